"""Integration of one chunk of trajectories, in this process or another."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...model import Array, FilippovSystem
from ..compiled.lanes.engine import lanes_for
from ..compiled.tape import tape_for
from ..constants import HAND_OVER, KINDS
from ..options import Options
from ..reference.driver import Driver
from ..results import Chunk, Stopped, kinds_of
from ..section import Times, sampled
from ..status import Status
from .starts import Cut

#: The reference driver's functions are built and evaluated by one thread at a time.
_REFERENCE = threading.Lock()


@dataclass(frozen=True)
class Job:
    """System and options that all chunks of an ensemble share."""

    system: FilippovSystem | bytes
    options: Options
    at: tuple[int, int] | None
    times: Times | None
    room: int | None
    engine: str  # lanes or core


def shipped(job: Job) -> Job:
    """Return the job with its system pickled, which every other process reads once."""
    return job if isinstance(job.system, bytes) else replace(job, system=pickle.dumps(job.system))


@lru_cache(maxsize=4)
def _unpickled(data: bytes) -> FilippovSystem:
    return pickle.loads(data)


def run_chunk(
    job: Job,
    x: Array,
    p: Array,
    out: Chunk | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Chunk:
    """Run the trajectories from extended starts x (m, N) with parameters p (np,) or (m, np)."""
    # Results go to ``out``, or to new arrays; where ``stop()`` returns true, Stopped is raised.
    system = _unpickled(job.system) if isinstance(job.system, bytes) else job.system
    bad = ~np.all(np.isfinite(p), axis=-1) if p.ndim > 1 else np.zeros(len(x), bool)
    start = np.where(bad[:, None], np.nan, x) if bad.any() else x
    times = None if job.times is None else job.times.of(p)
    chunk = out or Chunk.empty(len(x), system, job.at is not None, job.room)
    if tape_for(system, job.options) is None:
        _refuse(chunk, system, start, job.options)
    else:
        _run_compiled(job, system, start, p, chunk, stop, times)
    rest = np.flatnonzero(chunk.status == HAND_OVER)
    words = dict(enumerate(chunk.words))
    for i in rest.tolist():
        if stop():
            raise Stopped
        words[len(words)] = _run_reference(chunk, system, i, start[i], p, len(words), job, times)
    chunk.x[bad] = x[bad, : system.dimension]
    if rest.size:
        used = np.bincount(chunk.itinerary).nonzero()[0].tolist()
        chunk.rename({code: words[code] for code in used})
    return chunk


def run_cut(job: Job, cut: Cut) -> Chunk:
    """Run the trajectories of a chunk that another process sent."""
    return run_chunk(job, *cut.rows())


def _run_compiled(
    job: Job,
    system: FilippovSystem,
    x: Array,
    p: Array,
    out: Chunk,
    stop: Callable[[], bool],
    times: Array | None,
) -> None:
    if job.engine == "lanes":
        lanes = lanes_for(system, job.options)
        assert lanes is not None
        lanes.run_many(x, p, job.options, job.at, out, stop)
    else:
        tape = tape_for(system, job.options)
        assert tape is not None
        tape.run_many(x, p, job.options, job.at, out, stop, times)


def _refuse(chunk: Chunk, system: FilippovSystem, x: Array, options: Options) -> None:
    """Write the results of starts that are not finite; mark the others to be run."""
    bad = ~np.all(np.isfinite(x), axis=1)
    chunk.x[bad], chunk.t[bad] = x[bad, : system.dimension], options.t_start
    chunk.status[:] = np.where(bad, Status.NOT_FINITE, HAND_OVER)
    chunk.itinerary[:] = chunk.kinds[:] = 0
    chunk.kinds[bad, -1] = 1
    chunk.forget()
    chunk.words.append("")


def _run_reference(
    chunk: Chunk,
    system: FilippovSystem,
    i: int,
    x: Array,
    p: Array,
    code: int,
    job: Job,
    times: Array | None,
) -> str:
    """Write the results of the reference driver to row i and return its itinerary."""
    with _REFERENCE:
        run = Driver(system, x.copy(), p[i] if p.ndim > 1 else p, job.options).run()
    chunk.x[i], chunk.t[i], chunk.status[i] = run.x[-1], run.t[-1], run.status
    chunk.itinerary[i] = code
    chunk.kinds[i] = 0
    chunk.part(i, i + 1).forget()
    names = kinds_of(system)
    for event in run.events:
        column = names.index(event.kind)
        chunk.kinds[i, column] += 1
        if job.at == (KINDS.index(event.kind), chunk.kinds[i, column]) and chunk.at_x is not None:
            assert chunk.at_t is not None
            chunk.at_x[i], chunk.at_t[i] = event.x, event.t
    if chunk.sample_t is not None and chunk.sample_x is not None:
        if times is not None:
            row = times if times.ndim == 1 else times[i]
            chunk.sample_t[i], chunk.sample_x[i] = sampled(run, row)
        elif job.options.hits is not None:
            job.options.hits.fill(run.events, chunk.sample_t[i], chunk.sample_x[i])
    return run.itinerary
