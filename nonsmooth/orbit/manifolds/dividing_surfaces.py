"""Dividing surfaces cut by a plane of starts: where they are met, and the curves in the plane."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise, product
from typing import Any, Protocol

import numpy as np

from ...flow.follow import follow
from ...flow.saving import Savable, savable
from ...flow.simulate import simulate
from ...local.point.lie_derivatives import Numbers
from ...local.point.surface_point import place
from ...local.searches.two_fold import TwoFold
from ...model import (
    Array,
    ConvergenceError,
    DegenerateError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    Parameters,
    StartMap,
    explain,
)
from ...model.derivatives.event_maps import function_map
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
from ..runs.guards import change_fault
from ..runs.itinerary import Arrival, FixedItinerary, leg_between, read_word
from .two_fold_sheet import Meeting, TwoFoldSheet

# Arcs of a dividing surface cut by a plane of starts: curves in the plane, followed arc by arc.

#: Radius of the circle on which the arcs that leave a point are looked for, in scaled coordinates.
_CIRCLE = 1e-3

#: What a curve ends with; after anything else another arc may follow.
ENDS = ("reach", "rest", "bound", "closed", "interrupted")

#: A junction is solved for up to this error, in so many steps.
_JUNCTION, _STEPS = 1e-13, 8


@dataclass(frozen=True, eq=False)
class Passage:
    """Where the orbit of a start with a fixed itinerary is decided.

    Attributes
    ----------
    x : ndarray (n,)
        State there.
    t, entry : float
        Time of it, and of the beginning of the last leg.
    value : float
        What vanishes on an arc of this itinerary.
    corner : ndarray (2,)
        What vanishes where an arc that just touches the surface meets one that slides into a two-fold.
    fault : str
        Empty if an orbit really moves so, else why not.
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

    def passage(self, u: Array, word: str) -> Passage:
        """The orbit from a start (2,) with a fixed itinerary, one letter for each leg."""
        ...

    def simulated(self, u: Array) -> str:
        """The itinerary that a start really takes; its last letter says where the orbit goes on."""
        ...


