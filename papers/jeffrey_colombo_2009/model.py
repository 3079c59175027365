"""The normal form of the invisible two-fold and its orbits, by event-driven simulation.

The state is (x, y, z) and the surface x = 0:

    x > 0: (x', y', z') = (-y, 1, V+)        x < 0: (x', y', z') = (z, V-, 1)

V+ and V- are cotangents of the angles at which the fields pass the folds. They are nu1 and nu2 of
``nonsmooth``, with sigma = (-1, +1), and (x, y, z) is (z1, z2, z3).
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

Array = NDArray[np.float64]
V = tuple[float, float]

SIGMA = (-1, 1)
#: V+ V- below, at and above the bifurcation, both negative.
BEFORE: V = (-0.5, -0.5)
AT: V = (-1.0, -1.0)
AFTER: V = (-2.0, -1.0)


@cache
def system() -> ns.FilippovSystem:
    """Return the normal form, with the parameters nu1 = V+ and nu2 = V-."""
    return ns.textbook.two_fold(SIGMA, AFTER).system


def run(v: V, start: tuple[float, float], t_end: float, *, tol: float = 1e-12) -> ns.Trajectory:
    """Simulate from (0, y, z)."""
    values = {"nu1": v[0], "nu2": v[1]}
    return ns.simulate(system(), [0.0, *start], t_end, parameters=values, tol=tol)


def landings(trajectory: ns.Trajectory) -> Array:
    """(y, z) of the start and of each landing on the surface, crossing or not; (k, 2)."""
    kinds = ("crossing", "entry")
    points = [trajectory.x[0], *(e.x for e in trajectory.events if e.kind in kinds)]
    return np.array(points)[:, 1:]


def flights(trajectory: ns.Trajectory) -> int:
    """Number of arcs over or under the surface before the first sliding."""
    modes = trajectory.itinerary.split()
    return modes.index("s") if "s" in modes else len(modes)


def simulated_return_matrix(v: V) -> Array:
    """Matrix of one flight above and one below, from two simulated orbits; (2, 2)."""
    starts = np.array([[-1.0, 0.1], [-1.0, 0.2]])
    ends = np.array([landings(run(v, tuple(s), 50.0))[2] for s in starts])
    return np.linalg.solve(starts, ends).T


def most_flights(v: V) -> int:
    """Largest number of flights among orbits from a fan of starts in both crossing regions."""
    slopes = np.geomspace(1e-4, 1e4, 9)
    fan = np.column_stack([-1 / np.hypot(1, slopes), slopes / np.hypot(1, slopes)])
    return max(flights(run(v, tuple(s), 400.0, tol=1e-10)) for s in np.vstack([fan, -fan]))


def formula_for_flights(product: float) -> int:
    """ceil(pi/arccos sqrt(V+ V-)) - 1, for V+, V- < 0 and V+ V- < 1."""
    return math.ceil(math.pi / math.acos(math.sqrt(product)) - 1e-12) - 1


def ring(n: int) -> Array:
    """Points on |(y, z)| = 1 inside the attracting sliding region y, z > 0; (n, 2)."""
    angles = (np.arange(n) + 0.5) / n * math.pi / 2
    return np.column_stack([np.cos(angles), np.sin(angles)])
