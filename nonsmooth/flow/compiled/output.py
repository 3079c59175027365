"""Where a dense run is written: arrays of steps, points and events, which grow."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import address

#: Arrays in the order of C's pointers: type, and what there is one of for each entry.
_ARRAYS = {
    "start": (float, "step"),
    "coefficients": (float, "step"),
    "point_t": (float, "point"),
    "point_x": (float, "point"),
    "event_t": (float, "event"),
    "event_x": (float, "event"),
    "event_after_x": (float, "event"),
    "step_mode": (np.int32, "step"),
    "event_kind": (np.int32, "event"),
    "event_before": (np.int32, "event"),
    "event_after": (np.int32, "event"),
    "event_guard": (np.int32, "event"),
}

#: What there is several of, and room for at first; arrays of larger runs grow from there.
_FIRST = {"step": 64, "point": 128, "event": 64}

#: How rooms grow: pages that are not written cost nothing, so by much as long as they are small (bytes).
_SMALL, _MUCH, _LITTLE = 1 << 26, 16, 2

#: Rooms of all kinds that C asks for before a step.
_NEEDED = {"step": 2, "point": 4, "event": 4}

Rooms = Mapping[str, int]


@lru_cache(maxsize=64)
def _layout(n: int, order: int) -> tuple[dict[str, tuple[int, tuple[int, ...]]], dict[str, int]]:
    """For each array the bytes before it in its block, by room, and its shape; bytes of each kind."""
    shapes: dict[str, tuple[int, ...]] = {
        "coefficients": (n, order + 1),
        **dict.fromkeys(("point_x", "event_x", "event_after_x"), (n,)),
    }
    used, places = dict.fromkeys(_FIRST, 0), {}
    for name, (dtype, kind) in _ARRAYS.items():  # those of floats first
        shape = shapes.get(name, ())
        places[name] = used[kind], shape
        used[kind] += math.prod(shape) * (8 if dtype is float else 4)
    return places, used


class Output:
    """Arrays of a dense run, in a block of memory for each of steps, points and events.

    Parameters
    ----------
    n : int
        Extended dimension.
    order : int
    rooms : mapping, optional
        What a run like this one took.
    """

    class Structure(ctypes.Structure):
        """``Output`` of the drivers."""

        _fields_ = [
            *[(name, ctypes.c_int64) for name in ("steps", "points", "events")],
            *[(name, ctypes.c_int64) for name in ("step_room", "point_room", "event_room")],
            *[(name, ctypes.c_void_p) for name in _ARRAYS],
        ]

    def __init__(self, n: int, order: int, rooms: Rooms = _FIRST):
        self._places, self._sizes = _layout(n, order)
        self._rooms = {
            kind: max(least, min(rooms[kind], _SMALL // self._sizes[kind]))
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
        self.pointer = ctypes.byref(self.Structure(*counts, *rooms.values(), *at))

    def grow(self, counts: Sequence[int]) -> None:
        """Make room where there is little, with the same content."""
        for (kind, room), size in zip(self._rooms.items(), counts, strict=True):
            if size + _NEEDED[kind] <= room:
                continue
            written = self._of(kind, size)
            small = _MUCH * self._blocks[kind].nbytes < _SMALL
            self._rooms[kind] = room * (_MUCH if small else _LITTLE)
            self._blocks[kind] = self._block(kind)
            for name, array in self._of(kind, size).items():
                array[:] = written[name]
        self._point_to(counts)

    def filled(self, counts: Sequence[int]) -> dict[str, NDArray[Any]]:
        """Return the parts that were written: steps, points and events.

        They are views of the blocks, unless nearly all of these would be kept for nothing.
        """
        found = {}
        for (kind, room), size in zip(self._rooms.items(), counts, strict=True):
            own = self._of(kind, size)
            if room > _FIRST[kind] and _MUCH * size < room:
                own = {name: array.copy() for name, array in own.items()}
            found.update(own)
        return found

    def _of(self, kind: str, size: int) -> dict[str, NDArray[Any]]:
        room, block = self._rooms[kind], self._blocks[kind]
        return {
            name: np.ndarray((size, *shape), _ARRAYS[name][0], block, room * before)
            for name, (before, shape) in self._places.items()
            if _ARRAYS[name][1] == kind
        }


def rooms_of(counts: Sequence[int]) -> Rooms:
    """Room for a run of so many steps, points and events."""
    return {
        kind: count + needed for (kind, needed), count in zip(_NEEDED.items(), counts, strict=True)
    }
