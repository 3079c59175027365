"""An ensemble gives each start the result of its own run, however the work is divided."""

import concurrent.futures
import math
import multiprocessing
import pickle
import signal
import sys
import threading
import types

import casadi as ca
import numpy as np
import pytest

from nonsmooth.flow import Status, simulate
from nonsmooth.flow.constants import KINDS
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.ensembles import chunks
from nonsmooth.flow.ensembles import work as work_module
from nonsmooth.flow.ensembles.ensemble import ensemble
from nonsmooth.flow.ensembles.work import Work
from nonsmooth.flow.section import Section
from nonsmooth.model import (
    Clock,
    DefinitionError,
    FilippovSystem,
    Impact,
    OptionError,
    ParameterError,
    PointError,
    Reset,
    Stop,
)

WORTH = sys.modules[ensemble.__wrapped__.__module__]._WORTH
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def make_system():
    x, v, belt, friction = (ca.SX.sym(s) for s in ("x", "v", "belt", "friction"))
    return FilippovSystem(
        [x, v],
        surface=v - belt,
        above=[v, -x - friction - 0.1 * v],
        below=[v, -x + friction - 0.1 * v],
        parameters={belt: 0.3, friction: 0.4},
        stops=[Stop(x + 1.5, -1, "far")],
    )


def bouncing():
    """A forced mass on a stiff floor, with a wall."""
    x, v, t = (ca.SX.sym(s) for s in "xvt")
    floor, wall = Impact(x + 1, 0.8, name="floor"), Reset(x - 0.5, {v: -0.6 * v}, 1, name="wall")
    field = [v, -x + 1.3 * ca.cos(1.7 * t)]
    return FilippovSystem([x, v], field=field, time=t, impacts=floor, resets=wall)


@pytest.fixture(scope="module")
def system():
    return make_system()


@pytest.fixture(scope="module")
def starts():
    return np.random.default_rng(3).normal(size=(300, 2)) * 0.8


def same(a, b):
    for name in ("x", "t", "status", "itinerary_code", "event_x", "event_t"):
        one, two = getattr(a, name), getattr(b, name)
        assert (one is None) == (two is None)
        if one is not None:
            assert one.dtype == two.dtype and one.tobytes() == two.tobytes(), name
    assert a.itineraries == b.itineraries
    for kind in a.events:
        assert np.array_equal(a.events[kind], b.events[kind])


@needs_compiler
def test_each_start_as_by_simulate(system, starts):
    many = ensemble(system, starts, 12.0, at_event=("entry", 2))
    for k in range(0, 300, 15):
        run = simulate(system, starts[k], 12.0)
        assert many.itinerary[k] == run.itinerary
        assert many.status[k] == run.status
        np.testing.assert_allclose(many.x[k], run.x[-1], atol=1e-11)
        kinds = [e.kind for e in run.events]
        assert {kind: int(n[k]) for kind, n in many.events.items()} == {
            kind: kinds.count(kind) for kind in many.events
        }
        entries = [e for e in run.events if e.kind == "entry"]
        if len(entries) >= 2:
            np.testing.assert_allclose(many.event_x[k], entries[1].x, atol=1e-11)
            np.testing.assert_allclose(many.event_t[k], entries[1].t, atol=1e-11)
        else:
            assert np.isnan(many.event_t[k]) and np.isnan(many.event_x[k]).all()


@needs_compiler
def test_bit_identical_for_any_threads_and_chunks(system, starts):
    one = ensemble(system, starts, 8.0, at_event=("exit", 1), work=Work(threads=1))
    for options in ({"threads": 2, "chunk": 7}, {"threads": 3, "chunk": 64}, {"chunk": 299}):
        same(one, ensemble(system, starts, 8.0, at_event=("exit", 1), work=Work(**options)))


