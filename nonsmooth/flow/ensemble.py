"""The verb ``ensemble``: many starts, many parameters, one result for each.

It knows how to broadcast, to cut into chunks and to give the chunks to threads or to any
``concurrent.futures`` executor; it does not know how a trajectory is integrated.
"""

from __future__ import annotations

import hashlib
import math
import os
import threading
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model import Array, FilippovSystem, OptionError, PointError, explain, require_system
from .checkpoint import Checkpoint
from .chunks import Job, run_chunk, shipped
from .compiled.engine import KINDS, Chunk, engine_for, supports_lanes
from .compiled.select import use_compiled
from .options import Options
from .status import Status

#: Fewer trajectories than this are not worth compiling the engine that runs several in step.
_FEW = 64
_IN_FLIGHT = 64


@dataclass(frozen=True, repr=False)
class Ensemble:
    """Results, each of the shape ``(...)`` of the broadcast starts and parameters.

    Attributes
    ----------
    x : ndarray (..., n)
        Last states.
    t : ndarray (...)
        Last times.
    status : ndarray of int8 (...)
        Values of :class:`Status`; compare with its members.
    itineraries : tuple of str
        The different itineraries that occur, sorted.
    itinerary_code : ndarray of int32 (...)
        Position in ``itineraries``.
    events : dict of str to ndarray of int32 (...)
        Number of events by kind: crossing, entry, exit, stop, reset, end.
    event_x, event_t : ndarray (..., n), (...) or None
        State and time of the event asked for with ``at_event``; NaN where it did not happen.
    """

    x: Array
    t: Array
    status: NDArray[np.int8]
    itineraries: tuple[str, ...]
    itinerary_code: NDArray[np.int32]
    events: dict[str, NDArray[np.int32]]
    event_x: Array | None = None
    event_t: Array | None = None

    @property
    def itinerary(self) -> NDArray[np.object_]:
        """Itineraries as strings; equal ones are the same object."""
        return np.array([*self.itineraries, ""], dtype=object)[self.itinerary_code]

    @property
    def complete(self) -> NDArray[np.bool_]:
        """Where the run did what was asked: reached its end or a stop."""
        return (self.status == Status.REACHED_END) | (self.status == Status.STOPPED)

    def __repr__(self) -> str:
        found, number = np.unique(self.status, return_counts=True)
        counts = ", ".join(f"{Status(int(s))} {k}" for s, k in zip(found, number, strict=True))
        return (
            f"Ensemble(shape {self.t.shape}, {self.x.shape[-1]} states, "
            f"{len(self.itineraries)} itineraries; {counts})"
        )


def ensemble(
    system: FilippovSystem,
    x0: ArrayLike,
    t_end: float,
    *,
    t_start: float = 0.0,
    parameters: Mapping[Any, ArrayLike] | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    start_mode: str | None = None,
    max_step: float = math.inf,
    max_steps: int = 1_000_000,
    max_events: int = 100_000,
    at_event: tuple[str, int] | None = None,
    threads: int | None = None,
    executor: Executor | None = None,
    chunk: int = 16384,
    progress: bool = True,
    checkpoint: str | os.PathLike[str] | None = None,
    engine: str = "auto",
) -> Ensemble:
    """Integrate many trajectories and keep their ends.

    Parameters
    ----------
    system : FilippovSystem
    x0 : array_like (..., n)
        Starts. Those that are not finite get the status NOT_FINITE; the others go on.
    t_end : float
    t_start : float, optional
    parameters : mapping, optional
        Values that replace defaults: numbers, or arrays that broadcast with the starts.
    tol, rtol, atol, start_mode, max_step, max_steps, max_events : optional
        As in :func:`simulate`.
    at_event : (kind, k), optional
        Keep the state at the k-th event (from 1) of a kind, e.g. ``("crossing", 1)``.
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
    engine : {"auto", "reference", "compiled"}

    Returns
    -------
    Ensemble
        Independent of ``threads``, ``executor`` and ``chunk`` to the last bit.

    Raises
    ------
    PointError, ParameterError, OptionError, CompilerError

    Examples
    --------
    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x = ca.SX.sym("x")
    >>> system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
    >>> many = ns.ensemble(system, np.array([[-1.0], [0.5], [np.nan]]), t_end=0.4)
    >>> many.itinerary.tolist(), [str(ns.Status(s)) for s in many.status]
    (['- s', '+', ''], ['REACHED_END', 'REACHED_END', 'NOT_FINITE'])
    """
    options = Options(
        t_end=t_end,
        t_start=t_start,
        rtol=tol if rtol is None else rtol,
        atol=tol if atol is None else atol,
        max_step=max_step,
        max_steps=max_steps,
        max_events=max_events,
        start_mode=start_mode,
    )
    require_system(system)
    if executor is not None and not isinstance(executor, Executor):
        raise OptionError(
            explain(
                "executor",
                expected="a concurrent.futures.Executor",
                received=f"{executor!r} ({type(executor).__name__})",
                advice="ProcessPoolExecutor(), or dask.distributed.Client(...).get_executor().",
            )
        )
    if start_mode is not None:
        system.parse_mode(start_mode)
    starts = _Starts(system, x0, parameters, t_start)
    at = _event_number(at_event)
    _positive("chunk", chunk)
    _positive("threads", 1 if threads is None else threads)
    compiled = use_compiled(engine, engine_for(system, options) is not None)
    lanes = (
        compiled
        and supports_lanes(system)
        and start_mode is None
        and starts.count >= _FEW
        and t_end > t_start
    )
    job = Job(system, options, at, compiled, lanes)
    saved = None
    if checkpoint is not None:
        saved = Checkpoint(checkpoint, _problem(system, starts, options, at, compiled), chunk)
        chunk = saved.chunk
    results = _Results(system, starts.shape, at is not None)
    _run_all(job, starts, results, chunk, threads, executor, saved, progress)
    return results.ensemble()


