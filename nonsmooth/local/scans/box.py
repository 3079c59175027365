"""A rectangle of a plane and grids over it."""

from __future__ import annotations

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
