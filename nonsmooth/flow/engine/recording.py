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

#: Arrays in the order of C's pointers: type, and what there is one of for each entry.
_ARRAYS = {
    "start": (float, "step"),
    "coefficients": (float, "step"),
    "point_t": (float, "point"),
    "point_x": (float, "point"),
    "event_t": (float, "event"),
    "event_x": (float, "event"),
    "event_after_x": (float, "event"),
    "event_motion": (float, "event"),
    "step_mode": (np.int32, "step"),
    "event_kind": (np.int32, "event"),
    "event_before": (np.int32, "event"),
    "event_after": (np.int32, "event"),
    "event_guard": (np.int32, "event"),
}

#: What there is several of, and room for at first; blocks of larger runs grow from there.
_FIRST = {"step": 64, "point": 128, "event": 64}

#: Largest block that is given to a run since an earlier one needed it, and largest that grows (bytes).
_GIVEN, _LARGEST = 1 << 26, 1 << 22
#: How blocks grow: pages that are not written cost nothing.
_MUCH = 16

#: Events and points that are read one by one.
_FEW = 200

#: Rows of all arrays that C needs to be free before a step.
_NEEDED = {"step": 2, "point": 4, "event": 4}

Rooms = Mapping[str, int]


@lru_cache(maxsize=64)
def _layout(
    n: int, order: int, motion: int
) -> tuple[dict[str, tuple[int, tuple[int, ...]]], dict[str, int]]:
    """For each array the bytes before it in its block, by room, and its shape; bytes of each kind."""
    shapes: dict[str, tuple[int, ...]] = {
        "coefficients": (n, order + 1),
        **dict.fromkeys(("point_x", "event_x", "event_after_x"), (n,)),
        "event_motion": (motion,),
    }
    used, places = dict.fromkeys(_FIRST, 0), {}
    for name, (dtype, kind) in _ARRAYS.items():  # those of floats first
        shape = shapes.get(name, ())
        places[name] = used[kind], shape
        used[kind] += math.prod(shape) * (8 if dtype is float else 4)
    return places, used


def written_arrays() -> dict[str, tuple[int, str]]:
    """Bytes of a number of each array that the driver writes, and what there is one of for each entry."""
    return {name: (8 if dtype is float else 4, kind) for name, (dtype, kind) in _ARRAYS.items()}


