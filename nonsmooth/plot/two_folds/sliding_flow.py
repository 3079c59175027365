"""The sliding flow of a two-fold: its four regions, folds and orbits in the z2-z3 plane.

Everything is drawn to leading order, where the portrait has no scale: orbits of one sector are
scaled copies of each other.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from ...local.two_folds import ReducedFlow, diabolo_slopes, flight_above
from ...local.two_folds.flights import has_diabolo
from ...local.two_folds.reduced_flow import Sector, eigenlines, sectors
from ...model import Array, whole
from .. import style
from ..drawing import Canvas, Colors, Drawn, canvas
from ..legends import beside, is_narrow
from .annotation import (
    TINTS,
    ZERO,
    Portrait,
    label_points,
    line_names,
    line_style,
    number,
    portrait_of,
    title_of,
    to_box,
)

_BOX = (-1.0, 1.0, -1.0, 1.0)
_WIDER_BOX = (-1.2, 1.2, -1.2, 1.2)  # curves run past the frame, which clips them
_BESIDE = 8.0  # points, from an eigenline to the middle of its name
#: Where the crossing arrows stand in C1; those of C2 are opposite.
_CROSSINGS = ((-0.32, 0.8), (-0.8, 0.32), (-0.4, 0.4))


def two_fold(
    fold: object,
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    orbits: int = 7,
    legend: bool = True,
    labels: bool | str | None = None,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw the sliding portrait of a two-fold in normal-form coordinates.

    The regions are attracting sliding (Da), repelling sliding (Dr) and crossing up (C1) and down
    (C2). Orbits are exact for the leading order; arrows show the direction of real time. Eigenlines
    of the sliding field are virtual outside of sliding. Hatched and dotted
    sectors are those whose orbits all connect to the two-fold.

    Parameters
    ----------
    fold : TwoFold or pair (sigma, nu)
        The two-fold, or its two signs and two numbers.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    size : (float, float), optional
        Inches, of a new figure.
    orbits : int, optional
        About how many orbits to draw in each sliding region.
    legend : bool, optional
        Whether to explain the regions beside the axes.
    labels : bool or "lines", optional
        Whether to name the lines beside them, ``"lines"`` without the orbits that cross; by default
        where there is a legend.
    title : str, optional
        Instead of the class and the numbers of the normal form.
    colors : mapping, optional
        Colours by ``"orbit"``, ``"canard"``, ``"faux canard"``, ``"F1"`` and ``"F2"``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the sliding orbits.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    DefinitionError
        ``fold`` is not a two-fold.
    OptionError
        A number of orbits below 0; a size that is not positive; axes that are none.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> figure = ns.plot.two_fold(((1, -1), (-2.0, -1.0)))
    >>> figure.axes[0].get_xlabel()
    '$z_2$'
    """
    portrait = portrait_of(fold, "two_fold")
    whole(orbits, "orbits", least=0)
    with canvas(ax, size, (7.0, 5.0), colors=colors, look=look, title=title) as page:
        axes = page.ax
        parts = sectors(portrait.flow)
        _regions(axes)
        _shade_sectors(axes, parts)
        _crossing_arrows(axes, portrait.flow)
        _diabolo(axes, portrait.flow)
        for part in parts:
            _orbits(page, part, orbits)
        _folds(page, portrait.flow)
        wide = not is_narrow(axes)
        _eigenlines(page, portrait, legend and wide)
        _names(axes, parts)
        _frame(axes, title if title is not None else title_of(portrait))
        if legend:
            _legend(axes, parts)
        if legend if labels is None else labels:
            line_names(axes, portrait, passages=wide and labels != "lines")
    return page.drawn


def _regions(ax: Axes) -> None:
    for (a, b), tint in TINTS.items():
        corners = [(0, 0), (a, 0), (a, b), (0, b)]
        ax.add_patch(Polygon(corners, facecolor=tint, edgecolor="none", zorder=0))


def _shade_sectors(ax: Axes, parts: list[Sector]) -> None:
    """Hatch the sectors whose orbits all reach s or all come from it, and their images."""
    for part in parts:
        if "s" not in (part.orbit.goes_to, part.orbit.comes_from):
            continue
        angles = [part.low, *[a for a in (math.pi / 4,) if part.low < a < part.high], part.high]
        edge = np.array([to_box(a) for a in angles])
        for sign in (1, -1):
            ax.add_patch(
                Polygon(
                    np.vstack([[0.0, 0.0], sign * edge]),
                    facecolor="none",
                    edgecolor="#9A9A9A",
                    hatch="//" if part.orbit.goes_to == "s" else "..",
                    linewidth=0.0,
                    zorder=0.5,
                )
            )


