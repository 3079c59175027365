"""Friction in space bounded by the reaction of a contact: spheres that land and roll, tables that slide, closed forms."""

import itertools

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq, minimize

import nonsmooth as ns

G = 9.81

#: A table has more unknowns than are tried one by one.
pytestmark = pytest.mark.filterwarnings("ignore::nonsmooth.flow.warn.DecisionWarning")


def table(
    mu,
    feet,
    height=0.4,
    inertia=(0.1, 0.15, 0.2),
    e=0.0,
    pull=(0, 0),
    law="newton",
    turn=0,
    pivot=None,
    **others,
):
    """A rigid body of unit mass on feet, at small angles; it may turn on a pivot."""
    q, w, r = ca.SX.sym("q", 6), ca.SX.sym("w", 6), ca.SX.sym("r", len(feet))
    force, gaps, slips, multipliers = ca.SX.zeros(6), [], [], []
    force[:2] += ca.vertcat(*pull)
    force[5] += turn
    joints = []
    if pivot is not None:
        p, hold = ca.vertcat(*pivot), ca.SX.sym("hold", 2)
        joints = [q[0] - p[1] * q[5], q[1] + p[0] * q[5]]
        force[:2] += hold
        force[5] += p[0] * hold[1] - p[1] * hold[0]
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
        constraints=[ns.Constraint(g, reaction=hold[i]) for i, g in enumerate(joints)],
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


@pytest.mark.parametrize("arm", [0.1, 0.3, 1.0])
@pytest.mark.parametrize("mu", [0.2, 0.6])
def test_a_tripod_that_is_pulled_beside_its_centre_turns_as_costs_least_power(mu, arm):
    """Its friction is not determined while it sticks."""
    t, rate, (x, y) = ca.SX.sym("t"), 20 * mu, np.transpose(THREE)
    system = table(mu, THREE, pull=(rate * t, 0), turn=-arm * rate * t, time=t)
    run = ns.simulate(system, [0] * 12, 0.8)
    assert run.status is ns.Status.REACHED_END and run.itinerary == "sssccc ***ccc"

    def left(t):
        loads = G / 3 + 0.4 * rate * t * x / (x @ x)
        power = lambda z: mu * loads @ np.hypot(1 + (arm - y) * z[1], z[0] + x * z[1])
        return minimize(power, [0, -0.1], method="BFGS", options={"gtol": 1e-12}).fun - rate * t

    assert abs(brentq(left, 0.05, 0.6, xtol=1e-12) - run.events[0].t) < 1e-8


@pytest.mark.parametrize(("feet", "pivot"), [(THREE, (0, 0)), (THREE, (0.1, 0.2)), (FOUR, (0, 0))])
def test_a_plate_on_a_pivot_is_turned_by_what_its_feet_leave(feet, pivot):
    """The pivot takes all of the friction but its moment."""
    t, mu = ca.SX.sym("t"), 0.3
    run = ns.simulate(table(mu, feet, 0, turn=4 * t, pivot=pivot, time=t), [0] * 12, 1.0)
    assert run.status is ns.Status.REACHED_END and len(run.events) == 2
    slips = mu * G * np.mean(np.hypot(*(np.array(feet) - pivot).T)) / 4
    assert abs(run.events[0].t - slips) < 1e-9
    speed = 2 * (1 - slips) ** 2 / (0.2 + np.dot(pivot, pivot))
    assert abs(run.x[-1, 11] - speed) < 1e-8


def test_where_feet_slip_in_many_directions_their_loads_must_be_determined():
    t = ca.SX.sym("t")
    run = ns.simulate(table(0.3, FOUR, pull=(4 * t, 0), turn=-t, time=t), [0] * 12, 1.0)
    assert run.status is ns.Status.NON_UNIQUE and run.events[-1].t > 0.5


