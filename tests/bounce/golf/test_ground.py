"""A rebound is the same in any scale, and a ground that does not fit the ball is refused."""

import math

import pytest

import bounce

DRIVE = bounce.Landing.polar(28.5, math.radians(37.3), 2094)


def test_rebound_of_a_contact_model_scales():
    """Without gravity the linear model has no speed in it: any scaling gives the same rebound."""
    turf = bounce.KelvinVoigt(mu=0.4, d1=0.1, d2=0.3, eta=0.5)
    ends = []
    for stiffness in (1e4, 1e6):
        scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, stiffness)
        hit = bounce.golf.rebound(turf, DRIVE, scaling=scaling, tol=1e-12)
        ends.append(
            [hit.lift_off.xdot, hit.lift_off.ydot, hit.lift_off.omega * bounce.golf.GOLF.radius]
        )
        assert hit.y <= 0.0 and hit.time == pytest.approx(2.5 * scaling.time, rel=0.3)
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: bounce.golf.rebound("turf", DRIVE), bounce.ModelError, "model"),
        (
            lambda: bounce.golf.rebound(bounce.KelvinVoigt(mu=0.4, d1=0.1, d2=0.3, eta=0.5), DRIVE),
            bounce.ModelError,
            "scaling",
        ),
        (
            lambda: bounce.golf.rebound(
                bounce.laws.TURFS["natural"].law, DRIVE, bounce.BALLS["tennis"]
            ),
            bounce.ModelError,
            "inertia",
        ),
    ],
)
def test_messages(make, error, message):
    with pytest.raises(error, match=message):
        make()
