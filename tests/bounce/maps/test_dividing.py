"""The dividing surface: reference points, both sides by simulation, symmetries, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bounce
import nonsmooth as ns
from nonsmooth.model.cache import Cache

DATA = json.loads((Path(__file__).parents[2] / "data" / "dividing_curve.json").read_text())
POINTS, SLIPPING = DATA["points"], DATA["slip_zero"]
PARAMETERS = {name: float(value) for name, value in DATA["params"].items()}
TURF = bounce.KelvinVoigt(load="net", **PARAMETERS)
NO_GRAVITY = TURF.replace(G=0.0, load="contact")


@pytest.fixture(scope="module")
def curve():
    return bounce.dividing_curve(TURF)


def sides(model, arc, ydot=-1.0, offset=3e-5):
    """Last phases of landings to both sides of an arc's inner points."""
    for a, b in zip(arc.points[1:], arc.points[2:], strict=False):
        if np.linalg.norm(b - a) < 1e-3 * abs(ydot):
            continue
        normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
        starts = [a + s * offset * abs(ydot) * normal for s in (1, -1)]
        shots = [bounce.simulate(model, u[0], ydot, u[1], tol=1e-12) for u in starts]
        yield [shot.itinerary[-1] for shot in shots]


# Reference ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("point", POINTS, ids=lambda p: p["tau_e"][:5] + "+-"[p["slip_sign"] < 0])
def test_landing_that_begins_to_roll_at_a_given_time(curve, point):
    itinerary = "+ s" if point["slip_sign"] > 0 else "- s"
    start = curve.at_entry(float(point["tau_e"]), itinerary)
    assert abs(start.xdot - float(point["Xdot0"])) < 1e-12
    assert abs(start.omega - float(point["Omega0"])) < 1e-12


def test_spin_at_a_given_speed_on_both_parts_and_the_mirrored_half(curve):
    points = POINTS + SLIPPING["points"]
    spins = curve.omega([float(p["Xdot0"]) for p in points])
    assert np.abs(spins - [float(p["Omega0"]) for p in points]).max() < 1e-11
    assert np.abs(spins - [float(p["Omega0_bisection"]) for p in points]).max() < 1e-11


def test_junction_and_lift_off(curve):
    assert abs(curve.junction[0] - float(SLIPPING["Xdot_star"])) < 1e-12
    assert abs(curve.junction[1] - float(SLIPPING["Omega_star"])) < 1e-12
    first, second = curve.arcs
    assert (first.itinerary, second.itinerary, second.end) == ("+ s", "+", "reach")
    assert np.array_equal(curve.two_fold[-1], curve.slipping[0])
    assert abs(first.entry[-1] - float(DATA["liftoff"]["tau_L"])) < 1e-12
    assert np.abs(first.lift_off[:, 2] - float(DATA["liftoff"]["Y_L"])).max() < 1e-12
    assert np.abs(first.lift_off[:, 1] + first.lift_off[:, 4]).max() < 1e-12


@pytest.mark.slow
def test_speeds_within_rounding_of_the_junction_have_its_spin(curve):
    """There an orbit of one arc may be of the other by rounding."""
    for model in (curve.model, NO_GRAVITY):
        found = bounce.dividing_curve(model)
        xdot, omega = found.junction
        near = xdot + np.spacing(xdot) * np.arange(-4, 5)
        np.testing.assert_allclose(found.omega(near), omega, rtol=1e-12)


def test_slope_at_rest_is_five_halves(curve):
    assert curve.omega(1e-6) / 1e-6 == pytest.approx(2.5, abs=1e-4)


@pytest.mark.slow
def test_once_warm_nothing_is_built_again(curve, monkeypatch):
    """What takes long is to build functions; how long the rest takes is in benchmarks/."""

    def get(cache, key, build):
        def refuse():
            raise AssertionError(f"built again: {key}")

        return original(cache, key, refuse)

    original = Cache.get
    monkeypatch.setattr(Cache, "get", get)
    assert np.array_equal(bounce.dividing_curve(TURF).junction, curve.junction)


# By simulation -----------------------------------------------------------------------------------


def test_bisection_by_simulation_finds_the_same_spin(curve):
    for xdot in (0.1, 0.35, 1.0):
        spin = float(curve.omega(xdot))
        low, high = spin - 1e-2, spin + 1e-2
        for _ in range(28):
            middle = 0.5 * (low + high)
            last = bounce.simulate(TURF, xdot, -1.0, middle, tol=1e-13).itinerary[-1]
            low, high = (low, middle) if last == "+" else (middle, high)
        assert abs(low - spin) < 1e-8


