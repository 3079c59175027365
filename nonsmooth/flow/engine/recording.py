"""Output of a run: points, steps and events, from the memory that the driver fills to compact arrays."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array
from ..constants import IMPLICIT_STEP
from ..trajectory import Steps
from .arrays import address
from .structures import structure

#: Arrays in the order of C's pointers: type, and the counter of their entries; those of floats first.
_ARRAYS: dict[str, tuple[type, int]] = {
    "start": (float, STEP := 0),
    "coefficients": (float, STEP),
    "point_t": (float, POINT := 1),
    "point_x": (float, POINT),
    "event_t": (float, EVENT := 2),
    "event_x": (float, EVENT),
    "event_after_x": (float, EVENT),
    "event_motion": (float, EVENT),
    "step_mode": (np.int32, STEP),
    "event_kind": (np.int32, EVENT),
    "event_before": (np.int32, EVENT),
    "event_after": (np.int32, EVENT),
    "event_guard": (np.int32, EVENT),
}

_MOTION = [*_ARRAYS].index("event_motion")

#: Numbers of steps, points and events.
Rooms = tuple[int, int, int]
#: Room for them at first; the block of a larger run grows from there.
_FIRST: Rooms = (64, 128, 64)
#: Bytes of polynomials at a time where steps are not kept.
_LOOSE = 1 << 22
#: Free room that C needs before a step.
_NEEDED: Rooms = (2, 4, 4)

#: Most bytes of polynomials reserved because an earlier run needed them; most bytes that grow by the large factor.
_GIVEN, _LARGEST = 1 << 26, 1 << 18
#: Growth of arrays, as unwritten pages cost nothing; of large arrays by a part.
_MUCH, _PART = 16, 8

#: Events and points that are read one by one.
_FEW = 200


def written_arrays() -> dict[str, tuple[int, str]]:
    """Bytes of a number of each array that the driver writes, and the counter of its entries."""
    return {
        name: (np.dtype(dtype).itemsize, ("step", "point", "event")[kind])
        for name, (dtype, kind) in _ARRAYS.items()
    }


@lru_cache(maxsize=256)
def _layout(
    n: int, order: int, motion: int, rooms: Rooms
) -> tuple[dict[str, tuple[int, type, tuple[int, ...], int]], list[int], int]:
    """Counter, type, shape of an entry and offset of each array in a block; the offsets; the block's bytes."""
    shapes: dict[str, tuple[int, ...]] = {
        "coefficients": (n, order + 1),
        **dict.fromkeys(("point_x", "event_x", "event_after_x"), (n,)),
        "event_motion": (motion,),
    }
    arrays, used = dict[str, tuple[int, type, tuple[int, ...], int]](), 0
    for name, (dtype, kind) in _ARRAYS.items():
        shape = shapes.get(name, ())
        arrays[name] = kind, dtype, shape, used
        used += rooms[kind] * math.prod(shape) * np.dtype(dtype).itemsize
    return arrays, [offset for *_, offset in arrays.values()], used


