"""Expressions as polynomials with rational coefficients, for exact equality and common factors.

Instructions that are not polynomial (a sine, an inverse) are atoms. Common factors are the exact
greatest common divisor over the rationals.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from ...model.expressions.graph import Node
from .flint import fmpq, fmpq_mpoly, fmpq_mpoly_ctx
from .instructions import ExpressionGraph
from .intervals import COMMON, Numbers, exact

_POLYNOMIAL = {"const", "sq", "power", *COMMON}


class Algebra:
    """Nodes of a graph as polynomials in atoms."""

    def __init__(self, graph: ExpressionGraph, roots: Sequence[int], numbers: Numbers):
        self.graph = graph
        chosen = graph.ancestors(roots)
        self.atoms = [k for k in chosen if not self._is_polynomial(k)]
        # A quotient is a product with the inverse of its denominator, which is an atom.
        below = {k: graph.nodes[k].args[1] for k in chosen if graph.nodes[k].op == "div"}
        divisors = {k: graph.nodes[b] for k, b in below.items() if graph.nodes[b].op == "const"}
        below = {k: b for k, b in below.items() if k not in divisors}
        self._inverse = {k: graph.node("inv", b) for k, b in below.items()}
        self.atoms += sorted(set(self._inverse.values()) - set(self.atoms))
        names = [f"a{k}" for k in self.atoms] or ["a"]
        self.ring = fmpq_mpoly_ctx.get(names, "lex")
        self._value: dict[int, Any] = dict(zip(self.atoms, self.ring.gens(), strict=False))
        for k in chosen:
            if k not in self._value:
                node = graph.nodes[k]
                args = [self._value[a] for a in node.args]
                if k in divisors:
                    self._value[k] = args[0] / self._number(divisors[k], numbers)
                elif node.op == "div":
                    self._value[k] = args[0] * self._value[self._inverse[k]]
                elif node.op == "const":
                    self._value[k] = self.ring.constant(self._number(node, numbers))
                elif node.op in COMMON:
                    self._value[k] = COMMON[node.op](*args)
                else:
                    self._value[k] = args[0] ** (2 if node.op == "sq" else node.payload)

    def _is_polynomial(self, k: int) -> bool:
        return self.graph.nodes[k].op in _POLYNOMIAL

    def _number(self, node: Node, numbers: Numbers) -> fmpq:
        value = exact(node.payload, numbers)
        return fmpq(value.numerator, value.denominator)

    def __getitem__(self, k: int) -> fmpq_mpoly:
        """The polynomial of a node."""
        return self._value[k]

    def node(self, p: fmpq_mpoly) -> int:
        """Add a polynomial to the graph."""
        graph, terms = self.graph, []
        for powers, c in p.to_dict().items():
            term = graph.constant(Fraction(int(c.p), int(c.q)))
            for atom, n in zip(self.atoms, powers, strict=False):
                if n:
                    term = graph.apply("mul", [term, graph.power(atom, int(n))])
            terms.append(term)
        return graph.add(*terms)


def common_divisor(polynomials: Sequence[fmpq_mpoly]) -> fmpq_mpoly | None:
    """Greatest common divisor of those that are not zero; None if all are."""
    found = None
    for p in polynomials:
        if not p.is_zero():
            found = p if found is None else found.gcd(p)
    return found


class Difference:
    """F1 - F2 = g G with the greatest common divisor g, and b = grad h . G."""

    # L1 - L2 = g b, so where b has no zero, L1 = L2 implies F1 = F2; while sliding the field is
    # F1 - (L1/b) G, smooth where g vanishes (Filippov 1988, sec. 4).

    def __init__(
        self,
        graph: ExpressionGraph,
        fields: Sequence[Sequence[int]],
        gradient: Sequence[int],
        numbers: Numbers,
    ):
        self.differences = [graph.apply("sub", [a, b]) for a, b in zip(*fields, strict=True)]
        algebra = Algebra(graph, self.differences, numbers)
        polynomials = [algebra[k] for k in self.differences]
        divisor = common_divisor(polynomials)
        self.identical = divisor is None
        if divisor is None or divisor.is_constant():
            self.factor, self.direction = graph.constant(1.0), self.differences
        else:  # written out only where something is cancelled
            self.factor = algebra.node(divisor)
            self.direction = [algebra.node(p / divisor) for p in polynomials]
        self.transverse = graph.dot(gradient, self.direction)
