"""Where a family of periodic orbits shrinks to an equilibrium: the Hopf point, from an orbit close to it.

The equations of an orbit are singular there, as the equilibrium solves them with any duration; those of
an equilibrium with two eigenvalues on the imaginary axis are not.
"""

from __future__ import annotations

import numpy as np

from ..local.newton import Secant, converge
from ..model import Array, FilippovSystem, NonsmoothError
from ..model.variational import variational_field

#: The equilibrium is looked for within so many sizes of the small orbit, or of the step to it.
_NEAR = 0.1


def hopf_point(
    system: FilippovSystem, mode: str, x: Array, p: Array, index: int
) -> tuple[Array, float, float] | None:
    """The Hopf point near a small orbit of one mode.

    Parameters
    ----------
    system : FilippovSystem
    mode : str
    x : ndarray (n,)
        Inside the orbit.
    p : ndarray
        All parameters.
    index : int
        Of the one that varies.

    Returns
    -------
    point : ndarray (n,)
    value : float
        Of the parameter.
    frequency : float
    """
    field, n = variational_field(system, mode).linear, system.dimension
    size = np.append(np.full(n, max(1.0, float(np.abs(x).max()))), max(abs(float(p[index])), 1e-3))

    def parameters(u: Array) -> Array:
        q = p.copy()
        q[index] = u[-1]
        return q

    def pair(u: Array) -> complex:
        """The complex eigenvalue next to the imaginary axis."""
        values = np.linalg.eigvals(np.asarray(field.copied(u[:n], parameters(u))[1], float)[:n, :n])
        turning = values[values.imag > 0.0]
        return (
            complex(turning[np.argmin(np.abs(turning.real))]) if turning.size else complex(np.nan)
        )

    def equations(v: Array) -> Array:
        u = v * size
        rate = np.asarray(field.copied(u[:n], parameters(u))[0], float).ravel()[:n]
        return np.append(rate, pair(u).real)

    start = np.append(x, p[index])
    try:
        root = converge(Secant(equations, 1.0), start / size)
    except (NonsmoothError, np.linalg.LinAlgError):
        return None
    if root is None or not np.abs(root - start / size).max() < _NEAR:
        return None
    u = root * size
    return u[:n], float(u[-1]), pair(u).imag