class Output:
    """Memory that the driver fills with steps, points and events: a block, then an array for each that grows."""

    def __init__(self, n: int, order: int, rooms: Rooms | None = None, motion: int = 0):
        self.motion, self._sizes = motion, (n, order, motion)
        most, given = _GIVEN // (8 * n * (order + 1) + 1), rooms or _FIRST
        steps, points, events = (
            max(a, min(own, most)) for a, own in zip(_FIRST, given, strict=True)
        )
        self._rooms: Rooms = steps, points, events
        self._arrays, positions, size = _layout(*self._sizes, self._rooms)
        self._block = np.empty(size, np.uint8)
        self._grown: dict[str, NDArray[Any]] = {}
        first = address(self._block) or 0
        self._point_to((0, 0, 0), [first + offset for offset in positions])

    def _point_to(self, counts: Sequence[int], positions: list[int]) -> None:
        if not self.motion:  # C writes none
            positions[_MOTION] = 0
        self.pointer = ctypes.byref(structure("Output")(*counts, *self._rooms, *positions))

    def written(self, counts: Sequence[int]) -> Arrays:
        """The written arrays; a copy where most of a large block would be unused."""
        if self._grown:
            return {name: self._grown[name][: counts[kind]] for name, (_, kind) in _ARRAYS.items()}
        found = Written(self._block, self._arrays, counts)
        few = all(_MUCH * size < room for size, room in zip(counts, self._rooms, strict=True))
        if few and self._rooms != _FIRST:
            arrays, _, size = _layout(*self._sizes, (counts[0], counts[1], counts[2]))
            copy = Written(np.empty(size, np.uint8), arrays, counts)
            for name in _ARRAYS:
                copy[name][...] = found[name]
            return copy
        return found

    def grow(self, counts: Sequence[int]) -> None:
        """Keep this content and enlarge the arrays that have no room for another step."""
        own, grown = self.written(counts), self._grown
        size = sum(own[name].nbytes for name in _ARRAYS)
        steps, points, events = (
            room
            if count + needed <= room
            else _MUCH * room
            if size < _LARGEST
            else room + room // _PART + needed
            for room, count, needed in zip(self._rooms, counts, _NEEDED, strict=True)
        )
        self._rooms = steps, points, events
        for name, (_, kind) in _ARRAYS.items():
            array = grown.get(name)
            if array is None:
                array = own[name].copy()
            array.resize((self._rooms[kind], *array.shape[1:]), refcheck=False)
            grown[name] = array
        self._grown = grown
        self._point_to(counts, [array.ctypes.data for array in grown.values()])


class Written:
    """Arrays of what was written, by name: views of a block, each made when it is read."""

    def __init__(
        self,
        block: NDArray[np.uint8],
        arrays: Mapping[str, tuple[int, type, tuple[int, ...], int]],
        counts: Sequence[int],
    ):
        self._block, self._arrays, self.counts = block, arrays, counts

    def __getitem__(self, name: str) -> NDArray[Any]:
        kind, dtype, shape, offset = self._arrays[name]
        return np.ndarray((self.counts[kind], *shape), dtype, self._block, offset)


Arrays = Written | dict[str, NDArray[Any]]


def loose_rooms(n: int, order: int) -> Rooms:
    """Room at first where steps are not kept: few calls for more of it."""
    return _LOOSE // (8 * n * (order + 1)), *_FIRST[1:]


def rooms_of(counts: Sequence[int]) -> Rooms:
    """Room for a run of so many steps, points and events: powers of two, of which few are different."""
    steps, points, events = map(max, _FIRST, (1 << (c + 4).bit_length() for c in counts))
    return steps, points, events


