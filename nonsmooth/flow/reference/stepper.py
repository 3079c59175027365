"""One Taylor step of one mode: jets, step size, guards, end state.

The order follows from the tolerance and the step from the last two coefficients (Jorba & Zou
2005); the guards' own series bound the step too, so that their roots are as accurate as the state.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem, Guard
from .. import messages
from ..constants import (
    AT_END,
    BEFORE_EVENT,
    CHECKS,
    FAR,
    FIRST,
    GROWTH,
    JUST,
    OCTAVE,
    ON_SURFACE,
    PRIORITY,
    RESOLVED,
    ROOT_ROUNDING,
    SAFETY,
    SHORTENED,
    SHORTEST,
    STEADY,
    TIE,
    VANISHES,
    WRONG,
)
from ..options import Options
from .laws_of_sets import slip_root
from .modes import Expansion, Modes, powers
from .polynomial import first_crossing, first_root, passed, side_before

#: Signs of stops and resets by kind and index.
Sides = dict[tuple[str, int], int]


@dataclass(frozen=True)
class Hit:
    """A guard that fell through zero at time ``dt`` after the step's start."""

    dt: float
    number: int
    guard: Guard


@dataclass(frozen=True)
class Plan:
    """A step: how long, the hits at its end (or at most a tie later), whether it reaches t_end."""

    # ``fault`` says why there is none.

    dt: float
    hits: list[Hit]
    last: bool
    fault: str = ""


