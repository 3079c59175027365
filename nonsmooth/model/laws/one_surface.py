"""One surface, condition or contact of a system, with the other elements fixed at the letters of a mode.

Reactions of closed contacts, conditions and joints are eliminated: they are linear in the equations that keep
their functions at zero. The fields that remain are tangent to the manifold on which those functions vanish.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca

from ..definition.system import FilippovSystem
from ..errors import DefinitionError
from ..values import Array
from .coupled import Coupled, coupled_of
from .evaluators import Evaluator
from .motion import least_norm

#: An ordinary surface; a condition of relative degree 0 or 1; a contact; nothing.
Kind = Literal["surface", "algebraic", "one-sided", "contact", "none"]


@dataclass(frozen=True, eq=False)
class OneSurface:
    """A system with one surface, or none, in the states of the whole.

    Attributes
    ----------
    kind : str
        What the surface is in the whole system.
    surface : int or None
        Its number among the letters there.
    system : FilippovSystem
        Above the surface a condition or contact is open, below it is closed.
    kept : int
        How many functions vanish in the mode besides the surface: those of closed elements and joints, and derivatives
        of them that no reaction enters.
    """

    kind: Kind
    surface: int | None
    system: FilippovSystem
    kept: int
    _evaluate: Evaluator

    def kept_at(self, x: Array, p: Array) -> tuple[Array, Array, Array]:
        """Those functions (k,), their gradients (k, N) and Hessians (k, N, N) at an extended state."""
        values, gradient, hessians = self._evaluate.copied(x, p)[:3]
        return values.ravel(), gradient, hessians.reshape(self.kept, x.size, x.size)

    def push_at(self, x: Array, p: Array) -> tuple[Array, float]:
        """Direction (N,) in which the multiplier of a condition or contact acts, and its value while closed."""
        push, load = self._evaluate.copied(x, p)[3:]
        return push.ravel(), float(load.item())


def has_elements(system: FilippovSystem) -> bool:
    """Whether a system has conditions, contacts or joints."""
    return bool(system.complementarity or system.impacts or system.constraints)


def kind_of_element(system: FilippovSystem, element: int | None) -> Kind:
    """The kind of the surface, condition or contact with an index among the letters of a mode."""
    if element is None:
        return "none"
    if element >= system.surface_count:
        return "contact"
    if element in system.algebraic:
        return "algebraic"
    return "one-sided" if element in system.half_lines else "surface"


def one_surface(system: FilippovSystem, mode: str, element: int | None) -> OneSurface:
    """The system in which one element may change and the others have the letters of a mode; built once."""
    return system.cached(
        ("one surface", mode, element), lambda: _Held(system, mode, element).result()
    )


def condition_as_surface(system: FilippovSystem) -> FilippovSystem:
    """The system with a surface in place of its one complementarity condition, on which it slides where that is closed."""
    return system.cached("condition as surface", lambda: _Held(system, "o", 0).sliding())


class _Held:
    """Fields and functions of one element, the others held."""

    def __init__(self, system: FilippovSystem, mode: str, element: int | None):
        self.system, self.element = system, element
        self.kind = kind_of_element(system, element)
        self.letters = list(system.parse_letters(mode))
        self.coupled: Coupled = coupled_of(system)
        first = min((*system.half_lines, *system.joints, system.surface_count))
        #: Conditions, contacts and joints, in the order of their letters.
        self.elements = range(first, len(self.letters))

    def at(self, letter: int, what: ca.SX, own: ca.SX | None = None) -> ca.SX:
        """An expression at a letter of the element, reactions eliminated; ``own`` replaces its unknown."""
        letters = list(self.letters)
        if self.element is not None:
            letters[self.element] = letter
        coupled, n = self.coupled, self.system.extended_dimension
        rest = coupled.moving[n:]
        values = ca.SX.zeros(rest.numel(), 1)
        for i, sign in enumerate(letters):
            if i not in self.elements:
                values[i] = sign
        closed = [i for i in self.elements if letters[i] == 0]
        if own is not None and self.element is not None:
            closed = [i for i in closed if i != self.element]
            values[self.element] = own
        for i in closed:
            values[i] = coupled.unknown(i)
        put = lambda e: ca.substitute(e, rest, values)
        what = put(what)
        if not closed:
            return ca.densify(what)
        unknowns = ca.vertcat(*[coupled.unknown(i) for i in closed])
        rows = put(coupled.layer[closed])
        slope = ca.sparsify(ca.jacobian(rows, unknowns))
        if not slope.nnz():
            raise self._together(closed)
        found = -least_norm(slope, ca.substitute(rows, unknowns, ca.SX.zeros(len(closed), 1)))
        return ca.densify(ca.substitute(what, unknowns, found))

    def result(self) -> OneSurface:
        """The system, and what belongs to it."""
        field = self.coupled.field
        if self.element is None:
            return self._with(_with_sides(self.system, None, [self.at(1, field)]))
        above = self.at(1, field)
        if self.kind == "surface":
            h = self.coupled.kept[self.element]
            return self._with(_with_sides(self.system, h, [above, self.at(-1, field)]))
        h, push, first, slope = self._one_sided(self.element)
        load = -first / slope
        made = _with_sides(self.system, h, [above, above + load * push])
        return self._with(made, push, load)

    def _one_sided(self, element: int) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """The function of a condition or contact, the term of its unknown in the field, and its equation without and by it."""
        field, own = self.coupled.field, ca.SX.sym("own")
        push = ca.jacobian(self.at(0, field, own), own)
        row = self.at(0, self.coupled.layer[element], own)
        first, slope = ca.substitute(row, own, 0), ca.jacobian(row, own)
        if slope.is_zero():
            raise self._together([element])
        return first if self.kind == "algebraic" else self.coupled.kept[element], push, first, slope

    def sliding(self) -> FilippovSystem:
        """A surface that is reached from below, or continuous, in place of the condition."""
        assert self.element is not None
        h, push, first, slope = self._one_sided(self.element)
        above, rate = self.at(1, self.coupled.field), 0 if self.kind == "algebraic" else 1
        return _with_sides(self.system, h, [above, above + (rate - first) / slope * push])

    def _together(self, which: Sequence[int]) -> DefinitionError:
        names = [*self.system.surface_names, *self.system.impacts]
        return DefinitionError(
            f"condition {' and '.join(repr(names[i]) for i in which)}: it opens and closes with others only, as its own "
            "multiplier is not in its y, so that it is no surface by itself. simulate follows them, and "
            "find_equilibrium(system, near, mode=...) finds rest."
        )

    def _with(self, made: FilippovSystem, *more: ca.SX) -> OneSurface:
        """The result with functions for numbers."""
        x, rows = self.system.extended_states, self.kept()
        kept = ca.densify(ca.vertcat(*rows)) if rows else ca.SX(0, 1)
        gradient = ca.jacobian(kept, x)
        hessians = [ca.jacobian(gradient[k, :], x) for k in range(len(rows))]
        outputs = [kept, gradient, ca.vertcat(*hessians) if rows else ca.SX(0, x.numel()), *more]
        evaluate = Evaluator(
            ca.Function(
                "kept", [x, self.system.parameter_symbols], [ca.densify(e) for e in outputs]
            )
        )
        return OneSurface(self.kind, self.element, made, len(rows), evaluate)

    def kept(self) -> Sequence[ca.SX]:
        """Functions of the other closed elements, and of joints with their lower derivatives."""
        system, coupled, found = self.system, self.coupled, list[ca.SX]()
        m, c, every = system.surface_count, len(system.impacts), coupled.kept
        for i in self.elements:
            if self.letters[i] or i in system.algebraic or i == self.element:
                continue
            found.append(every[i])
            if i >= m:
                found.append(every[i + c])
            elif i in system.joints:
                found += coupled.lower[i]
        return found


def _with_sides(system: FilippovSystem, h: ca.SX | None, sides: Sequence[ca.SX]) -> FilippovSystem:
    """A system of the same states, time and parameters with these fields and nothing else."""
    d = system.definition
    fields = [ca.vertsplit(field[: system.dimension]) for field in sides]
    law: dict[str, Any] = {"field": fields[0]}
    if h is not None:
        law = {"surface": h, "above": fields[0], "below": fields[1]}
    return FilippovSystem(**d.frame(), **law)
