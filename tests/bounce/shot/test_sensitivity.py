"""The exact derivatives of the lift-off are those of finite differences, for every model and event."""

import numpy as np
import pytest

import bounce
import nonsmooth as ns

KV = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-3)
ALL = ["mu", "d1", "d2", "eta", "G", "inertia", "xdot", "ydot", "omega"]
STRIBECK = bounce.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5)
LUGRE = bounce.LuGre(bristle_stiffness=50.0, mu_kinetic=0.2, stribeck_speed=0.5)
POWER = dict(mu=0.3, stiffness=1.0, eta=0.4, d1=0.2)
CASES = {
    "entry and exit": (KV, (0.2, -1.0, 1.0), ALL, "+ s +"),
    "reversal": (KV, (0.3, -1.0, 0.1), ALL, "+ s -"),
    "slip": (KV, (-0.3, -1.0, 2.0), ALL, "+"),
    "backward": (KV, (-0.3, -1.0, -0.1), ALL, "- s +"),
    "no load at first": (
        KV.replace(load="net", d2=5e-4, G=0.02), (0.2, -1.0, 1.0), ALL, "F + s +"
    ),
    "Hunt-Crossley": (
        bounce.HuntCrossley(damping=0.3, **POWER), (0.2, -1.0, 1.0), ["mu", "stiffness", "damping", "ydot"], "+ s +"
    ),
    "Tsuji": (
        bounce.Tsuji(damping=0.3, **POWER), (0.2, -1.0, 1.0), ["mu", "stiffness", "damping", "ydot"], "+ s +"
    ),
    "Maxwell": (
        bounce.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=0.7, eta=0.4, d1=0.2),
        (0.2, -1.0, 1.0),
        ["mu", "branch_stiffness", "relaxation", "omega"],
        "+ s +",
    ),
    "Stribeck": (KV.replace(friction=STRIBECK, mu_kinetic=0.2, stribeck_speed=0.5), (0.2, -1.0, 1.0), ["mu", "mu_kinetic", "stribeck_speed"], None),
    "crossing": (KV.replace(friction=LUGRE, mu_kinetic=0.2, stribeck_speed=0.5, bristle_stiffness=50.0), (0.2, -1.0, 1.0), ["mu", "bristle_stiffness"], "+ - +"),
}  # fmt: skip


def end(model, landing):
    shot = bounce.simulate(model, *landing, tol=1e-13)
    return np.array([*shot.trajectory.x[-1], shot.time])


def differences(model, landing, name, h=1e-4):
    def at(d):
        if name in model.values:
            return end(model.replace(**{name: model.values[name] + d}), landing)
        k = ("xdot", "ydot", "omega").index(name)
        return end(model, [v + d * (i == k) for i, v in enumerate(landing)])

    return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)


@pytest.mark.slow_cases("Hunt-Crossley")
@pytest.mark.parametrize("case", CASES)
def test_against_fourth_order_differences(case):
    model, landing, names, itinerary = CASES[case]
    shot = bounce.simulate(model, *landing, tol=1e-13)
    assert itinerary is None or shot.itinerary == itinerary
    exact = bounce.sensitivity(shot, names)
    for k, name in enumerate(names):
        numeric = differences(model, landing, name)
        got = np.array([*exact.state[:, k], exact.time[k]])
        assert np.abs(got - numeric).max() < 1e-9, name


def test_they_converge_with_the_tolerance():
    reference = bounce.sensitivity(bounce.simulate(KV, 0.2, -1.0, 1.0, tol=1e-13), ALL).state
    errors = [
        np.abs(
            bounce.sensitivity(bounce.simulate(KV, 0.2, -1.0, 1.0, tol=tol), ALL).state - reference
        ).max()
        for tol in (1e-6, 1e-9)
    ]
    assert errors[0] < 1e-4 and errors[1] < 1e-7


def test_homogeneity():
    """Without gravity the lift-off is homogeneous of degree one in the landing (Euler's identity)."""
    model, landing = KV.replace(G=0.0), np.array([0.2, -1.0, 1.0])
    shot = bounce.simulate(model, *landing, tol=1e-12)
    s = bounce.sensitivity(shot, ["xdot", "ydot", "omega"])
    assert s.state @ landing == pytest.approx(shot.trajectory.x[-1], abs=1e-10)
    assert s.time @ landing == pytest.approx(0.0, abs=1e-10)


def test_unknown_name():
    with pytest.raises(ns.ParameterError, match=r"names among .*received 'nu'"):
        bounce.sensitivity(bounce.simulate(KV, 0.2, -1.0, 1.0), ["nu"])


@pytest.mark.slow_cases("None-landing0", "0.1-landing0")
@pytest.mark.parametrize("landing", [([1.0, 0.2], [0.1, 1.0, 0.0]), ([2.0, 0.2], [1.5, 0.4, 0.3])])
@pytest.mark.parametrize("drilling", [None, 0.1])
def test_derivatives_of_a_bounce_in_3d_are_those_of_differences(landing, drilling):
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    v, w = landing[0], landing[1] if drilling else landing[1][:2]
    names = ["mu", "eta", "xdot", "zdot", "omega", "side_omega", "x", "ydot"]
    names += ["spin"] if drilling else []

    def end(change, by=0.0):
        values = {"mu": 0.3, "eta": 0.5, "ydot": -1.0, "x": 0.0}
        pairs = dict(zip(("xdot", "zdot", "omega", "side_omega", "spin"), (*v, *w), strict=False))
        n = {**values, **pairs}
        n[change] += by
        model = turf.replace(mu=n["mu"], eta=n["eta"]).in_3d(drilling_radius=drilling)
        spin = [n["omega"], n["side_omega"], *([n["spin"]] if drilling else [])]
        return bounce.simulate(
            model, [n["xdot"], n["zdot"]], n["ydot"], spin, [n["x"], 0.0], tol=1e-13
        )

    shot, h = end("mu"), 1e-5
    found = bounce.sensitivity(shot, names)
    for k, name in enumerate(names):
        one, other = (end(name, s * h).trajectory.x[-1] for s in (1, -1))
        assert found.state[:, k] == pytest.approx((one - other) / (2 * h), abs=5e-6)
    with pytest.raises(ns.ParameterError, match="side_omega"):
        bounce.sensitivity(shot, ["tilt"])