class Recorder:
    """Points, events, changes of the mode and, if dense, steps of one run."""

    # The state of an event is nearly always one of the points, so its row is kept. Events and segments are made when
    # they are first read.

    def __init__(self, output: Output, dimension: int, dense: bool, read_at: Array | None):
        self.output, self._n, self._dense = output, dimension, dense
        self._times = np.zeros(0) if read_at is None or dense else read_at
        self._samples: list[Array] = []
        self._last: Steps | None = None
        #: Without dense output, start and mode of steps that were left out: those that begin a segment.
        self._begun: dict[str, list[NDArray[Any]]] = {"start": [], "step_mode": []}

    def make_room(self, counts: Sequence[int]) -> None:
        """Give the driver more room."""
        steps, points, events = counts
        if not self._dense:
            own, steps = self.output.written(counts), 0
            self._sample(own)
            changes = changes_of(own["step_mode"])
            for name, begun in self._begun.items():
                begun.append(own[name][changes])
        self.output.grow((steps, points, events))

    def finished(self, counts: Sequence[int]) -> dict[str, Any]:
        """Return the arrays of the whole run, as ``Run`` has them."""
        own = self.output.written(counts)
        self.rooms = rooms_of(counts)
        if not self._dense:
            self._sample(own)
            begun = {name: np.concatenate([*k, own[name]]) for name, k in self._begun.items()}
            if isinstance(own, Written):  # views of a block with the polynomials
                own = {name: own[name].copy() for name in _ARRAYS}
            own = own | begun | {"coefficients": own["coefficients"][:0].copy()}
        steps = counts[STEP] if self._dense else 0
        x = own["point_x"][:, : self._n]
        return {
            "t": own["point_t"],
            "x": x,
            "starts": own["start"][:steps],
            "coefficients": own["coefficients"],
            "implicit": own["step_mode"][:steps] >= IMPLICIT_STEP,
            "sample_x": np.vstack(self._samples) if self._samples else x[:0],
            "event_count": counts[EVENT],
            "written": own,
            "few": max(counts[1:]) <= _FEW,
        }

    def _sample(self, own: Arrays) -> None:
        """Read the run at its sample times before the last point."""
        steps, now = Steps(own["start"], own["coefficients"]), own["point_t"][-1]
        count = int(np.searchsorted(self._times, now, side="left"))
        times, self._times = self._times[:count], self._times[count:]
        begin = steps.starts[0] if len(steps) else math.inf
        early = 0 if self._last is None else int(np.searchsorted(times, begin, side="left"))
        for part, at in ((self._last, times[:early]), (steps, times[early:])):
            if part is not None and len(at):
                self._samples.append(part.at(at, self._n))
        if len(steps):
            self._last = Steps(steps.starts[-1:].copy(), np.array(steps.coefficients[-1:]))


def changes_of(modes: NDArray[np.int32]) -> NDArray[np.int64]:
    """Numbers of the steps that begin a segment."""
    own = modes & ~IMPLICIT_STEP
    return np.append(np.arange(min(len(own), 1)), np.flatnonzero(own[1:] != own[:-1]) + 1)


def states_of_events(own: Arrays, x: Array) -> tuple[Array, NDArray[np.int64], NDArray[np.bool_]]:
    """Points of a run followed by states of events that are not points, rows of the events' states, and whether the state
    after each is the next row."""
    t, before, after = (own[f"event_{name}"] for name in ("t", "x", "after_x"))
    before, after = before[:, : x.shape[1]], after[:, : x.shape[1]]
    jumps = _differ(before, after)
    earlier: NDArray[np.int64] = np.cumsum(jumps) - jumps
    rows = np.searchsorted(own["point_t"], t, side="left")
    rows += earlier - earlier[np.searchsorted(t, t, side="left")]
    wrong = rows + jumps >= len(x)
    at = np.where(wrong, 0, rows)
    wrong |= _differ(x[at], before) | _differ(x[at + (jumps & ~wrong)], after)
    if not wrong.any():
        return x, rows, jumps
    pairs = np.stack([before[wrong], after[wrong]], axis=1).reshape(-1, x.shape[1])
    rows[wrong] = len(x) + np.arange(0, len(pairs), 2)
    return np.vstack([x, pairs]), rows, jumps | wrong


def codes_of(own: Arrays) -> tuple[NDArray[np.int32], list[tuple[int, ...]]]:
    """Numbers of the different kinds of events, with their modes and guards, and these."""
    columns = [own[f"event_{name}"] for name in ("guard", "after", "before", "kind")]
    sizes = [int(column.max(initial=0)) + 1 for column in columns]
    packed = np.zeros(len(columns[0]), np.int64)
    for column, size in zip(columns, sizes, strict=True):
        packed *= size
        packed += column
    packed += math.prod(sizes[1:])  # guards begin at -1
    values = np.unique(packed)
    codes, keys = np.searchsorted(values, packed).astype(np.int32), list[NDArray[np.int64]]()
    for size in sizes[:0:-1]:
        values, key = np.divmod(values, size)
        keys.append(key)
    return codes, [*zip(*(key.tolist() for key in (*keys, values - 1)), strict=True)]


def _differ(one: Array, other: Array) -> NDArray[np.bool_]:
    """Which rows differ in any bit."""
    return np.asarray((one.view(np.int64) != other.view(np.int64)).any(axis=1))
