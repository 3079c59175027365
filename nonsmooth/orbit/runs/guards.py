"""Extrema of guards along a leg, and the guards that the leg violates.

Along a step a guard is a polynomial. Its extrema are roots of the derivative, so an itinerary is checked
without samples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...flow.fixed import LegsWatch, first_terms, passing
from ...flow.names import described, guard_name
from ...flow.variation import carry_legs, require_done
from ...model import Array, FilippovSystem, Guard
from ...model.derivatives.event_maps import is_due_at
from ...model.derivatives.variational import GuardedField, guarded_field, states_at
from .cell_field import CellField, Guarded, field_of
from .cells import cells_of
from .legs import Leg, integrate_leg, leg_name, rate_at

#: Part of a leg's duration beside its ends that belongs to the ends, where guards are zero.
_ENDS = 1e-6

#: Guards that change by less than this part of their size in a step are constant.
_CONSTANT = 1e-13

#: Newton steps to an extremum between two steps of the driver.
_REFINED = 4

#: Newton steps beside sets, where the direction of h turns ever faster.
_NEAR_SETS = 1e-4

#: Guards that are functions of conditions of events.
CONDITIONS = ("stop", "reset", "atom")

#: A guard is negative below this part of its scale.
_NEGATIVE = 1e-9


@dataclass(frozen=True)
class Approach:
    """A guard's extremum inside a leg that comes nearest to zero."""

    guard: Guard
    t: float
    value: float
    distance: float


@dataclass(frozen=True)
class Watch:
    """Extrema of the guards inside a leg, and violations."""

    approaches: list[Approach]
    violations: list[str]


def watch(system: FilippovSystem, leg: Leg, x: Array, duration: float, p: Array) -> Watch:
    """Find the extrema of all guards inside a leg, and the violations."""
    guards = LegGuards(system, [leg])
    ((rows,), _, _), (field,) = guards(x[None], p, np.array([duration])), guards.fields
    return Watch(_approaches(field, rows, p), _violations_along(field, rows, p))


def is_active(field: Guarded, row: Array, p: Array) -> bool:
    """Whether an event is due where the guard of a row of ``LegsWatch`` passes zero."""
    guard, system = field.motion.guards[int(row[0])], field.motion.system
    if guard.kind not in CONDITIONS:
        return True
    return is_due_at(system, guard, row[4 : 4 + system.extended_dimension], p)


def _approaches(field: Guarded, rows: Array, p: Array) -> list[Approach]:
    """Extrema at which guards come near to zero."""
    guards, found = field.motion.guards, list[Approach]()
    for row in rows:
        guard, (t, value, bend) = guards[int(row[0])], row[1:4].tolist()
        if bend and (bend > 0.0 or guard.kind in CONDITIONS) and is_active(field, row, p):
            slope = field.gradients.copied(row[4:], p)[0][int(row[0])]
            size = math.sqrt(float(slope @ slope))
            if size > 0.0:
                found.append(Approach(guard, t, value, value / size))
    return found


class LegGuards:
    """The guards of consecutive legs, evaluated repeatedly."""

    def __init__(self, system: FilippovSystem, legs: Sequence[Leg]):
        self.fields = [field_of(system, leg.mode) for leg in legs]
        self._cells, cells = [f for f in self.fields if isinstance(f, CellField)], cells_of(system)
        self._system, self._legs = cells.system, [cells.leg(leg) for leg in legs]
        self._driven = [guarded_field(cells.system, leg.mode) for leg in self._legs]
        self._explicit = all(field.entries == system.extended_dimension for field in self._driven)
        self._limits = [i for i, leg in enumerate(legs) if leg.repeats]
        self._watch = None if system.sets else LegsWatch(self._driven)

    def __call__(
        self, starts: Array, p: Array, durations: Array
    ) -> tuple[list[Array], list[Array], list[Array]]:
        """As of LegsWatch; legs of no positive duration have no inside, nor have those of infinitely many events."""
        if self._limits:
            durations = durations.copy()
            durations[self._limits] = 0.0
        if not self._cells:
            return self._watched(starts, np.broadcast_to(p, (len(starts), p.size)), durations)
        own = np.array([field.parameters(p) for field in self._cells])
        rows, begins, values = self._watched(starts, own, durations)
        return (
            [field.extrema(of) for field, of in zip(self._cells, rows, strict=True)],
            [field.series(of) for field, of in zip(self._cells, begins, strict=True)],
            [field.values(of) for field, of in zip(self._cells, values, strict=True)],
        )

    def _watched(
        self, starts: Array, p: Array, durations: Array
    ) -> tuple[list[Array], list[Array], list[Array]]:
        """The same of modes without breakpoints, with parameters (L, np)."""
        if self._watch is None:
            given = zip(self._legs, self._driven, starts, durations.tolist(), p, strict=True)
            legs = [_by_steps(self._system, leg, f, x, t, own) for leg, f, x, t, own in given]
            rows, begins, values = zip(*legs, strict=True)
            return [*rows], [*begins], [*values]
        states = list(starts)
        if not self._explicit:
            given_states = zip(self._legs, starts, p, strict=True)
            states = [states_at(self._system, leg.mode, x, own) for leg, x, own in given_states]
        return self._watch(states, p, durations, _ENDS)


