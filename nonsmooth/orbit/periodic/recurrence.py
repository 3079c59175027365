"""Reading an itinerary off a run: the legs between two passages of nearly the same state.

Distances are measured by how far each state moves in the run; in a forced system the time between the
passages must be a whole number of periods, and half numbers count with a symmetry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...model import Array, ConvergenceError
from ..runs.legs import Stretch, stretches

#: A run that comes back to within this part of its size may be near a periodic orbit.
CLOSE = 0.25


#: An orbit takes about as long as it is said to within this factor.
_ABOUT = 1.5

#: Times between events that fall below this part of what they were at half of a run go on falling.
_FALLING = 0.7

#: What moves by no more than this part of a run rests.
_REST = 1e-6

#: A run that spends this part of its time after its last event may have come to an orbit without one.
_QUIET = 0.75

#: States as large as this have no squares.
_HUGE = 1e150

#: Runs of fewer events are not asked whether they chatter.
_MANY = 1000


def is_about(duration: float, about: float) -> bool:
    """Whether a time is near another one, from two thirds to one and a half times it."""
    return about / _ABOUT <= duration <= about * _ABOUT


@dataclass(frozen=True, eq=False)
class Recurrence:
    """A stretch of a run that nearly closes."""

    parts: tuple[Stretch, ...]
    periods: float
    distance: float


def recurrence(
    run: Trajectory,
    *,
    symmetry: Array | None,
    period: float | None,
    first: bool,
    about: float | None = None,
) -> Recurrence | None:
    """The legs of a run that nearly close, None if it has none."""
    parts = [part for part in stretches(run) if part.duration > 0.0]
    if len(parts) > 1 and parts[-1].leg.timed:
        if parts[-1].duration > _QUIET * sum(part.duration for part in parts):
            found = _without_events(run, parts[-1:], symmetry, period, first, about)
            if found is not None and found.distance <= CLOSE and _moves(run, found.parts[0]):
                return found
    closed = [k for k, part in enumerate(parts) if part.leg.kind not in ("end", "stop")]
    # legs between two events: start k is after the event that ends part k - 1
    starts = [k + 1 for k in closed if k + 1 < len(parts)]
    if len(starts) < 2:
        return _without_events(run, parts, symmetry, period, first, about)
    scale = _scales(run)
    anchor = starts[0] if first else starts[-1]
    others = [k for k in starts if (k > anchor if first else k < anchor)]
    if symmetry is None:
        others = [k for k in others if _key(parts, k) == _key(parts, anchor)]
    if about is not None:
        others = [k for k in others if is_about(abs(parts[k].t - parts[anchor].t), about)]
    if not others:
        return None
    distances, periods = _distances(run, parts, anchor, others, scale, symmetry, period)
    best = min(distances)  # of those that close about as well as the best the shortest
    good = [i for i, apart in enumerate(distances) if apart <= max(3.0 * best, 1e-9)]
    i = min(good, key=lambda i: abs(others[i] - anchor))
    low, high = sorted((anchor, others[i]))
    return Recurrence(tuple(parts[low:high]), periods[i], distances[i])


def _moves(run: Trajectory, part: Stretch) -> bool:
    """Whether a run does not rest in a part of it."""
    way = np.ptp(run(part.t + part.duration * np.linspace(0.0, 1.0, 9)), axis=0)
    return bool(np.max(way) > _REST * np.ptp(run.x, axis=0).max())


def _key(parts: Sequence[Stretch], k: int) -> tuple[object, ...]:
    """Mode of a leg, and the guard that ended the one before it."""
    leg = parts[k - 1].leg
    own = leg.kind if leg.kind in ("stop", "reset") else leg.mode[leg.element :][:1] == "s"
    return parts[k].leg.mode, own, leg.element, leg.side if own is True else 0


def _scales(run: Trajectory) -> Array:
    span = np.asarray(np.ptp(run.x[len(run.x) // 2 :], axis=0))
    return np.where(span > 1e-12 * max(float(span.max()), 1e-300), span, max(span.max(), 1e-300))


def _distances(
    run: Trajectory,
    parts: Sequence[Stretch],
    anchor: int,
    others: Sequence[int],
    scale: Array,
    symmetry: Array | None,
    period: float | None,
) -> tuple[list[float], list[float]]:
    """Relative distances of the starts of parts, and the forcing periods between them."""
    n, sign = run.system.dimension, 1.0 if others[0] > anchor else -1.0
    states = np.array([parts[k].start[:n] for k in others])
    if symmetry is not None:  # its square is 1: either end may be mirrored
        states = states @ symmetry.T
    apart = np.abs((states - parts[anchor].start[:n]) / scale).max(axis=1)
    if period is None:
        return apart.tolist(), [0.0] * len(others)
    times = np.array([parts[k].t for k in others])
    count = sign * (times - parts[anchor].t) / period
    shift = 0.0 if symmetry is None else 0.5
    whole = np.round(count - shift) + shift
    apart = np.maximum(apart, 2.0 * np.abs(count - whole))
    return np.where(whole > 0.0, apart, np.inf).tolist(), whole.tolist()


def _without_events(
    run: Trajectory,
    parts: Sequence[Stretch],
    symmetry: Array | None,
    period: float | None,
    first: bool,
    about: float | None,
) -> Recurrence | None:
    """A recurrence within one leg: after whole periods, or on a plane across the flow."""
    if not parts:
        return None
    part = parts[0] if first else parts[-1]
    start, end = part.t, part.t + part.duration
    scale = _scales(run)
    anchor = start if first else end
    found = []
    for t in _returns(run, start, end, anchor, symmetry, period):
        low, high = sorted((anchor, t))
        if about is not None and not is_about(high - low, about):
            continue
        there = run(high) if symmetry is None else symmetry @ run(high)
        distance = float(np.abs((there - run(low)) / scale).max())
        x = np.append(run(low), low) if run.system.time_dependent else run(low)
        periods = (high - low) / period if period else 0.0
        leg = type(part.leg)(part.leg.mode)
        cut = Stretch(leg, low, high - low, x, x, x)
        found.append(Recurrence((cut,), round(2 * periods) / 2, distance))
    best = min((r.distance for r in found), default=np.inf)
    good = [r for r in found if r.distance <= max(3.0 * best, 1e-9)]
    return min(good, key=lambda r: r.parts[0].duration) if good else None


def _returns(
    run: Trajectory,
    start: float,
    end: float,
    anchor: float,
    symmetry: Array | None,
    period: float | None,
) -> list[float]:
    """Times at which the run may be back at the state it has at ``anchor``."""
    if period is not None:
        shift = 0.0 if symmetry is None else 0.5
        count = int((end - start) / period + 1e-9)
        steps = [(k + 1 - shift) * period for k in range(count)]
        sign = 1.0 if anchor == start else -1.0
        return [anchor + sign * s for s in steps]
    times = np.linspace(start, end, 4001)
    states = run(times) if symmetry is None else run(times) @ symmetry.T
    x = run(anchor)
    if not np.abs(states).max() < _HUGE:
        return []  # it diverges
    i = int(np.argmin(np.abs(times - anchor)))
    rate = (run(times[min(i + 1, 4000)]) - run(times[max(i - 1, 0)])) / 2.0
    height = (states - x) @ rate
    crossings = np.flatnonzero((height[:-1] < 0.0) & (height[1:] >= 0.0))
    away = [k for k in crossings if abs(times[k] - anchor) > 3 * (times[1] - times[0])]

    def above(t: float) -> float:
        there = run(t) if symmetry is None else symmetry @ run(t)
        return float((there - x) @ rate)

    from scipy.optimize import brentq  # here: it is not needed to import the library

    return [float(brentq(above, times[k], times[k + 1], xtol=1e-13 * end)) for k in away]


def require_steady(run: Trajectory) -> None:
    """Refuse a run that chatters: it had too many events, and the times between them shrink."""
    if run.status is not Status.TOO_MANY_EVENTS or len(run.events) < _MANY:
        return
    times = np.array([event.t for event in run.events])
    waits = np.diff(times)
    part = len(waits) // 10
    parts = (waits[4 * part : 5 * part], waits[6 * part : 7 * part], waits[-part:])
    middle, between, last = (float(w.mean()) for w in parts)  # legs of one orbit differ
    if last >= _FALLING * middle or not last < between < middle:
        return
    raise ConvergenceError(
        f"guess: expected a run that comes back to where it was, received one that chatters: it ended "
        f"with {run.status} at t = {times[-1]:.6g}, after {len(times)} events, the time between which "
        f"fell from {middle:.2g} at half of them to {last:.2g}. Its switches accumulate near "
        f"{run.x[-1].tolist()}: no orbit of finitely many legs is there. Start elsewhere, or model "
        "what limits the switching, such as hysteresis or a delay.",
        point=run.x[-1],
    )


def refused(run: Trajectory, found: Recurrence | None) -> ConvergenceError:
    """The error for a run in which no orbit closes."""
    came = (
        "it has no two passages of one event"
        if found is None
        else (
            f"the best one closes to {found.distance:.2g} of its size, after "
            f"{len(found.parts)} legs"
        )
    )
    return ConvergenceError(
        f"guess: expected a run that comes back near to where it was, received none: {came}. The "
        f"itinerary does not close. The run ended with {run.status} at t = {run.t[-1]:.6g}. Simulate "
        "longer, closer to the orbit, or give itinerary= or a symmetry."
    )
