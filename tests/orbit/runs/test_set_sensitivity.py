"""Derivatives of runs with friction in the plane: closed forms of a block, central differences of a bounce, lost
directions at a hit, and corners."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
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
def test_a_bounce_against_central_differences(start, itinerary):
    x0 = np.array([0.0, 0.0, *start, 0.0, -1.0])

    def end(x, p):
        run = ns.simulate(plane.ball(), x, 20.0, parameters=p, tol=1e-14)
        return np.append(run.x[-1], [e.t for e in run.events])

    def difference(f, e):
        return (8 * (f(e) - f(-e)) - (f(2 * e) - f(-2 * e))) / (12 * e)

    run = ns.simulate(plane.ball(), x0, 20.0, parameters=TURF, tol=1e-13)
    found = ns.sensitivity(run)
    assert run.itinerary == itinerary
    times = len(found.event_times)
    assert times == len(run.events)
    # A start on the set is left by most neighbours: only the direction along it is compared.
    directions = np.eye(8) if itinerary[0] == "*" else np.array([[0, 0, 1, 0, -1, 0, 0, 0.0]])
    for d in directions:
        slope = difference(lambda e, d=d: end(x0 + e * d, TURF), 1e-4)
        assert found.dx_dx0 @ d == pytest.approx(slope[:8], abs=2e-9)
        assert found.dt_dx0 @ d == pytest.approx(slope[8 : 8 + times], abs=2e-8)
        assert found.dt_end_dx0 @ d == pytest.approx(slope[-1], abs=2e-9)
    for name in ("mu", "eta", "k"):
        slope = difference(lambda e, n=name: end(x0, {**TURF, n: TURF[n] + e}), 1e-4)
        column = found.names.index(name)
        assert found.dx_dp[:, column] == pytest.approx(slope[:8], abs=5e-9)
        assert found.dt_dp[:, column] == pytest.approx(slope[8 : 8 + times], abs=5e-8)


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


def test_two_sets():
    v, w = plane.columns("v1", "v2"), plane.columns("w1", "w2")
    one, two = (ca.vertcat(*plane.columns(f"{n}1", f"{n}2")) for n in "lm")
    field = [-0.5 * one[0], -0.5 * one[1], 0.1 - 0.5 * two[0] + 0.1 * one[0], -0.5 * two[1]]
    system = ns.FilippovSystem(
        [*v, *w], field=field, surfaces=[ca.vertcat(*v), ca.vertcat(*w)], multipliers=[one, two]
    )
    start = np.array([0.6, 0.8, -0.8, 0.9])
    run = ns.simulate(system, start, 1.9, tol=1e-13)
    found = ns.sensitivity(run)
    ends = [
        ns.simulate(system, start + e, 1.9, tol=1e-14).x[-1]
        for d in 1e-4 * np.eye(4)
        for e in (d, -d)
    ]
    slope = np.array([(a - b) / 2e-4 for a, b in zip(ends[::2], ends[1::2], strict=True)]).T
    assert found.dx_dx0 == pytest.approx(slope, abs=1e-7)


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
