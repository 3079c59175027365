"""The rigid law agrees with its closed form in every case, and is the limit of compliant ground."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import bounce
import nonsmooth as ns

DATA = Path(__file__).parents[2] / "data"
RIGID = json.loads((DATA / "rigid_bounce.json").read_text(encoding="utf-8"))["cases"]
HYPOTHESES = ["kinematic", "poisson", "energetic"]


@pytest.mark.parametrize("hypothesis", HYPOTHESES)
@pytest.mark.parametrize("case", RIGID, ids=[c["id"] for c in RIGID])
def test_reference(case, hypothesis):
    q = {name: float(value) for name, value in case["inputs"].items()}
    model = bounce.laws.RigidBounce(mu=q["mu"], restitution=q["r"], hypothesis=hypothesis)
    shot = model.lift_off(q["xdot0"], q["ydot0"], q["omega0"])
    expected = case["outputs"]
    pairs = [
        (shot.xdot, "xdotF"),
        (shot.ydot, "ydotF"),
        (shot.omega, "omegaF"),
        (shot.slip, "HF"),
        (shot.tangential_impulse, "tangential_impulse"),
        (shot.normal_impulse, "normal_impulse"),
        (shot.rolling_impulse, "n_at_roll_onset"),
        (shot.rolling_speed, "vN_at_roll_onset"),
    ]
    assert str(shot.case) == expected["case"]
    scale = max(abs(v) for v in q.values())
    boundary = "/" in expected["case"]  # whether it still rolls is then a matter of rounding
    for value, name in pairs:
        if expected[name] is None or (boundary and "roll_onset" in name):
            assert boundary or np.isnan(value)
        else:
            assert abs(value - float(expected[name])) <= 1e-14 * scale


# Rolling ends where the load does, but rounding puts the roots of the two 1e-14 apart.
@example(mu=1.0, d2=0.8984375, xdot=0.0, omega=1.0, inertia=0.5)
@given(
    mu=st.floats(0.05, 1.0),
    d2=st.floats(0.0, 2.0),
    xdot=st.floats(-3, 3),
    omega=st.floats(-3, 3),
    inertia=st.floats(0.2, 1.0),
)
def test_normal_compliance_alone_is_the_rigid_law(mu, d2, xdot, omega, inertia):
    soft = bounce.NormalKelvinVoigt(mu=mu, d2=d2, inertia=inertia)
    hard = bounce.laws.RigidBounce(mu=mu, inertia=inertia, restitution=soft.restitution)
    shot = bounce.simulate(soft, xdot, -1.0, omega, tol=1e-13)
    expected = hard.lift_off(xdot, -1.0, omega)
    end = shot.lift_off
    for name in ("xdot", "ydot", "omega"):
        assert abs(getattr(end, name) - getattr(expected, name)) <= 1e-11


@given(
    xdot=st.floats(-50, 50), ydot=st.floats(-50, -0.1), omega=st.floats(-300, 300),
    r=st.floats(0, 1), mu=st.floats(0.01, 5),
)  # fmt: skip
def test_invariances(xdot, ydot, omega, r, mu):
    model = bounce.laws.RigidBounce(mu=mu, restitution=r)
    a, b = model.lift_off(xdot, ydot, omega), model.lift_off(-xdot, ydot, -omega)
    assert (a.xdot, a.ydot, a.omega) == (-b.xdot, b.ydot, -b.omega)
    before = xdot**2 + ydot**2 + 0.4 * omega**2
    after = a.xdot**2 + a.ydot**2 + 0.4 * a.omega**2
    assert after <= before * (1 + 1e-14)
    assert a.slip * (xdot + omega) >= 0, "a rigid ground cannot reverse the slip"


def test_restitution_as_a_function_of_speed_and_arrays():
    model = bounce.laws.RigidBounce(mu=0.3, restitution=lambda v: 0.5 * np.exp(-v / 10))
    shot = model.lift_off(np.zeros((2, 1)), [-1.0, -2.0, -3.0], 0.5)
    assert shot.ydot.shape == shot.case.shape == (2, 3)
    assert np.allclose(shot.ydot[0], 0.5 * np.exp([-0.1, -0.2, -0.3]) * [1, 2, 3])


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: bounce.laws.RigidBounce(mu=0.3, restitution=1.5), ns.ParameterError, "restitution"),
        (lambda: bounce.laws.RigidBounce(mu=-1, restitution=0.5), ns.ParameterError, "mu"),
        (lambda: bounce.laws.RigidBounce(mu=0.3, restitution="x"), ns.ParameterError, "restitution"),
        (
            lambda: bounce.laws.RigidBounce(mu=0.3, restitution=0.5, hypothesis="newton"),
            ns.ParameterError,
            "hypothesis",
        ),
        (
            lambda: bounce.laws.RigidBounce(mu=0.3, restitution=0.5).lift_off(1.0, 1.0, 0.0),
            bounce.LandingError,
            "ydot",
        ),
        (
            lambda: bounce.laws.RigidBounce(mu=0.3, restitution=0.5).lift_off(math.nan, -1.0, 0.0),
            bounce.LandingError,
            "xdot",
        ),
        (
            lambda: bounce.laws.RigidBounce(mu=0.3, restitution=0.5).lift_off([1, 2], [-1] * 3, 0),
            bounce.LandingError,
            "broadcast",
        ),
        (
            lambda: bounce.laws.RigidBounce(mu=0.3, restitution=lambda v: 2.0).lift_off(1, -1, 0),
            ns.ParameterError,
            "restitution",
        ),
    ],
)  # fmt: skip
def test_messages(call, error, message):
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize("wrong", [lambda v: np.ones(3), lambda v: "a"])
def test_a_restitution_function_of_the_wrong_shape(wrong):
    ball = bounce.laws.RigidBounce(mu=0.3, restitution=wrong)
    with pytest.raises(ns.ParameterError, match="restitution"):
        ball.lift_off([1.0, 2.0], -1.0, 0.0)


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
@pytest.mark.parametrize("mu", [0.0, 0.1, 0.3])
def test_in_3d_on_a_line_it_is_the_planar_law(angle, mu):
    law = bounce.laws.RigidBounce(mu=mu, restitution=0.6)
    e = np.array([np.cos(angle), np.sin(angle)])
    v, w = np.array([1.0, 1.0, -0.5, 0.3]), np.array([0.5, -2.0, -0.2, -0.3])
    plane = law.lift_off(v, -1.0, w)
    space = bounce.laws.rigid_lift_off_3d(law, v[:, None] * e, -1.0, w[:, None] * e)
    assert space.xdot == pytest.approx(plane.xdot[:, None] * e, abs=1e-15)
    assert space.omega == pytest.approx(plane.omega[:, None] * e, abs=1e-15)
    assert space.slip == pytest.approx(plane.slip[:, None] * e, abs=1e-15)
    assert space.ydot == pytest.approx(plane.ydot, abs=1e-15)


def test_deflection_of_a_ball_that_rolls():
    """tan(kick) = -k W2/(V1 - k W1); spin and speed of rolling are opposite."""
    law = bounce.laws.RigidBounce(mu=0.5, restitution=0.5)
    v, w = np.array([1.0, 0.0]), np.array([0.2, 0.5])
    shot = bounce.laws.rigid_lift_off_3d(law, v, -1.0, w)
    assert str(shot.case) == "II" or str(shot.case) == "III"
    assert np.tan(shot.travel_angle) == pytest.approx(-0.4 * 0.5 / (1 - 0.4 * 0.2), abs=1e-15)
    assert shot.xdot == pytest.approx((v - 0.4 * w) / 1.4, abs=1e-15)
    assert shot.omega == pytest.approx(-shot.xdot, abs=1e-15)
    assert np.all(shot.slip == 0.0)


def test_in_3d_contact_without_tangential_compliance_is_the_law():
    model = bounce.NormalKelvinVoigt(mu=0.1, d2=0.1)
    law = bounce.laws.RigidBounce(mu=0.1, restitution=model.restitution)
    for w in ([1.5, 0.5], [-0.9, 0.05]):  # slips throughout, rolls
        soft = bounce.simulate(model, [1.0, 0.2], -1.0, w, tol=1e-12)
        hard = bounce.laws.rigid_lift_off_3d(law, [1.0, 0.2], -1.0, w)
        assert soft.lift_off.xdot == pytest.approx(hard.xdot, abs=1e-11)
        assert soft.lift_off.omega == pytest.approx(hard.omega, abs=1e-11)


def test_arrays_in_3d_broadcast_and_refusals():
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.5)
    shot = bounce.laws.rigid_lift_off_3d(law, [1.0, 0.2], [[-1.0], [-2.0]], np.zeros((3, 2)))
    assert shot.xdot.shape == (2, 3, 2) and shot.ydot.shape == (2, 3)
    with pytest.raises(bounce.LandingError, match="omega"):
        bounce.laws.rigid_lift_off_3d(law, [1.0, 0.0], -1.0, 0.5)
    with pytest.raises(bounce.LandingError, match="ydot"):
        bounce.laws.rigid_lift_off_3d(law, [1.0, 0.0], 0.0, [0.5, 0.1])
    with pytest.raises(bounce.LandingError, match="xdot"):
        bounce.laws.rigid_lift_off_3d(law, [np.nan, 0.0], -1.0, [0.5, 0.1])
