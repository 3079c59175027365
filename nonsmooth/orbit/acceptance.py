"""What a solution of the equations of an orbit must be to count as one.

It moves, takes the time that was said, and passes no two-fold.
"""

from __future__ import annotations

import numpy as np

from ..model import ConvergenceError, DegenerateError
from .boundary import BoundaryProblem, Evaluation
from .guess import Start
from .legs import Leg, leg_name
from .periodic import PeriodicOrbit
from .recurrence import is_about

#: A period below this part of the guess is that of a point.
_POINT = 1e-9

#: One below this part of it is too, where the equations are singular to ``_SINGULAR``: as an orbit
#: shrinks to a point, its duration is determined ever less.
_SHRUNK, _SINGULAR = 1e-2, 1e-9

#: Motion by fewer spacings of numbers of the size of a state is lost in rounding.
_SPACINGS = 8.0

#: What moves by no more than this part of its size rests.
_STILL = 1e-6


def require_motion(problem: BoundaryProblem, at: Evaluation, start: Start) -> None:
    """Refuse a point: every equilibrium solves the equations of an orbit, of no or any duration.

    So does, with any duration, every point so far away that motion is lost in its rounding.
    """
    n = problem.system.dimension
    guess = float(np.abs(start.problem.split(start.unknowns)[1]).sum())
    period, x = float(np.abs(at.durations).sum()), at.starts[0, :n]
    _require_resolved(problem, at)
    way = float(np.abs(at.flight.rate[0]).max()) * period
    rests = not problem.legs[-1].name and not problem.system.time_dependent
    shrunk = period <= _SHRUNK * guess and _singular(problem, at)
    if period > _POINT * guess and not shrunk:
        guessed = float(np.abs(start.problem.split(start.unknowns)[0][:, :n]).max())
        size = max(min(1.0, guessed), float(np.abs(x).max()))
        if not (rests and way <= _STILL * size):
            return
    raise ConvergenceError(
        f"periodic orbit: expected a period near {guess:.6g}, received {period:.2g}: Newton's method "
        f"shrank the orbit to a point, {x.tolist()}. It is an equilibrium, or a point "
        "where legs vanish: start closer to the orbit.",
        point=x,
    )


def _require_resolved(problem: BoundaryProblem, at: Evaluation) -> None:
    """Refuse an orbit whose states are so large that they do not change by what its legs move."""
    n, count = problem.system.dimension, len(problem.legs)
    ways = np.abs(at.flight.rate[:count, :n]) * np.abs(at.durations[:, None])
    spacings = np.spacing(np.abs(at.starts[:, :n]).max(axis=0))
    if (ways > _SPACINGS * spacings).any() or not ways.any() or not _singular(problem, at):
        return  # or at rest where the equations say so
    raise ConvergenceError(
        f"periodic orbit: expected an orbit that moves, received the state {at.starts[0, :n].tolist()}, "
        f"which moves by {ways.max():.2g} at most: less than {_SPACINGS:g} spacings of numbers of that "
        f"size, of {spacings.max():.2g}, so it closes by rounding. Start closer to the orbit.",
        point=at.starts[0, :n],
    )


def _singular(problem: BoundaryProblem, at: Evaluation) -> bool:
    """Whether the equations, in units of the orbit, say next to nothing of it in some direction."""
    jacobian = at.jacobian * problem.scales(problem.pack(at.starts, at.durations))
    rows = np.linalg.norm(jacobian, axis=1)
    values = np.linalg.svd(jacobian / np.where(rows > 0.0, rows, 1.0)[:, None], compute_uv=False)
    return bool(values[-1] <= _SINGULAR * values[0])


def require_duration(problem: BoundaryProblem, at: Evaluation, about: float | None) -> None:
    """Refuse an orbit that takes another time than was said."""
    period = float(at.durations.sum()) * (1 if problem.symmetry is None else 2)
    if about is None or is_about(period, about):
        return
    raise ConvergenceError(
        f"periodic orbit: expected one that takes about period = {about:.6g}, received one of period "
        f"{period:.10g}, at {at.starts[0, : problem.system.dimension].tolist()}. Start closer to the "
        "orbit, or leave period= out.",
        point=at.starts[0, : problem.system.dimension],
    )


def require_simple(orbit: PeriodicOrbit) -> None:
    """Refuse orbits through two-folds; grazing is refused by the multipliers."""
    system, p = orbit.system, orbit.parameter_vector
    for i, leg in enumerate(orbit.problem.legs):
        if leg.kind != "exit" or system.coupled:
            continue
        other = {"L_F1 h": "L_F2 h", "L_F2 h": "L_F1 h"}[leg.name]
        flight = orbit.evaluation.flight
        end = flight.end[i, : flight.sizes[i]]
        at = Leg(leg.mode, other, "exit").at_end(system, end, p)
        size = float(np.linalg.norm(at.gradient) * np.linalg.norm(end)) or 1.0
        if abs(at.value) <= 1e-9 * size:
            raise DegenerateError(
                f"periodic orbit: expected legs that end on one fold, received leg {i + 1} "
                f"{leg_name(leg)} that ends where L_F1 h and L_F2 h both vanish: a two-fold, at "
                f"{end[: system.dimension].tolist()}. The orbit is not unique there: vary a parameter."
            )
    orbit.floquet  # noqa: B018  # DegenerateError where an event is grazed