def test_starts_and_parameters_broadcast(system):
    x0 = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    friction = np.linspace(0.1, 0.6, 4)[:, None]
    many = ensemble(system, x0, 5.0, parameters={"friction": friction, "belt": 0.2})
    assert many.x.shape == (4, 3, 2)
    assert many.t.shape == many.status.shape == many.itinerary.shape == (4, 3)
    run = simulate(system, x0[1], 5.0, parameters={"friction": 0.6, "belt": 0.2})
    np.testing.assert_allclose(many.x[3, 1], run.x[-1], atol=1e-11)
    assert many.itinerary[3, 1] == run.itinerary
    single = ensemble(system, x0[1], 5.0)
    assert single.x.shape == (2,) and single.t.shape == ()
    assert ensemble(system, np.zeros((0, 2)), 5.0).x.shape == (0, 2)


@needs_compiler
def test_not_finite_is_reported_and_the_rest_continues(system, starts):
    bad = starts.copy()
    bad[5, 0], bad[123, 1], bad[299] = np.nan, np.inf, -np.inf
    many, good = ensemble(system, bad, 5.0), ensemble(system, starts, 5.0)
    wrong = np.isin(np.arange(300), [5, 123, 299])
    assert (many.status[wrong] == Status.NOT_FINITE).all()
    assert many.x[~wrong].tobytes() == good.x[~wrong].tobytes()
    friction = np.full(300, 0.4)
    friction[7] = np.nan
    many = ensemble(system, starts, 5.0, parameters={"friction": friction})
    assert many.status[7] == Status.NOT_FINITE and np.array_equal(many.x[7], starts[7])
    assert many.x[8:].tobytes() == good.x[8:].tobytes()
    assert "NOT_FINITE 1" in repr(many)


@pytest.mark.slow
@needs_compiler
def test_process_pool_gives_the_same_bits(system, starts):
    here = ensemble(system, starts, 5.0, work=Work(chunk=50))
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as pool:
        same(
            here,
            ensemble(
                pickle.loads(pickle.dumps(system)), starts, 5.0, work=Work(chunk=50, executor=pool)
            ),
        )


@needs_compiler
@pytest.mark.slow
def test_dask_cluster_gives_the_same_bits(system, starts):
    distributed = pytest.importorskip("dask.distributed")
    here = ensemble(system, starts, 5.0, work=Work(chunk=50))
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        same(
            here, ensemble(system, starts, 5.0, work=Work(chunk=50, executor=client.get_executor()))
        )


NONE = np.zeros((4, 2))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"x0": np.zeros((4, 3))}, PointError, "^x0 .*shape"),
        ({"x0": [["a", "b"]]}, PointError, "^x0 .*numbers"),
        ({"parameters": {"belt": np.zeros(3)}}, PointError, "broadcast"),
        ({"parameters": {"bolt": 1.0}}, ParameterError, "names"),
        ({"parameters": [0.3]}, ParameterError, "parameters"),
        ({"at_event": ("hop", 1)}, OptionError, "^at_event"),
        ({"at_event": ("exit", 0)}, OptionError, "^at_event"),
        ({"at_event": ("end", 1)}, OptionError, "^at_event"),
        ({"at_event": 3}, OptionError, "^at_event"),
        ({"tol": 2.0}, OptionError, "^tol"),
        ({"work": 3}, OptionError, "^work"),
        ({"system": None}, DefinitionError, "^system"),
    ],
)
def test_bad_arguments_are_refused(arguments, error, message, system):
    given = {"system": system, "x0": NONE, "t_end": 1.0, **arguments}
    with pytest.raises(error, match=message):
        ensemble(**given)


@pytest.mark.parametrize(
    "options", [{"threads": 0}, {"chunk": -1}, {"chunk": 2.5}, {"executor": 3}]
)
def test_bad_work_is_refused(options):
    with pytest.raises(OptionError, match=f"^{next(iter(options))}"):
        Work(**options)


