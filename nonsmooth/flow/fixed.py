"""The flow of one smooth field over a given duration of either sign, and extrema of guards along it.

Legs of a periodic orbit or of a sensitivity have given durations, so no event is located: these are Taylor
steps to rounding. Along a step a guard is a polynomial, so its extrema are the roots of its derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..model import Array, ConvergenceError
from ..model.derivatives.event_maps import EventMap, PlainMap
from ..model.derivatives.variational import ORDER, GuardedField, PlainField
from .engine.smooth import LegsProgram, SmoothProgram, ValuesProgram, WatchProgram

#: Part of the size of a group of states that the last terms of a step may reach.
TOLERANCE = 2.0**-53

MOST_STEPS = 20_000


def flow_for(
    field: PlainField, z: Array, p: Array, duration: float, tol: float = TOLERANCE
) -> Array:
    """State of a smooth flow after a duration of either sign."""
    if not duration:
        return z
    end, left = program_of(field).flow(z, p, duration, tol, MOST_STEPS)
    if left:
        raise stuck(duration, left, end)
    return end


def first_terms(field: GuardedField, y: Array, p: Array, order: int = 3) -> tuple[Array, Array]:
    """First coefficients of states (N + k, order + 1) and guards (g, order + 1) of a mode from a state."""
    program = program_of(field)
    if order > program.order:
        program = made_program(field, order)
    terms = program.terms(y, p)[:, : order + 1]
    return terms[: len(y)], terms[len(y) :]


#: Programs of the interpreter for fields and expressions, as long as these live.
_PROGRAMS: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()


def program_of(field: PlainField) -> SmoothProgram:
    """Program of a smooth field for the interpreter, made once."""
    made: SmoothProgram | None = _PROGRAMS.get(field)
    return made or _PROGRAMS.setdefault(field, made_program(field, ORDER))


def made_program(field: PlainField, order: int) -> SmoothProgram:
    """Make the program of a smooth field at an order."""
    group = np.full(field.entries, -1, np.int32)
    for k, entries in enumerate(field.groups):
        group[entries] = k
    of_columns = field.derivatives, field.by_start, field.columns
    return SmoothProgram(field.series, group, order, *of_columns)


def legs_program(
    fields: Sequence[PlainField],
    events: Sequence[EventMap | PlainMap | None],
    parameters: int,
    by_leg: bool = False,
) -> LegsProgram:
    """Program that integrates legs and evaluates expressions at their ends, in one call, with as many parameters of all
    or of each."""
    return LegsProgram(
        [program_of(field) for field in fields],
        [None if event is None else values_program(event) for event in events],
        parameters,
        by_leg,
    )


def values_program(event: EventMap | PlainMap) -> ValuesProgram:
    """Program of expressions for the interpreter, made once."""
    made: ValuesProgram | None = _PROGRAMS.get(event)
    return made or _PROGRAMS.setdefault(event, ValuesProgram(event.values))


def stuck(duration: float, left: float, z: Array) -> ConvergenceError:
    """Error of a flow that does not reach the end of its duration."""
    return ConvergenceError(
        f"The flow of a leg of duration {duration:.6g} is not finite, or needs too small steps, "
        f"{left:.6g} before the end, near {np.array2string(z[:6], precision=6)}. The itinerary, the "
        "durations or the start are far from an orbit: start from a simulation.",
        point=z,
    )


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
        """Rows (guard, t, h, h'', state), start series and end values of the guards, by leg."""
        # Values, with h'' = 0, are at the end of every step, and by the part ``ends`` beside the start and the end.
        found = self._program(starts, p, durations, TOLERANCE, MOST_STEPS, ends)
        if found.failed >= 0:
            raise stuck(float(durations[found.failed]), found.left, found.rows[0])
        return found.rows, found.begins, found.values


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
    program = program_of(field)
    t = program.march(y, p, t_max, TOLERANCE, MOST_STEPS, row, direction, still)
    if t == -2.0:
        raise stuck(t_max, t_max, y)
    return None if t < 0.0 else t
