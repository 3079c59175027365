"""Equations and starts for Newton's method from a guess of a periodic orbit.

A guess is a state, a run or an orbit. From a run the itinerary is that of the legs between two events at
nearly the same state. Distances are relative to the range of each state in the run; in a forced system the
time between the events must be a whole number of periods, or half a number with a symmetry.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...flow.fixed import flow_for
from ...flow.simulate import simulate
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    ConvergenceError,
    DefinitionError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    Parameters,
    Surfaces,
    real_array,
)
from ...model.derivatives.forcing import Forcing, common_frequency, frequencies
from ...model.derivatives.variational import plain_field, states_at
from ..runs.guards import march
from ..runs.itinerary import Itinerary, lone_leg, word_legs
from ..runs.legs import Leg, Stretch, integrate_leg, leg_name, rate_at, stretches
from ..runs.limit_leg import merged
from .boundary_value_problem import BoundaryProblem
from .orbit import PeriodicOrbit, named

# Forcing ------------------------------------------------------------------------------------------


def _forcing_of(system: FilippovSystem, period: Any) -> Forcing | None:
    """The period of the forcing as a function of the parameters, given or from the system; or None."""
    if not system.time_dependent:
        return None
    if period is None:
        found = system.cached("frequencies", lambda: frequencies(system))
        common = system.cached("common frequency", lambda: common_frequency(found))
        if common is None:
            raise OptionError(
                f"period is missing, and the system has {len(found)} frequencies {found} in sines and "
                "cosines without a common period. Give the period of the forcing, such as period=2*pi/w."
            )
        return system.cached("forcing", lambda: Forcing(system, 2.0 * math.pi / common, True))
    return Forcing(system, period)


def _span_of(forcing: Forcing | None, p: Array) -> float | None:
    """The period of the forcing at some parameters; None for autonomous systems."""
    return None if forcing is None else _positive(forcing(p)[0])


def about_of(system: FilippovSystem, period: Any, p: Array) -> float | None:
    """The given approximate period of an orbit of an autonomous system; else None."""
    if period is None or system.time_dependent:
        return None
    return _positive(Forcing(system, period)(p)[0])


def _positive(span: float) -> float:
    if not (math.isfinite(span) and span > 0.0):
        raise OptionError(
            f"period = {span:.6g} is not positive. Give the period of the forcing, or the approximate "
            "period of an orbit of an autonomous system."
        )
    return span


# Itineraries of runs ------------------------------------------------------------------------------

#: Largest relative distance of two states of a run between which there may be a periodic orbit.
_CLOSE = 0.25

#: Factor within which a period agrees with the given one.
_ABOUT = 1.5

#: Ratio of the times between events at the end and in the middle of a run below which they are decreasing.
_FALLING = 0.7

#: Relative range of the states of a part of a run below which it rests.
_REST = 1e-6

#: Share of the time of a run at its end in which it rests, if it does.
_AT_END = 0.1

#: Share of the time of a run after its last event from which it may have reached an orbit without events.
_QUIET = 0.75

#: Size of states whose squares overflow.
_HUGE = 1e150

#: Number of events from which a run is checked for chattering.
_MANY = 1000


def is_about(duration: float, about: float) -> bool:
    """Whether a time is from two thirds to one and a half times another one."""
    return about / _ABOUT <= duration <= about * _ABOUT


@dataclass(frozen=True, eq=False)
class _Recurrence:
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
    multiplicity: int | None = None,
) -> _Recurrence | None:
    """The legs of a run that nearly close, over a number of periods of the forcing; None if there are none."""
    whole = None if multiplicity is None else multiplicity / (1 if symmetry is None else 2)
    parts = [part for part in merged(stretches(run, begins=False)) if part.duration > 0.0]
    if len(parts) > 1 and parts[-1].leg.timed:
        if parts[-1].duration > _QUIET * sum(part.duration for part in parts):
            found = _without_events(run, parts[-1:], symmetry, period, first, about, whole)
            if found is not None and found.distance <= _CLOSE and _moves(run, found.parts[0]):
                return found
    closed = [k for k, part in enumerate(parts) if part.leg.kind not in ("end", "stop")]
    # legs between two events: start k is after the event that ends part k - 1
    starts = [k + 1 for k in closed if k + 1 < len(parts)]
    if len(starts) < 2:
        return _without_events(run, parts, symmetry, period, first, about, whole)
    rests = [k for k in starts if parts[k - 1].leg.repeats]
    starts = rests if len(rests) > 1 else starts  # the others may be of unfinished chatter
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
    if period is not None and whole is not None:
        distances = [d if n == whole else math.inf for d, n in zip(distances, periods, strict=True)]
    best = min(distances)  # the shortest of those that close nearly as well as the best
    good = [i for i, apart in enumerate(distances) if apart <= max(3.0 * best, 1e-9)]
    i = min(good, key=lambda i: abs(others[i] - anchor))
    low, high = sorted((anchor, others[i]))
    return _Recurrence(tuple(parts[low:high]), periods[i], distances[i])


def _moves(run: Trajectory, part: Stretch) -> bool:
    """Whether a run moves in a part of it."""
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
    if symmetry is not None:  # its square is 1, so either end may be mapped
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
    whole: float | None,
) -> _Recurrence | None:
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
        if period is not None and whole is not None and abs((high - low) / period - whole) > 0.25:
            continue
        there = run(high) if symmetry is None else symmetry @ run(high)
        distance = float(np.abs((there - run(low)) / scale).max())
        x = np.append(run(low), low) if run.system.time_dependent else run(low)
        periods = (high - low) / period if period else 0.0
        leg = type(part.leg)(part.leg.mode)
        cut = replace(part, leg=leg, t=low, duration=high - low, start=x, end=x, after=x)
        found.append(_Recurrence((cut,), round(2 * periods) / 2, distance))
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
    """Times at which the run may return to its state at ``anchor``."""
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


def _require_steady(run: Trajectory) -> None:
    """Raise for a run that chatters: it had too many events, and the times between them shrink."""
    if run.status is not Status.TOO_MANY_EVENTS or len(run.events) < _MANY:
        return
    times = run.events.t
    waits = np.diff(times)
    part = len(waits) // 10
    parts = (waits[4 * part : 5 * part], waits[6 * part : 7 * part], waits[-part:])
    middle, between, last = (float(w.mean()) for w in parts)  # legs of one orbit differ
    if last >= _FALLING * middle or not last < between < middle:
        return
    raise ConvergenceError(
        f"guess: the run chatters near {run.x[-1].tolist()}. It ended with {run.status} at "
        f"t = {times[-1]:.6g} after {len(times)} events, the time between which fell from {middle:.2g} to "
        f"{last:.2g}. Start elsewhere, or model what limits the switching, such as hysteresis or a delay.",
        point=run.x[-1],
    )


def refused(
    run: Trajectory,
    found: _Recurrence | None,
    multiplicity: int | None = None,
    other: _Recurrence | None = None,
) -> ConvergenceError:
    """The error for a run without a recurrence, or with an ``other`` one over more periods."""
    if _rests(run):
        return ConvergenceError(
            f"guess: the run rests at {run.x[-1].tolist()} at its end, t = {run.t[-1]:.6g}. Start it where it "
            "keeps moving, or vary a parameter.",
            point=run.x[-1],
        )
    over = "" if multiplicity is None else f" over {multiplicity} of the forcing's periods"
    best = (
        f"has no two events of one kind{over}"
        if found is None
        else f"closes only to {found.distance:.2g} of its size{over}, after {len(found.parts)} legs"
    )
    advice = "Simulate longer, closer to the orbit, or give itinerary= or a symmetry."
    if other is not None and other.distance < _GOOD and other.parts:
        advice = f"It closes over {other.periods:g} of the forcing's periods: give that as multiplicity=."
    return ConvergenceError(
        f"guess: the itinerary does not close: the run to t = {run.t[-1]:.6g} ({run.status}) {best}. {advice}"
    )


def _rests(run: Trajectory) -> bool:
    """Whether a run is at rest at its end."""
    if run.status is not Status.REACHED_END:
        return False
    last = run(run.t[-1] - _AT_END * (run.t[-1] - run.t[0]) * np.linspace(0.0, 1.0, 33))
    size = float(np.abs(run.x).max())
    return bool(np.ptp(last, axis=0).max() <= _REST * size) if np.isfinite(size) else False


# Checks of a guess --------------------------------------------------------------------------------

#: Relative difference of the fields after a period from which it is not that of the forcing.
_OTHER = 1e-6


def _require_of(system: FilippovSystem, other: FilippovSystem) -> None:
    """Raise for a guess that is of another system, by its states and events."""
    if other is system or _signature(other) == _signature(system):
        return
    raise DefinitionError(
        f"guess is of another system, {other!r}, not of {system!r}. Give a state, or the system of the guess."
    )


def _signature(system: FilippovSystem) -> tuple[Any, ...]:
    events = (system.surface_count, system.resets, system.impacts, system.time_dependent)
    return (system.state_names, system.parameter_names, *map(str, events))


def _require_alone(guess: Any, **given: Any) -> None:
    """Raise for options that apply only to a state as the guess."""
    for name, value in given.items():
        if value is not None:
            raise OptionError(
                f"{name}= applies only if guess is a state; this {type(guess).__name__} already fixes its "
                f"{name}. Drop it."
            )


def _require_same(problem: BoundaryProblem, period: Any, mirror: Array | None, p: Array) -> None:
    """Raise for a period of the forcing or a symmetry other than that of an orbit."""
    own, other = problem.forcing, None if period is None else _forcing_of(problem.system, period)
    if own is not None and other is not None and abs(other(p)[0] / own(p)[0] - 1.0) > _OTHER:
        raise OptionError(
            f"period = {other(p)[0]:.10g} differs from that of the given PeriodicOrbit, {own(p)[0]:.10g}. "
            "Drop it, or give a run as the guess."
        )
    half = problem.symmetry
    if mirror is not None and (half is None or np.abs(half - mirror).max() > 0.0):
        raise OptionError(
            "symmetry= differs from the symmetry of the given PeriodicOrbit. Drop it, or give "
            "orbit.trajectory as the guess."
        )


def _require_period(
    system: FilippovSystem,
    legs: Sequence[Leg],
    starts: Array,
    durations: Array,
    span: float,
    p: Array,
) -> None:
    """Raise for a period after which the fields differ."""
    # They are compared in the middle of legs, as a field may jump at their ends.
    for leg, x, duration in zip(legs, starts, durations, strict=True):
        y = integrate_leg(system, leg, x, 0.5 * float(duration), p).end[: len(x)]
        later, middle = y.copy(), replace(leg, left=())
        later[system.dimension] += span
        here, there = (rate_at(system, middle, z, p) for z in (y, later))
        miss = float(np.abs(here - there).max())
        if miss > _OTHER * float(np.abs(here).max()):
            raise OptionError(
                f"period = {span:.10g} is not that of the forcing: after it the field differs by {miss:.2g} "
                f"in mode {leg.mode!r} at {y[: system.dimension].tolist()}. Give the period of the forcing, "
                "or drop it."
            )


# Starts -------------------------------------------------------------------------------------------

_MOST_EVENTS = 2000

#: Longest duration of a leg of a given itinerary, in times in which the state changes by its size.
_LONGEST = 200.0

#: Most periods of the forcing over which one mode alone is integrated.
_MOST_PERIODS = 16

#: Most periods of the forcing of an orbit beside a state, and events of the run from there.
_BESIDE, _SEVERAL = 8, 200

#: Relative distance of a recurrence at which a run is not simulated further.
_GOOD = 0.02

#: Parts of an orbit without events at whose ends it may begin, and part of its size below which a state is small.
_SAMPLES, _ALMOST_ZERO = 64, 1e-3

#: Time after which a second run begins where there are resets, in the same unit.
_LATER = 0.05


@dataclass(frozen=True, eq=False)
class Start:
    """Equations of an orbit, unknowns near it, and all parameters."""

    problem: BoundaryProblem
    unknowns: Array
    p: Array
    near: bool = False  # an orbit is accepted only beside it


def starts_of(
    system: FilippovSystem,
    guess: Any,
    itinerary: Itinerary | None,
    period: Any,
    multiplicity: int | None,
    mirror: Array | None,
    parameters: Parameters | None,
    t_start: float,
) -> Iterator[Start]:
    """Starts of Newton's method in the order in which they are tried."""
    if isinstance(guess, (PeriodicOrbit, Trajectory)):
        _require_of(system, guess.system)
        _require_alone(guess, itinerary=itinerary, t_start=t_start or None)
    if isinstance(guess, PeriodicOrbit):
        yield _from_orbit(system, guess, period, mirror, parameters)
        return
    own = guess.parameters if isinstance(guess, Trajectory) else {}
    p = system.parameter_vector({**own, **_by_name(parameters)})
    forcing, about = _forcing_of(system, period), _half(about_of(system, period, p), mirror)
    span = _span_of(forcing, p)
    if isinstance(guess, Trajectory):
        found = recurrence(
            guess, symmetry=mirror, period=span, first=False, about=about, multiplicity=multiplicity
        )
        _require_steady(guess)
        if found is None or found.distance > _CLOSE:
            raise refused(guess, found, multiplicity)
        yield _from_recurrence(system, found, forcing, mirror, p)
        return
    x = system.extended_point(real_array(guess, "guess"), t_start)
    if itinerary is not None:
        yield _from_word(system, x, itinerary, forcing, multiplicity, mirror, p)
        return
    once = 1 if multiplicity is None else multiplicity
    if forcing is not None and span is not None and not forcing.found:
        here = Leg(_mode(system, x, p))
        _require_period(system, (here,), x[None], np.zeros(1), span, p)
    for near in () if span is None else _beside(system, x, mirror, span, multiplicity, p):
        yield replace(_from_recurrence(system, near, forcing, mirror, p), near=True)
    found = _simulated(system, x, mirror, about or span, once if forcing is not None else None, p)
    start = _from_recurrence(system, found, forcing, mirror, p)
    yield start if forcing is None or mirror is not None else _nearest(start, x, forcing(p)[0])


