"""The variational equations of a mode: X' = Df X and P' = Df P + f_p beside the state.

X and P are the derivatives by the start and by parameters. Together with the state they form one
smooth field, without the entries that are constant (structural zeros, the row of time).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..definition.system import FilippovSystem
from ..errors import DegenerateError
from ..laws.coupled import coupled_of, raised_of
from ..laws.evaluators import Evaluator
from ..laws.explicit import explicit, solved
from ..laws.motion import Motion
from ..laws.multipliers import newton_multipliers, sliding_multipliers
from ..printing.tape import Series, series_of
from ..values import Array

#: Order of the series of a leg: for the rounding of doubles about -ln(eps)/2 + 2 (Jorba & Zou 2005).
ORDER = 20


@dataclass(frozen=True)
class Blocks:
    """The pattern of the entries of x, X and P in the state of a variational field."""

    states: int
    starts: int
    parameters: int
    moving: NDArray[np.bool_]
    fixed: Array

    def pack(self, matrix: Array) -> Array:
        """Take the moving entries of (x, X, P)."""
        return np.asarray(matrix.T[self.moving.T])

    def unpack(self, z: Array) -> Array:
        """Return the matrix (x, X, P), (N + k, 1 + N + q)."""
        whole = self.fixed.T.copy()
        whole[self.moving.T] = z
        return whole.T


class PlainField:
    """One mode's flow as a smooth field, with all multipliers solved for (``explicit``)."""

    def __init__(self, of_mode: Motion):
        self.motion, self.states, self.field = of_mode, of_mode.states, of_mode.field

    @property
    def parameters(self) -> ca.SX:
        """Symbols of the parameters."""
        return self.motion.system.parameter_symbols

    @property
    def entries(self) -> int:
        """Number of states."""
        return int(self.states.numel())

    @cached_property
    def groups(self) -> tuple[NDArray[np.intp], ...]:
        """Entries whose errors are measured together; the time is exact."""
        moving = np.arange(self.entries)
        system = self.motion.system
        return (np.delete(moving, system.dimension) if system.time_dependent else moving,)

    @cached_property
    def series(self) -> Series:
        """The Taylor rules of the field."""
        return series_of([self.states, self.parameters], [self.field])


def plain_field(system: FilippovSystem, mode: str) -> PlainField:
    """Return the field of a mode without guards, built once per system."""
    return system.cached(("plain field", mode), lambda: PlainField(explicit(system, mode)))


class VariationalField(PlainField):
    """The flow of an explicit mode with derivatives by its start and by ``chosen`` parameters."""

    def __init__(self, of_mode: Motion, chosen: tuple[int, ...] = ()):
        super().__init__(of_mode)
        self.chosen = chosen
        system = of_mode.system
        y, f, p = of_mode.states, of_mode.field, system.parameter_symbols
        size, n, q = y.numel(), system.extended_dimension, len(chosen)
        by_state = ca.jacobian(f, y)
        by_parameters = ca.jacobian(f, p)[:, list(chosen)] if q else ca.SX(size, 0)
        moving, fixed = _pattern(by_state, by_parameters, n)
        self.blocks = Blocks(size, n, q, moving, fixed)
        symbols = [
            [y[i] for i in range(size)],
            *[
                [
                    ca.SX.sym(f"d{i}_{j}") if moving[i, j] else ca.SX(float(fixed[i, j]))
                    for i in range(size)
                ]
                for j in range(1, 1 + n + q)
            ],
        ]
        matrix = ca.sparsify(ca.horzcat(*[ca.vertcat(*column) for column in symbols[1:]]))
        rates = ca.mtimes(by_state, matrix)
        if q:
            rates[:, n:] += by_parameters
        chosen_rates = [f[i] for i in range(size)]
        kept = [y[i] for i in range(size)]
        for j in range(1, 1 + n + q):
            for i in range(size):
                if moving[i, j]:
                    chosen_rates.append(ca.densify(rates[i, j - 1]))
                    kept.append(symbols[j][i])
        self.states, self.field = ca.vertcat(*kept), ca.vertcat(*chosen_rates)

    @cached_property
    def groups(self) -> tuple[NDArray[np.intp], ...]:
        """Entries of z whose errors are measured together: of x without time, of X, of P."""
        of_column = np.repeat(
            np.arange(self.blocks.moving.shape[1]), self.blocks.moving.sum(axis=0)
        )
        states = np.flatnonzero(of_column == 0)
        system = self.motion.system
        if system.time_dependent:
            states = np.delete(states, system.dimension)
        n = self.blocks.starts
        groups = (
            states,
            np.flatnonzero((of_column > 0) & (of_column <= n)),
            np.flatnonzero(of_column > n),
        )
        return tuple(g for g in groups if g.size)

    @cached_property
    def rate(self) -> Evaluator:
        """(y, p) -> the mode's field (N + k, 1)."""
        inputs = [self.motion.states, self.parameters]
        return Evaluator(ca.Function("rate", inputs, [ca.densify(self.motion.field)]))

    def rate_at(self, y: Array, p: Array) -> Array:
        """The mode's field at states of a leg (N + k,)."""
        return self.rate.copied(y, p)[0][:, 0]

    @cached_property
    def linear(self) -> Evaluator:
        """(y, p) -> field, its derivatives by the states and by all parameters."""
        y, f, p = self.motion.states, self.motion.field, self.parameters
        outputs = [ca.densify(e) for e in (f, ca.jacobian(f, y), ca.jacobian(f, p))]
        return Evaluator(ca.Function("linear", [y, p], outputs, {"cse": True}))

    @cached_property
    def _multipliers(self) -> Evaluator:
        """(y, p) -> derivatives of the multipliers that are states, by states and parameters."""
        law, p = self.motion.law, self.parameters
        x, u = self.motion.states[: self.blocks.starts], self.motion.states[self.blocks.starts :]
        (layer,) = coupled_of(self.motion.system).held_at(self.motion.mode, [law.coupled.layer])  # type: ignore[attr-defined]
        residual = layer[list(law.unknowns)]  # type: ignore[attr-defined]
        right = ca.horzcat(ca.jacobian(residual, x), ca.jacobian(residual, p)[:, list(self.chosen)])
        outputs = [ca.densify(-solved(ca.jacobian(residual, u), right))]
        return Evaluator(ca.Function("multipliers", [self.motion.states, p], outputs))

    def start(self, x: Array, p: Array, unknowns: Array | None = None) -> Array:
        """The state z at the start of a leg, X = 1 and P = 0; ``unknowns`` is a guess of multipliers."""
        return self.blocks.pack(self.initial(x, p, unknowns))

    def initial(self, x: Array, p: Array, unknowns: Array | None = None) -> Array:
        """The matrix (x, X, P) at the start of a leg, (N + k, 1 + N + q)."""
        b, matrix = self.blocks, self._identity.copy()
        matrix[: b.starts, 0] = x
        if b.states > b.starts:
            matrix[b.starts :, 0] = self._unknowns(x, p, unknowns)
            matrix[b.starts :, 1:] = self._multipliers.copied(matrix[:, 0], p)[0]
        return matrix

    @cached_property
    def _identity(self) -> Array:
        b = self.blocks
        matrix = np.zeros((b.states, 1 + b.starts + b.parameters))
        matrix[: b.starts, 1 : 1 + b.starts] = np.eye(b.starts)
        return matrix

    def states_at(self, x: Array, p: Array) -> Array:
        """Extended states (N,) and the multipliers that are states of the leg; (N + k,)."""
        if self.blocks.states == self.blocks.starts:
            return x
        return np.concatenate([x, self._unknowns(x, p, None)])

    def _unknowns(self, x: Array, p: Array, near: Array | None) -> Array:
        system, mode = self.motion.system, self.motion.mode
        coupled, which = coupled_of(system), list(self.motion.law.unknowns)  # type: ignore[attr-defined]
        if near is not None:
            guess = np.zeros(coupled.count)
            guess[which] = near
            found = newton_multipliers(coupled, mode, x, guess, p, 30)
            if found is not None:
                return np.asarray(found[which])
        solutions = sliding_multipliers(coupled, mode, x, p, stable_only=any(system.nonlinear))
        if len(solutions) != 1:
            raise DegenerateError(
                f"mode {mode!r} at {x.tolist()}: expected one set of multipliers that keeps the "
                f"sliding, received {len(solutions)}. Start elsewhere on the surface, or choose "
                "another itinerary."
            )
        return np.asarray(solutions[0][which])


