"""What orbits and branches say of the reference cases besides period and multipliers has their digits."""

from __future__ import annotations

import math

import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import (
    CASES,
    excited_oscillator,
    forced_friction,
    friction_oscillator,
    grazing_circle,
    scalar_relay,
    stick_slip,
    table,
    welander,
)


def digits(value: str) -> object:
    return pytest.approx(float(value), rel=1e-12, abs=0)


def test_stick_slip_from_two_digits_lands_where_it_does():
    orbit = ns.periodic_orbit(stick_slip(), [1.0, 0.5], itinerary="- s")
    (stick,) = (leg for leg in orbit.legs if leg.mode == "s")
    assert stick.start[0] == digits(CASES["R3"]["x_restick"])


def test_welander_box_has_both_ends_and_times():
    values, orbit = CASES["R5"], ns.periodic_orbit(welander(), [0.4, 0.3])
    legs = {leg.mode: leg for leg in orbit.legs}
    assert legs["+"].duration == digits(values["t_k5"])
    assert legs["-"].duration == digits(values["t_k0"])
    assert legs["+"].start[0] == digits(values["T_end_k0"])
    assert legs["-"].start[0] == digits(values["T_end_k5"])


def test_relay_slides_between_its_times_and_changes_at_its_amplitudes():
    system = scalar_relay()
    branch = ns.continue_orbit(ns.periodic_orbit(system, [0.5]), "A", bounds=(0.8, 3.0))
    found = {event.kind: event.parameter for event in branch.events}
    assert found["crossing-sliding"] == digits(CASES["F1"]["A_crossing_sliding"])
    assert found["adding-sliding"] == digits(CASES["F2"]["ADDING_SLIDING_A"])
    run = ns.simulate(system, [0.5], 60, parameters={"A": 1.5})
    legs = ns.periodic_orbit(system, run).legs
    k = next(i for i, leg in enumerate(legs) if leg.mode == "+")
    exits, lands = legs[k].t, legs[(k + 1) % len(legs)].t
    assert math.remainder(exits, 2 * math.pi) == digits(CASES["F2"]["exit_time"])
    assert math.remainder(lands, 2 * math.pi) == digits(CASES["F2"]["landing_time"])


def test_circle_grazes_at_its_level_and_lifts_off_at_its_fold():
    orbit = ns.periodic_orbit(grazing_circle(), [0.9, 0.0])
    legs = {leg.mode: leg for leg in orbit.legs}
    assert legs["+"].start[0] == digits(CASES["F5"]["x_fold"])
    assert legs["s"].start[0] == digits(CASES["F5"]["x_landing"])
    (event,) = ns.continue_orbit(orbit, "d", bounds=(0.85, 1.1)).events
    assert event.kind == "grazing-sliding"
    assert event.parameter == digits(CASES["F5"]["d_grazing_sliding"])


def test_bouncing_ball_folds_and_doubles_at_its_amplitudes():
    orbit = ns.periodic_orbit(table(), [0.26, 3.1], t_start=0.64, itinerary=[("", "reset")])
    branch = ns.continue_orbit(orbit, "A", bounds=(0.3, 1.3))
    found = {event.kind: event.parameter for event in branch.events}
    assert found["fold"] == digits(CASES["I1"]["A_fold"])
    assert found["period doubling"] == digits(CASES["I1"]["A_period_doubling"])
    assert np.prod(orbit.multipliers).real == digits(CASES["I1"]["det"])


def test_a_torus_is_born_at_the_damping_of_the_closed_form():
    values = CASES["I4"]
    orbit = ns.periodic_orbit(
        excited_oscillator(),
        [-0.1, -1.1],
        t_start=1.3,
        itinerary=[("", "reset")],
        parameters={"d": 0.03},
    )
    (event,) = ns.continue_orbit(orbit, "d", bounds=(0.01, 0.06)).events
    assert event.kind == "Neimark-Sacker" and event.parameter == digits(values["d_NS"])
    assert event.orbit.multipliers.sum().real == digits(values["trace"])


def test_forced_friction_turns_and_sticks_at_its_phases():
    system, w = forced_friction(), 0.6
    moving = ns.periodic_orbit(system, [1.5, 0.0], symmetry="odd")
    assert abs(math.remainder(w * moving.legs[0].t, math.pi)) == digits(CASES["D1"]["phase"])
    assert np.prod(moving.half_multipliers).real == digits(CASES["D1"]["det_half"])
    rate = math.log(abs(np.prod(moving.multipliers))) / moving.period
    assert rate == digits(CASES["D1"]["lyapunov_sum"])
    sticking = ns.periodic_orbit(
        system,
        [1.44, 0.0],
        itinerary="s -",
        symmetry="odd",
        t_start=0.64,
        parameters={"f": 0.6},
    )
    stick = sticking.legs[0]
    assert abs(stick.start[0]) == digits(CASES["D5"]["x_stick"])
    assert w * stick.t % math.pi == digits(CASES["D5"]["phase_landing"])
    derivative = float(CASES["D5"]["half_map_derivative"])
    assert abs(sticking.half_multipliers[0] - derivative) < 1e-11


def test_friction_oscillator_grazes_at_its_frequency_time_and_state():
    system, values = friction_oscillator(), CASES["K1"]
    orbit = ns.periodic_orbit(system, [2.19, -0.42], parameters={"nu": 1.7085})
    branch = ns.continue_orbit(orbit, "nu", bounds=(1.7075, 1.709), through=False)
    (event,) = branch.events
    assert event.kind == "grazing-sliding" and event.parameter == digits(values["nu_grazing"])
    assert event.orbit.start[0] == digits(values["start"][0])
    assert event.orbit.start[1] == digits(values["start"][1])
    # where h has its minimum it is as flat as rounding, so its time has half of the digits
    assert event.orbit.margins[0].t == pytest.approx(float(values["graze_time"]), rel=1e-12)
