"""Friction in space bounded by the reaction of a contact: spheres that land and roll, tables that slide, closed forms."""

import itertools

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

G = 9.81

#: A table has more unknowns than are tried one by one.
pytestmark = pytest.mark.filterwarnings("ignore::nonsmooth.flow.warn.DecisionWarning")


def sphere(mu=0.1, e=0.0, law="newton", pull=(0, 0), **others):
    """A ball of radius 1: position, height, velocities, spins in the units of the slip; inertia 2/5."""
    x = [ca.SX.sym(name) for name in ("x1", "x2", "y", "v1", "v2", "vy", "w1", "w2")]
    _, _, y, v1, v2, vy, w1, w2 = x
    lam, r = ca.SX.sym("lam", 2), ca.SX.sym("r")
    a, b = -mu * r * lam[0], -mu * r * lam[1]
    return ns.FilippovSystem(
        x,
        field=[v1, v2, vy, a + pull[0], b + pull[1], r - G, 2.5 * a, 2.5 * b],
        surfaces=[ca.vertcat(v1 + w1, v2 + w2)],
        multipliers=[lam],
        impacts=ns.Impact(y, reaction=r, restitution=e, law=law),
        **others,
    )


START = [0, 0, 1, 2, 0.5, 0, 1, -0.7]
#: The velocity of rolling follows from the angular momentum about the point of contact.
ROLLING = (np.array([2, 0.5]) * 2.5 - np.array([1, -0.7])) / 3.5


@pytest.mark.parametrize("law", ["newton", "moreau", "poisson"])
@pytest.mark.parametrize("mu", [0.1, 0.9])
def test_a_sphere_lands_and_rolls(law, mu):
    """A plastic impact takes mu v of the slip over 2/7, or all of it; then mu g until it rolls."""
    run = ns.simulate(sphere(mu, law=law), START, 1.0, tol=1e-11)
    fall, slip = np.sqrt(2 * G), np.array([3, -0.2])
    after = run.events[0].x_after
    left = max(0.0, 1 - 3.5 * mu * fall / np.linalg.norm(slip))
    np.testing.assert_allclose(after[3:5] + after[6:8], left * slip, atol=1e-11)
    assert run.itinerary == ("*o *c sc" if left else "*o sc")
    if left:
        roll = np.sqrt(2 / G) + left * np.linalg.norm(slip) / (3.5 * mu * G)
        assert abs(run.events[1].t - roll) < 1e-11
    np.testing.assert_allclose(run.x[-1, 3:5], ROLLING, atol=1e-11)
    np.testing.assert_allclose(run.x[-1, 6:8], -ROLLING, atol=1e-11)


@pytest.mark.parametrize("e", [0.5, 0.8])
def test_a_sphere_bounces_until_it_rolls(e):
    run = ns.simulate(sphere(e=e), START, 8.0)
    assert run.status is ns.Status.REACHED_END and run.itinerary.endswith("sc")
    rest = np.sqrt(2 / G) * (1 + e) / (1 - e)
    assert abs(run.events[-2].t - rest) < 1e-9 and run.events[-2].kind == "contact"
    np.testing.assert_allclose(run.x[-1, 3:5], ROLLING, atol=1e-9)


@pytest.mark.parametrize("start", [[0, 0, 1, 2, 0.5, 0, -2, -0.5], [0, 0, 1, 0, 0, 0, 0, 0]])
def test_a_sphere_without_slip_in_the_air_lands_without_slip(start):
    run = ns.simulate(sphere(), start, 1.0)
    assert run.itinerary == "*o sc"
    np.testing.assert_allclose(run.x[-1, 3:5], start[3:5], atol=1e-13)


def test_a_sphere_that_is_pulled_rolls_and_then_slips():
    """Rolling needs 2/7 of the pull; it slips where that is mu g."""
    t = ca.SX.sym("t")
    pull = 2 * t
    run = ns.simulate(sphere(0.1, pull=(0.6 * pull, 0.8 * pull), time=t), [0] * 8, 2.5, tol=1e-11)
    slips = 3.5 * 0.1 * G / 2
    assert run.itinerary == "sc *c"
    assert abs(run.events[0].t - slips) < 1e-11
    speed = 5 / 7 * slips**2 + (2.5**2 - slips**2) - 0.1 * G * (2.5 - slips)
    np.testing.assert_allclose(run.x[-1, 3:5], [0.6 * speed, 0.8 * speed], atol=1e-10)


