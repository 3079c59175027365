"""The GPU's kernels, as C++ on this processor, give what the lanes give: the same bits where nothing is fused."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
import nonsmooth.textbook as textbook
from benchmarks.problems import bounce_system, random_starts
from nonsmooth.flow.constants import FALL_BACK
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.engine import lanes as engine
from nonsmooth.flow.engine.device import kernel as kernel_module
from nonsmooth.flow.engine.device.kernel import Given, Kernel, Source
from nonsmooth.flow.engine.device.records import FROZEN, word_of
from nonsmooth.flow.ensembles import on_device
from nonsmooth.flow.options import Options
from nonsmooth.flow.results import Chunk
from tests.flow.engine.device.cases import TAKEN, block_on_a_belt, ends
from tests.flow.engine.device.shim import Shim

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

LOOSE = Options(t_end=3.0, rtol=1e-5, atol=1e-5)


STARTS = np.random.default_rng(3).normal(size=(200, 2)) * 0.8


@pytest.fixture(scope="module")
def system():
    return block_on_a_belt()


@pytest.fixture
def shim():
    return Shim(fused=False)


@pytest.fixture
def as_card(monkeypatch, shim):
    """``device="cuda"`` runs in the shim."""
    monkeypatch.setattr(on_device, "machine_for", lambda device: shim)


def agree(there, here, digits):
    """Itineraries and events are equal, and numbers to some digits."""
    assert there.itinerary.tolist() == here.itinerary.tolist()
    assert np.array_equal(there.status, here.status)
    for kind, count in here.events.items():
        assert np.array_equal(there.events[kind], count), kind
    for name in ("x", "t", "event_x", "event_t"):
        pair = getattr(there, name), getattr(here, name)
        np.testing.assert_allclose(*pair, rtol=0, atol=digits, err_msg=name)


def plain_lanes(system, x, p, options, at, monkeypatch):
    """What four lanes say without fused operations."""
    monkeypatch.setattr(engine, "FLAGS", (*engine.FLAGS, "-ffp-contract=off"))
    monkeypatch.setattr(engine, "lane_width", lambda: 4)
    return engine.Lanes(system, options.order).run_many(x, p, options, at)


def compared(system, x, options, machine, monkeypatch, at=None, p=None):
    """Trajectories without a fallback in either: both results, and their number."""
    x = np.concatenate([x, np.full((len(x), int(system.time_dependent)), options.t_start)], axis=1)
    p = system.parameter_vector() if p is None else p
    one = ends(machine, system, x, options, p, at)
    two = plain_lanes(system, x, p, options, at, monkeypatch)
    # Undecided steps of the kernel fall back to the driver, which makes them here.
    done = one.status != FALL_BACK
    words = [[c.words[k] for k in c.itinerary[done]] for c in (one, two)]
    assert words[0] == words[1]
    for name in ("t", "x", "status", "kinds", "at_t", "at_x"):
        if getattr(one, name) is not None:
            pair = getattr(one, name)[done], getattr(two, name)[done]
            assert np.array_equal(*pair, equal_nan=True), name
    return done


@pytest.mark.slow
def test_same_bits_as_lanes_without_contraction(system, shim, monkeypatch):
    done = compared(system, STARTS, LOOSE, shim, monkeypatch, at=(1, 1))
    assert done.sum() > 150


def test_same_bits_with_parameters_of_each_start(system, shim, monkeypatch):
    p = system.parameter_vector() * np.linspace(0.5, 1.5, len(STARTS))[:, None]
    assert compared(system, STARTS, LOOSE, shim, monkeypatch, p=p).sum() > 150


def test_an_ensemble_there_is_the_ensemble_here(system, as_card):
    """All starts, with those that fall back: itineraries and events equal, states to the tolerance."""
    options = dict(t_end=3.0, tol=1e-8, at_event=("entry", 1))
    x = STARTS.copy()
    x[7] = np.nan
    there = ns.ensemble(system, x, device="cuda", **options)
    here = ns.ensemble(system, x, **options)
    agree(there, here, 1e-8)


@pytest.mark.parametrize(
    "drawn",
    [
        ns.Grid([np.linspace(-1, 1, 7), np.linspace(0.1, 0.9, 5)]),
        ns.Grid([0.25, np.linspace(-1, 1, 9)]),
        ns.RandomStarts(50, [-1.0, 0.5], [1.0, 0.5], seed=2**64 - 3),
        ns.RandomStarts(50, [-1.0, -0.3], [0.7, 0.1], seed=5),
    ],
)
def test_starts_made_there_have_the_bits_of_those_made_here(system, as_card, drawn):
    rows = drawn.at(np.arange(np.prod(drawn.shape)))
    options = dict(t_end=1.0, tol=1e-5, device="cuda", work=ns.Work(chunk=13))
    made, given = ns.ensemble(system, drawn, **options), ns.ensemble(system, rows, **options)
    assert made.t.shape == drawn.shape
    assert np.array_equal(made.x.reshape(-1, 2), given.x)
    assert np.array_equal(made.itinerary.ravel(), given.itinerary)


def test_a_share_of_threads_changes_nothing(system):
    """Persistent threads: how many there are, and how they share the starts, is not in the results."""
    p, results = system.parameter_vector(), []
    for blocks in (1, 2, 50):
        x = np.concatenate([STARTS, np.zeros((len(STARTS), 1))], axis=1)
        machine = Shim(fused=False, blocks=blocks)
        results.append(ends(machine, system, x, LOOSE, p))
    for other in results[1:]:
        assert np.array_equal(results[0].x, other.x)
        assert np.array_equal(results[0].itinerary, other.itinerary)


def clock():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    return ns.FilippovSystem([x, y], surface=x, above=[y, -1 - x], below=[y, 1 - x])


@pytest.mark.parametrize("random", [0, 5])
def test_of_long_itineraries_the_first_modes_are_kept(monkeypatch, random):
    monkeypatch.setattr(on_device, "machine_for", lambda device: Shim(fused=False, random=random))
    starts, options = [[1.0, 0.0], [0.01, 0.0], [0.1, 0.0]], dict(t_end=10.0, tol=1e-6)
    there, here = (ns.ensemble(clock(), starts, device=d, **options) for d in ("cuda", None))
    words = here.itinerary.tolist()
    counts = [len(word.split()) for word in words]
    assert counts[0] < 30 < counts[1]
    words = [word if len(word) < 60 else word[:60] + "..." for word in words]
    assert there.itinerary.tolist() == words
    assert np.array_equal(there.events["crossing"], here.events["crossing"])
    np.testing.assert_allclose(there.x, here.x, rtol=0, atol=1e-6)
    found = ns.outcomes(clock(), starts, device="cuda", **options)
    assert found.itineraries == dict.fromkeys(words, 1)


def test_modes_that_are_kept_stay_where_a_step_is_not_clear(as_card):
    """The run falls back at its last event, after many modes for which there was no room."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    spiral = ns.FilippovSystem([x, y], surface=x, above=[y, -1 - 2 * y], below=[y, 1 - 2 * y])
    runs = ns.ensemble(spiral, [[-1.0, 0.3]], 40.0, tol=1e-8, max_events=100, device="cuda")
    assert runs.status == [ns.Status.TOO_MANY_EVENTS]
    assert runs.itinerary[0] == "- + " * 15 + "..."


