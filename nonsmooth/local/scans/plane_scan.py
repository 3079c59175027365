"""Scan of a planar system in a box: pieces of its surface, folds, equilibria, pseudo-equilibria.

The surface may be that of a complementarity condition. Where a condition or a gap is negative, or an event is due
at once, there is no motion.

Points are found by sign changes on a grid and then solved for. Two of a kind closer than the grid
(1/160 of the box) can be missed. Names follow Kuznetsov, Rinaldi & Gragnani 2003.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem, HeldEvent, call, one_surface
from ...solvers.newton import solve_many
from ..point.surface_point import SIDES, LocalSurface, ManyNumbers, Side
from ..searches.equilibria import Equilibrium, find_equilibrium
from ..searches.folds import Fold, tangency_near
from ..searches.pseudo_equilibria import (
    PseudoEquilibrium,
    closed_equilibrium,
    find_pseudo_equilibrium,
)
from ..searches.search import find_all
from .box import Box, inserted, middle_of_sign_changes, refined, sign_changes, zero_lines

_GRID = 161  # for the surface
_CELLS = 61  # for equilibria
_MOST = 100  # starts of one search
_ON_SURFACE = 1e-3  # an equilibrium closer to its field's fold, in units of the box, is drawn on it


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of the surface of one kind: "attracting", "repelling" or "crossing"."""

    kind: str
    points: Array


