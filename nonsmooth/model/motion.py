"""The smooth motion of one mode: its field, its guards, and their jets as fast functions.

A guard is a function that is positive inside the mode; the mode ends where it falls through zero:

- ``surface``: s_i h_i for a surface that does not slide (s_i = +1 or -1);
- ``exit``: -L_{F+} h_i and L_{F-} h_i for the one that slides. They vanish where sliding stops
  being attracting; the ratio alpha is never used, because it is 0/0 at a two-fold.

Stops and resets follow the guards as they were given; their direction is the driver's business.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .cancel import cancel_common_factor
from .errors import DefinitionError
from .jets import taylor
from .system import Array, FilippovSystem, read_function


@dataclass(frozen=True)
class Guard:
    """What the zero of one event function means.

    Attributes
    ----------
    kind : {"surface", "exit", "stop", "reset"}
    index : int
        Of the surface, stop or reset.
    side : int
        For an exit the side, +1 or -1, to which the motion leaves; for a surface the side on which
        the motion is; for stops and resets the direction.
    name : str
    """

    kind: str
    index: int
    side: int
    name: str


class Motion:
    """Field, guards and jets of one mode of a system.

    Parameters
    ----------
    system : FilippovSystem
    mode : str
        One letter for each surface, at most one ``s``.
    """

    def __init__(self, system: FilippovSystem, mode: str):
        self.system, self.mode = system, mode
        self.signs = system.parse_mode(mode)
        sliding = [i for i, s in enumerate(self.signs) if s == 0]
        if len(sliding) > 1:
            raise DefinitionError(
                f"mode {mode!r}: expected at most one sliding surface, received {len(sliding)}. "
                "Sliding on an intersection of surfaces is not built yet."
            )
        self.sliding = sliding[0] if sliding else None
        self.cancelled = False
        self._key: tuple[object, ...] = ()
        self.field = self._sliding_field() if sliding else system.field(mode)
        self.guards, self.functions = self._guards()

    def _with_side(self, side: int) -> str:
        assert self.sliding is not None
        letters = list(self.mode)
        letters[self.sliding] = "+" if side > 0 else "-"
        return "".join(letters)

    def _sliding_field(self) -> ca.SX:
        """F0 - (a/b) G with the common factor of G and b cancelled (Filippov 1988, sec. 4)."""
        system, i = self.system, self.sliding
        assert i is not None
        multipliers = ca.SX([float(s) for s in self.signs])
        lam = ca.SX.sym("lambda")
        multipliers[i] = lam
        field = system.field_with(multipliers)
        middle = ca.substitute(field, lam, 0)
        difference = ca.jacobian(field, lam)
        gradient = ca.jacobian(system.surface_function(i), system.extended_states)
        a = ca.simplify(ca.mtimes(gradient, middle))
        entries = ca.vertsplit(ca.densify(difference))
        # A factor of G is one of b = grad h . G too, and there it may no longer be in sight.
        reduced, factor = cancel_common_factor(
            entries, system.extended_states, system.parameter_symbols
        )
        self.cancelled = bool(ca.depends_on(factor, system.extended_states))
        b = ca.simplify(ca.mtimes(gradient, ca.vertcat(*reduced)))
        return middle - (a / b) * ca.vertcat(*reduced)

    def _guards(self) -> tuple[tuple[Guard, ...], ca.SX]:
        system = self.system
        guards: list[Guard] = []
        functions: list[ca.SX] = []
        for i, sign in enumerate(self.signs):
            if sign:
                guards.append(Guard("surface", i, sign, f"h{i}"))
                functions.append(sign * system.surface_function(i))
                continue
            for side in (1, -1):
                guards.append(Guard("exit", i, side, "L_F1 h" if side > 0 else "L_F2 h"))
                functions.append(-side * system.lie_derivative([self._with_side(side)], i))
        for j, (name, direction) in enumerate(system.stops):
            guards.append(Guard("stop", j, direction, name))
            functions.append(system._guards[j])
        for j, (name, direction) in enumerate(system.resets):
            guards.append(Guard("reset", j, direction, name))
            functions.append(system._guards[len(system.stops) + j])
        return tuple(guards), ca.densify(ca.vertcat(*functions)) if functions else ca.SX(0, 1)

    def jet_function(self, order: int) -> ca.Function:
        """Return (x, p) -> jets of states (N, order+1) and of guard functions (m, order+1)."""
        system = self.system

        def build() -> Sequence[ca.SX]:
            return taylor(
                self.field, self.functions, system.extended_states, system.parameter_symbols, order
            )

        return system.function(("jet", self.mode, order, *self._key), build)

    def gradient_function(self) -> ca.Function:
        """Return (x, p) -> gradients of the guard functions (m, N), the yardstick of rounding."""
        system = self.system

        def build() -> Sequence[ca.SX]:
            return [ca.jacobian(self.functions, system.extended_states)]

        return system.function(("gradient", self.mode, *self._key), build)


class Evaluator:
    """A CasADi function called without conversions: preallocated inputs and outputs.

    Not for use by two threads at once.

    Parameters
    ----------
    function : casadi.Function
        Two dense inputs (x, p), dense outputs.
    """

    def __init__(self, function: ca.Function):
        self._buffer, self._run = function.buffer()
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


class Followed(Motion):
    """A mode whose functions are only watched: its guards' and further ones, all of kind "zero".

    Parameters
    ----------
    system : FilippovSystem
    mode : str
    watched : sequence of SX scalars
        Functions of states, parameters and time, named ``f0``, ``f1``, ...
    """

    def __init__(self, system: FilippovSystem, mode: str, watched: Sequence[ca.SX]):
        super().__init__(system, mode)
        own = [Guard("zero", k, 0, g.name) for k, g in enumerate(self.guards)]
        more = [Guard("zero", len(own) + k, 0, f"f{k}") for k in range(len(watched))]
        expressions = [
            read_function(system, w, f"watched function {k}") for k, w in enumerate(watched)
        ]
        self.guards = (*own, *more)
        self.functions = ca.densify(ca.vertcat(self.functions, *expressions))
        inputs = [system.extended_states, system.parameter_symbols]
        content = ca.Function("watched", inputs, [ca.vertcat(*expressions)]).serialize()
        self._key = ("followed", hash(content)) if expressions else ()


class Surfaces:
    """Values and state gradients of all switching functions; projection onto them."""

    def __init__(self, system: FilippovSystem):
        self.system = system

        def build() -> Sequence[ca.SX]:
            h = ca.vertcat(*[system.surface_function(i) for i in range(system.surface_count)])
            return [h, ca.jacobian(h, system.extended_states)]

        self.evaluator = Evaluator(system.function("surfaces", build))

    def values(self, x: Array, p: Array) -> tuple[Array, Array]:
        """Return h (m,) and its gradient with respect to the extended state (m, N)."""
        if not self.system.surface_count:
            return np.zeros(0), np.zeros((0, x.size))
        h, gradient = self.evaluator(x, p)
        return np.array(h).ravel(), np.array(gradient)

    def project(
        self,
        x: Array,
        p: Array,
        which: Sequence[int],
        level: float = 0.0,
        iterations: int = 3,
    ) -> Array:
        """Move the states (not the time) onto h_i = level by least-norm Newton steps."""
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


class Resets:
    """The maps of a system's resets as one function of state and parameters."""

    def __init__(self, system: FilippovSystem):
        self.system = system
        self.function = system.function("resets", lambda: [system._maps])

    def apply(self, index: int, x: Array, p: Array) -> Array:
        """Return the state after reset ``index``; the time is kept."""
        after = x.copy()
        after[: self.system.dimension] = np.array(self.function(x, p))[:, index]
        return after


def motion(system: FilippovSystem, mode: str) -> Motion:
    """Return the motion of a mode, built once per system."""
    key = ("motion", mode)
    if key not in system._functions:
        system._functions[key] = Motion(system, mode)
    return system._functions[key]
