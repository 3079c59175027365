"""Two fields are taken for one on a surface only where that is proven, whatever their size."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns
from nonsmooth.model import coupled_of
from nonsmooth.model.expressions.identity import vanish_on
from tests.drawing import at_most

x, y, z, mu = (ca.SX.sym(s) for s in ("x", "y", "z", "mu"))
states = ca.vertcat(x, y, z)


@pytest.mark.parametrize(
    ("expression", "surface"),
    [
        (x - x, y),
        ((x + y) ** 3 - x**3, y),
        (ca.sin(x) * (x**2 + y**2 - 1), x**2 + y**2 - 1),
        (ca.exp(x * y) - ca.exp(x * mu), y - mu),
        (x / y - x / mu, y - mu),
        (ca.sqrt(x**2 + y**2) ** 2 - 1, x**2 + y**2 - 1),
        ((x * z - y) * (x - 1e-300), y - x * z),
        (mu * (x - 0.1) - mu * (y - 0.1), x - y),
    ],
)
def test_what_vanishes(expression, surface):
    assert vanish_on([expression], surface, states)


@pytest.mark.parametrize(
    ("expression", "surface"),
    [
        (x**30, y),
        (1e-300 * x, y),
        ((x / 8) ** 14, y),
        (ca.exp(-((x - 50) ** 2)), y),
        (ca.sqrt(x**2) - x, y),
        (x - mu, y),
        ((x**2 + y**2 - 1) + 1e-17 * x, x**2 + y**2 - 1),
        (y - x, ca.sin(y) + x),
    ],
)
def test_what_does_not_vanish_or_is_not_seen(expression, surface):
    assert not vanish_on([expression], surface, states)


small = st.integers(-3, 3)


@at_most(30)
@given(st.lists(st.tuples(small, small, small, small), min_size=1, max_size=4), small, small)
def test_a_multiple_of_the_surface_is_found_and_one_with_a_remainder_is_not(terms, a, b):
    h = y - a * x * z - b
    factor = sum((c * x ** abs(i) * z ** abs(j) * y ** abs(k) for c, i, j, k in terms), ca.SX(0))
    assert vanish_on([factor * h], h, states)
    assert not vanish_on([factor * h + 1e-12 * (1 + x**2)], h, states)


def test_fields_that_are_nearly_equal_near_the_origin():
    e = (x / 8) ** 14
    system = ns.FilippovSystem([x, y], surface=y, above=[1 - 2 * e, -2 * e], below=[1 + e, e])
    np.testing.assert_allclose(ns.sliding_field(system, [8.0, 0.0]), [1.0, 0.0], atol=1e-13)
    e = ca.exp(-((x - 50) ** 2))
    system = ns.FilippovSystem([x, y], surface=y, above=[1 - 2 * e, -2 * e], below=[1 + e, e])
    run = ns.simulate(system, [47.0, 0.0], 6.0)
    assert abs(run.x[-1, 0] - 53.0) < 1e-8


@pytest.mark.parametrize("size", [1e-12, 1e-30, 1e-200, 1e30])
def test_small_fields_slide_as_large_ones(size):
    system = ns.FilippovSystem(
        [x, y], surface=y, above=[size, -size], below=[2 * size, size], parameters={}
    )
    assert not coupled_of(system).continuous[0]
    run = ns.simulate(system, [0.0, 0.0], 1 / size)
    assert run.itinerary == "s" and abs(run.x[-1, 0] - 1.5) < 1e-12


def test_coefficients_that_differ_by_rounding_are_the_same():
    system = ns.FilippovSystem([x, y], surface=y, above=[0.3 * x, 0], below=[3 * 0.1 * x, 0])
    values = system.evaluate(ns.local.mode_field(system, "s"), [2.0, 0.0])
    np.testing.assert_allclose(np.ravel(values), [0.6, 0.0], atol=1e-15)
    assert coupled_of(system).continuous[0]  # so that runs slide too


@pytest.mark.parametrize("unit", [1e-13, 1e-9, 1e-3, 1e9])
def test_the_unit_of_the_states_does_not_matter(unit):
    """Stick-slip with a tolerance in the same unit: the same itinerary and times."""
    v = y
    system = ns.FilippovSystem(
        [x, v],
        surface=v - 0.3 * unit,
        above=[v, -x - 0.2 * v - 0.5 * unit],
        below=[v, -x - 0.2 * v + 0.7 * unit],
    )
    run = ns.simulate(system, [0.0, 0.0], 30.0, atol=1e-10 * unit, rtol=1e-10)
    assert run.itinerary == "- s -"
    exit = next(e for e in run.events if e.kind == "exit")
    assert abs(exit.x[0] / unit - (0.7 - 0.2 * 0.3)) < 1e-8