@pytest.mark.parametrize(
    "eta", [0.5, 2.0, *(pytest.param(eta, marks=pytest.mark.slow) for eta in (1.0, 1.3))]
)
def test_forward_slip_on_one_side_and_reverse_slip_on_the_other(eta):
    """Also where the curve continues through itineraries such as + - s, + s + and - +."""
    model = TURF.replace(eta=eta)
    curve = bounce.dividing_curve(model, step=0.4, reach=2.0)
    assert curve.complete
    letters = [sorted(pair) for arc in curve.arcs for pair in sides(model, arc)]
    assert len(letters) > 6
    assert all(pair == ["+", "-"] for pair in letters)


def test_eight_open_regions_around_the_curve(curve):
    """S+, S+RS+, S+RS-, S+S- beside the two parts; the mirror images are the other four."""
    spin = float(curve.omega(0.2))
    landings = [(0.2, spin + 0.01), (0.2, spin - 0.01), (1.0, 1.65), (1.0, 1.59)]
    expected = ["+ s +", "+ s -", "+", "+ -"]
    swap = str.maketrans("+-", "-+")
    for (xdot, omega), itinerary in zip(landings, expected, strict=True):
        assert bounce.simulate(TURF, xdot, -1.0, omega).itinerary == itinerary
        assert bounce.simulate(TURF, -xdot, -1.0, -omega).itinerary == itinerary.translate(swap)


class Coupled(bounce.ContactModel):
    """The normal force depends on the tangential motion, so lift-off comes at various times."""

    parameters = dict(mu=0.3, eta=0.5, coupling=0.2)

    def normal_force(self, s, p):
        return -s.y * (1 + p.coupling * s.xdot**2 + p.coupling * s.x) - 0.2 * s.ydot

    def tangential_force(self, s, p):
        return -(p.eta**2) * s.x - 0.2 * p.eta * s.xdot


MODELS = [
    bounce.contact.DepthDampedKelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5),
    bounce.contact.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=0.5, d1=0.1, eta=0.5),
    bounce.KelvinVoigt(mu=0.3, d1=0.0, d2=0.1, eta=0.5),
    bounce.KelvinVoigt(
        mu=0.3,
        d1=0.1,
        d2=0.1,
        eta=0.5,
        friction=bounce.contact.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5),
    ),
    bounce.Hertz(mu=0.3, stiffness=1.0, d1=0.1, eta=0.5, G=0.1, load="net"),
    bounce.contact.KuwabaraKono(mu=0.3, stiffness=1.0, damping=0.3, d1=0.1, eta=0.5),
    bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=0.1, slope=0.05),
    Coupled(),
]


#: Dear ones, of which the rest has one of each kind: a damper, a power law, an own law.
DEAR = (bounce.contact.KuwabaraKono, Coupled, bounce.contact.Maxwell)


@pytest.mark.slow_cases("DepthDampedKelvinVoigt", "KelvinVoigt1", "Hertz", "KelvinVoigt2")
@pytest.mark.parametrize(
    "model",
    [pytest.param(m, marks=pytest.mark.slow) if type(m) in DEAR else m for m in MODELS],
    ids=lambda m: type(m).__name__,
)
def test_other_contact_models_have_it_too(model):
    curve = bounce.dividing_curve(model, step=0.3, reach=1.0)
    assert curve.junction is not None
    letters = [sorted(p) for arc in (*curve.arcs, *curve.reverse) for p in sides(model, arc)]
    assert all(pair == ["+", "-"] for pair in letters)


@pytest.mark.slow
def test_landings_given_by_expressions_lead_to_the_same_curve(curve):
    """The general verb looks for it in a box, with exact derivatives instead of differences."""
    model = NO_GRAVITY  # its contact begins at touch-down
    reference = bounce.dividing_curve(model)
    system = bounce.contact.equations.contact_system(model.blueprint())
    fold = ns.find_two_fold(system, near=reference.arcs[0].lift_off[5], parameters=model.values)
    found = ns.manifold(
        system,
        fold,
        starts=lambda xdot, omega: [0.0, xdot, 0.0, -1.0, omega],
        box=[(0.11, 1.5), (0.17, 2.0)],
        duration=100.0,
        until="lift-off",
        spacing=0.2,
        parameters=model.values,
    )
    assert [arc.itinerary for arc in found.arcs] == ["+ s", "+"]
    assert np.abs(found.junctions[0] - reference.junction).max() < 1e-12
    for arc in found.arcs:
        xdot, omega = arc.points.T
        assert np.abs(reference.omega(xdot) - omega).max() < 1e-11


