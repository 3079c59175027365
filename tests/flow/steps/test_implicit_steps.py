"""Implicit steps: cases with 22 digits from collocation in 66 digits, closed forms, and when they are taken."""

import json
import re
from pathlib import Path

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import nonsmooth as ns
from testset.problem import Problem

CASES = {
    case["id"]: case
    for case in json.loads((Path("tests") / "cases" / "stiff.json").read_text())["cases"]
}
x, v, f, t, lam = (ca.SX.sym(name) for name in ("x", "v", "f", "t", "lam"))
RATE = 1e6


@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("name", CASES)
def test_a_case(name, tol):
    case, end = CASES[name], np.array(CASES[name]["end"], float)
    near = lambda found, true: np.testing.assert_array_less(
        np.abs(found - true) / np.maximum(np.abs(true), 1.0), 100 * tol
    )
    run = Problem(case).run(tol=tol)
    assert run.status is ns.Status.REACHED_END and len(run.t) < 1000
    if name != "tanh_limit":
        assert run.facts.implicit_steps == run.steps.implicit.sum() > 0
    events = [event for event in run.events if event.kind != "end"]
    assert len(events) == len(case["events"])
    for found, true in zip(events, case["events"], strict=True):
        assert abs(found.t - float(true["t"])) <= 100 * tol * max(1.0, found.t)
        assert found.mode_after == "".join("-s+"[k + 1] for k in true["letters"])
        if true["state"]:
            near(found.x, np.array(true["state"][: len(end)], float))
    near(run.x[-1], end)


def actuator(**more):
    return ns.FilippovSystem(
        [x, v, f],
        field=[v, f - x - 0.4 * lam, RATE * (1.5 * ca.cos(0.7 * t) - f)],
        surface=v,
        multipliers=lam,
        time=t,
        **more,
    )


def test_explicit_steps_report_what_limits_them():
    run = ns.simulate(actuator(), [0.0, 0.0, 1.5], 10.0, method="taylor", max_steps=500)
    assert run.status is ns.Status.TOO_MANY_STEPS and run.facts.implicit_steps == 0
    assert "A decay rate of about" in run.message and "method='auto'" in run.message
    with pytest.raises(ns.OptionError, match="method is 'radau'"):
        ns.simulate(actuator(), [0.0, 0.0, 1.5], 10.0, method="radau")


def test_a_run_is_the_same_whoever_ran_before():
    """The program of derivatives is made within the first run that needs it."""
    system = actuator()
    runs = [ns.simulate(system, [0.0, 0.0, 1.5], 10.0) for _ in range(2)]
    assert np.array_equal(runs[0].t, runs[1].t) and np.array_equal(runs[0].x, runs[1].x)
    many = ns.ensemble(system, np.tile([0.0, 0.0, 1.5], (70, 1)), 10.0)
    assert many.engine == "core" and np.array_equal(many.x, np.tile(runs[0].x[-1], (70, 1)))
    half = ns.simulate(system, [0.0, 0.0, 1.5], 5.0)
    rest = ns.simulate(system, start=half, t_end=10.0)
    assert np.allclose(rest.x[-1], runs[0].x[-1], rtol=0, atol=1e-9)


def test_samples_and_saved_steps(tmp_path):
    run = ns.simulate(actuator(), [0.0, 0.0, 1.5], 10.0)
    times = np.linspace(0.0, 10.0, 301)
    read = ns.simulate(actuator(), [0.0, 0.0, 1.5], 10.0, t_eval=times, dense=False)
    assert np.array_equal(read.sample_x, run(times))
    run.save(tmp_path / "run.npz")
    again = ns.load(tmp_path / "run.npz")
    assert np.array_equal(again.steps.implicit, run.steps.implicit) and again.facts == run.facts


