"""Every law creates no energy, is symmetric, broadcasts, and is the rigid one where its change is nil."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bounce
import nonsmooth as ns

LANDINGS = dict(xdot=st.floats(-30, 30), ydot=st.floats(-30, -0.1), omega=st.floats(-30, 30))
LAWS = [fit.law for fit in bounce.laws.TURFS.values()] + [
    bounce.laws.CrossBounce(mu=0.6, restitution=0.7, tangential_restitution=0.3)
]


def energy(xdot, ydot, omega, inertia=2 / 5):
    return 0.5 * (xdot**2 + ydot**2 + inertia * omega**2)


@given(**LANDINGS)
def test_no_tilt_and_no_tangential_restitution_are_the_rigid_law(xdot, ydot, omega):
    rigid = bounce.laws.RigidBounce(mu=0.4, restitution=0.6).lift_off(xdot, ydot, omega)
    tilted = bounce.laws.TiltedBounce(mu=0.4, restitution=0.6, tilt=0.0).lift_off(xdot, ydot, omega)
    cross = bounce.laws.CrossBounce(mu=0.4, restitution=0.6, tangential_restitution=0.0)
    for other in (tilted, cross.lift_off(xdot, ydot, omega)):
        for name in ("xdot", "ydot", "omega", "slip", "tangential_impulse"):
            assert abs(getattr(other, name) - getattr(rigid, name)) <= 1e-13 * 60


@pytest.mark.parametrize("law", LAWS, ids=repr)
@given(**LANDINGS)
def test_energy_never_increases_and_the_mirror_image_is_a_bounce(law, xdot, ydot, omega):
    after = law.lift_off(xdot, ydot, omega)
    before = energy(xdot, ydot, omega)
    assert energy(after.xdot, after.ydot, after.omega) <= before * (1 + 1e-12)
    mirrored = law.lift_off(-xdot, ydot, -omega)
    assert [-mirrored.xdot, mirrored.ydot, -mirrored.omega] == pytest.approx(
        [after.xdot, after.ydot, after.omega], abs=1e-12 * 60
    )


def test_arrays_broadcast():
    law = bounce.laws.TURFS["natural"].law
    many = law.lift_off(np.linspace(-5, 5, 7)[:, None], -3.0, np.linspace(-2, 2, 4))
    assert many.xdot.shape == many.ydot.shape == many.case.shape == (7, 4)
    one = law.lift_off(5.0, -3.0, 2.0)
    assert float(one.ydot) == pytest.approx(float(many.ydot[-1, -1]), rel=1e-14)


def test_laws_are_values():
    law = bounce.laws.TURFS["natural"].law
    assert law.replace(mu=0.5).tilt == law.tilt and law.replace(tilt=0.1).restitution == 0.147
    assert law == bounce.laws.TiltedBounce(mu=0.998, restitution=0.147, tilt=math.radians(18.4))
    assert law != law.replace(tilt=0.1)
    assert repr(bounce.laws.PennerBounce(mu=0.3)) == "PennerBounce(mu=0.3)"
    assert bounce.laws.PennerBounce().replace(mu=0.3).values["mu"] == 0.3


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (
            lambda: bounce.laws.TiltedBounce(mu=0.4, restitution=0.5, tilt=18.4),
            ns.ParameterError,
            "tilt",
        ),
        (
            lambda: bounce.laws.TiltedBounce(mu=0.4, restitution=1.5, tilt=0.1),
            ns.ParameterError,
            "restitution",
        ),
        (
            lambda: bounce.laws.CrossBounce(mu=0.4, restitution=0.5, tangential_restitution=1.2),
            ns.ParameterError,
            "tangential_restitution",
        ),
        (lambda: bounce.laws.PennerBounce(mu=-0.1), ns.ParameterError, "mu"),
        (
            lambda: bounce.laws.TURFS["natural"].law.lift_off(1.0, 1.0, 0.0),
            bounce.LandingError,
            "ydot",
        ),
        (
            lambda: bounce.laws.PennerBounce().lift_off(200.0, -200.0, 0.0),
            ns.ParameterError,
            "tilt",
        ),
    ],
)
def test_messages(make, error, message):
    with pytest.raises(error, match=message):
        make()
