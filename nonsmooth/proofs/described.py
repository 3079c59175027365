"""A system on a tape: its surface, both fields and their Lie derivatives, differentiated exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

from ..model import DefinitionError, FilippovSystem, ParameterError, explain
from .arithmetic import Numbers, between, enclose, exact
from .flint import arb
from .tape import Tape

#: A parameter's value, or the ends of an interval of values.
Range = Any


class Described:
    """The stored expressions of one surface of a system and what follows from them.

    Parameters
    ----------
    system : FilippovSystem
    surface : int
    mode : str, optional
        The sides of the other surfaces, one letter for each surface.
    moving : sequence of int, optional
        Parameters that are taken as further states that do not change.

    Attributes
    ----------
    tape : Tape
    x, p : list of int
        Input nodes of the extended states and the parameters.
    h : int
    fields : (list of int, list of int)
        F1 and F2, the rate of time included.
    """

    def __init__(
        self,
        system: FilippovSystem,
        surface: int = 0,
        mode: str | None = None,
        moving: Sequence[int] = (),
    ):
        self.system, self.surface = system, system.surface_index(surface)
        self.tape = tape = Tape()
        d = system.definition
        n = d.states.numel()
        count = system.extended_dimension
        self.x = [tape.symbol(0, i) for i in range(count + len(moving))]
        self.p = [tape.symbol(1, i) for i in range(d.parameters.numel())]
        for k, i in enumerate(moving):
            self.p[i] = self.x[count + k]
        self._places = [self.x[:n], self.x[n:count], self.p]
        self._symbols = [d.states, d.time, d.parameters]
        ((self.h,),) = self.insert([d.surfaces[self.surface]])
        self.fields = tuple(self._field(s) for s in self._sides(mode))

    def _sides(self, mode: str | None) -> list[list[float]]:
        signs = [0.0] * self.system.surface_count
        if mode is not None:
            signs = [float(s) for s in self.system.parse_mode(mode)]
        if any(s == 0 for i, s in enumerate(signs) if i != self.surface):
            raise DefinitionError(
                explain(
                    "mode",
                    expected="a side, + or -, of every other surface",
                    received=repr(mode),
                    advice="Proofs where several surfaces slide at once are not built.",
                )
            )
        return [[s if i == self.surface else t for i, t in enumerate(signs)] for s in (1.0, -1.0)]

    def _field(self, multipliers: Sequence[float]) -> list[int]:
        d, tape = self.system.definition, self.tape
        values = [[tape.constant(m) for m in multipliers], [tape.constant(0)] * d.reactions.numel()]
        (rows,) = tape.insert(
            [d.field], [*self._symbols, d.multipliers, d.reactions], [*self._places, *values]
        )
        more = len(self.x) - self.system.extended_dimension
        return [*rows, *[tape.constant(1)] * d.time.numel(), *[tape.constant(0)] * more]

    def insert(self, expressions: Sequence[Any]) -> list[list[int]]:
        """Write expressions in states, time and parameters onto the tape."""
        return self.tape.insert(expressions, self._symbols, self._places)

    def gradient(self, k: int) -> list[int]:
        """Derivatives with respect to the extended states."""
        return self.tape.gradient(k, self.x)

    def lie_derivative(self, k: int, of: int) -> int:
        """Derivative of a node along field k (0: F1, 1: F2)."""
        return self.tape.dot(self.fields[k], self.gradient(of))

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
    """Ends of the intervals of all parameters, as exact fractions.

    Raises
    ------
    ParameterError
        An unknown or missing parameter, an interval that is empty or not finite.
    """
    intervals: dict[str, tuple[Any, Any]] = {}
    for key, value in (given or {}).items():
        name = key if isinstance(key, str) else str(key)
        ends = value if isinstance(value, (tuple, list)) else (value, value)
        if len(ends) != 2:
            raise ParameterError(_interval(name, value))
        low, high = (exact(v, numbers, f"parameter {name!r}") for v in ends)
        if low > high:
            raise ParameterError(_interval(name, value))
        intervals[name] = low, high
    point = system.parameter_vector(
        {name: float((low + high) / 2) for name, (low, high) in intervals.items()}
    )
    names = system.parameter_names
    defaults = [exact(float(v), numbers) for v in point]
    return [intervals.get(k, (v, v)) for k, v in zip(names, defaults, strict=True)]


def _interval(name: str, value: Any) -> str:
    return explain(
        f"parameter {name!r}",
        expected="a number or (low, high) with low <= high",
        received=repr(value),
        advice="For example (0.29, 0.31).",
    )


def enclosed(intervals: Sequence[tuple[Any, Any]]) -> list[arb]:
    """Enclose intervals of exact ends."""
    return [enclose(a) if a == b else between(a, b) for a, b in intervals]