def _by_steps(
    system: FilippovSystem, leg: Leg, field: GuardedField, x: Array, duration: float, p: Array
) -> tuple[Array, Array, Array]:
    """As of LegsWatch for one leg, from the steps of the driver: on sets a mode has no field of the states alone."""
    near, n = _NEAR_SETS * duration, len(x)
    moved = lambda y, leg, t: integrate_leg(system, leg, y, t, p).end
    terms = lambda y: np.vstack(first_terms(field, y, p))
    begin = terms(moved(x, leg, near) if leg.left else x)
    if not duration > 0.0:
        return np.zeros((0, 4 + n)), begin, begin[n:, 0]
    arcs = [leg.arc(system, x, duration)]
    found = carry_legs(system, arcs, p, back=True)
    require_done(system, arcs, found)
    times, states = found.steps_of(0)
    if system.time_dependent:  # whose times are since the start
        states = states + np.append(np.zeros(n - 1), x[-1])
    kept, inside = (near < times) & (times < duration - near), replace(leg, left=())
    times = np.concatenate([[near], times[kept], [duration - near]])
    first, *middle = [moved(x, leg, near), *states[kept]]
    states = np.array([first, *middle, moved([first, *middle][-1], inside, times[-1] - times[-2])])
    series, rows = np.array([terms(y)[n:] for y in states]), list[Array]()
    for (k, j), value in np.ndenumerate(series[:, :, 0]):
        rows.append(np.array([j, times[k], value, 0.0, *states[k]]))
    rates, spans = series[:, :, 1], np.diff(times)
    turns = (rates[:-1] * rates[1:] < 0.0) & (
        np.abs(np.diff(rates, axis=0)) * spans[:, None] > _CONSTANT * np.abs(series[1:, :, 0])
    )
    for k, j in zip(*np.nonzero(turns), strict=True):
        t = spans[k] * rates[k, j] / (rates[k, j] - rates[k + 1, j])
        for _ in range(_REFINED):
            y = moved(states[k], inside, float(t))
            own = terms(y)[n + j]
            t = min(max(t - own[1] / (2 * own[2]), 0.0), spans[k])
        rows.append(np.array([j, times[k] + t, own[0], 2 * own[2], *y]))
    return np.array(rows).reshape(-1, 4 + n), begin, terms(found.ends[0])[n:, 0]


def _violations_along(field: Guarded, rows: Array, p: Array) -> list[str]:
    """Violations, from extrema of guards and values at the ends of steps."""
    if not len(rows) or float(rows[:, 2].min()) >= 0.0:
        return []
    guards = field.motion.guards
    seen: list[list[tuple[float, float, float]]] = [[] for _ in guards]  # time, value, scale
    positive = {k for k, _, value in rows[:, :3].tolist() if value > 0.0}
    for row in rows:
        k, (t, value), scale = int(row[0]), row[1:3].tolist(), 0.0
        if k not in positive and guards[k].kind in ("stop", "reset", "zero", "atom"):
            continue  # no change of sign
        if value < 0.0 and guards[k].kind not in ("stop", "reset", "atom"):
            slope = np.abs(field.gradients.copied(row[4:], p)[0][k])
            scale = float(slope @ np.abs(row[4:])) + math.sqrt(float(slope @ slope)) * 1e-3
        seen[k].append((t, value, scale))
    system = field.motion.system
    return [
        f for g, values in zip(guards, seen, strict=True) for f in _violations(system, g, values)
    ]


def _violations(
    system: FilippovSystem, guard: Guard, values: Sequence[tuple[float, float, float]]
) -> list[str]:
    """Violations of one guard inside a leg, earliest first."""
    ordered = sorted(values)
    largest = max((abs(v) for _, v, _ in ordered), default=0.0)  # where the gradient vanishes
    if guard.kind in ("stop", "reset", "zero", "atom"):
        if guard.kind == "atom" or not system.definition.plain:
            return []  # the orbit is run, with its conditions
        clear = [(t, v) for t, v, _ in ordered if abs(v) > _NEGATIVE * largest]  # not a touch
        for (_, a), (t, b) in pairwise(clear):
            if a * b < 0.0 and guard.side in (0, 1 if b > a else -1) and guard.kind != "zero":
                name = guard_name(system, guard)
                return [f"{guard.kind} {name!r} reaches zero {t:.6g} after its start"]
        return []
    low = [(t, v) for t, v, scale in ordered if v < -_NEGATIVE * max(scale, largest)]
    if not low:
        return []
    t, v = min(low, key=lambda entry: entry[1])
    return [f"{described(system, guard)} is violated {t:.6g} after its start (by {abs(v):.3g})"]


