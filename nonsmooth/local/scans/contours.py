"""Zero lines and sign changes of functions on a grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...model import Array


def zero_lines(lines: tuple[Array, Array], values: Array) -> list[Array]:
    """Polylines (m, 2) on which a function of grid points vanishes; NaN counts as undefined."""
    if not (np.any(values > 0) and np.any(values < 0)):
        return []
    from contourpy import contour_generator  # of matplotlib, on which it does not depend

    found = contour_generator(*lines, np.ma.masked_invalid(values)).lines(0.0)
    return [np.asarray(line) for line in found if len(line) > 1]


def refined(curve: Array, scale: Array, step: float) -> Array:
    """Insert points so that neighbours on a polyline are at most ``step`` of the scale apart."""
    length = np.linalg.norm(np.diff(curve, axis=0) / scale, axis=1)
    parts = [
        np.linspace(a, b, max(int(np.ceil(n / step)), 1), endpoint=False)
        for a, b, n in zip(curve[:-1], curve[1:], length, strict=True)
    ]
    return np.vstack([*parts, curve[-1:]])


def inserted(curve: Array, points: Array) -> Array:
    """Insert points that lie on a polyline between its vertices."""
    for point in points:
        a, b = curve[:-1], curve[1:]
        detour = (
            np.linalg.norm(point - a, axis=1)
            + np.linalg.norm(point - b, axis=1)
            - np.linalg.norm(b - a, axis=1)
        )
        curve = np.insert(curve, int(np.argmin(detour)) + 1, point, axis=0)
    return curve


def sign_changes(values: Array) -> NDArray[np.int64]:
    """Indices k of values (m,) that change sign from k to k + 1; an exact zero is found once."""
    positive = values >= 0  # a zero at a vertex counts as positive
    good = np.isfinite(values)
    return np.flatnonzero((positive[:-1] != positive[1:]) & good[:-1] & good[1:])


def middle_of_sign_changes(
    lines: tuple[Array, Array], functions: Sequence[Array], keep: NDArray[np.bool_] | None = None
) -> Array:
    """Middles (k, 2) of the grid cells in which all functions (rows, columns) change sign."""
    # ``keep`` excludes cells; a cell with an undefined corner has no sign change.
    u, v = lines
    found = np.ones((len(v) - 1, len(u) - 1), dtype=bool) if keep is None else keep
    for f in functions:
        corners = np.stack([f[:-1, :-1], f[1:, :-1], f[:-1, 1:], f[1:, 1:]])
        with np.errstate(invalid="ignore"):
            found = found & (corners.min(axis=0) <= 0) & (corners.max(axis=0) >= 0)
    i, j = np.nonzero(found)
    return np.column_stack([(u[j] + u[j + 1]) / 2, (v[i] + v[i + 1]) / 2])
