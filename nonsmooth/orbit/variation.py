"""Derivatives along a run: state-transition matrices of its legs and saltation at its events.

A run with a fixed itinerary is a chain of smooth maps. Each leg gives its state-transition matrix X
and its derivatives P by parameters, each event its saltation matrices (``saltation``); derivatives of
the end are their product, and gradients of a cost are the same product from the other end (the exact
discrete adjoint: nothing is integrated backward, which no method could do through an entry to sliding).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..flow.trajectory import Trajectory
from ..model import Array, ConvergenceError
from .collocation import collocated
from .flight import Flight, Flights
from .guards import described, watch
from .legs import Flown, Leg, Stretch, fly, stretches
from .near_grazes import require_known
from .saltation import Saltation, saltation, saltations


@dataclass(frozen=True, eq=False)
class Passage:
    """A leg of a run and the event that ends it, with derivatives.

    Attributes
    ----------
    stretch : Stretch
    flown : Flown
    event : Saltation or None
        None where a time ends the leg.
    """

    stretch: Stretch
    flown: Flown
    event: Saltation | None

    def forward(self, dx: Array, dp: Array) -> tuple[Array, Array]:
        """Carry derivatives by start (N, m) and parameters (N, q) to the end of the leg's flow."""
        by_start = self.flown.by_start
        return by_start @ dx, by_start @ dp + self.flown.by_parameters

    def through(self, dx: Array, dp: Array, chosen: Sequence[int]) -> tuple[Array, Array]:
        """Carry derivatives at the end of the flow through the event."""
        if self.event is None:
            return dx, dp
        s = self.event
        return s.matrix @ dx, s.matrix @ dp + s.by_parameters[:, list(chosen)]

    def times(self, dx: Array, dp: Array, chosen: Sequence[int]) -> tuple[Array, Array]:
        """Derivatives of the time of the event, from those at the end of the flow."""
        assert self.event is not None
        s = self.event
        return s.time_by_state @ dx, s.time_by_state @ dp + s.time_by_parameters[list(chosen)]

    def backward(self, cotangent: Array, chosen: Sequence[int]) -> tuple[Array, Array]:
        """Pull a row (N,) back through event and flow: the row at the start, and by parameters."""
        by_parameters = np.zeros(len(chosen))
        if self.event is not None:
            by_parameters += cotangent @ self.event.by_parameters[:, list(chosen)]
            cotangent = cotangent @ self.event.matrix
        by_parameters += cotangent @ self.flown.by_parameters
        return cotangent @ self.flown.by_start, by_parameters


def passages(run: Trajectory, chosen: tuple[int, ...]) -> list[Passage]:
    """Legs and events of a run, with derivatives by the start of each and by chosen parameters.

    Raises
    ------
    DegenerateError
        An event that is grazed, also within the run's error; a corner, impacts that accumulate.
    """
    system = run.system
    p = system.parameter_vector(run.parameters)
    parts = stretches(run)
    try:
        flight = Flights(system, [part.leg for part in parts], chosen)(
            np.array([part.start for part in parts]),
            np.array([part.duration for part in parts]),
            p,
        )
    except ConvergenceError:
        found = _one_by_one(run, parts, p, chosen)
        require_known(system, found, p)
        return found
    found = _together(parts, flight)
    if parts[-1].leg.name and run.events[-1].kind == "end":  # the run ends at the very event
        last = found[-1]
        jump = saltation_after(run, last.stretch, last.flown, None, p)
        found[-1] = replace(last, event=jump)
    require_known(system, found, p)
    return found


def _together(parts: Sequence[Stretch], flight: Flight) -> list[Passage]:
    """Legs that were flown together, with the saltation of their events."""
    n = flight.after.shape[1]
    after = np.roll(flight.before[:, :n], -1, axis=0)
    carried = (flight.after_state @ flight.rate[:, :, None])[:, :, 0]
    ends: NDArray[Any] = ~np.all(np.isfinite(after), axis=1)
    ends[-1] = True
    after[ends] = carried[ends]
    events = np.array([bool(part.leg.name) for part in parts])
    found = saltations(flight, after, lambda k: _at(parts[k]), events)
    rows = zip(
        parts,
        flight.flown,
        events.tolist(),
        found.matrix,
        found.by_parameters,
        found.time_by_state,
        found.time_by_parameters,
        found.angle.tolist(),
        flight.sizes,
        strict=True,
    )
    return [
        Passage(part, flown, Saltation(s[:, :k], sp, t[:k], tp, angle) if event else None)
        for part, flown, event, s, sp, t, tp, angle, k in rows
    ]


def _at(part: Stretch) -> str:
    return f"{part.leg.name!r} at t = {part.t + part.duration:.10g}"


def _one_by_one(
    run: Trajectory, parts: Sequence[Stretch], p: Array, chosen: tuple[int, ...]
) -> list[Passage]:
    """Legs of which some have no Taylor series at an end."""
    result: list[Passage] = []
    for k, part in enumerate(parts):
        flown = _flown(run, part, p, chosen)
        following = parts[k + 1] if k + 1 < len(parts) else None
        result.append(Passage(part, flown, saltation_after(run, part, flown, following, p)))
    return result


