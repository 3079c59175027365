"""First root of a polynomial on an interval, with no root overlooked.

In Bernstein form on [0, h] a polynomial has at most as many roots as its coefficients change sign:
none excludes, one isolates, more are resolved by halving the interval (de Casteljau). A sign test
at the ends would miss a double crossing; this does not. The isolated root is finished by a Newton
iteration that stays in its bracket.

Source: Lane & Riesenfeld 1981, "Bounds on a polynomial"; Mourrain & Pavone 2009. Declined:
companion-matrix eigenvalues (all roots where one is wanted) and Sturm sequences (unstable).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...model import OptionError
from ..constants import DEPTH, ROUNDING


@lru_cache(maxsize=64)
def _to_bernstein(degree: int) -> NDArray[np.float64]:
    """Matrix from power coefficients on [0, 1] to Bernstein coefficients."""
    return np.array(
        [
            [math.comb(j, i) / math.comb(degree, i) if i <= j else 0.0 for i in range(degree + 1)]
            for j in range(degree + 1)
        ]
    )


def sign_changes(coefficients: NDArray[np.float64], h: float) -> NDArray[np.int64]:
    """Sign changes of the Bernstein coefficients of polynomials (rows, in powers of t) on 0 .."""
    # None says that there is surely no zero between 0 and h, one that there is exactly one; where rounding
    # leaves a coefficient at zero the answer is at least two, and more says nothing.
    degree = coefficients.shape[1] - 1
    b = np.sign((coefficients * h ** np.arange(degree + 1)) @ _to_bernstein(degree).T)
    changes = np.count_nonzero(b[:, 1:] != b[:, :-1], axis=1)
    return np.where(np.all(b != 0.0, axis=1), changes, np.maximum(changes, 2))


def first_root(coefficients: Sequence[float], h: float) -> float | None:
    """First t in (0, h] at which a polynomial that is positive at 0 stops being positive.

    Parameters
    ----------
    coefficients : sequence of float (n + 1,)
        In increasing powers of t.
    h : float
        End of the interval.

    Returns
    -------
    float or None
        None if the polynomial stays positive (a touch without crossing counts as positive to
        rounding); 0 if it is not positive at 0.

    Examples
    --------
    A parabola that dips to -1e-9 between its equal ends:

    >>> root = first_root([0.25 - 1e-9, -1.0, 1.0], 1.0)
    >>> abs(root - (0.5 - 1e-9**0.5)) < 1e-12
    True
    """
    c = _floats(coefficients)
    if c[0] <= 0.0:
        return 0.0
    scaled = _scaled(c, h)
    rest = sum(abs(v) for v in scaled[1:])
    if c[0] > rest:
        return None
    if not rest < 2.0**DEPTH * c[0]:  # more halvings than there are would be needed, or an overflow
        h = min(h, _largest_root(c))
        scaled = _scaled(c, h)
    # A touch that reaches zero only by rounding is no root: look for roots of p + rounding, which at t
    # is ROUNDING sum |c_k| t^k.
    raised = [v + ROUNDING * abs(v) for v in scaled]
    bernstein = (_to_bernstein(len(c) - 1) @ raised).tolist()
    return _first_in(c, bernstein, 0.0, h)


def _scaled(c: list[float], h: float) -> list[float]:
    """Coefficients on [0, 1] of a polynomial on [0, h]; overflow gives inf or NaN."""
    scaled, power = [c[0]], 1.0
    for v in c[1:]:
        power *= h
        scaled.append(v * power if v else 0.0)
    return scaled


def _largest_root(c: list[float]) -> float:
    """Bound of the magnitudes of all roots (Fujiwara 1916), with a margin for rounding."""
    n = max((k for k, v in enumerate(c) if v), default=0)
    ratios = (abs(v / c[n]) ** (1.0 / (n - k)) for k, v in enumerate(c[:n]))
    return 2.5 * max(ratios, default=0.0)


def _floats(coefficients: Sequence[float]) -> list[float]:
    try:
        c = [float(v) for v in coefficients]
    except (TypeError, ValueError):
        c = []
    if not c:
        raise OptionError(
            f"coefficients: expected at least one number, in increasing powers of t, received "
            f"{coefficients!r}."
        )
    return c


def _first_in(c: list[float], b: list[float], low: float, high: float) -> float | None:
    """First root on (low, high] given Bernstein coefficients there; depth-first, left first."""
    pending = [(b, low, high, 0)]
    while pending:
        b, low, high, depth = pending.pop()
        if b[0] <= 0.0:
            return _polish(c, low, high)
        changes = sum((u > 0.0) != (v > 0.0) for u, v in pairwise(b))
        if changes == 0:
            continue
        if changes == 1:
            if _horner(c, low)[0] <= 0.0:
                return _polish(c, low, high)
            return _newton(c, low, high, low + (high - low) * _crossing(b))
        if depth == DEPTH:
            if b[-1] <= 0.0:
                return high
            continue
        left, right = _halve(b)
        middle = 0.5 * (low + high)
        pending.append((right, middle, high, depth + 1))
        pending.append((left, low, middle, depth + 1))
    return None


def _crossing(b: list[float]) -> float:
    """Where the control polygon first crosses zero, as a fraction of the interval."""
    n = len(b) - 1
    j = next(k for k in range(n) if b[k + 1] <= 0.0)
    return (j + b[j] / (b[j] - b[j + 1])) / n


def _halve(b: list[float]) -> tuple[list[float], list[float]]:
    work, left, right = list(b), [b[0]], [b[-1]]
    for level in range(len(b) - 1, 0, -1):
        for i in range(level):
            work[i] = 0.5 * (work[i] + work[i + 1])
        left.append(work[0])
        right.append(work[level - 1])
    return left, right[::-1]


def _polish(c: list[float], x: float, h: float) -> float:
    """Newton's steps near a root that rounding in Bernstein form has put a little late."""
    value, slope = _horner(c, x)
    for _ in range(4):
        new = x - value / slope if slope else math.nan
        if not 0.0 <= new <= h:
            break
        new_value, slope = _horner(c, new)
        if abs(new_value) >= abs(value):
            break
        x, value = new, new_value
    return x


