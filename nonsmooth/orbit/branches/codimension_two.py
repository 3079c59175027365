"""What degenerates on a curve of bifurcations of periodic orbits: points of codimension two.

On a curve of grazing-sliding the touching is of higher order (L11 = 0), or at a two-fold (L2 = 0), or a
multiplier with contact is 1 or -1, or a second place touches; on one of crossing- or switching-sliding
L11 = 0 turns one into the other. On a curve of Neimark-Sacker points the angle is resonant; where the pair
meets at 1 or -1 the curve ends, as the numbers beyond are a neutral saddle's. There and on curves of period
doublings the cubic coefficient of the normal form may vanish.

Source: Kowalczyk, di Bernardo, Champneys et al. 2006 (Int. J. Bifurcation Chaos 16, 601); Kuznetsov 2004,
ch. 9.
"""

from __future__ import annotations

import numpy as np

from ...model import Array, NonsmoothError
from ...model.derivatives.event_maps import surface_map
from ...model.derivatives.variational import guarded_field, variational_field
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation
from ..periodic.multipliers import return_map
from .conditions import Condition, minima
from .normal_forms import normal_form
from .unfoldings import contact_at, contact_numbers, touched

#: Resonances by the cosine of their angle.
_RESONANT = {"1:1": 1.0, "1:2": -1.0, "1:3": -0.5, "1:4": 0.0}

#: At these the curve ends.
ENDS = ("1:1 resonance", "1:2 resonance")


def degenerate(
    problem: BoundaryProblem, condition: Condition | None, name: str, at: Evaluation, p: Array
) -> dict[str, float]:
    """Functions that vanish at points of codimension two on the curve of one event."""
    if name == "Neimark-Sacker":
        return _resonances(problem, at) | _cubic(problem, at, p, name)
    if name in ("period doubling", "pitchfork"):
        return _cubic(problem, at, p, name)
    if condition is None or condition.guard is None:
        return {}
    if condition.what == "interior":
        return _touches(problem, condition, at, p)
    return _beginnings(problem, condition, at, p) if condition.what == "start" else {}


def _cubic(problem: BoundaryProblem, at: Evaluation, p: Array, name: str) -> dict[str, float]:
    """The coefficient of the normal form: where it vanishes a curve of folds begins."""
    word = "Chenciner" if name == "Neimark-Sacker" else f"degenerate {name}"
    try:
        found = normal_form(problem, at, p, name)
    except np.linalg.LinAlgError:  # another multiplier is 1
        return {}
    return {word: next(iter(found.values()))} if found else {}


def _resonances(problem: BoundaryProblem, at: Evaluation) -> dict[str, float]:
    values = np.linalg.eigvals(return_map(problem, at))
    k, l = np.triu_indices(values.size, 1)
    near = int(np.argmin(np.abs(values[k] * values[l] - 1.0)))
    cosine = float((values[k[near]] + values[l[near]]).real) / 2.0
    found = {f"{word} resonance": cosine - value for word, value in _RESONANT.items()}
    others = np.delete(values, [k[near], l[near]])  # the pair itself passes 1 and -1 where it ends
    found["fold"] = float(np.prod(1.0 - others[np.abs(others) > 1e-9]).real)
    found["period doubling"] = float(np.prod(1.0 + others[np.abs(others) > 1e-9]).real)
    return found


def _touches(
    problem: BoundaryProblem, condition: Condition, at: Evaluation, p: Array
) -> dict[str, float]:
    i, guard = condition.leg, condition.guard
    assert guard is not None
    leg, x, duration = problem.legs[i], at.starts[i], float(at.durations[i])
    found: dict[str, float] = {}
    values = sorted(minima(problem.system, leg, condition, x, duration, p), key=abs)
    if len(values) > 1:
        found["a second touch"] = min(values[1:])
    if guard.kind != "surface":
        return found
    y = touched(problem, condition, at, p)
    try:
        _, other, second = contact_at(problem, leg, guard.element, guard.side, y, p)
    except NonsmoothError:
        return found  # the leg slides elsewhere
    normal = guard.side * surface_map(problem.system, guard.element)(y, p).gradient
    found["two-fold"] = float(normal[: other.size] @ other)
    found["touch of higher order"] = guard.side * float(second["L11"])
    with np.errstate(all="ignore"):  # at the two-fold itself the map has a pole
        try:
            numbers = contact_numbers(problem, condition, at, p)
        except np.linalg.LinAlgError:
            return found
    found["fold with contact"] = numbers["det(I - A_i)"]
    found["period doubling with contact"] = numbers["det(I + A_i)"]
    return {key: value for key, value in found.items() if np.isfinite(value)}


def _beginnings(
    problem: BoundaryProblem, condition: Condition, at: Evaluation, p: Array
) -> dict[str, float]:
    i, guard, system = condition.leg, condition.guard, problem.system
    field = guarded_field(system, problem.legs[i].mode)
    k = field.motion.guards.index(guard)
    y = variational_field(system, problem.legs[i].mode).states_at(at.starts[i], p)
    order = 2 if problem.legs[i - 1].kind == "crossing" else 1
    before = at.events[i - 1]
    rate = at.flown[i - 1].rate[: before.gradient.size]
    return {
        "cusp with the other sliding bifurcation": float(field.jets(y, p)[1][k, order]),
        "two-fold": float(before.gradient @ rate),
    }
