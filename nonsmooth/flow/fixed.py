"""The flow of one smooth field over a given duration of either sign, and extrema of guards along it.

Legs of a periodic orbit or of a sensitivity have given durations, so no event is located: these are Taylor
steps to rounding. Along a step a guard is a polynomial, so its extrema are the roots of its derivative.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..model import Array, ConvergenceError, Evaluator
from ..model.derivatives.variational import ORDER, GuardedField
from ..model.printing.tape import Series, Values
from .compiled.smooth import LegsProgram, SmoothProgram, ValuesProgram, WatchProgram
from .compiled.tape import library
from .reference.polynomial import first_crossing, first_root, sign_changes
from .select import compiled_or_none, use_compiled

#: Part of the size of a group of states that the last terms of a step may reach.
TOLERANCE = 2.0**-53

MOST_STEPS = 20_000


class SmoothField(Protocol):
    """A smooth field as Taylor coefficients, with groups of states that share an error scale."""

    @property
    def jets(self) -> Evaluator:
        """(z, p) -> coefficients (m, order + 1)."""
        ...

    @property
    def entries(self) -> int:
        """Number of entries of z."""
        ...

    @property
    def groups(self) -> Sequence[NDArray[np.intp]]:
        """Entries of z whose errors have one scale; what is exact is in none."""
        ...


class CompiledField(SmoothField, Protocol):
    """A smooth field that the interpreter in C can integrate."""

    @property
    def series(self) -> Series:
        """Taylor rules of the field."""
        ...


def flow_for(
    field: CompiledField, z: Array, p: Array, duration: float, tol: float = TOLERANCE
) -> Array:
    """State of a smooth flow after a duration of either sign."""
    if duration and has_interpreter():
        end, left = program_of(field).flow(z, p, duration, tol, MOST_STEPS)
        if left:
            raise stuck(duration, left, end)
        return end
    for _, _, end in steps_for(field, z, p, duration, tol):
        z = end
    return z


def has_interpreter() -> bool:
    """Whether smooth fields are integrated in C."""
    if library.cache_info().currsize:  # it is loaded
        return True
    return use_compiled("auto") and compiled_or_none("auto", library, library) is not None


#: Programs of the interpreter for fields and expressions, as long as these live.
_PROGRAMS: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()


def program_of(field: CompiledField) -> SmoothProgram:
    """Program of a smooth field for the interpreter, made once."""
    made: SmoothProgram | None = _PROGRAMS.get(field)
    if made is None:
        group = np.full(field.entries, -1, np.int32)
        for k, entries in enumerate(field.groups):
            group[entries] = k
        made = _PROGRAMS.setdefault(field, SmoothProgram(field.series, group, ORDER))
    return made


class Evaluated(Protocol):
    """Expressions of states and parameters that the interpreter in C can evaluate."""

    @property
    def values(self) -> Values:
        """Their graph."""
        ...


def legs_program(
    fields: Sequence[CompiledField], events: Sequence[Evaluated | None], parameters: int
) -> LegsProgram:
    """Program that integrates legs and evaluates expressions at their ends, in one call."""
    return LegsProgram(
        [program_of(field) for field in fields],
        [None if event is None else values_program(event) for event in events],
        parameters,
    )


def values_program(event: Evaluated) -> ValuesProgram:
    """Program of expressions for the interpreter, made once."""
    made: ValuesProgram | None = _PROGRAMS.get(event)
    return made or _PROGRAMS.setdefault(event, ValuesProgram(event.values))


def steps_for(
    field: SmoothField, z: Array, p: Array, duration: float, tol: float = TOLERANCE
) -> Iterator[tuple[float, Array, Array]]:
    """The steps of ``flow_for``: length (with its sign), coefficients (m, order + 1), end (m,)."""
    # The coefficients are overwritten by the next step.
    left, sign = abs(duration), math.copysign(1.0, duration)
    for _ in range(MOST_STEPS):
        if left == 0.0:
            return
        c, *watched = field.jets(z, p)
        h = _length(c, field.groups, abs(duration), tol)
        for rows in watched:  # a guard may vary where the states rest
            h = min(h, _length(rows, np.arange(len(rows))[:, None], abs(duration), tol))
        if not (h > 1e-14 * abs(duration) and np.all(np.isfinite(c))):
            break
        # Two equal steps rather than a long one and the rest of it
        h = left if h >= left else min(h, 0.5 * left) if h < left < 1.5 * h else h
        degrees = _DEGREES[: c.shape[1]]
        z = c @ (sign * h) ** degrees
        left -= h
        yield sign * h, c, z
    if left:
        raise stuck(duration, left, z)


def stuck(duration: float, left: float, z: Array) -> ConvergenceError:
    """Error for a flow that does not reach the end of its duration."""
    return ConvergenceError(
        f"The flow of a leg of duration {duration:.6g} is not finite, or needs too small steps, "
        f"{left:.6g} before the end, near {np.array2string(z[:6], precision=6)}. The itinerary, the "
        "durations or the start are far from an orbit: start from a simulation.",
        point=z,
    )


_DEGREES = np.arange(64)


def _length(c: Array, groups: Iterable[NDArray[np.intp]], duration: float, tol: float) -> float:
    """Step for which the last two terms stay below ``tol`` times the size of their group."""
    last, order, h = np.abs(c[:, [0, 1, -2, -1]]), c.shape[1] - 1, math.inf
    for group in groups:
        size, rate, before, final = last[group].max(axis=0).tolist()
        allowed = tol * max(size, rate * duration)
        if before != before or final != final:
            return math.nan
        if allowed == 0.0:
            continue  # derivatives by parameters at the start; their series converges like the others
        if final > 0.0:
            h = min(h, (allowed / final) ** (1.0 / order))
        if before > 0.0:
            h = min(h, (allowed / before) ** (1.0 / (order - 1)))
    return h


def watched(field: GuardedField, y: Array, p: Array, duration: float, margin: float) -> Array:
    """Extrema and values of the guards of a mode along its flow: rows (guard, t, h, h'', state)."""
    # The values are at the end of every step, and by the margin beside the start and the end.
    if not has_interpreter():
        return _watched(field, y, p, duration, margin)
    if not field.motion.guards:
        return np.zeros((0, 4 + len(y)))
    program = program_of(field)
    found, end, left = program.watch(y, p, duration, TOLERANCE, MOST_STEPS, margin)
    if left:
        raise stuck(duration, left, end)
    return found


class LegsWatch:
    """Extrema and values of guards along many legs; those of no positive duration are left out."""

    def __init__(self, fields: Sequence[GuardedField]):
        self._fields = list(fields)

    @cached_property
    def _program(self) -> WatchProgram:
        return WatchProgram([program_of(field) for field in self._fields])

    def __call__(
        self, starts: Sequence[Array], p: Array, durations: Array, ends: float
    ) -> tuple[list[Array], list[Array], list[Array]]:
        """Rows of ``watched``, start series and end values of the guards, by leg."""
        if has_interpreter():
            found = self._program(starts, p, durations, TOLERANCE, MOST_STEPS, ends)
            if found.failed >= 0:
                raise stuck(float(durations[found.failed]), found.left, starts[found.failed])
            return found.rows, found.begins, found.values
        rows, begins, values = list[Array](), list[Array](), list[Array]()
        for field, y, duration in zip(self._fields, starts, durations.tolist(), strict=True):
            begins.append(np.vstack([part[:, :4] for part in field.starts.copied(y, p)]))
            rows.append(np.zeros((0, 4 + len(y))))
            values.append(np.zeros(len(field.motion.guards)))
            if duration > 0.0:
                rows[-1] = _watched(field, y, p, duration, ends * duration)
                values[-1] = field.starts.copied(flow_for(field, y, p, duration), p)[1][:, 0]
        return rows, begins, values


def _watched(field: GuardedField, y: Array, p: Array, duration: float, margin: float) -> Array:
    found: list[Array] = []
    t = 0.0
    for h, states, end in steps_for(field, y, p, duration):
        rows = field.jets.outputs[1].copy()
        degrees = np.arange(rows.shape[1])
        slopes = rows[:, 1:] * degrees[1:]
        changes = sign_changes(slopes, h).tolist() if len(rows) else []
        points = [(s, k) for k, c in enumerate(changes) if c for s in _extrema(slopes[k], h, c)]
        points = [(s, k) for s, k in points if margin < t + s < duration - margin]
        extrema = len(points)
        last = duration - margin - t if t + h >= duration - margin else h
        for s in (last, margin) if t == 0.0 else (last,):
            points += [(s, k) for k in range(len(rows)) if 0.0 < s <= h]
        for i, (s, k) in enumerate(points):
            powered = s**degrees
            bend = float(slopes[k, 1:] * degrees[1:-1] @ powered[:-2]) if i < extrema else 0.0
            at = end if s == h else states @ powered
            found.append(np.array([k, t + s, rows[k] @ powered, bend, *at]))
        t += h
    return np.array(found).reshape(-1, 4 + len(y))


def _extrema(slope: Array, h: float, changes: int) -> list[float]:
    """Zeros in (0, h] of a polynomial whose Bernstein coefficients change sign so many times."""
    if changes == 1:
        root = first_root((slope if slope[0] > 0.0 else -slope).tolist(), h)
        return [] if root is None else [root]
    d = slope * h ** np.arange(len(slope))
    size = np.abs(d)
    if size[0] > size[1:].sum() or not np.all(np.isfinite(d)):
        return []
    kept = np.flatnonzero(size > 1e-17 * size.max()) if size.max() > 0.0 else np.zeros(0, int)
    if not kept.size or kept[-1] == 0:
        return []
    roots = np.roots(d[kept[-1] :: -1])
    real = roots.real[np.abs(roots.imag) <= 1e-8]
    return [float(r) * h for r in real if 0.0 < r <= 1.0]


def passing(
    field: GuardedField,
    row: int,
    y: Array,
    p: Array,
    t_max: float,
    *,
    direction: int,
    still: float,
) -> float | None:
    """Time at which a guard passes through zero, whatever the others do; None if it does not."""
    if has_interpreter():
        program = program_of(field)
        t = program.march(y, p, t_max, TOLERANCE, MOST_STEPS, row, direction, still)
        if t == -2.0:
            raise stuck(t_max, t_max, y)
        return None if t < 0.0 else t
    t = 0.0
    for h, _, _ in steps_for(field, y, p, t_max):
        c = field.jets.outputs[1][row].copy()
        if t == 0.0:
            c = c[int(np.argmax(np.abs(c) > still)) :]
        found = first_crossing(c.tolist(), h, direction)
        if found is not None and t + found > 0.0:
            return t + found
        t += h
    return None
