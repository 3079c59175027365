"""Curves, N - 1 smooth equations in N unknowns: their points, and zeros of test functions on them.

Lengths and angles are measured in unknowns divided by their ``scale``. A guess is corrected in the
hyperplane across a direction (pseudo-arclength; Keller 1977), so turning points are regular points.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...model import Array, DefinitionError, NonsmoothError, is_real
from .. import linear_equations
from ..newton import Secant, converge


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a curve.

    Attributes
    ----------
    u : ndarray (N,)
        The unknowns.
    tangent : ndarray (N,)
        Direction of the curve in scaled unknowns, of length 1.
    arclength : float
        From the start of the arc, in scaled unknowns.
    jacobian : ndarray (N - 1, N)
        Of the equations by scaled unknowns; empty for a curve without derivatives.
    tests : mapping of str to float
        Functions whose zeros are located.
    """

    u: Array
    tangent: Array
    arclength: float = 0.0
    jacobian: Array = field(default_factory=lambda: np.zeros((0, 0)))
    tests: Mapping[str, float] = field(default_factory=dict)


class Curve:
    """A curve in $R^N$; subclasses give its equations and test functions.

    Attributes
    ----------
    scale : ndarray (N,) or float
        Sizes of the unknowns.
    tol : float
        Error of a point, in scaled unknowns.
    exact : bool
        Whether ``equations`` gives the derivative itself, not a :class:`~nonsmooth.continuation.Secant`
        estimate of it; then tangents come from it, otherwise from the chord.
    parameter : int or None
        The unknown whose turning points are located, under the name ``"fold"``.
    branching : bool
        Whether branch points are located, under the name ``"branch point"``.
    snaps : bool
        Whether the end is solved for (``snap``) also where corrections fail, as they do where equations
        are not defined beyond it; without derivatives always.

    Examples
    --------
    The unit circle, one turn from its rightmost point:

    >>> import nonsmooth as ns
    >>> class Circle(ns.continuation.Curve):
    ...     parameter = 0
    ...     def equations(self, u):
    ...         return np.array([u @ u - 1]), 2 * u[None, :]
    >>> arc = ns.continuation.trace(Circle(), [np.array([1.0, 0.0])], np.array([0.0, 1.0]), step=0.2)
    >>> arc.end, [(zero.name, zero.point.u[0].round(12).tolist()) for zero in arc.zeros]
    ('closed', [('fold', -1.0), ('fold', 1.0)])
    """

    scale: Any = 1.0
    tol: float = 1e-13
    exact: bool = True
    parameter: int | None = None
    branching: bool = False
    snaps: bool = False
    regular: bool = False  # Newton's method converges quadratically though tangents are chords
    #: The words of the error that made the last correction fail; else empty.
    refused: str = ""

    def equations(self, u: Array) -> tuple[Array, Array]:
        """Return the values of the equations and their Jacobian; every subclass defines it.

        Parameters
        ----------
        u : ndarray (N,)
            The unknowns.

        Returns
        -------
        values, jacobian : ndarray (N - 1,), (N - 1, N)
            Zero on the curve, and the derivatives by the unknowns.
        """
        raise NotImplementedError

    def values(self, u: Array) -> Array | None:
        """Return the values of the equations alone, where that is cheaper; else None.

        Parameters
        ----------
        u : ndarray (N,)
            The unknowns.
        """
        return None

    def fault(self, u: Array) -> str:
        """Say why a zero of the equations is not a point of the curve; empty if it is one.

        Parameters
        ----------
        u : ndarray (N,)
            The unknowns.
        """
        return ""

    def tests(self, point: Point) -> Mapping[str, float]:
        """Return the functions whose zeros along the curve are located.

        Parameters
        ----------
        point : Point
            A point of the curve.

        Returns
        -------
        mapping of str to float
            Their values by name. Anything else is refused (DefinitionError).
        """
        return {}

    def ends(self, name: str) -> bool:
        """Whether the curve ends at a zero of a test.

        Parameters
        ----------
        name : str
            Of the test.
        """
        return False

    def ends_at(self, zero: Zero) -> bool:
        """Whether the curve ends at a located zero.

        Parameters
        ----------
        zero : Zero
            Of one of the tests, located on the curve.
        """
        return self.ends(zero.name)

    def passed(self, last: Point, new: Point, ending: Zero | None) -> bool:
        """Whether a step hides an end of the curve; then shorter steps are taken.

        Parameters
        ----------
        last, new : Point
            The ends of the step.
        ending : Zero or None
            The first zero in the step of a test that ends the curve.
        """
        return False

    def singular(self, name: str) -> bool:
        """Whether the equations are singular at a zero of a test, so that it is interpolated.

        Parameters
        ----------
        name : str
            Of the test.
        """
        return name == "branch point"

    def renewed(self, point: Point) -> Point | None:
        """Return the same point of better equations, e.g. on a new section; None to keep these.

        Parameters
        ----------
        point : Point
            The newest point.
        """
        return None

    def out(self, u: Array) -> str:
        """Say why the curve need not be followed beyond a point; empty if it is followed.

        Parameters
        ----------
        u : ndarray (N,)
            The unknowns.
        """
        return ""

    def snap(self, u: Array, tangent: Array, reach: float) -> Array | None:
        """Solve for the end of the curve, where its condition is known; None if it is not near.

        Parameters
        ----------
        u, tangent : ndarray (N,)
            The newest point, and the way ahead in scaled unknowns.
        reach : float
            How far ahead to look.
        """
        return None

    # computed from the equations ----------------------------------------------------------------

    def scaled(self, u: Array) -> tuple[Array, Array]:
        """Return values and Jacobian by scaled unknowns.

        Parameters
        ----------
        u : ndarray (N,)
            Scaled unknowns.

        Returns
        -------
        values, jacobian : ndarray (N - 1,), (N - 1, N)
            As of :meth:`equations`.
        """
        values, jacobian = self.equations(u * self.scale)
        return values, jacobian * self.scale

    def correct(self, guess: Array, across: Array, *, max_iterations: int = 10) -> Array | None:
        """Point of the curve in the hyperplane through ``guess`` across a direction, or None.

        Parameters
        ----------
        guess : ndarray (N,)
            A point near the curve.
        across : ndarray (N,)
            In scaled unknowns; a unit vector keeps that unknown at its value in ``guess``.
        max_iterations : int, optional
            Newton's method gives up after this many.
        """
        start = guess / self.scale
        level = float(across @ start)

        def bordered(v: Array) -> tuple[Array, Array]:
            values, jacobian = self.scaled(v)
            return np.append(values, across @ v - level), np.vstack([jacobian, across])

        def plain(v: Array) -> Array | None:
            values = self.values(v * self.scale)
            return None if values is None else np.append(values, across @ v - level)

        def attempt() -> Array | None:
            # exact derivatives converge quadratically: near a branch point rounding is magnified
            noise = 1e-8 if self.exact or self.regular else 1e-11
            return converge(
                bordered,
                start,
                tol=self.tol,
                max_iterations=max_iterations,
                linear=self.solve,
                noise=noise,
                values=plain,
            )

        try:
            found = attempt()
            source = getattr(self, "secant", None)
            if found is None and isinstance(source, Secant) and source.forget():
                found = attempt()
        except NonsmoothError as error:
            self.refused = str(error)
            return None
        self.refused = ""
        return None if found is None else found * self.scale

    def point(self, u: Array, before: Array, chord: Array, arclength: float) -> Point | None:
        """Describe a zero of the equations: its tangent and its tests; None if that fails.

        Parameters
        ----------
        u : ndarray (N,)
            The zero.
        before : ndarray (N,)
            The tangent before, along which the new one points.
        chord : ndarray (N,)
            The direction from the last point, which stands for the tangent without derivatives.
        arclength : float
            From the start of the arc, in scaled unknowns.
        """
        try:
            tests: dict[str, float] = {}
            jacobian, tangent = np.zeros((0, 0)), chord
            if self.exact:
                jacobian = self.equations(u)[1] * self.scale
                tangent, sign = self.along(jacobian, before)
                if self.parameter is not None:
                    tests["fold"] = float(tangent[self.parameter])
                if self.branching:
                    tests["branch point"] = sign
            own = self.tests(Point(u, tangent, arclength, jacobian))
        except (NonsmoothError, np.linalg.LinAlgError) as error:
            self.refused = str(error)
            return None
        tests.update(read_tests(own))
        return Point(u, tangent, arclength, jacobian, tests)

    def solve(self, matrix: Array, right: Array) -> Array:
        """Solve the linear equations of a corrector; a subclass may use their structure.

        Parameters
        ----------
        matrix : ndarray (N, N)
            The Jacobian, then the row across.
        right : ndarray (N,)
            The right-hand side.

        Returns
        -------
        ndarray (N,)
            The step.

        Raises
        ------
        numpy.linalg.LinAlgError
            A singular matrix.
        """
        return linear_equations.solve(matrix, right)

    def along(self, jacobian: Array, before: Array) -> tuple[Array, float]:
        """Return the tangent of a Jacobian, and a determinant.

        The determinant is that of the Jacobian bordered by the tangent: it changes its sign at a simple
        branch point.

        Parameters
        ----------
        jacobian : ndarray (N - 1, N)
            By scaled unknowns.
        before : ndarray (N,)
            The tangent before, along which the new one points.

        Returns
        -------
        tangent, determinant : ndarray (N,), float
            Of length 1; up to a factor that keeps its sign.

        Raises
        ------
        numpy.linalg.LinAlgError
            At a branch point.
        """
        bordered = np.vstack([jacobian, before])
        target = np.zeros(before.size)
        target[-1] = 1.0
        tangent = self.solve(bordered, target)
        length = float(np.linalg.norm(tangent))
        return tangent / length, self.determinant(bordered) * length

    def determinant(self, matrix: Array) -> float:
        """Determinant of bordered equations, up to a factor that keeps its sign.

        Parameters
        ----------
        matrix : ndarray (N, N)
            The bordered Jacobian.
        """
        return linear_equations.determinant(matrix)


