"""Regions of outcome maps: their colours, their names on the picture, and a key of the narrow ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..maps.outcomes import OutcomeMap
from .keys import is_narrow

style = ns.plot.style
Canvas = ns.plot.Canvas
Array = NDArray[np.float64]

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

#: Regions of the paper's eight itineraries: warm where the ball leaves in forward slip, cold where
#: in reverse (colours of the style and tints of them; neighbours differ in grey as well).
COLOURS = {
    "S+": "#F6C7A3",
    "S+ R S+": style.VERMILLION,
    "S- R S+": style.YELLOW,
    "S- S+": "#A05A2C",
    "S-": "#BCDDF5",
    "S- R S-": style.BLUE,
    "S+ R S-": style.SKY,
    "S+ S-": "#0B3C5D",
    # of the laws: slip throughout in the same colours, rolling at lift-off in those of its own side
    "I+": "#F6C7A3",
    "II+": style.GREEN,
    "III+": style.SKY,
    "III-": style.VERMILLION,
    "II-": "#B7E4C7",
    "I-": "#BCDDF5",
}
#: For other itineraries: each has one meaning on a map.
MORE = (
    style.PURPLE,
    "#999999",
    "#7A5195",
    "#5F5F5F",
    "#EBC4DB",
    "#00573F",
)

#: How many regions without room for their name are listed, the largest first, and the colour of the others.
LISTED = 5
_REST = "#E4E4E4"
#: What the layout leaves of the height and the width of axes to the map, at least: keys need the rest.
_LEFT, _LEFT_COLUMN = np.array([1.0, 0.8]), np.array([0.8, 1.0])
_POINTS = 9.0  # of the names of regions


def regions(page: Canvas, outcomes: OutcomeMap, x: Array, y: Array, room: int) -> list[Patch]:
    """Colour the regions and name them; return a key of the ``room`` largest without room for a name."""
    from matplotlib.patches import Patch

    ax = page.ax
    clear = ~_turns(outcomes.slip)
    inside = [outcomes.code == code for code in range(len(outcomes.regions))]
    positions = [
        _place(ax, x, y, cells & clear, name)
        for cells, name in zip(inside, outcomes.regions, strict=True)
    ]
    named = [code for code, place in enumerate(positions) if place is not None]
    narrow = [code for code, place in enumerate(positions) if place is None]
    narrow.sort(key=lambda code: -np.count_nonzero(inside[code]))
    listed = narrow if len(narrow) <= room + 1 else narrow[:room]  # not "and 1 more"
    spare = iter(MORE)
    colours: list[Any] = [_REST] * len(outcomes.regions)
    for code in (*listed, *named):
        name = outcomes.regions[code]
        colours[code] = page.color(name, COLOURS.get(name) or next(spare, _REST))
    look: dict[str, Any] = dict(
        cmap=page.palette(colours or [_REST]), vmin=-0.5, vmax=max(len(colours), 1) - 0.5
    )
    cells = np.ma.masked_less(outcomes.code, 0)  # without lift-off
    ax.pcolormesh(x, y, cells, shading="nearest", rasterized=True, **look)
    for code in named:
        place = positions[code]
        assert place is not None
        ink = "white" if style.luminance(colours[code]) < 0.2 else "black"
        style.write(
            ax,
            place,
            outcomes.regions[code],
            zorder=6,
            color=ink,
            fontsize=style.points(_POINTS),
            fontweight="bold",
        )
    column = is_narrow(ax)
    key = [(_short(outcomes.regions[code], column), colours[code]) for code in listed]
    if rest := narrow[len(listed) :]:
        key.append((f"and {len(rest)} more", _REST))
        _borders(ax, outcomes.code, rest, x, y)
    frame: dict[str, Any] = dict(edgecolor="0.3", linewidth=0.6)
    return [Patch(facecolor=colour, label=name, **frame) for name, colour in key]


def _turns(slip: Array) -> NDArray[np.bool_]:
    """Cells at which the slip changes its sign: a line is there."""
    sign = np.sign(slip)
    found = np.zeros(sign.shape, dtype=bool)
    found[1:] |= sign[1:] * sign[:-1] < 0
    found[:, 1:] |= sign[:, 1:] * sign[:, :-1] < 0
    return found


def _short(name: str, column: bool) -> str:
    """The first phases of a long itinerary, its last and how many they are; fewer in a column."""
    phases, most = name.split(), 5 if column else 8
    if len(phases) <= most:
        return name
    return " ".join([*phases[: most // 2], "..", phases[-1], f"({len(phases)})"])


def _borders(ax: Axes, code: NDArray[Any], rest: Sequence[int], x: Array, y: Array) -> None:
    """Thin lines between regions that have the same colour."""
    from matplotlib.collections import LineCollection

    left, low = ([axis[0], *((axis[1:] + axis[:-1]) / 2), axis[-1]] for axis in (x, y))
    shared = np.isin(code, rest)
    lines = []
    for row, col in np.argwhere((code[:, 1:] != code[:, :-1]) & shared[:, 1:] & shared[:, :-1]):
        lines.append([(left[col + 1], low[row]), (left[col + 1], low[row + 1])])
    for row, col in np.argwhere((code[1:] != code[:-1]) & shared[1:] & shared[:-1]):
        lines.append([(left[col], low[row + 1]), (left[col + 1], low[row + 1])])
    ax.add_collection(
        LineCollection(lines, colors="0.72", linewidths=0.4, zorder=1, rasterized=True)
    )


def _place(
    ax: Axes, x: Array, y: Array, inside: NDArray[np.bool_], name: str
) -> tuple[float, float] | None:
    """The widest point of a region, if its name fits there."""
    from scipy.ndimage import distance_transform_edt, minimum_filter

    room = distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    letters = np.array([1.3, 0.72 * len(name)]) * style.points(
        _POINTS
    )  # height and width of the name
    left = _LEFT_COLUMN if is_narrow(ax) else _LEFT
    frame = np.array([ax.bbox.height, ax.bbox.width]) * left * 72 / ax.figure.dpi
    cells = np.ceil(letters / frame * inside.shape).astype(int)
    fits = minimum_filter(inside, size=tuple(cells), mode="constant", cval=0)
    room = np.where(fits, room, 0.0)
    row, column = np.unravel_index(int(np.argmax(room)), room.shape)
    if room.max() < 0.03 * min(inside.shape):
        return None
    return float(x[column]), float(y[row])
