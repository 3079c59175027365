"""Power series of recorded instructions along a motion, with a derivative along another direction.

Coefficients are computed on first use, as a motion needs those of its rates one order after another.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from intervals import PI, CheckError, Iv, atan, cos, erf, exp, log, sin, sqrt, whole

ZERO, ONE_ = whole(0), whole(1)

# The recursion of coefficients is as deep as the graph.
sys.setrecursionlimit(100_000)


class Series:
    """Coefficients by a rule that gives the next one from those before it."""

    __slots__ = ("_known", "_rule")

    def __init__(self, rule: Callable[[list[Iv], int], Iv]):
        self._known: list[Iv] = []
        self._rule = rule

    def __getitem__(self, k: Any) -> Any:
        known = self._known
        try:
            return known[k]
        except IndexError:
            while len(known) <= k:
                known.append(self._rule(known, len(known)))
            return known[k]


class Constant(Series):
    """A series of one coefficient, which is computed on first use."""

    __slots__ = ()

    def __init__(self, first: Callable[[], Iv]):
        super().__init__(lambda _, k: ZERO if k else first())


#: A series, or as many of its coefficients as are needed.
Coefficients = Series | list[Iv]


def plus(a: Coefficients, b: Coefficients) -> Series:
    if type(a) is Constant and type(b) is Constant:
        return Constant(lambda: a[0] + b[0])
    return Series(lambda _, k: a[k] + b[k])


def minus(a: Coefficients, b: Coefficients) -> Series:
    if type(a) is Constant and type(b) is Constant:
        return Constant(lambda: a[0] - b[0])
    return Series(lambda _, k: a[k] - b[k])


def negative(a: Coefficients) -> Series:
    return Series(lambda _, k: -a[k])


def _convolved(a: Any, b: Any, k: int, first: int = 0, last: int | None = None) -> Iv:
    """Sum of a[i] b[k - i] for i from first to last."""
    total = ZERO
    for i in range(first, (k if last is None else last) + 1):
        p, q = a[i], b[k - i]
        if not (p.zero or q.zero):
            total = total + p * q
    return total


def times(a: Coefficients, b: Coefficients) -> Series:
    if type(b) is Constant:
        a, b = b, a
    if type(a) is Constant and type(b) is Constant:
        return Constant(lambda: a[0] * b[0])
    if type(a) is Constant:
        return Series(lambda _, k: b[k] if b[k].zero else b[k] * a[0])
    return Series(lambda _, k: _convolved(a, b, k))


def over(a: Coefficients, b: Coefficients) -> Series:
    if type(a) is Constant and type(b) is Constant:
        return Constant(lambda: a[0] / b[0])
    if type(b) is Constant:
        return Series(lambda _, k: a[k] if k and a[k].zero else a[k] / b[0])
    return Series(lambda w, k: (a[k] - _convolved(w, b, k, 0, k - 1)) / b[0])


def scaled(a: Coefficients, n: int) -> Series:
    return times(a, constant(whole(n)))


def constant(v: Iv) -> Series:
    return Constant(lambda: v)


def slope_of(a: Coefficients) -> Series:
    """Series of the derivative."""
    return Series(lambda _, k: a[k + 1] * whole(k + 1))


def integral(a: Coefficients, slope: Coefficients, first: Iv) -> Series:
    """The series that begins with ``first`` and has the rate a' slope."""
    rate = times(slope_of(a), slope)
    return Series(lambda _, k: rate[k - 1] / whole(k) if k else first)


def root(a: Coefficients) -> Series:
    def rule(w: list[Iv], k: int) -> Iv:
        if not k:
            return sqrt(a[0])
        return (a[k] - _convolved(w, w, k, 1, k - 1)) / (w[0] + w[0])

    return Series(rule)


def exponential(a: Coefficients) -> Series:
    rate = slope_of(a)

    def rule(w: list[Iv], k: int) -> Iv:
        return _convolved(rate, w, k - 1) / whole(k) if k else exp(a[0])

    return Series(rule)


