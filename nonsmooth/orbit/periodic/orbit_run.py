"""The legs of a periodic orbit, and the orbit as a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...flow.events import Event, Events, Segment, Segments
from ...flow.follow import follow
from ...flow.names import change
from ...flow.simulate import simulate
from ...flow.status import Status
from ...flow.trajectory import Steps, Trajectory
from ...model import Array, FilippovSystem
from ..runs.legs import Leg


@dataclass(frozen=True, eq=False)
class OrbitLeg:
    """A leg of a periodic orbit.

    Attributes
    ----------
    mode : str
        One letter for each surface.
    start : ndarray (n,)
        States at its start.
    t : float
        Of the start: of the forcing, or since the start of the orbit.
    duration : float
        Time that it takes.
    event, kind : str
        Name of the guard that ends it and kind of the event; empty where a time ends it.
    element, side : int
        Of that event, as in ``Event``.
    """

    mode: str
    start: Array
    t: float
    duration: float
    event: str
    kind: str
    element: int = -1
    side: int = 0


def orbit_leg(
    system: FilippovSystem, leg: Leg, start: Array, t: float, duration: float, ends: bool = True
) -> OrbitLeg:
    """A leg with numbers; without its event where it is a part before its end."""
    own = (leg.name(system), leg.kind, leg.element, leg.side) if ends else ("", leg.kind)
    return OrbitLeg(leg.mode, start, t, duration, *own)


#: Absolute tolerance of a leg; the one of a leg that misses its end by more than this part of its size, as where a
#: state that grows again is smaller than the first one.
_ABSOLUTE, _SMALLEST, _MISSED = 1e-12, 1e-250, 1e-7


def orbit_run(
    system: FilippovSystem,
    parameters: Mapping[str, float],
    legs: Sequence[OrbitLeg],
    ends: Sequence[Array] | Array = (),
) -> Trajectory:
    """Integrate each leg over its duration, and join them; ``ends`` are the known ends of the first ones."""
    times, states, starts = list[Array](), list[Array](), list[float]()
    coefficients: list[Array] = []
    implicit: list[bool] = []
    events: list[Event] = []
    segments: list[Segment] = []
    held = system.dimension - len(system.definition.discrete)
    for k, leg in enumerate(legs):
        if leg.duration <= 0.0:
            continue
        end, following, first = leg.t + leg.duration, legs[(k + 1) % len(legs)], len(coefficients)
        given: dict[str, Any] = {"t_start": leg.t, "parameters": parameters, "rtol": 1e-12}
        endless = leg.kind == "limit"
        # one mode has no field at its ends on sets, drifts off joints, or is one of many of tables
        if endless or system.sets or system.written.tables or system.constraints:
            run = simulate(system, leg.start, end, atol=_ABSOLUTE, **given)
        else:
            flow = partial(follow, system, leg.start, end, mode=leg.mode, **given)
            run, known = flow(atol=_ABSOLUTE), ends[k : k + 1]
            near = [abs(run.x[-1] - x).max() <= _MISSED * (1 + abs(x).max()) for x in known]
            run = run if all(near) else flow(atol=_SMALLEST)
        if endless:
            events += [e for e in run.events if e.kind not in ("end", "contact", "rest")]
        times.append(run.t)
        states.append(run.x)
        starts += run.steps.starts.tolist()
        coefficients += list(run.steps.coefficients)
        implicit += run.steps.implicit.tolist()
        values = tuple(leg.start[held:].tolist())
        segments.append(Segment(leg.mode, leg.t, end, first, len(coefficients), values))
        if leg.event:
            modes, of = (leg.mode, following.mode), (leg.element, leg.side)
            kind, after = change(*modes) if endless else leg.kind, following.start
            events.append(Event(kind, end, run.x[-1], *modes, leg.event, after, *of))
    last = states[-1][-1]
    events.append(Event("end", float(times[-1][-1]), last, legs[-1].mode, legs[-1].mode))
    return Trajectory(
        system=system,
        parameters=dict(parameters),
        t=np.concatenate(times),
        x=np.vstack(states),
        events=Events.of(events),
        segments=Segments.of(segments),
        status=Status.REACHED_END,
        message="One period.",
        steps=Steps(np.array(starts), coefficients, np.array(implicit, bool)),
    )
