"""Multipliers of several surfaces: every solution that a count in closed form allows, and no other."""

from itertools import product

import numpy as np
import pytest

from nonsmooth.model.laws.complementarity import all_solutions, is_unique, solve


@pytest.mark.parametrize("k", [1, 2, 3])
def test_repelling_surfaces_have_every_combination_of_letters(k):
    """rate = lambda: -1, 0 and 1 each agree with themselves, independently for each surface."""
    found = all_solutions(np.zeros(k), np.eye(k))
    assert sorted(tuple(v) for v in found) == sorted(product((-1.0, 0.0, 1.0), repeat=k))


def test_an_attracting_surface_has_the_one_multiplier_that_holds_it():
    (found,) = all_solutions(np.array([0.5]), np.array([[-1.0]]))
    assert found.tolist() == [0.5]


def test_a_rate_that_no_multiplier_can_turn_has_one_solution_at_its_bound():
    (found,) = all_solutions(np.array([3.0, -2.0]), np.zeros((2, 2)))
    assert found.tolist() == [1.0, -1.0]


@pytest.mark.parametrize("seed", range(20))
def test_the_search_finds_what_the_enumeration_finds(seed):
    """Where -M is a P-matrix there is one solution (Cottle, Pang & Stone, theorem 3.3.7)."""
    rng = np.random.default_rng(seed)
    b = rng.normal(size=(4, 4))
    m, a = -(b @ b.T + np.eye(4)), 3 * rng.normal(size=4)
    assert is_unique(m)
    (expected,) = all_solutions(a, m)
    np.testing.assert_allclose(solve(a, m, np.zeros(4)), expected, atol=1e-12)


def test_too_many_surfaces_are_not_enumerated():
    assert all_solutions(np.zeros(30), -np.eye(30)) is None


def test_a_search_that_is_cut_off_or_meets_a_singular_matrix_finds_nothing():
    a, m = np.array([0.5, -3.0]), -np.eye(2)
    assert solve(a, m, np.zeros(2), iterations=1) is None
    assert solve(a, np.zeros((2, 2)), np.zeros(2)) is None


def test_not_every_matrix_has_one_solution():
    assert not is_unique(np.array([[np.nan]]))
    assert not is_unique(np.eye(2))
