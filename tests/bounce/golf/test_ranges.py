"""A law says where it was fitted; a shot that leaves that range is computed with a warning."""

import math
import pickle
import warnings

import numpy as np
import pytest

import bounce

TURFS = bounce.laws.TURFS
DRIVE = bounce.Landing.polar(28.5, math.radians(37.3), 2094)


def landing(speed, angle, rpm):
    return bounce.Landing.polar(speed, math.radians(angle), rpm)


@pytest.mark.parametrize("name", TURFS)
def test_every_turf_has_its_range(name):
    law = TURFS[name].law
    assert law.covers.source
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bounce.golf.rebound(law, DRIVE)


@pytest.mark.parametrize(
    ("name", "hit", "words"),
    [
        ("natural", landing(28, 90, 0), "along.* 0 m/s .*0.0171 to 36.8"),
        ("natural", landing(60, 30, 2000), "along.* 52 m/s"),
        ("natural", landing(50, 60, 2000), "into.* 43.3 m/s .*2.14 to 33"),
        ("natural", landing(20, 5, 2000), "into.* 1.74 m/s"),
        ("artificial", landing(20, 40, 12000), "spin.* 12000 rpm .*-4550 to 10400"),
        ("artificial", landing(20, 40, -5000), "spin.* -5000 rpm"),
        ("penner", landing(40, 30, 2000), "along.* 34.6 m/s"),
        ("natural", landing(28, 80, 3000), "71.6 deg"),
        ("artificial-rigid", landing(28, 85, 12000), "spin"),
    ],
)
def test_a_landing_outside_is_warned_of(name, hit, words):
    with pytest.warns(bounce.golf.ExtrapolationWarning, match=words) as caught:
        bounce.golf.rebound(TURFS[name].law, hit)
    assert caught[0].filename == __file__
    with pytest.warns(bounce.golf.ExtrapolationWarning, match=words) as caught:
        run = bounce.golf.play(TURFS[name].law, hit)
    assert caught[0].filename == __file__
    assert run.cautions and run.extrapolated >= 1


def test_mirrored_landings_are_the_same():
    covers = TURFS["natural"].law.covers
    assert covers.holds(20.0, -10.0, 300.0) and covers.holds(-20.0, -10.0, -300.0)
    assert not covers.holds(20.0, -10.0, -700.0) and not covers.holds(-20.0, -10.0, 700.0)
    speeds = np.array([10.0, 50.0])
    assert covers.holds(speeds, -10.0, 0.0).tolist() == [True, False]


def test_hops_below_the_range_are_counted_not_shouted():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = bounce.golf.play(TURFS["natural"].law, DRIVE)
    hits = [b.rebound.landing for b in run.bounces]
    slow = [hit for hit in hits if -hit.ydot < 2.14]
    spun = [hit for hit in hits if not -3880 <= hit.backspin_rpm <= 10900 and -hit.ydot >= 2.14]
    assert run.extrapolated == len(slow) + len(spun) and len(slow) > 5
    assert run.cautions == ()


def test_a_ball_that_rolls_like_no_putt():
    with pytest.warns(bounce.golf.ExtrapolationWarning, match=r"rolling_friction: .*14\.\d m/s"):
        run = bounce.golf.play(TURFS["natural-rigid"].law, landing(28, 38, 2500))
    assert run.rolled > 100.0 and len(run.cautions) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bounce.golf.play(TURFS["natural-rigid"].law, landing(28, 38, 2500), rolling_friction=0.4)


def test_a_law_of_ones_own_has_no_range():
    law = bounce.laws.TiltedBounce(mu=0.5, restitution=0.3, tilt=0.2)
    assert law.covers is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = bounce.golf.play(law, landing(60, 40, 12000))
    assert run.extrapolated == 0
    with pytest.warns(bounce.golf.ExtrapolationWarning, match="TiltedBounce"):
        bounce.golf.rebound(law, landing(20, 85, 0))


def test_a_range_stays_with_its_law_and_is_no_part_of_its_value():
    law = TURFS["natural"].law
    assert law.replace(mu=0.5).covers == law.covers
    assert law.covering(None) == law and hash(law.covering(None)) == hash(law)
    assert "covers" not in repr(law)
    assert pickle.loads(pickle.dumps(law)).covers == law.covers


def test_a_fitted_law_covers_its_data():
    law = bounce.laws.TiltedBounce(mu=0.25, restitution=0.4, tilt=0.2)
    rng = np.random.default_rng(0)
    u, v, w = rng.uniform(5, 25, 30), rng.uniform(5, 20, 30), rng.uniform(-100, 300, 30)
    off = law.lift_off(u, -v, w * bounce.golf.GOLF.radius)
    data = {
        "xdot [m/s]": u, "ydot [m/s]": -v, "omega [rad/s]": w,
        "lift_off_xdot [m/s]": off.xdot, "lift_off_ydot [m/s]": off.ydot,
    }  # fmt: skip
    found = bounce.golf.fit(law, data, parameters=["restitution"], starts=0).model
    assert found.covers.xdot == pytest.approx((u.min(), u.max()))
    assert found.covers.ydot == pytest.approx((v.min(), v.max()))
    assert found.covers.spin == pytest.approx((w.min(), w.max()))
    plain = {k.partition(" ")[0]: v for k, v in data.items()}
    assert bounce.golf.fit(law, plain, parameters=["restitution"], starts=0).model.covers is None
