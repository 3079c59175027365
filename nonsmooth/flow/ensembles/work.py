"""Running the chunks of an ensemble in threads or on an executor, with progress and a store."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, Protocol, TypeVar

import numpy as np

from ...model import Array, OptionError
from ..results import Chunk
from .chunks import Job, run_chunk, run_cut, shipped
from .progress import progress_bar
from .starts import Starts
from .store import Store

#: Largest number of chunks in flight with an executor, and largest size of the results of each (bytes).
_IN_FLIGHT, _SHIPPED = 64, 1 << 22

#: Time of a chunk, of an ensemble that is worth several chunks, and of a probe that can be measured
#: (seconds).
_SECONDS, _WORTH, _PROBE = 1.0, 0.02, 0.002

#: Least number of short trajectories in a chunk, and largest number of any.
_LEAST, _LARGEST = 256, 1 << 18


@dataclass(frozen=True)
class Work:
    """Threads, chunks and storage of an ensemble; the results do not depend on them.

    Parameters
    ----------
    threads : int, optional
        Threads in this process; all processors that it may use unless given.
    executor : concurrent.futures.Executor, optional
        Runs the chunks instead: processes, or ``dask.distributed.Client(...).get_executor()``.
    chunk : int, optional
        Trajectories in one piece of work; a few are timed to choose it unless given.
    progress : bool, optional
        A bar for runs of some seconds on a terminal; nothing in logs.
    store : path, optional
        A folder for the results: arrays (``x.npy``, ...) that are mapped into memory and filled chunk
        by chunk, so that results of any size need no memory; starts need none as a :class:`Grid` or
        :class:`RandomStarts`. After an interruption a call with the same problem computes the chunks
        that are missing, with bit-identical results; the folder of another problem is refused.

    Raises
    ------
    OptionError
        ``threads`` or ``chunk`` is not positive; ``executor`` is none; ``store`` is no path.

    Examples
    --------
    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x = ca.SX.sym("x")
    >>> system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
    >>> starts = np.linspace(-1, 1, 5)[:, None]
    >>> ns.ensemble(system, starts, t_end=2.0, work=ns.Work(threads=1, progress=False)).x[:, 0]
    array([0., 0., 0., 0., 0.])
    """

    threads: int | None = None
    executor: Executor | None = None
    chunk: int | None = None
    progress: bool = True
    store: str | os.PathLike[str] | None = None

    def __post_init__(self) -> None:
        _positive("chunk", 1 if self.chunk is None else self.chunk)
        _positive("threads", 1 if self.threads is None else self.threads)
        if not (
            self.store is None or (isinstance(self.store, (str, os.PathLike)) and str(self.store))
        ):
            raise OptionError(
                f'store is {self.store!r}. Give the path of a folder, for example store="sweep".'
            )
        if self.executor is not None and not isinstance(self.executor, Executor):
            raise OptionError(
                f"executor is {self.executor!r}, a {type(self.executor).__name__}. Give a "
                "concurrent.futures.Executor, for example ProcessPoolExecutor() or "
                "dask.distributed.Client(...).get_executor()."
            )

    @property
    def workers(self) -> int:
        """Number of chunks in flight: the threads, or the limit for an executor."""
        return (self.threads or _processors()) if self.executor is None else _IN_FLIGHT

    def largest(self, row: int) -> int:
        """Largest number of trajectories in a chunk, for results of ``row`` bytes each."""
        return _LARGEST if self.executor is None else min(_LARGEST, max(1, _SHIPPED // row))


def _positive(name: str, value: int) -> None:
    if not (isinstance(value, int) and value > 0):
        raise OptionError(f"{name} is {value!r}. Give a positive integer.")


class Sink(Protocol):
    """Collector of finished chunks."""

    def part(self, first: int, last: int) -> Chunk:
        """Return arrays for the results of some trajectories."""
        ...

    def put(self, first: int, chunk: Chunk) -> None:
        """Take a chunk that begins with trajectory ``first``."""
        ...


def run_all(
    job: Job,
    starts: Starts,
    results: Sink,
    work: Work,
    size: int,
    store: Store | None,
    on_device: Callable[[int, Chunk], Chunk] | None = None,
) -> None:
    """Run all trajectories, chunk by chunk, except those in the store."""
    bar = progress_bar(starts.count, work.progress)
    missing = []
    for number in range(math.ceil(starts.count / size)):
        first = number * size
        like = results.part(first, min(first + size, starts.count))
        done = store.load(number, like) if store is not None else None
        if done is None:
            missing.append(number)
        else:
            results.put(first, done)
            bar.update(len(done.t))
    ends = ((k, k * size, min((k + 1) * size, starts.count)) for k in missing)
    workers = min(work.threads or _processors(), len(missing))
    try:
        if on_device is not None:
            chunks = ((k, on_device(a, results.part(a, b))) for k, a, b in ends)
        else:
            chunks = _chunks(job, starts, results, ends, workers, work.executor)
        with closing(chunks) as finished:
            for number, chunk in finished:
                results.put(number * size, chunk)
                if store is not None:
                    store.save(number, chunk)
                bar.update(len(chunk.t))
    finally:
        bar.close()


def size_of_chunk(job: Job, starts: Starts, workers: int, most: int = _LARGEST) -> int:
    """Number of trajectories in a chunk, from the time that a few of them take."""
    count, k, spent = starts.count, 1, 0.0
    if count < 2:
        return 1  # nothing to divide
    while True:
        spent = _probe(job, starts, k)
        if _PROBE < spent < _SECONDS and 64 * k <= count:
            spent = min(spent, _probe(job, starts, k))  # without what is done only once
        if spent > _PROBE or 64 * k > count or (k >= _LEAST and 8 * spent > _PROBE):
            break
        k *= 8
    every = max(spent / k, 1e-9)
    if count * every < _WORTH:
        return max(count, 1)
    size = min(_SECONDS / every, count / (4 * workers))
    least = min(_LEAST, math.ceil(count / workers)) if every < 1e-3 else 1
    return min(max(math.ceil(size), least), most)


def _probe(job: Job, starts: Starts, k: int) -> float:
    """Seconds that k of the trajectories take."""
    x, p = starts.rows(np.linspace(0, starts.count - 1, k).astype(np.int64))
    began = _clock()
    run_chunk(job, x, p)
    return _clock() - began


def _clock() -> float:
    """Processor time of this thread, which does not depend on the load of the machine."""
    fine = time.get_clock_info("thread_time").resolution < 1e-4
    return time.thread_time() if fine else time.perf_counter()


#: The number of a chunk, its first trajectory and the one after its last.
_Piece = tuple[int, int, int]


def _chunks(
    job: Job,
    starts: Starts,
    results: Sink,
    pieces: Iterator[_Piece],
    workers: int,
    executor: Executor | None,
) -> Generator[tuple[int, Chunk], None, None]:
    """Finished chunks in the order in which they finish; a bounded number is in flight."""
    if isinstance(executor, ThreadPoolExecutor):
        rows = ((k, *starts.part(a, b)) for k, a, b in pieces)
        yield from _submit(rows, lambda x, p: executor.submit(run_chunk, job, x, p), _IN_FLIGHT)
    elif executor is not None:
        job = shipped(job)
        cuts = ((k, starts.cut(a, b)) for k, a, b in pieces)
        yield from _submit(cuts, lambda cut: executor.submit(run_cut, job, cut), _IN_FLIGHT)
    else:
        work = ((k, *starts.part(a, b), results.part(a, b)) for k, a, b in pieces)
        if workers < 2:
            for number, x, p, out in work:
                yield number, run_chunk(job, x, p, out)
        else:
            yield from _in_threads(job, work, workers)


def _in_threads(
    job: Job, work: Iterator[tuple[int, Array, Array, Chunk]], workers: int
) -> Generator[tuple[int, Chunk], None, None]:
    pool, stop = ThreadPoolExecutor(workers), threading.Event()
    here = lambda x, p, out: pool.submit(run_chunk, job, x, p, out, stop.is_set)
    try:
        yield from _submit(work, here, 2 * workers)
    except BaseException:
        stop.set()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


_T = TypeVar("_T")


def _submit(
    work: Iterator[tuple[Any, ...]], submit: Callable[..., Future[_T]], limit: int
) -> Iterator[tuple[int, _T]]:
    """Results with their numbers, as they are finished."""
    # A future is released with its result: a cluster keeps the result of every future, and computes it
    # again where its worker is lost.
    pending: dict[int, Future[_T]] = {}
    finished: SimpleQueue[tuple[int, _T | None, BaseException | None]] = SimpleQueue()
    count = 0

    def note(number: int, future: Future[_T]) -> None:
        pending.pop(number, None)
        error = CancelledError() if future.cancelled() else future.exception()
        finished.put((number, None if error else future.result(), error))

    try:
        while True:
            while count < limit and (item := next(work, None)) is not None:
                try:
                    pending[item[0]] = submit(*item[1:])
                except Exception:
                    yield from _taken(finished)  # finished chunks are saved first
                    raise
                count += 1
                pending[item[0]].add_done_callback(partial(note, item[0]))
            if not count:
                return
            number, result, error = finished.get()
            count -= 1
            if error is not None:
                yield from _taken(finished)
                raise error
            yield number, result  # type: ignore[misc]  # no error, so there is a result
            del result
    finally:
        for future in list(pending.values()):
            future.cancel()


def _taken(
    finished: SimpleQueue[tuple[int, Any, BaseException | None]],
) -> Iterator[tuple[int, Any]]:
    """Results that are finished, without errors."""
    try:
        while True:
            number, result, error = finished.get_nowait()
            if error is None:
                yield number, result
    except Empty:
        return


def checked_work(work: Any) -> Work:
    """A Work as it is, the default for None; OptionError otherwise."""
    if work is not None and not isinstance(work, Work):
        raise OptionError(
            f"work is {work!r}, a {type(work).__name__}. Give a Work, for example "
            "nonsmooth.Work(threads=2)."
        )
    return work or Work()


def _processors() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1
