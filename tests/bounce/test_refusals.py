"""What does not fit a ball, its ground or a fit is refused by name, with what was expected."""

import dataclasses
import pickle

import numpy as np
import pytest

import bounce
import nonsmooth as ns
from bounce.golf.fits.least_squares import Problem

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.15, eta=0.5)
LAW = bounce.laws.TURFS["natural"].law
LANDING = bounce.Landing(20.0, -15.0, -200.0)


def measured():
    u, w = np.array([0.2, 0.5, -0.4, 0.9]), np.array([0.3, -0.6, 0.8, -1.1])
    off = bounce.lift_off(TURF, u, -1.0, w)
    return dict(
        xdot=u,
        ydot=-np.ones(4),
        omega=w,
        lift_off_xdot=off.xdot,
        lift_off_ydot=off.ydot,
        lift_off_omega=off.omega,
    )


def test_a_scaling_is_that_of_one_ball():
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 2e4)
    heavier = dataclasses.replace(bounce.golf.GOLF, mass=0.06)
    with pytest.raises(bounce.ModelError, match="ball"):
        bounce.golf.rebound(TURF, LANDING, heavier, scaling=scaling)


def test_a_map_of_outcomes_needs_a_contact_model():
    with pytest.raises(bounce.ModelError, match="model"):
        bounce.outcome_map(LAW, over={"xdot": [0.0, 1.0], "omega": [0.0, 1.0]})


def test_a_level_of_confidence_lies_between_0_and_1():
    found = bounce.golf.fit(TURF, measured(), parameters=["mu"], starts=1)
    for level in (0.0, 1.0, -0.5, float("nan")):
        with pytest.raises(ns.OptionError, match="level"):
            found.interval(level)


def test_symbols_of_the_equations_are_read_and_not_set():
    from bounce.parameters import Names

    names = Names("parameter", {"mu": 0.3})
    assert names.mu == 0.3
    assert dir(names) == ["mu"]
    assert not hasattr(names, "__wrapped__")
    with pytest.raises(AttributeError, match="'mu'"):
        names.mu = 0.4


def test_a_failed_lift_off_keeps_its_trajectory_through_a_pickle():
    error = bounce.LiftOffError("no lift-off until t = 1", None)
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), again.trajectory) == (type(error), str(error), None)


def test_a_hypothesis_that_is_not_the_usual_one_is_reported_and_kept():
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.5, hypothesis="poisson")
    assert "poisson" in repr(law)
    assert law.replace(mu=0.4).options()["hypothesis"] == "poisson"
    assert "hypothesis" not in bounce.laws.RigidBounce(mu=0.3, restitution=0.5).options()


def test_a_start_outside_of_what_a_law_allows_costs_infinitely_much():
    """A negative friction coefficient is no error of the search: the step shrinks."""
    data = bounce.golf.read_measurements(measured())
    problem = Problem(TURF, data, ["mu"], None, bounce.golf.GOLF, None, 1e-10)
    start = problem.start(np.array([-1.0]))
    assert start.cost == np.inf
    assert "mu" in start.problem
    assert np.all(np.isnan(problem.residuals(np.array([-1.0]))))
    assert problem.start(np.array([0.3])).cost < 1e-18
