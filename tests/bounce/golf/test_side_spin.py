"""A ball with a tilted spin axis kicks to the side to which it curves, as the rigid law and compliance
say; on ground that acts as if it were tilted the kick of a drive changes its side."""

import math

import numpy as np
import pytest

import bounce
import nonsmooth as ns
from bounce.golf import SideState, axis_spin, rebound

DEG = math.pi / 180


def side_rebound(model, landing, side_spin, vertical_spin=0.0, side_slope=0.0, **options):
    """Bounce a ball that lands in a vertical plane with side spin."""
    state = SideState.of(landing, side_spin, vertical_spin, side_slope)
    return rebound(model, state, side_slope=side_slope, **options)


def rigid_kick(speed, up, spin, tilt, launch, ball=bounce.golf.GOLF):
    """tan(kick) = -k W2/(V1 - k W1) of a ball that rolls."""
    w1 = ball.radius * spin * math.cos(tilt)
    w2 = -ball.radius * spin * math.sin(tilt) * math.sin(launch)
    return math.atan2(-0.4 * w2, speed - 0.4 * w1)


def test_kick_of_a_wedge_is_the_closed_form():
    law = bounce.laws.RigidBounce(mu=0.5, restitution=0.3)
    spin = 21.0 / bounce.golf.GOLF.radius  # W/|Y'| about 1.05
    for tilt in (10 * DEG, -20 * DEG):
        back, side, _ = axis_spin(spin, tilt, 28 * DEG)
        hit = side_rebound(law, bounce.Landing(15.0, -20.0, back), side)
        assert hit.kick == pytest.approx(rigid_kick(15.0, 20.0, spin, tilt, 28 * DEG), abs=1e-12)
        assert hit.kick * tilt > 0  # to the side to which it curves
    assert hit.lift_off.velocity[1] == pytest.approx(6.0)
    assert hit.landing.side_spin == side and hit.time == 0.0


def test_published_estimates_of_the_kick():
    """With the theory: rigid 5.8 deg, eta = 0.2 6.9, 0.4 13.5 (W/|Y'| = 1.05, V/|Y'| = 0.75)."""
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 20e3)
    down = scaling.speed  # unit normal speed
    back, side, _ = axis_spin(1.05 * down / bounce.golf.GOLF.radius, 10 * DEG, 28 * DEG)
    landing = bounce.Landing(0.75 * down, -down, back)
    law = bounce.laws.RigidBounce(mu=0.5, restitution=bounce.laws.kelvin_voigt_restitution(0.5))
    kicks = [side_rebound(law, landing, side).kick]
    for eta in (0.2, 0.4):
        soft = bounce.KelvinVoigt(mu=0.5, d1=0.1, d2=0.5, eta=eta)
        kicks.append(side_rebound(soft, landing, side, scaling=scaling).kick)
    assert kicks[0] / DEG == pytest.approx(5.8, abs=0.06)
    assert kicks[0] < kicks[1] < kicks[2]
    assert np.array(kicks[1:]) / DEG == pytest.approx([6.9, 13.5], abs=0.06)


def test_without_side_spin_it_is_the_planar_rebound():
    landing = bounce.Landing.polar(28.5, 37.3 * DEG, 2094)
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 20e3)
    soft = bounce.KelvinVoigt(mu=0.5, d1=0.1, d2=0.5, eta=0.3)
    for model, unit in ((bounce.laws.TURFS["natural"].law, None), (soft, scaling)):
        hit = side_rebound(model, landing, 0.0, scaling=unit, tol=1e-12)
        one = rebound(model, landing, scaling=unit, tol=1e-12)
        off, other = one.lift_off, hit.lift_off.in_plane
        assert hit.kick == pytest.approx(0.0, abs=1e-12)
        assert other.xdot == pytest.approx(off.xdot, rel=1e-10)
        assert other.ydot == pytest.approx(off.ydot, rel=1e-10)
        assert other.omega == pytest.approx(off.omega, rel=1e-10)
        assert (hit.x, hit.y, hit.z) == pytest.approx((one.x, one.y, 0.0), abs=1e-10)
        assert hit.slip_angle == pytest.approx(one.slip_angle, abs=1e-10)
        assert one.kick == 0.0