def _beside(
    system: FilippovSystem, x: Array, mirror: Array | None, span: float, given: int | None, p: Array
) -> Iterator[_Recurrence]:
    """The legs from a state that returns to its neighbourhood, as beside an unstable orbit."""
    n, t, values = system.dimension, float(x[-1]), named(system, p)
    for once in range(1, _BESIDE + 1) if given is None else (given,):
        end = t + (once + 1.05) * span
        run = simulate(
            system, x[:n], end, t_start=t, parameters=values, tol=1e-12, max_events=_SEVERAL
        )
        near = recurrence(run, symmetry=mirror, period=span, first=True, multiplicity=once)
        if near is not None and near.distance <= _CLOSE:
            yield near
        if run.status is not Status.REACHED_END:
            return


def _half(about: float | None, mirror: Array | None) -> float | None:
    """The approximate duration of the legs: of half of the orbit with a symmetry."""
    return about if about is None or mirror is None else 0.5 * about


def _nearest(start: Start, x: Array, span: float) -> Start:
    """Start an orbit without events at the period of the forcing at which it is nearest to ``x``."""
    problem, p = start.problem, start.p
    if not problem.legs[-1].timed or problem.periods < 2:
        return start
    (y,), (duration,) = problem.split(start.unknowns)
    n, found = problem.system.dimension, list[Array]()
    there = integrate_leg(problem.system, problem.legs[0], x, -float(x[-1]) % span, p).end[:n]
    for _ in range(round(problem.periods)):
        found.append(y.copy())
        y = integrate_leg(problem.system, problem.legs[0], y, span, p).end[: n + 1].copy()
        y[-1] = found[0][-1]
    best = min(found, key=lambda state: float(np.abs(state[:n] - there).max()))
    phased = replace(problem, reference=best)
    return Start(phased, phased.pack(best, np.array([duration])), p)