def circular(a: Coefficients) -> tuple[Series, Series]:
    """Sine and cosine."""
    rate = slope_of(a)
    s = Series(lambda _, k: _convolved(rate, c, k - 1) / whole(k) if k else sin(a[0]))
    c = Series(lambda _, k: -_convolved(rate, s, k - 1) / whole(k) if k else cos(a[0]))
    return s, c


def _one(a: Coefficients) -> Coefficients:
    return constant(ONE_)


def _inverse(a: Coefficients) -> Coefficients:
    return over(_one(a), a)


def _sinh(a: Coefficients) -> tuple[Coefficients, Coefficients]:
    p, m = exponential(a), exponential(negative(a))
    half = lambda v: over(v, constant(whole(2)))
    return half(minus(p, m)), half(plus(p, m))


def _area(a: Coefficients, sign: int) -> tuple[Coefficients, Coefficients]:
    """asinh (1) or acosh (-1) with its derivative."""
    r = root(plus(times(a, a), scaled(_one(a), sign)))
    d = _inverse(r)
    return integral(a, d, log(a[0] + r[0])), d


def _of(value: Callable[[Iv], Iv], slope: Callable[[Coefficients], Coefficients]) -> Any:
    """A function known by its value and its derivative."""

    def apply(a: Coefficients) -> tuple[Coefficients, Coefficients]:
        d = slope(a)
        return integral(a, d, value(a[0])), d

    return apply


def _asin(v: Iv) -> Iv:
    return atan(v / sqrt(ONE_ - v.sq()))


def _tanh(a: Coefficients) -> tuple[Coefficients, Coefficients]:
    s, c = _sinh(a)
    w = over(s, c)
    return w, minus(_one(a), times(w, w))


def _tan(a: Coefficients) -> tuple[Coefficients, Coefficients]:
    s, c = circular(a)
    w = over(s, c)
    return w, plus(_one(a), times(w, w))


def _pair(w: Coefficients) -> tuple[Coefficients, Coefficients]:
    return w, w


def _bell(a: Coefficients) -> Coefficients:
    bell, factor = exponential(negative(times(a, a))), whole(2) / sqrt(PI)
    return Series(lambda _, k: bell[k] * factor)


#: Functions of one variable: series of the value and of the derivative.
FUNCTIONS: dict[str, Callable[[Coefficients], tuple[Coefficients, Coefficients]]] = {
    "exp": lambda a: _pair(exponential(a)),
    "expm1": lambda a: (minus(exponential(a), _one(a)), exponential(a)),
    "log": _of(log, _inverse),
    "log1p": _of(lambda v: log(v + ONE_), lambda a: _inverse(plus(a, _one(a)))),
    "sqrt": lambda a: (root(a), over(_one(a), scaled(root(a), 2))),
    "sq": lambda a: (_squared(a), scaled(a, 2)),
    "inv": lambda a: (_inverse(a), negative(times(_inverse(a), _inverse(a)))),
    "sin": lambda a: circular(a),
    "cos": lambda a: (circular(a)[1], negative(circular(a)[0])),
    "tan": _tan,
    "atan": _of(atan, lambda a: _inverse(plus(_one(a), times(a, a)))),
    "asin": _of(_asin, lambda a: _inverse(root(minus(_one(a), times(a, a))))),
    "acos": _of(
        lambda v: PI / whole(2) - _asin(v),
        lambda a: negative(_inverse(root(minus(_one(a), times(a, a))))),
    ),
    "sinh": lambda a: _sinh(a),
    "cosh": lambda a: (_sinh(a)[1], _sinh(a)[0]),
    "tanh": _tanh,
    "asinh": lambda a: _area(a, 1),
    "acosh": lambda a: _area(a, -1),
    "atanh": _of(
        lambda v: log((ONE_ + v) / (ONE_ - v)) / whole(2),
        lambda a: _inverse(minus(_one(a), times(a, a))),
    ),
    "erf": _of(erf, _bell),
}


def _squared(a: Coefficients) -> Coefficients:
    w = times(a, a)
    return Series(lambda _, k: w[k] if k else a[0].sq())


class Dual:
    """A series and its derivative along a direction; None where there is none."""

    __slots__ = ("d", "v")

    def __init__(self, v: Coefficients, d: Coefficients | None = None):
        self.v, self.d = v, d


