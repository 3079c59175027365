"""Gaps that cannot close: impacts, rest after an accumulation, friction at the contact, release, each at
its closed form."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, u, v, t, lam, r, q = (ca.SX.sym(s) for s in ("x", "y", "u", "v", "t", "lam", "r", "q"))
G = 9.81


def kinds(run):
    return [e.kind for e in run.events]


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_table_throws_the_ball_off_when_its_reaction_ends(restitution):
    """g = A omega^2 sin(omega t)."""
    a, omega = 0.2, 8.0
    gap = y - a * ca.sin(omega * t)
    ball = ns.FilippovSystem(
        [y, v], field=[v, -G], impacts=ns.Impact(gap, restitution=restitution), time=t
    )
    run = ns.simulate(ball, [1.0, 0.0], 5.0)
    released = [event.t for event in run.events if event.kind == "release"]
    phase = np.arcsin(G / (a * omega**2))
    turns = np.round((omega * np.array(released) - phase) / (2 * np.pi))
    assert len(released) == (5 if restitution else 6)
    np.testing.assert_allclose(released, (phase + 2 * np.pi * turns) / omega, atol=1e-11)
    heights = run(np.linspace(0.0, 5.0, 2001))[:, 0]
    assert np.min(heights - a * np.sin(omega * np.linspace(0.0, 5.0, 2001))) > -1e-9


@pytest.mark.parametrize("e", [-0.5, 1.5])
def test_a_parameter_that_is_no_restitution_is_refused(e):
    ball = ns.FilippovSystem(
        [y, v], field=[v, -G], impacts=ns.Impact(y, restitution=1 - q), parameters={q: 0.5}
    )
    with pytest.raises(ns.ParameterError, match="restitution of 'impact'"):
        ns.simulate(ball, [1.0, 0.0], 5.0, parameters={"q": 1 - e})
    run = ns.ensemble(ball, [[1.0, 0.0]] * 2, 5.0, parameters={"q": [0.5, 1 - e]})
    assert [ns.Status(s) for s in run.status] == [ns.Status.REACHED_END, ns.Status.INCONSISTENT]


def test_a_gap_without_states_is_refused():
    with pytest.raises(ns.DefinitionError, match="gap of 'impact'"):
        ns.FilippovSystem([y, v], field=[v, -G], impacts=ns.Impact(q), parameters={q: 1.0})


def bar(inertia, e=0.0):
    """A bar of unit mass and half length 1 over two supports, at small angles."""
    forces = [ca.SX.sym("r1"), ca.SX.sym("r2")]
    impacts = [
        ns.Impact(y - x, restitution=e, reaction=forces[0], name="left"),
        ns.Impact(y + x, restitution=e, reaction=forces[1], name="right"),
    ]
    lift, turn = forces[0] + forces[1] - G, (forces[1] - forces[0]) / inertia
    return ns.FilippovSystem([x, y, u, v], field=[u, v, turn, lift], impacts=impacts)


@pytest.mark.parametrize("inertia", [0.5, 2.0])
def test_one_end_rests_while_the_other_strikes(inertia):
    """The end at rest is struck too if it would be pressed down (I < m l^2), else it lifts off."""
    start = [0.3, 0.3, 0.0, 0.0]  # left end down, right end up
    run = ns.simulate(bar(inertia), start, 2.0)
    strike = next(event for event in run.events if event.kind == "impact")
    rate = strike.x[3] + strike.x[2]  # of the right end, before
    after = strike.x_after[3] - strike.x_after[2]  # of the left end
    coupling = (1 - 1 / inertia) / (1 + 1 / inertia)
    assert abs(strike.x_after[3] + strike.x_after[2]) < 1e-12 and rate < 0
    assert abs(after - max(-coupling * rate, 0.0)) < 1e-11
    assert np.all(
        run(np.linspace(0, 2, 400))[:, 1] - abs(run(np.linspace(0, 2, 400))[:, 0]) > -1e-9
    )


def test_an_oscillator_chatters_to_rest_at_its_wall_and_leaves_when_the_force_ends():
    """x'' = -x + A cos(omega t) before the wall x = s: it leaves where A cos(omega t) = s."""
    force, omega, wall = 3.0, 0.3, 0.5
    system = ns.FilippovSystem(
        [x, v],
        field=[v, -x - 0.1 * v + force * ca.cos(omega * t)],
        impacts=ns.Impact(wall - x, restitution=0.6),
        time=t,
    )
    run = ns.simulate(system, [0.0, 0.0], 45.0)
    left = [event.t for event in run.events if event.kind == "release"]
    assert len(left) == 2
    expected = (np.arccos(wall / force) + 2 * np.pi * np.arange(2)) / omega
    np.testing.assert_allclose(left, expected, atol=1e-10)
    assert run(np.linspace(0, 45, 3000))[:, 0].max() < wall + 1e-9


def test_wrong_impacts_are_refused():
    with pytest.raises(ns.DefinitionError, match="restitution of 'impact'"):
        ns.FilippovSystem([y, v], field=[v, -G], impacts=ns.Impact(y, restitution=1.5))
    with pytest.raises(ns.DefinitionError, match="positions"):
        ns.FilippovSystem([y, v], field=[v, r - G], impacts=ns.Impact(v, reaction=r))
    with pytest.raises(ns.DefinitionError, match="reaction of 'impact'"):
        ns.FilippovSystem([y, v, x], field=[v, -G, r], impacts=ns.Impact(y, reaction=r))
    with pytest.raises(ns.DefinitionError, match="impacts"):
        ns.FilippovSystem([y, v], field=[v, -G], impacts=[ns.Stop(y)])


def test_a_curved_wall_pushes_along_its_normal():
    """Without reaction=: a bead that rests in a parabola, and one that oscillates at the inside of a circle
    as a pendulum does, energy kept."""
    bowl = ns.FilippovSystem([x, y, u, v], field=[u, v, 0, -G], impacts=ns.Impact(y - x**2))
    run = ns.simulate(bowl, [0.1, 0.01, 0.0, 0.0], 3.0)
    assert run.itinerary == "c" and abs(run.x[-1, 1] - run.x[-1, 0] ** 2) < 1e-12
    energy = (run.x[:, 2] ** 2 + run.x[:, 3] ** 2) / 2 + G * run.x[:, 1]
    np.testing.assert_allclose(energy, energy[0], atol=1e-9)
    ring = ns.FilippovSystem([x, y, u, v], field=[u, v, 0, -G], impacts=ns.Impact(1 - x**2 - y**2))
    swing = ns.simulate(ring, [0.1, -((1 - 0.01) ** 0.5), 0.0, 0.0], 4.0)
    pendulum = ns.simulate(
        ns.FilippovSystem([q, v], field=[v, -G * ca.sin(q)]), [np.arcsin(0.1), 0.0], 4.0
    )
    assert swing.itinerary == "c" and abs(swing.x[-1, 0] - np.sin(pendulum.x[-1, 0])) < 1e-8


def test_a_reaction_whose_direction_cannot_be_seen_is_requested():
    """A point that moves at speed v in the direction q before a wall: the gap's rate is v cos q."""
    with pytest.raises(ns.DefinitionError, match="reaction of 'impact'"):
        ns.FilippovSystem([x, q, v], field=[v * ca.cos(q), 1, 0], impacts=ns.Impact(1 - x))


