"""How the figures of papers look: the library's style, with the sizes of print."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from nonsmooth.plot import style
from nonsmooth.plot.labels import Labels
from nonsmooth.plot.style import (
    ABOVE,
    BELOW,
    BLACK,
    BLUE,
    CANARD,
    DASH_DOT,
    DASHED,
    DOTS,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    REPELLING,
    TINT_ATTRACTING,
    TINT_REPELLING,
    VERMILLION,
    arrow,
    arrowhead,
    halo,
    line,
    marker,
    write,
)

Array = NDArray[np.float64]

__all__ = [
    "ABOVE",
    "BELOW",
    "BLACK",
    "BLUE",
    "CANARD",
    "DASHED",
    "DASH_DOT",
    "DOTS",
    "GREEN",
    "GREY",
    "ORANGE",
    "PURPLE",
    "REPELLING",
    "TINT_ATTRACTING",
    "TINT_REPELLING",
    "VERMILLION",
    "Labels",
    "arrow",
    "arrowhead",
    "canvas",
    "halo",
    "line",
    "marker",
    "new_figure",
    "sampled",
    "settings",
    "write",
]

_PRINT = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "pdf.fonttype": 42,
}


@contextmanager
def settings() -> Iterator[None]:
    """Apply the look inside a ``with`` block."""
    with style.settings(_PRINT):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure (inches) that pyplot does not keep."""
    return style.new_figure((width, height))


def sampled(
    function: Callable[[float], ArrayLike], at: ArrayLike, turn: float = 4.0, most: int = 200
) -> tuple[Array, Array]:
    """Values of a function where its curves bend: between two points until they look smooth.

    Parameters
    ----------
    function : callable
        Returns a number or several (k,), each drawn as a curve over its argument.
    at : array_like (m,)
        Where to begin with.
    turn : float, optional
        Largest angle between neighbouring pieces, in degrees, on a square picture of each curve.
    most : int, optional
        Points after which to stop.

    Returns
    -------
    (ndarray (n,), ndarray (n, k))
        Arguments in order, and values.
    """
    values = {float(x): np.atleast_1d(np.asarray(function(float(x)), float)) for x in np.ravel(at)}
    while len(values) < most:
        xs = np.array(sorted(values))
        ys = np.array([values[x] for x in xs])
        dx = np.diff(xs)[:, None] / np.ptp(xs)
        dy = np.diff(ys, axis=0) / np.where(np.ptp(ys, axis=0) > 0, np.ptp(ys, axis=0), 1.0)
        angle = np.degrees(np.arctan2(dy, dx))
        bends = np.abs(np.diff(angle, axis=0)) > turn
        long = np.hypot(dx, dy) > 2e-3
        near = np.zeros(len(dx), dtype=bool)
        near[:-1] |= np.any(bends & long[:-1], axis=1)
        near[1:] |= np.any(bends & long[1:], axis=1)
        new = [(a + b) / 2 for a, b, k in zip(xs[:-1], xs[1:], near, strict=True) if k]
        if not new:
            break
        for x in new[: most - len(values)]:
            values[float(x)] = np.atleast_1d(np.asarray(function(float(x)), float))
    xs = np.array(sorted(values))
    return xs, np.array([values[x] for x in xs])


def canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """Return a figure with one axes of equal scales and no frame, for schematic drawings."""
    figure = new_figure(width, height)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure, axes
