"""Orbits found in one call are those found step by step, from states and with exact residuals alike."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.compiled import find_compiler
from nonsmooth.orbit.periodic import find_periodic, guess, shooting
from nonsmooth.orbit.periodic.guess import start_of
from nonsmooth.orbit.periodic.symmetry import mirror_of
from nonsmooth.orbit.runs import flight
from nonsmooth.orbit.runs.flight import flights_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


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
def test_an_orbit_in_one_call_is_that_step_by_step(monkeypatch, name):
    system, start, given = CASES[name]()
    at_once = ns.periodic_orbit(system, start, **given)
    monkeypatch.setattr(find_periodic, "shot", lambda *_: None)
    stepwise = ns.periodic_orbit(system, start, **given)
    scales = at_once.problem.scales(at_once.unknowns)
    assert np.abs((at_once.unknowns - stepwise.unknowns) / scales).max() < 1e-14
    one, two = at_once.evaluation, stepwise.evaluation
    for field in ("jacobian", "starts", "durations"):
        apart = np.abs(getattr(one, field) - getattr(two, field)).max()
        assert apart < 1e-10 * np.abs(getattr(two, field)).max(), field
    for field in flight.Flight.__dataclass_fields__:
        one_field, two_field = (np.asarray(getattr(at.flight, field)) for at in (one, two))
        np.testing.assert_allclose(one_field, two_field, rtol=1e-9, atol=1e-10, err_msg=field)
    np.testing.assert_allclose(at_once.half_multipliers, stepwise.half_multipliers, atol=1e-12)
    assert at_once.residual < 1e-13 and at_once.iterations <= stepwise.iterations


@pytest.mark.parametrize("name", CASES)
def test_legs_are_followed_alike_in_c_and_in_python(name):
    system, x, given = CASES[name]()
    p = system.parameter_vector(given.get("parameters"))
    mirror = mirror_of(system, given.get("symmetry"))
    start = start_of(system, x, given["itinerary"], None, mirror, given.get("parameters"), 0.64)
    legs, first = start.problem.legs, system.extended_point(x, 0.64)
    starts, durations = flights_of(system, legs).followed(first, p, 200.0)
    again = guess._followed(system, legs, first, p)
    np.testing.assert_allclose(starts[:-1], again[0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(durations, again[1], rtol=1e-11)


def test_a_leg_that_does_not_come_to_its_event_is_told():
    system, _, given = friction()
    with pytest.raises(ns.ConvergenceError, match=r"guess.*leg 1 \(s, ended by"):
        ns.periodic_orbit(
            system, [0.0, 0.0], **{**given, "parameters": {"f": 1.6}, "itinerary": "s -"}
        )


def test_equations_of_other_kinds_are_left_to_the_steps():
    """A smooth oscillator has no event; an orbit in the sliding mode alone keeps its surface."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    r = x**2 + y**2
    system = ns.FilippovSystem([x, y], field=[y + x * (1 - r), -x + y * (1 - r)])
    orbit = ns.periodic_orbit(system, [1.0, 0.1])
    assert orbit.period == pytest.approx(2 * np.pi, rel=1e-13)
    problem, u = orbit.problem, orbit.unknowns
    assert shooting.shot(problem, u, orbit.parameter_vector, 100.0, 20) is None


def test_where_newtons_method_fails_there_is_none():
    system, start, given = walker()
    orbit = ns.periodic_orbit(system, start, **given)
    problem, p = orbit.problem, orbit.parameter_vector
    far = orbit.unknowns + 0.3
    assert shooting.shot(problem, far, p, 1e-3, 20) is None  # no leg may last so long
    assert shooting.shot(problem, far, p, 100.0, 1) is None
    assert shooting.shot(problem, np.full(problem.size, np.nan), p, 100.0, 20) is None
    found = shooting.shot(problem, orbit.unknowns + 1e-3, p, 100.0, 20)
    assert found is not None
    assert np.abs(found[0] - orbit.unknowns).max() < 1e-14
