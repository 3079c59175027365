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


@pytest.mark.parametrize("power", [0.5, 1.0, 1.5, 2.0])
def test_without_a_pull_it_sticks(power):
    result = run(0, y**power)
    assert (result.itinerary, result.status) == ("s", ns.Status.REACHED_END)
    assert np.abs(result.x[:, 0]).max() == 0


@pytest.mark.parametrize("side", [1, -1])
def test_a_bound_that_rounding_has_left_below_zero(side):
    """The load y^(3/2) - G from a root of which rounding makes -1e-17."""
    for g in (0.1, 0.3, 0.7, 1e-3):
        for shift in range(-2, 3):
            root = g ** (2 / 3) * (1 + shift * np.finfo(float).eps)
            result = run(side * 0.1 * (y - root), y**1.5 - g, start=(0.0, root))
            assert (result.itinerary, result.status) == ("s", ns.Status.REACHED_END)


@pytest.mark.parametrize("g", [1e-6, 1e-3, 1e-2])
def test_a_stop_at_the_zero_of_the_load_comes_before_the_end_of_sticking(g):
    """The load falls to zero at depth g^(2/3); both functions have that root to rounding."""
    depth, speed, lam = ca.SX.sym("y"), ca.SX.sym("w"), multiplier
    load = depth**1.5 - g
    system = ns.FilippovSystem(
        [v, depth, speed],
        field=[-load * lam, speed, -load],
        surfaces=[v],
        multipliers=[lam],
        stops=[ns.Stop(load / (depth**1.5 + g), -1, "lift-off")],
    )
    result = ns.simulate(system, [0.0, g ** (2 / 3), 1.0], 10.0, tol=1e-11)
    assert (result.itinerary, result.status) == ("s", ns.Status.STOPPED)
    assert result.x[-1] == pytest.approx([0, g ** (2 / 3), -1], abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.5, 2.0])
def test_slip_that_begins_and_ends_within_a_step(angle):
    """In the plane h' = (2 - s) e - lambda, s' = 1: slip t - t^2/2 until t = 2, then |(2 - s) e| < 1 to s = 3."""
    h, lam, s = ca.SX.sym("h", 2), ca.SX.sym("l", 2), ca.SX.sym("s")
    e = np.array([np.cos(angle), np.sin(angle)])
    system = ns.FilippovSystem(
        [h[0], h[1], s],
        field=[(2 - s) * e[0] - lam[0], (2 - s) * e[1] - lam[1], 1],
        surfaces=[[h[0], h[1]]],
        multipliers=[[lam[0], lam[1]]],
    )
    result = ns.simulate(system, [0, 0, 0], 3.5, tol=TOL)
    assert (result.itinerary, result.status) == ("* s *", ns.Status.REACHED_END)
    assert [event.t for event in result.events[:2]] == pytest.approx([2, 3], abs=100 * TOL)
    left = 0.5 * 0.5**2  # from s = 3, (s - 3) against e
    assert result.x[-1, :2] == pytest.approx(-left * e, abs=100 * TOL)
