"""The smooth motion of one mode: its field, with multipliers solved for, and its guards.

Sliding multipliers, reactions and friction on them solve grad h_i . f(x, lambda) = 0, rates of gaps included. Linear
equations are solved here symbolically; for nonlinear ones (products of multipliers, hidden dynamics) the multipliers
are further states, with the rate that keeps the equations.

A guard is a function that is positive inside the mode; the mode ends where it falls through zero. Stops and resets
follow the guards as they were given; the driver checks their direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np

from ..definition.parse_definition import read_function
from ..definition.system import FilippovSystem, require_system
from ..definition.tables.pieces import beyond_cells
from ..errors import DefinitionError
from ..expressions.identity import decide_zero
from .coupled import combinable, coupled_of, raised_of
from .switches import Guard, event_guards

#: Rows of a matrix that are dependent to this part of its entries are so.
_DEPENDENT = 1e-10

#: Determinants of more unknowns than these are not written out.
_WRITTEN_OUT = 3


class Motion:
    """Field and guards of one mode of a system; made by ``motion``."""

    def __init__(self, system: FilippovSystem, mode: str):
        rests = rests_on(system, mode)
        self.system, self.mode = system, mode
        self._coupled = raised_of(system) if rests else coupled_of(system)
        #: Multipliers that are states.
        self.unknowns: tuple[int, ...] = ()
        is_single = not system.coupled and not rests
        self._solve(is_single, bool(rests or system.complementarity or system.constraints))
        pairs = [*self._guarded(is_single)]
        self.guards = tuple(guard for guard, _ in pairs)
        functions = ca.densify(ca.vertcat(*[own for _, own in pairs])) if pairs else ca.SX(0, 1)
        if not self.unknowns and self._values.numel():
            symbols = self._coupled.symbols_of(self._coupled.sliding(mode))
            functions = ca.substitute(functions, symbols, self._values)
        self.functions = functions

    def _solve(self, is_single: bool, may_depend: bool) -> None:
        """Solve for the sliding multipliers."""
        coupled, x = self._coupled, self.system.extended_states
        #: Surfaces whose unknown is lambda + c lambda^3, and their c: sliding ends where that is largest.
        self._cubic: dict[int, ca.SX] = {}
        if self.system.written.tables and 0 not in self.system.parse_letters(self.mode):
            self.states, self.field, self._values = x, self.system.field(self.mode), ca.SX(0, 1)
            return
        sliding = coupled.sliding(self.mode)
        symbols = coupled.symbols_of(sliding)
        field, layer = coupled.held_at(self.mode, [coupled.field, coupled.layer])
        for i in sliding:
            if i < self.system.surface_count and self.system.nonlinear[i]:
                field, layer = self._of_cubic(i, field, layer, symbols)
        self.states, self.field, self._values = x, field, symbols
        if not sliding:
            return
        if (
            is_single
        ):  # the rate of h in the entries of the field, so that cancelling terms are zero
            gradient = ca.jacobian(self.system.surface_function(sliding[0]), x)
            free, column = ca.substitute(field, symbols, 0), ca.jacobian(field, symbols)
            rates = [ca.simplify(ca.mtimes(gradient, e)) for e in (column, free)]
            self._values = -solved(*rates)
            self.field = free + column * self._values
            return
        residual = _with_rates(self.system, sliding, layer[sliding], symbols, field)
        slope = ca.jacobian(residual, symbols)
        if not ca.depends_on(slope, symbols):
            rest = ca.substitute(residual, symbols, 0)
            self._values = -(least_norm if may_depend else solved)(slope, rest)
            self.field = ca.substitute(field, symbols, self._values)
            return
        self.unknowns = tuple(sliding)
        self.states = ca.vertcat(x, symbols)
        drift = ca.mtimes(ca.jacobian(residual, x), field)
        self.field = ca.vertcat(field, -solved(slope, drift))

    def _of_cubic(self, i: int, field: ca.SX, layer: ca.SX, symbols: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Field and layer in lambda + c lambda^3 if lambda_i enters as such, as friction that drops does."""
        x, own = self.system.extended_states, self._coupled.unknown(i)
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
        self._cubic[i] = row[1] / row[0]
        both = ca.densify(ca.substitute(both, own, zero) + first * own)
        return both[:n], both[n:]

    def _guarded(self, is_single: bool) -> Iterator[tuple[Guard, ca.SX]]:
        """Guards of surfaces and exits, contacts, stops and resets, and their functions."""
        coupled, system, m = self._coupled, self.system, self.system.surface_count
        layer, heights, factors, stops = coupled.held_at(
            self.mode, [coupled.layer, coupled.heights, coupled.factors, coupled.stops]
        )
        sliding = coupled.sliding(self.mode)
        letters = system.parse_letters(self.mode)
        beyond = beyond_cells(system.written, letters)
        for i, sign in enumerate(letters):
            if i in beyond:
                continue
            of = (i, system.entry_of(i)) if i < m else (i - m, len(system.entries) + i - m)
            guard = lambda kind, side, of=of: Guard(kind, of[0], side, of[1])
            if i in system.set_of:
                members = list(system.set_of[i])
                if i > members[0] or coupled.is_idle(i, letters):
                    continue
                if sign:
                    yield guard("surface", 1), ca.norm_2(heights[members])
                else:  # n^2 (1 - |lambda|^2)
                    own = self._values[[sliding.index(j) for j in members]]
                    yield guard("exit", 0), factors[i] ** 2 - ca.sumsqr(own)
            elif sign:
                yield guard("surface" if i < m else "impact", sign), sign * heights[i]
            elif i >= m or i in system.half_lines:
                yield guard("release", 0), self._values[sliding.index(i)]
            elif i in self._cubic:
                yield (
                    guard("branch", 0),
                    -4 / (27 * self._cubic[i]) - self._values[sliding.index(i)] ** 2,
                )
            elif i not in system.joints:
                for side in (1, -1):
                    if is_single:  # vanishes where sliding stops being attracting
                        function = -side * system.lie_derivative(["+" if side > 0 else "-"], i)
                    elif i not in sliding:
                        function = -side * layer[i]
                    else:  # n^2 (1 -+ lambda) has the sign of 1 -+ lambda
                        turn = 1 if factors[i].is_one() else factors[i]
                        function = turn * (factors[i] - side * self._values[sliding.index(i)])
                    yield guard("exit", side), function
        yield from zip(event_guards(system), ca.vertsplit(stops)[: stops.numel()], strict=True)

    def multiplier_equations(self) -> ca.SX:
        """Equations of the multipliers that are states."""
        (layer,) = self._coupled.held_at(self.mode, [self._coupled.layer])
        return layer[list(self.unknowns)]


def motion(system: FilippovSystem, mode: str) -> Motion:
    """Return the motion of a mode as a field of the states, for any system; built once."""
    require_system(system, sets=True, complementarity=True, joints=True)
    return system.cached(("motion", mode), lambda: Motion(system, mode))


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
    surfaces = [i for i, sign in enumerate(system.parse_mode(mode)) if not sign]
    several = not system.complementarity and len(surfaces) > 1
    found = motion(system, mode)
    if several or found.unknowns:
        raise DefinitionError(
            f"mode {mode!r} has no explicit field: on several surfaces, or with a nonlinear multiplier, "
            "there is only an equation. Use sliding_branches."
        )
    return found.field


def watched_functions(system: FilippovSystem, watched: Sequence[ca.SX]) -> list[ca.SX]:
    """Check functions to be monitored."""
    return [
        read_function(system.definition, w, f"watched function {k}") for k, w in enumerate(watched)
    ]
