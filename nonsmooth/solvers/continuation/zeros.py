"""Zeros of test functions between two points of a curve, located along it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...model import Array
from .curve import Curve, Point

_HALVINGS = 30  # of what is left of a step in which a curve is lost
_NODES = 8  # points from which what is singular at a branch point is interpolated


@dataclass(frozen=True, eq=False)
class Zero:
    """A zero of a test function on a curve.

    Attributes
    ----------
    name : str
        Of the test.
    point : Point
        Where on the curve the watched function is zero.
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
    # Where the equations are singular at the zero of a test that ends the curve it cannot be located
    # along the curve; then it is taken to be at the last point before it.
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
        # At a branch point the equations are singular across every hyperplane. Both the test and the
        # curve are smooth through it, so polynomials through points on both sides are right there.
        low, high = self.a.tests[name], self.b.tests[name]
        middle, width = low / (low - high), 0.5
        point: Point | None = None
        for _ in range(3):
            wanted = middle + width * np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
            pairs = [(w, p) for w in wanted.tolist() if (p := self.at(w)) is not None]
            least = 1e-9 * (
                abs(low) + abs(high)
            )  # not on a branch that crosses where the test is zero
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
            jacobian = self.curve.scaled(u / self.curve.scale)[1]
            point = replace(near, u=u, arclength=s, jacobian=jacobian)
            width *= 0.2
        return point


class _LostError(Exception):
    """The curve could not be followed inside a step."""
