"""One Taylor step of one mode: jets, step size, guards, end state.

The order follows from the tolerance and the step from the last two coefficients (Jorba & Zou
2005); the guards' own series bound the step too, so that their roots are as accurate as the state.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model import Array, Evaluator, FilippovSystem, Guard, Motion, motion
from .polynomial import first_crossing, first_root, passed, side_before

EPSILON = float(np.finfo(float).eps)

#: Two events closer than this, relative to the time, and than the rounding of their roots, are
#: simultaneous; a stop is then served first.
_TIE = 8 * EPSILON

#: Rounding in a polynomial, relative to the sum of the magnitudes of its terms.
_ROOT_ROUNDING = 16 * EPSILON

#: A point is on a surface where h is zero to this many roundings of its terms.
ON_SURFACE = 16

#: Local errors add up over a run; a twentieth keeps the global error near the tolerance.
_SAFETY = 0.05

#: The last terms of a guard's series stay below this part of all of them, however small the guard is
#: beside the tolerance: beyond its circle of convergence a polynomial has roots that the guard has not.
_RESOLVED = 1e-3

#: A defect this many times the local tolerance is no truncation error.
_WRONG = 1e3

#: So many steps that had to be shortened for their defect, most of them in a row, are an end.
_SHORTENED = 40

#: An event at the end of a domain may lie beyond it by rounding; the field is looked at just before.
_JUST = 1 - 1e-9

_PRIORITY = {"stop": 0, "reset": 1, "surface": 2, "exit": 3, "branch": 4}


def order_for(tolerance: float) -> int:
    """Order of the Taylor method for a local tolerance.

    A fifth above the optimum of Jorba & Zou (2005, eq. 3-7; 0.5 there), which counts the work of the
    series only: guards, roots and step size cost as much, and are paid by the step.
    """
    return max(6, math.ceil(-0.6 * math.log(tolerance)) + 1)


@dataclass(frozen=True)
class Expansion:
    """Jets at a point: state coefficients (N, P+1), guard coefficients (m, P+1), guard scales.

    ``scales`` is sum_i |d guard/d x_i| (1 + |x_i|): rounding in a guard is that times epsilon.
    """

    mode: str
    states: Array
    guards: Array
    scales: Array
    gradient: Array
    finite: bool


def rounding_scale(gradient: Array, x: Array) -> Array:
    """``sum_i |d guard/d x_i| (1 + |x_i|)``: rounding in a guard is that times epsilon.

    Entries that are not finite, those of a square root at zero, say nothing and are left out.
    """
    return _finite(gradient) @ (1.0 + np.abs(x))


#: Signs of stops and resets by kind and index.
Sides = dict[tuple[str, int], int]


@dataclass(frozen=True)
class Hit:
    """A guard that fell through zero at time ``dt`` after the step's start."""

    dt: float
    number: int
    guard: Guard


