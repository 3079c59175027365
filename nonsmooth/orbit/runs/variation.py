"""Derivatives along a run by state-transition matrices of its legs and saltation matrices of its events.

A run with a fixed itinerary is a chain of smooth maps. Each leg has its state-transition matrix X and its
derivatives P by parameters, each event its saltation matrices (``saltation``). Derivatives of the end are
their product; events that accumulate have a limit (``limits``). Gradients of a cost are the same product from the
other end, without X and P: rows are pulled back through the recursion of each step's series
(``flow/core/legs/adjoint.c``). That is the exact discrete adjoint,
without backward integration, which is impossible through an entry to sliding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from ...flow.names import described
from ...flow.trajectory import Trajectory
from ...flow.variation import NONE, ROUNDING, Precision, carry_legs, require_done
from ...model import (
    Array,
    ConvergenceError,
    DegenerateError,
    FilippovSystem,
    require_plain,
)
from ...model.derivatives.event_maps import AtEvent
from ...model.laws.motion import rests_on
from ...result_tables import ResultTable, Tabular
from .cells import cells_of
from .guards import watch
from .legs import (
    Leg,
    LegFlow,
    Stretch,
    carry_leg,
    flows_of,
    held_before,
    leg_name,
    parameters_of,
    rate_at,
    sets_left,
    stretches,
)
from .limits import AtLimit, Nearest, limits_of, rest_at
from .saltation import Ended, Saltation, saltation, saltations

# Grazings within the error of a run ---------------------------------------------------------------

#: Angle between orbit and surface above which no event is within the error of a run.
_STEEP = 1e-3

#: Depth of a grazing, relative to the error of the run, above which it happens for certain.
_CERTAIN = 4.0

#: Relative rounding of an event's function.
_ROUNDING = 16.0 * float(np.finfo(float).eps)

#: Relative step of the difference that gives the rate of a speed.
_INSTANT = 1e-5


def _require_certain(run: Trajectory, parts: Sequence[Passage]) -> None:
    """Raise for a run with a grazing that is within its own error, and leaves the derivative not continuous."""
    flat = [
        k
        for k, part in enumerate(parts)
        if part.event and not (part.event.kept or part.repeats) and part.event.angle < _STEEP
    ]
    error = np.zeros(
        run.system.extended_dimension
    )  # of the run, relative to the orbit from its start
    for k, part in enumerate(parts[: flat[-1] + 1] if flat else ()):
        flow, own = part.flow, part.stretch
        if part.back:
            flow = carry_leg(own.system, own.leg, own.start, own.duration, own.p)
        error = flow.by_start @ error + own.end - flow.end
        if k in flat:
            _require_deep(run, part, error)
        if part.event is not None:
            error = part.event.matrix @ error


def _require_deep(run: Trajectory, part: Passage, error: Array) -> None:
    """Raise for a grazing that is no deeper than the error (N,) of the run."""
    leg, flow, system, p = part.stretch.leg, part.flow, part.stretch.system, part.stretch.p
    at = leg.at_event(system, flow.end, p)
    speed = _speed(at, flow.rate)
    size, length = math.hypot(*flow.end), math.hypot(*flow.rate)
    step = _INSTANT * min(part.stretch.duration, size / length if size and length else math.inf)
    before = flow.end - step * flow.rate
    rate = rate_at(system, leg, before, p)
    turning = (speed - _speed(leg.at_event(system, before, p), rate)) / step if step else 0.0
    if not turning * speed < 0.0:
        return  # it does not turn back
    depth = 0.5 * speed**2 / abs(turning)
    wrong = abs(float(at.gradient @ error))
    wrong += _ROUNDING * float(np.abs(at.gradient) @ np.abs(flow.end))
    if depth > _CERTAIN * wrong:
        return
    raise DegenerateError(
        f"{leg_name(run.system, part.stretch.shown)} at t = {part.stretch.t + part.stretch.duration:.10g} is a grazing: the orbit turns "
        f"back {depth:.1e} beyond it, with an error of {wrong:.1e}. Simulate with a smaller tol, or move the "
        "start or a parameter away from the grazing."
    )


def _speed(at: AtEvent, rate: Array) -> float:
    return float(at.gradient @ rate)


# Legs without Taylor series at an end -------------------------------------------------------------

_STAGES = 12

#: Power of the time from an end of a leg on which its nodes there lie: roots have no derivative at zero.
_POWER = 8

#: Ends of panels in the root of that power, coarse and fine.
_COARSE, _FINE = (0.0, 0.25, 1.0), (0.0, 0.0625, 0.25, 0.5, 1.0)

#: Relative difference of derivatives with coarser panels above which they are refused.
_COLLOCATED = 1e-6


def _collocated(run: Trajectory, part: Stretch, t_end: float, chosen: tuple[int, ...]) -> LegFlow:
    """Derivatives of a leg of a run to a time, by Gauss collocation graded to both ends."""
    coarse, end, rate = _by_panels(run, part, t_end, chosen, _COARSE)
    derivatives, _, _ = _by_panels(run, part, t_end, chosen, _FINE)
    wrong = float(np.abs(derivatives - coarse).max())
    if not wrong <= _COLLOCATED * max(1.0, float(np.abs(derivatives).max())):
        raise DegenerateError(_without_derivative(leg_name(run.system, part.shown), t_end))
    n = len(end)
    return LegFlow(end, derivatives[:, :n], derivatives[:, n:], rate)


def _by_panels(
    run: Trajectory,
    part: Stretch,
    t_end: float,
    chosen: tuple[int, ...],
    cuts: tuple[float, ...],
) -> tuple[Array, Array, Array]:
    field, t_start, p = part.leg.field(part.system, chosen), part.t, part.p
    n, starts = field.by_start, run.steps.starts
    first = max(int(np.searchsorted(starts, t_start, side="right")) - 1, 0)
    last = max(int(np.searchsorted(starts, t_end, side="left")), first + 1)
    start = _polynomial(run, first, t_start - float(starts[first]), n)[0]
    derivatives = field.initial(start, p)[:, 1:]
    _, weights, inner = _gauss(_STAGES)
    for k in range(first, last):
        low = max(float(starts[k]), t_start)
        high = min(float(starts[k + 1]) if k + 1 < len(starts) else t_end, t_end)
        if high <= low:
            continue
        low, high = low - float(starts[k]), high - float(starts[k])
        for times, rates in _panels(low, high, k == first, k == last - 1, cuts):
            values = [field.linear.copied(_polynomial(run, k, t, n)[0], p)[1:] for t in times]
            a = rates[:, None, None] * np.array([v[0] for v in values])
            b = np.zeros((_STAGES, *derivatives.shape))
            b[:, :, n:] = rates[:, None, None] * np.array([v[1][:, list(chosen)] for v in values])
            if not np.array_equal(rates, rates[:1].repeat(_STAGES)):  # a root of rounding, maybe
                a[~np.isfinite(a)] = b[~np.isfinite(b)] = 0.0
            try:
                derivatives = derivatives + _increment(a, b, derivatives, inner, weights)
            except np.linalg.LinAlgError:
                at = float(starts[k]) + float(times[0])
                raise DegenerateError(
                    _without_derivative(leg_name(run.system, part.shown), at)
                ) from None
    end, rate = _polynomial(run, last - 1, t_end - float(starts[last - 1]), n)
    return derivatives, end, rate


def _panels(
    low: float, high: float, begins: bool, ends: bool, cuts: tuple[float, ...]
) -> Iterator[tuple[Array, Array]]:
    """Nodes of the panels of a step, and the rates of time there for a panel of unit length."""
    nodes = _gauss(_STAGES)[0]
    middle = 0.5 * (low + high) if begins and ends else low if ends else high
    if begins:
        for one, two in pairwise(cuts):
            s = one + (two - one) * nodes
            rates = _POWER * s ** (_POWER - 1) * (two - one)
            yield low + (middle - low) * s**_POWER, (middle - low) * rates
    if not (begins or ends):
        yield low + (high - low) * nodes, np.full(_STAGES, high - low)
    if ends:
        for two, one in pairwise(reversed(cuts)):
            s = two + (one - two) * nodes
            rates = _POWER * s ** (_POWER - 1) * (two - one)
            yield high - (high - middle) * s**_POWER, (high - middle) * rates


def _without_derivative(what: str, t: float) -> str:
    return (
        f"{what}: the derivative is not finite, or not resolved, near t = {t:.10g}, as at the zero of a root. "
        "Start or end the run on one side of it."
    )


def _polynomial(run: Trajectory, step: int, t: float, n: int) -> tuple[Array, Array]:
    """State and rate at a time from the start of a step."""
    c = run.steps.coefficients[step][:n]
    degrees = np.arange(c.shape[1])
    powered = t**degrees
    return c @ powered, c[:, 1:] @ (degrees[1:] * powered[:-1])


def _increment(a: Array, b: Array, s: Array, inner: Array, weights: Array) -> Array:
    """Increment over [0, 1] of S' = A S + B by collocation: sum_i w_i K_i, K = A (S + a K) + B."""
    m, n = a.shape[:2]
    system = np.eye(m * n) - (a[:, :, None, :] * inner[:, None, :, None]).reshape(m * n, m * n)
    rates = np.linalg.solve(system, (a @ s + b).reshape(m * n, -1)).reshape(m, n, -1)
    return np.asarray(np.einsum("i,ijk->jk", weights, rates))


