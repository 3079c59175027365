"""Integration of one chunk of trajectories, in this process or another."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...model import Array, FilippovSystem
from ..engine.interpreter import interpreter_for
from ..engine.lanes import lanes_for
from ..options import Options
from ..results import Chunk
from ..section import Times
from .starts import Cut


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
    """Return the job with its system pickled, which each other process reads once."""
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
    _run_compiled(job, system, start, p, chunk, stop, times)
    chunk.x[bad] = x[bad, : system.dimension]
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
        lanes.run_many(x, p, job.options, job.at, out, stop, times)
    else:
        engine = interpreter_for(system, job.options)
        engine.run_many(x, p, job.options, job.at, out, stop, times)