def read_tests(found: Any) -> dict[str, float]:
    """What ``Curve.tests`` returned, as numbers by name; they may have poles."""
    if type(found) is dict and all(type(k) is str and type(v) is float for k, v in found.items()):
        return found
    if isinstance(found, Mapping):
        number = lambda v: is_real(v) or isinstance(v, (float, np.floating))
        wrong = [k for k, v in found.items() if not (isinstance(k, str) and number(v))]
        if not wrong:
            return {k: float(v) for k, v in found.items()}
        received = f"{found[wrong[0]]!r} under the name {wrong[0]!r}"
    else:
        received = repr(found)
    raise DefinitionError(
        f"curve.tests: expected a mapping of names to numbers, received {received}. For example "
        'return {"half": float(point.u[0]) - 0.5}.'
    )


# zeros of test functions -----------------------------------------------------------------------

_HALVINGS = 30  # of a step in which the curve is lost
_NODES = 8  # points of the interpolation through a branch point


@dataclass(frozen=True, eq=False)
class Zero:
    """A zero of a test function on a curve.

    Attributes
    ----------
    name : str
        Of the test.
    point : Point
        The point of the curve where the test is zero.
    slope : float
        Derivative of the test by arclength, from the ends of the step.
    together : tuple of str
        Tests that vanish at the same point, this one included.
    """

    name: str
    point: Point
    slope: float
    together: tuple[str, ...] = ()


