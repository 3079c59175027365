"""The modes of a system, expanded at a state: one by one, or all of them by one program.

Systems of at most one surface with a multiplier that enters linearly have few modes; each has its own
jets, in which sliding is written out. Others have their multipliers as series (``model.coupled``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...model import Array, Coupled, Evaluator, FilippovSystem, Guard, Motion, coupled_of, motion
from ...model.layer import spirals_in
from ...model.multipliers import newton_multipliers, sliding_multipliers
from ..facts import SAFETY
from ..options import Options


@dataclass(frozen=True)
class Expansion:
    """Jets of a mode at a point, and how exact they have to be and can be.

    Attributes
    ----------
    mode : str
    states : ndarray (N, P+1)
        Coefficients of the extended states.
    guards : ndarray (m, P+1)
        Coefficients of the guards.
    allowed : ndarray (N,)
        Local errors of the states that are allowed; 0 for the time, which is exact.
    guard_allowed : ndarray (m,)
        What they come to in the guards.
    scales : ndarray (m,)
        Rounding in a guard is that times epsilon.
    steepness : ndarray (m,)
        Sums of the magnitudes of the guards' slopes.
    finite : bool
    unknowns : ndarray (surfaces, P+1)
        Series of the multipliers that slide; empty where sliding is written out.
    inverse : ndarray
        Of the slope of the layer problem, in magnitude; empty likewise.
    """

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
        """Field (N,), guards (m,) at the polynomials' state at time s, moved by ``nudge``;
        multipliers' errors."""
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

    def solutions(self, mode: str, x: Array, stable_only: bool = True) -> list[Array]:
        """Multipliers (surfaces,) that keep the sliding surfaces of a mode."""
        ...

    def spirals_in(self, mode: str, x: Array, surfaces: Sequence[int]) -> bool:
        """Whether orbits of the plane run round the point where two surfaces meet, and towards it."""
        ...

    def improve(self, mode: str, x: Array, unknowns: Array) -> Array:
        """Correct multipliers that were advanced by a step."""
        ...


def modes_of(system: FilippovSystem, p: Array, options: Options) -> Modes:
    """Return the modes of a system as the drivers move in them."""
    if system.coupled:
        return CoupledModes(system, coupled_of(system), p, options)
    return SeparateModes(system, p, options)


def rounding_scale(gradient: Array, x: Array, size: float) -> Array:
    """``sum_i |d guard/d x_i| (size + |x_i|)``: rounding in a guard is that times epsilon.

    Entries that are not finite, those of a square root at zero, say nothing and are left out.
    """
    return np.where(np.isfinite(gradient), gradient, 0.0) @ (size + np.abs(x))


def tolerances(system: FilippovSystem, x: Array, options: Options) -> Array:
    """Local errors that are allowed at an extended state; the time is exact."""
    allowed = SAFETY * (options.atol + options.rtol * np.abs(x))
    if system.time_dependent:
        allowed[system.dimension] = 0.0
    return allowed


class SeparateModes:
    """Modes that have their jets one by one, evaluated by CasADi.

    Parameters
    ----------
    system : FilippovSystem
    p : ndarray
    options : Options
    motion_of : callable, optional
        Where the motion of a mode comes from.
    """

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
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(values / scales)

    def rates(self, mode: str, x: Array, active: Sequence[int]) -> None:
        """There is one surface."""

    def solutions(self, mode: str, x: Array, stable_only: bool = True) -> list[Array]:
        """Multipliers are eliminated."""
        return [np.zeros(len(mode))]

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


