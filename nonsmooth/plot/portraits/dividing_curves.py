"""Sections of the dividing surfaces of two-folds with a plane of initial states."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ...model import Array, OptionError
from ...orbit import DividingCurves
from .. import style
from ..arguments import results
from ..drawing import Canvas, Colors, Drawn, canvas
from ..labels import Labels

#: Description and dashes of each kind of arc.
_KINDS: dict[str, tuple[str, Any]] = {
    "two-fold": ("into a two-fold", "-"),
    "grazing": ("just touches", style.DASHED),
}

#: Shares of an arc's length beside which its name may be.
_MIDDLE = np.linspace(0.3, 0.7, 9)


def dividing_curves(
    found: DividingCurves | Sequence[DividingCurves],
    *,
    names: Sequence[str] = (),
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    labels: bool = True,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw the curves in which a plane of starts cuts the dividing surfaces of two-folds.

    Starts that slide into a two-fold are full lines, starts that graze the surface are dashed, and dots
    are their common ends; circles are common ends of arcs of one kind with different itineraries. Each
    arc has its itinerary beside it. Orbits into two-folds are blue, orbits out of them red.

    Parameters
    ----------
    found : DividingCurves or sequence of DividingCurves
        From :func:`nonsmooth.manifold` with ``starts``; several in one plane.
    names : sequence of str, optional
        Of the two coordinates of the plane, for the axes.
    ax : matplotlib Axes, optional
        Axes to draw into, for example those of a map of outcomes; a new figure is made without it.
    size : (width, height), optional
        Of a new figure, in inches.
    labels : bool, optional
        Whether arcs have their names beside them.
    title : str, optional
        Title of the picture; none by default.
    colors : mapping, optional
        Colours by the kinds of arcs, ``"two-fold"`` and ``"grazing"``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the arcs.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    OptionError
        Not such curves, or no axes of a plane.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z = (ca.SX.sym(name) for name in "xyz")
    >>> system = ns.FilippovSystem([x, y, z], surface=x, above=[y, 1, 0.5], below=[z, 0.3, -1])
    >>> fold = ns.find_two_fold(system, near=[0.0, 0.0, 0.0])
    >>> found = ns.manifold(system, fold, starts=lambda a, b: [0.3, a, b], box=[(-2, -0.5), (-1, 1)],
    ...                     duration=6.0)
    >>> figure = ns.plot.dividing_curves(found, names=["y at the start", "z at the start"])
    >>> figure.axes[0].get_xlabel()
    'y at the start'
    """
    several = results(found, DividingCurves, "manifold returns them with starts=.")
    with canvas(ax, size, (5.0, 3.9), colors=colors, look=look, title=title) as page:
        axes = page.ax
        if hasattr(axes, "get_zlim"):
            raise OptionError(
                f"ax is {type(axes).__name__}, not axes of a plane. Leave projection out."
            )
        named = Labels(axes) if labels else None
        for one in several:
            _draw(page, named, one)
        for axis, name in zip("xy", names, strict=False):
            getattr(axes, f"set_{axis}label")(name)
        axes.margins(0.06)
    return page.drawn


def _draw(page: Canvas, named: Labels | None, one: DividingCurves) -> None:
    axes, color = page.ax, style.BLUE if one.stable else style.VERMILLION
    for arc in one.arcs:
        description, dashes = _KINDS[arc.kind]
        line = page.look(arc.kind, color=color, linewidth=1.8, linestyle=dashes)
        axes.plot(*arc.points.T, **line)
        if named is not None:
            back = "" if one.stable else ", backward"
            modes = arc.itinerary.replace("-", "\N{MINUS SIGN}")
            named.name(f"{modes} {description}{back}", _middle(arc.points), line["color"])
    changes = _changes(one)
    if len(changes):
        look: Any = {"markersize": 4.5, "zorder": 5}
        axes.plot(*changes.T, "o", markerfacecolor="white", markeredgecolor=color, **look)
    if len(one.junctions):
        axes.plot(*one.junctions.T, "o", color=style.BLACK, markersize=4.5, zorder=5)


def _changes(one: DividingCurves) -> Array:
    """Points (k, 2) at which arcs of two itineraries of one kind follow each other."""
    pairs = [pair for curve in one.curves for pair in pairwise(curve)]
    found = [a.points[-1] for a, b in pairs if a.kind == b.kind and a.itinerary != b.itinerary]
    return np.array(found).reshape(-1, 2)


def _middle(points: Array) -> Array:
    """Points (k, 2) about the middle of a polyline, by its length."""
    steps = np.diff(points, axis=0) / (np.ptp(points, axis=0) + np.finfo(float).tiny)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
    at = _MIDDLE * length[-1]
    return np.column_stack([np.interp(at, length, column) for column in points.T])
