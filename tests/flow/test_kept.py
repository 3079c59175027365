"""What a run keeps: events and segments as sequences over arrays, and runs without polynomials."""

import copy
import pickle

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow import Event, Events, Segment, Segments
from nonsmooth.flow.engine import recording
from nonsmooth.textbook import PROBLEMS

x, v = ca.SX.sym("x"), ca.SX.sym("v")
BALL = ns.FilippovSystem(
    [x, v],
    surface=v,
    above=[v, -1.01],
    below=[v, -0.99],
    resets=ns.Reset(x, [0, -0.9 * v], -1, "floor"),
)
BELT = ns.FilippovSystem([x, v], surface=v - 1, above=[v, -x - 0.4], below=[v, -x + 0.4])
RUNS = {"ball": (BALL, [0.1, 0.1], 6.0), "belt": (BELT, [3.0, 0.0], 40.0)}


def bits(event):
    """All of an event, numbers as bytes."""
    motion = None if event.motion is None else event.motion.tobytes()
    label = (event.kind, event.mode_before, event.mode_after, event.name, event.element, event.side)
    states = np.float64(event.t).tobytes(), event.x.tobytes(), event.x_after.tobytes()
    return (*label, *states, motion)


# Sequences ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", RUNS)
@pytest.mark.parametrize("of", ["events", "segments"])
def test_they_are_read_as_a_list_is(name, of):
    found = getattr(ns.simulate(*RUNS[name]), of)
    made = [*found]
    size = len(made)
    assert size == len(found) > 5 and bool(found)
    for k in (*range(-size, size), np.int64(2)):
        assert found[k] == made[k]
    for k in (size, -size - 1):
        with pytest.raises(IndexError):
            found[k]
    with pytest.raises(TypeError):
        found["0"]
    for cut in (
        np.s_[:],
        np.s_[1:4],
        np.s_[-3:],
        np.s_[::-1],
        np.s_[7:2:-2],
        np.s_[4:4],
        np.s_[::3],
    ):
        assert type(found[cut]) is type(found)
        assert (
            found[cut] == made[cut]
            and [*found[cut]] == made[cut]
            and len(found[cut]) == len(made[cut])
        )
    assert found == made and made == found and not found == made[:-1] and found != made[::-1]
    assert found != "text" and found != tuple(made)
    assert repr(found) == repr(made) and [*reversed(found)] == made[::-1]
    assert made[3] in found and found.index(made[3]) == 3 and found.count(made[3]) == 1
    assert (
        found[:2] + found[2:] == made
        and found[:2] + made[2:] == made
        and made[:2] + found[2:] == made
    )
    with pytest.raises(TypeError):
        hash(found)


@pytest.mark.parametrize("name", RUNS)
def test_sequences_of_objects_are_the_same_as_those_of_runs(name):
    run = ns.simulate(*RUNS[name])
    assert [*map(bits, Events.of([*run.events]))] == [*map(bits, run.events)]
    assert Segments.of([*run.segments]) == run.segments
    assert Events.of(run.events) is run.events and Segments.of(run.segments) is run.segments
    assert Events.of([]) == [] and Segments.of([]) == []


def test_events_with_and_without_a_motion():
    """A restart needs the motion of an event; orbits have events without one."""
    states = np.array([1.0, 2.0]), np.array([1.0, 3.0])
    made = [
        Event("zero", 1.0, states[0], "", "", "f0"),
        Event("reset", 2.0, *states[:1], "", "", "r", states[1]),
    ]
    made += [Event("end", 3.0, states[1], "", "", motion=np.array([0.0, -1.0]))]
    for found in (
        Events.of(made),
        Events.of(made)[::-1][::-1],
        pickle.loads(pickle.dumps(Events.of(made))),
    ):
        assert [*map(bits, found)] == [*map(bits, made)]


def test_events_are_equal_where_all_of_their_numbers_are():
    one, other = (ns.simulate(*RUNS["ball"]).events[1] for _ in range(2))
    assert one == other and one is not other and copy.deepcopy(one) == one
    for name, value in [
        ("t", 0.5),
        ("x", one.x + 1),
        ("kind", "zero"),
        ("motion", None),
        ("side", 7),
    ]:
        changed = copy.copy(one)
        object.__setattr__(changed, name, value)
        assert changed != one and one != changed
    assert one != "event"


