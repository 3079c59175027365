"""The arithmetic of doubles in Python, in which an undefined value is NaN and no error."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence


def _erfinv(y: float) -> float:
    """CasADi's erfinv, off by up to 2e-6 below zero, and two Newton steps."""
    import casadi as ca  # here: a build of the package has no CasADi

    w = float(ca.erfinv(y))
    for _ in range(2 if math.isfinite(w) else 0):
        w -= (math.erf(w) - y) * 0.5 * math.sqrt(math.pi) * math.exp(w * w)
    return w


#: Operations of one argument, as CasADi names them.
UNARY: dict[str, Callable[[float], float]] = {
    "assign": float,
    "neg": lambda a: -a,
    "twice": lambda a: a + a,
    "sq": lambda a: a * a,
    "inv": lambda a: 1.0 / a,
    "sign": lambda a: float((a > 0) - (a < 0)) if a == a else math.nan,
    "fabs": abs,
    "not": lambda a: float(not a),
    "floor": lambda a: float(math.floor(a)),
    "ceil": lambda a: float(math.ceil(a)),
    "erfinv": _erfinv,
    **{
        name: getattr(math, name)
        for name in "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh asinh acosh "
        "atanh erf".split()
    },
}

#: Operations of two arguments.
BINARY: dict[str, Callable[[float, float], float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "pow": math.pow,
    "constpow": math.pow,
    "atan2": math.atan2,
    "hypot": math.hypot,
    "fmin": lambda a, b: b if a != a else min(a, b),
    "fmax": lambda a, b: b if a != a else max(a, b),
    "fmod": math.fmod,
    "remainder": math.remainder,
    "copysign": math.copysign,
    "lt": lambda a, b: float(a < b),
    "le": lambda a, b: float(a <= b),
    "eq": lambda a, b: float(a == b),
    "ne": lambda a, b: float(a != b),
    "and": lambda a, b: float(bool(a and b)),
    "or": lambda a, b: float(bool(a or b)),
    "if_else_zero": lambda a, b: b if a else 0.0,
}


class Numbers:
    """Doubles as coefficients of series (see ``jets.Arithmetic``)."""

    def number(self, value: float) -> float | None:
        """Return a constant, None for 0."""
        return float(value) if value else None

    def clean(self, a: float) -> float | None:
        """Return None for 0."""
        return None if a == 0.0 else a

    def inner(self, u: Sequence[float | None], v: Sequence[float | None]) -> float | None:
        """Return the sum of products."""
        total = 0.0
        for a, b in zip(u, v, strict=True):
            if a is not None and b is not None:
                total += a * b
        return total or None

    def divide(self, a: float, b: float | None) -> float:
        """Return a quotient; infinite where the divisor is zero."""
        if b:
            return a / b
        return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a)

    def apply(self, op: str, args: Sequence[float | None]) -> float:
        """Return an operation of values, with 0 for None; NaN where it is undefined."""
        values = [0.0 if a is None else a for a in args]
        try:
            if len(values) == 1:
                return UNARY[op](values[0])
            return BINARY[op](values[0], values[1])
        except (OverflowError, ZeroDivisionError, ValueError):  # infinite or undefined
            import casadi as ca

            code, given = getattr(ca, "OP_" + op.upper()), map(ca.DM, values)
            return float((ca.DM.unary if len(values) == 1 else ca.DM.binary)(code, *given))
