"""SI units go to the dimensionless models and back, the same in both consistent scalings."""

import math

import numpy as np
import pytest

import bounce
import nonsmooth as ns

LANDING = bounce.Landing.polar(speed=28.5, angle=math.radians(37.3), backspin_rpm=2094)


def test_polar():
    assert LANDING.speed == pytest.approx(28.5)
    assert math.degrees(LANDING.angle) == pytest.approx(37.3)
    assert LANDING.backspin_rpm == pytest.approx(2094)
    assert LANDING.ydot < 0 < LANDING.xdot


@pytest.mark.parametrize("convention", ["length", "speed"])
def test_round_trip(convention):
    units = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 2e4, convention)
    back = units.landing(units.state(LANDING))
    for name in ("xdot", "ydot", "omega"):
        assert getattr(back, name) == pytest.approx(getattr(LANDING, name), rel=1e-14)
    # The slip of the contact point is a speed in both: xdot + omega R.
    slip = LANDING.xdot + LANDING.omega * bounce.golf.GOLF.radius
    assert units.state(LANDING).slip * units.speed == pytest.approx(slip)


def test_both_scalings_give_one_bounce():
    """The linear model is homogeneous, so the two scalings differ by one factor throughout."""
    results = []
    for convention in ("length", "speed"):
        units = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 2e4, convention)
        start = units.state(LANDING)
        turf = bounce.KelvinVoigt(mu=0.4, d1=0.1, d2=0.2, eta=0.5, G=units.gravity)
        shot = bounce.simulate(turf, start.xdot, start.ydot, start.omega, tol=1e-13)
        end = units.landing(shot.lift_off)
        results.append([end.xdot, end.ydot, end.omega, shot.lift_off.y * units.length])
    assert np.allclose(*results, rtol=1e-10)


def test_against_newton_in_si():
    """The scaled equations are m y'' = -k y - m g: the depth at rest is m g / k."""
    units = bounce.Scaling.from_stiffness(bounce.BALLS["tennis"], 3e4)
    depth = bounce.BALLS["tennis"].mass * 9.80665 / 3e4
    assert units.gravity * units.length == pytest.approx(depth)
    assert units.force / units.length == pytest.approx(3e4)


def test_table_of_the_paper_is_in_radii_per_second():
    """1.53 m/s is 71.7 radii per second (the paper prints 71.1), with a golf ball's radius."""
    units = bounce.Scaling(bounce.golf.GOLF, time=1e-3, convention="speed")
    assert units.state(bounce.Landing(1.53, -4.61, 0.0)).xdot == pytest.approx(71.7, abs=0.05)
    assert units.state(bounce.Landing(1.53, -4.61, 0.0)).ydot == pytest.approx(-216, abs=0.5)


def test_balls_have_sources():
    assert set(bounce.BALLS) == {"golf", "tennis", "basketball"}
    assert all(ball.source and ball.mass > 0 for ball in bounce.BALLS.values())


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bounce.Ball(-1.0, 0.02), "mass"),
        (lambda: bounce.Ball(0.05, math.nan), "radius"),
        (lambda: bounce.Ball(0.05, 0.02, 1.2), "inertia"),
        (lambda: bounce.Landing(1.0, math.inf, 0.0), "ydot"),
        (lambda: bounce.Landing.polar(-1.0, 0.5, 0.0), "speed"),
        (lambda: bounce.Landing.polar(28.5, 37.3, 0.0), "angle"),
        (lambda: bounce.Scaling(bounce.golf.GOLF, 0.0), "time"),
        (lambda: bounce.Scaling(bounce.golf.GOLF, 1e-3, "both"), "convention"),
        (lambda: bounce.Scaling.from_stiffness(bounce.golf.GOLF, -1.0), "stiffness"),
    ],
)
def test_messages(call, message):
    with pytest.raises(ns.NonsmoothError, match=message):
        call()
