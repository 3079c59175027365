"""A rectangle of a plane, grids over it, and zero lines of functions on a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, OptionError

_ROUNDING = 1e-9


@dataclass(frozen=True)
class Box:
    """x0 <= x <= x1, y0 <= y <= y1."""

    x0: float
    x1: float
    y0: float
    y1: float

    @classmethod
    def read(cls, box: object) -> Box:
        """Read (xmin, xmax, ymin, ymax), or two pairs."""
        try:
            values = np.asarray(box, dtype=float).ravel()
        except (TypeError, ValueError):
            values = np.empty(0)
        finite = values.shape == (4,) and bool(np.all(np.isfinite(values)))
        if not finite or not (values[0] < values[1] and values[2] < values[3]):
            raise OptionError(
                "box: expected (xmin, xmax, ymin, ymax) with xmin < xmax and ymin < ymax, "
                f"received {box!r}. For example (-1, 1, -2, 2)."
            )
        return cls(*map(float, values))

    @property
    def limits(self) -> tuple[float, float, float, float]:
        """(x0, x1, y0, y1)."""
        return self.x0, self.x1, self.y0, self.y1

    @property
    def corner(self) -> Array:
        """(x0, y0)."""
        return np.array([self.x0, self.y0])

    @property
    def size(self) -> Array:
        """Width and height."""
        return np.array([self.x1 - self.x0, self.y1 - self.y0])

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points (..., 2) are inside or, to rounding, on the frame."""
        share = (np.asarray(points, dtype=float) - self.corner) / self.size
        return np.all((share >= -_ROUNDING) & (share <= 1 + _ROUNDING), axis=-1)

    def lines(self, count: int) -> tuple[Array, Array]:
        """Return the grid lines of both coordinates, ``count`` each."""
        return np.linspace(self.x0, self.x1, count), np.linspace(self.y0, self.y1, count)

    def grid(self, count: int) -> Array:
        """Return the points of that grid, row by row from below; (count**2, 2)."""
        return np.column_stack([m.ravel() for m in np.meshgrid(*self.lines(count))])

    def middles(self, count: int) -> Array:
        """Return the middles of count x count equal cells; (count**2, 2)."""
        shares = (np.arange(count) + 0.5) / count
        both = np.column_stack([m.ravel() for m in np.meshgrid(shares, shares, indexing="ij")])
        return self.corner + both * self.size

    def length(self, curve: Array) -> float:
        """Length of a polyline (m, 2) in units of the box."""
        return float(self.lengths(curve)[-1]) if len(curve) else 0.0

    def lengths(self, curve: Array) -> Array:
        """Lengths (m,) of a polyline (m, 2) to each of its points, in units of the box."""
        steps = np.linalg.norm(np.diff(curve, axis=0) / self.size, axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])


# zero lines and sign changes -------------------------------------------------------------------


def zero_lines(lines: tuple[Array, Array], values: Array) -> list[Array]:
    """Polylines (m, 2) on which a function of grid points vanishes; NaN counts as undefined."""
    if not (np.any(values > 0) and np.any(values < 0)):
        return []
    from contourpy import contour_generator  # of matplotlib, on which it does not depend

    found = contour_generator(*lines, np.ma.masked_invalid(values)).lines(0.0)
    return [np.asarray(line) for line in found if len(line) > 1]


def refined(curve: Array, scale: Array, step: float) -> Array:
    """Insert points so that neighbours on a polyline are at most ``step`` of the scale apart."""
    length = np.linalg.norm(np.diff(curve, axis=0) / scale, axis=1)
    parts = [
        np.linspace(a, b, max(int(np.ceil(n / step)), 1), endpoint=False)
        for a, b, n in zip(curve[:-1], curve[1:], length, strict=True)
    ]
    return np.vstack([*parts, curve[-1:]])


def inserted(curve: Array, points: Array) -> Array:
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


def sign_changes(values: Array) -> NDArray[np.int64]:
    """Indices k of values (m,) that change sign from k to k + 1; an exact zero is found once."""
    positive = values >= 0  # a zero at a vertex counts as positive
    good = np.isfinite(values)
    return np.flatnonzero((positive[:-1] != positive[1:]) & good[:-1] & good[1:])


def middle_of_sign_changes(
    lines: tuple[Array, Array], functions: Sequence[Array], keep: NDArray[np.bool_] | None = None
) -> Array:
    """Middles (k, 2) of the grid cells in which all functions (rows, columns) change sign."""
    # ``keep`` excludes cells; a cell with an undefined corner has no sign change.
    u, v = lines
    found = np.ones((len(v) - 1, len(u) - 1), dtype=bool) if keep is None else keep
    for f in functions:
        corners = np.stack([f[:-1, :-1], f[1:, :-1], f[:-1, 1:], f[1:, 1:]])
        with np.errstate(invalid="ignore"):
            found = found & (corners.min(axis=0) <= 0) & (corners.max(axis=0) >= 0)
    i, j = np.nonzero(found)
    return np.column_stack([(u[j] + u[j + 1]) / 2, (v[i] + v[i + 1]) / 2])