def pile(count, e, mu=0.4):
    """Blocks on each other on the floor, with friction at every contact; masses 1, 2, ..."""
    q, v, u, n, lam = (ca.SX.sym(name, count) for name in ("q", "v", "u", "n", "lam"))
    fall, push, slips, impacts = [-9.81] * count, [0] * count, [], []
    for i in range(count):
        fall[i] += n[i] / (i + 1)
        push[i] -= mu * lam[i] * n[i] / (i + 1)
        below, slip = 0, u[i]
        if i:
            fall[i - 1] -= n[i] / i
            push[i - 1] += mu * lam[i] * n[i] / i
            below, slip = q[i - 1] + 0.5, u[i] - u[i - 1]
        slips.append(slip)
        impacts.append(ns.Impact(q[i] - below, e, reaction=n[i], name=f"contact {i}"))
    states = [*ca.vertsplit(q), *ca.vertsplit(v), *ca.vertsplit(u)]
    field = [*ca.vertsplit(v), *fall, *push]
    multipliers = ca.vertsplit(lam)
    return ns.FilippovSystem(
        states, field=field, surfaces=slips, multipliers=multipliers, impacts=impacts
    )


@pytest.mark.parametrize("e", [0.0, 0.4])
def test_a_pile_of_three_falls_and_comes_to_rest(e):
    """The momentum of the slips goes into the floor; at rest, one on the other, all stick."""
    system = pile(3, e)
    start = [0.2, 0.9, 1.7, 0.0, 0.0, 0.0, 0.3, -0.2, 0.1]
    run = ns.simulate(system, start, 4.0)
    assert run.status is ns.Status.REACHED_END, run.message
    assert run.itinerary.endswith("sssccc")
    np.testing.assert_allclose(run.x[-1, :3], [0.0, 0.5, 1.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.x[-1, 3:], 0.0, rtol=0, atol=1e-12)


def test_a_neighbour_is_not_behind_by_the_error_of_a_root():
    """While one gap chatters the others are reached within the tolerance, from all sides."""
    system = pile(2, 0.5)
    for k in range(6):
        start = [0.1 + 0.07 * k, 0.75 + 0.05 * k, 0.1 * k, -0.3 * k, 0.3 * k, -0.2]
        run = ns.simulate(system, start, 3.0, tol=1e-8)
        assert run.status is ns.Status.REACHED_END, run.message


@pytest.mark.parametrize("tol", [1e-8, 1e-9, 1e-10, 1e-11, 1e-12])
def test_a_plastic_impact_is_one_event(tol):
    """A jamming contact of the woodpecker stops a rate of 25, of which rounding leaves 7e-15."""
    run = ns.textbook.woodpecker().run(tol=tol)
    impacts = [(e.name, e.t) for e in run.events if e.kind == "impact"]
    assert all(one[0] != two[0] or two[1] - one[1] > 1e-6 for one, two in pairwise(impacts))
    assert [name for name, _ in impacts[:4]] == ["high", "beak", "high", "low"]
