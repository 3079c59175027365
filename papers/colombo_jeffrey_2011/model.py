"""The normal form of all two-folds, and a system that returns to its two-fold again and again.

The state is (x, y, z) = (z1, z2, z3) of ``nonsmooth``:

    x > 0: (-y, -sigma1, nu1)        x < 0: (z, nu2, sigma2)

The paper's own example of recurrence was not at hand. The one here adds one term to the normal form
of the invisible two-fold, nu1 + c x in place of nu1 above the surface: high flights are turned less
than low ones, so orbits that spiral away from the singularity come back to slide into it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

Array = NDArray[np.float64]
Numbers = tuple[tuple[int, int], tuple[float, float]]

#: One two-fold of each class.
CLASSES = ns.textbook.TWO_FOLDS
RING = 120
#: nu1 = nu2 of the recurrent system, on both sides of the bifurcation at nu1 nu2 = 1.
RECURRENT, CALM, BEND = -1.1, -0.9, 1.0


def ring() -> Array:
    """Points (y, z) on the unit circle inside the attracting sliding region; (RING, 2)."""
    angles = (np.arange(RING) + 0.5) / RING * math.pi / 2
    return np.column_stack([np.cos(angles), np.sin(angles)])


@cache
def normal_form(numbers: Numbers) -> ns.FilippovSystem:
    """Return the normal form with these signs and numbers."""
    return ns.textbook.two_fold(*numbers).system


@cache
def arrivals(numbers: Numbers) -> int:
    """How many of the ring of attracting sliding orbits end at the two-fold, by simulation."""
    system = normal_form(numbers)
    runs = [ns.simulate(system, [0.0, *p], 20.0, tol=1e-9) for p in ring()]
    return sum(r.status is ns.Status.NON_UNIQUE for r in runs)


@cache
def repelling_arrivals(numbers: Numbers) -> int:
    """How many of the opposite ring, in repelling sliding, end there if they stay in the surface."""
    system, folds = normal_form(numbers), ["lambda0 = 1", "lambda0 = -1"]
    runs = [
        ns.flow.follow(system, [0.0, *-p], 20.0, mode="s", until=folds, tol=1e-9) for p in ring()
    ]
    return sum(float(np.abs(r.x[-1]).max()) < 1e-6 for r in runs)


@cache
def recurrent() -> ns.FilippovSystem:
    """Return the system whose orbits return; parameters nu1, nu2 and c."""
    x, y, z = (ca.SX.sym(s) for s in "xyz")
    nu1, nu2, c = (ca.SX.sym(s) for s in ("nu1", "nu2", "c"))
    return ns.FilippovSystem(
        [x, y, z],
        surface=x,
        above=[-y, 1, nu1 + c * x],
        below=[z, nu2, 1],
        parameters={nu1: RECURRENT, nu2: RECURRENT, c: BEND},
    )


@dataclass(frozen=True)
class Excursion:
    """An orbit from repelling sliding at ``start`` to the side ``mode`` and back to the two-fold."""

    start: Array
    mode: str
    trajectory: ns.Trajectory

    @property
    def returned(self) -> bool:
        """Whether it ends at the two-fold."""
        return self.trajectory.status is ns.Status.NON_UNIQUE

    @property
    def amplitude(self) -> float:
        """Largest height above the surface."""
        t = np.linspace(self.trajectory.t[0], self.trajectory.t[-1], 2000)
        return float(self.trajectory(t)[:, 0].max())


@cache
def excursions(count: int = 40, seed: int = 1) -> tuple[Excursion, ...]:
    """Continue from the two-fold at random: slide on for a while, then leave to a side."""
    chance = np.random.default_rng(seed)
    system = recurrent()
    fold = ns.find_two_fold(system, [0.0, 0.01, 0.01])
    found = []
    for _ in range(count):
        angle, radius = chance.uniform(0, math.pi / 2), 0.3 * chance.uniform(0.05, 1)
        start = fold.point_at([-radius * math.cos(angle), -radius * math.sin(angle)])
        mode = "+-"[int(chance.integers(2))]
        run = ns.simulate(system, start, 400.0, start_mode=mode)
        found.append(Excursion(start, mode, run))
    return tuple(found)


@cache
def slid_from(start: tuple[float, ...]) -> Array:
    """Sliding orbit from the two-fold to a point of repelling sliding near it; (m, 3)."""
    back = ns.flow.follow(recurrent(), start, -5.0, mode="s", until=_close(), tol=1e-8)
    return back(np.linspace(back.t[0], back.t[-1], 60))[::-1]


def _close() -> ca.SX:
    """Zero at a small distance from the two-fold."""
    x = recurrent().extended_states
    return x[1] ** 2 + x[2] ** 2 - 1e-6


def calm_run(t_end: float = 400.0) -> ns.Trajectory:
    """Simulate an orbit on the other side of the bifurcation, where nothing reaches the two-fold."""
    values = {"nu1": CALM, "nu2": CALM}
    return ns.simulate(recurrent(), [0.0, 0.05, 0.08], t_end, parameters=values)
