"""A mode as one smooth field of the states, with its multipliers solved for.

``motion`` eliminates the multiplier of one surface. Of several surfaces, closed contacts and friction
on them the multipliers solve grad h_i . f(x, lambda) = 0, rates of gaps included: linear equations
are solved here symbolically; where they are not linear (products of multipliers, hidden dynamics) the
multipliers are further states, with the rate that keeps the equations.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from ..definition.system import FilippovSystem, require_system
from ..errors import DefinitionError
from ..expressions.identity import decide_zero
from .coupled import combinable, coupled_of, raised_of
from .motion import Motion, motion
from .switches import Guard, Guarded

#: Rows of a matrix that are dependent to this part of its entries are so.
_DEPENDENT = 1e-10

#: Determinants of more unknowns than these are not written out.
_WRITTEN_OUT = 3


class Solved:
    """The law of a mode of coupled surfaces and contacts (see ``switches.Law``)."""

    def __init__(self, system: FilippovSystem, mode: str):
        coupled = raised_of(system) if rests_on(system, mode) else coupled_of(system)
        x = system.extended_states
        self.system, self.mode, self.coupled = system, mode, coupled
        #: Surfaces whose unknown is lambda + c lambda^3, and their c: sliding ends where that is largest.
        self.cubic: dict[int, ca.SX] = {}
        self.unknowns: tuple[int, ...] = ()
        if system.written.tables and 0 not in system.parse_letters(mode):
            self.states, self.values, self.field = x, ca.SX(0, 1), system.field(mode)
            return
        sliding = coupled.sliding(mode)
        own = [coupled.unknown(i) for i in sliding]
        symbols = ca.vertcat(*own) if own else ca.SX(0, 1)
        field, layer = coupled.held_at(mode, [coupled.field, coupled.layer])
        for i in sliding:
            if i < system.surface_count and system.nonlinear[i]:
                field, layer = self._of_cubic(i, field, layer, symbols)
        residual = layer[sliding] if sliding else ca.SX(0, 1)
        residual = _with_rates(system, sliding, residual, symbols, field)
        self.states, self.values, self.field = x, symbols, field
        if not sliding:
            return
        slope = ca.jacobian(residual, symbols)
        if not ca.depends_on(slope, symbols):
            rest = ca.substitute(residual, symbols, 0)
            dependent = system.complementarity or system.constraints or rests_on(system, mode)
            self.values = -(least_norm if dependent else solved)(slope, rest)
            self.field = ca.substitute(field, symbols, self.values)
            return
        self.unknowns = tuple(sliding)
        self.states = ca.vertcat(x, symbols)
        drift = ca.mtimes(ca.jacobian(residual, x), field)
        self.field = ca.vertcat(field, -solved(slope, drift))

    def _of_cubic(self, i: int, field: ca.SX, layer: ca.SX, symbols: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Field and layer in lambda + c lambda^3 if lambda_i enters as such, as friction that drops does."""
        x, own = self.system.extended_states, self.coupled.unknown(i)
        both = ca.vertcat(field, layer)
        slopes, zero = [both], ca.SX(0)
        for _ in range(4):
            slopes.append(ca.jacobian(slopes[-1], own))
        first, second = (ca.substitute(e, own, zero) for e in slopes[1:3])
        third, n = slopes[3] / 6, field.numel()
        row = [first[n + i], third[n + i]]
        parts = ca.vertcat(first, third)
        if not slopes[4].is_zero() or ca.depends_on(parts, symbols) or row[0].is_zero():
            return field, layer
        apart = [*ca.vertsplit(second), *ca.vertsplit(third * row[0] - first * row[1])]
        if not decide_zero(apart, [], x)[0]:
            return field, layer
        self.cubic[i] = row[1] / row[0]
        both = ca.densify(ca.substitute(both, own, zero) + first * own)
        return both[:n], both[n:]

    def guarded(self) -> Guarded:
        """Guards of the mode, in the order of ``Coupled.guards``, and their functions."""
        coupled, m = self.coupled, self.system.surface_count
        signs = self.system.parse_letters(self.mode)
        layer, heights, factors, stops = coupled.held_at(
            self.mode, [coupled.layer, coupled.heights, coupled.factors, coupled.stops]
        )
        sliding = coupled.sliding(self.mode)
        functions: list[ca.SX] = []
        for i, sign in enumerate(signs):
            if sign:
                functions.append(sign * heights[i])
            elif i >= m or i in self.system.half_lines:
                functions.append(self.values[sliding.index(i)])
            elif i in self.system.joints:
                continue
            elif i not in sliding:
                functions += [-layer[i], layer[i]]
            elif i in self.cubic:
                functions.append(-4 / (27 * self.cubic[i]) - self.values[sliding.index(i)] ** 2)
            else:
                u, n = self.values[sliding.index(i)], factors[i]
                turn = 1 if n.is_one() else n  # n^2 (1 -+ lambda) has the sign of 1 -+ lambda
                functions += [turn * (n - u), turn * (n + u)]
        functions += ca.vertsplit(stops)[: stops.numel()]
        guards = [g for g in coupled.guards(self.mode) if not (self._has_fold(g) and g.side < 0)]
        guards = [replace(g, kind="branch", side=0) if self._has_fold(g) else g for g in guards]
        own = coupled.symbols_of(sliding)
        if own.numel() and not self.unknowns:
            functions = [ca.substitute(f, own, self.values) for f in functions]
        return list(zip(guards, functions, strict=True))

    def _has_fold(self, guard: Guard) -> bool:
        """Whether sliding ends at the fold of a cubic instead of where a multiplier is 1."""
        return guard.kind == "exit" and guard.index in self.cubic


