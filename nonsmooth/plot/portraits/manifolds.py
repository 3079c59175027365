"""Manifolds: separatrices in a plane, curves and surfaces in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ...model import OptionError
from ...orbit import Manifold
from .. import style
from ..arguments import results
from ..drawing import Canvas, Colors, Drawn, canvas, key

_STABLE, _UNSTABLE = style.BLUE, style.VERMILLION


def manifold(
    found: Manifold | Sequence[Manifold],
    *,
    names: Sequence[str] = (),
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw manifolds, stable ones in blue and unstable ones in red.

    Parameters
    ----------
    found : Manifold or sequence of Manifold
        Of points of one system in the plane or in space.
    names : sequence of str, optional
        Of the states, for the axes.
    ax : matplotlib Axes, optional
        For example that of a phase portrait; with the projection ``"3d"`` for manifolds in space. A
        new figure is made without it.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture; the default says what is shown.
    colors : mapping, optional
        Colours by ``"stable"`` and ``"unstable"``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the curves.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    OptionError
        Not manifolds, of other dimensions, or axes that do not fit them.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[x + y, -1], below=[x, 1])
    >>> saddle = ns.find_pseudo_equilibrium(system, [0.1, 0.0])
    >>> both = [ns.manifold(system, saddle, stable=s, length=1.0) for s in (True, False)]
    >>> figure = ns.plot.manifold(both, names=["x", "y"])
    """
    several = results(found, Manifold, "dividing_curves draws curves in a plane of starts.")
    spatial = _dimension(several) == 3
    options: Any = {"colors": colors, "look": look, "title": title}
    with canvas(ax, size, (6.0, 4.6), projection="3d" if spatial else None, **options) as page:
        axes = page.ax
        if spatial != hasattr(axes, "get_zlim"):
            raise OptionError(
                f"ax is {type(axes).__name__}, which does not have the dimension of the manifolds. "
                "Make them with projection='3d' for three states."
            )
        for one in several:
            _draw(page, one)
        for axis, name in zip("xyz", names, strict=False):
            getattr(axes, f"set_{axis}label")(name)
        if spatial:
            _fit(axes, several)
        if legend:
            _legend(page, several)
    return page.drawn


def _dimension(several: list[Manifold]) -> int:
    sizes = {len(m.point) for m in several}
    if len(sizes) != 1 or not sizes <= {2, 3}:
        raise OptionError(
            f"found must be manifolds of one system with two or three states, not {several!r}."
        )
    return sizes.pop()


def _line(page: Canvas, stable: bool, width: float = 1.4) -> dict[str, Any]:
    color = _STABLE if stable else _UNSTABLE
    return page.look("stable" if stable else "unstable", color=color, linewidth=width)


def _draw(page: Canvas, one: Manifold) -> None:
    axes, line = page.ax, _line(page, one.stable)
    if one.dimension == 2 and len(one.triangles):
        faces = one.points[one.triangles]
        axes.add_collection3d(
            Poly3DCollection(
                faces,
                facecolors=line["color"],
                alpha=0.35,
                linewidths=0.0,
                shade=True,
                rasterized=True,
            )
        )
        for arc in one.arcs[:: max(1, len(one.arcs) // 24)]:
            axes.plot(*arc.points.T, **_line(page, one.stable, 0.5))
    else:
        for arc in one.arcs:
            axes.plot(*arc.points.T, **line)
    axes.plot(*one.point[:, None], marker="X", color=style.BLACK, markersize=5.0, linestyle="")


def _fit(axes: Any, several: list[Manifold]) -> None:
    """Limits around all points, in one scale."""
    points = np.vstack([arc.points for m in several for arc in m.arcs])
    for axis, low, high in zip("xyz", points.min(axis=0), points.max(axis=0), strict=True):
        pad = 0.03 * (high - low) or 0.5
        getattr(axes, f"set_{axis}lim")(low - pad, high + pad)


def _legend(page: Canvas, several: list[Manifold]) -> None:
    labels = {True: "stable manifold", False: "unstable manifold"}
    handles = [
        Line2D([], [], label=labels[s], **_line(page, s))
        for s in (True, False)
        if any(m.stable == s for m in several)
    ]
    handles.append(
        style.marker("X", "its point" if len(several) == 1 else "their points", size=5.0)
    )
    key(page.ax, handles, loc="upper left" if page.ax.name == "3d" else "best")
