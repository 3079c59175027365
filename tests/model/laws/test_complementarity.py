"""Multipliers of several surfaces: the one solution of a P-matrix, and none where the search fails."""

from itertools import product

import numpy as np
import pytest

from nonsmooth.model.laws.complementarity import is_unique, solve


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
    np.testing.assert_allclose(solve(a, m, np.zeros(4)), expected, atol=1e-12)


def test_a_search_that_is_cut_off_or_meets_a_singular_matrix_finds_nothing():
    a, m = np.array([0.5, -3.0]), -np.eye(2)
    assert solve(a, m, np.zeros(2), iterations=1) is None
    assert solve(a, np.zeros((2, 2)), np.zeros(2)) is None


def test_not_every_matrix_has_one_solution():
    assert not is_unique(np.array([[np.nan]]))
    assert not is_unique(np.eye(2))
