"""A periodic orbit as a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from ...flow.follow import follow
from ...flow.status import Status
from ...flow.trajectory import Event, Segment, Steps, Trajectory
from ...model import Array, FilippovSystem


class _Leg(Protocol):
    @property
    def mode(self) -> str: ...
    @property
    def start(self) -> Array: ...
    @property
    def t(self) -> float: ...
    @property
    def duration(self) -> float: ...
    @property
    def event(self) -> str: ...
    @property
    def kind(self) -> str: ...


def orbit_run(
    system: FilippovSystem, parameters: Mapping[str, float], legs: Sequence[_Leg]
) -> Trajectory:
    """Integrate each leg over its duration, and join them."""
    times, states, starts = list[Array](), list[Array](), list[float]()
    coefficients: list[Array] = []
    events: list[Event] = []
    segments: list[Segment] = []
    for k, leg in enumerate(legs):
        if leg.duration <= 0.0:
            continue
        run = follow(
            system,
            leg.start,
            leg.t + leg.duration,
            mode=leg.mode,
            t_start=leg.t,
            parameters=parameters,
            tol=1e-12,
        )
        first = len(coefficients)
        times.append(run.t)
        states.append(run.x)
        starts += run.steps.starts.tolist()
        coefficients += list(run.steps.coefficients)
        end, following = leg.t + leg.duration, legs[(k + 1) % len(legs)]
        segments.append(Segment(leg.mode, leg.t, end, first, len(coefficients)))
        if leg.event:
            events.append(
                Event(
                    leg.kind, end, run.x[-1], leg.mode, following.mode, leg.event, following.start
                )
            )
    last = states[-1][-1]
    events.append(Event("end", float(times[-1][-1]), last, legs[-1].mode, legs[-1].mode))
    return Trajectory(
        system=system,
        parameters=dict(parameters),
        t=np.concatenate(times),
        x=np.vstack(states),
        events=events,
        segments=segments,
        status=Status.REACHED_END,
        message="One period.",
        steps=Steps(np.array(starts), coefficients),
    )
