"""Zeros of test functions between two points of a curve, located along it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...model import Array
from .curve import Curve, Point

_NODES = 8  # points from which what is singular at a branch point is interpolated


@dataclass(frozen=True, eq=False)
class Zero:
    """A zero of a test function on a curve.

    Attributes
    ----------
    name : str
        Of the test.
    point : Point
    slope : float
        Derivative of the test by arclength, from the ends of the step.
    """

    name: str
    point: Point
    slope: float


def zeros_between(curve: Curve, a: Point, b: Point) -> list[Zero]:
    """Zeros in the step from a to b, in their order; a test that jumps or has a pole has none."""
    names = [k for k in a.tests if k in b.tests and a.tests[k] * b.tests[k] < 0]
    found = [_zero(curve, a, b, name) for name in names]
    return sorted(
        (zero for zero in found if zero is not None), key=lambda zero: zero.point.arclength
    )


def _zero(curve: Curve, a: Point, b: Point, name: str) -> Zero | None:
    segment = _Segment(curve, a, b)
    low, high = a.tests[name], b.tests[name]
    slope = (high - low) / (b.arclength - a.arclength)
    if name == "branch point":
        point = segment.interpolated(name)
    else:
        weight = segment.root(name)
        point = None if weight is None else segment.at(weight)
        if point is not None and not abs(point.tests[name]) <= 1e-5 * max(abs(low), abs(high)):
            return None
    return None if point is None else Zero(name, point, slope)


class _Segment:
    """One step of a curve, as a function of its fraction."""

    def __init__(self, curve: Curve, a: Point, b: Point):
        self.curve, self.a, self.b = curve, a, b
        self.chord = (b.u - a.u) / curve.scale
        self.length = float(np.linalg.norm(self.chord))
        self.known: dict[float, Point | None] = {0.0: a, 1.0: b}

    def at(self, weight: float) -> Point | None:
        """The point of the curve across the chord at a fraction of it."""
        if weight not in self.known:
            u = self.curve.correct(self.guess(weight), self.chord / self.length)
            self.known[weight] = (
                None
                if u is None
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
        """Zero of a test where the corrector is singular, from points around it.

        At a branch point the equations are singular across every hyperplane. Both the test and the
        curve are smooth through it, so polynomials through points on both sides are right there.
        """
        low, high = self.a.tests[name], self.b.tests[name]
        middle, width = low / (low - high), 0.5
        point: Point | None = None
        for _ in range(3):
            nodes = middle + width * np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
            points = [p for w in nodes if (p := self.at(float(w))) is not None]
            if len(points) < _NODES or any(name not in p.tests for p in points):
                return point
            tests = np.polynomial.Polynomial.fit(nodes, [p.tests[name] for p in points], _NODES - 1)
            roots = tests.roots()
            real = roots.real[np.abs(roots.imag) < 1e-6]
            if not real.size:
                return point
            middle = float(real[np.argmin(np.abs(real - middle))])
            rows = np.array([p.u for p in points])
            u = np.array(
                [np.polynomial.Polynomial.fit(nodes, row, _NODES - 1)(middle) for row in rows.T]
            )
            near = points[int(np.argmin(np.abs(nodes - middle)))]
            s = self.a.arclength + middle * (self.b.arclength - self.a.arclength)
            jacobian = self.curve.scaled(u / self.curve.scale)[1]
            point = replace(near, u=u, arclength=s, jacobian=jacobian)
            width *= 0.2
        return point


class _LostError(Exception):
    """The curve could not be followed inside a step."""
