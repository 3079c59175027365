"""Derivatives at samples, forward and back, agree with one another, with closed forms and with differences."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import values_of

CASES = values_of("cases/samples.json")
x, y, v, w, t, a, b, r, k, lam = (ca.SX.sym(s) for s in "x y v w t a b r k lam".split())


def numbers(rows) -> np.ndarray:
    return np.array(rows, float)


def test_a_bouncing_ball_has_the_derivatives_of_the_closed_form_at_its_samples() -> None:
    g, data = ca.SX.sym("g"), ca.SX.sym("data")
    ball = ns.FilippovSystem(
        [y, v], field=[v, -g], impacts=ns.Impact(y, restitution=r), parameters={r: 0.8, g: 2.0}
    )
    values = CASES["SE1"]
    run = ns.simulate(ball, [1.0, 0.5], 7.0, t_eval=numbers(values["times"]), tol=1e-14)
    found = ns.sensitivity(run)
    assert np.abs(run.sample_x - numbers(values["x(t)"])).max() < 1e-13
    both = np.concatenate([found.dsample_dx0, found.dsample_dp], axis=2)
    exact = numbers(values["d(y,v)(t)/d(y0,v0,r,g)"])
    assert np.abs(both - exact).max() < 1e-12 * np.abs(exact).max()
    cost = ns.gradient(run, (y - data) ** 2 / 2, samples={data: numbers(values["data"])})
    assert cost.value == pytest.approx(float(values["cost"]), rel=1e-12)
    slopes = [*cost.x0, cost.parameters["r"], cost.parameters["g"]]
    assert slopes == pytest.approx(numbers(values["gradient of the cost"]), rel=1e-11)


def network(count: int, rng: np.random.Generator) -> ns.FilippovSystem:
    """x' = -x + W relu(x) + V sgn(x) + c, all entries parameters."""
    states = ca.SX.sym("x", count)
    big, small, c = (ca.SX.sym(s, count * m) for s, m in (("W", count), ("V", count), ("c", 1)))
    signs = [ca.SX.sym(f"s{i}") for i in range(count)]
    relu = states * (1 + ca.vertcat(*signs)) / 2
    rate = -states + ca.reshape(big, count, count) @ relu + c
    rate += ca.reshape(small, count, count) @ ca.vertcat(*signs)
    given = ca.vertsplit(ca.vertcat(big, small, c))
    sizes = np.repeat([1.2, 0.1, 0.3], [count**2, count**2, count])
    return ns.FilippovSystem(
        ca.vertsplit(states),
        field=ca.vertsplit(rate),
        multipliers=signs,
        surfaces=ca.vertsplit(states),
        parameters=dict(zip(given, sizes * rng.normal(size=len(sizes)), strict=True)),
    )


def test_a_network_has_the_gradient_of_the_reference() -> None:
    values = CASES["SE4"]
    system = network(3, np.random.default_rng(0))
    parts = [numbers(values[n]) for n in "WVb"]
    p = np.concatenate([part.T.ravel() for part in parts])
    given = dict(zip(system.parameter_names, p, strict=True))
    start, times = [0.5, -0.4, 0.3], numbers(values["samples at"])
    run = ns.simulate(system, start, 5.0, t_eval=times, parameters=given, tol=1e-14)
    by_start, by_parameters = ns.vjp(run, samples=run.sample_x)
    assert by_start == pytest.approx(numbers(values["dcost/dx0"]), rel=1e-10)
    by_w, by_v = (by_parameters[9 * i : 9 * i + 9].reshape(3, 3).T for i in (0, 1))
    assert by_w[0] == pytest.approx(numbers(values["dcost/dW row 1"]), rel=1e-10)
    assert by_v[1] == pytest.approx(numbers(values["dcost/dV row 2"]), rel=1e-10)
    assert by_parameters[18:] == pytest.approx(numbers(values["dcost/db"]), rel=1e-10)