@lru_cache(maxsize=1)
def _gauss(stages: int) -> tuple[Array, Array, Array]:
    """Nodes and weights of Gauss on [0, 1] and the integrals a_ij of the Lagrange basis to node i."""
    legendre = np.polynomial.legendre
    x, w = legendre.leggauss(stages)
    values = legendre.legvander(x, stages - 1)
    integrals = np.column_stack(
        [legendre.legval(x, legendre.legint(row, lbnd=-1)) for row in np.eye(stages)]
    )
    return (x + 1) / 2, w / 2, np.linalg.solve(values.T, integrals.T).T / 2


@dataclass(eq=False)
class Passage:
    """A leg of a run and the event that ends it, with derivatives."""

    stretch: Stretch
    flow: LegFlow
    event: Saltation | None  # None where a time ends the leg
    #: Where its samples are among those of the run.
    samples: slice
    #: Whether it was recorded so that rows can be pulled back, in place of derivatives.
    back: bool = False
    #: Derivatives of where it begins by the start of the run and by all parameters, if that is not free.
    held: Nearest | None = None
    #: The limit of events that ends it.
    limit: AtLimit | None = None
    #: Whether its event is one of those that accumulate.
    repeats: bool = False

    def forward(self, dx: Array, dp: Array) -> tuple[Array, Array]:
        """Carry derivatives by start (N, m) and parameters (N, q) to the end of the leg's flow."""
        by_start = self.flow.by_start
        return by_start @ dx, by_start @ dp + self.flow.by_parameters

    def at_samples(self, dx: Array, dp: Array) -> tuple[Array, Array]:
        """The same at the samples of the leg."""
        found, n = self.flow.at_samples, len(dx)
        assert found is not None
        by_start = found[:, :, :n]
        return by_start @ dx, by_start @ dp + found[:, :, n:]

    def moments(self, dx: Array, dp: Array, chosen: Sequence[int]) -> tuple[Array, Array]:
        """Derivatives of the time of the event, from those at the end of the flow."""
        assert self.event is not None
        s = self.event
        return s.time_by_state @ dx, s.time_by_state @ dp + s.time_by_parameters[list(chosen)]

    def through(
        self, dx: Array, dp: Array, t_x: Array, t_p: Array, chosen: Sequence[int]
    ) -> tuple[Array, Array]:
        """Carry derivatives at the end of the flow through the event, whose time has derivatives too."""
        assert self.event is not None
        s = self.event
        if not s.smooth:
            dx, dp = s.after_state @ dx, s.after_state @ dp + s.after_parameters[:, list(chosen)]
        if s.kept:
            return dx, dp
        return dx - np.multiply.outer(s.jump, t_x), dp - np.multiply.outer(s.jump, t_p)

    def backward(self, row: Array, rows: Array, by_parameters: Array) -> Array:
        """Pull a row (N,) at the end of the flow, and rows (K, N) at the samples of the run, back to the start, and add
        their derivatives by the chosen parameters, or by all where the legs were recorded."""
        flow, n = self.flow, len(row)
        if self.back and flow.carried is not None:
            carried, leg = flow.carried
            carried.row[:] = row
            carried.pull(leg)
            return carried.row
        by_parameters += row @ flow.by_parameters
        row, own = row @ flow.by_start, rows[self.samples]
        if flow.at_samples is not None and len(own):
            more = np.einsum("ki,kij->j", own, flow.at_samples)
            row = row + more[:n]
            by_parameters += more[n:]
        return row


