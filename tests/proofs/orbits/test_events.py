"""Orbits over several surfaces and through impacts are proven: closed forms, the simulation's modes."""

import casadi as ca
import mpmath
import numpy as np
import pytest

import nonsmooth as ns
from tests.proofs.systems import BALL, BELT, SPIN, TABLE, TWO, a, b, holds, t, u, v, x, y

r = ca.SX.sym("r")


def test_a_bouncing_ball_has_the_impacts_of_the_closed_form():
    orbit = ns.certify_orbit(BALL, [1, 0], t_end=5, bits=128)
    assert [e.kind for e in orbit.events[:3]] == ["impact"] * 3
    with mpmath.workdps(100):
        fall = mpmath.sqrt(2)
        times = [fall, fall + fall, fall + fall + fall / 2]
        for event, time, speed in zip(orbit.events, times, (1, 0.5, 0.25), strict=False):
            assert holds(event.t, time) and event.t.radius < 1e-30
            assert holds(event.x["v"], fall * mpmath.mpf(speed) / 2)
    # Impacts accumulate at 3 sqrt(2): what is beyond is not proven.
    assert not orbit.proven and orbit.t.middle < 3 * np.sqrt(2) + 1e-6
    short = ns.certify_orbit(BALL, [1, 0], t_end=3)
    assert short.proven and short.itinerary == "o" and len(short.events) == 2


def test_a_shaken_table_agrees_with_the_simulation():
    orbit = ns.certify_orbit(TABLE, ["0.5", 0], t_end=1.5)
    run = ns.simulate(TABLE, [0.5, 0.0], t_end=1.5, rtol=1e-13, atol=1e-14)
    reached = [e for e in run.events if e.kind == "impact"]
    assert orbit.proven and len(orbit.events) == len(reached) >= 3
    for event, other in zip(orbit.events, reached, strict=True):
        assert event.t.middle == pytest.approx(other.t, abs=1e-10)
    assert [e.middle for e in orbit.end.values()][:2] == pytest.approx(list(run.x[-1]), abs=1e-9)


def test_what_impacts_may_not_be_proven_says_why():
    block = ns.FilippovSystem(
        [x, y, u, v],
        field=[u, v, -0.3 * a * r, r - 9.81],
        surface=u,
        multipliers=a,
        impacts=ns.Impact(y, reaction=r, name="floor"),
    )
    with pytest.raises(ns.DefinitionError, match="friction"):
        ns.certify_orbit(block, [0, 1, 1, 0], t_end=1)
    dead = ns.FilippovSystem([y, v], field=[v, -1], impacts=ns.Impact(y, 0.0, name="floor"))
    orbit = ns.certify_orbit(dead, [1, 0], t_end=5)
    assert not orbit.proven and "floor" in orbit.why and holds(orbit.t, mpmath.sqrt(2))
    for start in ([0, -1], [0, 0], [-1, 0]):
        orbit = ns.certify_orbit(dead, start, t_end=1)
        assert not orbit.proven and not orbit.events and "floor" in orbit.why
    assert ns.certify_orbit(dead, [0, 1], t_end=1).proven


def test_a_start_on_a_wall_is_reached_at_once_and_not_passed():
    """A reset with a direction fires at its zero; one without does not determine the side."""
    for direction, start in ((-1, -1), (0, 1), (0, -1), (-1, 0), (-1, 1)):
        wall = ns.Reset(x, [x, -0.5 * v], direction=direction, name="wall")
        drop = ns.FilippovSystem([x, v], field=[v, -2], resets=[wall])
        orbit = ns.certify_orbit(drop, [0, start], t_end=0.25)
        assert orbit.proven if (direction, start) == (-1, 1) else "wall" in orbit.why


def masses():
    """Two masses in series on belts, each with its own friction; the second is pushed periodically."""
    return ns.FilippovSystem(
        [x, u, y, v],
        field=[u, -2 * x + y - 0.6 * a, v, x - y - 0.5 * b + 0.9 * ca.cos(1.1 * t)],
        surfaces=[u - 0.3, v - 0.2],
        multipliers=[a, b],
        time=t,
    )


