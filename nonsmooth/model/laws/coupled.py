"""All modes of several surfaces as one program, with the multipliers as numbers or as series.

On a surface that does not slide the multiplier is the number +1 or -1. On those that slide the
multipliers keep G_i = grad h_i . f(x, lambda) at zero: coefficient k of lambda enters coefficient k of
G linearly, with the matrix M = dG/dlambda at the start of the step (``MultiplierSeries``; also where
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
from ..numbering import FALL, LIMIT_FALL
from ..values import Array
from .degree import Degree, degree_of
from .evaluators import Evaluator
from .switches import Guard, event_guards

# error scales ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class ErrorScales:
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
        if len(members) == 1:  # what vanishes with h has no part in sliding
            h, others = system.definition.surfaces[members[0]], ca.vertcat(p, lam, reactions)
            acts = [not vanish_on([e], h, x, others) for e in entries]
            places = [own for own, is_there in zip(places, acts, strict=True) if is_there]
            entries = [e for e, is_there in zip(entries, acts, strict=True) if is_there]
        if not entries:
            continue
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

    def __init__(
        self, system: FilippovSystem, watched: Sequence[ca.SX] = (), by_degree: bool = False
    ):
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
        #: Of each surface, derivatives that vanish while it rests; the layer has the next one.
        self.lower: list[tuple[ca.SX, ...]] = [()] * self._surfaces
        if by_degree:
            for i, found in enumerate(self.degrees(field, lam, unknowns)):
                self.lower[i], self.layer[i] = found.lower, found.row
        stops = ca.vertcat(d.guards, *watched)
        stops = ca.densify(stops) if stops.numel() else ca.SX(0, 1)
        heights = ca.densify(ca.vertcat(d.surfaces, d.gaps))
        factor = ca.vertcat(*factors, *[ca.SX(1)] * len(system.impacts))
        self.outputs = [field, self.layer, heights, factor, stops]
        every = ca.vertcat(*unknowns, d.reactions)
        self.slope, self._every = ca.jacobian(self.layer, every), every
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

    def degrees(self, field: ca.SX, lam: ca.SX, unknowns: Sequence[ca.SX]) -> list[Degree]:
        """Relative degrees of the surfaces."""
        x, d, found = self.system.extended_states, self.system.definition, list[Degree]()
        scaled = [e for e, own in zip(unknowns, self.scaled, strict=True) if own]
        every = [*ca.vertsplit(lam), *scaled, *ca.vertsplit(d.reactions)]
        for i in range(self._surfaces):
            found.append(Degree((), self.layer[i]))
            if self.continuous[i] or self.system.nonlinear[i] or i in self.system.set_of:
                continue
            own = ca.vertcat(lam[i], unknowns[i]) if self.scaled[i] else lam[i]
            others = ca.vertcat(*[e for e in every if not ca.depends_on(own, e)])
            found[i] = degree_of(d.surfaces[i], self.layer[i], own, others, x, field)
        return found

    @property
    def kept(self) -> ca.SX:
        """What closed contacts and sliding surfaces keep at zero: h, gaps, their rates, lower derivatives."""
        d = self.system.definition
        return ca.vertcat(d.surfaces, d.gaps, d.gap_rates, *[e for own in self.lower for e in own])

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
        """Whether a multiplier makes no difference: on its surface, or at open contacts alone."""
        if i >= self._surfaces:
            return False
        carried = self.carriers[i]
        idle = bool(carried) and all(signs[self._surfaces + j] for j in carried)
        return self.continuous[i] or idle

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

    @cached_property
    def slope_symmetric(self) -> NDArray[np.bool_]:
        """Which pairs of those derivatives are equal, as those of mechanical systems are, by numbers (m, m)."""
        if not self.count:
            return np.zeros((0, 0), bool)
        function, rng = ca.Function("slope", self._symbols, [self.slope]), np.random.default_rng(1)
        equal = np.ones((self.count, self.count), bool)
        for _ in range(3):
            found = np.array(
                function(*[rng.uniform(0.2, 0.9, s.numel()) for s in self._symbols]), float
            )
            size = abs(found).max(initial=0.0)
            equal &= abs(found - found.T) <= 1e-12 * size
        return equal

    @cached_property
    def mixed(self) -> NDArray[np.bool_]:
        """Pairs of unknowns that do not enter the field linearly together (m, m)."""
        mixed = np.zeros((self.count, self.count), bool)
        for j in range(0 if self.affine else self.count):
            bent = ca.jacobian(self.columns_of_field[:, j], self._every)
            mixed[j, bent.sparsity().get_col()] = True
        return mixed

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
    def _error_scales(self) -> Evaluator:
        return self._evaluator([self.layer, self.slope, self.factors, *self.gradients])

    def _evaluator(self, outputs: Sequence[ca.SX]) -> Evaluator:
        return Evaluator(ca.Function("at", self._symbols, self.awake(outputs), {"cse": True}))

    def error_scales(self, x: Array, multipliers: Array, unknowns: Array, p: Array) -> ErrorScales:
        """Evaluate at an extended state, with lambda where nothing slides (else 0) and nu (else 0)."""
        values = self._error_scales.copied(self._inputs(x, multipliers, unknowns), p)
        layer, slope, factors, *gradients = values
        return ErrorScales(
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


def raised_of(system: FilippovSystem) -> Coupled:
    """Return the same with the derivatives of surfaces that their multipliers enter first in the layer."""

    def build() -> Coupled:
        plain = coupled_of(system)
        unknowns = [plain.unknown(i) for i in range(system.surface_count)]
        degrees = plain.degrees(plain.field, plain.multipliers, unknowns)
        return Coupled(system, by_degree=True) if any(own.lower for own in degrees) else plain

    return system.cached("raised", build)


# multipliers of a mode as power series ---------------------------------------------------------

#: A rate of leaving below this part of its terms is zero by rounding.
_STILL = 64 * np.finfo(float).eps

Outputs = Sequence[Sequence[float | None]]


def unit(h: Array) -> Array:
    """Direction of a vector of any size; NaN for zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        scaled = h / np.abs(h).max()
        return np.asarray(scaled / np.linalg.norm(scaled))


