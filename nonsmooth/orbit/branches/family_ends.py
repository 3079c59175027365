"""Points to which a family of periodic orbits shrinks: Hopf points, boundary equilibria and two-folds.

The size of the orbits is proportional to the distance of the parameter from that of a boundary equilibrium,
or to its square root at a Hopf point or a two-fold. On a surface all tests of the itinerary vanish with the
size, so none of them identifies the end. The equations of the point are regular there, and give its parameter
to rounding.

Source: Kuznetsov, Rinaldi & Gragnani 2003 (Int. J. Bifurcation Chaos 13, 2157), boundary focus and
fused focus; di Bernardo et al. 2008, ch. 5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...flow.fixed import first_terms
from ...local.point.surface_point import SIDES, Numbers, Side, surface_at
from ...local.searches.boundary_equilibria import find_boundary_equilibrium
from ...model import Array, FilippovSystem, Guard, NonsmoothError
from ...model.derivatives.variational import guarded_field, variational_field
from ...solvers.continuation import Point, Zero
from ...solvers.newton import Secant, converge
from ..periodic.boundary_value_problem import BoundaryProblem
from ..periodic.orbit import PeriodicOrbit
from ..runs.legs import integrate_leg, surface_of
from .branch import BranchEvent, FarSide
from .equilibrium_branches import EquilibriumCurve

#: Largest distance of a Hopf point from a small orbit, in scaled unknowns.
_NEAR_HOPF = 0.1


def hopf_point(
    system: FilippovSystem,
    mode: str,
    x: Array,
    p: Array,
    free: Sequence[int],
    guard: Guard | None = None,
) -> tuple[Array, Array, float] | None:
    """The Hopf point near a small orbit of one mode; with two free parameters on the surface of a guard."""
    field, n, some = variational_field(system, mode).linear, system.dimension, list(free)
    size = np.full(n, max(1.0, float(np.abs(x).max())))
    size = np.append(size, np.maximum(np.abs(p[some]), 1e-3))

    def parameters(u: Array) -> Array:
        q = p.copy()
        q[some] = u[n:]
        return q

    def height(u: Array) -> list[float]:
        if guard is None:
            return []
        guarded, q = guarded_field(system, mode), parameters(u)
        y = variational_field(system, mode).states_at(u[:n], q)
        return [float(first_terms(guarded, y, q)[1][guarded.motion.guards.index(guard), 0])]

    def pair(u: Array) -> complex:
        """The complex eigenvalue next to the imaginary axis."""
        values = np.linalg.eigvals(np.asarray(field.copied(u[:n], parameters(u))[1], float)[:n, :n])
        turning = values[values.imag > 0.0]
        return (
            complex(turning[np.argmin(np.abs(turning.real))]) if turning.size else complex(np.nan)
        )

    def equations(v: Array) -> Array:
        u = v * size
        rate = np.asarray(field.copied(u[:n], parameters(u))[0], float).ravel()[:n]
        return np.array([*rate, pair(u).real, *height(u)])

    start = np.append(x, p[some])
    try:
        root = converge(Secant(equations, 1.0), start / size)
    except (NonsmoothError, np.linalg.LinAlgError):
        return None
    if root is None or not np.abs(root - start / size).max() < _NEAR_HOPF:
        return None
    u = root * size
    return u[:n], u[n:], pair(u).imag


#: Largest distance of the point of a surface from the small orbit, relative to that orbit, and to the first
#: orbit of the family: rounding may shrink the last one to a point beside it.
_NEAR, _BESIDE = 30.0, 1e-5


def extent(problem: BoundaryProblem, u: Array, p: Array) -> float:
    """Size of an orbit: the range of its states, at the starts and in the middle of its legs."""
    starts, durations = problem.split(u)
    n, seen = problem.system.dimension, list[Array]()
    for leg, x, duration in zip(problem.legs, starts, durations, strict=True):
        seen += [x[:n], integrate_leg(problem.system, leg, x, 0.5 * float(duration), p).end[:n]]
    states = np.array(seen)
    if problem.symmetry is not None:
        states = np.vstack([states, states @ problem.symmetry.T])
    return float(np.ptp(states, axis=0).max())


def surface_end(
    orbit: PeriodicOrbit, parameter: str, size: float, first: float
) -> BranchEvent | None:
    """The point of a surface near a small orbit; None if there is none."""
    reach = max(_NEAR * size, _BESIDE * first)
    problem, system = orbit.problem, orbit.system
    x = problem.split(orbit.unknowns)[0][:, : system.dimension].mean(axis=0)
    for surface, mode in _surfaces(problem):
        for side in SIDES:
            found = _equilibrium(orbit, x, parameter, (surface, mode), side, reach)
            if found is not None:
                return found
        found = _two_fold(orbit, x, parameter, (surface, mode), reach)
        if found is not None:
            return found
    return None


def _surfaces(problem: BoundaryProblem) -> Iterator[tuple[int, str | None]]:
    """Surfaces on which legs end, with the mode of sliding on each."""
    seen = set[int]()
    for leg in problem.legs:
        surface = surface_of(problem.system, leg)
        if surface < 0 or surface in seen:
            continue
        seen.add(surface)
        one = problem.system.surface_count == 1
        yield surface, None if one else leg.mode[:surface] + "s" + leg.mode[surface + 1 :]


def _equilibrium(
    orbit: PeriodicOrbit,
    x: Array,
    parameter: str,
    at: tuple[int, str | None],
    side: Side,
    reach: float,
) -> BranchEvent | None:
    found = _boundary(orbit, x, parameter, at, side)
    if found is None or not found[0] < reach:
        return None
    _, event, k = found
    label, verdict = event.solution.label, event.far_side.verdict
    verdict = f"the orbit shrinks to a boundary equilibrium of F{k + 1} ({label}; {verdict})"
    side_of = FarSide("", verdict, event.far_side.numbers)
    return replace(event, solution=orbit, far_side=side_of, coefficients=side_of.numbers)


def _boundary(
    orbit: PeriodicOrbit, x: Array, parameter: str, at: tuple[int, str | None], side: Side
) -> tuple[float, BranchEvent, int] | None:
    """The boundary equilibrium near a state: its distance, the event, and of which field it is."""
    system, (surface, mode), given = orbit.system, at, orbit.parameters
    try:
        found = find_boundary_equilibrium(
            system, x, vary=parameter, side=side, parameters=given, surface=surface, mode=mode
        )
        values = dict(found.parameters)
        where, point = surface_at(system, found.point, values, 0.0, surface, mode)
        free, scale = (system.parameter_names.index(parameter),), np.ones(system.dimension + 1)
        curve, u = EquilibriumCurve(where, free, scale, side), np.append(point, found.value)
        zero = Zero("boundary equilibrium", Point(u, np.zeros(u.size)), 0.0)
        return found.distance, curve.boundary(zero, curve.k), curve.k
    except (NonsmoothError, np.linalg.LinAlgError):
        return None


def _two_fold(
    orbit: PeriodicOrbit, x: Array, parameter: str, at: tuple[int, str | None], reach: float
) -> BranchEvent | None:
    """The two-fold at which F1 and F2 are antiparallel, at an isolated value of the parameter."""
    system, (surface, mode) = orbit.system, at
    index = system.parameter_names.index(parameter)

    def numbers_at(u: Array) -> Numbers:
        values = {**orbit.parameters, parameter: float(u[-1])}
        return surface_at(system, x, values, 0.0, surface, mode)[0].at(u[:-2])

    def equations(u: Array) -> Array:
        numbers = numbers_at(u)
        first, second = numbers.fields
        return np.append(
            (1 - u[-2]) * first + u[-2] * second, [numbers.h, numbers.lie[0] - numbers.lie[1]]
        )

    start = np.concatenate([x, [0.5, orbit.parameter_vector[index]]])
    first, second = numbers_at(start).fields
    apart = first - second
    start[-2] = np.clip(float(first @ apart) / (float(apart @ apart) or 1.0), 0.01, 0.99)
    try:
        root = converge(Secant(equations, 1.0), start)
    except (NonsmoothError, np.linalg.LinAlgError):
        return None
    if root is None or not np.abs(root[:-2] - x).max() < reach or not 0.0 < root[-2] < 1.0:
        return None
    verdict = "the orbit shrinks to a two-fold, at which sliding changes its stability"
    kind = "two-fold" if system.dimension == 2 else "cycle from a two-fold"
    if system.dimension > 2:
        verdict = "the orbit shrinks to a two-fold, through which a pseudo-equilibrium passes"
    return BranchEvent(kind, float(root[-1]), orbit, FarSide("", verdict))


#: Speed at the slowest start of a leg, relative to the fastest, of an orbit that is close to a boundary equilibrium.
_SLOW = 1e-3

#: Distance of the parameter from that of the node, relative to the bounds.
_CLOSE = 1e-3


def node_end(orbit: PeriodicOrbit, parameter: str, width: float) -> BranchEvent | None:
    """The node on a surface beside which a long periodic orbit crosses that surface; None if there is none."""
    # The period grows with the logarithm of the distance, so that it is not long where the steps end.
    n, system = orbit.system.dimension, orbit.system
    if system.time_dependent:
        return None
    at = (
        orbit.evaluation
    )  # it leaves slowly from where a leg begins, or comes slowly to where one ends
    rates = np.vstack([at.flows.before[: len(at.durations), :n], at.flows.rate[:, :n]])
    speeds = np.linalg.norm(rates, axis=1)
    slowest = int(np.argmin(speeds))
    if not speeds[slowest] < _SLOW * speeds.max():
        return None
    x = np.vstack([at.starts[:, :n], at.flows.end[:, :n]])[slowest]
    value = orbit.parameters[parameter]
    for surface in _surfaces(orbit.problem):
        for side in SIDES:
            found = _boundary(orbit, x, parameter, surface, side)
            if found is None or not abs(found[1].parameter - value) < _CLOSE * width:
                continue
            values = found[1].solution.eigenvalues
            slow = values[np.argmin(np.abs(values.real))]  # along which it comes or leaves
            if not np.iscomplex(slow) and np.all(values.real * slow.real > 0):
                verdict = "the period diverges like the logarithm of the distance"
                kind = "infinite period at a boundary node"
                return BranchEvent(kind, found[1].parameter, orbit, FarSide("", verdict))
    return None
