"""Relative degrees of switching functions: the first derivative along the motion that its multiplier enters.

Source: Isidori 1995, Nonlinear Control Systems, chapter 4; Levant 1993 for sliding of higher order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from ..expressions.identity import vanish_on

#: Largest relative degree.
_MOST = 4


@dataclass(frozen=True)
class Degree:
    """One switching function: derivatives that vanish while it rests, and the one that its multiplier enters."""

    lower: tuple[ca.SX, ...]
    row: ca.SX


def degree_of(
    h: ca.SX, rate: ca.SX, own: ca.SX, others: Callable[[], ca.SX], x: ca.SX, field: ca.SX
) -> Degree:
    """Relative degree of ``h``, of this ``rate``, for the unknowns ``own``; 1 where others enter first."""
    first, lower = Degree((), rate), list[ca.SX]()
    if not ca.depends_on(rate, own) and _distance(h, own, x, field) > _MOST:
        return first
    while len(lower) < _MOST:
        if ca.depends_on(rate, own):
            if not _vanishes(ca.jacobian(rate, own), h, x):
                return Degree(tuple(lower), rate)
            rate = ca.substitute(rate, own, ca.SX.zeros(own.numel(), 1))
        if ca.depends_on(rate, others()):
            return first
        lower.append(rate)
        rate = ca.densify(ca.jtimes(rate, x, field))
    return first


def _distance(h: ca.SX, own: ca.SX, x: ca.SX, field: ca.SX) -> int:
    """Number of derivatives after which the sparsity alone lets the unknowns ``own`` enter."""
    moved = [bool(ca.depends_on(f, own)) for f in ca.vertsplit(field)]
    reads = [ca.symvar(f) for f in ca.vertsplit(field)]
    place = {symbol.element_hash(): k for k, symbol in enumerate(ca.vertsplit(x))}
    states = _places(ca.symvar(h), place)
    for order in range(1, _MOST + 1):
        if any(moved[i] for i in states):
            return order
        states |= {j for i in states for j in _places(reads[i], place)}
    return _MOST + 1


def _places(symbols: Sequence[ca.SX], place: dict[int, int]) -> set[int]:
    return {place[s.element_hash()] for s in symbols if s.element_hash() in place}


def _vanishes(column: ca.SX, h: ca.SX, x: ca.SX) -> bool:
    """Whether what an unknown is multiplied with is zero wherever ``h`` is."""
    pieces = [e for e in ca.vertsplit(ca.densify(column.T)) if not e.is_zero()]
    return all(ca.depends_on(e, x) for e in pieces) and vanish_on(pieces, h, x)