def test_a_sphere_is_lifted_off_while_it_slips():
    """The floor rises as sin t and falls away where its acceleration is -g."""
    t, y, v, r = (ca.SX.sym(name) for name in "tyvr")
    u, both = ca.SX.sym("u", 2), ca.SX.sym("both", 2)
    system = ns.FilippovSystem(
        [y, v, u[0], u[1]],
        field=[v, r - G, -0.1 * r * both[0], -0.1 * r * both[1]],
        surfaces=[u],
        multipliers=[both],
        impacts=ns.Impact(y - 20 * ca.sin(t), reaction=r),
        time=t,
    )
    run = ns.simulate(system, [0, 20, 3, 4], 0.8, tol=1e-11)
    leaves = np.arcsin(G / 20)
    assert run.itinerary == "*c *o" and abs(run.events[0].t - leaves) < 1e-11
    lost = 0.1 * (20 * (np.cos(leaves) - 1) + G * leaves)
    np.testing.assert_allclose(run.x[-1, 2:], (1 - lost / 5) * np.array([3, 4]), atol=1e-11)


def table(mu, feet, height=0.4, inertia=(0.1, 0.15, 0.2), e=0.0, pull=(0, 0), **others):
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
        gaps.append(ns.Impact(gap, reaction=r[i], restitution=e, name=f"foot{i}"))
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
    ("feet", "mu"),
    [(THREE, 0.3), (FOUR, 0.3), pytest.param(FOUR, 1.2, marks=pytest.mark.slow)],
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


def corner(mu, e=0.0, law="newton"):
    """A particle between a floor and a wall that presses with 1, with friction at both."""
    x, y, z, u, v, w, r, s = (ca.SX.sym(name) for name in "xyzuvwrs")
    floor, wall = ca.SX.sym("floor", 2), ca.SX.sym("wall", 2)
    along = -mu * r * floor[1] - mu * s * wall[0]
    return ns.FilippovSystem(
        [x, y, z, u, v, w],
        field=[u, v, w, s - mu * r * floor[0] - 1, along, r - mu * s * wall[1] - G],
        surfaces=[ca.vertcat(u, v), ca.vertcat(v, w)],
        multipliers=[floor, wall],
        impacts=[
            ns.Impact(z, reaction=r, restitution=e, name="floor", law=law),
            ns.Impact(x, reaction=s, restitution=e, name="wall", law=law),
        ],
    )


def test_a_particle_slides_along_an_edge_and_stops():
    run = ns.simulate(corner(0.2), [0, 0, 0, 0, 2.0, 0], 2.0)
    stop = 2.0 / (0.2 * (G + 1))
    assert run.itinerary == "**cc sscc" and abs(run.events[0].t - stop) < 1e-11
    np.testing.assert_allclose(run.x[-1], [0, stop, 0, 0, 0, 0], atol=1e-11)


@pytest.mark.parametrize("law", ["newton", "moreau", "poisson"])
def test_a_particle_falls_into_an_edge(law):
    run = ns.simulate(corner(0.2, law=law), [0.5, 0, 0.5, -1, 2, 0], 5.0)
    assert run.status is ns.Status.REACHED_END, run.message
    assert run.itinerary.endswith("sscc") or run.itinerary.endswith("s*co")
    np.testing.assert_allclose(run.x[-1, 3:], 0.0, atol=1e-12)


def test_a_particle_on_a_rod_slides_round_and_stops():
    """A joint beside friction in space: the speed falls at mu g."""
    x, y, z, u, v, w, r, f = (ca.SX.sym(name) for name in "xyzuvwrf")
    lam = ca.SX.sym("lam", 2)
    system = ns.FilippovSystem(
        [x, y, z, u, v, w],
        field=[u, v, w, f * x - 0.2 * r * lam[0], f * y - 0.2 * r * lam[1], r - G],
        surfaces=[ca.vertcat(u, v)],
        multipliers=[lam],
        impacts=ns.Impact(z, reaction=r),
        constraints=ns.Constraint((x**2 + y**2 - 1) / 2, reaction=f),
    )
    run = ns.simulate(system, [1, 0, 0, 0, 3.0, 0], 3.0, tol=1e-11)
    turned = 3.0**2 / (0.4 * G)
    assert run.itinerary == "*sc ssc" and abs(run.events[0].t - 3.0 / (0.2 * G)) < 1e-11
    np.testing.assert_allclose(run.x[-1, :2], [np.cos(turned), np.sin(turned)], atol=1e-11)


def test_what_is_not_determined_is_said():
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
