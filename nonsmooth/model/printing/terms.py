"""Terms of a program that is printed: nodes of one graph, with the arithmetic in which instructions are expanded.

Equal terms are one node, constants are computed, and neutral terms and factors are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias, cast

from ..expressions.float_arithmetic import BINARY, UNARY
from ..expressions.graph import Node, evaluate
from ..expressions.taylor_rules import touched
from ..laws.coupled import Coupled
from .instructions import Entries, Values, instructions_of
from .jets import Expansion

Terms: TypeAlias = "Sequence[Term | None]"

_OPERATIONS: dict[str, Callable[..., float]] = {**UNARY, **BINARY}

#: Of masks of lanes: whether a number is not zero, and whether one of two is true.
MASKS = ("nonzero", "either")


@dataclass(frozen=True, slots=True)
class Term:
    """A node; None stands for a zero."""

    graph: Graph
    number: int

    @property
    def node(self) -> Node:
        return self.graph.nodes[self.number]

    @property
    def value(self) -> float | None:
        """Of a constant."""
        node = self.node
        return cast("float", node.payload) if node.op == "const" else None

    def __add__(self, other: Term) -> Term:
        return self.graph.operation("add", self, other)

    def __sub__(self, other: Term) -> Term:
        return self.graph.operation("sub", self, other)

    def __mul__(self, other: Term) -> Term:
        return self.graph.operation("mul", self, other)

    def __rmul__(self, factor: float) -> Term:
        return self.graph.operation("mul", self.graph.constant(factor), self)

    def __truediv__(self, other: Term) -> Term:
        return self.graph.operation("div", self, other)

    def __neg__(self) -> Term:
        return self.graph.operation("neg", self)


class Graph:
    """The nodes, in an order in which each can be computed."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._known: dict[Node, int] = {}

    def _term(self, node: Node) -> Term:
        if node not in self._known:
            self._known[node] = len(self.nodes)
            self.nodes.append(node)
        return Term(self, self._known[node])

    def constant(self, value: float) -> Term:
        """Return a number."""
        return self._term(Node("const", (), float(value)))

    def inputs(self, vector: int, count: int) -> list[Term]:
        """Return the entries of an input: 0 states, 1 parameters, 2 what differs between lanes."""
        return [self._term(Node("input", (), (vector, k))) for k in range(count)]

    def operation(self, op: str, *args: Term) -> Term:
        """Return an operation, as simple as it can be."""
        if (known := self._folded(op, args)) is not None:
            return known
        if op in ("add", "mul") and args[0].number > args[1].number:
            args = args[::-1]
        return self._term(Node(op, tuple(a.number for a in args)))

    def _folded(self, op: str, args: Sequence[Term]) -> Term | None:
        """A term that an operation is equal to."""
        values = [v for a in args if (v := a.value) is not None]
        if len(values) == len(args):
            try:
                found = _OPERATIONS[op](*values)
            except (ArithmeticError, ValueError):
                return None
            return self.constant(found) if math.isfinite(found) else None
        if op in ("add", "sub", "mul", "div", "neg"):
            fold = getattr(self, "_" + op)
            return cast("Term | None", fold(*args))
        return args[0] if op == "assign" else None

    def _of(self, op: str, a: Term) -> Term | None:
        """The argument of an operation, if a term is one."""
        return Term(self, a.node.args[0]) if a.node.op == op else None

    def _neg(self, a: Term) -> Term | None:
        return self._of("neg", a)

    def _add(self, a: Term, b: Term) -> Term | None:
        if 0.0 in (a.value, b.value):
            return b if a.value == 0.0 else a
        if a == b:
            return 2.0 * a
        if (other := self._of("neg", b)) is not None:
            return a - other
        return b - other if (other := self._of("neg", a)) is not None else None

    def _sub(self, a: Term, b: Term) -> Term | None:
        if 0.0 in (a.value, b.value):
            return -b if a.value == 0.0 else a
        if a == b:
            return self.constant(0.0)
        if (other := self._of("neg", b)) is not None:
            return a + other
        return -(other + b) if (other := self._of("neg", a)) is not None else None

    def _mul(self, a: Term, b: Term) -> Term | None:
        if b.value is not None:
            a, b = b, a
        if a.value in (0.0, 1.0, -1.0):
            return {0.0: a, 1.0: b}.get(a.value) or -b
        if a == b:
            return self.operation("sq", a)
        for one, two in ((a, b), (b, a)):
            if (other := self._of("neg", one)) is not None:
                return -(two * other) if two.value is None else -two.value * other
        return None

    def _div(self, a: Term, b: Term) -> Term:
        """A product with a reciprocal, which is taken once: it costs as much as twenty products."""
        return a * (self.constant(math.inf) if b.value == 0.0 else self.operation("inv", b))

    def select(self, mask: Term, a: Term | None, b: Term | None) -> Term | None:
        """Return ``a`` in lanes of a mask and ``b`` in the others."""
        if a == b:
            return a
        args = [mask, *(self.constant(0.0) if e is None else e for e in (a, b))]
        return self._term(Node("select", tuple(e.number for e in args)))

    # the arithmetic of series, with None for a structural zero ------------------------------------

    def number(self, value: float) -> Term | None:
        """Return a constant."""
        return self.constant(value) if value else None

    def clean(self, a: Term) -> Term | None:
        """Return None for zero."""
        return None if a.value == 0.0 else a

    def inner(self, u: Terms, v: Terms) -> Term | None:
        """Return the sum of products."""
        total: Term | None = None
        for a, b in zip(u, v, strict=True):
            if a is not None and b is not None:
                total = a * b if total is None else total + a * b
        return None if total is None else self.clean(total)

    def convolved(self, u: Terms, v: Terms, k: int, first: int, last: int) -> Term | None:
        """Return the sum of u_i v_(k-i) for i from first to last."""
        return self.inner(u[first : last + 1], v[k - last : k - first + 1][::-1])

    def divide(self, a: Term, b: Term | None) -> Term:
        """Return a quotient."""
        return a / self.whole(b)

    def apply(self, op: str, args: Terms) -> Term:
        """Return an operation of values."""
        if op == "if_else_zero" and not all(a is None or self.is_still(a) for a in args):
            return self.whole(self.chosen(args[:1], args[1]))
        return self.operation(op, *map(self.whole, args))

    def chosen(self, c: Terms, u: Term | None) -> Term | None:
        """Return a term where a coefficient of a series is not zero, else zero."""
        mask: Term | None = None
        for own in c:
            if own is None:
                continue
            if own.value is not None:
                return u
            one = self._term(Node("nonzero", (own.number,)))
            mask = one if mask is None else self._term(Node("either", (mask.number, one.number)))
        return None if mask is None or u is None else self.select(mask, u, None)

    def whole(self, a: Term | None) -> Term:
        """Return a zero term as a constant."""
        return self.constant(0.0) if a is None else a

    def total(self, a: Term | None, b: Term | None) -> Term | None:
        """Return a sum."""
        if a is None or b is None:
            return b if a is None else a
        return self.clean(a + b)

    def difference(self, a: Term | None, b: Term | None) -> Term | None:
        """Return a difference."""
        if b is None:
            return a
        return self.clean(-b if a is None else a - b)

    def scaled(self, factor: Term, a: Term | None) -> Term | None:
        """Return a product with one factor of parameters in place of two."""
        if a is None:
            return None
        own = [Term(self, k) for k in a.node.args if a.node.op in ("mul", "neg")]
        for one, two in (own, own[::-1]) if len(own) == 2 else ():
            if self.is_still(one):
                return self.scaled(factor * one, two)
        return self.scaled(-factor, own[0]) if len(own) == 1 else self.clean(factor * a)

    def is_still(self, a: Term) -> bool:
        """Whether a term depends on parameters alone."""
        pending = [a.number]
        while pending:
            node = self.nodes[pending.pop()]
            if node.op == "input" and node.source[0] != 1:
                return False
            pending += node.args
        return True

    def values(self, of: Values, moving: Terms, still: Sequence[Term]) -> list[Term | None]:
        """Return the outputs of a program of values."""
        found = evaluate(of.nodes, _Evaluation(self, (moving, still)))
        return [found[j] for j in of.outputs.tolist()]


