"""Picture of what is proven about landings (matplotlib; ``bounce.plot.proven_map``)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import nonsmooth as ns

from ..errors import require
from ..maps.dividing import DividingCurve
from ..maps.proven import OUTCOMES, ProvenMap
from .keys import keys
from .outcomes import draw_curve

style = ns.plot.style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Outcomes as they are drawn; undecided is left white.
PROVEN_COLOURS = {
    "undecided": "#FFFFFF",
    "forward": style.VERMILLION,
    "reverse": style.BLUE,
    "rolling": style.GREEN,
}


def proven_map(
    found: ProvenMap, *, curve: DividingCurve | None = None, ax: Axes | None = None
) -> Figure:
    """Draw which landings are proven to lift off forward, in reverse, or are undecided.

    Parameters
    ----------
    found : ProvenMap
        The map, from :func:`bounce.maps.proven_map`.
    curve : DividingCurve, optional
        Drawn over it; the undecided pieces surround it.
    ax : matplotlib Axes, optional
        Draw here instead of in a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, with ``savefig``; notebooks show it.

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
    with style.settings():
        figure, ax = style.axes_for(ax, (7.0, 5.4))
        for k, name in enumerate(OUTCOMES):
            boxes = found.boxes[found.outcome == k]
            patches = [Rectangle((a, c), b - a, d - c) for a, b, c, d in boxes]
            ax.add_collection(
                PatchCollection(
                    patches, facecolor=PROVEN_COLOURS[name], edgecolor="0.6", linewidth=0.3
                )
            )
        low, high = found.boxes.min(axis=0), found.boxes.max(axis=0)
        view = (low[0], high[1]), (low[2], high[3])
        key = {} if curve is None else draw_curve(ax, ("xdot", "omega"), curve, view)
        ax.set_xlim(view[0])
        ax.set_ylim(view[1])
        ax.set_xlabel(r"speed $\dot X_0$")
        ax.set_ylabel(r"spin $\Omega_0$")
        handles = [
            Patch(facecolor=PROVEN_COLOURS[name], edgecolor="0.6", label=f"{name}: {share:.1%}")
            for name, share in found.area.items()
            if share > 0
        ]
        keys(ax, handles, key, "proven, share")
    return figure
