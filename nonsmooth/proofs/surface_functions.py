"""Switching function, both fields and their Lie derivatives, as exact expression graphs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, get_args

from ..model import DefinitionError, FilippovSystem, OptionError, ParameterError
from .arithmetic.flint import arb
from .arithmetic.instructions import ExpressionGraph
from .arithmetic.intervals import Numbers, between, enclose, exact, exact_range

#: A parameter's value, or the ends of an interval of values.
Range = Any


class SystemGraph:
    """The stored expressions of a system as a graph."""

    # With a clock, a system that does not depend on time has it as one more state all the same.

    def __init__(self, system: FilippovSystem, moving: Sequence[int] = (), clock: bool = False):
        self.system = system
        self.graph = graph = ExpressionGraph()
        d = system.definition
        n = d.states.numel()
        self.clock = n + 1 if clock else system.extended_dimension
        self.x = [graph.symbol(0, i) for i in range(self.clock + len(moving))]
        self.p = [graph.symbol(1, i) for i in range(d.parameters.numel())]
        for k, i in enumerate(moving):
            self.p[i] = self.x[self.clock + k]
        self._inputs = [self.x[:n], self.x[n : system.extended_dimension], self.p]
        self._symbols = [d.states, d.time, d.parameters]

    def insert(self, expressions: Sequence[Any]) -> list[list[int]]:
        """Add expressions in states, time and parameters to the graph."""
        return self.graph.insert(expressions, self._symbols, self._inputs)

    def inserted_at(self, expression: Any, x: Sequence[int]) -> int:
        """Add a function of states, time and parameters, with other nodes for the states."""
        n, count = self.system.dimension, self.system.extended_dimension
        inputs = [list(x[:n]), list(x[n:count]), self.p]
        ((node,),) = self.graph.insert([expression], self._symbols, inputs)
        return int(node)

    def field(
        self, multipliers: Sequence[int], reactions: Sequence[int] | None = None
    ) -> list[int]:
        """Rates of the extended states, for nodes of the multipliers and of the reactions (default 0)."""
        d, graph = self.system.definition, self.graph
        still = [graph.constant(0)] * d.reactions.numel()
        values = [list(multipliers), still if reactions is None else list(reactions)]
        (rows,) = graph.insert(
            [d.field], [*self._symbols, d.multipliers, d.reactions], [*self._inputs, *values]
        )
        times = self.clock - self.system.dimension
        more = [graph.constant(0)] * (len(self.x) - self.clock)
        return [*rows, *[graph.constant(1)] * times, *more]

    def gradient(self, k: int) -> list[int]:
        """Derivatives with respect to the extended states."""
        return self.graph.gradient(k, self.x)


class SurfaceFunctions:
    """One surface of a system: its switching function, both fields and Lie derivatives."""

    def __init__(
        self,
        system: FilippovSystem,
        surface: int = 0,
        mode: str | None = None,
        system_graph: SystemGraph | None = None,
    ):
        self.system, self.surface, self.mode = system, system.surface_index(surface), mode
        self.system_graph = system_graph or SystemGraph(system)
        self.graph, self.x, self.p = (
            self.system_graph.graph,
            self.system_graph.x,
            self.system_graph.p,
        )
        ((self.h,),) = self.system_graph.insert([system.definition.surfaces[self.surface]])
        sides = self._sides()
        constant = self.graph.constant
        self.fields = tuple(self.system_graph.field([constant(m) for m in s]) for s in sides)
        self.elsewhere = self._elsewhere(sides[0])

    def _sides(self) -> list[list[float]]:
        signs = [0.0] * self.system.surface_count
        if self.mode is not None:
            letters = self.system.parse_letters(self.mode)
            signs = [float(s) for s in letters[: len(signs)]]
            if 0 in letters[len(signs) :]:
                raise DefinitionError(
                    f"mode {self.mode!r} has closed contacts, whose points are not proven. Give a mode with open ones."
                )
        if any(s == 0 for i, s in enumerate(signs) if i != self.surface):
            raise DefinitionError(
                f"mode {self.mode!r} must give a side, + or -, of every other surface. Proofs do not cover "
                "sliding on several surfaces at once."
            )
        return [[s if i == self.surface else t for i, t in enumerate(signs)] for s in (1.0, -1.0)]

    def _elsewhere(self, signs: Sequence[float]) -> list[tuple[str, int]]:
        d, found = self.system.definition, []
        for i, s in enumerate(signs):
            if i != self.surface:
                ((h,),) = self.system_graph.insert([d.surfaces[i]])
                node = h if s > 0 else self.graph.apply("neg", [h])
                found.append((f"the side {'+' if s > 0 else '-'} of surface {i}", node))
        for k, name in enumerate(self.system.impacts):
            ((gap,),) = self.system_graph.insert([d.gaps[k]])
            found.append((f"an open gap of {name!r}", gap))
        return found

    @property
    def nonlinear(self) -> bool:
        """Whether the surface's multiplier enters nonlinearly."""
        return bool(self.system.nonlinear[self.surface])

    def gradient(self, k: int) -> list[int]:
        """Derivatives with respect to the extended states."""
        return self.system_graph.gradient(k)

    def lie_derivative(self, k: int, of: int) -> int:
        """Derivative of a node along field k (0: F1, 1: F2)."""
        return self.graph.dot(self.fields[k], self.gradient(of))

    @cached_property
    def lie(self) -> tuple[int, int]:
        """L1 and L2."""
        return self.lie_derivative(0, self.h), self.lie_derivative(1, self.h)

    @cached_property
    def second(self) -> list[int]:
        """L11, L12, L21, L22 with L_ij = F_i . grad L_j."""
        return [self.lie_derivative(i, self.lie[j]) for i in (0, 1) for j in (0, 1)]


def parameter_ranges(
    system: FilippovSystem, given: Mapping[Any, Range] | None, numbers: Numbers
) -> list[tuple[Any, Any]]:
    """Ends of the intervals of all parameters, as exact fractions."""
    if numbers not in get_args(Numbers):
        raise OptionError(f"numbers={numbers!r} is not 'stored' or 'written'. See certify.")
    intervals: dict[str, tuple[Any, Any]] = {}
    for key, value in (given or {}).items():
        name = key if isinstance(key, str) else str(key)
        intervals[name] = exact_range(value, numbers, f"parameter {name!r}", ParameterError)
    point = system.parameter_vector(
        {name: float((low + high) / 2) for name, (low, high) in intervals.items()}
    )
    names = system.parameter_names
    defaults = [exact(float(v), numbers) for v in point]
    return [intervals.get(k, (v, v)) for k, v in zip(names, defaults, strict=True)]


def enclosed(intervals: Sequence[tuple[Any, Any]]) -> list[arb]:
    """Enclose intervals of exact ends."""
    return [enclose(a) if a == b else between(a, b) for a, b in intervals]
