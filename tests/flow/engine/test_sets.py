"""Friction in the plane: ensembles and runs alone, dense output."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.flow import plane_friction as plane


def landings(count, seed):
    """Random bounces: parameters, start, load; some on a line, some nearly without slip."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        p = {
            "mu": rng.uniform(0.05, 1.5),
            "d1": rng.uniform(0, 0.4),
            "d2": rng.uniform(0.02, 0.4),
            "eta": 10 ** rng.uniform(-2, 0.9),
            "G": 10 ** rng.uniform(-5, -2),
            "k": rng.choice([0.4, 0.6]),
        }
        v = rng.normal(size=2) * rng.choice([0.1, 1, 3])
        w = rng.normal(size=2) * rng.choice([0.1, 1, 3])
        kind = k % 8
        if kind == 5:
            w = -v + rng.normal(size=2) * 10 ** rng.uniform(-16, -3)
        if kind == 6:
            v[1] = w[1] = 0.0
        if kind == 7:
            w = v * rng.uniform(-3, 3)
        yield p, np.array([0.0, 0.0, *v, *w, 0.0, -1.0]), ("contact", "net")[k // 4 % 2]


def test_ensembles_are_runs():
    cases = list(landings(40, 5))
    starts = np.array([x for _, x, _ in cases])
    p = {name: np.array([values[name] for values, _, _ in cases]) for name in cases[0][0]}
    many = ns.ensemble(plane.ball(), starts, 20.0, parameters=p)
    again = ns.ensemble(
        plane.ball(), starts, 20.0, parameters=p, work=ns.Work(threads=2, chunk=7, progress=False)
    )
    assert np.array_equal(many.x, again.x)
    for i in (0, 5, 7, 13, 39):
        own = {name: values[i] for name, values in p.items()}
        run = ns.simulate(plane.ball(), starts[i], 20.0, parameters=own)
        assert many.itinerary[i] == run.itinerary
        assert np.array_equal(many.x[i], run.x[-1]) and many.t[i] == run.t[-1]
    assert sum(many.events["entry"]) == sum("s" in word for word in many.itinerary)


def test_dense_output_and_samples_through_a_stop_of_slip():
    case = plane.CASES["oblique-slow-net"]
    fast, _ = plane.run_of(case, 1e-11)
    fine, _ = plane.run_of(case, 1e-14)
    t = np.sort(
        np.concatenate([np.linspace(0, 2.9, 200), fast.events[0].t + np.logspace(-16, -2, 20)])
    )
    assert np.abs(fast(t) - fine(t)).max() < 1e-9
    p = {name: float(value) for name, value in case["parameters"].items()}
    start = fast.x[0]
    kept = ns.simulate(plane.ball("net"), start, 20.0, parameters=p, tol=1e-11, t_eval=t)
    assert np.array_equal(kept.sample_x, fast(t))
    assert [s.mode for s in fast.segments] == [s.mode for s in fine.segments] == ["*", "s", "*"]


def test_crossings_on_a_line_are_stretches_of_their_own():
    p = {"mu": 0.2037, "d1": 0.2835, "d2": 0.0897, "eta": 5.617, "G": 5.6e-4, "k": 0.4}
    line = np.array([0.6, 0.8])
    start = [0.0, 0.0, *(-1.533 * line), *(-0.0878 * line), 0.0, -1.0]
    run = ns.simulate(plane.ball(), start, 20.0, parameters=p)
    assert run.itinerary == "* * * * s *"
    assert [s.mode for s in run.segments] == list("****s*")


def test_what_is_rare_is_left_to_the_reference():
    x, v = plane.columns("x1", "x2"), plane.columns("v1", "v2")
    (z, lam, mu), pair = plane.columns("z", "lam", "mu"), ca.vertcat(*plane.columns("l1", "l2"))
    system = ns.FilippovSystem(
        [*x, *v, z],
        field=[*v, -mu * pair[0], -mu * pair[1], -lam],
        surfaces=[ca.vertcat(*v), z],
        multipliers=[pair, lam],
        parameters={mu: 0.5},
    )
    run = ns.simulate(system, [0, 0, 0.6, 0.8, 0.3], 4.0)  # z slides when the block stops
    assert run.itinerary == "*+ *s ss"
    assert [e.t for e in run.events[:2]] == pytest.approx([0.3, 2.0], abs=1e-12)
    still = ns.simulate(system, [0, 0, 0, 0, 0.3], 4.0, parameters={"mu": 0.0})
    assert still.itinerary == "*+ *s" and not still.x[-1].any()
    started = ns.simulate(system, [0, 0, 0, 0, 0.3], 0.2, start_mode="s+")
    assert started.itinerary == "s+"
