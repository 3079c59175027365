"""What a run has produced so far, and the trajectory that it becomes."""

from __future__ import annotations

import numpy as np

from ...model import Array, FilippovSystem, Guard
from ..names import guard_name
from ..status import ADVICE, Status
from ..trajectory import Event, Segment, Steps, Trajectory


class Record:
    """Points, steps, events and segments of one run."""

    def __init__(self, system: FilippovSystem, p: Array):
        self.system, self.p = system, p
        self.t: list[float] = []
        self.x: list[Array] = []
        self.starts: list[float] = []
        self.coefficients: list[Array] = []
        self.events: list[Event] = []
        self.segments: list[Segment] = []

    def point(self, t: float, x: Array) -> None:
        """Note a state (extended)."""
        self.t.append(t)
        self.x.append(self._plain(x))

    def correct(self, x: Array) -> None:
        """Replace the state noted last."""
        self.x[-1] = self._plain(x)

    def step(self, t: float, coefficients: Array) -> None:
        """Note a step's start and Taylor coefficients."""
        self.starts.append(t)
        self.coefficients.append(coefficients)

    def event(
        self,
        kind: str,
        t: float,
        x: Array,
        before: str,
        after: str,
        guard: Guard | None,
        name: str = "",
        x_after: Array | None = None,
    ) -> Event:
        """Note an event of a guard, or one with a name; a reset leads from ``x`` to ``x_after``."""
        state = self._plain(x)
        following = state if x_after is None or x_after is x else self._plain(x_after)
        name = name or ("" if guard is None else guard_name(self.system, guard))
        of = (-1, 0) if guard is None else (guard.element, guard.side)
        event = Event(kind, t, state, before, after, name, following, *of)
        self.events.append(event)
        return event

    def trajectory(
        self, status: Status, message: str, accumulation_time: float | None = None
    ) -> Trajectory:
        """Return the run; the status says how it ended, the message what happened."""
        return Trajectory(
            system=self.system,
            parameters=dict(zip(self.system.parameter_names, self.p.tolist(), strict=True)),
            t=np.array(self.t),
            x=np.array(self.x),
            events=self.events,
            segments=self.segments,
            status=status,
            message=f"{message} {ADVICE[status]}",
            accumulation_time=accumulation_time,
            steps=Steps(np.array(self.starts), self.coefficients),
        )

    def _plain(self, x: Array) -> Array:
        return x[: self.system.dimension].copy()
