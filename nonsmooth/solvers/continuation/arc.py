"""Pseudo-arclength continuation of one arc: predictor, corrector, step control, zeros, ends.

The predictor is the polynomial in arclength through the last points. A step that fails, bends too
much or leads to a point that is not on the curve is halved. A step in which a test changes its sign
is searched for the zero. An interrupt ends the arc; what was computed is returned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...model import (
    Array,
    ConvergenceError,
    DefinitionError,
    DegenerateError,
    NonsmoothError,
    OptionError,
    PointError,
    is_real,
    real_array,
    whole,
)
from .curve import Curve, Point, Zero, zeros_between

#: Steps turn by no more than this, and grow where they turn by less than a third of it; rad.
BEND = 0.3
_ROWS = 6  # points of the predictor
#: Steps are not shortened below this share of the largest to look for hidden ends.
_SEEN = 1e-5
#: Errors of equations that cannot be evaluated at a point.
_REFUSED = (ConvergenceError, DegenerateError, PointError, np.linalg.LinAlgError)


@dataclass(eq=False)
class Arc:
    """A piece of a curve.

    Attributes
    ----------
    points : list of Point
        The points, in order along the curve.
    zeros : list of Zero
        Zeros of the tests, in their order along the arc.
    end : str
        ``"bound"``, ``"closed"``, ``"junction"``, ``"step too small"``, ``"points"`` (``most`` of
        them), ``"interrupted"``, ``"failed"`` (an error was raised), the name of the test that ended it, or
        the text that the curve gave.
    reason : str
        The words of the error, also of the last one that made a step fail; else empty.
    """

    points: list[Point] = field(default_factory=list)
    zeros: list[Zero] = field(default_factory=list)
    end: str = ""
    reason: str = ""

    @property
    def rows(self) -> list[Array]:
        """The unknowns of the points."""
        return [point.u for point in self.points]


def trace(
    curve: Curve,
    rows: Sequence[Array],
    tangent: Array,
    *,
    step: float,
    first: float | None = None,
    smallest: float = 1e-9,
    most: int = 2000,
    bounds: Sequence[tuple[int, float, float]] = (),
    report: Callable[[Point], None] | None = None,
) -> Arc:
    """Follow a curve from the last of some points of it.

    Parameters
    ----------
    curve : Curve
        The curve: its equations and test functions.
    rows : sequence of ndarray (N,)
        At least one point of the curve; earlier ones help the predictor.
    tangent : ndarray (N,)
        Which way to go, in scaled unknowns.
    step : float
        Largest step on bent pieces, in scaled unknowns; straight ones are taken in longer steps.
    first : float, optional
        The first step; by default a tenth of ``step``.
    smallest : float, optional
        An arc ends where steps would have to be shorter.
    most : int, optional
        Points of an arc.
    bounds : sequence of (index, low, high), optional
        Where an unknown stops the arc; it is solved for.
    report : callable, optional
        Called with every new point, e.g. to move a progress bar.

    Returns
    -------
    Arc
        The arc, with why it ended.

    Raises
    ------
    DefinitionError
        What is no :class:`Curve`, or one whose equations do not fit its unknowns.
    PointError
        No points, or vectors of a wrong length or not finite.
    OptionError
        A step, a count or bounds out of their range.
    """
    lengths = {"step": step, "smallest": smallest, **({} if first is None else {"first": first})}
    rows, tangent = check_trace(curve, rows, tangent, lengths, most, bounds, report)
    arc = Arc()
    tracing = _Tracing(curve, arc, step, smallest, bounds)
    try:
        tracing.begin(rows, tangent, step / 10 if first is None else first)
        while not arc.end:
            if len(arc.points) >= most:
                arc.end = "points"
                break
            tracing.advance()
            if report is not None and arc.points:
                report(arc.points[-1])
    except KeyboardInterrupt:
        arc.end = "interrupted"
    except _REFUSED as error:
        arc.end, arc.reason = "failed", str(error)
    if arc.end in ("lost", "step too small"):
        arc.reason = curve.refused
    if not arc.points:
        arc.points.append(Point(np.asarray(rows[-1], float), np.asarray(tangent, float)))
    return arc


class _Tracing:
    """The state of one arc while it is traced."""

    def __init__(
        self,
        curve: Curve,
        arc: Arc,
        step: float,
        smallest: float,
        bounds: Sequence[tuple[int, float, float]],
    ):
        self.curve, self.arc, self.bounds = curve, arc, bounds
        self.step, self.smallest, self.closing = step, smallest, False
        self.smooth = 0  # the first point of those that one curve passes

    def begin(self, rows: Sequence[Array], tangent: Array, first: float) -> None:
        tangent = tangent / np.linalg.norm(tangent)
        self.size = min(first, self.step)
        for u in rows[:-1]:
            self.arc.points.append(Point(np.asarray(u, float), tangent))
        point = self.curve.point(np.asarray(rows[-1], float), tangent, tangent, 0.0)
        if point is None:
            self.arc.points.append(Point(np.asarray(rows[-1], float), tangent))
            self.arc.end = "lost"
            return
        self.arc.points.append(point)
        self.started = len(rows) - 1

    def advance(self) -> None:
        """Take one step, or halve it."""
        curve, last = self.curve, self.arc.points[-1]
        u, tangent = last.u, last.tangent
        known = self.arc.points[max(self.smooth, len(self.arc.points) - _ROWS) :]
        guess = ahead([p.u / curve.scale for p in known], self.size, tangent)
        trial = curve.correct(guess * curve.scale, tangent)
        chord = np.zeros(u.size) if trial is None else (trial - u) / curve.scale
        bend = 0.0 if trial is None else angle(chord, tangent)
        fault = "" if trial is None else curve.fault(trial)
        new = None
        if trial is not None and not fault and bend <= BEND:
            length = math.sqrt(float(chord @ chord))
            new = curve.point(trial, tangent, chord / length, last.arclength + length)
        if new is not None and curve.exact:
            bend = max(bend, angle(new.tangent, tangent))
        if new is None or bend > BEND:
            self._shorten(last, fault, bend, failed=trial is None)
            return
        zeros, points = len(self.arc.zeros), len(self.arc.points)
        try:
            self._accept(last, new)
        except _REFUSED as error:  # the step is too long for what is computed inside it
            del self.arc.zeros[zeros:], self.arc.points[points:]
            self.arc.end, curve.refused = "", str(error)
            self._shorten(last, "", bend, failed=True)
            return
        if not self.closing and bend < BEND / 3:
            straight = 10.0 if bend < 1e-6 else 4.0 if bend < 0.01 else 1.0
            self.size = min(1.6 * self.size, straight * self.step)

    def _shorten(self, last: Point, fault: str, bend: float, failed: bool) -> None:
        """Halve a step that failed; end the arc where what ends it can be solved for."""
        solved = type(self.curve).snap is not Curve.snap  # what ends it
        lost = failed and solved and (self.curve.snaps or not self.curve.exact)
        self.closing = self.closing or bool(fault) or lost
        if self.closing:
            snapped = self.curve.snap(last.u, last.tangent, 2 * self.size)
            if snapped is not None:
                self.arc.points.append(Point(snapped, last.tangent))
                self.arc.end = "junction"
                return
        if self.size < self.smallest:
            self.arc.end = fault or ("lost" if failed else "step too small")
        self.size *= 0.5

    def _accept(self, last: Point, new: Point) -> None:
        found = zeros_between(self.curve, last, new)
        passed = any(not low <= new.u[k] <= high for k, low, high in self.bounds)
        bound = self._bound(last, new) if passed else None
        if passed and bound is None:  # too far to solve for the point at the bound
            self.size *= 0.5
            if self.size < self.smallest:
                self.arc.end = "bound"
            return
        if bound is not None:
            new, self.arc.end = bound, "bound"
            found = [zero for zero in found if zero.point.arclength <= new.arclength]
        ending = next((zero for zero in found if self.curve.ends_at(zero)), None)
        if self.size > _SEEN * self.step and self.curve.passed(last, new, ending):
            self.size *= 0.3
            return
        for zero in found:
            self.arc.zeros.append(zero)
            if self.curve.ends_at(zero):
                self.arc.points.append(zero.point)
                self.arc.end = zero.name
                return
        renewed = None if self.arc.end else self.curve.renewed(new)
        if renewed is not None:  # other equations: what they have in common is this point
            new, self.smooth = renewed, len(self.arc.points)
        self.arc.points.append(new)
        self.arc.end = self.arc.end or self.curve.out(new.u) or self._closed(last, new)

    def _bound(self, last: Point, new: Point) -> Point | None:
        """The first point of this step where an unknown reaches its bound."""
        weights: list[tuple[float, int, float]] = []
        for k, low, high in self.bounds:
            if not low <= new.u[k] <= high:
                limit = low if new.u[k] < low else high
                weights.append(((limit - last.u[k]) / (new.u[k] - last.u[k]), k, limit))
        if not weights:
            return None
        weight, k, limit = min(weights)
        guess = last.u + weight * (new.u - last.u)
        guess[k] = limit
        axis = np.zeros(guess.size)
        axis[k] = 1.0
        u = self.curve.correct(guess, axis)
        if u is None:
            return None
        u[k] = limit
        chord = (u - last.u) / self.curve.scale
        length = float(np.linalg.norm(chord)) or 1.0
        return self.curve.point(u, last.tangent, chord / length, last.arclength + length)

    def _closed(self, last: Point, new: Point) -> str:
        """Whether this step passes the start again."""
        first = self.arc.points[self.started]
        if len(self.arc.points) - self.started < 5 or first.tangent @ new.tangent < 0.5:
            return ""
        back, step = (first.u - last.u) / self.curve.scale, (new.u - last.u) / self.curve.scale
        along = float(back @ step) / float(step @ step)
        across = float(np.linalg.norm(back - along * step))
        return "closed" if 0 < along <= 1 and across < 0.3 * float(np.linalg.norm(step)) else ""


def ahead(rows: Sequence[Array], size: float, tangent: Array) -> Array:
    """Guess the point ahead: the polynomial in arclength through the last points.

    Parameters
    ----------
    rows : sequence of ndarray (N,)
        The last points, the newest at the end.
    size : float
        How far ahead.
    tangent : ndarray (N,)
        The direction that is taken where there are fewer than three points.

    Returns
    -------
    ndarray (N,)
        The guess.

    Examples
    --------
    >>> t = np.linspace(0, 1, 6)
    >>> parabola = list(np.column_stack([t, 0 * t]))
    >>> ahead(parabola, 0.2, np.array([1.0, 0.0])).round(12).tolist()
    [1.2, 0.0]
    """
    if not len(rows):
        raise PointError("rows: expected at least one point, received none.")
    last = np.array(rows)
    if len(last) < 3:
        return np.asarray(last[-1] + size * tangent)
    chords = last[1:] - last[:-1]
    s = np.concatenate([[0.0], np.cumsum(np.sqrt((chords * chords).sum(axis=1)))])
    nodes = (s - s[-1]).tolist()
    weights = [math.prod((size - b) / (a - b) for b in nodes if b != a) for a in nodes]
    return np.asarray(weights @ last)


def angle(step: Array, direction: Array) -> float:
    """Angle of a step with a direction of length 1; pi for none."""
    length = math.sqrt(float(step @ step))
    # NaN stays NaN
    return math.acos(max(min(float(step @ direction) / length, 1.0), -1.0)) if length else math.pi


# checks of the arguments -----------------------------------------------------------------------


def require_curve(curve: Any) -> None:
    """Refuse all but a Curve."""
    if not isinstance(curve, Curve):
        raise DefinitionError(
            "curve: expected an instance of a subclass of nonsmooth.continuation.Curve, received "
            f"{curve!r}. Write class Mine(Curve) with equations(self, u), and give Mine()."
        )


def vector(values: Any, what: str, size: int | None = None) -> Array:
    """A vector of finite numbers, of a given length."""
    found = real_array(values, what)
    expected = "a vector" if size is None else f"a vector ({size},)"
    if found.ndim != 1 or (size is not None and found.size != size) or not found.size:
        received = f"shape {found.shape}"
    elif not np.isfinite(found).all():
        received = str(found)
    else:
        return np.asarray(found, float)
    raise PointError(
        f"{what}: expected {expected} of finite numbers, received {received}. One for each "
        "unknown of the curve, the parameter included."
    )


def check_trace(
    curve: Any,
    rows: Any,
    tangent: Any,
    lengths: dict[str, Any],
    most: Any,
    bounds: Any,
    report: Callable[..., Any] | None,
) -> tuple[list[Array], Array]:
    """Check the arguments of ``trace``; the rows and the tangent as arrays."""
    require_curve(curve)
    if not isinstance(rows, (Sequence, np.ndarray)) or isinstance(rows, str) or not len(rows):
        raise PointError(
            f"rows: expected a list of points of the curve, at least one, received {rows!r}. "
            "Write [np.array([...])]."
        )
    size = vector(rows[-1], "rows[-1]").size
    found = [vector(row, f"rows[{i}]", size) for i, row in enumerate(rows)]
    way = vector(tangent, "tangent", size)
    if not way.any():
        raise PointError("tangent: expected a direction, received zero. Give which way to go.")
    for name, value in lengths.items():
        if not is_real(value) or not 0.0 < float(value) < np.inf:
            raise OptionError(f"{name}: expected a positive finite number, received {value!r}.")
    whole(most, "most")
    _check_bounds(bounds, size)
    if report is not None and not callable(report):
        raise OptionError(f"report: expected a function of a point, or None, received {report!r}.")
    _check_curve(curve, found[-1])
    return found, way


def _check_bounds(bounds: Any, size: int) -> None:
    for entry in bounds if isinstance(bounds, (Sequence, np.ndarray)) else [bounds]:
        if isinstance(entry, (Sequence, np.ndarray)) and len(entry) == 3:
            if all(isinstance(e, (int, float, np.number)) for e in entry):
                k, low, high = entry
                if k in range(-size, size) and low <= high:
                    continue
        raise OptionError(
            f"bounds: expected entries (index, low, high) with an index below {size} and low <= "
            f"high, received {entry!r}. For example bounds=[(0, -1.0, 1.0)]."
        )


def _check_curve(curve: Curve, u: Array) -> None:
    """Refuse a curve whose attributes or equations do not fit its unknowns."""
    n, scale = u.size, np.asarray(curve.scale)
    if scale.dtype.kind not in "iuf" or scale.shape not in ((), (n,)) or not (scale > 0.0).all():
        raise DefinitionError(
            f"curve.scale: expected a positive number or vector ({n},), received {curve.scale!r}. It "
            "holds the sizes of the unknowns."
        )
    if curve.parameter is not None and curve.parameter not in range(-n, n):
        raise DefinitionError(
            f"curve.parameter: expected the index of one of {n} unknowns, or None, received "
            f"{curve.parameter!r}."
        )
    if type(curve).equations is Curve.equations:
        raise DefinitionError(
            "curve: its class does not define equations. Write equations(self, u), which returns their "
            "values and their Jacobian."
        )
    if not curve.exact:
        return  # an evaluation would change the carried Jacobian
    try:
        given = curve.equations(u)
    except (NonsmoothError, np.linalg.LinAlgError):
        return  # the arc ends there with its reason
    try:
        shapes = [part.shape for part in given if isinstance(part, np.ndarray)]
    except TypeError:
        shapes = []
    if shapes != [(n - 1,), (n - 1, n)]:
        raise DefinitionError(
            f"curve.equations: expected arrays ({n - 1},) and ({n - 1}, {n}) for {n} unknowns, the "
            f"values and their derivatives, received {given!r}. Return both as numpy arrays."
        )