def zeros_between(curve: Curve, a: Point, b: Point) -> list[Zero]:
    """Zeros in the step from a to b, in their order; a test that jumps or has a pole has none."""
    # A zero that ends the curve, where the equations are singular, is put at the last point before it.
    names = [k for k in a.tests if k in b.tests and a.tests[k] * b.tests[k] < 0]
    names.sort(key=lambda name: not (curve.singular(name) and curve.ends(name)))
    segment = _Segment(curve, a, b)
    found: list[Zero | None] = []
    for name in names:
        twin = next((z for z in found if z is not None and segment.shares(z.point, name)), None)
        found.append(
            _zero(segment, name) if twin is None else Zero(name, twin.point, segment.slope(name))
        )
    zeros = [zero for zero in found if zero is not None]
    lost = [n for n, zero in zip(names, found, strict=True) if zero is None and curve.ends(n)]
    lost = [n for n in lost if not segment.jumps(n)]
    if lost:
        end = segment.before(lost)
        before = end.arclength  # others that are located there are beyond doubt
        zeros = [z for z in zeros if curve.ends(z.name) or z.point.arclength < before]
        zeros += [Zero(name, end, segment.slope(name)) for name in lost]
    near = 1e-6 * (b.arclength - a.arclength)
    zeros = [
        replace(
            z,
            together=tuple(
                o.name
                for o in zeros
                if abs(o.point.arclength - z.point.arclength) <= near
                or (lost and curve.ends(o.name) and curve.ends(z.name))
            ),
        )
        for z in zeros
    ]
    return sorted(zeros, key=lambda zero: zero.point.arclength)


