"""All modes of several surfaces as one program, with the multipliers as numbers or as series.

On a surface that does not slide the multiplier is the number +1 or -1. On those that slide the
multipliers keep G_i = grad h_i . f(x, lambda) at zero: coefficient k of lambda enters coefficient k of
G linearly, with the matrix M = dG/dlambda at the start of the step (``multiplier_series``; also where
lambda enters nonlinearly: hidden dynamics). The size does not grow with the number of modes.

Where the field is affine in all multipliers and what multiplies lambda_i has a factor n_i(x), the
unknown is nu_i = n_i lambda_i (``factors``).

Source: Acary & Brogliato 2008, "Numerical methods for nonsmooth dynamical systems", for the
complementarity of several surfaces; Jeffrey 2018 for hidden dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..definition.system import FilippovSystem
from ..expressions.cancel import cancel_common_factor
from ..expressions.float_arithmetic import Numbers
from ..expressions.graph import depends_on, instructions
from ..expressions.identity import vanish_on
from ..expressions.jets import Expansion
from ..expressions.linearity import linearity
from ..expressions.simplification import simplified
from ..expressions.taylor_rules import lower, touched
from ..expressions.unused_terms import without_unused_terms
from ..values import Array
from .evaluators import Evaluator
from .multiplier_series import MultiplierSeries, unit
from .switches import Guard, event_guards

# error scales ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Yardsticks:
    """Numbers at the start of a step."""

    layer: Array
    slope: Array
    factors: Array
    layer_gradient: Array
    surface_gradient: Array
    stop_gradient: Array
    factor_gradient: Array


# factors of multipliers ------------------------------------------------------------------------


def with_factors(system: FilippovSystem, lam: ca.SX) -> tuple[ca.SX, list[ca.SX], list[ca.SX]]:
    """Return the field in lambda, reactions and nu, with the factors taken out."""
    x, p, reactions = system.extended_states, system.parameter_symbols, system.definition.reactions
    field = plain = system.field_with(lam, reactions)
    factors, unknowns = [ca.SX(1)] * system.surface_count, [*ca.vertsplit(lam)][: lam.numel()]
    known, variables = ca.vertcat(p, lam), ca.vertcat(x, reactions)
    columns = ca.jacobian(plain, lam)
    for members in system.entries:  # a set has one factor
        places = [(row, i) for i in members for row in columns[:, i].sparsity().row()]
        entries = [e for i in members for e in columns[:, i].nonzeros()]
        column = ca.vertcat(*entries)
        if ca.depends_on(column, lam) or not ca.depends_on(column, variables):
            continue  # products of multipliers, or hidden dynamics; a constant
        reduced, factor = cancel_common_factor(entries, variables, known)
        if ca.depends_on(factor, variables):
            field = ca.SX(field)
            for i in members:
                factors[i], unknowns[i] = factor, ca.SX.sym(f"nu{i}")
            for (row, i), entry in zip(places, reduced, strict=True):
                field[row] += unknowns[i] * entry  # lambda_i is 0 while the surface slides
    return field, factors, unknowns


class Coupled:
    """Series of states, surfaces, stops and multipliers of a system in any mode."""

    def __init__(self, system: FilippovSystem, watched: Sequence[ca.SX] = ()):
        self.system, d = system, system.definition
        self._surfaces, self._watched = system.surface_count, len(watched)
        #: Surfaces and impacts: the letters of a mode.
        self.count = self._surfaces + len(system.impacts)
        x = system.extended_states
        lam = ca.vertcat(*[ca.SX.sym(f"lambda{i}") for i in range(self._surfaces)])
        field, factors, unknowns = with_factors(system, lam)
        self.scaled = tuple(not f.is_one() for f in factors)
        self._scaled = np.array([*self.scaled, *[False] * len(system.impacts)], bool)
        #: Impacts whose reaction a surface's multiplier is multiplied with: friction at a contact.
        self.carriers = tuple(
            [j for j in range(len(system.impacts)) if ca.depends_on(f, d.reactions[j])]
            for f in factors
        )
        self.continuous = tuple(self._is_continuous(i) for i in range(self._surfaces))
        extra = [n for n, scaled in zip(unknowns, self.scaled, strict=True) if scaled]
        self.moving = ca.vertcat(x, lam, d.reactions, *extra)
        self._symbols = [self.moving, system.parameter_symbols]
        self._stable: dict[tuple[int, ...], list[ca.SX]] = {}
        self._series: dict[tuple[int, ...], tuple[Expansion, list[int]]] = {}
        self.layer = ca.densify(ca.jtimes(ca.vertcat(d.surfaces, d.gap_rates), x, field))
        stops = ca.vertcat(d.guards, *watched)
        stops = ca.densify(stops) if stops.numel() else ca.SX(0, 1)
        heights = ca.densify(ca.vertcat(d.surfaces, d.gaps))
        factor = ca.vertcat(*factors, *[ca.SX(1)] * len(system.impacts))
        self.outputs = [field, self.layer, heights, factor, stops]
        every = ca.vertcat(*unknowns, d.reactions)
        self.slope = ca.jacobian(self.layer, every)
        #: Whether the unknown multipliers of a mode enter linearly together.
        self.affine = bool(ca.is_linear(field, every))
        guards, rest = ca.vertcat(heights, stops), (x, every, not system.sets, d.time)
        self.linearity = linearity(field, self.layer, guards, factor, *rest)
        #: Of layer, of surfaces and gaps, of stops and resets, and of factors, by the states.
        self.gradients = [ca.jacobian(e, x) for e in (self.layer, heights, stops, factor)]
        self.columns_of_field = ca.jacobian(field, every)

    def _is_continuous(self, surface: int) -> bool:
        """Whether the multiplier makes no difference on its surface: it is 0 there."""
        if surface in self.system.set_of:
            return False
        d, x = self.system.definition, self.system.extended_states
        column = ca.jacobian(d.field, d.multipliers[surface])
        pieces = [e for e in ca.vertsplit(ca.densify(column)) if not e.is_zero()]
        h, others = d.surfaces[surface], ca.vertcat(d.parameters, d.multipliers, d.reactions)
        return all(ca.depends_on(e, x) for e in pieces) and vanish_on(pieces, h, x, others)

    # shape -------------------------------------------------------------------------------------

    def held(self, mode: str) -> Array:
        """Multipliers that are known in a mode: +1 and -1; 0 for the others and open contacts."""
        signs = np.array(self.system.parse_letters(mode), float)
        signs[self._surfaces :] = 0.0
        signs[list(self.system.set_of)] = 0.0
        return signs

    def known_multipliers(self, mode: str, x: Array, unknowns: Array, p: Array) -> Array:
        """Multipliers at a state that are known in a mode."""
        held = self.held(mode)
        for members in self.moving_sets(mode):
            own = list(members)
            h = self.heights_at(x, p)[own] if mode[own[0]] == "*" else unknowns[own]
            held[own] = unit(h)
        return held

    def moving_sets(self, mode: str) -> list[tuple[int, ...]]:
        """Sets off which a mode is, or which it leaves."""
        return [s for s in self.system.sets if self.system.widened(mode)[s[0]] in "*bl"]

    def acting(self, mode: str, unknowns: Array) -> Array:
        """Unknowns that multiply the field: not what is kept of sets that are left."""
        slides = np.array(self.system.parse_letters(mode)) == 0
        return np.where(slides, unknowns, 0.0) if self.system.sets else unknowns

    def heights_at(self, x: Array, p: Array) -> Array:
        """Switching functions and gaps (m,) at an extended state."""
        build = lambda: Evaluator(self.system.function("heights", lambda: [self.heights]))
        return self.system.cached("heights at", build).copied(x, p)[0].ravel()

    def sliding(self, mode: str) -> list[int]:
        """Surfaces that slide and contacts that are closed, with multipliers that are unknown."""
        signs = self.system.parse_letters(mode)
        return [i for i, sign in enumerate(signs) if sign == 0 and not self._is_idle(i, signs)]

    def _is_idle(self, i: int, signs: Sequence[int]) -> bool:
        """Whether a multiplier makes no difference: on its surface, or at an open contact."""
        if i >= self._surfaces:
            return False
        open_ones = [j for j in self.carriers[i] if signs[self._surfaces + j]]
        return self.continuous[i] or bool(open_ones)

    def guards(self, mode: str) -> tuple[Guard, ...]:
        """Guards of a mode: surfaces and exits, stops and resets, stability of sliding."""
        result, contacts = list[Guard](), len(self.system.entries)
        for i, sign in enumerate(self.system.parse_letters(mode)):
            j = i - self._surfaces
            if j >= 0:
                result.append(Guard("impact" if sign else "release", j, sign, contacts + j))
            elif i in self.system.set_of:
                result += self._guards_of_set(i, mode[i])
            elif sign:
                result.append(Guard("surface", i, sign, self.system.entry_of(i)))
            else:
                result += [Guard("exit", i, side, self.system.entry_of(i)) for side in (1, -1)]
        result += event_guards(self.system)
        result += [Guard("zero", k, 0, k) for k in range(self._watched)]
        sliding = self.sliding(mode)
        first = next((i for i in sliding if i < self._surfaces), 0)
        branches = len(self._changing(sliding))
        of_first = self.system.entry_of(first) if self._surfaces else 0
        return (*result, *[Guard("branch", first, 0, of_first)] * branches)

    def _guards_of_set(self, i: int, letter: str) -> list[Guard]:
        """Those of the set that begins with a switching function."""
        if i != self.system.set_of[i][0] or letter == "i":
            return []
        k = self.system.entry_of(i)
        near = [Guard("near", i, 0, k)]
        return [Guard("slip", i, 0, k), *near * self.scaled[i]] if letter == "s" else near

    @cached_property
    def slope_moves(self) -> NDArray[np.bool_]:
        """Which derivatives of the layer's rates by the unknowns change along a motion (m, m)."""
        moves = np.zeros((self.count, self.count), bool)
        sparsity = self.slope.sparsity()
        for i, j in zip(sparsity.row(), sparsity.get_col(), strict=True):
            moves[i, j] = ca.depends_on(self.slope[i, j], self.moving)
        return moves

    def _changing(self, sliding: Sequence[int]) -> list[int]:
        """Unknowns that the stability of sliding is read from."""
        if len(sliding) == 2 and max(sliding) < self._surfaces:
            return list(sliding) if self.slope_moves[np.ix_(sliding, sliding)].any() else []
        return [i for i in sliding if self.slope_moves[i, i]]

    def _stability(self, sliding: Sequence[int]) -> list[ca.SX]:
        """Functions that pass zero where sliding loses its stability across the layer."""
        # The slope of one multiplier, determinant and trace of that of two; of more, or with contacts,
        # its diagonal, each of which has to keep its sign.
        changing = self._changing(sliding)
        if len(sliding) == 2 and len(changing) == 2 and max(sliding) < self._surfaces:
            if (pair := tuple(changing)) not in self._stable:
                both = ca.densify(self.slope[changing, changing])
                self._stable[pair] = [ca.det(both), ca.trace(both)]
            return self._stable[pair]
        return [self.slope[i, i] for i in changing]

    # expressions --------------------------------------------------------------------------------

    @property
    def field(self) -> ca.SX:
        """The field in states, multipliers, reactions and nu."""
        return self.outputs[0]

    @property
    def heights(self) -> ca.SX:
        """Switching functions and gaps."""
        return self.outputs[2]

    @property
    def factors(self) -> ca.SX:
        """The factors n_i of surfaces and contacts; 1 where there is none."""
        return self.outputs[3]

    @property
    def stops(self) -> ca.SX:
        """Functions of stops and resets."""
        return self.outputs[4]

    @property
    def multipliers(self) -> ca.SX:
        """The symbols lambda_i of the surfaces."""
        n = self.system.extended_dimension
        return self.moving[n : n + self._surfaces]

    def unknown(self, i: int) -> ca.SX:
        """The symbol of the unknown of a surface or contact: lambda_i, a reaction, or nu_i."""
        n = self.system.extended_dimension
        scaled = i < self._surfaces and self.scaled[i]
        return self.moving[n + self.count + sum(self.scaled[:i]) if scaled else n + i]

    def symbols_of(self, which: Sequence[int]) -> ca.SX:
        """The symbols of several unknowns (SX column)."""
        return ca.vertcat(*[self.unknown(i) for i in which]) if which else ca.SX(0, 1)

    def held_at(self, mode: str, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Expressions with the multipliers that are known in a mode; unknowns stay symbols."""
        n = self.system.extended_dimension
        held = ca.SX([*self.held(mode), *[0.0] * sum(self.scaled)])
        rest = self.moving[n:]
        for i in self.sliding(mode):
            own = self.unknown(i)
            for k in range(rest.numel()):
                if ca.is_equal(rest[k], own):
                    held[k] = own
        return [ca.substitute(e, rest, held) for e in expressions]

    def awake(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Dense expressions in ``moving``, for numbers: terms that a mode leaves out are not looked at."""
        n, m, places = self.system.extended_dimension, self._surfaces, self.moving.numel()
        held: dict[int, tuple[float, ...]] = dict.fromkeys(range(n + m, places), (0.0,))
        for i in range(m):
            signs = () if i in self.system.set_of else (1.0, -1.0)
            held[n + i] = (*signs, 0.0) if self.scaled[i] else signs
        return without_unused_terms(self._symbols, [ca.densify(e) for e in expressions], held)

    # numbers -----------------------------------------------------------------------------------

    @cached_property
    def _yardsticks(self) -> Evaluator:
        return self._evaluator([self.layer, self.slope, self.factors, *self.gradients])

    def _evaluator(self, outputs: Sequence[ca.SX]) -> Evaluator:
        return Evaluator(ca.Function("at", self._symbols, self.awake(outputs), {"cse": True}))

    def yardsticks(self, x: Array, multipliers: Array, unknowns: Array, p: Array) -> Yardsticks:
        """Evaluate at an extended state, with lambda where nothing slides (else 0) and nu (else 0)."""
        values = self._yardsticks.copied(self._inputs(x, multipliers, unknowns), p)
        layer, slope, factors, *gradients = values
        return Yardsticks(
            layer.ravel(), slope, factors.ravel(), *[np.abs(gradient) for gradient in gradients]
        )

    def columns(self, x: Array, multipliers: Array, p: Array) -> Array:
        """Derivatives of the field by the unknowns (N, m), with the multipliers held."""
        return self._columns.copied(self._inputs(x, multipliers, np.zeros(self.count)), p)[0]

    @cached_property
    def _columns(self) -> Evaluator:
        return self._evaluator([self.columns_of_field])

    def _inputs(self, x: Array, multipliers: Array, unknowns: Array) -> Array:
        scaled = self._scaled
        return np.concatenate([x, multipliers + np.where(scaled, 0.0, unknowns), unknowns[scaled]])

    def values(
        self, x: Array, multipliers: Array, unknowns: Array, p: Array
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Field (N,), layer G (m,), surfaces (m,), factors (m,), stops and resets (s,) at a point."""
        found = self._values.copied(self._inputs(x, multipliers, unknowns), p)
        field, layer, h, factors, stops = (v.ravel() for v in found)
        return field, layer, h, factors, stops

    @cached_property
    def _values(self) -> Evaluator:
        return self._evaluator(self.outputs)

    def _expansion(self, mode: str) -> tuple[Expansion, list[int]]:
        """Return the expansion for a mode, and the rules that the unknowns enter."""
        stability = self._stability(self.sliding(mode))
        key = tuple(self.sliding(mode)) if stability else ()
        if key not in self._series:
            outputs = [*self.outputs, ca.vertcat(*stability) if stability else ca.SX(0, 1)]
            outputs = simplified(self._symbols, self.awake(outputs), [True, False])
            nodes, rows = instructions(self._symbols, outputs)
            rules, rule_of = lower(nodes, depends_on(nodes, [True, False]))
            rows = [[rule_of[j] for j in row] for row in rows]
            late = touched(rules, self.system.extended_dimension)
            self._series[key] = Expansion(rules, rows, [], Numbers()), late
        return self._series[key]

    def jets(self, law: MultiplierSeries, x: Array, p: Array) -> tuple[Array, Array]:
        """Taylor coefficients in a mode."""
        expansion, late = self._expansion(law.mode)
        expansion.restart([v or None for v in p.tolist()])
        order = law.order
        states = np.zeros((x.size, order + 1))
        states[:, 0] = x
        found: list[list[list[float]]] = []
        for k in range(order + 1):
            outputs = expansion.advance(k, self._now(states[:, k], law, k))
            if law.follow(k, outputs[2]):
                outputs = expansion.again(k, self._now(states[:, k], law, k), late)
            if law.solve(k, outputs[1]):
                outputs = expansion.again(k, self._now(states[:, k], law, k), late)
            law.close(k, outputs[1])
            numbers = [[v or 0.0 for v in row] for row in outputs]
            found.append(numbers[1:])
            if k < order:
                states[:, k + 1] = np.array(numbers[0]) / (k + 1)
        parts = [np.array([numbers[j] for numbers in found]).T for j in range(5)]
        of_sets = law.rows(parts[1], parts[2], self) if self.system.sets else []
        return states, self.rows(law.mode, law.series, of_sets, *parts)

    def _now(self, states: Array, law: MultiplierSeries, k: int) -> list[float | None]:
        """Coefficients k of the moving inputs: states, lambda and reactions, nu."""
        values = self._inputs(states, law.held[:, k], law.acting[:, k])
        return [v or None for v in values.tolist()]

    def rows(
        self,
        mode: str,
        series: Array,
        of_sets: Sequence[list[Array]],
        layer: Array,
        heights: Array,
        factors: Array,
        stops: Array,
        stability: Array | None = None,
    ) -> Array:
        """Guards of a mode, from coefficients or values (rows) of what they are made of."""
        rows: list[Array] = []
        signs, first = self.system.parse_letters(mode), [s[0] for s in self.system.sets]
        for i, sign in enumerate(signs):
            if i in self.system.set_of:
                rows += of_sets[first.index(i)] if i in first and mode[i] != "i" else []
            elif sign:
                rows.append(sign * heights[i])
            elif i >= self._surfaces:
                rows.append(series[i])
            elif self._is_idle(i, signs):
                rows += [-layer[i], layer[i]]
            else:
                turn = _sign(factors[i])
                rows += [turn * (factors[i] - series[i]), turn * (factors[i] + series[i])]
        rows += [*stops, *[_sign(row) * row for row in (() if stability is None else stability)]]
        return np.array(rows) if rows else np.zeros((0, *np.shape(series)[1:]))


def _sign(row: Array) -> float:
    return float(np.sign(next((v for v in np.ravel(row) if v), 1.0)))  # just after its start


def coupled_of(system: FilippovSystem) -> Coupled:
    """Return the program of all modes of a system, built once."""
    return system.cached("coupled", lambda: Coupled(system))
