"""Dividing surfaces cut by a plane of starts: where they are met, and the curves in the plane."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any

import numpy as np

from ...flow.saving import Savable
from ...local.searches.two_fold import TwoFold
from ...model import (
    Array,
    DegenerateError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    StartMap,
    explain,
)
from ...solvers.continuation import depart
from .dividing_arcs import DividingArc, DividingTracer, StartCurve, common_start, last_side
from .dividing_passages import ComputedStarts, EventPassages, Start, TwoFoldPassages
from .two_fold_sheet import TwoFoldSheet

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
class DividingCurves(Savable, point="n"):
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
