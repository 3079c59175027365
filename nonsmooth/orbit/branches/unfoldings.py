"""Unfoldings of events that change the itinerary of a periodic orbit.

At a grazing-sliding the derivative of the return map jumps from A_o to A_i = A_o C with
C = I - [F2 - (L21/L11) F1] n/L2, at a corner with the order of its two events. Whether the orbit persists, and
whether an orbit of twice the period exists, is decided by signs of det(I -+ A) (Feigin; di Bernardo,
Kowalczyk & Nordmark 2002; Kowalczyk & di Bernardo 2005). Where an impact is grazed the map has a square
root, x -> A_o (x - s w), s = sqrt(2 a depth) (Nordmark 1991; Fredriksson & Nordmark 1997). The other sliding
bifurcations keep the derivative continuous.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...flow.names import guard_name
from ...local.read_only import ReadOnly
from ...model import Array, DegenerateError, Guard, NonsmoothError
from ...model.derivatives.event_maps import surface_map
from ...model.derivatives.mode_derivatives import contact_expansion, guard_rate_gradient
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation
from ..periodic.multipliers import leg_maps, return_map
from ..runs.legs import Leg, integrate_leg, rate_at
from .branch import FarSide
from .conditions import Condition, touching
from .itinerary_changes import FORCE, ChangedItinerary

#: Sine of the angle between orbit and surface below which an event is a grazing.
_TANGENT = 1e-6

_SMOOTH = "persistence: the derivative of the return map is continuous"
VERDICTS = {
    "crossing-sliding": _SMOOTH,
    "switching-sliding": _SMOOTH,
    "adding-sliding": _SMOOTH,
    "impact grazing": "the return map has a square root: stability is lost at once",
    "grazing of a reset": "the reset happens on one side only, and the return map changes at once",
    "grazing of a stop": "the orbit ends at the stop",
    "grazing of a soft switch": _SMOOTH,
    "focus-centre-limit cycle": "the cycle is born from the largest orbit of a centre",
    "grazing of a jumping force": "the return map has a square root: stability is lost at once",
    "end of complete chatter": "the contact opens before impacts have accumulated: finitely many follow",
    "plastic impact": "the impacts after the first vanish: beyond, the contact closes at once",
    "grazing, escaping": "the orbit leaves along the other field: nothing continues it",
    "two-fold": "the orbit passes a two-fold, where its continuation may not be unique",
    "corner": "two events at one time, {one} and {other}; the itinerary beyond is not known here: "
    "simulate there and continue what is found",
}


#: Events at which the return map may have a square root.
_ROOTS = ("impact grazing", "grazing of a reset", FORCE)


def far_side(
    problem: BoundaryProblem,
    kind: str,
    test: Condition,
    at: Evaluation,
    p: Array,
    itinerary: str,
    beyond: ChangedItinerary | None = None,
) -> FarSide:
    """Classify an event."""
    try:
        if kind == "grazing-sliding" and test.what == "interior":
            numbers = contact_numbers(problem, test, at, p)
            return FarSide(
                itinerary, _verdict(numbers, "with and without sliding"), ReadOnly(numbers)
            )
        passed = "" if test.guard is None else test.guard.kind
        if kind in _ROOTS and test.what == "interior" and passed in ("impact", "reset", "surface"):
            return _root(problem, kind, test, at, p, itinerary)
        if kind == "corner" and beyond is not None and passed == "reset":
            return FarSide(itinerary, _SMOOTH)  # a reset that happens again changes nothing
        if kind == "corner" and beyond is not None:
            numbers = _orders(problem, at, beyond, p)
            return FarSide(itinerary, _verdict(numbers, "with either order"), ReadOnly(numbers))
    except (NonsmoothError, np.linalg.LinAlgError) as error:
        return FarSide(itinerary, f"not classified: {error}")
    verdict = VERDICTS.get(kind, "")
    if kind == "corner":
        i = test.leg
        of, guard = problem.system, test.guard
        other = problem.legs[i].name(of) if guard is None else guard_name(of, guard)
        verdict = verdict.format(one=problem.legs[i - 1].name(of), other=other)
    return FarSide(itinerary, verdict)


def _root(
    problem: BoundaryProblem, kind: str, test: Condition, at: Evaluation, p: Array, itinerary: str
) -> FarSide:
    """The square root of a grazed impact, or of a reset that is one."""
    numbers = impact_numbers(problem, test, at, p)
    if "n.A.w" not in numbers:
        return FarSide(itinerary, VERDICTS[kind], ReadOnly(numbers))
    if numbers["n.A.w"] == 0.0:  # a reset that changes nothing there
        return FarSide(itinerary, _SMOOTH, ReadOnly(numbers))
    if numbers["n.(I - A)^-1.A.w"] > 0.0:
        what = "the visit" if kind == FORCE else "the impact"
        verdict = f"nonsmooth fold: the orbits with and without {what} meet and vanish"
    else:
        verdict = "persistence of an orbit that becomes unstable"
    verdict += "; the return map has a square root: stability is lost at once"
    return FarSide(itinerary, verdict, ReadOnly(numbers))


def contact_numbers(
    problem: BoundaryProblem, test: Condition, at: Evaluation, p: Array
) -> dict[str, float]:
    """Determinants of I -+ A without (o) and with (i) contact, and products for period two."""
    return _determinants(*contact_maps(problem, test, at, p))


def _determinants(outside: Array, inside: Array) -> dict[str, float]:
    one = np.eye(len(outside))
    return {
        "det(I - A_o)": float(np.linalg.det(one - outside)),
        "det(I - A_i)": float(np.linalg.det(one - inside)),
        "det(I + A_o)": float(np.linalg.det(one + outside)),
        "det(I + A_i)": float(np.linalg.det(one + inside)),
        "radius of A_o": float(np.abs(np.linalg.eigvals(outside)).max()),
        "radius of A_i": float(np.abs(np.linalg.eigvals(inside)).max()),
        "radius of A_o A_i": float(np.abs(np.linalg.eigvals(outside @ inside)).max()),
    }


def contact_maps(
    problem: BoundaryProblem, test: Condition, at: Evaluation, p: Array
) -> tuple[Array, Array]:
    """Return maps on the section L1 = 0 at the touching point, without and with contact."""
    assert test.guard is not None
    _require_one_touch(at)
    y = touched(problem, test, at, p)
    own, other, second = contact_at(
        problem, problem.legs[test.leg], test.guard.element, test.guard.side, y, p
    )
    outside = _around(problem, test, at, p, own, second["gradient of L1"])
    normal = surface_map(problem.system, test.guard.element)(y, p).gradient
    ratio = second["L21"] / second["L11"]
    contact = np.eye(problem.dimension)
    contact -= np.outer(other - ratio * own, normal) / float(normal @ other)
    return outside, outside @ contact


def impact_numbers(
    problem: BoundaryProblem, test: Condition, at: Evaluation, p: Array
) -> dict[str, float]:
    """Numbers of the map x -> A (x - s w) at a grazing of an impact or reset with the speed s."""
    system, n, leg, guard = problem.system, problem.dimension, problem.legs[test.leg], test.guard
    assert guard is not None
    _require_one_touch(at)
    values = np.linalg.eigvals(return_map(problem, at))
    leading = complex(values[np.argmax(np.abs(values))])
    # it decides the order of the bifurcations beyond
    numbers = {"leading multiplier": abs(leading), "its angle": float(np.angle(leading))}
    y = touched(problem, test, at, p)
    own = rate_at(system, leg, y, p)[:n]
    if guard.kind == "surface":
        normal, rate, push = _visit(problem, leg, guard, y, p)
    else:
        event = Leg(leg.mode, guard.kind, guard.element, guard.side).at_event(system, y, p)
        size = 1 + np.abs(y).max()
        if y.size != event.gradient.size or np.abs(event.after - y).max() > 1e-6 * size:
            return numbers
        sign = -guard.side if guard.kind == "reset" else 1
        normal = (sign or 1) * event.gradient
        found = guard_rate_gradient(system, leg.mode, guard).copied(y, p)[0]
        rate = found.ravel() * (sign or 1)
        bend = float(rate @ own)
        jump = (event.after_state @ own - own) / bend
        push = jump - own * float(rate @ jump) / bend
    outside = _around(problem, test, at, p, own, rate)
    after = outside @ push
    numbers["n.A.w"] = float(normal @ after)
    numbers["n.(I - A)^-1.A.w"] = float(normal @ np.linalg.solve(np.eye(n) - outside, after))
    if guard.kind == "surface":
        size = math.sqrt(2.0 * float(rate @ own))
        numbers["psi"] = -size * numbers["n.(I - A)^-1.A.w"]
        numbers["n.A.e"] = -size * numbers["n.A.w"]
    return numbers


def _visit(
    problem: BoundaryProblem, leg: Leg, guard: Guard, y: Array, p: Array
) -> tuple[Array, Array, Array]:
    """Gradients of |h| and of its rate at a touch, and w of a visit beyond a surface where a force jumps."""
    # The visit takes 2 s/a2 while the flow without it would take 2 s/a1 to come back.
    own, other, second = contact_at(problem, leg, guard.element, guard.side, y, p)
    gradient, sign = second["gradient of L1"], guard.side
    normal = surface_map(problem.system, guard.element)(y, p).gradient[: own.size]
    return (
        sign * normal,
        sign * gradient,
        2.0 * (own / second["L11"] - other / second["L21"]) * sign,
    )


def _require_one_touch(at: Evaluation) -> None:
    """Raise if an event is grazed too, as where a symmetric orbit touches two points."""
    for event, flow in zip(at.events, at.by_leg, strict=True):
        speed = abs(float(event.gradient @ flow.rate))
        size = float(np.linalg.norm(event.gradient) * np.linalg.norm(flow.rate))
        if size and speed < _TANGENT * size:
            raise DegenerateError("another event is grazed at the same orbit")


def touched(problem: BoundaryProblem, test: Condition, at: Evaluation, p: Array) -> Array:
    """The state (N,) of a leg nearest to a guard."""
    i, guard = test.leg, test.guard
    assert guard is not None
    x, duration = at.starts[i], float(at.durations[i])
    t = touching(problem.system, problem.legs[i], test, x, duration, p)[0]
    return integrate_leg(problem.system, problem.legs[i], x, t, p).end[: problem.dimension]


def _orders(
    problem: BoundaryProblem, at: Evaluation, beyond: ChangedItinerary, p: Array
) -> dict[str, float]:
    """Determinants at a corner: o with the order of events before it, i with the other one."""
    maps, first = leg_maps(problem, at), beyond.origin[0]
    outside, n = np.eye(problem.dimension), problem.dimension
    for k in range(len(maps)):
        outside = maps[(first + k) % len(maps)] @ outside
    inside = return_map(beyond.problem, beyond.problem.evaluate(beyond.u, p))
    numbers = _determinants(outside, inside)
    if problem.symmetry is not None and first:  # on another section, of the other half
        del numbers["radius of A_o A_i"]
    if n != len(inside) or not np.isfinite(list(numbers.values())).all():
        raise DegenerateError("its events are not crossed in the other order")
    return numbers


def _around(
    problem: BoundaryProblem, test: Condition, at: Evaluation, p: Array, own: Array, section: Array
) -> Array:
    """Return map at the touching point, on the section of a function's gradient, without contact."""
    system, n, i, guard = problem.system, problem.dimension, test.leg, test.guard
    assert guard is not None
    leg, x, duration = problem.legs[i], at.starts[i], float(at.durations[i])
    t = touching(system, leg, test, x, duration, p)[0]
    first = integrate_leg(system, leg, x, t, p)
    across = np.eye(n) - np.outer(own, section) / float(section @ own)
    maps = leg_maps(problem, at)
    rest = integrate_leg(system, leg, first.end[:n], duration - t, p)
    if not leg.timed:
        event = at.events[i]
        speed = float(event.gradient @ rest.rate)
        closing = event.after_state @ (
            rest.by_start - np.outer(rest.rate, event.gradient @ rest.by_start) / speed
        )
    else:
        closing = rest.by_start[:n]  # an orbit without events has no other section
    if i + 1 == len(maps):
        closing = problem.wrap @ closing
    product = closing
    for k in range(1, len(maps)):
        product = maps[(i + k) % len(maps)] @ product
    return np.asarray(across @ first.by_start[:n] @ product @ across)


