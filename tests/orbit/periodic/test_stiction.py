"""Stick-slip with static friction above kinetic: sliding ends at the fold of a cubic law, with derivatives."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nonsmooth as ns
from tests.differences import require

x, v, damping, static, y, w = (ca.SX.sym(s) for s in ("x", "v", "damping", "static", "y", "w"))
BELT, KINETIC, FORCE = 0.1, 0.3, 0.5


def _block(load=1):
    dry = ns.Friction(v - BELT, load=load, kinetic=KINETIC, static=static)
    return ns.FilippovSystem(
        [x, v],
        field=[v, -x - damping * v + dry.force],
        surfaces=[dry],
        parameters={damping: 0.1, static: FORCE},
    )


def _slip(damped=0.1, limit=FORCE):
    """Time and end of a slip from where the belt pulls with the static friction, to the belt's speed."""
    start = limit - damped * BELT
    end = solve_ivp(
        lambda _, u: [u[1], KINETIC - u[0] - damped * u[1]],
        (0, 20),
        [start, BELT],
        events=lambda t, u: u[1] - BELT,
        rtol=1e-12,
        atol=1e-14,
    )
    k = next(k for k, t in enumerate(end.t_events[0]) if t > 1e-6)
    return start, end.t_events[0][k], end.y_events[0][k][0]


def test_a_stick_slip_cycle():
    orbit = ns.periodic_orbit(_block(), [0.0, BELT])
    assert orbit.itinerary == "- s" and orbit.multipliers.tolist() == [1, 0]
    start, slips, end = _slip()
    assert orbit.period == pytest.approx(slips + (start - end) / BELT, abs=1e-10)
    periods, step = [], 1e-4
    for limit in (FORCE - step, FORCE + step):
        a, t, b = _slip(limit=limit)
        periods.append(t + (a - b) / BELT)
    slope = (periods[1] - periods[0]) / (2 * step)
    assert orbit.derivative("static").period == pytest.approx(slope, rel=1e-6)


def test_a_load_that_changes_with_the_position():
    """The limit is that of the load where it breaks away: x + 0.01 = 0.5 (1 + 0.2 x)."""
    orbit = ns.periodic_orbit(_block(1 + x / 5), [0.0, BELT])
    assert orbit.itinerary == "- s"
    breaks_away = next(leg for leg in orbit.legs if leg.mode == "-").start[0]
    assert breaks_away == pytest.approx((0.5 - 0.01) / 0.9, abs=1e-10)


def test_a_branch_of_stick_slip_cycles_ends_where_the_slip_grazes_the_belt():
    orbit = ns.periodic_orbit(_block(), [0.0, BELT])
    branch = ns.continue_orbit(orbit, "damping", bounds=(0.05, 0.2))
    assert [end.name for end in branch.ends] == ["REACHED_BOUND"] * 2
    for value in (0.07, 0.18):
        (at,) = branch.at(value)
        start, slips, end = _slip(value)
        assert at.period == pytest.approx(slips + (start - end) / BELT, abs=1e-8)


def test_derivatives_of_a_run_through_sticking():
    require(_block(), [0.0, 0.05], 25.0, "s - s")


def test_two_blocks_that_stick_at_times_of_their_own():
    one = ns.Friction(v - BELT, load=1, kinetic=0.3, static=0.5)
    two = ns.Friction(w - BELT, load=1, kinetic=0.2, static=0.4)
    system = ns.FilippovSystem(
        [x, v, y, w],
        field=[v, -x - 0.2 * (x - y) + one.force, w, -2 * y - 0.2 * (y - x) + two.force],
        surfaces=[one, two],
    )
    start = [0.1, BELT, 0.0, 0.0]
    run = ns.simulate(system, start, 12.0)
    assert run.status is ns.Status.REACHED_END and "ss s-" in run.itinerary
    for event in run.events[:-1]:  # the event is that of the friction whose letter changes
        assert event.mode_before[event.element] != event.mode_after[event.element]
    require(system, start, 12.0, of=[0, 2])


def test_a_branch_sticks_where_the_force_at_a_stop_falls_below_the_static_friction():
    """Not where it falls below the kinetic one, at which crossing alone would become sliding."""
    y, w, t, push = (ca.SX.sym(name) for name in ("y", "w", "t", "push"))
    dry = ns.Friction(w, load=1, kinetic=0.2, static=0.3)
    system = ns.FilippovSystem(
        [y, w],
        field=[w, dry.force - y - 0.1 * w + push * ca.cos(0.6 * t)],
        surfaces=[dry],
        time=t,
        parameters={push: 1.5},
    )
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3, 0.0], 200.0))
    branch = ns.continue_orbit(orbit, "push", bounds=(0.4, 1.5))
    (event,) = branch.events
    assert orbit.itinerary.replace(" ", "") in ("+-", "-+") and event.kind == "crossing-sliding"
    for leg in event.orbit.legs:  # where it stops, the force is the static one
        force = abs(event.parameter * np.cos(0.6 * leg.t) - leg.start[0])
        assert force == pytest.approx(0.3, abs=1e-9)
    for value in np.linspace(0.9 * event.parameter, 1.1 * event.parameter, 6):
        (at,) = branch.at(value)
        x, begin = at.trajectory(at.legs[0].t + 0.4 * at.legs[0].duration), at.legs[0].t
        begin += 0.4 * at.legs[0].duration
        given = {"push": value}
        run = ns.simulate(system, x, begin + at.period, t_start=begin, parameters=given, tol=1e-12)
        assert np.abs(run.x[-1] - x).max() < 1e-8
