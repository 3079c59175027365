"""Whether expressions vanish on a surface, decided by exact arithmetic modulo a prime.

A nonzero expression vanishes at random integers modulo the prime with a probability of about 2^-60.
Elementary functions are random functions of their argument there, but for their exact values at 0
and 1, so identities between them (exp(a) exp(b) = exp(a + b)) are not found; square roots are.
Constants are the exact values of the doubles, and what is only their rounding counts as zero. Where this leaves it open, ``decide_zero`` looks at
doubles.

Source: Schwartz 1980, "Fast probabilistic algorithms for verification of polynomial identities".
"""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..values import Array
from .cancel import NormalForms, ratio
from .float_arithmetic import BINARY, UNARY
from .graph import Node, evaluate, instructions

PRIME = 2**61 - 1

_TRIALS, _DRAWS = 6, 200

#: Elementary functions at an argument where their value is exact.
_AT_ZERO = {
    **dict.fromkeys(
        "sin tan asin atan sinh tanh asinh atanh expm1 log1p erf erfinv sqrt".split(), 0
    ),
    **dict.fromkeys(("exp", "cos", "cosh"), 1),
}
_AT_ONE = {"log": 0, "acos": 0, "acosh": 0}


class _Undecided(Exception):
    """A quotient by zero, or a root that does not exist modulo the prime: draw again."""


class _Modular:
    """The algebra of integers modulo the prime, over drawn values of the symbols."""

    def __init__(self, values: Sequence[Sequence[int]], seed: int):
        self.values, self.seed = values, seed
        self._positive = set[int]()  # constants
        self.guesses = False  # whether a value is that of no function

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
        elif a == 0 and op in _AT_ZERO:
            result = _AT_ZERO[op]
        elif a == 1 and op in _AT_ONE:
            result = _AT_ONE[op]
        elif op == "sqrt":
            result = _root(a)
        elif op in ("pow", "constpow") and (n := _small(b)) is not None:
            result = pow(a, n, PRIME) if n >= 0 else pow(_inverse(a), -n, PRIME)
        elif op in ("pow", "constpow") and a == 0 and b in self._positive:
            result = 0
        else:
            self.guesses = True
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


def vanish_on(expressions: Sequence[ca.SX], surface: ca.SX, variables: ca.SX) -> bool:
    """Whether all expressions are zero wherever ``surface`` is."""
    forms = NormalForms([ca.vertcat(*ca.symvar(ca.vertcat(surface, *expressions)))])
    own = forms.of(surface)
    if all(not form or ratio(form, own) for form in map(forms.of, expressions)):
        return True  # zeros, and visible multiples of it
    return _modular(expressions, [surface], variables) is True


def that_vanish_on(expressions: Sequence[ca.SX], surface: ca.SX, variables: ca.SX) -> list[bool]:
    """Which of many expressions are zero wherever ``surface`` is: most are not, at one point of it."""
    drawn = next(_values_on(expressions, [surface], variables), None)
    zero = [True] * len(expressions) if drawn is None else [not value for value in drawn[0]]
    return [
        may and vanish_on([e], surface, variables) for e, may in zip(expressions, zero, strict=True)
    ]


def decide_zero(
    expressions: Sequence[ca.SX], surfaces: Sequence[ca.SX], variables: ca.SX
) -> tuple[bool | None, str]:
    """Whether all expressions are zero wherever all ``surfaces`` are, or None, and how it was decided."""
    pieces = [e for e in expressions if not ca.SX(e).is_zero()]
    if not pieces:
        return True, EXACTLY
    found = _modular(pieces, surfaces, variables)
    if found is False and zero_but_for_rounding(pieces, surfaces, variables):
        return True, BUT_FOR_ROUNDING
    if found is not None:
        return found, EXACTLY
    return _in_doubles(pieces, surfaces, variables), IN_DOUBLES


