"""The harvested prey-predator model and its cycles.

    x1' = x1 (1 - x1) - psi x2,   x2' = psi x2 - d x2 - E x2 [x2 > alpha],   psi = a x1/(b + x1)

The paper calls f1 the field below the threshold x2 = alpha and f2 the harvested one above it; in
``nonsmooth`` the harvested one is F1 (h = x2 - alpha > 0). Names here say "free" (below) and
"harvested" (above). The parameters a, d, E, b are quoted from memory.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import nonsmooth as ns

Array = NDArray[np.float64]

PROBLEM = ns.textbook.harvested_prey_predator()
SYSTEM = PROBLEM.system
A, D, E, B = (PROBLEM.parameters[name] for name in ("a", "d", "E", "b"))

#: Folds on x2 = alpha: psi = d (free field) and psi = d + E (harvested field).
FREE_FOLD = B * D / (A - D)
HARVESTED_FOLD = B * (D + E) / (A - D - E)
#: Thresholds where an equilibrium is on the surface, and where two pseudo-equilibria merge.
BOUNDARY_FOCUS = (1 - FREE_FOLD) * (B + FREE_FOLD) / A
BOUNDARY_NODE = (1 - HARVESTED_FOLD) * (B + HARVESTED_FOLD) / A
SADDLE_NODE = (1 + B) ** 2 / (4 * A)


def at(alpha: float) -> dict[str, float]:
    """Return the parameter that varies."""
    return {"alpha": float(alpha)}


def pseudo_equilibria(alpha: float) -> list[float]:
    """Roots x1 of (1 - x1)(b + x1) = a alpha: the pseudo-saddle's, then the pseudo-node's."""
    square = (1 + B) ** 2 / 4 - A * alpha
    if square < 0:
        return []
    return [(1 - B) / 2 - math.sqrt(square), (1 - B) / 2 + math.sqrt(square)]


@cache
def landing(alpha: float) -> tuple[float, float]:
    """Time and x1 at which the orbit from the fold of the free field comes back to the threshold."""
    run = ns.flow.follow(
        SYSTEM, [FREE_FOLD, alpha], 200.0, mode="-", parameters=at(alpha), until="h0", tol=1e-13
    )
    return float(run.t[-1]), float(run.x[-1, 0])


def run_from_fold(alpha: float, t_end: float) -> ns.Trajectory:
    """Simulate from the fold of the free field, downwards."""
    return ns.simulate(
        SYSTEM,
        [FREE_FOLD, alpha],
        t_end,
        parameters=at(alpha),
        start_mode="-",
        max_events=12,
    )


@cache
def period(alpha: float, t_end: float = 3000.0) -> float:
    """Period of the sliding cycle through the fold of the free field; NaN if there is none."""
    exits = [e.t for e in run_from_fold(alpha, t_end).events if e.kind == "exit"]
    return exits[1] - exits[0] if len(exits) > 1 else math.nan


@cache
def sliding_homoclinic() -> float:
    """Threshold at which the orbit from the fold lands on the pseudo-saddle."""

    def beyond(alpha: float) -> float:
        return landing(alpha)[1] - pseudo_equilibria(alpha)[0]

    return float(brentq(beyond, 1.186, SADDLE_NODE - 1e-9, xtol=1e-15))


@cache
def free_cycle() -> tuple[float, Array]:
    """Largest x2 on the cycle of the model without harvest, and the cycle; (m, 2)."""
    x1 = SYSTEM.extended_states[0]
    top = 2.4
    for _ in range(8):  # the return map contracts by some 1e-4
        run = ns.flow.follow(
            SYSTEM,
            [FREE_FOLD, top],
            200.0,
            mode="-",
            parameters=at(100.0),
            watch=[A * x1 / (B + x1) - D],
            tol=1e-13,
        )
        turn = [e for e in run.events if e.kind == "zero"][1]  # the first is the smallest x2
        top = float(turn.x[1])
    return top, run(np.linspace(0.0, turn.t, 1200))
