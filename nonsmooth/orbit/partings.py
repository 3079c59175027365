"""Branch points of orbits that are the doubling or the pitchfork of a part of them, met from the other side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model import Array, NonsmoothError
from .boundary import BoundaryProblem
from .branch import FarSide
from .continuation import Point, Zero
from .multipliers import return_map
from .rounds import halves, once_round
from .smooth_events import smooth_side

if TYPE_CHECKING:
    from .orbit_branches import OrbitCurve

#: Branch points are found to about the square root of rounding; so is the multiplier -1 there.
_PARTS = 1e-3

#: Kind, curve and point of the event, its test, and what is beyond.
Parting = tuple[str, "OrbitCurve", Point, str, FarSide]


def as_doubling(curve: OrbitCurve, zero: Zero) -> Parting | None:
    """Two rounds that become one: the period doubling of the shorter orbit, met from the doubled ones.

    Parameters
    ----------
    curve : OrbitCurve
    zero : Zero
        A branch point.
    """
    u, p = zero.point.u, curve.parameters_at(zero.point.u)
    problem, once = once_round(curve.problem, u[: curve.problem.size], p)
    whole = float(curve.problem.split(u)[1].sum())
    if round(whole / float(problem.split(once)[1].sum())) != 2:
        return None
    return _part(curve, problem, once, zero, "period doubling")


def as_pitchfork(curve: OrbitCurve, zero: Zero) -> Parting | None:
    """An orbit that a reflection of coordinates maps to itself half a period later: its pitchfork.

    Parameters
    ----------
    curve : OrbitCurve
    zero : Zero
        A branch point.
    """
    u, p = zero.point.u, curve.parameters_at(zero.point.u)
    for problem, half in halves(curve.problem, u[: curve.problem.size], p):
        found = _part(curve, problem, half, zero, "pitchfork")
        if found is not None:
            return found
    return None


def _part(
    curve: OrbitCurve, problem: BoundaryProblem, part: Array, zero: Zero, kind: str
) -> Parting | None:
    """The event of a part of the orbit whose return map has the multiplier -1."""
    made = curve.with_problem(problem, part)
    u = np.append(part, zero.point.u[-len(curve.free) :])
    try:
        tangent = np.linalg.svd(made.scaled(u / made.scale)[1])[2][-1]
        point, at = made.point(u, tangent, tangent, 0.0), made.evaluation(u)
        values = np.linalg.eigvals(return_map(problem, at))
    except (NonsmoothError, np.linalg.LinAlgError):
        return None
    if point is None or not float(np.abs(values + 1.0).min()) < _PARTS:
        return None
    side = smooth_side(problem, at, made.parameters_at(u), kind)
    return None if side is None else (kind, made, point, kind, side)
