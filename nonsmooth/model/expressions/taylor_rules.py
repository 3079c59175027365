"""Graphs as lists of Taylor rules, by which each operation is expanded in a power series.

Most operations need one rule. Others need further series: sin the cosine, tan its square plus one. A
rule's arguments are numbers of rules; a sine and a cosine refer to each other. The recurrences of the
rules are in ``jets`` (on any arithmetic) and in ``flow/core/programs.h``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, cast

from ..errors import NotSmoothError
from .graph import Node


class Rule(NamedTuple):
    """How one series follows from others."""

    rule: str
    args: tuple[int, ...] = ()
    operation: str = ""
    numbers: tuple[float, ...] = ()
    source: tuple[int, int] = (-1, -1)


def lower(nodes: Sequence[Node], moving: Sequence[bool]) -> tuple[list[Rule], list[int]]:
    """Write a graph as rules."""
    lowering = _Lowering()
    for node, moves in zip(nodes, moving, strict=True):
        lowering.add(node, moves, moving)
    return lowering.rules, lowering.rule_of


class _Lowering:
    """Rules written so far."""

    def __init__(self) -> None:
        self.rules: list[Rule] = []
        self.rule_of: list[int] = []
        self._pairs: dict[tuple[str, int], int] = {}

    def add(self, node: Node, moves: bool, moving: Sequence[bool]) -> None:
        args = tuple(self.rule_of[a] for a in node.args)
        if node.op == "const":
            number = self._new("constant", numbers=(cast("float", node.payload),))
        elif node.op == "input":
            number = self._new("input", source=node.source)
        elif not moves:
            number = self._new("apply", *args, operation=node.op)
        elif node.op in ("pow", "constpow"):
            number = self._power(args, moving[node.args[1]])
        else:
            rule = _EXPANSIONS.get(node.op)
            if rule is None:
                raise NotSmoothError(
                    f"CasADi's operation {node.op!r} has no Taylor recurrence. Write it with "
                    "arithmetic, powers, sqrt, exp, log, trigonometric and hyperbolic functions and "
                    "their inverses, atan2 and erf."
                )
            number = rule(self, *args)
        self.rule_of.append(number)

    def _new(self, rule: str, *args: int, **more: object) -> int:
        self.rules.append(Rule(rule, args, **more))  # type: ignore[arg-type]
        return len(self.rules) - 1

    def _constant(self, value: float) -> int:
        return self._new("constant", numbers=(value,))

    def _affine(self, u: int, offset: float, factor: float = 1.0) -> int:
        return self._new("affine", u, numbers=(offset, factor))

    def _integral(self, op: str, u: int, g: int, sign: float = 1.0) -> int:
        return self._new("integral", u, g, operation=op, numbers=(sign,))

    def _quotient(self, op: str, u: int, g: int, sign: float = 1.0) -> int:
        return self._new("quotient", u, g, operation=op, numbers=(sign,))

    # powers
    def _power(self, args: tuple[int, ...], moves: bool) -> int:
        """u^v; CasADi itself writes natural powers as products, so that u = 0 is a regular point."""
        u, v = args
        if moves:
            return self._exp(self._new("mul", v, self._log(u)))
        return self._new("power", u, v)

    def _inv(self, v: int) -> int:
        return self._new("div", self._constant(1.0), v)

    def _hypot(self, u: int, v: int) -> int:
        return self._new("sqrt", self._new("add", self._new("sq", u), self._new("sq", v)))

    # w' = g u'
    def _exp(self, u: int) -> int:
        return self._integral("exp", u, len(self.rules))

    def _expm1(self, u: int) -> int:
        w = self._integral("expm1", u, len(self.rules) + 1)
        self._affine(w, 1.0)
        return w

    def _pair(self, one: str, other: str, u: int, signs: tuple[float, float]) -> int:
        """A function and the one in its derivative, which both of them use."""
        if (one, u) not in self._pairs:
            w = len(self.rules)
            self._pairs[one, u] = self._integral(one, u, w + 1, signs[0])
            self._pairs[other, u] = self._integral(other, u, w, signs[1])
        return self._pairs[one, u]

    def _from_square(self, op: str, u: int, factor: float) -> int:
        """w' = (1 + factor w^2) u'."""
        w = self._integral(op, u, len(self.rules) + 2)
        self._affine(self._new("sq", w), 1.0, factor)
        return w

    def _erf(self, u: int) -> int:
        bell = self._exp(self._new("neg", self._new("sq", u)))
        return self._integral("erf", u, bell, 2.0 / math.sqrt(math.pi))

    def _erfinv(self, u: int) -> int:
        w = self._integral("erfinv", u, len(self.rules) + 2, math.sqrt(math.pi) / 2.0)
        self._exp(self._new("sq", w))
        return w

    # w' = u'/g
    def _log(self, u: int) -> int:
        return self._quotient("log", u, u)

    def _over_root(self, op: str, u: int, offset: float, factor: float, sign: float = 1.0) -> int:
        """w' = sign u'/sqrt(offset + factor u^2)."""
        square = self._affine(self._new("sq", u), offset, factor)
        return self._quotient(op, u, self._new("sqrt", square), sign)

    def _over(self, op: str, u: int, offset: float, factor: float) -> int:
        """w' = u'/(offset + factor u^2)."""
        return self._quotient(op, u, self._affine(self._new("sq", u), offset, factor))

    def _atan2(self, y: int, x: int) -> int:
        radius = self._new("add", self._new("sq", x), self._new("sq", y))
        return self._new("atan2", y, x, radius)


def _plain(name: str) -> Callable[..., int]:
    return lambda lowering, *args: lowering._new(name, *args)


_L = _Lowering
_EXPANSIONS: dict[str, Callable[..., int]] = {
    "assign": lambda s, u: u,
    **{op: _plain(op) for op in ("add", "sub", "neg", "twice", "mul", "sq", "div", "sqrt")},
    "inv": _L._inv,
    "if_else_zero": _plain("chosen"),
    "hypot": _L._hypot,
    "exp": _L._exp,
    "expm1": _L._expm1,
    "sin": lambda s, u: s._pair("sin", "cos", u, (1.0, -1.0)),
    "cos": lambda s, u: s._pair("cos", "sin", u, (-1.0, 1.0)),
    "sinh": lambda s, u: s._pair("sinh", "cosh", u, (1.0, 1.0)),
    "cosh": lambda s, u: s._pair("cosh", "sinh", u, (1.0, 1.0)),
    "tan": lambda s, u: s._from_square("tan", u, 1.0),
    "tanh": lambda s, u: s._from_square("tanh", u, -1.0),
    "erf": _L._erf,
    "erfinv": _L._erfinv,
    "log": _L._log,
    "log1p": lambda s, u: s._quotient("log1p", u, s._affine(u, 1.0)),
    "asin": lambda s, u: s._over_root("asin", u, 1.0, -1.0),
    "acos": lambda s, u: s._over_root("acos", u, 1.0, -1.0, -1.0),
    "asinh": lambda s, u: s._over_root("asinh", u, 1.0, 1.0),
    "acosh": lambda s, u: s._over_root("acosh", u, -1.0, 1.0),
    "atan": lambda s, u: s._over("atan", u, 1.0, 1.0),
    "atanh": lambda s, u: s._over("atanh", u, 1.0, -1.0),
    "atan2": _L._atan2,
}


def touched(rules: Sequence[Rule], states: int) -> list[int]:
    """Return the rules that depend on inputs of the moving vector after the states."""
    return [j for j, yes in enumerate(entered(rules, lambda k: k >= states)) if yes]


def entered(rules: Sequence[Rule], target: Callable[[int], bool]) -> list[bool]:
    """Return whether each rule depends on some of the inputs of the moving vector."""
    found = [False] * len(rules)
    for j, rule in enumerate(
        rules
    ):  # of a sine and its cosine, the first has no other inputs than its argument
        found[j] = rule.source[0] == 0 and target(rule.source[1])
        for a in rule.args:
            if found[a]:
                found[j] = True
                break
    return found
