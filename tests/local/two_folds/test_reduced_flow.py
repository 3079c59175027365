"""Sliding orbits of the normal form are exact: matrix exponentials, times to leave, and their ends."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

from nonsmooth import textbook
from nonsmooth.local.two_folds import ReducedFlow, classify_two_fold
from nonsmooth.local.two_folds.reduced_flow import exponential, leaving, orbit, sectors

CLASSES = textbook.TWO_FOLDS


@pytest.mark.parametrize("label", CLASSES)
def test_sectors_that_connect_to_the_two_fold_agree_with_the_decision_table(label):
    flow = ReducedFlow(*CLASSES[label])
    table = classify_two_fold(*CLASSES[label])
    for part in sectors(flow):
        slope = np.tan((part.low + part.high) / 2)
        wide = table.into.kind in ("all", "sector")
        assert (part.orbit.goes_to == "s") == (wide and table.into.contains(slope))
        wide = table.out_of.kind in ("all", "sector")
        assert (part.orbit.comes_from == "s") == (wide and table.out_of.contains(slope))


def test_exponential_is_exact_for_focus_node_and_jordan_block():
    for matrix in ([[0.3, -2], [1, 0.1]], [[-3, -1], [1, -0.5]], [[0.5, -1], [1, -1.5]]):
        for r in (-1.3, 0.0, 2.0):
            expected = expm(np.array(matrix) * r)
            assert_allclose(exponential(matrix, r), expected, rtol=1e-12, atol=1e-13)


def test_time_to_leave_the_quadrant_is_exact():
    rng = np.random.default_rng(1)
    for _ in range(300):
        matrix, z = rng.normal(size=(2, 2)), rng.uniform(0.1, 1, 2)
        r, component = leaving(matrix, z)
        times = np.linspace(0, min(r, 50.0), 400)[1:-1]
        with np.errstate(over="ignore"):
            inside = exponential(matrix, times) @ z
        assert np.all(inside > -1e-9 * np.abs(inside).max())
        if component >= 0:
            end = exponential(matrix, r) @ z
            assert abs(end[component]) < 1e-9 * (1 + np.abs(end).max())


def test_reaching_the_two_fold_and_the_folds():
    assert orbit(ReducedFlow((-1, 1), (-2.0, -1.0)), [1.0, 1.0]).goes_to == "s"
    assert orbit(ReducedFlow((1, -1), (-2.0, -1.0)), [1.0, 0.1]).goes_to == "z3=0"
    assert orbit(ReducedFlow((1, -1), (2.0, 0.5)), [1.0, 0.1]).comes_from == "equilibrium"
