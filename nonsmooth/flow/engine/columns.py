"""Columns of derivatives along legs of known duration, in the driver in C."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...model import Array, FilippovSystem
from ..constants import GUARDS
from .arrays import address
from .structures import structure
from .tape import TapeEngine, library

#: Why a leg does not reach its end.
DONE, STUCK, NOT_UNIQUE = range(3)

#: Letter of a set in the first step of leaving it (``state.c``).
LEAVING = 4


_ARRAYS = ("p", "dp", "letter", "x", "y", "start_rate", "end_rate", "gradient")


class EndOfLeg(NamedTuple):
    """What ends a leg by the law of its mode: a set that is reached, or a guard of sliding or of a contact."""

    hit: int = -1
    guard: str = "stop"
    number: int = 0
    side: int = 0


class CarriedLeg(NamedTuple):
    """End of a leg and its derivatives, fields at start and end; gradient of its event's function by states and
    parameters there."""

    status: int
    left: float
    end: Array
    by_start: Array
    by_parameters: Array
    start_rate: Array
    end_rate: Array
    gradient: Array


class ColumnsEngine(TapeEngine):
    """The driver with one system and the series of its derivatives."""

    def __init__(self, system: FilippovSystem, order: int):
        super().__init__(system, order, derived=True)

    def carry(
        self,
        letters: Sequence[int],
        x: Array,
        p: Array,
        chosen: Sequence[int],
        duration: float,
        tol: float,
        most_steps: int,
        ends: EndOfLeg | None,
    ) -> CarriedLeg:
        """Carry a state and its derivatives by the start and by chosen parameters over a duration."""
        n, q = len(x), len(chosen)
        given, end = np.append(p, 0.0), np.array(x, float)
        y, dp = np.zeros((n + q, n)), np.zeros((n + q, len(p) + 1))
        y[:n], dp = np.eye(n), dp[:, : len(p)].copy()
        dp[n + np.arange(q), list(chosen)] = 1.0
        letter, rates = np.array([*letters, 0], np.int8), np.empty((2, n))
        row, of = np.empty(n + len(p)), ends or EndOfLeg()
        leg: Any = structure("Leg")(n + q, of.hit, GUARDS.index(of.guard), of.number, of.side)
        leg.duration, leg.tol, leg.most_steps = duration, tol, most_steps
        arrays = (given, dp, letter, end, y, rates[0], rates[1], row if ends else None)
        for name, array in zip(_ARRAYS, arrays, strict=True):
            setattr(leg, name, address(array))
        with self.held_table() as table, self.held_run(table) as state:
            status = library().carry_columns(state, ctypes.byref(leg))
        return CarriedLeg(status, leg.left, end, y[:n].T, y[n:].T, rates[0], rates[1], row)
