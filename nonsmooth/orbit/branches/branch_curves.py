"""Following a branch of solutions both ways from its start, piece after piece.

Each piece is continued by :mod:`nonsmooth.continuation` with equations of its own; where one ends at
an event the next one begins in the solutions on the other side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...model import Array, ConvergenceError, FilippovSystem, NonsmoothError, OptionError, explain
from ...solvers.continuation import Arc, Curve, Departure, Point, Zero, pieces, trace
from .branch import Branch, BranchEnd, BranchEvent


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
        """The same equations with other free parameters, and the point there.

        Parameters
        ----------
        u : ndarray
        free : tuple of int
        widths : ndarray
            Scales of these parameters.
        """
        raise NotImplementedError

    def ending(self, u: Array, end: BranchEnd) -> BranchEvent | None:
        """What the end of a branch is, where more than that it ends can be said."""
        return None

    def restart(self, u: Array) -> None:
        """Prepare to be followed from a point of it."""

    def turned(self, u: Array, tangent: Array) -> Array | None:
        """Prepare to be followed on from a point, if need be; the tangent of the new equations."""
        return None

    def renewed(self, point: Point) -> Point | None:
        tangent = self.turned(point.u, point.tangent)
        return None if tangent is None else self.point(point.u, tangent, tangent, point.arclength)

    def codimension_two(self, name: str, u: Array) -> Mapping[str, float]:
        """Further functions whose zeros on a curve of events are of codimension two."""
        return {}

    def ends_curve(self, name: str) -> bool:
        """Whether a curve of events ends at a point of codimension two."""
        return False

    def test_row(self, test: str, u: Array) -> tuple[float, Array] | None:
        """A test and its derivatives by the unknowns, where few of them matter; else None."""
        return None

    def named(self, test: str, u: Array) -> str:
        """The bifurcation at a zero of a test."""
        return test

    def double_zero(self, u: Array) -> bool:
        """Whether two eigenvalues vanish together at a point, not one beside an imaginary pair."""
        return False

    def require_valid(self, u: Array) -> None:
        """Refuse a point at which what the equations take for granted does not hold."""

    def describe(self, u: Array) -> Any:
        """The solution at a point of the curve."""
        raise NotImplementedError

    def event(self, zero: Zero) -> BranchEvent | None:
        """What a located zero is; None if it is nothing."""
        raise NotImplementedError

    def onward(self, event: BranchEvent, zero: Zero) -> Departure | None:
        """How the branch goes on beyond an event that ends this curve."""
        return None

    def unknowns_at(self, guess: Array, value: float) -> Array | None:
        """The unknowns near a guess at a value of the parameter; None if there are none."""
        start, axis = np.array(guess), np.zeros(len(guess))
        start[-1], axis[-1] = value, 1.0
        return self.correct(start, axis)

    def toward(self, guess: Array, value: float, end: float) -> Array:
        """A guess at a value that lies towards an event at ``end``, where a leg vanishes like a root."""
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
                explain(
                    f"the branch at {value:.10g}",
                    expected="a solution near its neighbours",
                    received="no convergence",
                    advice="Continue with a smaller step.",
                )
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
            explain(
                "bounds",
                expected=f"two numbers around {name} = {value:.10g}",
                received=repr(bounds),
                advice="Give (low, high).",
            )
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
    """Continue a solution both ways to the bounds of the parameter, through events if asked to."""
    # With ``away`` one way only, from an event.
    if not isinstance(through, (bool, np.bool_)):
        raise OptionError(f"through: expected True or False, received {through!r}.")
    bar = progress_bar(progress)

    def report(point: Point) -> None:
        if bar is not None:
            bar.set_postfix_str(f"{name} = {point.u[-1]:.6g}", refresh=False)
            bar.update()

    forward = np.zeros(start.size)
    forward[-1] = 1.0
    step = min(step, 1.0)  # a step is no longer than the bounds are wide
    options: dict[str, Any] = dict(step=step, max_points=max_points, report=report, bounds=bounds)
    ways = [Departure(curve, [start], sign * forward) for sign in (-1.0, 1.0)]
    halves = [] if away is None else [_Half()]
    for way in ways if away is None else [away]:
        if halves and halves[0].end in (BranchEnd.CLOSED, BranchEnd.INTERRUPTED):
            halves.append(_Half(end=halves[0].end))
            continue
        halves.append(_half(way, through, options))
    if bar is not None:
        bar.close()
    branch = _joined(name, *halves)
    for at, point in (branch.nodes[0], branch.nodes[-1]):
        assert isinstance(at, BranchCurve)
        at.require_valid(point.u)
    return branch


def progress_bar(progress: bool) -> Any:
    """A bar that counts points, shown after a second; None if it is not asked for."""
    if not progress:
        return None
    from tqdm import tqdm  # here: it is not needed to import the library

    return tqdm(disable=None, delay=1.0, unit=" points")


@dataclass
class _Half:
    """One way along a branch."""

    nodes: list[tuple[BranchCurve, Point]] = field(default_factory=list)
    events: list[BranchEvent] = field(default_factory=list)
    end: BranchEnd = BranchEnd.EVENT


def _half(first: Departure, through: bool, options: Mapping[str, Any]) -> _Half:
    half, (low, high) = _Half(), options["bounds"]
    known: dict[int, BranchEvent | None] = {}  # by the identity of the zero, kept in its arc

    def follow(departure: Departure) -> Arc:
        curve = departure.curve
        assert isinstance(curve, BranchCurve)
        curve.restart(departure.rows[-1])
        arc = trace(
            curve,
            departure.rows,
            departure.tangent,
            step=options["step"],
            most=options["max_points"],
            bounds=[(len(departure.rows[-1]) - 1, low, high)],
            report=options["report"],
        )
        _drop_turning(arc)
        known.update(dict.fromkeys(map(id, arc.zeros)))
        try:
            for zero in arc.zeros:
                known[id(zero)] = curve.event(zero)
        except KeyboardInterrupt:
            arc.end = "interrupted"
        return arc

    def following(departure: Departure, arc: Arc) -> Departure | None:
        event = known[id(arc.zeros[-1])] if through and arc.zeros else None
        if event is None or arc.zeros[-1].name != arc.end:
            return None
        assert isinstance(departure.curve, BranchCurve)
        try:
            return departure.curve.onward(event, arc.zeros[-1])
        except NonsmoothError:  # the itinerary beyond has no orbit that could be followed
            return None
        except KeyboardInterrupt:
            half.end = BranchEnd.INTERRUPTED
            return None

    whole = ("bound", "closed", "interrupted", "points")
    for departure, arc in pieces(
        first, follow, following, last=lambda arc: arc.end in whole, apart=0.0
    ):
        at = departure.curve
        assert isinstance(at, BranchCurve)
        points = arc.points[1:] if half.nodes else arc.points  # pieces share their ends
        half.nodes += [(at, point) for point in points]
        last = known[id(arc.zeros[-1])] if arc.zeros and arc.zeros[-1].name == arc.end else None
        if last is not None and last.point is not None and _elsewhere(last, at):
            half.nodes[-1] = (last.curve, last.point)  # regular in the other itinerary
        found = [known[id(zero)] for zero in arc.zeros]
        half.events += [event for event in found if event is not None]
        half.end = end_of(arc)
        if half.end in (BranchEnd.PERIOD_DIVERGES, BranchEnd.STEP_TOO_SMALL):
            last = at.ending(arc.points[-1].u, half.end)
            if last is not None:
                half.events.append(last)
                diverges = last.kind == "homoclinic"
                half.end = BranchEnd.PERIOD_DIVERGES if diverges else BranchEnd.EVENT
    return half


def _elsewhere(event: BranchEvent, curve: BranchCurve) -> bool:
    """Whether an event is a point of another curve of the same kind of solutions."""
    return event.curve is not curve and type(event.curve) is type(curve)


def _drop_turning(arc: Arc) -> None:
    """Forget a turning or branch point that only mirrors the event at which an arc ends."""
    # Where a new leg grows like a square root the branch is tangent to a constant parameter, and where
    # it grows like a cube root the equations are singular; so they are at a Hopf point.
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
    if arc.end in ("lost", "step too small"):
        return BranchEnd.STEP_TOO_SMALL
    if arc.end == "period diverges":
        return BranchEnd.PERIOD_DIVERGES
    known = {end.value: end for end in BranchEnd}
    return known.get(arc.end, BranchEnd.EVENT)


def _joined(name: str, backward: _Half, forward: _Half) -> Branch:
    nodes = [*reversed(backward.nodes), *forward.nodes[1 if backward.nodes else 0 :]]
    events = [*reversed(backward.events), *forward.events]
    return Branch(
        parameter=name,
        values=np.array([curve.value(point.u) for curve, point in nodes]),
        solutions=tuple(curve.describe(point.u) for curve, point in nodes),
        events=tuple(events),
        ends=(backward.end, forward.end),
        nodes=tuple(nodes),
    )
