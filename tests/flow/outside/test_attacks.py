"""Inputs on which a run or a derivative was silently wrong, against differences and closed forms."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.differences import require

x, y, v, a, lam, kap, time = (ca.SX.sym(n) for n in ("x", "y", "v", "a", "lam", "kap", "time"))


def _root(force, power, jump):
    """A body that falls on a spring with the law force * depth^power, and a jump of its load there."""
    return ns.FilippovSystem(
        [x, v], surface=x, above=[v, -1], below=[v, jump - 1 + force * (-x) ** power]
    )


@pytest.mark.parametrize(("power", "jump"), [(1.5, 0.5), (1.5, 0.0), (0.5, 0.5)])
def test_derivatives_through_the_zero_of_a_power(power, jump):
    require(_root(9.0, power, jump), [0.5, 0.0], 1.2, h=1e-5, tol=1e-12, within=2e-6)


@pytest.mark.parametrize(("power", "within"), [(0.25, 1e-7), (0.3, 1e-7), (0.5, 1e-9)])
@pytest.mark.parametrize("begins", [0.0, -0.3])
def test_derivatives_where_damping_grows_like_a_power(power, within, begins):
    """v + c x^(1 + power) is constant while x > 0; from x = 0 on the leg begins where the power has no slope."""
    c = 0.7 / (1 + power)
    system = ns.FilippovSystem([x, v], surface=x, above=[v, -0.7 * x**power * v], below=[v, 0])
    run = ns.simulate(system, [begins, 1.0], 1.0, tol=1e-13)
    found, end = ns.sensitivity(run).dx_dx0, run.x[-1, 0]
    nodes, weights = np.polynomial.legendre.leggauss(60)
    s = (end ** (1 / 8) * (nodes + 1) / 2, end ** (1 / 8) / 2 * weights)
    time = float(s[1] @ (8 * s[0] ** 7 / (1 - c * s[0] ** (8 * (1 + power))) ** 2))
    speed = 1 - c * end ** (1 + power)
    of_x = speed * np.array([1.0, time - begins])  # by the start and by the speed there
    exact = [of_x, np.array([0.0, 1.0]) - 0.7 * end**power * of_x]
    np.testing.assert_allclose(found, exact, rtol=0, atol=within if begins else 1e-11)


def test_derivatives_that_are_not_resolved_are_refused():
    surface = x + 0.1 * v**2
    below = [v, -0.7 + 9 * (-surface) ** (1 / 3) - 0.3 * v]
    run = ns.simulate(
        ns.FilippovSystem([x, v], surface=surface, above=[v, -1], below=below), [0.5, 0], 2.5
    )
    with pytest.raises(ns.DegenerateError, match="not resolved"):
        ns.sensitivity(run)


def test_rest_after_infinitely_many_events_depends_on_nothing_but_its_begin():
    twisting = ns.FilippovSystem(
        [x, v], field=[v, -2 * lam - 0.9 * kap], surfaces=[x, v], multipliers=[lam, kap]
    )
    run = ns.simulate(twisting, [1.0, 0.1], 9.0)
    assert run.x[-1].tolist() == [0, 0]
    found = ns.sensitivity(run)
    np.testing.assert_allclose(found.dx_dx0, 0, rtol=0, atol=1e-15)
    ends = [ns.simulate(twisting, [1.0 + s, 0.1], 9.0).events[-2].t for s in (1e-5, -1e-5)]
    np.testing.assert_allclose(found.dt_dx0[-1, 0], (ends[0] - ends[1]) / 2e-5, rtol=1e-6)


def test_derivatives_of_rest_on_a_curve():
    # x = sin(a t) at rest, also where a changes: the speed that it starts with is a
    curve = ns.FilippovSystem(
        [x, v, y], field=[v, -3 * lam, a], surfaces=[x - ca.sin(y)], multipliers=[lam],
        parameters={a: 1.0},
    )  # fmt: skip
    found = ns.sensitivity(ns.simulate(curve, [0.0, 1.0, 0.0], 1.0))
    expected = [[math.cos(1)], [math.cos(1) - math.sin(1)], [1]]
    np.testing.assert_allclose(found.dx_dp, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("values", ["now", "trigger"])
def test_derivatives_of_a_map_of_the_state_at_its_trigger(values):
    resets = [
        ns.Reset(x - 1, {y: y**2 + x}, 1, "one"),
        ns.Reset(x - 1, {x: x - 1.5 + 0.3 * y}, 1, "two", values=values),
    ]
    system = ns.FilippovSystem([x, y], field=[1, 0.7 * x - y], resets=resets)
    if values == "now":
        require(system, [0.0, 0.5], 1.4)
        return
    with pytest.raises(ns.DegenerateError, match="trigger"):
        ns.sensitivity(ns.simulate(system, [0.0, 0.5], 1.4))
