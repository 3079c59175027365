"""The diabolo's numbers come out of simulation as the formulas and the theory notes have them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import nonsmooth as ns
from papers.jeffrey_colombo_2009 import model, results


@pytest.mark.slow_cases("v4-31")
@pytest.mark.parametrize(("v", "expected"), results.COUNTS)
def test_flights_are_counted_as_in_the_theory(v, expected):
    assert model.most_flights(v) == expected == model.formula_for_flights(v[0] * v[1])


@pytest.mark.parametrize("v", [model.BEFORE, model.AFTER, (-0.3, -2.0)])
def test_simulated_return_matrix_is_the_product_of_both_flights(v):
    # (y, z) -> (-y, z - 2 V+ y) -> (y - 2 V- z, -z)
    above = np.array([[-1, 0], [-2 * v[0], 1]])
    below = np.array([[1, -2 * v[1]], [0, -1]])
    assert model.simulated_return_matrix(v) == pytest.approx(below @ above, rel=0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("v", "count"), [((-2.0, -1.0), 120), ((-0.5, -0.5), 0), ((2.0, 1.0), 0)])
def test_ring_of_120_sliding_orbits(v, count):
    assert results.reached(v) == count


def test_accumulation_on_the_inner_line():
    # The line repels along another direction: rounding has grown to the distance that is left at 1e-8 from the
    # two-fold, so a run does not come closer.
    r = model.run(model.AFTER, (-1.0, 2 + math.sqrt(2)), 10.0, tol=1e-5)
    assert r.status is ns.Status.ACCUMULATION
    assert r.accumulation_time == pytest.approx(3.828427124746, rel=0, abs=1e-8)


@pytest.mark.parametrize(("factor", "inside"), [(1.001, True), (0.999, False)])
def test_the_line_divides_attraction_from_repulsion(factor, inside):
    r = model.run(model.AFTER, (-1.0, factor * (2 + math.sqrt(2))), 60.0)
    assert (r.status is ns.Status.NON_UNIQUE) == inside