def _with_rates(
    system: FilippovSystem, sliding: list[int], residual: ca.SX, symbols: ca.SX, field: ca.SX
) -> ca.SX:
    """Equations of a mode, those that closed conditions of degree 0 leave of the states alone by their rates."""
    rows = [k for k, i in enumerate(sliding) if i in combinable(system)]
    if not rows:
        return residual
    x, own = system.extended_states, residual[rows]
    slope = ca.densify(ca.jacobian(own, symbols))
    if not slope.is_constant():
        return residual
    values, kept = np.array(ca.DM(slope)), list[int]()
    for k in range(len(rows)):
        known = values[kept]
        factors = np.linalg.lstsq(known.T, values[k], rcond=None)[0]
        if abs(values[k] - factors @ known).max() > _DEPENDENT * max(1.0, abs(values[k]).max()):
            kept.append(k)
            continue
        of_states = ca.substitute(
            own[k] - sum(float(f) * own[j] for f, j in zip(factors, kept, strict=True)), symbols, 0
        )
        residual[rows[k]] = ca.jtimes(of_states, x, field)
    return residual


def solved(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solution of linear equations, written out for few unknowns."""
    k = matrix.shape[0]
    if k == 1:
        return ca.simplify(right / matrix)
    if k <= _WRITTEN_OUT:
        return ca.mtimes(ca.adj(ca.densify(matrix)), right) / ca.det(ca.densify(matrix))
    return ca.solve(matrix, right)


def rests_on(system: FilippovSystem, mode: str) -> tuple[int, ...]:
    """Surfaces that rest in a mode: their multipliers enter a higher derivative of their functions first."""
    letters = system.parse_letters(mode)[: system.surface_count]
    if 0 not in letters:
        return ()
    lower = raised_of(system).lower
    return tuple(
        i for i, own in enumerate(lower) if own and not letters[i] and i not in system.joints
    )


def least_norm(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """The least solution of linear equations, some of which may follow from others, as those of diodes side by side."""
    symbols, rng = ca.symvar(matrix), np.random.default_rng(1)
    at = ca.Function("at", [ca.vertcat(*symbols)], [ca.densify(matrix)])
    values = np.array(at(rng.uniform(0.2, 0.9, len(symbols))), float)
    rows: list[int] = []
    for i in range(len(values)):
        more = [*rows, i]
        if np.linalg.matrix_rank(values[more], tol=_DEPENDENT * float(np.abs(values).max())) == len(
            more
        ):
            rows = more
    if len(rows) == len(values):
        return solved(matrix, right)
    if not rows:
        return ca.SX.zeros(matrix.shape[1], 1)
    own = matrix[rows, :]
    return ca.mtimes(own.T, solved(ca.mtimes(own, own.T), right[rows]))


def explicit(system: FilippovSystem, mode: str) -> Motion:
    """Return the motion of a mode as a field of the states, for any system; built once."""
    require_system(system, complementarity=True, joints=True)
    if not system.coupled and not rests_on(system, mode):
        return motion(system, mode)

    def build() -> Motion:
        law = Solved(system, mode)
        return Motion(system, mode, law, law.guarded(), "explicit")

    return system.cached(("explicit", mode), build)


def mode_field(system: FilippovSystem, mode: str) -> ca.SX:
    """Right-hand side of any mode, sliding included, time row included (SX, extended dimension).

    Parameters
    ----------
    system : FilippovSystem
    mode : str
        One letter for each surface; at most one ``s``, of a surface whose multiplier is linear. Any mode of a
        system with complementarity conditions.

    Returns
    -------
    SX
        While sliding Filippov's field, with the factor cancelled that makes it 0/0 where both
        fields coincide.

    Raises
    ------
    DefinitionError
        A mode whose multipliers are only known implicitly.

    Examples
    --------
    >>> import casadi as ca
    >>> import nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[1, -1], below=[3, 1])
    >>> ns.local.mode_field(system, "s")
    SX([2, 0])
    """
    require_system(system, complementarity=True)
    found = explicit(system, mode) if system.complementarity else motion(system, mode)
    if found.states.numel() != system.extended_dimension:
        raise DefinitionError(
            f"mode {mode!r} has no explicit field: on several surfaces, or with a nonlinear multiplier, "
            "there is only an equation. Use sliding_branches."
        )
    return found.field
