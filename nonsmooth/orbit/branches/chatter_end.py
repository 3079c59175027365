"""Ends of complete chatter on a branch of periodic orbits: a contact opens as soon as it has closed, or closes at once.

Towards it the time T for which the contact is closed vanishes. Impacts accumulate ever closer to the release, where the
contact's acceleration is zero, so their limit is a power of the parameter's distance, whose exponent follows from the
restitution: with the gap's acceleration proportional to the time tau to the release, the speed c tau^2 w becomes
c tau'^2 w' by an impact, and w' = w has an unstable solution. The parameter at T = 0 is extrapolated from those at
geometrically falling T. Where the restitution vanishes, the time of all impacts after the first does.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...model import Array, NonsmoothError
from ..periodic.boundary_value_problem import BoundaryProblem
from ..runs.limits import geometric_limit
from .itinerary_changes import CHATTER_END, PLASTIC

#: Times for which a contact is closed, relative to the period: below the first the end of chatter may be near; and
#: those of impacts after the first, as a part of them.
_TIMES, _IMPACTS = 0.05 * 0.6 ** np.arange(9.0), 0.01

#: Steps of Newton's method, in units of the orbit: so small, or so small that rounding of the limit keeps them from
#: becoming smaller.
_MOST_STEPS, _SMALL, _LEAST = 12, 1e-8, 1e-6

#: Change of the limit, relative to that of the parameter, below which it has converged.
_RESOLVED = 1e-3


def chatter_end(
    problem: BoundaryProblem,
    u: Array,
    scale: Array,
    equations: Callable[[Array], tuple[Array, Array]],
) -> tuple[str, float, Array] | None:
    """Kind of the end, value of the parameter, which is the last unknown, and unknowns near it; None where none is near."""
    durations = problem.split(u[: problem.size])[1]
    limits = [i for i, leg in enumerate(problem.legs) if leg.repeats]
    after = [(i + 1) % len(problem.legs) for i in limits]
    closed = [i for i in after if problem.legs[i].kind == "release"]
    for kind, legs, times in ((CHATTER_END, closed, _TIMES), (PLASTIC, limits, _IMPACTS * _TIMES)):
        i = min(legs, key=lambda k: float(durations[k]), default=-1)
        times = times * float(durations.sum())
        if i >= 0 and durations[i] < times[1]:
            index = len(durations) * problem.dimension + i
            found = _vanishing(u, index, times, scale, equations)
            return None if found is None else (kind, *found)
    return None


def _vanishing(
    u: Array,
    index: int,
    times: Array,
    scale: Array,
    equations: Callable[[Array], tuple[Array, Array]],
) -> tuple[float, Array] | None:
    """Value of the parameter at which the time at an index of the unknowns vanishes, and unknowns near it."""
    values, nearest, shortest = list[float](), u, float(u[index])
    jacobian = equations(u)[1]
    for time in times[::-1]:
        if time < shortest:
            continue
        found = _closed_for(u, jacobian, index, time, scale, equations)
        if found is None:  # so near to the end impacts may seem to end early
            values = []
            continue
        u, jacobian = found
        nearest = nearest if values else u
        values.append(float(u[-1]))
    limit, change = geometric_limit(np.array(values[::-1]))
    return (limit, nearest) if change < _RESOLVED else None


def _closed_for(
    u: Array,
    jacobian: Array,
    index: int,
    time: float,
    scale: Array,
    equations: Callable[[Array], tuple[Array, Array]],
) -> tuple[Array, Array] | None:
    """The orbit of the branch on which one unknown is a time, with derivatives near it; None where Newton's
    method fails."""
    row, values, size = np.eye(1, u.size, index), np.zeros(u.size - 1), np.inf
    try:
        for _ in range(_MOST_STEPS):
            right = np.append(values, u[index] - time)
            step = np.linalg.solve(np.vstack([jacobian, row]) * scale, right) * scale
            u, before, size = u - step, size, float(np.abs(step / scale).max())
            if size < _SMALL or 0.5 * before < size < _LEAST:
                return u, jacobian
            values, jacobian = equations(u)
    except (NonsmoothError, np.linalg.LinAlgError):
        return None
    return None
