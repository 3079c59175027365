"""Other scales, exact boundaries, several things at once: what a user may write and no example does, each at
its closed form."""

from math import erf, log, pi, sqrt

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, v, t = (ca.SX.sym(s) for s in "xyvt")
G = 9.81


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("time", [1e-9, 1e9])
def test_friction_in_any_units(length, time):
    """An oscillator of amplitude 2.2 loses 0.6 at each swing and rests at -0.2."""
    k, force = 1 / time**2, 0.3 * length / time**2
    system = ns.FilippovSystem(
        [x, v], surface=v, above=[v, -k * x - force], below=[v, -k * x + force]
    )
    options = {"atol": 1e-10 * min(length, length / time), "rtol": 1e-10}
    run = ns.simulate(system, [2.2 * length, 0.0], 13 * time, **options)
    assert run.itinerary == "- + - + s"
    assert abs(run.x[-1, 0] / length + 0.2) < 1e-8
    crossing = run.events[0].t / time
    assert abs(crossing - pi) < 1e-8


def test_elastic_bounces_keep_their_energy():
    ball = ns.FilippovSystem([x, v], field=[v, -G], impacts=ns.Impact(x, restitution=1.0))
    run = ns.simulate(ball, [1.0, 0.0], 200.0)
    assert len(run.events) > 200
    assert np.abs(run.x[:, 0] * G + run.x[:, 1] ** 2 / 2 - G).max() < 1e-7


def test_a_pulse_that_breaks_friction_late():
    load = 3 * ca.exp(-((t - 30) ** 2))
    sides = {"above": [v, load - 0.4], "below": [v, load + 0.4]}
    system = ns.FilippovSystem([x, v], surface=v, **sides, time=t)
    run = ns.simulate(system, [0.0, 0.0], 60.0)
    starts = 30 - sqrt(log(3 / 0.4))
    assert run.itinerary.startswith("s +") and abs(run.events[0].t - starts) < 1e-9
    stops = next(e.t for e in run.events if e.kind == "entry")
    impulse = 3 * sqrt(pi) / 2 * (erf(stops - 30) - erf(starts - 30)) - 0.4 * (stops - starts)
    assert abs(impulse) < 1e-8


FAST = 1e15  # in a unit of time of a femtosecond


def test_what_happens_soon_after_the_end_does_not_happen():
    system = ns.FilippovSystem([x], field=[FAST], stops=ns.Stop(x - 1.5))
    starts = np.linspace(-0.1, 0.1, 80)[:, None]
    found = ns.ensemble(system, starts, 1 / FAST, work=ns.Work(progress=False))
    assert (found.status == ns.Status.REACHED_END).all()
    np.testing.assert_allclose(found.x, starts + 1, rtol=0, atol=1e-12)
    assert ns.simulate(system, [0.0], 1 / FAST).status is ns.Status.REACHED_END
    assert ns.simulate(system, [0.0], 1.5 / FAST).status is ns.Status.STOPPED


def test_events_that_a_short_time_divides_are_two():
    resets = [ns.Reset(x - 1, {y: y + 1}), ns.Reset(x - 1.5, {y: 2 * y})]
    system = ns.FilippovSystem([x, y], field=[FAST, -0.5 * FAST], resets=resets)
    run = ns.simulate(system, [0.0, 0.0], 2 / FAST, at=ns.Section("reset"))
    np.testing.assert_allclose([e.t * FAST for e in run.events], [1, 1.5, 2], rtol=1e-12)
    np.testing.assert_allclose(run.x[-1], [2, 2 * (0.5 - 0.25) - 0.25], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.sample_t * FAST, [1, 1.5], rtol=1e-12)