def test_no_program_is_made_for_a_mode() -> None:
    rng = np.random.default_rng(0)
    system = network(6, rng)
    run = ns.simulate(system, rng.normal(size=6), 6.0, t_eval=np.linspace(1.0, 6.0, 5))
    assert len({s.mode for s in run.segments}) > 4
    ns.vjp(run, samples=run.sample_x)
    kinds = {key[0] for key in system._cache._values if isinstance(key, tuple)}
    assert not kinds & {"explicit", "motion", "variational field", "plain field", "event map"}


SLIDER = ns.FilippovSystem(  # a surface that is crossed, slid on, and left
    [x, y],
    surface=y,
    above=[1 + a * y**2, -1 - b * x + x**2 / 2],
    below=[1 + y * x, 2 + b * y - x],
    parameters={a: 0.3, b: 0.7},
)


def test_samples_at_an_event_are_on_the_side_of_their_states() -> None:
    """A mass that starts at the height 1 hits the floor with v = -2 at t = 1, where it jumps to 1."""
    mass = ns.FilippovSystem(
        [y, v], field=[v, -2.0], resets=ns.Reset(y, [y, -r * v], -1), parameters={r: 0.5}
    )
    before, at, after = [
        ns.simulate(mass, [1.0, 0.0], 1.5, t_eval=[1.0 + d]) for d in (-1e-9, 0, 1e-9)
    ]
    near = [ns.sensitivity(run).dsample_dx0[0] for run in (before, at, after)]
    assert at.events[0].t == 1.0 and np.array_equal(at.sample_x[0], at.events[0].x_after)
    assert np.abs(near[1] - near[2]).max() < 1e-8 < np.abs(near[1] - near[0]).max()
    assert ns.vjp(at, samples=[[1.0, 2.0]])[0] == pytest.approx([1.0, 2.0] @ near[1])
    end = ns.simulate(mass, [1.0, 0.0], 1.0, t_eval=[1.0])  # the run ends at the very event
    assert np.abs(ns.sensitivity(end).dsample_dx0[0] - near[1]).max() < 1e-12
    assert ns.vjp(end, samples=[[1.0, 2.0]])[0] == pytest.approx([1.0, 2.0] @ near[1])
    section = ns.simulate(mass, [1.0, 0.0], 1.5, at="reset")
    with pytest.raises(ns.OptionError, match="samples at events"):
        ns.vjp(section, samples=[[1.0, 0.0]])
    assert np.array_equal(section.sample_x[0], section.events[0].x)
    assert np.abs(ns.sensitivity(section).dsample_dx0[0] - near[0]).max() < 1e-8


def test_samples_after_an_early_end_have_no_derivatives() -> None:
    fall = ns.FilippovSystem([x, y], field=[y, -a], stops=ns.Stop(x, -1), parameters={a: 2.0})
    run = ns.simulate(fall, [1.0, 0.0], 9.0, t_eval=[0.5, 5.0])  # x = x0 - a t^2/2
    s = ns.sensitivity(run)
    assert s.dsample_dp[0] == pytest.approx(np.array([[-0.125], [-0.5]]))
    assert np.isnan(s.dsample_dx0[1]).all() and np.isnan(s.dsample_dp[1]).all()
    assert ns.vjp(run, samples=[[1.0, 0.0], [0.0, 0.0]])[1] == pytest.approx([-0.125])
    with pytest.raises(ns.PointError, match="after the end"):
        ns.vjp(run, samples=[[1.0, 0.0], [1.0, 0.0]])
    with pytest.raises(ns.DegenerateError, match="not finite"):
        ns.gradient(run, x**2, samples={})


