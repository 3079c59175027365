"""Two-folds of a bouncing ball agree with 30-digit references to 1e-12, and nu1 nu2 is 1 to 1e-14."""

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.local import find_two_fold, region, sliding_field, two_fold

FILE = Path(__file__).parents[2] / "data" / "two_folds.json"
CASES = json.loads(FILE.read_text(encoding="utf-8"))["cases"]
GENERIC = [case for case in CASES if not case["degenerate"]]
STATES = ["X", "X'", "Y", "Y'", "Omega"]


def laws(model, q, y, v):
    """Normal force without gravity, and the tangential laws upsilon and zeta, of a model."""
    if model == "M0_linear":
        return -q["d0"] * v - y, q["u0"], q["z0"]
    if model == "M3_poly":
        force = -(q["d0"] + q["d1"] * y**2) * v - (q["k0"] + q["k1"] * y**2) * y
        return force, q["u0"] - q["u1"] * y, q["z0"] + q["z1"] * y**2
    spring = q["k0"] * (-y) ** 1.5
    if model == "M4_hertz_plus_dashpot":
        depth = (-y) ** 1.5
        force = spring - (q["c0"] + q["c"] * depth) * v
    else:
        depth = -y
        force = spring - q["c"] * (-y) ** {"M1_hunt_crossley": 1.5, "M2_tsuji": 0.5}[model] * v
    return force, q["u0"] + q["u1"] * depth, q["z0"] + q["z1"] * depth


def ball(case):
    """A ball on a compliant surface with Coulomb friction; contact speed h = X' + Omega."""
    q = {name: float(value) for name, value in case["params"].items()}
    x, u, y, v, w = states = [ca.SX.sym(name) for name in STATES]
    lam = ca.SX.sym("lam")
    force, upsilon, zeta = laws(case["model"], q, y, v)
    normal = force - q["G"]
    upsilon = upsilon + q.get("u2", 0.0) * u**2
    elastic = -(q["eps"] * upsilon * u + q["eps"] ** 2 * zeta * x)
    friction = -lam * q["mu"] * normal
    return ns.FilippovSystem(
        states,
        surface=u + w,
        multipliers=lam,
        field=[u, elastic + friction, v, normal, 2.5 * friction],
    )


def point(case):
    return np.array([float(s) for s in case["s"]])


def ids(case):
    return f"{case['model']} V={float(case['V']):g}"


@pytest.mark.parametrize("case", GENERIC, ids=ids)
def test_normal_form(case):
    fold = two_fold(ball(case), point(case))
    close = lambda value, text: value == pytest.approx(float(text), rel=1e-12)
    for key in ("F1F1H", "F1F2H", "F2F1H", "F2F2H"):
        assert close(fold.lie[f"L{key[1]}{key[3]}"], case[key]), key
    assert fold.sigma == (case["sigma1"], case["sigma2"])
    assert close(fold.nu[0], case["nu1"]) and close(fold.nu[1], case["nu2"])
    assert close(fold.theta, case["theta"]) and close(fold.phi, case["phi"])
    assert fold.kind == case["type"]
    np.testing.assert_allclose(fold.matrix, np.array(case["M"], dtype=float), rtol=1e-12)


@pytest.mark.parametrize("case", GENERIC, ids=ids)
def test_eigenvalues_and_eigenvectors(case):
    fold = two_fold(ball(case), point(case))
    expected = np.array(case["eigenvalues"], dtype=float)
    np.testing.assert_allclose(fold.eigenvalues, np.sort(expected), rtol=1e-12, atol=1e-14)
    vectors = [case["eigenvectors"][k] for k in ("zero_vector", "strong_vector")]
    slopes = [float(v[1]) for v in vectors]
    np.testing.assert_allclose(fold.slopes[np.argsort(expected).argsort()], slopes, rtol=1e-12)
    residual = fold.matrix @ fold.eigenvectors - fold.eigenvectors * fold.eigenvalues
    np.testing.assert_allclose(residual, 0, atol=1e-14)


@pytest.mark.parametrize("case", GENERIC, ids=ids)
def test_fields_coincide_so_sliding_is_smooth_through_it(case):
    system = ball(case)
    fold = two_fold(system, point(case))
    sign = fold.sigma[0] * fold.sigma[1]
    assert fold.coincident_fields
    assert abs(fold.nu[0] * fold.nu[1] + sign) <= 1e-14
    assert [b.name for b in fold.boundaries] == ["Delta=0"]
    assert fold.boundaries[0].harmless
    assert (fold.canards == 1) is case["rolling_reaches_s"]
    assert fold.label == ("VV-C1" if case["rolling_reaches_s"] else "mix-0")
    velocity = sliding_field(system, fold.point)
    above = system.evaluate(system.field("+"), fold.point)[:, 0]
    np.testing.assert_allclose(velocity, above, rtol=1e-14, atol=1e-15)
    # dz/dt at s is (-sigma1/phi, sigma2 phi), whatever the direction
    step = 1e-4 * np.abs(fold.point).min()  # small beside the depth Y
    drift = fold.coordinates(fold.point + step * velocity) / step
    expected = [0, -fold.sigma[0] / fold.phi, fold.sigma[1] * fold.phi]
    np.testing.assert_allclose(drift, expected, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("case", GENERIC, ids=ids)
def test_found_from_a_distance(case):
    system, s = ball(case), point(case)
    offset = 0.02 * abs(s) * [1, 0, -1, 0, 1]
    fold = find_two_fold(system, s + offset, hold=["X'", "Y'"])
    np.testing.assert_allclose(fold.point, s, rtol=1e-12, atol=1e-17)
    free = find_two_fold(system, s + offset)
    assert free.residual < 1e-16 + 1e-14 * abs(s).max()
    # least norm: the free search does not go farther, up to the curvature of the set
    assert free.distance <= fold.distance * 1.05
    assert str(region(system, fold.point)) == "tangency of both fields"


def test_normal_force_with_zero_gradient_is_refused():
    case = next(case for case in CASES if case["degenerate"])
    with pytest.raises(ns.DegenerateError, match="dependent"):
        two_fold(ball(case), point(case))


@pytest.mark.parametrize("case", GENERIC, ids=ids)
def test_product_of_nu_along_the_set(case):
    system, s = ball(case), point(case)
    rng = np.random.default_rng(1)
    for _ in range(5):
        fold = find_two_fold(system, s * (1 + 0.05 * rng.normal(size=5)))
        assert abs(fold.nu[0] * fold.nu[1] + fold.sigma[0] * fold.sigma[1]) <= 1e-14