def _linear(a: Dual, b: Dual, combine: Callable[..., Coefficients]) -> Dual:
    zero = constant(ZERO)
    known = [zero if d is None else d for d in (a.d, b.d)]
    d = None if a.d is None and b.d is None else combine(*known)
    return Dual(combine(a.v, b.v), d)


def _times(a: Dual, b: Dual) -> Dual:
    d = None
    for x, y in ((a, b), (b, a)):
        if y.d is not None:
            term = times(x.v, y.d)
            d = term if d is None else plus(d, term)
    return Dual(times(a.v, b.v), d)


def _apply(op: str, args: list[Dual]) -> Dual:
    if op == "pi":
        return Dual(constant(PI))
    a = args[0]
    if op in ("add", "sub"):
        return _linear(a, args[1], plus if op == "add" else minus)
    if op == "mul":
        return _times(a, args[1])
    if op == "div":
        return (
            _times(a, _apply("inv", [args[1]]))
            if args[1].d is not None
            else Dual(over(a.v, args[1].v), None if a.d is None else over(a.d, args[1].v))
        )
    if op in ("neg", "twice"):
        n = -1 if op == "neg" else 2
        return Dual(scaled(a.v, n), None if a.d is None else scaled(a.d, n))
    if op == "pow":
        return _apply("exp", [_times(args[1], _apply("log", [a]))])
    if op == "hypot":
        p, q = (_apply("sq", [v]) for v in args)
        return _apply("sqrt", [_linear(p, q, plus)])
    if op == "atan2":
        return _atan2(a, args[1])
    if op not in FUNCTIONS:
        raise CheckError(f"the operation {op!r} is not known to this checker")
    v, slope = FUNCTIONS[op](a.v)
    if type(a.v) is Constant and a.d is None:
        return Dual(Constant(lambda: v[0]))
    return Dual(v, None if a.d is None else times(slope, a.d))


def _atan2(y: Dual, x: Dual) -> Dual:
    if x.v[0].sign() > 0:
        return _apply("atan", [_apply("div", [y, x])])
    if not y.v[0].sign():
        raise CheckError("atan2 may jump")
    quarter = Dual(constant(PI / whole(2 * y.v[0].sign())))
    return _linear(quarter, _apply("atan", [_apply("div", [x, y])]), minus)


#: Constants of graphs, each read once.
_number = lru_cache(100_000)(Iv.of)


def evaluate(graph: dict[str, Any], inputs: list[list[Dual]]) -> list[Dual]:
    """Series of all nodes."""
    values: list[Dual] = []
    for op, *rest in graph["nodes"]:
        if op == "const":
            values.append(Dual(constant(_number(rest[0]))))
        elif op == "input":
            values.append(inputs[rest[0]][rest[1]])
        elif op == "power":
            result = values[rest[0]]
            for _ in range(rest[1] - 1):
                result = _times(result, values[rest[0]])
            values.append(result)
        else:
            values.append(_apply(op, [values[k] for k in rest]))
    return values


def motion(
    rates: Callable[[list[Coefficients]], list[Coefficients]], x: list[Iv], count: int
) -> list[Coefficients]:
    """The first coefficients of x' = rates(x), one order after another."""
    f: list[Coefficients] = []

    def state(i: int) -> Series:
        return Series(lambda _, k: f[i][k - 1] / whole(k) if k else x[i])

    c: list[Coefficients] = [state(i) for i in range(len(x))]
    f.extend(rates(c))
    return [[v[k] for k in range(count)] for v in c]


def along_field(
    graph: dict[str, Any], field: list[int], node: int, x: list[Iv], p: list[Iv]
) -> list[Iv]:
    """The first four coefficients of a node along the motion of a field."""
    still = [Dual(constant(v)) for v in p]

    def at(c: list[Coefficients]) -> list[Dual]:
        return evaluate(graph, [[Dual(v) for v in c], still, []])

    c = motion(lambda c: [at(c)[k].v for k in field], x, 4)
    return [at(c)[node].v[k] for k in range(4)]