@savable
@dataclass(frozen=True, eq=False, repr=False)
class DividingArc:
    """Starts of one itinerary on a dividing surface.

    Attributes
    ----------
    itinerary : str
        Modes up to where it is decided on which side orbits go on: ``"+ s"`` slides into a two-fold,
        ``"+"`` just touches the surface.
    points : ndarray (k, 2)
        Coordinates in the plane of starts, along the arc.
    entry, t : ndarray (k,)
        Times at which the last leg begins (at the first point, of the arc before), and at which it
        ends.
    decided : ndarray (k, n)
        States there: points of the two-fold set, or where the surface is touched.
    begin, end : str
        Why the arc begins and ends where it does: ``"junction"`` with an arc of the other kind,
        ``"bound"`` of the box, ``"closed"``, ``"interrupted"``, ``"lost"`` where no orbit of the
        itinerary is found beyond (starts cross the surface there, say, and another arc follows), or
        what ceases to hold. ``begin`` is empty where the curve was begun.
    starts : ndarray (k, n)
        The states of ``points``, where they are asked for.
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
    """Starts of one itinerary that are on a dividing surface, to be continued.

    Parameters
    ----------
    passages : Passages
    word : str
        The itinerary, one letter for each leg.
    out : callable, optional
        Why the curve need not be followed beyond a start; empty if it is.
    tol : float, optional
        Error of a point, in scaled coordinates.
    """

    snaps = True

    def __init__(
        self,
        passages: Passages,
        word: str,
        out: Callable[[Array], str] | None = None,
        tol: float = 1e-13,
    ):
        self.passages, self.word, self.leaves, self.tol = passages, word, out, tol
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
        """Where the orbit of a start is decided, computed once for each."""
        key = u.tobytes()
        if key not in self.known:
            self.known[key] = self.passages.passage(u, self.word)
        return self.known[key]

    def fault(self, u: Array) -> str:
        return self.passage(u).fault

    def out(self, u: Array) -> str:
        return "" if self.leaves is None else self.leaves(u)

    def snap(self, u: Array, tangent: Array, reach: float) -> Array | None:
        """The start ahead at which arcs that slide and arcs that touch the surface meet."""
        free = self.word.rstrip("s")
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
    """Root of two conditions near a start, by differences.

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
    """Follows a dividing surface in a plane of starts from arc to arc.

    Each arc is continued by :mod:`nonsmooth.continuation`; where its itinerary ceases to hold the
    end is located, and a junction is solved for. The next itinerary is what simulations on a small
    circle have in common on both sides of the curve.

    Parameters
    ----------
    passages : Passages
    step : float
        Largest step on bent arcs, in scaled coordinates.
    out : callable, optional
        Why the curve need not be followed beyond a start; empty if it is.
    first : callable, optional
        The first step of an arc from its start.
    bounds : sequence of (index, low, high), optional
        Where a coordinate ends the curve; it is solved for.
    """

    passages: Passages
    step: float
    out: Callable[[Array], str] | None = None
    first: Callable[[Array], float] | None = None
    bounds: Sequence[tuple[int, float, float]] = ()

    def arcs(
        self, word: str, rows: list[Array], initial: str | None = None
    ) -> Iterator[DividingArc]:
        """Arcs of the curve, each where the one before ends.

        Parameters
        ----------
        word : str
            Itinerary of the first arc, one letter for each leg.
        rows : list of ndarray (2,)
            Two points of it at least.
        initial : str, optional
            Itinerary of its first point, where that is another one.
        """
        step = (rows[-1] - rows[-2]) / self.passages.scale
        start = Departure(self._curve(word), rows, step / float(np.linalg.norm(step)))
        before = self.passages.passage(rows[0], word if initial is None else initial)
        begin = ""
        for departure, arc in pieces(
            start,
            self._trace,
            self._following,
            last=lambda arc: arc.end in ENDS,
        ):
            assert isinstance(departure.curve, StartCurve)
            made, before = self._made(departure.curve, arc, before)
            yield replace(made, begin=begin)
            begin = made.end

    def _curve(self, word: str) -> StartCurve:
        return StartCurve(self.passages, word, self.out)

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
        word, u, tangent = before.curve.word, arc.points[-1].u, arc.points[-1].tangent
        joined = word[:-1] if word.endswith("s") else word + "s"
        ways = self._ways(joined, u) if arc.end == "junction" else []
        for new, direction in chain(((joined, d) for d in ways), self._round(u, tangent)):
            found = depart(self._curve(new), u, direction, _CIRCLE, tangent)
            if found is not None:
                return found
        return None

    def _ways(self, word: str, u: Array) -> list[Array]:
        """Directions of an arc at its junction; none if its last leg cannot be flown there."""
        try:
            return self._curve(word).directions(u)
        except NonsmoothError:
            return []

    def _round(self, u: Array, tangent: Array) -> Iterator[tuple[str, Array]]:
        """Itineraries and directions in which the curve leaves a point, by a small circle."""

        def word(angle: float) -> str:
            way = np.array([np.cos(angle), np.sin(angle)])
            return self.passages.simulated(u + _CIRCLE * self.passages.scale * way)

        straight = float(np.arctan2(tangent[1], tangent[0]))
        for angle, a, b in changes_around(word, last_side, straight):
            common = common_start(a, b)
            if common:
                yield common, np.array([np.cos(angle), np.sin(angle)])

    def _made(self, curve: StartCurve, arc: Arc, first: Passage) -> tuple[DividingArc, Passage]:
        """An arc with what happens at its points, and the passage of its last one."""
        word, points = curve.word, arc.rows
        joins = arc.end == "junction"
        inner = [curve.passage(u) for u in points[1:-1]]
        # At a junction the last sliding leg has no length.
        last = (
            self.passages.passage(points[-1], word.rstrip("s"))
            if joins
            else curve.passage(points[-1])
        )
        after = last
        if joins and word.endswith("s"):
            last = replace(last, entry=last.t)
        row = [first, *inner, last]
        made = DividingArc(
            " ".join(word),
            np.array(points),
            np.array([p.entry for p in row]),
            np.array([p.t for p in row]),
            np.array([p.x for p in row]),
            arc.end,
        )
        return made, after