def discrete_indices(system: FilippovSystem) -> slice:
    """Where the discrete states are among the states: nothing has a derivative by them."""
    return slice(system.dimension - len(system.definition.discrete), system.dimension)


def passages(
    run: Trajectory, chosen: tuple[int, ...], times: Array = NONE, back: bool = False
) -> list[Passage]:
    """Legs and events of a run, with derivatives by the start of each and by chosen parameters, also at times of
    samples; or recorded, so that rows can be pulled ``back``."""
    system = run.system
    if system.sets:
        require_plain(system, "sensitivity with sets")
    parts = stretches(run, driven=True)
    ends, last = [part.t for part in parts[1:]], parts[-1]
    if last.leg.kind not in ("end", "stop"):  # samples from it on are behind the event
        ends.append(last.t + last.duration)
    cuts = [0, *np.searchsorted(times, ends, side="left").tolist(), len(times)][: len(parts) + 1]
    since = times
    if len(times):
        counts, spans = np.diff(cuts), np.array([(part.t, part.duration) for part in parts])
        begun, durations = np.repeat(spans, counts, axis=0).T
        since = np.clip(times[: cuts[-1]] - begun, 0.0, durations)
    found = passages_over(run, parts, chosen, since, cuts, back)
    if not system.sets:
        _require_certain(run, found)
    first = parts[0]
    own = rests_on(first.system, first.leg.mode)
    resting = list(dict.fromkeys(first.system.entry_of(i) for i in own))
    held = rest_at(first.system, first.leg, resting, first.start, first.p)
    return [replace(found[0], held=held), *found[1:]]


