"""Jets printed: Taylor coefficients in time of a flow and of functions along it, as terms.

Each rule of ``taylor_rules`` has one recurrence, below; ``flow/core/programs.h`` has them for numbers. Structural
zeros (constants, polynomials) are None.

Sources: Moore 1966; Jorba & Zou 2005, "A software package for the numerical integration of ODEs by
means of high-order Taylor methods", Prop. 2.1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from ..expressions.graph import reached
from ..expressions.taylor_rules import Rule, entered

if TYPE_CHECKING:
    from .terms import Graph

#: Gives a coefficient from its order.
_Later = Callable[[int], Any]


class Expansion:
    """All series of a list of rules, expanded together."""

    def __init__(
        self,
        rules: Sequence[Rule],
        rows: Sequence[Sequence[int]],
        still: Sequence[Any],
        graph: Graph,
    ):
        self._rows, self._still, self._on = rows, still, graph
        self.series: list[list[Any]] = [[] for _ in rules]
        self._moving: Sequence[Any] = ()
        self._moves = entered(rules, lambda _: True)
        arguments, roots = [rule.args for rule in rules], [j for row in rows for j in row]
        self._needed = reached(arguments, [True] * len(rules), roots)
        self._recurrences = {j: self._recurrence(j, rules[j]) for j in self._needed}

    def advance(self, k: int, moving: Sequence[Any]) -> list[list[Any]]:
        """Expand everything to order k, given coefficient k of vector 0; the outputs' coefficients."""
        self._moving = moving
        for j in self._needed:
            self.series[j].append(self._recurrences[j](k) if self._moves[j] or not k else None)
        return self.outputs(k)

    def again(self, k: int, moving: Sequence[Any], which: Sequence[int]) -> list[list[Any]]:
        """Expand some rules once more to the same order, with other coefficients of vector 0."""
        self._moving = moving
        for j in which:
            if j in self._recurrences:
                self.series[j][k] = self._recurrences[j](k)
        return self.outputs(k)

    def outputs(self, k: int) -> list[list[Any]]:
        """Return coefficient k of every entry of every output."""
        return [[self.series[j][k] for j in row] for row in self._rows]

    def _product(self, a: Any, b: Any) -> Any:
        return None if a is None or b is None else self._on.clean(a * b)

    def _scaled(self, a: Any, factor: float) -> Any:
        return a if a is None or factor == 1.0 else self._on.clean(factor * a)

    def _quotient_of(self, a: Any, b: Any) -> Any:
        return None if a is None else self._on.divide(a, b)

    def _weigh(self, u: list[Any], v: list[Any], k: int, last: int) -> Any:
        """Sum of i u_i v_(k-i) for i from 1 to last."""
        total = None
        for i in range(1, last + 1):
            total = self._on.total(total, self._product(self._scaled(u[i], float(i)), v[k - i]))
        return total

    # one recurrence for each rule ---------------------------------------------------------------

    def _recurrence(self, j: int, rule: Rule) -> _Later:
        build: Callable[..., _Later] = getattr(self, "_" + rule.rule)
        return build(rule, self.series[j], *[self.series[a] for a in rule.args])

    def _constant(self, rule: Rule, _: list[Any]) -> _Later:
        value = self._on.number(rule.numbers[0])
        return lambda k: None if k else value

    def _input(self, rule: Rule, _: list[Any]) -> _Later:
        vector, position = rule.source
        if vector == 0:
            return lambda k: self._moving[position]
        return lambda k: None if k else self._still[position]

    def _apply(self, rule: Rule, _: list[Any], *args: list[Any]) -> _Later:
        value = lambda: self._on.clean(self._on.apply(rule.operation, [a[0] for a in args]))
        return lambda k: None if k else value()

    def _add(self, _: Rule, __: list[Any], u: list[Any], v: list[Any]) -> _Later:
        return lambda k: self._on.total(u[k], v[k])

    def _sub(self, _: Rule, __: list[Any], u: list[Any], v: list[Any]) -> _Later:
        return lambda k: self._on.difference(u[k], v[k])

    def _neg(self, _: Rule, __: list[Any], u: list[Any]) -> _Later:
        return lambda k: self._on.difference(None, u[k])

    def _twice(self, _: Rule, __: list[Any], u: list[Any]) -> _Later:
        return lambda k: self._on.total(u[k], u[k])

    def _mul(self, rule: Rule, _: list[Any], u: list[Any], v: list[Any]) -> _Later:
        moves, other = (self._moves[a] for a in rule.args)
        if not moves:
            return lambda k: self._product(u[0], v[k])
        if not other:
            return lambda k: self._product(u[k], v[0])
        return lambda k: self._on.convolved(u, v, k, 0, k)

    def _sq(self, _: Rule, __: list[Any], u: list[Any]) -> _Later:
        def square(k: int) -> Any:
            half = self._scaled(self._on.convolved(u, u, k, 0, (k + 1) // 2 - 1), 2.0)
            return half if k % 2 else self._on.total(half, self._product(u[k // 2], u[k // 2]))

        return square

    def _div(self, _: Rule, w: list[Any], u: list[Any], v: list[Any]) -> _Later:
        return lambda k: self._quotient_of(
            self._on.difference(u[k], self._on.convolved(w, v, k, 0, k - 1)), v[0]
        )

    def _after(self, op: str, args: Sequence[list[Any]], later: _Later) -> _Later:
        """An operation of the values, and what gives the coefficients after them."""
        return lambda k: later(k) if k else self._on.apply(op, [a[0] for a in args])

    def _sqrt(self, _: Rule, w: list[Any], u: list[Any]) -> _Later:
        def root(k: int) -> Any:
            known = self._on.convolved(w, w, k, 1, k - 1)
            return self._quotient_of(self._scaled(self._on.difference(u[k], known), 0.5), w[0])

        return self._after("sqrt", [u], root)

    def _power(self, _: Rule, w: list[Any], u: list[Any], v: list[Any]) -> _Later:
        def power(k: int) -> Any:
            total = None
            for j in range(k):
                factor = self._on.difference(self._scaled(v[0], float(k - j)), self._on.number(j))
                term = self._product(factor, self._product(u[k - j], w[j]))
                total = self._on.total(total, term)
            return self._scaled(self._quotient_of(total, u[0]), 1.0 / k)

        return self._after("pow", [u, v], power)

    def _affine(self, rule: Rule, _: list[Any], u: list[Any]) -> _Later:
        offset, factor = rule.numbers
        constant = self._on.number(offset)
        return lambda k: self._on.total(None if k else constant, self._scaled(u[k], factor))

    def _integral(self, rule: Rule, _: list[Any], u: list[Any], g: list[Any]) -> _Later:
        (sign,) = rule.numbers
        later = lambda k: self._scaled(self._weigh(u, g, k, k), sign / k)
        return self._after(rule.operation, [u], later)

    def _quotient(self, rule: Rule, w: list[Any], u: list[Any], g: list[Any]) -> _Later:
        (sign,) = rule.numbers

        def quotient(k: int) -> Any:
            known = self._weigh(w, g, k, k - 1)
            top = self._on.difference(self._scaled(u[k], sign * k), known)
            return self._scaled(self._quotient_of(top, g[0]), 1.0 / k)

        return self._after(rule.operation, [u], quotient)

    def _atan2(
        self, _: Rule, w: list[Any], y: list[Any], x: list[Any], radius: list[Any]
    ) -> _Later:
        def angle(k: int) -> Any:
            turn = self._on.difference(self._weigh(y, x, k, k), self._weigh(x, y, k, k))
            top = self._on.difference(turn, self._weigh(w, radius, k, k - 1))
            return self._scaled(self._quotient_of(top, radius[0]), 1.0 / k)

        return self._after("atan2", [y, x], angle)

    def _chosen(self, _: Rule, __: list[Any], c: list[Any], u: list[Any]) -> _Later:
        return lambda k: self._on.chosen(c[: k + 1], u[k])