def test_what_is_no_cotangent_raises() -> None:
    data = ca.SX.sym("data")
    run = ns.simulate(SLIDER, [-1.0, 0.9], 1.0, t_eval=[0.5, 1.0])
    plain = ns.simulate(SLIDER, [-1.0, 0.9], 1.0)
    with pytest.raises(ns.OptionError, match="cotangent is missing"):
        ns.vjp(run)
    with pytest.raises(ns.PointError, match=r"samples has shape \(2,\)"):
        ns.vjp(run, samples=[1.0, 2.0])
    with pytest.raises(ns.PointError, match="not finite"):
        ns.vjp(run, samples=[[np.nan, 0.0], [0.0, 0.0]])
    with pytest.raises(ns.OptionError, match="no samples"):
        ns.vjp(plain, samples=[[1.0, 2.0]])
    with pytest.raises(ns.OptionError, match="no samples"):
        ns.gradient(plain, x, samples={})
    with pytest.raises(ns.OptionError, match=r"shape \(3,\)"):
        ns.gradient(run, x - data, samples={data: [1.0, 2.0, 3.0]})
    with pytest.raises(ns.OptionError, match="mapping"):
        ns.gradient(run, x - data, samples=[1.0, 2.0])  # type: ignore[arg-type]
    with pytest.raises(ns.DefinitionError, match="stranger"):
        ns.gradient(run, x - data + ca.SX.sym("stranger"), samples={data: [1.0, 2.0]})
    assert ns.sensitivity(plain).dsample_dx0 is None


def stribeck() -> ns.FilippovSystem:
    """A block on a belt, whose friction falls from s to c with the slip."""
    s, c, q = (ca.SX.sym(n) for n in "scq")
    slip = v - 1
    force = (c + (s - c) / (1 + (slip / q) ** 2)) * lam
    return ns.FilippovSystem(
        [x, v],
        field=[v, -x - force],
        multipliers=lam,
        surface=slip,
        parameters={s: 1.2, c: 0.4, q: 0.5},
    )


def test_three_friction_parameters_are_fitted_to_two_hundred_points() -> None:
    from scipy.optimize import least_squares

    system, times = stribeck(), np.linspace(0.1, 20.0, 200)
    run = ns.simulate(system, [1.2, 1.0], 20.0, t_eval=times)
    assert "s" in run.itinerary and len(run.events) > 4
    data = run.sample_x[:, 0] + 0.01 * np.random.default_rng(5).normal(size=200)

    def fitted(p: np.ndarray) -> ns.Trajectory:
        given = dict(zip("scq", p, strict=True))
        return ns.simulate(system, [1.2, 1.0], 20.0, t_eval=times, parameters=given)

    def residuals(p: np.ndarray) -> np.ndarray:
        return fitted(p).sample_x[:, 0] - data

    def slopes(p: np.ndarray) -> np.ndarray:
        return ns.sensitivity(fitted(p)).dsample_dp[:, 0]

    start = [1.15, 0.45, 0.45]
    options = dict(xtol=1e-12, ftol=1e-14, gtol=1e-10)
    exact = least_squares(residuals, start, slopes, **options)
    plain = least_squares(residuals, start, "3-point", **options)
    assert exact.x == pytest.approx(plain.x, rel=1e-6)
    assert np.abs(exact.x - [1.2, 0.4, 0.5]).max() < 0.05
    symbol, best = ca.SX.sym("data"), fitted(exact.x)
    cost = ns.gradient(best, (x - symbol) ** 2 / 2, samples={symbol: data})
    assert cost.value == pytest.approx(exact.cost, rel=1e-12)
    assert list(cost.parameters.values()) == pytest.approx(exact.grad, abs=1e-9)


def test_a_run_back_in_time_has_derivatives_too() -> None:
    """A rotation about (-a, 0) by -1, along one mode."""
    rotation = ns.FilippovSystem(
        [x, v], surface=v, above=[v, -x - a], below=[v, -x + a], parameters={a: 0.3}
    )
    run = ns.flow.follow(rotation, [1.0, -0.5], -1.0, mode="-")
    c, s = np.cos(1.0), np.sin(1.0)
    found = ns.sensitivity(run)
    assert np.abs(found.dx_dx0 - [[c, -s], [s, c]]).max() < 1e-14
    by_start, by_a = ns.vjp(run, [1.0, 0.0])
    assert by_start == pytest.approx([c, -s], rel=1e-14) and by_a == pytest.approx([1 - c])