def _flown(run: Trajectory, part: Stretch, p: Array, chosen: tuple[int, ...]) -> Flown:
    try:
        return fly(run.system, part.leg, part.start, part.duration, p, chosen)
    except ConvergenceError:
        # The field has no Taylor series at an end of the leg (a power law at zero), but a derivative.
        return collocated(run, part.leg, part.t, part.t + part.duration, p, chosen)


def saltation_after(
    run: Trajectory, part: Stretch, flown: Flown, following: Stretch | None, p: Array
) -> Saltation | None:
    """What the event that ends a leg does to neighbours; None where a time ends it.

    At the end of a run that goes no further the field after it is that of the mode reached.

    Raises
    ------
    DegenerateError
        The run grazes there.
    """
    if not part.leg.name:
        return None
    system, n = run.system, len(part.start)
    at = part.leg.at_end(system, flown.end, p)
    ends = run.events[-1]
    leg = following.leg if following else Leg(ends.mode_before) if ends.kind == "end" else None
    if part.leg.kind == "stop" or leg is None:
        after = at.after_state @ flown.rate
    else:
        field = leg.field(system)
        start = field.states_at(at.after, p)
        after = field.rate.copied(start, p)[0][:n, 0]
        if not np.all(np.isfinite(after)):
            after = at.after_state @ flown.rate
    return saltation(at, flown.rate, after, _at(part))


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity:
    """Derivatives of the end of a run and of the times of its events.

    Attributes
    ----------
    dx_dx0 : ndarray (n, n)
        Of the final state by the start.
    dx_dp : ndarray (n, q)
        Of the final state by the parameters ``names``.
    event_times : ndarray (m,)
        Times of the events that the derivatives pass.
    dt_dx0, dt_dp : ndarray (m, n), (m, q)
        Of the event times.
    dt_end_dx0, dt_end_dp : ndarray (n,), (q,)
        Of the final time: zero unless a stop ended the run.
    names : tuple of str
        Of the parameters.
    run : Trajectory
        The run that was differentiated.
    """

    dx_dx0: Array
    dx_dp: Array
    event_times: Array
    dt_dx0: Array
    dt_dp: Array
    dt_end_dx0: Array
    dt_end_dp: Array
    names: tuple[str, ...]
    run: Trajectory

    @cached_property
    def clearance(self) -> float:
        """Smallest distance ``h/|grad h|`` at which the run passed a guard without reaching it.

        Perturbations of that size may change the itinerary, and with it the derivative. Infinite
        where the run passes none.
        """
        return self._nearest[0]

    @cached_property
    def nearest(self) -> str:
        """The guard of ``clearance``, and when it was nearest; empty where there is none."""
        return self._nearest[1]

    @cached_property
    def _nearest(self) -> tuple[float, str]:
        if self.run.system.sets:  # not looked for
            return math.inf, ""
        return clearance(self.run)

    def __repr__(self) -> str:
        near = f"; clearance {self.clearance:.3g} ({self.nearest})" if self.nearest else ""
        return (
            f"Sensitivity({self.dx_dx0.shape[0]} states, parameters {', '.join(self.names) or '-'}, "
            f"{len(self.event_times)} events{near})"
        )


def clearance(run: Trajectory) -> tuple[float, str]:
    """Smallest distance from a guard that a run passed without reaching it, and which and when."""
    p, best = run.system.parameter_vector(run.parameters), (math.inf, "")
    for part in stretches(run):
        if part.duration <= 0.0:
            continue
        try:
            seen = watch(run.system, part.leg.mode, part.start, part.duration, p).approaches
        except ConvergenceError:
            continue  # no Taylor series at an end: nothing is said of this leg
        for near in seen:
            if abs(near.distance) < best[0]:
                when = f"{described(near.guard)} at t = {part.t + near.t:.6g}"
                best = (abs(near.distance), when)
    return best


def along(run: Trajectory, names: Sequence[str]) -> tuple[list[Passage], Sensitivity]:
    """Passages of a run, and the derivatives that follow from them (without the clearance)."""
    system, n = run.system, run.system.dimension
    chosen = tuple(system.parameter_names.index(name) for name in names)
    parts = passages(run, chosen)
    dx, dp = np.eye(system.extended_dimension), np.zeros((system.extended_dimension, len(chosen)))
    times, by_start, by_parameters = list[float](), list[Array](), list[Array]()
    end_x, end_p = np.zeros(system.extended_dimension), np.zeros(len(chosen))
    for part in parts:
        dx, dp = part.forward(dx, dp)
        if part.event is not None:
            t_x, t_p = part.times(dx, dp, chosen)
            times.append(part.stretch.t + part.stretch.duration)
            by_start.append(t_x[:n])
            by_parameters.append(t_p)
            if part.stretch.leg.kind == "stop":
                end_x, end_p = t_x, t_p
                rate = part.flown.rate
                dx, dp = dx + np.outer(rate, t_x), dp + np.outer(rate, t_p)
                continue
        dx, dp = part.through(dx, dp, chosen)
    m, q = len(times), len(chosen)
    return parts, Sensitivity(
        dx_dx0=dx[:n, :n],
        dx_dp=dp[:n],
        event_times=np.array(times),
        dt_dx0=np.array(by_start).reshape(m, n),
        dt_dp=np.array(by_parameters).reshape(m, q),
        dt_end_dx0=end_x[:n],
        dt_end_dp=end_p,
        names=tuple(names),
        run=run,
    )