@dataclass(frozen=True)
class _Evaluation:
    """The algebra of terms (``expressions.graph.Algebra``)."""

    graph: Graph
    inputs: tuple[Terms, Terms]

    def constant(self, value: float) -> Term | None:
        return self.graph.number(value)

    def symbol(self, vector: int, position: int) -> Term | None:
        return self.inputs[vector][position]

    def apply(self, op: str, args: Terms) -> Term | None:
        return self.graph.clean(self.graph.apply(op, args))


@dataclass(frozen=True)
class Point:
    """Values of the layer and of its parts; gradients by the states, row by row."""

    layer: Terms
    factors: Terms
    slope: Terms
    layer_gradient: Terms
    factor_gradient: Terms


class OfInstructions:
    """Instructions of a system without contacts, in terms of states and parameters."""

    def __init__(self, coupled: Coupled):
        system = coupled.system
        self.coupled, self.lists, self.graph = coupled, instructions_of(coupled), Graph()
        self.n, self.m = system.extended_dimension, system.surface_count
        self.x = self.graph.inputs(0, self.n)
        self.p = self.graph.inputs(1, len(system.parameter_names))
        #: Rules that multipliers enter.
        self.late = touched(self.lists.series.printed[0], self.n)

    def begun(self) -> list[list[Term | None]]:
        """Rows of coefficients of the states, with their values."""
        return [[x] for x in self.x]

    def extend(self, jet: list[list[Term | None]], field: Terms, k: int, order: int) -> None:
        """Add coefficients k + 1 of the states, up to an order, from those of the field."""
        for row, value in zip(jet, field if k < order else (), strict=k < order):
            row.append(None if value is None else (1.0 / (k + 1)) * value)

    def expansion(self, outputs: Sequence[int]) -> Expansion:
        """The series of some of field, layer, heights, factors, stops."""
        rules, rows = self.lists.series.printed
        return Expansion(rules, [rows[i] for i in outputs], self.p, self.graph)

    def point(self, acting: Terms) -> Point:
        """Values for some multipliers and unknowns."""
        lists, m = self.lists, self.m
        values = self.graph.values(lists.point, [*self.x, *acting], self.p)
        parts = [2 * m, *(len(e.row) for e in (lists.slope, lists.layer_gradient))]
        first, second = sum(parts[:2]), sum(parts)
        return Point(
            values[:m],
            values[m : 2 * m],
            self._dense(values[2 * m : first], lists.slope, m, m),
            self._dense(values[first:second], lists.layer_gradient, m, self.n),
            self._dense(
                values[-len(lists.factor_gradient.row) :], lists.factor_gradient, m, self.n
            ),
        )

    def columns(self, acting: Terms) -> list[list[Term | None]]:
        """Derivatives of the field by the unknowns, in rows."""
        values = self.graph.values(self.lists.columns, [*self.x, *acting], self.p)
        dense = self._dense(values, self.lists.column, self.n, self.m)
        return [dense[i : i + self.m] for i in range(0, len(dense), self.m)]

    def surfaces(self) -> tuple[list[Term | None], list[Term | None]]:
        """The surfaces, and their gradients."""
        rows, lists = self.coupled.kept.numel(), self.lists
        values = self.graph.values(lists.surfaces, self.x, self.p)
        slopes = self._dense(values[rows:], lists.surface_gradient, rows, self.n)
        return values[: self.m], slopes[: self.m * self.n]

    def stops(self) -> tuple[list[Term | None], list[Term | None]]:
        """The guards of stops, and their gradients."""
        rows, lists = self.coupled.stops.numel(), self.lists
        values = self.graph.values(lists.atoms, self.x, self.p)
        return values[:rows], self._dense(values[rows:], lists.atom_gradient, rows, self.n)

    def _dense(self, entries: Terms, of: Entries, rows: int, columns: int) -> list[Term | None]:
        """A matrix from its entries."""
        matrix: list[Term | None] = [None] * (rows * columns)
        positions = of.row.tolist(), of.column.tolist()
        for value, i, j in zip(entries[: len(of.row)], *positions, strict=True):
            matrix[i * columns + j] = value
        return matrix
