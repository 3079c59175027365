"""Linear systems, whose series are longer, keep the tolerance and every event of the closed form."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.engine import find_compiler, interpreter_for
from nonsmooth.flow.options import Options

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

x, v, t, lam = (ca.SX.sym(name) for name in ("x", "v", "t", "lam"))


def oscillator(surface, push=0.0):
    """x'' = -x + push - lam, with a force of lam that the surface switches."""
    return ns.FilippovSystem(
        [x, v], surface=surface, multipliers=lam, field=[v, -x + push - 0.1 * lam], time=t
    )


def test_orders_are_higher_where_all_is_linear_and_of_one_surface():
    order = lambda system, tol: interpreter_for(system, Options(1.0, rtol=tol, atol=tol)).order
    linear, bent = oscillator(v - 9.0), oscillator(v + x**2 - 9.0)
    usual = Options(1.0, rtol=1e-6).order
    assert order(bent, 1e-6) == usual and 3 * order(linear, 1e-6) == 4 * usual
    assert order(linear, 1e-16) == order(bent, 1e-16) > 22 >= order(linear, 1e-13)
    two = ns.FilippovSystem(
        [x, v], surfaces=[v - 9.0, x - 9.0], multipliers=[lam, t], field=[v, -x - lam - t]
    )
    assert order(two, 1e-6) == usual


@pytest.mark.parametrize("tol", [1e-4, 1e-7, 1e-10, 1e-13, 1e-15])
def test_forced_motion_keeps_the_tolerance(tol):
    """x'' = -x + cos(2 t) + 0.1 below the surface: x = .1 + A cos t + B sin t - cos(2 t) / 3."""
    run = ns.simulate(oscillator(v - 9.0, ca.cos(2 * t)), [1.0, 0.5], 200.0, tol=tol)
    a = 1.0 - 0.1 + 1 / 3
    exact = lambda s: 0.1 + a * np.cos(s) + 0.5 * np.sin(s) - np.cos(2 * s) / 3
    assert abs(run.x[-1, 0] - exact(200.0)) < 20 * tol + 2e-13
    between = np.linspace(0.0, 200.0, 3001)
    assert np.abs(run(between)[:, 0] - exact(between)).max() < 20 * tol + 2e-13


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_grazing_is_seen_on_one_side_only(gap):
    """x = .1 + cos(t + phase) comes to 1.1 once a turn, near any place of a step."""
    for phase in np.linspace(0.3, 6.0, 12):
        start = [0.1 + np.cos(phase), -np.sin(phase)]
        clear = ns.simulate(oscillator(x - 1.1 - gap), start, 40.0, tol=1e-12)
        assert len(clear.events) == 1 and clear.status is ns.Status.REACHED_END
        reached = ns.simulate(oscillator(x - 1.1 + gap), start, 2 * np.pi, tol=1e-12)
        expected = 2 * np.pi - phase - np.arccos(1.0 - gap)
        assert reached.events[0].kind == "crossing"
        assert abs(reached.events[0].t - expected) < 1e-12 / np.sqrt(gap) + 1e-12
