"""What a run writes: points, steps and events, from the memory that the driver fills to compact arrays."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array
from ..constants import IMPLICIT_STEP, KINDS
from ..trajectory import Steps
from .arrays import Happened, address
from .structures import structure

#: Arrays in the order of C's pointers: type, and what there is one of for each entry; those of floats first.
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

#: Numbers of steps, points and events.
Rooms = tuple[int, int, int]
#: Room for them at first; the block of a larger run grows from there.
_FIRST: Rooms = (64, 128, 64)
#: What C needs to be free before a step.
_NEEDED: Rooms = (2, 4, 4)

#: Most bytes of polynomials that are given to a run since an earlier one needed them, largest block that grows.
_GIVEN, _LARGEST = 1 << 26, 1 << 22
#: How blocks grow: pages that are not written cost nothing.
_MUCH = 16

#: Events and points that are read one by one.
_FEW = 200


def written_arrays() -> dict[str, tuple[int, str]]:
    """Bytes of a number of each array that the driver writes, and what there is one of for each entry."""
    return {
        name: (np.dtype(dtype).itemsize, ("step", "point", "event")[kind])
        for name, (dtype, kind) in _ARRAYS.items()
    }


@lru_cache(maxsize=256)
def _layout(
    n: int, order: int, motion: int, rooms: Rooms
) -> tuple[dict[str, tuple[int, type, tuple[int, ...], int]], list[int], int]:
    """Of each array what it is of, type, shape of an entry and place in a block; the places; the block's bytes."""
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
    return arrays, [place for *_, place in arrays.values()], used


class Output:
    """A block of memory that the driver fills with steps, points and events."""

    def __init__(self, n: int, order: int, rooms: Rooms = _FIRST, motion: int = 0):
        self.motion, self._sizes = motion, (n, order, motion)
        most = _GIVEN // (8 * n * (order + 1) + 1)
        self._allot(tuple(map(max, _FIRST, (min(own, most) for own in rooms))))
        self._point_to((0, 0, 0))

    def _allot(self, rooms: Any) -> None:
        self._rooms: Rooms = rooms
        self._arrays, self._places, size = _layout(*self._sizes, rooms)
        self._block = np.empty(size, np.uint8)

    def _point_to(self, counts: Sequence[int]) -> None:
        first = address(self._block) or 0
        at = [first + place for place in self._places]
        self.pointer = ctypes.byref(structure("Output")(*counts, *self._rooms, *at))

    def written(self, counts: Sequence[int]) -> Written:
        """What was written; a copy where nearly all of a large block would be kept for nothing."""
        found = Written(self._block, self._arrays, counts)
        few = all(_MUCH * size < room for size, room in zip(counts, self._rooms, strict=True))
        if few and self._rooms != _FIRST:
            arrays, _, size = _layout(*self._sizes, (counts[0], counts[1], counts[2]))
            copy = Written(np.empty(size, np.uint8), arrays, counts)
            for name in _ARRAYS:
                copy[name][...] = found[name]
            return copy
        return found

    def full(self, counts: Sequence[int]) -> list[bool]:
        """Whether steps, points and events have no room for another step."""
        return [a + b > c for a, b, c in zip(counts, _NEEDED, self._rooms, strict=True)]

    @property
    def grows(self) -> bool:
        """Whether the block is small enough to grow."""
        return _MUCH * self._block.nbytes < _LARGEST

    def begin_with(
        self, rest: dict[str, NDArray[Any]], growing: Sequence[bool] = (False,) * 3
    ) -> None:
        """Go on in a block with this content, larger for what is ``growing`` and where half is taken."""
        rest = {name: array.copy() for name, array in rest.items()}
        counts = [len(rest[name]) for name in ("start", "point_t", "event_t")]
        rooms = tuple(
            room * (_MUCH if grows else 2 if 2 * (count + needed) > room else 1)
            for room, count, needed, grows in zip(
                self._rooms, counts, _NEEDED, growing, strict=True
            )
        )
        if rooms != self._rooms:
            self._allot(rooms)
        written = Written(self._block, self._arrays, counts)
        for name, array in rest.items():
            written[name][...] = array
        self._point_to(counts)


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
        kind, dtype, shape, place = self._arrays[name]
        return np.ndarray((self.counts[kind], *shape), dtype, self._block, place)


_Arrays = Written | dict[str, NDArray[Any]]


def rooms_of(counts: Sequence[int]) -> Rooms:
    """Room for a run of so many steps, points and events: powers of two, of which few are different."""
    steps, points, events = map(max, _FIRST, (1 << (c + 4).bit_length() for c in counts))
    return steps, points, events


