"""Coordinates of the normal form have the derivative and the inverse they say, in R^n and with time."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns

x, y, z, w, t = (ca.SX.sym(name) for name in "xyzwt")
SPACE = ns.FilippovSystem(
    [x, y, z],
    surface=x + 0.2 * y * z,
    above=[-y + 0.3 * z**2, 1 + 0.1 * x, -2 + y],
    below=[z, -1 + 0.4 * y, 1 + x],
)
MORE = ns.FilippovSystem(
    [x, y, z, w],
    surface=x - 0.1 * w**2,
    above=[-y + w, 1, -2, 0.3],
    below=[z + 0.2 * w, -1, 1, 0.1 * y],
)
MOVING = ns.FilippovSystem(
    [x, y, z], surface=x, above=[-(y - t / 2), 1, -2], below=[z, -1, 1], time=t
)
CASES = {
    "three states": lambda: ns.find_two_fold(SPACE, [0.1, 0.1, 0.1]),
    "four states": lambda: ns.find_two_fold(MORE, [0.1, 0.1, 0.1, 0.4], hold=["w"]),
    "explicit time": lambda: ns.find_two_fold(MOVING, [0.0, 0.2, 0.1], t=0.5),
}


@pytest.mark.parametrize("case", CASES)
def test_tangents_are_the_derivative_of_the_inverse(case):
    fold = CASES[case]()
    step = 1e-4 * np.vstack([np.eye(3), -np.eye(3)])
    states = fold.point_at(step)
    differences = (states[:3] - states[3:]).T / 2e-4
    assert fold.tangents().shape == (len(fold.point), 3)
    assert_allclose(fold.tangents(), differences, atol=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_states_have_the_coordinates_they_were_found_for(case):
    fold = CASES[case]()
    expected = 0.05 * np.random.default_rng(0).uniform(-1, 1, size=(20, 3))
    assert_allclose(fold.coordinates(fold.point_at(expected)), expected, atol=1e-13)
    assert_allclose(fold.coordinates(fold.point), 0, atol=1e-13)


def test_wrong_shapes_and_numbers_are_refused():
    fold = CASES["three states"]()
    with pytest.raises(ns.PointError, match="states"):
        fold.coordinates([1.0, 2.0])
    with pytest.raises(ns.PointError, match="states"):
        fold.coordinates([1.0, np.nan, 0.0])
    for wrong in (1.0, [1.0], [0.1, np.inf]):
        with pytest.raises(ns.PointError, match=r"\bz\b"):
            fold.point_at(wrong)
