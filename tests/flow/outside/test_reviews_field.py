"""Events by other people's tests: curved guards against closed forms, close events after Hipparchus, static
friction, problems of nosnoc, OpenModelica, SciML, ARCH-COMP and the Modelica reference units."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import nonsmooth as ns

k, x, y, u, v, w, t, h = (ca.SX.sym(name) for name in "kxyuvwth")
REACHED = ns.Status.REACHED_END
LEVELS = np.random.default_rng(3).uniform(-0.9, 0.9, 100)


def resets_of(run):
    return np.array([e.t for e in run.events if e.kind == "reset"])


GUARDS = {
    "time": ns.FilippovSystem(
        [k],
        field=[1],
        parameters={h: 0.0},
        time=t,
        resets=ns.Reset(ca.sin(t) - h, [k + 1], direction=1),
    ),
    "state": ns.FilippovSystem(
        [x, k],
        field=[1, 0],
        parameters={h: 0.0},
        resets=ns.Reset(ca.sin(x) - h, [x, k + 1], direction=1),
    ),
    "oscillator": ns.FilippovSystem(
        [x, v, k],
        field=[v, -x, 0],
        parameters={h: 0.0},
        resets=ns.Reset(x - h, [x, v, k + 1], direction=1),
    ),
}
STARTS = {"time": [0.0], "state": [0.0, 0.0], "oscillator": [0.0, 1.0, 0.0]}


@pytest.mark.parametrize("guard", GUARDS)
@pytest.mark.parametrize("tol", [1e-8, 1e-10, 1e-12])
def test_a_sine_guard_is_located_where_the_arcsine_says(guard, tol):
    for level in LEVELS:
        true = np.arcsin(level) + 2 * np.pi * np.arange(-1, 5)
        true = true[(true > 1e-6) & (true < 20.0)]
        run = ns.simulate(GUARDS[guard], STARTS[guard], 20.0, parameters={"h": level}, tol=tol)
        found = resets_of(run)
        assert len(found) == len(true), level
        assert np.abs(found - true).max() < 100 * tol, level


FINE = np.linspace(0, 20.0, 400_001)
CURVED = {
    "x": (x, np.cos(FINE)),
    "sin t": (ca.sin(t), np.sin(FINE)),
    "sin 3t": (ca.sin(3 * t), np.sin(3 * FINE)),
    "x + sin 3.1t": (x + ca.sin(3.1 * t), np.cos(FINE) + np.sin(3.1 * FINE)),
    "x^3": (x**3, np.cos(FINE) ** 3),
    "xv": (x * v, -np.cos(FINE) * np.sin(FINE)),
}


def rises(values):
    return int(((values[:-1] < 0) & (values[1:] >= 0)).sum())


@pytest.mark.parametrize("name", CURVED)
@pytest.mark.parametrize("tol", [1e-6, 1e-10, 1e-13])
def test_a_reset_fires_once_a_passage(name, tol):
    guard, dense = CURVED[name]
    kick = ns.Reset(guard - h, [x, v, k + 1], direction=1, name="kick")
    system = ns.FilippovSystem(
        [x, v, k], field=[v, -x, 0], parameters={h: 0.0}, time=t, resets=kick
    )
    for level in LEVELS[:60]:
        run = ns.simulate(system, [1.0, 0.0, 0.0], 20.0, parameters={"h": level}, tol=tol)
        assert run.x[-1, 2] == rises(dense - level), level


def test_a_section_is_met_once_a_passage():
    guard, dense = CURVED["x + sin 3.1t"]
    system = ns.FilippovSystem([x, v], field=[v, -x], time=t)
    for level in LEVELS:
        at = ns.Section(guard - float(level), direction=1)
        run = ns.simulate(system, [1.0, 0.0], 20.0, at=at)
        assert len(run.sample_t) == rises(dense - level), level


@pytest.mark.parametrize("speed", [3.0, 5.0, 10.0, 30.0])
def test_the_first_impact_on_a_shaken_table(speed):
    table = ns.FilippovSystem(
        [y, v],
        field=[v, -9.81],
        impacts=ns.Impact(y - 0.1 * ca.sin(speed * t), restitution=0.8),
        time=t,
    )
    for height in (0.5, 1.0, 2.0, 5.0):
        run = ns.simulate(table, [height, 0.0], 1.3)
        grid = np.linspace(1e-9, 1.3, 200_001)

        def gap(s, height=height):
            return height - 4.905 * s * s - 0.1 * np.sin(speed * s)

        below = np.flatnonzero(gap(grid) < 0)
        true = brentq(gap, grid[below[0] - 1], grid[below[0]], xtol=1e-15)
        assert abs(next(e.t for e in run.events if e.kind == "impact") - true) < 1e-12


def at(*roots):
    return math.prod([t - root for root in roots])


#: After CloseEventsTest of Hipparchus: guards by name, end, and what is expected.
CLOSE = {
    "close": ({"a": at(5), "b": at(5.5)}, 20, [("a", 5), ("b", 5.5)]),
    "simultaneous": ({"a": at(5), "b": at(5)}, 20, [("a", 5), ("b", 5)]),
    "nearly": (
        {"a": at(9), "b": at(9 + 1e-15, 9 + 4.9)}, 20, [("a", 9), ("b", 9 + 1e-15), ("b", 9 + 4.9)]
    ),
    "fast": ({"a": at(9.9, 10.1, 12)}, 20, [("a", 9.9), ("a", 10.1), ("a", 12)]),
    "tricky": (
        {"A": at(16), "B": at(-10, 1, 15, 18), "C": at(17)},
        30,
        [("B", 1), ("B", 15), ("A", 16), ("C", 17), ("B", 18)],
    ),
    "tolerance": ({"a": at(11), "b": at(11 + 1e-5)}, 30, [("a", 11), ("b", 11 + 1e-5)]),
    "between": ({"A": at(11.1), "B": at(11, 11.2)}, 30, [("B", 11), ("A", 11.1), ("B", 11.2)]),
    "pi": (
        {"A": at(math.pi), "B": at(math.pi + 1e-12)}, 10, [("A", math.pi), ("B", math.pi + 1e-12)]
    ),
    "twenty": (
        {"A": at(*[0.5 + n for n in range(20)])}, 20, [("A", 0.5 + n) for n in range(20)]
    ),
}  # fmt: skip


@pytest.mark.parametrize("moves", [0, 1])
@pytest.mark.parametrize("case", CLOSE)
def test_close_events_of_hipparchus(case, moves):
    guards, t_end, expected = CLOSE[case]
    resets = [ns.Reset(g, [x + moves], name=name) for name, g in guards.items()]
    system = ns.FilippovSystem([x], field=[1 + 0 * t], resets=resets, time=t)
    run = ns.simulate(system, [0.0], t_end, tol=1e-12)
    found = [(e.name, e.t) for e in run.events if e.kind == "reset"]
    assert [name for name, _ in found] == [name for name, _ in expected]
    error = np.abs([one[1] - other[1] for one, other in zip(found, expected, strict=True)])
    # twenty roots: a product known to rounding, so ill-conditioned as Wilkinson's
    assert error.max() < (1e-9 if case == "twenty" else 1e-12)


@pytest.mark.slow
def test_static_friction_above_kinetic():
    """Break-aways of x'' + 0.1 x' + x = 1.3 cos(0.3 t) - friction, by an event loop with scipy's DOP853."""
    z, speed, push, static, t_end = 0.05, 0.3, 1.3, 1.1, 200.0
    hump = brentq(lambda c: (2 / 3) * (1 + c) ** 1.5 / math.sqrt(3 * c) - static, 0.5, 5)
    law = w * (1 + hump * (1 - w**2))
    system = ns.FilippovSystem(
        [x, v],
        surface=v,
        multipliers=w,
        field=[v, -2 * z * v - x + push * ca.cos(speed * t) - law],
        time=t,
        hidden=True,
    )
    run = ns.simulate(system, [0.0, 1.0], t_end, tol=1e-11)
    found = [e.t for e in run.events if e.kind == "exit"]
    now, state, sign, true = 0.0, np.array([0.0, 1.0]), 1, []
    while True:

        def force(s, state=state):
            return -state[0] + push * np.cos(speed * s)

        def stopped(s, q):
            return q[1]

        stopped.terminal, stopped.direction = True, -sign
        leg = solve_ivp(
            lambda s, q, sign=sign: [q[1], -2 * z * q[1] + force(s, q) - sign],
            (now, t_end), state, events=stopped, rtol=1e-12, atol=1e-13, method="DOP853", max_step=0.5,
        )  # fmt: skip
        now, state = leg.t[-1], leg.y[:, -1].copy()
        if leg.status != 1:
            break
        state[1] = 0.0
        if abs(force(now, state)) > static:
            sign = int(np.sign(force(now, state)))
            continue
        grid = np.linspace(now, now + 2 * math.pi / speed, 200_001)
        over = np.flatnonzero(np.abs(force(grid, state)) > static)
        if not over.size or grid[over[0]] > t_end:
            break
        now = brentq(
            lambda s, state=state: abs(force(s, state)) - static,
            grid[over[0] - 1], grid[over[0]], xtol=1e-14,
        )  # fmt: skip
        sign = int(np.sign(force(now, state)))
        true.append(now)
    assert run.status == REACHED and len(found) == len(true) == 19
    assert np.abs(np.array(found) - true).max() < 1e-10


def test_a_chain_of_two_resets():
    """At t = 1 the first pushes y over 1, and the second takes it to -3 at the same instant."""
    a = ns.Reset(x - 1, [0, y + 2], direction=1, name="A")
    b = ns.Reset(y - 1, [x, y - 5], direction=1, name="B")
    run = ns.simulate(ns.FilippovSystem([x, y], field=[1, 0], resets=[a, b]), [0.0, 0.0], 2.5)
    assert [e.name for e in run.events if e.kind == "reset"] == ["A", "B", "A"]
    assert np.allclose(run.x[-1], [0.5, -1.0], rtol=0, atol=1e-12)


def test_a_map_with_a_condition_and_a_guard_that_is_a_minimum():
    chosen = ns.Reset(x - 1, [0, y + ca.if_else(y > 0.5, -1, 1)], direction=1)
    run = ns.simulate(ns.FilippovSystem([x, y], field=[1, 0], resets=chosen), [0.0, 0.0], 3.5)
    assert run.x[-1].round(12).tolist() == [0.5, 1.0]
    both = ns.Reset(ca.fmin(x - 1, y - 2), [0, 0], direction=1)
    run = ns.simulate(ns.FilippovSystem([x, y], field=[1, 1], resets=both), [0.0, 0.5], 3.0)
    assert run.x[-1].round(12).tolist() == [1.5, 1.5]  # both hold from t = 1.5 on


def test_values_of_the_trigger():
    """SBML case 01330: x := 7 and y := x at one instant, with the values from before both."""
    first = ns.Reset(w - 1, [w, 7, y], direction=1, priority=10, values="trigger")
    second = ns.Reset(w - 1, [w, x, x], direction=1, values="trigger")
    system = ns.FilippovSystem([w, x, y], field=[1, 0, 0], resets=[second, first])
    assert ns.simulate(system, [0.0, 3.0, 0.0], 2.0).x[-1, 2] == 3.0


def test_oscillator_of_nosnoc():
    c, turn = x**2 + y**2 - 1, 2 * math.pi
    above, below = [x + turn * y, y - turn * x], [x - turn * y, y + turn * x]
    run = ns.simulate(
        ns.FilippovSystem([x, y], surface=c, above=above, below=below),
        [math.exp(-1), 0], math.pi / 2, tol=1e-12,
    )  # fmt: skip
    late = math.pi / 2 - 1
    end = math.exp(late) * np.array([math.cos(turn * late), -math.sin(turn * late)])
    assert np.abs(run.x[-1] - end).max() < 1e-11 and abs(run.events[0].t - 1) < 1e-11


def test_two_balls_and_a_spring_of_nosnoc():
    q1, q2, v1, v2 = (ca.SX.sym(name) for name in ("q1", "q2", "v1", "v2"))
    spring = 1e4 * (q2 - q1 - 1)
    system = ns.FilippovSystem(
        [q1, q2, v1, v2],
        field=[v1, v2, -9.81 + spring, -9.81 - spring],
        impacts=ns.Impact(q1 - 0.2, restitution=0.8),
    )
    run = ns.simulate(system, [1, 2, 0, 0], 1.0, tol=1e-12)
    end = [0.24684189, 1.22821031, -2.37983952, -3.11409239]
    assert np.abs(run.x[-1] - end).max() < 1e-7
    found = [e.t for e in run.events if e.kind == "impact"][:2]
    assert np.abs(np.array(found) - [0.403855021877, 0.423316968815]).max() < 1e-11


def test_two_states_that_slide_after_openmodelica():
    system = ns.FilippovSystem([x, y], surface=x - y, above=[-2, 1.5], below=[2, -3])
    run = ns.simulate(system, [1.5, 1.0], 1.0)
    assert run.itinerary == "+ s" and np.abs(run.x[-1] - 0.911764705882353).max() < 1e-12


def test_four_states_of_sciml():
    """A ball that keeps nine tenths of its speed at the floor and at two walls."""
    resets = [
        ns.Reset(y, [y, -0.9 * v, x, w], direction=-1, name="floor"),
        ns.Reset((10 - x) * x, [y, v, x, -0.9 * w], direction=-1, name="wall"),
    ]
    system = ns.FilippovSystem([y, v, x, w], field=[v, -9.8, w, 0], resets=resets)
    run = ns.simulate(system, [50.0, 0, 0, 2.0], 15.0)
    found = [(e.name, e.t) for e in run.events if e.kind == "reset"]
    assert [name for name, _ in found] == ["floor", "wall", "floor", "wall", "floor"]
    true = [3.194383, 5.0, 8.944272, 10.555556, 14.119172]
    assert np.abs(np.array([s for _, s in found]) - true).max() < 1e-6


LOTKA_VOLTERRA = {
    1.288: [0.795135972457, 0.868361678496, 2.548411510238, 2.938611321785],
    1.294: [2.571130527179, 2.921499113764],
    1.3: [2.594568518212, 2.903489661304],
    1.306: [2.619317781051, 2.884009279465],
    1.312: [2.646456229229, 2.861996018771],
}


@pytest.mark.parametrize("start", LOTKA_VOLTERRA)
def test_lotka_volterra_of_arch_comp(start):
    circle = (x - 1) ** 2 + (y - 1) ** 2 - 0.161**2
    field = [3 * x - 3 * x * y, x * y - y]
    system = ns.FilippovSystem([x, y, k], surface=circle, above=[*field, 0], below=[*field, 1])
    run = ns.simulate(system, [start, 1.0, 0.0], 3.64, tol=1e-13)
    found = [e.t for e in run.events if e.kind == "crossing"]
    assert len(found) == len(LOTKA_VOLTERRA[start])
    assert np.abs(np.array(found) - LOTKA_VOLTERRA[start]).max() < 1e-10


def test_bouncing_ball_of_the_reference_units():
    system = ns.FilippovSystem([y, v], field=[v, -9.81], impacts=ns.Impact(y, restitution=0.7))
    run = ns.simulate(system, [1.0, 0.0], 3.0, tol=1e-12)
    rest = next(e.t for e in run.events if e.kind == "contact")
    assert abs(run.events[0].t - 0.451523640986) < 1e-12
    assert abs(rest - math.sqrt(2 / 9.81) * (1 + 2 * 0.7 / 0.3)) < 1e-12