class CoupledModes:
    """Modes of one program, with multipliers as numbers or series, in Python's doubles.

    Parameters
    ----------
    system : FilippovSystem
    coupled : Coupled
    p : ndarray
    options : Options
    kinds : callable, optional
        Guards of a mode, where they have other meanings than the program's.
    """

    def __init__(
        self,
        system: FilippovSystem,
        coupled: Coupled,
        p: Array,
        options: Options,
        kinds: Callable[[str], tuple[Guard, ...]] | None = None,
    ):
        self._system, self.coupled, self._p, self._options = system, coupled, p, options
        self._kinds = kinds or coupled.guards

    def guards(self, mode: str) -> tuple[Guard, ...]:
        """Guards, in the order of the rows of an expansion."""
        return self._kinds(mode)

    def affine(self, mode: str) -> bool:
        """Whether field and guards are affine in the states."""
        return self.coupled.linear

    def expand(self, mode: str, x: Array, unknowns: Array) -> Expansion:
        """Jets at an extended state, with the multipliers of what slides."""
        signs = self._system.parse_letters(mode)
        sliding = self.coupled.sliding(mode)
        marks = self.coupled.yardsticks(x, self.coupled.held(mode), unknowns, self._p)
        states, guards, series = self.coupled.jets(
            mode, x, unknowns, marks.slope, self._p, self._options.order
        )
        allowed = tolerances(self._system, x, self._options)
        inverse = np.abs(_inverse(marks.slope[np.ix_(sliding, sliding)]))

        def of_rows(surface: Array, layer: Array, stops: Array, factors: Array) -> Array:
            of_unknowns = layer.copy()
            of_unknowns[sliding] = inverse @ layer[sliding]
            of_unknowns[: self._system.surface_count] += factors[: self._system.surface_count]
            return self._of_rows(signs, surface, of_unknowns, stops, len(guards))

        size = self._options.size
        gradients = (
            *(marks.surface_gradient, marks.layer_gradient, marks.stop_gradient),
            marks.factor_gradient,
        )
        return Expansion(
            mode=mode,
            states=states,
            guards=guards,
            allowed=allowed,
            guard_allowed=of_rows(*[g @ allowed for g in gradients]),
            scales=of_rows(*[rounding_scale(g, x, size) for g in gradients]),
            steepness=of_rows(*[g.sum(axis=1) for g in gradients]),
            finite=bool(np.all(np.isfinite(states)) and np.all(np.isfinite(guards))),
            unknowns=series,
            inverse=inverse,
        )

    def _of_rows(
        self,
        signs: Sequence[int],
        surface: Array,
        unknowns: Array,
        stops: Array,
        count: int,
    ) -> Array:
        """Yardsticks of the guards, from those of surfaces, of sliding multipliers and of stops."""
        rows: list[float] = []
        for i, sign in enumerate(signs):
            exits = 2 if i < self._system.surface_count else 1
            rows += [float(surface[i])] if sign else [float(unknowns[i])] * exits
        rows += stops.tolist()
        worst = max(unknowns.tolist(), default=1.0)
        return np.array(rows + [worst] * (count - len(rows)))

    def gradient(self, mode: str, x: Array) -> Array:
        """Not asked for: multipliers are series."""
        raise NotImplementedError

    def at(self, e: Expansion, s: float, nudge: Array | float = 0.0) -> tuple[Array, Array, Array]:
        """Field (N,), guards (m,) at the polynomials' state at time s; multipliers' errors."""
        powered = powers(s, e.states.shape[1])
        sliding = self.coupled.sliding(e.mode)
        unknowns = e.unknowns @ powered
        held = self.coupled.held(e.mode)
        found = self.coupled.values(e.states @ powered + nudge, held, unknowns, self._p)
        field, layer, *others = found
        columns = [v[:, None] for v in (unknowns, layer, *others)]
        rows = self.coupled.rows(e.mode, *columns)
        guards = np.concatenate([rows[:, 0], e.guards[len(rows) :] @ powered])
        return field, guards, e.inverse @ np.abs(layer[sliding])

    def angles(self, mode: str, x: Array, surface: int) -> Array | None:
        """L_F1 h and L_F2 h relative to their rounding; None if sliding is regular all the same."""
        if self.coupled.continuous[surface]:
            return None
        none, result = np.zeros(self.coupled.count), []
        for side in (1.0, -1.0):
            held = self.coupled.held(mode)
            held[surface] = side
            marks = self.coupled.yardsticks(x, held, none, self._p)
            if self.coupled.scaled[surface] and marks.slope[surface, surface]:
                return None
            scale = rounding_scale(marks.layer_gradient[surface], x, self._options.size)
            with np.errstate(divide="ignore", invalid="ignore"):
                result.append(marks.layer[surface] / scale)
        return np.array(result)

    def rates(
        self, mode: str, x: Array, active: Sequence[int]
    ) -> tuple[Array, Array, Array] | None:
        """Rates of the active surfaces as a + M lambda, and their scales of rounding."""
        coupled, first = self.coupled, self._system.surface_count
        own = [i for i in active if i < first]
        borne = any(first + j in active for i in own for j in coupled.carriers[i])
        if not coupled.affine or borne or any(coupled.continuous[i] for i in own):
            return None
        held = coupled.held(mode)
        held[list(active)] = 0.0
        marks = coupled.yardsticks(x, held, np.zeros(coupled.count), self._p)
        if any(marks.factors[i] == 0.0 for i in active):
            return None
        turn = np.where(np.arange(coupled.count) < first, 1.0, -1.0)  # reactions open contacts
        slope = turn[:, None] * marks.slope * marks.factors
        scales = rounding_scale(marks.layer_gradient, x, self._options.size)
        if not np.all(np.isfinite(marks.layer)):
            return None
        chosen = list(active)
        return (turn * marks.layer)[chosen], slope[np.ix_(chosen, chosen)], scales[chosen]

    def solutions(self, mode: str, x: Array, stable_only: bool = True) -> list[Array]:
        """Multipliers (surfaces,) that keep the sliding surfaces of a mode."""
        return sliding_multipliers(self.coupled, mode, x, self._p, stable_only)

    def spirals_in(self, mode: str, x: Array, surfaces: Sequence[int]) -> bool:
        """Whether orbits of the plane run round the point where two surfaces meet, and towards it."""
        return spirals_in(self._system, x, self.coupled.held(mode), self._p, surfaces)

    def improve(self, mode: str, x: Array, unknowns: Array) -> Array:
        """Correct multipliers that were advanced by a step."""
        if not self.coupled.sliding(mode):
            return unknowns
        better = newton_multipliers(self.coupled, mode, x, unknowns, self._p, 2)
        return unknowns if better is None else better


def powers(h: float, count: int) -> Array:
    """Return h^0, h^1, ... (count,)."""
    return np.asarray(h ** np.arange(count), float)


def _inverse(matrix: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(matrix), float)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)
