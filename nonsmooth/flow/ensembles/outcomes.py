"""Counts, means and histograms of the ends of many runs, none of which is kept."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, FilippovSystem, OptionError, require_system, whole
from ...result_tables import ResultTable, Tabular
from ..engine.device.kernel import Bins, Reduced
from ..options import Options
from ..results import Chunk
from ..status import Status
from .chunks import Job
from .ensemble import engine_for
from .lazy_starts import LazyStarts
from .on_device import device_chunk, reduce_on_device, require_device
from .starts import Starts
from .work import Work, checked_work, run_all, size_of_chunk


@dataclass(frozen=True)
class Outcomes(Tabular):
    """Counts, means and histograms of the ends of many runs.

    Attributes
    ----------
    count : int
        Number of runs.
    status : dict of Status to int
        Number of runs by status.
    itineraries : dict of str to int
        Number of runs by itinerary, the most frequent first.
    mean, std : dict of str to float
        Mean and standard deviation of the states and of the time ``"t"`` at the ends of runs that reached
        their end or a stop; NaN where there are none.
    edges, histogram : dict of str to ndarray (bins + 1,), (bins,)
        Of the same, for the names in ``ranges``: values outside are not counted.
    """

    count: int
    status: dict[Status, int]
    itineraries: dict[str, int]
    mean: dict[str, float]
    std: dict[str, float]
    edges: dict[str, Array]
    histogram: dict[str, NDArray[np.int64]]

    def _tables(self) -> dict[str, ResultTable]:
        counted = lambda found: {"count": list(found.values())}
        states = {"mean": list(self.mean.values()), "std": list(self.std.values())}
        tables = {
            "states": ResultTable({"state": list(self.mean)}, states),
            "status": ResultTable({"status": [str(s) for s in self.status]}, counted(self.status)),
            "itineraries": ResultTable(
                {"itinerary": list(self.itineraries)}, counted(self.itineraries)
            ),
        }
        for name, edges in self.edges.items():
            columns = {"low": edges[:-1], "high": edges[1:], "count": self.histogram[name]}
            tables[name] = ResultTable({f"{name}_bin": len(edges) - 1}, columns)
        return tables


@dataclass
class _Sums:
    """Sums over runs, chunk by chunk."""

    system: FilippovSystem
    bins: Bins
    status: Counter[int] = field(default_factory=Counter)
    words: Counter[str] = field(default_factory=Counter)
    sums: Array = field(init=False)
    histogram: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.sums = np.zeros((self.system.dimension + 1, 2))
        self.histogram = np.zeros((self.system.dimension + 1, self.bins.count), np.int64)

    def part(self, first: int, last: int) -> Chunk:
        """Return arrays for some runs."""
        return Chunk.empty(last - first, self.system, False)

    def put(self, first: int, chunk: Chunk) -> None:
        """Add the runs of a chunk."""
        codes, counts = np.unique(chunk.itinerary, return_counts=True)
        self.words.update({chunk.words[k]: int(m) for k, m in zip(codes, counts, strict=True)})
        ends, counts = np.unique(chunk.status, return_counts=True)
        self.status.update(dict(zip(ends.tolist(), counts.tolist(), strict=True)))
        done = (chunk.status == Status.REACHED_END) | (chunk.status == Status.STOPPED)
        for k, v in enumerate([*chunk.x[done].T, chunk.t[done]]):
            self.sums[k] += v.sum(), (v * v).sum()
            self.histogram[k] += np.bincount(self.bins.indices(k, v), minlength=self.bins.count)

    def add(self, found: Reduced) -> None:
        """Add sums from a device."""
        self.words.update(found.words)
        self.status.update(found.status)
        self.sums += found.sums
        self.histogram += found.histogram

    def outcomes(self, ranges: Mapping[str, Any]) -> Outcomes:
        """Return the sums as a result."""
        done = self.status[Status.REACHED_END] + self.status[Status.STOPPED]
        names = (*self.system.state_names, "t")
        mean, square = (self.sums / done).T if done else np.full((2, len(names)), math.nan)
        std = np.sqrt(np.maximum(square - mean * mean, 0.0)) if done else mean
        rows = {name: k for k, name in enumerate(names) if name in ranges}
        edge = lambda k: np.linspace(self.bins.low[k], self.bins.high[k], self.bins.count + 1)
        return Outcomes(
            count=self.status.total(),
            status={s: self.status[s] for s in Status if self.status[s]},
            itineraries=dict(sorted(self.words.items(), key=lambda item: (-item[1], item[0]))),
            mean=dict(zip(names, mean.tolist(), strict=True)),
            std=dict(zip(names, std.tolist(), strict=True)),
            edges={name: edge(k) for name, k in rows.items()},
            histogram={name: self.histogram[k] for name, k in rows.items()},
        )


def outcomes(
    system: FilippovSystem,
    x0: ArrayLike | LazyStarts,
    t_end: float,
    *,
    t_start: float = 0.0,
    parameters: Mapping[Any, ArrayLike] | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    bins: int = 100,
    work: Work | None = None,
    device: str | None = None,
) -> Outcomes:
    """Integrate many trajectories and count their ends: by status and itinerary, means and histograms.

    Memory does not grow with their number. With ``device="cuda"`` and starts from a :class:`Grid` or
    :class:`RandomStarts` they are computed and reduced on the card.

    Parameters
    ----------
    system : FilippovSystem
        As for :func:`simulate`.
    x0 : array_like (..., n), Grid or RandomStarts
        Starts.
    t_end : float
        Time at which every run ends, unless a stop ends it before.
    t_start, tol, rtol, atol : float, optional
        As for :func:`ensemble`.
    parameters : mapping, optional
        Values that replace defaults: numbers, or arrays that broadcast with the starts.
    ranges : mapping of str to (low, high), optional
        States, or ``"t"``, whose values at the ends are counted in bins of equal width.
    bins : int, optional
        Number of bins.
    work : Work, optional
        Threads, executor, size of a chunk, progress bar.
    device : {None, "cuda"}, optional
        ``"cuda"`` runs and reduces on an NVIDIA card.

    Returns
    -------
    Outcomes
        Sums depend on the size of a chunk, and on a card's threads, in their last digits; counts do not.

    Raises
    ------
    PointError, ParameterError, DefinitionError, CompilerError, DeviceError
        As :func:`ensemble`.
    OptionError
        An option out of its range; ranges that are empty or of no state; a store.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> block = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 1], below=[v, -x + 1])
    >>> starts = ns.RandomStarts(500, low=[-3, 0], high=[3, 0], seed=1)
    >>> found = ns.outcomes(block, starts, t_end=9.0, ranges={"x": (-1, 1)}, bins=2)
    >>> found.status, found.histogram["x"].sum()
    ({<Status.REACHED_END: 0>: 500}, np.int64(500))
    """
    options = Options.of(locals())
    require_system(system, sets=True, hysteresis=True, complementarity=True, joints=True)
    work = checked_work(work)
    if work.store is not None:
        raise OptionError("work has a store, but outcomes keeps no runs. Leave out store=.")
    made = _Sums(system, _bins(system, ranges or {}, bins))
    starts = Starts(system, x0, parameters, t_start)
    step = t_end > t_start and device is None
    job = Job(system, options, None, None, None, engine_for(system, options, starts, step))
    if device is None:
        most = work.largest(Chunk.empty(0, system, at=False).row_size)
        size = work.chunk or size_of_chunk(job, starts, work.workers, most)
        run_all(job, starts, made, work, size, None)
    else:
        require_device(job, device, work.executor is not None)
        size = work.chunk or device_chunk(system)
        for found in reduce_on_device(job, device, starts, size, made.bins, work.workers):
            if isinstance(found, Chunk):
                made.put(0, found)
            else:
                made.add(found)
    return made.outcomes(ranges or {})


def _bins(system: FilippovSystem, ranges: Mapping[str, tuple[float, float]], bins: int) -> Bins:
    names = (*system.state_names, "t")
    low, high = np.full((2, len(names)), math.nan)  # without a range there are no bins
    for name, given in ranges.items():
        try:
            k = names.index(name)
            low[k], high[k] = given
            good = bool(np.isfinite(high[k] - low[k]) and low[k] < high[k])
        except (TypeError, ValueError):
            good = False
        if not good:
            raise OptionError(
                f"ranges has {name!r}: {given!r}. Give finite (low, high), low < high, for names among "
                f"{names}."
            )
    return Bins(int(whole(bins, "bins")), low, high)