def _by_name(parameters: Parameters | None) -> dict[str, Any]:
    return {str(k): v for k, v in (parameters or {}).items()}


def _from_orbit(
    system: FilippovSystem,
    orbit: PeriodicOrbit,
    period: Any,
    mirror: Array | None,
    parameters: Parameters | None,
) -> Start:
    """The equations of an orbit, with its period of the forcing and its symmetry."""
    p = system.parameter_vector({**orbit.parameters, **_by_name(parameters)})
    _require_same(orbit.problem, period, mirror, p)
    return Start(replace(orbit.problem, system=system), orbit.unknowns, p)


def _from_recurrence(
    system: FilippovSystem,
    found: _Recurrence,
    forcing: Forcing | None,
    mirror: Array | None,
    p: Array,
) -> Start:
    starts = np.array([part.start for part in found.parts])
    durations = np.array([part.duration for part in found.parts])
    if forcing is not None:  # within one period, so that the time has the size of the orbit's
        span = forcing(p)[0]
        starts[:, -1] -= span * math.floor(starts[0, -1] / span)
    legs = tuple(part.leg for part in found.parts)
    return equations_of(system, legs, starts, durations, found.periods, forcing, mirror, p)


def equations_of(
    system: FilippovSystem,
    legs: tuple[Leg, ...],
    starts: Array,
    durations: Array,
    periods: float,
    forcing: Forcing | None,
    mirror: Array | None,
    p: Array,
) -> Start:
    """The equations of an orbit through legs, with a phase condition where one leg has no event."""
    phase = reference = None
    if forcing is not None and not forcing.found:
        _require_period(system, legs, starts, durations, forcing(p)[0], p)
    if legs[-1].timed:
        phase = np.zeros(system.extended_dimension)
        if system.time_dependent:  # from the phase 0 of the forcing
            assert forcing is not None
            span = forcing(p)[0]
            wait = -starts[0, -1] % span
            wait = 0.0 if wait > span * (1.0 - 1e-12) else wait
            starts = (
                integrate_leg(system, legs[0], starts[0], wait, p)
                .end[None, : starts.shape[1]]
                .copy()
            )
            starts[0, -1] = 0.0
            phase[-1] = 1.0
        else:
            starts, rate = _well_begun(system, legs[0], starts[0], float(durations[0]), p)
            phase = rate / float(np.linalg.norm(rate))
        reference = starts[0]
    problem = BoundaryProblem(system, legs, mirror, periods, forcing, phase, reference)
    return Start(problem, problem.pack(starts, durations), p)


