"""What a run notes as it goes: points, events, segments, how it ended; accumulation of events."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from ...model import Array, FilippovSystem, Guard
from .. import messages
from ..constants import AT_ONCE, BLOCKS, LAGS, REMAINING, SHRINKS, SPREAD
from ..options import Options
from ..status import Status
from ..trajectory import Segment, Trajectory
from .record import Record

# Events that accumulate in finite time, recognised by their geometric intervals.


def remaining_time(
    intervals: Sequence[float], patterns: Sequence[str], elapsed: float
) -> float | None:
    """Estimate the time left until events accumulate, or None if they do not (yet)."""
    if len(intervals) > AT_ONCE and not any(intervals[-AT_ONCE:]):
        return 0.0
    for lag in LAGS:
        need = lag * BLOCKS
        if len(intervals) < need + lag:
            return None
        recent = list(patterns[-need:])
        if recent != list(patterns[-need - lag : -lag]):
            continue
        tail = list(intervals[-need:])
        blocks = [sum(tail[k : k + lag]) for k in range(0, need, lag)]
        if min(blocks) <= 0.0:
            continue
        ratios = [b / a for a, b in pairwise(blocks)]
        r = ratios[-1]
        if max(ratios) < SHRINKS and max(ratios) - min(ratios) <= SPREAD * (1.0 - r):
            left = blocks[-1] * r / (1.0 - r)
            if left < REMAINING * elapsed:
                return left
    return None


class Bookkeeping:
    """State of one run, and what is known of its past."""

    def __init__(self, system: FilippovSystem, x: Array, p: Array, options: Options):
        self.system, self.p, self.options = system, p, options
        self.t, self.x, self.mode = options.t_start, x, ""
        self.record = Record(system, p)
        self.intervals: list[float] = []
        self.patterns: list[str] = []
        self.ended: tuple[Status, str] | None = None
        self.limit: float | None = None
        self._segment_start = (self.t, 0)
        self._last_event = self.t
        self._hits = 0  # of the section where the run is looked at

    def come_to_rest(self, left: float) -> bool:
        """Whether the run goes on after events that accumulate in the time left."""
        return False

    def note(self) -> None:
        """Note the state."""
        self.record.point(self.t, self.x)

    def event(
        self, kind: str, before: str, guard: Guard | None, x: Array | None = None, name: str = ""
    ) -> None:
        """Note an event at the state ``x``, the present one unless the event changed it."""
        before, after = self.system.spelled(before), self.system.spelled(self.mode)
        state = x if x is not None else self.x
        name = self.record.event(kind, self.t, state, before, after, guard, name, self.x).name
        self._count_hit(kind, before, name)
        if kind in ("end", "stop"):
            return
        self.intervals.append(self.t - self._last_event)
        self.patterns.append(f"{kind} {before} {after} {name}")
        self._last_event = self.t
        left = remaining_time(self.intervals, self.patterns, self.t - self.options.t_start)
        if left is not None and not (self.ended is None and self.come_to_rest(left)):
            self.limit = self.t + left
            message = messages.accumulation(len(self.record.events), self.limit)
            self.end(Status.ACCUMULATION, message)
        elif len(self.record.events) >= self.options.max_events:
            self.end(Status.TOO_MANY_EVENTS, messages.too_many("events", self.options.max_events))

    def _count_hit(self, kind: str, before: str, name: str) -> None:
        hits = self.options.hits
        if hits is not None and hits.has(self.t, kind, name, before):
            self._hits += 1
            if self._hits >= hits.last:
                self.end(Status.STOPPED, messages.sampled(hits.count or 0, self.t))

    def close_segment(self, following: str) -> None:
        """End the stretch of steps in a mode, where another follows."""
        start, first = self._segment_start
        count = len(self.record.starts)
        if following == self.mode.replace("b", "*") or following == self.mode:
            return
        if count > first:
            self.record.segments.append(self._segment(start, first, count))
        self._segment_start = (self.t, count)

    def _segment(self, start: float, first: int, last: int) -> Segment:
        return Segment(self.system.spelled(self.mode), start, self.t, first, last)

    def end(self, status: Status, message: str) -> None:
        """End the run, if it has not ended."""
        if self.ended is None:
            self.ended = (status, message)

    def trajectory(self) -> Trajectory:
        """Return the run."""
        assert self.ended is not None
        status, message = self.ended
        start, first = self._segment_start
        count = len(self.record.starts)
        if count > first or not self.record.segments:
            self.record.segments.append(self._segment(start, first, count))
        if status is not Status.STOPPED:
            self.event("end", self.mode, None, name=str(status))
        return self.record.trajectory(status, message, self.limit)