class Stepper:
    """Steps of one run: its modes, with fixed parameters and tolerances."""

    def __init__(self, system: FilippovSystem, modes: Modes, options: Options):
        self.system, self.modes = system, modes
        self.rtol, self.atol, self.size = options.rtol, options.atol, options.size
        self.order = options.order
        self._mode: str | None = None  # of the step before
        self._length = math.inf
        self._shortened, self._begun = 0.0, options.t_start

    def guards(self, mode: str) -> tuple[Guard, ...]:
        """Return the guards of a mode, in the order of the rows of its expansion."""
        return self.modes.guards(mode)

    def expand(self, mode: str, x: Array, unknowns: Array) -> Expansion:
        """Jets of a mode at x (extended state), with the multipliers of what slides."""
        return self.modes.expand(mode, x, unknowns)

    def step_size(self, e: Expansion) -> float:
        """Step for which the last two terms of states and guards stay below the tolerances."""
        moves = e.allowed > 0.0  # time is exact
        h = _bound(e.states[moves], e.allowed[moves], self.order)
        if e.guards.size:
            # A guard without gradient here (a double zero) has no error scale of its own.
            guard_allowed = e.guard_allowed + self.rtol * np.abs(e.guards[:, 0])
            known = guard_allowed > 0
            h = min(h, _bound(e.guards[known], guard_allowed[known], self.order))
            small = ~known | (guard_allowed > RESOLVED * np.abs(e.guards[:, 0]))
            for g in e.guards[small]:  # elsewhere the bound above is the stronger one
                h = _resolved(np.abs(g), h)
        if e.directions.size:
            h = min(h, _bound(e.directions, np.array([SAFETY * self.rtol]), self.order))
        return h

    def leading(self, e: Expansion, row: int, known_zeros: int) -> tuple[int, float]:
        """First coefficient of a guard that is not zero to rounding, and its value."""
        # Returns ``(order + 1, 0.0)`` if there is none.
        speed, steepness = np.abs(e.states).max(axis=0), float(e.steepness[row])
        for k in range(known_zeros, e.guards.shape[1]):
            noise = e.scales[row] if k == 0 else steepness * float(speed[k]) * (k + 1)
            if abs(e.guards[row, k]) > VANISHES * noise:
                return k, float(e.guards[row, k])
        return e.guards.shape[1], 0.0

    def sides(self, e: Expansion, dt: float) -> Sides:
        """Signs of stops and resets just before the end of a step, where they are clear."""
        result: Sides = {}
        for row, guard in enumerate(self.guards(e.mode)):
            if guard.kind in ("stop", "reset"):
                rounding = ON_SURFACE * float(e.scales[row])
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
        """Earliest guard to end the mode within h; ``drops[row]`` leading coefficients are zero."""
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
        near = first.dt + TIE * max(1.0, abs(t)) + blur[hits.index(first)]
        tied = [hit for hit, own in zip(hits, blur, strict=True) if hit.dt <= near + own]
        return min(tied, key=lambda hit: (PRIORITY[hit.guard.kind], hit.dt))

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
        dt = first_root(c.tolist(), h) if c.size else None
        if dt and guard.kind == "slip":  # squares lose digits where friction's limit is small
            return slip_root(e, self.system.sets, guard.index, dt, h)
        return dt

    @staticmethod
    def advance(e: Expansion, dt: float) -> Array:
        """State after dt, by Horner's rule."""
        value = e.states[:, -1].copy()
        with np.errstate(over="ignore", invalid="ignore"):  # the driver looks at the result
            for k in range(e.states.shape[1] - 2, -1, -1):
                value *= dt
                value += e.states[:, k]
        return value

    def plan(
        self,
        e: Expansion,
        left: float,
        max_step: float,
        t: float,
        find: Callable[[float], list[Hit]],
        sign: float = 1.0,
    ) -> Plan:
        """Choose the next step, up to the first of the hits that ``find`` sees within a step."""
        # ``left`` is the time to the end of the run; ``sign`` is that of the direction of time. The
        # step is halved until field and guards agree with the polynomials.
        by_series = self.step_size(e)
        h = min(by_series, max_step)
        if h <= SHORTEST * max(abs(t - self._begun), abs(t)) and h < left:
            often = self._shortened > SHORTENED / 10
            fault = messages.branch_point(t) if often else messages.step_too_small(h)
            return Plan(0.0, [], False, fault)
        last, h = h >= left, min(h, left)
        # What happens at the end, to rounding, happens.
        hits = find(h + AT_END * max(1.0, abs(t + sign * h)) if last else h)
        dt = wanted = min((*(hit.dt for hit in hits), h))
        safe = self._safe(e, by_series)
        while dt > 0.0:
            end = BEFORE_EVENT if hits and dt == wanted else JUST
            good = self._verified(e, dt, end, safe, sign)
            if good == dt:
                break
            dt = good
        held = dt > STEADY * self._length and (dt > self._length / STEADY or dt > wanted / FAR)
        shrinks = dt < wanted and not (e.mode == self._mode and held)
        self._shortened = max(0.0, self._shortened + (1.0 if shrinks else -0.2))
        self._mode, self._length = e.mode, h if dt == wanted else dt
        swallowed = dt < wanted and dt <= SHORTEST * abs(t)  # close to t = 0 steps may be tiny
        if self._shortened >= SHORTENED or swallowed:
            return Plan(0.0, [], False, messages.branch_point(t))
        if dt < wanted:
            return Plan(dt, [], False)
        return Plan(dt, hits, last and dt == h)

    def _safe(self, e: Expansion, h: float) -> float:
        """A length beyond which the step h that the series allows may not see what comes."""
        if self.modes.affine(e.mode):
            return math.inf
        if e.mode == self._mode:
            return self._length if h > GROWTH * self._length else math.inf
        with np.errstate(divide="ignore", over="ignore"):
            sizes = np.abs(e.states[:, 0]) + self.size
            natural = float((sizes / np.abs(e.states[:, 1])).min())
        return FIRST * natural if h > FAR * natural else math.inf

    def _verified(self, e: Expansion, dt: float, end: float, safe: float, sign: float) -> float:
        """Return dt where the polynomials of states and guards are those of the equation, as far
        as the part ``end`` of it and points inside show, else half of the first point where
        they are not."""
        # A solution may reach what its series does not see: a pulse, or the branch point of a root
        # (x' = -sqrt(x) is solved by a polynomial, but not beyond its zero).
        if self.modes.affine(e.mode):
            return dt
        for s in _points(dt, end, safe):
            if not self._agrees(e, s, dt, sign):
                return 0.5 * s if s > sys.float_info.min else 0.0
        return dt

    def _agrees(self, e: Expansion, s: float, dt: float, sign: float) -> bool:
        """Whether field and guards at a time s of a step dt are those of the polynomials."""
        with np.errstate(over="ignore", invalid="ignore"):
            found = [v.copy() for v in self.modes.at(e, s)]  # the next call overwrites them
            return self._is_near(e, s, dt, sign, found) or self._is_near(
                e, s, dt, sign, found, self._rounding(e, s, found)
            )

    def _is_near(
        self,
        e: Expansion,
        s: float,
        dt: float,
        sign: float,
        found: Sequence[Array],
        rounding: Sequence[Array] = (np.zeros(1),) * 3,
    ) -> bool:
        """Whether what was found at a time s is what the polynomials say, to ``rounding``."""
        (field, guards, drift), (of_field, of_guards, of_drift) = found, rounding
        degrees = np.arange(1, e.states.shape[1])
        powered = powers(s, e.states.shape[1])
        slope = e.states[:, 1:] @ (degrees * powered[:-1])
        defect = np.abs(sign * field - slope) * dt
        allowed = WRONG * e.allowed + dt * (VANISHES * np.abs(slope) + of_field)
        if not np.all(defect <= allowed):
            return False
        if not np.all(drift <= WRONG * SAFETY * self.rtol + VANISHES + of_drift):
            return False
        tolerated = e.guard_allowed + SAFETY * self.rtol * np.abs(e.guards[:, 0])
        miss = np.abs(guards - e.guards @ powered)
        return bool(np.all(miss <= WRONG * tolerated + VANISHES * e.scales + of_guards))

    def _rounding(self, e: Expansion, s: float, found: Sequence[Array]) -> list[Array]:
        """What rounding in the states, and in the time, makes of field, guards and multipliers at a time
        s: far from zero (a time of 1e9) it is more than any tolerance."""
        result = [np.zeros_like(v) for v in found]
        state = e.states @ powers(s, e.states.shape[1])
        for j in np.flatnonzero(state):
            nudge = np.zeros_like(state)
            nudge[j] = VANISHES * state[j]
            for total, value, moved in zip(result, found, self.modes.at(e, s, nudge), strict=True):
                total += np.abs(moved - value)
        return result

    def singular_step(self, e: Expansion, h_max: float) -> tuple[Array, float]:
        """Short step from a point where high derivatives do not exist (a power law at zero)."""
        # Each state keeps the coefficients before its first non-finite one; the step is shortened
        # until the defect of the equation at its end is below the tolerance.
        c = e.states.copy()
        for row in c:
            bad = np.flatnonzero(~np.isfinite(row))
            row[bad[0] if bad.size else row.size :] = 0.0
            if bad.size and bad[0] < 2:
                return c, 0.0
        allowed = e.allowed / SAFETY
        kept = replace(e, states=c, finite=True)
        unknowns = e.unknowns[:, 0] if e.unknowns.size else e.unknowns
        several = unknowns.size and (self.system.sets or {*e.mode} & {*"sc"})
        h = 0.0 if several else min(h_max, 1e-3)
        while h > 1e-15:
            end = self.advance(kept, h)
            there = self.expand(e.mode, end, unknowns)
            slope, rates = there.states[:, 1], c[:, 1:] * np.arange(1, c.shape[1])
            defect = np.abs(slope - rates @ powers(h, c.shape[1] - 1))
            # Guards are not located within this step: none may fall in it, and what leaves zero at
            # a rate must do so at that rate, however far below the tolerance.
            crossed = np.sign(there.guards[:, 0]) * np.sign(e.guards[:, 0]) < 0
            gradient = _finite(self.modes.gradient(e.mode, end))
            wrong = gradient @ defect > 1e-2 * np.abs(_finite(e.guards[:, 1]))
            fits = np.all(np.isfinite(slope)) and np.all(defect * h <= allowed)
            if fits and not np.any(crossed) and not np.any(wrong & _leaves_zero(e)):
                return c, h
            h *= 0.25
        return c, 0.0