@pytest.mark.slow
def test_on_a_slope_both_halves_are_traced():
    curve = bounce.dividing_curve(MODELS[-2], reach=1.0)
    assert not curve.mirrored
    assert curve.reverse[0].itinerary == "- s"
    assert np.allclose(curve.reverse[0].points[0], curve.arcs[0].points[0], atol=0.1)


# Symmetries --------------------------------------------------------------------------------------


COARSE = dict(step=0.4, reach=2.6)


@pytest.mark.slow
@settings(max_examples=3, deadline=None)
@given(st.floats(0.1, 8.0), st.floats(0.05, 2.5))
def test_without_gravity_the_surface_is_a_cone(factor, xdot):
    one = bounce.dividing_curve(NO_GRAVITY, -1.0, **COARSE).omega(xdot)
    other = bounce.dividing_curve(NO_GRAVITY, -factor, **COARSE).omega(factor * xdot)
    assert other == pytest.approx(factor * one, rel=1e-10)


@pytest.mark.slow
@settings(max_examples=3, deadline=None)
@given(st.floats(0.1, 8.0), st.floats(0.05, 2.5))
def test_with_gravity_scaling_it_too_is_a_symmetry(factor, xdot):
    model = TURF.replace(G=0.02)
    one = bounce.dividing_curve(model, -1.0, **COARSE).omega(xdot)
    other = bounce.dividing_curve(model.replace(G=0.02 * factor), -factor, **COARSE)
    assert other.omega(factor * xdot) == pytest.approx(factor * one, rel=1e-9)


@pytest.mark.slow
def test_surface_is_curves_at_several_normal_speeds():
    surface = bounce.maps.dividing_surface(NO_GRAVITY, [-2.0, -0.5])
    assert surface.two_fold[0].shape[1] == surface.slipping[1].shape[1] == 3
    rays = surface.junction / surface.ydot[:, None]
    assert np.abs(rays[0] - rays[1]).max() < 1e-11
    assert set(surface.two_fold[1][:, 1]) == {-0.5}


# Critical frequency ratio ------------------------------------------------------------------------


def test_critical_eta_for_slow_shots_without_spin():
    eta = bounce.maps.critical_eta(NO_GRAVITY)
    assert abs(eta - 1.194) < 5e-4
    for factor, last in ((0.998, "-"), (1.002, "+")):
        shot = bounce.simulate(NO_GRAVITY.replace(eta=factor * eta), 1e-4, -1.0, 0.0, tol=1e-13)
        assert shot.itinerary == f"+ s {last}"


def test_critical_eta_in_closed_form_without_damping():
    """X'' = -(5/7) eta^2 X from X = 0 for a time pi: X vanishes there if sqrt(5/7) eta = 1."""
    model = bounce.KelvinVoigt(mu=0.3, d1=0.0, d2=0.0, eta=0.5)
    assert abs(bounce.maps.critical_eta(model) - np.sqrt(7 / 5)) < 1e-10


# Refusals ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (bounce.Hertz(mu=0.3, stiffness=1.0, d1=0.1, eta=0.5), "visible-invisible"),
        (
            bounce.contact.HuntCrossley(mu=0.3, stiffness=1.0, damping=0.2, d1=0.1, eta=0.5),
            "Hertz's law",
        ),
        (bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.0), "force along the ground"),
    ],
    ids=["Hertz", "HuntCrossley", "nothing along the ground"],
)
def test_models_without_such_a_lift_off_are_refused(model, words):
    with pytest.raises(ns.DegenerateError, match=words):
        bounce.dividing_curve(model)


def test_bristles_are_refused():
    law = bounce.contact.Dahl(bristle_stiffness=50.0)
    model = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, friction=law)
    with pytest.raises(ns.DegenerateError, match="Dahl"):
        bounce.dividing_curve(model)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: bounce.dividing_curve(TURF, 1.0), ns.OptionError, "ydot"),
        (lambda: bounce.dividing_curve(TURF, reach=0), ns.OptionError, "reach"),
        (lambda: bounce.dividing_curve("turf"), bounce.ModelError, "model"),
        (lambda: bounce.maps.dividing_surface(TURF, []), ns.OptionError, "ydot"),
        (lambda: bounce.maps.critical_eta(TURF, bounds=(0.1, 0.5)), ns.ConvergenceError, "eta"),
    ],
)
def test_bad_input(call, error, words):
    with pytest.raises(error, match=words):
        call()


def test_speeds_beyond_the_curve_and_wrong_entries(curve):
    with pytest.raises(ns.PointError, match="xdot"):
        curve.omega(50.0)
    with pytest.raises(ns.OptionError, match="itinerary"):
        curve.at_entry(1.0, "s")
    with pytest.raises(ns.PointError, match="time"):
        curve.at_entry(5.0)