def contact_at(
    problem: BoundaryProblem, leg: Leg, surface: int, side: int, y: Array, p: Array
) -> tuple[Array, Array, dict[str, Any]]:
    """The field of a leg and the one across its surface at a point, and second Lie derivatives."""
    system, n = problem.system, problem.dimension
    if "s" in leg.mode or any(surface in members for members in system.sets):
        raise DegenerateError("the map of a touch is known for legs that do not slide elsewhere")

    at = contact_expansion(system, leg.mode, surface, side)
    own, other, gradient = (v.ravel()[:n] for v in at.copied(y, p))
    second = {"gradient of L1": gradient, "L11": gradient @ own, "L21": gradient @ other}
    return own, other, second


def _verdict(numbers: dict[str, float], which: str) -> str:
    """Persistence or nonsmooth fold, and what happens to stability (Feigin's classification)."""
    if numbers["det(I - A_o)"] * numbers["det(I - A_i)"] < 0:
        return f"nonsmooth fold: the orbits {which} meet and vanish"
    verdict = "persistence"
    if numbers["radius of A_i"] > 1 and numbers["radius of A_o"] < 1:
        verdict += " of an orbit that becomes unstable"
    if numbers["det(I + A_o)"] * numbers["det(I + A_i)"] < 0:
        stable = numbers.get("radius of A_o A_i", np.inf) < 1
        verdict += f", with {'a stable' if stable else 'an unstable'} orbit of twice the period"
        if not stable and numbers["radius of A_i"] > 1:
            verdict += "; chaos of size linear in the parameter may follow"
    return verdict
