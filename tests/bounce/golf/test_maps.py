"""A map of landings in SI units holds what single rebounds give, on laws and contact models."""

import math

import numpy as np
import pytest

import bounce
import nonsmooth as ns

R = bounce.golf.GOLF.radius
pytestmark = pytest.mark.filterwarnings("ignore::bounce.golf.ExtrapolationWarning")
SCALING = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 2e4)
TURF = bounce.KelvinVoigt(mu=0.4, d1=0.1, d2=0.3, eta=0.5, G=SCALING.gravity)
OVER = dict(speed=np.linspace(10, 30, 6), angle=np.radians([15, 25, 40, 60, 80]))


@pytest.mark.parametrize("model", [*(f.law for f in bounce.laws.TURFS.values()), TURF], ids=repr)
def test_it_holds_what_rebounds_give(model):
    m = bounce.golf.landing_map(model, OVER, dict(spin=200.0), scaling=SCALING)
    assert m.slip.shape == m.code.shape == (5, 6)
    for row, column in ((0, 0), (2, 3), (3, 5)):
        landing = bounce.Landing.polar(
            OVER["speed"][column], OVER["angle"][row], 200.0 * 30 / math.pi
        )
        hit = bounce.golf.rebound(model, landing, scaling=SCALING)
        off = hit.lift_off
        assert m.lift_offs.xdot[row, column] == pytest.approx(off.xdot, abs=1e-8)
        assert m.lift_offs.ydot[row, column] == pytest.approx(off.ydot, abs=1e-8)
        assert m.lift_offs.omega[row, column] == pytest.approx(off.omega * R, abs=1e-8)
        assert m.slip[row, column] == pytest.approx(off.xdot + off.omega * R, abs=1e-8)
        assert m.lift_offs.time[row, column] == pytest.approx(hit.time, abs=1e-10)
        assert m.lift_offs.itinerary[row, column] == hit.itinerary
        assert m.spin_reversal[row, column] == (off.omega < 0)
    assert math.isclose(sum(m.share().values()), 1.0)


@pytest.mark.filterwarnings("error")
def test_landings_outside_the_fit_are_warned_of():
    law, speeds = bounce.laws.TURFS["natural"].law, [20.0, 30.0]
    with pytest.warns(bounce.golf.ExtrapolationWarning, match="2 of 4") as caught:
        bounce.golf.landing_map(law, dict(speed=speeds, angle=[0.05, 0.5]), dict(spin=200.0))
    assert caught[0].filename == __file__
    bounce.golf.landing_map(law, dict(speed=speeds, angle=[0.4, 0.5]), dict(spin=200.0))


def test_over_spin_and_a_parameter():
    over = dict(mu=[0.2, 0.4], spin=[-100.0, 0.0, 300.0])
    m = bounce.golf.landing_map(TURF, over, dict(speed=20.0, angle=0.7), scaling=SCALING)
    landing = bounce.Landing(20 * math.cos(0.7), -20 * math.sin(0.7), 300.0)
    off = bounce.golf.rebound(TURF.replace(mu=0.2), landing, scaling=SCALING).lift_off
    assert m.lift_offs.xdot[2, 0] == pytest.approx(off.xdot, abs=1e-8)
    assert m.spin[:, 0].tolist() == [-100.0, 0.0, 300.0]


def test_where_a_law_keeps_the_ball_down():
    law = bounce.laws.TiltedBounce(mu=0.4, restitution=0.0, tilt=math.radians(20))
    over = dict(speed=[20.0, 30.0], angle=np.radians([50.0, 60.0]))
    m = bounce.golf.landing_map(law, over, dict(spin=900.0))
    down = law.lift_off(30 * math.cos(math.radians(60)), -30 * math.sin(math.radians(60)), 900 * R)
    assert down.ydot < 0
    assert m.code[1, 1] == -1 and np.isnan(m.slip[1, 1])
    assert m.lift_offs.status[1, 1] == bounce.BounceStatus.NO_LIFT_OFF


@pytest.mark.parametrize("quantity", ["itinerary", "slip", "omega", "lift_off_angle"])
def test_pictures_speak_of_degrees_and_rpm(quantity):
    m = bounce.golf.landing_map(bounce.laws.TURFS["natural"].law, OVER, dict(spin=200.0))
    axes = bounce.plot.outcome_map(m, quantity).axes[0]
    assert axes.get_xlabel() == "landing speed (m/s)"
    assert axes.get_ylabel() == "angle of descent (deg)"
    assert axes.get_ylim() == pytest.approx((15, 80))
    assert "spin = 1910 rpm" in axes.get_title(loc="left")


@pytest.mark.parametrize(
    ("model", "over", "fixed", "options", "error", "message"),
    [
        (TURF, OVER, dict(spin=0.0), {}, bounce.ModelError, "scaling"),
        ("turf", OVER, dict(spin=0.0), {}, bounce.ModelError, "model"),
        (TURF, OVER, {}, dict(scaling=SCALING), ns.OptionError, "spin"),
        (TURF, dict(speed=[1.0]), {}, dict(scaling=SCALING), ns.OptionError, "over"),
        (
            bounce.laws.TURFS["natural"].law,
            dict(OVER, angle=[1.0, 2.0]),
            dict(spin=0.0),
            {},
            ns.OptionError,
            "angle",
        ),
        (
            bounce.laws.TURFS["natural"].law,
            dict(mu=[0.1], speed=[1.0]),
            dict(spin=0.0, angle=1.0),
            {},
            ns.OptionError,
            "mu",
        ),
    ],
)
def test_messages(model, over, fixed, options, error, message):
    with pytest.raises(error, match=message):
        bounce.golf.landing_map(model, over, fixed, **options)
