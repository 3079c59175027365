"""The box model in its nonsmooth form, and its cycle.

    T' = 1 - T - k T,   S' = b (1 - S) - k S,   k = 5 if S - a T > eps else 0,   a = .8, b = .5

T and S are temperature and salinity of the box, S - a T its density: where it exceeds the threshold
eps the box mixes with the deep ocean. h = S - a T - eps; F1 mixes, F2 does not. On h = 0,
L1 = L2 - k eps, so sliding is attracting for eps > 0, repelling for eps < 0, and there is none at 0.
The parameters are quoted from memory.
"""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

Array = NDArray[np.float64]

PROBLEM = ns.textbook.welander_box()
SYSTEM = PROBLEM.system
A, B, K = (PROBLEM.parameters[name] for name in ("a", "b", "k"))


def _over_density() -> ns.FilippovSystem:
    """The box with the density S - a T in place of S, in which its cycle is no sliver."""
    t, density, eps = (ca.SX.sym(name) for name in ("T", "density", "eps"))
    s = density + A * t
    fields = []
    for k in (K, 0.0):  # mixing where the water above is denser than the threshold
        warming = 1 - t - k * t
        fields.append([warming, B * (1 - s) - k * s - A * warming])
    above, below = fields
    return ns.FilippovSystem(
        [t, density], surface=density - eps, above=above, below=below, parameters={eps: 0.0}
    )


DENSITY = _over_density()

#: Equilibria of the fields, and the thresholds at which they are on the surface.
MIXED = np.array([1 / (1 + K), B / (B + K)])
RESTING = np.array([1.0, 1.0])
BOUNDARY_MIXED = float(MIXED[1] - A * MIXED[0])  # -7/165
BOUNDARY_RESTING = float(RESTING[1] - A * RESTING[0])  # .2
FUSED = 0.0
#: Where both fields are tangent to the surface at eps = 0: b (1 - S) = a (1 - T), S = a T.
FOLD_FOLD = np.array([(A - B) / (A * (1 - B)), (A - B) / (1 - B)])


#: Temperature and threshold at which two pseudo-equilibria merge.
MERGING = float((1 - np.sqrt(B / A)) / (1 - B))


def threshold_of(temperature: NDArray[np.float64] | float) -> NDArray[np.float64] | float:
    """Threshold at which there is a pseudo-equilibrium of this temperature: F1 x F2 = 0 on h = 0."""
    return B * temperature / (1 - (1 - B) * temperature) - A * temperature


def at(eps: float) -> dict[str, float]:
    """Return the parameter that varies."""
    return {"eps": float(eps)}


def point(temperature: float, eps: float) -> Array:
    """Point of the surface with a temperature; (2,)."""
    return np.array([temperature, A * temperature + eps])


def simulate(
    start: Array,
    eps: float,
    t_end: float,
    mode: str | None = None,
    tol: float = 1e-11,
    max_events: int = 1000,
) -> ns.Trajectory:
    """Simulate the box."""
    return ns.simulate(
        SYSTEM,
        start,
        t_end,
        parameters=at(eps),
        start_mode=mode,
        tol=tol,
        max_events=max_events,
    )


def once_around(temperature: float, eps: float) -> tuple[float, float]:
    """Temperature at the next crossing downwards from one of them, and the time it takes."""
    run = simulate(point(temperature, eps), eps, 60.0, "-", 1e-13, max_events=2)
    down = [e for e in run.events if e.kind == "crossing" and e.mode_after == "-"]
    return float(down[0].x[0]), down[0].t


@cache
def cycle(eps: float) -> tuple[float, float, float]:
    """Temperature at the downward crossing of the cycle, its period, and its multiplier."""
    run = simulate(FOLD_FOLD - 2.0 * np.sqrt(-eps), eps, 60.0, tol=1e-8, max_events=12)
    temperature = float(
        [e for e in run.events if e.kind == "crossing" and e.mode_after == "-"][-1].x[0]
    )
    for _ in range(20):
        landing, period = once_around(temperature, eps)
        step = 1e-5
        ends = [once_around(temperature + d, eps)[0] for d in (step, -step)]
        multiplier = (ends[0] - ends[1]) / (2 * step)
        change = (landing - temperature) / (1 - multiplier)
        temperature += change
        if abs(change) < 1e-13:
            break
    return temperature, period, multiplier