def test_stops_resets_and_clocks_end_implicit_steps():
    """A sensor of rate 1e7 follows T' = -T/2 + 8 q; the relay switches by the sensor: T = 18 and 22 but 1e-6."""
    temperature, sensor, q = (ca.SX.sym(name) for name in ("T", "S", "q"))
    rate = 1e7
    system = ns.FilippovSystem(
        [temperature, sensor],
        discrete={q: (0, 1)},
        field=[-0.5 * (temperature - 10) + 8 * q, rate * (temperature - sensor)],
        resets=[
            ns.Reset(sensor - 18, {q: 1}, direction=-1, level=True, when=q == 0),
            ns.Reset(sensor - 22, {q: 0}, direction=+1, level=True, when=q == 1),
        ],
        stops=[ns.Stop(t - 9.5, 1, "late")],
        time=t,
    )
    run = ns.simulate(system, [20.0, 20.0, 1], 20.0)
    assert run.t[-1] == 9.5 and run.facts.implicit_steps > 0
    # the sensor lags behind a slope s by s/rate: T = 22 + s/rate where it says 22
    times, level = [0.0], 20.0
    for k in range(len(run.events) - 1):
        limit, bound = (26.0, 22.0) if k % 2 == 0 else (10.0, 18.0)
        lag = -0.5 * (bound - limit) / rate
        times.append(times[-1] + 2 * np.log((level - limit) / (bound + lag - limit)))
        level = bound + lag
    assert np.allclose([e.t for e in run.events[:-1]], times[1:], rtol=0, atol=1e-9)


def test_a_ball_bounces_on_a_table_beside_a_fast_state():
    """Impacts at 2 v0 r^k: the fast state does not disturb them."""
    y, w, fast = (ca.SX.sym(name) for name in ("y", "w", "fast"))
    system = ns.FilippovSystem(
        [y, w, fast],
        field=[w, -1, 1e7 * (ca.sin(y) - fast)],
        impacts=[ns.Impact(y, restitution=0.8)],
    )
    run = ns.simulate(system, [0.0, 1.0, 0.0], 7.0)
    impacts = [event.t for event in run.events if event.kind == "impact"]
    assert np.allclose(impacts, 2 * np.cumsum(0.8 ** np.arange(len(impacts))), rtol=0, atol=1e-9)
    assert run.facts.implicit_steps > 10


def test_many_coupled_states():
    """The heat equation on 200 points: u_k = sin(pi k h) exp(-mu t) is a mode of the difference matrix."""
    n = 200
    u = [ca.SX.sym(f"u{k}") for k in range(n)]
    h = 1 / (n + 1)
    rates = [
        ((u[k - 1] if k else 0) - 2 * u[k] + (u[k + 1] if k < n - 1 else 0)) / h**2
        for k in range(n)
    ]
    system = ns.FilippovSystem(u, field=rates)
    start, mu = np.sin(np.pi * h * np.arange(1, n + 1)), 4 / h**2 * np.sin(np.pi * h / 2) ** 2
    run = ns.simulate(system, start, 0.5, tol=1e-9)
    assert np.allclose(run.x[-1], start * np.exp(-0.5 * mu), rtol=0, atol=1e-8) and len(run.t) < 200


@pytest.mark.parametrize("rate", [1.0, 1e3, 1e7])
def test_fast_growth_is_no_decay(rate):
    """x' = rate (x - cos t) - sin t from cos 0: the exact solution is unstable, and steps stay explicit."""
    system = ns.FilippovSystem([x], field=[rate * (x - ca.cos(t)) - ca.sin(t)], time=t)
    run = ns.simulate(system, [1.0], 3.0 / rate)
    assert run.facts.implicit_steps == 0 and abs(run.x[-1, 0] - np.cos(3.0 / rate)) < 1e-7


def test_fast_oscillations_are_resolved():
    """An oscillator of frequency 1e4 without damping decays nowhere."""
    system = ns.FilippovSystem([x, v], field=[v, -1e8 * x])
    run = ns.simulate(system, [1.0, 0.0], 0.01, atol=1e-6)
    assert run.facts.implicit_steps == 0 and abs(run.x[-1, 0] - np.cos(100.0)) < 1e-6


def numbers(name):
    text = Path("nonsmooth/flow/core/implicit/radau.h").read_text()
    table = re.search(name + r"\[\] = \{(.*?)\}", text, re.DOTALL).group(1)
    return [mp.mpf(word) for word in re.findall(r"[-+0-9.e]+", table)]


def pairs(name):
    return [mp.mpc(*row) for row in zip(*[iter(numbers(name))] * 2, strict=True)]


def radau_polynomial(z, s):
    """Of degree s, by the recurrence of Legendre's polynomials."""
    before, now = mp.mpf(1), 2 * z - 1
    for n in range(1, s):
        before, now = now, ((2 * n + 1) * (2 * z - 1) * now - n * before) / (n + 1)
    return now - before


