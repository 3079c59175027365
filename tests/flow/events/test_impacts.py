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


@pytest.mark.parametrize("e", [0.3, 0.9])
def test_a_ball_comes_to_rest_at_the_closed_form(e):
    ball = ns.FilippovSystem([y, v], field=[v, -G], impacts=ns.Impact(y, restitution=e))
    run = ns.simulate(ball, [1.0, 0.0], 30.0)
    first = (2 / G) ** 0.5
    contact = next(event for event in run.events if event.kind == "contact")
    assert run.itinerary == "o c" and run.status is ns.Status.REACHED_END
    assert abs(contact.t - first * (1 + e) / (1 - e)) < 1e-11
    assert np.all(run.x[-1] == 0.0) and abs(run.events[0].t - first) < 1e-12
    before, after = run.events[0].x[1], run.events[0].x_after[1]
    assert abs(after + e * before) < 1e-14


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
def test_a_restitution_that_only_the_run_knows_ends_it_where_it_is_improper(e):
    """Below zero the ball would be pushed through the floor, above one energy would come from nowhere."""
    ball = ns.FilippovSystem([y, v], field=[v, -G], impacts=ns.Impact(y, restitution=e + y))
    run = ns.simulate(ball, [1.0, 0.0], 5.0)
    assert run.status is ns.Status.INCONSISTENT and "restitution of 'impact'" in run.message
    assert abs(run.t[-1] - (2 / G) ** 0.5) < 1e-12


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


def test_a_start_at_rest_needs_no_accumulation():
    ball = ns.FilippovSystem([y, v], field=[v, -G], impacts=ns.Impact(y, restitution=0.9))
    run = ns.simulate(ball, [0.0, 0.0], 1.0)
    assert run.itinerary == "c" and kinds(run) == ["end"] and np.all(run.x == 0.0)


def test_a_start_that_presses_into_the_gap_is_an_impact_at_once():
    ball = ns.FilippovSystem([y, v], field=[v, -G], impacts=ns.Impact(y, restitution=0.5))
    run = ns.simulate(ball, [0.0, -2.0], 0.05)
    assert run.events[0].kind == "impact" and run.events[0].t == 0.0
    assert abs(run.x[-1, 1] - (1.0 - 0.05 * G)) < 1e-13


def test_a_pulled_body_leaves():
    """The load turns round at t = 1: reaction 1 - t."""
    body = ns.FilippovSystem([y, v], field=[v, t - 1], impacts=ns.Impact(y), time=t)
    run = ns.simulate(body, [0.0, 0.0], 3.0)
    assert run.itinerary == "c o" and kinds(run) == ["release", "end"]
    assert abs(run.events[0].t - 1.0) < 1e-12
    assert abs(run.x[-1, 0] - 2.0**3 / 6) < 1e-10


def test_a_start_behind_the_constraint_is_refused():
    ball = ns.FilippovSystem([y, v], field=[v, -G], impacts=ns.Impact(y, name="floor"))
    run = ns.simulate(ball, [-0.1, 0.0], 1.0)
    assert run.status is ns.Status.INCONSISTENT and "'floor' is negative" in run.message


def block(mu, e=0.0):
    """A point mass on the ground y = 0, with Coulomb friction at the contact."""
    return ns.FilippovSystem(
        [x, y, u, v],
        field=[u, v, -mu * lam * r, r - G],
        surface=u,
        multipliers=lam,
        impacts=ns.Impact(y, restitution=e, reaction=r),
    )


def test_friction_lives_on_the_contact():
    """It slides to rest after u^2/(2 mu g), and sticks."""
    run = ns.simulate(block(0.3), [0.0, 0.0, 2.0, 0.0], 3.0)
    assert run.itinerary == "+c sc"
    assert abs(run.events[0].t - 2.0 / (0.3 * G)) < 1e-12
    np.testing.assert_allclose(run.x[-1], [2.0**2 / (2 * 0.3 * G), 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("speed", "slips"), [(5.0, True), (0.5, False), (-5.0, True)])
def test_an_oblique_impact_takes_friction_with_it(speed, slips):
    """Slip is reduced by mu (1 + e) |v|, or stopped within the impact."""
    mu, e, fall = 0.3, 0.5, -2.0
    run = ns.simulate(block(mu, e), [0.0, 0.0, speed, fall], 0.01)
    after = run.events[0].x_after
    stop = mu * (1 + e) * abs(fall)
    expected = speed - np.sign(speed) * stop if slips else 0.0
    np.testing.assert_allclose(after, [0.0, 0.0, expected, -e * fall], atol=1e-13)


def test_in_the_air_friction_does_nothing():
    run = ns.simulate(block(0.3, 0.5), [0.0, 1.0, 1.0, 0.0], 0.4)
    assert run.itinerary == "+o" and run.x[-1, 2] == 1.0


def test_a_body_without_slip_falls_and_stays():
    """u = 0 all the time: the surface is never left, in the air nor on the ground."""
    run = ns.simulate(block(0.3, 0.5), [0.0, 1.0, 0.0, 0.0], 5.0)
    assert run.status is ns.Status.REACHED_END
    np.testing.assert_allclose(run.x[-1], 0.0, atol=1e-12)
    assert run.itinerary.split()[-1][1] == "c"


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


def test_both_ends_strike_at_once():
    run = ns.simulate(bar(1.5), [0.0, 1.0, 0.0, 0.0], 2.0)
    assert run.itinerary == "oo cc" and np.all(np.abs(run.x[-1]) < 1e-12)


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


def test_a_reaction_whose_direction_cannot_be_seen_is_asked_for():
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
    """While one gap chatters the others are met within the tolerance, from all sides."""
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
