"""How the figures of papers look: one palette for colour-blind eyes, line styles that print in grey."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from numpy.typing import ArrayLike

# Okabe & Ito 2008.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#7F7F7F"
ABOVE, BELOW, SLIDING = VERMILLION, BLUE, BLACK
CANARD = "#A8005C"
DASHED, DASHDOT, DOTTED = (0, (5, 2)), (0, (6, 2, 1.5, 2)), (0, (1, 1.5))

_SETTINGS: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10.0,
    "mathtext.fontset": "dejavusans",
    "axes.labelsize": 11.0,
    "axes.titlesize": 10.5,
    "axes.linewidth": 0.8,
    "figure.facecolor": "white",
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "pdf.fonttype": 42,
}


@contextmanager
def settings() -> Iterator[None]:
    """Apply the look inside a ``with`` block."""
    with mpl.rc_context(_SETTINGS):
        yield


def new_figure(width: float = 6.0, height: float = 4.5) -> Figure:
    """Return an empty figure (inches) that pyplot does not keep."""
    return Figure(figsize=(width, height), layout="constrained")


def canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """Return a figure with one axes of equal scales and no frame, for schematic drawings."""
    figure = new_figure(width, height)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure, axes


def halo(width: float = 3.0) -> list[Any]:
    """Return path effects that keep a text legible on lines."""
    return [patheffects.withStroke(linewidth=width, foreground="white")]


def arrow(axes: Axes, start: ArrayLike, end: ArrayLike, color: str = BLACK, **options: Any) -> None:
    """Draw a straight arrow in data coordinates."""
    options = {"arrowstyle": "-|>", "mutation_scale": 12, "linewidth": 1.3, **options}
    patch = FancyArrowPatch(
        tuple(np.asarray(start, dtype=float)),
        tuple(np.asarray(end, dtype=float)),
        shrinkA=0,
        shrinkB=0,
        color=color,
        **options,
    )
    axes.add_patch(patch)


def direction(axes: Axes, curve: ArrayLike, at: float, color: str, size: float = 13) -> None:
    """Put an arrowhead on a curve (m, 2) at a fraction of its length."""
    points = np.asarray(curve, dtype=float)
    span = np.ptp(points, axis=0)
    scale = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())]) if any(span) else 1.0
    steps = np.hypot(*(np.diff(points, axis=0) / scale).T)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    tip, tail = (
        [np.interp(x * length[-1], length, c) for c in points.T] for x in (at, max(at - 0.02, 0))
    )
    arrow(axes, tail, tip, color, linewidth=0, mutation_scale=size, zorder=8)
