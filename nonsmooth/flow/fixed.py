"""The flow of one smooth field over a known duration, of either sign, without events.

Legs of a periodic orbit or of a sensitivity have durations that are unknowns or known, so nothing
has to be located: Taylor steps to rounding, and no more. This is the one place where the legs of
``orbit`` are integrated.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..model import Array, ConvergenceError, Evaluator
from ..model.derivatives.variational import ORDER
from ..model.printing.tape import Series, Values
from .compiled.smooth import LegsProgram, SmoothProgram, ValuesProgram
from .compiled.tape import library
from .select import compiled_or_none, use_compiled

#: Part of the size of a group of states that the last terms of a step may reach.
TOLERANCE = 2.0**-53

MOST_STEPS = 20_000


class SmoothField(Protocol):
    """What is integrated: Taylor coefficients, and states that are measured together."""

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
        """Its Taylor rules."""
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


#: What the interpreter needs of a field or of expressions, as long as they live.
_PROGRAMS: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()


def program_of(field: CompiledField) -> SmoothProgram:
    """A smooth field as the interpreter takes it, written once."""
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
        """Them as a graph."""
        ...


def legs_program(
    fields: Sequence[CompiledField], events: Sequence[Evaluated | None], parameters: int
) -> LegsProgram:
    """Legs of smooth fields, with expressions of the state at their ends, to be flown in one
    call."""
    return LegsProgram(
        [program_of(field) for field in fields],
        [None if event is None else values_program(event) for event in events],
        parameters,
    )


def values_program(event: Evaluated) -> ValuesProgram:
    """Expressions as the interpreter takes them, written once."""
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
        # two equal steps rather than a long one and the rest of it
        h = left if h >= left else min(h, 0.5 * left) if h < left < 1.5 * h else h
        degrees = _DEGREES[: c.shape[1]]
        z = c @ (sign * h) ** degrees
        left -= h
        yield sign * h, c, z
    if left:
        raise stuck(duration, left, z)


def stuck(duration: float, left: float, z: Array) -> ConvergenceError:
    """The error for a flow that does not come to its end."""
    return ConvergenceError(
        f"flow of a leg: expected a smooth field over the duration {duration:.6g}, received one "
        f"that is not finite, or steps too small, {left:.6g} before the end, near "
        f"{np.array2string(z[:6], precision=6)}. The itinerary, the durations or the start are "
        "far from an orbit: start from a simulation.",
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
            continue  # derivatives by parameters at the start: their series converges as the others
        if final > 0.0:
            h = min(h, (allowed / final) ** (1.0 / order))
        if before > 0.0:
            h = min(h, (allowed / before) ** (1.0 / (order - 1)))
    return h
