"""Derivatives along legs of known duration, in the driver in C: columns forward, rows back."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache, cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem
from ..constants import GUARDS
from .arrays import address
from .interpreter import Interpreter, library
from .structures import structure

#: Why a leg does not reach its end.
DONE, STUCK, NOT_UNIQUE = range(3)

#: Letter of a set in the first step of leaving it (``state.c``).
LEAVING = 4


#: Steps for which there is room at first, and those of each leg.
_ROOM, _STEPS = 32, 6

#: Parts of each leg for which there is room, and most numbers of them all.
_PARTS, _MOST_PARTS = 64, 2**22

_NO_STEPS = np.zeros((0, 0))

#: Direction of a column along given parameters (``variation.c``).
_ALONG_DP = -2


class EndOfLeg(NamedTuple):
    """End of a leg by the law of its mode: a set that is reached, or a guard of sliding or of a contact."""

    hit: int = -1
    guard: str = "stop"
    number: int = 0
    side: int = 0


class GivenLegs(NamedTuple):
    """Legs: letters of their modes (L, w), starts (L, n), durations (L,), ends; parameters (np,) or (L, np), error, most steps of a leg;
    times of samples since the starts (K,), and where those of each leg begin (L + 1,); the condition of derivatives by the
    start beyond which others begin, or 0."""

    letters: NDArray[np.int8]
    starts: Array
    durations: Array
    ends: Sequence[EndOfLeg | None]
    p: Array
    tol: float
    most_steps: int
    times: Array
    first: NDArray[np.intp]
    ratio: float = 0.0


@cache
def _leg_type() -> np.dtype[Any]:
    return np.dtype(structure("Leg"))


class CarriedLegs:
    """Ends of legs (L, n) with fields at starts and ends, gradients of their events by states and parameters (L, n + np),
    derivatives of the ends (L, n, columns) and at samples (K, n, columns).

    ``failed`` is the number of a leg that did not reach its end, with its status, or -1.
    """

    def __init__(self, engine: ColumnsEngine, given: GivenLegs, count: int, starts: int):
        legs, n = given.starts.shape
        self._engine, self.given = engine, given
        self.ends, self.before, self.rates = (np.empty((legs, n)) for _ in range(3))
        self.gradients = np.empty((legs, n + given.p.shape[-1]))
        self._y, self._samples = np.zeros((legs, count, n)), np.empty((len(given.times), count, n))
        self._y[:, range(min(n, count)), range(min(n, count))] = 1.0
        self._kept = [np.ascontiguousarray(a) for a in given[:3]]
        self._kept += [
            np.append(given.p, np.zeros((*given.p.shape[:-1], 1)), -1),
            np.ascontiguousarray(given.times, float),
        ]
        self.failed, self.status = -1, DONE
        self.row = np.zeros(n)
        room = min(_PARTS * legs, _MOST_PARTS // (1 + n * n)) if given.ratio > 0.0 else 0
        self._parts = np.empty((1 + room, 1 + n * n))
        self._c = self._structures(count, starts)

    def _structures(self, count: int, starts: int) -> NDArray[np.void]:
        """The legs as C reads them."""
        given, (legs, n) = self.given, self.given.starts.shape
        letters, begins, durations, p, times = self._kept
        made, row = np.zeros(legs, _leg_type()), np.arange(legs) * 8 * n
        none = EndOfLeg()
        own = [
            (e.hit, GUARDS.index(e.guard), e.number, e.side)
            for e in (e or none for e in given.ends)
        ]
        made["hit"], made["kind"], made["index"], made["side"] = np.array(own, np.int32).T
        made["columns"], made["starts"] = count, starts
        made["duration"], made["tol"] = durations, given.tol
        made["most_steps"], made["samples"] = given.most_steps, np.diff(given.first)
        made["letter"] = letters.ctypes.data + np.arange(legs) * letters.shape[1]
        for name, array in (("x", begins), ("end", self.ends)):
            made[name] = array.ctypes.data + row
        made["start_rate"], made["end_rate"] = (
            a.ctypes.data + row for a in (self.before, self.rates)
        )
        made["y"], made["p"] = self._y.ctypes.data + row * count, p.ctypes.data
        if p.ndim > 1:
            made["p"] = p.ctypes.data + np.arange(legs) * 8 * p.shape[1]
        made["sample_t"] = times.ctypes.data + 8 * given.first[:-1]
        made["at_samples"] = self._samples.ctypes.data + 8 * n * count * given.first[:-1]
        gradients = self.gradients.ctypes.data + np.arange(legs) * 8 * self.gradients.shape[1]
        made["ratio"], made["parts"] = given.ratio, self._parts.ctypes.data
        made["part_room"][0] = len(self._parts) - 1
        made["gradient"] = np.where([e is not None for e in given.ends], gradients, 0)
        return made

    def carry(self, direction: Array, dp: Array | None, steps: Array) -> int:
        """Integrate them and return the number of steps, which are recorded as far as there is room."""
        self._c["direction"], self._c["dp"] = direction.ctypes.data, address(dp) or 0
        self._c["steps"][0], self._c["step_room"][0] = address(steps) or 0, len(steps)
        self._steps = steps
        with self._engine.state() as state:
            self.failed = int(library().carry_legs(state, self._c.ctypes.data, len(self._c)))
        if self.failed >= 0:
            self.status = int(self._c["status"][self.failed])
        return int(self._c["step_count"].sum())

    @property
    def left(self) -> Array:
        """Remaining durations (L,) of legs that end early: at a set, or where integration fails."""
        return np.asarray(self._c["left"])

    def steps_of(self, leg: int) -> tuple[Array, Array]:
        """Times since the start of a recorded leg at which its steps begin (k,), and the states there (k, n)."""
        counts, n = self._c["step_count"].tolist(), self.ends.shape[1]
        first = sum(counts[:leg])
        rows = self._steps[first : first + counts[leg]]
        rows = rows[rows[:, 2] >= 0.0]  # without stages
        return rows[:, 1], rows[:, 3 : 3 + n]

    @cached_property
    def parts(self) -> list[tuple[Array, Array]]:
        """Of each leg times since its start (k,) at which other derivatives begin, and what those are that end there (k, n, n)."""
        n, first = self.ends.shape[1], [0, *np.cumsum(self._c["part_count"]).tolist()]
        times, matrices = self._parts[:, 0], self._parts[:, 1:].reshape(-1, n, n).swapaxes(1, 2)
        return [(times[i:j], matrices[i:j]) for i, j in pairwise(first)]

    def set_columns(self, first: Array) -> None:
        """Set the first column (n,) of all legs, and the others to zero."""
        self._y[:] = 0.0
        self._y[:, 0] = first

    @property
    def derivatives(self) -> Array:
        """Of the ends (L, n, columns)."""
        return self._y.swapaxes(1, 2)

    @property
    def at_samples(self) -> Array:
        """Derivatives at samples (K, n, columns)."""
        return self._samples.swapaxes(1, 2)

    @contextmanager
    def pulling(self, by_parameters: Array, rows: Array) -> Iterator[None]:
        """Let ``pull`` add the row's derivatives by all parameters; ``rows`` (K, n) are added at samples."""
        c, width = self._c, 8 * rows.shape[1]
        c["row"], c["by_parameters"] = self.row.ctypes.data, by_parameters.ctypes.data
        c["at_samples"] = rows.ctypes.data + width * self.given.first[:-1]
        self._at = int(c.ctypes.data)
        with self._engine.state() as self._state:
            yield

    def pull(self, leg: int) -> None:
        """Pull ``row`` (n,) from the end of a recorded leg back to its start."""
        if library().pull_row(self._state, self._at + leg * self._c.itemsize) != DONE:
            self.row[:] = np.nan