def groove(walls, load, time=None, ends=(0.0,)):
    """A block of unit mass between two walls, each an angle and a coefficient of friction; with two ends, a rod."""
    size, count = 3 * len(ends), 2 * len(ends)
    q, w, n = ca.SX.sym("q", size), ca.SX.sym("w", size), ca.SX.sym("n", count)
    turn, spin = (q[3:], w[3:]) if size > 3 else (ca.SX.zeros(3), ca.SX.zeros(3))
    force, gaps, slips, multipliers = ca.vertcat(*load, *[0] * (size - 3)), [], [], []
    for i, (end, (k, (angle, mu))) in enumerate(itertools.product(ends, enumerate(walls))):
        c, s, lam = np.cos(angle), (2 * k - 1) * np.sin(angle), ca.SX.sym(f"lam{i}", 2)
        up, across, arm = ca.DM([0, -s, c]), ca.DM([0, c, s]), ca.DM([end, 0.3 * s, -0.3 * c])
        speed, push = (
            w[:3] + ca.cross(spin, arm),
            up - mu * (ca.DM([1, 0, 0]) * lam[0] + across * lam[1]),
        )
        gaps.append(
            ns.Impact(ca.dot(up, q[:3] + ca.cross(turn, arm)), reaction=n[i], name=f"wall{i}")
        )
        slips.append(ca.vertcat(speed[0], ca.dot(across, speed)))
        multipliers.append(lam)
        force += n[i] * ca.vertcat(push, 10 * ca.cross(arm, push))[:size]
    return ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(w)],
        field=[*ca.vertsplit(w), *ca.vertsplit(force)],
        surfaces=slips,
        multipliers=multipliers,
        impacts=gaps,
        time=time,
    )


@pytest.mark.parametrize(
    ("walls", "load", "itinerary"),
    [
        ([(1.129, 0.1), (0.266, 0.1)], (24.76, -2.55), "sscc **cc"),
        ([(0.4589, 0.1), (0.4417, 0.1)], (26.1, 0), "sscc **cc"),
        ([(0.8101, 0.1), (0.2141, 0.1)], (3.289, -1.994), "sscc **cc"),
        ([(1.002, 0.3), (0.3224, 0.3)], (3.662, 6.842), "sscc **oc"),
        ([(0.249, 0.1), (0.4172, 0.6)], (17.69, 22.72), "sscc **oc"),
        ([(0.3840, 1), (0.6044, 0.6)], (20.99, -18.26), "sscc **co"),
    ],
)
def test_a_block_in_a_groove_leaves_when_no_loads_hold_it(walls, load, itinerary):
    """Loads of the walls, and friction across, are not determined; the most that they hold is found by convex programming."""
    t = ca.SX.sym("t")
    run = ns.simulate(groove(walls, (load[0] * t, load[1] * t, -G), t), [0] * 6, 1.0)
    assert run.status is ns.Status.REACHED_END and run.itinerary == itinerary
    axes = []
    for sign, (angle, _) in zip((-1, 1), walls, strict=True):
        c, s = np.cos(angle), sign * np.sin(angle)
        axes += [(0, -s, c), (1, 0, 0), (0, c, s)]
    rows, ends = np.transpose(axes), run.events[0].t

    def room(t):
        rest = np.linalg.lstsq(rows, -np.array([load[0] * t, load[1] * t, -G]), rcond=None)[0]
        free = np.linalg.svd(rows)[2][3:]
        force = lambda z: rest + z[:3] @ free
        cones = [
            {
                "type": "ineq",
                "fun": lambda z, k=k, mu=mu: (
                    mu * force(z)[3 * k] - np.hypot(*force(z)[3 * k + 1 : 3 * k + 3]) - z[3]
                ),
            }
            for k, (_, mu) in enumerate(walls)
        ]
        return minimize(
            lambda z: -z[3],
            [*np.zeros(3), -50],
            constraints=cones,
            options={"maxiter": 100},
        ).x[3]

    assert room(0.999 * ends) > 0 > room(1.001 * ends)


