"""The laws in use reduce to the rigid one, give what was published, and never create energy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bounce
import nonsmooth as ns

LANDINGS = dict(xdot=st.floats(-30, 30), ydot=st.floats(-30, -0.1), omega=st.floats(-30, 30))
DRIVE = bounce.Landing.polar(28.5, math.radians(37.3), 2094)
LAWS = [fit.law for fit in bounce.TURFS.values()] + [
    bounce.CrossBounce(mu=0.6, restitution=0.7, tangential_restitution=0.3)
]


def energy(xdot, ydot, omega, inertia=2 / 5):
    return 0.5 * (xdot**2 + ydot**2 + inertia * omega**2)


@given(**LANDINGS)
def test_no_tilt_and_no_tangential_restitution_are_the_rigid_law(xdot, ydot, omega):
    rigid = bounce.RigidBounce(mu=0.4, restitution=0.6).lift_off(xdot, ydot, omega)
    tilted = bounce.TiltedBounce(mu=0.4, restitution=0.6, tilt=0.0).lift_off(xdot, ydot, omega)
    cross = bounce.CrossBounce(mu=0.4, restitution=0.6, tangential_restitution=0.0)
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


@given(**LANDINGS)
def test_cross_reverses_the_slip_or_exhausts_friction(xdot, ydot, omega):
    law = bounce.CrossBounce(mu=0.3, restitution=0.5, tangential_restitution=0.4)
    after, before = law.lift_off(xdot, ydot, omega), xdot + omega
    cone = 0.3 * after.normal_impulse
    assert abs(after.tangential_impulse) <= cone * (1 + 1e-14)
    assert after.slip == pytest.approx(after.xdot + after.omega, abs=1e-12 * 60)
    if str(after.case).startswith("grip"):
        assert after.slip == pytest.approx(-0.4 * before, abs=1e-12)
    else:
        assert abs(after.tangential_impulse) == pytest.approx(cone)


def test_penner_formulas():
    assert bounce.penner_restitution([0.0, 20.0, 20.1, 50.0]).tolist() == pytest.approx(
        [0.510, 0.1212, 0.120, 0.120]
    )
    angle = float(bounce.penner_tilt(18.6, math.radians(90 - 44.4)))
    assert math.degrees(angle) == pytest.approx(15.4, rel=1e-14)
    assert float(bounce.penner_tilt(18.6, math.pi / 2)) == 0.0


@pytest.mark.parametrize(
    ("speed", "from_vertical", "spin", "printed", "exact"),
    [(26.2, 46.2, 315.0, 1.17, 1.1756), (26.8, 68.0, 224.0, 2.82, 2.8170)],
)
def test_penner_worked_heights(speed, from_vertical, spin, printed, exact):
    """Penner 2002, p. 936: the heights of the first bounce of his two drives, to his rounding."""
    angle = math.radians(90 - from_vertical)
    landing = bounce.Landing(speed * math.cos(angle), -speed * math.sin(angle), spin)
    after = bounce.rebound(bounce.PennerBounce(), landing)
    height = after.lift_off.ydot**2 / (2 * 9.80665)
    assert after.itinerary == "III+"
    assert height == pytest.approx(printed, abs=6e-3)
    assert height == pytest.approx(exact, abs=1e-4)


def test_tilted_plane_by_hand():
    """Frictionless: the normal speed of the tilted plane is reversed, the other kept."""
    tilt = math.radians(20)
    law = bounce.TiltedBounce(mu=1e-300, restitution=0.5, tilt=tilt)
    shot = law.lift_off(3.0, -4.0, 1.0)
    normal, along = (
        np.array([-math.sin(tilt), math.cos(tilt)]),
        np.array([math.cos(tilt), math.sin(tilt)]),
    )
    v = np.array([3.0, -4.0])
    expected = along * (v @ along) - 0.5 * normal * (v @ normal)
    assert [float(shot.xdot), float(shot.ydot)] == pytest.approx(expected.tolist(), rel=1e-14)


def test_arrays_broadcast():
    law = bounce.TURFS["natural"].law
    many = law.lift_off(np.linspace(-5, 5, 7)[:, None], -3.0, np.linspace(-2, 2, 4))
    assert many.xdot.shape == many.ydot.shape == many.case.shape == (7, 4)
    one = law.lift_off(5.0, -3.0, 2.0)
    assert float(one.ydot) == pytest.approx(float(many.ydot[-1, -1]), rel=1e-14)


def test_published_values():
    values = {
        name: (fit.law.values["mu"], fit.law.restitution, getattr(fit.law, "tilt", None))
        for name, fit in bounce.TURFS.items()
    }
    assert values["natural"] == (0.998, 0.147, math.radians(18.4))
    assert values["artificial"] == (0.852, 0.420, math.radians(12.9))
    assert values["natural-rigid"] == (0.998, 0.260, None)
    assert values["artificial-rigid"] == (0.997, 0.544, None)
    assert all(fit.source and fit.checked for fit in bounce.TURFS.values())


def test_rebound_of_a_contact_model_scales():
    """Without gravity the linear model has no speed in it: any scaling gives the same rebound."""
    turf = bounce.KelvinVoigt(mu=0.4, d1=0.1, d2=0.3, eta=0.5)
    ends = []
    for stiffness in (1e4, 1e6):
        scaling = bounce.Scaling.from_stiffness(bounce.GOLF, stiffness)
        hit = bounce.rebound(turf, DRIVE, scaling=scaling, tol=1e-12)
        ends.append([hit.lift_off.xdot, hit.lift_off.ydot, hit.lift_off.omega * bounce.GOLF.radius])
        assert hit.y <= 0.0 and hit.time == pytest.approx(2.5 * scaling.time, rel=0.3)
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)


def test_laws_are_values():
    law = bounce.TURFS["natural"].law
    assert law.replace(mu=0.5).tilt == law.tilt and law.replace(tilt=0.1).restitution == 0.147
    assert law == bounce.TiltedBounce(mu=0.998, restitution=0.147, tilt=math.radians(18.4))
    assert law != law.replace(tilt=0.1)
    assert repr(bounce.PennerBounce(mu=0.3)) == "PennerBounce(mu=0.3)"
    assert bounce.PennerBounce().replace(mu=0.3).values["mu"] == 0.3


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (
            lambda: bounce.TiltedBounce(mu=0.4, restitution=0.5, tilt=18.4),
            ns.ParameterError,
            "tilt: .*math.radians",
        ),
        (
            lambda: bounce.TiltedBounce(mu=0.4, restitution=1.5, tilt=0.1),
            ns.ParameterError,
            "restitution",
        ),
        (
            lambda: bounce.CrossBounce(mu=0.4, restitution=0.5, tangential_restitution=1.2),
            ns.ParameterError,
            "tangential_restitution: .*in \\[0, 1\\]",
        ),
        (lambda: bounce.PennerBounce(mu=0.0), ns.ParameterError, "mu: .*> 0"),
        (
            lambda: bounce.TURFS["natural"].law.lift_off(1.0, 1.0, 0.0),
            bounce.LandingError,
            "does not approach",
        ),
        (
            lambda: bounce.PennerBounce().lift_off(200.0, -200.0, 0.0),
            ns.ParameterError,
            "tilt: .*extrapolates",
        ),
        (lambda: bounce.rebound("turf", DRIVE), bounce.ModelError, "model: .*TURFS"),
        (
            lambda: bounce.rebound(bounce.KelvinVoigt(mu=0.4, d1=0.1, d2=0.3, eta=0.5), DRIVE),
            bounce.ModelError,
            "scaling: .*from_stiffness",
        ),
        (
            lambda: bounce.rebound(bounce.TURFS["natural"].law, DRIVE, bounce.TENNIS),
            bounce.ModelError,
            "inertia: .*replace",
        ),
    ],
)
def test_messages(make, error, message):
    with pytest.raises(error, match=message):
        make()