def beginning_of(part: Stretch) -> Stretch:
    """The first instant of a leg."""
    x, leg = part.start, Leg(part.leg.mode, left=part.leg.left)
    return replace(part, leg=leg, duration=0.0, end=x, after=x)


def passages_to(
    run: Trajectory, parts: Sequence[Stretch], i: int, first: int = 0, chosen: tuple[int, ...] = ()
) -> list[Passage]:
    """Legs and events of a run from leg ``first`` to the limit that ends leg i, and where the next one starts."""
    own = list(parts[first : i + 2])
    if i + 1 < len(parts):
        own[-1] = beginning_of(own[-1])
    return passages_over(run, own, chosen)


def passages_over(
    run: Trajectory,
    parts: Sequence[Stretch],
    chosen: tuple[int, ...] = (),
    since: Array = NONE,
    cuts: Sequence[int] = (),
    back: bool = False,
    precision: Precision = ROUNDING,
) -> list[Passage]:
    """Legs of a run with derivatives, also at times ``since`` their starts that are cut by legs; or recorded."""
    cuts = cuts or [0] * (len(parts) + 1)
    flows = flows_over(run, parts, chosen, since, cuts, back, precision)
    limits, repeating = _limits(parts, flows)
    events = _saltations(run, parts, flows, repeating)
    every = zip(parts, flows, events, pairwise(cuts), strict=True)
    return [
        Passage(part, flow, event, slice(*own), back, limit=limits.get(i), repeats=i in repeating)
        for i, (part, flow, event, own) in enumerate(every)
    ]


