"""The variational equations of a mode: X' = Df X and P' = Df P + f_p beside the state.

X and P are the derivatives by the start and by parameters; ``flow/core/legs/flow.c`` integrates their columns.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..definition.system import FilippovSystem
from ..errors import DegenerateError
from ..laws.coupled import coupled_of
from ..laws.evaluators import Evaluator, evaluator
from ..laws.motion import Motion, motion, solved
from ..laws.multipliers import sliding_multipliers
from ..printing.instructions import Entries, Series, series_of, sparse_entries
from ..values import Array

#: Order of the series of a leg: for the rounding of doubles about -ln(eps)/2 + 2 (Jorba & Zou 2005).
ORDER = 20


class PlainField:
    """One mode's flow as a smooth field, with all multipliers solved for (``motion``)."""

    def __init__(self, of_mode: Motion):
        self.motion, self.states, self.field = of_mode, of_mode.states, of_mode.field

    @property
    def parameters(self) -> ca.SX:
        """Symbols of the parameters."""
        return self.motion.system.parameter_symbols

    #: Columns of derivatives, those by the start first.
    by_start = columns = 0

    @cached_property
    def entries(self) -> int:
        """Number of states."""
        return int(self.states.numel())

    @property
    def derivatives(self) -> Entries:
        """Row and column indices of the derivatives among the last outputs of ``series``: none."""
        return sparse_entries(ca.SX(0, 0))[1]

    @cached_property
    def groups(self) -> tuple[NDArray[np.intp], ...]:
        """Entries whose errors are measured together: each alone, as states may be small; the time is exact."""
        system = self.motion.system
        return tuple(
            np.array([k])
            for k in range(self.entries)
            if not (system.time_dependent and k == system.dimension)
        )

    @cached_property
    def series(self) -> Series:
        """The Taylor rules of the field."""
        return series_of([self.states, self.parameters], [self.field])


def plain_field(system: FilippovSystem, mode: str) -> PlainField:
    """Return the field of a mode without guards, built once per system."""
    return system.cached(("plain field", mode), lambda: PlainField(motion(system, mode)))