def _orbits(page: Canvas, part: Sector, count: int) -> None:
    """Draw scaled copies of a sector's orbit, evenly spaced across the flow, and their images."""
    ax = page.ax
    if part.high - part.low < 0.02 or not count:
        return
    points, middle = part.orbit.points, part.middle
    k = int(np.argmin(np.linalg.norm(points - middle, axis=1)))
    direction = points[min(k + 1, len(points) - 1)] - points[max(k - 1, 0)]
    across = abs(direction[0] * middle[1] - direction[1] * middle[0]) / np.linalg.norm(direction)
    spacing = 1.15 / max(count, 1) / max(across, 0.25)
    number = int(min(np.ceil(3.0 / spacing), 4 * count))
    for scale in spacing * (0.5 + np.arange(number)):
        for sign, usual in ((1, style.ATTRACTING), (-1, style.REPELLING)):
            line = page.look("orbit", color=usual, linewidth=0.9, zorder=2)
            curve = scale * points if sign > 0 else -scale * points[::-1]
            for piece in style.inside(curve, _WIDER_BOX):
                ax.plot(*piece.T, gid="orbit", **line)
            for piece in style.inside(curve, _BOX):
                if np.hypot(*np.diff(piece, axis=0).T).sum() > 0.16:
                    at = _fraction(piece, sign * scale * middle)
                    style.arrowhead(ax, piece, at, line["color"], mutation_scale=11, zorder=2.1)


