"""Derivatives of runs with friction in space that the reaction of a contact bounds: closed forms, central differences."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.differences import require
from tests.flow.elements.test_friction_on_contacts import THREE, table

G = 9.81
T, MU, A, E = (ca.SX.sym(name) for name in ("t", "mu", "a", "e"))


def box(law="newton", plate=(0, 0), push=(0, 0), inertia=((0, 0), (0, 0)), floor=0, lift=0.0):
    """A body on a floor that moves, with two spins in the units of the slip."""
    x = [ca.SX.sym(name) for name in ("x1", "x2", "y", "v1", "v2", "vy", "w1", "w2")]
    _, _, y, v1, v2, vy, w1, w2 = x
    lam, r = ca.SX.sym("lam", 2), ca.SX.sym("r")
    force = -MU * r * lam
    spins = ca.mtimes(ca.DM(inertia), force)
    return ns.FilippovSystem(
        x,
        field=[
            v1,
            v2,
            vy,
            *ca.vertsplit(force + ca.vertcat(*push)),
            r - G,
            spins[0] + lift * r,
            spins[1],
        ],
        surfaces=[ca.vertcat(v1 + w1 - plate[0], v2 + w2 - plate[1])],
        multipliers=[lam],
        impacts=ns.Impact(y - floor, reaction=r, restitution=E, law=law),
        time=T,
        parameters={MU: 0.3, A: 1.0, E: 0.0},
    )


def valley(law):
    """A body in a valley y = 0.3 x1^2, with two spins in the units of the slip."""
    x = [ca.SX.sym(name) for name in ("x1", "x2", "y", "v1", "v2", "vy", "w1", "w2")]
    x1, _, y, v1, v2, vy, w1, w2 = x
    lam, r = ca.SX.sym("lam", 2), ca.SX.sym("r")
    length = ca.sqrt(1 + (0.6 * x1) ** 2)
    along, up = 1 / length, 0.6 * x1 / length
    one, two = -MU * r * lam[0], -MU * r * lam[1]
    force = [one * along - r * up, two, one * up + r * along - G]
    return ns.FilippovSystem(
        x,
        field=[v1, v2, vy, *force, 2.5 * one, 2.5 * two],
        surfaces=[ca.vertcat(v1 * along + vy * up + w1, v2 + w2)],
        multipliers=[lam],
        impacts=ns.Impact(y - 0.3 * x1**2, reaction=r, restitution=E, law=law),
        parameters={MU: 0.1, A: 1.0, E: 0.5},
    )


def agrees(system, start, end, values, itinerary):
    """Whether derivatives are differences of runs; what holds by contact is kept."""
    closed = [] if itinerary.startswith("*o") else [2, 5]
    free = [k for k in range(11) if k not in (*closed, *([] if values[2] else [10]))]
    given = dict(zip(("mu", "a", "e"), values, strict=True))
    require(system, start, end, itinerary, parameters=given, of=list(free), within=1e-9)


def test_a_box_slides_to_rest_in_closed_form():
    """It stops after |v|/(mu g), at x + |v| v/(2 mu g)."""
    v, mu = np.array([2.0, 1.0]), 0.3
    speed = np.linalg.norm(v)
    run = ns.simulate(box(), [0, 0, 0, *v, 0, 0, 0], 1.2, tol=1e-13)
    s = ns.sensitivity(run)
    way = (np.outer(v, v) / speed + speed * np.eye(2)) / (2 * mu * G)
    np.testing.assert_allclose(s.dx_dx0[:2, 3:5], way, atol=1e-10)
    np.testing.assert_allclose(s.dx_dx0[3:5, 3:5], 0, atol=1e-12)
    np.testing.assert_allclose(s.dx_dp[:2, 0], -speed * v / (2 * mu**2 * G), atol=1e-10)
    np.testing.assert_allclose(s.dt_dx0[0, 3:5], v / speed / (mu * G), atol=1e-10)
    np.testing.assert_allclose(s.dt_dp[0, 0], -speed / (mu**2 * G), atol=1e-10)


@pytest.mark.parametrize("law", ["newton", "moreau", "poisson"])
def test_a_box_falls_and_slides_to_rest_in_closed_form(law):
    """The impact takes mu sqrt(2 g y) of the speed."""
    v, y, mu = np.array([2.0, 1.0]), 1.0, 0.1
    run = ns.simulate(box(law), [0, 0, y, *v, 0, 0, 0], 4.0, parameters={"mu": mu}, tol=1e-13)
    assert run.itinerary == "*o *c sc"
    s = ns.sensitivity(run)
    one, two, high, m = (ca.SX.sym(name) for name in ("one", "two", "high", "m"))
    speed, fall = ca.sqrt(one**2 + two**2), ca.sqrt(2 * G * high)
    left = speed - m * fall
    way = (fall / G + left**2 / (2 * m * G) / speed) * ca.vertcat(one, two)
    given = ca.vertcat(one, two, high, m)
    expected = np.array(ca.Function("way", [given], [ca.jacobian(way, given)])([*v, y, mu]))
    np.testing.assert_allclose(s.dx_dx0[:2, [3, 4, 2]], expected[:, :3], rtol=1e-9)
    np.testing.assert_allclose(s.dx_dp[:2, 0], expected[:, 3], rtol=1e-9)


#: Inertias of a ball, and of a body that turns the slip while it stops.
BALL, BODY = ((2.5, 0), (0, 2.5)), ((2.5, 0.3), (0.3, 1.2))
ELLIPSE = (A * ca.sin(3.2 * T), 0.5 * A * ca.sin(3.2 * T + 1))


@pytest.mark.parametrize(
    ("others", "start", "end", "values", "itinerary"),
    [
        ({"inertia": BODY}, [0, 0, 0, 2, 1, 0, 0.5, -0.7], 0.2, [0.3, 1, 0.5], "*c"),
        ({"inertia": BALL}, [0, 0, 0.1, 2, 1, 0, 1, -0.7], 1.5, [0.3, 1, 0], "*o *c sc"),
        ({"plate": ELLIPSE}, [0, 0, 0, 0.6, 0.4, 0, 0, 0], 1.2, [0.3, 1, 0.5], "*c sc *c"),
        (
            {"push": (A * T, ca.sin(2 * T))},
            [0, 0, 0.02, 0.6, 0.4, -0.1, 0, 0],
            2.0,
            [0.2, 2, 0],
            "*o *c sc *c",
        ),
        ({"floor": 20 * ca.sin(T)}, [0, 0, 0, 3, 4, 20, 0, 0], 0.8, [0.1, 20, 0.5], "*c *o"),
        (
            {"floor": 20 * ca.sin(T)},
            [0, 0, 0, 0.03, 0.04, 20, 0, 0],
            0.8,
            [0.1, 20, 0.5],
            "*c sc *o",
        ),
        ({}, [0, 0, 1, 0, 0, 0, 0, 0], 0.7, [0.3, 1, 0.5], "*o"),
    ],
)
def test_sliding_resting_and_release_are_central_differences(others, start, end, values, itinerary):
    agrees(box(**others), start, end, values, itinerary)


@pytest.mark.parametrize("law", ["newton", "moreau", "poisson"])
@pytest.mark.parametrize("mu", [0.1, 0.16, 0.5])
def test_impacts_that_slip_and_hold_are_central_differences(law, mu):
    """By Poisson's law one with mu = 0.16 slips first, and then holds."""
    system = box(law, inertia=BODY, lift=0.2)
    start = [0, 0, 1, 2, 0.5, 0, 1, -0.7]
    agrees(system, start, 0.7, [mu, 1, 0.5], "*o")


