"""Orbits off the surface are those of the two fields, and flights land where the crossing map says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from nonsmooth.local.two_folds import ReducedFlow, flight_above, flight_below
from nonsmooth.local.two_folds.parabolas import arc, flight, passage

ALL = {
    "VV-F": ((1, -1), (2.0, 1.0)),
    "II-C": ((-1, 1), (-2.0, -1.0)),
    "mix-0": ((1, 1), (0.0, 0.5)),
    "mix-C": ((1, 1), (-3.0, -0.5)),
    "IV": ((-1, -1), (-0.5, -3.0)),
    "Delta=0": ((1, -1), (2.0, 0.5)),
}


@pytest.mark.parametrize("sigma, nu", ALL.values(), ids=ALL)
@pytest.mark.parametrize("side", "+-")
def test_arcs_are_orbits_of_the_fields_off_the_surface(sigma, nu, side):
    flow = ReducedFlow(sigma, nu)
    curve = arc(flow, side, 0.4, 0.5, 0.0)
    dt = 1.0 / 60
    velocity = (curve[2:] - curve[:-2]) / (2 * dt)  # exact for parabolas
    z = curve[1:-1]
    one = np.ones(len(z))
    above = np.column_stack([-z[:, 1], -sigma[0] * one, nu[0] * one])
    below = np.column_stack([z[:, 2], nu[1] * one, sigma[1] * one])
    assert_allclose(velocity, above if side == "+" else below, atol=1e-12)


@pytest.mark.parametrize("side", "+-")
def test_flights_land_where_the_crossing_map_says(side):
    flow = ReducedFlow((-1, 1), (-0.7, 0.4))
    z = np.array([-0.5, 0.8]) if side == "+" else np.array([0.8, -0.5])
    curve = flight(flow, z, side)
    assert_allclose(curve[0], [0, *z], atol=1e-15)
    landing = (flight_above if side == "+" else flight_below)(z, flow.nu)
    assert_allclose(curve[-1], [0, *landing], atol=1e-15)
    height = curve[1:-1, 0]
    assert np.all(height > 0) if side == "+" else np.all(height < 0)


@pytest.mark.parametrize("side", "+-")
@pytest.mark.parametrize("ahead", [True, False])
def test_passages_begin_or_end_on_the_surface_and_stay_on_their_side(side, ahead):
    flow, z = ReducedFlow((1, -1), (0.3, -0.6)), np.array([-0.4, 0.4])
    if (side == "+") != ahead:  # crossing up: from below to above
        z = -z
    curve = passage(flow, z, side, ahead=ahead)
    assert_allclose(curve[0 if ahead else -1], [0, *z], atol=1e-15)
    away = curve[1:, 0] if ahead else curve[:-1, 0]
    assert np.all(away > 0) if side == "+" else np.all(away < 0)
