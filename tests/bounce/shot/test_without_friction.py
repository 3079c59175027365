"""With mu = 0 a ball keeps its spin and moves along the ground as its springs say."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import bounce
import nonsmooth as ns

SMOOTH = bounce.KelvinVoigt(mu=0.0, d1=0.1, d2=0.2, eta=0.5)
LANDING = dict(xdot=st.floats(-2, 2), omega=st.floats(-2, 2))


def oscillator(speed, damping, frequency, t):
    """Speed at a time of x'' + 2 d f x' + f^2 x = 0 from x = 0."""
    damped = frequency * math.sqrt(1 - damping**2)
    decay = math.exp(-damping * frequency * t)
    phase = damped * t
    return speed * decay * (math.cos(phase) - damping / math.sqrt(1 - damping**2) * math.sin(phase))


@given(**LANDING)
def test_closed_form(xdot, omega):
    shot = bounce.simulate(SMOOTH, xdot, -1.0, omega, tol=1e-12)
    end = shot.lift_off
    assert end.omega == pytest.approx(omega, abs=1e-11)
    assert end.xdot == pytest.approx(oscillator(xdot, 0.1, 0.5, shot.time), abs=1e-11)
    assert end.ydot == pytest.approx(bounce.laws.kelvin_voigt_restitution(0.2), abs=1e-11)
    assert np.abs(shot.forces(np.linspace(0, shot.time, 9)).friction).max() < 1e-15


@given(**LANDING)
def test_the_limit_of_little_friction(xdot, omega):
    """Friction mu < 1e-9 moves the spin by at most mu/inertia times the impulse of the load, 2.

    At rest along the ground it would roll into the two-fold, to rounding.
    """
    assume(max(abs(xdot), abs(omega)) > 1e-6)
    one = bounce.simulate(SMOOTH, xdot, -1.0, omega, tol=1e-12).lift_off
    other = bounce.simulate(SMOOTH.replace(mu=1e-9), xdot, -1.0, omega, tol=1e-12).lift_off
    assert abs(one.omega - other.omega) <= 1e-8
    assert abs(one.xdot - other.xdot) <= 1e-8


@pytest.mark.parametrize(
    "model",
    [
        SMOOTH,
        SMOOTH.replace(G=0.01, load="net"),
        bounce.NormalKelvinVoigt(mu=0.0, d2=0.1),
        bounce.Hertz(mu=0.0, stiffness=1.0, d1=0.1, eta=0.5),
        SMOOTH.replace(friction=bounce.contact.Viscous(viscosity=0.1)),
    ],
    ids=repr,
)
def test_arrays_agree_also_at_no_slip(model):
    xdot, omega = np.array([0.5, 0.5, 0.0, -0.3]), np.array([0.2, -0.5, 0.0, 0.3])
    many = bounce.lift_off(model, xdot, -1.0, omega)
    assert many.complete.all()
    for k in range(4):
        shot = bounce.simulate(model, xdot[k], -1.0, omega[k])
        assert many.itinerary[k] == shot.itinerary
        assert many.slip[k] == pytest.approx(shot.slip, abs=1e-9)
    mixed = bounce.lift_off(model, 0.5, -1.0, 0.2, parameters=dict(mu=[0.0, 0.3, -0.1]))
    bad = bounce.BounceStatus.BAD_PARAMETER
    assert mixed.status.tolist() == [0, 0, bad]
    assert mixed.omega[0] == pytest.approx(many.omega[0], abs=1e-9)


@pytest.mark.parametrize("hypothesis", ["kinematic", "poisson", "energetic"])
@given(**LANDING)
def test_laws(hypothesis, xdot, omega):
    """Rigid impact only turns the normal speed round; so do the laws that are made of it."""
    rigid = bounce.laws.RigidBounce(mu=0.0, restitution=0.5, hypothesis=hypothesis)
    cross = bounce.laws.CrossBounce(mu=0.0, restitution=0.5, tangential_restitution=0.5)
    flat = bounce.laws.TiltedBounce(mu=0.0, restitution=0.5, tilt=0.0)
    for law in (rigid, cross, flat):
        shot = law.lift_off(xdot, -2.0, omega)
        assert (float(shot.xdot), float(shot.ydot), float(shot.omega)) == (xdot, 1.0, omega)
        assert float(shot.slip) == pytest.approx(xdot + omega, abs=1e-15)
        assert shot.tangential_impulse == 0.0
        slips = "I" if law is not rigid or xdot + omega else "III"
        sign = {1.0: "+", -1.0: "-"}.get(float(np.sign(xdot + omega)), "")
        assert law is cross or str(shot.case) in (slips + sign, "III" + sign)


def test_a_ball_without_friction_slips_for_ever_on_the_ground():
    law = bounce.laws.RigidBounce(mu=0.0, restitution=0.0)
    with pytest.raises(bounce.golf.NoRestError, match="friction"):
        bounce.golf.play(law, bounce.Landing(5.0, -1.0, 0.0))


@pytest.mark.filterwarnings("error")
def test_the_cone_is_a_line():
    shot = bounce.simulate(SMOOTH, 0.3, -1.0, 0.1)
    low, high = bounce.plot.friction_cone(shot).axes[0].get_xlim()
    assert low < 0.0 < high


@pytest.mark.parametrize(
    "law",
    [
        bounce.contact.Dahl(bristle_stiffness=50.0),
        bounce.contact.LuGre(bristle_stiffness=50.0, mu_kinetic=0.2, stribeck_speed=0.5),
    ],
    ids=repr,
)
def test_bristles_need_friction(law):
    with pytest.raises(ns.ParameterError, match="mu"):
        SMOOTH.replace(friction=law)
    model = SMOOTH.replace(friction=law, mu=0.3)
    many = bounce.lift_off(model, 0.5, -1.0, 0.2, parameters=dict(mu=[0.3, 0.0]))
    assert many.status.tolist() == [0, bounce.BounceStatus.BAD_PARAMETER]


def test_parameters_of_the_friction_law_are_checked_in_arrays_too():
    law = bounce.contact.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5)
    model = SMOOTH.replace(friction=law, mu=0.3)
    with pytest.raises(ns.ParameterError, match="stribeck_speed"):
        model.replace(stribeck_speed=-1.0)
    many = bounce.lift_off(model, 0.5, -1.0, 0.2, parameters=dict(stribeck_speed=[0.5, -1.0]))
    assert many.status.tolist() == [0, bounce.BounceStatus.BAD_PARAMETER]
