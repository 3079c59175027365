"""Derivatives of runs through sets of codimension two and three: friction in the plane.

Off a set the multiplier u = h/|h| moves with the state, du = (1 - u u^T) dh/|h|; on it lambda keeps h at
zero. The variational equation is integrated along the steps of the run by Gauss collocation, which stays
accurate where du is stiff: next to the set.

At a hit the derivatives by the time of the hit cancel: with h' = a - M lambda and B = df/dlambda

    dx+ = (1 + B M^-1 grad h) dx,

whatever the directions are from which neighbours come. At the end of sliding the field is continuous and
dx+ = dx. A set that is crossed exactly at h = 0 is a corner, where a run has no derivative.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from ..flow.trajectory import Event, Segment, Trajectory
from ..model import Array, DefinitionError, DegenerateError, FilippovSystem, explain
from ..model.layer import layer_evaluator
from .variation import Sensitivity

#: Nodes of the collocation on each step.
_NODES = 10

#: A matrix of friction this close to a multiple of 1 is one.
_ISOTROPIC = 1e-9


@lru_cache(maxsize=1)
def _gauss() -> tuple[Array, Array, Array]:
    """Nodes in (0, 1), and the integrals of Lagrange's polynomials up to each and up to 1."""
    nodes = 0.5 * (np.polynomial.legendre.leggauss(_NODES)[0] + 1.0)
    powers = np.vander(nodes, increasing=True)
    degrees = np.arange(1, _NODES + 1)
    upto = (nodes[:, None] ** degrees) / degrees
    inner, outer = np.linalg.solve(powers.T, upto.T).T, np.linalg.solve(powers.T, 1.0 / degrees)
    return nodes, np.asarray(inner), np.asarray(outer)


@dataclass(frozen=True, eq=False)
class _At:
    """Field f, switching functions h and their rates G at a state and multipliers, with derivatives."""

    f: Array
    f_x: Array
    f_l: Array
    f_p: Array
    h: Array
    h_x: Array
    h_p: Array
    g: Array
    g_x: Array
    g_l: Array
    g_p: Array