class Stepper:
    """Evaluates modes of one system with fixed parameters and tolerances.

    Parameters
    ----------
    system : FilippovSystem
    p : ndarray
        Parameter values.
    rtol, atol : float
        The local error of state i is kept below ``atol + rtol*abs(x_i)``.
    motion_of : callable, optional
        Where the motion of a mode comes from.
    """

    def __init__(
        self,
        system: FilippovSystem,
        p: Array,
        rtol: float,
        atol: float,
        motion_of: Callable[[FilippovSystem, str], Motion] = motion,
    ):
        self.system, self.p = system, p
        self._motion_of = motion_of
        self.rtol, self.atol = rtol, atol
        self.order = order_for(_SAFETY * min(rtol, atol))
        self._jets: dict[str, tuple[Evaluator, Evaluator]] = {}
        self._fields: dict[str, Evaluator | None] = {}
        self._shortened = 0.0

    def guards(self, mode: str) -> tuple[Guard, ...]:
        """Return the guards of a mode, in the order of the rows of its expansion."""
        return self._motion_of(self.system, mode).guards

    def expand(self, mode: str, x: Array) -> Expansion:
        """Jets of a mode at x (extended state); a fresh copy."""
        if mode not in self._jets:
            m = self._motion_of(self.system, mode)
            self._jets[mode] = (
                Evaluator(m.jet_function(self.order)),
                Evaluator(m.gradient_function()),
            )
        jets, gradients = self._jets[mode]
        states, guards = (np.array(a) for a in jets(x, self.p))
        gradient = np.abs(gradients(x, self.p)[0])
        finite = bool(np.all(np.isfinite(states)) and np.all(np.isfinite(guards)))
        return Expansion(mode, states, guards, rounding_scale(gradient, x), gradient, finite)

    def step_size(self, e: Expansion) -> float:
        """Step for which the last two terms of states and guards stay below the tolerances."""
        moves = np.ones(e.states.shape[0], dtype=bool)
        if self.system.time_dependent:
            moves[self.system.dimension] = False  # time is exact
        allowed = _SAFETY * moves * (self.atol + self.rtol * np.abs(e.states[:, 0]))
        h = _bound(e.states[moves], allowed[moves], self.order)
        if e.guards.size:
            # A guard without gradient here (a double zero) has no yardstick of its own.
            guard_allowed = e.gradient @ allowed + self.rtol * np.abs(e.guards[:, 0])
            known = guard_allowed > 0
            h = min(h, _bound(e.guards[known], guard_allowed[known], self.order))
            small = ~known | (guard_allowed > _RESOLVED * np.abs(e.guards[:, 0]))
            for g in e.guards[small]:  # elsewhere the bound above is the stronger one
                h = _resolved(np.abs(g), h)
        return h

    def leading(self, e: Expansion, row: int, known_zeros: int) -> tuple[int, float]:
        """First coefficient of a guard that is not zero to rounding, and its value.

        Returns ``(order + 1, 0.0)`` if there is none.
        """
        speed = np.abs(e.states).max(axis=0)
        steepness = float(e.gradient[row].sum())  # infinite at a power law's zero
        for k in range(known_zeros, e.guards.shape[1]):
            noise = e.scales[row] if k == 0 else steepness * float(speed[k]) * (k + 1)
            if abs(e.guards[row, k]) > 64 * EPSILON * noise:
                return k, float(e.guards[row, k])
        return e.guards.shape[1], 0.0

    def sides(self, e: Expansion, dt: float) -> Sides:
        """Signs of stops and resets just before the end of a step, where they are clear."""
        result: Sides = {}
        for row, guard in enumerate(self.guards(e.mode)):
            if guard.kind in ("stop", "reset"):
                rounding = ON_SURFACE * EPSILON * float(e.scales[row])
                result[guard.kind, guard.index] = side_before(e.guards[row].tolist(), dt, rounding)
        return result

    def first_hit(
        self,
        e: Expansion,
        h: float,
        drops: dict[int, int],
        t: float,
        repelling: bool = False,
        sides: Sides | None = None,
    ) -> Hit | None:
        """Earliest guard to end the mode within h; ``drops[row]`` leading coefficients are zero.

        In repelling sliding the exit guards are negative, and rise to zero where it ends. ``sides``
        are those just before the step: a stop or a reset may be passed at its start, where rounding
        hid it from the step before.
        """
        if repelling:
            exits = [guard.kind == "exit" for guard in self.guards(e.mode)]
            e = replace(e, guards=np.where(np.array(exits)[:, None], -e.guards, e.guards))
        hits = []
        for row, guard in enumerate(self.guards(e.mode)):
            c = e.guards[row, drops.get(row, 0) :]
            dropped = drops.get(row, 0)
            side = sides.get((guard.kind, guard.index), 0) if sides and not dropped else 0
            at_once = side and passed(c.tolist(), side, guard.side)
            dt = 0.0 if at_once else self._root(e, row, guard, c, h, dropped)
            if dt is not None:
                hits.append(Hit(dt, row, guard))
        if not hits:
            return None
        first = min(hits, key=lambda hit: hit.dt)
        if len(hits) == 1:
            return first
        blur = [_blur(e.guards[hit.number], hit.dt) for hit in hits]
        near = first.dt + _TIE * max(1.0, abs(t)) + blur[hits.index(first)]
        tied = [hit for hit, own in zip(hits, blur, strict=True) if hit.dt <= near + own]
        return min(tied, key=lambda hit: (_PRIORITY[hit.guard.kind], hit.dt))

    def _root(
        self, e: Expansion, row: int, guard: Guard, c: Array, h: float, dropped: int
    ) -> float | None:
        if guard.kind in ("stop", "reset"):
            return first_crossing(c.tolist(), h, guard.side)
        if c.size and c[0] <= 0.0:
            # Rounding can put a state that has just left a surface on the wrong side of it.
            k, value = self.leading(e, row, dropped)
            if value == 0.0:
                return None
            c = e.guards[row, k:]
        return first_root(c.tolist(), h) if c.size else None

    @staticmethod
    def advance(e: Expansion, dt: float) -> Array:
        """State after dt, by Horner's rule."""
        value = e.states[:, -1].copy()
        for k in range(e.states.shape[1] - 2, -1, -1):
            value *= dt
            value += e.states[:, k]
        return value

    def reach(self, e: Expansion, dt: float, sign: float = 1.0) -> float | None:
        """Longest of dt, dt/2, dt/4, ... at whose end the polynomial satisfies the equation.

        Looked at only where the field has a branch point, which a polynomial may pass unseen.

        Returns
        -------
        float or None
            None after many steps in a row that had to be shortened: the run is at the branch point.
        """
        if e.mode not in self._fields:
            m = self._motion_of(self.system, e.mode)
            self._fields[e.mode] = Evaluator(m.field_function()) if m.branches else None
        field = self._fields[e.mode]
        if field is None:
            return dt
        wanted = dt
        while not self._satisfies(e, field, dt * _JUST, sign):
            dt *= 0.5
        self._shortened = max(0.0, self._shortened + (1.0 if dt < wanted else -0.2))
        return dt if self._shortened < _SHORTENED else None

    def _satisfies(self, e: Expansion, field: Evaluator, dt: float, sign: float) -> bool:
        c = e.states
        allowed = _WRONG * _SAFETY * (self.atol + self.rtol * np.abs(c[:, 0]))
        slope = sign * field(self.advance(e, dt), self.p)[0][:, 0]
        defect = slope - c[:, 1:] @ (np.arange(1, c.shape[1]) * _powers(dt, c.shape[1] - 1))
        return bool(np.all(np.abs(defect) * dt <= allowed))

    def singular_step(self, e: Expansion, h_max: float) -> tuple[Array, float]:
        """Short step from a point where high derivatives do not exist (a power law at zero).

        Each state keeps the coefficients before its first non-finite one; the step is shortened
        until the defect of the equation at its end is below the tolerance.

        Returns
        -------
        coefficients (N, P+1), h; h is 0 where not even the field is finite.
        """
        c = e.states.copy()
        for row in c:
            bad = np.flatnonzero(~np.isfinite(row))
            row[bad[0] if bad.size else row.size :] = 0.0
            if bad.size and bad[0] < 2:
                return c, 0.0
        allowed = self.atol + self.rtol * np.abs(c[:, 0])
        kept = Expansion(e.mode, c, e.guards, e.scales, e.gradient, True)
        h = min(h_max, 1e-3)
        while h > 1e-15:
            end = self.advance(kept, h)
            there = self.expand(e.mode, end)
            slope = there.states[:, 1]
            defect = np.abs(
                slope - c[:, 1:] @ (np.arange(1, c.shape[1]) * _powers(h, c.shape[1] - 1))
            )
            # Guards are not located within this step: none may fall in it, and what leaves zero at
            # a rate must do so at that rate, however far below the tolerance.
            crossed = np.sign(there.guards[:, 0]) * np.sign(e.guards[:, 0]) < 0
            wrong = _finite(there.gradient) @ defect > 1e-2 * np.abs(_finite(e.guards[:, 1]))
            fits = np.all(np.isfinite(slope)) and np.all(defect * h <= allowed)
            if fits and not np.any(crossed) and not np.any(wrong & _leaves_zero(e)):
                return c, h
            h *= 0.25
        return c, 0.0