class Direction:
    """The series of h/|h|, order by order."""

    def __init__(self, size: int, order: int):
        self.radius = 0.0
        self.h, self.u = np.zeros((size, order + 1)), np.zeros((size, order + 1))
        self._root = np.zeros(order + 1)

    def push(self, k: int, h: Array) -> Array:
        """Coefficient k of the direction from that of h."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            if k == 0:
                largest = float(np.abs(h).max())
                self.radius = largest * float(np.linalg.norm(h / largest))
            own, root = self.h, self._root
            own[:, k] = h / self.radius
            # Along a line the products are those of the root, exactly so along an axis.
            curved = sum(_inner(row, k) for row in own) - _inner(root, k)
            root[k] = float(own[:, 0] @ own[:, k]) + 0.5 * curved if k else 1.0
            self.u[:, k] = own[:, k] - self.u[:, :k] @ root[k:0:-1]
        return self.u[:, k]


class MultiplierSeries:
    """The multipliers of one step."""

    def __init__(
        self,
        coupled: Coupled,
        mode: str,
        unknowns: Array,
        held: Array,
        slope: Array,
        factors: Array,
        order: int,
    ):
        self.mode, self.order = mode, order
        self.sliding = coupled.sliding(mode)
        self._slope = slope[np.ix_(self.sliding, self.sliding)]
        self._inverse: Array | None = None
        self.held, self.series = np.zeros((2, coupled.count, order + 1))
        self.limits = np.zeros((0, order + 1))
        self.held[:, 0] = held
        self.series[self.sliding, 0] = unknowns[self.sliding]
        sets = coupled.moving_sets(mode)
        self._off = {s: Direction(len(s), order) for s in sets if mode[s[0]] != "l"}
        self._leaving = [list(s) for s in sets if mode[s[0]] == "l"]
        for s in self._off:
            if mode[s[0]] == "b":
                self.series[list(s), 0] = unknowns[list(s)]
        self._radii = np.zeros((len(self._leaving), order + 2))
        if self._leaving:
            rates = slope * factors  # by the multipliers themselves
            columns = [i for s in self._leaving for i in s]
            self._rates = np.concatenate([slope[:, self.sliding], rates[:, columns]], axis=1)
        self.acting = self.series if not sets else np.zeros_like(self.series)
        self.acting[self.sliding, 0] = self.series[self.sliding, 0]

    def follow(self, k: int, heights: Sequence[float | None]) -> bool:
        """Coefficients k of what is h/|h|; whether there is any that was not known."""
        for s, direction in self._off.items():
            own = list(s)
            if self.mode[s[0]] == "b":
                h = self.series[own, k]
            else:
                h = np.array([heights[i] or 0.0 for i in own])
            self.held[own, k] = direction.push(k, h)
        return bool(self._off) and k > 0

    def solve(self, k: int, layer: Sequence[float | None]) -> bool:
        """Coefficients k of what keeps the rates where they have to be; whether there is any."""
        if self._leaving:
            self._leave(k, layer)
            return k > 0
        if not k or not self.sliding:
            return False
        residual = np.array([layer[i] or 0.0 for i in self.sliding])
        if self._inverse is None:
            self._inverse = _inverse(self._slope)
        self.series[self.sliding, k] = self.acting[self.sliding, k] = -self._inverse @ residual
        return True

    def close(self, k: int, layer: Sequence[float | None]) -> None:
        """Coefficients k + 1 of h that is carried along."""
        if k == self.order:
            return
        for s in self._off:
            if self.mode[s[0]] == "b":
                self.series[list(s), k + 1] = [(layer[i] or 0.0) / (k + 1) for i in s]
        for j, own in enumerate(self._leaving):
            radius, u = self._radii[j], self.held[own]
            self.series[own, k + 1] = u[:, : k + 1] @ radius[k + 1 : 0 : -1]

    def _leave(self, k: int, layer: Sequence[float | None]) -> None:
        """Coefficients k of the directions and k + 1 of the distances, with those of what slides."""
        rates = np.array([v or 0.0 for v in layer])
        if k == 0:
            for radius, own in zip(self._radii, self._leaving, strict=True):
                u, g = self.held[own, 0], rates[own]
                size = np.abs(u) @ (np.abs(g) + np.abs(self._rates[own]).sum(axis=1))
                rate = float(u @ g)
                radius[1] = rate if abs(rate) > _STILL * size else 0.0
            return
        slides, n = len(self.sliding), self._rates.shape[1]
        rows = [*self.sliding, *[i for own in self._leaving for i in own]]
        matrix = np.zeros((n + len(self._leaving),) * 2)
        right = np.zeros(n + len(self._leaving))
        matrix[:n, :n], right[:n] = self._rates[rows], -rates[rows]
        first = slides
        for j, (radius, own) in enumerate(zip(self._radii, self._leaving, strict=True)):
            u, last = self.held[own], first + len(own)
            here = slice(first, last)
            matrix[here, here] -= (k + 1) * radius[1] * np.eye(len(own))
            matrix[here, n + j] = -(k + 1) * u[:, 0]
            matrix[n + j, here] = u[:, 0]
            right[here] += (k + 1) * (u[:, 1:k] @ radius[k:1:-1])
            right[n + j] = -0.5 * float((u[:, 1:k] * u[:, k - 1 : 0 : -1]).sum())
            first = last
        found = _solve(matrix, right)
        self.series[self.sliding, k] = self.acting[self.sliding, k] = found[:slides]
        first = slides
        for j, own in enumerate(self._leaving):
            self.held[own, k] = found[first : first + len(own)]
            self._radii[j, k + 1] = found[n + j]
            first += len(own)

    def rows(self, heights: Array, factors: Array, coupled: Coupled) -> list[list[Array]]:
        """Series of the guards of each set: how far |h| has fallen, or how far friction can rise."""
        result: list[list[Array]] = []
        self.limits = factors[[s[0] for s in coupled.system.sets]]
        for s, limit in zip(coupled.system.sets, self.limits, strict=True):
            own, letter = list(s), self.mode[s[0]]
            if letter in "si":
                result.append(_on(self.series[own], limit, abs(limit[0]), coupled.scaled[s[0]]))
            elif letter == "l":
                j = self._leaving.index(own)
                result.append([self._radii[j, : self.order + 1]])
            else:
                h = heights[own] if letter == "*" else self.series[own]
                result.append([remaining(h, self._off[s].radius)])
        return result

    @property
    def directions(self) -> Array:
        """Series whose relative accuracy counts, whatever the size of the states."""
        rows: list[Array] = []
        for s, direction in self._off.items():
            if self.mode[s[0]] == "b":
                rows += [*direction.u, *direction.h]
        rows += [row for own in self._leaving for row in self.held[own]]
        return np.array(rows) if rows else np.zeros((0, self.order + 1))

    def radii(self, coupled: Coupled) -> Array:
        """|h| at the start for each set, and on it the magnitude of its factor (sets,)."""
        pairs = zip(coupled.system.sets, self.limits, strict=True)
        off = self._off
        return np.array([off[s].radius if s in off else abs(limit[0]) for s, limit in pairs])


def _inner(row: Array, k: int) -> float:
    """Coefficient k of a square, without its first and last products."""
    return float(row[1:k] @ row[k - 1 : 0 : -1]) if k > 1 else 0.0


def product(a: Array, b: Array) -> Array:
    """Product of two series of one length."""
    return np.convolve(a, b)[: len(a)]


def _on(unknowns: Array, factor: Array, size: float, scaled: bool) -> list[Array]:
    """Guards on a set: friction's limit is not reached, and has not fallen too far for its square."""
    rows = [room(unknowns, factor)]
    if scaled and size > 0.0:
        rows.append(remaining(factor[None, :], size, LIMIT_FALL))
    elif scaled:
        rows.append(np.eye(1, factor.size)[0])
    return rows


