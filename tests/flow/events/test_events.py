"""Events with conditions, levels and discrete states: what the cases do not say."""

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.differences import require

x, y, v, t, q, g, p = (ca.SX.sym(name) for name in ("x", "y", "v", "t", "q", "g", "p"))
REACHED = ns.Status.REACHED_END


def thermostat():
    return ns.FilippovSystem(
        [x],
        discrete={q: (0, 1)},
        field=[-0.5 * (x - 10) + 8 * q],
        resets=[
            ns.Reset(x - 18, {q: 1}, -1, "on", level=True, when=q == 0),
            ns.Reset(x - 22, {q: 0}, 1, "off", level=True, when=q == 1),
        ],
    )


def neurons(count=3, push=0.3):
    """Three neurons that push one another over the threshold at one instant."""
    own = [ca.SX.sym(f"v{i}") for i in range(count)]
    resets = [
        ns.Reset(
            w - 1,
            {w: 0, **{u: ca.if_else(u > 0, u + push, 0) for u in own if u is not w}},
            1,
            f"n{i}",
        )
        for i, w in enumerate(own)
    ]
    return ns.FilippovSystem(own, field=[1.2 - w for w in own], resets=resets)


def fired(run):
    return [event.name for event in run.events if event.kind == "reset"]


# discrete states --------------------------------------------------------------------------------


def test_itineraries_show_discrete_states():
    run = ns.simulate(thermostat(), [20.0, 0], 5.0)
    assert run.itinerary.split()[:3] == ["q=0", "q=1", "q=0"]
    assert [segment.discrete for segment in run.segments[:2]] == [(0.0,), (1.0,)]
    many = ns.ensemble(
        thermostat(), [[20.0, 0], [20.0, 1]], 5.0, work=ns.Work(threads=1, progress=False)
    )
    assert many.itinerary[0] == run.itinerary and many.itinerary[1].startswith("q=1 q=0")


def test_discrete_states_beside_a_surface():
    system = ns.FilippovSystem(
        [x, v],
        discrete=[g],
        field=[v, -x - 0.3 * p],
        multipliers=p,
        surface=v,
        resets=ns.Reset(x - 0.5, {g: g + 1}, 1),
    )
    run = ns.simulate(system, [1.0, 0.0, 0], 10.0)
    assert run.itinerary.startswith("-,g=0 +,g=0") and REACHED is run.status


def test_values_of_discrete_states_are_checked():
    with pytest.raises(ns.PointError, match=r"q = 2.*\(0\.0, 1\.0\)"):
        ns.simulate(thermostat(), [20.0, 2], 1.0)
    with pytest.raises(ns.PointError, match=r"q = 0\.5"):
        ns.ensemble(thermostat(), [[20.0, 1], [20.0, 0.5]], 1.0)
    wrong = ns.FilippovSystem(
        [x], discrete={q: (0, 1)}, field=[1], resets=ns.Reset(x - 1, {q: q + 1}, 1, "count")
    )
    run = ns.simulate(wrong, [0.0, 1], 2.0)
    assert run.status is ns.Status.INCONSISTENT and "'count'" in run.message and run.t[-1] == 1.0


def test_a_map_of_a_discrete_state_is_locally_constant():
    with pytest.raises(ns.DefinitionError, match="varies smoothly"):
        ns.FilippovSystem([x], discrete=[q], field=[1], resets=ns.Reset(x - 1, {q: x}, 1))
    chosen = ns.Reset(y - 1, {q: ca.if_else(x > 0.5, 1, q)}, 1)
    system = ns.FilippovSystem([x, y], discrete=[q], field=[0, 1], resets=chosen)
    assert [ns.simulate(system, [a, 0.0, 7], 2.0).x[-1, 2] for a in (0.4, 0.6)] == [7.0, 1.0]


# definitions ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("event", "message"),
    [
        (lambda: ns.Reset(x - 1, {x: 0}, 0, level=True), "level=True needs direction"),
        (lambda: ns.Reset(x - 1, {y: 1}, 1, level=True), "without end"),
        (lambda: ns.Reset(x >= 1, {x: 0}, 1), "direction"),
        (lambda: ns.Reset(ca.logic_and(x == 1, y > 0), {x: 0}), "discrete states"),
        (lambda: ns.Reset(x - 1, {ca.SX.sym("z"): 0}, 1), "is no state"),
        (lambda: ns.Reset(x - 1, {x: 0}, 1, values="later"), "now"),
        (lambda: ns.Reset(x - 1, {x: 0}, 1, initially=2), "initially"),
        (lambda: ns.Reset(x - 1, {x: 0}, 1, level=1), "level"),
        (lambda: ns.Stop(p >= 1), "function of the states"),
    ],
)
def test_wrong_events_are_refused(event, message):
    made = event()
    kind = "stops" if isinstance(made, ns.Stop) else "resets"
    with pytest.raises(ns.DefinitionError, match=message):
        ns.FilippovSystem([x, y], field=[1, 1], parameters={p: 1.0}, **{kind: made})