@pytest.mark.parametrize("t_end", [0.5, 6.0])
def test_an_event_that_is_changed_leaves_points_and_arrays_as_they_are(t_end):
    run, again = (ns.simulate(*RUNS["ball"][:2], t_end, max_step=0.02) for _ in range(2))
    for event in run.events:
        event.x[:], event.x_after[:], event.motion[:] = 9.0, 9.0, 9.0
    assert np.array_equal(run.x, again.x) and np.array_equal(run(run.t), again(again.t))
    assert np.array_equal(run.events.x, again.events.x)
    assert np.array_equal(run.events.x_after, again.events.x_after)


def test_columns_of_events():
    run = ns.simulate(*RUNS["ball"])
    for name in ("kind", "name", "element", "side", "mode_before", "mode_after"):
        assert run.events.column(name).tolist() == [getattr(e, name) for e in run.events]
    assert run.events.t.tolist() == [e.t for e in run.events]
    for name in ("x", "x_after"):
        assert np.array_equal(getattr(run.events, name), [getattr(e, name) for e in run.events])


def test_several_jumps_of_one_instant():
    """Each has the state that the one before it left."""
    second = ns.Reset(v - 2, [x + 1, v], name="second")
    chain = ns.FilippovSystem(
        [x, v], field=[1, 0], resets=[ns.Reset(x - 1, [x, 3 * v], name="first"), second]
    )
    run = ns.simulate(chain, [0.0, 1.0], 1.5)
    jumps = [e for e in run.events if e.kind == "reset"]
    assert [(e.name, e.t) for e in jumps] == [("first", 1.0), ("second", 1.0)]
    assert [e.x.tolist() for e in jumps] == [[1.0, 1.0], [1.0, 3.0]]
    assert [e.x_after.tolist() for e in jumps] == [[1.0, 3.0], [2.0, 3.0]]


# Runs without polynomials, and runs that fill the driver's memory many times -----------------------


def summary(run):
    """All that a run with and without polynomials has in common, numbers as bytes."""
    events = [bits(e)[:-1] for e in run.events]
    samples = [None if a is None else a.tobytes() for a in (run.sample_t, run.sample_x)]
    segments = [(s.mode, s.t_start, s.t_end, s.discrete) for s in run.segments]
    points = run.t.tobytes(), np.ascontiguousarray(run.x).tobytes()
    return (
        events,
        segments,
        samples,
        points,
        run.itinerary,
        repr(run),
        run.message,
        bits(run.events[-1]),
    )


def small_memory(patched):
    """Let the driver fill its memory after every few steps."""
    patched.setattr(recording, "_FIRST", (3, 6, 6))
    for name in ("_GIVEN", "_LARGEST"):
        patched.setattr(recording, name, 0)


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_run_without_polynomials_is_the_same_otherwise(name, monkeypatch):
    problem = PROBLEMS[name]()
    start, p = problem.start_at({})
    end = min(problem.t_end, 50.0)
    for more in ({}, {"t_eval": np.linspace(0, end, 57)}, {"at": "crossing"}, {"max_events": 5}):
        given = dict(parameters=p, max_steps=300, **more)
        run = ns.simulate(problem.system, start, end, **given)
        with monkeypatch.context() as patched:
            small_memory(patched)
            pieces = ns.simulate(problem.system, start, end, **given)
            loose = ns.simulate(problem.system, start, end, dense=False, **given)
        assert summary(run) == summary(pieces) == summary(loose)
        assert summary(run) == summary(
            ns.simulate(problem.system, start, end, dense=False, **given)
        )
        assert run.segments == pieces.segments and [*map(bits, run.events)] == [
            *map(bits, pieces.events)
        ]
        assert pieces.steps.starts.tobytes() == run.steps.starts.tobytes()
        assert (
            np.array(pieces.steps.coefficients).tobytes()
            == np.array(run.steps.coefficients).tobytes()
        )
        assert run.dense and not loose.dense and not len(loose.steps)