@pytest.mark.parametrize("side", [0.0, 0.5])
@pytest.mark.parametrize(("angle", "mu"), [(0.7, 0.2), (0.7, 0.5), (1.0, 0.2), (1.0, 0.5)])
def test_a_block_in_a_groove_holds_as_long_as_any_loads_can_hold_it(angle, mu, side):
    """Friction across the groove presses it against both walls: at rest its limit is 1/sqrt(1 - k^2) of that in sliding."""
    t, limit = ca.SX.sym("t"), mu * G / np.cos(angle)
    run = ns.simulate(groove([(angle, mu)] * 2, (limit * t, side, -G), t), [0] * 6, 2.0)
    assert run.status is ns.Status.REACHED_END and run.itinerary == "sscc **cc"
    release = 1 / np.sqrt(1 - (mu * np.tan(angle)) ** 2)
    if side == 0:
        assert abs(run.events[0].t - release) < 1e-7
        speed = limit * (1 - (release - 1) ** 2) / 2
        np.testing.assert_allclose(run.x[-1, 3:], [speed, 0, 0], atol=1e-6)


ROD = (-0.6, 0.6)


@pytest.mark.parametrize(
    ("walls", "load", "speed", "ends", "modes"),
    [
        ([(0.6881, 1.0), (1.1232, 1.0)], (18.273, 1.576), 0.0, (0.0,), "sscc **cc"),
        ([(0.8921, 1.0), (1.0350, 0.1)], (9.861, 0.999), 0.0, (0.0,), "sscc **cc"),
        ([(1.0935, 0.6), (0.8683, 1.0)], (19.521, 0.0), -2.0, (0.0,), "sscc **cc"),
        ([(1.1, 1.0), (1.1, 1.0)], (-25.0, 2.0), 0.0, (0.0,), "sscc **cc"),
        ([(0.6881, 1.0), (1.1232, 1.0)], (18.273, 1.576), 0.0, ROD, "sscc **cc"),
        ([(0.6881, 1.0), (1.1232, 1.0)], (15.0, 1.576), 0.0, ROD, "sscc"),
        ([(0.9073, 1.0), (0.7535, 1.0)], (13.0, 7.086), 0.0, (0.0,), "sscc"),
        ([(1.1, 1.0), (1.1, 1.0)], (20.0, 2.0), 2.0, (0.0,), "sscc"),
        ([(0.3, 0.5), (0.3, 0.5)], (8.0, 0.0), 0.0, (0.0,), "**cc"),
    ],
)
def test_a_body_wedged_at_rest_may_also_slide(walls, load, speed, ends, modes):
    """A squeeze of any size holds it; in sliding friction is along the groove, and loads balance the force across."""
    (one, mu), (two, nu) = walls
    across = [[np.sin(one), -np.sin(two)], [np.cos(one), np.cos(two)]]
    friction = np.dot(np.linalg.solve(across, [-load[1], G]), [mu, nu])
    size, modes = 3 * len(ends), ["".join(c * len(ends) for c in m) for m in modes.split()]
    system = groove(walls, (*load, -G), ends=ends)
    stop = speed and -speed / (load[0] - np.sign(speed) * friction)
    run = ns.simulate(system, [*[0] * size, speed, *[0] * (size - 1)], stop + 1)
    faster, begin = load[0] - np.sign(load[0]) * friction, speed * stop / 2
    runs = {modes[0]: run}
    if len(modes) > 1:
        assert run.status is ns.Status.NON_UNIQUE and abs(run.t[-1] - stop) < 1e-9
        assert [c.mode for c in run.continuations] == modes
        runs = {m: ns.simulate(system, run.x[-1], 1.0, start_mode=m) for m in modes}
    for mode, after in runs.items():
        rate, end = faster if "*" in mode else 0.0, np.zeros(2 * size)
        end[[0, size]] = begin + rate / 2, rate
        assert after.status is ns.Status.REACHED_END and after.itinerary.split()[-1] == mode
        np.testing.assert_allclose(after.x[-1], end, atol=1e-9)
