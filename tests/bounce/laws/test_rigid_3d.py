"""Rigid impact with side spin is its closed form: the planar law along the first slip."""

import numpy as np
import pytest

import bounce


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
@pytest.mark.parametrize("mu", [0.0, 0.1, 0.3])
def test_on_a_line_it_is_the_planar_law(angle, mu):
    law = bounce.laws.RigidBounce(mu=mu, restitution=0.6)
    e = np.array([np.cos(angle), np.sin(angle)])
    v, w = np.array([1.0, 1.0, -0.5, 0.3]), np.array([0.5, -2.0, -0.2, -0.3])
    plane = law.lift_off(v, -1.0, w)
    space = bounce.laws.rigid_lift_off_3d(law, v[:, None] * e, -1.0, w[:, None] * e)
    assert space.xdot == pytest.approx(plane.xdot[:, None] * e, abs=1e-15)
    assert space.omega == pytest.approx(plane.omega[:, None] * e, abs=1e-15)
    assert space.slip == pytest.approx(plane.slip[:, None] * e, abs=1e-15)
    assert space.ydot == pytest.approx(plane.ydot, abs=1e-15)


def test_deflection_of_a_ball_that_rolls():
    """tan(kick) = -k W2/(V1 - k W1); spin and speed of rolling are opposite."""
    law = bounce.laws.RigidBounce(mu=0.5, restitution=0.5)
    v, w = np.array([1.0, 0.0]), np.array([0.2, 0.5])
    shot = bounce.laws.rigid_lift_off_3d(law, v, -1.0, w)
    assert str(shot.case) == "II" or str(shot.case) == "III"
    assert np.tan(shot.travel_angle) == pytest.approx(-0.4 * 0.5 / (1 - 0.4 * 0.2), abs=1e-15)
    assert shot.xdot == pytest.approx((v - 0.4 * w) / 1.4, abs=1e-15)
    assert shot.omega == pytest.approx(-shot.xdot, abs=1e-15)
    assert np.all(shot.slip == 0.0)


def test_contact_without_compliance_along_the_ground_is_the_law():
    model = bounce.NormalKelvinVoigt(mu=0.1, d2=0.1)
    law = bounce.laws.RigidBounce(mu=0.1, restitution=model.restitution)
    for w in ([1.5, 0.5], [-0.9, 0.05]):  # slips throughout, rolls
        soft = bounce.simulate(model, [1.0, 0.2], -1.0, w, tol=1e-12)
        hard = bounce.laws.rigid_lift_off_3d(law, [1.0, 0.2], -1.0, w)
        assert soft.lift_off.xdot == pytest.approx(hard.xdot, abs=1e-11)
        assert soft.lift_off.omega == pytest.approx(hard.omega, abs=1e-11)


def test_arrays_broadcast_and_refusals():
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.5)
    shot = bounce.laws.rigid_lift_off_3d(law, [1.0, 0.2], [[-1.0], [-2.0]], np.zeros((3, 2)))
    assert shot.xdot.shape == (2, 3, 2) and shot.ydot.shape == (2, 3)
    with pytest.raises(bounce.LandingError, match="omega"):
        bounce.laws.rigid_lift_off_3d(law, [1.0, 0.0], -1.0, 0.5)
    with pytest.raises(bounce.LandingError, match="ydot"):
        bounce.laws.rigid_lift_off_3d(law, [1.0, 0.0], 0.0, [0.5, 0.1])
    with pytest.raises(bounce.LandingError, match="xdot"):
        bounce.laws.rigid_lift_off_3d(law, [np.nan, 0.0], -1.0, [0.5, 0.1])
