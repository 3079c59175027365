"""Orbits of the normal form off the surface: parabolas, exact.

The fields (-z2, -sigma1, nu1) for z1 > 0 and (z3, nu2, sigma2) for z1 < 0 are linear in time, so
z1 is quadratic in it and no step is taken.
"""

from __future__ import annotations

import numpy as np

from ...model import Array
from ..point.sides import Side
from .reduced_flow import ReducedFlow

_POINTS = 61


def arc(flow: ReducedFlow, side: Side, centre: float, half: float, height: float = 0.0) -> Array:
    """Return an orbit off the surface, symmetric in time about its passage over a fold.

    Parameters
    ----------
    flow : ReducedFlow
    side : {"+", "-"}
        Above (F1, over z2 = 0) or below (F2, under z3 = 0).
    centre : float
        The other coordinate, z3 above and z2 below, at that passage.
    half : float
        Half of its duration in normal-form time.
    height : float, optional
        z1 at that passage: 0 for the tangent orbit of a visible fold, ``half**2/2`` (negative
        below) for a flight over an invisible one.

    Returns
    -------
    ndarray (61, 3)
        (z1, z2, z3) in the direction of time.

    Examples
    --------
    >>> arc(ReducedFlow((-1, 1), (0.5, 0.0)), "+", 0.0, 1.0, 0.5)[[0, 30, 60]]
    array([[ 0. , -1. , -0.5],
           [ 0.5,  0. ,  0. ],
           [ 0. ,  1. ,  0.5]])
    """
    (s1, s2), (n1, n2) = flow.sigma, flow.nu
    t = np.linspace(-half, half, _POINTS)
    if side == "+":
        return np.column_stack([height + s1 * t**2 / 2, -s1 * t, centre + n1 * t])
    return np.column_stack([height + s2 * t**2 / 2, centre + n2 * t, s2 * t])


def flight(flow: ReducedFlow, z: Array, side: Side) -> Array:
    """Return the flight (61, 3) from (z2, z3) in a crossing region over (under) an invisible fold.

    Examples
    --------
    >>> flight(ReducedFlow((-1, 1), (-1.0, -2.0)), np.array([-1.0, 3.0]), "+")[[0, -1]]
    array([[ 0., -1.,  3.],
           [ 0.,  1.,  1.]])
    """
    if side == "+":
        return arc(flow, "+", z[1] - flow.nu[0] * z[0], -z[0], z[0] ** 2 / 2)
    return arc(flow, "-", z[0] - flow.nu[1] * z[1], -z[1], -(z[1] ** 2) / 2)


def passage(flow: ReducedFlow, z: Array, side: Side, *, ahead: bool) -> Array:
    """Return the orbit (61, 3) of one field from or to (z2, z3), while it stays on its side.

    Parameters
    ----------
    flow : ReducedFlow
    z : ndarray (2,)
    side : {"+", "-"}
    ahead : bool
        Whether it begins at z or ends there.

    Examples
    --------
    >>> passage(ReducedFlow((1, -1), (1.0, 1.0)), np.array([1.0, 1.0]), "+", ahead=False)[-1]
    array([0., 1., 1.])
    """
    (s1, s2), (n1, n2) = flow.sigma, flow.nu
    if side == "+":
        speed, returns = abs(z[0]), s1 < 0
    else:
        speed, returns = abs(z[1]), s2 > 0
    last = 2 * speed if returns else 1.5
    t = np.linspace(0.0, last, _POINTS) if ahead else np.linspace(-last, 0.0, _POINTS)
    if side == "+":
        return np.column_stack([-z[0] * t + s1 * t**2 / 2, z[0] - s1 * t, z[1] + n1 * t])
    return np.column_stack([z[1] * t + s2 * t**2 / 2, z[0] + n2 * t, z[1] + s2 * t])
