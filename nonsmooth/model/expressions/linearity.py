"""Parts of a system that are affine in its states, sines of the time added; their steps need no check.

The first Taylor coefficients then determine all others: a sine is a state of a larger affine system,
u' = omega v, v' = -omega u, and two successive coefficients of it are not both small. A product of
sines, such as cos(t)^40, or a sine of a state is not affine in this sense.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import casadi as ca

from .graph import evaluate, instructions
from .long_sums import LongSums

_NO_TIME = ca.SX(0, 1)


@dataclass(frozen=True)
class Linearity:
    """Which parts of a system are affine, and which rows and guards are not (bent)."""

    everywhere: bool
    free: bool
    bent_rows: list[bool]
    bent_free_rows: list[bool]
    bent_guards: list[bool]
    curved_guards: list[bool]  # not affine in states and time


def enters_nonlinearly(expressions: ca.SX, variables: ca.SX) -> tuple[bool, ...]:
    """Which variables enter a vector of expressions nonlinearly, each for itself: products of two are linear."""
    together = ca.which_depends(expressions, variables, 2, False) if variables.numel() else []
    return tuple(
        bool(bent) and not ca.is_linear(expressions, variables[i])
        for i, bent in enumerate(together)
    )


def linearity(
    field: ca.SX,
    layer: ca.SX,
    guards: ca.SX,
    factors: ca.SX,
    x: ca.SX,
    unknowns: ca.SX,
    smooth: bool = True,
    time: ca.SX = _NO_TIME,
    sums: LongSums | None = None,
) -> Linearity:
    """Determine which parts of a system, with symbols for long sums, are affine."""
    outputs = [field, guards, layer, factors]
    every = _bent(outputs, x, unknowns, time, True, sums)
    (rows, guard_rows, *_), free_rows = every, _bent(outputs, x, unknowns, time, False, sums)[0]
    return Linearity(
        everywhere=smooth and not any(b for own in every for b in own),
        free=smooth and not any(free_rows + guard_rows),
        bent_rows=rows if smooth else [True] * field.numel(),
        bent_free_rows=free_rows if smooth else [True] * field.numel(),
        bent_guards=guard_rows,
        curved_guards=_bent([guards], x, unknowns, _NO_TIME, True, sums)[0],
    )


class _Kind(IntEnum):
    """Kinds of expressions; the kind of a sum is the largest of its terms."""

    CONSTANT = 0
    LINE = 1  # affine in the time
    WAVE = 2  # and with sines of such
    AFFINE = 3  # and affine in the states
    BENT = 4


class _Kinds:
    """The algebra of kinds."""

    def __init__(self, time: int | None, moves: bool, sums: Sequence[_Kind] = ()):
        self._time, self._moves, self._sums = time, moves, sums

    def constant(self, value: float) -> _Kind:
        return _Kind.CONSTANT

    def symbol(self, vector: int, position: int) -> _Kind:
        if vector == 3:
            return self._sums[position]
        if vector == 2 or (vector and not self._moves):
            return _Kind.CONSTANT
        return _Kind.LINE if (vector, position) == (0, self._time) else _Kind.AFFINE

    def apply(self, op: str, args: Sequence[_Kind]) -> _Kind:
        most = max(args)
        if most is _Kind.CONSTANT or op in ("assign", "neg", "twice", "add", "sub"):
            return most
        if op == "mul" and min(args) is _Kind.CONSTANT:
            return most
        if op == "div" and args[1] is _Kind.CONSTANT:
            return most
        if op == "if_else_zero" and args[0] is _Kind.CONSTANT:
            return most
        return _Kind.WAVE if op in ("sin", "cos") and most is _Kind.LINE else _Kind.BENT


def bent(expressions: ca.SX, x: ca.SX, time: ca.SX = _NO_TIME) -> list[bool]:
    """Which expressions are not affine in states, with sines of the time added."""
    return _bent([expressions], x, ca.SX(0, 1), time, False)[0]


def _bent(
    outputs: Sequence[ca.SX],
    x: ca.SX,
    unknowns: ca.SX,
    time: ca.SX,
    moves: bool,
    sums: LongSums | None = None,
) -> list[list[bool]]:
    """The same of several, in unknowns too where these move."""
    own = [] if sums is None else sums.kinds(_kinds([sums.terms], x, unknowns, time, moves)[0])
    symbols = _NO_TIME if sums is None else sums.symbols
    rows = _kinds(outputs, x, unknowns, time, moves, symbols, own)
    return [[kind is _Kind.BENT for kind in row] for row in rows]


def _kinds(
    outputs: Sequence[ca.SX],
    x: ca.SX,
    unknowns: ca.SX,
    time: ca.SX,
    moves: bool,
    sums: ca.SX = _NO_TIME,
    of_sums: Sequence[_Kind] = (),
) -> list[list[_Kind]]:
    """Kinds of the entries of several expressions."""
    positions = {s.element_hash(): i for i, s in enumerate(ca.vertsplit(x))}
    known = {*positions, *(s.element_hash() for own in (unknowns, sums) for s in ca.vertsplit(own))}
    symbols = ca.symvar(ca.vertcat(*map(ca.vec, outputs)))
    others = ca.vertcat(*[s for s in symbols if s.element_hash() not in known])
    nodes, rows = instructions([x, unknowns, others, sums], outputs)
    at = positions.get(time.element_hash()) if time.numel() else None
    kinds = evaluate(nodes, _Kinds(at, moves, of_sums))
    return [[kinds[j] for j in row] for row in rows]