def last_side(word: str) -> int:
    """The side on which an itinerary ends: 1, -1, or 0 while it slides."""
    return {"+": 1, "-": -1}.get(word[-1:], 0)


def common_start(a: str, b: str) -> str:
    """What two itineraries begin with."""
    differ = (k for k, (p, q) in enumerate(zip(a, b, strict=False)) if p != q)
    return a[: next(differ, min(len(a), len(b)))]


# Orbits of a plane of starts up to where their side is decided: at an event, or at a two-fold.

# What a dividing surface of orbits that end at an event needs of the event.

#: Relative distance of a two-fold from its event, and sine of the angle of both zeros there.
_AT_EVENT = 1e-7


def require_event(
    system: FilippovSystem, until: object, fold: TwoFold, parameters: dict[str, float]
) -> None:
    """Refuse an event unless at it both fields have the same component across the surface."""
    names = [name for name, _ in system.stops]
    if until not in names:
        raise OptionError(
            explain(
                "until",
                expected=f"the name of a stop of the system, among {names}",
                received=repr(until),
                advice="Stops are given with stops=[nonsmooth.Stop(function, name=...)].",
            )
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
            f"of: expected a two-fold at the event {until!r}, and fields with the same component across "
            f"the surface wherever it happens, received {fold.point.round(9).tolist()}, where the event's "
            f"function is {at.value:.3g} and its zeros turn from those of the difference by {angle:.3g}. "
            "Leave until out where orbits go on and two-folds part them."
        )


def read_begin(system: FilippovSystem, begin: Any) -> list[tuple[str, Array]]:
    """Points of a curve with their itineraries, one letter for each leg."""
    if begin is None:
        return []
    try:
        pairs = [("".join(read_word(system, word)), np.array(u, dtype=float)) for word, u in begin]
    except (TypeError, ValueError):
        pairs = []
    if len(pairs) < 2 or any(u.shape != (2,) or not np.isfinite(u).all() for _, u in pairs):
        raise OptionError(
            explain(
                "begin",
                expected="two points or more of a curve, each as its itinerary and its two coordinates",
                received=repr(begin),
                advice="For example begin=[('+ s', (0.1, -0.5)), ('+ s', (0.11, -0.5))].",
            )
        )
    return pairs


#: Time and state (n,) at which an orbit begins, and the derivatives of the state by the coordinates
#: of the plane (n, 2), if they are known.
Start = tuple[float, Array, Array | None]


