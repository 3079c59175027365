"""Equilibria have the kind of eigenvalues known in closed form, and none if a sign is undecided."""

import math

import pytest
from flint import arb

from nonsmooth.proofs.arithmetic.eigenvalues import eigenvalue_kind


def matrix(*rows):
    return [[arb(v) for v in row] for row in rows]


@pytest.mark.parametrize(
    ("rows", "kind", "eigenvalues"),
    [
        ([], "stable node", []),
        (matrix([-2]), "stable node", [-2]),
        (matrix([3, 0], [0, 1]), "unstable node", [1, 3]),
        (matrix([-3, 0], [0, -1]), "stable node", [-3, -1]),
        (matrix([2, 0], [0, 2]), "unstable node", [2, 2]),
        (matrix([1, 0], [0, -1]), "saddle", [-1, 1]),
        (matrix([1, -2], [2, 1]), "unstable focus", [1, 1]),
        (matrix([1, 2, 3], [0, 4, 5], [0, 0, 6]), "unstable node", [1, 4, 6]),
        (matrix([-1, 2, 0], [0, 2, 1], [0, 0, 3]), "saddle", [-1, 2, 3]),
        (matrix([-1, -2, 0], [2, -1, 0], [0, 0, -5]), "stable focus", [-5, -1, -1]),
    ],
)
def test_kinds_are_those_of_known_eigenvalues(rows, kind, eigenvalues):
    found, why, values = eigenvalue_kind(rows)
    assert (found, why) == (kind, "")
    real = [v for name, v in values.items() if not name.endswith("_imaginary")]
    assert len(real) == len(eigenvalues)
    assert all(
        v.overlaps(arb(e)) and v.rad() < 1e-9 for v, e in zip(real, eigenvalues, strict=True)
    )


def test_the_imaginary_parts_of_a_focus_are_given():
    _, _, values = eigenvalue_kind(matrix([1, -2], [2, 1]))
    assert [float(values[f"eigenvalue{k}_imaginary"]) for k in (1, 2)] == [-2.0, 2.0]


def test_a_small_eigenvalue_keeps_its_sign_beside_a_large_one():
    """1e12 and 1e-12: by the formula with the root the small one would be lost in rounding."""
    large, small = 10**12, 1e-12
    for sign in (1, -1):
        kind, _, values = eigenvalue_kind(matrix([sign * large, 1], [0, sign * small]))
        assert kind == ("unstable node" if sign > 0 else "stable node")
        near_zero = min(values.values(), key=lambda v: abs(float(v)))
        assert math.isclose(float(near_zero), sign * small, rel_tol=1e-6)


WIDE = arb(0, 1e-3)


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        (matrix([math.nan, 0], [0, 1]), "the Jacobian is not finite"),
        ([[arb(1), WIDE], [WIDE, arb(1)]], "the eigenvalues are not proven to be apart"),
        (matrix([1, 1, 0], [0, 1, 1], [0, 0, 1]), "the eigenvalues are not proven to be apart"),
        ([[WIDE]], "the real part of an eigenvalue has no proven sign"),
        (matrix([0, -1], [1, 0]), "the real part of an eigenvalue has no proven sign"),
    ],
)
def test_what_is_undecided_has_no_name_and_says_why(rows, why):
    assert eigenvalue_kind(rows)[:2] == ("", why)
