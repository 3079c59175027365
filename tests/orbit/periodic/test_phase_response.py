"""Phase responses against closed forms, and against the phase that a kicked run reaches."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit import phase_response
from tests.orbit.periodic_cases import relay_oscillator, values_of, weakening_friction

VALUES = values_of("cases/orbits_2.json")


def shift_of(orbit, x, time, turns=12):
    """How much earlier than the orbit the motion from x, where the orbit is at a time, gets round."""
    event = next(leg for leg in orbit.legs if leg.event)
    kinds = (event.kind, event.element)
    run = ns.simulate(orbit.system, x, (turns + 1) * orbit.period, parameters=orbit.parameters)
    hits = [e.t for e in run.events if (e.kind, e.element) == kinds and e.mode_before == event.mode]
    late = (hits[-1] + time - event.t - event.duration) / orbit.period
    return (round(late) - late) * orbit.period


def kicked_shift(orbit, response, t, kick, size=1e-5):
    """Difference of the phases of runs from both sides of a point of the orbit."""
    x = orbit.trajectory(t + orbit.legs[0].t)
    ahead, back = (shift_of(orbit, x + s * size * kick, t) for s in (1, -1))
    return (ahead - back) / (2 * size)


@pytest.mark.parametrize("symmetry", [None, -np.eye(2)])
def test_relay_oscillator(symmetry):
    given = {} if symmetry is None else {"symmetry": symmetry}
    orbit = ns.periodic_orbit(relay_oscillator(), [-6.4, 0.01], **given)
    response = phase_response(orbit)
    start = float(VALUES["PR2"]["start (t=0)"][0])
    begin = next(leg.t for leg in orbit.legs if leg.mode == "+")
    assert np.abs(orbit.trajectory(begin) - [start, 0.0]).max() < 1e-12
    for time in (0.0, 0.7, 2.0, 3.0):
        true = np.array([float(z) for z in VALUES["PR2"]["Z(0)" if not time else f"Z({time:.1f})"]])
        assert np.abs(response(begin + time) - true).max() < 1e-13
        assert np.abs(response(begin + time + 0.5 * orbit.period) + true).max() < 1e-13
    assert response.error < 1e-13
    before, after = response.z[np.flatnonzero(np.diff(response.t) == 0.0)[0] + np.array([0, 1])]
    factor = float(VALUES["PR2"]["jump factor of Z_v at the switch (before/after)"])
    assert abs(before[1] / after[1] - factor) < 1e-12


def test_rows_are_the_responses_at_their_times():
    orbit = ns.periodic_orbit(weakening_friction(), [1.0, 0.0])
    response = phase_response(orbit, samples=40)
    assert response.t[0] == 0.0 and abs(response.t[-1] - orbit.period) < 1e-14
    inside = np.flatnonzero(np.diff(response.t) > 0)[1::5]
    for i in inside:
        assert (
            np.abs(response(response.t[i]) - response.z[i]).max() < 1e-12 * np.abs(response.z).max()
        )


def test_integrate_and_fire():
    system = ns.textbook.integrate_and_fire().system
    orbit = ns.periodic_orbit(system, [0.3], parameters={"I": 1.2})
    response = phase_response(orbit)
    begin = orbit.legs[0].duration if orbit.legs[0].start[0] > 1e-9 else 0.0
    for t in (0.0, 0.4, 1.5):
        assert abs(response(begin + t)[0] - math.exp(t) / 1.2) < 1e-13 * math.exp(t)


def test_thermostat_with_a_relay():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    on = ns.Reset(x - 18, [x, 1.0], direction=-1)
    off = ns.Reset(x - 22, [x, 0.0], direction=1)
    system = ns.FilippovSystem([x, u], field=[-0.1 * (x - 10) + 2.5 * u, 0], resets=[on, off])
    orbit = ns.periodic_orbit(system, [20.0, 1.0])
    response = phase_response(orbit)
    for t in np.linspace(0.1, orbit.period - 0.1, 7):
        state = orbit.trajectory(t)
        rate = -0.1 * (state[0] - 10) + 2.5 * round(state[1])
        assert abs(response(t)[0] * rate - 1.0) < 1e-11


@pytest.mark.parametrize(("time", "length"), [(1e-6, 1e4), (1e7, 1e-9), (1.0, -1.0)])
def test_units_of_time_and_state_do_not_matter(time, length):
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    rate = lambda s: (-x / length - 0.2 * v * time / length + s) * length / time**2
    side = 1 if length > 0 else -1
    fields = {"above": [v, rate(side)], "below": [v, rate(-side)]}
    system = ns.FilippovSystem([x, v], surface=v, **fields)
    start, small = [-6.4 * length, 0.01 * length / time], 1e-12 * abs(length) * min(1.0, 1 / time)
    run = ns.simulate(system, start, 40 * time, rtol=1e-12, atol=small)
    orbit = ns.periodic_orbit(system, run)
    response = phase_response(orbit)
    reference = phase_response(ns.periodic_orbit(relay_oscillator(), [-6.4, 0.01]))
    ours, theirs = (
        next(leg.t for leg in r.orbit.legs if leg.mode == mode)
        for r, mode in ((response, "+" if length > 0 else "-"), (reference, "+"))
    )
    found = response(ours + 0.7 * time) * [length / time, length / time**2]
    assert np.abs(found - reference(theirs + 0.7)).max() < 1e-12


@pytest.mark.parametrize("t", [0.3, 2.9, 4.8])
def test_kicks_of_a_relay_oscillator_shift_the_phase(t):
    orbit = ns.periodic_orbit(relay_oscillator(), [-6.4, 0.01], parameters={"d": 0.3})
    response = phase_response(orbit)
    for kick in np.eye(2):
        assert abs(kicked_shift(orbit, response, t, kick) - response(t) @ kick) < 1e-5


def test_slide_and_both_sides_of_it():
    orbit = ns.periodic_orbit(weakening_friction(), [1.0, 0.0])
    response = phase_response(orbit)
    slide = next(leg for leg in orbit.legs if leg.mode == "s")
    t = slide.t + 0.4 * slide.duration
    x = orbit.trajectory(t)
    along = kicked_shift(orbit, response, t, np.array([1.0, 0.0]), 1e-4)
    assert abs(along - response(t)[0]) < 1e-8
    assert abs(response(t)[0] - 1.0 / 0.5) < 1e-11  # x' = .5 while it sticks
    for side in (1, -1):
        size = 1e-5
        late = shift_of(orbit, x + np.array([0.0, side * size]), t) - shift_of(orbit, x, t)
        assert abs(late / size - side * response.kicked(t, 0, side)[1]) < 1e-3
    with pytest.raises(ns.PointError, match="expected sliding"):
        response.kicked(slide.t + slide.duration + 0.1, 0, 1)
    with pytest.raises(ns.OptionError, match="side"):
        response.kicked(t, 0, 0)


def test_period_by_a_parameter_is_the_response_to_it():
    """dT/dp = -int Z . f_p dt - sum Z+ . S_p; a force moves no event, and does not act in stick."""
    x, v, force = (ca.SX.sym(n) for n in ("x", "v", "force"))
    belt = v - 0.5
    drop = lambda s: 1 / (1 + 2 * s)
    fields = {"above": [v, force - x - drop(belt)], "below": [v, force - x + drop(-belt)]}
    system = ns.FilippovSystem([x, v], surface=belt, parameters={force: 0.2}, **fields)
    orbit = ns.periodic_orbit(system, [1.0, 0.0])
    response = phase_response(orbit, samples=4000)
    total = 0.0
    for i, leg in enumerate(orbit.legs):
        own = response.leg == i
        total -= 0.0 if leg.mode == "s" else np.trapezoid(response.z[own, 1], response.t[own])
    assert abs(total - orbit.derivative("force").period) < 1e-5


def test_refusals():
    t, x, v = (ca.SX.sym(n) for n in ("t", "x", "v"))
    with pytest.raises(ns.OptionError, match="PeriodicOrbit"):
        phase_response(relay_oscillator())
    orbit = ns.periodic_orbit(relay_oscillator(), [-6.4, 0.01])
    with pytest.raises(ns.OptionError, match="samples"):
        phase_response(orbit, samples=1)
    forced = ns.FilippovSystem(
        [x], surface=x, above=[-1 + 2 * ca.sin(t)], below=[1 + 2 * ca.sin(t)], time=t
    )
    driven = ns.periodic_orbit(forced, [0.3], period=2 * math.pi)
    with pytest.raises(ns.OptionError, match="forcing"):
        phase_response(driven)
    centre = ns.FilippovSystem([x, v], surface=x, above=[v, -1], below=[v, 1])
    family = ns.periodic_orbit(centre, [0.0, 1.0])
    with pytest.raises(ns.DegenerateError, match="family"):
        phase_response(family)
