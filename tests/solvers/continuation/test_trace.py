"""Curves with closed forms are followed round turning points, their zeros, bounds and branch points found."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns
from tests.drawing import at_most

Curve, other_direction, trace = (
    ns.continuation.Curve,
    ns.continuation.other_direction,
    ns.continuation.trace,
)


class Cubic(Curve):
    """mu = x^3 - 3 x, folds at x = -1 and 1, with unknowns (x, mu)."""

    parameter = 1

    def __init__(self, factor=1.0):
        self.scale = factor * np.ones(2)
        self.factor, self.calls = factor, 0

    def equations(self, u):
        self.calls += 1
        x, mu = u / self.factor
        return np.array([mu - x**3 + 3 * x]), np.array([[3 - 3 * x**2, 1.0]]) / self.factor

    def tests(self, point):
        return {"half": point.u[0] / self.factor - 0.5, "pole": 1 / (point.u[0] - 0.123)}


class Pitchfork(Curve):
    """x (mu - x^2) = 0, both branches through 0, rotated so that no unknown is special."""

    branching = True
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])

    def equations(self, u):
        x, mu = self.turn @ u
        return np.array([x * (mu - x * x)]), np.array([[mu - 3 * x * x, x]]) @ self.turn


def test_folds_are_passed_and_located():
    arc = trace(
        Cubic(), [np.array([-2.0, -2.0])], np.array([1.0, 9.0]), step=0.2, bounds=[(1, -3, 3)]
    )
    folds = [zero.point.u for zero in arc.zeros if zero.name == "fold"]
    assert np.abs(np.array(folds) - [[-1, 2], [1, -2]]).max() < 1e-12
    assert arc.end == "bound" and arc.points[-1].u[1] == 3.0
    assert all(abs(p.u[1] - p.u[0] ** 3 + 3 * p.u[0]) < 1e-12 for p in arc.points)


def test_a_zero_of_a_test_is_found_and_a_pole_is_none():
    arc = trace(
        Cubic(), [np.array([-2.0, -2.0])], np.array([1.0, 9.0]), step=0.2, bounds=[(1, -3, 3)]
    )
    found = [zero for zero in arc.zeros if zero.name in ("half", "pole")]
    assert [zero.name for zero in found] == ["half"]
    assert np.abs(found[0].point.u - [0.5, 0.125 - 1.5]).max() < 1e-13


def test_an_arc_ends_at_a_test_that_ends_it():
    curve = Cubic()
    curve.ends = lambda name: name == "half"
    arc = trace(curve, [np.array([-2.0, -2.0])], np.array([1.0, 9.0]), step=0.2)
    assert arc.end == "half"
    assert abs(arc.points[-1].u[0] - 0.5) < 1e-13


@pytest.mark.slow
@at_most(20)
@given(st.floats(1e-6, 1e6))
def test_units_do_not_matter(factor):
    start, way = np.array([-2.0, -2.0]), np.array([1.0, 9.0])
    plain = trace(Cubic(), [start], way, step=0.2, bounds=[(1, -3, 3)])
    other = trace(
        Cubic(factor), [factor * start], way, step=0.2, bounds=[(1, -3 * factor, 3 * factor)]
    )
    assert np.allclose(np.array(other.rows) / factor, plain.rows, rtol=0, atol=1e-9)


def test_a_branch_point_is_located_and_left_along_the_other_branch():
    curve = Pitchfork()
    start = curve.turn.T @ [0.0, -1.0]
    arc = trace(curve, [start], curve.turn.T @ [0.0, 1.0], step=0.1, most=20)
    (zero,) = [z for z in arc.zeros if z.name == "branch point"]
    assert np.abs(zero.point.u).max() < 1e-10
    way = other_direction(zero.point)
    assert abs(abs((curve.turn @ way)[0]) - 1) < 1e-9
    first = curve.correct(zero.point.u + 0.05 * way, way)
    x, mu = curve.turn @ first
    assert abs(mu - x * x) < 1e-12 and abs(x) > 0.04


def test_an_interrupt_returns_what_was_computed():
    class Interrupted(Cubic):
        def equations(self, u):
            if self.calls > 30:
                raise KeyboardInterrupt
            return super().equations(u)

    arc = trace(Interrupted(), [np.array([-2.0, -2.0])], np.array([1.0, 9.0]), step=0.1)
    assert arc.end == "interrupted"
    assert len(arc.points) > 3


@pytest.mark.parametrize("reach", [0, 1])
def test_an_error_of_the_equations_ends_the_arc_where_they_end(reach):
    """Also an error at a point that is only tested, ``reach`` steps beyond the last one."""

    class Root(Curve):
        def equations(self, u):
            if u[0] < 0:
                raise ns.PointError("outside")
            return np.array([u[1] - np.sqrt(u[0])]), np.array([[-0.5 / np.sqrt(u[0]), 1.0]])

        def passed(self, last, new, ending):
            self.equations(new.u + reach * (new.u - last.u))
            return False

    arc = trace(Root(), [np.array([1.0, 1.0])], np.array([-1.0, -0.5]), step=0.1)
    assert arc.end in ("lost", "step too small")
    assert 0 <= arc.points[-1].u[0] < 1e-6


def test_steps_are_few_where_the_curve_is_straight():
    class Line(Curve):
        def equations(self, u):
            return np.array([u[0] - 2 * u[1]]), np.array([[1.0, -2.0]])

    arc = trace(Line(), [np.zeros(2)], np.array([2.0, 1.0]), step=0.1, bounds=[(0, -1, 10)])
    assert len(arc.points) < 25


@pytest.mark.parametrize("level", [0.3, -1.7])
def test_a_point_at_a_given_value_of_an_unknown(level):
    curve = Cubic()
    u = curve.correct(np.array([-1.9, level]), np.array([0.0, 1.0]))
    assert u[1] == level
    assert abs(np.polyval([1, 0, -3, -level], u[0])) < 1e-13