@pytest.mark.parametrize("jumps", [1, 40, 300])
def test_an_instant_with_many_jumps_fits_into_small_memory(jumps, monkeypatch):
    """Jumps of one instant stay together: an instant may be larger than the memory that the driver has."""
    k = ca.SX.sym("k")
    first = ns.Reset(x - 1, [0, 1], 1, "first")
    more = ns.Reset(k - 0.5, [x, k + 1], 1, "more", level=True, when=k < jumps)
    system = ns.FilippovSystem([x, k], field=[1, 0], resets=[first, more])
    run = ns.simulate(system, [0.5, 0.0], 21.0, max_jumps=1000)
    small_memory(monkeypatch)
    assert summary(ns.simulate(system, [0.5, 0.0], 21.0, dense=False, max_jumps=1000)) == summary(
        run
    )
    assert len(run.events) > 20 * jumps


def test_states_apart_from_the_points_are_kept_too():
    """An event need not be at a point of the run."""
    own = recording.Output(2, 3).written((1, 3, 3))
    own["point_t"][:], own["point_x"][:] = [0.0, 1.0, 1.0], [[0, 0], [1, 1], [2, 2]]
    own["event_t"][:], own["event_x"][:] = [0.5, 1.0, 1.0], [[5, 5], [1, 1], [2, 2]]
    own["event_after_x"][:] = [[5, 6], [2, 2], [-0.0, 2]]
    for name in ("kind", "before", "after", "guard"):
        own[f"event_{name}"][:] = 0
    states, rows, jumps = recording.states_of_events(own, own["point_x"])
    assert states[rows].tolist() == [[5, 5], [1, 1], [2, 2]]
    assert states[rows + jumps].tolist() == [[5, 6], [2, 2], [0, 2]]
    assert np.signbit(states[rows + jumps][2, 0]) and len(states) == 7


def test_reading_a_run_without_polynomials():
    run = ns.simulate(*RUNS["ball"], dense=False)
    assert np.array_equal(run(run.t[:1]), run.x[:1]) and np.array_equal(run(run.t[-1]), run.x[-1])
    hit = run.events[0]
    assert np.array_equal(run(hit.t), hit.x_after) and np.array_equal(
        run(hit.t, side="left"), hit.x
    )
    for needs in (
        lambda: run(0.1),
        lambda: run([0.0, 0.1]),
        lambda: ns.sensitivity(run),
        lambda: ns.plot.trajectory(run),
    ):
        with pytest.raises(ns.OptionError, match=r"dense=False"):
            needs()
    with pytest.raises(ns.PointError, match="Give times"):
        run(9.0)
    assert "svg" in run._repr_html_()
    for wrong in (None, 1, "no"):
        with pytest.raises(ns.OptionError, match="dense"):
            ns.simulate(*RUNS["ball"], dense=wrong)


def test_continuing_a_run_without_polynomials():
    whole, half = ns.simulate(*RUNS["ball"]), ns.simulate(*RUNS["ball"][:2], 3.0, dense=False)
    rest = ns.simulate(BALL, start=half, t_end=6.0)
    np.testing.assert_allclose(rest.x[-1], whole.x[-1], atol=1e-8)
    with pytest.raises(ns.OptionError, match=r"dense=False"):
        ns.simulate(BALL, start=half.events[0], t_end=6.0)
    assert [e.motion is None or e.motion.size == 0 for e in half.events[:-1]] == [True] * (
        len(half.events) - 1
    )
    assert half.events[::-1][0] == half.events[-1] and half.events[-1].motion.size
    loose = ns.simulate(*RUNS["belt"], dense=False)  # no events that need more than a state
    assert ns.simulate(BELT, start=loose.events[0], t_end=40.0).itinerary


def test_saving_a_run_without_polynomials(tmp_path):
    run = ns.simulate(*RUNS["ball"], dense=False)
    run.save(tmp_path / "run")
    again = ns.load(tmp_path / "run")
    assert summary(again) == summary(run) and not again.dense
    assert again.events.states is again.x  # one array, written once
    with pytest.raises(ns.OptionError, match=r"dense=False"):
        again(0.1)


def test_events_of_a_long_run_share_their_labels():
    run = ns.simulate(BELT, [3.0, 0.0], 3000.0, dense=False)
    assert len(run.events.labels) <= 8 and len(run.events.states) == len(run.t)
    arrays = [run.t, run.x, *(getattr(run.events, n) for n in ("t", "rows", "jumps", "codes"))]
    assert sum(a.nbytes for a in arrays) <= 60 * len(run.t)
    assert isinstance(run.events[0], Event) and isinstance(run.segments[0], Segment)
