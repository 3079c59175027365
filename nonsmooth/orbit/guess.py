"""From a guess to the equations of a periodic orbit and a start for Newton's method."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..flow.fixed import flow_for
from ..flow.simulate import simulate
from ..flow.status import Status
from ..flow.trajectory import Trajectory
from ..model import (
    Array,
    ConvergenceError,
    FilippovSystem,
    NonsmoothError,
    Parameters,
    Surfaces,
    real_array,
)
from ..model.forcing import Forcing
from ..model.variational import plain_field
from .boundary import BoundaryProblem
from .flight import flights_of
from .forced import about_of, forcing_of, span_of
from .guards import march
from .guess_checks import require_alone, require_of, require_period, require_same
from .legs import Leg, fly, leg_name
from .periodic import PeriodicOrbit, named
from .recurrence import CLOSE, Recurrence, recurrence, refused, require_steady
from .words import Itinerary, lone_leg, word_legs

_MOST_EVENTS = 2000

#: A leg of a given itinerary is followed so many times the time in which the state changes.
_LONGEST = 200.0

#: A mode alone is followed over so many periods of the forcing.
_MOST_PERIODS = 16

#: A run that comes back as near as this, relative to its size, is not simulated further.
_GOOD = 0.02

#: A state that may be one after a reset is left by this part of that time.
_LATER = 0.05


@dataclass(frozen=True, eq=False)
class Start:
    """Equations of an orbit, unknowns near it, and all parameters."""

    problem: BoundaryProblem
    unknowns: Array
    p: Array


def start_of(
    system: FilippovSystem,
    guess: Any,
    itinerary: Itinerary | None,
    period: Any,
    mirror: Array | None,
    parameters: Parameters | None,
    t_start: float,
) -> Start:
    if isinstance(guess, (PeriodicOrbit, Trajectory)):
        require_of(system, guess.system)
    if isinstance(guess, PeriodicOrbit):
        require_alone(guess, itinerary=itinerary, t_start=t_start or None)
        return _from_orbit(system, guess, period, mirror, parameters)
    if isinstance(guess, Trajectory):
        require_alone(guess, itinerary=itinerary, t_start=t_start or None)
        given = {**guess.parameters, **_by_name(parameters)}
        p = system.parameter_vector(given)
        forcing, about = forcing_of(system, period), _half(about_of(system, period, p), mirror)
        found = recurrence(
            guess, symmetry=mirror, period=span_of(forcing, p), first=False, about=about
        )
        require_steady(guess)
        if found is None or found.distance > CLOSE:
            raise refused(guess, found)
        return _from_recurrence(system, found, forcing, mirror, p)
    p = system.parameter_vector(parameters)
    forcing = forcing_of(system, period)
    span = span_of(forcing, p)
    x = system.extended_point(real_array(guess, "guess"), t_start)
    if itinerary is not None:
        return _from_word(system, x, itinerary, forcing, mirror, p)
    about = _half(about_of(system, period, p), mirror)
    found = _simulated(system, x, mirror, about or span, forcing is not None, p)
    start = _from_recurrence(system, found, forcing, mirror, p)
    return start if forcing is None or mirror is not None else _nearest(start, x, forcing(p)[0])


def _half(about: float | None, mirror: Array | None) -> float | None:
    """The time that what is looked for takes: with a symmetry half of the orbit."""
    return about if about is None or mirror is None else 0.5 * about


def _nearest(start: Start, x: Array, span: float) -> Start:
    """Of the whole periods at which an orbit without an event may begin, the one nearest to ``x``."""
    problem, p = start.problem, start.p
    if problem.legs[-1].name or problem.periods < 2:
        return start
    (y,), (duration,) = problem.split(start.unknowns)
    n, found = problem.system.dimension, list[Array]()
    there = fly(problem.system, problem.legs[0], x, -float(x[-1]) % span, p).end[:n]
    for _ in range(round(problem.periods)):
        found.append(y.copy())
        y = fly(problem.system, problem.legs[0], y, span, p).end[: n + 1].copy()
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
    """The equations of an orbit, which say its period of the forcing and its symmetry."""
    p = system.parameter_vector({**orbit.parameters, **_by_name(parameters)})
    require_same(orbit.problem, period, mirror, p)
    return Start(replace(orbit.problem, system=system), orbit.unknowns, p)


def _from_recurrence(
    system: FilippovSystem,
    found: Recurrence,
    forcing: Forcing | None,
    mirror: Array | None,
    p: Array,
) -> Start:
    starts = np.array([part.start for part in found.parts])
    durations = np.array([part.duration for part in found.parts])
    if forcing is not None:  # the clock within one period keeps its size that of the orbit's
        span = forcing(p)[0]
        starts[:, -1] -= span * math.floor(starts[0, -1] / span)
    legs = tuple(part.leg for part in found.parts)
    return _problem(system, legs, starts, durations, found.periods, forcing, mirror, p)


def _problem(
    system: FilippovSystem,
    legs: tuple[Leg, ...],
    starts: Array,
    durations: Array,
    periods: float,
    forcing: Forcing | None,
    mirror: Array | None,
    p: Array,
) -> Start:
    phase = reference = None
    if forcing is not None and not forcing.found:
        require_period(system, legs, starts, durations, forcing(p)[0], p)
    if not legs[-1].name:
        phase = np.zeros(system.extended_dimension)
        if system.time_dependent:  # from time 0, which is the same phase of every forcing period
            assert forcing is not None
            span = forcing(p)[0]
            wait = -starts[0, -1] % span
            wait = 0.0 if wait > span * (1.0 - 1e-12) else wait
            starts = fly(system, legs[0], starts[0], wait, p).end[None, : starts.shape[1]].copy()
            starts[0, -1] = 0.0
            phase[-1] = 1.0
        else:
            field = legs[0].field(system)
            rate = field.rate.copied(field.states_at(starts[0], p), p)[0]
            phase = rate[: system.extended_dimension, 0] / float(np.linalg.norm(rate))
        reference = starts[0]
    problem = BoundaryProblem(system, legs, mirror, periods, forcing, phase, reference)
    return Start(problem, problem.pack(starts, durations), p)


def _from_word(
    system: FilippovSystem,
    x: Array,
    itinerary: Itinerary,
    forcing: Forcing | None,
    mirror: Array | None,
    p: Array,
) -> Start:
    """Follow the legs of an itinerary, each to its event; one mode alone over periods of the forcing."""
    if forcing is not None and mirror is None and (leg := lone_leg(system, itinerary)) is not None:
        return _from_mode(system, x, leg, forcing, p)
    legs = word_legs(system, itinerary, mirror is not None)
    found = flights_of(system, legs).followed(x, p, _LONGEST)
    starts, durations = found or _followed(system, legs, x, p)
    periods = 0.0
    if forcing is not None:
        count = float(durations.sum()) / forcing(p)[0]
        periods = max(1.0, round(count)) if mirror is None else round(count - 0.5) + 0.5
    return _problem(system, legs, starts[: len(legs)], durations, periods, forcing, mirror, p)


def _from_mode(system: FilippovSystem, x: Array, leg: Leg, forcing: Forcing, p: Array) -> Start:
    """Fly one mode over periods of the forcing, and take as many as close best."""
    span, n, y, apart = span_of(forcing, p) or 1.0, system.dimension, x, list[float]()
    for _ in range(_MOST_PERIODS):
        y = fly(system, leg, y, span, p).end[: x.size]
        apart.append(float(np.abs(y[:n] - x[:n]).max()))
    count = 1 + int(np.argmin(apart))
    durations = np.array([count * span])
    return _problem(system, (leg,), x[None].copy(), durations, count, forcing, None, p)


def _followed(
    system: FilippovSystem, legs: Sequence[Leg], x: Array, p: Array
) -> tuple[Array, Array]:
    """Starts and durations of legs that are followed one after the other."""
    starts, durations, natural = list[Array](), list[float](), 0.0
    for k, leg in enumerate(legs):  # a state near zero says little of how long a leg may take
        natural = max(natural, _natural_time(system, x, p, leg.mode))
        duration = march(system, leg, x, p, _LONGEST * natural)
        if duration is None:
            n, t = system.dimension, float(x[-1]) if system.time_dependent else sum(durations)
            raise ConvergenceError(
                f"guess: expected leg {k + 1} {leg_name(leg)} to come to its event, received none "
                f"from {x[:n].tolist()} at t = {t:.6g}. Start closer to the orbit, or change the "
                "itinerary."
            )
        starts.append(x)
        durations.append(duration)
        y = leg.field(system).states_at(x, p)
        end = flow_for(plain_field(system, leg.mode), y, p, duration)
        x = leg.at_end(system, end, p).after
    return np.array(starts), np.array(durations)


def _simulated(
    system: FilippovSystem,
    x: Array,
    mirror: Array | None,
    hint: float | None,
    forced: bool,
    p: Array,
) -> Recurrence:
    """Simulate from a state, longer and longer, until the run comes back.

    Where there are resets the state may be meant as that after one, which is due again at once when a
    run begins there; so a state a little later is tried as well.
    """
    natural = _natural_time(system, x, p)
    starts = [x]
    if system.resets:
        try:
            later = fly(system, Leg(_letters(system, x, p)), x, _LATER * natural, p).end
            starts = [later[: x.size], x]
        except NonsmoothError:
            pass
    best: Recurrence | None = None
    run: Trajectory | None = None
    for start in starts:
        run, found = _comes_back(system, start, mirror, hint or natural, hint, forced, p)
        if found is not None and (best is None or found.distance < best.distance):
            best = found
        if best is not None and best.distance < _GOOD:
            break
    assert run is not None
    require_steady(run)
    if best is None or best.distance > CLOSE:
        raise refused(run, best)
    return best


def _comes_back(
    system: FilippovSystem,
    x: Array,
    mirror: Array | None,
    unit: float,
    hint: float | None,
    forced: bool,
    p: Array,
) -> tuple[Trajectory, Recurrence | None]:
    n, values = system.dimension, named(system, p)
    t = float(x[-1]) if system.time_dependent else 0.0
    best: Recurrence | None = None
    told = {"period": hint, "about": None} if forced else {"period": None, "about": hint}
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
            found = recurrence(run, symmetry=mirror, first=first, **told)
            if found is not None and (best is None or found.distance < 0.3 * best.distance):
                best = found
        if (best is not None and best.distance < _GOOD) or run.status is not Status.REACHED_END:
            break
    return run, best


def _letters(system: FilippovSystem, x: Array, p: Array) -> str:
    """The mode of a state that is on no surface."""
    h = Surfaces(system).values(x, p)[0][: system.surface_count]
    return "".join("+" if v > 0 else "-" for v in h) + "o" * len(system.impacts)


def _natural_time(system: FilippovSystem, x: Array, p: Array, mode: str | None = None) -> float:
    """The time in which the state changes by its size."""
    field = Leg(_letters(system, x, p) if mode is None else mode).field(system)
    rate = field.rate.copied(field.states_at(x, p), p)[0][: system.dimension, 0]
    size, speed = math.hypot(*x[: system.dimension]), math.hypot(*rate)
    return size / speed if size > 0.0 and speed > 0.0 and math.isfinite(speed) else 1.0
