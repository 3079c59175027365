"""Results of many runs: arrays of their ends, by chunk and for the whole ensemble."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model import Array, FilippovSystem
from ..notebook import representation
from ..result_tables import ResultTable
from .constants import KINDS, SIMPLE_KINDS
from .saving import Savable
from .status import Status

#: Results smaller than this (bytes) are in one piece of memory.
_LARGE = 1 << 25


class Stopped(Exception):
    """The computation was interrupted."""


def kinds_of(system: FilippovSystem) -> tuple[str, ...]:
    """Kinds of events that a system can have."""
    if system.resets or system.impacts or system.complementarity:
        return KINDS
    return (*KINDS[: SIMPLE_KINDS - 1], KINDS[-1])


def _block(arrays: Mapping[str, tuple[tuple[int, ...], type]]) -> dict[str, Any]:
    """Arrays of some shapes and types, in one block of memory unless they are large."""
    # The C library returns free memory to the system when it is twice its largest block, and it takes long
    # to get returned pages again. Types with large items come first, for alignment.
    sizes = [math.prod(shape) * np.dtype(kind).itemsize for shape, kind in arrays.values()]
    if sum(sizes) > _LARGE:
        return {name: np.empty(shape, kind) for name, (shape, kind) in arrays.items()}
    block, used, result = np.empty(sum(sizes), np.uint8), 0, {}
    for size, (name, (shape, kind)) in zip(sizes, arrays.items(), strict=True):
        result[name] = np.ndarray(shape, kind, block.data, used)
        used += size
    return result


@dataclass
class Chunk:
    """Results of some trajectories; ``itinerary`` indexes ``words``, the sorted itineraries."""

    # kinds: number of events, a column for each of ``kinds_of``. totals: steps, events, and trajectories for
    # which the lanes fell back to the scalar driver.

    x: Array
    t: Array
    status: NDArray[np.int8]
    itinerary: NDArray[np.int32]
    words: list[str]
    kinds: NDArray[np.int32]
    at_x: Array | None
    at_t: Array | None
    sample_t: Array | None = None
    sample_x: Array | None = None
    totals: NDArray[np.int64] = field(default_factory=lambda: np.zeros(4, np.int64))

    @classmethod
    def empty(cls, count: int, system: FilippovSystem, at: bool, room: int | None = None) -> Chunk:
        """Arrays without values for ``count`` trajectories of a system, ``room`` samples each."""
        n, kinds = system.dimension, len(kinds_of(system))
        shapes: dict[str, tuple[tuple[int, ...], type]] = {
            "x": ((count, n), np.float64),
            "t": ((count,), np.float64),
            "kinds": ((count, kinds), np.int32),
            "itinerary": ((count,), np.int32),
            "status": ((count,), np.int8),
        }
        return cls(
            words=[],
            at_x=np.empty((count, n)) if at else None,
            at_t=np.empty(count) if at else None,
            sample_t=None if room is None else np.empty((count, room)),
            sample_x=None if room is None else np.empty((count, room, n)),
            **_block(shapes),
        )

    @property
    def row_size(self) -> int:
        """Bytes of the results of one trajectory."""
        return sum(a.itemsize * math.prod(a.shape[1:]) for a in self.arrays().values())

    def part(self, first: int, last: int) -> Chunk:
        """Return the arrays of the trajectories first to last - 1, to be written in place."""
        arrays: dict[str, Any] = {name: a[first:last] for name, a in self.arrays().items()}
        return replace(self, words=[], totals=np.zeros(4, np.int64), **arrays)

    def forget(self) -> None:
        """Fill the arrays of events and samples with NaN."""
        for array in (self.at_x, self.at_t, self.sample_t, self.sample_x):
            if array is not None:
                array[:] = np.nan

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays with one row for each trajectory."""
        names = (
            *("x", "t", "status", "itinerary", "kinds"),
            *("at_x", "at_t", "sample_t", "sample_x"),
        )
        return {name: a for name in names if (a := getattr(self, name)) is not None}

    def take(self, parts: Iterable[tuple[NDArray[np.intp] | slice, Chunk]]) -> None:
        """Replace some rows by the results of other chunks, and add their steps and events."""
        own, words = self.arrays(), [*self.words]
        for rows, chunk in parts:
            for name, array in chunk.arrays().items():
                own[name][rows] = array
            self.itinerary[rows] += len(words)
            words += chunk.words
            self.totals[:2] += chunk.totals[:2]
        used = np.flatnonzero(np.bincount(self.itinerary)).tolist()
        self.rename({code: words[code] for code in used})

    def rename(self, words: Mapping[int, str]) -> None:
        """Number the itineraries that are in use in sorted order."""
        self.words = sorted(set(words.values()))
        number = {word: k for k, word in enumerate(self.words)}
        table = np.zeros(max(words, default=0) + 1, np.int32)
        for code, word in words.items():
            table[code] = number[word]
        self.itinerary[:] = table.take(self.itinerary)


