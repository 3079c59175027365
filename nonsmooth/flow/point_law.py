"""The law of elements at a point: the decisions of the engine at intersections of surfaces.

At a point of several surfaces the rates are w = a + M lambda, lambda between -1 and 1; see ``core/laws/decide.c`` and,
for planar orbits around a point, ``core/laws/spiral.c``.
"""

from __future__ import annotations

import ctypes

import numpy as np

from ..model import Array
from .engine.arrays import address
from .engine.interpreter import library

#: Certificates of -M, in the order of ``core/linear.h``.
_UNIQUE, _UNIQUE_AND_STABLE = 2, 3


def is_unique(m: Array) -> bool:
    """Whether -M is proved to be a P-matrix, so that there is one solution for every a."""
    return _certificate(m) >= _UNIQUE


def attracts(m: Array) -> bool:
    """Whether the intersection of the surfaces is proved to attract where all of them can slide."""
    return _certificate(m) >= (_UNIQUE if len(m) <= 2 else _UNIQUE_AND_STABLE)


def solve(a: Array, m: Array) -> Array | None:
    """Lambda of the unique solution, where -M is a P-matrix; None if it is not found."""
    given, matrix, found = _doubles(a), _doubles(-m), np.zeros(len(a))
    solved = library().law_solution(address(given), address(matrix), len(a), address(found))
    return np.clip(found, -1.0, 1.0) if solved else None


def go_round(rates: Array, slopes: Array) -> tuple[float, float] | None:
    """Return map of orbits around a point: r -> ratio r (1 + bend r); None where they do not return.

    Rates of two surfaces (4, 2) and their derivatives by the surfaces (4, 2, 2) in the quadrants ++, -+, --, +-.
    """
    ratio, bend = ctypes.c_double(), ctypes.c_double()
    given = _doubles(rates), _doubles(slopes)
    turns = library().law_round(*map(address, given), ctypes.byref(ratio), ctypes.byref(bend))
    return (ratio.value, bend.value) if turns else None


def _certificate(m: Array) -> int:
    matrix = _doubles(-m)
    return int(library().law_certificate(address(matrix), len(m)))


def _doubles(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=float)
