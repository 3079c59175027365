"""Points of codimension two on curves of bifurcations, and the curves that leave them.

Two events at one time: each is followed in the itinerary with and without the legs that the other adds. Landing
or exit at a degenerate tangency (L1 = L11 = 0): three sliding bifurcations meet, or two. At a fold, a doubling or
a Hopf point on the curve of another event its own curve leaves; with contact it is that of the orbit with one more
leg. Where an orbit becomes homoclinic to a saddle at which it touches a surface, the curves of the boundary
equilibrium and of the homoclinic orbit leave.

Source: Kowalczyk & di Bernardo 2005 (Physica D 204, 204); Kuznetsov 2004, ch. 8 and 9.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...flow.fixed import first_terms
from ...local.point.surface_point import SIDES, surface_at
from ...model import Array, DegenerateError, Guard, NonsmoothError
from ...model.derivatives.variational import guarded_field, states_at
from ...solvers.continuation import Departure, Point, Zero, directions
from ...solvers.newton import Equations, Secant, converge
from ..homoclinic.homoclinic_orbits import Connection
from ..homoclinic.loops import SaddleLoop
from ..periodic.orbit import named
from ..runs.legs import integrate_leg, surface_of
from .branch import BranchCurve
from .conditions import Condition, condition_row, is_smooth, minima
from .equilibrium_branches import EquilibriumCurve
from .event_curves import AT_END, AT_START, CUSP, HIGHER, SECOND, TWO_FOLD, EventCurve
from .homoclinic_curves import ConnectionCurve, boundary_homoclinic
from .itinerary_changes import (
    SOFT,
    ChangedItinerary,
    changed_itinerary,
    departures,
    kind_of,
    rotated,
)
from .orbit_branches import OrbitCurve

_NAMES = {
    frozenset({"fold", "period doubling"}): "fold-flip",
    frozenset({"fold", "Neimark-Sacker"}): "fold-Neimark-Sacker",
    frozenset({"period doubling", "Neimark-Sacker"}): "flip-Neimark-Sacker",
    frozenset({"fold", "Hopf"}): "fold-Hopf",
    frozenset({"boundary equilibrium", "fold"}): "boundary saddle-node",
    frozenset({"boundary equilibrium", "Hopf"}): "boundary Hopf",
}

#: Of a test that is no event of its own: the kind of a point is named by both.
_BESIDE = (TWO_FOLD, SECOND, HIGHER, CUSP, AT_START, AT_END)
_CONTACT = " with contact"

#: Events at which multipliers are continuous.
_CONTINUOUS = ("crossing-sliding", "switching-sliding", "adding-sliding", SOFT)

#: Where the touch of an orbit comes to a saddle.
AT_SADDLE = "boundary equilibrium"

#: Duration of a leg that vanishes where others are tangent, relative to the orbit: a cube root of rounding.
_VANISHES = 1e-4

#: Distance of a point from its guess, and of the states of one event in two itineraries, in scaled unknowns.
_NEAR, _SAME = 0.05, 1e-4

#: Relative durations of legs that grow from a degenerate tangency.
_SIZES = (1e-2, 3e-3, 3e-2)


@dataclass(frozen=True)
class Degenerate:
    """A landing (order 0) or exit (order 2) at a degenerate tangency, at the start of a leg."""

    leg: int
    guard: Guard
    order: int

    def names(self, incoming: str) -> str:
        own = incoming == ("+" if self.guard.side > 0 else "-")
        if self.order:
            return "exit at a degenerate tangency"
        return f"landing at a degenerate tangency of {'its own' if own else 'the other'} field"


@dataclass(frozen=True, eq=False)
class Meeting:
    """The functions that vanish at a point of codimension two, and its regular equations."""

    base: BranchCurve
    u: Array
    came: EventCurve
    other: str
    touch: float | None = None
    at: Degenerate | tuple[Condition, Condition] | None = None
    loop: Connection | None = None  # a homoclinic orbit whose saddle is on a surface


@dataclass(frozen=True, eq=False)
class CodimensionTwo:
    """A point of codimension two on a curve of bifurcations.

    Attributes
    ----------
    kind : str
        Its name, such as ``"cusp"``, or the names of both events.
    values : ndarray (2,)
        Values of the two parameters.
    solution
        The equilibrium or orbit there.
    meeting
        The equations there, from which ``continue_bifurcation`` follows the curves that leave it.
    """

    kind: str
    values: Array
    solution: Any
    meeting: Meeting | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{self.kind} at ({self.values[0]:.10g}, {self.values[1]:.10g})"


def special_point(
    curve: EventCurve | ConnectionCurve, zero: Zero, event: str
) -> CodimensionTwo | None:
    """The point at a located zero of a test; None where there is none at a limit of a touch."""
    if zero.name == AT_SADDLE and isinstance(curve, EventCurve) and curve.touches:
        return _at_saddle(curve, zero.point.u, event)
    base: BranchCurve = curve.base
    u, meeting = zero.point.u, None
    if isinstance(curve, EventCurve):
        meeting = _meeting(curve, zero)
        u, base = meeting.u, meeting.base
    kind = _kind(curve, zero, event)
    if meeting is not None and isinstance(meeting.at, Degenerate):
        assert isinstance(base, OrbitCurve)
        at = meeting.at
        kind = at.names(base.problem.legs[at.leg - 1].mode[at.guard.element])
    try:
        solution = base.describe(u)
    except (ArithmeticError, ValueError):
        solution = None
    values, touched = u[-2:], getattr(curve, "condition", None)
    if zero.name == "Hopf" and isinstance(base, OrbitCurve) and touched is not None:
        shrunk = base.hopf(u, touched.guard)  # the equilibrium on the surface
        if shrunk is not None and meeting is not None:
            values, meeting = (
                shrunk[1],
                _at_equilibrium(meeting, touched.guard.element, *shrunk[:2]),
            )
    return CodimensionTwo(kind, values, solution, meeting)


def _at_equilibrium(at: Meeting, surface: int, x: Array, values: Array) -> Meeting:
    """The same point as one of the curves of the equilibrium to which the orbit has shrunk."""
    base = at.base
    assert isinstance(base, OrbitCurve)
    assert at.came.condition is not None
    mode, p = base.problem.legs[at.came.condition.leg].mode, base.p.copy()
    p[list(base.free)] = values
    sliding = None if base.system.surface_count == 1 else mode[:surface] + "s" + mode[surface + 1 :]
    where, _ = surface_at(base.system, x, named(base.system, p), 0.0, surface, sliding)
    scale, side = np.append(base.scale[: x.size], base.widths), SIDES["+-".index(mode[surface])]
    curve = EquilibriumCurve(where, base.free, scale, side)
    return Meeting(curve, np.append(x, values), at.came, "Hopf")


def _at_saddle(curve: EventCurve, u: Array, event: str) -> CodimensionTwo | None:
    """Where an orbit becomes homoclinic to a saddle at which it touches a surface."""
    base, at = curve.base, curve.condition
    assert isinstance(base, OrbitCurve) and at is not None and at.guard is not None
    inner, touch, surface = curve.without(u), float(u[curve.columns]), at.guard.element
    if at.guard.kind != "surface" or base.problem.symmetry is not None:
        return None
    k, p = base.problem.size, base.parameters_at(inner)
    loop = boundary_homoclinic(base.problem, inner[:k], p, base.free, at.leg, touch, surface)
    values = u[-2:] if loop is None else loop.unknowns[-2:]
    if loop is None or np.abs((values - u[-2:]) / curve.scale[-2:]).max() > _NEAR:
        return None
    plain = Meeting(base, inner, curve, AT_SADDLE)
    meeting = _at_equilibrium(plain, surface, loop.saddle.point, values)
    meeting = replace(meeting, other=AT_SADDLE, loop=loop)
    return CodimensionTwo(f"{event} with {AT_SADDLE}", values, loop, meeting)


def _kind(curve: EventCurve | ConnectionCurve, zero: Zero, event: str) -> str:
    u = zero.point.u if isinstance(curve, ConnectionCurve) else curve.without(zero.point.u)
    own, other = (curve.base.named(name, u) for name in (curve.name, _cause(curve, zero)))
    kind = _NAMES.get(frozenset({own, other}), other)
    if zero.name in _BESIDE or zero.name.endswith(_CONTACT):
        kind = f"{event} with {other}"
    elif kind == other and zero.name in {"fold", *curve.base.tests(Point(u, zero.point.tangent))}:
        kind = f"{own} with {other}"
    double = kind == "fold-Hopf" and curve.base.double_zero(u)
    return "Bogdanov-Takens" if double else kind


# What meets ---------------------------------------------------------------------------------------


def _cause(curve: EventCurve | ConnectionCurve, zero: Zero) -> str:
    """The test that names a zero: beside a leg that vanishes the others end tangentially too."""
    at = getattr(curve.base, "known", {}).get(zero.name)
    if at is None or at.what != "transversality" or not isinstance(curve, EventCurve):
        return zero.name
    durations = curve.problem.split(curve.without(zero.point.u)[: curve.problem.size])[1]
    beside = [(at.leg + k) % len(durations) for k in (1, -1)]
    shortest = min(beside, key=lambda k: float(durations[k]))
    vanishes = durations[shortest] < _VANISHES * durations.sum()
    return Condition("duration", shortest).name if vanishes else zero.name


def _meeting(curve: EventCurve, zero: Zero) -> Meeting:
    u, base = curve.without(zero.point.u), curve.base
    touch = float(zero.point.u[curve.columns]) if curve.touches else None
    plain = Meeting(base, u, curve, _cause(curve, zero), touch)
    if isinstance(base, OrbitCurve) and curve.condition is None and plain.other in base.known:
        return _on_other_curve(plain)
    if isinstance(base, OrbitCurve) and curve.condition is not None:
        found = _degenerate(curve, base, u, {zero.name, *zero.together})
        if found is not None:
            return found
        if plain.other in base.known:
            return _with_fewer_legs(plain)
        if zero.name == SECOND:
            first = replace(curve.condition, t=touch)
            return replace(plain, at=(first, _other_touch(base, first, u)))
    return plain


def _other_touch(base: OrbitCurve, first: Condition, u: Array) -> Condition:
    """The second touch of the same guard inside a leg."""
    starts, durations = base.problem.split(u[: base.problem.size])
    x, duration = starts[first.leg], float(durations[first.leg])
    t = first.t
    assert first.guard is not None and t is not None
    leg, p = base.problem.legs[first.leg], base.parameters_at(u)
    near = minima(base.system, leg, first.guard, x, duration, p)
    apart = max(near[:2], key=lambda pair: abs(pair[0] - t))
    return replace(first, t=apart[0])


def _with_fewer_legs(at: Meeting) -> Meeting:
    """The same point where both of two events are regular: without the legs that the second one adds."""
    base, u, curve = at.base, at.u, at.came
    assert isinstance(base, OrbitCurve) and curve.condition is not None
    first, other = curve.condition, base.known[at.other]
    found = _changed(base, other, u)
    if found is None or not found.test:
        return at
    shorter, start = _with(base, u, found)
    if not _known(shorter, start, found.test):
        return at
    own = _same(base, u, replace(first, t=at.touch), shorter, start)
    second = _same(base, u, other, shorter, start, shorter.known[found.test])
    if own is None or second is None:
        return at
    regular = EventCurve(shorter, own.name, start, own.t, whole=False)

    def equations(v: Array) -> tuple[Array, Array]:
        (values, jacobian), u = regular.scaled(v), regular.without(v * regular.scale)
        p, k = shorter.parameters_at(u), shorter.problem.size
        row = condition_row(shorter.problem, u[:k], p, shorter.free, second)
        if row is None:
            raise DegenerateError("the second event has no regular test")
        slope = np.insert(row[1], regular.columns, 0.0) if regular.touches else row[1]
        return np.append(values, row[0]), np.vstack([jacobian, slope * regular.scale])

    located = _solved(equations, regular.start / regular.scale)
    if located is None:
        return at
    v = located * regular.scale
    return replace(at, base=shorter, u=regular.without(v), at=(own, second))


def _on_other_curve(at: Meeting) -> Meeting:
    """The same point where an orbit that bifurcates smoothly loses legs: on the curve of orbits without them."""
    base, came = at.base, at.came
    assert isinstance(base, OrbitCurve)
    found = _changed(base, base.known[at.other], at.u)
    if found is None or not found.test:
        return at
    shorter, start = _with(base, at.u, found)
    if not _known(shorter, start, found.test):
        return at
    regular = EventCurve(shorter, found.test, start, whole=False)
    jumps = (
        shorter.named(found.test, start) not in _CONTINUOUS
    )  # the multipliers, as a leg is added

    def test(v: Array) -> Array:
        tests = regular.tests(Point(v * regular.scale, np.zeros(v.size)))
        return np.array([tests.get(came.name + _CONTACT * jumps, np.nan)])

    more = Secant(test, 1.0)

    def equations(v: Array) -> tuple[Array, Array]:
        (values, jacobian), (end, row) = regular.scaled(v), more(v)
        return np.append(values, end), np.vstack([jacobian, row])

    located = _solved(equations, regular.start / regular.scale)
    if located is None:
        return at
    u = regular.without(located * regular.scale)
    return replace(at, base=shorter, u=u, other=found.test)


def _solved(equations: Equations, guess: Array) -> Array | None:
    """The zero near a guess, in scaled unknowns; None if there is none."""
    try:
        root = converge(equations, guess, tol=1e-14, max_iterations=30, noise=1e-10)
    except (NonsmoothError, np.linalg.LinAlgError):
        return None
    near = root is not None and np.abs(root - guess).max() <= _NEAR
    return root if near else None


def _degenerate(curve: EventCurve, base: OrbitCurve, u: Array, names: set[str]) -> Meeting | None:
    """The landing or exit at a degenerate tangency near a point, located in the itinerary with fewest legs."""
    at = curve.condition
    if at is None or at.guard is None:
        return None
    found = _after_tangency(base, u, at, names)
    count = 0 if found is None else len(found[0].problem.legs)
    if found is None or count < 2:
        return None
    before, start, order = found
    if start == 0:
        before, start = rotated(before, count - 1, base.parameters_at(u)), 1
    own = _own_guard(before, start, at.guard.element, order, at.guard)
    if own is None:
        return None
    point = Degenerate(start, own, order)
    regular, guess = _with(base, u, before)
    located = _located(regular, guess, point)
    return None if located is None else Meeting(regular, located, curve, "", at=point)


def _after_tangency(
    base: OrbitCurve, u: Array, at: Condition, names: set[str]
) -> tuple[ChangedItinerary, int, int] | None:
    """The itinerary with fewest legs beside a degenerate tangency, the leg that begins there, and its order."""
    legs, i, guard, system = base.problem.legs, at.leg, at.guard, base.system
    assert guard is not None
    same = ChangedItinerary(base.problem, u[: base.problem.size], tuple(range(len(legs))))
    if at.what == "start" and legs[i - 1].kind == "crossing":
        found = _changed(base, Condition("duration", i), u)
        if not names & {CUSP, f"duration {i}"} or found is None or not found.test:
            return None
        return found, int(found.test.split()[1]), 0
    if at.what == "start":
        return (same, i, 0) if CUSP in names else None
    ends = {"exit": ("entry", "exit", 0), "surface": ("exit", "entry", 2)}.get(guard.kind)
    if ends is None or not names & {HIGHER, AT_START, AT_END}:
        return None
    begins_by, ends_by, order = ends
    if legs[i - 1].kind == begins_by and surface_of(system, legs[i - 1]) == guard.element:
        if AT_START in names:
            return same, i, order
    if legs[i].kind == ends_by and surface_of(system, legs[i]) == guard.element:
        return same, (i + 1) % len(legs), 2 - order
    return None


def _own_guard(
    at: ChangedItinerary, start: int, surface: int, order: int, guard: Guard
) -> Guard | None:
    """The guard of a leg whose coefficients vanish at its start."""
    leg = at.problem.legs[start]
    kind = "surface" if order else "exit"
    side = guard.side if guard.kind == "exit" else (1 if guard.side > 0 else -1)
    for own in guarded_field(at.problem.system, leg.mode).motion.guards:
        if own.kind == kind and own.element == surface and (order or own.side == side):
            return own
    return None


def _located(base: OrbitCurve, guess: Array, point: Degenerate) -> Array | None:
    """The orbit at which two coefficients of a guard vanish at the start of a leg."""
    problem = base.problem
    mode = problem.legs[point.leg].mode
    guards = guarded_field(base.system, mode)
    row = guards.motion.guards.index(point.guard)

    def terms(v: Array) -> Array:
        u = v * base.scale
        p, x = base.parameters_at(u), problem.split(u[: problem.size])[0][point.leg]
        y = states_at(base.system, mode, x, p)
        return np.asarray(first_terms(guards, y, p)[1][row, point.order : point.order + 2])

    more = Secant(terms, 1.0)

    def equations(v: Array) -> tuple[Array, Array]:
        (values, jacobian), (ends, rows) = base.scaled(v), more(v)
        return np.append(values, ends), np.vstack([jacobian, rows])

    root = _solved(equations, guess / base.scale)
    return None if root is None else root * base.scale


def _changed(base: OrbitCurve, at: Condition, u: Array, kind: str = "") -> ChangedItinerary | None:
    """The itinerary beyond an event; None where nothing continues it."""
    p = base.parameters_at(u)
    try:
        kind = kind or kind_of(base.problem, at, base.evaluation(u), p)
        return changed_itinerary(base.problem, kind, [at], u[: base.problem.size], p)
    except NonsmoothError:
        return None


def _with(base: OrbitCurve, u: Array, at: ChangedItinerary) -> tuple[OrbitCurve, Array]:
    """The equations with another itinerary, and the unknowns there."""
    curve = base.with_problem(at.problem, at.u, base.parameters_at(u))
    return curve, np.append(at.u, u[base.problem.size :])


# Curves that leave --------------------------------------------------------------------------------

#: A curve that may leave: its equations, and ways to start.
Candidate = tuple[EventCurve, list[Departure]]


def leaving(
    meeting: Meeting, free: tuple[int, ...], widths: Array
) -> Iterator[tuple[str, EventCurve | ConnectionCurve, Departure]]:
    """Kinds, equations and starts of the real curves that leave a point of codimension two."""
    base, u = meeting.base.freed(meeting.u, free, widths)
    for curve, ways in _candidates(meeting, base, u):
        if _is_known(meeting, curve):
            continue
        for way in ways:
            inner = curve.without(way.rows[-1])
            if not curve.base.occurs(curve.name, inner):  # a neutral saddle
                continue
            kind = curve.base.named(curve.name, inner)
            curve.settle(way.rows[-1])
            yield kind, curve, way
    if meeting.loop is not None:
        yield from _homoclinic(meeting.loop, free, widths)


def _homoclinic(
    at: Connection, free: tuple[int, ...], widths: Array
) -> Iterator[tuple[str, ConnectionCurve, Departure]]:
    """The curve of a homoclinic orbit from where its saddle is on a surface to where it is real."""
    loop = copy(at.loop)
    assert isinstance(loop, SaddleLoop)
    loop.surface = None
    curve, u = ConnectionCurve(loop, at.unknowns).freed(at.unknowns, free, widths)
    assert isinstance(curve, ConnectionCurve)
    for way in directions(curve, u):
        found = curve.correct(u + _SIZES[0] * way * curve.scale, way)
        if found is not None and not curve.describe(found).faults:
            yield curve.name, curve, Departure(curve, [u, found], way)


def _is_known(meeting: Meeting, curve: EventCurve) -> bool:
    """Whether a curve is the one on which the point was found."""
    came = meeting.came
    one, other = came.condition, curve.condition
    if one is None or other is None:
        return came.name == curve.name and type(came.base) is type(curve.base)
    legs, own, shift = came.problem.legs, curve.problem.legs, other.leg - one.leg
    if (one.what, one.guard, len(legs)) != (other.what, other.guard, len(own)):
        return False
    if meeting.touch is not None and not isinstance(meeting.at, Degenerate):
        if abs(meeting.touch - curve.start[curve.columns]) > _SAME * curve.scale[curve.columns]:
            return False  # another touch of the same leg
    return all(leg == own[(k + shift) % len(own)] for k, leg in enumerate(legs))


def _candidates(meeting: Meeting, base: BranchCurve, u: Array) -> Iterator[Candidate]:
    if isinstance(base, OrbitCurve) and isinstance(meeting.at, Degenerate):
        yield from _at_tangency(base, u, meeting.at)
        return
    other, came = meeting.other, meeting.came
    if other.endswith(_CONTACT) and isinstance(base, OrbitCurve):
        assert came.condition is not None
        yield from _with_legs(base, u, came.condition, other.removesuffix(_CONTACT))
    elif not isinstance(base, OrbitCurve) or is_smooth(other):
        of_orbits = isinstance(came.base, OrbitCurve) and not isinstance(base, OrbitCurve)
        for name in dict.fromkeys((other, AT_SADDLE) if of_orbits else (other,)):
            if name == "fold" or name in base.tests(Point(u, np.zeros(u.size))):
                yield _from(base, name, u)
    elif isinstance(meeting.at, tuple):
        yield from _two_events(base, u, *meeting.at)
    elif other == CUSP and came.condition is not None:
        yield from _beyond_cusp(base, u, came.condition)
    elif _known(base, u, other):
        if came.condition is None:  # a smooth bifurcation
            yield _from(base, base.known[other], u)
        else:
            first = replace(came.condition, t=meeting.touch)
            yield from _two_events(base, u, first, base.known[other])


def _known(base: OrbitCurve, u: Array, name: str) -> bool:
    """Whether an itinerary has a condition."""
    base.tests(Point(u, np.zeros(u.size)))
    return name in base.known


def _with_legs(base: OrbitCurve, u: Array, at: Condition, name: str) -> Iterator[Candidate]:
    """The curve of a smooth bifurcation of the orbit beyond an event, whose legs grow from zero."""
    beyond = _changed(base, at, u)
    if beyond is not None and beyond.fresh:
        longer, start = _with(base, u, beyond)
        yield _from(longer, name, start, beyond.fresh)


def _beyond_cusp(base: OrbitCurve, u: Array, at: Condition) -> Iterator[Candidate]:
    """Crossing-sliding turns into switching-sliding where the tangency at which a long leg begins is degenerate."""
    beyond = _changed(base, at, u, "crossing-sliding")
    if beyond is None or not beyond.fresh:
        return
    (longer, start), k = _with(base, u, beyond), beyond.fresh[0]
    slide = longer.problem.legs[k]
    for guard in guarded_field(longer.system, slide.mode).motion.guards:
        if guard.ends("exit", slide.element, slide.side):
            yield _from(longer, Condition("start", k, guard), start, beyond.fresh)


def _two_events(
    base: OrbitCurve, u: Array, first: Condition, other: Condition
) -> Iterator[Candidate]:
    """Two events at one time: each with and without the legs that the other one adds."""
    yield _from(base, first, u)
    yield _from(base, other, u)
    for own, added in ((first, other), (other, first)):
        beyond = _changed(base, added, u)
        if beyond is None or not beyond.fresh:
            continue
        longer, start = _with(base, u, beyond)
        at = _same(base, u, own, longer, start)
        if at is not None:
            yield _from(longer, at, start, beyond.fresh)


def _from(
    base: BranchCurve, at: Condition | str, u: Array, fresh: tuple[int, ...] = ()
) -> Candidate:
    """The curve of an event from a point of it, where legs grow from zero."""
    name, touch = (at.name, at.t) if isinstance(at, Condition) else (at, None)
    if isinstance(at, Condition):  # a leg without inside has no test of it yet
        assert isinstance(base, OrbitCurve)
        base.known.setdefault(name, at)
    curve = EventCurve(base, name, u, touch, whole=False)
    return curve, departures(curve, curve.start, fresh)


def _same(
    base: OrbitCurve,
    u: Array,
    at: Condition,
    other: OrbitCurve,
    v: Array,
    like: Condition | None = None,
) -> Condition | None:
    """The condition of another itinerary, of the kind of ``like`` or the same one, at the state of a condition."""
    like, n = at if like is None else like, base.system.dimension
    here, found = _states(base, u, at)[0][0], list[tuple[float, Condition]]()
    for i, leg in enumerate(other.problem.legs):
        if (
            like.guard is None
            or like.guard not in guarded_field(other.system, leg.mode).motion.guards
        ):
            continue
        for there, condition in _states(other, v, replace(like, leg=i, t=None)):
            found.append((float(np.abs((there - here)[:n] / base.scale[:n]).max()), condition))
    near = min(found, key=lambda pair: pair[0], default=(np.inf, None))
    return near[1] if near[0] < _SAME else None


def _states(base: OrbitCurve, u: Array, at: Condition) -> list[tuple[Array, Condition]]:
    """The states at which a condition may be that of an event, the nearest to it first."""
    p, (starts, durations) = base.parameters_at(u), base.problem.split(u[: base.problem.size])
    leg, x, duration = base.problem.legs[at.leg], starts[at.leg], float(durations[at.leg])
    if at.what in ("start", "duration"):
        return [(x, at)]
    times = [duration]
    if at.what == "interior" and at.guard is not None:
        times = [t for t, _ in minima(base.system, leg, at.guard, x, duration, p)]
        times = times if at.t is None else [at.t]
    found = [(integrate_leg(base.system, leg, x, t, p).end, t) for t in times]
    return [(y, replace(at, t=t) if at.what == "interior" else at) for y, t in found]


def _at_tangency(base: OrbitCurve, u: Array, at: Degenerate) -> Iterator[Candidate]:
    """The sliding bifurcations that meet at a degenerate tangency, where leg ``at.leg`` begins."""
    i, legs, g = at.leg, base.problem.legs, at.guard
    surface, exits = g.element, g.side
    own = legs[i - 1].mode[surface] == ("+" if exits > 0 else "-")
    sliding = i - 1 if at.order else i
    slide = next(
        g
        for g in guarded_field(base.system, legs[sliding].mode).motion.guards
        if g.kind == "exit"
        and g.element == surface
        and g.side == (legs[i - 1].side if at.order else exits)
    )
    adding = Condition("interior", sliding, slide)
    flight = i if at.order else i - 1
    if at.order == 0:
        yield _from(base, replace(adding, t=0.0), u)
    if at.order == 0 and not own:
        start = Condition("start", i, g)
        yield _from(base, start, u)
        beyond = _changed(base, start, u, "switching-sliding")
        if beyond is not None and beyond.fresh:
            (longer, guess), (k,) = _with(base, u, beyond), beyond.fresh
            crossing = Condition("start", k, _surface_guard(longer, k, surface))
            yield _from(longer, crossing, guess, (k,))
        return
    touch = Condition("interior", flight, _surface_guard(base, flight, surface))
    if at.order:
        yield from _grown_touch(base, u, adding, i - 1, ahead=2.0, touch=-1.0)
        yield from _grown_touch(base, u, touch, i - 1, ahead=-1.0, touch=1.0)
    else:
        yield from _grown_touch(base, u, touch, i - 1, ahead=2.0, touch=-1.0)


def _surface_guard(base: OrbitCurve, k: int, surface: int) -> Guard:
    """The guard of a leg that is the function of a surface."""
    guards = guarded_field(base.system, base.problem.legs[k].mode).motion.guards
    return next(g for g in guards if g.kind == "surface" and g.element == surface)


def _grown_touch(
    base: OrbitCurve, u: Array, at: Condition, before: int, *, ahead: float, touch: float
) -> Iterator[Candidate]:
    """A touch beside a degenerate tangency: event ``before`` is ``ahead`` of it, in units in which the touch is."""
    problem, k = base.problem, base.problem.size
    starts, durations = (np.array(part) for part in problem.split(u[:k]))
    span, p = float(base.scale[k - 1]), base.parameters_at(u)
    for size in _SIZES:
        d = size * span
        xs, times = starts.copy(), durations.copy()
        times[before] += ahead * d
        times[before + 1] -= ahead * d
        flow = integrate_leg(base.system, problem.legs[before], xs[before], float(times[before]), p)
        xs[before + 1] = flow.end[: problem.dimension]
        t = touch * d + (durations[before] if at.leg == before else -ahead * d)
        guess = np.append(problem.pack(xs, times), u[k:])
        base.known.setdefault(at.name, at)
        curve = EventCurve(base, at.name, guess, t, whole=False)
        axis = np.eye(curve.start.size)[problem.size - len(problem.legs) + before]
        found = curve.correct(curve.start, axis)
        if found is not None and not curve.faults(found):
            origin = np.insert(u, curve.columns, durations[before] if at.leg == before else 0.0)
            yield curve, [Departure(curve, [origin, found], (found - origin) / curve.scale)]
            return
