"""Random smooth expressions, and their exact values at points by mpmath."""

import casadi as ca
import mpmath
import numpy as np

from nonsmooth.model.expressions.graph import instructions

UNARY = (
    *("neg", "sq", "twice", "sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan"),
    *("sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "erf", "expm1", "log1p", "inv"),
)
BINARY = ("add", "sub", "mul", "div", "atan2", "hypot", "pow")
_MPMATH = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "twice": lambda a: 2 * a,
    "sq": lambda a: a * a,
    "inv": lambda a: 1 / a,
    "pow": lambda a, b: a**b,
    "constpow": lambda a, b: a**b,
    "fabs": abs,
    "assign": lambda a: a,
}


class Undefined(ArithmeticError):
    """A point outside the domain of an expression."""


class Exact:
    """The algebra of mpmath's numbers."""

    def __init__(self, point):
        self.point = point

    def constant(self, value):
        return mpmath.mpf(value)

    def symbol(self, vector, position):
        return self.point[position]

    def power(self, a, n):
        return a**n

    def apply(self, op, args):
        try:
            value = mpmath.pi() if op == "pi" else (_MPMATH.get(op) or getattr(mpmath, op))(*args)
        except (ZeroDivisionError, ValueError, OverflowError) as error:
            raise Undefined from error
        if isinstance(value, mpmath.mpc) or not mpmath.isfinite(value) or abs(value) > 1e6:
            raise Undefined
        return value


def expression(rng, symbols, size=8):
    """A random expression that CasADi did not fold to a constant, an infinite one least of all."""
    while True:
        f = _expression(rng, symbols, size)
        nodes, _ = instructions([ca.vertcat(*symbols)], [f])
        finite = all(np.isfinite(n.payload) for n in nodes if n.op == "const")
        finite = finite and all(n.op != "fabs" for n in nodes)  # of sqrt(e**2): a kink
        if finite and ca.depends_on(f, ca.vertcat(*symbols)):
            return f


def _expression(rng, symbols, size):
    pool = [*symbols, ca.SX(0.1), ca.SX(1.5), ca.SX(float(rng.normal()))]
    for _ in range(size):
        a, b = (pool[int(k)] for k in rng.integers(0, len(pool), 2))
        if rng.random() < 0.4:
            op = UNARY[int(rng.integers(len(UNARY)))]
            pool.append(ca.SX.unary(getattr(ca, "OP_" + op.upper()), a))
        elif rng.random() < 0.15:
            pool.append(a ** int(rng.integers(-3, 6)))
        else:
            op = BINARY[int(rng.integers(len(BINARY)))]
            pool.append(ca.SX.binary(getattr(ca, "OP_" + op.upper()), a, b))
    return pool[-1]
