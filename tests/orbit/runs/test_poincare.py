"""Returns to a section and their derivatives are those of closed forms and of differences."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import CASES, welander

x, y, v, t, k0, lam = (ca.SX.sym(s) for s in ("x", "y", "v", "t", "T", "lam"))


def test_welanders_box_returns_with_its_period_and_multiplier():
    """R5: from a start off the orbit; the derivative of a return has the orbit's multiplier and 0."""
    values = CASES["R5"]
    found = ns.orbit.poincare(welander(), "h0", [0.87, 0.69], count=25, tol=1e-13)
    assert np.diff(found.t)[-1] == pytest.approx(float(values["period"]), rel=1e-10)
    assert np.allclose(found.points[-1][0], float(values["T_end_k0"]), rtol=1e-9)
    multipliers = np.sort(np.abs(np.linalg.eigvals(found.jacobian(24))))
    assert multipliers == pytest.approx([0.0, float(values["multiplier"])], abs=1e-8)


def test_derivatives_through_events_are_those_of_differences():
    dry = ns.FilippovSystem(
        [x, v],
        surface=v,
        multipliers=lam,
        field=[v, ca.cos(1.3 * t) - x - 0.3 * lam],
        time=t,
        resets=ns.Reset(x - 0.9, [x, -0.7 * v], 1, "wall"),
    )
    start = np.array([0.2, 0.4])
    for section, options in (
        (x, {}),
        ("wall", {}),
        (ns.Section("wall", after=True), {}),
        (2.0, {}),
    ):
        found = ns.orbit.poincare(dry, section, start, count=3, tol=1e-13, **options)
        h, columns = 1e-6, []
        for i in range(2):
            ends = [
                ns.orbit.poincare(
                    dry, section, start + s * h * np.eye(2)[i], count=3, tol=1e-13
                ).points[1]
                for s in (1, -1)
            ]
            columns.append((ends[0] - ends[1]) / (2 * h))
        assert np.allclose(found.jacobian(1, since=-1), np.array(columns).T, atol=1e-7), section
        if section is not x and not isinstance(section, float):
            continue  # time passes too: derivatives of one return are not those of the states alone
        if isinstance(section, float):
            product = found.jacobian(1) @ found.jacobian(0)
            assert np.allclose(product, found.jacobian(1, since=-1), atol=1e-10)


def test_jacobians_of_returns_multiply():
    system = ns.FilippovSystem(
        [x, v],
        surface=x,
        above=[v, -x],
        below=[v, -4 * x - 0.2 * v],
        resets=ns.Reset(x - 0.5, [x, -0.9 * v], 1, "wall"),
    )
    for section in ("h0", ns.Section("wall"), ns.Section("wall", after=True), v):
        found = ns.orbit.poincare(system, section, [0.1, 1.0], count=5, tol=1e-13)
        whole = found.jacobian(3, since=0)
        product = found.jacobian(3) @ found.jacobian(2) @ found.jacobian(1)
        assert np.allclose(whole, product, atol=1e-9)


def test_a_start_on_the_section_is_no_return_and_returns_can_be_skipped():
    circle = ns.FilippovSystem([x, y], field=[-y, x])
    found = ns.orbit.poincare(circle, y, [1.0, 0.0], count=2, skip=1)
    assert np.allclose(found.t, [4 * math.pi, 6 * math.pi]) and "2 returns to section" in repr(
        found
    )
    both = ns.orbit.poincare(circle, y, [1.0, 0.0], count=2, direction=0)
    assert np.allclose(both.points[:, 0], [-1.0, 1.0]) and both.run.status == ns.Status.STOPPED


def test_a_period_may_be_an_expression_in_parameters():
    forced = ns.FilippovSystem(
        [x], field=[-x + ca.cos(2 * ca.pi * t / k0)], time=t, parameters={k0: 2.0}
    )
    found = ns.orbit.poincare(forced, k0, [0.3], count=3, parameters={"T": 0.5})
    assert np.allclose(found.t, [0.5, 1.0, 1.5])
    assert np.allclose(found.jacobian(2), [[math.exp(-0.5)]], atol=1e-12)


def test_a_run_that_ends_early_has_fewer_returns(tmp_path):
    away = ns.FilippovSystem([x, y], field=[-y, x], stops=ns.Stop(x + 0.5, -1))
    found = ns.orbit.poincare(away, x, [1.0, 0.0], count=4, direction=0)
    assert len(found.t) == 1 and found.run.events[-1].name == "stop"
    with pytest.raises(ns.OptionError, match=r"\bk\b"):
        found.jacobian(1)
    found.save(tmp_path / "orbit")
    again = ns.load(tmp_path / "orbit")
    assert np.array_equal(again.points, found.points)
    assert np.array_equal(again.jacobian(0), found.jacobian(0))


@pytest.mark.parametrize("name", ["h7", "7", "lambda0"])
def test_a_stop_may_have_a_name_like_that_of_a_surface(name):
    system = ns.FilippovSystem([x, v], field=[v, -x], resets=[ns.Reset(x, [x, 0.5 * v], name=name)])
    found = ns.orbit.poincare(system, name, [1.0, 0.0], count=2)
    assert np.allclose(found.points[:, 1], [-1.0, 0.5], atol=1e-9)