def _well_begun(
    system: FilippovSystem, leg: Leg, x: Array, duration: float, p: Array
) -> tuple[Array, Array]:
    """The start (1, n) of a leg, or where it moves fastest if a state is almost zero there, and the rate there."""
    states, n = [x], system.dimension
    for _ in range(_SAMPLES):
        states.append(integrate_leg(system, leg, states[-1], duration / _SAMPLES, p).end[:n])
    rates = [rate_at(system, leg, state, p) for state in states]
    sizes = np.abs(states).max(axis=0)
    scale, k = np.where(sizes > 0.0, sizes, 1.0), 0
    if (np.abs(x) < _ALMOST_ZERO * sizes).any():
        k = int(np.argmax([np.linalg.norm(rate / scale) for rate in rates]))
    return states[k][None].copy(), rates[k]


def _from_word(
    system: FilippovSystem,
    x: Array,
    itinerary: Itinerary,
    forcing: Forcing | None,
    multiplicity: int | None,
    mirror: Array | None,
    p: Array,
) -> Start:
    """Integrate the legs of an itinerary to their events, or one mode over periods of the forcing."""
    if forcing is not None and mirror is None and (leg := lone_leg(system, itinerary)) is not None:
        return _from_mode(system, x, leg, forcing, multiplicity, p)
    if system.sets:
        raise OptionError(
            "itinerary= is one mode for a system with vector multipliers. Give a run of the itinerary as the guess."
        )
    legs = word_legs(system, itinerary, mirror is not None)
    starts, durations = _followed(system, legs, x, p)
    periods = 0.0
    if forcing is not None:
        count = float(durations.sum()) / forcing(p)[0]
        periods = max(1.0, round(count)) if mirror is None else round(count - 0.5) + 0.5
        if multiplicity is not None:
            periods = multiplicity / (1.0 if mirror is None else 2.0)
    return equations_of(system, legs, starts[: len(legs)], durations, periods, forcing, mirror, p)


