"""What an executor is given and what waits for it are small, however fast and however many the runs are."""

import gc
import pickle
import sys
import threading
import weakref
from concurrent.futures import Executor, Future, ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.ensembles import work as work_module
from nonsmooth.flow.results import Collected

x, v = ca.SX.sym("x"), ca.SX.sym("v")
BLOCK = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 1], below=[v, -x + 1])
RANDOM = ns.RandomStarts(2000, low=[-3, 0], high=[3, 1], seed=2)
GRID = ns.Grid([np.linspace(-3, 3, 50), np.linspace(0, 1, 40)])


class Here(Executor):
    """Runs what it is given at once, as another process would: from its pickle."""

    def __init__(self):
        self.sizes, self.results = [], []

    def submit(self, fn, /, *args, **kwargs):
        sent = pickle.dumps((fn, args, kwargs))
        self.sizes.append(len(sent))
        fn, args, kwargs = pickle.loads(sent)
        future = Future()
        future.set_result(fn(*args, **kwargs))
        self.results.append(weakref.ref(future))
        return future


def run(starts, executor=None, chunk=100, **kwargs):
    work = ns.Work(executor=executor, chunk=chunk, threads=None if executor else 1, progress=False)
    return ns.ensemble(BLOCK, starts, 5.0, work=work, **kwargs)


@pytest.mark.parametrize("starts", [RANDOM, GRID], ids=["random", "grid"])
def test_starts_made_by_a_rule_travel_as_the_rule(starts):
    small, large = Here(), Here()
    found = run(starts, small, chunk=10), run(starts, large, chunk=1000)
    assert abs(max(large.sizes) - max(small.sizes)) < 100
    for many in found:
        assert many.x.tobytes() == run(starts).x.tobytes()


def test_so_they_do_where_they_are_broadcast_with_parameters_and_time():
    t, a = ca.SX.sym("t"), ca.SX.sym("a")
    pushed = ns.FilippovSystem(
        [x, v], surface=v, above=[v, a * ca.cos(t) - 1], below=[v, a * ca.cos(t) + 1],
        parameters=[a], time=t,
    )  # fmt: skip
    starts = ns.Grid([np.linspace(-3, 3, 9), 0.5])
    given = dict(t_start=0.3, parameters={"a": np.linspace(0, 1, 7)[:, None]}, t_end=4.0)
    one = ns.ensemble(pushed, starts, work=ns.Work(threads=1, progress=False), **given)
    work = ns.Work(executor=Here(), chunk=5, progress=False)
    two = ns.ensemble(pushed, starts, work=work, **given)
    assert one.x.shape == (7, 9, 2) and one.x.tobytes() == two.x.tobytes()


def test_a_future_is_let_go_when_its_result_is_there(monkeypatch):
    """A cluster keeps a result, and computes it again where a worker is lost, while its future is held."""
    executor, held, put = Here(), [], Collected.put

    def counted(self, first, chunk):
        held.append(sum(ref() is not None for ref in executor.results))
        put(self, first, chunk)

    monkeypatch.setattr(Collected, "put", counted)
    gc.disable()
    try:
        run(RANDOM, executor, chunk=20)
    finally:
        gc.enable()
    assert len(held) == 100 and max(held) == 0


def answered(number, error=None):
    future = Future()
    if error is None:
        future.set_result(number)
    else:
        future.set_exception(error)
    return future


def work_of(submit):
    """Thirty numbers, of which eight may be under way."""
    return work_module._submit(iter((k, k) for k in range(30)), submit, 8)


def test_new_work_is_given_as_soon_as_one_result_is_taken():
    """Not when all that were finished at one instant have been taken: workers would wait for that."""
    given, taken = [], []

    def submit(number):
        given.append(number)
        return answered(number)

    for number, result in work_of(submit):
        assert number == result
        taken.append(number)
        assert len(given) == min(30, len(taken) + 7)
    assert sorted(taken) == list(range(30))


def refusing(number):
    """Takes no more, as a pool of processes does when one of them was killed."""
    if number == 5:
        raise RuntimeError("broken")
    return answered(number)


def failing(number):
    return answered(number, ValueError("number two") if number == 2 else None)


@pytest.mark.parametrize(
    ("submit", "error", "least", "most"),
    [
        (failing, ValueError, {0, 1, 3, 4, 5, 6, 7}, {*range(30)} - {2}),
        (refusing, RuntimeError, {*range(5)}, {*range(5)}),
    ],
)
def test_what_is_finished_is_taken_before_an_error_is_reported(submit, error, least, most):
    taken = []
    with pytest.raises(error, match=r"number two|broken"):
        for number, _ in work_of(submit):
            taken.append(number)
    assert least <= set(taken) <= most and len(taken) == len(set(taken))


def test_what_was_not_begun_is_taken_back_after_an_error():
    began, gate = [], threading.Event()

    def task(number):
        began.append(number)
        if number == 0:
            raise ValueError("number none")
        gate.wait(10)

    with ThreadPoolExecutor(1) as pool:
        work = work_of(lambda k: pool.submit(task, k))
        with pytest.raises(ValueError, match="number none"):
            next(work)
        gate.set()
    assert len(began) <= 2


@pytest.mark.parametrize("room", [None, 1000])
def test_results_on_their_way_are_small_unless_the_size_is_given(room, tmp_path, monkeypatch):
    """Sixty-four may be under way; with many samples each has fewer trajectories."""
    times, stop = None if room is None else np.linspace(0, 5, room), RuntimeError("seen")
    work = ns.Work(store=tmp_path / "small", progress=False)
    ns.ensemble(BLOCK, RANDOM, 5.0, t_eval=times, work=work)
    (tmp_path / "small" / "itinerary_code.npy").unlink()
    row = sum(path.stat().st_size - 128 for path in (tmp_path / "small").glob("*.npy")) / 2000
    seen, size_of_chunk = [], work_module.size_of_chunk

    def sized(*args):
        seen.append(size_of_chunk(*args))
        raise stop

    monkeypatch.setattr(work_module, "_probe", lambda job, starts, k: 1e-7 * k)
    monkeypatch.setattr(sys.modules["nonsmooth.flow.ensembles.ensemble"], "size_of_chunk", sized)
    starts = ns.RandomStarts(10**8, low=[-3, 0], high=[3, 1])
    for executor in (Here(), None):
        work = ns.Work(executor=executor, store=tmp_path / "large", progress=False)
        with pytest.raises(RuntimeError, match="seen"):
            ns.ensemble(BLOCK, starts, 5.0, t_eval=times, work=work)
    assert 0.9 * 2**22 <= seen[0] * row <= 2**22 < seen[1] * row