def _horner(c: list[float], x: float) -> tuple[float, float]:
    """Value and slope of a polynomial."""
    value, slope = c[-1], 0.0
    for v in reversed(c[:-1]):
        slope = slope * x + value
        value = value * x + v
    return value, slope


def _newton(c: list[float], low: float, high: float, x: float) -> float:
    """Root in (low, high], positive at low; Newton with bisection where it leaves the bracket."""
    for _ in range(100):
        value, slope = _horner(c, x)
        if value > 0.0:
            low = x
        else:
            high = x
        step = value / slope if slope else math.inf
        new = x - step
        # The step before the bracket: at a root near an end the iterate may leave it by rounding.
        if abs(step) <= 4e-16 * max(abs(x), high):
            return min(max(new, low), high)
        if not low < new < high:
            new = 0.5 * (low + high)
            if not low < new < high:
                return high
        x = new
    return high


def shift(coefficients: Sequence[float], t: float) -> list[float]:
    """Coefficients of p(t + s) in powers of s (Horner's scheme)."""
    c = [float(v) for v in coefficients]
    n = len(c)
    for i in range(n - 1):
        for k in range(n - 2, i - 1, -1):
            c[k] += t * c[k + 1]
    return c


def first_crossing(coefficients: Sequence[float], h: float, direction: int) -> float | None:
    """First t in (0, h] at which a polynomial passes zero in a direction.

    Parameters
    ----------
    coefficients : sequence of float
        In increasing powers of t; leading zeros are a start on the zero and are skipped.
    h : float
        End of the interval.
    direction : {-1, 0, 1}
        Falling, either way, rising.

    Returns
    -------
    float or None
        The time of the first crossing; None if there is none.

    Examples
    --------
    >>> first_crossing([1.0, -2.5, 1.0], 3.0, 1)
    2.0
    """
    sign = 1.0 if direction == 0 else -float(direction)
    try:
        c = [sign * float(v) for v in coefficients]
    except (TypeError, ValueError) as error:
        raise OptionError(
            f"coefficients: expected numbers in increasing powers of t, received {coefficients!r}."
        ) from error
    while c and c[0] == 0.0:
        c.pop(0)
    if not c:
        return None
    if c[0] > 0.0:
        return first_root(c, h)
    rise = first_root([-v for v in c], h)
    if rise is None or direction == 0:
        return rise
    fall = first_root(shift(c, rise)[1:], h - rise) if len(c) > 1 and rise < h else None
    return None if fall is None else rise + fall


def side_before(coefficients: Sequence[float], t: float, rounding: float) -> int:
    """Sign of a polynomial just before t > 0; 0 where rounding hides it."""
    c = _floats(coefficients)
    value, slope = _horner(c, t)
    noise = rounding + ROUNDING * _horner([abs(v) for v in c], t)[0]
    if abs(value) > noise:
        return 1 if value > 0.0 else -1
    if abs(slope) * t > noise:
        return -1 if slope > 0.0 else 1
    return 0


def passed(coefficients: Sequence[float], side: int, direction: int) -> bool:
    """Whether a function that was on a side just before has passed zero at once, in a direction."""
    if side * direction > 0:
        return False
    return next((float(v) for v in coefficients if v != 0.0), 0.0) * side < 0.0
