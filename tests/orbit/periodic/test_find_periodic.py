"""Newton's method for periodic orbits: from guesses near and far, to rounding, or with the reason why not."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns


def walker():
    start = [0.20, -0.20, 0.40, (1 - np.cos(0.40)) * -0.20]
    return ns.textbook.simplest_walker().system, start, {"itinerary": [("", "heelstrike")]}


def friction():
    given = {"symmetry": "odd", "parameters": {"f": 0.6}, "t_start": 0.64}
    system = ns.textbook.forced_dry_friction().system
    return system, [1.44, 0.0], {"itinerary": "s -", **given}


def relay():
    system = ns.textbook.multi_sliding_relay().system
    return system, [0.0, 1.0, 2.57], {"itinerary": ["+", "s"] * 7, "symmetry": "odd"}


CASES = {"walker": walker, "friction": friction, "relay": relay}


@pytest.mark.parametrize("name", CASES)
def test_an_orbit_is_found_again_from_beside_it_to_rounding(name):
    system, start, given = CASES[name]()
    orbit = ns.periodic_orbit(system, start, **given)
    scales = orbit.problem.scales(orbit.unknowns)
    beside = np.array(start) + 1e-6 * scales[: len(start)]
    again = ns.periodic_orbit(system, beside, **given)
    assert np.abs((orbit.unknowns - again.unknowns) / scales).max() < 1e-14
    one, two = orbit.evaluation.jacobian, again.evaluation.jacobian
    assert np.abs(one - two).max() < 1e-10 * np.abs(two).max()
    np.testing.assert_allclose(orbit.half_multipliers, again.half_multipliers, atol=1e-12)
    assert orbit.residual < 1e-13


def test_a_leg_that_does_not_come_to_its_event_is_told():
    system, _, given = friction()
    with pytest.raises(ns.ConvergenceError, match=r"leg 1 \(s, ended by"):
        ns.periodic_orbit(
            system, [0.0, 0.0], **{**given, "parameters": {"f": 1.6}, "itinerary": "s -"}
        )


def test_a_smooth_orbit_without_events_is_found():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    r = x**2 + y**2
    system = ns.FilippovSystem([x, y], field=[y + x * (1 - r), -x + y * (1 - r)])
    orbit = ns.periodic_orbit(system, [1.0, 0.1])
    assert orbit.period == pytest.approx(2 * np.pi, rel=1e-13)


def test_an_orbit_at_other_parameters_leads_to_the_one_there_and_too_few_iterations_to_none():
    system, start, given = friction()
    orbit = ns.periodic_orbit(system, start, **given)
    there = ns.periodic_orbit(system, orbit, parameters={"f": 0.7})
    back = ns.periodic_orbit(system, there, parameters={"f": 0.6})
    assert np.abs(back.unknowns - orbit.unknowns).max() < 1e-14
    with pytest.raises(ns.ConvergenceError, match="Newton's method"):
        ns.periodic_orbit(system, orbit, parameters={"f": 0.7}, max_iterations=1)
