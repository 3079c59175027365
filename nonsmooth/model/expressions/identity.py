"""Whether expressions vanish on a surface, decided by exact arithmetic modulo a prime.

A nonzero expression vanishes at random integers modulo the prime with a probability of about 2^-60.
Elementary functions are random functions of their argument there, so identities between them
(exp(a) exp(b) = exp(a + b)) are not found; square roots are. Constants are the exact values of the
doubles.

Source: Schwartz 1980, "Fast probabilistic algorithms for verification of polynomial identities".
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction

import casadi as ca

from .graph import Node, evaluate, instructions

PRIME = 2**61 - 1

_TRIALS, _DRAWS = 6, 200


class _Undecided(Exception):
    """A quotient by zero, or a root that does not exist modulo the prime: draw again."""


class _Modular:
    """The algebra of integers modulo the prime, over drawn values of the symbols."""

    def __init__(self, values: Sequence[Sequence[int]], seed: int):
        self.values, self.seed = values, seed
        self._positive = set[int]()  # constants

    def constant(self, value: float) -> int:
        exact = Fraction(value)
        found = exact.numerator * pow(exact.denominator, -1, PRIME) % PRIME
        if exact > 0:
            self._positive.add(found)
        return found

    def symbol(self, vector: int, position: int) -> int:
        return self.values[vector][position]

    def apply(self, op: str, args: Sequence[int]) -> int:
        a, b = args[0], args[-1]
        if op in ("add", "sub", "mul"):
            result = {"add": a + b, "sub": a - b, "mul": a * b}[op]
        elif op in ("neg", "sq", "twice", "assign"):
            result = {"neg": -a, "sq": a * a, "twice": 2 * a, "assign": a}[op]
        elif op in ("div", "inv"):
            result = (a if op == "div" else 1) * _inverse(b)
        elif op == "sqrt":
            result = _root(a)
        elif op in ("pow", "constpow") and (n := _small(b)) is not None:
            result = pow(a, n, PRIME) if n >= 0 else pow(_inverse(a), -n, PRIME)
        elif op in ("pow", "constpow") and a == 0 and b in self._positive:
            result = 0
        else:
            result = random.Random(f"{self.seed} {op} {list(args)}").randrange(1, PRIME)
        return result % PRIME


def _inverse(a: int) -> int:
    if a % PRIME == 0:
        raise _Undecided
    return pow(a, -1, PRIME)


def _root(a: int) -> int:
    """A square root; the prime is 3 modulo 4."""
    root = pow(a % PRIME, (PRIME + 1) // 4, PRIME)
    if root * root % PRIME != a % PRIME:
        raise _Undecided
    return root


def _small(b: int) -> int | None:
    """A whole number of small size, as an exponent is."""
    signed = b if b < PRIME // 2 else b - PRIME
    return signed if abs(signed) <= 1000 else None


def vanish_on(
    expressions: Sequence[ca.SX], surface: ca.SX, variables: ca.SX, others: ca.SX
) -> bool:
    """Whether all expressions are zero wherever ``surface`` is."""
    every = ca.vertcat(surface, *expressions)
    used = [(s, ca.depends_on(variables, s)) for s in ca.symvar(every)]
    vectors = [ca.vertcat(*[s for s, moves in used if moves is kind]) for kind in (True, False)]
    nodes, rows = instructions(vectors, [surface, ca.vertcat(*expressions)])
    generator, trials = random.Random(0), 0
    for seed in range(_DRAWS):
        values = [[generator.randrange(PRIME) for _ in range(v.numel())] for v in vectors]
        try:
            point = _on_surface(nodes, rows[0][0], values, seed)
            if point is None:
                return False
            found = evaluate(nodes, _Modular(point, seed))
        except _Undecided:
            continue
        if any(found[k] for k in rows[1]):
            return False
        trials += 1
        if trials == _TRIALS:
            return True
    return False


def _on_surface(
    nodes: Sequence[Node], row: int, values: list[list[int]], seed: int
) -> list[list[int]] | None:
    """Move one variable so that a node becomes zero; None where none enters it simply."""

    def at(j: int, value: int) -> int:
        moved = [[*values[0][:j], value, *values[0][j + 1 :]], values[1]]
        return evaluate(nodes[: row + 1], _Modular(moved, seed))[row]

    for j in range(len(values[0])):
        h = [at(j, k) for k in range(4)]
        if h[0] == h[1]:
            continue
        second, third = h[2] - 2 * h[1] + h[0], h[3] - 3 * h[2] + 3 * h[1] - h[0]
        if third % PRIME:
            continue
        a, c = second * _inverse(2) % PRIME, h[0]
        b = (h[1] - a - c) % PRIME
        if a == 0:
            root = -c * _inverse(b)
        else:
            root = (-b + _root(b * b - 4 * a * c)) * _inverse(2 * a)
        return [[*values[0][:j], root % PRIME, *values[0][j + 1 :]], values[1]]
    return None
