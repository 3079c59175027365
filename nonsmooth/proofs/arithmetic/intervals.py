"""Midpoint-radius intervals of any precision, by Arb through python-flint.

Every operation returns an enclosure of its exact results for all arguments enclosed, or something
that is not finite. Where a function jumps or has no value, the result is not finite.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any, Literal

from ...model import NonsmoothError, OptionError
from .flint import arb, ctx, fmpq

Numbers = Literal["stored", "written"]


def exact(value: Any, numbers: Numbers = "stored", what: str = "number") -> Fraction:
    """The rational number that is meant: a float as stored or as written, others exactly."""
    if isinstance(value, (str, Decimal, Fraction)) or (
        isinstance(value, int) and not isinstance(value, bool)
    ):
        try:
            return Fraction(value)
        except (ValueError, OverflowError, ZeroDivisionError) as error:
            raise OptionError(_no_number(what, value)) from error
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise OptionError(_no_number(what, value)) from error
    if not math.isfinite(number) or isinstance(value, bool):
        raise OptionError(_no_number(what, value))
    return Fraction(repr(number)) if numbers == "written" else Fraction(number)


def _no_number(what: str, value: Any) -> str:
    return f"{what} is {value!r}, not a finite number. Write it as 0.3 or '0.3'."


def exact_range(
    value: Any, numbers: Numbers, what: str, error: type[NonsmoothError] = OptionError
) -> tuple[Fraction, Fraction]:
    """Both ends of a range (low, high), or a number twice."""
    ends = tuple(value) if isinstance(value, (tuple, list)) else (value, value)
    fractions = [exact(v, numbers, what) for v in ends]
    if len(fractions) != 2 or fractions[0] > fractions[1]:
        raise error(f"{what} is {value!r}, not a number or (low, high) with low <= high.")
    return fractions[0], fractions[1]


def enclose(value: Fraction) -> arb:
    """Enclose a rational number."""
    return arb(fmpq(value.numerator, value.denominator))


def hull(low: arb, high: arb) -> arb:
    """Enclose everything from one to the other."""
    return low.union(high)


def fraction(a: arb) -> Fraction:
    """The value of an exact number."""
    mantissa, exponent = a.mid().man_exp()
    m, e = int(mantissa), int(exponent)
    return Fraction(m * 2**e) if e >= 0 else Fraction(m, 2**-e)


def ends(a: arb) -> tuple[Fraction, Fraction]:
    """Both ends of a finite enclosure, exactly."""
    m, r = fraction(a), fraction(a.rad())
    return m - r, m + r


def between(low: Fraction, high: Fraction) -> arb:
    """Enclose an interval."""
    return hull(enclose(low), enclose(high))


def radius(a: arb) -> float:
    """Radius as a double, rounded upward; infinite where the enclosure is not finite."""
    return math.nextafter(float(a.rad()), math.inf) if a.is_finite() else math.inf


def sign(a: arb) -> int:
    """The common sign of all numbers enclosed; 0 if there is none."""
    return 1 if a > 0 else -1 if a < 0 else 0


def inside(a: arb, b: arb) -> bool:
    """Whether a is finite and lies in the interior of b."""
    return bool(a.is_finite() and b.is_finite() and b.contains_interior(a))


def within(point: Sequence[arb], box: Sequence[arb]) -> bool:
    """Whether a box holds another."""
    return all(b.contains(a) for a, b in zip(point, box, strict=True))


@contextmanager
def _set(name: str, value: int) -> Iterator[None]:
    """Set a property of the context inside a ``with`` block."""
    old = getattr(ctx, name)
    setattr(ctx, name, value)
    try:
        yield
    finally:
        setattr(ctx, name, old)


#: Blocks with another working precision in bits, and with series of another length.
precision, length = partial(_set, "prec"), partial(_set, "cap")


# Operations --------------------------------------------------------------------------------------


def square(a: arb) -> arb:
    """a^2, not negative."""
    if not a.contains(0):
        return a * a
    top = a.abs_upper()
    return arb(0).union(top * top)


def power_of(a: Any, n: int, one: Callable[[], Any], square: Callable[[Any], Any]) -> Any:
    """A natural power by squaring, in any arithmetic."""
    result = None
    while True:
        if n & 1:
            result = a if result is None else result * a
        n >>= 1
        if not n:
            return one() if result is None else result
        a = square(a)


def power(a: arb, n: int) -> arb:
    """A natural power."""
    return power_of(a, n, lambda: arb(1), square)


def _atan2(y: arb, x: arb) -> arb:
    """Away from its cut, the negative x axis and 0, where it jumps."""
    if y.contains(0) and not x > 0:
        return arb.nan()
    return arb.atan2(y, x)


#: Operations that are the same in every arithmetic.
COMMON: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "twice": lambda a: a + a,
}

OPERATIONS: dict[str, Callable[..., arb]] = {
    **COMMON,
    **{
        op: getattr(arb, op)
        for op in (
            *("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh"),
            *("tanh", "asinh", "acosh", "atanh", "erf", "erfinv", "expm1", "log1p"),
        )
    },
    "inv": lambda a: 1 / a,
    "sq": square,
    "pow": lambda a, b: (b * a.log()).exp(),
    "hypot": lambda a, b: (square(a) + square(b)).sqrt(),
    "atan2": _atan2,
    "fabs": abs,
    "fmin": lambda a, b: a.min(b),
    "fmax": lambda a, b: a.max(b),
    "pi": arb.pi,
}


class Arithmetic:
    """An arithmetic of programs: inputs by vector and position, and how constants are read."""

    operations: Mapping[str, Callable[..., Any]]

    def __init__(self, inputs: Sequence[Sequence[Any]], numbers: Numbers = "stored"):
        self.inputs, self.numbers = inputs, numbers

    def symbol(self, vector: int, position: int) -> Any:
        return self.inputs[vector][position]

    def apply(self, op: str, args: Sequence[Any]) -> Any:
        return self.operations[op](*args)


class Enclosures(Arithmetic):
    """The arithmetic in which a program's values are enclosed."""

    operations, power = OPERATIONS, staticmethod(power)

    def constant(self, value: float | Fraction) -> arb:
        """Enclose a constant."""
        if isinstance(value, float) and (
            self.numbers == "stored" or (value.is_integer() and abs(value) < 2**53)
        ):
            return arb(value)
        return enclose(exact(value, self.numbers))


class Rationals(Arithmetic):
    """The arithmetic of fractions; None for what is not rational or not known."""

    operations = COMMON | {"inv": lambda a: 1 / a, "sq": lambda a: a * a}

    def constant(self, value: float | Fraction) -> Fraction | None:
        return exact(value, self.numbers)

    def power(self, a: Fraction | None, n: int) -> Fraction | None:
        return None if a is None else a**n

    def apply(self, op: str, args: Sequence[Fraction | None]) -> Any:
        if None in args or op not in self.operations:
            return None
        try:
            return self.operations[op](*args)
        except ZeroDivisionError:
            return None
