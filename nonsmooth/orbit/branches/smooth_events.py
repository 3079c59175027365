"""What branches off at the smooth bifurcations of a periodic orbit, and whether it is stable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...local.read_only import ReadOnly
from ...model import Array, NonsmoothError
from ...solvers.continuation import Point, Zero
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation
from ..periodic.multipliers import return_map
from ..periodic.symmetry import halves, once_round
from .branch import FarSide
from .normal_forms import normal_form

if TYPE_CHECKING:
    from .orbit_branches import OrbitCurve


_WORDS = {
    "fold": "two orbits meet and vanish",
    "branch point": "branches cross",
    "period doubling": "an orbit of twice the period branches off",
    "pitchfork": "two orbits without the symmetry branch off",
    "Neimark-Sacker": "an invariant torus is born",
}

#: Angles that are this close to a strong resonance have normal forms of their own.
_RESONANT = 1e-4


def smooth_side(problem: BoundaryProblem, at: Evaluation, p: Array, kind: str) -> FarSide | None:
    """Classify a smooth bifurcation."""
    words, numbers = _WORDS[kind], dict[str, float]()
    if kind in ("fold", "branch point"):
        return FarSide("", words)
    values = np.linalg.eigvals(return_map(problem, at))
    critical = [int(np.argmin(np.abs(values + 1.0)))]
    if kind == "Neimark-Sacker":
        k, l = np.triu_indices(values.size, 1)
        near = int(np.argmin(np.abs(values[k] * values[l] - 1.0)))
        critical = [int(k[near]), int(l[near])]
        pair = values[k[near]]
        if abs(pair.imag) < 1e-9:
            return None  # a neutral saddle: two real multipliers with the product 1
        numbers["angle"] = angle = float(abs(np.angle(pair)))
        if min(abs(3.0 * angle - 2.0 * np.pi), abs(4.0 * angle - 2.0 * np.pi)) < _RESONANT:
            return FarSide("", f"{words}; not classified: a strong resonance", ReadOnly(numbers))
    found = normal_form(problem, at, p, kind)
    if not found:
        return FarSide("", f"{words}; not classified: no orbits beside it", ReadOnly(numbers))
    value, error = found.values()
    numbers |= found
    if abs(value) <= 10.0 * error:
        return FarSide("", f"{words}; degenerate to rounding", ReadOnly(numbers))
    grows = (value < 0.0) if kind == "Neimark-Sacker" else (value > 0.0)
    rest = np.delete(values, critical)
    stable = grows and bool(np.all(np.abs(rest) < 1.0))
    what = "supercritical" if grows else "subcritical"
    return FarSide("", f"{words} ({what}{', stable' if stable else ''})", ReadOnly(numbers))


# Branch points of orbits that are the doubling or the pitchfork of a part of them, met from the other side.

#: Branch points are found to about the square root of rounding; so is the multiplier -1 there.
_PARTS = 1e-3

#: Kind, curve and point of the event, its test, and what is beyond.
Parting = tuple[str, "OrbitCurve", Point, str, FarSide]


def as_doubling(curve: OrbitCurve, zero: Zero) -> Parting | None:
    """Two rounds that become one."""
    u, p = zero.point.u, curve.parameters_at(zero.point.u)
    problem, once = once_round(curve.problem, u[: curve.problem.size], p)
    whole = float(curve.problem.split(u)[1].sum())
    if round(whole / float(problem.split(once)[1].sum())) != 2:
        return None
    return _part(curve, problem, once, zero, "period doubling")


def as_pitchfork(curve: OrbitCurve, zero: Zero) -> Parting | None:
    """An orbit that a reflection of coordinates maps to itself half a period later."""
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
