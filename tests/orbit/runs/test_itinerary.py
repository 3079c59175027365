"""A fixed itinerary is a smooth map of its start, and says in terms of guards when none moves so."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v = ca.SX.sym("x"), ca.SX.sym("v")


@pytest.fixture(scope="module")
def block() -> ns.FilippovSystem:
    """A block of unit mass on a belt of speed 1, with unit friction and spring."""
    return ns.FilippovSystem([x, v], surface=v - 1, above=[v, -x - 1], below=[v, -x + 1])


def test_it_ends_where_a_simulation_does(block: ns.FilippovSystem) -> None:
    arrival = ns.orbit.FixedItinerary(block, "- s", until="lambda0 = -1").arrive([-1.0, 0.0])
    run = ns.simulate(block, [-1.0, 0.0], 9.0, tol=1e-13)
    assert run.itinerary.startswith("- s -") and not arrival.fault
    assert arrival.x == pytest.approx(run.events[1].x, rel=1e-12)
    assert arrival.t == pytest.approx(run.events[1].t, rel=1e-12)
    assert arrival.entry == pytest.approx(run.events[0].t, rel=1e-12)


def test_faults_name_the_guard_and_the_leg(block: ns.FilippovSystem) -> None:
    late = ns.orbit.FixedItinerary(block, "- s", until="lambda0 = -1").arrive([1.0, -1.2])
    assert late.fault == ""
    crossing = ns.orbit.FixedItinerary(block, "- +", until="h0").arrive([-1.0, 0.0])
    assert crossing.fault.startswith("leg 1 (-): where mode '+' begins")
    assert "h0 > 0 fails" in crossing.fault
    # From x = -3 the belt is passed, so it cannot stick.
    sticking = ns.orbit.FixedItinerary(block, "- s", until="lambda0 = -1").arrive([-3.0, 0.0])
    assert "lambda0 <= 1 fails" in sticking.fault


def test_its_derivative_is_that_of_the_map_whatever_the_guards_say(block) -> None:
    virtual = ns.orbit.FixedItinerary(block, "- +", until="h0")
    start, h = np.array([-1.0, 0.0]), 1e-4
    _, at_event = virtual.derivative(virtual.arrive(start))
    for column, e in zip(at_event.T, h * np.eye(2), strict=True):
        ends = {k: virtual.arrive(start + k * e).x for k in (-2, -1, 1, 2)}
        slope = (8 * (ends[1] - ends[-1]) - (ends[2] - ends[-2])) / (12 * h)
        assert column == pytest.approx(slope, abs=1e-9)


def test_words_that_do_not_fit_are_refused(block: ns.FilippovSystem) -> None:
    with pytest.raises(ns.DefinitionError, match="mode"):
        ns.orbit.FixedItinerary(block, "- x", until="h0")
    with pytest.raises(ns.OptionError, match="itinerary"):
        ns.orbit.FixedItinerary(block, "- -", until="h0").arrive([-1.0, 0.0])
    with pytest.raises(ns.ConvergenceError, match="leg in mode"):
        ns.orbit.FixedItinerary(block, "s", until="lambda0 = 1", t_max=1.0).arrive([0.0, 1.0])


def test_an_itinerary_without_modes_is_refused(block: ns.FilippovSystem) -> None:
    for word in ("", []):
        with pytest.raises(ns.OptionError, match="itinerary"):
            ns.orbit.FixedItinerary(block, word, until="h0")


def test_a_system_without_switches_has_one_mode_whatever_it_is_called() -> None:
    """x'' = -x from (1, 0) meets v = 0 again at t = pi."""
    smooth = ns.FilippovSystem([x, v], field=[v, -x], stops=[ns.Stop(x + 0.5, -1, name="half")])
    for word in ("o", [""]):
        arrival = ns.orbit.FixedItinerary(smooth, word, until="half").arrive([1.0, 0.0])
        assert arrival.t == pytest.approx(2 * np.pi / 3, abs=1e-10)
        assert arrival.x == pytest.approx([-0.5, -np.sqrt(0.75)], abs=1e-10)
