"""Power series of recorded instructions along a motion, with a derivative along another direction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from intervals import PI, CheckError, Iv, atan, cos, erf, exp, log, sin, sqrt, whole

Coefficients = list[Iv]
ZERO, ONE_ = whole(0), whole(1)


def plus(a: Coefficients, b: Coefficients) -> Coefficients:
    return [x + y for x, y in zip(a, b, strict=True)]


def minus(a: Coefficients, b: Coefficients) -> Coefficients:
    return [x - y for x, y in zip(a, b, strict=True)]


def times(a: Coefficients, b: Coefficients) -> Coefficients:
    result = []
    for k in range(len(a)):
        total = ZERO
        for i in range(k + 1):
            if not (a[i].zero or b[k - i].zero):
                total = total + a[i] * b[k - i]
        result.append(total)
    return result


def over(a: Coefficients, b: Coefficients) -> Coefficients:
    result: Coefficients = []
    for k in range(len(a)):
        total = a[k]
        for i in range(k):
            total = total - result[i] * b[k - i]
        result.append(total / b[0])
    return result


def scaled(a: Coefficients, n: int) -> Coefficients:
    return [x * whole(n) for x in a]


def constant(v: Iv, count: int) -> Coefficients:
    return [v] + [ZERO] * (count - 1)


def integral(a: Coefficients, slope: Coefficients, first: Iv) -> Coefficients:
    """The series that begins with ``first`` and has the rate a' slope."""
    rate = times([a[k + 1] * whole(k + 1) for k in range(len(a) - 1)] + [ZERO], slope)
    return [first] + [rate[k] / whole(k + 1) for k in range(len(a) - 1)]


def root(a: Coefficients) -> Coefficients:
    w = [sqrt(a[0])]
    for k in range(1, len(a)):
        total = a[k]
        for i in range(1, k):
            total = total - w[i] * w[k - i]
        w.append(total / (w[0] + w[0]))
    return w


def exponential(a: Coefficients) -> Coefficients:
    w = [exp(a[0])]
    for k in range(1, len(a)):
        total = ZERO
        for i in range(1, k + 1):
            total = total + a[i] * whole(i) * w[k - i]
        w.append(total / whole(k))
    return w


def circular(a: Coefficients) -> tuple[Coefficients, Coefficients]:
    """Sine and cosine."""
    s, c = [sin(a[0])], [cos(a[0])]
    for k in range(1, len(a)):
        p, q = ZERO, ZERO
        for i in range(1, k + 1):
            p = p + a[i] * whole(i) * c[k - i]
            q = q - a[i] * whole(i) * s[k - i]
        s.append(p / whole(k))
        c.append(q / whole(k))
    return s, c


def _one(a: Coefficients) -> Coefficients:
    return constant(ONE_, len(a))


def _inverse(a: Coefficients) -> Coefficients:
    return over(_one(a), a)


def _sinh(a: Coefficients) -> tuple[Coefficients, Coefficients]:
    p, m = exponential(a), exponential([-v for v in a])
    half = lambda v: [x / whole(2) for x in v]
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
    return [v * (whole(2) / sqrt(PI)) for v in exponential([-v for v in times(a, a)])]


