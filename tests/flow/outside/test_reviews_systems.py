"""Systems of new users: jumps over another guard, rest, second-order sliding, roots in fields."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v, t, a, b = (ca.SX.sym(name) for name in ("x", "v", "t", "a", "b"))
REACHED = ns.Status.REACHED_END


def test_a_jump_over_another_reset_fires_it():
    first = ns.Reset(a - 1, [0, b + 0.6], direction=1, name="A")
    second = ns.Reset(b - 1, [a, 0], direction=1, name="B")
    system = ns.FilippovSystem([a, b], field=[1, 0], resets=[first, second])
    run = ns.simulate(system, [0.0, 0.0], 4.5)
    assert [e.name for e in run.events if e.kind == "reset"] == ["A", "A", "B"] * 2
    assert np.allclose(run.x[-1], [0.5, 0.0], rtol=0, atol=1e-12)


def test_a_jump_over_a_stop_stops():
    first = ns.Reset(a - 1, [0, b + 0.6], direction=1, name="A")
    stop = ns.Stop(b - 1, direction=1, name="B")
    system = ns.FilippovSystem([a, b], field=[1, 0], resets=first, stops=stop)
    run = ns.simulate(system, [0.0, 0.0], 4.5)
    assert run.status == ns.Status.STOPPED and abs(run.t[-1] - 2.0) < 1e-12
    assert np.allclose(run.x[-1], [0.0, 1.2], rtol=0, atol=1e-12)


def network(count, strength):
    potentials = [ca.SX.sym(f"v{k}") for k in range(count)]
    resets = []
    for k in range(count):
        pushed = [w + strength / count for w in potentials]
        pushed[k] = ca.SX(0)
        resets.append(ns.Reset(potentials[k] - 1, pushed, direction=1, name=f"spike{k}"))
    return ns.FilippovSystem(potentials, field=[1.2 - w for w in potentials], resets=resets)


def spikes(start, strength, t_end):
    """Exact: all potentials tend to 1.2; what a spike pushes over 1 fires next, in order of definition."""
    potential, t, fired = np.array(start), 0.0, []
    while True:
        wait = np.log((1.2 - potential) / 0.2)
        k = int(np.argmin(wait))
        if t + wait[k] > t_end:
            return 1.2 - (1.2 - potential) * np.exp(t - t_end), fired
        potential, t = 1.2 - (1.2 - potential) * np.exp(-wait[k]), t + wait[k]
        due = [k]
        while due:
            k = due.pop(0)
            under = potential < 1
            potential = potential + strength / len(potential)
            potential[k] = 0.0
            fired.append((t, f"spike{k}"))
            due = sorted({*due, *np.flatnonzero(under & (potential >= 1))})


@pytest.mark.parametrize(("count", "strength"), [(2, 0.02), (5, 0.05), (20, 0.02)])
def test_neurons_that_excite_one_another(count, strength):
    start = [0.0, 0.4] if count == 2 else np.random.default_rng(0).random(count) * 0.99
    run = ns.simulate(network(count, strength), start, 20.0)
    end, fired = spikes(start, strength, 20.0)
    assert run.status == REACHED
    assert [e.name for e in run.events if e.kind == "reset"] == [name for _, name in fired]
    assert np.allclose(run.x[-1], end, rtol=0, atol=1e-8)


def test_a_damped_relay_stays_at_rest():
    """|x| + v^2/2 does not grow."""
    relay = ns.FilippovSystem([x, v], surface=x, above=[v, -1 - v], below=[v, 1 - v])
    run = ns.simulate(relay, [0.0, 0.0], 5.0)
    assert run.status == REACHED and np.abs(run.x).max() == 0.0


def test_a_cold_rectifier_starts():
    above, below = [ca.sin(t) - v, x - v], [ca.sin(t) + v, -x - v]
    rectifier = ns.FilippovSystem([x, v], surface=x, above=above, below=below, time=t)
    run = ns.simulate(rectifier, [0.0, 0.0], 10.0)
    assert run.status == REACHED
    assert np.allclose(run.x[-1], [0.12251932, 0.54488078], rtol=0, atol=1e-7)


def test_twisting_rests_from_its_limit_on():
    l1, l2 = ca.SX.sym("l1"), ca.SX.sym("l2")
    system = ns.FilippovSystem(
        [x, v], surfaces=[x, v], multipliers=[l1, l2], field=[v, -5 * l1 - 2 * l2]
    )
    run = ns.simulate(system, [0.2, 0.0], 20.0)
    assert run.status == REACHED and np.abs(run.x[-1]).max() < 1e-10


def test_super_twisting_rests_from_its_limit_on():
    sign, size = ca.sign(x), ca.fabs(x)
    system = ns.FilippovSystem.from_expression(
        [x, v], [-1.5 * ca.sqrt(size) * sign + v, -1.1 * sign]
    )
    run = ns.simulate(system, [0.2, 0.0], 20.0)
    assert run.status == REACHED and np.abs(run.x[-1]).max() < 1e-10


def test_a_rocking_block_comes_to_rest():
    system = ns.FilippovSystem(
        [x, v],
        surface=x,
        above=[v, -4 * ca.sin(0.25 - x)],
        below=[v, -4 * ca.sin(-0.25 - x)],
        resets=ns.Reset(x, [x, 0.925 * v], name="impact"),
    )
    assert ns.simulate(system, [0.0, 0.0], 1.0).status == REACHED
    run = ns.simulate(system, [0.2, 0.0], 20.0)
    assert run.status == REACHED and np.abs(run.x[-1]).max() < 1e-9


def orifice(states, field, start, end, t_end):
    system = ns.FilippovSystem.from_expression(states, field, time=t)
    run = ns.simulate(system, start, t_end, max_steps=2000)
    assert run.status == REACHED
    assert np.allclose(run.x[-1], end, rtol=0, atol=2e-7)


def test_flow_through_an_orifice():
    """By scipy's Radau at two tolerances."""
    flow = -2 * ca.sign(x) * ca.sqrt(ca.fabs(x)) + 0.3 * ca.cos(t)
    orifice([x], [flow], [1.0], [0.00518905], 20.0)


def test_flow_between_two_pressures():
    flow = ca.sign(x - v) * ca.sqrt(ca.fabs(x - v))
    orifice([x, v], [-flow + 0.3 * ca.cos(t), flow], [1.0, 0.0], [0.63953631, 0.63434726], 20.0)


@pytest.mark.parametrize(("speed", "rests"), [(0.5, 3.0812374), (-0.5, 2.5849508)])
def test_finite_time_control_with_powers(speed, rests):
    """Bhat & Bernstein: on the surface x' = -x^(3/5), from where scipy's DOP853 reaches it."""
    power = ca.sign(v) * ca.fabs(v) ** (5 / 3)
    system = ns.FilippovSystem.from_expression(
        [x, v], [v, -ca.sign(v) * ca.fabs(v) ** (1 / 3) - 2 * ca.sign(x + power)]
    )
    run = ns.simulate(system, [1.0, speed], 4.0, max_steps=2000)
    assert run.status == REACHED and np.abs(run.x[-1]).max() < 1e-9
    assert abs(run(2.0)[0] - (0.4 * (rests - 2.0)) ** 2.5) < 1e-6