@dataclass(frozen=True)
class ComputedStarts:
    """Starts of orbits that no formula gives, such as the ends of other runs.

    Attributes
    ----------
    function : callable
        Takes coordinates (2,) and returns the time and the state (n,) at which an orbit begins.
    scale : float
        Size of the coordinates: the unit of spacings, and of steps for differences.

    Examples
    --------
    Starts that a body comes to after a flight of the duration 1 without friction:

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

    def itinerary(self, word: str) -> FixedItinerary:
        """The map of an itinerary to the event."""
        if word not in self._itineraries:
            self._itineraries[word] = FixedItinerary(
                self.system,
                word,
                until=self.until,
                parameters=self.parameters,
                tol=self.tol,
                t_max=self.t_max,
            )
        return self._itineraries[word]

    def numbers(self, x: Array, t: float = 0.0) -> Numbers:
        """h, L1, L2 and their gradients at a state."""
        where, extended = place(self.system, x, self.parameters, t)
        return where.at(extended)

    def passage(self, u: Array, word: str) -> Passage:
        """The orbit from a start to the event: of L1 + L2 after sliding, of h else.

        Parameters
        ----------
        u : ndarray (2,)
            Coordinates of the start.
        word : str
            Its itinerary; a last leg of sliding is not left before the event.
        """
        t, x, slope = self.start(u)
        itinerary = self.itinerary(word)
        arrival = itinerary.arrive(x, t)
        by_start = None if slope is None else itinerary.derivative(arrival)[1] @ slope
        found = self.decided(arrival, word, by_start)
        if last_side(word[0]) * self.numbers(x, t).h < 0.0:
            return replace(found, fault="the start is on the other side of the surface")
        return found

    def seed(self, u: Array, word: str) -> None:
        """Nothing has to be known of an itinerary before its passages are computed.

        Parameters
        ----------
        u : ndarray (2,)
        word : str
        """

    def decided(self, arrival: Arrival, word: str, by_start: Array | None = None) -> Passage:
        """Describe the end of an orbit; one that slid there must be at a visible two-fold.

        Parameters
        ----------
        arrival : Arrival
        word : str
        by_start : ndarray (n, 2), optional
            Derivatives of its end by the coordinates of the plane.
        """
        at, slides, fault = self.numbers(arrival.x, arrival.t), word[-1] == "s", arrival.fault
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
        """The itinerary to the event that a start really takes, one letter for each leg."""
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


class TwoFoldPassages:
    """Orbits that two-folds of a system part."""

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
        self._met: dict[str, Meeting] = {}

    def passage(self, u: Array, word: str) -> Passage:
        """The orbit from a start."""
        return self._slides(u, word) if word.endswith("s") else self._touches(u, word)

    def simulated(self, u: Array) -> str:
        """The itinerary that a start really takes, one letter for each leg."""
        _, x, _ = self.start(u)
        run = simulate(
            self.system, x, self.duration, parameters=self.parameters, tol=max(self.tol, 1e-12)
        )
        return run.itinerary.replace(" ", "")

    def seed(self, u: Array, word: str) -> None:
        """Take from a simulation beside a dividing surface where orbits of an itinerary meet the
        sheet."""
        _, x, _ = self.start(u)
        run = simulate(
            self.system, x, self.duration, parameters=self.parameters, tol=max(self.tol, 1e-12)
        )
        legs = len(word)
        if len(run.events) < legs or not word.endswith("s"):
            return
        entry = run.events[legs - 2] if legs > 1 else None
        leaves = run.events[legs - 1]
        start = (run.t[0], run.x[0]) if entry is None else (entry.t, entry.x_after)
        self._met[word] = self.sheet.guess(start[1], leaves.x, leaves.t - start[0])

    def _itinerary(self, word: str, until: object) -> FixedItinerary:
        return FixedItinerary(
            self.system, word, until, parameters=self.parameters, tol=self.tol, t_max=self.duration
        )

    # sliding into a two-fold --------------------------------------------------------------------

    def _slides(self, u: Array, word: str) -> Passage:
        _, x, slope = self.start(u)
        assert slope is not None
        entry, fault, by_start = 0.0, "", slope
        if len(word) > 1:
            itinerary = self._itinerary(word[:-1], "h0")
            arrival = itinerary.arrive(x)
            by_start = itinerary.derivative(arrival)[1] @ slope
            x, entry = arrival.x, arrival.t
            fault = arrival.fault or self._entry_fault(word, x)
        met = self.sheet.meet(x, self._met.get(word))
        self._met[word] = met
        return Passage(
            met.fold,
            entry + met.duration + met.left,
            entry,
            met.gap,
            np.full(2, np.nan),
            fault or met.fault,
            (met.slope @ by_start)[None, :],
        )

    def _entry_fault(self, word: str, x: Array) -> str:
        leg, p = leg_between(self.system, word[-2], "s"), self.sheet.parameters
        return change_fault(self.system, leg, "s", x, x, p)

    # touching the surface -----------------------------------------------------------------------

    def _touches(self, u: Array, word: str) -> Passage:
        """The last leg turns back from the surface: h is least there, and zero on the arc."""
        _, x, slope = self.start(u)
        assert slope is not None
        itinerary = self._itinerary(word, self._lie(word[-1]))
        arrival = self._turned(itinerary, itinerary.arrive(x), word[-1])
        by_start = itinerary.derivative(arrival)[1] @ slope
        at = self.sheet.where.at(arrival.x)
        other = 1 if word[-1] == "+" else 0
        corner = np.array([at.h, at.lie[other]])
        slopes = np.array([at.gradient, at.lie_gradients[other]]) @ by_start
        fault = arrival.fault
        sign = 1.0 if word[-1] == "+" else -1.0
        if not sign * at.lie[other] < 0.0:
            fault = fault or "what has touched the surface does not cross it, but slides"
        return Passage(arrival.x, arrival.t, arrival.entry, at.h, corner, fault, slopes[:1], slopes)

    def _lie(self, letter: str) -> Any:
        return self.system.lie_derivative(letter)

    def _turned(self, itinerary: FixedItinerary, arrival: Arrival, letter: str) -> Arrival:
        """The same orbit up to the turn at which it is nearest to the surface."""
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
                f"leg in mode {letter!r} from {np.array2string(start, precision=6)}: expected a turn "
                f"back from the surface within {self.duration:g}, received none."
            )
        _, end, x = min(turns, key=lambda turn: turn[0])
        fault = arrival.fault
        if end != arrival.t:
            last = itinerary.leg(letter, t, start, (), t_end=end)
            fault = itinerary.inside(last, f"leg {len(arrival.legs)} ({letter})")
        durations = (*arrival.durations[:-1], end - t)
        return replace(arrival, x=x, t=end, fault=fault, durations=durations)


#: Cells across the box between whose corners curves are looked for, and halvings of an edge.
_CELLS, _HALVINGS = 8, 26

#: What an arc has for every point of it.
_ROWS = ("points", "entry", "t", "decided")

#: The first point beside the one where a curve is met, in scaled coordinates.
_BESIDE = 1e-3

#: A curve whose begin is given takes first steps of so much of the distance from there, and is closed
#: this near to it.
_FIRST, _APART = 0.2, 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class DividingCurves(Savable):
    """Where a plane of starts cuts the surface that divides orbits beside two-folds.

    Attributes
    ----------
    stable : bool
        Whether orbits that come to the two-folds divide (True), or those that leave them, backward
        in time.
    point : ndarray (n,)
        The two-fold that was given.
    curves : list of list of DividingArc
        Curves in the plane, each as arcs that follow each other.
    complete : bool
        False if the computation was interrupted.
    """

    stable: bool
    point: Array
    curves: list[list[DividingArc]]
    complete: bool = True

    @property
    def arcs(self) -> list[DividingArc]:
        """The arcs of all curves."""
        return [arc for curve in self.curves for arc in curve]

    @property
    def junctions(self) -> Array:
        """Starts (k, 2) at which arcs that slide into a two-fold meet arcs that touch the surface."""
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
class Plane:
    """A plane of starts with the part of it that is looked at."""

    start: Callable[[Array], Start]
    box: Array
    scale: Any
    exact: bool

    @property
    def size(self) -> float:
        """Of the box in the phase space."""
        corners = np.array([self.start(np.array(u))[1] for u in product(*self.box)])
        return float(np.linalg.norm(corners - corners.mean(axis=0), axis=1).max()) or 1.0


def plane_of(system: FilippovSystem, starts: Any, box: Any) -> Plane:
    """Read a plane of starts and its box."""
    try:
        limits = np.asarray(box, dtype=float)
    except (TypeError, ValueError):
        limits = np.zeros(0)
    if limits.shape != (2, 2) or not np.all(np.isfinite(limits) & (limits[:, :1] < limits[:, 1:])):
        raise OptionError(
            explain(
                "box",
                expected="the range (low, high) of each of the two coordinates of the plane",
                received=repr(box),
                advice="For example box=[(-1, 1), (0, 2)].",
            )
        )
    if isinstance(starts, ComputedStarts):
        return Plane(starts, limits, starts.scale, exact=False)
    states = StartMap(system, starts)
    half = np.asarray(limits[:, 1] - limits[:, 0]) / 2
    return Plane(lambda u: (0.0, *states(u)), limits, half, exact=True)


def dividing_curves(
    system: FilippovSystem,
    fold: TwoFold,
    plane: Plane,
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
    passages: TwoFoldPassages | EventPassages
    if until is None:
        sheet = TwoFoldSheet(system, fold.point, plane.size, parameters)
        passages = TwoFoldPassages(
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
            f"starts: expected orbits of the box {plane.box.tolist()} on both sides of a dividing "
            f"surface within the duration {duration:g}, received none. Move or widen the box, or give "
            "another duration, at whose end orbits are on one side of the switching surface or the other."
        )
    return DividingCurves(stable, fold.point, curves, complete)


def _with_starts(arc: DividingArc, plane: Plane) -> DividingArc:
    return replace(arc, starts=np.array([plane.start(u)[1] for u in arc.points]))


def _require_plain(system: FilippovSystem) -> None:
    """Refuse systems whose orbits the words of one surface do not tell."""
    whole = system.surface_count == 1 and not any(system.nonlinear)
    if whole and not system.resets and not system.impacts and not system.sets:
        return
    raise DegenerateError(
        f"system: expected one surface, and no resets, impacts or hidden dynamics, received {system!r}. "
        "The curves in which a plane of starts cuts its dividing surfaces are not followed here."
    )


class _Search:
    """Looks for curves between the corners of cells and follows them."""

    def __init__(
        self,
        plane: Plane,
        passages: TwoFoldPassages | EventPassages,
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
        """The curve of which points are given, from the last of them on."""
        words, rows = [word for word, _ in self.begin], [u for _, u in self.begin]
        arcs = list[DividingArc]()
        try:
            for arc in self.tracer.arcs(words[-1], rows, words[0]):
                arcs.append(arc)
        except KeyboardInterrupt:
            if not arcs:
                raise
            self.interrupted = True
        self.interrupted = self.interrupted or arcs[-1].end == "interrupted"
        yield arcs

    def curves(self) -> Iterator[list[DividingArc]]:
        """Curves that cross edges between corners whose orbits end on different sides."""
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
                if last_side(one) * last_side(other) >= 0 or self._crossed(a, b):
                    continue
                curve = self._met((a, one), (b, other))
                if curve:
                    self.traced += [arc.points for arc in curve]
                    yield curve

    def _crossed(self, a: Array, b: Array) -> bool:
        """Whether a curve that was traced crosses the edge between two corners."""
        return any(_crosses(points, a, b) for points in self.traced)

    def _met(self, one: tuple[Array, str], other: tuple[Array, str]) -> list[DividingArc]:
        """The curve that crosses an edge; none where the change of sides is not at a two-fold."""
        edge = (other[0] - one[0]) / self.plane.scale
        across = np.array([-edge[1], edge[0]]) / float(
            np.linalg.norm(edge)
        )  # corrected on the edge
        for _ in range(_HALVINGS):
            middle = 0.5 * (one[0] + other[0])
            label = self.passages.simulated(middle)
            side = last_side(label)
            if side == 0:  # it slides for as long as it is looked at
                break
            if side == last_side(one[1]):
                one = middle, label
            else:
                other = middle, label
        word = common_start(one[1], other[1])
        if not word:
            return []
        middle = 0.5 * (one[0] + other[0])
        try:
            self.passages.seed(one[0], word)
            curve = StartCurve(self.passages, word)
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
                    for arc in self.tracer.arcs(curve.word, departure.rows):
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
    """Two arcs of one itinerary as one; the second begins where the first ends."""
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
