"""Exact rational values of programs, to decide whether a start lies on a surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

from .instructions import Program
from .intervals import Numbers, exact

_APPLY: dict[str, Callable[..., Fraction]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "inv": lambda a: 1 / a,
    "neg": lambda a: -a,
    "twice": lambda a: 2 * a,
    "sq": lambda a: a * a,
}


class Rationals:
    """The arithmetic of fractions; None for what is not rational or not known."""

    def __init__(self, inputs: Sequence[Sequence[Fraction | None]], numbers: Numbers):
        self.inputs, self.numbers = inputs, numbers

    def constant(self, value: float | Fraction) -> Fraction | None:
        """A constant."""
        return exact(value, self.numbers)

    def symbol(self, vector: int, position: int) -> Fraction | None:
        """Return an input."""
        return self.inputs[vector][position]

    def power(self, a: Fraction | None, n: int) -> Fraction | None:
        """A natural power."""
        return None if a is None else a**n

    def apply(self, op: str, args: Sequence[Fraction | None]) -> Fraction | None:
        """An operation."""
        known = [a for a in args if a is not None]
        if len(known) < len(args) or op not in _APPLY:
            return None
        try:
            return _APPLY[op](*known)
        except ZeroDivisionError:
            return None


def is_zero(
    program: Program, inputs: Sequence[Sequence[Fraction | None]], numbers: Numbers
) -> bool:
    """Whether a program's first value is zero exactly."""
    return program(Rationals(inputs, numbers))[0][0] == 0