def _blur(c: Array, dt: float) -> float:
    """How far rounding in a guard moves its root; nothing where it has no slope."""
    powers = _powers(dt, c.size)
    slope = abs(float(c[1:] @ (np.arange(1, c.size) * powers[:-1])))
    noise = _ROOT_ROUNDING * float(np.abs(c) @ powers)
    return noise / slope if noise < 1e-9 * dt * slope else 0.0


def _finite(a: Array) -> Array:
    return np.where(np.isfinite(a), a, 0.0)


def _leaves_zero(e: Expansion) -> NDArray[np.bool_]:
    """Guards that are zero to rounding and change at a rate."""
    rate = e.guards[:, 1]
    zero = np.abs(e.guards[:, 0]) <= 64 * EPSILON * e.scales
    return zero & np.isfinite(rate) & (rate != 0.0)


def _powers(h: float, count: int) -> Array:
    return np.asarray(h ** np.arange(count), float)


def _resolved(g: Array, h: float) -> float:
    """Shorten a step until a guard's series, given in magnitudes, converges within it."""
    while math.isfinite(h):
        with np.errstate(over="ignore"):
            terms = g * _powers(h, g.size)
            last, rest = float(terms[-2:].max()), _RESOLVED * float(terms[:-2].sum())
        if last <= rest or not 0.0 < rest < math.inf:
            break
        h *= 0.99 * (rest / last) ** (1.0 / (g.size - 2))
    return h


def _bound(c: Array, allowed: Array, order: int) -> float:
    if not c.size:
        return math.inf
    with np.errstate(over="ignore"):  # infinite ratios give a step of zero
        last = float((np.abs(c[:, order]) / allowed).max())
        before = float((np.abs(c[:, order - 1]) / allowed).max())
    h = math.inf if last == 0.0 else last ** (-1.0 / order)
    return h if before == 0.0 else min(h, before ** (-1.0 / (order - 1)))