#: Functions of one variable: series of the value and of the derivative.
FUNCTIONS: dict[str, Callable[[Coefficients], tuple[Coefficients, Coefficients]]] = {
    "exp": lambda a: _pair(exponential(a)),
    "expm1": lambda a: (minus(exponential(a), _one(a)), exponential(a)),
    "log": _of(log, _inverse),
    "log1p": _of(lambda v: log(v + ONE_), lambda a: _inverse(plus(a, _one(a)))),
    "sqrt": lambda a: (root(a), over(_one(a), scaled(root(a), 2))),
    "sq": lambda a: (_squared(a), scaled(a, 2)),
    "inv": lambda a: (_inverse(a), [-v for v in times(_inverse(a), _inverse(a))]),
    "sin": lambda a: circular(a),
    "cos": lambda a: (circular(a)[1], [-v for v in circular(a)[0]]),
    "tan": _tan,
    "atan": _of(atan, lambda a: _inverse(plus(_one(a), times(a, a)))),
    "asin": _of(_asin, lambda a: _inverse(root(minus(_one(a), times(a, a))))),
    "acos": _of(
        lambda v: PI / whole(2) - _asin(v),
        lambda a: [-v for v in _inverse(root(minus(_one(a), times(a, a))))],
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
    return [a[0].sq(), *w[1:]]


class Dual:
    """A series and its derivative along a direction; None where there is none."""

    __slots__ = ("d", "v")

    def __init__(self, v: Coefficients, d: Coefficients | None = None):
        self.v, self.d = v, d


def _linear(a: Dual, b: Dual, combine: Callable[..., Coefficients]) -> Dual:
    zero = [ZERO] * len(a.v)
    d = None if a.d is None and b.d is None else combine(a.d or zero, b.d or zero)
    return Dual(combine(a.v, b.v), d)


def _times(a: Dual, b: Dual) -> Dual:
    d = None
    for x, y in ((a, b), (b, a)):
        if y.d is not None:
            term = times(x.v, y.d)
            d = term if d is None else plus(d, term)
    return Dual(times(a.v, b.v), d)


def _apply(op: str, args: list[Dual], count: int) -> Dual:
    if op == "pi":
        return Dual(constant(PI, count))
    a = args[0]
    if op in ("add", "sub"):
        return _linear(a, args[1], plus if op == "add" else minus)
    if op == "mul":
        return _times(a, args[1])
    if op == "div":
        return (
            _times(a, _apply("inv", [args[1]], count))
            if args[1].d
            else Dual(over(a.v, args[1].v), None if a.d is None else over(a.d, args[1].v))
        )
    if op in ("neg", "twice"):
        n = -1 if op == "neg" else 2
        return Dual(scaled(a.v, n), None if a.d is None else scaled(a.d, n))
    if op == "pow":
        return _apply("exp", [_times(args[1], _apply("log", [a], count))], count)
    if op == "hypot":
        squares = [_apply("sq", [v], count) for v in args]
        return _apply("sqrt", [_linear(*squares, plus)], count)
    if op == "atan2":
        return _atan2(a, args[1], count)
    if op not in FUNCTIONS:
        raise CheckError(f"the operation {op!r} is not known to this checker")
    v, slope = FUNCTIONS[op](a.v)
    return Dual(v, None if a.d is None else times(slope, a.d))


def _atan2(y: Dual, x: Dual, count: int) -> Dual:
    if x.v[0].sign() > 0:
        return _apply("atan", [_apply("div", [y, x], count)], count)
    if not y.v[0].sign():
        raise CheckError("atan2 may jump")
    quarter = Dual(constant(PI / whole(2 * y.v[0].sign()), count))
    return _linear(quarter, _apply("atan", [_apply("div", [x, y], count)], count), minus)


def evaluate(graph: dict[str, Any], inputs: list[list[Dual]], count: int) -> list[Dual]:
    """Series of all nodes, where each vector of inputs has so many coefficients."""
    values: list[Dual] = []
    for op, *rest in graph["nodes"]:
        if op == "const":
            values.append(Dual(constant(Iv.of(rest[0]), count)))
        elif op == "input":
            values.append(inputs[rest[0]][rest[1]])
        elif op == "power":
            result = values[rest[0]]
            for _ in range(rest[1] - 1):
                result = _times(result, values[rest[0]])
            values.append(result)
        else:
            values.append(_apply(op, [values[k] for k in rest], count))
    return values


def motion(
    rates: Callable[[list[Coefficients]], list[Coefficients]], x: list[Iv], count: int
) -> list[Coefficients]:
    """The first coefficients of x' = rates(x), one order after another."""
    c = [[v] for v in x]
    for k in range(1, count):
        f = rates(c)
        c = [[*a, b[k - 1] / whole(k)] for a, b in zip(c, f, strict=True)]
    return c


def along_field(
    graph: dict[str, Any], field: list[int], node: int, x: list[Iv], p: list[Iv]
) -> Coefficients:
    """The first four coefficients of a node along the motion of a field."""

    def at(c: list[Coefficients]) -> list[Dual]:
        n = len(c[0])
        still = [Dual(constant(v, n)) for v in p]
        return evaluate(graph, [[Dual(v) for v in c], still, []], n)

    c = motion(lambda c: [at(c)[k].v for k in field], x, 4)
    return at(c)[node].v
