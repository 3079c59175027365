"""Pictures of slip directions in 3-D (matplotlib; reached as ``bounce.plot.slip_map``)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..errors import require
from ..maps.slip_directions import SlipMap
from ..parameters import numbers
from .keys import is_narrow

style = ns.plot.style
Canvas = ns.plot.Canvas
canvas = ns.plot.canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import ListedColormap

Array = NDArray[np.float64]

#: Lightness forward and reverse, and how yellow the right and how blue the left (CIE L*, b*).
_LIGHTNESS, _SWING, _YELLOW = 58.0, 30.0, 48.0
#: From XYZ (D65) to linear sRGB, and the white point.
_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
_WHITE = np.array([0.95047, 1.0, 1.08883])
_COLOURS = 360
_ARROWS, _ARROWS_COLUMN = 13, 8  # across a map, and across one in a column of a journal
_DOT = 17.0  # points, of a vortex: its turns are written on it


def direction_colours(angle: ArrayLike) -> Array:
    """Return colours of directions that colour-blind readers tell apart too.

    Forward is light, reverse dark, the right yellow, the left blue: a circle in lightness and in the
    one pair of hues that all but the rarest of colour-blind eyes see.

    Parameters
    ----------
    angle : array_like (...)
        rad from forward to the right.

    Returns
    -------
    ndarray (..., 3)
        Red, green and blue, from 0 to 1.

    Examples
    --------
    >>> import numpy as np
    >>> import bounce
    >>> light, dark = bounce.plot.direction_colours([0.0, np.pi]).mean(axis=-1)
    >>> bool(light > 0.8), bool(dark < 0.35)
    (True, True)
    """
    turned = numbers(angle, "angle")
    lightness = _LIGHTNESS + _SWING * np.cos(turned)
    f_y = (lightness + 16) / 116
    f = np.stack([f_y, f_y, f_y - _YELLOW * np.sin(turned) / 200], axis=-1)
    xyz = _WHITE * np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    linear = np.clip(xyz @ _TO_RGB.T, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _palette() -> ListedColormap:
    from matplotlib.colors import ListedColormap

    return ListedColormap(direction_colours(np.linspace(-math.pi, math.pi, _COLOURS)))


def slip_map(
    directions: SlipMap,
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Mapping[str, Any] | None = None,
    **look: Any,
) -> Any:
    """Draw the direction of the slip at lift-off over the spins, with a colour wheel.

    Light is forward, dark reverse, yellow to the right, blue to the left; arrows say the same (up is
    forward). White dots are vortices, where the ball lifts off without slip, with the turns that the
    direction makes around them.

    Parameters
    ----------
    directions : SlipMap
        The map, from :func:`bounce.slip_map`.
    ax : matplotlib Axes, optional
        Draw here instead of in a new figure.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture.
    colors : mapping, optional
        Colours by ``"arrows"`` and ``"vortices"``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the vortices.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    >>> spins = np.linspace(0.3, 0.8, 3), np.linspace(-0.25, 0.2, 2)
    >>> figure = bounce.plot.slip_map(bounce.slip_map(turf, [0.2, 0.0], spins, tol=1e-6))
    >>> [key.get_text() for key in figure.axes[0].child_axes[0].get_xticklabels()]
    ['forward', 'right', 'reverse', 'left']
    """
    require(directions, SlipMap, "directions", "bounce.slip_map returns one.")
    with canvas(ax, size, (7.0, 5.4), colors=colors, look=look, title=title) as page:
        ax = page.ax
        lateral, axial = directions.omega
        angle = np.where(directions.lift_offs.complete, directions.angle, np.nan)
        ax.pcolormesh(
            lateral, axial, angle, cmap=_palette(), vmin=-math.pi, vmax=math.pi,
            shading="nearest", rasterized=True,
        )  # fmt: skip
        _arrows(page, directions, angle)
        for vortex in directions.vortices:
            dot: Any = {"marker": "o", "markeredgecolor": "black", "markersize": _DOT}
            ax.plot(*vortex.omega, **page.look("vortices", color="white", zorder=6, **dot))
            turns = f"{vortex.winding:+d}"
            style.write(
                ax, vortex.omega, turns, zorder=7, fontsize=style.points(8.5), fontweight="bold"
            )
        ax.set_xlabel(r"lateral spin, $\omega_z$ (backspin)")
        ax.set_ylabel(r"axial spin, $-\omega_x$ (slips to the right)")
        v = directions.xdot
        if title is None:
            text = f"slip at lift-off: xdot = ({v[0]:g}, {v[1]:g}), ydot = {directions.ydot:g}"
            ax.set_title(text, fontsize=style.points(9), loc="left")
        if legend:
            _wheel(ax)
    return page.drawn


def _spread(count: int, most: int) -> NDArray[np.intp]:
    """Rows of cells with an arrow: half a distance off the frame, so that none reaches over it."""
    shown = min(most, count)
    return np.unique(np.round((np.arange(shown) + 0.5) * count / shown - 0.5).astype(np.intp))


def _arrows(page: Canvas, directions: SlipMap, angle: Array) -> None:
    ax, ink = page.ax, page.named("arrows", color="black")["color"]
    lateral, axial = directions.omega
    most = _ARROWS_COLUMN if is_narrow(ax) else _ARROWS
    rows, columns = _spread(axial.size, most), _spread(lateral.size, most)
    larger = _ARROWS / most
    shown = angle[np.ix_(rows, columns)]
    figure = ax.get_figure(root=True)
    assert figure is not None
    clear = 0.02 + _DOT / ax.bbox.width * figure.dpi / 72  # of the axes: half an arrow, and the dot
    for vortex in directions.vortices:
        at = vortex.omega
        beside = np.abs(lateral[columns] - at[0]) < clear * np.ptp(ax.get_xlim())
        shown[np.outer(np.abs(axial[rows] - at[1]) < clear * np.ptp(ax.get_ylim()), beside)] = (
            np.nan
        )
    # Up is forward: the second component of an arrow is that along the direction of travel.
    ax.quiver(
        lateral[columns], axial[rows], np.sin(shown), np.cos(shown), color=ink, edgecolor="white",
        linewidth=0.5, width=0.0045 * larger, scale=26 / larger, headwidth=4, headlength=4.5, headaxislength=4,
        pivot="middle", angles="uv", zorder=4,
    )  # fmt: skip


def _wheel(ax: Axes) -> None:
    """The key: a ring of colours beside the picture, forward at its top."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    gap = 0.55 * figure.dpi / ax.bbox.width  # inches for "left", on maps of every size
    ring: Any = ax.inset_axes((1.0 + gap, 0.68, 0.19, 0.24), projection="polar")
    ring.set_theta_zero_location("N")
    ring.set_theta_direction(-1)
    edges = np.linspace(-math.pi, math.pi, 181)
    middles = (edges[:-1] + edges[1:]) / 2
    ring.pcolormesh(
        edges,
        [0.55, 1.0],
        middles[None, :],
        cmap=_palette(),
        vmin=-math.pi,
        vmax=math.pi,
        rasterized=True,
    )
    ring.set_ylim(0.0, 1.0)
    ring.set_yticks([])
    ring.grid(False)
    ring.spines["polar"].set_visible(False)
    ring.set_xticks(
        [0.0, math.pi / 2, math.pi, 3 * math.pi / 2], labels=["forward", "right", "reverse", "left"]
    )
    ring.tick_params(pad=0, labelsize=style.points(8))
    # Beside the ring: the sides of a polar axis have their labels on it without a distance.
    for label, side in zip(
        ring.get_xticklabels(), ("center", "left", "center", "right"), strict=True
    ):
        label.set_horizontalalignment(side)
