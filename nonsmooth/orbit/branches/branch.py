"""Branches of solutions as one parameter varies, and their continuation.

Each piece is continued by :mod:`nonsmooth.continuation` with its own equations; where one ends at an
event the next one begins with the solutions beyond it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np

from ...flow.ensembles.progress import progress_bar
from ...local.read_only import ReadOnly
from ...model import (
    Array,
    ConvergenceError,
    FilippovSystem,
    Guard,
    NonsmoothError,
    OptionError,
    PointError,
    real,
)
from ...notebook import representation
from ...result_tables import ResultTable, Tabular, stacked
from ...solvers.continuation import (
    Arc,
    Curve,
    Departure,
    Point,
    Zero,
    directions,
    pieces,
    trace,
)


class BranchEnd(Enum):
    """Why a branch ends.

    REACHED_BOUND: the parameter reached a bound. CLOSED: the branch is a closed curve. EVENT: nothing
    continues it beyond an event. PERIOD_DIVERGES: the period grows without bound. STEP_TOO_SMALL: no
    solution was found at the shortest step. TOO_MANY_POINTS: it has ``max_points`` points. FAILED: an
    error was raised, with its message in ``Branch.reasons``. INTERRUPTED: Ctrl-C.
    """

    REACHED_BOUND = "bound"
    CLOSED = "closed"
    EVENT = "event"
    PERIOD_DIVERGES = "period"
    STEP_TOO_SMALL = "step too small"
    TOO_MANY_POINTS = "points"
    FAILED = "failed"
    INTERRUPTED = "interrupted"

    def __str__(self) -> str:
        return self.name

    @property
    def advice(self) -> str:
        """The reason in a sentence, with what to do."""
        return _ADVICE[self]


_ADVICE = {
    BranchEnd.REACHED_BOUND: "The parameter reached its bound.",
    BranchEnd.CLOSED: "The branch is a closed curve.",
    BranchEnd.EVENT: "Nothing continues the branch beyond its last event, or through=False.",
    BranchEnd.PERIOD_DIVERGES: "The period grows without bound: a homoclinic orbit is near.",
    BranchEnd.STEP_TOO_SMALL: "Steps became too short: the solutions end here, or the equations do.",
    BranchEnd.TOO_MANY_POINTS: "Raise max_points to continue.",
    BranchEnd.FAILED: "An error was raised.",
    BranchEnd.INTERRUPTED: "Interrupted; the branch has the points computed so far.",
}


@dataclass(frozen=True, eq=False)
class FarSide:
    """Unfolding of an event: the solutions beyond it.

    Attributes
    ----------
    itinerary : str
        Or the kind of solution; empty if nothing continues the branch.
    verdict : str
        The fate of the solutions there, in words.
    numbers : mapping of str to float
        The numbers that decide the verdict.
    """

    itinerary: str = ""
    verdict: str = ""
    numbers: Mapping[str, float] = field(default_factory=lambda: ReadOnly({}))

    def __str__(self) -> str:
        parts = [part for part in (self.itinerary, self.verdict) if part]
        return ": ".join(parts) if parts else "nothing changes"


@dataclass(frozen=True, eq=False, repr=False)
class BranchEvent(Tabular):
    """A bifurcation on a branch.

    Attributes
    ----------
    kind : str
        ``"fold"``, ``"Hopf"``, ``"period doubling"``, ``"grazing-sliding"``, ...
    parameter : float
        Value of the parameter.
    solution
        The equilibrium or periodic orbit there.
    far_side : FarSide
        The unfolding: what continues the branch beyond the event.
    coefficients : mapping of str to float
        Coefficients of normal forms and conditions.
    curve, point, test
        The equations, the point on their curve and the test that vanishes there, from which
        ``continue_bifurcation`` and branch switching start.
    family : tuple
        Where orbits shrink or become infinitely long: those of the branch, from which ``continue_orbit`` starts.
    """

    kind: str
    parameter: float
    solution: Any
    far_side: FarSide = field(default_factory=FarSide)
    coefficients: Mapping[str, float] = field(default_factory=lambda: ReadOnly({}))
    curve: Any = None
    point: Point | None = None
    test: str = ""
    family: tuple[Any, ...] = ()

    @property
    def orbit(self) -> Any:
        """The solution, where it is a periodic orbit."""
        return self.solution

    def __repr__(self) -> str:
        return f"BranchEvent({self.kind!r}, {self.parameter:.10g}, {self.far_side})"


def _beside(choices: Sequence[tuple[Any, Point]], target: float) -> list[Any]:
    """The solution next to an event, in the first itinerary that is admissible there."""
    for (curve, point), (_, far) in zip(choices, reversed(choices), strict=True):
        try:
            guess = curve.toward(point.u, target, float(far.u[-1]))
            found = curve.solution_at(guess, target)
        except NonsmoothError:
            continue
        if not getattr(found, "is_virtual", getattr(found, "status", "") == "virtual"):
            return [found]
    return []


@dataclass(frozen=True, eq=False, repr=False)
class Branch(Tabular):
    """Solutions as a parameter varies.

    Attributes
    ----------
    parameter : str
        Name of the parameter that varies.
    values : ndarray (k,)
        Values of the parameter; a branch that turns back has values more than once.
    solutions : tuple of k solutions
        Equilibria or periodic orbits.
    events : tuple of BranchEvent
        Events in their order along the branch.
    ends : tuple of two BranchEnd
        Why it ends at its first and its last point.
    reasons : tuple of two str
        The same in a sentence each.
    nodes : tuple of (curve, Point)
        For each solution the equations and the point of their curve.
    """

    parameter: str
    values: Array
    solutions: tuple[Any, ...]
    events: tuple[BranchEvent, ...]
    ends: tuple[BranchEnd, BranchEnd]
    reasons: tuple[str, str] = ("", "")
    nodes: tuple[tuple[Any, Point], ...] = ()

    def _tables(self) -> dict[str, ResultTable]:
        names = self.nodes[0][0].system.state_names if self.nodes else ()
        found = [e.parameter for e in self.events]
        events = {
            "kind": [e.kind for e in self.events],
            "far_side": [str(e.far_side) for e in self.events],
        }
        return {
            "points": stacked(self.solutions, {self.parameter: self.values}, names),
            "events": ResultTable({"event": len(found)}, {self.parameter: found, **events}),
        }

    @property
    def orbits(self) -> tuple[Any, ...]:
        """The solutions, where they are periodic orbits."""
        return self.solutions

    def __len__(self) -> int:
        return len(self.values)

    def at(self, value: float) -> list[Any]:
        """Solve for the solutions at a value of the parameter.

        Parameters
        ----------
        value : float
            Value of the parameter.

        Returns
        -------
        list
            Equilibria or orbits, in their order along the branch.

        Raises
        ------
        PointError
            A value that the branch does not reach.

        See Also
        --------
        __getitem__ : the only one, or the first.
        """
        target = real(value, "value", expected="a finite number", advice="Give one.")
        found = []
        for k in range(len(self) - 1):
            (curve, a), (other, b) = self.nodes[k], self.nodes[k + 1]
            va, vb = curve.value(a.u), other.value(b.u)
            if not min(va, vb) <= target <= max(va, vb) or va == vb:
                continue
            if curve is not other:  # beside an event: first in the itinerary beyond it
                before = any(event.point is b for event in self.events)
                ways = [(curve, a), (other, b)] if before else [(other, b), (curve, a)]
                found += [] if target in (va, vb) else _beside(ways, target)
                continue
            if target == va and k and self.nodes[k - 1][0] is curve:
                continue  # found as the end of the step before
            guess = a.u + (target - va) / (vb - va) * (b.u - a.u)
            found.append(curve.solution_at(guess, target))
        if not found:
            raise PointError(
                f"value: the branch has no solution at {self.parameter} = {target:.10g}. It reaches "
                f"[{self.values.min():.10g}, {self.values.max():.10g}]: widen the bounds of the continuation."
            )
        return found

    def __getitem__(self, value: float) -> Any:
        return self.at(value)[0]

    def table(self) -> str:
        """The events as lines of text; empty if there are none."""
        if not self.events:
            return ""
        rows = [f"{self.parameter:>18}  event"]
        rows += [f"{e.parameter:18.12g}  {e.kind}; {e.far_side}" for e in self.events]
        return "\n".join(rows)

    def __str__(self) -> str:
        low, high = self.values.min(), self.values.max()
        return (
            f"Branch of {len(self)} points, {self.parameter} from {low:.10g} to {high:.10g}, "
            f"ends {self.ends[0]} and {self.ends[1]}, {len(self.events)} events\n{self.table()}"
        ).rstrip()

    def _repr_html_(self) -> str:
        """Notebook representation: range, ends and events."""
        rows = [
            (self.parameter, f"{self.values.min():.10g} to {self.values.max():.10g}"),
            ("ends", f"{self.ends[0]} and {self.ends[1]}"),
            *((f"{e.parameter:.10g}", f"{e.kind}; {e.far_side}") for e in self.events),
        ]
        return representation(f"Branch of {len(self)} points", rows)

    def __repr__(self) -> str:
        kinds = ", ".join(f"{e.kind} {e.parameter:.6g}" for e in self.events)
        return f"Branch({self.parameter!r}, {len(self)} points; {kinds or 'no events'})"


# Continuation -------------------------------------------------------------------------------------


class BranchCurve(Curve):
    """A curve of solutions with the parameter as last unknown; subclasses describe its points."""

    parameter: int | None = -1
    branching = True
    scale: Array
    system: FilippovSystem
    free: tuple[int, ...]

    def value(self, u: Array) -> float:
        """The parameter at a point of the curve."""
        return float(u[-1])

    def parameters_at(self, u: Array) -> Array:
        """All parameters of the system at a point of the curve."""
        raise NotImplementedError

    def freed(self, u: Array, free: tuple[int, ...], widths: Array) -> tuple[BranchCurve, Array]:
        """The same equations with other free parameters of the scales ``widths``, and the point there."""
        raise NotImplementedError

    def begun_later(self, u: Array) -> tuple[BranchCurve, Array]:
        """The same equations and solution; a forced orbit without events begins at another phase."""
        return self, u

    def ending(self, u: Array, end: BranchEnd) -> BranchEvent | None:
        """The event at the end of a branch, if one can be named."""
        return None

    def restart(self, u: Array) -> None:
        """Prepare a continuation from a point of the curve."""

    def admissible(self, u: Array) -> bool:
        """Whether the solution at a point is admissible."""
        return getattr(self.describe(u), "status", "") != "virtual"

    def turned(self, u: Array, tangent: Array) -> Array | None:
        """Change the equations at a point, if necessary; returns the tangent of the new ones."""
        return None

    def renewed(self, point: Point) -> Point | None:
        tangent = self.turned(point.u, point.tangent)
        return None if tangent is None else self.point(point.u, tangent, tangent, point.arclength)

    def codimension_two(self, name: str, u: Array, touch: float | None) -> Mapping[str, float]:
        """Further functions whose zeros on a curve of events are of codimension two."""
        return {}

    def ends_curve(self, event: str, name: str) -> bool:
        """Whether the curve of an event ends at a zero of another test."""
        return self.ends(name)

    def faults(self, u: Array) -> list[str]:
        """Violated guards at a point of the curve."""
        return []

    def test_row(self, test: str, u: Array) -> tuple[float, Array] | None:
        """A test and its derivatives by the unknowns, where known in closed form; else None."""
        return None

    def named(self, test: str, u: Array) -> str:
        """The bifurcation at a zero of a test."""
        return test

    def occurs(self, test: str, u: Array) -> bool:
        """Whether the bifurcation occurs at a zero of its test, which may vanish elsewhere too."""
        return True

    def double_zero(self, u: Array) -> bool:
        """Whether two eigenvalues vanish together at a point."""
        return False

    def require_valid(self, u: Array) -> None:
        """Raise if an assumption of the equations does not hold at a point."""

    def describe(self, u: Array) -> Any:
        """The solution at a point of the curve."""
        raise NotImplementedError

    def event(self, zero: Zero) -> BranchEvent | None:
        """The event at a located zero; None if there is none."""
        raise NotImplementedError

    def unresolved(self, u: Array) -> str:
        """Why doubles do not resolve the curve beyond a point; empty if not known."""
        return ""

    def diverges(self, u: Array) -> str:
        """Why the period of orbits grows without bound where they can be followed no further; empty if it does not."""
        return ""

    def again(self, u: Array, tangent: Array | None = None) -> Departure | None:
        """The same curve from a point of it with better equations; None if there are none."""
        return None

    def is_to_divide(self, u: Array) -> bool:
        """Whether derivatives grow too much on a leg of an orbit."""
        return False

    def is_at_hopf(self, u: Array, guard: Guard | None = None) -> bool:
        """Whether an orbit has shrunk to an equilibrium, with two free parameters on the surface of a guard."""
        return False

    def redivided(self, u: Array) -> tuple[BranchCurve, Array]:
        """The same equations with legs of an orbit divided, and a guess at the point; themselves if nothing changes."""
        return self, u

    def onward(self, event: BranchEvent, zero: Zero) -> Departure | None:
        """The start of the branch beyond an event that ends this curve."""
        return None

    def unknowns_at(self, guess: Array, value: float) -> Array | None:
        """The unknowns near a guess at a value of the parameter; None if there are none."""
        start, axis = np.array(guess), np.zeros(len(guess))
        start[-1], axis[-1] = value, 1.0
        return self.correct(start, axis)

    def toward(self, guess: Array, value: float, end: float) -> Array:
        """A guess at a value near an event at ``end``, where a leg vanishes like a square root."""
        u = guess
        while abs(value - end) < 0.25 * abs(self.value(u) - end):
            closer = self.unknowns_at(u, end + 0.25 * (self.value(u) - end))
            if closer is None:
                break
            u = closer
        return u

    def solution_at(self, guess: Array, value: float) -> Any:
        """The solution near a guess at a value of the parameter."""
        u = self.unknowns_at(guess, value)
        if u is None:
            raise ConvergenceError(
                f"the branch at {value:.10g}: no solution was found between its neighbours. Continue with a "
                "smaller step."
            )
        u[-1] = value
        return self.describe(u)


def check_bounds(bounds: Sequence[float], value: float, name: str) -> tuple[float, float]:
    """Check bounds of a parameter around its value."""
    try:
        low, high = (float(b) for b in bounds)
    except (TypeError, ValueError):
        low, high = np.nan, np.nan
    if not low <= value <= high or not np.isfinite(high - low) or low == high:
        raise OptionError(
            f"bounds={bounds!r} are not two numbers around {name} = {value:.10g}. Give (low, high)."
        )
    return low, high


def follow_branch(
    curve: BranchCurve,
    start: Array,
    *,
    name: str,
    bounds: tuple[float, float],
    step: float,
    max_points: int,
    through: bool,
    progress: bool = False,
    away: Departure | None = None,
) -> Branch:
    """Continue a solution both ways to the bounds of the parameter, or one way ``away`` from an event."""
    if not isinstance(through, (bool, np.bool_)):
        raise OptionError(f"through={through!r} is no truth value. Give True or False.")
    bar = progress_bar(None, progress, " points")

    def report(point: Point) -> None:
        if progress:
            bar.set_postfix_str(f"{name} = {point.u[-1]:.6g}", refresh=False)
        bar.update()

    step = min(step, 1.0)  # a step is no longer than the bounds are wide
    forward = np.zeros(start.size)
    forward[-1] = 1.0
    halves = [] if away is None else [_Half(reason="It begins at an event.")]
    if away is None:
        try:
            start = _off_events(curve, start, 0.01 * step, bounds)
        except KeyboardInterrupt:
            halves = [_Half([(curve, Point(start, forward))], end=BranchEnd.INTERRUPTED)]
    options: dict[str, Any] = dict(step=step, max_points=max_points, report=report, bounds=bounds)
    ways = [Departure(curve, [start], sign * forward) for sign in (-1.0, 1.0)]
    for way in ways[len(halves) :] if away is None else [away]:
        if halves and halves[0].end in (BranchEnd.CLOSED, BranchEnd.INTERRUPTED):
            halves.append(_Half(end=halves[0].end))
            continue
        halves.append(_half(way, through, options))
    bar.close()
    branch = _joined(name, *halves)
    for at, point in (branch.nodes[0], branch.nodes[-1]):
        assert isinstance(at, BranchCurve)
        at.require_valid(point.u)
    return branch


#: End of an arc whose equations are to be divided, and most pieces of a branch.
DIVIDE, _PIECES = "legs to divide", 48

#: Size of a test at the start, relative to that beside it, at which the start is its zero.
_ZERO = 1e-9


def _off_events(
    curve: BranchCurve, start: Array, step: float, bounds: tuple[float, float]
) -> Array:
    """The start, or where a test vanishes there a point beside it, so that the zero is inside a step."""
    curve.restart(start)
    try:
        tangent = directions(curve, start)[0]
    except (NonsmoothError, np.linalg.LinAlgError):
        return start
    here = curve.point(start, tangent, tangent, 0.0)
    small = {} if here is None else {k: abs(v) for k, v in here.tests.items() if abs(v) < 1e-6}
    if not small:
        return start
    beside = list[Point]()
    for sign in (-1.0, 1.0):
        u = curve.correct(start + sign * step * tangent * curve.scale, tangent)
        point = None if u is None else curve.point(u, tangent, tangent, sign * step)
        if point is not None and bounds[0] <= curve.value(point.u) <= bounds[1]:
            beside.append(point)
    zero = [k for k in small for p in beside if small[k] < _ZERO * abs(p.tests.get(k, 0.0))]
    kept = [point for point in beside if zero and curve.admissible(point.u)]
    return kept[0].u if kept else start


@dataclass
class _Half:
    """One direction along a branch."""

    nodes: list[tuple[BranchCurve, Point]] = field(default_factory=list)
    events: list[BranchEvent] = field(default_factory=list)
    end: BranchEnd = BranchEnd.EVENT
    reason: str = ""

    def name_end(self) -> None:
        """The event at the last point of a curve whose continuation failed."""
        curve, point = self.nodes[-1]
        try:
            last = curve.ending(point.u, self.end)
            beside = "" if last is not None else curve.diverges(point.u)
            said = "" if last is not None or beside else curve.unresolved(point.u)
        except (NonsmoothError, np.linalg.LinAlgError):
            return
        self.reason = beside or said or self.reason
        if last is not None:
            self.events.append(last)
            self.end = BranchEnd.PERIOD_DIVERGES if last.kind in _DIVERGES else BranchEnd.EVENT
        elif beside:
            self.end = BranchEnd.PERIOD_DIVERGES


#: Events to which the period diverges.
_DIVERGES = ("homoclinic", "infinite period at a boundary node")

#: At these the orbits of a branch shrink to a point, or one of them is infinitely long.
_FAMILY_ENDS = ("Hopf", "boundary equilibrium", "two-fold", "cycle from a two-fold", _DIVERGES[1])

#: Ends of an arc behind which no other itinerary follows.
_WHOLE = ("bound", "closed", "interrupted", "points")


def _half(first: Departure, through: bool, options: Mapping[str, Any]) -> _Half:
    half, (low, high) = _Half(), options["bounds"]
    known: dict[int, BranchEvent | None] = {}  # by the identity of the zero, kept in its arc

    def follow(departure: Departure) -> Arc:
        curve = departure.curve
        assert isinstance(curve, BranchCurve)
        try:
            curve.restart(departure.rows[-1])
        except KeyboardInterrupt:
            return Arc([Point(departure.rows[-1], departure.tangent)], end="interrupted")
        arc = trace(
            curve,
            departure.rows,
            departure.tangent,
            step=options["step"],
            most=options["max_points"] - max(0, len(half.nodes) - 1),  # pieces share their ends
            bounds=[(len(departure.rows[-1]) - 1, low, high)],
            report=options["report"],
        )
        _drop_turning(arc)
        known.update(dict.fromkeys(map(id, arc.zeros)))
        try:
            for zero in arc.zeros:
                known[id(zero)] = _event(curve, zero)
        except KeyboardInterrupt:
            arc.end = "interrupted"
        return arc

    def following(departure: Departure, arc: Arc) -> Departure | None:
        assert isinstance(departure.curve, BranchCurve)
        if arc.end in (DIVIDE, "lost", "step too small"):
            return departure.curve.again(arc.points[-1].u, arc.points[-1].tangent)
        event = known[id(arc.zeros[-1])] if through and arc.zeros else None
        if event is None or arc.zeros[-1].name != arc.end:
            return None
        try:
            return departure.curve.onward(event, arc.zeros[-1])
        except (NonsmoothError, np.linalg.LinAlgError):  # the itinerary beyond has no orbit
            return None
        except KeyboardInterrupt:
            half.end = BranchEnd.INTERRUPTED
            return None

    for departure, arc in pieces(
        first, follow, following, last=lambda arc: arc.end in _WHOLE, apart=0.0, most=_PIECES
    ):
        at = departure.curve
        assert isinstance(at, BranchCurve)
        points = arc.points[1:] if half.nodes else arc.points  # pieces share their ends
        half.nodes += [(at, point) for point in points]
        last = known[id(arc.zeros[-1])] if arc.zeros and arc.zeros[-1].name == arc.end else None
        if last is not None and last.point is not None and _elsewhere(last, at):
            half.nodes[-1] = (last.curve, last.point)  # regular in the other itinerary
        found = [known[id(zero)] for zero in arc.zeros]
        half.events += _distinct(found, last)
        half.end, half.reason = end_of(arc), arc.reason
    if half.end in (BranchEnd.PERIOD_DIVERGES, BranchEnd.STEP_TOO_SMALL, BranchEnd.FAILED):
        half.name_end()
    return half


#: Distance of a turning point from a pitchfork and from the end of an arc, relative to the parameter, at which it is
#: that event itself.
_SAME, _ROUNDING = 1e-8, 1e-12


def _distinct(events: Sequence[BranchEvent | None], last: BranchEvent | None) -> list[BranchEvent]:
    """Events without the turning points of branches that begin at pitchforks, or at the last event, as a square root."""
    found = [event for event in events if event is not None]
    ends = [(event.parameter, _SAME) for event in found if event.kind == "pitchfork"]
    ends += [] if last is None else [(last.parameter, _ROUNDING)]
    return [
        event
        for event in found
        if event.kind != "fold"
        or all(abs(event.parameter - end) > part * (1e-3 + abs(end)) for end, part in ends)
    ]


def _event(curve: BranchCurve, zero: Zero) -> BranchEvent | None:
    """The event at a zero; where it cannot be computed, with the reason."""
    try:
        return curve.event(zero)
    except (NonsmoothError, np.linalg.LinAlgError) as error:
        solution, side = curve.describe(zero.point.u), FarSide("", f"not classified: {error}")
        value = curve.value(zero.point.u)
        return BranchEvent(
            "unclassified", value, solution, side, side.numbers, curve, zero.point, zero.name
        )


def _sentence(name: str, half: _Half) -> str:
    """Why a branch ends."""
    last = half.events[-1] if half.events else None
    diverges = half.end is BranchEnd.PERIOD_DIVERGES
    if last is not None and (last.kind in _DIVERGES if diverges else half.end is BranchEnd.EVENT):
        return (
            f"At {name} = {last.parameter:.10g} there is an event, {last.kind} ({last.far_side})."
        )
    said = half.reason and f" {half.reason}"
    return half.end.advice + said


def _elsewhere(event: BranchEvent, curve: BranchCurve) -> bool:
    """Whether an event is a point of another curve of the same kind of solutions."""
    return event.curve is not curve and type(event.curve) is type(curve)


def _drop_turning(arc: Arc) -> None:
    """Drop turning and branch points that coincide with the event at the end of an arc."""
    # Where a new leg grows like a square root the branch is tangent to a constant parameter. Where it grows
    # like a cube root, and at a Hopf point, the equations are singular.
    if not arc.zeros or arc.zeros[-1].name != arc.end:
        return
    end = arc.zeros[-1].point.arclength
    near = 1e-6 * max(1.0, end)
    if arc.zeros[-1].name == "Hopf":  # where the equilibrium has any period
        near = max(near, end - arc.points[-2].arclength)
    arc.zeros[:] = [
        zero
        for zero in arc.zeros
        if zero.name not in ("fold", "branch point")
        or end - zero.point.arclength > near
        or zero is arc.zeros[-1]
    ]


def end_of(arc: Arc) -> BranchEnd:
    """Name the end of an arc."""
    if arc.zeros and arc.zeros[-1].name == arc.end:
        return BranchEnd.EVENT
    if arc.end in ("lost", "step too small", "two-fold", DIVIDE):
        return BranchEnd.STEP_TOO_SMALL
    if arc.end == "period diverges":
        return BranchEnd.PERIOD_DIVERGES
    known = {end.value: end for end in BranchEnd}
    return known.get(arc.end, BranchEnd.EVENT)


def _joined(name: str, backward: _Half, forward: _Half) -> Branch:
    nodes = [*reversed(backward.nodes), *forward.nodes[1 if backward.nodes else 0 :]]
    solutions = tuple(curve.describe(point.u) for curve, point in nodes)
    events = [*reversed(backward.events), *forward.events]
    if hasattr(solutions[0], "period"):
        events = [replace(e, family=solutions) if e.kind in _FAMILY_ENDS else e for e in events]
    return Branch(
        parameter=name,
        values=np.array([curve.value(point.u) for curve, point in nodes]),
        solutions=solutions,
        events=tuple(events),
        ends=(backward.end, forward.end),
        reasons=(_sentence(name, backward), _sentence(name, forward)),
        nodes=tuple(nodes),
    )