def _require_statuses(many: Ensemble) -> None:
    """Raise ValueError where a number is no status."""
    if not np.isin(many.status, [int(s) for s in Status]).all():
        raise ValueError("Ensemble.status: it has no status")


@dataclass(frozen=True, repr=False)
class Ensemble(
    Savable,
    check=_require_statuses,
    x="... n nan",
    t="... nan",
    status="...",
    itinerary_code="... <itineraries",
    events="...",
    event_x="... n nan",
    event_t="... nan",
    sample_x="... k n nan",
    sample_t="... k nan",
):
    """Results, each of the shape ``(...)`` of the broadcast starts and parameters.

    Attributes
    ----------
    x : ndarray (..., n)
        States at the ends of the runs.
    t : ndarray (...)
        Times of these ends.
    status : ndarray of int8 (...)
        Values of :class:`Status`; compare with its members.
    itineraries : tuple of str
        The different itineraries that occur, sorted.
    itinerary_code : ndarray of int32 (...)
        Position in ``itineraries``.
    events : dict of str to ndarray of int32 (...)
        Number of events by kind: crossing, entry, exit, stop, reset, end.
    event_x, event_t : ndarray (..., n), (...) or None
        State and time of the event given by ``at_event``; NaN where it did not happen.
    sample_x, sample_t : ndarray (..., K, n), (..., K) or None
        States and times of the samples by ``t_eval`` or ``at``; NaN where there are none.
    state_names : tuple of str
        Names of the states, in their order on the last axis.
    engine : str
        What ran: ``"lanes"``, several trajectories in step, ``"core"``, one at a time, or ``"cuda"``.
        Itineraries are the same with each, and numbers within the tolerance; of more than 30 modes on a card the
        first 30 are kept, and ``...``.
    """

    x: Array
    t: Array
    status: NDArray[np.int8]
    itineraries: tuple[str, ...]
    itinerary_code: NDArray[np.int32]
    events: dict[str, NDArray[np.int32]]
    event_x: Array | None = None
    event_t: Array | None = None
    sample_x: Array | None = None
    sample_t: Array | None = None
    state_names: tuple[str, ...] = ()
    engine: str = "core"

    @property
    def itinerary(self) -> NDArray[np.object_]:
        """Itineraries as strings; equal ones are the same object."""
        return np.array([*self.itineraries, ""], dtype=object)[self.itinerary_code]

    @property
    def complete(self) -> NDArray[np.bool_]:
        """Whether each run reached its end or a stop."""
        return (self.status == Status.REACHED_END) | (self.status == Status.STOPPED)

    def _tables(self) -> dict[str, ResultTable]:
        axes: dict[str, Any] = {f"start_{k}": size for k, size in enumerate(self.t.shape)}
        labels = {"state": self.state_names} if self.state_names else {}
        columns = {
            "t": self.t,
            "x": self.x,
            "status": self._named_status(),
            "itinerary": self.itinerary,
        }
        counts = {f"{kind}_count": number for kind, number in self.events.items()}
        tables = {"ends": ResultTable(axes, columns | counts, labels)}
        if self.event_x is not None:
            tables["events"] = ResultTable(axes, {"t": self.event_t, "x": self.event_x}, labels)
        if self.sample_t is not None:
            samples = axes | {"sample": self.sample_t.shape[-1]}
            tables["samples"] = ResultTable(
                samples, {"t": self.sample_t, "x": self.sample_x}, labels
            )
        return tables

    def _named_status(self) -> NDArray[np.object_]:
        """Names of the statuses (...)."""
        return np.array([str(s) for s in sorted(Status)], dtype=object)[self.status]

    def _repr_html_(self) -> str:
        """Notebook representation: number of runs and their ends."""
        shape = " x ".join(map(str, self.t.shape))
        rows = (
            ("runs", shape),
            ("states", ", ".join(self.state_names)),
            ("itineraries", len(self.itineraries)),
            ("ends", self._ends()),
        )
        return representation("Ensemble", rows)

    def __repr__(self) -> str:
        return (
            f"Ensemble(shape {self.t.shape}, {self.x.shape[-1]} states, "
            f"{len(self.itineraries)} itineraries; {self._ends()})"
        )

    def _ends(self) -> str:
        """Number of runs by status."""
        flat, size = self.status.reshape(-1), 1 << 22
        pieces = [flat[k : k + size] for k in range(0, len(flat), size)]
        number = {s: sum(int(np.count_nonzero(piece == s)) for piece in pieces) for s in Status}
        return ", ".join(f"{s} {k}" for s, k in number.items() if k)


