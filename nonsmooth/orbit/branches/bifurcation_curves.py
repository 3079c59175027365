"""Curves of bifurcations in two parameters, from an event of a branch or a point of codimension two.

Points of a curve are admissible. It ends where it would become virtual, at a point of codimension two, from
which other curves leave.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

import numpy as np

from ...flow.ensembles.progress import progress_bar
from ...model import (
    Array,
    ConvergenceError,
    DefinitionError,
    NonsmoothError,
    OptionError,
    whole,
)
from ...model.checks import positive
from ...result_tables import ResultTable, Tabular, stacked
from ...solvers.continuation import Arc, Curve, Departure, Zero, directions, pieces, trace
from ..homoclinic.homoclinic_orbits import Connection
from .branch import DIVIDE, BranchCurve, BranchEnd, BranchEvent, check_bounds, end_of
from .codimension_two import AT_SADDLE, CodimensionTwo, leaving, special_point
from .event_curves import SECOND, VIRTUAL, EventCurve
from .homoclinic_curves import ConnectionCurve, event_of
from .orbit_branches import OrbitCurve

#: Ends of arcs that are no events.
_WHOLE = ("bound", "closed", "interrupted", "points", VIRTUAL)

#: Ends of pieces beyond which legs may have to be divided.
_DIVISIBLE = (DIVIDE, "lost", "step too small")

#: Points of codimension two closer than this, relative to their sizes, are one.
_MERGED = 1e-6

#: Relative duration of a leg that has vanished.
_NO_LEG = 1e-7


#: The equations of a point of a curve, and their unknowns.
Node = tuple[EventCurve | ConnectionCurve, Array]

#: The equations of a piece of a curve, and its points.
Piece = tuple[EventCurve | ConnectionCurve, Arc]


@dataclass(frozen=True, eq=False, repr=False)
class BifurcationCurve(Tabular):
    """A curve of bifurcations in the plane of two parameters.

    Attributes
    ----------
    kind : str
        Kind of the bifurcation, as in ``BranchEvent.kind``.
    parameters : tuple of two str
        Names of the two parameters.
    values : ndarray (k, 2)
        Their values along the curve.
    special : tuple of CodimensionTwo
        Points of codimension two on the curve.
    ends : tuple of two BranchEnd
        Why the curve ends at its two ends.
    nodes : tuple of k (Curve, ndarray)
        For each point the equations and their unknowns.
    """

    kind: str
    parameters: tuple[str, str]
    values: Array
    special: tuple[CodimensionTwo, ...]
    ends: tuple[BranchEnd, BranchEnd]
    nodes: tuple[Node, ...]

    def _tables(self) -> dict[str, ResultTable]:
        columns = dict(zip(self.parameters, self.values.T, strict=True))
        special = {"special": len(self.special)}
        return {
            "points": ResultTable({"point": len(self.values)}, columns),
            "special": stacked(self.special, special),
        }

    def solution(self, k: int) -> Any:
        """Return the equilibrium or orbit at a point of the curve.

        Parameters
        ----------
        k : int
            Number of the point: a row of ``values``.
        """
        curve, u = self.nodes[k]
        return curve.describe(u)

    def __len__(self) -> int:
        return len(self.values)

    def __str__(self) -> str:
        lines = [
            f"Curve of {self.kind} in ({', '.join(self.parameters)}), {len(self)} points, "
            f"ends {self.ends[0]} and {self.ends[1]}"
        ]
        return "\n".join([*lines, *(f"  {point}" for point in self.special)])

    def __repr__(self) -> str:
        return f"BifurcationCurve({self.kind!r}, {len(self)} points, {len(self.special)} special)"


def continue_bifurcation(
    event: BranchEvent | Connection | CodimensionTwo,
    parameters: Sequence[str],
    *,
    bounds: Sequence[Sequence[float]],
    step: float = 0.02,
    max_points: int = 2000,
    progress: bool = False,
) -> BifurcationCurve | tuple[BifurcationCurve, ...]:
    """Follow a bifurcation as two parameters vary, or the curves that leave a point of codimension two.

    Parameters
    ----------
    event : BranchEvent, Connection or CodimensionTwo
        An entry of ``Branch.events``, a homoclinic orbit, or an entry of ``BifurcationCurve.special``.
    parameters : two str
        Names; others keep their values at the event.
    bounds : two (low, high)
        Bounds of the parameters at which the curve ends.
    step : float, optional
        Largest step where the curve bends, relative to the widths of the bounds.
    max_points : int, optional
        Largest number of points on each side of the event.
    progress : bool, optional
        Whether to show a bar that counts points. After Ctrl-C the points computed so far are returned.

    Returns
    -------
    BifurcationCurve
        With the points of codimension two on it: a second event at the same time, cusps of folds,
        changes of the class of a boundary equilibrium, neutral saddles of homoclinic orbits. It ends where
        its solutions become virtual. From a point of codimension two a tuple of the curves that leave it,
        without the one on which it was found.

    Raises
    ------
    DefinitionError
        No event of a branch that two parameters unfold; parameters that are not two of the system.
    OptionError
        Bounds in the wrong order, or without the event; ``step`` or ``max_points`` out of its range;
        parameters that break the symmetry by which half of an orbit is solved for.
    ConvergenceError
        The event does not solve the equations of its curve.

    Examples
    --------
    The cusp $x' = a + b x - x^3$: folds lie on $4 b^3 = 27 a^2$.

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, a, b = (ca.SX.sym(s) for s in ("x", "y", "a", "b"))
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[a + b * x - x**3, 1 - y], below=[1, 1],
    ...                       parameters={a: -1.0, b: 0.75})
    >>> branch = ns.continue_equilibrium(s, [-1.5, 1.0], "a", bounds=(-2, 2))
    >>> curve = continue_bifurcation(branch.events[0], ("a", "b"), bounds=[(-1, 1), (-1, 1)])
    >>> bool(abs(4 * curve.values[:, 1]**3 - 27 * curve.values[:, 0]**2).max() < 1e-11)
    True
    >>> [point.kind for point in curve.special], abs(curve.special[0].values).max().round(6)
    (['cusp'], np.float64(0.0))
    """
    if isinstance(event, Connection):
        event = event_of(event)
    names, widths, limits = _checked(event, parameters, bounds)
    positive(step, "step")
    whole(max_points, "max_points", least=2)
    bar = progress_bar(None, progress, " points")

    follow = partial(_follow, limits=limits, step=step, most=max_points, report=bar.update)
    try:
        if isinstance(event, CodimensionTwo):
            assert event.meeting is not None
            found = leaving(event.meeting, _free(event.meeting.base, names), widths)
            return tuple(
                _curve_of(kind, names, [[(curve, Arc(half[0][1].points[:1], end="event"))], half])
                for kind, curve, departure in found
                for half in [follow(departure)]
            )
        assert event.point is not None
        base, start = event.curve.begun_later(event.point.u)
        base, start = base.freed(start, _free(base, names), widths)
        curve: EventCurve | ConnectionCurve
        if isinstance(base, ConnectionCurve):  # its equations are of codimension one
            curve = base
        else:
            curve = EventCurve(base, event.test, start)
            start = curve.start
        start = _on_curve(curve, start, event.kind)
        halves, tangent = list[list[Piece]](), directions(curve, start)[0]
        for way in (-tangent, tangent):
            if halves and halves[0][-1][1].end in ("closed", "interrupted"):
                break
            halves.append(follow(Departure(curve, [start], way)))
    finally:
        bar.close()
    return _curve_of(event.kind, names, halves)


def _follow(departure: Departure, **options: Any) -> list[Piece]:
    """Follow a curve from its start, in pieces between which legs of orbits are divided."""

    def following(at: Departure, arc: Arc) -> Departure | None:
        last = arc.points[-1]
        if arc.end not in _DIVISIBLE or not isinstance(at.curve, EventCurve):
            return None
        try:
            return at.curve.again(last.u, last.tangent)
        except (NonsmoothError, np.linalg.LinAlgError):
            return None

    every, most = list[Piece](), options.pop("most")

    def follow(at: Departure) -> Arc:
        left = most - sum(len(arc.points) - 1 for _, arc in every)  # pieces share their ends
        return _traced(at, most=left, **options)

    for at, arc in pieces(
        departure, follow, following, last=lambda arc: arc.end in _WHOLE, apart=0.0
    ):
        every.append((cast("EventCurve | ConnectionCurve", at.curve), arc))
    curve, arc = every[-1]
    located = bool(arc.zeros) and arc.zeros[-1].name == arc.end
    if isinstance(curve, EventCurve) and (located or arc.end in _DIVISIBLE):
        limit = curve.comes_to(arc.points[-1].u)
        # an extremum beside a saddle is so flat that a second one is seen
        if limit == "Hopf" or (limit and arc.end in (SECOND, *_DIVISIBLE)):
            arc.zeros[:] = [
                *arc.zeros[: len(arc.zeros) - located],
                Zero(limit if limit == "Hopf" else AT_SADDLE, arc.points[-1], 0.0),
            ]
        if limit == "Hopf" or not located or arc.zeros[-1].name == AT_SADDLE:
            arc.end = limit or arc.end
            _drop_singular(arc)
    return every


def _traced(
    departure: Departure,
    *,
    limits: Sequence[tuple[float, float]],
    step: float,
    most: int,
    report: Callable[[], None],
) -> Arc:
    """Follow a curve with the same equations."""
    curve = departure.curve
    assert isinstance(curve, (EventCurve, ConnectionCurve))
    u = departure.rows[-1]
    curve.base.restart(curve.without(u) if isinstance(curve, EventCurve) else u)
    if isinstance(curve, EventCurve):
        curve.secant.forget()
    k = departure.rows[-1].size - 2
    arc = trace(
        curve,
        departure.rows,
        departure.tangent,
        step=step,
        most=most,
        bounds=[(k + i, low, high) for i, (low, high) in enumerate(limits)],
        report=lambda _: report(),
    )
    _drop_singular(arc)
    if arc.end == VIRTUAL and len(arc.points) > 1:
        arc.points.pop()
        last = arc.points[-1].arclength
        arc.zeros[:] = [zero for zero in arc.zeros if zero.point.arclength <= last]
    return arc


def _free(curve: BranchCurve, names: Sequence[str]) -> tuple[int, ...]:
    return tuple(curve.system.parameter_names.index(name) for name in names)


def _curve_of(kind: str, names: tuple[str, str], halves: list[list[Piece]]) -> BifurcationCurve:
    """The curve of two halves from one point, or of one that is closed."""
    nodes, zeros = list[Node](), list[tuple[EventCurve | ConnectionCurve, Zero]]()
    for half in halves:
        nodes.reverse()
        zeros.reverse()
        for curve, arc in half:
            nodes += [(curve, u) for u in (arc.rows[1:] if nodes else arc.rows)]
            zeros += [(curve, zero) for zero in arc.zeros]
        if isinstance(curve, EventCurve) and arc.end not in _WHOLE:
            curve.limits.append(arc.rows[-1])
    for at, u in (nodes[0], nodes[-1]):
        at.base.require_valid(u if isinstance(at, ConnectionCurve) else at.without(u))
    located = [special_point(at, zero, kind) for at, zero in zeros if _occurs(at, zero)]
    return BifurcationCurve(
        kind=kind,
        parameters=names,
        values=np.array([u[-2:] for _, u in nodes]),
        special=tuple(_merged([point for point in located if point is not None])),
        ends=(end_of(halves[0][-1][1]), end_of(halves[-1][-1][1])),
        nodes=tuple(nodes),
    )


def _drop_singular(arc: Arc) -> None:
    """Drop zeros beside the end of an arc, where legs vanish and the equations become singular."""
    if not arc.zeros or arc.zeros[-1].name != arc.end:
        return
    last = arc.zeros[-1]
    away = lambda zero: float(np.abs(zero.point.u[-2:] - last.point.u[-2:]).max())
    arc.zeros[:] = [zero for zero in arc.zeros if zero is last or away(zero) > _MERGED]


def _occurs(curve: EventCurve | ConnectionCurve, zero: Zero) -> bool:
    if isinstance(curve, ConnectionCurve):
        return True
    u = curve.without(zero.point.u)
    if zero.name == "fold" and isinstance(curve.base, OrbitCurve):
        durations = curve.problem.split(u[: curve.problem.size])[1]
        if durations.min() < _NO_LEG * durations.sum():  # the equations are singular
            return False
    return curve.base.occurs(zero.name, u)


def _merged(points: Sequence[CodimensionTwo]) -> list[CodimensionTwo]:
    """Points in their order, without repeated ones."""
    found = list[CodimensionTwo]()
    for point in points:
        near = [one for one in found if np.abs(one.values - point.values).max() <= _MERGED]
        if not any(_like(one, point) for one in near):
            found.append(point)
    return found


def _like(one: CodimensionTwo, other: CodimensionTwo) -> bool:
    """Whether two points at the same parameters have the same equations and unknowns."""
    a, b = one.meeting, other.meeting
    if a is None or b is None or a.u.size != b.u.size:
        return one.kind == other.kind
    return bool(np.abs((a.u - b.u) / a.base.scale).max() <= _MERGED)


def _checked(
    event: BranchEvent | CodimensionTwo,
    parameters: Sequence[str],
    bounds: Sequence[Sequence[float]],
) -> tuple[tuple[str, str], Array, list[tuple[float, float]]]:
    if isinstance(event, CodimensionTwo) and event.meeting is not None:
        curve, u = event.meeting.base, event.meeting.u
    elif isinstance(event, BranchEvent) and event.curve is not None and event.test:
        assert event.point is not None
        curve, u = event.curve, event.point.u
    else:
        raise DefinitionError(
            f"event={event!r} is no entry of Branch.events that two parameters unfold, and no point from which "
            "curves leave. Continue an equilibrium or an orbit first."
        )
    known = curve.system.parameter_names
    given = [parameters] if isinstance(parameters, str) else parameters
    names = [str(name) for name in given] if isinstance(given, Iterable) else []
    if len(names) != 2 or len(set(names)) != 2 or not set(names) <= set(known):
        raise DefinitionError(
            f"parameters={parameters!r} are not two names of the system's. Give two among {list(known)}."
        )
    if not isinstance(bounds, (Sequence, np.ndarray)) or len(bounds) != 2:
        raise OptionError(
            f"bounds={bounds!r} are not two pairs. Give (low, high) for each parameter."
        )
    values = curve.parameters_at(u)
    limits = [
        check_bounds(pair, float(values[known.index(name)]), name)
        for pair, name in zip(bounds, names, strict=True)
    ]
    return (names[0], names[1]), np.array([high - low for low, high in limits]), limits


def _on_curve(curve: Curve, start: Array, kind: str) -> Array:
    """The event as a point of the curve, to rounding."""
    _, jacobian = curve.scaled(start / curve.scale)
    found = curve.correct(start, np.linalg.svd(jacobian)[2][-1])
    if found is None:
        raise ConvergenceError(
            f"event: Newton's method for the curve does not converge at the {kind}. It may be of "
            "codimension two itself, or the second parameter does not unfold it: choose others.",
            point=start,
        )
    return found
