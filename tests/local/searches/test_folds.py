"""Folds and cusps are distinguished by the first nonzero derivative of h, and found by search."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.local import find_fold, fold

x, y, z, w, t = (ca.SX.sym(s) for s in "xyzwt")


def jordan(order, side="+", sign=1):
    """h = y and along the field y = sign t^order/order!: x is the time."""
    field = [1, sign * x ** (order - 1) / math.factorial(order - 1)]
    other = [0, 1 if side == "+" else -1]
    above, below = (field, other) if side == "+" else (other, field)
    return ns.FilippovSystem([x, y], surface=y, above=above, below=below)


@pytest.mark.parametrize("side", "+-")
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_order_of_contact(order, sign, side):
    found = fold(jordan(order, side, sign), [0, 0], side=side)
    assert found.order == order
    expected = np.zeros(7)
    expected[order] = sign
    np.testing.assert_allclose(found.lie, expected, atol=1e-14)
    if order == 2:
        assert found.kind == ("visible" if (sign > 0) == (side == "+") else "invisible")
    else:
        assert found.kind == ("cusp" if order == 3 else "degenerate")


@given(st.floats(-3, 3), st.floats(0.2, 5), st.floats(0.2, 5))
def test_cusp_of_a_curved_surface_in_rotated_coordinates(angle, speed, scale):
    """The orbit t -> (t, t^3) of the field meets the surface y = 0, both bent and rotated."""
    c, s = math.cos(angle), math.sin(angle)
    u, v = c * x + s * y, -s * x + c * y  # straight coordinates
    h = scale * (v - u**2)  # surface v = u^2
    rate = [speed * 1, speed * (2 * u + 3 * u**2)]  # v = u^2 + u^3 along it
    f = [c * rate[0] - s * rate[1], s * rate[0] + c * rate[1]]
    system = ns.FilippovSystem([x, y], surface=h, above=f, below=[s, -c])
    found = fold(system, [0, 0])
    assert (found.order, found.kind) == (3, "cusp")
    assert found.lie[3] == pytest.approx(6 * scale * speed**3, rel=1e-9)


@pytest.mark.parametrize("start", [(0.02, -0.03), (-0.3, 0.1), (0.1, 0.0)])
@pytest.mark.parametrize("bend", [1.0, 0.3, -0.7])
def test_searching_a_cusp_of_the_plane(start, bend):
    u, v = x + y / 3, y - x / 3
    rate = 2 * bend * u + 3 * u**2  # v = bend u^2 + u^3 along F1
    system = ns.FilippovSystem(
        [x, y],
        surface=v - bend * u**2,
        above=[0.9 * (1 - rate / 3), 0.9 * (1 / 3 + rate)],
        below=[0, -1],
    )
    assert fold(system, [0, 0]).order == 3
    found = find_fold(system, start)
    assert found.kind == "cusp"
    np.testing.assert_allclose(found.point, 0, atol=1e-6)


def test_visible_means_that_the_orbit_stays_on_its_side():
    system = ns.FilippovSystem([x, y], surface=y, above=[1, ca.sin(x)], below=[1, ca.sin(x) + 2])
    for start, kind, sign in ((0.2, "visible", 1), (3.0, "invisible", -1)):
        found = find_fold(system, [start, 0.1])
        assert found.kind == kind
        for step in (-0.1, 0.1):
            after = ns.flow.follow(system, found.point, step, mode="+").x[-1]
            assert np.sign(after[1]) == sign


def test_search_reports_where_it_went():
    system = ns.FilippovSystem([x, y, z], surface=x + y**2, above=[z - 1, y, 1], below=[1, z, x])
    found = find_fold(system, [0.1, 0.2, 0.8])
    h, l1 = found.point[0] + found.point[1] ** 2, found.point[2] - 1 + 2 * found.point[1] ** 2
    assert abs(h) < 1e-15 and abs(l1) < 1e-15
    assert found.residual < 1e-15 and 0 < found.iterations < 8
    assert found.distance == pytest.approx(np.linalg.norm(found.point - [0.1, 0.2, 0.8]))
    held = find_fold(system, [0.1, 0.2, 0.8], hold=["y"])
    np.testing.assert_allclose(held.point, [-0.04, 0.2, 0.92], atol=1e-15)
    # the least-norm search goes no farther, up to the curvature of the set of folds
    assert found.distance <= held.distance * 1.05


def test_both_sides_and_what_the_other_field_does():
    system = ns.FilippovSystem([x, y], surface=y, above=[1, x - 1], below=[1, x + 1])
    above, below = find_fold(system, [0.5, 0]), find_fold(system, [0.5, 0], side="-")
    np.testing.assert_allclose(above.point, [1, 0], atol=1e-15)
    np.testing.assert_allclose(below.point, [-1, 0], atol=1e-15)
    assert (above.kind, below.kind) == ("visible", "invisible")
    assert above.other == pytest.approx(2) and below.other == pytest.approx(-2)


def test_words():
    assert str(fold(jordan(2), [0, 0])) == (
        "F1 (above) at [0.0, 0.0]: visible fold of order 2, L^2 h = 1."
    )
    assert "F2 (below) at [0.0, 0.0]: cusp of order 3" in str(
        fold(jordan(3, "-"), [0, 0], side="-")
    )
    assert "degenerate tangency of order 5" in str(fold(jordan(5), [0, 0]))
    inside = ns.FilippovSystem([x, y], surface=y, above=[1, 0], below=[1, 1])
    found = fold(inside, [0, 0])
    assert found.order is None and found.kind == "degenerate"
    assert "no nonzero derivative of h along it up to order 6" in str(found)
    rest = ns.FilippovSystem([x, y], surface=y, above=[y, -x], below=[1, 1])
    assert fold(rest, [0, 0]).order is None  # a boundary equilibrium
    assert "from the start" in str(find_fold(jordan(2), [0.5, 0.1]))


def test_explicit_time():
    system = ns.FilippovSystem([x, y], surface=y - ca.sin(t), above=[1, 0], below=[0, 2], time=t)
    found = fold(system, [0, 1.0], t=math.pi / 2)  # the surface turns back: h'' = sin t = 1
    assert (found.order, found.kind) == (2, "visible")
    assert found.lie[2] == pytest.approx(1)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda s: fold(s, [0.5, 0]), ns.PointError, "L1 = 0.5"),
        (lambda s: fold(s, [0.5, 0.1]), ns.PointError, "h = 0.1"),
        (lambda s: fold(s, [0, 0], max_order=1), ns.DefinitionError, "max_order"),
        (lambda s: find_fold(s, [0, math.nan]), ns.PointError, "finite"),
        (lambda s: find_fold(s, [0, 0, 0]), ns.PointError, "point.*shape"),
        (lambda s: find_fold(s, [0, 0], hold="x"), ns.DefinitionError, "free states"),
        (lambda s: find_fold(s, [0, 0], parameters={"q": 1}), ns.ParameterError, "'q'"),
        (lambda s: find_fold(s, [0, 0], side="-"), ns.ConvergenceError, "fold of F2"),
        (lambda s: find_fold(s, [0, 0], tol=math.nan), ns.OptionError, "tol"),
    ],
)
def test_bad_input(call, error, message):
    with pytest.raises(error, match=message):
        call(jordan(2))


def test_a_search_for_a_fold_that_ends_at_an_equilibrium_says_so():
    """v' = 1000 (1 - x^2) v - x - sgn(v)/2 rests at x = -1/2 above; the search ends some 1e-21 beside it."""
    v = ca.SX.sym("v")
    field = [v, 1000 * (1 - x**2) * v - x]
    stuck = ns.FilippovSystem(
        [x, v], surface=v, above=[v, field[1] - 0.5], below=[v, field[1] + 0.5]
    )
    found = ns.find_fold(stuck, [-0.4, 0.0])
    assert found.point == pytest.approx([-0.5, 0.0], abs=1e-12)
    assert (found.order, found.kind) == (None, "degenerate")
