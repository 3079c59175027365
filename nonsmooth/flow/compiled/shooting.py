"""Periodic orbits in the interpreter: legs flown to their events, Newton's method, the return map."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...model import Array
from .arrays import address, require_size
from .smooth import LegsProgram, SmoothProgram, ValuesProgram
from .tape import library

_I64, _D, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p


class _Orbit(ctypes.Structure):
    _fields_ = [
        *[(name, _I64) for name in ("n", "parameters", "moving", "free")],
        *[(name, _POINTER) for name in ("legs", "plain", "own", "row", "chosen", "start", "fixed")],
        *[(name, _I64) for name in ("of_legs", "of_plain")],
    ]


class _Followed(ctypes.Structure):
    _fields_ = [
        *[(name, _I64) for name in ("count", "n", "dimension", "parameters")],
        *[(name, _POINTER) for name in ("field", "event", "plain", "row", "direction")],
    ]


class _Returns(ctypes.Structure):
    _fields_ = [
        *[(name, _I64) for name in ("count", "n", "s")],
        *[(name, _POINTER) for name in ("by_start", "rate", "gradient", "after_state")],
        *[(name, _POINTER) for name in ("wrap", "units")],
    ]


class Demands(ctypes.Structure):
    """What is asked of Newton's method; lengths of steps are in units of the unknowns."""

    _fields_ = [
        *[(name, _D) for name in ("tol", "noise", "finest", "coarse", "extended")],
        *[(name, _D) for name in ("final", "rounding", "longest", "periods")],
        ("period", _POINTER),
        *[(name, _I64) for name in ("most", "most_steps")],
    ]


class SolvedOrbit(NamedTuple):
    """An orbit in numbers; legs on the first axis.

    Attributes
    ----------
    unknowns, residual, jacobian : ndarray (m + k,), (m,), (m, m + k)
        With k free parameters.
    whole : ndarray (L, n, 1 + n + k)
        States at the ends, and their derivatives by the starts and by the free parameters.
    before, after : ndarray (L, width)
        Fields at the starts and at the ends.
    results : ndarray (L, results)
        Of the events' programs.
    steps : int
    """

    unknowns: Array
    residual: Array
    jacobian: Array
    whole: Array
    before: Array
    after: Array
    results: Array
    steps: int


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    made = library()
    require_size(made.orbit_size, _Orbit)
    require_size(made.demands_size, Demands)
    require_size(made.returns_size, _Returns)
    require_size(made.followed_size, _Followed)
    made.orbit_work.restype = made.orbit_newton.restype = made.reduced_map.restype = _I64
    made.whole_map.restype = _I64
    made.whole_map.argtypes = [_POINTER, _POINTER]
    made.follow_legs.restype = _I64
    made.follow_legs.argtypes = [*[_POINTER] * 4, _D, _D, _I64, _POINTER]
    made.orbit_work.argtypes = [_POINTER]
    made.reduced_map.argtypes = [_POINTER, _I64, _D, _D, _POINTER]
    made.orbit_newton.argtypes = [_POINTER] * 5
    made.orbit_evaluate.restype = made.orbit_correct.restype = _I64
    made.orbit_evaluate.argtypes = [_POINTER, _POINTER, _POINTER, _D, _POINTER]
    made.orbit_correct.argtypes = [_POINTER] * 6
    made.bordered_direction.restype = _I64
    made.bordered_direction.argtypes = [_POINTER, _POINTER, _I64, _POINTER, _POINTER]
    return made


class OrbitProgram:
    """The equations of orbits with a fixed itinerary, every leg of which ends by one event."""

    def __init__(
        self,
        legs: LegsProgram,
        plain: LegsProgram,
        n: int,
        parameters: int,
        chosen: tuple[int, ...],
        own: NDArray[Any],
        row: NDArray[Any],
        start: Array,
        fixed: Array,
    ):
        numbers = [np.array(part, np.int32) for part in (own, row, chosen)]
        kept = [np.ascontiguousarray(array) for array in (*numbers, start, fixed)]
        self._kept, self._legs = (legs, plain, *kept), legs
        pointers = (legs.pointer, plain.pointer, *[address(array) for array in kept])
        counts = (n, parameters, len(own), len(chosen))
        self._c = _Orbit(*counts, *pointers, legs.size, plain.size)
        self._pointer = ctypes.addressof(self._c)
        self._count, self._n, self._free = len(start), n, len(chosen)
        work = int(_library().orbit_work(self._pointer))
        self._parameters = work, work + legs.size
        self._size = work + legs.size + plain.size

    def newton(
        self, u: Array, p: Array, scales: Array, wrap: Array | None, demands: Demands
    ) -> SolvedOrbit | None:
        """Solve from unknowns ``u``; None where that does not converge."""
        memory, scales = self._memory(u, p), np.ascontiguousarray(scales)
        wrap = None if wrap is None else np.ascontiguousarray(wrap, float)
        steps = _library().orbit_newton(
            self._pointer,
            ctypes.addressof(demands),
            address(scales),
            address(wrap),
            address(memory),
        )
        return self._solved(memory, steps) if steps else None

    def evaluate(
        self, u: Array, p: Array, wrap: Array | None, tol: float, demands: Demands
    ) -> SolvedOrbit | None:
        """The equations at unknowns (m + k,); None where a leg cannot be flown."""
        memory = self._memory(u, p)
        failed = _library().orbit_evaluate(
            self._pointer, ctypes.addressof(demands), address(wrap), tol, memory.ctypes.data
        )
        return self._solved(memory, 0) if failed < 0 else None

    def correct(
        self,
        u: Array,
        p: Array,
        scales: Array,
        wrap: Array | None,
        across: Array,
        demands: Demands,
    ) -> SolvedOrbit | None:
        """The branch near a guess (m + 1,) across a direction in units ``scales``; None where that fails."""
        memory = self._memory(u, p)
        scales, across = np.ascontiguousarray(scales), np.ascontiguousarray(across)
        steps = _library().orbit_correct(
            self._pointer,
            ctypes.addressof(demands),
            scales.ctypes.data,
            address(wrap),
            across.ctypes.data,
            memory.ctypes.data,
        )
        return self._solved(memory, steps) if steps else None

    def _memory(self, u: Array, p: Array) -> Array:
        memory = np.empty(self._size)
        memory[: len(u)] = u
        for at in self._parameters:
            memory[at : at + len(p)] = p
        return memory

    def _solved(self, memory: Array, steps: int) -> SolvedOrbit:
        """What is found, copied: the room for work is many times as large."""
        n, free, count = self._n, self._free, self._count
        size, columns = count * (n + 1), 1 + n + free
        wide = size + free
        first = memory[: (2 + size) * wide].copy()
        at = 5 * wide + size * wide + wide * wide + n * n
        whole = memory[at : at + count * n * columns].copy().reshape(count, columns, n)
        rows = self._legs.found(memory[self._parameters[0] :])
        jacobian = first[2 * wide :].reshape(size, wide)
        found = first[:wide], first[wide : wide + size], jacobian, whole.swapaxes(1, 2)
        return SolvedOrbit(*found, *rows, steps)


