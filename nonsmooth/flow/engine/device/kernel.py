"""A system's trajectories on a GPU, from Python: where starts come from, and what comes back."""

from __future__ import annotations

import re
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....model import Array, FilippovSystem
from ...constants import HAND_OVER, SIMPLE_KINDS
from ...options import Options
from ...results import Chunk
from ...status import Status
from ..building.codegen import device_source
from .machine import Machine

#: Kinds of starts, by number in kernel.c.
_ROWS, _GRID, _BOX = 0, 1, 2

#: What may count without end, in a number of 64 bits.
_MOST = 2**62


@dataclass(frozen=True)
class Source:
    """Where the starts of a kernel come from."""

    kind: int
    seed: int
    values: Array
    lengths: NDArray[np.int64]

    @classmethod
    def rows(cls, x: Array) -> Source:
        """Starts given one by one (m, n)."""
        return cls(_ROWS, 0, np.ascontiguousarray(x, float), np.zeros(1, np.int64))

    @classmethod
    def grid(cls, axes: Sequence[Array]) -> Source:
        """All combinations of values; those of the last axis run fastest."""
        lengths = np.array([len(a) if a.ndim else 0 for a in axes], np.int64)
        return cls(_GRID, 0, np.concatenate([np.atleast_1d(a) for a in axes]), lengths)

    @classmethod
    def box(cls, low: Array, high: Array, seed: int) -> Source:
        """Random starts between two corners."""
        signed = seed - (1 << 64) if seed >= 1 << 63 else seed
        return cls(_BOX, signed, np.concatenate([low, high]), np.zeros(1, np.int64))


@dataclass(frozen=True)
class Bins:
    """Bins of equal width for the states and the time."""

    count: int
    low: Array
    high: Array

    def places(self, k: int, values: Array) -> NDArray[np.int64]:
        """Numbers of the bins that some values of column k lie in; those that lie in one."""
        low, high = self.low[k], self.high[k]
        place = (values - low) * (self.count / (high - low))
        place = np.where(values == high, self.count - 1, place)
        return place[(place >= 0) & (place < self.count)].astype(np.int64)


@dataclass(frozen=True)
class Reduced:
    """What became of some runs."""

    words: dict[str, int]
    status: dict[int, int]
    sums: Array
    histogram: NDArray[np.int64]
    rest: NDArray[np.int64]


