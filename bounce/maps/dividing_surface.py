"""The dividing surface: dividing curves at several normal speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.model import ContactModel
from .dividing import DividingCurve, dividing_curve

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class DividingSurface:
    """$H_F = 0$ in the space of landings (xdot, ydot, $omega$), as curves at several normal speeds.

    Attributes
    ----------
    curves : tuple of DividingCurve
        In the order of ``ydot``.
    """

    curves: tuple[DividingCurve, ...]

    @property
    def ydot(self) -> Array:
        """Normal speeds, (k,)."""
        return np.array([curve.ydot for curve in self.curves])

    @property
    def two_fold(self) -> list[Array]:
        """For each normal speed (n, 3) of (xdot, ydot, $omega$)."""
        return [_with_ydot(curve.two_fold, curve.ydot) for curve in self.curves]

    @property
    def slipping(self) -> list[Array]:
        """For each normal speed (n, 3) of (xdot, ydot, $omega$)."""
        return [_with_ydot(curve.slipping, curve.ydot) for curve in self.curves]

    @property
    def junction(self) -> Array:
        """Line where the parts meet, (k, 3); NaN where they do not."""
        rows = [np.full(2, np.nan) if c.junction is None else c.junction for c in self.curves]
        return np.column_stack([np.array(rows)[:, 0], self.ydot, np.array(rows)[:, 1]])

    def __repr__(self) -> str:
        return f"DividingSurface({len(self.curves)} curves, ydot = {self.ydot.tolist()})"


def dividing_surface(
    model: ContactModel,
    ydot: ArrayLike,
    *,
    reach: float = 3.0,
    step: float = 0.05,
    tol: float = 1e-12,
) -> DividingSurface:
    """Trace the dividing surface at several normal speeds.

    Without gravity a linear model's field is homogeneous of degree one and the surface is a cone.

    Parameters
    ----------
    model : ContactModel
        The surface, with its friction.
    ydot : array_like (k,)
        Normal speeds at touch-down, $< 0$.
    reach, step, tol : float, optional
        As in :func:`dividing_curve`.

    Returns
    -------
    DividingSurface
        The dividing curves, one for each normal speed.

    Raises
    ------
    LandingError, ModelError, nonsmooth.OptionError
        As :func:`dividing_curve`.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> surface = bounce.dividing_surface(turf, [-0.5, -1.0])
    >>> (surface.junction / surface.ydot[:, None]).round(9)
    array([[-0.444..., 1. , -1.59...],
           [-0.444..., 1. , -1.59...]])
    """
    speeds = np.atleast_1d(np.asarray(ydot, dtype=float))
    if speeds.ndim != 1 or speeds.size == 0:
        raise ns.OptionError(f"ydot: expected a list of speeds, received shape {speeds.shape}.")
    return DividingSurface(
        tuple(dividing_curve(model, v, reach=reach, step=step, tol=tol) for v in speeds.tolist())
    )


def _with_ydot(points: Array, ydot: float) -> Array:
    return np.column_stack([points[:, 0], np.full(len(points), ydot), points[:, 1]])
