"""Dividing surfaces of two-folds, as curves in a plane of starts.

Orbits from a dividing surface have one itinerary up to a deciding point: a two-fold into which they slide, or a
grazing of the switching surface. Neighbours continue on either side of it. With the itinerary fixed this
condition is a smooth function of the start, so an arc is continued like any curve. It ends where its
itinerary ceases to be admissible, and the next arc begins there. Two kinds are computed:

- orbits end at an *event* at which both fields agree across the surface (a contact that opens: with the
  load its friction vanishes). They end on one side of the surface, on the other, or in it;
- orbits continue, and a *two-fold* divides them: beside it they leave to either side. Where they do not slide
  into it they are divided by grazing, into those that miss the surface and those that cross it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise, product
from typing import Any, Protocol

import numpy as np

from ...flow.follow import follow
from ...flow.saving import Savable, savable
from ...flow.simulate import simulate
from ...flow.trajectory import Trajectory
from ...local.point.surface_point import Numbers, surface_at
from ...local.searches.find_two_fold import TwoFold
from ...model import (
    Array,
    ConvergenceError,
    DegenerateError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    Parameters,
    StartMap,
)
from ...model.derivatives.event_maps import function_map
from ...result_tables import ResultTable, joined
from ...solvers.continuation import (
    Arc,
    Curve,
    Departure,
    Secant,
    Values,
    changes_around,
    converge,
    depart,
    directions,
    pieces,
    trace,
)
from ..runs.guards import change_violation
from ..runs.itinerary import Arrival, FixedItinerary, leg_between, read_word
from .two_fold_sheet import Meeting, TwoFoldSheet

# Arcs ---------------------------------------------------------------------------------------------

#: Radius of the circle that is searched for the arcs that leave a point, in scaled coordinates.
_CIRCLE = 1e-3

#: Ends of a curve; after any other end another arc may follow.
_ENDS = ("reach", "rest", "bound", "closed", "interrupted")

#: Error of a junction, and the most steps of Newton's method.
_JUNCTION, _STEPS = 1e-13, 8


@dataclass(frozen=True, eq=False)
class Passage:
    """The deciding point of the orbit of a start with a fixed itinerary.

    Attributes
    ----------
    x : ndarray (n,)
        State there.
    t, entry : float
        Time there, and at the beginning of the last leg.
    value : float
        The condition, zero on an arc of this itinerary.
    corner : ndarray (2,)
        Two conditions, zero where an arc that grazes the surface meets one that slides into a two-fold.
    fault : str
        Why the orbit is not admissible; empty if it is.
    slope, corner_slope : ndarray (1, 2), (2, 2), optional
        Derivatives of ``value`` and ``corner`` by the coordinates of the plane.
    """

    x: Array
    t: float
    entry: float
    value: float
    corner: Array
    fault: str
    slope: Array | None = None
    corner_slope: Array | None = None


class Passages(Protocol):
    """Orbits of a plane of starts."""

    @property
    def scale(self) -> Any:
        """Sizes of the coordinates of the plane: a number, or one for each of the two."""

    @property
    def exact(self) -> bool:
        """Whether passages come with derivatives."""

    def passage(self, u: Array, itinerary: str) -> Passage:
        """The orbit from a start (2,) with a fixed itinerary, one letter for each leg."""
        ...

    def simulated(self, u: Array) -> str:
        """The itinerary of a simulation; its last letter is the side on which the orbit continues."""
        ...


@savable(points="k 2", entry="k", t="k", decided="k n", starts="k n | 0 0")
@dataclass(frozen=True, eq=False, repr=False)
class DividingArc:
    """Starts of one itinerary on a dividing surface.

    Attributes
    ----------
    itinerary : str
        Modes up to where the side is decided: ``"+ s"`` slides into a two-fold, ``"+"`` grazes the
        surface.
    points : ndarray (k, 2)
        Coordinates in the plane of starts, along the arc.
    entry, t : ndarray (k,)
        Times at which the last leg begins (at the first point, of the arc before), and at which it
        ends.
    decided : ndarray (k, n)
        States there: points of the two-fold set, or of grazing.
    begin, end : str
        Why the arc begins and ends: ``"junction"`` with an arc of the other kind, ``"bound"`` of the
        box, ``"closed"``, ``"interrupted"``, ``"lost"`` where no orbit of the itinerary is found beyond
        (such as where starts cross the surface), or the condition that fails. ``begin`` is empty where
        the computation started.
    starts : ndarray (k, n)
        The states of ``points``; may be empty.
    """

    itinerary: str
    points: Array
    entry: Array
    t: Array
    decided: Array
    end: str
    begin: str = ""
    starts: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def kind(self) -> str:
        """``"two-fold"`` or ``"grazing"``."""
        return "two-fold" if self.itinerary.endswith("s") else "grazing"

    def reversed(self) -> DividingArc:
        """The same arc from its other end."""
        rows = (self.points, self.entry, self.t, self.decided, self.starts)
        points, entry, t, decided, starts = (row[::-1] for row in rows)
        return DividingArc(self.itinerary, points, entry, t, decided, self.begin, self.end, starts)

    def __repr__(self) -> str:
        return f"DividingArc({self.itinerary!r}, {len(self.points)} points, {self.end})"


class StartCurve(Curve):
    """Starts of one itinerary on a dividing surface, for continuation.

    Parameters
    ----------
    passages : Passages
    itinerary : str
        One letter for each leg.
    out : callable, optional
        The reason to end the curve at a start; empty to continue.
    tol : float, optional
        Error of a point, in scaled coordinates.
    """

    snaps = True

    def __init__(
        self,
        passages: Passages,
        itinerary: str,
        out: Callable[[Array], str] | None = None,
        tol: float = 1e-13,
    ):
        self.passages, self.itinerary, self.leaves, self.tol = passages, itinerary, out, tol
        self.scale, self.exact = passages.scale, passages.exact
        self.known: dict[bytes, Passage] = {}
        self.secant = None if self.exact else Secant(self._condition, float(passages.scale))

    def equations(self, u: Array) -> tuple[Array, Array]:
        if self.secant is not None:
            return self.secant(u)
        found = self.passage(u)
        assert found.slope is not None
        return np.array([found.value]), found.slope

    def _condition(self, u: Array) -> Array:
        return np.array([self.passage(u).value])

    def passage(self, u: Array) -> Passage:
        """The passage of a start, computed once for each."""
        key = u.tobytes()
        if key not in self.known:
            self.known[key] = self.passages.passage(u, self.itinerary)
        return self.known[key]

    def fault(self, u: Array) -> str:
        return self.passage(u).fault

    def out(self, u: Array) -> str:
        return "" if self.leaves is None else self.leaves(u)

    def snap(self, u: Array, tangent: Array, reach: float) -> Array | None:
        """The junction ahead of an arc that slides and an arc that grazes."""
        free = self.itinerary.rstrip("s")
        if free == "" or free[-1] == "s":
            return None

        def corner(v: Array) -> Array:
            return self.passages.passage(v, free).corner

        def with_slope(v: Array) -> tuple[Array, Array]:
            found = self.passages.passage(v, free)
            assert found.corner_slope is not None
            return found.corner, found.corner_slope

        guess = u + 0.5 * reach * tangent * self.scale
        root = (
            joint_root(corner, guess, float(self.scale), _JUNCTION, _STEPS)
            if self.secant is not None
            else converge(with_slope, guess, tol=_JUNCTION, max_iterations=_STEPS)
        )
        if root is None:
            return None
        step = (root - u) / self.scale
        return root if np.linalg.norm(step) < 2 * reach and step @ tangent > 0 else None

    def directions(self, u: Array) -> list[Array]:
        """Both directions of the curve at a start."""
        if self.secant is not None:
            self.secant.forget()
        return directions(self, u)


def joint_root(
    values: Values, guess: Array, scale: float, tol: float, max_iterations: int
) -> Array | None:
    """Root of two conditions near a guess, by differences.

    Parameters
    ----------
    values : callable
    guess : ndarray (2,)
    scale : float
        Size of the coordinates.
    tol : float
    max_iterations : int
    """
    return converge(
        Secant(values, scale), guess, tol=tol, scale=scale, max_iterations=max_iterations
    )


@dataclass(eq=False)
class DividingTracer:
    """Continuation of a dividing surface in a plane of starts from arc to arc.

    Each arc is continued by :mod:`nonsmooth.continuation`. Where its itinerary ceases to be admissible
    the end is located, and a junction is solved for. The next itinerary is the common beginning of
    simulations on a small circle on both sides of the curve.

    Parameters
    ----------
    passages : Passages
    step : float
        Largest step on bent arcs, in scaled coordinates.
    out : callable, optional
        The reason to end the curve at a start; empty to continue.
    first : callable, optional
        The first step of an arc from its start.
    bounds : sequence of (index, low, high), optional
        Bounds of coordinates at which the curve ends, exactly.
    """

    passages: Passages
    step: float
    out: Callable[[Array], str] | None = None
    first: Callable[[Array], float] | None = None
    bounds: Sequence[tuple[int, float, float]] = ()

    def arcs(
        self, itinerary: str, rows: list[Array], initial: str | None = None
    ) -> Iterator[DividingArc]:
        """Arcs of the curve, each beginning where the last one ends.

        Parameters
        ----------
        itinerary : str
            Itinerary of the first arc, one letter for each leg.
        rows : list of ndarray (2,)
            At least two points of it.
        initial : str, optional
            Itinerary of its first point, if different.
        """
        step = (rows[-1] - rows[-2]) / self.passages.scale
        start = Departure(self._curve(itinerary), rows, step / float(np.linalg.norm(step)))
        before = self.passages.passage(rows[0], itinerary if initial is None else initial)
        begin = ""
        for departure, arc in pieces(
            start, self._trace, self._following, last=lambda arc: arc.end in _ENDS
        ):
            assert isinstance(departure.curve, StartCurve)
            made, before = self._made(departure.curve, arc, before)
            yield replace(made, begin=begin)
            begin = made.end

    def _curve(self, itinerary: str) -> StartCurve:
        return StartCurve(self.passages, itinerary, self.out)

    def _trace(self, departure: Departure) -> Arc:
        first = 0.0 if self.first is None else self.first(departure.rows[-1])
        return trace(
            departure.curve,
            departure.rows,
            departure.tangent,
            step=self.step,
            first=first or self.step,
            bounds=self.bounds,
        )

    def _following(self, before: Departure, arc: Arc) -> Departure | None:
        """The next arc: its itinerary, first two points and tangent."""
        assert isinstance(before.curve, StartCurve)
        itinerary, u, tangent = before.curve.itinerary, arc.points[-1].u, arc.points[-1].tangent
        joined = itinerary[:-1] if itinerary.endswith("s") else itinerary + "s"
        ways = self._ways(joined, u) if arc.end == "junction" else []
        for new, direction in chain(((joined, d) for d in ways), self._round(u, tangent)):
            found = depart(self._curve(new), u, direction, _CIRCLE, tangent)
            if found is not None:
                return found
        return None

    def _ways(self, itinerary: str, u: Array) -> list[Array]:
        """Directions of an arc at its junction; none if its last leg cannot be integrated there."""
        try:
            return self._curve(itinerary).directions(u)
        except NonsmoothError:
            return []

    def _round(self, u: Array, tangent: Array) -> Iterator[tuple[str, Array]]:
        """Itineraries and directions in which the curve leaves a point, on a small circle."""

        def ahead(angle: float) -> str:
            way = np.array([np.cos(angle), np.sin(angle)])
            return self.passages.simulated(u + _CIRCLE * self.passages.scale * way)

        straight = float(np.arctan2(tangent[1], tangent[0]))
        for angle, a, b in changes_around(ahead, _last_side, straight):
            common = _common_start(a, b)
            if common:
                yield common, np.array([np.cos(angle), np.sin(angle)])

    def _made(self, curve: StartCurve, arc: Arc, first: Passage) -> tuple[DividingArc, Passage]:
        """A DividingArc, and the passage of its last point."""
        itinerary, points = curve.itinerary, arc.rows
        joins = arc.end == "junction"
        inner = [curve.passage(u) for u in points[1:-1]]
        # At a junction the last sliding leg has no length.
        last = (
            self.passages.passage(points[-1], itinerary.rstrip("s"))
            if joins
            else curve.passage(points[-1])
        )
        after = last
        if joins and itinerary.endswith("s"):
            last = replace(last, entry=last.t)
        row = [first, *inner, last]
        made = DividingArc(
            " ".join(itinerary),
            np.array(points),
            np.array([p.entry for p in row]),
            np.array([p.t for p in row]),
            np.array([p.x for p in row]),
            arc.end,
        )
        return made, after


def _last_side(itinerary: str) -> int:
    """The side on which an itinerary ends: 1, -1, or 0 while it slides."""
    return {"+": 1, "-": -1}.get(itinerary[-1:], 0)


def _common_start(a: str, b: str) -> str:
    """The common beginning of two itineraries."""
    differ = (k for k, (p, q) in enumerate(zip(a, b, strict=False)) if p != q)
    return a[: next(differ, min(len(a), len(b)))]


# Orbits of a plane of starts up to where their side is decided ------------------------------------

#: Tolerance of the relative distance of a two-fold from its event, and of the sine of the angle between
#: the zeros there of the event's function and of the difference of the fields.
_AT_EVENT = 1e-7


def require_event(
    system: FilippovSystem, until: object, fold: TwoFold, parameters: dict[str, float]
) -> None:
    """Raise unless both fields have the same component across the surface at an event."""
    names = [name for name, _ in system.stops]
    if until not in names:
        raise OptionError(
            f"until={until!r} is no stop of the system, which has {names}. Define it with "
            "stops=[nonsmooth.Stop(function, name=...)]."
        )
    event = system.definition.guards[names.index(until)]
    jump = system.lie_derivative("+") - system.lie_derivative("-")
    p = system.parameter_vector(parameters)
    at, gap = (function_map(system, "+", of)(fold.point, p) for of in (event, jump))
    sizes = np.array([np.linalg.norm(row.gradient) for row in (at, gap)])
    unit = np.array([at.gradient, gap.gradient]) / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    aside = abs(at.value) / (sizes[0] or 1.0) / (1.0 + float(np.linalg.norm(fold.point)))
    angle = float(np.linalg.svd(unit)[1][1])
    if not sizes.min() > 0.0 or aside > _AT_EVENT or angle > _AT_EVENT:
        raise DegenerateError(
            f"of: at the two-fold {fold.point.round(9).tolist()} the function of the event {until!r} is "
            f"{at.value:.3g}, and its zeros make the angle {angle:.3g} with those at which both fields have "
            "the same component across the surface; both must be 0. Drop until where orbits continue."
        )


def read_begin(system: FilippovSystem, begin: Any) -> list[tuple[str, Array]]:
    """Points of a curve with their itineraries, one letter for each leg."""
    if begin is None:
        return []
    try:
        pairs = [
            ("".join(read_word(system, itinerary)), np.array(u, dtype=float))
            for itinerary, u in begin
        ]
    except (TypeError, ValueError):
        pairs = []
    if len(pairs) < 2 or any(u.shape != (2,) or not np.isfinite(u).all() for _, u in pairs):
        raise OptionError(
            f"begin={begin!r}, but it needs two or more points, each as an itinerary and two coordinates. "
            "For example begin=[('+ s', (0.1, -0.5)), ('+ s', (0.11, -0.5))]."
        )
    return pairs


#: Time and state (n,) at which an orbit begins, and the derivatives (n, 2) of the state by the coordinates
#: of the plane, or None.
Start = tuple[float, Array, Array | None]


@dataclass(frozen=True)
class ComputedStarts:
    """Starts of orbits without a formula, such as the ends of other runs.

    Attributes
    ----------
    function : callable
        Takes coordinates (2,) and returns the time and the state (n,) at which an orbit begins.
    scale : float
        Size of the coordinates: the unit of spacings, and of steps for differences.

    Examples
    --------
    Starts that a body reaches after a free flight of the duration 1:

    >>> starts = ComputedStarts(lambda u: (1.0, [u[0], u[1] - 1.0, 0.0]), scale=1.0)
    >>> starts(np.array([0.5, 3.0]))
    (1.0, array([0.5, 2. , 0. ]), None)
    """

    function: Callable[[Array], Any]
    scale: float = 1.0

    def __call__(self, u: Array) -> Start:
        t, x = self.function(u)
        return float(t), np.asarray(x, dtype=float), None


class EventPassages:
    """Orbits that end at an event at which both fields have the same component across the surface.

    Parameters
    ----------
    system : FilippovSystem
        With one surface.
    until : str
        Name of the event: a stop.
    start : callable
        Takes coordinates (2,) of the plane and returns where the orbit begins.
    scale : float
        Size of the coordinates.
    parameters, tol, t_max : optional
        As of :class:`FixedItinerary`.
    exact : bool, optional
        Whether ``start`` gives derivatives.
    """

    def __init__(
        self,
        system: FilippovSystem,
        until: str,
        start: Callable[[Array], Start],
        scale: Any,
        *,
        parameters: Parameters | None = None,
        tol: float = 1e-13,
        t_max: float = 1000.0,
        exact: bool = True,
    ):
        self.system, self.until, self.start, self.scale = system, until, start, scale
        self.tol, self.t_max, self.exact = tol, t_max, exact
        self.parameters = parameters
        self._itineraries: dict[str, FixedItinerary] = {}

    def itinerary(self, itinerary: str) -> FixedItinerary:
        """The map of an itinerary to the event."""
        if itinerary not in self._itineraries:
            self._itineraries[itinerary] = FixedItinerary(
                self.system,
                itinerary,
                until=self.until,
                parameters=self.parameters,
                tol=self.tol,
                t_max=self.t_max,
            )
        return self._itineraries[itinerary]

    def numbers(self, x: Array, t: float = 0.0) -> Numbers:
        """h, L1, L2 and their gradients at a state."""
        where, extended = surface_at(self.system, x, self.parameters, t)
        return where.at(extended)

    def passage(self, u: Array, itinerary: str) -> Passage:
        """The orbit from a start to the event; its value is L1 + L2 after sliding, else h.

        Parameters
        ----------
        u : ndarray (2,)
            Coordinates of the start.
        itinerary : str
            One letter for each leg; a last leg of sliding is not left before the event.
        """
        t, x, slope = self.start(u)
        fixed = self.itinerary(itinerary)
        arrival = fixed.arrive(x, t)
        by_start = None if slope is None else fixed.derivative(arrival)[1] @ slope
        found = self.decided(arrival, itinerary, by_start)
        if _last_side(itinerary[0]) * self.numbers(x, t).h < 0.0:
            return replace(found, fault="the start is on the wrong side of the surface")
        return found

    def seed(self, u: Array, itinerary: str) -> None:
        """Do nothing: passages to events need no preparation.

        Parameters
        ----------
        u : ndarray (2,)
        itinerary : str
        """

    def decided(self, arrival: Arrival, itinerary: str, by_start: Array | None = None) -> Passage:
        """The passage at the end of an orbit; one that slides there must be at a visible two-fold.

        Parameters
        ----------
        arrival : Arrival
        itinerary : str
        by_start : ndarray (n, 2), optional
            Derivatives of its end by the coordinates of the plane.
        """
        at, slides, fault = self.numbers(arrival.x, arrival.t), itinerary[-1] == "s", arrival.fault
        second = at.second
        if slides and not second["L11"] > 0 > second["L22"]:
            fault = fault or "the two-fold at its end is not visible"
        corner = np.array([at.h, at.lie.mean()])
        slopes = None
        if by_start is not None:
            n = self.system.dimension
            rows = np.array([at.gradient[:n], at.lie_gradients.mean(axis=0)[:n]])
            slopes = rows @ by_start
        which = int(slides)
        return Passage(
            arrival.x,
            arrival.t,
            arrival.entry,
            float(corner[which]),
            corner,
            fault,
            None if slopes is None else slopes[which : which + 1],
            slopes,
        )

    def simulated(self, u: Array) -> str:
        """The itinerary of a simulation to the event, one letter for each leg."""
        t, x, _ = self.start(u)
        run = simulate(
            self.system,
            x,
            t + self.t_max,
            t_start=t,
            parameters=self.parameters,
            tol=max(self.tol, 1e-12),
        )
        return run.itinerary.replace(" ", "")


class _TwoFoldPassages:
    """Orbits that two-folds divide."""

    exact = True

    def __init__(
        self,
        system: FilippovSystem,
        sheet: TwoFoldSheet,
        start: Callable[[Array], Start],
        scale: Any,
        duration: float,
        *,
        parameters: Parameters | None = None,
        tol: float = 1e-13,
    ):
        self.system, self.sheet, self.start, self.scale = system, sheet, start, scale
        self.duration, self.parameters, self.tol = duration, parameters, tol
        self._meetings: dict[str, Meeting] = {}

    def passage(self, u: Array, itinerary: str) -> Passage:
        """The orbit from a start."""
        return self._slides(u, itinerary) if itinerary.endswith("s") else self._grazes(u, itinerary)

    def simulated(self, u: Array) -> str:
        """The itinerary of a simulation, one letter for each leg."""
        return self._run(u).itinerary.replace(" ", "")

    def _run(self, u: Array) -> Trajectory:
        tol = max(self.tol, 1e-12)
        return simulate(
            self.system, self.start(u)[1], self.duration, parameters=self.parameters, tol=tol
        )

    def seed(self, u: Array, itinerary: str) -> None:
        """Guess from a simulation beside a dividing surface where orbits meet the sheet."""
        run, legs = self._run(u), len(itinerary)
        if len(run.events) < legs or not itinerary.endswith("s"):
            return
        entry = run.events[legs - 2] if legs > 1 else None
        leaves = run.events[legs - 1]
        start = (run.t[0], run.x[0]) if entry is None else (entry.t, entry.x_after)
        self._meetings[itinerary] = self.sheet.guess(start[1], leaves.x, leaves.t - start[0])

    def _fixed(self, itinerary: str, until: object) -> FixedItinerary:
        return FixedItinerary(
            self.system,
            itinerary,
            until,
            parameters=self.parameters,
            tol=self.tol,
            t_max=self.duration,
        )

    def _slides(self, u: Array, itinerary: str) -> Passage:
        _, x, slope = self.start(u)
        assert slope is not None
        entry, fault, by_start = 0.0, "", slope
        if len(itinerary) > 1:
            fixed = self._fixed(itinerary[:-1], "h0")
            arrival = fixed.arrive(x)
            by_start = fixed.derivative(arrival)[1] @ slope
            x, entry = arrival.x, arrival.t
            fault = arrival.fault or self._entry_violation(itinerary, x)
        reached = self.sheet.meet(x, self._meetings.get(itinerary))
        self._meetings[itinerary] = reached
        return Passage(
            reached.fold,
            entry + reached.duration + reached.left,
            entry,
            reached.gap,
            np.full(2, np.nan),
            fault or reached.fault,
            (reached.slope @ by_start)[None, :],
        )

    def _entry_violation(self, itinerary: str, x: Array) -> str:
        leg, p = leg_between(self.system, itinerary[-2], "s"), self.sheet.parameters
        return change_violation(self.system, leg, "s", x, x, p)

    def _grazes(self, u: Array, itinerary: str) -> Passage:
        """The passage of an orbit whose last leg turns back from the surface: h is least there."""
        _, x, slope = self.start(u)
        assert slope is not None
        fixed = self._fixed(itinerary, self._lie(itinerary[-1]))
        arrival = self._turned(fixed, fixed.arrive(x), itinerary[-1])
        by_start = fixed.derivative(arrival)[1] @ slope
        at = self.sheet.where.at(arrival.x)
        other = 1 if itinerary[-1] == "+" else 0
        corner = np.array([at.h, at.lie[other]])
        slopes = np.array([at.gradient, at.lie_gradients[other]]) @ by_start
        fault = arrival.fault
        sign = 1.0 if itinerary[-1] == "+" else -1.0
        if not sign * at.lie[other] < 0.0:
            fault = fault or "an orbit that reaches the surface slides there and does not cross it"
        return Passage(arrival.x, arrival.t, arrival.entry, at.h, corner, fault, slopes[:1], slopes)

    def _lie(self, letter: str) -> Any:
        return self.system.lie_derivative(letter)

    def _turned(self, fixed: FixedItinerary, arrival: Arrival, letter: str) -> Arrival:
        """The same orbit up to the turn nearest to the surface."""
        start, t = arrival.starts[-1], arrival.entry
        run = follow(
            self.system,
            start,
            t + self.duration,
            mode=letter,
            watch=[self._lie(letter)],
            t_start=t,
            parameters=self.parameters,
            tol=self.tol,
        )
        sign = 1.0 if letter == "+" else -1.0
        turns: list[tuple[float, float, Array]] = []
        for event in run.events:
            if event.name != "f0" or event.kind != "zero":
                continue
            at = self.sheet.where.at(event.x)
            if sign * at.second["L11" if sign > 0 else "L22"] > 0.0:
                turns.append((abs(at.h), event.t, event.x))
        if not turns:
            raise ConvergenceError(
                f"duration: the leg in mode {letter!r} from {np.array2string(start, precision=6)} does not "
                f"turn back from the surface within {self.duration:g}. Give a longer duration."
            )
        _, end, x = min(turns, key=lambda turn: turn[0])
        fault = arrival.fault
        if end != arrival.t:
            last = fixed.leg(letter, t, start, (), t_end=end)
            fault = fixed.inside(last, f"leg {len(arrival.legs)} ({letter})")
        durations = (*arrival.durations[:-1], end - t)
        return replace(arrival, x=x, t=end, fault=fault, durations=durations)


#: Cells across the box whose edges are searched for curves, and halvings of an edge.
_CELLS, _HALVINGS = 8, 26

#: Attributes of an arc with one row for each point.
_ROWS = ("points", "entry", "t", "decided")

#: Distance of the first point from the one where an edge crosses a curve, in scaled coordinates.
_BESIDE = 1e-3

#: First step of a curve from a given beginning, relative to the distance from it, and the distance from
#: it at which the curve is closed.
_FIRST, _APART = 0.2, 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class DividingCurves(Savable, point="n"):
    """Intersections of a plane of starts with a dividing surface of two-folds.

    Attributes
    ----------
    stable : bool
        Whether orbits that enter the two-folds divide (True), or those that leave them, backward in
        time.
    point : ndarray (n,)
        The given two-fold.
    curves : list of list of DividingArc
        Curves in the plane, each as arcs that follow each other.
    complete : bool
        False if the computation was interrupted.
    """

    stable: bool
    point: Array
    curves: list[list[DividingArc]]
    complete: bool = True

    def _tables(self) -> dict[str, ResultTable]:
        names = ("points", "entry", "t", "decided")
        parts = [{name: getattr(arc, name) for name in names} for arc in self.arcs]
        return {"points": joined("arc", parts)}

    @property
    def arcs(self) -> list[DividingArc]:
        """The arcs of all curves."""
        return [arc for curve in self.curves for arc in curve]

    @property
    def junctions(self) -> Array:
        """Starts (k, 2) at which arcs that slide into a two-fold meet arcs that graze the surface."""
        found = [
            one.points[-1]
            for curve in self.curves
            for one, other in pairwise(curve)
            if "junction" in (one.end, other.begin)
        ]
        return np.array(found).reshape(-1, 2)

    def __repr__(self) -> str:
        arcs = "; ".join(
            ", ".join(f"{arc.itinerary!r} ({len(arc.points)})" for arc in curve)
            for curve in self.curves
        )
        cut = "" if self.complete else "; interrupted"
        point = self.point.round(6).tolist()
        return f"DividingCurves(of {point}: {len(self.curves)} with arcs {arcs}{cut})"


@dataclass(frozen=True)
class _Plane:
    """A plane of starts with a box in it."""

    start: Callable[[Array], Start]
    box: Array
    scale: Any
    exact: bool

    @property
    def size(self) -> float:
        """Size of the box in the phase space."""
        corners = np.array([self.start(np.array(u))[1] for u in product(*self.box)])
        return float(np.linalg.norm(corners - corners.mean(axis=0), axis=1).max()) or 1.0


def plane_of(system: FilippovSystem, starts: Any, box: Any) -> _Plane:
    """Read a plane of starts and its box."""
    try:
        limits = np.asarray(box, dtype=float)
    except (TypeError, ValueError):
        limits = np.zeros(0)
    if limits.shape != (2, 2) or not np.all(np.isfinite(limits) & (limits[:, :1] < limits[:, 1:])):
        raise OptionError(
            f"box={box!r}, but it needs the range (low, high) of each of the two coordinates of the plane. "
            "For example box=[(-1, 1), (0, 2)]."
        )
    if isinstance(starts, ComputedStarts):
        return _Plane(starts, limits, starts.scale, exact=False)
    states = StartMap(system, starts)
    half = np.asarray(limits[:, 1] - limits[:, 0]) / 2
    return _Plane(lambda u: (0.0, *states(u)), limits, half, exact=True)


def dividing_curves(
    system: FilippovSystem,
    fold: TwoFold,
    plane: _Plane,
    *,
    stable: bool,
    duration: float,
    step: float,
    until: str | None,
    begin: Sequence[tuple[str, Array]],
    parameters: dict[str, float],
    tol: float,
    report: Callable[[], object],
) -> DividingCurves:
    """Curves in a plane of starts that divide orbits beside two-folds."""
    _require_plain(system)
    passages: _TwoFoldPassages | EventPassages
    if until is None:
        sheet = TwoFoldSheet(system, fold.point, plane.size, parameters)
        passages = _TwoFoldPassages(
            system, sheet, plane.start, plane.scale, duration, parameters=parameters, tol=tol
        )
    else:
        passages = EventPassages(
            system,
            until,
            plane.start,
            plane.scale,
            parameters=parameters,
            tol=tol,
            t_max=duration,
            exact=plane.exact,
        )
    search = _Search(plane, passages, step, begin)
    curves, complete = list[list[DividingArc]](), True
    try:
        for curve in search.begun() if begin else search.curves():
            curves.append([_with_starts(arc, plane) for arc in curve])
            for _ in curve:
                report()
            if search.interrupted:
                complete = False
                break
    except KeyboardInterrupt:
        if not curves:
            raise
        complete = False
    if not curves:
        raise DegenerateError(
            f"starts: no dividing surface was found in the box {plane.box.tolist()} with the duration "
            f"{duration:g}. Move or widen the box, or give a duration at whose end orbits are on one side "
            "of the switching surface or the other."
        )
    return DividingCurves(stable, fold.point, curves, complete)


def _with_starts(arc: DividingArc, plane: _Plane) -> DividingArc:
    return replace(arc, starts=np.array([plane.start(u)[1] for u in arc.points]))


def _require_plain(system: FilippovSystem) -> None:
    """Raise unless itineraries of one surface describe all orbits."""
    whole = system.surface_count == 1 and not any(system.nonlinear)
    if whole and not system.resets and not system.impacts and not system.sets:
        return
    raise DegenerateError(
        f"system {system!r} has more than one surface, resets, impacts or hidden dynamics. Give one with "
        "one surface and none of these."
    )


class _Search:
    """Search for curves on the edges of cells, and their continuation."""

    def __init__(
        self,
        plane: _Plane,
        passages: _TwoFoldPassages | EventPassages,
        step: float,
        begin: Sequence[tuple[str, Array]] = (),
    ):
        self.plane, self.passages, self.begin = plane, passages, begin
        bounds = [(k, float(low), float(high)) for k, (low, high) in enumerate(plane.box)]
        self.tracer = DividingTracer(passages, step, bounds=bounds)
        if begin:
            self.tracer.out = lambda u: "closed" if self._from_begin(u) < _APART else ""
            self.tracer.first = lambda u: _FIRST * self._from_begin(u)
        self.traced: list[Array] = []
        self.interrupted = False

    def _from_begin(self, u: Array) -> float:
        return float(np.linalg.norm((u - self.begin[0][1]) / self.plane.scale))

    def begun(self) -> Iterator[list[DividingArc]]:
        """The curve through the given points, from the last of them."""
        itineraries, rows = [key for key, _ in self.begin], [u for _, u in self.begin]
        arcs = list[DividingArc]()
        try:
            for arc in self.tracer.arcs(itineraries[-1], rows, itineraries[0]):
                arcs.append(arc)
        except KeyboardInterrupt:
            if not arcs:
                raise
            self.interrupted = True
        self.interrupted = self.interrupted or arcs[-1].end == "interrupted"
        yield arcs

    def curves(self) -> Iterator[list[DividingArc]]:
        """Curves that cross edges whose corners have orbits that end on different sides."""
        axes = [np.linspace(low, high, _CELLS + 1) for low, high in self.plane.box]
        corners = {
            (i, j): np.array([axes[0][i], axes[1][j]])
            for i, j in product(range(_CELLS + 1), repeat=2)
        }
        labels = {key: self.passages.simulated(u) for key, u in corners.items()}
        for (i, j), one in labels.items():
            for other_key in ((i + 1, j), (i, j + 1)):
                other = labels.get(other_key, "")
                a, b = corners[i, j], corners.get(other_key, corners[i, j])
                if _last_side(one) * _last_side(other) >= 0 or self._crossed(a, b):
                    continue
                curve = self._crossing((a, one), (b, other))
                if curve:
                    self.traced += [arc.points for arc in curve]
                    yield curve

    def _crossed(self, a: Array, b: Array) -> bool:
        """Whether a curve that was traced crosses the edge between two corners."""
        return any(_crosses(points, a, b) for points in self.traced)

    def _crossing(self, one: tuple[Array, str], other: tuple[Array, str]) -> list[DividingArc]:
        """The curve that crosses an edge; none where sides do not change at a two-fold."""
        edge = (other[0] - one[0]) / self.plane.scale
        across = np.array([-edge[1], edge[0]]) / float(
            np.linalg.norm(edge)
        )  # corrected on the edge
        for _ in range(_HALVINGS):
            middle = 0.5 * (one[0] + other[0])
            label = self.passages.simulated(middle)
            side = _last_side(label)
            if side == 0:  # it slides to the end of the run
                break
            if side == _last_side(one[1]):
                one = middle, label
            else:
                other = middle, label
        itinerary = _common_start(one[1], other[1])
        if not itinerary:
            return []
        middle = 0.5 * (one[0] + other[0])
        try:
            self.passages.seed(one[0], itinerary)
            curve = StartCurve(self.passages, itinerary)
            u = curve.correct(middle, across)
            if u is None or curve.fault(u):
                return []
            return self._both_ways(curve, u, curve.directions(u))
        except NonsmoothError:
            return []

    def _both_ways(self, curve: StartCurve, u: Array, ways: list[Array]) -> list[DividingArc]:
        """Follow a curve from a point in both directions, as one."""
        halves: list[list[DividingArc]] = [[], []]
        try:
            for way, half in zip(ways, halves, strict=True):
                departure = depart(curve, u, way, _BESIDE, way)
                if departure is not None:
                    for arc in self.tracer.arcs(curve.itinerary, departure.rows):
                        half.append(arc)
                self.interrupted = bool(half) and half[-1].end == "interrupted"
                if self.interrupted or (half and half[-1].end == "closed"):
                    break
        except KeyboardInterrupt:
            if not any(halves):
                raise
            self.interrupted = True
        ahead, back = halves
        if not ahead or not back:
            return ahead or [arc.reversed() for arc in back[::-1]]
        joined = _joined(back[0].reversed(), ahead[0])
        return [*[arc.reversed() for arc in back[:0:-1]], joined, *ahead[1:]]


def _joined(one: DividingArc, other: DividingArc) -> DividingArc:
    """Two consecutive arcs of one itinerary as one."""
    pairs = ((getattr(arc, name) for arc in (one, other)) for name in _ROWS)
    points, entry, t, decided = (np.concatenate([a, b[1:]]) for a, b in pairs)
    return DividingArc(one.itinerary, points, entry, t, decided, other.end, one.begin)


def _crosses(points: Array, a: Array, b: Array) -> bool:
    """Whether a polyline (k, 2) crosses the segment from a to b."""
    along, normal = b - a, np.array([a[1] - b[1], b[0] - a[0]])
    side = (points - a) @ normal
    k = np.flatnonzero(side[:-1] * side[1:] <= 0.0)
    share = side[k] / np.where(side[k] == side[k + 1], 1.0, side[k] - side[k + 1])
    at = (points[k] + share[:, None] * (points[k + 1] - points[k]) - a) @ along / (along @ along)
    return bool(np.any((at >= -0.02) & (at <= 1.02)))
