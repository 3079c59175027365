"""Friction laws reduce to Coulomb's, keep to their own cone, and creep where they have a bristle."""

import math

import numpy as np
import pytest

import bounce
import nonsmooth as ns

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
COULOMB = bounce.simulate(TURF, 0.3, -1.0, 0.1, tol=1e-12)
SET_VALUED = [
    bounce.contact.Stribeck(mu_kinetic=0.2, stribeck_speed=0.3),
    bounce.contact.ExponentialDecay(mu_kinetic=0.2, decay_speed=0.3),
    bounce.contact.Viscous(viscosity=0.1),
]


def coefficient(law, slip):
    q, mu = law.values, 0.3
    if isinstance(law, bounce.contact.Stribeck):
        return q["mu_kinetic"] + (mu - q["mu_kinetic"]) * np.exp(
            -((slip / q["stribeck_speed"]) ** 2)
        )
    if isinstance(law, bounce.contact.ExponentialDecay):
        return q["mu_kinetic"] + (mu - q["mu_kinetic"]) * np.exp(-slip / q["decay_speed"])
    return mu + q["viscosity"] * slip


@pytest.mark.parametrize("law", SET_VALUED, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("landing", [(0.3, -1.0, 0.1), (-0.5, -1.0, -0.4), (0.2, -1.0, 1.4)])
def test_traction_while_slipping_and_rolling(law, landing):
    shot = bounce.simulate(TURF.replace(friction=law), *landing, tol=1e-12)
    t = np.linspace(0.0, shot.time, 300)
    load, friction = shot.forces(t)
    states, mode = shot(t), shot.mode(t)
    slip = states[:, 1] + states[:, 4]
    bound = coefficient(law, np.abs(slip)) * load
    assert np.all(np.abs(friction) <= bound * (1 + 1e-12) + 1e-12)
    slipping = mode != "s"
    assert np.allclose(friction[slipping], -np.sign(slip[slipping]) * bound[slipping], atol=1e-10)
    assert np.all(np.abs(slip[~slipping][1:]) < 1e-12)


@pytest.mark.parametrize("law", SET_VALUED, ids=lambda law: type(law).__name__)
def test_mirror(law):
    model = TURF.replace(friction=law)
    a, b = (bounce.simulate(model, s * 0.3, -1.0, s * 0.6) for s in (1, -1))
    assert np.abs(np.array(a.lift_off) * [-1, 1, -1, -1, 1] - b.lift_off).max() < 1e-13


@pytest.mark.parametrize(
    "law",
    [
        bounce.contact.Stribeck(mu_kinetic=0.3, stribeck_speed=0.3),
        bounce.contact.ExponentialDecay(mu_kinetic=0.3, decay_speed=0.3),
        bounce.contact.Viscous(viscosity=0.0),
    ],
    ids=lambda law: type(law).__name__,
)
def test_coulomb_as_a_special_case(law):
    shot = bounce.simulate(TURF.replace(friction=law), 0.3, -1.0, 0.1, tol=1e-12)
    assert shot.itinerary == COULOMB.itinerary
    assert np.abs(np.array(shot.lift_off) - COULOMB.lift_off).max() < 1e-12


@pytest.mark.parametrize("kind", ["dahl", "lugre"])
def test_stiff_bristles_approach_coulomb(kind):
    gaps = []
    for stiffness in (100.0, 400.0):
        if kind == "dahl":
            law = bounce.contact.Dahl(bristle_stiffness=stiffness)
        else:
            law = bounce.contact.LuGre(
                bristle_stiffness=stiffness, bristle_damping=1.0, mu_kinetic=0.3, stribeck_speed=1.0
            )
        shot = bounce.simulate(TURF.replace(friction=law), 0.3, -1.0, 0.1, tol=1e-9)
        assert shot.trajectory.system.state_names[-1] == "bristle"
        assert "s" not in shot.itinerary, "the law is single-valued: nothing sticks exactly"
        gaps.append(np.abs(np.array(shot.lift_off) - COULOMB.lift_off).max())
    assert gaps[1] < 0.7 * gaps[0] < 0.01


def test_parameters_of_a_law_belong_to_the_model():
    model = TURF.replace(friction=bounce.contact.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5))
    assert model.values["mu_kinetic"] == 0.2
    assert model.replace(mu_kinetic=0.25).values["mu_kinetic"] == 0.25
    assert "friction=Stribeck" in repr(model)
    with pytest.raises(ns.ParameterError, match="mu_kinetic"):
        model.replace(mu_kinetic=-1.0)
    with pytest.raises(ns.ParameterError, match="stribeck_speed"):
        bounce.contact.Stribeck(mu_kinetic=0.2)
    with pytest.raises(ns.ParameterError, match="viscosity"):
        bounce.contact.Viscous(viscosity=math.nan)


def test_a_coefficient_of_ones_own():
    """Overriding friction_coefficient is enough: wet ground that is slippery when fast."""

    class Wet(bounce.KelvinVoigt):
        parameters = dict(film=0.5)

        def friction_coefficient(self, s, p):
            return p.mu / (1 + p.film * s.slip)

    wet = Wet(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    shot = bounce.simulate(wet, 0.3, -1.0, 2.0)
    load, friction = shot.forces(0.5)
    state = shot(0.5)
    assert friction == pytest.approx(-0.3 / (1 + 0.5 * (state[1] + state[4])) * load, abs=1e-12)


def test_bristles_at_rest_do_not_stop_a_vertical_landing():
    """The bristle law is continuous across H = 0, so there is nothing to decide there."""
    law = bounce.contact.LuGre(bristle_stiffness=200.0, mu_kinetic=0.2, stribeck_speed=0.1)
    model = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, friction=law)
    shot = bounce.simulate(model, xdot=0.0, ydot=-1.0, omega=0.0)
    assert shot.slip == 0.0 and shot.time == pytest.approx(2.956075324749550, abs=1e-9)
