"""Functions of a system called with numbers: values, projections, jumps."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..definition.system import FilippovSystem
from ..values import Array


class Evaluator:
    """A CasADi function called without conversions: preallocated inputs and outputs.

    Two threads at once may use ``copied`` only.

    Parameters
    ----------
    function : casadi.Function
        Two dense inputs (x, p), dense outputs.
    """

    def __init__(self, function: ca.Function):
        self._buffer, self._run = function.buffer()
        self._lock = threading.Lock()
        self._x = np.zeros(function.numel_in(0))
        self._p = np.zeros(function.numel_in(1))
        self.outputs: list[NDArray[np.float64]] = [
            np.zeros(function.size_out(k), order="F") for k in range(function.n_out())
        ]
        for k, value in enumerate((self._x, self._p)):
            if value.size:
                self._buffer.set_arg(k, value.data)
        for k, result in enumerate(self.outputs):
            if result.size:
                self._buffer.set_res(k, result.reshape(-1, order="F").data)

    def __call__(self, x: Array, p: Array) -> list[Array]:
        """Evaluate; the returned arrays are overwritten by the next call."""
        self._x[:] = x
        self._p[:] = p
        self._run()
        return self.outputs

    def copied(self, x: Array, p: Array) -> list[Array]:
        """Evaluate to arrays that are the caller's, from any thread."""
        with self._lock:
            return [np.array(output) for output in self(x, p)]


class Surfaces:
    """Values and state gradients of all switching functions; projection onto them.

    The gaps of impacts follow the surfaces, and then the rates of the gaps.
    """

    def __init__(self, system: FilippovSystem):
        self.system = system

    def values(self, x: Array, p: Array) -> tuple[Array, Array]:
        """Return h (m,) and its gradient with respect to the extended state (m, N)."""
        if not self.system.surface_count and not self.system.impacts:
            return np.zeros(0), np.zeros((0, x.size))
        d, states = self.system.definition, self.system.extended_states
        every = lambda: ca.vertcat(d.open_surfaces, d.gaps, d.gap_rates)
        build = lambda: [every(), ca.jacobian(every(), states)]
        h, gradient = evaluator(self.system, "surfaces", build).copied(x, p)
        return h.ravel(), gradient

    def project(
        self,
        x: Array,
        p: Array,
        which: Sequence[int],
        level: float | Array = 0.0,
        iterations: int = 3,
    ) -> Array:
        """Move the states (not the time) onto h_i = level by least-norm Newton steps.

        ``level`` is one number or one for each of ``which``.
        """
        n, chosen = self.system.dimension, list(which)
        for _ in range(iterations if chosen else 0):
            h, gradient = self.values(x, p)
            miss = h[chosen] - level
            if not np.any(miss):
                break
            step = np.linalg.lstsq(gradient[chosen, :n], miss, rcond=None)[0]
            x = x.copy()
            x[:n] -= step
        return x


def evaluator(
    system: FilippovSystem,
    key: Hashable,
    build: Callable[[], Sequence[ca.SX]],
    states: ca.SX | None = None,
) -> Evaluator:
    """Return the evaluator of ``system.function(key, build, states)``, made once per system."""
    made = lambda: Evaluator(system.function(key, build, states))
    return system.cached(("evaluator", key), made)
