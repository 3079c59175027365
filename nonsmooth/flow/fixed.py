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
from ..model.printing.tape import Series
from ..model.variational import ORDER
from .compiled.tape import FixedFlow, library
from .select import compiled_or_none, use_compiled

#: Part of the size of a group of states that the last terms of a step may reach.
TOLERANCE = 2.0**-53

_MOST_STEPS = 20_000


class SmoothField(Protocol):
    """What is integrated: Taylor coefficients, and states that are measured together."""

    @property
    def jets(self) -> Evaluator:
        """(z, p) -> coefficients (m, order + 1)."""
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
    """State of a smooth flow after a duration of either sign.

    Parameters
    ----------
    field : SmoothField
    z : ndarray (m,)
    p : ndarray
    duration : float
    tol : float, optional
        Local error relative to the size of each group of states, which is at least the distance
        that its rate covers in the whole duration.

    Returns
    -------
    ndarray (m,)

    Raises
    ------
    ConvergenceError
        The field is not finite on the way, or steps become too small.
    """
    if duration and _has_interpreter():
        flow = _FLOWS.get(field) or _FLOWS.setdefault(field, _compiled(field, len(z)))
        end, left = flow(z, p, duration, tol, _MOST_STEPS)
        if left:
            raise _stuck(duration, left, end)
        return end
    for _, _, end in steps_for(field, z, p, duration, tol):
        z = end
    return z


def _has_interpreter() -> bool:
    return use_compiled("auto") and compiled_or_none("auto", library, library) is not None


#: What the interpreter needs of a field, as long as there is the field.
_FLOWS: WeakKeyDictionary[Any, FixedFlow] = WeakKeyDictionary()


def _compiled(field: CompiledField, size: int) -> FixedFlow:
    group = np.full(size, -1, np.int32)
    for k, entries in enumerate(field.groups):
        group[entries] = k
    return FixedFlow(field.series, group, ORDER)


def steps_for(
    field: SmoothField, z: Array, p: Array, duration: float, tol: float = TOLERANCE
) -> Iterator[tuple[float, Array, Array]]:
    """The steps of ``flow_for``: length (with its sign), coefficients (m, order + 1), end (m,).

    The coefficients are overwritten by the next step.
    """
    left, sign = abs(duration), math.copysign(1.0, duration)
    for _ in range(_MOST_STEPS):
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
        raise _stuck(duration, left, z)


def _stuck(duration: float, left: float, z: Array) -> ConvergenceError:
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
