"""Arrays of intervals with ends in doubles, rounded outward.

+ - * / and sqrt of doubles are correctly rounded (IEEE 754), so one step outward encloses. Other
functions go through Arb entry by entry. What is not defined on an interval becomes the whole line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .flint import arb
from .instructions import Program
from .intervals import COMMON, OPERATIONS, Arithmetic, Numbers, exact, power_of, precision

Floats = NDArray[np.float64]
_INF = np.inf


class Intervals:
    """Intervals [low, high] as arrays of one shape."""

    __slots__ = ("high", "low")

    def __init__(self, low: Any, high: Any):
        self.low, self.high = low, high

    def __add__(self, other: Intervals) -> Intervals:
        return _outward(self.low + other.low, self.high + other.high)

    def __sub__(self, other: Intervals) -> Intervals:
        return _outward(self.low - other.high, self.high - other.low)

    def __neg__(self) -> Intervals:
        return Intervals(-self.high, -self.low)

    def __mul__(self, other: Intervals) -> Intervals:
        a, b = self.low * other.low, self.low * other.high
        c, d = self.high * other.low, self.high * other.high
        return _outward(
            np.minimum(np.minimum(a, b), np.minimum(c, d)),
            np.maximum(np.maximum(a, b), np.maximum(c, d)),
        )

    def __truediv__(self, other: Intervals) -> Intervals:
        zero = (other.low <= 0) & (other.high >= 0)
        inverse = _outward(
            np.where(zero, np.nan, 1 / np.where(zero, 1.0, other.high)),
            np.where(zero, np.nan, 1 / np.where(zero, 1.0, other.low)),
        )
        return self * inverse

    @property
    def size(self) -> Floats:
        """Largest absolute value."""
        return np.maximum(np.abs(self.low), np.abs(self.high))

    @property
    def has_zero(self) -> NDArray[np.bool_]:
        """Whether zero is inside; true where nothing is known."""
        return ~((self.low > 0) | (self.high < 0))

    def __getitem__(self, key: Any) -> Intervals:
        return Intervals(self.low[key], self.high[key])


def _outward(low: Any, high: Any) -> Intervals:
    low, high = np.nextafter(low, -_INF), np.nextafter(high, _INF)
    return Intervals(np.where(np.isnan(low), -_INF, low), np.where(np.isnan(high), _INF, high))


def points(values: Any) -> Intervals:
    """Doubles as intervals of no width."""
    return Intervals(values, values)


def of_enclosure(a: arb) -> Intervals:
    """The doubles around an enclosure."""
    if not a.is_finite():
        return Intervals(np.float64(-_INF), np.float64(_INF))
    # Conversion rounds to the nearest double (0 or infinity where there is none): a step outward.
    low, high = float(a.lower()), float(a.upper())
    return Intervals(np.nextafter(low, -_INF), np.nextafter(high, _INF))


def of_fractions(low: Fraction, high: Fraction) -> Intervals:
    """The doubles around exact ends."""
    a, b = float(low), float(high)
    a = math.nextafter(a, -_INF) if Fraction(a) > low else a
    b = math.nextafter(b, _INF) if Fraction(b) < high else b
    return Intervals(np.float64(a), np.float64(b))


# Operations --------------------------------------------------------------------------------------


def _square(a: Intervals) -> Intervals:
    s, t = np.abs(a.low), np.abs(a.high)
    inner = np.where((a.low <= 0) & (a.high >= 0), 0.0, np.minimum(s, t))
    found = _outward(inner * inner, np.square(np.maximum(s, t)))
    return Intervals(np.maximum(found.low, 0.0), found.high)


def power(a: Intervals, n: int) -> Intervals:
    """A natural power."""
    return power_of(a, n, lambda: points(np.float64(1.0)), _square)


def _sqrt(a: Intervals) -> Intervals:
    bad = a.low < 0
    low, high = np.where(bad, np.nan, a.low), np.where(bad, np.nan, a.high)
    found = _outward(np.sqrt(low), np.sqrt(high))
    return Intervals(np.where(bad, -_INF, np.maximum(found.low, 0.0)), found.high)


def _one_by_one(function: Callable[..., arb]) -> Callable[..., Intervals]:
    def apply(*args: Intervals) -> Intervals:
        arrays = np.broadcast_arrays(*[v for a in args for v in (a.low, a.high)])
        low, high = np.empty(arrays[0].shape), np.empty(arrays[0].shape)
        with precision(64):
            for k in np.ndindex(low.shape):
                given = [v[k] for v in arrays]
                found = Intervals(-_INF, _INF)
                if all(map(math.isfinite, given)):
                    pairs = zip(given[::2], given[1::2], strict=True)
                    found = of_enclosure(function(*(_hull(float(a), float(b)) for a, b in pairs)))
                low[k], high[k] = found.low, found.high
        return Intervals(low, high)

    return apply


def _hull(low: float, high: float) -> arb:
    return arb(low) if low == high else arb(low).union(arb(high))


_APPLY: dict[str, Callable[..., Intervals]] = {
    **{op: _one_by_one(f) for op, f in OPERATIONS.items() if op != "pi"},
    **COMMON,
    "inv": lambda a: points(np.float64(1.0)) / a,
    "sq": _square,
    "sqrt": _sqrt,
    "hypot": lambda a, b: _sqrt(_square(a) + _square(b)),
    "fabs": lambda a: Intervals(
        np.where(a.has_zero, 0.0, np.minimum(np.abs(a.low), np.abs(a.high))), a.size
    ),
    "fmin": lambda a, b: Intervals(np.minimum(a.low, b.low), np.minimum(a.high, b.high)),
    "fmax": lambda a, b: Intervals(np.maximum(a.low, b.low), np.maximum(a.high, b.high)),
    "pi": lambda: of_enclosure(arb.pi()),
}


class Batch(Arithmetic):
    """The arithmetic of many intervals at once."""

    operations, power = _APPLY, staticmethod(power)

    def constant(self, value: float | Fraction) -> Intervals:
        return of_fractions(*[exact(value, self.numbers)] * 2)


def evaluate_many(
    program: Program, inputs: Sequence[Sequence[Intervals]], numbers: Numbers
) -> list[list[Intervals]]:
    """Enclose a program's values on many boxes; infinities and NaN on the way are meant."""
    with np.errstate(all="ignore"):
        return program(Batch(inputs, numbers))
