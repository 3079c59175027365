"""One mode's flow is followed both ways in time, and its event functions are reported."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns

x, y, t, lam = (ca.SX.sym(s) for s in ("x", "y", "t", "lam"))
PARABOLA = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[1, 1])


def test_backward_along_a_parabola_to_the_surface():
    run = ns.flow.follow(PARABOLA, [2.0, 0.0], -10.0, mode="+", until="h0", tol=1e-13)
    assert run.status is ns.Status.STOPPED
    assert run.t[-1] == pytest.approx(-4.0, abs=1e-12)
    np.testing.assert_allclose(run.x[-1], [-2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(run(-2.0), [0.0, 2.0], atol=1e-12)


def test_no_switching_and_every_zero_is_reported():
    run = ns.flow.follow(PARABOLA, [-2.0, 0.0], 10.0, mode="+", watch=[x, x - 5])
    assert run.itinerary == "+"
    assert [(e.name, round(e.t, 9)) for e in run.events if e.kind == "zero"] == [
        ("f0", 2.0),
        ("h0", 4.0),
        ("f1", 7.0),
    ]


def test_off_the_surface_the_sliding_field_keeps_its_level():
    run = ns.flow.follow(PARABOLA, [2.0, 1.0], 3.0, mode="s", until=[x - 3])
    np.testing.assert_allclose(run.x[-1], [3.0, 1.0], atol=1e-12)


PENDULUM = ns.FilippovSystem(
    [x, y], field=[y, -ca.sin(x) - lam * (1 + 0.2 * ca.cos(t))], multipliers=lam, surface=y, time=t
)


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 5.0), st.sampled_from("+-s"))
def test_forward_then_backward_is_the_identity(a, b, span, mode):
    there = ns.flow.follow(PENDULUM, [a, b], span, mode=mode, tol=1e-12)
    back = ns.flow.follow(PENDULUM, there.x[-1], 0.0, t_start=span, mode=mode, tol=1e-12)
    np.testing.assert_allclose(back.x[-1], [a, b], atol=1e-9)


def test_wrong_requests_are_refused():
    with pytest.raises(ns.OptionError, match=r"^until .*\['h0'\]"):
        ns.flow.follow(PARABOLA, [0.0, 0.0], 1.0, mode="+", until="h7")
    with pytest.raises(ns.DefinitionError, match="mode"):
        ns.flow.follow(PARABOLA, [0.0, 0.0], 1.0, mode="up")
    with pytest.raises(ns.DefinitionError, match="'q'"):
        ns.flow.follow(PARABOLA, [0.0, 0.0], 1.0, mode="+", watch=[ca.SX.sym("q")])
    with pytest.raises(ns.NotSmoothError):
        ns.flow.follow(PARABOLA, [0.0, 0.0], 1.0, mode="+", until=[ca.fabs(x)])


def test_a_power_law_is_followed_from_its_singular_point():
    """v' = -x^(3/2) from x = 0 keeps v^2/2 + x^(5/2)/2.5."""
    system = ns.FilippovSystem([x, y], field=[y, -x * ca.sqrt(x)])
    run = ns.flow.follow(system, [0.0, 1.0], 10.0, mode="", until=[y], tol=1e-12)
    assert run.x[-1, 0] == pytest.approx(1.25**0.4, abs=1e-10)


def test_sliding_along_a_corner_is_followed_with_both_multipliers():
    """x1' = -s1 + x3/2, x2' = -s2 + x3/4, x3' = 1 + s1 s2/2: x3 = 4 tan(t/4) along the corner."""
    q, kap = ca.SX.sym("q"), ca.SX.sym("kap")
    system = ns.FilippovSystem(
        [x, y, q],
        field=[-lam + q / 2, -kap + q / 4, 1 + lam * kap / 2],
        multipliers=[lam, kap],
        surfaces=[x, y],
    )
    run = ns.flow.follow(system, [0.0, 0.0, 0.0], 1.5, mode="ss", watch=[q - 1], tol=1e-12)
    assert run.x[-1, 2] == pytest.approx(4 * np.tan(1.5 / 4), abs=1e-10)
    (reached,) = [e for e in run.events if e.kind == "zero" and e.name == "f0"]
    assert reached.t == pytest.approx(4 * np.arctan(0.25), abs=1e-10)
    back = ns.flow.follow(system, run.x[-1], 0.0, t_start=1.5, mode="ss", tol=1e-12)
    np.testing.assert_allclose(back.x[-1], 0.0, atol=1e-10)


def test_a_field_that_is_nowhere_defined_ends_the_run():
    root = ns.FilippovSystem([x, y], field=[ca.sqrt(y), -1])
    run = ns.flow.follow(root, [0.0, -1.0], 1.0, mode="")
    assert run.status is ns.Status.NOT_FINITE
    assert "(0, -1)" in run.message
    back = ns.flow.follow(root, [0.0, 0.0], -1.0, mode="")  # x = -2/3 (-t)^(3/2), y = -t
    assert back.status is ns.Status.REACHED_END
    np.testing.assert_allclose(back.x[-1], [-2 / 3, 1.0], atol=1e-10)


def test_a_run_has_no_more_steps_than_were_allowed():
    run = ns.flow.follow(PENDULUM, [1.0, 0.5], 100.0, mode="+", max_steps=3)
    assert run.status is ns.Status.TOO_MANY_STEPS
    assert len(run.steps) == 3


def test_a_mode_with_two_sliding_solutions_is_not_unique():
    """lam kap = 1/4 and lam = kap along the corner: both 1/2 or both -1/2."""
    kap = ca.SX.sym("kap")
    system = ns.FilippovSystem(
        [x, y], surfaces=[x, y], multipliers=[lam, kap], field=[lam * kap - 0.25, lam - kap]
    )
    assert ns.flow.follow(system, [0.0, 0.0], 1.0, mode="ss").status is ns.Status.NON_UNIQUE
