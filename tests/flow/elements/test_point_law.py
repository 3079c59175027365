"""Multipliers of several surfaces: the one solution of a P-matrix."""

from itertools import product

import numpy as np
import pytest

from nonsmooth.flow.point_law import is_unique, solve


def solutions(a, m):
    """All lambda with the complementarity, by their 3^k letters."""
    for letters in np.array(list(product((0.0, 1.0, -1.0), repeat=len(a)))):
        lam, own = letters.copy(), letters == 0
        lam[own] = np.linalg.solve(m[np.ix_(own, own)], -(a + m @ letters)[own])
        if np.all(np.abs(lam) <= 1) and np.all(letters * (a + m @ lam) >= 0):
            yield lam


@pytest.mark.parametrize("seed", range(20))
def test_the_search_finds_what_the_enumeration_finds(seed):
    """Where -M is a P-matrix there is one solution (Cottle, Pang & Stone, theorem 3.3.7)."""
    rng = np.random.default_rng(seed)
    b = rng.normal(size=(4, 4))
    m, a = -(b @ b.T + np.eye(4)), 3 * rng.normal(size=4)
    assert is_unique(m)
    (expected,) = solutions(a, m)
    np.testing.assert_allclose(solve(a, m), expected, atol=1e-12)


def test_not_every_matrix_has_one_solution():
    assert not is_unique(np.array([[np.nan]]))
    assert not is_unique(np.eye(2))
