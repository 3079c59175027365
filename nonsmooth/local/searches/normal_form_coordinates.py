"""Coordinates of the normal form as functions of the state, and the states that have given ones.

z1 = theta h, z2 = -phi theta L1, z3 = theta L2/phi (Jeffrey & Colombo 2009) are taken as they are,
not linearised: near a generic two-fold they are coordinates (for n = 3), or three functions with
independent gradients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, PointError, explain, real_array
from ...model.checks import positive
from ...solvers.newton import solve_many
from ..point.surface_point import Place
from .search import search


@dataclass(frozen=True, eq=False)
class Chart:
    """The coordinates (z1, z2, z3) near a two-fold.

    Attributes
    ----------
    where : Place
    point : ndarray (N,)
        The two-fold, time included where the system depends on it.
    scales : ndarray (3,)
        Of h, L1 and L2.
    """

    where: Place
    point: Array
    scales: Array

    @property
    def _dimension(self) -> int:
        return self.where.system.dimension

    def _extended(self, x: Array) -> Array:
        """Append the two-fold's time to states (k, n)."""
        tail = np.tile(self.point[self._dimension :], (len(x), 1))
        return np.hstack([x, tail])

    def __call__(self, x: ArrayLike) -> Array:
        """Return z (..., 3) at states (..., n)."""
        states, n = real_array(x, "states"), self._dimension
        if states.ndim == 0 or states.shape[-1] != n:
            raise PointError(
                explain(
                    "states",
                    expected=f"shape (..., {n}) for the states {self.where.system.state_names}",
                    received=f"shape {states.shape}",
                    advice="States are on the last axis.",
                )
            )
        if not np.all(np.isfinite(states)):
            raise PointError("states: expected finite numbers, received NaN or inf.")
        many = self.where.many(self._extended(states.reshape(-1, n)))
        return (many.values * self.scales).reshape(*states.shape[:-1], 3)

    def tangents(self) -> Array:
        """States per unit of z1, z2 and z3 at the two-fold: the derivative of ``inverse``; (n, 3)."""
        gradients = self.where.at(self.point).gradients[:, : self._dimension]
        return np.asarray(np.linalg.pinv(self.scales[:, None] * gradients), dtype=np.float64)

    def inverse(self, z: ArrayLike, tol: float, max_iterations: int) -> Array:
        """Return states (..., n) with coordinates (..., 2), (z2, z3) on the surface, or (..., 3).

        Raises
        ------
        PointError, ConvergenceError
        """
        target = np.asarray(z, dtype=float)
        if target.ndim == 0 or target.shape[-1] not in (2, 3) or not np.all(np.isfinite(target)):
            raise PointError(
                f"z: expected finite numbers of shape (..., 2) or (..., 3), received {z!r}."
            )
        if target.shape[-1] == 2:
            target = np.concatenate([np.zeros((*target.shape[:-1], 1)), target], axis=-1)
        wanted, n = target.reshape(-1, 3), self._dimension

        def equations(x: Array, which: NDArray[np.int64]) -> tuple[Array, Array]:
            many, scales = self.where.many(self._extended(x)), self.scales
            return many.values * scales - wanted[which], many.gradients[:, :, :n] * scales[:, None]

        starts = np.tile(self.point[:n], (len(wanted), 1))
        x, converged = solve_many(equations, starts, tol=positive(tol, "tol"))
        for k in np.flatnonzero(~converged):
            x[k] = self._one(wanted[k], tol, max_iterations)
        return x.reshape(*target.shape[:-1], n)

    def _one(self, wanted: Array, tol: float, max_iterations: int) -> Array:
        """Search with damping, where full steps went astray."""

        def equations(x: Array) -> tuple[Array, Array]:
            numbers = self.where.at(x)
            values = np.array([numbers.h, *numbers.lie]) * self.scales - wanted
            return values, numbers.gradients * self.scales[:, None]

        n, what = self._dimension, f"state at z = {wanted.tolist()}"
        found = search(
            equations, self.point, range(n), tol=tol, max_iterations=max_iterations, what=what
        )
        return found.x[:n]
