"""How the figures of papers look: the library's style, with the sizes of print."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nonsmooth.plot import style
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
    "TINT_ATTRACTING",
    "TINT_REPELLING",
    "VERMILLION",
    "arrow",
    "arrowhead",
    "canvas",
    "halo",
    "line",
    "marker",
    "new_figure",
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


def canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """Return a figure with one axes of equal scales and no frame, for schematic drawings."""
    figure = new_figure(width, height)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure, axes
