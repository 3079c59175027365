"""From a period doubling, pitchfork, branch or Hopf point to the branch that crosses or begins there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...local import Equilibrium, PseudoEquilibrium
from ...model import Array, ConvergenceError, DefinitionError, explain
from ...model.derivatives.variational import variational_field
from ...solvers.continuation import other_direction
from ..periodic.boundary_value_problem import BoundaryProblem, mirrored
from ..periodic.multipliers import leg_maps
from ..runs.legs import Leg
from .branch import BranchEvent
from .orbit_branches import OrbitCurve

#: Distances from the event at which the new branch is looked for, relative to the orbit.
_AWAY = (1e-3, 1e-2, 3e-2)

#: An orbit this many times as long as the small one at a Hopf point is near a homoclinic orbit.
_LONG = 10.0


def switched(event: BranchEvent, free: tuple[int, ...]) -> tuple[OrbitCurve, list[Array]]:
    """The branch that crosses at an event: its curve, and a point near the event."""
    # Where rounds double the event itself comes first: the other half of the branch has the same orbits,
    # begun a round later.
    if event.kind == "Hopf" and isinstance(event.solution, (Equilibrium, PseudoEquilibrium)):
        return _around(event, free)
    if event.kind not in ("period doubling", "pitchfork", "branch point"):
        raise DefinitionError(
            explain(
                "orbit",
                expected="a period doubling, pitchfork or branch point to switch branches at, or a "
                "Hopf point of equilibria",
                received=repr(event),
                advice="Continue event.orbit, or continue_bifurcation the event.",
            )
        )
    base: OrbitCurve = event.curve
    assert event.point is not None
    curve, u = base.freed(event.point.u, free, np.ones(1))
    assert isinstance(curve, OrbitCurve)
    if event.kind == "branch point":
        way = other_direction(event.point)
    else:
        curve, u, way = _twice(curve, u)
    for away in _AWAY:
        found = curve.correct(u + away * way * curve.scale, way)
        if found is not None and np.abs((found - u) / curve.scale).max() < 10 * away:
            return curve, [u, found] if event.kind == "period doubling" else [found]
    raise ConvergenceError(
        explain(
            event.kind,
            expected="an orbit on the branch that crosses",
            received="no convergence near it",
            advice="Perhaps the crossing branch is vertical or the event is degenerate.",
        )
    )


def _around(event: BranchEvent, free: tuple[int, ...]) -> tuple[OrbitCurve, list[Array]]:
    """The small orbits around an equilibrium at its Hopf point."""
    assert event.point is not None
    system, at, n = event.curve.system, event.solution, event.curve.n
    p, mode = event.curve.parameters_at(event.point.u), at.mode
    slope = np.asarray(variational_field(system, mode).linear.copied(at.point, p)[1], float)
    values, vectors = np.linalg.eig(slope)
    turning = np.flatnonzero(values.imag > 1e-6 * np.abs(values).max())
    if not turning.size:
        raise DefinitionError(
            f"orbit: expected a Hopf point, received {event!r}, a neutral saddle."
        )
    k = turning[np.argmin(np.abs(values[turning].real))]
    across, period = vectors[:, k].real, 2 * np.pi / float(values[k].imag)
    across = across / np.linalg.norm(across)
    phase = slope @ across
    problem = BoundaryProblem(
        system,
        (Leg(mode),),
        phase=phase / np.linalg.norm(phase),
        reference=at.point.copy(),
    )
    u = np.concatenate([at.point, [period], p[list(free)]])
    curve = OrbitCurve(problem, p, free, np.ones(1), u[: n + 1], np.inf)
    size = event.curve.scale[:n]
    curve.scale[: n + 1] = np.append(size, period)
    way = np.concatenate([across / np.linalg.norm(across), np.zeros(2)])
    for away in _AWAY:
        found = curve.correct(u + away * way * curve.scale, way)
        first = curve.correct(u + 0.01 * away * way * curve.scale, way)
        if found is None or first is None:
            continue
        if np.abs((found - u) / curve.scale).max() < 10 * away:
            curve.longest = _LONG * period
            return curve, [first, found]  # an orbit of no size has no direction
    raise ConvergenceError(
        f"Hopf: expected small orbits around {at.point.tolist()}, received no convergence. Perhaps the "
        "point is degenerate: the pair of eigenvalues does not cross the axis."
    )


def _twice(curve: OrbitCurve, u: Array) -> tuple[OrbitCurve, Array, Array]:
    """Twice the legs, and the direction in which the orbit parts from its first round."""
    problem = curve.problem
    starts, durations = problem.split(u)
    p = curve.parameters_at(u)
    changes, times = _alternating(curve, u)
    n = problem.dimension
    shift = np.zeros(n)
    if problem.forcing is not None:
        shift[-1] = problem.advance(p)[0]
    back = np.linalg.inv(problem.wrap)
    second = np.array([back @ (x + shift) for x in starts]).reshape(starts.shape)
    turned = np.array([back @ -d for d in changes]).reshape(starts.shape)
    legs = (*problem.legs, *(mirrored(problem, leg) for leg in problem.legs))
    double = replace(
        problem, legs=legs, symmetry=None, periods=2 * problem.periods, phase=None, reference=None
    )
    if problem.phase is not None:  # no event divides the rounds
        double = replace(problem, legs=problem.legs, symmetry=None, periods=2 * problem.periods)
        unknowns = double.pack(starts, 2.0 * durations)
        way = np.concatenate([changes.ravel(), [0.0], np.zeros(len(curve.free))])
        new = curve.with_problem(double, unknowns)
        way = way / new.scale
        return new, np.append(unknowns, p[list(curve.free)]), way / np.linalg.norm(way)
    unknowns = double.pack(np.concatenate([starts, second]), np.concatenate([durations] * 2))
    way = np.append(
        double.pack(np.concatenate([changes, turned]), np.concatenate([times, -times])),
        np.zeros(len(curve.free)),
    )
    new = curve.with_problem(double, unknowns)
    way = way / new.scale
    return new, np.append(unknowns, p[list(curve.free)]), way / np.linalg.norm(way)


def _alternating(curve: OrbitCurve, u: Array) -> tuple[Array, Array]:
    """Changes of starts and durations in the direction that the legs' map turns round."""
    problem, at = curve.problem, curve.evaluation(u)
    maps = leg_maps(problem, at)
    whole = np.eye(problem.dimension)
    for step in maps:
        whole = step @ whole
    values, vectors = np.linalg.eig(whole)
    d = vectors[:, int(np.argmin(np.abs(values + 1.0)))].real
    changes, times = [], []
    for step, flown, event in zip(maps, at.flown, at.events, strict=True):
        changes.append(d)
        times.append(
            -float(event.gradient @ flown.by_start @ d) / float(event.gradient @ flown.rate)
        )
        d = step @ d
    return np.array(changes), np.array(times)
