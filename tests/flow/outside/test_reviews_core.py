"""Systems that are not generic, with answers in closed form: exits from intersections, passages that once
counted twice, accumulating impacts, loss of stability of sliding, nearly parallel surfaces, time, many parts."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, u, v, w, z, t = (ca.SX.sym(name) for name in "xyuvwzt")
l1, l2, l3 = (ca.SX.sym(f"l{i}") for i in (1, 2, 3))
REACHED, STOPPED = ns.Status.REACHED_END, ns.Status.STOPPED


def exits(weight):
    """Slides on x = y = 0 until z = 0; of the four fields only that of -+ leaves to its own side then."""
    first = -(l1 + 1 + z) + weight * (l2 + 0.5)
    second = 1.5 * (l1 + 1 + z) + 0.1 * (l2 + 0.5)
    return ns.FilippovSystem(
        [x, y, z], field=[first, second, 1], surfaces=[x, y], multipliers=[l1, l2]
    )


@pytest.mark.parametrize(
    ("weight", "end"), [(z - 0.6, [-0.3875, 0.2625]), (-0.6, [-0.575, 0.2625])], ids=["z", "fixed"]
)
def test_exit_from_an_intersection_takes_the_side_whose_field_leaves(weight, end):
    run = ns.simulate(exits(weight), [0, 0, -0.5], 1.0)
    assert (run.status, run.itinerary) == (REACHED, "ss -+")
    assert np.allclose(run.x[-1, :2], end, rtol=0, atol=1e-9)


@pytest.mark.parametrize("level", [0.999, 0.99999])
def test_a_passage_of_a_curved_guard_is_one_reset(level):
    jump = ns.Reset(ca.sin(x) - level, [x, y + 1], direction=1)
    run = ns.simulate(ns.FilippovSystem([x, y], field=[1, 0], resets=jump), [0, 0], 20.0)
    assert run.x[-1, 1] == 3


@pytest.mark.parametrize("tol", [1e-6, 1e-8, 1e-10])
def test_returns_to_a_curved_section_are_counted_once(tol):
    """The 40th return by scipy's DOP853 with steps of at most 0.1 is at 151.5334."""
    pendulum = ns.FilippovSystem([x, v], field=[v, -1.3 * ca.sin(x) + 0.1 * (1 - x * x) * v])
    section = ca.sin(1.1 * x + 0.7 * v) - 0.9
    points = ns.orbit.poincare(pendulum, section, [1.0, 0.5], count=40, tol=tol)
    assert np.diff(points.t).min() > 1e-3
    assert abs(points.t[-1] - 151.5334) < 1e-3


GRAVITY, RESTITUTION = 9.81, 0.8
LIMIT = math.sqrt(2 / GRAVITY) * (1 + 2 * RESTITUTION / (1 - RESTITUTION))


def ball(**events):
    impact = ns.Impact(y, restitution=RESTITUTION)
    return ns.FilippovSystem([y, v, x], field=[v, -GRAVITY, 1], impacts=impact, **events)


def test_a_run_that_ends_before_impacts_accumulate_ends_at_t_end():
    run = ns.simulate(ball(), [1, 0, 0], LIMIT - 3e-6)
    assert run.status == REACHED and run.t[-1] == LIMIT - 3e-6


def test_a_stop_before_the_limit_of_impacts_stops():
    run = ns.simulate(ball(stops=ns.Stop(x - (LIMIT - 1e-6))), [1, 0, 0], LIMIT + 1)
    assert run.status == STOPPED and abs(run.t[-1] - LIMIT + 1e-6) < 1e-9


def test_a_kick_before_the_limit_of_impacts_kicks():
    kick = ns.Reset(x - (LIMIT - 1e-6), [y, v + 5, x], direction=1)
    run = ns.simulate(ball(resets=kick), [1, 0, 0], LIMIT + 0.5)
    assert abs(run.x[-1, 0] - (2.5 - GRAVITY / 8)) < 2e-5  # speeds there are up to 1e-5


@pytest.mark.parametrize("kick", [1, 100, 1000])
def test_the_last_impacts_do_not_depend_on_the_age_of_a_run(kick):
    clock = ns.Clock(20.0, map=[y, v + 5.0])
    system = ns.FilippovSystem(
        [y, v],
        field=[v, -GRAVITY],
        impacts=ns.Impact(y, restitution=RESTITUTION),
        clocks=clock,
    )
    began = 20.0 * (kick - 1)  # the ball rests there: every kick is as the first
    run = ns.simulate(system, [0, 0, 0], 20.0 * kick + 19, max_events=10**6)
    impacts = [e.t for e in run.events if e.kind == "impact" and e.t > began + 20.0]
    closed = [e.t for e in run.events if e.kind == "contact"][-1]
    at, speed, last = impacts[-1] + 0.3 * (closed - impacts[-1]), 5.0, 20.0 * kick
    while last + 2 * speed / GRAVITY <= at:
        last, speed = last + 2 * speed / GRAVITY, speed * RESTITUTION
    assert abs(run(at)[1] - (speed - GRAVITY * (at - last))) < 2e-5
    assert abs(closed - 20.0 * kick - 2 * 5.0 / GRAVITY / (1 - RESTITUTION)) < 1e-9


