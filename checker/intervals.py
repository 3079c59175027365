"""Intervals in fixed point, rounded outward, and elementary functions of them."""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from math import isqrt
from typing import Any

BITS = 640
ONE = 1 << BITS

#: Products and quotients are below two to this power.
_LARGE = 1 << 16
_LIMIT = 1 << (_LARGE + BITS)
_SQUARED = _LIMIT << BITS

#: Numbers in texts; one such as 1e999999999 would fill the memory.
_NUMBER = re.compile(
    r"[-+]?[0-9]{1,4000}/[0-9]{1,4000}|[-+]?[0-9]{1,4000}(\.[0-9]{0,4000})?([eE][-+]?[0-9]{1,4})?"
)


class CheckError(Exception):
    """A claim that is false or cannot be checked."""


def number(value: Any) -> Fraction:
    """An exact number of a record: a whole number, a double, or a fraction or decimals as a text."""
    known = type(value) in (int, float, Fraction)
    if isinstance(value, str):
        known = bool(_NUMBER.fullmatch(value))
    try:
        return Fraction(value if known else None)
    except (ArithmeticError, ValueError, TypeError) as error:
        raise CheckError(f"a number is written as {str(value)[:50]!r}") from error


class Iv:
    """An interval [a, b]/2^BITS."""

    __slots__ = ("a", "b")

    def __init__(self, a: int, b: int):
        self.a, self.b = a, b

    @staticmethod
    def of(low: Any, high: Any = None) -> Iv:
        p, q = number(low), number(low if high is None else high)
        if p > q:
            raise CheckError("an interval has its ends in the wrong order")
        return Iv(p.numerator * ONE // p.denominator, -(-q.numerator * ONE // q.denominator))

    def __add__(self, o: Iv) -> Iv:
        return Iv(self.a + o.a, self.b + o.b)

    def __sub__(self, o: Iv) -> Iv:
        return Iv(self.a - o.b, self.b - o.a)

    def __neg__(self) -> Iv:
        return Iv(-self.b, -self.a)

    def __mul__(self, o: Iv) -> Iv:
        a, b, c, d = self.a, self.b, o.a, o.b
        if a == b and c == d:
            low = high = a * c
        elif a >= 0 and c >= 0:
            low, high = a * c, b * d
        else:
            p = (a * c, a * d, b * c, b * d)
            low, high = min(p), max(p)
        if low < -_SQUARED or high > _SQUARED:
            raise CheckError(f"a number is larger than 2^{_LARGE}")
        return Iv(low >> BITS, -(-high >> BITS))

    def __truediv__(self, o: Iv) -> Iv:
        if o.a <= 0 <= o.b:
            raise CheckError("a division by an interval that contains zero")
        ends = (o.a, o.b) if o.a < o.b else (o.a,)
        p = [(n << BITS, d) for n in (self.a, self.b) for d in ends]
        low, high = min(n // d for n, d in p), max(-(-n // d) for n, d in p)
        if low < -_LIMIT or high > _LIMIT:
            raise CheckError(f"a number is larger than 2^{_LARGE}")
        return Iv(low, high)

    def sq(self) -> Iv:
        low = 0 if self.a <= 0 <= self.b else min(self.a * self.a, self.b * self.b) >> BITS
        high = max(self.a * self.a, self.b * self.b)
        if high > _SQUARED:
            raise CheckError(f"a number is larger than 2^{_LARGE}")
        return Iv(low, -(-high >> BITS))

    def sign(self) -> int:
        return 1 if self.a > 0 else -1 if self.b < 0 else 0

    def inside(self, o: Iv) -> bool:
        return o.a < self.a and self.b < o.b

    @property
    def zero(self) -> bool:
        return self.a == self.b == 0

    def mid(self) -> Iv:
        m = (self.a + self.b) >> 1
        return Iv(m, m)


def whole(n: int) -> Iv:
    return Iv(n * ONE, n * ONE)


def _smooth(slope: Callable[[Any], Any]) -> Callable[[Callable[[Iv], Iv]], Callable[[Any], Any]]:
    """A function of intervals, and by its slope of forms with a chain rule."""

    def of(f: Callable[[Iv], Iv]) -> Callable[[Any], Any]:
        return lambda x: f(x) if type(x) is Iv else x.chained(f, slope)

    return of


def _ends(f: Callable[[Iv], Iv], x: Iv) -> Iv:
    """A rising function from its values at both ends."""
    return Iv(f(Iv(x.a, x.a)).a, f(Iv(x.b, x.b)).b)


def _series(first: Iv, factor: Callable[[Iv, int], Iv]) -> Iv:
    """Sum of terms, each from the last; the rest is below twice the first term left out."""
    # The terms must come to fall at least by half each; the remainder is added on both sides.
    total, term, n = first, first, 0
    while max(abs(term.a), abs(term.b)) > 2 or n < 4:
        n += 1
        term = factor(term, n)
        total = total + term
        if n > 5000:
            raise CheckError("a series does not converge")
    r = 4 * max(abs(term.a), abs(term.b)) + 8
    return Iv(total.a - r, total.b + r)


@_smooth(lambda x: exp(x))
def exp(x: Iv) -> Iv:
    def point(p: Iv) -> Iv:
        k = max(0, abs(p.a).bit_length() - BITS + 4)
        small = Iv(p.a >> k, -(-p.b >> k))
        value = _series(whole(1), lambda t, n: t * small / whole(n))
        for _ in range(k):
            value = value * value
        return value

    return _ends(point, x)


def _atanh_series(z: Iv) -> Iv:
    s, powers = z.sq(), {0: z}

    def factor(t: Iv, n: int) -> Iv:
        powers[n] = powers[n - 1] * s
        return powers[n] / whole(2 * n + 1)

    return _series(z, factor)


@_smooth(lambda x: whole(1) / x)
def log(x: Iv) -> Iv:
    def point(p: Iv) -> Iv:
        if p.a <= 0:
            raise CheckError("a logarithm of what is not positive")
        k = p.a.bit_length() - BITS
        m = Iv(p.a << -k, p.b << -k) if k < 0 else Iv(p.a >> k, -(-p.b >> k))
        ln2 = whole(2) * _atanh_series(whole(1) / whole(3))
        return whole(k) * ln2 + whole(2) * _atanh_series((m - whole(1)) / (m + whole(1)))

    return _ends(point, x)


@_smooth(lambda x: whole(1) / (sqrt(x) + sqrt(x)))
def sqrt(x: Iv) -> Iv:
    if x.a < 0:
        raise CheckError("a root of what may be negative")
    return Iv(isqrt(x.a << BITS), isqrt(x.b << BITS) + 1)


@_smooth(lambda x: whole(1) / (whole(1) + x.sq()))
def atan(x: Iv) -> Iv:
    def point(p: Iv) -> Iv:
        for _ in range(4):
            p = p / (whole(1) + sqrt(whole(1) + p.sq()))
        s, powers = p.sq(), {0: p}

        def factor(t: Iv, n: int) -> Iv:
            powers[n] = -(powers[n - 1] * s)
            return powers[n] / whole(2 * n + 1)

        return whole(16) * _series(p, factor)

    return _ends(point, x)


PI = whole(4) * atan(whole(1))


def _circular(x: Iv, shift: int) -> Iv:
    """sin (shift 0) or cos (shift 1): the value at the middle, and the width on both sides."""
    m = x.mid()
    turns = whole((m.a + PI.a) // (2 * PI.a))
    y = m - turns * whole(2) * PI
    s = y.sq()
    first = whole(1) if shift else y
    value = _series(
        first, lambda t, n: -(t * s) / whole(2 * n * (2 * n - 1 if shift else 2 * n + 1))
    )
    r = (x.b - x.a + 1) // 2 + 1
    return Iv(max(value.a - r, -ONE - 1), min(value.b + r, ONE + 1))


@_smooth(lambda x: cos(x))
def sin(x: Iv) -> Iv:
    return _circular(x, 0)


@_smooth(lambda x: -sin(x))
def cos(x: Iv) -> Iv:
    return _circular(x, 1)


@_smooth(lambda x: whole(2) / sqrt(PI) * exp(-x.sq()))
def erf(x: Iv) -> Iv:
    def point(p: Iv) -> Iv:
        s, powers = p.sq(), {0: p}

        def factor(t: Iv, n: int) -> Iv:
            powers[n] = -(powers[n - 1] * s) / whole(n)
            return powers[n] / whole(2 * n + 1)

        return whole(2) / sqrt(PI) * _series(p, factor)

    if max(abs(x.a), abs(x.b)) > 8 * ONE:
        raise CheckError("erf of a large number")
    return _ends(point, x)


def power(a: Iv, n: int) -> Iv:
    if n % 2 == 0:
        return whole(1) if n == 0 else power(a.sq(), n // 2) if n > 2 else a.sq()
    return a * power(a, n - 1) if n > 1 else a
