"""Whether rational functions vanish on a surface but for the rounding of the numbers in them.

0.7 x - 0.07 is not zero at the double 0.1, and nobody means a jump of 1e-17. Values at random rational points are
exact here, beside what half a unit in the last place of each number makes of them; whole numbers are exact.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction

import casadi as ca

from .graph import Node, evaluate, instructions

_POINTS = 4

#: Half a unit in the last place, relative to a number, and so many of them are allowed.
_ROUNDED, _TIMES = Fraction(1, 2**53), 4

#: A value and how far it may be off.
Value = tuple[Fraction, Fraction]


class _NotRational(Exception):
    """An operation that leaves the rational numbers, or a quotient by zero."""


class _Exact:
    """The algebra of rational numbers with the rounding of constants."""

    def __init__(self, values: Sequence[Sequence[Value]]):
        self.values = values

    def constant(self, value: float) -> Value:
        if value - value != 0.0:
            raise _NotRational
        exact = Fraction(value)
        return exact, Fraction(0) if exact.denominator == 1 else abs(exact) * _ROUNDED

    def symbol(self, vector: int, position: int) -> Value:
        return self.values[vector][position]

    def apply(self, op: str, args: Sequence[Value]) -> Value:
        (a, da), (b, db) = args[0], args[-1]
        if op in ("add", "sub"):
            return (a + b if op == "add" else a - b), da + db
        if op in ("mul", "sq"):
            return a * b, abs(a) * db + abs(b) * da
        if op in ("neg", "twice", "assign"):
            times = {"neg": -1, "twice": 2, "assign": 1}[op]
            return times * a, abs(times) * da
        if op in ("div", "inv") and b:
            a, da = (a, da) if op == "div" else (Fraction(1), Fraction(0))
            return a / b, da / abs(b) + abs(a) * db / (b * b)
        if op in ("pow", "constpow") and b.denominator == 1 and 0 < b <= 16:
            n = int(b)
            return a**n, n * abs(a) ** (n - 1) * da
        raise _NotRational


def zero_but_for_rounding(
    expressions: Sequence[ca.SX], surfaces: Sequence[ca.SX], variables: ca.SX
) -> bool:
    """Whether all expressions are zero on ``surfaces`` to the rounding of numbers; False where this is not known."""
    every = ca.symvar(ca.vertcat(*surfaces, *expressions))
    moves = [k for k, s in enumerate(every) if ca.depends_on(variables, s)]
    symbols = [ca.vertcat(*every)]
    nodes, rows = instructions(symbols, [ca.vertcat(*surfaces), ca.vertcat(*expressions)])
    generator = random.Random(0)
    for _ in range(_POINTS):
        drawn = [Fraction(generator.randrange(-64, 65) * 2 + 1, 32) for _ in every]
        try:
            point = [(value, Fraction(0)) for value in drawn]
            for row in rows[0]:
                point = _moved(nodes, row, point, moves)
            found = evaluate(nodes, _Exact([point]))
            missed = [found[row] for row in rows[0]]
            values = [found[row] for row in rows[1]]
        except _NotRational:
            return False
        if any(value for value, _ in missed) or any(abs(v) > _TIMES * off for v, off in values):
            return False
    return True


def _moved(
    nodes: Sequence[Node], row: int, point: list[Value], moves: Sequence[int]
) -> list[Value]:
    """Move a variable in which a node is linear to its zero."""

    def at(j: int, value: int) -> Value:
        moved = [*point[:j], (Fraction(value), Fraction(0)), *point[j + 1 :]]
        return evaluate(nodes[: row + 1], _Exact([moved]))[row]

    for j in moves:
        (a, off), (b, _), (c, _), (d, _) = (at(j, value) for value in range(4))
        slope = b - a
        if slope and c - b == slope and d - c == slope:
            root = (-a / slope, off / abs(slope))
            return [*point[:j], root, *point[j + 1 :]]
    raise _NotRational
