"""Operations of doubles in Python, by the names that CasADi gives them."""

from __future__ import annotations

import math
from collections.abc import Callable


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
