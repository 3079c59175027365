"""Sliding on intersections and hidden dynamics follow the closed forms of their multipliers."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, w, lam, kap, b = (ca.SX.sym(s) for s in ("x", "y", "z", "w", "lam", "kap", "b"))
BILINEAR = ns.FilippovSystem(
    [x, y, z],
    field=[-lam + z / 2, -kap + z / 4, 1 + lam * kap / 2],
    multipliers=[lam, kap],
    surfaces=[x, y],
)


def test_bilinear_law_leaves_the_intersection_at_its_closed_form():
    """x1' = -s1 + x3/2, x2' = -s2 + x3/4, x3' = 1 + s1 s2/2: s1 = 1 at t = 4 atan(1/2)."""
    run = ns.simulate(BILINEAR, [0.0, 0.0, 0.0], 2.5, tol=1e-13)
    assert run.itinerary == "ss +s"
    assert run.events[0].kind == "exit"
    assert run.events[0].t == pytest.approx(4 * np.arctan(0.5), abs=1e-12)
    times = np.linspace(0, run.events[0].t, 20)
    np.testing.assert_allclose(run(times)[:, 2], 4 * np.tan(times / 4), atol=1e-11)
    np.testing.assert_allclose(run(times)[:, :2], 0.0, atol=1e-12)
    # Beyond, x1' = -1 + x3/2 with s2 = x3/4 still sliding: x3' = 1 + x3/8.
    s = 2.5 - run.events[0].t
    assert run.x[-1, 2] == pytest.approx(-8 + 10 * np.exp(s / 8), abs=1e-10)


@pytest.mark.parametrize("damping", [0.5, 0.0, -0.5])
def test_orbits_around_an_intersection_that_no_layer_attracts_to(damping):
    """x' = -sgn y - c x, y' = sgn x - c y: squares for c = 0, which only a bend of second order closes in on."""
    system = ns.FilippovSystem(
        [x, y],
        field=[-kap - damping * x, lam - damping * y],
        multipliers=[lam, kap],
        surfaces=[x, y],
    )
    # of |x| + |y| = s, s' = -c s between the axes
    run = ns.simulate(system, [0.3, 0.1], 2.0, tol=1e-12)
    assert np.abs(run.x[-1]).sum() == pytest.approx(0.4 * np.exp(-2 * damping), abs=1e-10)


@pytest.mark.parametrize("turns", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_curved_intersection_does_not_drift(turns):
    """Held on a sphere and a plane, carried around the circle at unit speed for many turns."""
    radius = x**2 + y**2 + w**2 - 1
    field = [-y - lam * x, x - lam * y, -lam * w - kap]
    system = ns.FilippovSystem([x, y, w], field=field, multipliers=[lam, kap], surfaces=[radius, w])
    t_end = 2 * turns * np.pi
    run = ns.simulate(system, [1.0, 0.0, 0.0], t_end, tol=1e-12)
    assert run.itinerary == "ss"
    assert np.abs(np.linalg.norm(run.x, axis=1) - 1).max() < 1e-12
    np.testing.assert_allclose(run.x[-1], [1.0, 0.0, 0.0], atol=1e-8)


def test_nonlinear_multipliers_need_hidden_true():
    with pytest.raises(ns.DefinitionError, match="hidden=True"):
        ns.FilippovSystem([x], field=[lam**3], multipliers=lam, surface=x)


def test_the_ambiguity_of_the_exit_is_reported():
    """Among all Filippov solutions of the bilinear example the exit lies in [1.4586, 2.4434].

    x1 leaves when x3 = 2; x3' ranges over [1/2 + 3 x3/8, 3/2 - x3/8] on the way, so the extreme
    times are 8 log(6/5) and (8/3) log(5/2), and the bilinear law is in between.
    """
    for height in (0.0, 0.7, 1.9):
        low, high = ns.local.intersection_range(BILINEAR, [0.0, 0.0, height], of=z)
        assert low == pytest.approx(0.5 + 3 * height / 8, abs=1e-12)
        assert high == pytest.approx(1.5 - height / 8, abs=1e-12)
        assert low <= 1 + height**2 / 16 <= high
    extremes = 8 * np.log(1.2), 8 / 3 * np.log(2.5)
    np.testing.assert_allclose(extremes, [1.45857245435163701, 2.44344195166441351], rtol=1e-15)
    run = ns.simulate(BILINEAR, [0.0, 0.0, 0.0], 2.5)
    assert extremes[0] < run.events[0].t < extremes[1]


def test_no_motion_along_an_intersection_has_no_range():
    system = ns.FilippovSystem(
        [x, y], field=[2 + lam, kap], multipliers=[lam, kap], surfaces=[x, y]
    )
    with pytest.raises(ns.PointError, match="intersection"):
        ns.local.intersection_range(system, [0.0, 0.0], of=x)
