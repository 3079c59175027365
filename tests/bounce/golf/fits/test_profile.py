"""An interval of a fit that is too narrow gives a warning, and its profile extends as far as the data allow."""

import pickle
import warnings

import numpy as np
import pytest

import bounce
import nonsmooth as ns

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)


def gentle(seed, size=0.1, noise=0.001):
    """Five bounces that mostly roll, so that friction is whatever it needs to be, with noise."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(-size, size, 5)
    w = -u + rng.uniform(-size, size, 5)
    off = bounce.lift_off(TURF, u, -1.0, w)
    measured = {
        f"lift_off_{name}": getattr(off, name) + rng.normal(size=5) * noise
        for name in ("xdot", "ydot", "omega")
    }
    return dict(xdot=u, ydot=-np.ones(5), omega=w, **measured)


@pytest.mark.parametrize("seed", [36, 53])
def test_an_interval_that_misses_the_exact_value_is_reported(seed):
    with pytest.warns(bounce.golf.IdentifiabilityWarning, match="mu"):
        found = bounce.golf.fit(TURF.replace(mu=0.4), gentle(seed), parameters=["mu"], starts=4)
    low, high = found.interval()["mu"]
    assert not low <= 0.3 <= high and found.narrow == ("mu",)
    low, high = found.profile()["mu"]
    assert low <= 0.3 <= high
    assert "too narrow" in repr(found) and found.to_dict()["narrow"] == ["mu"]
    assert pickle.loads(pickle.dumps(found)).profile() == found.profile()


def test_friction_of_bounces_that_only_roll_has_no_upper_end():
    u = np.array([0.02, -0.03, 0.05, 0.01, -0.02])
    noise = np.random.default_rng(1).normal(size=(3, 5)) * 0.01
    off = bounce.lift_off(TURF, u, -1.0, -u)
    names = ("xdot", "ydot", "omega")
    data = {f"lift_off_{n}": getattr(off, n) + e for n, e in zip(names, noise, strict=True)}
    data |= dict(xdot=u, ydot=-np.ones(5), omega=-u)
    with pytest.warns(bounce.golf.IdentifiabilityWarning):
        found = bounce.golf.fit(TURF, data, parameters=["mu"], starts=2)
    low, high = found.profile()["mu"]
    assert low <= 0.3 and high == np.inf


def test_an_end_far_below_a_fitted_value_that_ran_away_is_resolved():
    """All balls grip, so only a friction below what the steepest needed is refused by the data."""
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.5)
    u, v = np.array([1.0, 2.0, 3.0]), np.full(3, 10.0)
    off = law.lift_off(u, -v, 0 * u)
    seen = off.xdot + np.array([1e-3, -1e-3, 1e-3])
    data = dict(xdot=u, ydot=-v, omega=0 * u, lift_off_xdot=seen)
    with pytest.warns(bounce.golf.IdentifiabilityWarning):
        found = bounce.golf.fit(law.replace(mu=1e6), data, parameters=["mu"], starts=0)
    # to stop a slip u the friction of a uniform sphere needs mu (1 + e) v >= 2 u/7
    low, high = found.profile()["mu"]
    assert low == pytest.approx(2 * 3.0 / 7 / 1.5 / 10.0, rel=0.02) and high == np.inf


def test_a_parameter_that_enters_linearly_has_the_interval_of_student():
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.5)
    v, rng = np.linspace(5, 20, 12), np.random.default_rng(0)
    data = dict(xdot=v, ydot=-v, omega=0 * v, lift_off_ydot=0.5 * v + rng.normal(size=12))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = bounce.golf.fit(law, data, parameters=["restitution"], starts=2)
    assert found.narrow == ()
    for level in (0.5, 0.95):
        assert found.profile(level)["restitution"] == pytest.approx(
            found.interval(level)["restitution"], rel=1e-3
        )
    with pytest.raises(ns.OptionError, match="level"):
        found.profile(1.0)


def test_the_others_are_refitted():
    """A linear problem of two parameters: the profile of each is Student's interval."""
    rng = np.random.default_rng(3)
    law = bounce.laws.RigidBounce(mu=0.1, restitution=0.5)  # steep slip: both enter linearly
    u, v = rng.uniform(20, 30, 40), rng.uniform(3, 6, 40)
    off = law.lift_off(u, -v, 0 * u)
    noise = rng.normal(size=(2, 40)) * 0.05
    data = dict(xdot=u, ydot=-v, omega=0 * u)
    data |= dict(lift_off_xdot=off.xdot + noise[0], lift_off_ydot=off.ydot + noise[1])
    found = bounce.golf.fit(law, data, parameters=["mu", "restitution"], starts=2)
    for name, ends in found.interval().items():
        assert found.profile()[name] == pytest.approx(ends, rel=0.01)
