"""Branches of periodic orbits from an orbit or an event: cycles from equilibria, two-folds and loops, other branches.

At an equilibrium on a surface, and beside a homoclinic orbit, cycles are found by simulation at a nearby value
of the parameter, in reversed time too. Where a pseudo-equilibrium passes an invisible two-fold, F1 + c F2 = 0,
the cycle x - r F1/2 with legs r and c r closes to third order (Cristiano et al. 2018).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from ...flow.simulate import simulate
from ...local import Equilibrium, PseudoEquilibrium
from ...local.checks import parameter_index
from ...local.point.surface_point import LocalSurface
from ...model import (
    Array,
    ConvergenceError,
    DefinitionError,
    FilippovSystem,
    NonsmoothError,
    whole,
)
from ...model.checks import positive
from ...model.definition.derived_systems import reversed_system
from ...model.derivatives.variational import variational_field
from ...solvers.continuation import Departure, Point, other_direction
from ...solvers.newton import Secant, converge
from ..homoclinic.homoclinic_orbits import Connection
from ..periodic.boundary_value_problem import BoundaryProblem
from ..periodic.find_periodic import periodic_orbit
from ..periodic.multipliers import leg_maps
from ..periodic.orbit import PeriodicOrbit, named
from ..periodic.orbit_functions import OrbitFunction, read_rows
from ..periodic.orbit_run import orbit_run
from ..periodic.symmetry import mirrored
from ..runs.itinerary import leg_between
from ..runs.legs import Leg
from .branch import Branch, BranchEvent, check_bounds, follow_branch
from .itinerary_changes import CENTRE, FORCE, SOFT
from .orbit_branches import OrbitCurve

#: Distances from the event at which the new branch is searched, relative to the orbit.
_AWAY = (1e-3, 1e-2, 3e-2)

#: Period, relative to that of the first orbit, beyond which a branch may approach a homoclinic orbit.
_LONG = 10.0

#: Largest size of a cycle beside an equilibrium, relative to the distance that the equilibrium has moved.
_WIDE = 300.0

#: Distance of a guard from a touch at which it is touched too.
_TOUCHED = 1e-9

#: Periods of a simulation beside an event.
_TURNS = 60.0

#: Rows of unknowns of which the last one is on the branch.
Begun = tuple[OrbitCurve, list[Array]]


def continue_orbit(
    orbit: PeriodicOrbit | BranchEvent,
    parameter: str,
    *,
    bounds: tuple[float, float],
    step: float = 0.05,
    max_points: int = 1000,
    through: bool = True,
    progress: bool = False,
    events: Mapping[str, OrbitFunction] = MappingProxyType({}),
    constraints: Sequence[OrbitFunction] = (),
    free: Sequence[str] = (),
    cost: OrbitFunction | None = None,
) -> Branch:
    """Follow a periodic orbit as a parameter varies.

    Pseudo-arclength continuation both ways to the bounds, with multipliers at each point. The itinerary
    is kept as long as it is admissible; the event at its end is located in the itinerary with fewer
    legs, where it is regular, and named.

    Parameters
    ----------
    orbit : PeriodicOrbit or BranchEvent
        Where to start; at a period doubling, pitchfork or branch point the other branch is followed
        (from a period doubling one way only, as the other half repeats its orbits), at a touch of a switch
        on which nothing slides the orbits beyond it, at other events of orbits the branch through them. At
        a Hopf point, a boundary equilibrium or a two-fold of equilibria, and at a homoclinic orbit, the
        cycles that are born there.
    parameter : str
        Name of the parameter that varies.
    bounds : (float, float)
        Bounds of the parameter at which the branch ends.
    step : float, optional
        Largest step where the branch bends, relative to the width of the bounds and to the size of
        the orbit.
    max_points : int, optional
        Largest number of points on each side of the start.
    through : bool, optional
        Whether to change the itinerary and continue beyond events that end it.
    progress : bool, optional
        Whether to show a bar that counts points. After Ctrl-C the points computed so far are returned.
    events : mapping of str to OrbitFunction, optional
        Functions of :func:`orbit_functions` whose zeros along the branch are events of these names.
    constraints : sequence of OrbitFunction, optional
        Functions that are zero along the branch, from an orbit as the start.
    free : sequence of str, optional
        As many further parameters that vary, so that the constraints hold.
    cost : OrbitFunction, optional
        A function whose extrema along the branch are events, ``"extremum of the cost"``.

    Returns
    -------
    Branch
        Its ``solutions`` (or ``orbits``) are PeriodicOrbits. Events: ``"fold"``, ``"period
        doubling"``, ``"Neimark-Sacker"``, ``"pitchfork"`` (of symmetric orbits), ``"branch
        point"``, ``"grazing-sliding"``, ``"crossing-sliding"``, ``"switching-sliding"``,
        ``"adding-sliding"``, ``"impact grazing"``, ``"grazing of a soft switch"``,
        ``"grazing of a jumping force"``, ``"grazing, escaping"``, ``"corner"``, ``"two-fold"``,
        ``"end of complete chatter"``, ``"plastic impact"`` where the restitution vanishes; ``"Hopf"`` where orbits without events shrink to an equilibrium, ``"boundary equilibrium"`` (with its
        class) or ``"two-fold"`` where others shrink to a point of a surface, ``"focus-centre-limit cycle"``,
        ``"homoclinic"`` and ``"infinite period at a boundary node"``.

    Raises
    ------
    ConvergenceError
        The orbit at the start does not solve its equations, or no orbit of the new branch was found.
    DefinitionError
        Neither an orbit nor an event from which orbits start; a parameter that the system does not have.
    OptionError
        Bounds in the wrong order, or without the start; ``step`` or ``max_points`` out of its range; a
        parameter that breaks the symmetry by which half of the orbit is solved for.

    Examples
    --------
    A forced relay, $x' = A cos t - sgn x$: crossing orbits begin to slide below
    $A = sqrt(1 + pi^2/4)$.

    >>> import casadi as ca, nonsmooth as ns
    >>> x, t, a = (ca.SX.sym(s) for s in ("x", "t", "a"))
    >>> relay = ns.FilippovSystem([x], surface=x, time=t, parameters={a: 2.5},
    ...                           above=[a * ca.cos(t) - 1], below=[a * ca.cos(t) + 1])
    >>> orbit = ns.periodic_orbit(relay, [0.5])
    >>> branch = ns.continue_orbit(orbit, "a", bounds=(1.5, 3.0))
    >>> [(e.kind, round(e.parameter, 12)) for e in branch.events]
    [('crossing-sliding', 1.862095889119)]
    """
    positive(step, "step")
    whole(max_points, "max_points", least=2)
    if not isinstance(orbit, (PeriodicOrbit, BranchEvent)):
        raise DefinitionError(
            f"orbit={orbit!r} is no PeriodicOrbit or event of a branch. Find one with periodic_orbit."
        )
    if isinstance(orbit, BranchEvent) and orbit.family:
        orbit = _of_family(orbit, parameter, bounds)
    system = orbit.curve.system if isinstance(orbit, BranchEvent) else orbit.system
    more = [parameter_index(system, name) for name in ([free] if isinstance(free, str) else free)]
    of_user = read_rows(system, events, constraints, cost, more)
    chosen = (*more, parameter_index(system, parameter))
    if len(set(chosen)) < len(chosen):
        raise DefinitionError(f"free={free!r} names a parameter twice, or {parameter!r} itself.")
    if isinstance(orbit, BranchEvent):
        if more:
            raise DefinitionError("constraints= need an orbit as the start. Give event.orbit.")
        low, high = check_bounds(bounds, orbit.parameter, parameter)
        curve, rows = first_orbits(orbit, chosen, high - low)
    else:
        curve, rows = curve_of(orbit, chosen)
    start, curve.rows = rows[-1], of_user
    low, high = check_bounds(bounds, float(start[-1]), parameter)
    sizes = np.maximum(np.abs(curve.p[more]), 1e-3)
    curve.widths = np.append(sizes, high - low)
    curve.scale = np.append(curve.scale[: curve.problem.size], curve.widths)
    for function in (
        *of_user.events.values(),
        *of_user.constraints,
    ):  # raises where one is not defined
        function.rule(curve.problem.whole, curve.evaluation(start), curve.p, ())
    if more:
        start = _constrained(curve, start)
    away = Departure(curve, rows, (start - rows[0]) / curve.scale) if len(rows) > 1 else None
    return follow_branch(
        curve,
        start,
        name=parameter,
        bounds=(low, high),
        step=step,
        max_points=max_points,
        through=through,
        progress=progress,
        away=away,
    )


def _of_family(event: BranchEvent, parameter: str, bounds: Sequence[float]) -> PeriodicOrbit:
    """An orbit within the bounds, away from the end of its family."""
    system = event.family[0].system
    name = system.parameter_names[parameter_index(system, parameter)]
    low, high = check_bounds(bounds, event.parameter, name)
    inside = [one for one in event.family if low <= one.parameters[name] <= high]
    found: PeriodicOrbit = inside[len(inside) // 2] if inside else event.solution
    return found


def _constrained(curve: OrbitCurve, start: Array) -> Array:
    """The orbit at the value of the parameter at which the constraints hold."""
    found = curve.unknowns_at(start, float(start[-1]))
    if found is None:
        values = [
            c.rule(curve.problem.whole, curve.evaluation(start), curve.p, ())[0]
            for c in curve.rows.constraints
        ]
        raise ConvergenceError(
            f"constraints: no orbit near the start fulfils them; they are {values} there. Start closer, or name "
            "other parameters in free=.",
            point=start,
        )
    return found


def first_orbits(event: BranchEvent, free: tuple[int, ...], width: float) -> Begun:
    """The branch that crosses or begins at an event: its curve, and points near the event."""
    # At a period doubling the event comes first, as the other half of the branch repeats the same orbits.
    kind, solution = event.kind, event.solution
    if kind in ("period doubling", "pitchfork", "branch point") and event.point is not None:
        return _switched(event, free)
    if kind in (CENTRE, SOFT, FORCE) and isinstance(event.curve, OrbitCurve):
        return _with_contact(event, free)
    if isinstance(solution, PeriodicOrbit):
        return curve_of(solution, free)
    if kind == "Hopf" and isinstance(solution, (Equilibrium, PseudoEquilibrium)):
        return _around(event, free)
    if kind == "two-fold" and event.curve is not None:
        return _from_two_fold(event, free)
    if kind == "boundary equilibrium" and event.point is not None:
        planar = _planar_cycle(event, free, width)
        curve, rows = planar or curve_of(_beside_equilibrium(event, free, width), free)
        count, n = len(curve.problem.legs), curve.problem.dimension
        moved = abs(float(rows[-1][-1]) - event.parameter)
        curve.scale[: count * n] *= width / moved  # the cycle grows with the parameter
        return curve, rows
    if isinstance(solution, Connection):
        curve, rows = curve_of(_beside_loop(solution, free, width), free)
        curve.longest /= _LONG  # it is long already
        return curve, rows
    raise DefinitionError(
        f"orbit={event!r} is no event from which periodic orbits start: one of orbits, a Hopf point, a boundary "
        "equilibrium or a two-fold of equilibria, or a homoclinic orbit. continue_bifurcation follows it."
    )


def curve_of(orbit: PeriodicOrbit, free: tuple[int, ...]) -> Begun:
    """An orbit as a point of its branch."""
    p, u = orbit.parameter_vector, orbit.unknowns
    longest = _LONG * float(orbit.evaluation.durations.sum())
    return OrbitCurve(orbit.problem, p, free, np.ones(len(free)), u, longest), [
        np.append(u, p[list(free)])
    ]


def _switched(event: BranchEvent, free: tuple[int, ...]) -> Begun:
    assert event.point is not None
    curve, u = event.curve.freed(event.point.u, free, np.ones(1))
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
        f"orbit: no orbit of the other branch was found near the {event.kind}. That branch may be vertical, "
        "or the event degenerate: give an orbit of it."
    )


def _with_contact(event: BranchEvent, free: tuple[int, ...]) -> Begun:
    """The orbits that visit the other side of a surface that is touched."""
    assert event.point is not None
    curve, u = event.curve.freed(event.point.u, free, np.ones(1))
    assert isinstance(curve, OrbitCurve)
    tests = curve.tests(Point(u, np.zeros(u.size)))  # both walls of a gap may be touched
    touched = [
        c for k, c in curve.known.items() if c.what == "interior" and abs(tests[k]) < _TOUCHED
    ]
    own = curve.known[event.test]
    begun = curve.beyond(event.kind, [own, *(c for c in touched if c is not own)], u)
    if begun is None or not isinstance(begun.curve, OrbitCurve):
        raise ConvergenceError(
            f"orbit: no orbit beyond the {event.kind} was found. Simulate there and give an orbit."
        )
    begun.curve.longest = _LONG * float(event.solution.evaluation.durations.sum())
    return begun.curve, begun.rows


def _around(event: BranchEvent, free: tuple[int, ...]) -> Begun:
    """The small orbits around an equilibrium at its Hopf point."""
    assert event.point is not None
    system, at, n = event.curve.system, event.solution, event.curve.n
    p, mode = event.curve.parameters_at(event.point.u), at.mode
    slope = np.asarray(variational_field(system, mode).linear.copied(at.point, p)[1], float)
    values, vectors = np.linalg.eig(slope)
    turning = np.flatnonzero(values.imag > 1e-6 * np.abs(values).max())
    if not turning.size:
        raise DefinitionError(
            f"orbit={event!r} is a neutral saddle, from which no orbits start. Give a Hopf point."
        )
    k = turning[np.argmin(np.abs(values[turning].real))]
    across, period = vectors[:, k].real, 2 * np.pi / float(values[k].imag)
    across = across / np.linalg.norm(across)
    phase = slope @ across
    problem = BoundaryProblem(
        system, (Leg(mode),), phase=phase / np.linalg.norm(phase), reference=at.point.copy()
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
            return curve, [first, found]  # the tangent at the Hopf point itself is not defined
    raise ConvergenceError(
        f"orbit: no small orbit was found around the Hopf point {at.point.tolist()}. It may be degenerate, "
        "with a pair of eigenvalues that does not cross the axis: give an orbit."
    )


def _from_two_fold(event: BranchEvent, free: tuple[int, ...]) -> Begun:
    """The small crossing orbits at an invisible two-fold where F1 and F2 are antiparallel."""
    at, u, n = event.curve, event.point.u, event.curve.n  # type: ignore[union-attr]
    here, x, p = at.local_surface(u), u[:n], at.parameters_at(u)
    first, ratio = here.at(x).fields[0], float(u[n] / (1.0 - u[n]))
    modes = [at.where.side("+"), at.where.side("-")]
    legs = tuple(leg_between(at.system, a, b) for a, b in (modes, modes[::-1]))
    problem = BoundaryProblem(at.system, legs)
    slopes = max(float(np.linalg.norm(slope)) for slope in here.jacobians(x))
    for size in _AWAY[::-1]:
        rows = list[Array]()
        for r in (0.1 * size / slopes, size / slopes):
            starts = np.array([x - 0.5 * r * first, x + 0.5 * r * first])
            guess = np.append(problem.pack(starts, np.array([r, ratio * r])), p[list(free)])
            curve = OrbitCurve(problem, p, free, np.ones(1), guess, np.inf)
            curve.scale[:-1] = np.append(np.tile(at.scale[:n], 2), [1.0 / slopes] * 2)
            axis = np.zeros(guess.size)
            axis[problem.size - 2] = 1.0
            found = curve.correct(guess, axis)
            if (
                found is not None
                and np.abs((found - guess)[: 2 * n]).max() < r * np.abs(first).max()
            ):
                rows.append(found)
        if len(rows) == 2 and not curve.faults(rows[-1]):
            return curve, rows
    raise ConvergenceError(
        f"orbit: no small orbit was found around the two-fold {x.tolist()}. Cycles start from an invisible "
        "one through which a pseudo-equilibrium passes."
    )


def _planar_cycle(event: BranchEvent, free: tuple[int, ...], width: float) -> Begun | None:
    """The cycle of the two linear parts of a planar continuous system, at a nearby value of the parameter."""
    cycle, at, u = getattr(event.solution, "cycle", None), event.curve, event.point.u  # type: ignore[union-attr]
    if cycle is None:
        return None
    own, modes = "+-".index(cycle.side), [at.where.side(side) for side in "+-"]
    legs = tuple(leg_between(at.system, modes[k], modes[1 - k]) for k in (own, 1 - own))
    problem = BoundaryProblem(at.system, legs)
    for away in (s * part * width for part in _AWAY for s in (1.0, -1.0)):
        v = np.append(u[:2], u[-1] + away)
        here, p = at.local_surface(v), at.parameters_at(v)
        rest = np.linalg.solve(here.jacobians(u[:2])[own], here.at(u[:2]).fields[own])
        height = float(here.at(u[:2] - rest).h)
        if (height > 0.0) != (cycle.side == "+"):
            continue
        rates = [
            (1 - 2 * k) * speed * abs(height)
            for speed, k in zip(cycle.speeds, (own, 1 - own), strict=True)
        ]
        starts = [
            _entered(here, k, rate, u[:2]) for rate, k in zip(rates, (own, 1 - own), strict=True)
        ]
        guess = np.append(problem.pack(np.array(starts), np.array(cycle.durations)), p[list(free)])
        curve = OrbitCurve(problem, p, free, np.ones(1), guess, np.inf)
        row = curve.unknowns_at(guess, float(v[-1]))
        if row is not None and not curve.faults(row):
            curve.longest = _LONG * cycle.period
            return curve, [row]
    return None


def _entered(here: LocalSurface, k: int, rate: float, near: Array) -> Array:
    """The point (2,) of a surface where the field of a side leaves it at a rate."""

    def equations(x: Array) -> Array:
        numbers = here.at(x)
        return np.array([numbers.h, numbers.lie[k] - rate])

    found = converge(Secant(equations, 1.0), near)
    return near if found is None else found


def _beside_equilibrium(event: BranchEvent, free: tuple[int, ...], width: float) -> PeriodicOrbit:
    """A small cycle beside a boundary equilibrium."""
    at, u, n = event.curve, event.point.u, event.curve.n  # type: ignore[union-attr]
    x, p = u[:n], at.parameters_at(u)
    moved = np.linalg.svd(at.equations(u)[1])[2][-1]
    speed = float(np.linalg.norm(moved[:n])) / max(abs(float(moved[-1])), 1e-300)
    rate = float(np.abs(event.solution.eigenvalues).max())
    for away in _AWAY:
        size = away * width * speed
        starts = [x + k * size * np.cos(k + np.arange(n)) for k in (1.0, 5.0, 30.0)]
        t_end = _TURNS * 2.0 * np.pi / rate
        for orbit in _simulated(at.system, starts, p, free[0], away * width, t_end):
            if float(np.abs(orbit.start - x).max()) < _WIDE * size:
                return orbit
    raise ConvergenceError(
        f"orbit: no cycle was found beside the boundary equilibrium {x.tolist()}. There may be none: "
        "simulate from near it at other values of the parameter."
    )


def _beside_loop(loop: Connection, free: tuple[int, ...], width: float) -> PeriodicOrbit:
    """A cycle that follows a homoclinic orbit."""
    p = np.array([loop.parameters[name] for name in loop.system.parameter_names])
    run = orbit_run(loop.system, loop.parameters, loop.legs)
    passed = float(run.t[-1] - run.t[0])
    starts = [np.asarray(run(run.t[0] + part * passed)) for part in (0.5, 0.3, 0.7)]
    size = float(np.ptp(run.x, axis=0).max())
    for away in _AWAY:
        for orbit in _simulated(loop.system, starts, p, free[0], away * width, _TURNS * passed):
            apart = min(float(np.abs(leg.start - x).max()) for leg in orbit.legs for x in starts)
            if 0.2 * passed < orbit.period < 5.0 * passed and apart < 0.3 * size:
                return orbit
    raise ConvergenceError(
        "orbit: no cycle was found beside the homoclinic orbit. It may have none on either side: simulate from "
        "near it at other values of the parameter."
    )


def _simulated(
    system: FilippovSystem, starts: list[Array], p: Array, index: int, away: float, t_end: float
) -> Iterator[PeriodicOrbit]:
    """Orbits to which motions from some starts tend at parameters beside p, forward or back in time."""
    for sign in (1.0, -1.0):
        q = p.copy()
        q[index] += sign * away
        for ahead in (True, False):
            for x in starts:
                try:
                    yield _limit(system, x, named(system, q), t_end, ahead)
                except NonsmoothError:
                    continue


def _limit(
    system: FilippovSystem, x: Array, parameters: dict[str, float], t_end: float, ahead: bool
) -> PeriodicOrbit:
    own = system if ahead else reversed_system(system)
    orbit = periodic_orbit(own, simulate(own, x, t_end, parameters=parameters))
    if ahead:
        return orbit
    modes = [leg.mode for leg in orbit.legs]
    itinerary = [modes[0], *modes[:0:-1]]  # from where the first leg ends, back
    begins = orbit.legs[1 % len(modes)].start
    return periodic_orbit(system, begins, itinerary=itinerary, parameters=parameters)


def _twice(curve: OrbitCurve, u: Array) -> tuple[OrbitCurve, Array, Array]:
    """Twice the legs, and the direction in which the doubled orbit leaves the single one."""
    problem = curve.problem
    starts, durations = problem.split(u)
    p = curve.parameters_at(u)
    changes, times = _alternating(curve, u)
    if problem.phase is not None:  # no event ends the first turn
        double = replace(problem, symmetry=None, periods=2 * problem.periods)
        unknowns, way = double.pack(starts, 2.0 * durations), np.append(changes.ravel(), 0.0)
    else:
        shift = np.zeros(problem.dimension)
        if problem.forcing is not None:
            shift[-1] = problem.advance(p)[0]
        back = np.linalg.inv(problem.wrap)
        second = np.array([back @ (x + shift) for x in starts]).reshape(starts.shape)
        turned = np.array([back @ -d for d in changes]).reshape(starts.shape)
        legs = (*problem.legs, *(mirrored(problem, leg) for leg in problem.legs))
        double = replace(problem, legs=legs, symmetry=None, periods=2 * problem.periods)
        unknowns = double.pack(np.concatenate([starts, second]), np.concatenate([durations] * 2))
        way = double.pack(np.concatenate([changes, turned]), np.concatenate([times, -times]))
    new = curve.with_problem(double, unknowns, p)
    way = np.append(way, np.zeros(len(curve.free))) / new.scale
    return new, np.append(unknowns, p[list(curve.free)]), way / np.linalg.norm(way)


def _alternating(curve: OrbitCurve, u: Array) -> tuple[Array, Array]:
    """Changes of starts and durations along the eigenvector of the multiplier -1."""
    problem, at = curve.problem, curve.evaluation(u)
    maps = leg_maps(problem, at)
    whole = np.eye(problem.dimension)
    for step in maps:
        whole = step @ whole
    values, vectors = np.linalg.eig(whole)
    d = vectors[:, int(np.argmin(np.abs(values + 1.0)))].real
    changes, times = [], []
    for step, flow, event in zip(maps, at.by_leg, at.events, strict=True):
        changes.append(d)
        times.append(-float(event.gradient @ flow.by_start @ d) / float(event.gradient @ flow.rate))
        d = step @ d
    return np.array(changes), np.array(times)