class Kernel:
    """What runs a system's trajectories on a machine, compiled when first needed."""

    def __init__(self, system: FilippovSystem, order: int, machine: Machine):
        self.system, self.order, self.machine = system, order, machine
        self._compiled: tuple[Any, int] | None = None
        self._lock = threading.Lock()

    @property
    def compiled(self) -> tuple[Any, int]:
        """The kernels, and how many numbers are prepared from the parameters."""
        with self._lock:
            if self._compiled is None:
                source = device_source(self.system, self.order, self.machine.threads)
                size = re.search(r"^#define NQ (\d+)$", source, re.MULTILINE)
                assert size is not None
                self._compiled = self.machine.compile(source), int(size[1])
            return self._compiled

    def run(
        self,
        source: Source,
        first: int,
        count: int,
        p: Array,
        options: Options,
        at: tuple[int, int] | None,
        out: Chunk,
    ) -> None:
        """Run ``count`` trajectories, the first of which has the number ``first`` in its source."""
        # Those that are rare keep the status HAND_OVER and have no results.
        memory = self.start(source, first, count, p, options, at)
        found = _results(count, self.system.dimension, at is not None)
        for name, array in found.items():
            self.machine.read(memory[name], array)
        _fill(out, found, self.system.modes)

    def start(
        self,
        source: Source,
        first: int,
        count: int,
        p: Array,
        options: Options,
        at: tuple[int, int] | None,
    ) -> dict[str, Any]:
        """Launch them, as :meth:`run` does, and return the memory where their results will be."""
        machine, n = self.machine, self.system.dimension
        kernels, width = self.compiled
        rows = np.atleast_2d(np.ascontiguousarray(p, float))
        q = machine.empty(8 * width * len(rows))
        given = [len(rows), rows.shape[1], machine.write(rows), q]
        machine.launch(kernels, "parameters", given)
        sizes = {name: array.nbytes for name, array in _results(count, n, at is not None).items()}
        memory = {name: machine.empty(size) for name, size in sizes.items()}
        kind, number = at or (-1, 0)
        arguments = [
            *(count, first, source.kind, source.seed),
            *(machine.write(source.values), machine.write(source.lengths)),
            *(q, width if p.ndim > 1 else 0, options.t_start, options.t_end),
            *(options.rtol, options.atol, options.max_step),
            *(min(limit, _MOST) for limit in (options.max_steps, options.max_events)),
            *(kind, number),
            *(memory.get(name) for name in _ORDER),
        ]
        machine.launch(kernels, "trajectories", arguments)
        return memory

    def reduced(
        self, source: Source, first: int, count: int, p: Array, options: Options, bins: Bins
    ) -> Reduced:
        """Run trajectories as :meth:`run` does, and return what becomes of them."""
        machine, n, kernels = self.machine, self.system.dimension, self.compiled[0]
        memory = self.start(source, first, count, p, options, None)
        sums = np.empty((machine.blocks * machine.threads, n + 1, 2))
        arrays: dict[str, NDArray[Any]] = {
            "histogram": np.zeros((n + 1, bins.count), np.int64),
            "keys": np.zeros(PLACES, np.int64),
            "counts": np.zeros(PLACES, np.int64),
            "status": np.zeros(len(Status), np.int64),
            "left": np.zeros(1, np.int64),
        }
        there = {name: machine.write(array) for name, array in arrays.items()}
        there["sums"], there["rest"] = machine.empty(sums.nbytes), machine.empty(8 * count)
        results = [memory[name] for name in ("x", "t", "status", "code")]
        ranges = [bins.count, machine.write(bins.low), machine.write(bins.high)]
        table = [PLACES, *(there[name] for name in ("keys", "counts", "status", "left", "rest"))]
        arguments = [count, *results, *ranges, there["histogram"], there["sums"], *table]
        machine.launch(kernels, "outcomes", arguments)
        arrays["sums"] = sums
        for name, array in arrays.items():
            machine.read(there[name], array)
        rest = np.empty(int(arrays["left"][0]), np.int64)
        machine.read(there["rest"], rest)
        used = np.flatnonzero(arrays["counts"])
        codes, counts = arrays["keys"][used] - 1, arrays["counts"][used]
        modes = self.system.modes
        words = zip(codes.tolist(), counts.tolist(), strict=True)
        return Reduced(
            words={word_of(code, modes): number for code, number in words},
            status={k: m for k, m in enumerate(arrays["status"].tolist()) if m},
            sums=sums.sum(axis=0),
            histogram=arrays["histogram"],
            rest=np.sort(rest),
        )


#: Different itineraries that a card counts at once, a power of two; what finds no room runs elsewhere.
PLACES = 1 << 14

#: Results, in the order in which the kernel takes them.
_ORDER = ("x", "t", "status", "kinds", "steps", "code", "at_x", "at_t")


def _results(count: int, n: int, at: bool) -> dict[str, NDArray[Any]]:
    """Arrays for what a kernel writes."""
    found: dict[str, NDArray[Any]] = {
        "x": np.empty((count, n)),
        "t": np.empty(count),
        "status": np.empty(count, np.int32),
        "kinds": np.empty((count, SIMPLE_KINDS), np.int32),
        "steps": np.empty(count, np.int32),
        "code": np.empty(count, np.int64),
    }
    return found | ({"at_x": np.empty((count, n)), "at_t": np.empty(count)} if at else {})


def _fill(out: Chunk, found: dict[str, NDArray[Any]], modes: Sequence[str]) -> None:
    """Put results into a chunk, with the itineraries as words."""
    for name in ("x", "t", "status", "kinds"):
        getattr(out, name)[...] = found[name]
    if out.at_x is not None and out.at_t is not None:
        out.at_x[...], out.at_t[...] = found["at_x"], found["at_t"]
    handed = out.status == HAND_OVER
    code = np.where(handed, 0, found["code"])
    codes, place = np.unique(code, return_inverse=True)
    out.itinerary[...] = place.reshape(-1)
    out.rename({k: word_of(c, modes) for k, c in enumerate(codes.tolist())})
    out.totals[0] += int(found["steps"].sum(dtype=np.int64))
    out.totals[1] += int(found["kinds"][:, :-1].sum(dtype=np.int64))
    out.totals[2] += int(handed.sum())


def word_of(code: int, modes: Sequence[str]) -> str:
    """Return an itinerary from its code: digits from 1 to base 4, the last mode lowest."""
    letters = []
    while code:
        letters.append(modes[(code & 3) - 1] or "o")
        code >>= 2
    return " ".join(reversed(letters))
