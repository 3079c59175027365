"""The work of an ensemble, one chunk of trajectories at a time, in this process or another."""

from __future__ import annotations

import hashlib
import pickle
import threading
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..model import Array, FilippovSystem
from .compiled.engine import HAND_OVER, KINDS, Chunk, engine_for
from .driver import Driver
from .options import Options
from .status import Status

#: The reference driver's functions are built and evaluated by one thread at a time.
_REFERENCE = threading.Lock()


@dataclass(frozen=True)
class Job:
    """What every chunk of an ensemble has in common; small, and the same for all of them.

    Attributes
    ----------
    system : bytes
        The pickled system.
    options : Options
    at : (kind, count) or None
        Event whose state is kept; the kind by its number.
    compiled, lanes : bool
        Which engine runs.
    """

    system: bytes
    options: Options
    at: tuple[int, int] | None
    compiled: bool
    lanes: bool


def make_job(
    system: FilippovSystem,
    options: Options,
    at: tuple[int, int] | None,
    compiled: bool,
    lanes: bool,
) -> Job:
    """Return a job; this process keeps the system itself, so that nothing is built twice."""
    job = Job(pickle.dumps(system), options, at, compiled, lanes)
    _OWN[_digest(job.system)] = system
    return job


_OWN: dict[bytes, FilippovSystem] = {}


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()


@lru_cache(maxsize=4)
def _unpickled(data: bytes) -> FilippovSystem:
    return pickle.loads(data)


def _system(job: Job) -> FilippovSystem:
    own = _OWN.get(_digest(job.system))
    return _unpickled(job.system) if own is None else own


def forget(job: Job) -> None:
    """Drop what ``make_job`` kept."""
    _OWN.pop(_digest(job.system), None)


def stop_chunks(job: Job, stopping: bool) -> None:
    """Make the chunks of a job that run in this process fail at once, or take that back."""
    engine = engine_for(_system(job), job.options) if job.compiled else None
    if engine is not None:
        engine.stop(stopping)


def run_chunk(job: Job, x: Array, p: Array) -> Chunk:
    """Run the trajectories from extended starts x (m, N) with parameters p (np,) or (m, np)."""
    system = _system(job)
    bad = ~np.all(np.isfinite(p), axis=-1) if p.ndim > 1 else np.zeros(len(x), bool)
    start = np.where(bad[:, None], np.nan, x) if bad.any() else x
    engine = engine_for(system, job.options) if job.compiled else None
    if engine is None:
        chunk = empty_chunk(system, len(x), job.at is not None)
        _not_finite(chunk, system, start, job.options)
    else:
        chunk = engine.run_many(start, p, job.options, job.at, job.lanes)
    for i in np.flatnonzero(chunk.status == HAND_OVER):
        if engine is not None and engine.stopping:
            raise RuntimeError("The ensemble was stopped.")
        _run_reference(chunk, system, int(i), start[i], p[i] if p.ndim > 1 else p, job)
    chunk.x[bad] = x[bad, : system.dimension]
    return _compact(chunk)


def empty_chunk(system: FilippovSystem, count: int, at: bool) -> Chunk:
    """Arrays of results with every trajectory still to be run."""
    n = system.dimension
    return Chunk(
        x=np.empty((count, n)),
        t=np.empty(count),
        status=np.full(count, HAND_OVER, np.int32),
        itinerary=np.zeros(count, np.int32),
        words=[],
        kinds=np.zeros((count, len(KINDS)), np.int32),
        at_x=np.full((count, n), np.nan) if at else None,
        at_t=np.full(count, np.nan) if at else None,
    )


def _not_finite(chunk: Chunk, system: FilippovSystem, x: Array, options: Options) -> None:
    bad = ~np.all(np.isfinite(x), axis=1)
    chunk.x[bad], chunk.t[bad] = x[bad, : system.dimension], options.t_start
    chunk.status[bad] = Status.NOT_FINITE
    chunk.kinds[bad, KINDS.index("end")] = 1
    chunk.words.append("")


def _run_reference(
    chunk: Chunk, system: FilippovSystem, i: int, x: Array, p: Array, job: Job
) -> None:
    with _REFERENCE:
        run = Driver(system, x.copy(), p, job.options).run()
    chunk.x[i], chunk.t[i], chunk.status[i] = run.x[-1], run.t[-1], run.status
    chunk.itinerary[i] = len(chunk.words)
    chunk.words.append(run.itinerary)
    chunk.kinds[i] = 0
    for event in run.events:
        kind = KINDS.index(event.kind)
        chunk.kinds[i, kind] += 1
        if job.at == (kind, chunk.kinds[i, kind]) and chunk.at_x is not None:
            assert chunk.at_t is not None
            chunk.at_x[i], chunk.at_t[i] = event.x, event.t


def _compact(chunk: Chunk) -> Chunk:
    """Keep only the words in use, sorted: equal results then have equal arrays."""
    used = np.flatnonzero(np.bincount(chunk.itinerary, minlength=len(chunk.words)))
    words = sorted({chunk.words[k] for k in used})
    number = {word: k for k, word in enumerate(words)}
    table = np.array([number.get(w, 0) for w in chunk.words], np.int32)
    if len(chunk.t):
        chunk.itinerary = table[chunk.itinerary]
    chunk.words = words
    return chunk