def _pattern(by_state: ca.SX, by_parameters: ca.SX, n: int) -> tuple[NDArray[np.bool_], Array]:
    """Entries of (x, X, P) that move, and the values of those that do not."""
    size, q = by_state.shape[0], by_parameters.shape[1]
    a = _nonzero(by_state)
    direct = np.hstack([np.zeros((size, n), bool), _nonzero(by_parameters)])
    fixed = np.zeros((size, 1 + n + q))
    fixed[:n, 1 : 1 + n] = np.eye(n)
    reached = fixed[:, 1:] != 0
    reached[n:] = True  # multipliers depend on everything
    for _ in range(size + 1):
        reached = reached | direct | (a @ reached)
    moving = np.hstack([np.ones((size, 1), bool), (a @ reached) | direct])
    moving[n:] = True
    fixed[moving] = 0.0
    return moving, fixed


def _nonzero(matrix: ca.SX) -> NDArray[np.bool_]:
    result = np.zeros(matrix.shape, bool)
    rows, columns = ca.sparsify(matrix).sparsity().get_triplet()
    result[rows, columns] = True
    return result


def variational_field(
    system: FilippovSystem, mode: str, chosen: tuple[int, ...] = ()
) -> VariationalField:
    """Return the variational field of a mode, built once per system."""

    def build() -> VariationalField:
        _require_first_degree(system, mode)
        return VariationalField(explicit(system, mode), chosen)

    return system.cached(("variational field", mode, chosen), build)


def _require_first_degree(system: FilippovSystem, mode: str) -> None:
    """Refuse rest on a surface whose multiplier enters a higher derivative of its function first."""
    letters = system.parse_letters(mode)[: system.surface_count]
    if 0 not in letters:
        return
    for i, lower in enumerate(raised_of(system).lower):
        if lower and letters[i] == 0:
            raise DegenerateError(
                f"Derivatives of rest on 'h{i}', whose multiplier enters the derivative "
                f"{len(lower) + 1} of its function first, are not implemented. End the run before it rests, "
                "or start after it."
            )


class GuardedField(PlainField):
    """One mode's flow with its guards along it."""

    @cached_property
    def series(self) -> Series:
        """The Taylor rules of the field and of the guards."""
        return series_of([self.states, self.parameters], [self.field, self.motion.functions])

    @cached_property
    def starts(self) -> Evaluator:
        """(y, p) -> the first coefficients of states and guards, to order 3."""
        return Evaluator(self.motion.jet_function(3))

    @cached_property
    def gradients(self) -> Evaluator:
        """(y, p) -> gradients of the guards (g, N + k)."""
        return Evaluator(self.motion.gradient_function())


def guarded_field(system: FilippovSystem, mode: str) -> GuardedField:
    """Return the guarded field of a mode, built once per system."""
    return system.cached(("guarded field", mode), lambda: GuardedField(explicit(system, mode)))
