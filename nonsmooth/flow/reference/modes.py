"""The modes of a system, expanded at a state, one by one.

Systems of at most one surface with a multiplier that enters linearly have few modes; each has its own
jets, in which sliding is written out. Others have their multipliers as series (``coupled_modes``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ...model import Array, Evaluator, FilippovSystem, Guard, Motion, motion
from ...model.laws.frozen import Frozen
from ..constants import SAFETY
from ..options import Options

#: What is larger may have derivatives that are infinite.
_HUGE = 1e300


@dataclass(frozen=True)
class Expansion:
    """Jets of a mode at a point, and how exact they have to be and can be."""

    mode: str
    states: Array
    guards: Array
    allowed: Array
    guard_allowed: Array
    scales: Array
    steepness: Array
    finite: bool
    unknowns: Array
    inverse: Array
    directions: Array = field(default_factory=lambda: np.zeros((0, 1)))
    radii: Array = field(default_factory=lambda: np.zeros(0))
    limits: Array = field(default_factory=lambda: np.zeros((0, 1)))

    @property
    def overflows(self) -> bool:
        """Whether the field is so large that its derivatives may be no numbers."""
        return bool(np.nanmax(np.abs(self.states[:, :2])) > _HUGE)


class Modes(Protocol):
    """What a stepper needs to know of the modes of a system."""

    def guards(self, mode: str) -> tuple[Guard, ...]:
        """Guards, in the order of the rows of an expansion."""
        ...

    def affine(self, mode: str) -> bool:
        """Whether field and guards are affine in the states."""
        ...

    def expand(self, mode: str, x: Array, unknowns: Array) -> Expansion:
        """Jets at an extended state, with the multipliers of what slides."""
        ...

    def at(self, e: Expansion, s: float, nudge: Array | float = 0.0) -> tuple[Array, Array, Array]:
        """Field (N,), guards (m,) at the polynomials' state at time s, moved by ``nudge``."""
        ...

    def gradient(self, mode: str, x: Array) -> Array:
        """Magnitudes of the slopes of the guards (m, N) where multipliers are eliminated."""
        ...

    def angles(self, mode: str, x: Array, surface: int) -> Array | None:
        """L_F1 h and L_F2 h relative to their rounding; None if sliding is regular all the same."""
        ...

    def rates(
        self, mode: str, x: Array, active: Sequence[int]
    ) -> tuple[Array, Array, Array] | None:
        """Rates of the active surfaces as a + M lambda, and their scales of rounding."""
        ...

    def solutions(
        self, mode: str, x: Array, stable_only: bool = True, kept: Array | None = None
    ) -> list[Array]:
        """Multipliers (surfaces,) that keep the sliding surfaces of a mode."""
        ...

    def frozen(
        self, mode: str, x: Array, active: Sequence[int], kept: Array | None
    ) -> Frozen | None:
        """Rates of the active sets of codimension two and more as a - M lambda."""
        ...

    def spirals_in(self, mode: str, x: Array, surfaces: Sequence[int]) -> bool:
        """Whether orbits of the plane run round the point where two surfaces meet, and towards it."""
        ...

    def improve(self, mode: str, x: Array, unknowns: Array) -> Array:
        """Correct multipliers that were advanced by a step."""
        ...


def rounding_scale(gradient: Array, x: Array, size: float) -> Array:
    """``sum_i |d guard/d x_i| (size + |x_i|)``: rounding in a guard is that times epsilon."""
    # Entries that are not finite, those of a square root at zero, say nothing and are left out.
    return np.where(np.isfinite(gradient), gradient, 0.0) @ (size + np.abs(x))