def test_on_ground_that_acts_as_tilted_a_drive_kicks_to_the_other_side():
    """sin(launch - b) takes the place of sin(launch): zero where the plane is normal to the launch."""
    spin, landing = 2094 * math.pi / 30, bounce.Landing.polar(28.5, 37.3 * DEG, 2094)

    def kick(tilt, launch):
        law = bounce.laws.TiltedBounce(mu=0.5, restitution=0.3, tilt=tilt)
        back, side, vertical = axis_spin(spin, 10 * DEG, launch)
        at = bounce.Landing(landing.xdot, landing.ydot, back)
        return side_rebound(law, at, side, vertical_spin=vertical).kick

    assert kick(0.0, 11 * DEG) > 0 > kick(15 * DEG, 11 * DEG)
    assert kick(15 * DEG, 15 * DEG) == pytest.approx(0.0, abs=1e-15)
    assert kick(15 * DEG, 28 * DEG) > 0


def test_mirror_and_side_slope():
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.5)
    landing = bounce.Landing(20.0, -15.0, 200.0)
    one = side_rebound(law, landing, 30.0, side_slope=0.1)
    other = side_rebound(law, landing, -30.0, side_slope=-0.1)
    assert other.kick == pytest.approx(-one.kick, abs=1e-15)
    assert other.lift_off.side_spin == pytest.approx(-one.lift_off.side_spin, abs=1e-12)
    # Ground that rises to the right throws the ball to the left: its normal leans there.
    assert side_rebound(law, landing, 0.0, side_slope=0.1).lift_off.heading < 0


def test_spin_about_the_vertical_is_felt_with_drilling_only():
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 20e3)
    soft = bounce.KelvinVoigt(mu=0.5, d1=0.1, d2=0.5, eta=0.3)
    landing = bounce.Landing(10.0, -15.0, 200.0)
    kicks = [
        side_rebound(model, landing, 20.0, vertical_spin=w, scaling=scaling).kick
        for model in (soft, soft.in_3d(drilling_radius=0.1))
        for w in (0.0, 2000.0)
    ]
    assert kicks[0] == pytest.approx(kicks[1], abs=1e-12)
    assert abs(kicks[2] - kicks[3]) > 1e-4


def test_refusals():
    landing = bounce.Landing(10.0, -15.0, 200.0)
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.5)
    soft = bounce.NormalKelvinVoigt(mu=0.3, d2=0.1)
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 20e3)
    cross = bounce.laws.CrossBounce(mu=0.3, restitution=0.5, tangential_restitution=0.2)
    for model in (cross, bounce.laws.PennerBounce(), "turf"):
        with pytest.raises(bounce.ModelError, match="model"):
            side_rebound(model, landing, 1.0)
    with pytest.raises(bounce.ModelError, match="scaling"):
        side_rebound(soft, landing, 1.0)
    with pytest.raises(
        bounce.LandingError, match="in_3d"
    ):  # in the plane the model is given as it is
        rebound(soft.in_3d(), landing, scaling=scaling)
    with pytest.raises(ns.OptionError, match="side_slope"):
        side_rebound(soft.in_3d(side_slope=0.1), landing, 1.0, scaling=scaling)
    steep = bounce.laws.TiltedBounce(mu=0.4, restitution=0.3, tilt=lambda speed, angle: 2.0)
    with pytest.raises(ns.ParameterError, match="tilt"):
        side_rebound(steep, landing, 1.0)
    with pytest.raises(ns.OptionError, match="axis_tilt, launch_angle"):
        axis_spin(2000.0, 100.0, 0.2)
    with pytest.raises(ns.OptionError, match="side_slope"):
        side_rebound(law, landing, 1.0, side_slope=2.0)
    with pytest.raises(ns.OptionError, match="side_slope"):
        rebound(law, landing, side_slope=0.1)
    with pytest.raises(ns.OptionError, match="landing"):
        rebound(law, (10.0, -15.0, 200.0))
    with pytest.raises(ns.PointError, match="velocity"):
        SideState([1.0, 2.0], [0.0, 0.0, 0.0])
    with pytest.raises(ns.PointError, match="spin"):
        SideState([1.0, 2.0, 0.0], [0.0, math.nan, 0.0])


def test_a_landing_outside_of_the_fit_is_warned_of_with_side_spin_too():
    fast = bounce.Landing.polar(60.0, 30 * DEG, 2000)
    with pytest.warns(bounce.golf.ExtrapolationWarning, match="TiltedBounce") as caught:
        rebound(bounce.laws.TURFS["natural"].law, SideState.of(fast, 50.0))
    assert caught[0].filename == __file__
