"""What a phase portrait of a planar system shows: its surface in pieces, folds and equilibria.

Everything on the surface is found by sign changes along its polyline and polished by bisection on
the surface itself, so two features closer than the grid (1/160 of the box) can be missed: a picture
is no proof. Names follow Kuznetsov, Rinaldi & Gragnani 2003.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from contourpy import contour_generator

from ..model import Array, FilippovSystem

GRID = 161


@dataclass(frozen=True)
class Values:
    """Numbers at m points: h (m,), its gradient and the fields (m, 2), Lie derivatives (m,)."""

    h: Array
    gradient: Array
    above: Array
    below: Array
    l1: Array
    l2: Array
    l11: Array
    l22: Array

    @property
    def cross(self) -> Array:
        """F1 x F2, zero at pseudo-equilibria."""
        return self.above[:, 0] * self.below[:, 1] - self.above[:, 1] * self.below[:, 0]

    @property
    def sliding(self) -> Array:
        """Sliding field (m, 2), meaningful where L1 L2 < 0."""
        weights = np.array([self.l2, -self.l1])
        with np.errstate(divide="ignore", invalid="ignore"):
            weights = weights / (self.l2 - self.l1)
        return weights[0][:, None] * self.above + weights[1][:, None] * self.below


@dataclass(frozen=True)
class Piece:
    """A stretch of the surface of one kind: "attracting", "repelling" or "crossing"."""

    kind: str
    points: Array


@dataclass(frozen=True)
class Mark:
    """A special point.

    Attributes
    ----------
    kind : str
        "visible fold", "invisible fold", "pseudo-node", "pseudo-saddle", "node", "focus",
        "saddle", "centre".
    point : ndarray (2,)
    side : {1, -1, 0}
        Of the field it belongs to; 0 for pseudo-equilibria.
    stable : bool or None
    directions : ndarray (k, 2)
        Of a saddle: the stable eigenvector, then the unstable one.
    """

    kind: str
    point: Array
    side: int
    stable: bool | None = None
    directions: Array | None = None


class Plane:
    """A planar system in a box, evaluated at many points at once.

    Parameters
    ----------
    system : FilippovSystem
        Two states, one surface.
    parameters : ndarray
    box : (float, float, float, float)
        xmin, xmax, ymin, ymax.
    """

    def __init__(
        self, system: FilippovSystem, parameters: Array, box: tuple[float, float, float, float]
    ):
        self.system, self.parameters, self.box = system, parameters, box
        self.scale = np.array([box[1] - box[0], box[3] - box[2]])
        self._function = system.function(("plot plane",), self._expressions)
        self._jacobians = {
            side: system.function(("plot jacobian", side), self._jacobian_rows(side))
            for side in (1, -1)
        }

    def _expressions(self) -> Sequence[Any]:
        system = self.system
        h = system.surface_function(0)
        lie = [system.lie_derivative(fields) for fields in ("+", "-", "++", "--")]
        return [h, system.gradient(h).T, system.field("+"), system.field("-"), *lie]

    def _jacobian_rows(self, side: int) -> Callable[[], Sequence[Any]]:
        field = self.system.field("+" if side > 0 else "-")
        return lambda: [field, self.system.gradient(field[0]), self.system.gradient(field[1])]

    def at(self, points: Array) -> Values:
        """Evaluate at points (m, 2)."""
        points = np.atleast_2d(points)
        outputs = self._function.call([points.T, self.parameters])
        h, gradient, above, below, *lie = (np.array(v, dtype=float) for v in outputs)
        return Values(h[0], gradient.T, above.T, below.T, *(v[0] for v in lie))

    def project(self, points: Array) -> Array:
        """Move points onto the surface along its gradient (three Newton steps)."""
        for _ in range(3):
            values = self.at(points)
            square = np.sum(values.gradient**2, axis=1)
            step = np.divide(values.h, square, out=np.zeros_like(square), where=square > 0)
            points = points - step[:, None] * values.gradient
        return points

    def inside(self, point: Array) -> bool:
        """Whether a point is in the box."""
        x0, x1, y0, y1 = self.box
        return bool(x0 <= point[0] <= x1 and y0 <= point[1] <= y1)

    # the surface -------------------------------------------------------------------------------

    def curves(self) -> list[Array]:
        """Polylines of the surface."""
        x, y = np.linspace(*self.box[:2], GRID), np.linspace(*self.box[2:], GRID)
        mesh = np.column_stack([v.ravel() for v in np.meshgrid(x, y)])
        h = self.at(mesh).h.reshape(GRID, GRID)
        if not np.nanmin(h) < 0 < np.nanmax(h):
            return []
        lines = contour_generator(x, y, np.ma.masked_invalid(h)).lines(0.0)
        return [self.project(_refined(np.asarray(line), self.scale)) for line in lines]

    def zeros(self, curve: Array, what: Callable[[Values], Array]) -> Array:
        """Zeros (k, 2) of a function along a polyline of the surface, by bisection."""
        values = what(self.at(curve))
        positive = values >= 0  # an exact zero at a vertex counts as positive: found once
        good = np.isfinite(values)
        k = np.flatnonzero((positive[:-1] != positive[1:]) & good[:-1] & good[1:])
        if not k.size:
            return np.empty((0, 2))
        low, high = curve[k], curve[k + 1]
        for _ in range(50):
            middle = self.project((low + high) / 2)
            same = (what(self.at(middle)) >= 0) == positive[k]
            low = np.where(same[:, None], middle, low)
            high = np.where(same[:, None], high, middle)
        return (low + high) / 2

    def pieces(self, curve: Array) -> list[Piece]:
        """Cut a polyline of the surface at its folds and name the pieces."""
        folds = np.vstack([self.zeros(curve, lambda v: v.l1), self.zeros(curve, lambda v: v.l2)])
        full = _insert(curve, folds)
        values = self.at((full[1:] + full[:-1]) / 2)
        kinds = np.where(
            values.l1 * values.l2 >= 0,
            "crossing",
            np.where(values.l1 < 0, "attracting", "repelling"),
        )
        cuts = [0, *(np.flatnonzero(kinds[1:] != kinds[:-1]) + 1), len(kinds)]
        return [Piece(str(kinds[a]), full[a : b + 1]) for a, b in pairwise(cuts)]

    # special points ----------------------------------------------------------------------------

    def folds(self, curve: Array) -> list[Mark]:
        """Folds of both fields along a polyline of the surface."""
        found = []
        for point in self.zeros(curve, lambda v: v.l1):
            visible = self.at(point).l11[0] > 0
            found.append(Mark("visible fold" if visible else "invisible fold", point, 1))
        for point in self.zeros(curve, lambda v: v.l2):
            visible = self.at(point).l22[0] < 0
            found.append(Mark("visible fold" if visible else "invisible fold", point, -1))
        return found

    def pseudo_equilibria(self, curve: Array) -> list[Mark]:
        """Pseudo-equilibria along a polyline of the surface."""
        found = []
        for point in self.zeros(curve, lambda v: v.cross):
            here = self.at(point)
            if not here.l1[0] * here.l2[0] < 0:
                continue
            tangent = np.array([-here.gradient[0, 1], here.gradient[0, 0]])
            tangent /= np.linalg.norm(tangent / self.scale)
            near = self.project(point + 1e-4 * np.array([[-1.0], [1.0]]) * tangent)
            speeds = self.at(near).sliding @ tangent
            falling, attracting = bool(speeds[1] < speeds[0]), bool(here.l1[0] < 0)
            kind = "pseudo-node" if falling == attracting else "pseudo-saddle"
            stable = attracting if kind == "pseudo-node" else None
            found.append(Mark(kind, point, 0, stable, tangent[None, :]))
        return found

    def equilibria(self) -> list[Mark]:
        """Equilibria of each field on its own side."""
        return [mark for side in (1, -1) for mark in self._equilibria(side)]

    def _equilibria(self, side: int) -> list[Mark]:
        x, y = np.linspace(*self.box[:2], 61), np.linspace(*self.box[2:], 61)
        mesh = np.column_stack([v.ravel() for v in np.meshgrid(x, y)])
        values = self.at(mesh)
        field = (values.above if side > 0 else values.below).reshape(61, 61, 2)
        corners = np.stack([field[:-1, :-1], field[1:, :-1], field[:-1, 1:], field[1:, 1:]])
        with np.errstate(invalid="ignore"):
            changes = np.all((corners.min(axis=0) <= 0) & (corners.max(axis=0) >= 0), axis=-1)
        found: list[Mark] = []
        for j, i in np.argwhere(changes):
            start = np.array([x[i] + x[i + 1], y[j] + y[j + 1]]) / 2
            point, jacobian = self._newton(start, side)
            if point is None or not self.inside(point) or side * self.at(point).h[0] <= 0:
                continue
            if all(np.linalg.norm((m.point - point) / self.scale) > 1e-6 for m in found):
                found.append(_equilibrium(point, jacobian, side))
        return found

    def _newton(self, point: Array, side: int) -> tuple[Array | None, Array]:
        for _ in range(30):
            outputs = self._jacobians[side].call([point, self.parameters])
            field, *rows = (np.array(v, dtype=float) for v in outputs)
            jacobian = np.vstack(rows)
            if not np.all(np.isfinite(jacobian)) or not np.all(np.isfinite(field)):
                return None, jacobian
            step = np.linalg.lstsq(jacobian, field.ravel(), rcond=None)[0]
            point = point - step
            if np.linalg.norm(step / self.scale) < 1e-13:
                return point, jacobian
        return None, jacobian


def _equilibrium(point: Array, jacobian: Array, side: int) -> Mark:
    values, vectors = np.linalg.eig(jacobian)
    real = np.real(values)
    if np.any(np.abs(np.imag(values)) > 1e-9 * np.abs(values).max()):
        size = float(np.abs(values).max())
        if abs(real[0]) < 1e-9 * size:
            return Mark("centre", point, side)
        return Mark("focus", point, side, bool(real[0] < 0))
    if real[0] * real[1] < 0:
        order = np.argsort(real)
        return Mark("saddle", point, side, None, np.real(vectors).T[order])
    return Mark("node", point, side, bool(real.max() < 0))


def _refined(curve: Array, scale: Array) -> Array:
    """Insert points where vertices of a contour are far apart (straight surfaces)."""
    length = np.linalg.norm(np.diff(curve, axis=0) / scale, axis=1)
    parts = [
        np.linspace(a, b, max(int(np.ceil(n * GRID)), 1), endpoint=False)
        for a, b, n in zip(curve[:-1], curve[1:], length, strict=True)
    ]
    return np.vstack([*parts, curve[-1:]])


def _insert(curve: Array, points: Array) -> Array:
    """Insert points that lie on a polyline between its vertices."""
    for point in points:
        a, b = curve[:-1], curve[1:]
        detour = (
            np.linalg.norm(point - a, axis=1)
            + np.linalg.norm(point - b, axis=1)
            - np.linalg.norm(b - a, axis=1)
        )
        curve = np.insert(curve, int(np.argmin(detour)) + 1, point, axis=0)
    return curve
