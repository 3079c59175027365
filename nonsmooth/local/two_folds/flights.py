"""Flights at a two-fold: the crossing map of the normal form near an invisible fold.

Points are (z2, z3) on z1 = 0. An orbit that leaves upwards (z2 < 0) over an invisible fold of F1
comes back after the time 2|z2|; downwards (z3 < 0) under an invisible fold of F2 after 2|z3|
(normal-form times; times phi and 1/phi in real time). Jeffrey & Colombo 2009 for the
diabolo; the counts and the accumulation time were derived for this library.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...model import Array, OptionError, PointError, real, real_array
from ...model.checks import positive
from .reduced_flow import ReducedFlow

Nu = tuple[float, float]


def pair(values: Any, what: str) -> tuple[float, float]:
    """Return two finite numbers or raise OptionError."""
    try:
        items = list(values)
    except TypeError:
        items = []
    if isinstance(values, str) or len(items) != 2:
        raise OptionError(f"{what}: expected a pair of numbers, received {values!r}.")
    expected = "a pair of finite numbers"
    first, second = (real(v, what, expected=expected) for v in items)
    return first, second


def _points(z: ArrayLike) -> Array:
    points = real_array(z, "z")
    if points.ndim == 0 or points.shape[-1] != 2:
        raise PointError(
            f"z: expected shape (..., 2), the coordinates (z2, z3), received {points.shape}."
        )
    return points


def flight_above(z: ArrayLike, nu: Nu) -> Array:
    """Landing point of a flight in $z1 > 0$ over an invisible fold: $(-z2, z3 - 2 nu1 z2)$.

    Parameters
    ----------
    z : array_like (..., 2)
        $(z2, z3)$ with $z2 <= 0$.
    nu : (float, float)
        The two numbers $(nu1, nu2)$ of the two-fold.

    Returns
    -------
    ndarray (..., 2)
        Where the flights land.

    Examples
    --------
    >>> flight_above([-1.0, 3.0], (-1.0, -2.0))
    array([1., 1.])
    """
    z, (nu1, _) = _points(z), pair(nu, "nu")
    return np.stack([-z[..., 0], z[..., 1] - 2 * nu1 * z[..., 0]], axis=-1)


def flight_below(z: ArrayLike, nu: Nu) -> Array:
    """Landing point of a flight in $z1 < 0$ under an invisible fold: $(z2 - 2 nu2 z3, -z3)$.

    Parameters
    ----------
    z : array_like (..., 2)
        $(z2, z3)$ with $z3 <= 0$.
    nu : (float, float)
        The two numbers $(nu1, nu2)$ of the two-fold.

    Returns
    -------
    ndarray (..., 2)
        Where the flights land.

    Examples
    --------
    >>> flight_below([3.0, -1.0], (-2.0, -1.0))
    array([1., 1.])
    """
    z, (_, nu2) = _points(z), pair(nu, "nu")
    return np.stack([z[..., 0] - 2 * nu2 * z[..., 1], -z[..., 1]], axis=-1)


def return_matrix(nu: Nu) -> Array:
    """Matrix of one flight above followed by one below, of an invisible two-fold; (2, 2).

    Determinant 1, trace $4 nu1 nu2 - 2$.

    Parameters
    ----------
    nu : (float, float)
        The two numbers $(nu1, nu2)$ of the two-fold.

    Returns
    -------
    ndarray (2, 2)
        The linear map of two successive flights.

    Examples
    --------
    >>> return_matrix((-2.0, -1.0))
    array([[ 7.,  2.],
           [-4., -1.]])
    """
    n1, n2 = pair(nu, "nu")
    return np.array([[4 * n1 * n2 - 1, -2 * n2], [2 * n1, -1.0]])


def max_flights(sigma: tuple[int, int], nu: Nu) -> float:
    """Largest number of flights of an orbit from a crossing region before it slides or goes away.

    Both folds invisible: 1 if $nu1, nu2 >= 0$; 2 if one of them is negative; if both are,
    $ceil(pi/arccos sqrt(nu1 nu2)) - 1$ for $nu1 nu2 < 1$ and no bound (``inf``) for $nu1 nu2 >= 1$. One
    fold invisible: 1. None: 0.

    Parameters
    ----------
    sigma : (int, int)
        Signs of the two folds.
    nu : (float, float)
        The two numbers $(nu1, nu2)$ of the two-fold.

    Returns
    -------
    float
        A whole number, or inf.

    Examples
    --------
    >>> max_flights((-1, 1), (-0.9, -1.0)), max_flights((-1, 1), (-2.0, -1.0))
    (9, inf)
    """
    first, second = pair(sigma, "sigma")
    if {abs(first), abs(second)} != {1.0}:
        raise OptionError(f"sigma: expected two signs, +1 or -1, received {sigma!r}.")
    n1, n2 = pair(nu, "nu")
    invisible = (first < 0) + (second > 0)
    if invisible < 2:
        return invisible
    if n1 >= 0 or n2 >= 0:
        return 1 if n1 >= 0 and n2 >= 0 else 2
    if n1 * n2 >= 1:
        return math.inf
    angle = math.acos(math.sqrt(n1 * n2))
    return math.ceil(math.pi / angle - 1e-12) - 1


def has_diabolo(flow: ReducedFlow) -> bool:
    """Whether the return map of an invisible two-fold has invariant lines where orbits cross."""
    n1, n2 = flow.nu
    return flow.folds == "II" and n1 < 0 and n2 < 0 and n1 * n2 > 1 + 1e-12


def diabolo_slopes(nu: Nu) -> tuple[float, float]:
    """Slopes $|z3/z2|$ of the two invariant lines of the return map (the nonsmooth diabolo).

    For an invisible two-fold with $nu1, nu2 < 0$ and $nu1 nu2 > 1$ they are
    $r_- = |nu1| (1 - sqrt(1 - 1/(nu1 nu2)))$ and $r_+ = |nu1| (1 + sqrt(1 - 1/(nu1 nu2)))$. On $r_-$ flights grow; on $r_+$ they shrink to s.

    Parameters
    ----------
    nu : (float, float)
        The two numbers $(nu1, nu2)$ of the two-fold.

    Returns
    -------
    (float, float)
        The smaller and the larger slope, $r_-$ and $r_+$.

    Raises
    ------
    OptionError
        For other numbers: the return map has no invariant lines in the crossing region.

    Examples
    --------
    >>> [round(r, 6) for r in diabolo_slopes((-2.0, -1.0))]
    [0.585786, 3.414214]
    """
    n1, n2 = pair(nu, "nu")
    a, b = -n1, -n2
    if not (a > 0 and b > 0 and a * b > 1):
        raise OptionError(
            f"nu: expected nu1, nu2 < 0 and nu1 nu2 > 1, received {nu!r}. Otherwise every orbit of "
            "an invisible two-fold makes finitely many flights."
        )
    plus = a * (1 + math.sqrt(1 - 1 / (a * b)))
    return a / (b * plus), plus


def accumulation_time(nu: Nu, phi: float = 1.0) -> float:
    """Time of the infinitely many flights from $(z2, z3) = (-1, r_+)$ into the two-fold.

    Parameters
    ----------
    nu : (float, float)
        Both negative, product above 1.
    phi : float, optional
        Time scale of the two-fold for real time; 1 gives normal-form time. The time is
        proportional to $|z2|$ of the start.

    Returns
    -------
    float
        The time to the two-fold along the contracting line of the diabolo.

    Raises
    ------
    OptionError
        For other numbers every orbit makes finitely many flights; ``phi`` is not positive.

    Examples
    --------
    >>> round(accumulation_time((-2.0, -1.0)), 12)
    3.828427124746
    """
    _, plus = diabolo_slopes(nu)
    n1, n2 = pair(nu, "nu")
    a, b = -n1, -n2
    growth = 2 * a * b - 1 + 2 * a * b * math.sqrt(1 - 1 / (a * b))
    phi = positive(phi, "phi")
    return 2 * (phi + (2 * a - plus) / phi) / (1 - 1 / growth)
