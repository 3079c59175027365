"""End of complete chatter on a branch of periodic orbits, where a contact opens as soon as it has closed.

Towards it the time T for which the contact is closed vanishes. Impacts accumulate ever closer to the release, where the
contact's acceleration is zero, so their limit is a power of the parameter's distance, whose exponent follows from the
restitution: with the gap's acceleration proportional to the time tau to the release, the speed c tau^2 w becomes
c tau'^2 w' by an impact, and w' = w has an unstable solution. The parameter at T = 0 is extrapolated from those at
geometrically falling T.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...model import Array, NonsmoothError
from ..periodic.boundary_value_problem import BoundaryProblem
from ..runs.limits import geometric_limit

#: Times for which a contact is closed, relative to the period: below the first the end of chatter may be near.
_TIMES = 0.05 * 0.6 ** np.arange(9.0)

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
) -> tuple[float, Array] | None:
    """Value of the parameter, which is the last unknown, at the end of complete chatter, and unknowns near it; None where
    that is not near."""
    count, n = len(problem.legs), problem.dimension
    durations = problem.split(u[: problem.size])[1]
    period = float(durations.sum())
    closed = [
        i
        for i, leg in enumerate(problem.legs)
        if leg.kind == "release" and problem.legs[i - 1].repeats
    ]
    i = min(closed, key=lambda k: float(durations[k]), default=-1)
    if i < 0 or not durations[i] < _TIMES[1] * period:
        return None
    index, values, nearest = count * n + i, list[float](), u
    jacobian = equations(u)[1]
    for time in _TIMES[::-1] * period:
        if time < durations[i]:
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