def _fraction(piece: Array, point: Array) -> float:
    """Where along a polyline a point of it is, away from the ends."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(piece, axis=0).T))])
    k = int(np.argmin(np.linalg.norm(piece - point, axis=1)))
    return float(np.clip(length[k] / length[-1], 0.3, 0.8))


def _folds(page: Canvas, flow: ReducedFlow) -> None:
    for k, (x, y) in enumerate((([0, 0], [-1, 1]), ([-1, 1], [0, 0]))):
        visible = flow.folds[k] == "V"
        color = (style.ABOVE, style.BELOW)[k]
        dashes = "-" if visible else style.DASHED
        line = page.named(f"F{k + 1}", color=color, linewidth=2.2, linestyle=dashes, zorder=3)
        page.ax.plot(x, y, gid="fold", **line)


def _eigenlines(page: Canvas, portrait: Portrait, numbers: bool) -> None:
    ax, sliding = page.ax, eigenlines(portrait.flow)
    for value, m in sliding:
        end = to_box(math.atan(m))
        color, name, dashes = line_style(value, portrait.flow)
        name = name.removeprefix("strong ").removeprefix("weak ")
        line = page.named(name, color=color, linewidth=2.6, linestyle=dashes, zorder=4)
        ax.plot(*np.array([-end, end]).T, gid="eigenline", path_effects=style.halo(4.0), **line)
        color = line["color"]
        if abs(value) < ZERO:
            _along(ax, m, end, name, color, away=0.54)  # longer than others: off the frame
            continue
        for at in (0.62, -0.42):
            tip = at * end - np.sign(-value) * 1e-3 * end
            tail = tip + np.sign(-value) * 2e-3 * end
            style.arrow(ax, tail, tip, color, mutation_scale=16, linewidth=0, zorder=4.1)
        _along(ax, m, end, f"{name}, $\\kappa$ = {number(value)}" if numbers else name, color)
    if portrait.flow.discriminant > 0:
        for m in np.real(portrait.flow.slopes):
            if m < 0:
                end = to_box(math.atan(m))
                faint: Any = {"color": style.GREY, "linewidth": 0.9, "linestyle": ":"}
                ax.plot(*np.array([-end, end]).T, zorder=1.5, gid="virtual eigenline", **faint)


def _along(ax: Axes, m: float, end: Array, name: str, color: str, away: float = 0.62) -> None:
    """Write a name along an eigenline in Dr, on the side with more room."""
    angle = math.atan(m)
    normal = np.array([-math.sin(angle), math.cos(angle)]) * (1 if m >= 1 else -1)
    ax.annotate(
        name,
        tuple(-away * end),
        xytext=tuple(_BESIDE * normal),
        textcoords="offset points",
        ha="center",
        va="center",
        color=color,
        rotation=math.degrees(angle),
        rotation_mode="anchor",
        fontsize=style.points(9),
        zorder=6,
        path_effects=style.halo(3.0),
    )


def _crossing_arrows(ax: Axes, flow: ReducedFlow) -> None:
    """Draw orbits that pass through the surface: in along one field, out along the other."""
    (s1, s2), (n1, n2) = flow.sigma, flow.nu
    above, below = np.array([-s1, n1], float), np.array([n2, s2], float)
    above, below = above / np.linalg.norm(above), below / np.linalg.norm(below)
    for point in _CROSSINGS:
        for sign in (1, -1):  # C1: from below to above; C2: from above to below
            z = sign * np.array(point)
            arriving, leaving = (below, above) if sign > 0 else (above, below)
            colors = (style.BELOW, style.ABOVE) if sign > 0 else (style.ABOVE, style.BELOW)
            before, after = z - 0.13 * arriving, z + 0.15 * leaving
            dashes = ("--", "-") if sign > 0 else ("-", "--")
            for k, part in enumerate(((before, z), (z, after))):
                look: Any = {"color": colors[k], "linestyle": dashes[k], "linewidth": 1.2}
                gid = f"crosses {k}" if sign > 0 else None
                ax.plot(*np.array(part).T, zorder=1.8, gid=gid, **look)
            style.arrow(ax, after - 1e-3 * leaving, after, colors[1], linewidth=0, zorder=1.9)
            ring: Any = {
                "markerfacecolor": "white",
                "markeredgecolor": style.BLACK,
                "markersize": 6,
            }
            ax.plot(*z, marker="o", markeredgewidth=0.8, zorder=1.95, **ring)
            inner: Any = {"color": style.BLACK, "markeredgewidth": 0.8, "markersize": 3.4}
            ax.plot(*z, marker="." if sign > 0 else "x", zorder=1.96, **inner)


def _diabolo(ax: Axes, flow: ReducedFlow) -> None:
    """Draw the invariant lines of the return map of an invisible two-fold."""
    if not has_diabolo(flow):
        return
    looks = ((style.FAUX_CANARD, style.DOTS), (style.CANARD, style.DASH_DOT))
    for k, (slope, (color, dashes)) in enumerate(zip(diabolo_slopes(flow.nu), looks, strict=True)):
        start = np.array([-1.0, slope])
        for z in (start, flight_above(start, flow.nu)):
            end = z / np.max(np.abs(z))
            ax.plot(
                [0, end[0]],
                [0, end[1]],
                color=color,
                linewidth=1.3,
                linestyle=dashes,
                zorder=1.7,
                gid=f"diabolo {k}",
            )


def _names(ax: Axes, parts: list[Sector]) -> None:
    box = {"boxstyle": "round,pad=0.18", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    for name, point in label_points(parts).items():
        style.write(ax, point, name, fontsize=style.points(14), zorder=7, bbox=box)
    ax.plot(0, 0, "o", color=style.BLACK, markersize=5, zorder=8)
    ax.annotate(
        "$s$",
        (0, 0),
        xytext=(7, -12),
        textcoords="offset points",
        fontsize=style.points(12),
        zorder=8,
        path_effects=style.halo(3.0),
    )


def _frame(ax: Axes, title: str) -> None:
    ax.set(xlim=_BOX[:2], ylim=_BOX[2:], xlabel="$z_2$", ylabel="$z_3$", title=title)
    ax.set_aspect("equal")
    ax.set_xticks([-1, -0.5, 0, 0.5, 1])
    ax.set_yticks([-1, -0.5, 0, 0.5, 1])


def _legend(ax: Axes, parts: list[Sector]) -> None:
    handles: list[Line2D | Patch] = [
        Patch(facecolor=style.TINT_ATTRACTING, label="$D_a$: attracting sliding"),
        Patch(facecolor=style.TINT_REPELLING, label="$D_r$: repelling sliding"),
        _circle(".", "$C_1$: crossing up"),
        _circle("x", "$C_2$: crossing down"),
    ]
    if any(part.orbit.goes_to == "s" for part in parts):
        text = "hatched: all $D_a \\to s \\to D_r$"
        handles.append(Patch(facecolor="white", edgecolor="#9A9A9A", hatch="////", label=text))
    if any(part.orbit.comes_from == "s" for part in parts):
        text = "dotted: all $D_r \\to s \\to D_a$"
        handles.append(Patch(facecolor="white", edgecolor="#9A9A9A", hatch="...", label=text))
    beside(ax, handles)


def _circle(inner: str, text: str) -> Line2D:
    marker = r"$\odot$" if inner == "." else r"$\otimes$"
    return Line2D(
        [],
        [],
        linestyle="none",
        marker=marker,
        markersize=9,
        markeredgewidth=0.4,
        color="black",
        label=text,
    )
