"""The diabolo's numbers come out of simulation as the formulas and the theory notes have them."""

from __future__ import annotations

import math
from fractions import Fraction

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


LIMIT = 1 + 2 * math.sqrt(2)


def exact_landings(y, z, count):
    """Times and points (y, z) of landings from a start of y < 0 < z, in rational arithmetic."""
    t, y, z, found = Fraction(0), Fraction(y), Fraction(z), []
    for k in range(count):
        dt = -2 * (z if k % 2 else y)
        t, y, z = (t + dt, y - dt, -z) if k % 2 else (t + dt, -y, z - 2 * dt)
        found.append([float(value) for value in (t, y, z)])
    return np.array(found)


def test_accumulation_on_the_inner_line():
    """The line repels: the number next to 2 + sqrt(2) starts an orbit that comes as near as 2e-8, and leaves."""
    start = (-1.0, 2 + math.sqrt(2))
    r = model.run(model.AFTER, start, 10.0, tol=1e-13)
    crossings = [event for event in r.events if event.kind == "crossing"]
    exact = exact_landings(*start, len(crossings))
    found = np.array([[event.t, *event.x[1:]] for event in crossings])
    assert found == pytest.approx(exact, rel=1e-13, abs=1e-15)
    assert r.status is ns.Status.REACHED_END and np.hypot(*exact[:, 1:].T).min() < 3e-8
    first, second, third = found[
        2:7:2, 0
    ]  # times to the limit shrink by 3 - 2 sqrt(2) in two flights
    ratio = (third - second) / (second - first)
    assert third + (third - second) * ratio / (1 - ratio) == pytest.approx(LIMIT, rel=0, abs=1e-12)
    r = model.run(model.AFTER, start, 10.0, tol=1e-5)  # farther away than it comes
    assert r.status is ns.Status.ACCUMULATION
    assert r.accumulation_time == pytest.approx(LIMIT, rel=0, abs=1e-8)


@pytest.mark.parametrize("distance", [1e-6, 1e-9, 1e-12])
def test_beside_the_inner_line_orbits_slide_into_the_two_fold_or_leave(distance):
    inside, outside = (
        model.run(model.AFTER, (-1.0, 2 + math.sqrt(2) + d), 10.0, tol=1e-13)
        for d in (distance, -distance)
    )
    assert inside.status is ns.Status.NON_UNIQUE and inside.itinerary.endswith("s")
    assert inside.t[-1] - LIMIT == pytest.approx(2 * distance, rel=1e-3)
    assert np.abs(inside.x[-1]).max() < 1e-12
    assert outside.status is ns.Status.REACHED_END and "s" not in outside.itinerary


@pytest.mark.parametrize(("factor", "inside"), [(1.001, True), (0.999, False)])
def test_the_line_divides_attraction_from_repulsion(factor, inside):
    r = model.run(model.AFTER, (-1.0, factor * (2 + math.sqrt(2))), 60.0)
    assert (r.status is ns.Status.NON_UNIQUE) == inside
