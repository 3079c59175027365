"""Shots with side spin: in a vertical plane they are the planar ones, they turn and mirror with the launch, and a
ball that stays down follows the parabola of a cue ball and then a straight line."""

import math

import numpy as np
import pytest

import bounce
import nonsmooth as ns
from bounce.golf import SMITS_SMITH, SideState, axis_spin, flight, play, side_flight, side_play

DEG = math.pi / 180
NATURAL = bounce.laws.TURFS["natural"].law
SOFT = bounce.KelvinVoigt(mu=0.5, d1=0.1, d2=0.5, eta=0.3)
SCALING = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 20e3)
DRIVE = bounce.Landing.polar(28.5, 37.3 * DEG, 2094)


def turned(state, angle):
    """A state turned to the right."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    return SideState(turn @ state.velocity, turn @ state.spin)


def curved():
    spin = axis_spin(283.0, 10 * DEG, 11 * DEG)
    launch = bounce.Landing(70 * math.cos(11 * DEG), 70 * math.sin(11 * DEG), spin.backspin)
    return SideState.of(launch, spin.side, spin.vertical)


@pytest.mark.parametrize("air", [None, SMITS_SMITH])
def test_a_flight_without_side_spin_is_the_planar_one(air):
    launch = bounce.Landing(60.0, 15.0, 300.0)
    one = flight(launch, air=air, slope=0.1, start=(1.0, 0.5), tol=1e-12)
    other = side_flight(SideState.of(launch), air=air, slope=0.1, start=(1.0, 0.5, 2.0), tol=1e-12)
    assert other.range == pytest.approx(one.range, rel=1e-10) and abs(other.side) < 1e-12
    assert other.height == pytest.approx(one.height, rel=1e-9)
    assert other.time == pytest.approx(one.time, rel=1e-10)
    assert other.landing.in_plane.omega == pytest.approx(one.landing.omega, rel=1e-10)
    assert other(0.7)[:2] == pytest.approx(one(0.7), rel=1e-9) and other.start[2] == 2.0


def test_a_fade_curves_right_as_a_draw_curves_left_and_turns_with_the_launch():
    fade = side_flight(curved(), air=SMITS_SMITH)
    mirror = np.array([1, 1, -1])
    drawn = SideState(curved().velocity * mirror, -curved().spin * mirror)
    draw = side_flight(drawn, air=SMITS_SMITH)
    assert fade.side > 10 and draw.side == -fade.side and draw.range == fade.range
    other = side_flight(turned(curved(), 0.4), air=SMITS_SMITH)
    c, s = math.cos(0.4), math.sin(0.4)
    assert other.range == pytest.approx(c * fade.range - s * fade.side, rel=1e-8)
    assert other.side == pytest.approx(s * fade.range + c * fade.side, rel=1e-8)
    assert fade.landing.heading > 0 and other.time == pytest.approx(fade.time, rel=1e-9)


def test_a_side_slope_pulls_a_ball_in_the_air_to_its_foot():
    launch = SideState([10.0, 8.0, 0.0], [0.0, 0.0, 0.0])
    g = bounce.golf.flight(bounce.Landing(1.0, 1.0, 0.0)).time / 2
    hop = side_flight(launch, slope=0.1, side_slope=0.2)
    across, down = math.cos(0.1) * math.sin(0.2) / g, math.cos(0.1) * math.cos(0.2) / g
    assert hop.time == pytest.approx(16.0 * g / (down * g), rel=1e-12)
    assert hop.side == pytest.approx(-across * hop.time**2 / 2, rel=1e-12)


@pytest.mark.filterwarnings("ignore::bounce.golf.ExtrapolationWarning")
@pytest.mark.parametrize(
    "model, more",
    [(NATURAL, {}), (NATURAL, dict(slope=0.03, air=SMITS_SMITH)), (SOFT, dict(scaling=SCALING))],
    ids=["natural", "natural uphill in air", "compliant"],
)
def test_a_run_without_side_spin_is_the_planar_one(model, more):
    one = play(model, DRIVE, tol=1e-12, **more)
    other = side_play(model, SideState.of(DRIVE), tol=1e-12, **more)
    assert len(one.bounces) == len(other.bounces) and one.extrapolated == other.extrapolated
    assert one.cautions == other.cautions
    assert other.rest == pytest.approx([one.run_out, 0.0], rel=1e-8, abs=1e-8)
    assert other.time == pytest.approx(one.time, rel=1e-8)
    assert other.first_height == pytest.approx(one.first_height, rel=1e-8)
    assert other.path()[-1] == pytest.approx([one.time, one.run_out, 0.0, 0.0], rel=1e-8, abs=1e-8)


@pytest.mark.filterwarnings("ignore::bounce.golf.ExtrapolationWarning")
def test_a_run_turns_and_mirrors_with_its_landing():
    landing = SideState.of(DRIVE, 80.0, -200.0)
    one = side_play(NATURAL, landing)
    left = side_play(NATURAL, SideState.of(DRIVE, -80.0, 200.0))
    assert left.rest == pytest.approx(one.rest * [1, -1], rel=1e-12) and left.kick == -one.kick
    other = side_play(NATURAL, turned(landing, 0.7))
    c, s = math.cos(0.7), math.sin(0.7)
    assert other.rest == pytest.approx(np.array([[c, -s], [s, c]]) @ one.rest, rel=1e-8)
    assert one.kick == pytest.approx(bounce.golf.side_rebound(
        NATURAL, DRIVE, 80.0, vertical_spin=-200.0).kick, rel=1e-12)  # fmt: skip


def test_a_ball_that_stays_down_is_a_cue_ball():
    """Coriolis: it slides for 2|h|/(7 mu g) on a parabola and rolls on with 2/7 of the slip taken off."""
    ball, g = bounce.golf.GOLF, 9.80665
    law = bounce.laws.RigidBounce(mu=0.05, restitution=0.0)
    run = side_play(law, SideState([3.0, -1.0, 0.5], [60.0, 5.0, 200.0]), rolling_friction=0.2)
    (first,) = run.bounces
    off = first.lift_off
    v = off.velocity[[0, 2]]
    h = v + ball.radius * np.array([off.spin[2], -off.spin[0]])
    slid = 2 * np.hypot(*h) / (7 * 0.05 * g)
    rolls = v - 2 / 7 * h
    at = v * slid - 0.05 * g * h / np.hypot(*h) * slid**2 / 2
    way = 1.4 * np.hypot(*rolls) / (2 * 0.2 * g)
    slides, rolling = run.glides
    assert slides.time == pytest.approx(slid, rel=1e-9) and off.velocity[1] == 0.0
    assert run.rest == pytest.approx(at + way * rolls, rel=1e-9)
    assert rolling.time == pytest.approx(1.4 * np.hypot(*rolls) / (0.2 * g), rel=1e-9)
    assert "the first kicks" in repr(run)


def test_a_ball_rolls_down_a_side_slope_and_comes_to_rest():
    """Energy: what gravity and the resistance along the way leave is nothing."""
    law = bounce.laws.RigidBounce(mu=0.5, restitution=0.0)
    state = SideState([4.0, -1.0, 0.0], [0.0, 0.0, -4.0 / bounce.golf.GOLF.radius])
    run = side_play(law, state, side_slope=0.05, rolling_friction=0.2)
    (glide,) = run.glides
    t = np.linspace(0.0, glide.time, 20001)
    x = glide.run(t)
    length = float(np.sum(np.hypot(*np.diff(x[:, :2], axis=0).T)))
    g = 9.80665
    begun = 0.7 * float(x[0, 2:] @ x[0, 2:])
    fallen = -math.sin(0.05) * g * run.rest[1]
    assert run.rest[1] < 0 and begun + fallen == pytest.approx(
        0.2 * g * math.cos(0.05) * length, rel=1e-7
    )
    with pytest.raises(bounce.golf.NoRestError, match="a rolling ball stops"):
        side_play(law, state, side_slope=0.3)
    with pytest.raises(bounce.golf.NoRestError, match="friction stops the slip"):
        slippery = bounce.laws.RigidBounce(mu=0.01, restitution=0.0)
        side_play(slippery, SideState([4.0, -1.0, 0.0], [0.0, 0.0, 0.0]), side_slope=0.3)


def test_what_is_no_shot_is_refused():
    with pytest.raises(ns.PointError, match=r"velocity: expected three finite numbers"):
        SideState([1.0, 2.0], [0.0, 0.0, 0.0])
    with pytest.raises(ns.PointError, match=r"spin: expected three finite numbers"):
        SideState([1.0, 2.0, 0.0], [0.0, math.nan, 0.0])
    state = SideState([1.0, -2.0, 0.0], [0.0, 0.0, 0.0])
    with pytest.raises(ns.PointError, match="rises above the ground"):
        side_flight(state)
    with pytest.raises(ns.OptionError, match="side_slope: expected radians"):
        side_flight(SideState([1.0, 2.0, 0.0], [0.0, 0.0, 0.0]), side_slope=2.0)
    with pytest.raises(ns.OptionError, match="min_height: expected a positive number"):
        side_play(NATURAL, state, min_height=0.0)
    with pytest.raises(bounce.golf.NoRestError, match="max_bounces"):
        side_play(bounce.laws.RigidBounce(mu=0.3, restitution=1.0), state, max_bounces=5)
    with pytest.raises(ns.OptionError, match="slope: expected that of the model"):
        side_play(SOFT, state, scaling=SCALING, slope=0.1)