def change_violation(
    system: FilippovSystem, leg: Leg, following: str, end: Array, after: Array, p: Array
) -> str:
    """Why a mode cannot follow a leg after its event; empty if it can."""
    if leg.timed:
        return ""
    own, rate = leg.at_event(system, end, p), rate_at(system, leg, end, p)
    field = guarded_field(system, following)
    begin = np.vstack(first_terms(field, states_at(system, following, after, p), p))
    return _change_violation(
        leg, guarded_field(system, leg.mode), float(own.gradient @ rate), field, begin, p
    )


def begin_violation(system: FilippovSystem, leg: Leg, end: Array, p: Array) -> str:
    """A guard of a leg's mode that is negative where the leg ends; empty if there is none."""
    field = guarded_field(system, leg.mode)
    values = np.vstack(first_terms(field, states_at(system, leg.mode, end, p), p, 0))
    return _negative(field, values, p)


def _change_violation(
    leg: Leg, own: Guarded, speed: float, field: Guarded, begin: Array, p: Array
) -> str:
    """The same from the rate of the event's function, and from the first coefficients of the next leg."""
    system = own.motion.system
    found = (g for g in own.motion.guards if g.ends(leg.kind, leg.element, leg.side))
    guard = next(found, None) if not leg.repeats else None
    if guard is None:
        return _following_violation(field, begin, p)
    if guard.kind in ("surface", "exit", "impact", "release") and speed > 0.0:
        condition, name = described(system, guard), leg.name(system)
        return f"at its end {condition} becomes true instead of false ({name})"
    if guard.kind in ("stop", "reset") and guard.side * speed < 0.0:
        return f"{guard.kind} {leg.name(system)!r} reaches zero from the wrong side at its end"
    return _following_violation(field, begin, p)


def _following_violation(field: Guarded, begin: Array, p: Array) -> str:
    """A guard of the next mode that is negative, or zero and falling, where the mode begins."""
    violation = _negative(field, begin, p)
    return violation and f"where mode {field.motion.mode!r} begins after it, {violation}"


def _negative(field: Guarded, begin: Array, p: Array) -> str:
    """Describe the first guard whose first nonzero coefficient is negative."""
    guards = field.motion.guards
    states, rows = begin[: len(begin) - len(guards)], begin[len(begin) - len(guards) :]
    if not len(rows) or float(rows.min()) >= 0.0:
        return ""
    slopes, sizes = field.gradients.copied(states[:, 0], p)[0], np.abs(states).max(axis=0)
    for k, guard in enumerate(guards):
        if guard.kind in ("stop", "reset", "zero", "branch", "atom"):
            continue
        length = math.sqrt(float(slopes[k] @ slopes[k]))
        scale = length * sizes
        scale[0] += 1e-3 * length
        for value, size in zip(rows[k].tolist(), scale.tolist(), strict=False):
            if abs(value) > _NEGATIVE * size:
                if value < 0.0:
                    return f"{described(field.motion.system, guard)} fails"
                break
    return ""


def violations_of_legs(
    system: FilippovSystem,
    legs: Sequence[Leg],
    starts: Array,
    durations: Array,
    speeds: Array,
    p: Array,
    closes: bool,
) -> list[str]:
    """Violations of guards along consecutive legs, leg by leg."""
    made = lambda: LegGuards(system, legs)  # kept for an orbit, which is one of many of a family
    guards = system.cached(("guards of legs", tuple(legs)), made) if closes else made()
    fields, (rows, begins, _) = guards.fields, guards(starts, p, durations)
    result, count = list[str](), len(legs)
    for i, leg in enumerate(legs):
        if durations[i] <= 0.0:
            result.append(
                f"leg {i + 1} {leg_name(system, leg)} has the duration {durations[i]:.6g}"
            )
            continue
        found = [] if leg.repeats else _violations_along(fields[i], rows[i], p)
        following = (i + 1) % count
        if not leg.timed and (closes or following):
            field, begin = fields[following], begins[following]
            violation = _change_violation(leg, fields[i], float(speeds[i]), field, begin, p)
            found += [violation] if violation else []
        result += [f"leg {i + 1} {leg_name(system, leg)}: {violation}" for violation in found]
    return result


def ending(system: FilippovSystem, leg: Leg) -> tuple[int, int]:
    """Number of the guard that ends a leg among those of its mode, and its direction."""
    guards = guarded_field(system, leg.mode).motion.guards
    own = leg.kind, leg.element, leg.side
    row = next(k for k, g in enumerate(guards) if g.ends(*own))
    return row, guards[row].side if guards[row].kind in ("stop", "reset") else -1


def march(system: FilippovSystem, leg: Leg, x: Array, p: Array, t_max: float) -> float | None:
    """Time until the event of a leg, ignoring other guards; None if it does not occur."""
    # A zero where the leg starts is not counted.
    field = guarded_field(system, leg.mode)
    row, direction = ending(system, leg)
    y = states_at(system, leg.mode, x, p)
    size = float(np.linalg.norm(field.gradients.copied(y, p)[0][row])) * float(np.abs(y).max())
    return passing(field, row, y, p, t_max, direction=direction, still=1e-9 * size)