def test_fields_with_conditions_are_refused_with_the_way_out():
    with pytest.raises(ns.NotSmoothError, match="from_expression"):
        ns.FilippovSystem([x], field=[ca.if_else(x > 0, 1, 2)])


# one instant ------------------------------------------------------------------------------------


def test_a_chain_of_neurons_fires_at_one_instant():
    run = ns.simulate(neurons(), [0.0, 0.5, 0.4], 2.0)
    assert fired(run) == ["n1", "n0", "n2"]
    assert len({event.t for event in run.events[:3]}) == 1
    assert abs(run.events[0].t - math.log(3.5)) < 1e-12


def test_jumps_without_end_have_a_status_with_names():
    ping = ns.Reset(x - 1, {x: 0, y: 2}, 1, "ping")
    pong = ns.Reset(y - 1, {y: 0, x: 2}, 1, "pong")
    system = ns.FilippovSystem([x, y], field=[1, 0], resets=[ping, pong])
    run = ns.simulate(system, [0.0, 0.0], 3.0)
    assert run.status is ns.Status.ENDLESS_JUMPS and run.t[-1] == 1.0
    assert "'ping' and 'pong'" in run.message and len(fired(run)) == 1000
    assert len(fired(ns.simulate(system, [0.0, 0.0], 3.0, max_jumps=7))) == 7


def test_the_dense_output_has_both_values_at_a_jump():
    drop = ns.Reset(x - 1, {x: 0}, 1, "one")
    again = ns.Reset(y - 1, {y: x + 5}, 1, "two")
    system = ns.FilippovSystem([x, y], field=[1, 1], resets=[drop, again])
    run = ns.simulate(system, [0.0, 0.0], 1.0, t_eval=[0.5, 1.0])
    assert np.array_equal(run(1.0), [0.0, 5.0]) and np.array_equal(run(1.0), run.x[-1])
    assert np.allclose(run(1.0, side="left"), [1.0, 1.0], rtol=0, atol=1e-14)
    assert np.array_equal(run.sample_x[-1], [0.0, 5.0])
    longer = ns.simulate(system, [0.0, 0.0], 2.5, t_eval=[1.0])
    assert np.array_equal(longer.sample_x[0], [0.0, 5.0])
    assert np.allclose(longer(1.0, side="left"), [1.0, 1.0], rtol=0, atol=1e-14)


@pytest.mark.parametrize("many", [False, True])
def test_a_section_has_the_states_before_and_after_all_jumps_of_its_instant(many):
    """The second jump of an instant: sampled before the first one, or after the last."""
    resets = [ns.Reset(x - 1, {x: 0, y: 3}, 1, "one"), ns.Reset(y - 2, {y: 0, v: v + 1}, 1, "two")]
    system = ns.FilippovSystem([x, y, v], field=[1, 0, 0], resets=resets)

    def samples(at):
        if many:
            work = ns.Work(threads=1, progress=False)
            return ns.ensemble(system, [[0.0, 0.0, 0.0]], 3.5, at=at, work=work).sample_x[0]
        return ns.simulate(system, [0.0, 0.0, 0.0], 3.5, at=at).sample_x

    before = samples(ns.Section("two", count=2))
    assert np.allclose(before, [[1, 0, 0], [1, 0, 1]], rtol=0, atol=1e-13)
    after = samples(ns.Section("two", count=2, after=True))
    assert np.allclose(after, [[0, 0, 1], [0, 0, 2]], rtol=0, atol=1e-13)


def test_events_know_what_they_led_to():
    """A ramp that a clock restarts, over a surface."""
    ramp = ns.FilippovSystem(
        [x, y],
        surface=x - 0.5,
        above=[1, 2],
        below=[1, 0],
        resets=ns.Reset(x - 1, [x - 1, y], 1, "clock"),
    )
    run = ns.simulate(ramp, [0.0, 0.0], 1.25)
    assert [(e.kind, e.name, e.mode_before, e.mode_after) for e in run.events] == [
        ("crossing", "h0", "-", "+"),
        ("reset", "clock", "+", "-"),
        ("end", "REACHED_END", "-", "-"),
    ]
    reset = run.events[1]
    assert abs(reset.x[0] - 1.0) < 1e-14 and abs(reset.x_after[0]) < 1e-14
    assert all(np.array_equal(e.x, e.x_after) for e in run.events if e.kind != "reset")


