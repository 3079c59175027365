"""What is known at a point of a surface, or at many: h, the two fields, L1, L2 and their gradients.

Points have N coordinates: the states, then time if the system depends on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...model import Array


@dataclass(frozen=True, eq=False)
class Numbers:
    """Values at one point.

    Attributes
    ----------
    x : ndarray (N,)
    h : float
        The switching function.
    gradient : ndarray (N,)
        grad h.
    fields : ndarray (2, N)
        F1 (above) and F2 (below).
    lie : ndarray (2,)
        L1 and L2.
    lie_gradients : ndarray (2, N)
        grad L1 and grad L2.
    """

    x: Array
    h: float
    gradient: Array
    fields: Array
    lie: Array
    lie_gradients: Array

    @property
    def second(self) -> dict[str, float]:
        """Second Lie derivatives ``{"L11", "L12", "L21", "L22"}``."""
        values = self.fields @ self.lie_gradients.T
        return {f"L{i + 1}{j + 1}": float(values[i, j]) for i in (0, 1) for j in (0, 1)}

    @property
    def gradients(self) -> Array:
        """Rows grad h, grad L1, grad L2; (3, N)."""
        return np.vstack([self.gradient, self.lie_gradients])

    @property
    def tangents(self) -> Array:
        """Orthonormal basis of the surface's tangent space (N, N-1); in the plane (g_y, -g_x)."""
        g = self.gradient
        if g.size == 2:
            return np.array([[g[1]], [-g[0]]]) / np.linalg.norm(g)
        return np.linalg.svd(g[None, :])[2][1:].T

    @property
    def angles(self) -> Array:
        """Sines of the angles of F1 and F2 with the surface, 0 for a vanishing field; (2,)."""
        lengths = np.linalg.norm(self.gradient) * np.linalg.norm(self.fields, axis=1)
        return np.divide(self.lie, lengths, out=np.zeros(2), where=lengths > 0)

    @property
    def distance(self) -> float:
        """Distance to the surface to first order, |h|/|grad h|."""
        length = float(np.linalg.norm(self.gradient))
        if not length:
            return float("inf") if self.h else 0.0
        return abs(self.h) / length


@dataclass(frozen=True, eq=False)
class ManyNumbers:
    """Values at k points; NaN where a field is undefined.

    Attributes
    ----------
    x : ndarray (k, N)
    h : ndarray (k,)
    gradient : ndarray (k, N)
    fields : ndarray (k, 2, N)
    lie : ndarray (k, 2)
    lie_gradients : ndarray (k, 2, N)
        As in :class:`Numbers`.
    """

    x: Array
    h: Array
    gradient: Array
    fields: Array
    lie: Array
    lie_gradients: Array

    @property
    def values(self) -> Array:
        """Columns h, L1, L2; (k, 3)."""
        return np.column_stack([self.h, self.lie])

    @property
    def gradients(self) -> Array:
        """Rows grad h, grad L1, grad L2 of each point; (k, 3, N)."""
        return np.concatenate([self.gradient[:, None], self.lie_gradients], axis=1)

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Whether L1 L2 < 0, attracting or repelling; (k,)."""
        return self.lie[:, 0] * self.lie[:, 1] < 0

    @property
    def numerator(self) -> Array:
        """L2 F1 - L1 F2, along the sliding field times L2 - L1 and smooth at two-folds; (k, N)."""
        above, below = self.fields[:, 0], self.fields[:, 1]
        return self.lie[:, 1:] * above - self.lie[:, :1] * below

    @property
    def sliding(self) -> Array:
        """Sliding field, meaningful where L1 L2 < 0; (k, N)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.numerator / (self.lie[:, 1:] - self.lie[:, :1])