# Input -------------------------------------------------------------------------------------------


class _Starts:
    """Starts and parameters broadcast against each other, given out chunk by chunk."""

    def __init__(
        self,
        system: FilippovSystem,
        x0: ArrayLike,
        parameters: Mapping[Any, ArrayLike] | None,
        t_start: float,
    ):
        self.system, self.t_start = system, t_start
        self.x0 = _numbers(x0, "x0")
        if self.x0.ndim == 0 or self.x0.shape[-1] != system.dimension:
            raise PointError(
                explain(
                    "x0",
                    expected=f"shape (..., {system.dimension}) for the states {system.state_names}",
                    received=f"shape {self.x0.shape}",
                    advice="States are on the last axis.",
                )
            )
        if parameters is not None and not isinstance(parameters, Mapping):
            system.parameter_vector(parameters)  # refuses what is no mapping
        arrays = {str(k): _numbers(v, f"parameter {k}") for k, v in (parameters or {}).items()}
        sample = {k: _sample(v) for k, v in arrays.items()}
        self.p = system.parameter_vector(sample)
        self.varied = {system.parameter_names.index(k): v for k, v in arrays.items() if v.ndim > 0}
        shapes = [self.x0.shape[:-1], *[v.shape for v in self.varied.values()]]
        try:
            self.shape = np.broadcast_shapes(*shapes)
        except ValueError as error:
            raise PointError(
                f"x0 and parameters: expected shapes that broadcast, received {shapes}."
            ) from error
        self.count = math.prod(self.shape)

    def part(self, first: int, last: int) -> tuple[Array, Array]:
        """Extended starts and parameters of the trajectories first to last - 1."""
        n = self.system.dimension
        x = _rows(self.x0, self.shape, first, last, n)
        if self.system.time_dependent:
            x = np.concatenate([x, np.full((last - first, 1), self.t_start)], axis=1)
        if not self.varied:
            return x, self.p
        p = np.tile(self.p, (last - first, 1))
        for column, values in self.varied.items():
            p[:, column] = _rows(values[..., None], self.shape, first, last, 1)[:, 0]
        return x, p


def _rows(values: Array, shape: tuple[int, ...], first: int, last: int, n: int) -> Array:
    """Rows first to last - 1 of values broadcast to ``(*shape, n)``, which is never made."""
    if values.shape == (*shape, n):
        return values.reshape(-1, n)[first:last]
    where = np.unravel_index(np.arange(first, last), shape) if shape else ()
    return np.broadcast_to(values, (*shape, n))[where]


def _numbers(value: ArrayLike, what: str) -> Array:
    try:
        return np.asarray(value, dtype=float, order="C")
    except (TypeError, ValueError) as error:
        raise PointError(f"{what}: expected numbers, received {value!r}.") from error


def _sample(values: Array) -> float:
    """Any finite entry: names are checked with it, entries later, one by one."""
    if values.ndim == 0:
        return float(values)
    finite = values[np.isfinite(values)]
    return float(finite.flat[0]) if finite.size else 0.0


def _event_number(at_event: tuple[str, int] | None) -> tuple[int, int] | None:
    if at_event is None:
        return None
    try:
        kind, count = at_event
        if kind in KINDS and int(count) == count and count >= 1:
            return KINDS.index(kind), int(count)
    except (TypeError, ValueError):
        pass
    raise OptionError(
        explain(
            "at_event",
            expected=f"(kind, k) with a kind of {KINDS} and k from 1",
            received=repr(at_event),
            advice='For example ("crossing", 1).',
        )
    )


