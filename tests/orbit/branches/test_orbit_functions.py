"""Functions of orbits along a branch: OC1 of ``tests/cases/orbits_2.json``, and orbits in closed form."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit import BranchEnd
from tests.orbit.periodic_cases import relay_oscillator, symbols, values_of

CASES = values_of("cases/orbits_2.json")
RELAY = relay_oscillator()
x, v = ca.vertsplit(RELAY.extended_states)
t, W, c = symbols("t W c")
LINEAR = ns.FilippovSystem(
    [x, v], field=[v, ca.cos(W * t) - x - c * v], time=t, parameters={W: 0.5, c: 0.4}
)


def decay(damping):
    """The factor q of half a turn, with which the amplitude of the relay oscillator is f (1 + q)/(1 - q)."""
    return np.exp(-damping * np.pi / np.sqrt(1 - damping**2))


def relay_orbit(**given):
    return ns.periodic_orbit(RELAY, [-6.4, 0.0], **given)


def resonance(w, damping=0.4):
    """The amplitude of the linear oscillator."""
    return 1 / np.hypot(1 - w**2, damping * w)


@pytest.mark.parametrize("symmetry", [None, "odd"])
def test_oc1_the_amplitude_as_an_event(symmetry) -> None:
    o, orbit, values = ns.orbit_functions(RELAY), relay_orbit(symmetry=symmetry), CASES["OC1"]
    half = np.log(2) / (2 * np.pi)  # q^2 = 1/2
    events = {"amplitude 2": o.max("x") - 2, "multiplier 1/2": 2 * o.multiplier(0) - 1}
    branch = ns.continue_orbit(orbit, "d", bounds=(0.08, 0.36), step=0.2, events=events)
    found = {event.kind: event for event in branch.events}
    assert len(branch.events) == 2
    event = found["amplitude 2"]
    assert event.parameter == pytest.approx(float(values["d where amplitude = 2"]), abs=1e-13)
    assert found["multiplier 1/2"].parameter == pytest.approx(half / np.hypot(1, half), abs=1e-11)
    slope, period = float(values["damplitude/dd there"]), float(values["dT/dd there"])
    assert o.max(x).derivative(event.orbit, "d") == pytest.approx(slope, rel=1e-12)
    assert o.min("x").derivative(event.orbit, "d") == pytest.approx(-slope, rel=1e-12)
    assert o.period.derivative(event.orbit, "d") == pytest.approx(period, rel=1e-12)
    if symmetry is None:
        assert o.at("h0", "x**2")(event.orbit) == pytest.approx(4.0, rel=1e-12)


def test_a_constraint_holds_along_the_branch() -> None:
    """The amplitude stays 2 where f = 2 (1 - q)/(1 + q)."""
    o = ns.orbit_functions(RELAY)
    given = {"free": ["f"], "constraints": [o.max("x") - 2]}
    branch = ns.continue_orbit(relay_orbit(), "d", bounds=(0.08, 0.3), step=0.2, **given)
    assert branch.ends == (BranchEnd.REACHED_BOUND,) * 2
    for value, orbit in zip(branch.values, branch.solutions, strict=True):
        q = decay(value)
        assert orbit.parameters["f"] == pytest.approx(2 * (1 - q) / (1 + q), rel=1e-11)
    (orbit,) = branch.at(0.25)
    assert o.max("x")(orbit) == pytest.approx(2.0, rel=1e-12) and not orbit.is_virtual


@pytest.mark.parametrize(
    ("cost", "peak"),
    [
        (lambda o: o.max("x"), np.sqrt(1 - 0.4**2 / 2)),  # where the amplitude is largest
        (lambda o: o.integral("v**2") / o.period, 1.0),  # the mean of v^2, W^2 A^2/2
    ],
)
def test_the_extremum_of_a_cost_is_the_peak_of_a_resonance(cost, peak) -> None:
    o = ns.orbit_functions(LINEAR)
    orbit = ns.periodic_orbit(LINEAR, [1.0, 0.0])
    branch = ns.continue_orbit(orbit, "W", bounds=(0.45, 1.1), step=0.2, cost=cost(o))
    (event,) = branch.events
    assert event.kind == "extremum of the cost"
    assert event.parameter == pytest.approx(peak, abs=1e-9)
    assert event.coefficients["cost"] == pytest.approx(cost(o)(event.orbit), rel=1e-12)


def test_values_and_derivatives_of_a_linear_oscillator() -> None:
    o, w = ns.orbit_functions(LINEAR), 0.5
    orbit, a = ns.periodic_orbit(LINEAR, [1.0, 0.0]), resonance(0.5)
    slope = -0.5 * a**3 * (2 * (1 - w**2) * -2 * w + 2 * 0.4**2 * w)
    for function, value, by_w in [
        (o.max("x"), a, slope),
        (o.min("-x"), -a, -slope),
        (o.max("W*x"), w * a, a + w * slope),
        (o.integral("x**2"), a**2 * np.pi / w, 2 * a * slope * np.pi / w - a**2 * np.pi / w**2),
        (o.integral("t") / o.period, np.pi / w, -np.pi / w**2),
        (1 - o.max("x") * o.period, 1 - 2 * np.pi * a / w, -2 * np.pi * (slope / w - a / w**2)),
    ]:
        assert function(orbit) == pytest.approx(value, rel=1e-11)
        assert function.derivative(orbit, "W") == pytest.approx(by_w, rel=1e-9)


O = ns.orbit_functions(RELAY)


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"events": [O.period]}, ns.DefinitionError, "mapping"),
        ({"events": {"a": 2.0}}, ns.DefinitionError, "no function of the orbits"),
        ({"cost": ns.orbit_functions(LINEAR).period}, ns.DefinitionError, "no function of the orbits"),
        ({"constraints": [O.period - 7]}, ns.DefinitionError, "as many parameters"),
        ({"constraints": [O.period - 7], "free": ["d"]}, ns.DefinitionError, "twice"),
        ({"constraints": [O.max("x") - 1e9], "free": ["f"]}, ns.ConvergenceError, "fulfils|fulfil"),
        ({"events": {"a": O.at("nowhere", "x")}}, ns.OptionError, "nowhere"),
        ({"events": {"a": O.multiplier(5)}}, ns.OptionError, "multipliers"),
    ],
)  # fmt: skip
def test_bad_functions_are_refused(given, error, words) -> None:
    with pytest.raises(error, match=words):
        ns.continue_orbit(relay_orbit(), "d", bounds=(0.05, 0.4), **given)


@pytest.mark.parametrize(
    "text", ["y", "x +", "__import__('os')", "x.real", "[x]", "x if v else d", 3]
)
def test_what_is_no_expression_is_refused(text) -> None:
    with pytest.raises(ns.DefinitionError, match="no scalar expression"):
        O.max(text)