@pytest.mark.parametrize(
    ("e", "end", "itinerary"), [(0.5, 0.9, "*o"), (0.0, 0.5, "*o *c"), (0.0, 0.7, "*o *c sc")]
)
def test_a_ball_in_a_valley_is_central_differences(e, end, itinerary):
    """A plastic impact takes all slip, and the ball slips at once from there."""
    start = [0.5, 0, 1, 0.6, 0.5, 0, 1, -0.7]
    agrees(valley("newton"), start, end, [0.1, 1, e], itinerary)


def test_an_impact_that_just_holds_has_no_derivative():
    """The slip vanishes where the impact ends: neighbours slip or hold."""
    start = [0, 0, 1, 0.1 * np.sqrt(2 * G), 0, 0, 0, 0]
    run = ns.simulate(box(), start, 0.7, parameters={"mu": 0.1})
    with pytest.raises(ns.DegenerateError, match="clearly holds or clearly slips"):
        ns.sensitivity(run)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "e", "way", "start", "end", "itinerary"),
    [
        ("newton", 0.0, (0.5, 0.3, 3.0), (0, 0), 0.4, "***ccc *s*ccc"),
        ("newton", 0.0, (0.4, 0.2, 0.0), (-0.05, 0), 0.13, "***occ ***coo ***cco ***ccc"),
        ("moreau", 0.5, (1.0, -2.0, 0.0), (-0.05, 0), 0.13, "***occ ***ooc"),
    ],
)
def test_a_table_on_three_feet_is_central_differences(law, e, way, start, end, itinerary):
    """One foot stops before the others; one falls while two slide, of which one may leave."""
    tilt, system = start[0], table(0.3, THREE, e=e, law=law)
    x = np.array([0, 0, -0.25 * tilt, 0, tilt, 0, *way[:2], 0, 0, 0, way[2]])
    free = (0, 1, 5, 6, 7, 11) if not tilt else (0, 1, 5, 11)
    require(system, x, end, itinerary, of=list(free), within=1e-9)
