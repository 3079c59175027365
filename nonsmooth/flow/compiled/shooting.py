"""Periodic orbits in the interpreter: legs followed to their events, Newton's method on the equations of legs,
and the return map on what it keeps."""

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
        *[(name, _I64) for name in ("n", "parameters", "moving")],
        *[(name, _POINTER) for name in ("legs", "plain", "own", "row", "start", "fixed")],
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
    """What is asked of Newton's method; lengths of steps are in units of the unknowns.

    Attributes
    ----------
    tol : float
        Full steps end where the next one would be below this,
    noise : float
        or where steps below this do not shrink.
    finest, coarse, extended : float
        Local errors of legs: the least, the largest far from the orbit, those in extended precision.
    final, rounding : float
        Steps that do not change derivatives, and those that do not change the orbit.
    longest : float
        No leg may last longer.
    advance : float
        Time by which the legs advance the last state.
    most, most_steps : int
        Of Newton's method, and along a leg.
    """

    _fields_ = [
        *[(name, _D) for name in ("tol", "noise", "finest", "coarse", "extended")],
        *[(name, _D) for name in ("final", "rounding", "longest", "advance")],
        *[(name, _I64) for name in ("most", "most_steps")],
    ]


class SolvedOrbit(NamedTuple):
    """An orbit in numbers; legs on the first axis.

    Attributes
    ----------
    unknowns, residual, jacobian : ndarray (m,), (m,), (m, m)
    whole : ndarray (L, n, 1 + n)
        States at the ends, and their derivatives by the starts.
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
    made.follow_legs.restype = _I64
    made.follow_legs.argtypes = [*[_POINTER] * 4, _D, _D, _I64, _POINTER]
    made.orbit_work.argtypes = [_POINTER]
    made.reduced_map.argtypes = [_POINTER, _I64, _D, _D, _POINTER]
    made.orbit_newton.argtypes = [_POINTER] * 5
    return made


class OrbitProgram:
    """The equations of orbits with a fixed itinerary, every leg of which ends by one event.

    Parameters
    ----------
    legs, plain : LegsProgram
        With derivatives by the starts, and the states alone.
    n, parameters : int
        States of a start, and parameters.
    own, row : ndarray of int
        Entries of (x, X) that move: places in ``start``, and in the rows of ``legs``.
    start, fixed : ndarray (L, 1 + n, n)
        Matrices (x, X) at the starts, transposed, and those of the entries that do not move.
    """

    def __init__(
        self,
        legs: LegsProgram,
        plain: LegsProgram,
        n: int,
        parameters: int,
        own: NDArray[Any],
        row: NDArray[Any],
        start: Array,
        fixed: Array,
    ):
        arrays = [own.astype(np.int32), row.astype(np.int32), start, fixed]
        kept = [np.ascontiguousarray(array) for array in arrays]
        self._kept, self._legs = (legs, plain, *kept), legs
        pointers = (legs.pointer, plain.pointer, *[address(array) for array in kept])
        self._c = _Orbit(n, parameters, len(own), *pointers, legs.size, plain.size)
        self._pointer = ctypes.addressof(self._c)
        self._count, self._n = len(start), n
        work = int(_library().orbit_work(self._pointer))
        self._parameters = work, work + legs.size
        self._size = work + legs.size + plain.size

    def newton(
        self, u: Array, p: Array, scales: Array, wrap: Array | None, demands: Demands
    ) -> SolvedOrbit | None:
        """Solve from unknowns ``u``; None where that does not converge.

        Parameters
        ----------
        u : ndarray (m,)
            Starts of the legs, then durations.
        p : ndarray
        scales : ndarray (m,)
            Sizes of the unknowns.
        wrap : ndarray (n, n) or None
            Symmetry that maps the end of the last leg.
        demands : Demands
        """
        memory, size, n = np.zeros(self._size), len(u), self._n
        memory[:size] = u
        for at in self._parameters:
            memory[at : at + len(p)] = p
        scales = np.ascontiguousarray(scales)
        wrap = None if wrap is None else np.ascontiguousarray(wrap, float)
        steps = _library().orbit_newton(
            self._pointer,
            ctypes.addressof(demands),
            address(scales),
            address(wrap),
            address(memory),
        )
        if not steps:
            return None
        jacobian = memory[2 * size : (2 + size) * size].reshape(size, size)
        at = 5 * size + 2 * size * size + n * n
        whole = memory[at : at + self._count * n * (n + 1)].reshape(self._count, n + 1, n)
        parts = self._legs.parts(memory[self._parameters[0] :])
        rows = [part.reshape(self._count, -1) for part in parts[3:6]]
        found = memory[:size], memory[size : 2 * size], jacobian, whole.swapaxes(1, 2)
        return SolvedOrbit(*found, rows[0], rows[1], rows[2], steps)


class FollowedProgram:
    """Legs that are followed one after the other, each to its event.

    Parameters
    ----------
    fields : sequence of SmoothProgram
        Of each leg, with functions that are watched.
    rows, directions : sequence of int
        Which of them ends the leg, and its direction.
    events, plain : sequence of ValuesProgram
        What happens there, with derivatives and without.
    dimensions : tuple of int
        States with the time, and without; parameters.
    """

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
        """Starts (L + 1, n) of the legs, with the end of the last one, and durations (L,).

        None where a leg does not come to its event within so many of the times in which the state
        changes by its size.
        """
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
    """The return map of legs on what it keeps of some directions; None where an event is grazed.

    Parameters
    ----------
    legs : tuple of ndarray
        Derivatives (L, S, N) of the ends by the starts, fields (L, S) there, gradients (L, S) of the
        events and derivatives (L, N, S) of the states after them.
    wrap : ndarray (N, N) or None
        Symmetry that maps the end of the last leg.
    units : ndarray (N,)
        Sizes of the states.
    basis : ndarray (N, m)
        Directions at the first start.
    grazing : float
        Angles between orbit and surface below this are a grazing.
    lost : float
        A direction of which a leg leaves no more than this part is lost.

    Returns
    -------
    ndarray (r, r)
    """
    count, n, s = legs[3].shape
    kept = [np.ascontiguousarray(rows, float) for rows in (*legs, wrap, units) if rows is not None]
    pointers = [address(rows) for rows in kept]
    if wrap is None:
        pointers.insert(4, None)
    given = _Returns(count, n, s, *pointers)
    memory = np.empty((2 * count + 5) * n * n + s * n)
    memory[: basis.size] = basis.ravel()
    r = _library().reduced_map(
        ctypes.addressof(given), basis.shape[1], grazing, lost, address(memory)
    )
    return None if r < 0 else memory[: r * r].reshape(r, r).copy()