def _modular(
    expressions: Sequence[ca.SX], surfaces: Sequence[ca.SX], variables: ca.SX
) -> bool | None:
    """Zero, not zero, or None where elementary functions or a surface of high degree leave it open."""
    for trial, (found, guessed) in enumerate(_values_on(expressions, surfaces, variables)):
        if any(found):
            return None if guessed else False
        if trial + 1 == _TRIALS:
            return True
    return None


def _values_on(
    expressions: Sequence[ca.SX], surfaces: Sequence[ca.SX], variables: ca.SX
) -> Iterator[tuple[list[int], bool]]:
    """Values at random points of surfaces, and whether elementary functions were guessed."""
    used = [
        (s, ca.depends_on(variables, s)) for s in ca.symvar(ca.vertcat(*surfaces, *expressions))
    ]
    vectors = [ca.vertcat(*[s for s, moves in used if moves is kind]) for kind in (True, False)]
    nodes, rows = instructions(vectors, [ca.vertcat(*surfaces), ca.vertcat(*expressions)])
    generator = random.Random(0)
    for seed in range(_DRAWS):
        values = [[generator.randrange(PRIME) for _ in range(v.numel())] for v in vectors]
        try:
            point = _on_surfaces(nodes, rows[0], values, seed)
            if point is None:
                return
            algebra = _Modular(point, seed)
            found = evaluate(nodes, algebra)
        except _Undecided:
            continue
        yield [found[k] for k in rows[1]], algebra.guesses


def _on_surfaces(
    nodes: Sequence[Node], rows: Sequence[int], values: list[list[int]], seed: int
) -> list[list[int]] | None:
    """Move a variable for each surface so that its node becomes zero; None where none enters it simply."""
    for k, row in enumerate(rows):
        found = _on_surface(nodes, row, rows[:k], values, seed)
        if found is None:
            return None
        values = found
    return values


def _on_surface(
    nodes: Sequence[Node], row: int, kept: Sequence[int], values: list[list[int]], seed: int
) -> list[list[int]] | None:
    """Move a variable on which no ``kept`` node depends so that a node becomes zero."""
    last = max(row, *kept, 0) + 1

    def at(j: int, value: int) -> tuple[int, bool]:
        moved = [[*values[0][:j], value, *values[0][j + 1 :]], values[1]]
        found = evaluate(nodes[:last], _Modular(moved, seed))
        return found[row], any(found[k] for k in kept)

    for j in range(len(values[0])):
        tried = [at(j, k) for k in range(4)]
        h = [value for value, _ in tried]
        if h[0] == h[1] or any(lost for _, lost in tried):
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


# In rational numbers -------------------------------------------------------------------------------

# 0.7 x - 0.07 is not zero at the double 0.1, but a jump of 1e-17 is not intended. Values of rational functions at random
# rational points are exact up to half a unit in the last place of each number; whole numbers are exact.

_RATIONAL_POINTS = 4

#: Half a unit in the last place, relative to a number, and so many of them are allowed.
_ROUNDED, _TIMES = Fraction(1, 2**53), 4

#: A value and its error.
_Value = tuple[Fraction, Fraction]


class _NotRational(Exception):
    """An operation that leaves the rational numbers, or a quotient by zero."""


class _Exact:
    """The algebra of rational numbers with the rounding of constants."""

    def __init__(self, values: Sequence[Sequence[_Value]]):
        self.values = values

    def constant(self, value: float) -> _Value:
        if value - value != 0.0:
            raise _NotRational
        exact = Fraction(value)
        return exact, Fraction(0) if exact.denominator == 1 else abs(exact) * _ROUNDED

    def symbol(self, vector: int, position: int) -> _Value:
        return self.values[vector][position]

    def apply(self, op: str, args: Sequence[_Value]) -> _Value:
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
    for _ in range(_RATIONAL_POINTS):
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
    nodes: Sequence[Node], row: int, point: list[_Value], moves: Sequence[int]
) -> list[_Value]:
    """Move a variable in which a node is linear to its zero."""

    def at(j: int, value: int) -> _Value:
        moved = [*point[:j], (Fraction(value), Fraction(0)), *point[j + 1 :]]
        return evaluate(nodes[: row + 1], _Exact([moved]))[row]

    for j in moves:
        (a, off), (b, _), (c, _), (d, _) = (at(j, value) for value in range(4))
        slope = b - a
        if slope and c - b == slope and d - c == slope:
            root = (-a / slope, off / abs(slope))
            return [*point[:j], root, *point[j + 1 :]]
    raise _NotRational