def carried(
    parts: Sequence[Passage], dx: Array, dp: Array, chosen: tuple[int, ...]
) -> Iterator[tuple[Passage, tuple[Array, Array], tuple[Array, Array] | None, tuple[Array, Array]]]:
    """Legs with derivatives, by the start (N, m) and parameters (N, q), where they begin, of the times of their events, and
    behind these."""
    needed = {k for part in parts if part.limit for k in part.limit.limit.points}
    seen, width = dict[int, tuple[Array, Array]](), dx.shape[1]
    given = np.zeros((len(parts[0].stretch.p), width + len(chosen)))
    given[list(chosen), width + np.arange(len(chosen))] = 1.0
    for i, part in enumerate(parts):
        begin, times = (dx, dp), None
        dx, dp = part.forward(dx, dp)
        if part.limit is not None:
            found = part.limit.through([seen[k] for k in part.limit.limit.points], given)
            times, (dx, dp) = ((k[..., :width], k[..., width:]) for k in found)
        elif part.event is not None:
            times = part.moments(dx, dp, chosen)
            if part.stretch.leg.kind == "stop":
                rate = part.flow.rate
                dx, dp = (k + np.outer(rate, t) for k, t in zip((dx, dp), times, strict=True))
            else:
                dx, dp = part.through(dx, dp, *times, chosen)
            if i in needed:
                seen[i] = np.concatenate(times), np.hstack([dx, dp])
        yield part, begin, times, (dx, dp)


def flows_over(
    run: Trajectory,
    parts: Sequence[Stretch],
    chosen: tuple[int, ...] = (),
    since: Array = NONE,
    cuts: Sequence[int] = (),
    back: bool = False,
    precision: Precision = ROUNDING,
) -> list[LegFlow]:
    """Flows of legs, with samples at times ``since`` their starts that are cut by legs."""
    cuts = cuts or [0] * (len(parts) + 1)
    system = parts[0].system
    arcs = [part.leg.arc(system, part.start, part.duration) for part in parts]
    p = np.array([part.p for part in parts]) if system is not run.system else parts[0].p
    found = carry_legs(system, arcs, p, chosen, since, cuts, back, precision)
    if found.failed < 0:
        return flows_of(found)
    if back:
        require_done(system, arcs, found)
    own = zip(parts, pairwise(cuts), strict=True)
    return [_flow(run, part, since[i:j], chosen) for part, (i, j) in own]


def _limits(
    parts: Sequence[Stretch], flows: Sequence[LegFlow]
) -> tuple[dict[int, AtLimit], set[int]]:
    """Limits of events by the legs that they end, and the legs whose events accumulate."""
    found, repeating = dict[int, AtLimit](), set[int]()
    for i, (limit, tail) in limits_of(parts).items():
        part = parts[i]
        rates = np.array([_rate_at_start(parts[k + 1], flows[k + 1]) for k in limit.points])
        rest = after = None
        if i + 1 < len(parts):
            then = parts[i + 1]
            letters = enumerate(zip(part.leg.mode, then.leg.mode, strict=True))
            resting = [k for k, (one, two) in letters if one != two and two in "sc"]
            rest = rest_at(then.system, then.leg, resting, limit.value[1:], then.p)
            x = limit.value[1:] if rest is None else rest.x
            after = rate_at(then.system, then.leg, x, then.p)
        found[i] = AtLimit(limit, rates, rest, after)
        repeating.update(tail)
    return found, repeating


def _rate_at_start(part: Stretch, flow: LegFlow) -> Array:
    rate, n = flow.before, len(part.start)
    usual = rate is not None and not part.system.sets and bool(np.isfinite(rate).all())
    return (
        rate[:n]
        if usual and rate is not None
        else rate_at(part.system, part.leg, part.start, part.p)
    )