class Growing:
    """An array that grows at its end; where memory can be moved by its pages, without a copy."""

    def __init__(self, like: NDArray[Any]):
        self._size, self._array = 0, np.empty((0, *like.shape[1:]), like.dtype)

    def add(self, rows: NDArray[Any]) -> None:
        """Append rows."""
        size = self._size + len(rows)
        if size > len(self._array):
            self._array.resize((size + size // 16, *rows.shape[1:]), refcheck=False)
        self._array[self._size : size] = rows
        self._size = size

    def array(self) -> NDArray[Any]:
        """Return the array; it grows no more."""
        self._array.resize((self._size, *self._array.shape[1:]), refcheck=False)
        return self._array


class Recorder:
    """Points, events, changes of the mode and, if dense, steps of one run."""

    # What can no longer change, all before the instant of the last point, is taken out of the blocks whenever
    # they are full. The state of an event is nearly always one of the points, so its row is kept. Events and
    # segments of a run that fits into the blocks are made when they are first read.

    def __init__(self, output: Output, dimension: int, dense: bool, read_at: Array | None):
        self.output, self._n, self._dense = output, dimension, dense
        self._kept: dict[str, Growing] = {}
        self._keys: dict[tuple[int, ...], int] = {}
        self._apart: list[Array] = []
        self._mode, self._counts = -1, np.zeros(3, np.int64)
        self._times = np.zeros(0) if read_at is None or dense else read_at
        self._samples: list[Array] = []
        self._last: Steps | None = None

    def make_room(self, counts: Sequence[int]) -> None:
        """Take out what was written, or give the driver larger blocks as long as they are small."""
        own, full = self.output.written(counts), self.output.full(counts)
        if self.output.grows:
            self.output.begin_with({name: own[name] for name in _ARRAYS}, full)
            return
        now = own["point_t"][-1]
        at_end = [own[name].searchsorted(now, side="left") for name in ("point_t", "event_t")]
        ends = (counts[STEP], *map(int, at_end))
        taken = {name: own[name][: ends[kind]] for name, (_, kind) in _ARRAYS.items()}
        found = self._steps(taken, now)
        self._keep(found | self._happened(taken, found["x"]))
        self.output.begin_with(
            {name: own[name][ends[kind] :] for name, (_, kind) in _ARRAYS.items()}
        )

    def _keep(self, found: dict[str, NDArray[Any]]) -> None:
        for name, array in found.items():
            self._kept.setdefault(name, Growing(array)).add(array)

    def finished(self, counts: Sequence[int]) -> dict[str, Any]:
        """Return the arrays of the whole run, as ``Run`` has them."""
        own: _Arrays = self.output.written(counts)
        total = [one + more for one, more in zip(self._counts.tolist(), counts, strict=True)]
        self.rooms = rooms_of(total)
        now = float(own["point_t"][-1])
        found = self._steps(own, now)
        if not self._dense:
            copies = {name: own[name].copy() for name in _ARRAYS if name != "coefficients"}
            own = copies | {"coefficients": own["coefficients"][:0].copy()}
            found |= {"t": own["point_t"], "x": own["point_x"][:, : self._n]}
            found |= {"starts": np.zeros(0), "implicit": np.zeros(0, bool)}
            found["coefficients"] = own["coefficients"]
        if not self._kept:
            happened, few = partial(self._read, own, found["x"], now), max(total[1:]) <= _FEW
        else:
            self._keep(found | self._happened(own, found["x"]))
            self._keep(self._end(now))
            found = {name: growing.array() for name, growing in self._kept.items()}
            whole, few = self._whole(found), False
            happened = partial(lambda: whole)
        names = ("t", "x", "starts", "coefficients", "implicit")
        return {name: found[name] for name in names} | {
            "sample_x": np.vstack(self._samples) if self._samples else found["x"][:0],
            "event_count": total[2],
            "make_happened": happened,
            "few": own if few else None,
        }

    def _read(self, own: _Arrays, x: Array, now: float) -> Happened:
        """Events and segments of a run that fits into the blocks."""
        found = {"x": x} | self._happened(own, x)
        end = self._end(now)
        return self._whole(found | {name: np.append(found[name], end[name]) for name in end})

    def _end(self, now: float) -> dict[str, NDArray[Any]]:
        """The row of the end of the run, after those of its events and segments."""
        return {
            "event_t": np.array([now]),
            "event_rows": self._counts[1:2] - 1,
            "event_jumps": np.zeros(1, np.bool_),
            "event_codes": np.array([len(self._keys)], np.int32),
            "segment_starts": np.array([now]),
        }

    def _whole(self, found: dict[str, NDArray[Any]]) -> Happened:
        """Events and segments, with the states that are no points after those that are."""
        x, rows = found["x"], found["event_rows"]
        rows[rows < 0] = len(x) - 1 - rows[rows < 0]
        if not self._dense:
            found |= {
                "event_motions": np.zeros((0, self.output.motion)),
                "segment_firsts": np.broadcast_to(np.int64(0), len(found["segment_modes"])),
            }
        names = [name for name in Happened._fields if name in found]
        states = np.vstack([x, *self._apart]) if self._apart else x
        return Happened(states=states, keys=[*self._keys], **{name: found[name] for name in names})

    def _steps(self, own: _Arrays, now: float) -> dict[str, NDArray[Any]]:
        """Points and steps before ``now``; without dense output the samples there."""
        found = {"t": own["point_t"], "x": own["point_x"][:, : self._n]}
        if self._dense:
            implicit = own["step_mode"] >= IMPLICIT_STEP
            of_steps = {"starts": own["start"], "coefficients": own["coefficients"]}
            return found | of_steps | {"implicit": implicit}
        self._sample(Steps(own["start"], own["coefficients"]), now)
        return found

    def _happened(self, own: _Arrays, x: Array) -> dict[str, NDArray[Any]]:
        """Events and changes of the mode, which follow on those before."""
        modes, found = own["step_mode"] & ~IMPLICIT_STEP, self._events(own, x)
        changes = np.flatnonzero(modes[1:] != modes[:-1]) + 1
        if len(modes) and modes[0] != self._mode:
            changes = np.append(0, changes)
        found["segment_modes"] = modes[changes]
        found["segment_starts"] = own["start"][changes]
        if self._dense:
            found["segment_firsts"] = changes + self._counts[0]
            found["event_motions"] = own["event_motion"]
        self._mode = int(modes[-1]) if len(modes) else self._mode
        self._counts += len(modes), len(x), len(own["event_t"])
        return found

    def _events(self, own: _Arrays, x: Array) -> dict[str, NDArray[Any]]:
        """Rows of the states of events among the points, and numbers of their labels."""
        t, before, after = (own[f"event_{name}"] for name in ("t", "x", "after_x"))
        before, after = before[:, : self._n], after[:, : self._n]
        jumps = _differ(before, after)
        earlier: NDArray[np.int64] = np.cumsum(jumps) - jumps
        rows = np.searchsorted(own["point_t"], t, side="left")
        rows += earlier - earlier[np.searchsorted(t, t, side="left")]
        wrong = rows + jumps >= len(x)
        at = np.where(wrong, 0, rows)
        if len(t):
            wrong |= _differ(x[at], before) | _differ(x[at + (jumps & ~wrong)], after)
        rows += self._counts[1]
        if wrong.any():
            pairs = np.stack([before[wrong], after[wrong]], axis=1).reshape(-1, self._n)
            rows[wrong] = -1 - np.arange(0, len(pairs), 2) - sum(map(len, self._apart))
            jumps |= wrong
            self._apart.append(pairs)
        return {
            "event_t": t,
            "event_rows": rows,
            "event_jumps": jumps,
            "event_codes": self._codes(own),
        }

    def _codes(self, own: _Arrays) -> NDArray[np.int32]:
        """Numbers of the different kinds of events, with their modes and guards."""
        columns = [own[f"event_{name}"] for name in ("kind", "before", "after", "guard")]
        if len(columns[0]) < _FEW:
            each = zip(*(column.tolist() for column in columns), strict=True)
            return np.array([self._keys.setdefault(k, len(self._keys)) for k in each], np.int32)
        kind, before, after, guard = (column.astype(np.int64) for column in columns)
        sizes = (len(KINDS), int(before.max()) + 1, int(after.max()) + 1)
        packed = kind + sizes[0] * (before + sizes[1] * (after + sizes[2] * (guard + 1)))
        _, first, inverse = np.unique(packed, return_index=True, return_inverse=True)
        keys = zip(*(a[first].tolist() for a in (kind, before, after, guard)), strict=True)
        numbers = [self._keys.setdefault(key, len(self._keys)) for key in keys]
        return np.array(numbers, np.int32)[inverse]

    def _sample(self, steps: Steps, now: float) -> None:
        """Read the run at its sample times before ``now``."""
        count = int(np.searchsorted(self._times, now, side="left"))
        times, self._times = self._times[:count], self._times[count:]
        begin = steps.starts[0] if len(steps) else math.inf
        early = 0 if self._last is None else int(np.searchsorted(times, begin, side="left"))
        for own, at in ((self._last, times[:early]), (steps, times[early:])):
            if own is not None and len(at):
                self._samples.append(own.at(at, self._n))
        if len(steps):
            self._last = Steps(steps.starts[-1:].copy(), np.array(steps.coefficients[-1:]))


def _differ(one: Array, other: Array) -> NDArray[np.bool_]:
    """Which rows differ in any bit."""
    return np.asarray((one.view(np.int64) != other.view(np.int64)).any(axis=1))
