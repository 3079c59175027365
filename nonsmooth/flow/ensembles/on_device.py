"""Ensembles on a GPU: starts, and steps that fall back to the CPU."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem, OptionError
from ..constants import SAFETY
from ..engine.building.codegen import supports_device
from ..engine.device.card import machine_for
from ..engine.device.kernel import Bins, Given, Kernel, Reduced, Reduction, Source
from ..engine.device.records import Records, continued, record_type
from ..options import Options
from ..results import Chunk
from .chunks import Job
from .lazy_starts import Grid, RandomStarts
from .starts import Starts

#: Largest number of trajectories of one call, and bytes of the device's memory for them.
CHUNK, _MEMORY = 1 << 22, 1 << 31

#: Order by the logarithm of the tolerance; ``Options.order`` has a quarter more. Measured on an H200 at tol=1e-10, order
#: 14 against 17: 1.36 times the runs a second of a linear system and 1.28 times those of a nonlinear one, and less than
#: half as many runs with a step of the driver.
_ORDER = 0.48

#: How often a run returns to the GPU after a step of the driver, before the driver completes it.
_TURNS = 8

#: Records of runs that wait for the driver while the GPU continues.
_WAITING = 1 << 19


def require_device(job: Job, device: str, executor: bool) -> None:
    """Raise where a GPU cannot run the job, or where there is none."""
    system = job.system
    assert isinstance(system, FilippovSystem)
    unsupported = _unsupported(system, job.options) or (
        "t_eval or at" if job.room is not None else "an executor" if executor else ""
    )
    if unsupported:
        raise OptionError(
            f"device is {device!r}, which does not run {unsupported}. Leave out device=: it runs systems "
            "of at most one surface, without sets, resets and contacts."
        )
    _kernel(job, device)


def _unsupported(system: FilippovSystem, options: Options) -> str:
    """The first property of a system or its options that no kernel supports; empty if there is none."""
    if system.sets:
        return "a system with a set of directions"
    if not supports_device(system):
        several = system.surface_count > 1
        return "a system of several surfaces" if several else "a system with resets or contacts"
    if options.start_mode is not None:
        return "a start_mode"
    if options.rest_below is not None:
        return "rest_below"
    if options.method == "stiff":
        return "implicit steps"
    if options.begins_late:
        return "times whose rounding is above the tolerance"
    return "" if options.t_end > options.t_start else "t_end = t_start"


def _kernel(job: Job, device: str) -> Kernel:
    system, order, machine = job.system, device_order(job.options), machine_for(device)
    assert isinstance(system, FilippovSystem)
    key = ("device", order, machine)
    return system.cached(key, lambda: Kernel(system, order, machine))


def device_chunk(system: FilippovSystem) -> int:
    """Trajectories of one call: results and records of all of them are on the device."""
    return min(CHUNK, _MEMORY // (record_type(system).itemsize + 16 * system.dimension + 64))


def device_order(options: Options) -> int:
    """Order of the series on a card: lower than on a processor, for each thread has 255 registers at most."""
    return max(6, math.ceil(_ORDER * -math.log(SAFETY * options.rtol)) + 1)


def run_on_device(
    job: Job, device: str, starts: Starts, first: int, out: Chunk, workers: int
) -> Chunk:
    """Run the trajectories of the rows of ``out``; the driver makes the steps that the GPU cannot decide."""
    kernel, count = _kernel(job, device), len(out.t)
    given, x = _given(starts, first, count, job.options)
    left = kernel.run(given, job.at, out)
    if x is not None:
        refused = np.isnan(given.source.values).any(axis=-1)
        out.x[refused] = x[refused]
    if left.size:
        rows, chunk = _carry_on(
            job, kernel, left, _of(given.p, left["index"]), _events(out, left), workers
        )
        out.take([(rows, chunk)])
    return out


def reduce_on_device(
    job: Job, device: str, starts: Starts, size: int, bins: Bins, workers: int
) -> Iterator[Reduced | Chunk]:
    """Sums over all trajectories, ``size`` at a time, and results of those that a card cannot add."""
    kernel = _kernel(job, device)
    reduction, waiting = Reduction(kernel, bins), list[tuple[Records, Array]]()
    for first in range(0, starts.count, size):
        count = min(size, starts.count - first)
        given, _ = _given(starts, first, count, job.options)
        (left, others), p = reduction.add(given), given.p
        waiting.append((left, _of(p, left["index"])))
        if others is not None:
            yield others
        if sum(len(records) for records, _ in waiting) > _WAITING or first + size >= starts.count:
            records = np.concatenate([records for records, _ in waiting])
            own = p if p.ndim == 1 else np.concatenate([rows for _, rows in waiting])
            waiting = []
            if records.size:
                yield _carry_on(job, kernel, records, own, None, workers)[1]
    yield reduction.read()


def _of(p: Array, rows: NDArray[np.int64]) -> Array:
    return p[rows] if p.ndim > 1 else p


def _events(out: Chunk, left: Records) -> tuple[Array, Array] | None:
    """The events of some runs at which they are kept."""
    if out.at_x is None or out.at_t is None:
        return None
    return out.at_x[left["index"]], out.at_t[left["index"]]


def _carry_on(
    job: Job,
    kernel: Kernel,
    left: Records,
    p: Array,
    events: tuple[Array, Array] | None,
    workers: int,
) -> tuple[NDArray[np.int64], Chunk]:
    """Ends of the runs of some records: their numbers, and results in that order."""
    # How often a run returns to the card depends on nothing but the run, so that results do not depend on chunks.
    system, options, at = kernel.system, job.options, job.at
    rows, ends = left["index"].copy(), list[tuple[NDArray[np.int64], Chunk]]()
    for turn in range(_TURNS + 1):
        chunk = Chunk.empty(len(left), system, at is not None)
        chunk.forget()
        _with_events(chunk, events)
        to_end = turn == _TURNS
        going = continued(left, system, p, options, at, chunk, to_end, workers)
        left, rows, p, events = _split(chunk, going, rows, p, ends)
        if not left.size:
            break
        chunk = Chunk.empty(len(left), system, at is not None)
        still = kernel.run(Given(Source.records(left), 0, len(left), p, options), at, chunk)
        left, rows, p, events = _split(_with_events(chunk, events), still, rows, p, ends)
        if not left.size:
            break
    return _joined(ends, system, at is not None)


def _with_events(chunk: Chunk, events: tuple[Array, Array] | None) -> Chunk:
    """A chunk with events from before it began."""
    if events is not None and chunk.at_x is not None and chunk.at_t is not None:
        before = np.isfinite(events[1])
        chunk.at_x[before], chunk.at_t[before] = (array[before] for array in events)
    return chunk


def _split(
    chunk: Chunk,
    going: Records,
    rows: NDArray[np.int64],
    p: Array,
    ends: list[tuple[NDArray[np.int64], Chunk]],
) -> tuple[Records, NDArray[np.int64], Array, tuple[Array, Array] | None]:
    """Add the runs that ended to ``ends``; return the others."""
    own = going["index"]
    done = np.ones(len(rows), bool)
    done[own] = False
    if done.any():
        arrays: dict[str, Any] = {name: a[done] for name, a in chunk.arrays().items()}
        ends.append((rows[done], replace(chunk, **arrays)))
    return going, rows[own], _of(p, own), _events(chunk, going)


def _joined(
    ends: list[tuple[NDArray[np.int64], Chunk]], system: FilippovSystem, at: bool
) -> tuple[NDArray[np.int64], Chunk]:
    rows = np.concatenate([own for own, _ in ends])
    made = Chunk.empty(len(rows), system, at)
    bounds = pairwise(accumulate((len(own) for own, _ in ends), initial=0))
    made.take((slice(a, b), chunk) for (a, b), (_, chunk) in zip(bounds, ends, strict=True))
    return rows, made


def _given(starts: Starts, first: int, count: int, options: Options) -> tuple[Given, Array | None]:
    """Trajectories of a call, and their states as given if they are sent: as NaN where a parameter is no number."""
    source, n = _source(starts), starts.system.dimension
    if source is not None:
        return Given(source, first, count, starts.p, options), None
    x, p = starts.part(first, first + count)
    bad = ~np.all(np.isfinite(p), axis=-1) if p.ndim > 1 else np.zeros(count, bool)
    sent = Source.rows(np.where(bad[:, None], np.nan, x[:, :n]))
    return Given(sent, 0, count, p, options), x[:, :n]


def _source(starts: Starts) -> Source | None:
    """Lazy starts that a GPU computes itself, or None."""
    x0 = starts.x0
    if starts.varied or isinstance(x0, np.ndarray) or x0.shape != starts.shape:
        return None
    if isinstance(x0, Grid):
        return Source.grid(x0.axes)
    if isinstance(x0, RandomStarts):
        return Source.box(np.asarray(x0.low), np.asarray(x0.high), x0.seed)
    return None
