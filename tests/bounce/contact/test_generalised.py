"""Nonlinear bounces agree with the references, power laws at touch-down included; conditions hold
where they should."""

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import bounce
from tests.bounce.shot.test_kelvin_voigt_reference import check

FILE = Path(__file__).parents[2] / "data" / "generalised_bounce.json"
CASES = json.loads(FILE.read_text(encoding="utf-8"))["cases"]


def upsilon(s, p):
    return p.u0 + p.u1 * (-s.y) + p.u2 * s.xdot**2


def zeta(s, p):
    return p.z0 + p.z1 * (-s.y)


FUNCTIONS = {
    "M0_linear": dict(
        kappa=lambda s, p: 1.0,
        delta=lambda s, p: p.d0,
        upsilon=lambda s, p: p.u0,
        zeta=lambda s, p: p.z0,
    ),
    "M1_hunt_crossley": dict(
        kappa=lambda s, p: p.k0 * (-s.y) ** 0.5,
        delta=lambda s, p: p.c * (-s.y) ** 1.5,
        upsilon=upsilon,
        zeta=zeta,
        lift_off=lambda s, p: -s.y * (p.k0 - p.c * s.ydot),
    ),
    "M2_tsuji": dict(
        kappa=lambda s, p: p.k0 * (-s.y) ** 0.5,
        delta=lambda s, p: p.c * (-s.y) ** 0.5,
        upsilon=upsilon,
        zeta=zeta,
        lift_off=lambda s, p: -p.k0 * s.y - p.c * s.ydot,
    ),
    "M3_poly": dict(
        kappa=lambda s, p: p.k0 + p.k1 * s.y**2,
        delta=lambda s, p: p.d0 + p.d1 * s.y**2,
        upsilon=upsilon,
        zeta=lambda s, p: p.z0 + p.z1 * s.y**2,
    ),
    "M4_hertz_plus_dashpot": dict(
        kappa=lambda s, p: p.k0 * (-s.y) ** 0.5,
        delta=lambda s, p: p.c0 + p.c * (-s.y) ** 1.5,
        upsilon=lambda s, p: p.u0 + p.u1 * (-s.y) ** 1.5 + p.u2 * s.xdot**2,
        zeta=lambda s, p: p.z0 + p.z1 * (-s.y) ** 1.5,
    ),
    "M5_exp": dict(
        kappa=lambda s, p: p.k0 * ca.exp(-p.a * s.y),
        delta=lambda s, p: p.d0 * ca.exp(-p.b * s.y),
        upsilon=lambda s, p: p.u0 * ca.exp(-p.c * s.y) * (1 + p.u2 * s.xdot**2),
        zeta=lambda s, p: p.z0 * ca.exp(-p.e * s.y) + p.z2 * s.omega**2,
    ),
}


def model_of(case, **more):
    values = {name: float(value) for name, value in case["params"].items()}
    common = {name: values.pop(name) for name in ("mu", "eps", "G")}
    return bounce.GeneralisedContact(
        **FUNCTIONS[case["model"]], parameters=values, load="net", **common, **more
    )


@pytest.mark.slow_cases("D01-1e-13", "D16-1e-13")
@pytest.mark.parametrize("tol", [1e-13, 1e-10, 1e-8, 1e-6])
@pytest.mark.parametrize("case", CASES, ids=[c["id"] for c in CASES])
def test_reference(case, tol):
    x, xdot, y, ydot, omega = map(float, case["p0"])
    shot = bounce.simulate(model_of(case), xdot, ydot, omega, x, y, tol=tol)
    check(shot, case["outputs"], 1e-10 if tol == 1e-13 else 100 * tol)


def test_linear_functions_are_the_linear_model():
    case = next(c for c in CASES if c["model"] == "M0_linear")
    q = {name: float(value) for name, value in case["params"].items()}
    same = bounce.KelvinVoigt(
        mu=q["mu"],
        eta=q["eps"] * np.sqrt(q["z0"]),
        d1=q["u0"] / (2 * np.sqrt(q["z0"])),
        d2=q["d0"] / 2,
        G=q["G"],
        load="net",
    )
    a = bounce.simulate(model_of(case), 0.2, -1.0, 1.0, tol=1e-13)
    b = bounce.simulate(same, 0.2, -1.0, 1.0, tol=1e-13)
    assert np.abs(np.array(a.lift_off) - b.lift_off).max() < 1e-14


def verdicts(model, **options):
    return {row.name: row.verdict for row in model.conditions(**options).rows}


def test_conditions_of_the_paper():
    poly = model_of(next(c for c in CASES if c["model"] == "M3_poly"))
    assert set(verdicts(poly).values()) == {"holds"}
    assert poly.conditions().hold
    linear = verdicts(model_of(next(c for c in CASES if c["model"] == "M0_linear")))
    assert linear["upsilon_Y < 0"] == "equality"
    assert linear["d Lambda_N / dY < 0"] == "holds"


@pytest.mark.parametrize(
    ("change", "broken"),
    [
        (dict(upsilon=lambda s, p: 1 + s.y), "upsilon_Y < 0"),
        (dict(delta=lambda s, p: 0.2 + 0.1 * s.y), "delta_Y < 0"),
        (dict(upsilon=lambda s, p: 1 - s.y - s.xdot**2), "sign upsilon_X' = sign X'"),
        (dict(kappa=lambda s, p: -1.0), "d Lambda_N / dY < 0"),
        (dict(zeta=lambda s, p: 1e3), "coefficients and slopes = O(1)"),
    ],
)
def test_a_broken_condition_is_named(change, broken):
    functions = dict(
        upsilon=lambda s, p: 1 - s.y + s.xdot**2,
        zeta=lambda s, p: 1.0,
        delta=lambda s, p: 0.2 - 0.1 * s.y,
        kappa=lambda s, p: 1.0,
    )
    good = bounce.GeneralisedContact(**functions, mu=0.3, eps=0.3)
    assert good.conditions().hold
    bad = bounce.GeneralisedContact(**{**functions, **change}, mu=0.3, eps=0.3)
    assert not bad.conditions().hold
    assert verdicts(bad)[broken] == "fails"


def test_large_eps_is_reported():
    case = next(c for c in CASES if c["id"] == "D16")
    assert verdicts(model_of(case))["eps << 1"] == "fails"


def test_messages():
    one = lambda s, p: 1.0
    with pytest.raises(bounce.ModelError, match="upsilon"):
        bounce.GeneralisedContact(1.0, one, one, one, mu=0.3, eps=0.1)
    coupled = bounce.GeneralisedContact(one, one, lambda s, p: s.xdot, one, mu=0.3, eps=0.1)
    with pytest.raises(bounce.UnknownNameError, match="'xdot'"):
        bounce.simulate(coupled, 1.0, -1.0, 0.0)
    with pytest.raises(bounce.ModelError, match="slope"):
        bounce.GeneralisedContact(one, one, one, one, parameters=dict(slope=1.0), mu=0.3, eps=0.1)
    good = bounce.GeneralisedContact(one, one, one, one, mu=0.3, eps=0.1)
    with pytest.raises(bounce.ModelError, match="box"):
        good.conditions(dict(z=(0.0, 1.0)))
