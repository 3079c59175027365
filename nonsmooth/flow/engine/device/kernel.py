"""A system's trajectories on a GPU, from Python: sources of starts, and results."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....model import Array, FilippovSystem
from ...constants import SIMPLE_KINDS
from ...options import Options
from ...results import Chunk
from ...status import Status
from ..building.codegen import device_source
from .card import Card
from .records import Records, record_type, word_of

#: Kinds of starts, by number in cuda.c.
_ROWS, _GRID, _BOX, _RECORDS = 0, 1, 2, 3

#: An unlimited count, in 64 bits.
_MOST = 2**62

#: Seconds of a launch, after which Python handles Ctrl-C; steps of each thread in the first one.
_SECONDS, _FIRST_STEPS = 0.1, 1000


@dataclass(frozen=True)
class Source:
    """Source of the starts of a kernel."""

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

    @classmethod
    def records(cls, left: Records) -> Source:
        """Runs that continue after a step of the driver."""
        return cls(_RECORDS, 0, np.ascontiguousarray(left).view(np.float64), np.zeros(1, np.int64))


class Given(NamedTuple):
    """Trajectories of one call: ``size`` of them, the first of which has the number ``first`` in its source."""

    source: Source
    first: int
    size: int
    p: Array
    options: Options


@dataclass(frozen=True)
class Bins:
    """Bins of equal width for the states and the time."""

    count: int
    low: Array
    high: Array

    def indices(self, k: int, values: Array) -> NDArray[np.int64]:
        """Bin indices of values of column k; values outside all bins are dropped."""
        low, high = self.low[k], self.high[k]
        index = (values - low) * (self.count / (high - low))
        index = np.where(values == high, self.count - 1, index)
        return index[(index >= 0) & (index < self.count)].astype(np.int64)


@dataclass(frozen=True)
class Reduced:
    """Sums over the ends of some runs."""

    words: dict[str, int]
    status: dict[int, int]
    sums: Array
    histogram: NDArray[np.int64]


class Kernel:
    """Kernels that run a system's trajectories on a machine, compiled when first needed."""

    def __init__(self, system: FilippovSystem, order: int, machine: Card):
        self.system, self.order, self.machine = system, order, machine
        self.record = record_type(system)
        self.steps = _FIRST_STEPS  # of a launch
        self._compiled: tuple[Any, int] | None = None
        self.lock = machine.lock

    @property
    def compiled(self) -> tuple[Any, int]:
        """The kernels, and how many numbers are prepared from the parameters."""
        with self.lock:
            if self._compiled is None:
                source = device_source(self.system, self.order, self.machine.threads)
                size = re.search(r"^#define NQ (\d+)$", source, re.MULTILINE)
                assert size is not None
                self._compiled = self.machine.compile(source), int(size[1])
            return self._compiled

    def memory(self, name: str, size: int) -> Any:
        """Memory of at least so many bytes, which later calls use again."""
        kept = self.machine.kept
        if name not in kept or kept[name][0] < size:
            kept.pop(name, None)  # before there is more
            kept[name] = size, self.machine.empty(size)
        return kept[name][1]

    def run(self, given: Given, at: tuple[int, int] | None, out: Chunk) -> Records:
        """Run trajectories, with an event at which they are kept.

        Those that need a step of the driver have the status FALL_BACK; their records are returned.
        """
        with self.lock:
            machine, (kernels, _), count = self.machine, self.compiled, given.size
            memory, left = self.start(given, at)
            keys, totals = np.zeros(TABLE_SIZE, np.int64), np.zeros(2, np.int64)
            there = [machine.write(keys), self.memory("slot", 4 * count), machine.write(totals)]
            arrays = [memory[name] for name in ("status", "kinds", "steps", "code")]
            machine.launch(kernels, "numbered", [count, *arrays, TABLE_SIZE, *there])
            for name in _READ:
                if name in memory:
                    machine.read(memory[name], getattr(out, name))
            machine.read(there[0], keys)
            machine.read(there[1], out.itinerary)
            machine.read(there[2], totals)
            words = {
                int(k): word_of(int(keys[k]) - 1, self.system.modes) for k in keys.nonzero()[0]
            }
            if out.itinerary.min(initial=0) < 0:
                words = self._beyond(memory["code"], out, words)
            out.rename(words)
            out.totals[:2] += totals
            out.totals[2] += left
            return self._records(memory["left"], left)

    def start(self, given: Given, at: tuple[int, int] | None) -> tuple[dict[str, Any], int]:
        """Run them, as :meth:`run` does: the memory where their results are, and the number of records."""
        machine, n, (source, first, count, p, options) = self.machine, self.system.dimension, given
        kernels, width = self.compiled
        rows = np.atleast_2d(np.ascontiguousarray(p, float))
        q = self.memory("q", 8 * width * len(rows))
        own_rows = [len(rows), rows.shape[1], machine.write(rows), q]
        machine.launch(kernels, "parameters", own_rows)
        sizes = _sizes(count, n, at is not None) | {"left": self.record.itemsize * count}
        memory = {name: self.memory(name, size) for name, size in sizes.items()}
        own = self.memory("own", (self.record.itemsize + 16) * machine.blocks * machine.threads)
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
        counts, is_first = np.zeros(2, np.int64), 1
        while True:
            counts[1] = 0
            there, began = machine.write(counts), time.perf_counter()
            more = [own, there, is_first, self.steps]
            machine.launch(kernels, "trajectories", [*arguments, *more])
            machine.read(there, counts)
            if not counts[1]:
                return memory, int(counts[0])
            is_first = 0
            faster = _SECONDS / max(time.perf_counter() - began, 1e-9)
            self.steps = max(1, int(self.steps * min(max(faster, 0.25), 8.0)))

    def _records(self, memory: Any, count: int) -> Records:
        """Records of the runs that were left, in the order of their numbers."""
        found = np.empty(count, self.record)
        self.machine.read(memory, found.view(np.int64))
        return found[np.argsort(found["index"])]

    def _beyond(self, memory: Any, out: Chunk, words: dict[int, str]) -> dict[int, str]:
        """Itineraries that found no room in a table too."""
        code = np.empty(len(out.t), np.int64)
        self.machine.read(memory, code)
        rows = np.flatnonzero(out.itinerary < 0)
        more, slot = np.unique(code[rows], return_inverse=True)
        out.itinerary[rows] = TABLE_SIZE + slot
        modes = self.system.modes
        return words | {TABLE_SIZE + k: word_of(c, modes) for k, c in enumerate(more.tolist())}


