"""Bounces in 3-D agree with 24 digits, in the plane with the planar ones, and come never closer to
one another than friction lets them; they turn and mirror with their landings."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import bounce
import nonsmooth as ns

DATA = Path(__file__).parents[2] / "data"
CASES = [
    case
    for case in json.loads((DATA / "vector_friction.json").read_text(encoding="utf-8"))["cases"]
    if case["kind"] == "ball"
]
TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
SPEED = st.floats(-2, 2)


def rotation(angle):
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def simulated(case, tol):
    values = {name: float(v) for name, v in case["parameters"].items()}
    model = bounce.KelvinVoigt(inertia=values.pop("k"), **values, load=case["load"])
    v, w = ([float(c) for c in case["landing"][name]] for name in "vw")
    return bounce.simulate(model, v, float(case["landing"]["ydot"]), w, tol=tol)


def numbers(shot):
    """Place, velocity, spin, height, normal speed and time at lift-off."""
    end = shot.lift_off
    return np.array([*end.x, *end.xdot, *end.omega, end.y, end.ydot, shot.time])


def expected(case):
    names = "x1 x2 v1 v2 w1 w2 y ydot t".split()
    return np.array([float(case["lift_off"][name]) for name in names])


@pytest.mark.parametrize("case", CASES, ids=lambda c: c["name"])
def test_reference(case):
    shot = simulated(case, 1e-13)
    assert shot.itinerary == " ".join(case["itinerary"])
    assert np.abs(numbers(shot) - expected(case)).max() <= 1e-12
    ends = [float(t) for _, t in case["events"]]
    assert np.abs([p.t_end for p in shot.phases] - np.array(ends)).max() <= 1e-12
    slip = np.array([float(c) for c in case["slip"]])
    assert np.abs(shot.slip - slip).max() <= 1e-12
    # Its direction is known however short it is.
    assert np.abs(shot.slip - slip).max() <= 1e-10 * np.hypot(*slip)
    assert shot.slip_angle == pytest.approx(float(case["slip_angle"]), abs=1e-10)


@pytest.mark.parametrize("tol", [1e-6, 1e-9])
@pytest.mark.parametrize("case", CASES[2:11:4], ids=lambda c: c["name"])
def test_reference_at_coarser_tolerances(case, tol):
    shot = simulated(case, tol)
    assert shot.itinerary == " ".join(case["itinerary"])
    assert np.abs(numbers(shot) - expected(case)).max() <= 100 * tol


@pytest.mark.slow
@pytest.mark.parametrize("tol", [10.0**-k for k in range(6, 14)])
@pytest.mark.parametrize("case", CASES, ids=lambda c: c["name"])
def test_reference_at_every_tolerance(case, tol):
    shot = simulated(case, tol)
    assert np.abs(numbers(shot) - expected(case)).max() <= 100 * tol


@pytest.mark.parametrize("load", ["contact", "net"])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.1])
@pytest.mark.parametrize("landing", [(0.3, 0.1), (2.0, 1.5), (0.5, -0.5)])
def test_landings_on_a_line_are_the_planar_ones(landing, angle, load):
    model, e = TURF.replace(load=load), rotation(angle)[:, 0]
    v, w = landing
    plane = bounce.simulate(model, v, -1.0, w, tol=1e-14)
    space = bounce.simulate(model, v * e, -1.0, w * e, tol=1e-14)
    one, other = plane.lift_off, space.lift_off
    pairs = [
        (one.x * e, other.x),
        (one.xdot * e, other.xdot),
        (one.omega * e, other.omega),
        (plane.slip * e, space.slip),
        (plane.time, space.time),
        (one.y, other.y),
        (one.ydot, other.ydot),
    ]
    for a, b in pairs:
        assert np.abs(a - b).max() <= 1e-15


MODELS = [
    bounce.NormalKelvinVoigt(mu=0.3, d2=0.1),
    bounce.DepthDampedKelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5),
    bounce.Hertz(mu=0.3, stiffness=1.0, d1=0.1, eta=0.5),
    bounce.Hertz(mu=0.3, stiffness=1.0, d1=0.1, eta=0.5, G=1e-3, load="net"),
    bounce.HuntCrossley(mu=0.3, stiffness=1.0, damping=0.3, d1=0.1, eta=0.5),
    bounce.Tsuji(mu=0.3, stiffness=1.0, damping=0.3, d1=0.1, eta=0.5),
    bounce.KuwabaraKono(mu=0.3, stiffness=1.0, damping=0.3, eta=0.5),
    bounce.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=1.0, d1=0.1, eta=0.5),
    bounce.GeneralisedContact(
        mu=0.3,
        eps=0.3,
        upsilon=lambda s, p: -s.y,
        zeta=lambda s, p: 1,
        delta=lambda s, p: 0.1,
        kappa=lambda s, p: 1,
    ),
    TURF.replace(mu=0.0),
    TURF.replace(friction=bounce.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5)),
    TURF.replace(friction=bounce.ExponentialDecay(mu_kinetic=0.2, decay_speed=0.5)),
    TURF.replace(friction=bounce.Viscous(viscosity=0.1)),
    TURF.replace(friction=bounce.Dahl(bristle_stiffness=20.0)),
    TURF.replace(friction=bounce.LuGre(bristle_stiffness=20.0, mu_kinetic=0.2, stribeck_speed=0.5)),
]


@pytest.mark.parametrize(
    "model", MODELS, ids=lambda m: f"{type(m).__name__}-{type(m.friction).__name__}"
)
def test_every_model_has_a_form_in_3d(model):
    """On a line through the ground it is the planar model, to the tolerance."""
    e = rotation(0.7)[:, 0]
    plane = bounce.simulate(model, 0.3, -1.0, 0.1, tol=1e-12)
    space = bounce.simulate(model, 0.3 * e, -1.0, 0.1 * e, tol=1e-12)
    assert space.slip == pytest.approx(plane.slip * e, abs=1e-9)
    assert space.lift_off.xdot == pytest.approx(plane.lift_off.xdot * e, abs=1e-9)
    assert space.time == pytest.approx(plane.time, abs=1e-9)


@pytest.mark.slow
@settings(max_examples=6)
@given(v=st.tuples(SPEED, SPEED), w=st.tuples(SPEED, SPEED))
def test_a_mirrored_landing_gives_mirrored_bits(v, w):
    v, w = np.array(v), np.array(w)
    one = bounce.simulate(TURF, v, -1.0, w, tol=1e-13)
    many = bounce.lift_off(TURF.in_3d(), [v, v * [1, -1]], -1.0, [w, w * [1, -1]], tol=1e-13)
    assert many.itinerary[0] == many.itinerary[1] == one.itinerary
    assert np.array_equal(many.slip[0] * [1, -1], many.slip[1])
    assert np.array_equal(many.time, [one.time, one.time])
    for mirror in ([1, -1], [-1, 1], [-1, -1]):
        other = bounce.simulate(TURF, v * mirror, -1.0, w * mirror, tol=1e-13)
        assert other.itinerary == one.itinerary and other.time == one.time
        for name in ("x", "xdot", "omega", "slip"):
            a, b = (getattr(shot.lift_off, name) for shot in (one, other))
            assert np.array_equal(a * mirror, b)


@pytest.mark.slow
@settings(max_examples=6)
@given(
    angle=st.floats(-3, 3),
    v=st.tuples(SPEED, SPEED),
    w=st.tuples(SPEED, SPEED),
    eta=st.floats(0.01, 5.0),
)
def test_a_turned_landing_lifts_off_turned_to_rounding(angle, v, w, eta):
    """The landing turned is off by eps of its size; the flow lets that grow as its derivatives say."""
    v, w, turn, model = np.array(v), np.array(w), rotation(angle), TURF.replace(eta=eta)
    # On a line, and without slip, a rounding of the landing is another itinerary.
    assume(abs(v[0] * w[1] - v[1] * w[0]) > 1e-6 and np.hypot(*(v + w)) > 1e-6)
    one = bounce.simulate(model, v, -1.0, w, tol=1e-13)
    other = bounce.simulate(model, turn @ v, -1.0, turn @ w, tol=1e-13)
    growth = np.abs(ns.sensitivity(one.trajectory, wrt="x0").dx_dx0).sum(axis=1).max()
    allowed = 16 * np.finfo(float).eps * (1 + growth) * np.abs(one.trajectory.x).max()
    assert one.itinerary == other.itinerary
    for name in ("x", "xdot", "omega", "slip"):
        a, b = (getattr(shot.lift_off, name) for shot in (one, other))
        assert np.abs(turn @ a - b).max() <= allowed
    assert (
        abs(one.time - other.time) <= 0.5 * len(one.trajectory.t) * np.finfo(float).eps * one.time
    )


def test_forces_oppose_the_slip_and_are_inside_the_cone_while_rolling():
    shot = bounce.simulate(TURF, [1.0, 0.0], -1.0, [0.2, 0.5], tol=1e-12)
    assert shot.itinerary == "* s *"
    t = np.linspace(0.0, shot.time, 60)[:-1]
    load, friction = shot.forces(t)
    slip, mode = shot.state(t).slip, shot.mode(t)
    slips = mode == "*"
    along = slip[slips] / np.hypot(*slip[slips].T)[:, None]
    assert friction[slips] == pytest.approx(-0.3 * load[slips, None] * along, abs=1e-12)
    assert np.all(np.hypot(*friction[~slips].T) < 0.3 * load[~slips])
    assert np.abs(slip[~slips]).max() <= 1e-15
    assert np.all(np.array(shot.forces(shot.time).friction) == 0.0)


def test_energy_falls_by_the_power_of_damping_and_friction():
    """Without dampers friction alone takes energy, as much as its force times the slip."""
    from scipy.integrate import quad

    model = bounce.KelvinVoigt(mu=0.3, d1=0.0, d2=0.0, eta=0.5, G=1e-3, slope=0.1)
    shot = bounce.simulate(model.in_3d(side_slope=0.2), [1.0, 0.2], -1.0, [0.2, 0.5], tol=1e-12)
    lost = shot.energy(0.0) - shot.energy(shot.time)

    def power(t):
        return -float(shot.forces(t).friction @ shot.state(t).slip)

    ends = [p.t_end for p in shot.phases[:-1]]
    work, _ = quad(power, 0.0, shot.time, points=ends, epsabs=1e-11, limit=200)
    assert lost == pytest.approx(work, abs=1e-9)


def test_gravity_on_a_side_slope_pulls_to_its_foot():
    """Without friction the ball's tangential motion is that of gravity's part along the ground."""
    model = bounce.NormalKelvinVoigt(mu=0.0, d2=0.1, G=0.3, slope=0.1)
    shot = bounce.simulate(model.in_3d(side_slope=0.2), [0.5, -0.2], -1.0, [0.1, 0.3], tol=1e-12)
    down = 0.3 * np.array([math.sin(0.1), math.cos(0.1) * math.sin(0.2)])
    assert shot.lift_off.xdot == pytest.approx([0.5, -0.2] - down * shot.time, abs=1e-12)
    assert shot.lift_off.omega == pytest.approx([0.1, 0.3], abs=1e-12)
    flat = bounce.NormalKelvinVoigt(mu=0.0, d2=0.1, G=0.3 * math.cos(0.1) * math.cos(0.2))
    assert shot.time == pytest.approx(
        bounce.simulate(flat, 0.5, -1.0, 0.1, tol=1e-12).time, abs=1e-12
    )


def test_friction_in_one_direction_only_is_approached_by_elliptical_friction():
    """Across the grain friction is weaker; along it, and with ratio 1, it is what it was."""
    one = bounce.simulate(TURF, [1.0, 0.3], -1.0, [0.2, 0.1], tol=1e-12)
    same = bounce.simulate(
        TURF.in_3d(friction_ratio=1.0, grain=0.4), [1.0, 0.3], -1.0, [0.2, 0.1], tol=1e-12
    )
    assert numbers(same) == pytest.approx(numbers(one), abs=1e-10)
    e = rotation(0.4)[:, 0]
    grain = TURF.in_3d(friction_ratio=0.5, grain=0.4)
    along = bounce.simulate(grain, 0.3 * e, -1.0, 0.1 * e, tol=1e-12)
    assert along.slip == pytest.approx(
        bounce.simulate(TURF, 0.3, -1.0, 0.1, tol=1e-12).slip * e, abs=1e-10
    )
    a = rotation(0.4)[:, 1]
    across = bounce.simulate(grain, 0.3 * a, -1.0, 0.1 * a, tol=1e-12)
    half = bounce.simulate(TURF.replace(mu=0.15), 0.3, -1.0, 0.1, tol=1e-12)
    assert across.slip == pytest.approx(half.slip * a, abs=1e-10)


def test_drilling_takes_the_roll_from_a_ball_that_spins_about_the_vertical():
    """Published with the theory: slip at lift-off rises from 0.087 to 0.244, and nothing rolls."""
    deep = TURF.in_3d(drilling_radius=0.1)
    shot = bounce.simulate(deep, [1.0, 0.0], -1.0, [0.2, 0.5, 2.0])
    assert shot.itinerary == "*"
    assert shot.slip_speed == pytest.approx(0.244, abs=5e-4)
    plain = bounce.simulate(TURF, [1.0, 0.0], -1.0, [0.2, 0.5])
    assert plain.slip_speed == pytest.approx(0.087, abs=5e-4)
    assert shot.lift_off.omega.shape == (3,) and 0 < shot.lift_off.omega[2] < 2.0
    still = bounce.simulate(deep, [1.0, 0.0], -1.0, [0.2, 0.5], tol=1e-12)
    assert still.slip == pytest.approx(
        bounce.simulate(TURF, [1.0, 0.0], -1.0, [0.2, 0.5], tol=1e-12).slip, abs=1e-10
    )


@pytest.mark.parametrize(
    "landing, message",
    [
        (([1.0, 0.0], -1.0, 0.1), "xdot: expected one number, received .* beside omega"),
        ((1.0, -1.0, [0.1, 0.2]), "omega: expected one number, received .* beside xdot"),
        (([1.0], -1.0, [0.1, 0.2]), "xdot: expected 2 numbers"),
        (([1.0, 0.0], -1.0, [0.1, 0.2, 0.3]), "omega: expected 2 numbers.*drilling_radius"),
        (([1.0, 0.0], -1.0, [[0.1, 0.2]]), "omega: expected 2 numbers"),
        (([1.0, math.nan], -1.0, [0.1, 0.2]), r"xdot\[1\]: expected a finite number"),
        (([1.0, 0.0], 0.0, [0.1, 0.2]), "ydot: expected a negative number"),
        (([1.0, 0.0], [-1.0], [0.1, 0.2]), "ydot: expected one number"),
        (([1.0, 0.0], -1.0, [0.1, 0.2], 0.5), "x: expected two numbers"),
    ],
)
def test_what_is_no_landing(landing, message):
    with pytest.raises(bounce.LandingError, match=message):
        bounce.simulate(TURF, *landing)


def test_refusals_of_contacts():
    with pytest.raises(bounce.LandingError, match="xdot, omega: expected pairs"):
        bounce.simulate(TURF.in_3d(), 1.0, -1.0, 0.1)
    with pytest.raises(ns.ParameterError, match="grain: expected with friction_ratio"):
        TURF.in_3d(grain=0.3)
    with pytest.raises(ns.ParameterError, match="friction_ratio: expected a number in"):
        TURF.in_3d(friction_ratio=1.5)
    with pytest.raises(bounce.ModelError, match="model: expected a ContactModel"):
        bounce.simulate(bounce.laws.RigidBounce(mu=0.3, restitution=0.5), [1, 0], -1, [0, 0])

    class Cubic(bounce.ContactModel):
        parameters = dict(mu=0.3)

        def normal_force(self, s, p):
            return -s.y

        def tangential_force(self, s, p):
            return -(s.x**3)

    assert bounce.simulate(Cubic(), 1.0, -1.0, 0.1).time > 0
    with pytest.raises(bounce.ModelError, match=r"tangential_force.*favours a direction"):
        bounce.simulate(Cubic(), [1.0, 0.0], -1.0, [0.1, 0.0])


def test_contacts_are_values():
    one = TURF.in_3d(side_slope=0.1, friction_ratio=0.5, grain=0.2, drilling_radius=0.1)
    assert one == one.replace() and hash(one) == hash(one.replace())
    assert one != one.replace(mu=0.4) and one.replace(mu=0.4).values["mu"] == 0.4
    assert one.replace(drilling_radius=0.2).values["drilling_radius"] == 0.2
    assert TURF.in_3d().blueprint() == TURF.replace(mu=0.5).in_3d().blueprint()
    assert "side_slope=0.1" in repr(one) and "grain=0.2" in repr(one)
