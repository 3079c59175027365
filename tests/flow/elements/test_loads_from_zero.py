"""Friction whose bound begins at zero like a power of the time: closed forms of slip and stick."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

v, y, multiplier = ca.SX.sym("v"), ca.SX.sym("y"), ca.SX.sym("lambda")
TOL = 1e-10


def run(pull, load, t_end=1.0, start=(0.0, 0.0)):
    """v' = pull - load lambda and y' = 1, with lambda in sgn v."""
    system = ns.FilippovSystem(
        [v, y], field=[pull - load * multiplier, 1], surfaces=[v], multipliers=[multiplier]
    )
    return ns.simulate(system, start, t_end, tol=TOL)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("power", [0.25, 0.5, 1.0, 1.5, 2.0, 2.5])
@pytest.mark.parametrize("growth", [0.0, 0.5, 1.0, 1.5, 2.0, 3.0])
def test_what_grows_faster_decides(power, growth, side):
    """With pull c t^q and load k t^p: slip if q < p, until t^(p - q) = c (p + 1) / (k (q + 1)); else stick."""
    c, k = 0.5, 2.0
    result = run(side * c * (y**growth if growth else 1), k * y**power)
    assert result.status is ns.Status.REACHED_END
    if growth >= power:
        assert (result.itinerary, result.x[-1, 0]) == ("s", 0)
        return
    assert result.itinerary == ("+ s" if side > 0 else "- s")
    stick = (c * (power + 1) / (k * (growth + 1))) ** (1 / (power - growth))
    braking = k * stick**power - c * stick**growth
    assert result.events[0].t == pytest.approx(stick, abs=10 * TOL / braking)


@pytest.mark.parametrize("side", [1, -1])
def test_a_bound_that_rounding_has_left_below_zero(side):
    """The load y^(3/2) - G from a root of which rounding makes -1e-17."""
    for g in (0.1, 0.3, 0.7, 1e-3):
        for shift in range(-2, 3):
            root = g ** (2 / 3) * (1 + shift * np.finfo(float).eps)
            result = run(side * 0.1 * (y - root), y**1.5 - g, start=(0.0, root))
            assert (result.itinerary, result.status) == ("s", ns.Status.REACHED_END)
