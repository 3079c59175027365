"""Square systems of equations whose zeros are special points, with their Jacobians."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from .flint import arb, arb_mat
from .instructions import ExpressionGraph, Program
from .intervals import Enclosures, Numbers


class Equations:
    """f(u) = 0 with as many equations as unknowns, (vector, position) among the inputs ``held``."""

    def __init__(
        self,
        graph: ExpressionGraph,
        values: Sequence[int],
        unknowns: Sequence[tuple[int, int]],
        names: Sequence[str],
        held: list[list[Any]],
        numbers: Numbers,
    ):
        self.graph, self.unknowns, self.names, self.numbers = graph, list(unknowns), names, numbers
        self.nodes, self.held, self.n = list(values), held, len(unknowns)
        inputs = [graph.symbol(*index) for index in unknowns]
        rows = [graph.gradient(k, inputs) for k in values]
        self._values = Program(graph, [values])
        self._both = Program(graph, [values, *rows])

    def inputs(self, u: Sequence[Any]) -> list[list[Any]]:
        """All inputs, with values of the unknowns."""
        vectors = [list(v) for v in self.held]
        for (vector, position), value in zip(self.unknowns, u, strict=True):
            vectors[vector][position] = value
        return vectors

    def evaluate(self, program: Program, u: Sequence[arb]) -> list[list[arb]]:
        """Enclose a program's values where the unknowns are ``u``."""
        return program(Enclosures(self.inputs(u), self.numbers))

    def values(self, u: Sequence[arb]) -> arb_mat:
        """f(u) as a column."""
        (row,) = self.evaluate(self._values, u)
        return column(row)

    def with_jacobian(self, u: Sequence[arb]) -> tuple[arb_mat, arb_mat]:
        """f(u) and its Jacobian."""
        row, *jacobian = self.evaluate(self._both, u)
        return column(row), arb_mat(jacobian)

    @property
    def programs(self) -> tuple[Program, Program]:
        """Programs of the values, and of values and Jacobian."""
        return self._values, self._both

    def holding(self, held: list[list[Any]]) -> Equations:
        """The same equations with other held values."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__, held=held)
        return other


def column(entries: Sequence[arb]) -> arb_mat:
    """A column of numbers."""
    return arb_mat([[v] for v in entries])


def entries(matrix: arb_mat) -> list[arb]:
    """The numbers of a column."""
    return [matrix[i, 0] for i in range(matrix.nrows())]


def plane(
    graph: ExpressionGraph,
    inputs: Sequence[int],
    normals: Sequence[Sequence[Fraction]],
    through: Sequence[Any],
) -> list[int]:
    """Nodes of normal . (x - through), exactly."""
    differences = [
        graph.apply("sub", [x, graph.constant(Fraction(c))])
        for x, c in zip(inputs, through, strict=True)
    ]
    return [graph.dot([graph.constant(c) for c in normal], differences) for normal in normals]