def losing_stability(start, **options):
    field = [0.2 - (l1 - 3 * l2), 0.1 - (3 * l1 - z * l2), 1]
    system = ns.FilippovSystem([x, y, z], field=field, surfaces=[x, y], multipliers=[l1, l2])
    return ns.simulate(system, [0, 0, start], 3.0, **options)


def test_sliding_on_two_surfaces_ends_where_the_layer_loses_stability():
    """Its trace vanishes at z = 1."""
    for start in np.random.default_rng(1).uniform(-1, 0.9, 20):
        run = losing_stability(start)
        assert run.status == ns.Status.INTERSECTION and abs(run.t[-1] + start - 1) < 1e-9
    assert losing_stability(-0.5, max_step=0.3).status == ns.Status.INTERSECTION


def test_sliding_on_three_surfaces_ends_where_the_layer_loses_stability():
    """Eigenvalues of the layer are 1 + z times the cube roots of 1: unstable from z = 2."""
    field = [0.1 - l1 - z * l2, 0.05 - l2 - z * l3, -0.1 - l3 - z * l1, 1]
    system = ns.FilippovSystem(
        [x, y, w, z], field=field, surfaces=[x, y, w], multipliers=[l1, l2, l3]
    )
    run = ns.simulate(system, [0, 0, 0, 0], 8.0)
    assert run.status == ns.Status.INTERSECTION and abs(run.t[-1] - 2) < 1e-9


@pytest.mark.parametrize(
    ("angle", "offset"), [(1e-8, 2e-7), (1e-10, 2e-5), (1e-12, 2e-3), (2e-15, 1.0)]
)
def test_nearly_parallel_surfaces_are_crossed_one_by_one(angle, offset):
    """y reaches zero at 1, y + angle x the same or next; x moves by -0.1 lambda before and 0.1 after."""
    system = ns.FilippovSystem(
        [x, y, w], field=[0.1 * l1, -1, l2], surfaces=[y, y + angle * x], multipliers=[l1, l2]
    )
    run = ns.simulate(system, [offset - 0.1, 1, 0], 2.0)
    assert run.status == REACHED and abs(run.x[-1, 0] - (offset - 0.1)) < 1e-10


@pytest.mark.parametrize("t_start", [0.0, 1.7e9])
def test_an_autonomous_run_does_not_depend_on_when_it_starts(t_start):
    system = ns.FilippovSystem([x, v, w], field=[1, w, -9 * v])
    run = ns.simulate(system, [0, 0, 1], t_start + 1000, t_start=t_start)
    assert abs(run.x[-1, 0] - 1000) < 1e-9
    assert abs(3 * run.x[-1, 1] - math.sin(3000)) < 1e-8


@pytest.mark.slow
def test_a_clock_does_not_drift():
    system = ns.FilippovSystem([x], field=[1], clocks=ns.Clock(0.1))
    run = ns.simulate(system, [0, 0], 1e5 + 0.05, max_events=10**8, max_steps=10**8)
    assert abs(run.x[-1, 1] - 0.05) < 1e-10


@pytest.mark.parametrize("count", [5, 6, 24])
def test_equal_blocks_that_leave_sticking_at_one_instant(count):
    velocities = [ca.SX.sym(f"v{i}") for i in range(count)]
    multipliers = [ca.SX.sym(f"m{i}") for i in range(count)]
    field = [*[z - 0.3 * m for m in multipliers], 1]
    system = ns.FilippovSystem(
        [*velocities, z], field=field, surfaces=velocities, multipliers=multipliers
    )
    run = ns.simulate(system, [0] * (count + 1), 2.0)
    assert (run.status, run.itinerary) == (REACHED, "s" * count + " " + "+" * count)
    assert np.allclose(run.x[-1, :count], 1.7**2 / 2, rtol=0, atol=1e-9)


@pytest.mark.parametrize("count", [10, 12])
def test_balls_that_land_and_are_let_go_at_one_instant(count):
    gaps, speeds = ([ca.SX.sym(f"{a}{i}") for i in range(count)] for a in "hk")
    impacts = [ns.Impact(gap, name=f"b{i}") for i, gap in enumerate(gaps)]
    field = [*speeds, *[z - 2.0] * count, 1]
    system = ns.FilippovSystem([*gaps, *speeds, z], field=field, impacts=impacts)
    run = ns.simulate(system, [0.1] * count + [0] * (count + 1), 4.0)
    assert run.status == REACHED
    assert np.allclose(run.x[-1, :count], 2.0**3 / 6, rtol=0, atol=1e-9)


def test_osculating_surfaces():
    """Both are negative near x = 1, for some 2e-5 each."""
    second = y + (x - 1) ** 3
    system = ns.FilippovSystem(
        [x, y, w],
        field=[1, 2 * (x - 1), 0.1 * (l1 + l2)],
        surfaces=[y, second],
        multipliers=[l1, l2],
    )
    run = ns.simulate(system, [0.5, 0.25 - 1e-10, 0], 1.5)
    cubic = np.sort(np.roots([1, 1, 0, -1e-10]).real)[1:]
    expected = 0.3 - 0.2 * (2e-5 + cubic[1] - cubic[0])
    assert run.status == REACHED
    assert abs(run.x[-1, 0] - 2) < 1e-9 and abs(run.x[-1, 2] - expected) < 1e-9