class VariationalField(PlainField):
    """The flow of an explicit mode with derivatives by its start and by ``chosen`` parameters."""

    def __init__(self, of_mode: Motion, chosen: tuple[int, ...] = ()):
        super().__init__(of_mode)
        self.chosen, self.by_start = chosen, of_mode.system.extended_dimension
        self.columns = self.by_start + len(chosen)

    @cached_property
    def _derived(self) -> tuple[ca.SX, Entries]:
        by_state = ca.jacobian(self.field, self.states)
        by_parameters = ca.jacobian(self.field, self.parameters)
        chosen = [by_parameters[:, j] for j in self.chosen]
        return sparse_entries(ca.horzcat(by_state, *chosen))

    @property
    def derivatives(self) -> Entries:
        """Row and column indices of the field's derivatives by states and chosen parameters, after it in ``series``."""
        return self._derived[1]

    @cached_property
    def series(self) -> Series:
        """The Taylor rules of the field and of its derivatives."""
        return series_of([self.states, self.parameters], [self.field, self._derived[0]])

    @cached_property
    def rate(self) -> Evaluator:
        """(y, p) -> the mode's field (N + k, 1)."""
        return self._evaluator("rate", lambda: [self.field])

    def rate_at(self, y: Array, p: Array) -> Array:
        """The mode's field at states of a leg (N + k,)."""
        return self.rate.copied(y, p)[0][:, 0]

    @cached_property
    def linear(self) -> Evaluator:
        """(y, p) -> field, its derivatives by the states and by all parameters."""
        y, f, p = self.states, self.field, self.parameters
        return self._evaluator("linear", lambda: [f, ca.jacobian(f, y), ca.jacobian(f, p)])

    @cached_property
    def _multipliers(self) -> Evaluator:
        """(y, p) -> derivatives of the multipliers that are states, by states and parameters."""
        p, residual = self.parameters, self.motion.multiplier_equations()
        x, u = self.motion.states[: self.by_start], self.motion.states[self.by_start :]
        right = ca.horzcat(ca.jacobian(residual, x), ca.jacobian(residual, p)[:, list(self.chosen)])
        key = ("multipliers", self.chosen)
        return self._evaluator(key, lambda: [-solved(ca.jacobian(residual, u), right)])

    def _evaluator(self, what: Hashable, build: Callable[[], Sequence[ca.SX]]) -> Evaluator:
        return evaluator(self.motion.system, (what, self.motion.mode), build, self.states)

    def start(self, x: Array) -> Array:
        """States and columns at the start of a leg without multipliers that are states, as one row."""
        z = self._unit.copy()
        z[0] = x
        return z.reshape(-1)

    @cached_property
    def _unit(self) -> Array:
        return np.eye(1 + self.columns, self.entries, -1)

    def matrix(self, z: Array) -> Array:
        """The matrix (x, X, P) of states and columns, (N + k, 1 + N + q)."""
        return z.reshape(1 + self.columns, self.entries).T

    def initial(self, x: Array, p: Array) -> Array:
        """The matrix (x, X, P) at the start of a leg, (N + k, 1 + N + q)."""
        n, matrix = self.by_start, np.eye(self.entries, 1 + self.columns, 1)
        matrix[n:] = matrix[:, 1 + n :] = 0.0
        matrix[:n, 0] = x
        if self.entries > n:
            matrix[n:, 0] = self._unknowns(x, p)
            matrix[n:, 1:] = self._multipliers.copied(matrix[:, 0], p)[0]
        return matrix

    def states_at(self, x: Array, p: Array) -> Array:
        """Extended states (N,) and the multipliers that are states of the leg; (N + k,)."""
        if self.entries == self.by_start:
            return x
        return np.concatenate([x, self._unknowns(x, p)])

    def _unknowns(self, x: Array, p: Array) -> Array:
        system, mode = self.motion.system, self.motion.mode
        coupled, which = coupled_of(system), list(self.motion.unknowns)
        solutions = sliding_multipliers(coupled, mode, x, p, stable_only=any(system.nonlinear))
        if len(solutions) != 1:
            raise DegenerateError(
                f"mode {mode!r} at {x.tolist()}: expected one set of multipliers that keeps the "
                f"sliding, received {len(solutions)}. Start elsewhere on the surface, or choose "
                "another itinerary."
            )
        return np.asarray(solutions[0][which])


def variational_field(
    system: FilippovSystem, mode: str, chosen: tuple[int, ...] = ()
) -> VariationalField:
    """Return the variational field of a mode, built once per system."""

    def build() -> VariationalField:
        return VariationalField(motion(system, mode), chosen)

    return system.cached(("variational field", mode, chosen), build)


def states_at(system: FilippovSystem, mode: str, x: Array, p: Array) -> Array:
    """Extended states (N,) and the multipliers that are states of a mode's flow; (N + k,)."""
    return variational_field(system, mode).states_at(x, p)


class GuardedField(PlainField):
    """One mode's flow with its guards along it."""

    @cached_property
    def series(self) -> Series:
        """The Taylor rules of the field and of the guards."""
        return series_of([self.states, self.parameters], [self.field, self.motion.functions])

    @cached_property
    def gradients(self) -> Evaluator:
        """(y, p) -> gradients of the guards (g, N + k)."""
        build = lambda: [ca.jacobian(self.motion.functions, self.states)]
        return evaluator(self.motion.system, ("gradient", self.motion.mode), build, self.states)


def guarded_field(system: FilippovSystem, mode: str) -> GuardedField:
    """Return the guarded field of a mode, built once per system."""
    return system.cached(("guarded field", mode), lambda: GuardedField(motion(system, mode)))