class ColumnsEngine(Interpreter):
    """The driver with one system and the series of its derivatives."""

    def __init__(self, system: FilippovSystem, order: int):
        super().__init__(system, order, derived=True)
        self.add_implicit()
        self._idle: list[int] = []  # runs that no call uses

    @contextmanager
    def state(self) -> Iterator[int]:
        """A run of the driver, kept for the next call."""
        try:
            state = self._idle.pop()
        except IndexError:
            made = library()
            table = made.table_new(self._width)
            state = made.run_new(ctypes.byref(self._c), table)
            weakref.finalize(self, _freed, state, table)
        try:
            yield state
        finally:
            self._idle.append(state)

    def carry(self, given: GivenLegs, chosen: Sequence[int]) -> CarriedLegs:
        """Integrate states and their derivatives by the starts and by chosen parameters over legs."""
        n = given.starts.shape[1]
        found = CarriedLegs(self, given, n + len(chosen), n)
        found.carry(np.array([-1] * n + list(chosen), np.int32), None, _NO_STEPS)
        return found

    def record(self, given: GivenLegs) -> CarriedLegs:
        """Integrate states over legs by steps along which rows can be pulled back: short enough for two columns; implicit
        ones end at samples."""
        (legs, n), q = given.starts.shape, given.p.shape[-1]
        some = 1.0 + 0.5 * np.cos(np.arange(max(n, q)))
        room = _ROOM + _STEPS * legs
        while True:
            found = CarriedLegs(self, given, 2, 1)
            found.set_columns(some[:n])
            steps = np.empty((room, 3 + n + given.letters.shape[1]))
            count = found.carry(np.array([-1, _ALONG_DP], np.int32), some[:q], steps)
            if count <= room:
                return found
            room = count


def carry_frame(matrices: Array, q: Array) -> tuple[Array, Array]:
    """Orthonormal directions (m, n, k) behind each of m matrices, from those (n, k) before the first, and their growths
    (m, k): products of triangular factors."""
    m, n, k = len(matrices), *q.shape
    own, growth = np.empty((m + 1, k, n)), np.empty((m, k))
    own[0] = q.T
    matrices = np.ascontiguousarray(matrices)
    pointers = (a.ctypes.data for a in (matrices, own, growth))
    library().carry_frame(n, k, m, *pointers)
    return own[1:].swapaxes(1, 2), growth


def _freed(state: int, table: int) -> None:
    """Free a run of the driver."""
    library().run_free(state)
    library().table_free(table)