@dataclass(frozen=True, eq=False)
class PlaneScan:
    """A planar system with one surface, or none, in a box."""

    where: LocalSurface
    box: Box
    whole: FilippovSystem
    events: tuple[HeldEvent, ...] = ()

    @classmethod
    def of(
        cls,
        system: FilippovSystem,
        parameters: Mapping[str, float],
        box: Box,
        events: tuple[HeldEvent, ...] = (),
    ) -> PlaneScan:
        """Scan a system of two states, at most one surface or condition and no explicit time."""
        p, mode = system.parameter_vector(parameters), "s" if system.surface_count else ""
        where = LocalSurface(system, 0, mode, p)
        if system.complementarity:
            element = one_surface(system, "o", 0)
            where = LocalSurface(element.system, 0, mode, p, element)
        return cls(where, box, system, events)

    @property
    def _beyond(self) -> list[Any]:
        """Functions of the state that are positive where an event is due at once or a gap is negative."""
        gaps = self.whole.definition.gaps
        found = [e.region for e in self.events if e.level]
        return [*found, *[-gaps[j] for j in range(gaps.numel())]]

    @cached_property
    def excluded(self) -> list[Any]:
        """Functions of the state that are positive where there is no motion, as expressions."""
        own = [-self.where.system.surface_function()] if self.where.one_sided else []
        return [*self._beyond, *own]

    def is_excluded(self, points: Array) -> NDArray[np.bool_]:
        """Whether there is no motion at points (k, 2)."""
        return self._any_positive(self.excluded, "excluded", points)

    def is_beyond(self, points: Array) -> NDArray[np.bool_]:
        """Whether an event is due at once or a gap is negative at points (k, 2)."""
        return self._any_positive(self._beyond, "beyond", points)

    def _any_positive(self, functions: list[Any], name: str, points: Array) -> NDArray[np.bool_]:
        if not functions or not len(points):
            return np.zeros(len(points), dtype=bool)
        function = self.whole.function((name, self.events), lambda: functions)
        values = call(function, points.T, self.where.parameters)
        return np.asarray(np.any([v.ravel() > 0.0 for v in values], axis=0))

    def of_events(self, points: Array) -> list[Array]:
        """For each event a function at points (k, 2) that is zero where it is due, NaN where its filter does not hold."""

        def build() -> list[Any]:
            return [e for event in self.events for e in event.functions]

        function = self.whole.function(("events", self.events), build)
        values = [v.ravel() for v in call(function, points.T, self.where.parameters)]
        pairs = zip(values[::2], values[1::2], strict=True)
        return [np.where(when >= 0.0, due, np.nan) for due, when in pairs]

    def at(self, points: Array) -> ManyNumbers:
        """Numbers at points (k, 2)."""
        return self.where.many(points)

    def project(self, points: Array) -> Array:
        """Move points onto the surface along its gradient."""

        def equations(x: Array, _: NDArray[np.int64]) -> tuple[Array, Array]:
            h, gradient = self.where.many_h(x)
            return h[:, None], gradient[:, None, :]

        return solve_many(equations, points, tol=1.0, iterations=4)[0]

    # the surface -------------------------------------------------------------------------------

    @cached_property
    def curves(self) -> list[Array]:
        """The surface as polylines (m, 2), with at most a grid step between neighbours."""
        if not self.where.mode:
            return []
        h = self.where.many_h(self.box.grid(_GRID))[0].reshape(_GRID, _GRID)
        found = zero_lines(self.box.lines(_GRID), h)
        return [self.project(refined(line, self.box.size, 1 / _GRID)) for line in found]

    @cached_property
    def pieces(self) -> list[Piece]:
        """The surface cut at its folds, where there is motion."""
        found = [_pieces(self, curve) for curve in self.curves]
        return [part for pieces in found for piece in pieces for part in self._moving(piece)]

    def _moving(self, piece: Piece) -> list[Piece]:
        """Parts of a piece at which there is motion."""
        due = self.is_beyond(piece.points)
        cuts = [0, *(np.flatnonzero(due[1:] != due[:-1]) + 1), len(due)]
        parts = [(a, b) for a, b in pairwise(cuts) if not due[a] and b - a > 1]
        return [Piece(piece.kind, piece.points[a:b]) for a, b in parts]

    # special points ----------------------------------------------------------------------------

    def _from_curves(
        self, what: Callable[[ManyNumbers], Array], look: Callable[[Array], Any]
    ) -> list[Any]:
        """Search from where a function changes sign along the surface; no result twice."""
        starts = [np.empty((0, 2))]
        for curve in self.curves:
            values = what(self.at(curve))
            k = sign_changes(values)
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.nan_to_num(values[k] / (values[k] - values[k + 1]))
            starts.append(curve[k] + share[:, None] * (curve[k + 1] - curve[k]))
        found = find_all(look, np.vstack(starts)[:_MOST])
        found = [f for f in found if self.box.contains(f.point)]
        return [f for f in found if not self.is_beyond(f.point[None, :])[0]]

    @cached_property
    def tangencies(self) -> list[Fold]:
        """Where a field is tangent to the surface or zero: folds, and boundary equilibria."""
        return [fold for k, side in enumerate(self.sides) for fold in self._folds(k, side)]

    @property
    def sides(self) -> tuple[Side, ...]:
        """Sides on which there is motion."""
        return SIDES if self.where.mode and not self.where.one_sided else SIDES[:1]

    def _folds(self, k: int, side: Side) -> list[Fold]:
        where = self.where

        def look(x: Array) -> Fold:
            return tangency_near(where, x, side, (0, 1), 3)

        return self._from_curves(lambda numbers: numbers.lie[:, k], look)

    @cached_property
    def boundary_equilibria(self) -> list[Equilibrium]:
        """Equilibria of a field on the surface, or closer to it than a picture of the box shows."""
        # The field is zero there, not only tangent: no fold, and no pseudo-equilibrium beside it.
        found = list[Equilibrium]()
        for fold in self.tangencies:
            for at in find_all(partial(self._equilibrium, side=fold.side), fold.point[None, :]):
                if self._close(at.point, fold.point):
                    found.append(replace(at, status="boundary"))
        return found

    def _close(self, one: Array, other: Array) -> bool:
        return float(np.linalg.norm((one - other) / self.box.size)) < _ON_SURFACE

    def _apart(self, points: list[Any]) -> list[Any]:
        """Those that are not boundary equilibria."""
        rests = [at.point for at in self.boundary_equilibria]
        return [f for f in points if not any(self._close(f.point, at) for at in rests)]

    @cached_property
    def folds(self) -> list[Fold]:
        """Folds of both fields, those in one point where a force jumps; none of a continuous surface."""
        if not self.where.mode:
            return []
        switching = None if self.where.one_sided else self.where.switching
        soft = switching is not None and not (switching.slides or switching.force_jumps)
        return [] if soft else self._apart(self.tangencies)

    @cached_property
    def pseudo_equilibria(self) -> list[PseudoEquilibrium]:
        """Real pseudo-equilibria."""
        where = self.where

        def along(numbers: ManyNumbers) -> Array:
            tangent = np.column_stack([numbers.gradient[:, 1], -numbers.gradient[:, 0]])
            return np.sum(numbers.numerator * tangent, axis=1)

        def look(x: Array) -> PseudoEquilibrium:
            return find_pseudo_equilibrium(where.system, x, parameters=where.values)

        if where.one_sided:
            return self._apart(self._closed())
        found = self._from_curves(along, look)
        return self._apart([e for e in found if e.status == "real"])

    def _closed(self) -> list[PseudoEquilibrium]:
        """Where a condition rests while it is closed."""

        def along(numbers: ManyNumbers) -> Array:
            tangent = np.column_stack([numbers.gradient[:, 1], -numbers.gradient[:, 0]])
            return np.sum(numbers.fields[:, 1] * tangent, axis=1)

        def look(x: Array) -> Equilibrium:
            return find_equilibrium(self.whole, x, parameters=self.where.values, mode="c")

        found = self._from_curves(along, look)
        return [closed_equilibrium(e) for e in found if e.status == "real"]

    @cached_property
    def equilibria(self) -> list[Equilibrium]:
        """Equilibria of each field on its own side."""
        numbers = self.at(self.box.grid(_CELLS))
        return [e for k, side in enumerate(self.sides) for e in self._equilibria(numbers, k, side)]

    def _equilibria(self, numbers: ManyNumbers, k: int, side: Side) -> list[Equilibrium]:
        field = numbers.fields[:, k].reshape(_CELLS, _CELLS, 2)
        components = [field[:, :, 0], field[:, :, 1]]
        starts = middle_of_sign_changes(self.box.lines(_CELLS), components)

        found = find_all(partial(self._equilibrium, side=side), starts[:_MOST])
        found = [e for e in found if e.status == "real" and self.box.contains(e.point)]
        found = [e for e in found if not self.is_excluded(e.point[None, :])[0]]
        return self._apart(found)

    def _equilibrium(self, near: Array, side: Side) -> Equilibrium:
        return find_equilibrium(self.where.system, near, side=side, parameters=self.where.values)

    def eigenvectors(self, found: Equilibrium) -> Array:
        """Real eigenvectors of a saddle as rows: the stable one, then the unstable one; (2, 2)."""
        jacobian = self.where.jacobians(found.point)[SIDES.index(found.side)]
        values, vectors = np.linalg.eig(jacobian)
        return np.real(vectors).T[np.argsort(np.real(values))]


def _pieces(scan: PlaneScan, curve: Array) -> list[Piece]:
    """Cut a polyline of the surface at the folds and name the pieces."""
    near = [
        fold.point
        for fold in scan.tangencies
        if np.min(np.linalg.norm((curve - fold.point) / scan.box.size, axis=1)) < 2 / _GRID
    ]
    full = inserted(curve, np.reshape(near, (-1, 2)))
    lie = scan.at((full[1:] + full[:-1]) / 2).lie
    slides = lie[:, 0] < 0
    if not scan.where.one_sided:
        slides = (lie[:, 0] * lie[:, 1] < 0) & scan.where.switching.slides
    kinds = np.where(slides, np.where(lie[:, 0] < 0, "attracting", "repelling"), "crossing")
    cuts = [0, *(np.flatnonzero(kinds[1:] != kinds[:-1]) + 1), len(kinds)]
    return [Piece(str(kinds[a]), full[a : b + 1]) for a, b in pairwise(cuts)]