class Variation:
    """The variational equation of a system whose switches are sets.

    Parameters
    ----------
    system : FilippovSystem
    p : ndarray
    chosen : sequence of int
        Parameters by which is differentiated.
    """

    def __init__(self, system: FilippovSystem, p: Array, chosen: Sequence[int]):
        if len(system.sets) != len(system.entries) or system.impacts:
            raise DefinitionError(
                explain(
                    "system",
                    expected="one with sets of codimension two or three, or one with surfaces, here",
                    received=repr(system),
                    advice="Derivatives of runs that meet both are not available.",
                )
            )
        self.system, self.p, self.chosen = system, p, list(chosen)
        self._m = system.surface_count

        self._evaluate = layer_evaluator(system)

    def at(self, x: Array, lam: Array) -> _At:
        """Evaluate at an extended state and multipliers."""
        found = self._evaluate.copied(np.concatenate([x, lam]), self.p)
        f, f_x, f_l, f_p, h, h_x, h_p, g, g_x, g_l, g_p = found
        c = self.chosen
        return _At(
            *(f.ravel(), f_x, f_l, f_p[:, c], h.ravel(), h_x, h_p[:, c]),
            *(g.ravel(), g_x, g_l, g_p[:, c]),
        )

    def moving(self, mode: str, x: Array, slip: Array | None = None) -> tuple[_At, Array, Array]:
        """Values at a state of a mode, with the derivatives of the multipliers by states and parameters.

        ``slip`` is h with all its digits, where it is known.
        """
        off = [s for s in self.system.sets if mode[self._entry(s)] == "*"]
        on = [i for s in self.system.sets if s not in off for i in s]
        lam, n = np.zeros(self._m), len(x)
        here = self.at(x, lam)
        by_state, by_p = np.zeros((self._m, n)), np.zeros((self._m, len(self.chosen)))
        for s in off:
            own = list(s)
            h = here.h[own] if slip is None else slip[own]
            r = math.hypot(*h)
            with np.errstate(divide="ignore", invalid="ignore"):
                lam[own] = u = h / r
                turn = (np.eye(len(own)) - np.outer(u, u)) / r
            by_state[own], by_p[own] = turn @ here.h_x[own], turn @ here.h_p[own]
        here = self.at(x, lam)
        if on:
            lam[on] = -np.linalg.solve(here.g_l[np.ix_(on, on)], here.g[on])
            here = self.at(x, lam)
            slope = here.g_l[np.ix_(on, on)]
            by_state[on] = -np.linalg.solve(slope, here.g_x[on] + here.g_l[on] @ by_state)
            by_p[on] = -np.linalg.solve(slope, here.g_p[on] + here.g_l[on] @ by_p)
        self.multipliers = lam
        return here, by_state, by_p

    def _entry(self, members: tuple[int, ...]) -> int:
        return self.system.entries.index(members)

    def across(
        self, mode: str, c: Array, dt: float, y: Array, leaving: tuple[int, ...] | None
    ) -> Array:
        """Carry derivatives (N, N + q) over a step with the Taylor coefficients c of the states."""
        nodes, inner, outer = _gauss()
        n, count = len(c), y.shape[1]
        slips = self._slips(c, leaving)
        matrix, right = np.eye(_NODES * n), np.zeros((_NODES * n, count))
        for i, node in enumerate(nodes):
            powers = (node * dt) ** np.arange(c.shape[1])
            slip = None if slips is None else slips @ powers
            here, by_state, by_p = self.moving(mode, c @ powers, slip)
            jacobian = here.f_x + here.f_l @ by_state
            rows = slice(i * n, (i + 1) * n)
            for j in range(_NODES):
                matrix[rows, j * n : (j + 1) * n] -= dt * inner[i, j] * jacobian
            right[rows] = jacobian @ y
            right[rows, n:] += here.f_p + here.f_l @ by_p
        if not np.all(np.isfinite(matrix)):
            return np.full_like(y, np.nan)
        rates = np.linalg.solve(matrix, right).reshape(_NODES, n, count)
        return np.asarray(y + dt * np.tensordot(outer, rates, 1))

    def _slips(self, c: Array, leaving: tuple[int, ...] | None) -> Array | None:
        """Series of all h where a set is left, without the rounding of its first two coefficients."""
        if leaving is None:
            return None
        here = self.at(c[:, 0], np.zeros(self._m))
        series = here.h_x @ c
        series[:, 0] = here.h
        series[list(leaving), :2] = 0.0
        return np.asarray(series)

    def hit(self, mode: str, members: tuple[int, ...], x: Array, y: Array) -> Array:
        """Derivatives after a set is reached, from those just before; ``mode`` is that after."""
        here, _, _ = self.moving(mode, x)
        on = [i for s in self.system.sets if mode[self._entry(s)] == "s" or s == members for i in s]
        n = len(x)
        miss = here.h_x[on] @ y
        miss[:, n:] += here.h_p[on]
        back = np.linalg.solve(here.g_l[np.ix_(on, on)], miss)
        return np.asarray(y - here.f_l[:, on] @ back)

    def time_of_hit(self, mode: str, members: tuple[int, ...], x: Array, y: Array) -> Array:
        """Derivatives of the time at which a set is reached, from close by; NaN if M is anisotropic."""
        here, _, _ = self.moving(mode, x)
        own = list(members)
        u, m = self.multipliers[own], -here.g_l[np.ix_(own, own)]
        c = float(np.trace(m)) / len(own)
        if np.abs(m - c * np.eye(len(own))).max() > _ISOTROPIC * c:
            return np.full(y.shape[1], np.nan)
        a = here.g[own] + m @ u
        dh = here.h_x[own] @ y
        dh[:, len(x) :] += here.h_p[own]
        return np.asarray((c * u + a) @ dh / (c * c - a @ a))

    def time_of_exit(self, members: tuple[int, ...], mode: str, x: Array, y: Array) -> Array:
        """Derivatives of the time at which |lambda| reaches 1."""
        here, by_state, by_p = self.moving(mode, x)
        own, n = list(members), len(x)
        lam = self.multipliers[own]
        g_x, g_p = lam @ by_state[own], lam @ by_p[own]
        change = g_x @ y
        change[n:] += g_p
        return np.asarray(-change / (g_x @ here.f))


