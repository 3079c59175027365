"""Jets: exact Taylor coefficients in time of a flow and of functions along it.

The solution of x' = f(x) is expanded order by order: from the coefficients 0..k of x follow those
of f(x), and x_{k+1} = f_k/(k+1). Each operation of the graph has one recurrence, below, the only
place in the library that knows how to differentiate along a flow. The recurrences act on CasADi
scalars, so a jet is itself a CasADi expression: it is evaluated by CasADi's virtual machine in the
reference driver and printed as C by the compiled engine. Structural zeros (constants, polynomials)
disappear on the way.

Sources: Moore 1966; Jorba & Zou 2005, "A software package for the numerical integration of ODEs by
means of high-order Taylor methods", Prop. 2.1. Declined: repeated CasADi ``jtimes`` (exponential
growth of the expression with the order) and finite differences (not exact).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import casadi as ca

from .economy import economise
from .errors import NotSmoothError
from .graph import Node, depends_on, instructions

Coefficient: TypeAlias = "ca.SX | None"  # None is a structural zero


def taylor(
    rhs: ca.SX, functions: ca.SX, states: ca.SX, others: ca.SX, order: int
) -> tuple[ca.SX, ca.SX]:
    """Taylor coefficients of the flow of ``rhs`` and of ``functions`` along it.

    Parameters
    ----------
    rhs : SX (n,)
        Right-hand side in ``states`` and ``others``.
    functions : SX (m,)
        Functions of the same symbols, may be empty.
    states, others : SX
        Symbol vectors; ``others`` (parameters) do not move.
    order : int
        Highest order of the state's coefficients.

    Returns
    -------
    states_jet : SX (n, order + 1)
    functions_jet : SX (m, order + 1)

    Examples
    --------
    >>> x, p = ca.SX.sym("x"), ca.SX.sym("p", 0)
    >>> jet = taylor(x, x**2, x, p, 2)[1]  # (x e^t)^2 = x^2 (1 + 2 t + 2 t^2 + ...)
    >>> ca.Function("jet", [x, p], [jet])(3.0, [])
    DM([[9, 18, 18]])
    """
    n, m = rhs.numel(), functions.numel()
    expansion = _Expansion(states, others, [rhs, functions])
    jet: list[list[Coefficient]] = [[states[i]] for i in range(n)]
    values: list[list[Coefficient]] = [[] for _ in range(m)]
    for k in range(order + 1):
        field, outputs = expansion.advance(k, [c[k] for c in jet])
        for j in range(m):
            values[j].append(outputs[j])
        if k < order:
            for i in range(n):
                jet[i].append(_scale(field[i], 1.0 / (k + 1)))
    return _matrix(jet, n, order + 1), _matrix(values, m, order + 1)


def _matrix(rows: Sequence[Sequence[Coefficient]], n: int, width: int) -> ca.SX:
    result = ca.SX.zeros(n, width)
    for i, row in enumerate(rows):
        for k, c in enumerate(row):
            if c is not None:
                result[i, k] = c
    return result


# Coefficients with structural zeros ------------------------------------------------------------


def _clean(a: ca.SX) -> Coefficient:
    return None if a.is_zero() else a


def _scale(a: Coefficient, factor: float) -> Coefficient:
    return None if a is None else (a if factor == 1.0 else _clean(factor * a))


def _add(a: Coefficient, b: Coefficient) -> Coefficient:
    return b if a is None else (a if b is None else _clean(a + b))


def _sub(a: Coefficient, b: Coefficient) -> Coefficient:
    if b is None:
        return a
    return _clean(-b) if a is None else _clean(a - b)


def _mul(a: Coefficient, b: Coefficient) -> Coefficient:
    return None if a is None or b is None else _clean(a * b)


def _div(a: Coefficient, b: Coefficient) -> Coefficient:
    return None if a is None else a / (ca.SX(0) if b is None else b)


def _value(a: Coefficient) -> ca.SX:
    return ca.SX(0) if a is None else a


def _sum(terms: Sequence[Coefficient]) -> Coefficient:
    total: Coefficient = None
    for term in terms:
        total = _add(total, term)
    return total


# The recurrences -------------------------------------------------------------------------------


class _Series:
    """Coefficients of one node, appended one order at a time."""

    def __init__(self, recurrence: Callable[[int], Coefficient]):
        self.c: list[Coefficient] = []
        self.recurrence = recurrence

    def advance(self, k: int) -> None:
        self.c.append(self.recurrence(k))


class _Expansion:
    """All nodes of a graph, expanded together."""

    def __init__(self, states: ca.SX, others: ca.SX, outputs: Sequence[ca.SX]):
        self._inputs = [states, others]
        cheaper = economise(self._inputs, outputs, [True, False])
        self._nodes, self._rows = instructions(self._inputs, cheaper)
        self._moving = depends_on(self._nodes, [True, False])
        self._series: list[_Series] = []  # in the order in which they advance
        self._states: list[Coefficient] = []
        self._node: list[_Series] = []
        for j, node in enumerate(self._nodes):
            self._node.append(self._expand(node, self._moving[j]))

    def advance(
        self, k: int, states: Sequence[Coefficient]
    ) -> tuple[list[Coefficient], list[Coefficient]]:
        """Expand every node to order k, given coefficient k of the states."""
        self._states = list(states)
        for series in self._series:
            series.advance(k)
        field, functions = ([self._node[j].c[k] for j in row] for row in self._rows)
        return field, functions

    def _new(self, recurrence: Callable[[int], Coefficient]) -> _Series:
        series = _Series(recurrence)
        self._series.append(series)
        return series

    def _expand(self, node: Node, moving: bool) -> _Series:
        args = [self._node[a] for a in node.args]
        if node.op == "const":
            value = None if node.payload == 0 else ca.SX(node.payload)
            return self._new(lambda k: value if k == 0 else None)
        if node.op == "input":
            vector, position = node.place
            if vector == 0:
                return self._new(lambda k: self._states[position])
            symbol = self._inputs[vector][position]
            return self._new(lambda k: symbol if k == 0 else None)
        if not moving:
            return self._new(lambda k: _apply(node.op, args) if k == 0 else None)
        if node.op in ("pow", "constpow"):
            return self._power(args[0], args[1], self._nodes[node.args[1]], node.args[1])
        rule = getattr(self, "_" + node.op, None)
        if rule is None:
            raise NotSmoothError(
                f"CasADi's operation {node.op!r}: expected one with a Taylor recurrence (arithmetic, "
                "powers, sqrt, exp, log, trigonometric and hyperbolic functions and their inverses, "
                "atan2, erf), received another. Write it with these."
            )
        return rule(*args)

    # linear
    def _assign(self, u: _Series) -> _Series:
        return u

    def _add(self, u: _Series, v: _Series) -> _Series:
        return self._new(lambda k: _add(u.c[k], v.c[k]))

    def _sub(self, u: _Series, v: _Series) -> _Series:
        return self._new(lambda k: _sub(u.c[k], v.c[k]))

    def _neg(self, u: _Series) -> _Series:
        return self._new(lambda k: _sub(None, u.c[k]))

    def _twice(self, u: _Series) -> _Series:
        return self._new(lambda k: _add(u.c[k], u.c[k]))

    # products and quotients
    def _mul(self, u: _Series, v: _Series) -> _Series:
        return self._new(lambda k: _sum([_mul(u.c[i], v.c[k - i]) for i in range(k + 1)]))

    def _sq(self, u: _Series) -> _Series:
        def square(k: int) -> Coefficient:
            half = _sum([_mul(u.c[i], u.c[k - i]) for i in range((k + 1) // 2)])
            middle = None if k % 2 else _mul(u.c[k // 2], u.c[k // 2])
            return _add(_scale(half, 2.0), middle)

        return self._new(square)

    def _div(self, u: _Series, v: _Series) -> _Series:
        def quotient(k: int) -> Coefficient:
            known = _sum([_mul(w.c[i], v.c[k - i]) for i in range(k)])
            return _div(_sub(u.c[k], known), v.c[0])

        w = self._new(quotient)
        return w

    def _inv(self, v: _Series) -> _Series:
        return self._div(self._constant(1.0), v)

    def _sqrt(self, u: _Series) -> _Series:
        def root(k: int) -> Coefficient:
            if k == 0:
                return _apply("sqrt", [u])
            known = _sum([_mul(w.c[i], w.c[k - i]) for i in range(1, k)])
            return _div(_scale(_sub(u.c[k], known), 0.5), w.c[0])

        w = self._new(root)
        return w

    def _power(self, u: _Series, v: _Series, exponent: Node, number: int) -> _Series:
        """u^v; natural powers by squaring, so that u = 0 is a regular point."""
        if self._moving[number]:
            return self._exp(self._mul(v, self._log(u)))
        a = float(exponent.payload) if exponent.op == "const" else 0.5  # type: ignore[arg-type]
        if a.is_integer() and 0 < abs(a) <= 64:
            power = self._natural_power(u, int(abs(a)))
            return power if a > 0 else self._inv(power)

        def general(k: int) -> Coefficient:
            if k == 0:
                return _apply("pow", [u, v])
            a = _value(v.c[0])
            terms = [_mul(_clean(a * (k - j) - j), _mul(u.c[k - j], w.c[j])) for j in range(k)]
            return _scale(_div(_sum(terms), u.c[0]), 1.0 / k)

        w = self._new(general)
        return w

    def _natural_power(self, u: _Series, n: int) -> _Series:
        result: _Series | None = None
        while True:
            if n & 1:
                result = u if result is None else self._mul(result, u)
            n >>= 1
            if not n:
                assert result is not None
                return result
            u = self._sq(u)

    def _hypot(self, u: _Series, v: _Series) -> _Series:
        return self._sqrt(self._add(self._sq(u), self._sq(v)))

    # integrals: w' = g u' and w' = u'/g
    def _constant(self, value: float) -> _Series:
        return self._new(lambda k: ca.SX(value) if k == 0 else None)

    def _affine(self, u: _Series, offset: float, factor: float = 1.0) -> _Series:
        """Offset + factor*u."""
        return self._new(lambda k: _add(ca.SX(offset) if k == 0 else None, _scale(u.c[k], factor)))

    def _integral(self, op: str, u: _Series, factor: list[_Series], sign: float = 1.0) -> _Series:
        """w = op(u) with w' = sign*g*u'; the caller puts g, which may need w, into ``factor``."""

        def recurrence(k: int) -> Coefficient:
            if k == 0:
                return _apply(op, [u])
            g = factor[0]
            terms = [_scale(_mul(u.c[j], g.c[k - j]), float(j)) for j in range(1, k + 1)]
            return _scale(_sum(terms), sign / k)

        return self._new(recurrence)

    def _quotient(self, op: str, u: _Series, g: _Series, sign: float = 1.0) -> _Series:
        """w = op(u) with w' = sign*u'/g."""

        def recurrence(k: int) -> Coefficient:
            if k == 0:
                return _apply(op, [u])
            known = [_scale(_mul(w.c[j], g.c[k - j]), float(j)) for j in range(1, k)]
            top = _sub(_scale(u.c[k], sign * k), _sum(known))
            return _scale(_div(top, g.c[0]), 1.0 / k)

        w = self._new(recurrence)
        return w

    def _exp(self, u: _Series) -> _Series:
        factor: list[_Series] = []
        factor.append(self._integral("exp", u, factor))
        return factor[0]

    def _expm1(self, u: _Series) -> _Series:
        factor: list[_Series] = []
        w = self._integral("expm1", u, factor)
        factor.append(self._affine(w, 1.0))
        return w

    def _log(self, u: _Series) -> _Series:
        return self._quotient("log", u, u)

    def _log1p(self, u: _Series) -> _Series:
        return self._quotient("log1p", u, self._affine(u, 1.0))

    def _pair(self, one: str, other: str, u: _Series, signs: tuple[float, float]) -> _Series:
        of_one: list[_Series] = []
        of_other: list[_Series] = []
        of_other.append(self._integral(one, u, of_one, signs[0]))
        of_one.append(self._integral(other, u, of_other, signs[1]))
        return of_other[0]

    def _sin(self, u: _Series) -> _Series:
        return self._pair("sin", "cos", u, (1.0, -1.0))

    def _cos(self, u: _Series) -> _Series:
        return self._pair("cos", "sin", u, (-1.0, 1.0))

    def _sinh(self, u: _Series) -> _Series:
        return self._pair("sinh", "cosh", u, (1.0, 1.0))

    def _cosh(self, u: _Series) -> _Series:
        return self._pair("cosh", "sinh", u, (1.0, 1.0))

    def _tan(self, u: _Series) -> _Series:
        factor: list[_Series] = []
        w = self._integral("tan", u, factor)
        factor.append(self._affine(self._sq(w), 1.0))
        return w

    def _tanh(self, u: _Series) -> _Series:
        factor: list[_Series] = []
        w = self._integral("tanh", u, factor)
        factor.append(self._affine(self._sq(w), 1.0, -1.0))
        return w

    def _erf(self, u: _Series) -> _Series:
        bell = self._exp(self._neg(self._sq(u)))
        return self._integral("erf", u, [bell], 2.0 / math.sqrt(math.pi))

    def _erfinv(self, u: _Series) -> _Series:
        factor: list[_Series] = []
        w = self._integral("erfinv", u, factor, math.sqrt(math.pi) / 2.0)
        factor.append(self._exp(self._sq(w)))
        return w

    def _asin(self, u: _Series) -> _Series:
        return self._quotient("asin", u, self._sqrt(self._affine(self._sq(u), 1.0, -1.0)))

    def _acos(self, u: _Series) -> _Series:
        return self._quotient("acos", u, self._sqrt(self._affine(self._sq(u), 1.0, -1.0)), -1.0)

    def _atan(self, u: _Series) -> _Series:
        return self._quotient("atan", u, self._affine(self._sq(u), 1.0))

    def _asinh(self, u: _Series) -> _Series:
        return self._quotient("asinh", u, self._sqrt(self._affine(self._sq(u), 1.0)))

    def _acosh(self, u: _Series) -> _Series:
        return self._quotient("acosh", u, self._sqrt(self._affine(self._sq(u), -1.0)))

    def _atanh(self, u: _Series) -> _Series:
        return self._quotient("atanh", u, self._affine(self._sq(u), 1.0, -1.0))

    def _atan2(self, y: _Series, x: _Series) -> _Series:
        radius = self._add(self._sq(x), self._sq(y))

        def recurrence(k: int) -> Coefficient:
            if k == 0:
                return _apply("atan2", [y, x])
            turn = [
                _sub(
                    _scale(_mul(x.c[k - j], y.c[j]), float(j)),
                    _scale(_mul(y.c[k - j], x.c[j]), float(j)),
                )
                for j in range(1, k + 1)
            ]
            known = [_scale(_mul(w.c[j], radius.c[k - j]), float(j)) for j in range(1, k)]
            return _scale(_div(_sub(_sum(turn), _sum(known)), radius.c[0]), 1.0 / k)

        w = self._new(recurrence)
        return w


def _apply(op: str, args: Sequence[_Series]) -> ca.SX:
    """Evaluate an operation at order zero."""
    code = getattr(ca, "OP_" + op.upper())
    values = [_value(a.c[0]) for a in args]
    if len(values) == 1:
        return ca.SX.unary(code, values[0])
    return ca.SX.binary(code, values[0], values[1])