def relative(values: Array, scales: Array) -> Array:
    """Values over their scales; zero where the value is, also where it is everywhere and has no scale."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(values == 0.0, 0.0, values / scales)


def tolerances(system: FilippovSystem, x: Array, options: Options) -> Array:
    """Local errors that are allowed at an extended state; the time is exact."""
    allowed = SAFETY * (options.atol + options.rtol * np.abs(x))
    if system.time_dependent:
        allowed[system.dimension] = 0.0
    return allowed


class SeparateModes:
    """Modes that have their jets one by one, evaluated by CasADi."""

    def __init__(
        self,
        system: FilippovSystem,
        p: Array,
        options: Options,
        motion_of: Callable[[FilippovSystem, str], Motion] = motion,
    ):
        self._system, self._p, self._options, self._motion_of = system, p, options, motion_of
        self._evaluators: dict[tuple[str, str], Any] = {}

    def _motion(self, mode: str) -> Motion:
        return self._motion_of(self._system, mode)

    def _evaluator(self, kind: str, mode: str) -> Evaluator:
        key = (kind, mode)
        if key not in self._evaluators:
            of_mode = self._motion(mode)
            made = {
                "jet": lambda: of_mode.jet_function(self._options.order),
                "gradient": of_mode.gradient_function,
                "value": of_mode.value_function,
            }
            self._evaluators[key] = Evaluator(made[kind]())
        evaluator: Evaluator = self._evaluators[key]
        return evaluator

    def guards(self, mode: str) -> tuple[Guard, ...]:
        """Guards, in the order of the rows of an expansion."""
        return self._motion(mode).guards

    def affine(self, mode: str) -> bool:
        """Whether field and guards are affine in the states."""
        return self._motion(mode).affine

    def expand(self, mode: str, x: Array, unknowns: Array) -> Expansion:
        """Jets at an extended state; a fresh copy."""
        states, guards = (np.array(a) for a in self._evaluator("jet", mode)(x, self._p))
        gradient = self.gradient(mode, x)
        allowed = tolerances(self._system, x, self._options)
        return Expansion(
            mode=mode,
            states=states,
            guards=guards,
            allowed=allowed,
            guard_allowed=gradient @ allowed,
            scales=rounding_scale(gradient, x, self._options.size),
            steepness=gradient.sum(axis=1),  # infinite at a power law's zero
            finite=bool(np.all(np.isfinite(states)) and np.all(np.isfinite(guards))),
            unknowns=np.zeros((0, states.shape[1])),
            inverse=np.zeros((0, 0)),
        )

    def gradient(self, mode: str, x: Array) -> Array:
        """Magnitudes of the slopes of the guards (m, N)."""
        return np.abs(self._evaluator("gradient", mode)(x, self._p)[0])

    def angles(self, mode: str, x: Array, surface: int) -> Array | None:
        """L_F1 h and L_F2 h relative to their rounding; None if sliding is regular all the same."""
        sliding = mode[:surface] + "s" + mode[surface + 1 :]
        if self._motion(sliding).regular:
            return None
        rows = [
            k
            for k, guard in enumerate(self.guards(sliding))
            if guard.kind == "exit" and guard.index == surface
        ]
        values = self._evaluator("value", sliding)(x, self._p)[1][rows, 0]
        scales = rounding_scale(self.gradient(sliding, x)[rows], x, self._options.size)
        return relative(values, scales)

    def rates(self, mode: str, x: Array, active: Sequence[int]) -> None:
        """There is one surface."""

    def solutions(
        self, mode: str, x: Array, stable_only: bool = True, kept: Array | None = None
    ) -> list[Array]:
        """Multipliers are eliminated."""
        return [np.zeros(len(mode))]

    def frozen(self, mode: str, x: Array, active: Sequence[int], kept: Array | None) -> None:
        """There are surfaces only."""

    def spirals_in(self, mode: str, x: Array, surfaces: Sequence[int]) -> bool:
        """There is one surface."""
        return False

    def improve(self, mode: str, x: Array, unknowns: Array) -> Array:
        """Multipliers are eliminated."""
        return unknowns

    def at(self, e: Expansion, s: float, nudge: Array | float = 0.0) -> tuple[Array, Array, Array]:
        """Field (N,), guards (m,) at the polynomials' state at time s; no multipliers."""
        state = e.states @ powers(s, e.states.shape[1]) + nudge
        field, guards = self._evaluator("value", e.mode)(state, self._p)
        return field[:, 0], guards[:, 0] if guards.size else np.zeros(0), np.zeros(0)


def powers(h: float, count: int) -> Array:
    """Return h^0, h^1, ... (count,)."""
    return np.asarray(h ** np.arange(count), float)
