"""Power series with enclosed coefficients, for expressions along a motion.

Picard's iteration of the field gains one order a pass. The jets of ``nonsmooth.model`` do not serve,
as they hold reciprocals as doubles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

from .flint import arb, arb_series, ctx
from .instructions import Program
from .intervals import COMMON, OPERATIONS, Arithmetic, Enclosures, Numbers, length, power_of


def _unknown() -> arb_series:
    """A series of which nothing is known, not even that it is one."""
    return arb_series([arb.nan()] * ctx.cap)


def _one() -> arb_series:
    return arb_series([1])


def _power(a: arb_series, n: int) -> arb_series:
    return power_of(a, n, _one, lambda b: b * b)


def _atan2(y: arb_series, x: arb_series) -> arb_series:
    right, up = x[0], y[0]
    if right > 0:
        return (y / x).atan()
    half = arb_series([arb.pi() / 2])
    if up > 0:
        return half - (x / y).atan()
    return -half - (x / y).atan() if up < 0 else arb_series([arb.nan()])


def _erfinv(a: arb_series) -> arb_series:
    """Each pass of w' = sqrt(pi)/2 exp(w^2) a' gains a coefficient."""
    start = arb_series([a[0].erfinv()])
    w, factor = start, arb.pi().sqrt() / 2
    for _ in range(ctx.cap - 1 if len(a) > 1 else 0):
        w = start + ((w * w).exp() * a.derivative() * factor).integral()
    return w


def _still(op: str) -> Callable[..., arb_series]:
    """An operation that is only known of constants."""

    def apply(*args: arb_series) -> arb_series:
        if any(len(a) > 1 for a in args):
            return arb_series([arb.nan()])
        return arb_series([OPERATIONS[op](*(a[0] for a in args))])

    return apply


_APPLY: dict[str, Callable[..., Any]] = {
    **COMMON,
    "pow": OPERATIONS["pow"],
    **{
        op: getattr(arb_series, op)
        for op in ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "erf")
    },
    **{op: _still(op) for op in ("fabs", "fmin", "fmax")},
    "sq": lambda a: a * a,
    "inv": lambda a: _one() / a,
    "sinh": lambda a: (a.exp() - (-a).exp()) / 2,
    "cosh": lambda a: (a.exp() + (-a).exp()) / 2,
    "tanh": lambda a: _one() - 2 / ((2 * a).exp() + 1),
    "asinh": lambda a: (a + (a * a + 1).sqrt()).log(),
    "acosh": lambda a: (a + (a * a - 1).sqrt()).log(),
    "atanh": lambda a: ((1 + a) / (1 - a)).log() / 2,
    "expm1": lambda a: a.exp() - 1,
    "log1p": lambda a: (1 + a).log(),
    "hypot": lambda a, b: (a * a + b * b).sqrt(),
    "atan2": _atan2,
    "erfinv": _erfinv,
    "pi": lambda: arb_series([arb.pi()]),
}


class Series(Arithmetic):
    """The arithmetic of power series."""

    power = staticmethod(_power)

    def constant(self, value: float | Fraction) -> arb_series:
        return arb_series([Enclosures((), self.numbers).constant(value)])

    def apply(self, op: str, args: Sequence[arb_series]) -> arb_series:
        """Enclose an operation's series; no coefficient is known where the value is not."""
        if all(a[0].is_finite() for a in args):
            try:
                found = _APPLY[op](*args)
            except (ValueError, ZeroDivisionError):  # a denominator or radicand that may be zero
                return _unknown()
            if found[0].is_finite():
                return found
        return _unknown()


def coefficients(
    field: Program, x: Sequence[arb], p: Sequence[arb], count: int, numbers: Numbers
) -> list[list[arb]]:
    """The first ``count`` Taylor coefficients of x' = field(x, p) from points x."""
    with length(count):
        start = [arb_series([v]) for v in x]
        still = [arb_series([v]) for v in p]
    now = start
    for k in range(1, count):
        with length(k):
            (rates,) = field(Series([now, still], numbers))
        with length(k + 1):
            now = [v + f.integral() for v, f in zip(start, rates, strict=True)]
    return [listed(v, count) for v in now]


def along(
    program: Program, x: Sequence[Sequence[arb]], p: Sequence[arb], numbers: Numbers
) -> list[list[list[arb]]]:
    """Coefficients of a program's rows along a motion whose coefficients are known."""
    count = len(x[0])
    with length(count):
        moving = [arb_series(list(c)) for c in x]
        still = [arb_series([v]) for v in p]
        rows = program(Series([moving, still], numbers))
        return [[listed(v, count) for v in row] for row in rows]


def listed(series: arb_series, count: int) -> list[arb]:
    """The first coefficients of a series."""
    return [series[k] for k in range(count)]


def horner(c: Sequence[Any], t: arb) -> Any:
    """Value of a polynomial at a time or over an interval of times."""
    result = c[-1]
    for a in reversed(c[:-1]):
        result = result * t + a
    return result
