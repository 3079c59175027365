"""The modes of a system with multipliers as numbers or series, all of them by one program."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...model import Array, Coupled, ErrorScales, FilippovSystem, Guard, coupled_of
from ...model.laws.coupled import MultiplierSeries, set_values
from ...model.laws.frozen import Frozen, frozen
from ...model.laws.layer import spirals_in
from ...model.laws.multipliers import newton_multipliers, sliding_multipliers
from ..options import Options
from .laws_of_sets import unknowns_of_sets
from .modes import Expansion, Modes, SeparateModes, powers, relative, rounding_scale, tolerances


def modes_of(system: FilippovSystem, p: Array, options: Options) -> Modes:
    """Return the modes of a system as the drivers move in them."""
    if system.coupled:
        return CoupledModes(system, coupled_of(system), p, options)
    return SeparateModes(system, p, options)


class CoupledModes:
    """Modes of one program, with multipliers as numbers or series, in Python's doubles."""

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
        free, linearity = all(self._system.parse_letters(mode)), self.coupled.linearity
        return linearity.free if free else linearity.everywhere

    def expand(self, mode: str, x: Array, unknowns: Array) -> Expansion:
        """Jets at an extended state, with the multipliers of what slides."""
        sliding = self.coupled.sliding(mode)
        coupled = self.coupled
        held = coupled.known_multipliers(mode, x, unknowns, self._p)
        marks = coupled.error_scales(x, held, coupled.acting(mode, unknowns), self._p)
        law = MultiplierSeries(
            coupled, mode, unknowns, held, marks.slope, marks.factors, self._options.order
        )
        states, guards = coupled.jets(law, x, self._p)
        allowed = tolerances(self._system, x, self._options)
        inverse = np.abs(_inverse(marks.slope[np.ix_(sliding, sliding)]))
        radii = law.radii(coupled)

        def of_rows(surface: Array, layer: Array, stops: Array, factors: Array) -> Array:
            of_unknowns = layer.copy()
            of_unknowns[sliding] = inverse @ layer[sliding]
            of_unknowns[: self._system.surface_count] += factors[: self._system.surface_count]
            of_sets = {
                s[0]: self._of_set(mode, s, radius, law, surface, of_unknowns, factors, marks)
                for s, radius in zip(self._system.sets, radii, strict=True)
            }
            return self._of_rows(mode, surface, of_unknowns, of_sets, stops, len(guards))

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
            unknowns=law.series,
            inverse=inverse,
            directions=law.directions,
            radii=radii,
            limits=law.limits,
        )

    def _of_set(
        self,
        mode: str,
        members: tuple[int, ...],
        radius: float,
        law: MultiplierSeries,
        surface: Array,
        unknowns: Array,
        limits: Array,
        marks: ErrorScales,
    ) -> list[float]:
        """Error scales of the guards of a set, from those of its functions and of its multipliers."""
        own, letter = list(members), mode[members[0]]
        if letter == "l":
            return [float(surface[own].sum())]
        if letter in "si":
            factor = abs(float(marks.factors[own[0]]))
            sizes = np.abs(law.series[own, 0]) + factor
            rows = [2.0 * float(sizes @ unknowns[own])]
            if self.coupled.scaled[own[0]]:
                rows.append(2.0 * float(limits[own[0]]) / factor if factor else math.inf)
            return rows
        return [2.0 * float(surface[own].sum()) / radius if radius else math.inf]

    def _of_rows(
        self,
        mode: str,
        surface: Array,
        unknowns: Array,
        of_sets: Mapping[int, list[float]],
        stops: Array,
        count: int,
    ) -> Array:
        """Error scales of the guards, from those of surfaces, of sliding multipliers and of stops."""
        rows: list[float] = []
        for i, sign in enumerate(self._system.parse_letters(mode)):
            if i in self._system.set_of:
                rows += of_sets[i] if i in of_sets and mode[i] != "i" else []
                continue
            exits = 2 if i < self._system.surface_count else 1
            rows += [float(surface[i])] if sign else [float(unknowns[i])] * exits
        rows += stops.tolist()
        worst = max(unknowns.tolist(), default=1.0)
        return np.array(rows + [worst] * (count - len(rows)))

    def gradient(self, mode: str, x: Array) -> Array:
        """Magnitudes of the derivatives of the guards of a mode in which nothing slides."""
        none = np.zeros(self.coupled.count)
        marks = self.coupled.error_scales(x, self.coupled.held(mode), none, self._p)
        return np.concatenate([marks.surface_gradient, marks.stop_gradient])

    def at(self, e: Expansion, s: float, nudge: Array | float = 0.0) -> tuple[Array, Array, Array]:
        """Field (N,), guards (m,) at the polynomials' state at time s; multipliers' errors."""
        powered, coupled = powers(s, e.states.shape[1]), self.coupled
        sliding = coupled.sliding(e.mode)
        unknowns, x = e.unknowns @ powered, e.states @ powered + nudge
        later = e.mode.replace("l", "b")
        held = coupled.known_multipliers(later, x, unknowns, self._p)
        found = coupled.values(x, held, coupled.acting(e.mode, unknowns), self._p)
        field, layer, *others = found
        series, layer_, heights, factors, stops = (v[:, None] for v in (unknowns, layer, *others))
        sets = set_values(coupled, e.mode, series, heights, factors, e.radii)
        rows = coupled.rows(e.mode, series, sets, layer_, heights, factors, stops)
        guards = np.concatenate([rows[:, 0], e.guards[len(rows) :] @ powered])
        return field, guards, e.inverse @ np.abs(layer[sliding])

    def angles(self, mode: str, x: Array, surface: int) -> Array | None:
        """L_F1 h and L_F2 h relative to their rounding; None if sliding is regular all the same."""
        mode = mode.replace("b", "*")
        if self.coupled.continuous[surface]:
            return None
        none, result = np.zeros(self.coupled.count), []
        for side in (1.0, -1.0):
            held = self.coupled.known_multipliers(mode, x, none, self._p)
            held[surface] = side
            marks = self.coupled.error_scales(x, held, none, self._p)
            if self.coupled.scaled[surface] and marks.slope[surface, surface]:
                return None
            scale = rounding_scale(marks.layer_gradient[surface], x, self._options.size)
            result.append(relative(marks.layer[surface], scale))
        return np.array(result)

    def rates(
        self, mode: str, x: Array, active: Sequence[int]
    ) -> tuple[Array, Array, Array] | None:
        """Rates of the active surfaces as a + M lambda, and their scales of rounding."""
        mode = mode.replace("b", "*")
        coupled, first = self.coupled, self._system.surface_count
        own = [i for i in active if i < first]
        borne = any(first + j in active for i in own for j in coupled.carriers[i])
        if not coupled.affine or borne or any(coupled.continuous[i] for i in own):
            return None
        held = coupled.known_multipliers(mode, x, np.zeros(coupled.count), self._p)
        held[list(active)] = 0.0
        marks = coupled.error_scales(x, held, np.zeros(coupled.count), self._p)
        if any(marks.factors[i] == 0.0 for i in active):
            return None
        turn = np.where(np.arange(coupled.count) < first, 1.0, -1.0)  # reactions open contacts
        slope = turn[:, None] * marks.slope * marks.factors
        scales = rounding_scale(marks.layer_gradient, x, self._options.size)
        if not np.all(np.isfinite(marks.layer)):
            return None
        chosen = list(active)
        return (turn * marks.layer)[chosen], slope[np.ix_(chosen, chosen)], scales[chosen]

    def solutions(
        self, mode: str, x: Array, stable_only: bool = True, kept: Array | None = None
    ) -> list[Array]:
        """Multipliers (surfaces,) that keep the sliding surfaces of a mode."""
        if self._system.sets:
            kept = np.zeros(self.coupled.count) if kept is None else kept
            return unknowns_of_sets(self.coupled, mode, x, self._p, kept, stable_only)
        return sliding_multipliers(self.coupled, mode, x, self._p, stable_only)

    def frozen(
        self, mode: str, x: Array, active: Sequence[int], kept: Array | None
    ) -> Frozen | None:
        """Rates of the active sets of codimension two and more as a - M lambda."""
        kept = np.zeros(self.coupled.count) if kept is None else kept
        return frozen(self.coupled, mode, x, kept, self._p, active)

    def spirals_in(self, mode: str, x: Array, surfaces: Sequence[int]) -> bool:
        """Whether orbits of the plane run round the point where two surfaces meet, and towards it."""
        return spirals_in(self._system, x, self.coupled.held(mode), self._p, surfaces)

    def improve(self, mode: str, x: Array, unknowns: Array) -> Array:
        """Correct multipliers that were advanced by a step."""
        if not self.coupled.sliding(mode):
            return unknowns
        better = newton_multipliers(self.coupled, mode, x, unknowns, self._p, 2)
        return unknowns if better is None else better


def _inverse(matrix: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(matrix), float)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)
