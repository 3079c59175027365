"""Picture of what is proven about landings (matplotlib; ``bounce.plot.proven_map``)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import nonsmooth as ns

from ..errors import require
from ..maps.dividing import DividingCurve
from ..maps.proven import OUTCOMES, ProvenMap
from .keys import keys
from .outcomes import draw_curve

style = ns.plot.style
canvas = ns.plot.canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Outcomes as they are drawn; undecided is left white.
PROVEN_COLOURS = {
    "undecided": "#FFFFFF",
    "forward": style.VERMILLION,
    "reverse": style.BLUE,
    "rolling": style.GREEN,
}


def proven_map(
    found: ProvenMap,
    *,
    curve: DividingCurve | None = None,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Mapping[str, Any] | None = None,
    **look: Any,
) -> Any:
    """Draw which landings are proven to lift off forward, in reverse, or are undecided.

    Parameters
    ----------
    found : ProvenMap
        The map, from :func:`bounce.maps.proven_map`.
    curve : DividingCurve, optional
        Drawn over it; the undecided pieces surround it.
    ax : matplotlib Axes, optional
        Draw here instead of in a new figure.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture.
    colors : mapping, optional
        Colours by outcomes: ``"forward"``, ``"reverse"``, ``"rolling"``, ``"undecided"``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the dividing curve and the edges of pieces.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> found = bounce.maps.proven_map(turf, xdot=(0.1, 0.11), omega=(1.0, 1.02), depth=1)
    >>> [t.get_text() for t in bounce.plot.proven_map(found).axes[0].get_legend().get_texts()]
    ['forward: 100.0%']
    """
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Patch, Rectangle

    require(found, ProvenMap, "found", "bounce.maps.proven_map returns one.")
    with canvas(ax, size, (7.0, 5.4), colors=colors, look=look, title=title) as page:
        ax = page.ax
        fills = {name: page.color(name, usual) for name, usual in PROVEN_COLOURS.items()}
        edges = page.look("edges", color="0.6", linewidth=0.3)
        edge = {"edgecolor": edges["color"], "linewidth": edges["linewidth"]}
        for k, name in enumerate(OUTCOMES):
            boxes = found.boxes[found.outcome == k]
            patches = [Rectangle((a, c), b - a, d - c) for a, b, c, d in boxes]
            ax.add_collection(PatchCollection(patches, facecolor=fills[name], **edge))
        low, high = found.boxes.min(axis=0), found.boxes.max(axis=0)
        view = (low[0], high[1]), (low[2], high[3])
        key = {} if curve is None else draw_curve(page, ("xdot", "omega"), curve, view)
        ax.set_xlim(view[0])
        ax.set_ylim(view[1])
        ax.set_xlabel(r"speed $\dot X_0$")
        ax.set_ylabel(r"spin $\Omega_0$")
        handles = [
            Patch(facecolor=fills[name], edgecolor="0.6", label=f"{name}: {share:.1%}")
            for name, share in found.area.items()
            if share > 0
        ]
        if legend:
            keys(ax, handles, key, "proven, share")
    return page.drawn