def _saltations(
    run: Trajectory, parts: Sequence[Stretch], flows: Sequence[LegFlow], repeating: set[int]
) -> list[Saltation | None]:
    """Events of legs; None where a time or a limit ends one. Those that repeat are no grazings."""
    system, result = run.system, list[Saltation | None]([None] * len(parts))
    before = np.array(
        [np.full(len(f.end), np.nan) if f.before is None else f.before for f in flows]
    )
    usual = (np.isfinite(before).all(axis=1) & (not system.sets)).tolist()
    which, events = list[int](), list[AtEvent]()  # by one formula
    for i, (part, flow) in enumerate(zip(parts[:-1], flows, strict=False)):
        if part.leg.kind == "limit":
            continue
        if usual[i + 1] and not (part.leg.timed or part.leg.at_start):
            which.append(i)
            events.append(flow.at or part.leg.at_event(part.system, flow.end, part.p))
        else:
            then = parts[i + 1], flows[i + 1]
            result[i] = saltation_after(run, part, flow, *then, i in repeating)
    if parts[-1].leg.kind != "limit":
        result[-1] = saltation_after(run, parts[-1], flows[-1], None, None)
    if which:
        stacked, after = _stacked(events, [flows[i].rate for i in which]), before[1:][which]
        slow = np.array([i in repeating for i in which]) if repeating else None
        made = saltations(stacked, after, lambda k: _at(run, parts[which[k]]), slow=slow)
        for k, (i, at) in enumerate(zip(which, events, strict=True)):
            result[i] = made.of(k, at.smooth)
    return result


def _stacked(events: Sequence[AtEvent], rates: Sequence[Array]) -> Ended:
    """Events, stacked."""
    count, n, q = len(events), len(rates[0]), len(events[0].by_parameters)
    if all(at.smooth for at in events):
        maps, by_p = np.broadcast_to(np.eye(n), (count, n, n)), np.broadcast_to(0.0, (count, n, q))
    else:
        maps = np.array([at.after_state for at in events])
        by_p = np.array([at.after_parameters for at in events])
    gradients = np.array([at.gradient for at in events])
    return Ended(
        np.array(rates), maps, by_p, gradients, np.array([at.by_parameters for at in events])
    )


def _at(run: Trajectory, part: Stretch) -> str:
    return f"{part.shown.name(run.system)!r} at t = {part.t + part.duration:.10g}"


def _flow(run: Trajectory, part: Stretch, times: Array, chosen: tuple[int, ...]) -> LegFlow:
    try:
        return carry_leg(part.system, part.leg, part.start, part.duration, part.p, chosen, times)
    except ConvergenceError:
        if run.system.sets:
            what = leg_name(run.system, part.shown)
            raise DegenerateError(_without_derivative(what, part.t + part.duration)) from None
        # A field such as a power law has a derivative, but no Taylor series at zero.
        collocated = lambda t: _collocated(run, part, part.t + t, chosen)
        at = [collocated(float(t)) for t in times]
        rows = [np.hstack([flow.by_start, flow.by_parameters]) for flow in at]
        n = len(part.start)
        stacked = np.array(rows).reshape(len(at), n, n + len(chosen))
        return replace(collocated(part.duration), at_samples=stacked)


def saltation_after(
    run: Trajectory,
    part: Stretch,
    flow: LegFlow,
    following: Stretch | None,
    then: LegFlow | None,
    slow: bool = False,
) -> Saltation | None:
    """The saltation of the event that ends a leg, ``slow`` as one of those that accumulate; None where a time ends it."""
    # At the end of a run the field after it is that of the mode reached.
    if part.leg.timed:
        return None
    system, p, ends = part.system, part.p, run.events[-1]
    leg, after_p = (following.leg, following.p) if following else (None, p)
    if leg is None and ends.kind == "end":
        cells = cells_of(run.system)
        mode = cells.mode(ends.mode_before)
        after_p = cells.parameters(parameters_of(run), ends.mode_before)
        left = sets_left(system, held_before(system, part.leg), mode, part.after, p)
        leg = Leg(mode, left=left)
    at = flow.at or part.leg.at_event(system, flow.end, p)
    if system.sets and following is None and leg is not None:  # the run ends at the event
        every = tuple(range(len(p)))
        landed = carry_leg(system, leg, at.after, 0.0, after_p, every)
        by_state, by_p = landed.by_start @ at.after_state, landed.by_start @ at.after_parameters
        by_p = by_p + landed.by_parameters
        at = replace(at, after_state=by_state, after_parameters=by_p, smooth=False)
    if part.leg.at_start:
        still = np.zeros(flow.rate.size), np.zeros(len(p))
        jump = np.zeros(len(at.after))
        maps = at.after_state, at.after_parameters
        return Saltation(*maps, jump, *still, 1.0, kept=True, smooth=at.smooth)
    if part.leg.kind == "stop" or leg is None:
        return saltation(at, flow.rate, at.after_state @ flow.rate, _at(run, part))
    after = None if then is None or system.sets else then.before
    if after is None or not np.isfinite(after).all():
        after = _rate_after(part, leg, at, after_p)
    if after is None and part.leg.kind == "exit":  # the fields agree
        after = at.after_state @ flow.rate
    if after is None:
        raise DegenerateError(
            f"{_at(run, part)}: the field after the event is not finite at {part.after.tolist()}. "
            "Start or end the run on one side of it."
        )
    return saltation(at, flow.rate, after, _at(run, part), slow)