def set_sensitivity(run: Trajectory, names: Sequence[str]) -> Sensitivity:
    """Derivatives of a run of a system with sets; as ``nonsmooth.sensitivity``.

    Raises
    ------
    DegenerateError
        A set that is crossed exactly, a start that leaves one, a reset.
    DefinitionError
        A system with surfaces too.
    """
    system = run.system
    p = system.parameter_vector(run.parameters)
    chosen = [system.parameter_names.index(name) for name in names]
    law = Variation(system, p, chosen)
    n, size = system.dimension, system.extended_dimension
    y = np.concatenate([np.eye(size), np.zeros((size, len(chosen)))], axis=1)
    events = [e for e in run.events if e.kind not in ("stop", "end")]
    bad = next((e for e in events if e.kind not in ("entry", "exit")), None)
    if bad is not None:
        raise DegenerateError(
            f"run: expected hits of sets and ends of sliding only, received {bad.kind!r} at "
            f"t = {bad.t:.10g}. A set that is crossed exactly is a corner: perturb the start."
        )
    times, rows = list[float](), list[Array]()
    for k, segment in enumerate(run.segments):
        before = run.segments[k - 1].mode if k else None
        y, more = _over(run, law, segment, before, y)
        rows += more
        times += [e.t for e in events[len(times) : len(times) + len(more)]]
    by_time = np.array(rows).reshape(len(rows), y.shape[1])
    end, dt = _ended(run, law, y)
    keep = np.r_[0:n, size : size + len(chosen)]
    y, by_time, dt = end[:n, keep], by_time[:, keep], dt[keep]
    return Sensitivity(
        dx_dx0=y[:, :n],
        dx_dp=y[:, n:],
        event_times=np.array(times),
        dt_dx0=by_time[:, :n],
        dt_dp=by_time[:, n:],
        dt_end_dx0=dt[:n],
        dt_end_dp=dt[n:],
        names=tuple(names),
        run=run,
    )


def _changed(system: FilippovSystem, before: str, after: str) -> list[tuple[int, ...]]:
    return [s for k, s in enumerate(system.entries) if before[k] != after[k]]


def _over(
    run: Trajectory, law: Variation, segment: Segment, before: str | None, y: Array
) -> tuple[Array, list[Array]]:
    """Carry derivatives through the event before a stretch of steps, and over the steps."""
    system, steps, mode = run.system, run.steps, segment.mode
    first, rows = _extended(run, segment.first), list[Array]()
    leaving: tuple[int, ...] | None = None
    if before is None:
        on = [s for k, s in enumerate(system.entries) if mode[k] == "s"]
        for s in on:
            y = law.hit(mode, s, first, y)
        h = law.at(first, np.zeros(system.surface_count)).h
        for k, s in enumerate(system.entries):
            if mode[k] == "*" and not h[list(s)].any():
                raise DegenerateError(
                    "run: expected a start off the sets that it leaves, received one on h = 0. "
                    "Neighbours leave from elsewhere: start a little later."
                )
    else:
        for s in _changed(system, before, mode):
            if mode[system.entries.index(s)] == "s":
                near = _extended(run, segment.first - 1)
                rows.append(law.time_of_hit(before, s, near, y))
                y = law.hit(mode, s, first, y)
            else:
                rows.append(law.time_of_exit(s, before, first, y))
                leaving = s
    edges = [*steps.starts[segment.first : segment.last].tolist(), segment.t_end]
    for k, (a, b) in enumerate(pairwise(edges), segment.first):
        c = np.asarray(steps.coefficients[k])
        # Up to a hit rounding may leave no slip: what is lost there the hit takes away anyway.
        moved = law.across(mode, c, b - a, y, leaving) if b > a else y
        y, leaving = moved if np.all(np.isfinite(moved)) else y, None
    return y, rows


def _extended(run: Trajectory, k: int) -> Array:
    """State at the start of a step."""
    return np.asarray(run.steps.coefficients[k][:, 0])


def _ended(run: Trajectory, law: Variation, y: Array) -> tuple[Array, Array]:
    """Derivatives of the end, and of its time where a stop is met."""
    stops = [e for e in run.events if e.kind == "stop"]
    if not stops:
        return y, np.zeros(y.shape[1])
    system, last = run.system, run.segments[-1]
    x = run.x[-1] if not system.time_dependent else np.append(run.x[-1], run.t[-1])
    here, _, _ = law.moving(last.mode, x)
    function = system.definition.guards[_stop(system, stops[-1])]
    gradient = system.evaluate(
        system.gradient(function), run.x[-1], run.parameters, float(run.t[-1])
    ).ravel()
    change = gradient @ y
    by_p = system.evaluate(
        system.parameter_gradient(function), run.x[-1], run.parameters, float(run.t[-1])
    ).ravel()
    change[len(x) :] += by_p[law.chosen]
    dt = -change / (gradient @ here.f)
    return y + np.outer(here.f, dt), dt


def _stop(system: FilippovSystem, event: Event) -> int:
    return [name for name, _ in system.stops].index(event.name)
