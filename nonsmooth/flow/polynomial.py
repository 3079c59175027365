"""First root of a polynomial on an interval, without missing a root, and shifts of polynomials.

In Bernstein form on [0, h] a polynomial has at most as many roots as its coefficients change sign: no change
excludes a root, one isolates it, more require bisection of the interval (``first_root`` of ``core/common.h``).

Source: Lane & Riesenfeld 1981, "Bounds on a polynomial"; Mourrain & Pavone 2009. Declined: companion-matrix
eigenvalues (they give all roots) and Sturm sequences (unstable).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model import Array, OptionError
from .engine.arrays import address
from .engine.building.core_source import MOST_ORDER
from .engine.interpreter import library


def first_root(coefficients: Sequence[float], h: float) -> float | None:
    """First t in (0, h] at which a polynomial that is positive at 0 stops being positive.

    Parameters
    ----------
    coefficients : sequence of float (n + 1,)
        In increasing powers of t, up to degree 47.
    h : float
        End of the interval.

    Returns
    -------
    float or None
        None if the polynomial stays positive (a touch without crossing counts as positive to
        rounding); 0 if it is not positive at 0.

    Raises
    ------
    OptionError
        No numbers, or too many.

    Examples
    --------
    A parabola that dips to -1e-9 between its equal ends:

    >>> root = first_root([0.25 - 1e-9, -1.0, 1.0], 1.0)
    >>> abs(root - (0.5 - 1e-9**0.5)) < 1e-12
    True
    """
    c = _floats(coefficients)
    return _time(library().polynomial_root(address(c), c.size - 1, h))


def first_crossing(coefficients: Sequence[float], h: float, direction: int) -> float | None:
    """First t in (0, h] at which a polynomial passes zero in a direction.

    Parameters
    ----------
    coefficients : sequence of float
        In increasing powers of t, up to degree 47; leading zeros are a start on the zero and are skipped.
    h : float
        End of the interval.
    direction : {-1, 0, 1}
        Falling, either way, rising.

    Returns
    -------
    float or None
        The time of the first crossing; None if there is none.

    Raises
    ------
    OptionError
        As :func:`first_root`.

    Examples
    --------
    >>> first_crossing([1.0, -2.5, 1.0], 3.0, 1)
    2.0
    """
    c = _floats(coefficients)
    return _time(library().polynomial_crossing(address(c), c.size - 1, h, direction))


def _floats(coefficients: Sequence[float]) -> Array:
    try:
        c = np.array([float(v) for v in coefficients])
    except (TypeError, ValueError):
        c = np.zeros(0)
    if not 0 < c.size <= MOST_ORDER:
        raise OptionError(
            f"coefficients is {coefficients!r}. Give 1 to {MOST_ORDER} numbers, in increasing powers of t."
        )
    return c


def _time(found: float) -> float | None:
    """The root, or None for -1, which the library returns without one."""
    return None if found < 0.0 else found


def shift(coefficients: Sequence[float], t: float) -> list[float]:
    """Coefficients of p(t + s) in powers of s (Horner's scheme)."""
    c = [float(v) for v in coefficients]
    n = len(c)
    for i in range(n - 1):
        for k in range(n - 2, i - 1, -1):
            c[k] += t * c[k + 1]
    return c