def remaining(h: Array, radius: float, fall: float = FALL) -> Array:
    """Series (k, n) of h to that of |h|^2/|h(0)|^2 - fall^2."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        scaled = h / radius
        total = sum((product(row, row) for row in scaled), np.zeros(h.shape[1]))
    total[0] -= fall * fall
    return np.asarray(total)


def room(unknowns: Array, factor: Array) -> Array:
    """Series of n^2 - |nu|^2, which is positive while |lambda| < 1."""
    used = sum((product(row, row) for row in unknowns), np.zeros(factor.size))
    return np.asarray(product(factor, factor) - used)


def set_values(
    coupled: Coupled, mode: str, unknowns: Array, heights: Array, factors: Array, radii: Array
) -> list[list[Array]]:
    """Values of the guards of all sets, as ``MultiplierSeries.rows``."""
    result: list[list[Array]] = []
    for s, radius in zip(coupled.system.sets, radii, strict=True):
        own, letter = list(s), mode[s[0]]
        if letter in "si":
            result.append(_on(unknowns[own], factors[own[0]], radius, coupled.scaled[own[0]]))
        elif letter == "l":
            result.append([np.array([np.linalg.norm(unknowns[own])])])
        else:
            result.append([remaining(heights[own] if letter == "*" else unknowns[own], radius)])
    return result


def _inverse(matrix: Array) -> Array:
    """Inverse of a matrix; NaN where it has none."""
    try:
        return np.asarray(np.linalg.inv(matrix), float)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)


def _solve(matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right), float)
    except np.linalg.LinAlgError:
        return np.full_like(right, np.nan)