def test_quiet_without_a_terminal(system, starts, capfd):
    ensemble(system, starts[:5], 1.0)  # a compilation that takes long says so
    capfd.readouterr()
    ensemble(system, starts[:5], 1.0, work=Work(progress=True))
    out, err = capfd.readouterr()
    assert out == "" and err == ""


LONG = {"t_end": 1e8, "max_steps": 10**7}  # minutes, if nothing ends it


@pytest.fixture
def endless():
    """A system without events, compiled."""
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    system = FilippovSystem([x, v], surface=v - 9, above=[v, -x - 1], below=[v, -x])
    starts = np.random.default_rng(0).normal(size=(400, 2))
    ensemble(system, starts[:100], 1.0, work=Work(chunk=50, threads=1))
    return system, starts


@pytest.fixture
def keyboard():
    """Ctrl-C is heard as at a terminal, also where a shell has put the tests in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def press():
    """Press Ctrl-C, from whatever thread."""
    signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
    return False


@needs_compiler
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_interrupt_from_the_keyboard_is_heard_inside_a_chunk(endless, keyboard, monkeypatch):
    monkeypatch.setattr(chunks.run_chunk, "__defaults__", (None, press))  # called between bursts
    with pytest.raises(KeyboardInterrupt):
        ensemble(*endless, **LONG, work=Work(chunk=50, threads=1))


@needs_compiler
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_interrupt_from_the_keyboard_is_heard_inside_the_chunks_of_threads(
    endless, keyboard, monkeypatch
):
    class Pressed(threading.Event):
        pressed = False

        def is_set(self):
            if not Pressed.pressed:
                Pressed.pressed = True
                press()
            return super().is_set()

    monkeypatch.setattr(work_module, "threading", types.SimpleNamespace(Event=Pressed))
    with pytest.raises(KeyboardInterrupt):
        ensemble(*endless, **LONG, work=Work(chunk=50, threads=2))
    assert Pressed.pressed


@pytest.mark.slow
def test_runs_that_fall_back_share_the_itineraries_of_lanes():
    """Starts on the surface at a fold fall back to the scalar driver; their neighbours do not."""
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    system = FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])
    starts = np.stack([np.linspace(-2.0, 2.0, 401), np.zeros(401)], axis=1)
    starts[::4, 1] = np.linspace(-1.0, 1.0, 101)
    many = ensemble(system, starts, 20.0)
    assert len(set(many.itineraries)) == len(many.itineraries) and "" not in many.itineraries
    single = [simulate(system, start, 20.0).itinerary for start in starts[::40]]
    assert many.itinerary[::40].tolist() == single


@pytest.mark.parametrize(("engine", "count"), [("core", 3), ("lanes", 100)])
def test_events_that_cannot_happen_are_none(engine, count):
    """A relay enters sliding once; a saw is set back by 1 whenever it reaches 5."""
    x, starts = ca.SX.sym("x"), np.linspace(-1.0, 4.0, count)[:, None]
    relay = FilippovSystem([x], surface=x, above=[-1], below=[2], stops=Stop(x - 5, 1))
    many = ensemble(relay, starts, 10.0)
    assert many.engine == engine
    assert list(many.events) == list(KINDS)
    for kind, number in pickle.loads(pickle.dumps(many)).events.items():
        assert number.shape == (count,) and np.all(number == (kind in ("entry", "end"))), kind
    saw = ensemble(FilippovSystem([x], field=[1], resets=Reset(x - 5, [x - 1], 1)), starts, 9.7)
    assert np.array_equal(saw.events["reset"], np.floor(5.7 + starts[:, 0]))
    assert np.all(saw.events["end"] == 1) and not saw.events["stop"].any()


@needs_compiler
def test_lanes_are_compiled_where_that_pays(monkeypatch):
    """A hundred starts of an oscillator wait for a compiler where the runs take as long one by one."""
    monkeypatch.setattr("nonsmooth.flow.ensembles.ensemble._WORTH", WORTH)
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    system = FilippovSystem([x, v], surface=x, above=[v, -1 - x], below=[v, 1 - x])
    starts = np.random.default_rng(0).normal(size=(100, 2))
    engines = [ensemble(system, starts, t_end).engine for t_end in (10.0, 9000.0)]
    assert engines == ["core", "lanes"]
    starts[49] = np.nan  # of which nothing is known
    assert ensemble(system, starts, 10.0).engine == "lanes"


@needs_compiler
def test_programs_that_are_compiled_for_long_are_not_compiled_for_short_ensembles(monkeypatch):
    """Lanes of a hundred oscillators are printed and compiled for half a minute, 64 runs of them take 0.4 s."""
    monkeypatch.setattr("nonsmooth.flow.ensembles.ensemble._WORTH", WORTH)
    x, v = ca.SX.sym("x", 50), ca.SX.sym("v", 50)
    pull = -ca.sin(x) - 0.1 * (x - ca.vertcat(x[1:], 0)) ** 3
    above, below = ca.vertcat(v, pull - 1), ca.vertcat(v, pull + 1)
    system = FilippovSystem(ca.vertcat(x, v), surface=x[0], above=above, below=below)
    assert ensemble(system, np.full((64, 100), 0.2), 10.0).engine == "core"


@needs_compiler
@pytest.mark.parametrize(
    ("made", "section"),
    [
        (make_system, Section("crossing", count=5)),
        (make_system, Section("h0", count=7)),
        (make_system, Section("h0", count=2, skip=1, every=2)),
        (make_system, Section("h0", direction=-1, count=50)),
        (make_system, Section("entry", count=3)),
        (make_system, Section("exit", count=100)),
        (bouncing, Section("wall", count=5)),
        (bouncing, Section("impact", count=3, skip=1, every=2)),
        (bouncing, Section("reset", count=50)),
        (bouncing, Section("wall", count=4, after=True)),
    ],
    ids=lambda own: getattr(own, "__name__", str(own)),
)
def test_sections_in_lanes_are_those_of_the_driver(made, section, monkeypatch):
    starts = np.random.default_rng(2).normal(size=(100, 2)) / (1 + 3 * (made is bouncing))
    starts[7] = np.nan
    run = lambda: ensemble(made(), starts, 30.0, at=section)
    lanes = run()
    monkeypatch.setattr("nonsmooth.flow.ensembles.ensemble._WORTH", math.inf)
    core = run()
    assert (lanes.engine, core.engine) == ("lanes", "core")
    assert np.isfinite(core.sample_t).sum() > 5
    assert np.array_equal(lanes.status, core.status)
    assert lanes.itinerary.tolist() == core.itinerary.tolist()
    for name in ("sample_t", "sample_x", "x", "t"):
        np.testing.assert_allclose(getattr(lanes, name), getattr(core, name), rtol=0, atol=1e-8)


@pytest.mark.parametrize("engine", ["core", pytest.param("lanes", marks=needs_compiler)])
def test_samples_at_the_very_times_of_ticks_are_after_them(engine, monkeypatch):
    """Of the ticks n 0.2 many are between two numbers; the time of an event is the nearest."""
    worth = 0.0 if engine == "lanes" else math.inf
    monkeypatch.setattr("nonsmooth.flow.ensembles.ensemble._WORTH", worth)
    x = ca.SX.sym("x")
    system = FilippovSystem([x], field=[0], clocks=Clock(0.2, {x: x + 1}))
    ticks = 0.2 * np.arange(1, 301)
    times = np.unique([ticks, ticks.round(9), np.nextafter(ticks, 0)])
    many = ensemble(system, np.zeros((64, 2)), 60.1, t_eval=times)
    one = simulate(system, np.zeros(2), 60.1, t_eval=times)
    assert many.engine == engine
    assert [event.t for event in one.events if event.kind == "reset"] == ticks.tolist()
    for found in (one.sample_x, *many.sample_x):
        assert np.array_equal(found[:, 0], np.searchsorted(ticks, times, side="right"))
