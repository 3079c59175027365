"""Ensembles on a GPU: its starts, and the runs that fall back to this processor."""

from __future__ import annotations

import numpy as np

from ...model import Array, FilippovSystem, OptionError
from ..constants import HAND_OVER
from ..engine.building.codegen import supports_lanes
from ..engine.device.card import machine_for
from ..engine.device.kernel import Bins, Kernel, Reduced, Source
from ..options import Options
from ..results import Chunk
from .chunks import Job, run_chunk
from .lazy_starts import Grid, RandomStarts
from .starts import Starts

#: Trajectories of one call; each needs some 150 bytes of memory on the host and on the device.
CHUNK = 1 << 22


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
    if not supports_lanes(system):
        several = system.surface_count > 1
        return "a system of several surfaces" if several else "a system with resets or contacts"
    if options.start_mode is not None:
        return "a start_mode"
    if options.begins_late:
        return "times whose rounding is above the tolerance"
    return "" if options.t_end > options.t_start else "t_end = t_start"


def _kernel(job: Job, device: str) -> Kernel:
    system, order, machine = job.system, job.options.order, machine_for(device)
    assert isinstance(system, FilippovSystem)
    key = ("device", order, machine)
    return system.cached(key, lambda: Kernel(system, order, machine))


def run_on_device(job: Job, device: str, starts: Starts, first: int, out: Chunk) -> Chunk:
    """Run the trajectories of the rows of ``out``; rare cases fall back to this processor."""
    kernel, count = _kernel(job, device), len(out.t)
    source = _source(starts)
    if source is not None:
        kernel.run(source, first, count, starts.p, job.options, job.at, out)
    else:
        own, p, x = _rows(starts, first, count)
        kernel.run(own, 0, count, p, job.options, job.at, out)
        refused = np.isnan(own.values).any(axis=1)
        out.x[refused] = x[refused]
    rest = np.flatnonzero(out.status == HAND_OVER)
    if rest.size:
        out.replace(rest, run_chunk(job, *starts.rows(first + rest)))
    return out


def reduce_on_device(
    job: Job, device: str, starts: Starts, first: int, count: int, bins: Bins
) -> Reduced:
    """Sums over some trajectories, and the numbers of those that fall back to this processor."""
    kernel, source = _kernel(job, device), _source(starts)
    if source is not None:
        return kernel.reduced(source, first, count, starts.p, job.options, bins)
    own, p, _ = _rows(starts, first, count)
    return kernel.reduced(own, 0, count, p, job.options, bins)


def _rows(starts: Starts, first: int, count: int) -> tuple[Source, Array, Array]:
    """Starts with NaN where a parameter is no number, their parameters, and their states as given."""
    n = starts.system.dimension
    x, p = starts.part(first, first + count)
    bad = ~np.all(np.isfinite(p), axis=-1) if p.ndim > 1 else np.zeros(count, bool)
    return Source.rows(np.where(bad[:, None], np.nan, x[:, :n])), p, x[:, :n]


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
