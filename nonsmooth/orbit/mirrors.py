"""Legs as the symmetry of an orbit maps them: the other half of one that is solved for as a half."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .boundary import BoundaryProblem
from .conditions import surface_of
from .legs import Leg

TURNED = str.maketrans("+-", "-+")


def neighbours(problem: BoundaryProblem, i: int) -> tuple[Leg, Leg]:
    """The legs before and after leg ``i``; beyond the ends of a half those of the other half."""
    legs, last = problem.legs, len(problem.legs) - 1
    before = legs[i - 1] if i else mirrored(problem, legs[last])
    after = legs[i + 1] if i < last else mirrored(problem, legs[0])
    return before, after


def mirrored(problem: BoundaryProblem, leg: Leg) -> Leg:
    """A leg as the symmetry of the problem maps it; surfaces whose function changes its sign turn."""
    if problem.symmetry is None:
        return leg
    turned = _turning(problem)
    mode = "".join(
        c.translate(TURNED) if k < len(turned) and turned[k] else c for k, c in enumerate(leg.mode)
    )
    surface = surface_of(problem.system, leg)
    name, side = leg.name, leg.side
    if surface >= 0 and turned[surface]:
        name = {"L_F1 h": "L_F2 h", "L_F2 h": "L_F1 h"}.get(name, name)
        side = -side
    return replace(leg, mode=mode, name=name, side=side)


def _turning(problem: BoundaryProblem) -> list[bool]:
    """Which switching functions the symmetry maps to their negatives."""
    system = problem.system
    x = np.cos(1.0 + np.arange(system.dimension))
    back = np.linalg.inv(problem.symmetry) if problem.symmetry is not None else np.eye(x.size)
    result = []
    for k in range(system.surface_count):
        h = system.surface_function(k)
        a, b = (float(system.evaluate(h, v, None)[0, 0]) for v in (x, back @ x))
        result.append(a * b < 0.0)
    return result
