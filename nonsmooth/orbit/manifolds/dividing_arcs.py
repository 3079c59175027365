"""Arcs of a dividing surface cut by a plane of starts: curves in the plane, followed arc by arc.

Starts on a dividing surface take one itinerary up to where it is decided on which side of the
switching surface they go on: at a two-fold, into which they slide, or where they just touch the
surface. With the itinerary fixed what happens there is a smooth function of the start, so an arc is
continued like any curve. It ends where its itinerary ceases to hold, and the next one begins there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, Protocol

import numpy as np

from ...flow.saving import savable
from ...model import Array, NonsmoothError
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


@savable(points="k 2", entry="k", t="k", decided="k n", starts="k n | 0 0")
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