@pytest.mark.parametrize(
    ("event", "start", "is_said"),
    [
        (ns.Reset(x - 1, [0], 1, "kick"), 2.0, True),
        (ns.Stop(x - 1, 1, "kick"), 2.0, True),
        (ns.Stop(x - 1, 1, "kick"), 0.0, False),  # not true
        (ns.Reset(x - 1, [0], 0, "kick"), 2.0, False),  # either way: no condition
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


# restart ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("cut", range(1, 7))
def test_a_run_cut_amid_an_instant_continues(cut):
    system = neurons(push=0.6)
    whole = ns.simulate(system, [0.0, 0.5, 0.4], 4.0)
    part = ns.simulate(system, [0.0, 0.5, 0.4], 4.0, max_events=cut)
    assert part.status is ns.Status.TOO_MANY_EVENTS and len(fired(part)) == cut
    for start in (part, whole.events[cut - 1]):
        rest = ns.simulate(system, start=start, t_end=4.0)
        assert fired(part) + fired(rest) == fired(whole)
        assert np.allclose(rest.x[-1], whole.x[-1], rtol=0, atol=1e-9)


def test_a_saved_run_continues(tmp_path):
    part = ns.simulate(neurons(push=0.6), [0.0, 0.5, 0.4], 4.0, max_events=2)
    part.save(tmp_path / "part")
    loaded = ns.load(tmp_path / "part")
    rest, again = (ns.simulate(r.system, start=r, t_end=4.0) for r in (part, loaded))
    assert fired(rest) == fired(again) and np.array_equal(rest.x[-1], again.x[-1])
    assert loaded.system == part.system


def test_a_saved_system_keeps_its_conditions(tmp_path):
    run = ns.simulate(thermostat(), [15.0, 0], 3.0)
    run.save(tmp_path / "run")
    system = ns.load(tmp_path / "run").system
    assert system == thermostat() and system.definition.rules == thermostat().definition.rules
    assert ns.simulate(system, [15.0, 0], 3.0).itinerary == run.itinerary


def test_start_excludes_a_state():
    run = ns.simulate(thermostat(), [20.0, 0], 1.0)
    with pytest.raises(ns.OptionError, match="start="):
        ns.simulate(thermostat(), [20.0, 0], 2.0, start=run)
    with pytest.raises(ns.OptionError, match="start is"):
        ns.simulate(thermostat(), start=3, t_end=2.0)
    with pytest.raises(ns.OptionError, match="another section"):
        ns.simulate(thermostat(), start=run, t_end=2.0, at=x - 20)
    with pytest.raises(ns.OptionError, match="x0 is missing"):
        ns.simulate(thermostat(), t_end=2.0)


# clocks -----------------------------------------------------------------------------------------


def test_ticks_are_counted():
    clock = ns.Clock(0.1)
    system = ns.FilippovSystem([x], field=[0], clocks=clock)
    run = ns.simulate(system, [0.0, 0.03], 1000.0)
    ticks = np.array([event.t for event in run.events if event.name == "clock"])
    exact = 0.07 + 0.1 * np.arange(len(ticks))
    assert len(ticks) == 10_000 and np.abs(ticks - exact).max() < 3e-13


def test_phases_at_the_start_are_checked():
    system = ns.FilippovSystem([x], field=[1], clocks=ns.Clock(2.0))
    for phase in (2.0, -0.1, 5.0):
        with pytest.raises(ns.OptionError, match="phase"):
            ns.simulate(system, [0.0, phase], 1.0)
    assert len(ns.simulate(system, [0.0, 0.0], 1.9).events) == 1


# derivatives and orbits --------------------------------------------------------------------------


@pytest.mark.parametrize("push", [0.3, 0.6])
def test_derivatives_through_a_chain_of_jumps(push):
    require(neurons(push=push), [0.0, 0.5, 0.4], 2.0)


def test_derivatives_at_a_corner_are_refused():
    clip = ns.Reset(x - 1, {x: 0, y: ca.fmax(y - 0.5, 0)}, 1)
    system = ns.FilippovSystem([x, y], field=[1, 0], resets=clip)
    assert np.allclose(ns.sensitivity(ns.simulate(system, [0.0, 0.8], 1.5)).dx_dx0, np.eye(2))
    with pytest.raises(ns.DegenerateError, match="corner"):
        ns.sensitivity(ns.simulate(system, [0.0, 0.5], 1.5))


@pytest.mark.parametrize("value", [0, 1, -1, 0.3])
def test_events_of_surfaces_have_their_kinds_beside_discrete_states(value):
    """Bytes of discrete states in a mode are no letters."""
    friction = {"surface": v, "above": [v, -x - 0.3], "below": [v, -x + 0.3]}
    plain = ns.FilippovSystem([x, v], **friction)
    system = ns.FilippovSystem([x, v], **friction, discrete=[q, p])
    expected = ns.simulate(plain, [1.0, 0.1], 20.0).events
    found = ns.simulate(system, [1.0, 0.1, value, 2], 20.0).events
    assert [e.kind for e in found] == [e.kind for e in expected]
    assert {"crossing", "entry"} <= {e.kind for e in found}
