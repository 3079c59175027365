"""Scan of a switching surface of three states: regions, fold curves, cusps, two-folds.

The surface is a graph over two of the states. Points are found by sign changes on a grid and then
solved for. Two of a kind closer than the grid (1/200 of the box) can be missed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array, DefinitionError, FilippovSystem, NonsmoothError, evaluator
from ...solvers.newton import solve_many
from ..point.regions import Region
from ..point.surface_point import FIELDS, SIDES, LocalSurface, ManyNumbers, Side, side_index
from ..searches.find_two_fold import TwoFold, find_two_fold
from ..searches.pseudo_equilibria import PseudoEquilibrium, find_pseudo_equilibrium
from ..searches.search import find_all, search
from .box import Box, middle_of_sign_changes, refined, zero_lines

_GRID = 201
_MOST = 50  # starts of one search

#: What ``SurfaceScan.regions`` counts, in this order.
REGIONS = (Region.ATTRACTING, Region.REPELLING, Region.CROSSING_UP, Region.CROSSING_DOWN)


@dataclass(frozen=True, eq=False)
class FoldCurve:
    """Folds of one field along a curve over the box."""

    side: Side
    pieces: tuple[tuple[Array, bool], ...]
    cusps: Array


@dataclass(frozen=True, eq=False)
class SurfaceScan:
    """The surface of a system of three states over a box of two of them."""

    where: LocalSurface
    box: Box
    shown: tuple[int, int]
    left_out: int
    guess: float

    @classmethod
    def of(
        cls,
        system: FilippovSystem,
        parameters: Mapping[str, float],
        box: Box,
        coordinates: Sequence[str] | None = None,
        guess: float = 0.0,
    ) -> SurfaceScan:
        """Choose the coordinates unless they are given."""
        names = list(system.state_names)
        if coordinates is None:
            pairs = [(1, 2), (0, 2), (0, 1)]
        else:
            chosen = [str(name) for name in coordinates]
            if len(chosen) != 2 or len(set(chosen)) != 2 or not set(chosen) <= set(names):
                raise DefinitionError(
                    f"coordinates: expected two of the states {names}, received {coordinates!r}. "
                    "Leave it out to draw over the two along which the surface is flattest."
                )
            pairs = [(names.index(chosen[0]), names.index(chosen[1]))]
        where = LocalSurface(system, 0, "s", system.parameter_vector(parameters))
        scans = [cls(where, box, p, 3 - sum(p), guess) for p in pairs]
        best = max(scans, key=lambda scan: scan._steepness())
        if not best._steepness() > 0:
            raise DefinitionError(
                "surface: h = 0 cannot be solved for the remaining state over "
                f"{[names[i] for i in best.shown]} in {box.limits}. Choose other coordinates=, another "
                "box or guess=."
            )
        return best

    def _steepness(self) -> float:
        """Share of the box over which the surface is found, times how steep it is there."""
        gradient = self.where.many_h(self.lift(self.box.grid(9)))[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.abs(gradient[:, self.left_out]) / np.linalg.norm(gradient, axis=1)
        return float(np.nan_to_num(share).mean())

    # the surface -------------------------------------------------------------------------------

    def flat(self, points: Array) -> Array:
        """Return the two coordinates of states (..., 3)."""
        return points[..., list(self.shown)]

    def lift(self, flat: Array, third: float | None = None) -> Array:
        """Points (k, 3) of the surface over (k, 2); NaN where Newton's method finds none."""
        points = np.empty((len(flat), 3))
        points[:, list(self.shown)] = flat
        k = self.left_out

        def equations(x: Array, which: NDArray[np.int64]) -> tuple[Array, Array]:
            full = points[which]
            full[:, k] = x[:, 0]
            h, gradient = self.where.many_h(full)
            return h[:, None], gradient[:, None, k : k + 1]

        start = np.full((len(flat), 1), self.guess if third is None else third)
        found, converged = solve_many(equations, start, tol=1e-9, iterations=40)
        points[:, k] = np.where(converged, found[:, 0], np.nan)
        return points

    @property
    def mesh(self) -> tuple[Array, Array]:
        """Grid lines of the two coordinates."""
        return self.box.lines(_GRID)

    @cached_property
    def _numbers(self) -> ManyNumbers:
        return self.where.many(self.lift(self.box.grid(_GRID)))

    def _on_grid(self, values: NDArray[Any]) -> NDArray[Any]:
        return values.reshape(_GRID, _GRID)

    @cached_property
    def regions(self) -> NDArray[np.int64]:
        """Per grid point the index in ``REGIONS``, -1 where there is no surface."""
        l1, l2 = (self._on_grid(self._numbers.lie[:, k]) for k in (0, 1))
        if not self.where.switching.slides:  # but for rounding both are the same
            l2 = l1
        kinds = np.where(l1 <= 0, np.where(l2 > 0, 0, 3), np.where(l2 > 0, 2, 1))
        return np.where(np.isfinite(l1), kinds, -1)

    # folds -------------------------------------------------------------------------------------

    @cached_property
    def folds(self) -> list[FoldCurve]:
        """Fold curves of both fields; none where nothing slides."""
        found = list[FoldCurve]()
        if not self.where.switching.slides:
            return found
        for k, side in enumerate(SIDES):
            lie = self._on_grid(self._numbers.lie[:, k])
            found += [self._fold(line, side) for line in zero_lines(self.mesh, lie)]
        return [curve for curve in found if curve.pieces]

    def _tangency(self, side: Side) -> Any:
        """Evaluator of L_ii and the gradients of h, L_i and L_ii."""
        where, system = self.where, self.where.system
        mode = where.side(side)

        def build() -> list[Any]:
            h = system.surface_function(where.surface)
            lie = [system.lie_derivative([mode] * k, where.surface) for k in (1, 2)]
            return [h, *lie, *(system.gradient(e) for e in (h, *lie))]

        return evaluator(system, ("tangency", where.surface, mode), build)

    def _fold(self, line: Array, side: Side) -> FoldCurve:
        """Polish a contour line of L_i and cut it at its cusps."""
        points = self._onto(self.lift(refined(line, self.box.size, 1 / _GRID)), side)
        points = points[np.all(np.isfinite(points), axis=1)]
        if len(points) < 2:
            return FoldCurve(side, (), np.empty((0, 2)))
        numbers, k = self.where.many(points), side_index(side)
        bend = np.sum(numbers.fields[:, k] * numbers.lie_gradients[:, k], axis=1)  # L_ii
        seen = bend if side == "+" else -bend
        change = np.flatnonzero((seen[1:] > 0) != (seen[:-1] > 0))
        share = (seen[change] / (seen[change] - seen[change + 1]))[:, None]
        near = (1 - share) * points[change] + share * points[change + 1]
        cusps = self.flat(np.reshape([self._cusp(x, side) for x in near], (-1, 3)))
        flat, pieces = self.flat(points), []
        for n, (a, b) in enumerate(pairwise([0, *(change + 1), len(flat)])):
            ends = [cusps[n - 1 : n] if n else flat[:0], flat[a:b], cusps[n : n + 1]]
            pieces.append((np.vstack(ends), bool(seen[(a + b - 1) // 2] > 0)))
        return FoldCurve(side, tuple(pieces), cusps)

    def _onto(self, points: Array, side: Side) -> Array:
        """Move points (m, 3) onto the fold, across it: Newton's method on h = L_i = 0."""
        k = side_index(side)

        def equations(x: Array, _: NDArray[np.int64]) -> tuple[Array, Array]:
            numbers = self.where.many(x)
            return numbers.values[:, [0, 1 + k]], numbers.gradients[:, [0, 1 + k]]

        found, converged = solve_many(equations, points, tol=1e-9)
        return np.where(converged[:, None], found, np.nan)

    def _cusp(self, near: Array, side: Side) -> Array:
        """Solve h = L_i = L_ii = 0; the start itself if that leads away (a degenerate cusp)."""
        evaluate, p = self._tangency(side), self.where.parameters

        def equations(x: Array) -> tuple[Array, Array]:
            values = evaluate.copied(x, p)
            return np.ravel(values[:3]), np.vstack(values[3:])

        what = f"cusp of {FIELDS[side]}"
        try:
            found = search(equations, near, tol=1e-12, max_iterations=20, what=what).x
        except NonsmoothError:
            return near
        away = np.linalg.norm(self.flat(found - near) / self.box.size)
        return found if away < 2 / _GRID else near

    # points ------------------------------------------------------------------------------------

    def _starts(self, first: Array, second: Array, keep: NDArray[np.bool_] | None = None) -> Array:
        """Points of the surface over the grid cells where two functions change sign."""
        grids = [self._on_grid(first), self._on_grid(second)]
        return self.lift(middle_of_sign_changes(self.mesh, grids, keep))[:_MOST]

    def _inside(self, found: list[Any]) -> list[Any]:
        return [f for f in found if self.box.contains(self.flat(f.point))]

    @cached_property
    def two_folds(self) -> list[TwoFold]:
        """Generic two-folds in the box; none where nothing slides."""
        if not self.where.switching.slides:
            return []
        where, lie = self.where, self._numbers.lie

        def look(x: Array) -> TwoFold:
            return find_two_fold(where.system, x, parameters=where.values)

        return self._inside(find_all(look, self._starts(lie[:, 0], lie[:, 1])))

    @cached_property
    def pseudo_equilibria(self) -> list[PseudoEquilibrium]:
        """Real pseudo-equilibria in the box."""
        where, sliding = self.where, self._on_grid(self._numbers.slides)
        inner = sliding[:-1, :-1] & sliding[1:, :-1] & sliding[:-1, 1:] & sliding[1:, 1:]
        along = self.flat(self._numbers.numerator)

        def look(x: Array) -> PseudoEquilibrium:
            return find_pseudo_equilibrium(where.system, x, parameters=where.values)

        found = find_all(look, self._starts(along[:, 0], along[:, 1], inner))
        return [f for f in self._inside(found) if f.status == "real"]