# In doubles ---------------------------------------------------------------------------------------

#: How it was decided: a nonzero value is a proof, zeros fail with a chance of about 2^-60.
EXACTLY = "exact arithmetic modulo a prime"

#: Not exact, but within the rounding of its numbers.
BUT_FOR_ROUNDING = "exact arithmetic, but for the rounding of numbers"

#: Numbers at some points are no proof.
IN_DOUBLES = "doubles at random points"

_EPSILON = sys.float_info.epsilon
_POINTS, _NEWTON = 8, 30

#: Rounding errors below which a value is zero, and above which it is not.
_ZERO, _CLEAR = 1e3, 1e6


class _Rounded:
    """The algebra of doubles with their rounding errors."""

    def __init__(self, values: Sequence[Sequence[float]]):
        self.values = values

    def constant(self, value: float) -> tuple[float, float]:
        return value, 0.0

    def symbol(self, vector: int, position: int) -> tuple[float, float]:
        value = self.values[vector][position]
        return value, _EPSILON * abs(value)

    def apply(self, op: str, args: Sequence[tuple[float, float]]) -> tuple[float, float]:
        function: Callable[..., float] = UNARY[op] if op in UNARY else BINARY[op]
        given = [value for value, _ in args]
        value = function(*given)
        error = _EPSILON * abs(value)
        for k, (own, off) in enumerate(args):
            if off:
                error += abs(function(*given[:k], own + off, *given[k + 1 :]) - value)
        return value, error


def _in_doubles(
    expressions: Sequence[ca.SX], surfaces: Sequence[ca.SX], variables: ca.SX
) -> bool | None:
    """The same by values at points on the surfaces, beside their rounding errors."""
    every = ca.symvar(ca.vertcat(*surfaces, *expressions))
    moves = np.array([bool(ca.depends_on(variables, s)) for s in every])
    z, h = ca.vertcat(*every), ca.vertcat(*surfaces)
    nodes, rows = instructions([z], [ca.vertcat(*expressions)])
    read = ca.Function("surfaces", [z], [h, ca.jacobian(h, z)])
    generator, zeros, seen = np.random.default_rng(0), 0, 0
    for _ in range(5 * _POINTS):
        point = _newton(read, generator.uniform(-2.0, 2.0, len(every)), moves)
        if point is None:
            continue
        try:
            values = evaluate(nodes, _Rounded([point.tolist()]))
        except (ValueError, ZeroDivisionError, OverflowError):
            continue
        found = [values[k] for k in rows[0]]
        if not all(math.isfinite(value) and math.isfinite(error) for value, error in found):
            continue
        if any(abs(value) > _CLEAR * error for value, error in found):
            return False
        zeros += all(abs(value) <= _ZERO * error for value, error in found)
        seen += 1
        if seen == _POINTS:
            return True if zeros == seen else None
    return None


def _newton(read: ca.Function, point: Array, moves: NDArray[np.bool_]) -> Array | None:
    """Least-norm Newton steps of the variables onto the surfaces."""
    for _ in range(_NEWTON):
        h, jacobian = (np.array(v, dtype=float) for v in read(point))
        if not (np.all(np.isfinite(h)) and np.all(np.isfinite(jacobian))):
            return None
        if np.all(np.abs(h) <= 8 * _EPSILON * (np.abs(jacobian) @ np.abs(point)[:, None])):
            return point
        step = np.zeros_like(point)
        step[moves] = np.linalg.lstsq(jacobian[:, moves], h.ravel(), rcond=None)[0]
        point = point - step
    return None
