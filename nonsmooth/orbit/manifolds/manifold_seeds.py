"""Where manifolds begin that are not those of a point of one mode: periodic orbits and two-folds."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...flow.options import tolerances
from ...flow.simulate import simulate
from ...local.point.surface_point import place
from ...local.searches.find_two_fold import TwoFold
from ...model import Array, DegenerateError, NonsmoothError, Surfaces, reversed_system
from ..periodic.multipliers import leg_maps
from ..periodic.orbit import PeriodicOrbit
from ..runs.legs import fly
from .arcs import Arc, Follower, lengths
from .canards import Slider, paths_from

Seed = Callable[[float], Arc | None]

#: Orbits on a manifold of a periodic orbit start at this distance from it, relative to its size, and are
#: shown from another one on, in spacings.
_NEAR, _SHOWN = 1e-6, 0.5

#: A multiplier this close to the unit circle decides nothing.
_HYPERBOLIC = 1e-6


def orbit_seeds(orbit: PeriodicOrbit, follower: Follower, stable: bool) -> list[Seed]:
    """Arcs of the surface of orbits that come to a periodic orbit, or leave it, by sheets."""
    multiplier, x, v, period = _direction(orbit, stable)
    rounds = 1 if multiplier > 0 else 2
    factor = abs(multiplier) ** (-rounds if stable else rounds)
    size = float(np.abs(orbit.trajectory.x).max()) or 1.0
    shown = _SHOWN * follower.spacing
    count = max(0, math.ceil(math.log(shown / (_NEAR * size)) / math.log(factor)))
    system = follower.system if follower.ahead else reversed_system(follower.system)

    def sheet(sign: float) -> Seed:
        def seed(u: float) -> Arc | None:
            start = x + sign * _NEAR * size * factor**u * v
            if count:
                run = simulate(
                    system,
                    start,
                    count * rounds * period,
                    parameters=follower.parameters,
                    tol=min(follower.tol, 1e-11),
                )
                if run.t[-1] < count * rounds * period:
                    return None
                start = run.x[-1]
            return follower.arc(start)

        return seed

    return [sheet(1.0), sheet(-1.0)] if rounds == 1 else [sheet(1.0)]


def _direction(orbit: PeriodicOrbit, stable: bool) -> tuple[float, Array, Array, float]:
    """The multiplier, a point of the orbit inside a leg, the eigenvector there, and the period."""
    values = orbit.floquet.values
    outside = np.abs(values) < 1.0 - _HYPERBOLIC if stable else np.abs(values) > 1.0 + _HYPERBOLIC
    word, n = "stable" if stable else "unstable", orbit.system.dimension
    if int(outside.sum()) != 1 or n != 3 or (stable and orbit.floquet.zeros):
        raise DegenerateError(
            f"of: expected an orbit in three dimensions with one {word} multiplier other than 0, "
            f"received {n} states and the multipliers {values.round(6).tolist()}. Its {word} manifold "
            "is no surface."
        )
    problem, at = orbit.problem, orbit.evaluation
    maps = leg_maps(problem, at)
    whole = np.eye(n)
    for step in maps:
        whole = step @ whole
    found, vectors = np.linalg.eig(whole)
    wanted = orbit.floquet.of_map[outside][0]
    k = int(np.argmin(np.abs(found - wanted)))
    v = vectors[:, k].real
    free = [i for i, leg in enumerate(problem.legs) if "s" not in leg.mode] or range(len(maps))
    best = max(free, key=lambda i: float(at.durations[i]))
    for step in maps[:best]:
        v = step @ v
    p, half = orbit.parameter_vector, 0.5 * float(at.durations[best])
    flown = fly(orbit.system, problem.legs[best], at.starts[best], half, p)
    v = flown.by_start[:n] @ v
    return float(values[outside][0].real), flown.end[:n], v / np.linalg.norm(v), orbit.period


def canard_curve(fold: TwoFold, follower: Follower, stable: bool) -> Callable[[float], Array]:
    """The sliding orbit that comes to a two-fold in attracting sliding (or leaves it in
    repelling)."""
    # A function of a parameter from 0, at the two-fold, to 1.
    system = reversed_system(follower.system) if stable else follower.system
    where, s = place(system, fold.point, follower.parameters)
    surfaces = Surfaces(system)
    speed = max(float(np.linalg.norm(f)) for f in where.at(s).fields) or 1.0
    span = 20.0 * follower.length / speed
    slider = Slider(where, surfaces, span, tolerances(min(follower.tol, 1e-10)))
    try:
        paths = [path for path in paths_from(s, 0.0, slider, 16) if path.repelling]
    except NonsmoothError:
        paths = []
    if len(paths) != 1:
        many = "infinitely many" if paths else "none"
        side = "into it through attracting" if stable else "out of it through repelling"
        raise DegenerateError(
            f"of: expected a two-fold with one canard {side} sliding, received {many} at "
            f"{fold.point.tolist()} ({fold.label}). Nothing divides the orbits beside it."
        )
    run = paths[0].run
    t, along = lengths(run)
    most = min(float(along[-1]), follower.length)
    mode = [where.surface]

    def point(u: float) -> Array:
        x = run(np.interp(u * most, along, t))
        return np.asarray(surfaces.project(x, system.parameter_vector(follower.parameters), mode))

    return point
