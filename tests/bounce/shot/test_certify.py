"""Bounces are proven to lift off as they do: closed forms, the mirror symmetry, refusals."""

import json
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import bounce
import nonsmooth as ns
from tests.proofs.checking import run
from tests.proofs.systems import holds

TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)


def test_the_time_of_lift_off_is_that_of_the_closed_form():
    """Without gravity Y'' = -2 d Y' - Y ends at t = (pi - atan2(w, d) ... )/w, by its zero load."""
    proof = bounce.certify(TURF, xdot="0.1", ydot=-1, omega=1)
    with mpmath.workdps(40):
        d = mpmath.mpf(0.1)
        w = mpmath.sqrt(1 - d * d)
        y = lambda t: -mpmath.exp(-d * t) * mpmath.sin(w * t) / w
        load = lambda t: -2 * d * mpmath.diff(y, t) - y(t)
        exact = mpmath.findroot(load, 2.95)
        assert holds(proof.time, exact) and proof.time.radius < 1e-16
        assert holds(proof.orbit.end["ydot"], mpmath.diff(y, exact))
    assert proof.proven and proof.outcome == "forward" and proof.itinerary == "+ s +"
    assert "lifts off with forward slip" in str(proof)


def compare(model, seed, count):
    """Random landings: all proven, with the itinerary and the slip of the simulation."""
    rng = np.random.default_rng(seed)
    for xdot, omega in rng.uniform([-1, -2], [1, 2], size=(count, 2)):
        proof = bounce.certify(model, xdot, -1.0, omega)
        shot = bounce.simulate(model, xdot, -1.0, omega, tol=1e-12)
        assert proof.proven, proof
        assert proof.itinerary == shot.itinerary
        assert proof.outcome == ("forward" if shot.slip > 0 else "reverse")
        assert proof.time.middle == pytest.approx(shot.time, abs=1e-9)
        for name in ("xdot", "ydot", "omega"):
            assert proof.orbit.end[name].middle == pytest.approx(
                getattr(shot.lift_off, name), abs=1e-8
            )


def test_random_linear_bounces():
    compare(TURF.replace(G=1e-4), seed=1, count=8)


@pytest.mark.slow
def test_five_hundred_random_bounces():
    compare(TURF, seed=3, count=250)
    soft = bounce.contact.DepthDampedKelvinVoigt(mu=0.3, d1=0.4, d2=0.1, eta=0.5)
    compare(soft, seed=4, count=250)


def test_boxes_and_parameters_hold_their_points():
    box = bounce.certify(TURF, xdot=(0.1, 0.11), ydot=-1, omega=(1.0, 1.02))
    assert box.proven and box.outcome == "forward"
    point = bounce.certify(TURF, xdot=0.105, ydot=-1, omega=1.01)
    for name, value in point.orbit.end.items():
        assert all(v in box.orbit.end[name] for v in value.ends)
    many = bounce.certify(TURF, "0.1", -1, 1, parameters={"mu": (0.295, 0.305)})
    assert many.proven and many.outcome == "forward"
    for mu in (0.295, 0.305):
        one = bounce.certify(TURF.replace(mu=mu), "0.1", -1, 1)
        assert all(v in many.time for v in one.time.ends)


def test_the_mirror_image_is_proven_too():
    one = bounce.certify(TURF, 0.3, -1, 0.4)
    other = bounce.certify(TURF, -0.3, -1, -0.4)
    swap = str.maketrans("+-", "-+")
    assert one.itinerary == other.itinerary.translate(swap)
    assert abs(one.time.middle - other.time.middle) < 1e-15


def test_what_cannot_be_proven_says_why():
    late = bounce.certify(TURF.replace(G=0.3, d2=0.01, load="net"), 1, -1, 0.2)
    assert not late.proven and "negative at first" in late.why
    hertz = bounce.certify(bounce.Hertz(mu=0.3, stiffness=1.0), 1, -1, 0.2)
    assert not hertz.proven and hertz.why
    wide = bounce.certify(TURF, (-2, 2), -1, (-2, 2))
    assert not wide.proven and wide.outcome == "undecided" and "Not proven" in str(wide)


def test_what_is_given_wrongly_is_refused():
    with pytest.raises(ns.ParameterError, match="mu"):
        bounce.certify(TURF, 1, -1, 0, parameters={"mu": (-0.1, 0.3)})
    with pytest.raises(ns.ParameterError, match="'nu'"):
        bounce.certify(TURF, 1, -1, 0, parameters={"nu": 1})
    with pytest.raises(bounce.LandingError, match="ydot"):
        bounce.certify(TURF, 1, (-1, 1), 0)
    with pytest.raises(bounce.ModelError, match="ContactModel"):
        bounce.certify(3, 1, -1, 0)


@pytest.mark.slow_cases("True-None", "True-earlier")
@pytest.mark.parametrize("change", [None, "earlier", "other"])
@pytest.mark.parametrize("box", [False, True])
def test_the_checker_follows_a_bounce_again(change, box, tmp_path):
    """Slip, rolling, reverse slip and lift-off, with intervals of whole numbers and no code in common."""
    model = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    landing = ((0.3, 0.301), -1.0, (0.1, 0.101)) if box else (0.3, -1.0, 0.1)
    proof = bounce.certify(model, *landing)
    assert proof.itinerary == "+ s -"
    path = tmp_path / "bounce.json"
    proof.orbit.save(path)
    record = json.loads(path.read_text())["orbit"]
    if change == "earlier":
        record["events"][0]["t"] = [
            str(Fraction(v) - Fraction(1, 1000 if box else 10**15))
            for v in record["events"][0]["t"]
        ]
    elif change == "other":
        record["events"][0]["after"] = "-"
    path.write_text(json.dumps({"orbit": record}))
    code, output = run(path)
    assert code == (1 if change else 0)
    assert ("3 events as claimed" in output) == (change is None)


@pytest.mark.slow
def test_the_checker_follows_random_boxes_of_bounces_again(tmp_path):
    rng = np.random.default_rng(1)
    soft = bounce.contact.DepthDampedKelvinVoigt(mu=0.3, d1=0.4, d2=0.1, eta=0.5)
    for k in range(20):
        wide = 10.0 ** rng.uniform(-6, -2)
        xdot, omega = rng.uniform([-1, -2], [1, 2])
        model = soft if k % 2 else TURF.replace(G=1e-4)
        proof = bounce.certify(model, (xdot, xdot + wide), -1, (omega, omega + wide))
        if proof.proven:
            proof.orbit.save(tmp_path / "bounce.json")
            assert run(tmp_path / "bounce.json")[0] == 0, proof
    model = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    proof = bounce.certify(model, "0.1", -1, 1, parameters={"mu": (0.295, 0.305)})
    proof.orbit.save(tmp_path / "mu.json")
    assert run(tmp_path / "mu.json")[0] == 0