class Reduction:
    """Sums over runs, kept on the machine."""

    def __init__(self, kernel: Kernel, bins: Bins):
        self.kernel, self.bins = kernel, bins
        machine, n = kernel.machine, kernel.system.dimension
        self._arrays: dict[str, NDArray[Any]] = {
            "histogram": np.zeros((n + 1, bins.count), np.int64),
            "sums": np.zeros((machine.blocks * machine.threads, n + 1, 2)),
            "keys": np.zeros(TABLE_SIZE, np.int64),
            "counts": np.zeros(TABLE_SIZE, np.int64),
            "status": np.zeros(len(Status), np.int64),
        }
        self._there = {name: machine.write(array) for name, array in self._arrays.items()}
        self._ranges = [bins.count, machine.write(bins.low), machine.write(bins.high)]

    def add(self, given: Given) -> tuple[Records, Chunk | None]:
        """Run trajectories and add their ends, except those in the records and in the chunk."""
        # The chunk has the runs whose itineraries have no room in the table.
        kernel, machine, there, count = self.kernel, self.kernel.machine, self._there, given.size
        with kernel.lock:
            memory, left = kernel.start(given, None)
            number = np.zeros(1, np.int64)
            rest = [machine.write(number), kernel.memory("rest", 8 * count)]
            results = [memory[name] for name in ("x", "t", "status", "code")]
            sums = [there["histogram"], there["sums"], TABLE_SIZE]
            table = [there[name] for name in ("keys", "counts", "status")]
            arguments = [count, *results, *self._ranges, *sums, *table, *rest]
            machine.launch(kernel.compiled[0], "outcomes", arguments)
            machine.read(rest[0], number)
            others = self._others(memory, rest[1], count, int(number[0])) if number[0] else None
            return kernel._records(memory["left"], left), others

    def _others(self, memory: Mapping[str, Any], rest: Any, count: int, number: int) -> Chunk:
        system, machine = self.kernel.system, self.kernel.machine
        rows, code = np.empty(number, np.int64), np.empty(count, np.int64)
        machine.read(rest, rows)
        machine.read(memory["code"], code)
        whole = Chunk.empty(count, system, False)
        for name in ("x", "t", "status"):
            machine.read(memory[name], getattr(whole, name))
        rows.sort()
        made = Chunk.empty(number, system, False)
        made.x[:], made.t[:], made.status[:] = whole.x[rows], whole.t[rows], whole.status[rows]
        made.kinds[:] = 0
        more, slot = np.unique(code[rows], return_inverse=True)
        made.itinerary[:] = slot
        made.rename({k: word_of(c, system.modes) for k, c in enumerate(more.tolist())})
        return made

    def read(self) -> Reduced:
        """Return the sums."""
        arrays, modes = self._arrays, self.kernel.system.modes
        for name, array in arrays.items():
            self.kernel.machine.read(self._there[name], array)
        used = np.flatnonzero(arrays["counts"])
        codes, counts = arrays["keys"][used] - 1, arrays["counts"][used]
        words = zip(codes.tolist(), counts.tolist(), strict=True)
        return Reduced(
            words={word_of(code, modes): number for code, number in words},
            status={k: m for k, m in enumerate(arrays["status"].tolist()) if m},
            sums=arrays["sums"].sum(axis=0),
            histogram=arrays["histogram"],
        )


#: Different itineraries that a card counts at once, a power of two.
TABLE_SIZE = 1 << 14

#: Results, in the order in which the kernel takes them; those that have their names in a chunk.
_ORDER = ("x", "t", "status", "kinds", "steps", "code", "at_x", "at_t", "left")
_READ = ("x", "t", "status", "kinds", "at_x", "at_t")


def _sizes(count: int, n: int, at: bool) -> dict[str, int]:
    """Bytes of what a kernel writes, but the records."""
    each = {"x": 8 * n, "t": 8, "status": 1, "kinds": 4 * SIMPLE_KINDS, "steps": 4, "code": 8}
    if at:
        each |= {"at_x": 8 * n, "at_t": 8}
    return {name: size * count for name, size in each.items()}