@pytest.mark.parametrize("seed", range(3))
def test_two_surfaces_agree_with_the_simulation(seed):
    rng = np.random.default_rng(seed)
    system, start = masses(), rng.normal(size=4)
    orbit = ns.certify_orbit(system, list(start), t_end=6, max_bits=64)
    assert orbit.events, orbit
    last = orbit.t.middle
    run = ns.simulate(system, start, t_end=last, rtol=1e-12, atol=1e-13)
    reached = [
        e for e in run.events if e.kind in ("crossing", "entry", "exit") and e.t < last - 1e-9
    ]
    assert [(e.kind, e.mode_after) for e in reached] == [
        (e.kind, e.after) for e in orbit.events if e.t.middle < last - 1e-9
    ]
    for event, other in zip(orbit.events, reached, strict=False):
        assert event.t.middle == pytest.approx(other.t, abs=1e-8)
    if not orbit.proven:
        assert "several surfaces at once" in orbit.why, orbit.why


def test_one_surface_is_crossed_while_another_slides():
    orbit = ns.certify_orbit(TWO, ["0.25", -1], t_end=3)
    assert orbit.proven and orbit.itinerary == "+- s- s+"
    assert [e.kind for e in orbit.events] == ["entry", "crossing"]
    # Friction is 1/2 for y < 0: 1/4 - 1/2 slows u down from 1/4 in 1, and from 1/2 when y = 0 too.
    assert holds(orbit.events[0].t, mpmath.mpf(1)) and holds(orbit.events[1].t, mpmath.mpf(2))
    corner = ns.certify_orbit(TWO, ["0.5", -1], t_end=3)
    assert not corner.proven and corner.itinerary == "+-"


def test_sliding_on_both_surfaces_and_corners_are_refused_by_name():
    both = ns.FilippovSystem([x, y], field=[-a, -b], surfaces=[x, y], multipliers=[a, b])
    orbit = ns.certify_orbit(both, [1, 2], t_end=3)
    assert (
        not orbit.proven and orbit.itinerary == "++ s+" and "several surfaces at once" in orbit.why
    )
    corner = ns.certify_orbit(both, [1, 1], t_end=3)
    assert not corner.proven and corner.itinerary == "++" and "first" in corner.why
    start = ns.certify_orbit(both, [0, 0], t_end=3)
    assert not start.proven and "2 surfaces at once" in start.why
    hidden = ns.FilippovSystem([x], field=[-a + a**3], surface=x, multipliers=a, hidden=True)
    with pytest.raises(ns.DefinitionError, match="hidden"):
        ns.certify_orbit(hidden, [1], t_end=1)


def test_smooth_systems_and_boxes_of_starts():
    orbit = ns.certify_orbit(SPIN, [1, 0], t_end=10)
    assert orbit.status == "turn" and holds(orbit.t, mpmath.pi) and orbit.itinerary == "o"
    many = ns.certify_orbit(SPIN, [("0.9", "1.1"), 0], t_end=10)
    assert many.status == "turn" and holds(many.t, mpmath.pi)
    assert all(holds(many.end["x"], -mpmath.mpf(s)) for s in ("0.9", "1.1"))


def test_a_jump_keeps_a_block_on_its_belt_where_it_leaves_the_surface_alone():
    orbit = ns.certify_orbit(BELT, [0, "0.25", 1, 0], t_end="1.75")
    assert orbit.proven and orbit.itinerary == "so"
    assert holds(orbit.end["x"], mpmath.mpf("0.4375"))


def test_an_event_that_some_orbits_meet_after_the_end_is_not_claimed():
    """Starts from -0.4 to -0.1: back to -1 at 0, which is reached again after 1, from 1.1 to 1.4."""
    clock = ns.FilippovSystem([x], field=[1], resets=[ns.Reset(x, [-1], 1, "tick")])
    for end, proven, ticks in (("1.05", True, 1), ("1.3", False, 1), ("1.5", True, 2)):
        orbit = ns.certify_orbit(clock, [("-0.4", "-0.1")], t_end=end)
        assert orbit.proven == proven and len(orbit.events) == ticks, orbit


def test_a_jump_across_another_reset_is_not_proven():
    leap, edge = ns.Reset(x - 1, [x + 2], 1, "leap"), ns.Reset(x - 2, [0], 1, "edge")
    system = ns.FilippovSystem([x], field=[1], resets=[leap, edge])
    proof = ns.certify_orbit(system, [0], t_end=4)
    assert not proof.proven and "carries the state across" in proof.why
