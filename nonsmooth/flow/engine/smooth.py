"""Smooth fields in the interpreter: flows of known durations, legs in one call, functions along them."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...model import Array
from ...model.printing.instructions import Entries, Series, Values
from .arrays import address
from .interpreter import library, series_structure, values_structure
from .structures import structure

#: Initial room for rows of monitored functions.
_ROOM = 64


class SmoothProgram:
    """A smooth field with columns of derivatives, or with functions monitored along it."""

    def __init__(
        self,
        series: Series,
        group: NDArray[np.int32],
        order: int,
        derivatives: Entries,
        starts: int = 0,
        columns: int = 0,
    ):
        self._kept: list[NDArray[Any]] = [np.ascontiguousarray(group, np.int32)]
        n, groups = len(group), int(group.max(initial=-1)) + 1
        self.order, self.size, count = order, n * (1 + columns), len(derivatives.row)
        self.watched = watched = len(series.outputs) - n - count
        rules = series_structure(series, n, order, self._kept)
        self._kept += [derivatives.row, derivatives.column]
        positions = structure("Entries")(count, 0, *[a.ctypes.data for a in self._kept[-2:]])
        sizes = (n, watched, order, groups, starts, columns)
        self._c = structure("Field")(*sizes, address(self._kept[0]), rules, positions)
        self.pointer = ctypes.addressof(self._c)
        self.work = int(library().field_work(self.pointer))

    def _given(self, z: Array, p: Array) -> tuple[Array, int, int, int]:
        """Parameters, state and work in one array, and their addresses."""
        memory = np.empty(len(p) + 1 + self.size + self.work)
        memory[: len(p)] = p
        memory[len(p) + 1 : len(p) + 1 + self.size] = z
        at = memory.ctypes.data
        state = at + 8 * (len(p) + 1)
        return memory, at, state, state + 8 * self.size

    def flow(
        self, z: Array, p: Array, duration: float, tol: float, most_steps: int
    ) -> tuple[Array, float]:
        """State after a duration of either sign, and the remaining time if it fails, else 0."""
        memory, at, state, work = self._given(z, p)
        left = library().fixed_flow(self.pointer, at, state, duration, tol, most_steps, work)
        return memory[len(p) + 1 : len(p) + 1 + self.size], left

    def terms(self, z: Array, p: Array) -> Array:
        """Coefficients of the states' and functions' series at a state, (n + watched, order + 1)."""
        memory, at, state, work = self._given(z, p)
        found = np.empty((self.size + self.watched, self.order + 1))
        library().fixed_terms(self.pointer, at, state, address(found), work)
        del memory
        return found

    def march(
        self,
        z: Array,
        p: Array,
        duration: float,
        tol: float,
        most_steps: int,
        row: int,
        direction: int,
        still: float,
    ) -> float:
        """Time until a function passes zero; -1 if it does not, -2 where the flow ends before."""
        memory, at, state, work = self._given(z, p)
        found: float = library().fixed_march(
            self.pointer, at, state, duration, tol, most_steps, row, direction, still, work
        )
        del memory
        return found


class ValuesProgram:
    """Expressions of states and parameters."""

    def __init__(self, values: Values):
        self._kept: list[NDArray[Any]] = []
        self._c = values_structure(values, self._kept)
        self.pointer = ctypes.addressof(self._c)
        self.results, self.work = len(values.outputs), len(values.op)


class IntegratedLegs(NamedTuple):
    """Legs integrated in one call."""

    ends: Array
    before: Array
    after: Array
    results: Array
    failed: int
    left: float


class LegsProgram:
    """Legs of smooth fields, with the events at their ends, integrated in one call."""

    def __init__(
        self,
        fields: Sequence[SmoothProgram],
        events: Sequence[ValuesProgram | None],
        parameters: int,
        by_leg: bool = False,
    ):
        self._kept = [*fields, *events]
        count, own = len(fields), [e for e in events if e is not None]
        self.width = max(f.size for f in fields)
        results = max([e.results for e in own], default=0)
        self._pointers = (ctypes.c_void_p * count)(*[f.pointer for f in fields])
        self._events = (ctypes.c_void_p * count)(*[e.pointer if e else None for e in events])
        every = count * parameters if by_leg else parameters
        sizes = [every + 1, count * self.width, count, count * self.width, count * self.width]
        sizes += [count * results, max([*(f.work for f in fields), *(e.work for e in own)])]
        positions = np.cumsum([0, *sizes]).tolist()
        self._offsets, self._count, self._parameters = positions, count, every
        pointers = (ctypes.addressof(self._pointers), ctypes.addressof(self._events))
        self._c = structure("Legs")(
            count, self.width, results, parameters if by_leg else 0, *positions[1:7], *pointers
        )
        self._pointer, self._size = ctypes.addressof(self._c), int(positions[-1])

    def __call__(
        self, z: Array, p: Array, durations: Array, tol: float, most_steps: int
    ) -> IntegratedLegs:
        """Integrate all legs from states (L, width)."""
        memory, _ = self._given(z, p, durations)
        left = ctypes.c_double()
        failed = library().run_legs(
            self._pointer, memory.ctypes.data, tol, most_steps, ctypes.byref(left)
        )
        at, count = self._offsets, self._count
        kept = memory[at[1] : at[6]].copy()  # the work array is many times as large
        ends, before, after, results = (
            kept[at[k] - at[1] : at[k + 1] - at[1]].reshape(count, -1) for k in (1, 3, 4, 5)
        )
        return IntegratedLegs(ends, before, after, results, failed, left.value)

    def _given(self, z: Array, p: Array, durations: Array) -> tuple[Array, list[Array]]:
        memory, at = np.empty(self._size), self._offsets
        parts = [memory[at[k] : at[k + 1]] for k in range(6)]
        parts[0][: self._parameters] = p.ravel()
        parts[1][:] = z.ravel()
        parts[2][:] = durations
        return memory, parts

    def extended(
        self, z: Array, p: Array, durations: Array, tol: float, most_steps: int
    ) -> tuple[Array, Array] | None:
        """Results (L, results) in extended precision: rounded, and the remainders."""
        memory, parts = self._given(z, p, durations)
        left, rest = ctypes.c_double(), np.empty(len(parts[5]))
        failed = library().run_legs_extended(
            self._pointer,
            memory.ctypes.data,
            tol,
            most_steps,
            ctypes.byref(left),
            address(rest),
        )
        if failed >= 0:
            return None
        return parts[5].reshape(self._count, -1), rest.reshape(self._count, -1)


class WatchedLegs(NamedTuple):
    """Functions along many legs."""

    rows: list[Array]
    begins: list[Array]
    values: list[Array]
    failed: int
    left: float


class WatchProgram:
    """Flows with monitored functions, all in one call."""

    def __init__(self, fields: Sequence[SmoothProgram]):
        self._fields, self._count = list(fields), len(fields)
        self._width = max(f.size for f in fields)
        self._rows = [f.size + f.watched for f in fields]
        self._begin = max(4 * r + f.watched for r, f in zip(self._rows, fields, strict=True))
        self._work = max(f.work for f in fields)
        self._pointers = (ctypes.c_void_p * self._count)(*[f.pointer for f in fields])

    def __call__(
        self,
        z: Sequence[Array],
        p: Array,
        durations: Array,
        tol: float,
        most_steps: int,
        ends: float,
    ) -> WatchedLegs:
        """Integrate them with parameters (np,) or (L, np); flows without a positive duration have their starts only."""
        parameters = p.shape[1] if p.ndim > 1 else 0
        legs, width, begin, room = self._count, self._width, self._begin, _ROOM + 16 * self._count
        counts, left = np.empty(legs, np.int64), ctypes.c_double()
        durations, p = np.ascontiguousarray(durations, float), np.append(p.ravel(), 0.0)
        pointers = ctypes.addressof(self._pointers)
        while True:
            states = np.empty((legs, width))
            for i, y in enumerate(z):
                states[i, : len(y)] = y
            memory, found = np.empty(legs * begin + self._work), np.empty(room * (4 + width))
            at = memory.ctypes.data
            failed = library().watch_legs(
                *(pointers, legs, width, p.ctypes.data, parameters, states.ctypes.data),
                *(durations.ctypes.data, tol, most_steps, ends, found.ctypes.data, room),
                *(counts.ctypes.data, at, begin, ctypes.addressof(left), at + 8 * legs * begin),
            )
            if failed != -2:
                break
            room *= 8
        if failed >= 0:
            return WatchedLegs([states[failed]], [], [], failed, left.value)
        own, begins, values, place = list[Array](), list[Array](), list[Array](), 0
        for i, (f, rows, count) in enumerate(
            zip(self._fields, self._rows, counts.tolist(), strict=True)
        ):
            size, first = count * (4 + f.size), i * begin
            own.append(found[place : place + size].reshape(count, 4 + f.size))
            begins.append(memory[first : first + 4 * rows].reshape(rows, 4))
            values.append(memory[first + 4 * rows : first + 4 * rows + f.watched])
            place += size
        return WatchedLegs(own, begins, values, -1, 0.0)