def _positive(name: str, value: int) -> None:
    if not (isinstance(value, int) and value > 0):
        raise OptionError(f"{name}: expected a positive integer, received {value!r}.")


def _problem(
    system: FilippovSystem,
    starts: _Starts,
    options: Options,
    at: tuple[int, int] | None,
    compiled: bool,
) -> str:
    code = hashlib.sha256(system.content_hash().encode())
    code.update(repr((options, at, compiled, starts.shape, starts.x0.shape)).encode())
    code.update(np.ascontiguousarray(starts.x0).tobytes())
    code.update(starts.p.tobytes())
    for column, values in sorted(starts.varied.items()):
        code.update(repr((column, values.shape)).encode())
        code.update(np.ascontiguousarray(values).tobytes())
    return code.hexdigest()


# Output ------------------------------------------------------------------------------------------


class _Results:
    """Arrays of all trajectories, filled as chunks arrive in any order."""

    def __init__(self, system: FilippovSystem, shape: tuple[int, ...], at: bool):
        self.shape = shape
        self.all = Chunk.empty(math.prod(shape), system.dimension, at)
        self._words: dict[str, int] = {}

    def part(self, first: int, last: int) -> Chunk:
        """Return the arrays of the trajectories first to last - 1, to be written in place."""
        every, cut = self.all, slice(first, last)
        return Chunk(
            x=every.x[cut],
            t=every.t[cut],
            status=every.status[cut],
            itinerary=every.itinerary[cut],
            words=[],
            kinds=every.kinds[cut],
            at_x=None if every.at_x is None else every.at_x[cut],
            at_t=None if every.at_t is None else every.at_t[cut],
        )

    def put(self, first: int, chunk: Chunk) -> None:
        """Take a chunk that begins with trajectory ``first``; its arrays may be a ``part``."""
        whole = self._arrays(self.all)
        for name, array in self._arrays(chunk).items():
            if array.base is not whole[name]:
                whole[name][first : first + len(array)] = array
        numbers = [self._words.setdefault(w, len(self._words)) for w in chunk.words]
        if numbers != list(range(len(numbers))):
            codes = self.all.itinerary[first : first + len(chunk.t)]
            codes[:] = np.array(numbers, np.int32)[codes]

    @staticmethod
    def _arrays(chunk: Chunk) -> dict[str, NDArray[Any]]:
        names = ("x", "t", "status", "itinerary", "kinds", "at_x", "at_t")
        return {name: a for name in names if (a := getattr(chunk, name)) is not None}

    def ensemble(self) -> Ensemble:
        """Return the results, with the itineraries sorted."""
        words, code, every = sorted(self._words), self.all.itinerary, self.all
        if words != list(self._words):
            order = np.empty(len(words), np.int32)
            for k, word in enumerate(words):
                order[self._words[word]] = k
            code = order[code]
        n, shape = every.x.shape[1], self.shape
        return Ensemble(
            x=every.x.reshape(*shape, n),
            t=every.t.reshape(shape),
            status=every.status.reshape(shape),
            itineraries=tuple(words),
            itinerary_code=code.reshape(shape),
            events={kind: every.kinds[:, k].reshape(shape) for k, kind in enumerate(KINDS)},
            event_x=None if every.at_x is None else every.at_x.reshape(*shape, n),
            event_t=None if every.at_t is None else every.at_t.reshape(shape),
        )


# Work --------------------------------------------------------------------------------------------


def _run_all(
    job: Job,
    starts: _Starts,
    results: _Results,
    size: int,
    threads: int | None,
    executor: Executor | None,
    saved: Checkpoint | None,
    progress: bool,
) -> None:
    bar = _bar(starts.count, progress)
    missing = []
    for number in range(math.ceil(starts.count / size)):
        done = saved.load(number) if saved is not None else None
        if done is None:
            missing.append(number)
        else:
            results.put(number * size, done)
            bar.update(len(done.t))
    work = ((k, k * size, min((k + 1) * size, starts.count)) for k in missing)
    pieces = ((k, *starts.part(*ends), results.part(*ends)) for k, *ends in work)
    workers = min(threads or _processors(), len(missing))
    try:
        with closing(_chunks(job, pieces, workers, executor)) as finished:
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


class _NoBar:
    def update(self, count: int) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def _bar(total: int, progress: bool) -> Any:
    """A bar on a terminal, for work of more than a second; nothing elsewhere."""
    if not progress:
        return _NoBar()
    from tqdm import tqdm  # here: it is not needed to import the library

    return tqdm(total=total, disable=None, delay=1.0, unit="run", unit_scale=True)
