"""Derivatives of runs with friction in the plane: closed forms of a block, central differences of a bounce, lost
directions at a hit, and corners."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.differences import require
from tests.flow import plane_friction as plane

TURF = {"mu": 0.3, "d1": 0.1, "d2": 0.1, "eta": 0.5, "G": 1e-4, "k": 0.4}


def block():
    """A block on an incline."""
    x, v, (a, c) = plane.columns("x1", "x2"), plane.columns("v1", "v2"), plane.columns("a", "c")
    lam = ca.vertcat(*plane.columns("l1", "l2"))
    return ns.FilippovSystem(
        [*x, *v],
        field=[*v, a - c * lam[0], -c * lam[1]],
        surfaces=[ca.vertcat(*v)],
        multipliers=[lam],
        parameters={a: 0.3, c: 0.5},
    )


def test_a_block_on_an_incline_in_closed_form():
    start, v1, v2 = [0.0, 0.0, 0.3, 0.4], ca.SX.sym("v1"), ca.SX.sym("v2")
    a, c = ca.SX.sym("a"), ca.SX.sym("c")
    r = ca.sqrt(v1**2 + v2**2)
    stop = (c * r + a * v1) / (c**2 - a**2)
    along = (c * r * v1 + a * v1**2 + a * v2**2 / 2) / (2 * (c**2 - a**2))
    across = (2 * c * r * v2 + a * v1 * v2) / (4 * c**2 - a**2)
    known = ca.Function(
        "known",
        [v1, v2, a, c],
        [ca.jacobian(ca.vertcat(along, across, stop), ca.vertcat(v1, v2, a, c))],
    )
    expected = np.array(known(0.3, 0.4, 0.3, 0.5))
    run = ns.simulate(block(), start, 4.0, tol=1e-13)
    found = ns.sensitivity(run)
    assert found.dx_dx0[:2, 2:] == pytest.approx(expected[:2, :2], abs=1e-10)
    assert found.dx_dp[:2] == pytest.approx(expected[:2, 2:], abs=1e-10)
    assert found.dt_dx0[0, 2:] == pytest.approx(expected[2, :2], abs=1e-10)
    assert found.dt_dp[0] == pytest.approx(expected[2, 2:], abs=1e-9)
    assert found.dx_dx0[:2, :2] == pytest.approx(np.eye(2), abs=1e-14)
    assert np.abs(found.dx_dx0[2:]).max() < 1e-14  # it rests, from wherever it came
    assert found.event_times == pytest.approx([run.events[0].t]) and found.names == ("a", "c")
    assert repr(found) == "Sensitivity(4 states, parameters a, c, 1 events)"


@pytest.mark.parametrize(
    ("start", "itinerary"),
    [
        pytest.param((1.0, 0.2, 0.3, 0.5), "* s *", marks=pytest.mark.slow),
        ((2.0, 0.2, -0.3, 1.5), "*"),
        ((0.4, 0.1, -0.4, -0.1), "s *"),
    ],
)
def test_a_bounce_against_differences(start, itinerary):
    # a start on the set is left by most neighbours: only the direction along it is compared
    along = {} if itinerary[0] == "*" else {"directions": np.array([[0, 0, 1, 0, -1, *[0] * 9]])}
    start = [0.0, 0.0, *start, 0.0, -1.0]
    require(plane.ball(), start, 20.0, itinerary, parameters=TURF, within=1e-9, **along)


def test_friction_that_a_parameter_may_bring():
    """Without friction v = v0 + a t; its derivative by the friction c is minus the integral of v/|v|."""
    start, t = [0.0, 0.0, 0.3, 0.4], np.polynomial.legendre.leggauss(40)
    run = ns.simulate(block(), start, 1.0, parameters={"c": 0.0}, tol=1e-13)
    found = ns.sensitivity(run, wrt="c")
    nodes, weights = (t[0] + 1) / 2, t[1] / 2
    v = np.array([0.3 + 0.3 * nodes, np.full(40, 0.4)])
    u = v / np.linalg.norm(v, axis=0)
    assert found.dx_dp[2:, 0] == pytest.approx(-u @ weights, abs=1e-13)
    assert found.dx_dp[:2, 0] == pytest.approx(-u @ (weights * (1 - nodes)), abs=1e-13)


def test_corners_and_other_systems_are_refused():
    line = ns.simulate(plane.ball(), [0, 0, 2, 0, 1.5, 0, 0, -1], 20.0, parameters=TURF)
    assert line.itinerary == "* *"
    with pytest.raises(ns.DegenerateError, match="corner"):
        ns.sensitivity(line)
    leaving = ns.simulate(block(), [0, 0, 0, 0], 1.0, parameters={"a": 0.8})
    with pytest.raises(ns.DegenerateError, match=r"start.*sets"):
        ns.sensitivity(leaving)
    with pytest.raises(ns.DefinitionError, match="multipliers"):
        ns.orbit.saltation_matrix(block(), "*", "s", [0, 0, 0, 0])


@pytest.mark.slow
def test_gradients_are_products_of_the_derivatives():
    system = block()
    x1, x2 = (system.extended_states[i] for i in (0, 1))
    c = system.parameter_symbols[1]
    run = ns.simulate(system, [0.0, 0.0, 0.3, 0.4], 4.0, tol=1e-13)
    s, (one, two) = ns.sensitivity(run), run.x[-1, :2]
    found = ns.gradient(run, x1**2 + c * x2)
    assert found.value == pytest.approx(one**2 + 0.5 * two, abs=1e-14)
    row = np.array([2 * one, 0.5, 0.0, 0.0])
    assert found.x0 == pytest.approx(row @ s.dx_dx0, abs=1e-12)  # by steps of their own
    assert found.parameters == pytest.approx(
        {"a": row @ s.dx_dp[:, 0], "c": row @ s.dx_dp[:, 1] + two}, abs=1e-12
    )
    back = ns.vjp(run, row)
    assert back[0] == pytest.approx(row @ s.dx_dx0) and back[1] == pytest.approx(row @ s.dx_dp)


def test_the_time_of_a_hit_where_friction_depends_on_direction():
    # T(s h) = s T(h), and T falls by dt along the motion: two equations for two derivatives.
    h, lam = ca.SX.sym("h", 2), ca.SX.sym("lam", 2)
    m = np.array([[0.8, 0.25], [0.1, 1.3]])
    pull, start = np.array([0.2, -0.3]), np.array([0.7, 1.1])
    system = ns.FilippovSystem(h, field=pull - m @ lam, surfaces=[h], multipliers=[lam])
    run = ns.simulate(system, start, 5.0, tol=1e-13)
    by_start = ns.sensitivity(run).dt_dx0[0]
    hit, rate = run.events[0].t, pull - m @ start / np.linalg.norm(start)
    assert run.itinerary == "* s"
    assert by_start @ start == pytest.approx(hit, rel=1e-10)
    assert by_start @ rate == pytest.approx(-1.0, rel=1e-10)


X1, X2, V1, V2, L1, L2, L3 = plane.columns("x1", "x2", "v1", "v2", "l1", "l2", "l3")


def puck():
    """A puck slides on a floor that is rougher beyond x = 0.6 to a wall at x = 1, and back."""
    near, far, restitution = plane.columns("near", "far", "e")
    friction = near + (far - near) * (1 + L3) / 2
    return ns.FilippovSystem(
        [X1, X2, V1, V2],
        field=[V1, V2, -friction * L1, -friction * L2],
        surfaces=[ca.vertcat(V1, V2), X1 - 0.6],
        multipliers=[ca.vertcat(L1, L2), L3],
        impacts=ns.Impact(1 - X1, restitution),
        parameters={near: 0.3, far: 0.5, restitution: 0.7},
    )


def test_a_puck_that_comes_back_from_a_wall_in_closed_form():
    """It slides along straight lines, and v^2 falls by twice friction times distance."""
    v1, v2, near, far, e = unknowns = plane.columns("v1", "v2", "near", "far", "e")
    (x, y), time, v = (ca.SX(0), ca.SX(0)), ca.SX(0), (v1, v2)
    times = []
    for friction, wall, bounces in ((near, 0.6, False), (far, 1.0, True), (far, 0.6, False)):
        speed = ca.sqrt(v[0] ** 2 + v[1] ** 2)
        way = (wall - x) * speed / v[0]
        later = ca.sqrt(speed**2 - 2 * friction * way)
        time += (speed - later) / friction
        times.append(time)
        x, y, v = ca.SX(wall), y + way * v[1] / speed, [c * later / speed for c in v]
        v = (-e * v[0], v[1]) if bounces else v
    speed = ca.sqrt(v[0] ** 2 + v[1] ** 2)
    times.append(time + speed / near)
    x, y = (c + u * speed / (2 * near) for c, u in zip((x, y), v, strict=True))
    slopes = ca.jacobian(ca.vertcat(x, y, *times), ca.vertcat(*unknowns))
    known = np.array(ca.Function("known", unknowns, [slopes])(1.2, 0.5, 0.3, 0.5, 0.7))
    run = ns.simulate(puck(), [0.0, 0.0, 1.2, 0.5], 4.0, tol=1e-13)
    assert run.itinerary == "*-o *+o *-o s-o"
    found = ns.sensitivity(run)
    assert found.dx_dx0[:2, 2:] == pytest.approx(known[:2, :2], abs=1e-11)
    assert found.dx_dp[:2] == pytest.approx(known[:2, 2:], abs=1e-11)
    assert found.dt_dx0[:, 2:] == pytest.approx(known[2:, :2], abs=1e-10)
    assert found.dt_dp == pytest.approx(known[2:, 2:], abs=1e-10)
    assert np.abs(found.dx_dx0[2:]).max() < 1e-14