def _rate_after(part: Stretch, leg: Leg, at: AtEvent, p: Array) -> Array | None:
    """The field after an event, also where a root of its function has rounding as its argument."""
    n = len(part.start)
    e = at.gradient[:n]
    shift = _ROUNDING * float(np.abs(e) @ np.abs(part.after)) * e / max(float(e @ e), 1e-300)
    with np.errstate(all="ignore"):
        for x in (at.after, part.after, part.after + shift, part.after - shift):
            rate = rate_at(part.system, leg, x, p)
            if np.all(np.isfinite(rate)):
                return rate
    return None


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Tabular):
    """Derivatives of the end of a run and of the times of its events.

    Attributes
    ----------
    dx_dx0 : ndarray (n, n)
        Derivatives of the final state by the start; zero by discrete states, and of them.
    dx_dp : ndarray (n, q)
        Derivatives of the final state by the parameters ``names``.
    event_times : ndarray (m,)
        Times of the events.
    dt_dx0, dt_dp : ndarray (m, n), (m, q)
        Derivatives of the event times.
    dt_end_dx0, dt_end_dp : ndarray (n,), (q,)
        Derivatives of the final time: zero unless a stop, or a limit of events, ended the run.
    names : tuple of str
        Names of the parameters.
    run : Trajectory
        The run that was differentiated; for one-sided derivatives its nearest neighbour.
    dsample_dx0, dsample_dp : ndarray (K, n, n), (K, n, q) or None
        Derivatives of ``run.sample_x``, at fixed times: None without samples, NaN where a sample is. A sample at the
        time of an event is on the side of ``sample_x``, after it where both agree.
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
    dsample_dx0: Array | None = None
    dsample_dp: Array | None = None

    def _tables(self) -> dict[str, ResultTable]:
        states = self.run.system.state_names
        labels = {"start": states, "parameter": self.names}
        by = lambda name, x0, p: {f"{name}_dx0": ("start", x0), f"{name}_dp": ("parameter", p)}
        times = {"t": self.event_times, **by("dt", self.dt_dx0, self.dt_dp)}
        tables = {
            "end": ResultTable({"state": states}, by("dx", self.dx_dx0, self.dx_dp), labels),
            "events": ResultTable({"event": len(self.event_times)}, times, labels),
        }
        if self.dsample_dx0 is not None:
            rows = {"sample": ("t", self.run.sample_t), "state": states}
            columns = by("dx", self.dsample_dx0, self.dsample_dp)
            tables["samples"] = ResultTable(rows, columns, labels)
        return tables

    @cached_property
    def clearance(self) -> float:
        """Smallest distance ``h/|grad h|`` at which the run passed a guard without reaching it.

        Perturbations of that size may change the itinerary, and with it the derivative. It is infinite
        where the run passes none.
        """
        return self._nearest[0]

    @cached_property
    def nearest(self) -> str:
        """The guard of ``clearance``, and when it was nearest; empty where there is none."""
        return self._nearest[1]

    @cached_property
    def _nearest(self) -> tuple[float, str]:
        return _clearance(self.run)

    def __repr__(self) -> str:
        near = f"; clearance {self.clearance:.3g} ({self.nearest})" if self.nearest else ""
        return (
            f"Sensitivity({self.dx_dx0.shape[0]} states, parameters {', '.join(self.names) or '-'}, "
            f"{len(self.event_times)} events{near})"
        )


def _clearance(run: Trajectory) -> tuple[float, str]:
    """Smallest distance from a guard that a run passed without reaching it, with its name and time."""
    p, best = parameters_of(run), (math.inf, "")
    for part in stretches(run, driven=True):
        if part.duration <= 0.0:
            continue
        try:
            seen = watch(run.system, part.shown, part.start, part.duration, p).approaches
        except ConvergenceError:
            continue  # no Taylor series at an end
        for near in seen:
            if abs(near.distance) < best[0]:
                guard = described(run.system, near.guard)
                best = (abs(near.distance), f"{guard} at t = {part.t + near.t:.6g}")
    return best


def sample_times(run: Trajectory) -> Array:
    """Times of the samples of a run, just before an event where ``sample_x`` is the state before it."""
    if run.sample_t is None or run.sample_x is None:
        return NONE
    found = run.sample_t[np.isfinite(run.sample_t)].copy()
    for event in run.events:
        for k in np.flatnonzero(found == event.t) if event.kind != "end" else ():
            x = run.sample_x[k]
            if np.array_equal(x, event.x) and not np.array_equal(x, event.x_after):
                found[k] = np.nextafter(event.t, -np.inf)
    return found


def numbers_of(run: Trajectory, names: Sequence[str]) -> tuple[int, ...]:
    """Numbers of parameters by their names."""
    known = {name: k for k, name in enumerate(run.system.parameter_names)}
    return tuple(known[name] for name in names)


def along(run: Trajectory, names: Sequence[str]) -> Sensitivity:
    """Derivatives of a run by its start and by parameters."""
    system, n = run.system, run.system.dimension
    chosen, at = numbers_of(run, names), sample_times(run)
    parts = passages(run, chosen, at)
    dx, dp = np.eye(system.extended_dimension), np.zeros((system.extended_dimension, len(chosen)))
    if (held := parts[0].held) is not None:
        dx, dp = held.by_state, held.by_parameters[:, list(chosen)]
    dx[:, discrete_indices(system)] = 0.0
    times, by_start, by_parameters = list[float](), list[Array](), list[Array]()
    sampled = list[tuple[Array, Array]]()
    end_x, end_p, last = np.zeros(len(dx)), np.zeros(len(chosen)), (dx, dp)
    for part, begin, moved, end in carried(parts, dx, dp, chosen):
        sampled.append(part.at_samples(*begin))
        if moved is not None:
            times.append(part.stretch.t + part.stretch.duration)
            by_start.append(moved[0][:n])
            by_parameters.append(moved[1])
            if part is parts[-1] and (part.limit or part.stretch.leg.kind == "stop"):
                end_x, end_p = moved
        last = end
    dx, dp = last
    m, q = len(times), len(chosen)
    if not (np.isfinite(dx).all() and np.isfinite(dp).all()):
        first = next((k for k in parts if not np.isfinite(k.flow.by_start).all()), parts[-1])
        raise DegenerateError(
            _without_derivative(leg_name(system, first.stretch.shown), float(run.t[-1]))
        )
    behind = len(at) - parts[-1].samples.stop
    sampled.append((dx[None].repeat(behind, 0), dp[None].repeat(behind, 0)))
    found = None if run.sample_t is None else len(run.sample_t)
    return Sensitivity(
        dx_dx0=dx[:n, :n],
        dx_dp=dp[:n],
        event_times=np.array(times),
        dt_dx0=np.array(by_start).reshape(m, n),
        dt_dp=np.array(by_parameters).reshape(m, q),
        dt_end_dx0=end_x[:n],
        dt_end_dp=end_p,
        names=tuple(names),
        run=run,
        dsample_dx0=None if found is None else _rows([k[:, :n, :n] for k, _ in sampled], found),
        dsample_dp=None if found is None else _rows([k[:, :n] for _, k in sampled], found),
    )


def _rows(found: Sequence[Array], count: int) -> Array:
    """Derivatives at samples, stacked, with NaN where a run has ended."""
    every = np.concatenate(found)
    missing = np.full((count - len(every), *every.shape[1:]), np.nan)
    return np.concatenate([every, missing])
