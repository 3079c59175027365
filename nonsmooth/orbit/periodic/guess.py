"""From a guess to the equations of a periodic orbit and a start for Newton's method."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
    explain,
    real_array,
)
from ...model.derivatives.forcing import Forcing
from ...model.derivatives.variational import plain_field
from ..runs.guards import march
from ..runs.itinerary import Itinerary, lone_leg, word_legs
from ..runs.legs import Leg, fly, leg_name
from .boundary_value_problem import BoundaryProblem
from .forcing import about_of, forcing_of, span_of
from .orbit import PeriodicOrbit, named
from .recurrence import CLOSE, Recurrence, recurrence, refused, require_steady

# What is said of a guess must not contradict it: its system, its forcing, its symmetry.

#: Fields that differ by this part after a period have another one.
_OTHER = 1e-6


def require_of(system: FilippovSystem, other: FilippovSystem) -> None:
    """Refuse a guess that is of another system, by what its states and events are."""
    if other is system or _signature(other) == _signature(system):
        return
    raise DefinitionError(
        explain(
            "guess",
            expected=f"a run or an orbit of {system!r}",
            received=f"one of {other!r}",
            advice="Give a state, or the system that it is of.",
        )
    )


def _signature(system: FilippovSystem) -> tuple[Any, ...]:
    events = (system.surface_count, system.resets, system.impacts, system.time_dependent)
    return (system.state_names, system.parameter_names, *map(str, events))


def require_alone(guess: Any, **given: Any) -> None:
    """Refuse what is said of a state, where the guess is none."""
    for name, value in given.items():
        if value is not None:
            raise OptionError(
                explain(
                    name,
                    expected="none, as it belongs to a state as the guess",
                    received=f"{value!r} with a {type(guess).__name__}, which has its own",
                    advice="Leave it out, or give a state.",
                )
            )


def require_same(problem: BoundaryProblem, period: Any, mirror: Array | None, p: Array) -> None:
    """Refuse another period of the forcing, or another symmetry, than an orbit has."""
    own, other = problem.forcing, None if period is None else forcing_of(problem.system, period)
    if own is not None and other is not None and abs(other(p)[0] / own(p)[0] - 1.0) > _OTHER:
        raise OptionError(
            explain(
                "period",
                expected=f"that of the orbit that is the guess, {own(p)[0]:.10g}",
                received=f"{other(p)[0]:.10g}",
                advice="Leave it out, or give a run as the guess.",
            )
        )
    half = problem.symmetry
    if mirror is not None and (half is None or np.abs(half - mirror).max() > 0.0):
        had = "has none" if half is None else "has another one"
        raise OptionError(
            explain(
                "symmetry",
                expected="none, or that by which the guess was found",
                received=f"one, and an orbit that {had}",
                advice="Leave it out, or give orbit.trajectory as the guess.",
            )
        )


def require_period(
    system: FilippovSystem,
    legs: Sequence[Leg],
    starts: Array,
    durations: Array,
    span: float,
    p: Array,
) -> None:
    """Refuse a period after which the fields are not what they were."""
    # A field may jump where a leg begins; so it counts what is within.
    for leg, x, duration in zip(legs, starts, durations, strict=True):
        field = leg.field(system)
        y = flow_for(plain_field(system, leg.mode), field.states_at(x, p), p, 0.5 * float(duration))
        later = y.copy()
        later[system.dimension] += span
        here, there = (field.rate.copied(z, p)[0][:, 0] for z in (y, later))
        miss = float(np.abs(here - there).max())
        if miss > _OTHER * float(np.abs(here).max()):
            raise OptionError(
                explain(
                    "period",
                    expected="a time after which the field is the same again",
                    received=f"{span:.10g}, after which it differs by {miss:.2g} in mode {leg.mode!r} "
                    f"at {y[: system.dimension].tolist()}",
                    advice="Give the period of the forcing, or leave it out.",
                )
            )


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
    starts, durations = _followed(system, legs, x, p)
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
    """Simulate from a state, longer and longer, until the run comes back."""
    # Where there are resets the state may be meant as that after one, which is due again at once when a
    # run begins there; so a state a little later is tried as well.
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
