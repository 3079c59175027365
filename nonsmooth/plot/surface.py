"""What a sliding portrait shows: a switching surface in three dimensions as a graph over two states.

Sliding orbits are followed in the flow of L2 F1 - L1 F2, whose orbits are the same and which is
smooth at two-folds, where the sliding field is 0/0; the sign of L2 - L1 gives the direction of time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from contourpy import contour_generator
from numpy.typing import ArrayLike, NDArray

from ..local import (
    PseudoEquilibrium,
    TwoFold,
    find_all,
    find_pseudo_equilibrium,
    find_two_fold,
)
from ..local.equilibria import jacobians, sliding_matrix
from ..local.lie import place
from ..model import Array, DefinitionError, FilippovSystem, explain

_GRID = 201
_STEP = 1 / 90  # of an orbit, in units of the box
_STEPS = 270
_APART, _SHORTEST = 0.022, 0.06  # orbits end this close to others; shorter ones are left out


@dataclass(frozen=True, eq=False)
class Fold:
    """A fold curve: pieces (m, 2) with their visibility, and the cusps (k, 2) between them."""

    side: int
    pieces: tuple[tuple[Array, bool], ...]
    cusps: Array


@dataclass(frozen=True, eq=False)
class Sheet:
    """The surface of a system over a box of two of its three states.

    Attributes
    ----------
    system : FilippovSystem
    parameters : mapping
    box : (float, float, float, float)
    shown : (int, int)
        Indices of the two coordinates.
    left_out : int
        Index of the third.
    guess : float
        Where the search for it starts.
    """

    system: FilippovSystem
    parameters: Mapping[str, float]
    box: tuple[float, float, float, float]
    shown: tuple[int, int]
    left_out: int
    guess: float

    @classmethod
    def of(
        cls,
        system: FilippovSystem,
        parameters: Mapping[str, float],
        box: tuple[float, float, float, float],
        coordinates: Sequence[str] | None,
        guess: float,
    ) -> Sheet:
        """Choose the coordinates unless they are given.

        Raises
        ------
        DefinitionError
            Not two different states, or no surface over the box.
        """
        names = list(system.state_names)
        if coordinates is None:
            pairs = [(1, 2), (0, 2), (0, 1)]
        else:
            chosen = [str(name) for name in coordinates]
            if len(chosen) != 2 or len(set(chosen)) != 2 or not set(chosen) <= set(names):
                raise DefinitionError(
                    explain(
                        "coordinates",
                        expected=f"two of the states {names}",
                        received=repr(coordinates),
                        advice="Leave it out to draw over the two along which the surface is flattest.",
                    )
                )
            pairs = [(names.index(chosen[0]), names.index(chosen[1]))]
        sheets = [cls(system, parameters, box, p, 3 - sum(p), guess) for p in pairs]
        best = max(sheets, key=lambda sheet: sheet._steepness())
        if not best._steepness() > 0:
            raise DefinitionError(
                explain(
                    "sliding_portrait",
                    expected="a surface over the box, h = 0 solvable for the remaining state",
                    received=f"none over {[names[i] for i in best.shown]} in {box}",
                    advice="Choose other coordinates=, another box or guess=.",
                )
            )
        return best

    def _steepness(self) -> float:
        """Share of the box over which the surface is found, times how steep it is there."""
        u, v = np.linspace(*self.box[:2], 9), np.linspace(*self.box[2:], 9)
        points = self.lift(np.column_stack([m.ravel() for m in np.meshgrid(u, v)]))
        gradient = self._first(points)[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.abs(gradient[:, self.left_out]) / np.linalg.norm(gradient, axis=1)
        return float(np.nan_to_num(share).mean())

    # numbers -----------------------------------------------------------------------------------

    @property
    def scale(self) -> Array:
        """Width and height of the box."""
        return np.array([self.box[1] - self.box[0], self.box[3] - self.box[2]])

    @property
    def mesh(self) -> tuple[Array, Array]:
        """Grid lines of the two coordinates."""
        return np.linspace(*self.box[:2], _GRID), np.linspace(*self.box[2:], _GRID)

    def length(self, curve: Array) -> float:
        """Length of a polyline (m, 2) in units of the box."""
        return float(np.linalg.norm(np.diff(curve, axis=0) / self.scale, axis=1).sum())

    def _call(self, key: str, expressions: Any, points: Array) -> list[Array]:
        function = self.system.function(("sliding portrait", key), expressions)
        p = self.system.parameter_vector(self.parameters)
        outputs = function.call([points.T, p])
        return [np.array(v, dtype=float).T for v in outputs]

    def _first(self, points: Array) -> tuple[Array, Array]:
        """h (m,) and its gradient (m, 3)."""
        s = self.system
        h = s.surface_function(0)
        values, gradient = self._call("first", lambda: [h, s.gradient(h).T], points)
        return values[:, 0], gradient

    def _lie(self, points: Array) -> Array:
        """L1, L2, L11, L22 as columns (m, 4)."""
        lie = self.system.lie_derivative
        values = self._call("lie", lambda: [lie(f) for f in ("+", "-", "++", "--")], points)
        return np.hstack(values)

    def _numerator(self, points: Array) -> tuple[Array, Array]:
        """L2 F1 - L1 F2 (m, 3) and L1, L2 (m, 2)."""
        s = self.system

        def build() -> list[Any]:
            l1, l2 = s.lie_derivative("+"), s.lie_derivative("-")
            return [l2 * s.field("+") - l1 * s.field("-"), l1, l2]

        field, l1, l2 = self._call("numerator", build, points)
        return field, np.hstack([l1, l2])

    def lift(self, flat: Array, third: Array | None = None) -> Array:
        """Points (m, 3) of the surface over (m, 2); NaN where Newton's method finds none."""
        points = np.empty((len(flat), 3))
        points[:, list(self.shown)] = flat
        points[:, self.left_out] = self.guess if third is None else third
        step = np.full(len(flat), np.inf)
        for _ in range(40):
            h, gradient = self._first(points)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = h / gradient[:, self.left_out]
            points[:, self.left_out] -= step
            small = np.abs(step) <= 1e-13 * (1 + np.abs(points[:, self.left_out]))
            if np.all(small | ~np.isfinite(step)):
                break
        points[~(np.abs(step) <= 1e-9 * (1 + np.abs(points[:, self.left_out])))] = np.nan
        return points

    @cached_property
    def _grid(self) -> tuple[Array, Array]:
        """L1, L2, L11, L22 (4, g, g) and L2 F1 - L1 F2 along the two coordinates (2, g, g)."""
        u, v = self.mesh
        points = self.lift(np.column_stack([m.ravel() for m in np.meshgrid(u, v)]))
        lie = self._lie(points).T.reshape(4, _GRID, _GRID)
        field = self._numerator(points)[0][:, list(self.shown)]
        return lie, field.T.reshape(2, _GRID, _GRID)

    def regions(self) -> NDArray[np.int64]:
        """Per grid point 0 attracting, 1 repelling, 2 crossing up, 3 crossing down, -1 no surface."""
        l1, l2 = self._grid[0][:2]
        kinds = np.where(l1 <= 0, np.where(l2 > 0, 0, 3), np.where(l2 > 0, 2, 1))
        return np.where(np.isfinite(l1), kinds, -1)

    # folds -------------------------------------------------------------------------------------

    def folds(self) -> list[Fold]:
        """Fold curves of both fields."""
        u, v = self.mesh
        lie = np.ma.masked_invalid(self._grid[0])
        return [
            self._fold(np.asarray(line), 1 - 2 * k)
            for k in (0, 1)
            if np.any(lie[k] > 0) and np.any(lie[k] < 0)
            for line in contour_generator(u, v, lie[k]).lines(0.0)
            if len(line) > 1
        ]

    def _fold(self, line: Array, side: int) -> Fold:
        """Polish a contour line of L_i and cut it at its cusps."""
        flat = self._onto(self._refined(line), side)
        flat = flat[np.all(np.isfinite(flat), axis=1)]
        seen = side * self._lie(self.lift(flat))[:, 2 if side > 0 else 3]
        change = np.flatnonzero((seen[1:] > 0) != (seen[:-1] > 0))
        share = (seen[change] / (seen[change] - seen[change + 1]))[:, None]
        cusps = self._onto((1 - share) * flat[change] + share * flat[change + 1], side)
        pieces = []
        for n, (a, b) in enumerate(pairwise([0, *(change + 1), len(flat)])):
            ends = [cusps[n - 1 : n] if n else flat[:0], flat[a:b], cusps[n : n + 1]]
            pieces.append((np.vstack(ends), bool(seen[(a + b - 1) // 2] > 0)))
        return Fold(side, tuple(pieces), cusps)

    def _refined(self, line: Array) -> Array:
        """Insert points where vertices of a contour are far apart."""
        gaps = np.linalg.norm(np.diff(line, axis=0) / self.scale, axis=1)
        parts = [
            np.linspace(a, b, max(int(np.ceil(n * _GRID)), 1), endpoint=False)
            for a, b, n in zip(line[:-1], line[1:], gaps, strict=True)
        ]
        return np.vstack([*parts, line[-1:]])

    def _onto(self, flat: Array, side: int) -> Array:
        """Move points (m, 2) onto the fold, across it: Newton's method on h = L_i = 0."""
        if not len(flat):
            return flat
        s, points = self.system, self.lift(flat)
        h, lie = s.surface_function(0), s.lie_derivative("+" if side > 0 else "-")
        key = f"fold {side}"
        for _ in range(4):
            values, rates, *rows = self._call(
                key, lambda: [h, lie, s.gradient(h).T, s.gradient(lie).T], points
            )
            jacobian = np.stack(rows, axis=1)
            good = np.isfinite(jacobian).all((1, 2))
            residual = np.concatenate([values, rates], axis=1)[good, :, None]
            points[good] -= (np.linalg.pinv(jacobian[good]) @ residual)[..., 0]
        return points[:, list(self.shown)]

    # points ------------------------------------------------------------------------------------

    def _cells(self, first: Array, second: Array, keep: Array) -> Array:
        """Middles on the surface (k, 3) of the grid cells where two functions change sign."""
        u, v = self.mesh
        found = keep
        for values in (first, second):
            corners = np.stack([values[:-1, :-1], values[1:, :-1], values[:-1, 1:], values[1:, 1:]])
            found = found & (corners.min(axis=0) <= 0) & (corners.max(axis=0) >= 0)
        i, j = np.nonzero(found)
        return self.lift(np.column_stack([(u[j] + u[j + 1]) / 2, (v[i] + v[i + 1]) / 2]))

    def _inside(self, flat: Array) -> NDArray[np.bool_]:
        """Whether points (..., 2) are in the box."""
        low, high = np.array(self.box[::2]), np.array(self.box[1::2])
        return np.all((low <= flat) & (flat <= high), axis=-1)

    def two_folds(self) -> list[TwoFold]:
        """Generic two-folds in the box."""
        l1, l2 = self._grid[0][:2]
        everywhere = np.ones((_GRID - 1, _GRID - 1), dtype=bool)
        starts = self._cells(l1, l2, everywhere)
        found = find_all(
            lambda x: find_two_fold(self.system, x, parameters=self.parameters), starts[:50]
        )
        return [f for f in found if self._inside(f.point[list(self.shown)])]

    def reach(self, fold: TwoFold) -> float:
        """Length of (z2, z3) that is about a unit of the box at a two-fold."""
        step = np.eye(2) * 1e-6
        flat = (fold.point_at(step) - fold.point)[:, list(self.shown)] / self.scale
        return 1e-6 / float(np.linalg.norm(flat, 2) or 1.0)

    def pseudo_equilibria(self) -> list[PseudoEquilibrium]:
        """Real pseudo-equilibria in the box."""
        lie, field = self._grid
        sliding = lie[0] * lie[1] < 0
        inner = sliding[:-1, :-1] & sliding[1:, :-1] & sliding[:-1, 1:] & sliding[1:, 1:]
        starts = self._cells(field[0], field[1], inner)
        found = find_all(
            lambda x: find_pseudo_equilibrium(self.system, x, parameters=self.parameters),
            starts[:50],
        )
        real = [f for f in found if f.status == "real"]
        return [f for f in real if self._inside(f.point[list(self.shown)])]

    def manifolds(self, found: PseudoEquilibrium) -> list[tuple[Array, int]]:
        """Starts (3,) on the manifolds of a pseudo-saddle's sliding flow, and the way to go."""
        where, x = place(self.system, found.point, self.parameters)
        matrix, basis = sliding_matrix(where.at(x), jacobians(where, x))
        values, vectors = np.linalg.eig(matrix)
        if np.any(np.imag(values)) or not values[0] * values[1] < 0:
            return []  # a saddle across the surface only
        starts = []
        for value, vector in zip(np.real(values), np.real(vectors).T, strict=True):
            along = (basis @ vector)[list(self.shown)]
            flat = found.point[list(self.shown)]
            offset = 2e-3 * along / np.linalg.norm(along / self.scale)
            for sign in (1, -1):
                third = found.point[self.left_out : self.left_out + 1]
                start = self.lift((flat + sign * offset)[None, :], third)[0]
                starts.append((start, 1 if value > 0 else -1))
        return starts

    # orbits ------------------------------------------------------------------------------------

    def sliding(self, starts: Array, ahead: ArrayLike) -> list[Array]:
        """Sliding orbits (m, 2) from points (k, 3) to the fold or the frame.

        Runge-Kutta steps of constant length (Kutta 1901), put back onto the surface after each.

        Parameters
        ----------
        starts : ndarray (k, 3)
        ahead : array_like (k,)
            1 forward in time, -1 backward.
        """
        points, shown = starts.copy(), list(self.shown)
        field, lie = self._numerator(points)
        sign = (np.asarray(ahead) * np.sign(lie[:, 1] - lie[:, 0]))[:, None]
        last, size = self._direction(field, sign), np.linalg.norm(field, axis=1)
        going = (lie[:, 0] * lie[:, 1] < 0) & np.all(np.isfinite(points), axis=1)
        path = np.full((_STEPS + 1, len(points), 2), np.nan)
        path[0] = points[:, shown]
        for n in range(1, _STEPS + 1):
            k = np.flatnonzero(going)
            if not k.size:
                break
            moved = self._put_back(points[k] + self._runge_kutta(points[k], sign[k]))
            field, new = self._numerator(moved)
            now = self._direction(field, sign[k])
            # past an equilibrium or a two-fold the direction turns round
            good = np.all(np.isfinite(moved), axis=1) & (np.sum(now * last[k], axis=1) >= 0)
            good &= np.linalg.norm(np.nan_to_num(field), axis=1) > 1e-12 * size[k]
            inside = new[:, 0] * new[:, 1] < 0
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.where(new * lie[k] < 0, lie[k] / (lie[k] - new), 1.0).min(axis=1)
            ends = points[k] + share[:, None] * (moved - points[k])  # the fold, or the whole step
            path[n, k[good]] = ends[good][:, shown]
            points[k], lie[k], last[k] = moved, new, now
            going[k] = good & inside & self._inside(ends[:, shown])
        counts = np.sum(np.isfinite(path[:, :, 0]), axis=0)
        return [path[:count, k] for k, count in enumerate(counts)]

    def _direction(self, field: Array, sign: Array) -> Array:
        """Unit vector, in units of the box, along the sliding flow (m, 3)."""
        norm = np.linalg.norm(field[:, list(self.shown)] / self.scale, axis=1, keepdims=True)
        return sign * np.divide(field, norm, out=np.zeros_like(field), where=norm > 0)

    def _runge_kutta(self, points: Array, sign: Array) -> Array:
        def slope(x: Array) -> Array:
            return _STEP * self._direction(self._numerator(x)[0], sign)

        k1 = slope(points)
        k2 = slope(points + k1 / 2)
        k3 = slope(points + k2 / 2)
        k4 = slope(points + k3)
        return (k1 + 2 * k2 + 2 * k3 + k4) / 6

    def _put_back(self, points: Array) -> Array:
        h, gradient = self._first(points)
        points = points.copy()
        with np.errstate(divide="ignore", invalid="ignore"):
            points[:, self.left_out] -= h / gradient[:, self.left_out]
        return points

    def orbits(self, count: int) -> list[tuple[Array, bool]]:
        """About evenly spaced sliding orbits (m, 2) in the direction of time, and if attracting."""
        shares = (np.arange(count) + 0.5) / count
        flat = np.column_stack([m.ravel() for m in np.meshgrid(shares, shares)])
        flat = np.random.default_rng(0).permutation(flat) * self.scale + np.array(self.box[::2])
        starts = self.lift(flat)
        lie = self._numerator(starts)[1]
        starts = starts[lie[:, 0] * lie[:, 1] < 0]
        if not len(starts):
            return []
        taken = np.empty((0, 2))
        chosen = []
        number = len(starts)
        curves = self.sliding(np.vstack([starts, starts]), np.repeat([1, -1], number))
        for start, later, before in zip(starts, curves[:number], curves[number:], strict=True):
            seed = start[list(self.shown)] / self.scale
            if len(taken) and np.min(np.linalg.norm(taken - seed, axis=1)) < 0.55 / count:
                continue
            parts = [_until(part / self.scale, taken) for part in (before, later)]
            whole = np.vstack([parts[0][:0:-1], parts[1]])
            if np.linalg.norm(np.diff(whole, axis=0), axis=1).sum() < _SHORTEST:
                continue
            taken = np.vstack([taken, whole])
            l1, l2 = self._numerator(start[None, :])[1][0]
            chosen.append((whole * self.scale, bool(l1 < l2)))
        return chosen


def _until(curve: Array, taken: Array) -> Array:
    """Part of a curve before it comes close to the points taken by others."""
    if not len(taken):
        return curve
    gaps = np.linalg.norm(curve[:, None, :] - taken[None, :, :], axis=2).min(axis=1)
    close = np.flatnonzero(gaps < _APART)
    return curve[: int(close[0]) + 1] if close.size else curve
