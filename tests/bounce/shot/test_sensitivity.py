"""The exact derivatives of the lift-off are those of finite differences, for every model and event."""

import numpy as np
import pytest

import bounce
import nonsmooth as ns

KV = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-3)
ALL = ["mu", "d1", "d2", "eta", "G", "inertia", "xdot", "ydot", "omega"]
STRIBECK = bounce.contact.Stribeck(mu_kinetic=0.2, stribeck_speed=0.5)
LUGRE = bounce.contact.LuGre(bristle_stiffness=50.0, mu_kinetic=0.2, stribeck_speed=0.5)
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
        bounce.contact.HuntCrossley(damping=0.3, **POWER), (0.2, -1.0, 1.0), ["mu", "stiffness", "damping", "ydot"], "+ s +"
    ),
    "Tsuji": (
        bounce.contact.Tsuji(damping=0.3, **POWER), (0.2, -1.0, 1.0), ["mu", "stiffness", "damping", "ydot"], "+ s +"
    ),
    "Maxwell": (
        bounce.contact.Maxwell(mu=0.3, branch_stiffness=1.0, relaxation=0.7, eta=0.4, d1=0.2),
        (0.2, -1.0, 1.0),
        ["mu", "branch_stiffness", "relaxation", "omega"],
        "+ s +",
    ),
    "Stribeck": (KV.replace(friction=STRIBECK, mu_kinetic=0.2, stribeck_speed=0.5), (0.2, -1.0, 1.0), ["mu", "mu_kinetic", "stribeck_speed"], None),
    "crossing": (KV.replace(friction=LUGRE, mu_kinetic=0.2, stribeck_speed=0.5, bristle_stiffness=50.0), (0.2, -1.0, 1.0), ["mu", "bristle_stiffness"], "+ - +"),
}  # fmt: skip


BOTH = [*ALL[:2], *ALL[3:5], "xdot", "zdot", "ydot", "omega", "side_omega", "x", "z"]
for name, v, w, itinerary in [
    ("3-D rolls", [1.0, 0.2], [0.1, 1.0, 0.0], None),
    ("3-D slips", [2.0, 0.2], [1.5, 0.4, 0.3], "*"),
]:
    CASES[name] = (KV.in_3d(), (v, -1.0, w[:2]), BOTH, itinerary)
    CASES[f"{name}, drilling"] = (
        KV.in_3d(drilling_radius=0.1),
        (v, -1.0, w),
        [*BOTH, "spin"],
        None,
    )

#: Where a component of the landing is among the arguments of ``simulate``.
AT = dict(
    xdot=(0, 0),
    zdot=(0, 1),
    ydot=(1, 0),
    omega=(2, 0),
    side_omega=(2, 1),
    spin=(2, 2),
    x=(3, 0),
    z=(3, 1),
)


def end(model, landing):
    shot = bounce.simulate(model, *landing, tol=1e-13)
    return np.array([*shot.trajectory.x[-1], shot.time])


def differences(model, landing, name, h=1e-4):
    def at(d):
        if name in model.values:
            return end(model.replace(**{name: model.values[name] + d}), landing)
        moved, (i, k) = [*landing, np.zeros_like(landing[0])], AT[name]
        moved[i] = moved[i] + d * (np.arange(np.size(moved[i])) == k).reshape(np.shape(moved[i]))
        return end(model, [v if np.ndim(v) else float(v) for v in moved])

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


@pytest.mark.parametrize(
    ("landing", "name"), [((0.2, -1.0, 1.0), "zdot"), (([1.0, 0.2], -1.0, [0.1, 1.0]), "spin")]
)
def test_unknown_name(landing, name):
    for wrong in ("nu", name):
        with pytest.raises(ns.ParameterError, match=wrong):
            bounce.sensitivity(bounce.simulate(KV, *landing), [wrong])