def _points(dt: float, end: float, safe: float) -> Iterator[float]:
    """Times of a step at which it is looked at: octaves, if it is long, middle and end."""
    low = dt if math.isinf(safe) else 0.5 * dt
    while low > safe:
        low *= 0.5
    while low < dt:
        for k in range(OCTAVE):
            yield low * (1 + k / OCTAVE)
        low *= 2.0
    for k in range(1, CHECKS + 1):
        yield dt * k / (CHECKS + 1)
    yield end * dt


def _blur(c: Array, dt: float) -> float:
    """How far rounding in a guard moves its root; nothing where it has no slope."""
    powered = powers(dt, c.size)
    slope = abs(float(c[1:] @ (np.arange(1, c.size) * powered[:-1])))
    noise = ROOT_ROUNDING * float(np.abs(c) @ powered)
    return noise / slope if noise < 1e-9 * dt * slope else 0.0


def _finite(a: Array) -> Array:
    return np.where(np.isfinite(a), a, 0.0)


def _leaves_zero(e: Expansion) -> NDArray[np.bool_]:
    """Guards that are zero to rounding and change at a rate."""
    rate = e.guards[:, 1]
    zero = np.abs(e.guards[:, 0]) <= VANISHES * e.scales
    return zero & np.isfinite(rate) & (rate != 0.0)


def _resolved(g: Array, h: float) -> float:
    """Shorten a step until a guard's series, given in magnitudes, converges within it."""
    while math.isfinite(h):
        with np.errstate(over="ignore"):
            terms = g * powers(h, g.size)
            last, rest = float(terms[-2:].max()), RESOLVED * float(terms[:-2].sum())
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
