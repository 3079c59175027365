"""What is beyond an event that changes the itinerary of a periodic orbit.

At a grazing-sliding the derivative of the return map jumps from A_o to A_i = A_o C with
C = I - [F2 - (L21/L11) F1] n/L2. Whether the orbit persists, and whether an orbit of twice the period
exists, is decided by signs of det(I -+ A) (Feigin; di Bernardo, Kowalczyk & Nordmark 2002; Kowalczyk &
di Bernardo 2005). The other sliding bifurcations keep the derivative continuous.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..local.read_only import ReadOnly
from ..model import Array, NonsmoothError
from ..model.event_maps import surface_map
from .boundary import BoundaryProblem, Evaluation
from .branch import FarSide
from .conditions import Condition, touching
from .legs import Leg, fly
from .multipliers import leg_maps, return_map

_SMOOTH = "persistence: the derivative of the return map is continuous"
_VERDICTS = {
    "crossing-sliding": _SMOOTH,
    "switching-sliding": _SMOOTH,
    "adding-sliding": _SMOOTH,
    "impact grazing": "the return map has a square root: stability is lost or gained at once",
    "grazing of a reset": "the return map changes at once",
    "grazing of a stop": "the orbit ends at the stop",
    "grazing, escaping": "the orbit leaves along the other field: nothing continues it",
    "two-fold": "the orbit passes a two-fold, where the future is not unique",
    "corner": "the derivative of the return map jumps with the order of the events",
}


def far_side(
    problem: BoundaryProblem, kind: str, test: Condition, at: Evaluation, p: Array, word: str
) -> FarSide:
    """Classify an event.

    Parameters
    ----------
    problem : BoundaryProblem
        Of the itinerary with fewer legs, where the event is regular.
    kind : str
    test : Condition
    at : Evaluation
    p : ndarray
    word : str
        The other itinerary.
    """
    if kind == "grazing-sliding" and test.what == "interior" and test.guard is not None:
        try:
            numbers = contact_numbers(problem, test, at, p)
        except NonsmoothError:
            return FarSide(word, "not classified: the map of a touch is known for one surface")
        return FarSide(word, _verdict(numbers), ReadOnly(numbers))
    if kind == "impact grazing" and test.what == "interior":
        values = np.linalg.eigvals(return_map(problem, at))
        leading = complex(values[np.argmax(np.abs(values))])
        # of the orbit that does not touch: by it the bifurcations beyond are ordered (Nordmark 1991)
        numbers = {"leading multiplier": abs(leading), "its angle": float(np.angle(leading))}
        return FarSide(word, _VERDICTS[kind], ReadOnly(numbers))
    return FarSide(word, _VERDICTS.get(kind, ""))


def contact_numbers(
    problem: BoundaryProblem, test: Condition, at: Evaluation, p: Array
) -> dict[str, float]:
    """Determinants of I -+ A without (o) and with (i) contact, and products for period two."""
    outside, inside = contact_maps(problem, test, at, p)
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
    system, n, i, guard = problem.system, problem.dimension, test.leg, test.guard
    assert guard is not None
    leg, x, duration = problem.legs[i], at.starts[i], float(at.durations[i])
    t = touching(system, leg, guard, x, duration, p)
    first = fly(system, leg, x, t, p)
    y = first.end[:n]
    own, other, second = contact_at(problem, leg, guard.index, guard.side, y, p)
    section = second["gradient of L1"]
    across = np.eye(n) - np.outer(own, section) / float(section @ own)
    maps = leg_maps(problem, at)
    rest = fly(system, leg, y, duration - t, p)
    event = at.events[i]
    speed = float(event.gradient @ rest.rate)
    closing = event.after_state @ (
        rest.by_start - np.outer(rest.rate, event.gradient @ rest.by_start) / speed
    )
    if i + 1 == len(maps):
        closing = problem.wrap @ closing
    product = closing
    for k in range(1, len(maps)):
        product = maps[(i + k) % len(maps)] @ product
    outside = across @ first.by_start[:n] @ product @ across
    normal = surface_map(system, guard.index)(y, p).gradient
    ratio = second["L21"] / second["L11"]
    contact = np.eye(n) - np.outer(other - ratio * own, normal) / float(normal @ other)
    return outside, outside @ contact


def contact_at(
    problem: BoundaryProblem, leg: Leg, surface: int, side: int, y: Array, p: Array
) -> tuple[Array, Array, dict[str, Any]]:
    """The field of a leg and the one across its surface at a point, and second Lie derivatives."""
    n, system = problem.dimension, problem.system
    turned = leg.mode[:surface] + ("-" if side > 0 else "+") + leg.mode[surface + 1 :]
    own = leg.field(system).rate.copied(y, p)[0][:n, 0]
    other = Leg(turned).field(system).rate.copied(y, p)[0][:n, 0]
    slide = leg.mode[:surface] + "s" + leg.mode[surface + 1 :]
    name = "L_F1 h" if side > 0 else "L_F2 h"
    gradient = Leg(slide, name, "exit").at_end(system, y, p).gradient[:n]
    second = {"gradient of L1": gradient, "L11": gradient @ own, "L21": gradient @ other}
    return own, other, second


def _verdict(numbers: dict[str, float]) -> str:
    """Persistence or nonsmooth fold, and what happens to stability (Feigin's classification)."""
    if numbers["det(I - A_o)"] * numbers["det(I - A_i)"] < 0:
        return "nonsmooth fold: the orbits with and without sliding meet and vanish"
    words = "persistence"
    if numbers["radius of A_i"] > 1 and numbers["radius of A_o"] < 1:
        words += " of an orbit that becomes unstable"
    if numbers["det(I + A_o)"] * numbers["det(I + A_i)"] < 0:
        stable = numbers["radius of A_o A_i"] < 1
        words += f", with {'a stable' if stable else 'an unstable'} orbit of twice the period"
        if not stable and numbers["radius of A_i"] > 1:
            words += "; chaos of size linear in the parameter may follow"
    return words