class Collected:
    """Arrays of all trajectories, filled as chunks arrive in any order."""

    def __init__(
        self,
        system: FilippovSystem,
        shape: tuple[int, ...],
        at: bool,
        room: int | None = None,
        arrays: Chunk | None = None,
    ):
        self.system, self.shape = system, shape
        self.all = Chunk.empty(math.prod(shape), system, at, room) if arrays is None else arrays
        self._words: dict[str, int] = {}
        self._parts: list[tuple[int, int, NDArray[np.int32]]] = []

    def part(self, first: int, last: int) -> Chunk:
        """Return the arrays of some trajectories, to be written in place."""
        return self.all.part(first, last)

    def put(self, first: int, chunk: Chunk) -> None:
        """Take a chunk that begins with trajectory ``first``; its arrays may be a part of these."""
        whole = self.all.arrays()
        for name, array in chunk.arrays().items():
            if not np.may_share_memory(array, whole[name]):
                whole[name][first : first + len(array)] = array
        numbers = [self._words.setdefault(w, len(self._words)) for w in chunk.words]
        self._parts.append((first, first + len(chunk.t), np.array(numbers, np.int32)))

    def ensemble(self, engine: str, codes: NDArray[np.int32] | None = None) -> Ensemble:
        """Return the results, with the itineraries sorted and their numbers in ``codes``."""
        words, every = sorted(self._words), self.all
        position = np.empty(len(words), np.int32)
        for k, word in enumerate(words):
            position[self._words[word]] = k
        code = every.itinerary if codes is None else codes
        for first, last, numbers in self._parts:
            code[first:last] = position[numbers].take(every.itinerary[first:last])

        def shaped(a: Any) -> Any:
            return None if a is None else a.reshape((*self.shape, *a.shape[1:]))

        return Ensemble(
            x=shaped(every.x),
            t=shaped(every.t),
            status=shaped(every.status),
            itineraries=tuple(words),
            itinerary_code=shaped(code),
            events=self._events(),
            event_x=shaped(every.at_x),
            event_t=shaped(every.at_t),
            sample_x=shaped(every.sample_x),
            sample_t=shaped(every.sample_t),
            state_names=self.system.state_names,
            engine=engine,
        )

    def _events(self) -> dict[str, NDArray[np.int32]]:
        """Numbers of events by kind; all kinds that cannot happen share one zero."""
        never, kinds = np.broadcast_to(np.int32(0), self.shape), kinds_of(self.system)
        counted = {kind: self.all.kinds[:, k].reshape(self.shape) for k, kind in enumerate(kinds)}
        return {kind: counted.get(kind, never) for kind in KINDS}