def _zero(segment: _Segment, name: str) -> Zero | None:
    if segment.curve.singular(name):
        return _interpolated(segment, name)
    weight = segment.root(name)
    point = None if weight is None else segment.at(weight)
    if weight is None and name == "fold":  # beside a branch point
        return _interpolated(segment, name)
    size = max(abs(segment.a.tests[name]), abs(segment.b.tests[name]))
    if point is None or not abs(point.tests[name]) <= 1e-5 * size:
        return None
    return Zero(name, point, segment.slope(name))


def _interpolated(segment: _Segment, name: str) -> Zero | None:
    point = segment.interpolated(name)
    return None if point is None else Zero(name, point, segment.slope(name))


class _Segment:
    """One step of a curve, as a function of its fraction."""

    def __init__(self, curve: Curve, a: Point, b: Point):
        self.curve, self.a, self.b = curve, a, b
        self.chord = (b.u - a.u) / curve.scale
        self.length = float(np.linalg.norm(self.chord))
        self.known: dict[float, Point | None] = {0.0: a, 1.0: b}

    def slope(self, name: str) -> float:
        """Mean slope of a test over the step."""
        return (self.b.tests[name] - self.a.tests[name]) / (self.b.arclength - self.a.arclength)

    def shares(self, point: Point, name: str) -> bool:
        """Whether a test vanishes at the zero of another one, as events of a symmetric orbit do."""
        size = max(abs(self.a.tests[name]), abs(self.b.tests[name]))
        return abs(point.tests.get(name, np.inf)) <= 1e-10 * size

    def jumps(self, name: str) -> bool:
        """Whether a test changes its sign without passing small values, where it was followed."""
        values = [p.tests[name] for p in self.known.values() if p is not None and name in p.tests]
        ends = min(abs(self.a.tests[name]), abs(self.b.tests[name]))
        return len(values) > 20 and min(map(abs, values)) > 0.1 * ends

    def before(self, names: list[str]) -> Point:
        """The last point before any of some tests changes its sign, or the curve is lost."""
        good, bad = 0.0, 1.0
        for weight in sorted(self.known):
            good = weight if self._precedes(weight, names) else good
        bad = min((w for w in self.known if w > good), default=1.0)
        for _ in range(_HALVINGS):
            middle = 0.5 * (good + bad)
            if self._precedes(middle, names):
                good = middle
            else:
                bad = middle
        point = self.at(good)
        assert point is not None
        return point

    def _precedes(self, weight: float, names: list[str]) -> bool:
        """Whether there is a point of the curve at which some tests have the signs of the start."""
        p = self.at(weight)
        if p is None:
            return False
        return all(p.tests.get(n, 0.0) * self.a.tests[n] > 0 for n in names)

    def at(self, weight: float) -> Point | None:
        """The point of the curve across the chord at a fraction of it."""
        if weight not in self.known:
            guess = self.guess(weight)
            u = self.curve.correct(guess, self.chord / self.length)
            # across the chord other solutions are far away
            astray = u is not None and np.abs((u - guess) / self.curve.scale).max() > self.length
            self.known[weight] = (
                None
                if u is None or astray
                else self.curve.point(
                    u,
                    self.a.tangent,
                    self.chord / self.length,
                    self.a.arclength + weight * (self.b.arclength - self.a.arclength),
                )
            )
        return self.known[weight]

    def guess(self, w: float) -> Array:
        """Cubic through both ends with their tangents."""
        a, b, scale = self.a, self.b, self.curve.scale
        ends = (1 + 2 * w) * (1 - w) ** 2 * a.u + w * w * (3 - 2 * w) * b.u
        if not self.curve.exact:
            return a.u + w * (b.u - a.u)
        bent = w * (1 - w) ** 2 * a.tangent - w * w * (1 - w) * b.tangent
        return np.asarray(ends + self.length * bent * scale)

    def root(self, name: str) -> float | None:
        """Fraction at which a test vanishes; None where it cannot be followed."""
        from scipy.optimize import brentq

        def value(weight: float) -> float:
            point = self.at(weight)
            if point is None or name not in point.tests:
                raise _LostError
            return float(point.tests[name])

        try:
            return float(brentq(value, 0.0, 1.0, xtol=1e-15, rtol=1e-15))
        except _LostError:
            return None

    def interpolated(self, name: str) -> Point | None:
        """Zero of a test where the corrector is singular, from points around it."""
        # The equations are singular there across every hyperplane, but the test and the curve are
        # smooth, so polynomials through points on both sides are accurate.
        low, high = self.a.tests[name], self.b.tests[name]
        middle, width = low / (low - high), 0.5
        point: Point | None = None
        for _ in range(3):
            required = middle + width * np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
            pairs = [(w, p) for w in required.tolist() if (p := self.at(w)) is not None]
            least = 1e-9 * (
                abs(low) + abs(high)
            )  # not on a crossing branch, where the test is zero
            pairs = [(w, p) for w, p in pairs if abs(p.tests.get(name, 0.0)) > least]
            if len(pairs) < _NODES - 2:
                return point
            nodes, points = np.array([w for w, _ in pairs]), [p for _, p in pairs]
            degree = len(pairs) - 1
            tests = np.polynomial.Polynomial.fit(nodes, [p.tests[name] for p in points], degree)
            roots = tests.roots()
            real = roots.real[np.abs(roots.imag) < 1e-6]
            if not real.size:
                return point
            middle = float(real[np.argmin(np.abs(real - middle))])
            rows = np.array([p.u for p in points])
            u = np.array(
                [np.polynomial.Polynomial.fit(nodes, row, degree)(middle) for row in rows.T]
            )
            near = points[int(np.argmin(np.abs(nodes - middle)))]
            s = self.a.arclength + middle * (self.b.arclength - self.a.arclength)
            point = replace(near, u=u, arclength=s)
            with suppress(NonsmoothError):  # there may be none at the zero itself
                point = replace(point, jacobian=self.curve.scaled(u / self.curve.scale)[1])
            width *= 0.2
        return point


class _LostError(Exception):
    """The curve could not be followed inside a step."""
