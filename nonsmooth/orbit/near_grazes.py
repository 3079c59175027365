"""Events that a run has only within its own error: grazes, of which it does not know that they happen.

An orbit that turns back at a surface is beyond it by the depth $s^2/(2 a)$ if it meets it with the speed s
against the acceleration a. Where the run's error is as large as that, the event may as well not happen,
and a derivative through it, of the size 1/s, means nothing. That error is known: legs are flown again to
rounding, and what the run misses by then is carried on by the same derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..model import Array, DegenerateError, FilippovSystem
from ..model.event_maps import AtEvent
from .legs import leg_name

if TYPE_CHECKING:
    from .variation import Passage

#: Events that an orbit meets at larger angles are met deeper than runs are wrong.
_STEEP = 1e-3

#: A graze is known to happen where it is so many times as deep as the run is wrong.
_KNOWN = 4.0

#: Roundings in an event's function, where the run is not wrong otherwise.
_ROUNDING = 16.0 * float(np.finfo(float).eps)

#: Part of a leg, or of the time in which the state changes, over which a speed's rate is taken.
_INSTANT = 1e-5


def require_known(system: FilippovSystem, parts: Sequence[Passage], p: Array) -> None:
    """Refuse a run with a graze that is within the run's own error.

    Parameters
    ----------
    system : FilippovSystem
    parts : sequence of Passage
        All legs of the run in order.
    p : ndarray
        All parameters.

    Raises
    ------
    DegenerateError
        By the event, its depth and the run's error.
    """
    flat = [k for k, part in enumerate(parts) if part.event and part.event.angle < _STEEP]
    if not flat:
        return
    n = system.extended_dimension
    error = np.zeros(n)  # of the run, against the orbit from its start
    for k, part in enumerate(parts[: flat[-1] + 1]):
        error = part.flown.by_start @ error
        error[:n] += part.stretch.end - part.flown.end[:n]
        if part.event is None:
            error = error[:n]
            continue
        if k in flat:
            _require_deep(system, part, error, p)
        error = part.event.matrix @ error


def _require_deep(system: FilippovSystem, part: Passage, error: Array, p: Array) -> None:
    """Refuse an event that the orbit meets no deeper than the run is wrong by ``error`` (N + k,)."""
    leg, flown = part.stretch.leg, part.flown
    at = leg.at_end(system, flown.end, p)
    if part.event is None or np.array_equal(part.event.matrix, at.after_state):
        return  # neighbours pass it as if it were not there
    speed = _speed(at, flown.rate)
    size, length = math.hypot(*flown.end), math.hypot(*flown.rate)
    step = _INSTANT * min(part.stretch.duration, size / length if size and length else math.inf)
    before = flown.end - step * flown.rate
    rate = leg.field(system).rate.copied(before, p)[0][:, 0]
    turning = (speed - _speed(leg.at_end(system, before, p), rate)) / step if step else 0.0
    if not turning * speed < 0.0:
        return  # it does not turn back
    depth = 0.5 * speed**2 / abs(turning)
    wrong = abs(float(at.gradient @ error))
    wrong += _ROUNDING * float(np.abs(at.gradient) @ np.abs(flown.end))
    if depth > _KNOWN * wrong:
        return
    raise DegenerateError(
        f"{leg_name(leg)} at t = {part.stretch.t + part.stretch.duration:.10g}: expected an event that "
        f"the run is sure of, received a grazing: the orbit would turn back {depth:.1e} beyond it, and "
        f"the run's error is {wrong:.1e} there. A derivative through it means nothing. Simulate with "
        "a smaller tol, or move the start or a parameter away from the grazing."
    )


def _speed(at: AtEvent, rate: Array) -> float:
    return float(at.gradient @ rate)
