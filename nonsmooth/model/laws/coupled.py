"""All modes of several surfaces as one program, with the multipliers as inputs.

On a surface that does not slide the multiplier is the number +1 or -1. On those that slide the
multipliers keep G_i = grad h_i . f(x, lambda) at zero: coefficient k of lambda enters coefficient k of
G linearly, with the matrix M = dG/dlambda at the start of the step (also where lambda enters
nonlinearly: hidden dynamics). The size does not grow with the number of modes.

Where the field is affine in all multipliers and the coefficient of lambda_i has a factor n_i(x), the
unknown is nu_i = n_i lambda_i (``factors``).

Source: Acary & Brogliato 2008, "Numerical methods for nonsmooth dynamical systems", for the
complementarity of several surfaces; Jeffrey 2018 for hidden dynamics.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..definition.complementarity import rate_of
from ..definition.roots import gate_roots, roots_of
from ..definition.system import FilippovSystem
from ..expressions.cancel import cancel_common_factor
from ..expressions.identity import that_vanish_on, vanish_on
from ..expressions.linearity import linearity
from ..expressions.long_sums import LongSums, long_sums
from ..expressions.unused_terms import without_unused_terms
from ..values import Array
from .evaluators import Evaluator, evaluator

#: Slopes of conditions are regular if eigenvalues are above this part of them and of those of the rates.
_REGULAR = 1e-3


@dataclass(frozen=True)
class LayerValues:
    """Rates G (m,) at a point, their slope by the unknowns (m, m), factors of the multipliers (m,)."""

    layer: Array
    slope: Array
    factors: Array


# relative degrees -------------------------------------------------------------------------------

# The first derivative of a switching function along the motion that its multiplier enters. Source: Isidori 1995,
# Nonlinear Control Systems, chapter 4; Levant 1993 for sliding of higher order.

#: Largest relative degree.
_MOST = 4


@dataclass(frozen=True)
class Degree:
    """One switching function: derivatives that vanish while it rests, and the one that its multiplier enters."""

    lower: tuple[ca.SX, ...]
    row: ca.SX


def degree_of(
    h: ca.SX, rate: ca.SX, own: ca.SX, others: Callable[[], ca.SX], x: ca.SX, field: ca.SX
) -> Degree:
    """Relative degree of ``h``, of this ``rate``, for the unknowns ``own``; 1 where others enter first."""
    first, lower = Degree((), rate), list[ca.SX]()
    if not ca.depends_on(rate, own) and _distance(h, own, x, field) > _MOST:
        return first
    while len(lower) < _MOST:
        if ca.depends_on(rate, own):
            if not _vanishes(ca.jacobian(rate, own), h, x):
                return Degree(tuple(lower), rate)
            rate = ca.substitute(rate, own, ca.SX.zeros(own.numel(), 1))
        if ca.depends_on(rate, others()):
            return first
        lower.append(rate)
        rate = ca.densify(ca.jtimes(rate, x, field))
    return first


def _distance(h: ca.SX, own: ca.SX, x: ca.SX, field: ca.SX) -> int:
    """Number of derivatives after which the sparsity alone lets the unknowns ``own`` enter."""
    moved = [bool(ca.depends_on(f, own)) for f in ca.vertsplit(field)]
    reads = [ca.symvar(f) for f in ca.vertsplit(field)]
    index = {symbol.element_hash(): k for k, symbol in enumerate(ca.vertsplit(x))}
    states = _indices(ca.symvar(h), index)
    for order in range(1, _MOST + 1):
        if any(moved[i] for i in states):
            return order
        states |= {j for i in states for j in _indices(reads[i], index)}
    return _MOST + 1


def _indices(symbols: Sequence[ca.SX], index: dict[int, int]) -> set[int]:
    return {index[s.element_hash()] for s in symbols if s.element_hash() in index}


def _vanishes(column: ca.SX, h: ca.SX, x: ca.SX) -> bool:
    """Whether the coefficient of an unknown is zero wherever ``h`` is."""
    pieces = [e for e in ca.vertsplit(ca.densify(column.T)) if not e.is_zero()]
    return all(ca.depends_on(e, x) for e in pieces) and vanish_on(pieces, h, x)


# factors of multipliers ------------------------------------------------------------------------


def with_factors(system: FilippovSystem, lam: ca.SX) -> tuple[ca.SX, list[ca.SX], list[ca.SX]]:
    """Return the field in lambda, reactions and nu, with the factors taken out."""
    x, p, reactions = system.extended_states, system.parameter_symbols, system.definition.reactions
    field = plain = system.field_with(lam, reactions)
    factors, unknowns = [ca.SX(1)] * system.surface_count, [*ca.vertsplit(lam)][: lam.numel()]
    known, variables = ca.vertcat(p, lam), ca.vertcat(x, reactions)
    ones = [ca.SX(1)] * system.surface_count
    roots = gate_roots(system.definition.field, _surfaces(system), x, ones)[1]
    columns = ca.jacobian(plain, lam)
    for members in system.entries:  # a set has one factor
        if members[0] in (*system.half_lines, *system.joints, *system.definition.breakpoints):
            continue
        positions = [(row, i) for i in members for row in columns[:, i].sparsity().row()]
        entries = [e for i in members for e in columns[:, i].nonzeros()]
        column = ca.vertcat(*entries)
        if ca.depends_on(column, lam) or not ca.depends_on(column, variables):
            continue  # products of multipliers, or hidden dynamics; a constant
        if len(members) == 1:  # terms that vanish with h do not act in sliding
            h = system.definition.surfaces[members[0]]
            acts = [not vanishes for vanishes in that_vanish_on(entries, h, x)]
            positions = [own for own, is_there in zip(positions, acts, strict=True) if is_there]
            entries = [e for e, is_there in zip(entries, acts, strict=True) if is_there]
        if not entries:
            continue
        reduced, factor = cancel_common_factor(entries, variables, known)
        for e, part in zip(entries, reduced, strict=True):
            if (
                not roots and part.is_constant()
            ):  # the factor as the field has it, so that one series serves both
                reduced, factor = [own / part for own in reduced], e
                break
        if ca.depends_on(factor, variables):
            field = ca.SX(field)
            for i in members:
                factors[i], unknowns[i] = factor, ca.SX.sym(f"nu{i}")
            for (row, i), entry in zip(positions, reduced, strict=True):
                field[row] += unknowns[i] * entry  # lambda_i is 0 while the surface slides
    return field, factors, unknowns


def combinable(system: FilippovSystem) -> tuple[int, ...]:
    """Conditions of degree 0 whose closed ones may leave equations of the states alone, with constant weights."""
    d, x, own = system.definition, system.extended_states, list(system.algebraic)
    if not own:
        return ()
    slope = ca.densify(ca.jacobian(d.surfaces[own], d.multipliers))
    if ca.depends_on(slope, x):
        return ()
    rate = ca.densify(ca.jacobian(rate_of(d, d.surfaces[own]), d.multipliers))
    if slope.is_constant() and rate.is_constant() and len(own) == len(system.half_lines):
        matrix, of_rate = (np.array(ca.DM(e[:, own])) for e in (slope, rate))
        least = np.linalg.eigvalsh((matrix + matrix.T) / 2)[0]
        if least > _REGULAR * max(abs(matrix).max(), abs(of_rate).max()):
            return ()  # no matrix of closed ones is singular, or nearly so
    return tuple(own)


class Coupled:
    """Series of states, surfaces, stops and multipliers of a system in any mode.

    With ``combines`` the layer's rows of conditions of degree 0 are sums over all of them, with weights that follow
    the parameters: of y first, then of the rates of y without those of the multipliers (``flow/core/laws/hidden.c``).
    """

    def __init__(self, system: FilippovSystem, by_degree: bool = False, combines: bool = False):
        self.system, d = system, system.definition
        self._surfaces = system.surface_count
        #: Surfaces and impacts: the letters of a mode.
        self.count = self._surfaces + len(system.impacts)
        x = system.extended_states
        lam = ca.vertcat(*[ca.SX.sym(f"lambda{i}") for i in range(self._surfaces)])
        field, factors, unknowns = with_factors(system, lam)
        #: Exponents of the roots of surfaces in the field; 0 where there is none.
        self.powers: list[float] = [0.0] * self._surfaces
        if by_degree:
            field = self._without_roots(field, lam, factors, unknowns)
        self.scaled = tuple(
            not f.is_one() or power > 0.0 for f, power in zip(factors, self.powers, strict=True)
        )
        self._scaled = np.array([*self.scaled, *[False] * len(system.impacts)], bool)
        #: Impacts whose reaction a surface's multiplier is multiplied with: friction at a contact.
        self.carriers = tuple(
            [j for j in range(len(system.impacts)) if ca.depends_on(f, d.reactions[j])]
            for f in factors
        )
        columns = ca.jacobian(d.field, d.multipliers)
        self.continuous = tuple(
            self._is_continuous(i, columns[:, i].nonzeros()) for i in range(self._surfaces)
        )
        extra = [n for n, scaled in zip(unknowns, self.scaled, strict=True) if scaled]
        self.moving = ca.vertcat(x, lam, d.reactions, *extra)
        h = ca.SX(d.surfaces)
        if system.algebraic:
            h = ca.substitute(h, d.multipliers, lam)
        self.layer = ca.densify(ca.jtimes(ca.vertcat(h, d.gap_rates), x, field))
        #: Conditions whose rows of the layer are combined.
        self.combined = list(combinable(system)) if combines else []
        weights = self._combine(h)
        self._symbols = [self.moving, ca.vertcat(system.parameter_symbols, weights)]
        degrees = self.degrees(field, lam, unknowns) if by_degree or system.joints else []
        #: Of each surface, derivatives that vanish while it rests; the layer has the next one.
        self.lower: list[tuple[ca.SX, ...]] = self._rest(h, lam, degrees, by_degree)
        stops = ca.densify(d.guards) if d.guards.numel() else ca.SX(0, 1)
        heights = ca.densify(ca.vertcat(h, d.gaps))
        factor = ca.vertcat(*factors, *[ca.SX(1)] * len(system.impacts))
        #: The field in states, multipliers, reactions and nu; switching functions and gaps; factors n_i of surfaces
        #: and contacts, 1 where there is none; functions of stops and resets.
        self.field, self.heights, self.factors, self.stops = field, heights, factor, stops
        self.outputs = [field, self.layer, heights, factor, stops]
        every = ca.vertcat(*unknowns, d.reactions)
        self.slope, self._every = ca.jacobian(self.layer, every), every
        #: The same with symbols for long sums, and these.
        self._short: list[ca.SX] = self.outputs
        self.sums: LongSums | None = None
        if (shortened := long_sums(self._symbols, self.outputs)) is not None:
            self._short, self.sums = shortened
        #: Whether the unknown multipliers of a mode enter linearly together.
        self.affine = bool(ca.is_linear(field, every))
        *short, of_stops = self._short
        guards, rest = ca.vertcat(short[2], of_stops), (x, every, not system.sets, d.time)
        self.linearity = linearity(short[0], short[1], guards, short[3], *rest, self.sums)
        #: Of layer, of surfaces and gaps, of stops and resets, and of factors, by the states.
        self.gradients = [ca.jacobian(e, x) for e in (self.layer, heights, stops, factor)]
        self.columns_of_field = ca.jacobian(field, every)

    def _rest(
        self, h: ca.SX, lam: ca.SX, degrees: Sequence[Degree], by_degree: bool
    ) -> list[tuple[ca.SX, ...]]:
        lower: list[tuple[ca.SX, ...]] = [()] * self._surfaces
        for i, found in enumerate(degrees):
            if by_degree or i in self.system.joints:
                lower[i], self.layer[i] = found.lower, found.row
        for i in self.system.remembering:  # h at multiplier +1, the further function at -1
            further = self.system.definition.hysteresis[i]
            lower[i] = (h[i] - further,)
            h[i] -= (1 - lam[i]) / 2 * further
        return lower

    def _combine(self, h: ca.SX) -> ca.SX:
        """Rows of conditions of degree 0: y, or sums of all y and of their rates with weights, which are returned."""
        rates, q = self.layer[self.combined], len(self.combined)
        for i in self.system.algebraic:
            self.layer[i] = h[i]
        weights = ca.SX.sym("weight", 2 * q * q)
        if q:
            of_y, of_rates = (ca.reshape(w, q, q).T for w in ca.vertsplit(weights, q * q))
            sums = of_y @ h[self.combined] + of_rates @ rates
            for k, i in enumerate(self.combined):
                self.layer[i] = sums[k]
        return weights

    def _is_continuous(self, surface: int, column: Sequence[ca.SX]) -> bool:
        """Whether the multiplier does not act on its surface: it is 0 there."""
        special = (*self.system.set_of, *self.system.remembering, *self.system.half_lines)
        if surface in (*special, *self.system.joints):
            return False
        d, x = self.system.definition, self.system.extended_states
        if surface in d.breakpoints:
            return True
        pieces = [e for e in column if not e.is_zero()]
        return all(ca.depends_on(e, x) for e in pieces) and vanish_on(
            pieces, d.surfaces[surface], x
        )

    def _without_roots(
        self, field: ca.SX, lam: ca.SX, factors: list[ca.SX], unknowns: list[ca.SX]
    ) -> ca.SX:
        """The field in which roots of switching functions are zero on their surfaces, where lambda_i is."""
        x = self.system.extended_states
        gates = ca.SX.sym("gate", self._surfaces)
        surfaces = _surfaces(self.system)
        powers = roots_of(field, surfaces, x)
        field = gate_roots(field, surfaces, x, ca.vertsplit(gates))[0]
        for i, factor in enumerate(factors):
            factors[i] = gate_roots(factor, surfaces, x, ca.vertsplit(gates))[0]
        for i, power in powers.items():
            if i in self.system.set_of:
                continue
            self.powers[i] = power
            if factors[i].is_one():
                unknowns[i] = ca.SX.sym(f"nu{i}")
                field = ca.substitute(field, lam[i], lam[i] + unknowns[i])
        open_gates = [lam[i] if power > 0.0 else ca.SX(1) for i, power in enumerate(self.powers)]
        for i, factor in enumerate(factors):
            factors[i] = ca.substitute(factor, gates, ca.vertcat(*open_gates))
        return ca.substitute(field, gates, ca.vertcat(*open_gates))

    def degrees(self, field: ca.SX, lam: ca.SX, unknowns: Sequence[ca.SX]) -> list[Degree]:
        """Relative degrees of the surfaces."""
        x, d, found = self.system.extended_states, self.system.definition, list[Degree]()
        scaled = [e for e, own in zip(unknowns, self.scaled, strict=True) if own]
        every = [*ca.vertsplit(lam), *scaled, *ca.vertsplit(d.reactions)]
        joints = list(self.system.joints)
        for i in range(self._surfaces):
            found.append(Degree((), self.layer[i]))
            if i in joints:
                rest = ca.vertcat(*every[: joints[0]], *every[self._surfaces :])
                own, others = lam[joints], lambda rest=rest: rest
                found[i] = degree_of(d.surfaces[i], self.layer[i], own, others, x, field)
                continue
            if self.continuous[i] or self.system.nonlinear[i] or i in self.system.set_of:
                continue
            if i in (*self.system.remembering, *self.system.half_lines):
                continue
            own = ca.vertcat(lam[i], unknowns[i]) if self.scaled[i] else lam[i]
            others = lambda own=own: ca.vertcat(*[e for e in every if not ca.depends_on(own, e)])
            found[i] = degree_of(d.surfaces[i], self.layer[i], own, others, x, field)
        return found

    @property
    def kept(self) -> ca.SX:
        """What closed contacts and sliding surfaces keep at zero: h, gaps, their rates, lower derivatives."""
        d, lower = self.system.definition, [e for own in self.lower for e in own]
        return ca.vertcat(d.open_surfaces, d.gaps, d.gap_rates, *lower)

    # shape -------------------------------------------------------------------------------------

    def held(self, mode: str) -> Array:
        """Multipliers that are known in a mode: +1 and -1; 0 for the others and open contacts."""
        signs = np.array(self.system.parse_letters(mode), float)
        signs[self._surfaces :] = 0.0
        signs[[*self.system.set_of, *self.system.half_lines]] = 0.0
        return signs

    def heights_at(self, x: Array, p: Array) -> Array:
        """Switching functions and gaps (m,) at an extended state."""
        heights = evaluator(self.system, "heights", lambda: [self.heights])
        return heights.copied(x, p)[0].ravel()

    def kept_at(self, x: Array, p: Array) -> tuple[Array, Array]:
        """The functions of ``kept`` (k,) and their gradients (k, N) at an extended state."""
        rows = self.kept
        build = lambda: [rows, ca.jacobian(rows, self.system.extended_states)]
        values, gradient = evaluator(self.system, ("kept", rows.numel()), build).copied(x, p)
        return values.ravel(), gradient

    def sliding(self, mode: str) -> list[int]:
        """Surfaces that slide and contacts that are closed, with multipliers that are unknown."""
        signs = self.system.parse_letters(mode)
        return [i for i, sign in enumerate(signs) if sign == 0 and not self.is_idle(i, signs)]

    def is_idle(self, i: int, signs: Sequence[int]) -> bool:
        """Whether a multiplier does not act: on its surface, or at open contacts alone."""
        if i >= self._surfaces:
            return False
        carried = self.carriers[i]
        idle = bool(carried) and all(signs[self._surfaces + j] for j in carried)
        return self.continuous[i] or idle

    @cached_property
    def slope_moves(self) -> NDArray[np.bool_]:
        """Which derivatives of the layer's rates by the unknowns change along a motion (m, m)."""
        moves, sparsity = np.zeros((self.count, self.count), bool), self.slope.sparsity()
        if sparsity.nnz():
            own = ca.vertcat(*self.slope.nonzeros())
            found = ca.which_depends(own, self.moving, 1, True)
            moves[sparsity.row(), sparsity.get_col()] = found
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

    # expressions --------------------------------------------------------------------------------

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
        rest, signs = self.moving[n:], self.system.parse_letters(mode)
        for members in self.system.sets:
            if signs[members[0]] and not self.is_idle(members[0], signs):
                h = self.system.definition.surfaces[list(members)]
                held[list(members)] = h / ca.norm_2(h)
        for i in self.sliding(mode):
            own = self.unknown(i)
            for k in range(rest.numel()):
                if ca.is_equal(rest[k], own):
                    held[k] = own
        return [ca.substitute(e, ca.vec(rest), held) for e in expressions]

    def awake(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Dense expressions in ``moving``, for numbers: terms without effect in a mode are not evaluated."""
        dense = [ca.densify(e) for e in expressions]
        return without_unused_terms(self._symbols, dense, self._values_held)

    def series(self, more: Sequence[ca.SX]) -> tuple[list[ca.SX], list[ca.SX]]:
        """Two vectors of symbols and what is expanded in them: terms of long sums, ``outputs``, and ``more``."""
        if self.sums is None:
            return self._symbols, self.awake([*self.outputs, *more])
        inputs = [ca.vertcat(self.moving, self.sums.symbols), self._symbols[1]]
        dense = [self.sums.terms, *self._short, *map(ca.densify, more)]
        return inputs, without_unused_terms(inputs, dense, self._values_held)

    @property
    def _values_held(self) -> dict[int, tuple[float, ...]]:
        """Fixed values of entries of ``moving`` in modes."""
        n, m, positions = self.system.extended_dimension, self._surfaces, self.moving.numel()
        held: dict[int, tuple[float, ...]] = dict.fromkeys(range(n + m, positions), (0.0,))
        for i in range(m):
            signs: tuple[float, ...] = () if i in self.system.set_of else (1.0, -1.0)
            if i in self.system.half_lines:
                signs = (0.0,)
            held[n + i] = (*signs, 0.0) if self.scaled[i] else signs
        for i in self.system.joints:
            del held[n + i]
        return held

    @property
    def derivatives(self) -> ca.SX:
        """Of field, layer, surfaces and gaps, and factors by ``moving`` and the parameters, sparse."""
        symbols = ca.vertcat(self.moving, self.system.parameter_symbols)
        return ca.jacobian(ca.vertcat(*self.outputs[:4]), symbols)

    @property
    def parameter_symbols(self) -> ca.SX:
        """Parameters, and behind them weights of rows that are combined."""
        return self._symbols[1]

    # numbers -----------------------------------------------------------------------------------

    @cached_property
    def _layer_values(self) -> Evaluator:
        return self._evaluator([self.layer, self.slope, self.factors])

    def _evaluator(self, outputs: Sequence[ca.SX]) -> Evaluator:
        return Evaluator(ca.Function("at", self._symbols, self.awake(outputs), {"cse": True}))

    def layer_at(self, x: Array, multipliers: Array, unknowns: Array, p: Array) -> LayerValues:
        """Evaluate at an extended state, with lambda where nothing slides (else 0) and nu (else 0)."""
        found = self._layer_values.copied(self._inputs(x, multipliers, unknowns), p)
        layer, slope, factors = found
        return LayerValues(layer.ravel(), slope, factors.ravel())

    def layer_gradients_at(self, x: Array, multipliers: Array, p: Array) -> Array:
        """Derivatives of the layer by the extended state (m, N), where no unknown acts."""
        build = lambda: self._evaluator([ca.densify(self.gradients[0])])
        found = self.system.cached("layer gradients", build)
        return found.copied(self._inputs(x, multipliers, np.zeros(self.count)), p)[0]

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


def _surfaces(system: FilippovSystem) -> ca.SX:
    """The switching functions of surfaces and sets, before those of complementarity conditions."""
    return system.definition.surfaces[: min((*system.half_lines, system.surface_count))]


def coupled_of(system: FilippovSystem) -> Coupled:
    """Return the program of all modes of a system, built once."""
    return system.cached("coupled", lambda: Coupled(system))


def raised_of(system: FilippovSystem) -> Coupled:
    """Return the same with the derivatives of surfaces that their multipliers enter first in the layer."""

    def build() -> Coupled:
        plain = coupled_of(system)
        unknowns = [plain.unknown(i) for i in range(system.surface_count)]
        degrees = plain.degrees(plain.field, plain.multipliers, unknowns)
        d, ones = system.definition, [ca.SX(1)] * system.surface_count
        roots = gate_roots(d.field, _surfaces(system), system.extended_states, ones)[1]
        raised = bool(roots) or any(own.lower for own in degrees)
        return Coupled(system, by_degree=True) if raised else plain

    return system.cached("raised", build)


def driven_of(system: FilippovSystem) -> Coupled:
    """Return the same as the driver reads it, with rows of conditions of degree 0 combined."""

    def build() -> Coupled:
        raised = raised_of(system)
        by_degree = raised is not coupled_of(system)
        return Coupled(system, by_degree, True) if combinable(system) else raised

    return system.cached("driven", build)
