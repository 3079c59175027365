"""Basins of attraction as a map, with the attractors on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from ..model import OptionError
from ..orbit import Basins
from . import style
from .drawing import Canvas, Colors, Drawn, canvas
from .labels import Labels
from .legends import beside

#: Colours of attractors in turn: distinct for deuteranopes too, light enough for dark marks.
COLORS = ("#9ecae1", "#fdd0a2", "#9fdf5f", "#7f7fff", "#df7f7f", "#5f9fdf", "#ffdf3f", "#7f9f3f")
_LISTED = 4  # attractors in a legend, beside other outcomes; more are named on the map
_ENTRIES = 6  # of a legend
_OTHERS = {0: "#ffffff", -1: "#252525", -2: "#737373", -3: "#bdbdbd", -4: "#969696"}


def basins(
    found: Basins,
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw which attractor each start of a grid of two axes goes to.

    Attractors are marked where they are in the plane of the grid's axes; the other states of the
    starts, if there are any, have the grid's values.

    Parameters
    ----------
    found : Basins
        Of a grid given as a mapping in which two states vary.
    ax : matplotlib Axes, optional
        A new figure is made without it.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture; the default says what is shown.
    colors : mapping, optional
        Colours by the names of the outcomes: ``"attractor 1"``, ``"undecided"``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the marks of attractors.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    OptionError
        The grid does not have two axes.

    Examples
    --------
    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> well = ns.FilippovSystem(
    ...     [x, v], surface=x, above=[v, 1 - x - 0.3 * v], below=[v, -1 - x - 0.3 * v])
    >>> axis = np.linspace(-3, 3, 8)
    >>> found = ns.basins(well, {"x": axis, "v": axis}, t_end=100.0)
    >>> figure = ns.plot.basins(found)
    """
    if not isinstance(found, Basins) or len(found.axes) != 2:
        raise OptionError(
            f"found is {found!r}, not Basins of a grid with two axes. Give the grid as a mapping: two "
            "states with axes, numbers for the others."
        )
    with canvas(ax, size, (6.4, 5.0), colors=colors, look=look, title=title) as page:
        axes = page.ax
        _fill(page, found)
        first, second = (found.state_names.index(name) for name in found.axes)
        for attractor in found.attractors:
            points = attractor.points
            size_ = 5.0 if len(points) < 8 else 2.0
            mark: Any = {
                "linestyle": "",
                "marker": "o",
                "markersize": size_,
                "markeredgewidth": 0.0,
            }
            mark = page.look("attractor", color=style.BLACK, zorder=3, **mark)
            axes.plot(points[:, first], points[:, second], **mark)
        across, up = found.axes
        axes.set_xlabel(across)
        axes.set_ylabel(up)
        if legend:
            _names(axes, found) if sum(k > 0 for k in found.fractions) > _LISTED else None
            _legend(page, found)
    return page.drawn


def _fill(page: Canvas, found: Basins) -> None:
    """Cells around the starts, in the colours of their labels."""
    axes = page.ax
    present = np.unique(found.labels)
    index = np.searchsorted(present, found.labels)
    colors = page.palette(_color(page, found, int(label)) for label in present)
    x, y = (_edges(axis) for axis in found.axes.values())
    axes.pcolormesh(x, y, index.T, cmap=colors, vmin=-0.5, vmax=len(present) - 0.5, rasterized=True)
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])


def _edges(axis: Any) -> Any:
    """Bounds of cells around values."""
    if len(axis) < 2:
        return np.array([axis[0] - 0.5, axis[0] + 0.5])
    middle = (axis[1:] + axis[:-1]) / 2
    return np.concatenate([[2 * axis[0] - middle[0]], middle, [2 * axis[-1] - middle[-1]]])


def _color(page: Canvas, found: Basins, label: int) -> Any:
    usual = COLORS[(label - 1) % len(COLORS)] if label > 0 else _OTHERS[label]
    return page.color(found.name(label), usual)


def _legend(page: Canvas, found: Basins) -> None:
    parts = found.fractions
    attractors = [k for k in parts if k > 0]
    order = [k for k in parts if k <= 0]
    order = order if len(attractors) > _LISTED else [*attractors, *order]
    handles: list[Any] = [
        Patch(
            facecolor=_color(page, found, k),
            edgecolor=style.GREY,
            label=f"{found.name(k)}: {100 * parts[k]:.1f} %",
        )
        for k in order
    ]
    if attractors and len(handles) < _ENTRIES:
        handles.append(style.marker("o", "attractor", size=5.0, markeredgewidth=0.0))
    if handles:
        beside(page.ax, handles[:_ENTRIES], bbox_to_anchor=(1.01, 1.0))


def _names(axes: Axes, found: Basins) -> None:
    """Name the attractors of the largest basins inside these."""
    labels, parts = Labels(axes), found.fractions
    x, y = found.axes.values()
    for k in sorted((k for k in parts if k > 0), key=lambda k: -parts[k])[: len(COLORS)]:
        i, j = np.nonzero(_core(found.labels == k))
        text = f"{found.name(k)}:\n{100 * parts[k]:.1f} %"
        labels.name(text, np.column_stack([x[i], y[j]]), inside=True)


def _core(cells: Any) -> Any:
    """The cells of a region (m, n) that are farthest from others."""
    while True:
        padded = np.pad(cells, 1, mode="edge")
        near = [padded[2:, 1:-1], padded[:-2, 1:-1], padded[1:-1, 2:], padded[1:-1, :-2]]
        inner = np.logical_and.reduce([cells, *near])
        if not inner.any() or np.array_equal(inner, cells):
            return cells
        cells = inner