@pytest.mark.parametrize("s", [5, 7])
def test_tables_of_radau(s):
    """Nodes and matrices anew in 60 digits."""
    with mp.workdps(60):
        given = numbers(f"NODES_{s}")
        nodes = [mp.findroot(lambda z: radau_polynomial(z, s), near) for near in given]
        assert max(abs(a - b) for a, b in zip(nodes, given, strict=True)) < 1e-18
        values, slopes = mp.matrix(s, s), mp.matrix(s, s)
        for i in range(s):
            for k in range(1, s + 1):
                values[i, k - 1], slopes[i, k - 1] = nodes[i] ** k, k * nodes[i] ** (k - 1)
        powers = values**-1
        matrix, whole = slopes * powers, mp.matrix(s, s)
        for name, true in (("POWERS", powers), ("SLOPES", matrix)):
            for found, exact in zip(numbers(f"{name}_{s}"), true, strict=True):
                assert abs(found - exact) < 1e-18 * (1 + abs(exact))
        left, right = pairs(f"LEFT_{s}"), pairs(f"RIGHT_{s}")
        for q, eigenvalue in enumerate(pairs(f"EIGENVALUES_{s}")):
            for i in range(s):
                for j in range(s):
                    term = right[q * s + i] * eigenvalue * left[q * s + j]
                    whole[i, j] += mp.re(term) * (2 if q else 1)
        assert max(abs(a - b) for a, b in zip(whole, matrix, strict=True)) < 1e-15


@pytest.mark.parametrize("name", [name for name in CASES if "d_end_d_start" in CASES[name]])
def test_derivatives_of_a_case(name):
    true = np.array(CASES[name]["d_end_d_start"], float)
    run = Problem(CASES[name]).run(tol=1e-12)
    assert np.max(np.abs(ns.sensitivity(run).dx_dx0 - true)) < 1e-10 * np.max(np.abs(true))


@pytest.mark.parametrize("rate", [1e4, 1e6, 1e8])
def test_derivatives_and_orbits_through_stiff_legs(rate):
    """To order 1/rate the actuator's force is 1.5 cos(0.7 (t - 1/rate)): an oscillator alone, shifted in time."""
    mu = ca.SX.sym("mu")
    slow = ns.FilippovSystem(
        [x, v],
        field=[v, 1.5 * ca.cos(0.7 * (t - 1 / rate)) - x - mu * lam],
        surface=v,
        multipliers=lam,
        time=t,
        parameters={mu: 0.4},
    )
    fast = ns.FilippovSystem(
        [x, v, f],
        field=[v, f - x - mu * lam, rate * (1.5 * ca.cos(0.7 * t) - f)],
        surface=v,
        multipliers=lam,
        time=t,
        parameters={mu: 0.4},
    )
    force = lambda time: 1.5 * np.cos(0.7 * (time - 1 / rate))
    runs = [ns.simulate(slow, [1.0, 0.3], 9.0), ns.simulate(fast, [1.0, 0.3, force(0.0)], 9.0)]
    known, found = (ns.sensitivity(run) for run in runs)
    assert np.allclose(found.dx_dx0[:2, :2], known.dx_dx0, rtol=0, atol=10 / rate**2 + 1e-8)
    assert np.allclose(found.dx_dp[:2], known.dx_dp, rtol=0, atol=10 / rate**2 + 1e-8)
    assert np.max(np.abs(found.dx_dx0[2])) < 1e-12  # the force forgets its start
    begun = ns.simulate(slow, [1.0, 0.3], 100.0, t_start=0.0)
    orbit = ns.periodic_orbit(slow, begun, period=2 * np.pi / 0.7)
    stiff = ns.simulate(fast, [*begun.x[-1], force(100.0)], 200.0, t_start=100.0)
    again = ns.periodic_orbit(fast, stiff, period=2 * np.pi / 0.7)
    multipliers = sorted(again.multipliers, key=abs)
    assert abs(multipliers[0]) < 1e-12
    assert np.allclose(
        sorted(multipliers[1:], key=np.imag),
        sorted(orbit.multipliers, key=np.imag),
        rtol=0,
        atol=1e-7,
    )