def _from_mode(
    system: FilippovSystem, x: Array, leg: Leg, forcing: Forcing, multiplicity: int | None, p: Array
) -> Start:
    """Integrate one mode over a number of periods of the forcing, or that after which it closes best."""
    span, n, y, apart = _span_of(forcing, p) or 1.0, system.dimension, x, list[float]()
    for _ in range(_MOST_PERIODS):
        y = integrate_leg(system, leg, y, span, p).end[: x.size]
        apart.append(float(np.abs(y[:n] - x[:n]).max()))
    count = 1 + int(np.argmin(apart)) if multiplicity is None else multiplicity
    durations = np.array([count * span])
    return equations_of(system, (leg,), x[None].copy(), durations, count, forcing, None, p)


def _followed(
    system: FilippovSystem, legs: Sequence[Leg], x: Array, p: Array
) -> tuple[Array, Array]:
    """Starts and durations of legs that are integrated one after the other."""
    starts, durations, natural = list[Array](), list[float](), 0.0
    for k, leg in enumerate(legs):  # the longest time so far, as a state near zero has a short one
        natural = max(natural, _natural_time(system, x, p, leg.mode))
        duration = march(system, leg, x, p, _LONGEST * natural)
        if duration is None:
            n, t = system.dimension, float(x[-1]) if system.time_dependent else sum(durations)
            raise ConvergenceError(
                f"guess: leg {k + 1} {leg_name(system, leg)} from {x[:n].tolist()} at t = {t:.6g} does not reach "
                "its event. Start closer to the orbit, or change the itinerary."
            )
        starts.append(x)
        durations.append(duration)
        y = states_at(system, leg.mode, x, p)
        end = flow_for(plain_field(system, leg.mode), y, p, duration)[: len(x)]
        x = leg.at_event(system, end, p).after
    return np.array(starts), np.array(durations)


