"""The contract of events and resets (``nonsmooth.flow``), sentence by sentence: one run, and many at once."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.constants import KINDS

x, y, v, w, t, lam = (ca.SX.sym(s) for s in ("x", "y", "v", "w", "t", "lam"))
G = 9.81

one_and_many = pytest.mark.parametrize("many", [False, True], ids=["one", "many"])


def ends(system, start, t_end, many, **options):
    """Last state, status, itinerary and number of events of each kind."""
    if many:
        starts = np.tile(np.array(start, float), (70, 1))
        found = ns.ensemble(system, starts, t_end, work=ns.Work(progress=False), **options)
        assert np.array_equal(found.x, np.tile(found.x[0], (70, 1)), equal_nan=True)
        counts = {kind: int(n[0]) for kind, n in found.events.items()}
        return found.x[0], ns.Status(int(found.status[0])), found.itinerary[0], counts
    run = ns.simulate(system, start, t_end, **options)
    counts = {kind: sum(e.kind == kind for e in run.events) for kind in KINDS}
    return run.x[-1], run.status, run.itinerary, counts


def floor(direction, restitution=0.8):
    """A ball over the floor y = 0."""
    reset = ns.Reset(y, [y, -restitution * v], direction, "impact")
    return ns.FilippovSystem([y, v], field=[v, -G], resets=[reset])


# 1 A stop or reset is due where its guard passes zero in its direction; a touch is no event.


@one_and_many
@pytest.mark.parametrize(("direction", "expected"), [(-1, 0.5), (1, 1.5), (0, 0.5)])
def test_a_stop_is_met_where_its_function_passes_zero_in_its_direction(direction, expected, many):
    system = ns.FilippovSystem([x, y], field=[y, -x], stops=[ns.Stop(x, direction)])
    state, status, _, _ = ends(system, [1.0, 0.0], 10.0, many)
    assert status is ns.Status.STOPPED
    assert abs(np.arctan2(-state[1], state[0]) % (2 * np.pi) - expected * np.pi) < 1e-10


@one_and_many
def test_a_touch_is_not_met(many):
    """y = (t - 1)^2 touches zero from above."""
    system = ns.FilippovSystem([y, v], field=[v, 2], stops=[ns.Stop(y)])
    state, status, _, _ = ends(system, [1.0, -2.0], 3.0, many)
    assert status is ns.Status.REACHED_END and abs(state[0] - 4.0) < 1e-12


# 8 An event at t_end, to rounding, happens.


@one_and_many
@pytest.mark.parametrize("t_end", [3.0, 0.3, 1e6])
def test_a_stop_exactly_at_the_end_stops(t_end, many):
    system = ns.FilippovSystem([x], field=[1], stops=[ns.Stop(x - t_end)])
    state, status, _, counts = ends(system, [0.0], t_end, many)
    assert status is ns.Status.STOPPED and state[0] == t_end and counts["stop"] == 1


@one_and_many
def test_a_reset_exactly_at_the_end_jumps(many):
    system = ns.FilippovSystem([x], field=[1], resets=[ns.Reset(x - 2.0, [x - 5.0])])
    state, status, _, counts = ends(system, [0.0], 2.0, many)
    assert status is ns.Status.REACHED_END and counts["reset"] == 1
    assert abs(state[0] + 3.0) < 1e-14


@pytest.mark.slow_cases("many")
@one_and_many
def test_a_surface_exactly_at_the_end_is_entered(many):
    system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
    state, status, itinerary, counts = ends(system, [2.0], 2.0, many)
    assert counts["entry"] == 1 and abs(state[0]) < 1e-15
    assert status is ns.Status.REACHED_END and itinerary == "+"  # no time was spent sliding


@one_and_many
def test_what_happens_after_the_end_does_not(many):
    system = ns.FilippovSystem([x], field=[1], stops=[ns.Stop(x - 2.0)])
    state, status, _, _ = ends(system, [0.0], 2.0 - 1e-9, many)
    assert status is ns.Status.REACHED_END and state[0] < 2.0


# 4 At one instant stops are served first, then resets in their order, then surfaces.


@one_and_many
def test_a_stop_is_served_before_a_reset_and_a_surface(many):
    system = ns.FilippovSystem(
        [x],
        surface=x - 1,
        above=[1],
        below=[1],
        stops=[ns.Stop(x - 1)],
        resets=[ns.Reset(x - 1, [x - 7])],
    )
    state, status, itinerary, counts = ends(system, [0.0], 2.0, many)
    assert status is ns.Status.STOPPED and abs(state[0] - 1.0) < 1e-15
    assert itinerary == "-" and counts["reset"] == counts["crossing"] == 0


@one_and_many
def test_resets_at_one_instant_are_served_in_their_order(many):
    """x reaches 1: the first adds 1 to y and leaves x, the second doubles y."""
    system = ns.FilippovSystem(
        [x, y],
        field=[1, 0],
        resets=[ns.Reset(x - 1, [x, y + 1], 1, "add"), ns.Reset(x - 1, [x, 2 * y], 1, "double")],
    )
    state, _, _, counts = ends(system, [0.0, 3.0], 2.0, many)
    assert counts["reset"] == 2 and abs(state[1] - 8.0) < 1e-15


@one_and_many
def test_what_a_jump_carries_across_is_met(many):
    """From x = 1 to x = 3, over the stop at 2."""
    system = ns.FilippovSystem(
        [x], field=[1], stops=[ns.Stop(x - 2)], resets=[ns.Reset(x - 1, [x + 2], 1)]
    )
    state, status, _, _ = ends(system, [0.0], 2.0, many)
    assert status is ns.Status.STOPPED and abs(state[0] - 3.0) < 1e-14


# 7 A start on the zero of a stop is no event.


@one_and_many
@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_a_start_on_a_stop_is_no_event(direction, many):
    system = ns.FilippovSystem([x, y], field=[y, -x], stops=[ns.Stop(x, direction)])
    state, status, _, _ = ends(system, [0.0, 1.0], 10.0, many)
    assert status is ns.Status.STOPPED
    assert np.allclose(state, [0.0, -1.0 if direction < 1 else 1.0], atol=1e-9)


# 7 At a start on its zero a reset with a direction is due if the motion goes in.


@one_and_many
@pytest.mark.parametrize("speed", [-1.0, 1.0])
def test_a_start_on_the_floor(speed, many):
    """A ball that starts on the floor bounces at once if it moves into it."""
    up = 1.0 if speed > 0 else 0.8
    state, status, _, counts = ends(floor(-1), [0.0, speed], up / G, many)
    assert counts["reset"] == (speed < 0) and status is ns.Status.REACHED_END
    assert abs(state[0] - up**2 / (2 * G)) < 1e-12


# 7 A reset without a direction is not due there; NON_UNIQUE if it would reverse the motion.


@one_and_many
def test_a_start_on_a_kick_without_a_direction(many):
    """The kick comes back twice in a period of the oscillator."""
    kick = ns.Reset(x, [x, 0.9 * v], name="kick")
    system = ns.FilippovSystem([x, v], field=[v, -x], resets=[kick])
    state, _, _, counts = ends(system, [0.0, 1.0], 2 * np.pi + 0.1, many)
    assert counts["reset"] == 2 and abs(np.hypot(*state) - 0.81) < 1e-9


@one_and_many
@pytest.mark.parametrize("speed", [-1.0, 0.0, 1.0])
def test_a_start_on_a_wall_of_two_sides_is_ambiguous(speed, many):
    """It could be the floor of the ball or its ceiling: nothing falls through in silence."""
    _, status, _, _ = ends(floor(0), [0.0, speed], 1.0, many)
    assert status is ns.Status.NON_UNIQUE
    run = ns.simulate(floor(0), [0.0, speed], 1.0)
    assert "direction" in run.message and "impact" in run.message


@one_and_many
def test_a_wall_of_two_sides_is_met_from_either(many):
    for start in ([1.0, 0.0], [-1.0, 2 * G]):
        _, _, _, counts = ends(floor(0), start, 0.6, many)
        assert counts["reset"] == 1


# 2 A passage is one event. 9 A motion that is pressed against its zero rests.


@one_and_many
@pytest.mark.parametrize("direction", [1, -1, 0])
def test_a_kick_that_stays_on_its_zero_comes_once(direction, many):
    """The oscillator is slowed to .9 at each passage in the direction."""
    kick = ns.Reset(x, [x, 0.9 * v], direction, "kick")
    system = ns.FilippovSystem([x, v], field=[v, -x], resets=[kick])
    state, status, _, counts = ends(system, [-1.0, 0.0], 6 * np.pi - 0.1, many)
    passages = 3 if direction else 6
    assert status is ns.Status.REACHED_END and counts["reset"] == passages
    assert abs(np.hypot(*state) - 0.9**passages) < 1e-9


@one_and_many
@pytest.mark.parametrize("direction", [1, 0])
def test_a_clock_written_as_a_sine_strikes_once_a_period(direction, many):
    strike = ns.Reset(ca.sin(2 * np.pi * t), [x + 1], direction, "clock")
    system = ns.FilippovSystem([x], field=[0], resets=[strike], time=t)
    state, status, _, _ = ends(system, [0.0], 4.9, many, t_start=0.25)
    assert status is ns.Status.REACHED_END and state[0] == (4 if direction else 9)


@one_and_many
def test_a_body_that_a_reset_leaves_pressed_against_its_zero_rests(many):
    """Without restitution nothing turns it back: it is not let through the floor."""
    state, status, _, counts = ends(floor(-1, 0.0), [1.0, 0.0], 5.0, many)
    assert status is ns.Status.ACCUMULATION and counts["reset"] == 1
    assert abs(state[0]) < 1e-12 and abs(state[1]) < 1e-12
    assert "Impact" in ns.simulate(floor(-1, 0.0), [1.0, 0.0], 5.0).message


# 6 A reset across a surface is one event, with the mode that starts.


def ramp():
    """A ramp c in [0, 1] restarted by a clock; above or below the level .5 the other field holds."""
    return ns.FilippovSystem(
        [x, y],
        surface=x - 0.5,
        above=[1, 2],
        below=[1, 0],
        resets=[ns.Reset(x - 1, [x - 1, y], 1, "clock")],
    )


@one_and_many
def test_a_reset_that_changes_side_is_one_event(many):
    state, _, itinerary, counts = ends(ramp(), [0.0, 0.0], 3.25, many)
    assert counts["reset"] == 3 and counts["crossing"] == 3 and counts["end"] == 1
    assert itinerary == "- + - + - + -" and abs(state[1] - 3.0) < 1e-12


def test_events_know_what_they_led_to():
    run = ns.simulate(ramp(), [0.0, 0.0], 1.25)
    assert [(e.kind, e.name, e.mode_before, e.mode_after) for e in run.events] == [
        ("crossing", "h0", "-", "+"),
        ("reset", "clock", "+", "-"),
        ("end", "REACHED_END", "-", "-"),
    ]
    reset = run.events[1]
    assert abs(reset.x[0] - 1.0) < 1e-14 and abs(reset.x_after[0]) < 1e-14
    assert all(np.array_equal(e.x, e.x_after) for e in run.events if e.kind != "reset")


# 3 Where a reset ends on the zero of another event, the motion that follows decides.


@one_and_many
def test_a_reset_onto_the_zero_of_another_one(many):
    """From x = 1 to x = 2, where the stop is, and on."""
    system = ns.FilippovSystem(
        [x], field=[1], stops=[ns.Stop(x - 2)], resets=[ns.Reset(x - 1, [x + 1], 1)]
    )
    state, status, _, _ = ends(system, [0.0], 2.0, many)
    assert status is ns.Status.STOPPED and abs(state[0] - 2.0) < 1e-14


@one_and_many
def test_a_reset_onto_the_zero_of_another_one_from_which_the_motion_goes_back(many):
    """x jumps to the stop at 2 and turns round there: v becomes -1."""
    system = ns.FilippovSystem(
        [x, v], field=[v, 0], stops=[ns.Stop(x - 2)], resets=[ns.Reset(x - 1, [x + 1, -v], 1)]
    )
    state, status, _, _ = ends(system, [0.0, 1.0], 1.5, many)
    assert status is ns.Status.REACHED_END and abs(state[0] - 1.5) < 1e-14


# Surfaces that cannot be located to rounding are refused when they are met.


@pytest.mark.slow_cases("many")
@one_and_many
def test_a_multiple_zero_that_rounding_hides_is_refused_when_it_is_met(many):
    surface = x**3 - 2.7 * x**2 + 2.43 * x - 0.729
    system = ns.FilippovSystem([x, y], surface=surface, above=[1, 2], below=[1, 1])
    _, status, _, _ = ends(system, [0.0, 0.0], 2.0, many)
    assert status is ns.Status.NON_UNIQUE
    assert "multiple zero" in ns.simulate(system, [0.0, 0.0], 2.0).message


# 13 What is clearly true at the start is no edge: the message says so once, if it did not happen later.


@pytest.mark.parametrize(
    ("event", "start", "is_said"),
    [
        (ns.Reset(x - 1, [0], 1, "kick"), 2.0, True),
        (ns.Stop(x - 1, 1, "kick"), 2.0, True),
        (ns.Stop(x - 1, 1, "kick"), 0.0, False),  # not true
        (
            ns.Reset(x - 1, [0], 0, "kick"),
            2.0,
            False,
        ),  # either way: no condition is true at a start
        (ns.Reset(x - 1, [0], 1, "kick", initially=True), 2.0, False),
        (ns.Reset(x - 1, [0], 1, "kick", initially=False), 2.0, False),
        (ns.Reset(x - 1, [0], 1, "kick", level=True), 2.0, False),
    ],
)
def test_an_event_that_is_true_at_the_start_and_silent_is_named(event, start, is_said):
    given = {"stops": [event]} if isinstance(event, ns.Stop) else {"resets": [event]}
    run = ns.simulate(ns.FilippovSystem([x], field=[1], **given), [start], 0.5)
    assert ("'kick' was true at the start" in run.message) == is_said
    assert "initially=True" in run.message or not is_said


def test_an_event_that_is_true_at_the_start_and_happens_later_is_not_named():
    kick = ns.Reset(x - 0.5, [x - 1, y], 1, "kick")
    system = ns.FilippovSystem([x, y], field=[y, -x], resets=[kick])
    run = ns.simulate(system, [1.0, 0.0], 6.0)
    assert any(e.name == "kick" for e in run.events) and "at the start" not in run.message
