"""Homoclinic orbits to pseudo-saddles are found with all digits from a rough parameter."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import CASES

x, y, c, rho = (ca.SX.sym(s) for s in ("x", "y", "c", "rho"))


@pytest.fixture(scope="module")
def spiral() -> ns.FilippovSystem:
    above = [rho * x - (y - 1), x + rho * (y - 1)]
    return ns.FilippovSystem(
        [x, y], surface=y, above=above, below=[c, 1], parameters={rho: 0.1, c: -0.6}
    )


def close(found: float, digits: str) -> bool:
    return abs(found - float(digits)) <= 1e-12 * abs(float(digits))


def test_h1_is_the_root_of_its_closed_form(spiral: ns.FilippovSystem) -> None:
    values = CASES["H1"]
    found = ns.find_homoclinic(spiral, [-1.4, 0.0], "c", guess=-0.59)
    assert close(found.value, values["c_homoclinic"])
    assert close(found.pseudo_saddle.point[0], values["x_pseudo_saddle"])
    assert close(found.flight, values["flight"])
    assert close(found.fold[0], values["x_fold"])
    assert close(found.eigenvalue, values["eigenvalue_sliding"])
    assert not found.faults and found.side == "+"
    end = found.trajectory.x[-1]
    assert np.abs(end - found.pseudo_saddle.point).max() < 1e-11
    assert "Homoclinic orbit to a pseudo-saddle at c = -0.586212601032" in str(found)


def test_the_mirror_image_has_the_same_parameter(spiral: ns.FilippovSystem) -> None:
    below = [rho * x - (-y - 1), -(x + rho * (-y - 1))]
    mirror = ns.FilippovSystem(
        [x, y], surface=y, above=[c, -1], below=below, parameters={rho: 0.1, c: -0.59}
    )
    found = ns.find_homoclinic(mirror, [-1.4, 0.0], "c")
    assert close(found.value, CASES["H1"]["c_homoclinic"]) and found.side == "-"


def test_what_is_no_connection_is_refused(spiral: ns.FilippovSystem) -> None:
    with pytest.raises(ns.ParameterError, match="'mu'"):
        ns.find_homoclinic(spiral, [-1.4, 0.0], "mu")
    with pytest.raises(ns.ConvergenceError, match="lands"):
        ns.find_homoclinic(spiral, [-1.4, 0.0], "c", guess=-3.0)
    relay = ns.FilippovSystem(
        [x, y],
        surface=x + y,
        above=[y - x, 3 * y - 10],
        below=[y - x, 3 * y + 10],
        parameters={c: 1},
    )
    with pytest.raises(ns.DegenerateError, match="pseudo-saddle"):
        ns.find_homoclinic(relay, [0.5, -0.4], "c")
    z = ca.SX.sym("z")
    solid = ns.FilippovSystem([x, y, z], surface=z, above=[1, 1, -1], below=[1, 1, 1])
    with pytest.raises(ns.OptionError, match="planar"):
        ns.find_homoclinic(solid, [0.0, 0.0, 0.0], "c")
