"""Runs that begin late: time is two numbers, so that a motion does not depend on when it begins."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v, w, y = (ca.SX.sym(name) for name in "xvwy")
LATE = [1.7e9, 1e15]

SYSTEMS = {
    "oscillator": (ns.FilippovSystem([x, v, w], field=[1, w, -9 * v]), [0, 0, 1]),
    "ball": (
        ns.FilippovSystem([y, v, x], field=[v, -9.81, 1], impacts=ns.Impact(y, restitution=0.9)),
        [1, 0, 0],
    ),
    "relay": (
        ns.FilippovSystem([x, v], surface=x + 0.1 * v, above=[v, -1], below=[v, 1]),
        [0.7, 0.1],
    ),
}


@pytest.mark.parametrize("t_start", LATE)
@pytest.mark.parametrize("name", SYSTEMS)
def test_an_autonomous_motion_does_not_depend_on_when_it_begins(name, t_start):
    system, start = SYSTEMS[name]
    early = ns.simulate(system, start, 5.0)
    late = ns.simulate(system, start, t_start + 5.0, t_start=t_start)
    assert late.status is early.status and late.itinerary == early.itinerary
    assert [e.kind for e in late.events] == [e.kind for e in early.events]
    assert np.abs(late.x[-1] - early.x[-1]).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "t_start"), [*((name, 1.7e9) for name in SYSTEMS), ("oscillator", 1e15)]
)
def test_dense_output_and_samples_are_at_the_times_that_were_asked_for(name, t_start):
    """Steps that begin at an event begin between two numbers."""
    system, start = SYSTEMS[name]
    asked = np.arange(1, 20) * 0.25  # numbers of their own at both starts
    early = ns.simulate(system, start, 5.0)(asked)
    times = t_start + asked
    late = ns.simulate(system, start, t_start + 5.0, t_start=t_start, t_eval=times)
    assert np.abs(late.sample_x - early).max() < 1e-11
    assert np.abs(late(times) - early).max() < 1e-11


def test_rows_of_an_ensemble_that_begins_late_are_single_runs():
    system, start = SYSTEMS["relay"]
    starts = np.array(start) + 0.01 * np.arange(80)[:, None]
    early = ns.ensemble(system, starts, 5.0, work=ns.Work(progress=False))
    late = ns.ensemble(system, starts, 1.7e9 + 5.0, t_start=1.7e9, work=ns.Work(progress=False))
    assert np.array_equal(early.status, late.status)
    assert np.abs(early.x - late.x).max() < 1e-9