@pytest.mark.parametrize(("name", "random"), [("belt", 1), ("belt", 2), ("linear", 3)])
def test_runs_go_on_where_the_card_left_them(name, random, monkeypatch):
    """Every other step is the driver's: events and itineraries are equal, and numbers to the tolerance."""
    belt = name == "belt"
    system = block_on_a_belt() if belt else bounce_system(name)
    x = STARTS[:100].copy() if belt else random_starts(100, seed=5)
    x[3], x[5] = np.nan, 0.0
    p = {"friction": np.linspace(0.2, 0.5, 100)} if belt else {}
    options = dict(tol=1e-7, parameters=p, at_event=("entry", 1), t_end=3.0 if belt else 100.0)
    here = ns.ensemble(system, x, **options)
    shim = Shim(random=random)
    monkeypatch.setattr(on_device, "machine_for", lambda device: shim)
    there = ns.ensemble(system, x, device="cuda", **options)
    agree(there, here, 1e-5)
    assert np.isfinite(there.event_t).sum() > 10
    # Which runs continue together changes nothing.
    pieces = ns.ensemble(system, x, device="cuda", work=ns.Work(chunk=7, threads=3), **options)
    assert np.array_equal(pieces.x, there.x, equal_nan=True)
    assert np.array_equal(pieces.event_t, there.event_t, equal_nan=True)
    assert pieces.itinerary.tolist() == there.itinerary.tolist()