def _simulated(
    system: FilippovSystem,
    x: Array,
    mirror: Array | None,
    hint: float | None,
    multiplicity: int | None,
    p: Array,
) -> _Recurrence:
    """Simulate from a state, longer and longer, until the run recurs."""
    # With resets the state may be one just after a reset, which is due again when a run begins there. So a
    # state a little later is tried first.
    natural = _natural_time(system, x, p)
    starts = [x]
    if system.resets:
        try:
            later = integrate_leg(system, Leg(_mode(system, x, p)), x, _LATER * natural, p).end
            starts = [later[: x.size], x]
        except NonsmoothError:
            pass
    best: _Recurrence | None = None
    run: Trajectory | None = None
    for start in starts:
        run, found = _recurring(system, start, mirror, hint or natural, hint, multiplicity, p)
        if found is not None and (best is None or found.distance < best.distance):
            best = found
        if best is not None and best.distance < _GOOD:
            break
    assert run is not None
    _require_steady(run)
    if best is None or best.distance > _CLOSE:
        other = recurrence(run, symmetry=mirror, period=hint, first=False) if multiplicity else None
        raise refused(run, best, multiplicity, other)
    return best


def _recurring(
    system: FilippovSystem,
    x: Array,
    mirror: Array | None,
    unit: float,
    hint: float | None,
    multiplicity: int | None,
    p: Array,
) -> tuple[Trajectory, _Recurrence | None]:
    n, values = system.dimension, named(system, p)
    t = float(x[-1]) if system.time_dependent else 0.0
    best: _Recurrence | None = None
    given: dict[str, Any] = {"period": None, "about": hint}
    if multiplicity is not None:  # the system is forced
        given = {"period": hint, "multiplicity": multiplicity}
    for span in [k + 0.6 for k in (1, 2, 4, 8, 16)] if hint else [4.0 * 2**k for k in range(11)]:
        run = simulate(
            system,
            x[:n],
            t + span * unit,
            t_start=t,
            parameters=values,
            tol=1e-12,
            max_events=_MOST_EVENTS,
        )
        for first in (True, False):
            found = recurrence(run, symmetry=mirror, first=first, **given)
            if found is not None and (best is None or found.distance < 0.3 * best.distance):
                best = found
        if (best is not None and best.distance < _GOOD) or run.status is not Status.REACHED_END:
            break
    return run, best


def _mode(system: FilippovSystem, x: Array, p: Array) -> str:
    """The mode of a state that is on no surface."""
    h = Surfaces(system).values(x, p)[0][: system.surface_count]
    letters = ["*" if more else "+" if h[i] > 0 else "-" for i, *more in system.entries]
    for i in system.half_lines:
        letters[system.entry_of(i)] = "o"
    return "".join(letters) + "o" * len(system.impacts)


def _natural_time(system: FilippovSystem, x: Array, p: Array, mode: str | None = None) -> float:
    """The time in which the state changes by its size."""
    leg = Leg(_mode(system, x, p) if mode is None else mode)
    try:
        rate = rate_at(system, leg, x, p)[: system.dimension]
    except NonsmoothError:  # on a set
        return 1.0
    size, speed = math.hypot(*x[: system.dimension]), math.hypot(*rate)
    return size / speed if size > 0.0 and speed > 0.0 and math.isfinite(speed) else 1.0
