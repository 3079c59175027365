"""How the work of an ensemble is done: chunks, threads or an executor, progress, checkpoints."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass

from ..model import Array, OptionError, explain
from .checkpoint import Checkpoint
from .chunks import Job, run_chunk, shipped
from .progress import progress_bar
from .results import Chunk, Collected
from .starts import Starts

#: Chunks under way at once with an executor.
_IN_FLIGHT = 64


@dataclass(frozen=True)
class Work:
    """How the work of an ensemble is done; the results do not depend on it.

    Parameters
    ----------
    threads : int, optional
        Threads in this process; all processors that it may use unless given.
    executor : concurrent.futures.Executor, optional
        Runs the chunks instead: processes, or ``dask.distributed.Client(...).get_executor()``.
    chunk : int, optional
        Trajectories in one piece of work.
    progress : bool, optional
        A bar for runs of some seconds on a terminal; nothing in logs.
    checkpoint : path, optional
        A folder for finished chunks. A later call with the same problem goes on from there, with
        bit-identical results; a checkpoint of another problem is refused.

    Raises
    ------
    OptionError

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
    chunk: int = 16384
    progress: bool = True
    checkpoint: str | os.PathLike[str] | None = None

    def __post_init__(self) -> None:
        _positive("chunk", self.chunk)
        _positive("threads", 1 if self.threads is None else self.threads)
        _require_path(self.checkpoint)
        if self.executor is not None and not isinstance(self.executor, Executor):
            raise OptionError(
                explain(
                    "executor",
                    expected="a concurrent.futures.Executor",
                    received=f"{self.executor!r} ({type(self.executor).__name__})",
                    advice="ProcessPoolExecutor(), or dask.distributed.Client(...).get_executor().",
                )
            )

    def checkpoint_of(self, problem: Callable[[], str]) -> Checkpoint | None:
        """Return the checkpoint of a problem, given as what makes its hash, if there is to be one.

        Raises
        ------
        OptionError
        """
        if self.checkpoint is None:
            return None
        return Checkpoint(self.checkpoint, problem(), self.chunk)


def _positive(name: str, value: int) -> None:
    if not (isinstance(value, int) and value > 0):
        raise OptionError(f"{name}: expected a positive integer, received {value!r}.")


def _require_path(value: object) -> None:
    if value is not None and not (isinstance(value, (str, os.PathLike)) and str(value)):
        raise OptionError(
            explain(
                "checkpoint",
                expected="the path of a folder",
                received=f"{value!r} ({type(value).__name__})",
                advice='For example checkpoint="sweep".',
            )
        )


def run_all(
    job: Job, starts: Starts, results: Collected, work: Work, saved: Checkpoint | None
) -> None:
    """Run all trajectories, chunk by chunk, except those that a checkpoint has.

    Parameters
    ----------
    job : Job
    starts : Starts
    results : Collected
        Filled.
    work : Work
    saved : Checkpoint or None
    """
    size = work.chunk if saved is None else saved.chunk
    bar = progress_bar(starts.count, work.progress)
    missing = []
    for number in range(math.ceil(starts.count / size)):
        first = number * size
        like = results.all.part(first, min(first + size, starts.count))
        done = saved.load(number, like) if saved is not None else None
        if done is None:
            missing.append(number)
        else:
            results.put(first, done)
            bar.update(len(done.t))
    ends = ((k, k * size, min((k + 1) * size, starts.count)) for k in missing)
    pieces = ((k, *starts.part(a, b), results.all.part(a, b)) for k, a, b in ends)
    workers = min(work.threads or _processors(), len(missing))
    try:
        with closing(_chunks(job, pieces, workers, work.executor)) as finished:
            for number, chunk in finished:
                if saved is not None:
                    saved.save(number, chunk)
                results.put(number * size, chunk)
                bar.update(len(chunk.t))
    finally:
        bar.close()


#: The number of a chunk, its starts and parameters, the arrays for its results.
_Piece = tuple[int, Array, Array, Chunk]


def _chunks(
    job: Job, work: Iterator[_Piece], workers: int, executor: Executor | None
) -> Generator[tuple[int, Chunk], None, None]:
    """Finished chunks in the order in which they finish; a bounded number is under way."""
    if executor is not None:
        if not isinstance(executor, ThreadPoolExecutor):
            job = shipped(job)
        away = lambda x, p, out: executor.submit(run_chunk, job, x, p)
        yield from _submit(work, away, _IN_FLIGHT)
    elif workers < 2:
        for number, x, p, out in work:
            yield number, run_chunk(job, x, p, out)
    else:
        yield from _in_threads(job, work, workers)


def _in_threads(
    job: Job, work: Iterator[_Piece], workers: int
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


def _submit(
    work: Iterator[_Piece],
    submit: Callable[[Array, Array, Chunk], Future[Chunk]],
    limit: int,
) -> Iterator[tuple[int, Chunk]]:
    pending: dict[Future[Chunk], int] = {}
    exhausted = False
    try:
        while pending or not exhausted:
            while not exhausted and len(pending) < limit:
                item = next(work, None)
                if item is None:
                    exhausted = True
                else:
                    pending[submit(*item[1:])] = item[0]
            if pending:
                finished, _ = wait(pending, return_when=FIRST_COMPLETED)
                for future in sorted(finished, key=_failed):  # what is finished is saved first
                    yield pending.pop(future), future.result()
    finally:
        for future in pending:
            future.cancel()


def _failed(future: Future[Chunk]) -> bool:
    return future.cancelled() or future.exception() is not None


def _processors() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1