def bordered_direction(jacobian: Array, before: Array) -> tuple[Array, float] | None:
    """Direction in which equations stay as they are, and the determinant of their bordered
    Jacobian."""
    wide, found = before.size, ctypes.c_double()
    jacobian, before = np.ascontiguousarray(jacobian), np.ascontiguousarray(before)
    memory = np.empty(wide * (wide + 2))
    done = _library().bordered_direction(
        jacobian.ctypes.data, before.ctypes.data, wide, ctypes.addressof(found), memory.ctypes.data
    )
    return (memory[:wide], found.value) if done else None


class FollowedProgram:
    """Legs that are followed one after the other, each to its event."""

    def __init__(
        self,
        fields: Sequence[SmoothProgram],
        rows: Sequence[int],
        directions: Sequence[int],
        events: Sequence[ValuesProgram],
        plain: Sequence[ValuesProgram],
        dimensions: tuple[int, int, int],
    ):
        count, parts = len(fields), (fields, events, plain)
        pointers = [(_POINTER * count)(*[part.pointer for part in own]) for own in parts]
        numbers = [np.array(own, np.int32) for own in (rows, directions)]
        self._kept = (*parts, pointers, numbers)
        places = [*map(ctypes.addressof, pointers), *map(address, numbers)]
        self._c = _Followed(count, *dimensions, *places)
        self._count, self._n = count, dimensions[0]
        self._work = max(part.work for own in parts for part in own)

    def __call__(
        self, x: Array, p: Array, times: float, tol: float, most_steps: int
    ) -> tuple[Array, Array] | None:
        """Starts (L + 1, n) of the legs, with the end of the last one, and durations (L,)."""
        # None where a leg does not come to its event within so many of the times in which the state
        # changes by its size.
        first, count, n = len(p) + 1, self._count, self._n
        memory = np.empty(first + (count + 1) * n + count + self._work)
        memory[: len(p)] = p
        memory[first : first + n] = x
        at, later = memory.ctypes.data, first + (count + 1) * n
        places = (at, at + 8 * first, at + 8 * later)
        options = (times, tol, most_steps, at + 8 * (later + count))
        if _library().follow_legs(ctypes.addressof(self._c), *places, *options) < count:
            return None
        return memory[first:later].reshape(count + 1, n), memory[later : later + count]


def reduced_map(
    legs: tuple[Array, Array, Array, Array],
    wrap: Array | None,
    units: Array,
    basis: Array,
    grazing: float,
    lost: float,
) -> Array | None:
    """The return map of legs on what it keeps of some directions; None where an event is grazed."""
    given, kept = _returns(legs, wrap, units)
    count, n, s = legs[3].shape
    memory = np.empty((2 * count + 5) * n * n + s * n)
    memory[: basis.size] = basis.ravel()
    r = _library().reduced_map(
        ctypes.addressof(given), basis.shape[1], grazing, lost, address(memory)
    )
    del kept
    return None if r < 0 else memory[: r * r].reshape(r, r).copy()


def whole_map(
    legs: tuple[Array, Array, Array, Array], wrap: Array | None, units: Array
) -> Array | None:
    """The return map (N, N) across the flow, as ``reduced_map``; None where it is not finite."""
    given, kept = _returns(legs, wrap, units)
    _, n, s = legs[3].shape
    memory = np.empty(n * (4 * n + 2 * s))
    done = _library().whole_map(ctypes.addressof(given), memory.ctypes.data)
    del kept
    return memory[: n * n].reshape(n, n) if done else None


def _returns(
    legs: tuple[Array, Array, Array, Array], wrap: Array | None, units: Array
) -> tuple[_Returns, list[Array]]:
    """What C reads, and what must live as long."""
    rows = [*legs, *([] if wrap is None else [wrap]), units]
    kept = [np.ascontiguousarray(part, float) for part in rows]
    pointers: list[int | None] = [part.ctypes.data for part in kept]
    if wrap is None:
        pointers.insert(4, None)
    return _Returns(*legs[3].shape, *pointers), kept
