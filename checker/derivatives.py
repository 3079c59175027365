"""Values, gradients and Hessians of recorded instructions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from intervals import PI, CheckError, Iv, atan, cos, erf, exp, log, power, sin, sqrt, whole

# f, f' and f'' of functions of one variable, as functions of x and w = f(x).
_1, _2 = whole(1), whole(2)
FUNCTIONS: dict[str, Callable[[Iv], tuple[Iv, Iv, Iv]]] = {
    "exp": lambda x: (exp(x),) * 3,
    "expm1": lambda x: (exp(x) - _1, exp(x), exp(x)),
    "log": lambda x: (log(x), _1 / x, -(_1 / x).sq()),
    "log1p": lambda x: (log(x + _1), _1 / (x + _1), -(_1 / (x + _1)).sq()),
    "sqrt": lambda x: _root(x),
    "sq": lambda x: (x.sq(), _2 * x, _2),
    "inv": lambda x: (_1 / x, -(_1 / x.sq()), _2 / (x * x.sq())),
    "sin": lambda x: (sin(x), cos(x), -sin(x)),
    "cos": lambda x: (cos(x), -sin(x), -cos(x)),
    "tan": lambda x: _tangent(sin(x) / cos(x), 1),
    "atan": lambda x: _atan(x),
    "asin": lambda x: _asin(x),
    "acos": lambda x: _acos(x),
    "sinh": lambda x: _hyperbolic(x, 1),
    "cosh": lambda x: _hyperbolic(x, -1),
    "tanh": lambda x: _tangent(_1 - _2 / (exp(_2 * x) + _1), -1),
    "asinh": lambda x: _area(x, _1),
    "acosh": lambda x: _area(x, -_1),
    "atanh": lambda x: (
        log((_1 + x) / (_1 - x)) / _2,
        _1 / (_1 - x.sq()),
        _2 * x / (_1 - x.sq()).sq(),
    ),
    "erf": lambda x: _erf(x),
}


def _root(x: Iv) -> tuple[Iv, Iv, Iv]:
    w = sqrt(x)
    d = _1 / (_2 * w)
    return w, d, -(d / (_2 * x))


def _tangent(w: Iv, sign: int) -> tuple[Iv, Iv, Iv]:
    d = _1 + whole(sign) * w.sq()
    return w, d, whole(2 * sign) * w * d


def _atan(x: Iv) -> tuple[Iv, Iv, Iv]:
    d = _1 / (_1 + x.sq())
    return atan(x), d, -(_2 * x * d.sq())


def _asin(x: Iv) -> tuple[Iv, Iv, Iv]:
    d = _1 / sqrt(_1 - x.sq())
    return atan(x * d), d, x * d * d.sq()


def _acos(x: Iv) -> tuple[Iv, Iv, Iv]:
    w, d, e = _asin(x)
    return PI / _2 - w, -d, -e


def _hyperbolic(x: Iv, sign: int) -> tuple[Iv, Iv, Iv]:
    s, c = (exp(x) - exp(-x)) / _2, (exp(x) + exp(-x)) / _2
    return (s, c, s) if sign > 0 else (c, s, c)


def _area(x: Iv, one: Iv) -> tuple[Iv, Iv, Iv]:
    d = _1 / sqrt(x.sq() + one)
    return log(x + sqrt(x.sq() + one)), d, -(x * d * d.sq())


def _erf(x: Iv) -> tuple[Iv, Iv, Iv]:
    d = _2 / sqrt(PI) * exp(-x.sq())
    return erf(x), d, -(_2 * x * d)


# Values, gradients and Hessians ------------------------------------------------------------------


class D:
    """A value with gradient and Hessian; both empty for constants."""

    __slots__ = ("H", "g", "v")

    def __init__(self, v: Iv, g: list[Iv] | None = None, H: list[list[Iv]] | None = None):
        self.v, self.g, self.H = v, g or [], H or []


def linear(a: D, b: D, sign: int) -> D:
    v = a.v + b.v if sign > 0 else a.v - b.v
    if not b.g:
        return D(v, a.g, a.H)
    if not a.g:
        s = [x if sign > 0 else -x for x in b.g]
        return D(v, s, [[x if sign > 0 else -x for x in row] for row in b.H])
    plus = (lambda p, q: p + q) if sign > 0 else (lambda p, q: p - q)
    g = [plus(p, q) for p, q in zip(a.g, b.g, strict=True)]
    H = [[plus(p, q) for p, q in zip(r, s, strict=True)] for r, s in zip(a.H, b.H, strict=True)]
    return D(v, g, H)


def product(a: D, b: D) -> D:
    if not a.g and not b.g:
        return D(a.v * b.v)
    if not a.g:
        a, b = b, a
    if not b.g:
        return D(a.v * b.v, [x * b.v for x in a.g], [[x * b.v for x in r] for r in a.H])
    n = range(len(a.g))
    H = [
        [a.v * b.H[i][j] + b.v * a.H[i][j] + a.g[i] * b.g[j] + b.g[i] * a.g[j] for j in n]
        for i in n
    ]
    return D(a.v * b.v, [a.v * b.g[i] + b.v * a.g[i] for i in n], H)


def chain(f: tuple[Iv, Iv, Iv], a: D) -> D:
    v, d, e = f
    n = range(len(a.g))
    H = [[d * a.H[i][j] + e * a.g[i] * a.g[j] for j in n] for i in n]
    return D(v, [d * x for x in a.g], H)


def apply(op: str, args: list[D]) -> D:
    a = args[0] if args else D(PI)
    if op in ("add", "sub"):
        return linear(a, args[1], 1 if op == "add" else -1)
    if op == "mul":
        return product(a, args[1])
    if op == "div":
        return product(a, apply("inv", [args[1]]))
    if op == "neg":
        return linear(D(whole(0)), a, -1)
    if op == "twice":
        return linear(a, a, 1)
    if op == "pow":
        return apply("exp", [product(args[1], apply("log", [a]))])
    if op == "hypot":
        return apply("sqrt", [linear(apply("sq", [a]), apply("sq", [args[1]]), 1)])
    if op == "pi":
        return a
    if op == "atan2":
        return _atan2(a, args[1])
    if op not in FUNCTIONS:
        raise CheckError(f"the operation {op!r} is not known to this checker")
    return chain(FUNCTIONS[op](a.v), a)


def _atan2(y: D, x: D) -> D:
    if x.v.sign() > 0:
        return apply("atan", [apply("div", [y, x])])
    if not y.v.sign():
        raise CheckError("atan2 may jump")
    quarter = D(PI / whole(2 * y.v.sign()))
    return linear(quarter, apply("atan", [apply("div", [x, y])]), -1)


def run(graph: dict[str, Any], *inputs: list[D]) -> list[D]:
    """Values of all nodes, for vectors of states, parameters, further unknowns, ..."""
    values: list[D] = []
    for op, *rest in graph["nodes"]:
        if op == "const":
            values.append(D(Iv.of(rest[0])))
        elif op == "input":
            values.append(inputs[rest[0]][rest[1]])
        elif op == "power":
            a, n = values[rest[0]], rest[1]
            f = (
                power(a.v, n),
                whole(n) * power(a.v, n - 1),
                whole(n * (n - 1)) * power(a.v, n - 2),
            )
            values.append(chain(f, a))
        else:
            values.append(apply(op, [values[k] for k in rest]))
    return values
