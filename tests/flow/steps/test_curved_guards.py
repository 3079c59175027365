"""Guards that are curved while the motion is simple: each passage is one event, at its time."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.flow import curved_guards

x, v, kicks, t, h = (ca.SX.sym(name) for name in ("x", "v", "kicks", "t", "h"))


def resets_of(run):
    return np.array([e.t for e in run.events if e.kind == "reset"])


SINES = {"time": (ca.sin(t), [1, 0]), "state": (ca.sin(x), [1, 0]), "oscillator": (x, [v, -x])}


@pytest.mark.parametrize("tol", [1e-6, 1e-10, 1e-12])
@pytest.mark.parametrize("of", SINES)
def test_passages_of_a_sine_are_reached_once_and_in_time(tol, of):
    """Zeros of sin(t) - h are asin(h) + 2 pi n, however long a step the field allows."""
    guard, field = SINES[of]
    kick = ns.Reset(guard - h, [x, v, kicks + 1], direction=1)
    given = {"parameters": {h: 0.0}, "time": t, "resets": kick}
    system = ns.FilippovSystem([x, v, kicks], field=[*field, 0], **given)
    for level in np.random.default_rng(3).uniform(-0.9, 0.9, 60):
        true = np.arcsin(level) + 2 * np.pi * np.arange(-1, 5)
        true = true[(true > 1e-6) & (true < 20.0)]
        start = [0.0, 1.0, 0.0]
        run = ns.simulate(system, start, 20.0, parameters={"h": level}, tol=tol)
        reached = resets_of(run)
        assert len(reached) == len(true) and run.x[-1, 2] == len(true)
        assert np.abs(reached - true).max() < (100 * tol if of == "oscillator" else 2e-14)


def test_a_section_is_sampled_once_a_passage():
    fine = np.linspace(0, 20.0, 400_001)
    dense = np.cos(fine) + np.sin(3.1 * fine)
    system = ns.FilippovSystem([x, v], field=[v, -x], time=t)
    for level in np.random.default_rng(3).uniform(-0.9, 0.9, 100):
        at = ns.Section(x + ca.sin(3.1 * t) - float(level), direction=1)
        run = ns.simulate(system, [1.0, 0.0], 20.0, at=at)
        rises = (dense[:-1] < level) & (dense[1:] >= level)
        assert len(run.sample_t) == rises.sum(), level


def test_a_flat_top_is_passed_once_up_and_once_down():
    """Close to its maximum a sine has a small slope: the state at the root must still be on the zero."""
    for level in (0.999, 0.99999, 1 - 1e-9):
        kick = ns.Reset(ca.sin(x) - level, [x, v + 1], direction=1)
        run = ns.simulate(ns.FilippovSystem([x, v], field=[1, 0], resets=kick), [0, 0], 20.0)
        true = np.arcsin(level) + 2 * np.pi * np.arange(3)
        assert run.x[-1, 1] == 3
        assert np.abs(resets_of(run) - true).max() < 1e-14 / np.sqrt(1 - level**2)


@pytest.mark.parametrize("tol", [1e-6, 1e-8, 1e-10])
def test_a_section_that_changes_nothing_is_sampled_once_a_passage(tol):
    """The 40th return of a pendulum with a curved section, by DOP853 with steps of 0.1."""
    pendulum = ns.FilippovSystem([x, v], field=[v, -1.3 * ca.sin(x) + 0.1 * (1 - x * x) * v])
    section = ca.sin(1.1 * x + 0.7 * v) - 0.9
    returns = ns.orbit.poincare(pendulum, section, [1.0, 0.5], count=40, tol=tol)
    assert np.diff(returns.t).min() > 0.1
    assert abs(returns.t[-1] - 151.53337271) < 200 * tol + 1e-7


@pytest.mark.parametrize("tol", [1e-6, 1e-10])
def test_a_restart_where_a_stop_ended_continues(tol):
    """The state that a stop leaves is on its zero to rounding, so that the next passage is the next event."""
    guard = ca.sin(1.1 * x + 0.7 * v) - h
    system = ns.FilippovSystem([x, v], field=[v, -x], parameters={h: 0.0}, stops=ns.Stop(guard))
    for level in np.random.default_rng(5).uniform(-0.7, 0.7, 20):
        state, times = [1.3, 0.5], []
        for _ in range(8):
            run = ns.simulate(system, state, 20.0, parameters={"h": level}, tol=tol)
            assert run.status is ns.Status.STOPPED
            state = run.x[-1]
            times.append(run.t[-1])
        assert min(times[1:]) > 1e-3
        phase = np.cumsum(times)  # of the angle, which four or eight passages make full
        fine = np.linspace(0, phase[-1] + 1e-3, 200_001)
        a, b = 1.3 * np.cos(fine) + 0.5 * np.sin(fine), 0.5 * np.cos(fine) - 1.3 * np.sin(fine)
        g = np.sin(1.1 * a + 0.7 * b) - level
        assert np.count_nonzero(g[:-1] * g[1:] < 0) == 8


@pytest.mark.parametrize("w", [3.0, 5.0, 10.0, 30.0])
def test_impacts_on_a_shaken_table_are_in_time(w):
    """The gap is a sine of the time, and the flight a parabola: against Newton's method."""
    gap = x - 0.1 * ca.sin(w * t)
    table = ns.FilippovSystem(
        [x, v], field=[v, -9.81], impacts=ns.Impact(gap, restitution=0.8), time=t
    )
    for height in (0.5, 1.0, 2.0, 5.0):
        run = ns.simulate(table, [height, 0.0], 1.3)
        first = next(e.t for e in run.events if e.kind == "impact")
        grid = np.linspace(1e-9, 1.3, 200_001)
        below = height - 4.905 * grid**2 - 0.1 * np.sin(w * grid) < 0
        true = grid[np.argmax(below)]
        for _ in range(6):
            value = height - 4.905 * true**2 - 0.1 * np.sin(w * true)
            true += value / (9.81 * true + 0.1 * w * np.cos(w * true))
        assert abs(first - true) < 1e-14


def test_guards_of_one_zero_are_reached_at_one_time():
    """Three ways to write a zero: polished, they coincide, and the stop fires first."""
    at = 0.7
    guards = [ca.sin(t) - np.sin(at), ca.exp(x) - np.exp(at), x - at]
    for first in range(3):
        order = guards[first:] + guards[:first]
        kick = [ns.Reset(g, [x, kicks + 1], direction=1) for g in order[:2]]
        stop = ns.Stop(order[2], direction=1)
        system = ns.FilippovSystem([x, kicks], field=[1, 0], time=t, resets=kick, stops=stop)
        run = ns.simulate(system, [0.0, 0.0], 2.0)
        assert run.status is ns.Status.STOPPED and abs(run.t[-1] - at) < 4e-16


@pytest.mark.parametrize("tol", [1e-6, 1e-10, 1e-13])
def test_random_curved_guards_have_the_passages_of_dense_sampling(tol):
    assert curved_guards.main(12, tol=tol).wrong == 0


@pytest.mark.slow
def test_ten_thousand_random_curved_guards():
    counts = curved_guards.main(500, 1000)
    assert counts.wrong == 0 and counts.runs > 9_900 and counts.worst < 1e-9