class Output:
    """A block of memory for each of steps, points and events, which the driver fills."""

    def __init__(self, n: int, order: int, rooms: Rooms = _FIRST, motion: int = 0):
        self.motion = motion
        self._places, self._sizes = _layout(n, order, motion)
        self._rooms = {
            kind: max(least, min(rooms[kind], _GIVEN // self._sizes[kind]))
            for kind, least in _FIRST.items()
        }
        self._blocks = {kind: self._block(kind) for kind in _FIRST}
        self._point_to((0, 0, 0))

    def _block(self, kind: str) -> NDArray[np.uint8]:
        return np.empty(self._rooms[kind] * self._sizes[kind], np.uint8)

    def _point_to(self, counts: Sequence[int]) -> None:
        first = {kind: address(block) or 0 for kind, block in self._blocks.items()}
        rooms, places = self._rooms, self._places
        at = [first[own] + rooms[own] * places[name][0] for name, (_, own) in _ARRAYS.items()]
        self.pointer = ctypes.byref(structure("Output")(*counts, *rooms.values(), *at))

    def full(self, counts: Sequence[int]) -> dict[str, bool]:
        """Kinds without room for another step, and whether their blocks may grow."""
        return {
            kind: _MUCH * self._blocks[kind].nbytes < _LARGEST
            for kind, size in zip(_FIRST, counts, strict=True)
            if size + _NEEDED[kind] > self._rooms[kind]
        }

    def written(self, counts: Sequence[int]) -> dict[str, NDArray[Any]]:
        """Arrays of what was written, views of the blocks."""
        sizes = dict(zip(_FIRST, counts, strict=True))
        return {
            name: np.ndarray(
                (sizes[kind], *self._places[name][1]),
                dtype,
                self._blocks[kind],
                self._rooms[kind] * self._places[name][0],
            )
            for name, (dtype, kind) in _ARRAYS.items()
        }

    def own(self, written: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Copies where nearly all of a block would be kept for nothing."""
        found = dict(written)
        for name, (_, kind) in _ARRAYS.items():
            if self._rooms[kind] > _FIRST[kind] and _MUCH * len(found[name]) < self._rooms[kind]:
                found[name] = found[name].copy()
        return found

    def begin_with(self, rest: dict[str, NDArray[Any]], growing: Sequence[str] = ()) -> None:
        """Go on in blocks with this content, larger ones for ``growing`` and where half is taken."""
        rest = {name: array.copy() for name, array in rest.items()}
        counts = [len(rest[name]) for name in ("start", "point_t", "event_t")]
        for kind, count in zip(_FIRST, counts, strict=True):
            if kind in growing or 2 * (count + _NEEDED[kind]) > self._rooms[kind]:
                self._rooms[kind] *= _MUCH if kind in growing else 2
                self._blocks[kind] = self._block(kind)
        for name, array in self.written(counts).items():
            array[...] = rest[name]
        self._point_to(counts)


def rooms_of(counts: Sequence[int]) -> Rooms:
    """Room for a run of so many steps, points and events."""
    return {
        kind: count + needed for (kind, needed), count in zip(_NEEDED.items(), counts, strict=True)
    }


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
        self._last = Steps()

    def make_room(self, counts: Sequence[int]) -> None:
        """Take out what was written, or give the driver larger blocks as long as they are small."""
        own, full = self.output.written(counts), self.output.full(counts)
        if all(full.values()):
            self.output.begin_with(own, [*full])
            return
        now = own["point_t"][-1]
        ends = {
            "step": counts[0],
            "point": int(np.searchsorted(own["point_t"], now, side="left")),
            "event": int(np.searchsorted(own["event_t"], now, side="left")),
        }
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
        own, before = self.output.written(counts), len(self._kept) > 0
        total = [one + more for one, more in zip(self._counts.tolist(), counts, strict=True)]
        self.rooms = rooms_of(total)
        now = float(own["point_t"][-1])
        own = own if before else self.output.own(own)
        found = self._steps(own, now)
        if not self._dense:
            steps = ("start", "step_mode")
            own |= {name: own[name].copy() for name in steps}
            own["coefficients"] = own["coefficients"][:0].copy()
        if before:
            self._keep(found | self._happened(own, found["x"]))
            self._keep(self._end(now))
            found = {name: growing.array() for name, growing in self._kept.items()}
            whole = self._whole(found)
        names = ("starts", "coefficients", "implicit")
        empty = {
            "starts": np.zeros(0),
            "coefficients": own["coefficients"],
            "implicit": np.zeros(0, bool),
        }
        return {name: found.get(name, empty.get(name)) for name in ("t", "x", *names)} | {
            "sample_x": np.vstack(self._samples) if self._samples else found["x"][:0],
            "event_count": total[2],
            "make_happened": (lambda: whole)
            if before
            else partial(self._read, own, found["x"], now),
            "few": None if before or max(total[1:]) > _FEW else own,
        }

    def _read(self, own: dict[str, NDArray[Any]], x: Array, now: float) -> Happened:
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

    def _steps(self, own: dict[str, NDArray[Any]], now: float) -> dict[str, NDArray[Any]]:
        """Points and steps before ``now``; without dense output the samples there."""
        found = {"t": own["point_t"], "x": own["point_x"][:, : self._n]}
        if self._dense:
            implicit = own["step_mode"] >= IMPLICIT_STEP
            of_steps = {"starts": own["start"], "coefficients": own["coefficients"]}
            return found | of_steps | {"implicit": implicit}
        self._sample(Steps(own["start"], own["coefficients"]), now)
        return found

    def _happened(self, own: dict[str, NDArray[Any]], x: Array) -> dict[str, NDArray[Any]]:
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

    def _events(self, own: dict[str, NDArray[Any]], x: Array) -> dict[str, NDArray[Any]]:
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

    def _codes(self, own: dict[str, NDArray[Any]]) -> NDArray[np.int32]:
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
        early = int(np.searchsorted(times, begin, side="left")) if len(self._last) else 0
        for own, at in ((self._last, times[:early]), (steps, times[early:])):
            if len(at):
                self._samples.append(own.at(at, self._n))
        if len(steps):
            self._last = Steps(steps.starts[-1:].copy(), np.array(steps.coefficients[-1:]))


def _differ(one: Array, other: Array) -> NDArray[np.bool_]:
    """Which rows differ in any bit."""
    return np.asarray((one.view(np.int64) != other.view(np.int64)).any(axis=1))
