"""The functions of a system that the lanes call, printed from instructions of its modes.

Lanes of a vector may be in different modes of one surface. All are expanded together: the multiplier is +1 or -1
in lanes that do not slide, and in those that do it keeps the layer's rate at zero order by order, as in the driver.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from ..definition.system import FilippovSystem
from ..expressions.cancel import in_span
from ..expressions.linearity import bent
from ..expressions.simplification import simplified
from ..laws.coupled import Coupled, coupled_of
from .ccode import Program
from .jets import Expansion
from .terms import OfInstructions, Term, Terms


@dataclass(frozen=True)
class Shape:
    """Properties of the functions for the text of lanes."""

    rows: list[int]  # of the field, rows that a step is checked with
    slots: list[int]  # of the guards
    affine: list[bool]  # which guards are affine in the states
    #: Whether all is, sines of the time added: above, below and on the surface; or off a set, on it and where it is left.
    affine_modes: list[bool]
    own: Sequence[int] = ()  # states that a set's functions are, if they are


def lanes_program(system: FilippovSystem, order: int) -> tuple[str, Shape]:
    """C of ``jet``, ``surface_values``, ``lie_values``, ``stop_values``, ``check_values``."""
    writer = _Writer(coupled_of(system))
    shape = writer.shape()
    jet, guards = writer.expanded(order)
    program = Program(writer.graph, ("I", "I", "T"))
    program.add("jet", c=[c for row in jet for c in row], g=[c for row in guards for c in row])
    for name, values, gradient in writer.values():
        program.add(
            f"{name}_values", **{"h" if name == "surface" else "value": values}, gradient=gradient
        )
    if shape.rows or shape.slots:
        rows, slots = [jet[i][1] for i in shape.rows], [guards[j][0] for j in shape.slots]
        program.add("check_values", f=rows, g=slots)
    return program.text(), shape


class _Writer(OfInstructions):
    """The modes of a system with one surface or none."""

    def __init__(self, coupled: Coupled):
        super().__init__(coupled)
        self.slides, _, self.lam = self.graph.inputs(2, 3)

    def expanded(self, order: int) -> tuple[list[list[Term | None]], list[list[Term | None]]]:
        """Coefficients of states and of guards, in rows."""
        jet = self.begun()
        guards: list[Terms] = []
        every = self.expansion(range(5))
        sides = [self.expansion((1,)) for _ in range(2)]
        for k in range(order + 1):
            now = [row[k] for row in jet]
            field, layer, heights, factors, stops = every.advance(k, [*now, *self._held(None)])
            if self.m:
                unknown = self._unknown(k, layer[0], factors[0])
                field, _, heights, _, stops = every.again(k, [*now, *unknown], self.late)
                field = list(field)
                for i in self._kept:
                    field[i] = self.graph.select(self.slides, None, field[i])
                above, below = self._rates(k, now, layer[0], factors[0], sides)
                height = self.graph.inner([self.lam], heights)
                leaves = None if above is None else -above
                stops = [self.graph.select(self.slides, leaves, height), below, *stops]
            guards.append(stops)
            self.extend(jet, field, k, order)
        return jet, [list(row) for row in zip(*guards, strict=True)]

    @cached_property
    def _kept(self) -> list[int]:
        """The state that a surface of one state keeps: rounding in its rate would move what rests."""
        x, h = self.coupled.system.extended_states, self.coupled.system.surface_function(0)
        own = [i for i in range(x.numel()) if ca.depends_on(h, x[i])]
        alone = len(own) == 1 and own[0] < self.coupled.system.dimension
        return own if alone and not self.coupled.continuous[0] else []

    def _held(self, multiplier: float | None) -> list[Term | None]:
        """The multiplier as a number, and none of its unknown."""
        held = None if multiplier is None else self.graph.constant(multiplier)
        return [held, *[None] * sum(self.coupled.scaled)] if self.m else []

    def _unknown(self, k: int, rate: Term | None, factor: Term | None) -> list[Term | None]:
        """Coefficients k of multiplier and unknown, from that of the layer's rate without them."""
        keeps, side = None, None if k else self.lam
        if not self.coupled.continuous[0]:
            if self._slope is not None:
                keeps = None if rate is None else -rate / self._slope
            elif k == 0:
                keeps = self.graph.constant(math.nan)
        if not self.coupled.scaled[0]:
            return [self.graph.select(self.slides, keeps, side)]
        if self._acts_alone:
            side = self.graph.scaled(self.lam, factor)
            return [None, self.graph.select(self.slides, keeps, side)]
        return [self.graph.select(self.slides, e, o) for e, o in ((None, side), (keeps, None))]

    def _rates(
        self, k: int, now: Terms, rate: Term | None, factor: Term | None, sides: Sequence[Expansion]
    ) -> list[Term | None]:
        """Coefficients k of the surface's rates above and below."""
        graph, m = self.graph, self._slope
        if m is None or not graph.is_still(m) or (self.coupled.scaled[0] and not self._acts_alone):
            held = [self._held(None if k else sign) for sign in (1.0, -1.0)]
            return [e.advance(k, [*now, *own])[0][0] for e, own in zip(sides, held, strict=True)]
        part = graph.scaled(m, factor)
        return [graph.total(rate, part), graph.total(rate, None if part is None else -part)]

    @cached_property
    def _acts_alone(self) -> bool:
        """Whether the unknown replaces the multiplier everywhere in the field."""
        columns = [
            ca.jacobian(self.coupled.field, e)
            for e in (self.coupled.multipliers, self.coupled.unknown(0))
        ]
        return columns[0].sparsity().row() == columns[1].sparsity().row()

    @cached_property
    def _slope(self) -> Term | None:
        """The derivative of the layer's rate by the unknown."""
        return self.point(self._held(None)).slope[0]

    def values(self) -> list[tuple[str, Terms, Terms]]:
        """Surface, its rates on both sides, and stops, each with its gradient."""
        stops = ("stop", *self.stops())
        if not self.m:
            return [stops]
        above, below = (self.point(self._held(sign)) for sign in (1.0, -1.0))
        gradients = [*above.layer_gradient, *below.layer_gradient]
        rates = ("lie", [above.layer[0], below.layer[0]], gradients)
        return [("surface", *self.surfaces()), rates, stops]

    def shape(self) -> Shape:
        """Return the affine parts; a function that is a combination of rows of the field is checked with them."""
        of, system = self.coupled, self.coupled.system
        x, p, unknowns = (
            system.extended_states,
            system.parameter_symbols,
            of.symbols_of(range(self.m)),
        )
        every = [ca.vertcat(of.field, of.layer, of.factors)]
        every = simplified([of.moving, p], every, [True, False])
        beyond = bent(every[0], ca.vertcat(x, unknowns), system.definition.time)
        rows, others = (
            [i for i in range(self.n) if beyond[i]],
            ca.vertcat(p, *ca.vertsplit(of.moving)[self.n :]),
        )
        for i in reversed(rows):
            rest = [j for j in rows if j != i]
            if in_span([of.field[i]], [of.field[j] for j in rest], x, others)[0]:
                rows = rest
        guards = [(2 * self.m + k, e) for k, e in enumerate(ca.vertsplit(of.stops)) if e.numel()]
        if self.m:
            sides = [(j, system.lie_derivative(side)) for j, side in enumerate("+-")]
            guards = [(0, system.surface_function(0)), *sides, *guards]
        functions = [e for _, e in guards]
        known = in_span(functions, [of.field[i] for i in rows], x, others)
        curved = [not ca.is_linear(e, x) for e in functions]
        slots = {
            j
            for (j, _), is_known, c in zip(guards, known, curved, strict=True)
            if c and not is_known
        }
        affine = [True] * (2 * self.m + of.stops.numel())
        for (j, _), is_curved in zip(guards, curved, strict=True):
            affine[j] &= not is_curved
        sliding = not any(beyond) and not any(of.linearity.bent_guards)
        return Shape(rows, sorted(slots), affine, [of.linearity.free] * 2 + [sliding])