def test_launches_are_bounded(system, monkeypatch):
    """What a launch has no steps for continues in the next one, to the same bits."""
    p, found = system.parameter_vector(), []
    for steps in (10**6, 1, 3):
        shim = Shim(fused=False)
        launched = []
        monkeypatch.setattr(
            shim, "launch", lambda *a, f=shim.launch, n=launched: (n.append(a[1]), f(*a))
        )
        kernel = Kernel(system, LOOSE.order, shim)
        kernel.steps = steps
        monkeypatch.setattr(kernel_module, "_SECONDS", 0.0)  # the number of steps does not grow
        chunk = Chunk.empty(len(STARTS), system, True)
        left = kernel.run(Given(Source.rows(STARTS), 0, len(STARTS), p, LOOSE), (2, 1), chunk)
        found.append((chunk, left))
        assert (launched.count("trajectories") > 20) == (steps < 4)
    for chunk, left in found[1:]:
        for name, array in found[0][0].arrays().items():
            assert np.array_equal(getattr(chunk, name), array, equal_nan=name.startswith("at")), (
                name
            )
        assert np.array_equal(left, found[0][1]) and left.size


def test_codes_beyond_the_table(system, as_card, monkeypatch):
    options = dict(t_end=3.0, tol=1e-5)
    whole = ns.ensemble(system, STARTS, device="cuda", **options)
    counted = ns.outcomes(system, STARTS, device="cuda", ranges={"x": (-1, 1)}, **options)
    monkeypatch.setattr(kernel_module, "TABLE_SIZE", 2)
    few = ns.ensemble(system, STARTS, device="cuda", **options)
    assert few.itinerary.tolist() == whole.itinerary.tolist()
    again = ns.outcomes(system, STARTS, device="cuda", ranges={"x": (-1, 1)}, **options)
    assert again.itineraries == counted.itineraries and again.status == counted.status
    assert np.array_equal(again.histogram["x"], counted.histogram["x"])
    assert again.mean["v"] == pytest.approx(counted.mean["v"])


def test_codes_are_read_from_the_first_mode_on():
    assert word_of(0, "+-s") == ""
    assert word_of(4 * (4 * 1 + 3) + 2, ("+", "-", "s")) == "+ s -"
    assert word_of(1, ("",)) == "o"
    assert word_of(FROZEN + 1, "+-s") == "+ ..."


@pytest.mark.slow
@pytest.mark.parametrize("name", ["linear", "nonlinear"])
def test_bounces(name, monkeypatch):
    system, x, options = bounce_system(name), random_starts(2000, seed=5), Options(t_end=100.0)
    done = compared(system, x, options, Shim(fused=False), monkeypatch)
    assert done.mean() > 0.97
    one, two = (ends(Shim(fused=fused), system, x, options) for fused in (False, True))
    assert np.array_equal(one.status, two.status)
    assert [one.words[k] for k in one.itinerary] == [two.words[k] for k in two.itinerary]
    np.testing.assert_allclose(one.x[done], two.x[done], rtol=0, atol=1e-14)
    np.testing.assert_allclose(one.t[done], two.t[done], rtol=0, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("name", TAKEN)
def test_textbook_problems(name, monkeypatch):
    problem = textbook.by_name(name)
    scale = 0.1 * (1 + np.abs(problem.start))
    x = problem.start + scale * np.random.default_rng(1).normal(size=(64, len(problem.start)))
    p = problem.system.parameter_vector(problem.parameters)
    options = Options(t_end=min(problem.t_end, 20.0), rtol=1e-8, atol=1e-8, max_steps=3000)
    compared(problem.system, x, options, Shim(fused=False), monkeypatch, p=p)
