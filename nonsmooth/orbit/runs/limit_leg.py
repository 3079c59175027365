"""Legs of infinitely many events: from behind one of them to their limit, as functions of the start.

The states of such a leg are those at the limit x_inf and the time t_inf - T that is left to it after the duration T: it
ends where that is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...flow.simulate import simulate
from ...flow.trajectory import Trajectory
from ...model import Array, ConvergenceError, DegenerateError, FilippovSystem
from .legs import Leg, LegFlow, Stretch, leg_name, stretches
from .limits import tail_of
from .variation import carried, passages_to

_TOLERANCE = 1e-12

#: A limit is searched for over so many times the duration of its leg, and over more if it is not found.
_LONGER = (1.3, 4.0)

#: Largest ratio of consecutive times between events that accumulate.
_GROWS = 10.0


def merged(parts: Sequence[Stretch]) -> list[Stretch]:
    """Legs of a run, where those from behind the first of events that accumulate are one."""
    result = list[Stretch]()
    for part in parts:
        result.append(part)
        if part.leg.kind != "limit" or part.leg.repeats:
            continue
        first = 1 + max((k for k, one in enumerate(result) if one.leg.repeats), default=-1)
        tail, block = tail_of(result[first:-1])
        if not len(tail) > block:
            continue
        start = result[first + tail.start + 1]
        leg = replace(start.leg, kind="limit", element=part.leg.element, side=0, letters="")
        repeats = tuple(result[first + k].leg for k in tail[1 : 1 + block])
        whole = replace(
            part, leg=replace(leg, repeats=repeats), t=start.t, start=start.start,
            duration=part.t + part.duration - start.t,
        )  # fmt: skip
        result[first + tail.start + 1 :] = [whole]
    return result


def limit_run(
    system: FilippovSystem, leg: Leg, x: Array, duration: float, p: Array
) -> tuple[Trajectory, list[Stretch], int]:
    """The run of a leg of infinitely many events, its legs, and the number of the one that ends at the limit."""
    n, names = system.dimension, system.parameter_names
    t = float(x[n]) if system.time_dependent else 0.0
    given = dict(zip(names, p.tolist(), strict=True))
    for longer in _LONGER:
        t_end = t + longer * abs(duration)
        run = simulate(system, x[:n], t_end, t_start=t, parameters=given, tol=_TOLERANCE)
        parts = stretches(run)
        i = next((k for k, part in enumerate(parts) if part.leg.kind == "limit"), None)
        if i is None or i + 1 == len(parts) or parts[i].leg.element != leg.element:
            continue
        spans = np.array([part.duration for part in parts[:i]])
        if (spans > _GROWS * np.minimum.accumulate(spans)).any():
            break  # that is the limit of other events, after these have ceased
        return run, parts, i
    raise ConvergenceError(
        f"{leg_name(system, leg)} from {x.tolist()}: events do not accumulate.", point=x
    )


def limit_flow(
    system: FilippovSystem, leg: Leg, x: Array, duration: float, p: Array, chosen: tuple[int, ...]
) -> tuple[LegFlow, Array]:
    """The flow of a leg of infinitely many events from ``x`` (N,), with derivatives, and the field (N,) behind it."""
    run, parts, i = limit_run(system, leg, _on_event(system, leg, x, p), duration, p)
    try:
        passed = passages_to(run, parts, i, 0, chosen)
    except DegenerateError as error:
        raise ConvergenceError(f"{leg_name(system, leg)}: {error}", point=x) from None
    start = np.eye(len(x)), np.zeros((len(x), len(chosen)))
    *_, (part, _, times, ends) = carried(passed[:-1], *start, chosen)
    assert times is not None and part.limit is not None and part.limit.after is not None
    t_x, t_p = times
    value, after = part.limit.limit.value, part.limit.after
    state = value[1:] if part.limit.rest is None else part.limit.rest.x
    end = np.append(state, value[0] - parts[0].t - duration)
    by_start, by_parameters = (
        np.vstack([own + np.outer(after, times), times])
        for own, times in zip(ends, (t_x, t_p), strict=True)
    )
    rate = np.append(np.zeros(len(x)), -1.0)
    return LegFlow(end, by_start, by_parameters, rate), after


def _on_event(system: FilippovSystem, leg: Leg, x: Array, p: Array) -> Array:
    """The nearest state (N,) at which the leg's event before it happens, from which it differs by residuals."""
    at, n = leg.repeats[-1].at_event(system, x, p), system.dimension
    row = np.where(np.arange(len(x)) < n, at.gradient[: len(x)], 0.0)
    return np.asarray(x - at.value * row / float(row @ row))
