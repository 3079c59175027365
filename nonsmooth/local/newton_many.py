"""Newton's method of :mod:`nonsmooth.local.newton` for many starts at once, without damping.

Same equations, same least-norm steps, same accepted residual. What does not converge in a few full
steps is left to the damped search, or is not a point of the set.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..model import Array

#: Points (k, n) and which of all starts they belong to (k,) -> values (k, m), Jacobians (k, m, n).
ManyEquations = Callable[[Array, NDArray[np.int64]], tuple[Array, Array]]

_FAR = 1e8  # a longer step has left the problem


def solve_many(
    equations: ManyEquations, starts: Array, *, tol: float, iterations: int = 10
) -> tuple[Array, NDArray[np.bool_]]:
    """Find a root close to each start.

    Parameters
    ----------
    equations : callable
    starts : ndarray (k, n)
    tol : float
        Accepted residual, a distance relative to $1 + |x|$.
    iterations : int, optional

    Returns
    -------
    x : ndarray (k, n)
        The last iterates.
    converged : ndarray of bool (k,)

    Examples
    --------
    >>> circles = lambda x, k: ((x**2).sum(axis=1, keepdims=True) - 1, 2 * x[:, None, :])
    >>> solve_many(circles, np.array([[3.0, 4.0], [0.0, 0.0]]), tol=1e-12)
    (array([[0.6, 0.8], [0. , 0. ]]), array([ True, False]))
    """
    x = np.array(starts, dtype=float)
    residual = np.full(len(x), np.inf)
    index = np.arange(len(x))
    for _ in range(iterations):
        if not index.size:
            break
        values, jacobian = equations(x[index], index)
        lengths = np.linalg.norm(jacobian, axis=2)
        good = np.isfinite(values).all(1) & np.isfinite(lengths).all(1) & (lengths > 0).all(1)
        residual[index[~good]] = np.inf
        index, values, jacobian, lengths = index[good], values[good], jacobian[good], lengths[good]
        residual[index] = np.max(np.abs(values) / lengths, axis=1, initial=0.0)
        step = _least_norm(values / lengths, jacobian / lengths[..., None])
        x[index] -= step
        length = np.linalg.norm(step, axis=1)
        residual[index[length >= _FAR]] = np.inf
        small = length <= 2.0**-48 * (1 + np.linalg.norm(x[index], axis=1))
        index = index[~small & (length < _FAR)]
    return x, residual <= tol * (1 + np.linalg.norm(x, axis=1))


def _least_norm(values: Array, jacobian: Array) -> Array:
    """Shortest steps (k, n) that solve equations (k, m) with rows of length 1."""
    if values.shape[1] == 1:
        return values * jacobian[:, 0]
    return (np.linalg.pinv(jacobian) @ values[..., None])[..., 0]
