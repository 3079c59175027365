"""Friction in space bounded by the reaction of a contact: spheres that land and roll, tables that slide, closed forms."""

import itertools

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

G = 9.81

#: A table has more unknowns than are tried one by one.
pytestmark = pytest.mark.filterwarnings("ignore::nonsmooth.flow.warn.DecisionWarning")


def table(
    mu, feet, height=0.4, inertia=(0.1, 0.15, 0.2), e=0.0, pull=(0, 0), law="newton", **others
):
    """A rigid body of unit mass on feet, at small angles."""
    q, w, r = ca.SX.sym("q", 6), ca.SX.sym("w", 6), ca.SX.sym("r", len(feet))
    force, gaps, slips, multipliers = ca.SX.zeros(6), [], [], []
    force[:2] += ca.vertcat(*pull)
    for i, (px, py) in enumerate(feet):
        lam, p = ca.SX.sym(f"lam{i}", 2), ca.vertcat(px, py, -height)
        push = ca.vertcat(-mu * r[i] * lam, r[i])
        force[:3] += push
        force[3:] += ca.cross(p, push)
        gap = q[2] + q[3] * py - q[4] * px
        gaps.append(ns.Impact(gap, reaction=r[i], restitution=e, law=law, name=f"foot{i}"))
        slips.append((w[:3] + ca.cross(w[3:], p))[:2])
        multipliers.append(lam)
    rates = ca.vertcat(force[:2], force[2] - G, force[3:] / ca.DM(inertia))
    return ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(w)],
        field=[*ca.vertsplit(w), *ca.vertsplit(rates)],
        surfaces=slips,
        multipliers=multipliers,
        impacts=gaps,
        **others,
    )


FOUR = list(itertools.product((-0.5, 0.5), (-0.3, 0.3)))
THREE = [(0.5, 0), (-0.25, 0.4), (-0.25, -0.4)]


@pytest.mark.parametrize(
    ("feet", "mu"), [(THREE, 0.3), (FOUR, 0.3), pytest.param(FOUR, 1.2, marks=pytest.mark.slow)]
)
def test_a_table_that_slides_stops_where_a_block_does(feet, mu):
    """Four feet share the load in more than one way; at 1.2 one of them hardly has any."""
    velocity = np.array([2.0, 1.0])
    stop = np.linalg.norm(velocity) / (mu * G)
    run = ns.simulate(table(mu, feet), [*[0] * 6, *velocity, 0, 0, 0, 0], 1.2 * stop)
    n = len(feet)
    assert run.itinerary == f"{'*' * n}{'c' * n} {'s' * n}{'c' * n}"
    assert abs(run.events[0].t - stop) < 1e-11
    np.testing.assert_allclose(run.x[-1], [*velocity * stop / 2, *[0] * 10], atol=1e-11)


@pytest.mark.parametrize("feet", [THREE, FOUR])
def test_a_table_that_is_pulled_slips_where_a_block_does(feet):
    """No foot slips before all do, however they share the load."""
    t, mu, end = ca.SX.sym("t"), 0.3, 2.0
    system = table(mu, feet, pull=(2 * t, t), time=t)
    run = ns.simulate(system, [0] * 12, end)
    slips, n = mu * G / np.sqrt(5), len(feet)
    assert run.itinerary == f"{'s' * n}{'c' * n} {'*' * n}{'c' * n}"
    assert abs(run.events[0].t - slips) < 1e-9
    speed = np.sqrt(5) / 2 * (end**2 - slips**2) - mu * G * (end - slips)
    np.testing.assert_allclose(run.x[-1, 6:8], speed * np.array([2, 1]) / np.sqrt(5), atol=1e-8)
    np.testing.assert_allclose(run.x[-1, 8:], 0.0, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [(0.0, 0.0), (0.3, 0.2), (1.0, 0.5)])
def test_a_table_falls_on_four_feet_and_slides_on(velocity):
    """The impact takes mu v of the speed, or all of it."""
    mu, fall = 0.3, np.sqrt(2 * G * 0.1)
    run = ns.simulate(table(mu, FOUR), [0, 0, 0.1, 0, 0, 0, *velocity, 0, 0, 0, 0], 2.0, tol=1e-11)
    assert run.status is ns.Status.REACHED_END, run.message
    speed = np.linalg.norm(velocity)
    left = max(speed - mu * fall, 0.0)
    way = speed * fall / G + left**2 / (2 * mu * G)
    np.testing.assert_allclose(run.x[-1, :2], way * np.array(velocity) / (speed or 1.0), atol=1e-10)
    np.testing.assert_allclose(run.x[-1, 2:], 0.0, atol=1e-10)


def test_what_is_not_determined_is_reported():
    """On four feet that slip in different directions the motion depends on how they share the load."""
    run = ns.simulate(table(0.3, FOUR), [*[0] * 6, 1, 0.4, 0, 0, 0, 3], 1.0)
    assert run.status is ns.Status.NON_UNIQUE


def test_components_with_different_loads_are_refused():
    x, u, v, w, r, s = (ca.SX.sym(name) for name in "xuvwrs")
    lam = ca.SX.sym("lam", 2)
    with pytest.raises(ns.DefinitionError, match="no common bound"):
        ns.FilippovSystem(
            [x, u, v, w],
            field=[w, -r * lam[0], -(r + s) * lam[1], r + s - G],
            surfaces=[ca.vertcat(u, v)],
            multipliers=[lam],
            impacts=[ns.Impact(x, reaction=r, name="one"), ns.Impact(x, reaction=s, name="two")],
        )


@pytest.mark.parametrize("side", [0.0, 0.5])
@pytest.mark.parametrize(("angle", "mu"), [(0.7, 0.2), (0.7, 0.5), (1.0, 0.2), (1.0, 0.5)])
def test_a_block_in_a_groove_holds_as_long_as_any_loads_can_hold_it(angle, mu, side):
    """Friction across the groove presses it against both walls: at rest its limit is 1/sqrt(1 - k^2) of that in sliding."""
    t, q, w, n = ca.SX.sym("t"), ca.SX.sym("q", 3), ca.SX.sym("w", 3), ca.SX.sym("n", 2)
    limit = mu * G / np.cos(angle)
    force, gaps, slips, multipliers = ca.vertcat(limit * t, side, -G), [], [], []
    for k, sign in enumerate((-1, 1)):
        c, s, lam = np.cos(angle), sign * np.sin(angle), ca.SX.sym(f"lam{k}", 2)
        gaps.append(ns.Impact(c * q[2] - s * q[1], reaction=n[k], name=f"wall{k}"))
        slips.append(ca.vertcat(w[0], c * w[1] + s * w[2]))
        multipliers.append(lam)
        force += n[k] * ca.vertcat(-mu * lam[0], -s - mu * c * lam[1], c - mu * s * lam[1])
    groove = ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(w)],
        field=[*ca.vertsplit(w), *ca.vertsplit(force)],
        surfaces=slips,
        multipliers=multipliers,
        impacts=gaps,
        time=t,
    )
    run = ns.simulate(groove, [0] * 6, 2.0)
    assert run.status is ns.Status.REACHED_END and run.itinerary == "sscc **cc"
    release = 1 / np.sqrt(1 - (mu * np.tan(angle)) ** 2)
    if side == 0:
        assert abs(run.events[0].t - release) < 1e-7
        speed = limit * (1 - (release - 1) ** 2) / 2
        np.testing.assert_allclose(run.x[-1, 3:], [speed, 0, 0], atol=1e-6)
