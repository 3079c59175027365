"""Every row of the decision table is what the reduced flow does, row by row and at random."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import nonsmooth as ns
from nonsmooth.local.two_folds import ReducedFlow, classify_two_fold
from nonsmooth.local.two_folds.classification import TABLE

VV, II, VI, IV = (1, -1), (-1, 1), (1, 1), (-1, -1)
ANGLES = (np.arange(120) + 0.5) * np.pi / 240


def fates(matrix, angles):
    """Follow dz/dr = matrix z from |z| = 1 in the first quadrant.

    Returns how each orbit ends ("s", "z2" or "z3" for the fold it leaves through, "far") and its
    closest approach to s.
    """
    z = np.array([np.cos(angles), np.sin(angles)])
    step = expm(0.1 * matrix / max(1.0, np.abs(matrix).max()))
    end = np.full(z.shape[1], "", dtype="<U3")
    closest = np.ones(z.shape[1])
    for _ in range(60_000):
        open_ = end == ""
        if not open_.any():
            return end, closest
        z[:, open_] = step @ z[:, open_]
        radius = np.hypot(*z)
        closest[open_] = np.minimum(closest[open_], radius[open_])
        for name, reached in (
            ("z2", z[0] <= 0),
            ("z3", z[1] <= 0),
            ("s", radius < 1e-25),
            ("far", radius > 1e6),
        ):
            end[open_ & reached & (end == "")] = name
    raise AssertionError("no end")


def survey(matrix):
    """Count of the 120 orbits that reach s, and the slopes of isolated orbits that do."""
    end, _ = fates(matrix, ANGLES)
    isolated = []
    for (a, left), (b, right) in pairwise(zip(ANGLES, end, strict=True)):
        if left == right or "s" in (left, right):
            continue
        for _ in range(9):  # cut the interval around the change by 50 each time
            parts = np.linspace(a, b, 51)
            k = int(np.argmax(fates(matrix, parts)[0] != left))
            a, b = parts[k - 1], parts[k]
        if fates(matrix, np.array([a, b]))[1].min() < 0.9:  # on an eigenline |z| is monotone
            isolated.append(math.tan(a))
    return int(np.sum(end == "s")), isolated


# sigma, nu, label, orbits Da -> s, orbits s -> Da (of 120, or the slope of a single one)
EXAMPLES = [
    (VV, (2, 1), "VV-F", 0, 120),
    (VV, (0.5, 0.5), "VV-C1", [1.0], 0),
    (VV, (-2, -1), "VV-C1", [(1 + 5**0.5) / 2], 0),
    (VV, (-2, -0.5), "VV-C1", [2.0], 0),
    (VV, (3, -1), "VV-C1", [-2 + 5**0.5], 0),
    (II, (-2, -1), "II-C", 120, 0),
    (II, (-0.5, -0.5), "II-F", 0, [1.0]),
    (II, (2, 1), "II-F", 0, [(1 + 5**0.5) / 2]),
    (II, (2, 0.5), "II-F", 0, [2.0]),  # Delta = 0, harmless too
    (VI, (-3, -0.5), "mix-C", 85, 0),
    (VI, (0.5, 3), "mix-F", 0, 85),
    (VI, (-1.5, 1.5), "mix-S", [(3 + 5**0.5) / 2], [(3 - 5**0.5) / 2]),
    (VI, (0, 0.5), "mix-0", 0, 0),
    (VI, (2, -2), "mix-0", 0, 0),
    (IV, (-0.5, -3), "mix-C", 85, 0),
    (IV, (3, 0.5), "mix-F", 0, 85),
    (IV, (1.5, -1.5), "mix-S", [(3 - 5**0.5) / 2], [(3 + 5**0.5) / 2]),
    (IV, (0.5, 0), "mix-0", 0, 0),
]


def check(found, expected):
    count, isolated = found
    if isinstance(expected, list):
        assert count == 0
        np.testing.assert_allclose(isolated, expected, rtol=1e-6)
    else:
        assert (count, isolated) == (expected, [])


@pytest.mark.slow_cases(
    "sigma5-nu5-II-C-120-0",
    "sigma11-nu11-mix-S-into11-out_of11",
    "sigma16-nu16-mix-S-into16-out_of16",
)
@pytest.mark.parametrize(("sigma", "nu", "label", "into", "out_of"), EXAMPLES)
def test_rings(sigma, nu, label, into, out_of):
    c = classify_two_fold(sigma, nu)
    matrix = ReducedFlow(sigma, nu).matrix
    assert c.label == label
    check(survey(matrix), into)
    check(survey(-matrix), out_of)
    for expected, slopes, number in ((into, c.into, c.canards), (out_of, c.out_of, c.faux_canards)):
        inside = sum(slopes.contains(math.tan(a)) for a in ANGLES)
        if isinstance(expected, list):
            assert (slopes.kind, number) == ("one", 1)
            assert slopes.low == pytest.approx(expected[0], rel=1e-14)
        else:
            assert inside == expected
            assert number == (math.inf if expected else 0)


numbers = st.floats(-4, 4).filter(lambda v: abs(v) > 1e-6)
signs = st.sampled_from([VV, II, VI, IV])


@pytest.mark.slow
@settings(max_examples=8)
@given(signs, numbers, numbers)
def test_rings_at_random(sigma, n1, n2):
    c = classify_two_fold(sigma, (n1, n2))
    assume(c.margin > 0.05)
    flow = ReducedFlow(sigma, (n1, n2))
    for matrix, slopes in ((flow.matrix, c.into), (-flow.matrix, c.out_of)):
        count, isolated = survey(matrix)
        assert abs(count - sum(slopes.contains(math.tan(a)) for a in ANGLES)) <= 1
        assert len(isolated) == (slopes.kind == "one")
        if isolated:
            assert isolated[0] == pytest.approx(slopes.low, rel=1e-5)


@given(signs, numbers, numbers)
def test_exactly_one_row_holds(sigma, n1, n2):
    flow = ReducedFlow(sigma, (n1, n2))
    c = classify_two_fold(sigma, (n1, n2))
    assume(all(b.harmless for b in c.boundaries))
    assert [r.label for r in TABLE if flow.folds in r.folds and r.holds(flow)] == [c.label]
    assert c.kind == flow.kind


@given(signs, numbers, numbers)
def test_rows_as_the_theory_states_them(sigma, n1, n2):
    t, delta = n1 + n2, n1 * n2 + sigma[0] * sigma[1]
    g = n2 - n1 if sigma == VI else n1 - n2
    c = classify_two_fold(sigma, (n1, n2))
    assume(all(b.harmless for b in c.boundaries))
    if sigma == VV:
        expected = "VV-F" if n1 > 0 and n2 > 0 and n1 * n2 > 1 else "VV-C1"
    elif sigma == II:
        expected = "II-C" if n1 < 0 and n2 < 0 and n1 * n2 > 1 else "II-F"
    elif g < 2:
        expected = "mix-0"
    else:
        expected = "mix-S" if delta < 0 else "mix-C" if t < 0 else "mix-F"
    assert c.label == expected


@given(signs, numbers, numbers)
def test_eigenvalues_and_slopes(sigma, n1, n2):
    flow = ReducedFlow(sigma, (n1, n2))
    # a nearly defective matrix: numpy's own eigenvalues are accurate to sqrt(eps) only
    np.testing.assert_allclose(
        np.sort_complex(flow.eigenvalues),
        np.sort_complex(np.linalg.eigvals(flow.matrix)),
        atol=1e-6,
    )
    vectors = np.vstack([np.ones(2), flow.slopes])
    np.testing.assert_allclose(flow.matrix @ vectors, vectors * flow.eigenvalues, atol=1e-12)
    assert np.trace(flow.matrix) == pytest.approx(flow.trace)
    assert np.linalg.det(flow.matrix) == pytest.approx(flow.determinant, abs=1e-12)


@pytest.mark.parametrize(
    ("sigma", "nu", "label"),
    [
        (VV, (2, 0.5), "boundary Delta=0: VV-C1|VV-F"),
        (II, (-4, -0.25), "boundary Delta=0: II-C|II-F"),
        (VI, (-2.5, 0.4), "boundary Delta=0: mix-S|mix-C"),
        (VI, (-0.4, 2.5), "boundary Delta=0: mix-S|mix-F"),
        (VI, (-3, -1), "boundary disc=0: mix-0|mix-C"),
        (IV, (3, 1), "boundary disc=0: mix-0|mix-F"),
        (VI, (-1, 1), "boundary disc=0, Delta=0: mix-0|mix-S|mix-C|mix-F"),
    ],
)
def test_boundaries_where_the_class_changes_are_named(sigma, nu, label):
    c = classify_two_fold(sigma, nu)
    assert c.label == label
    assert math.isnan(c.canards) and math.isnan(c.faux_canards)
    assert "does not decide" in c.determinism
    # rounding does not hide a boundary, and on either side lie the classes that were named
    assert classify_two_fold(sigma, (nu[0] * (1 + 1e-13), nu[1] * (1 - 2e-13))).label == label
    around = {
        classify_two_fold(sigma, (nu[0] + total + part, nu[1] + total - part)).label
        for total in (-1e-2, 0, 1e-2)
        for part in (-1e-6, 0, 1e-6)
    }
    assert {c for c in around if "boundary" not in c} == set(label.split(": ")[1].split("|"))


@pytest.mark.parametrize(
    ("sigma", "nu", "label", "name"),
    [
        (VV, (-2, -0.5), "VV-C1", "Delta=0"),
        (II, (4, 0.25), "II-F", "Delta=0"),
        (VI, (2, -0.5), "mix-0", "Delta=0"),
        (VI, (1.5, -0.5), "mix-0", "disc=0"),
        (II, (0, 0.7), "II-F", "nu1=0"),
        (VI, (0.7, 0), "mix-0", "nu2=0"),
    ],
)
def test_harmless_boundaries_keep_the_class_and_are_named(sigma, nu, label, name):
    c = classify_two_fold(sigma, nu)
    assert c.label == label
    assert [b.name for b in c.boundaries] == [name]
    assert c.boundaries[0].between == (label,)
    steps = (-1e-4, 0, 1e-4)
    around = {classify_two_fold(sigma, (nu[0] + a, nu[1] + b)).label for a in steps for b in steps}
    assert around == {label}


def test_margin_is_the_distance_to_the_nearest_boundary():
    c = classify_two_fold(VI, (-3.0, -0.9))
    assert c.nearest == "disc=0" and c.margin == pytest.approx(0.1 / 3)
    c = classify_two_fold(VV, (-2.0, -0.5))
    assert c.margin == math.inf and c.nearest == ""
    with pytest.raises(ns.OptionError, match="tol"):
        classify_two_fold(VV, (1, 2), tol=0)


@pytest.mark.parametrize(
    ("sigma", "nu", "error", "message"),
    [
        ((0, 1), (1, 1), ns.DegenerateError, "cusp-fold"),
        ((2, 1), (1, 1), ns.OptionError, "sigma"),
        ((1, 1), (math.nan, 1), ns.OptionError, r"\bnu\b"),
        ((1, 1), (1, 1, 1), ns.OptionError, r"\bnu\b"),
        (1, (1, 1), ns.OptionError, "sigma"),
    ],
)
def test_bad_input(sigma, nu, error, message):
    with pytest.raises(error, match=message):
        classify_two_fold(sigma, nu)
