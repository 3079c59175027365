"""Map of the classes of one kind of two-fold over (nu1, nu2), with every boundary."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from ...model import Array, OptionError
from .. import style
from ..drawing import Canvas, Colors, Drawn, canvas, key

#: Signs of L11 and L22 by the kind of the folds.
SIGMA: dict[str, tuple[int, int]] = {"VV": (1, -1), "II": (-1, 1), "VI": (1, 1), "IV": (-1, -1)}
_TITLES = {
    "VV": "visible (VV)",
    "II": "invisible (II)",
    "VI": "visible-invisible (VI)",
    "IV": "invisible-visible (IV)",
}
#: Tint and hatch of each class: pink for canards, green for faux canards, blue for one of each, grey
#: for none; stronger and hatched for infinitely many, which shows in grey print too.
FILLS = {
    "VV-C1": ("#F9E6EF", ""),
    "VV-F": ("#B7E0D0", ".."),
    "II-C": ("#F0C9DF", "//"),
    "II-F": ("#E4F3EC", ""),
    "mix-0": ("#F4F4F4", ""),
    "mix-S": ("#DCEBF5", ""),
    "mix-C": ("#F0C9DF", "//"),
    "mix-F": ("#B7E0D0", ".."),
}
_NAMES = {
    "VV": {"VV-C1": (-1.8, -1.6), "VV-F": (1.9, 1.7)},
    "II": {"II-C": (-2.15, -2.2), "II-F": (1.3, -1.4)},
    "VI": {
        "mix-0": (1.7, 1.5),
        "mix-S": (-2.1, 2.1),
        "mix-C": (-2.48, 0.17),
        "mix-F": (0.18, 2.72),
    },
    "IV": {
        "mix-0": (1.5, 1.7),
        "mix-S": (2.1, -2.1),
        "mix-C": (-0.06, -2.76),
        "mix-F": (2.57, -0.16),
    },
}
#: Of the maps: nu1 and nu2 from -REACH to REACH.
REACH = 3.0
_FLIGHTS = (3, 4, 5, 6, 8)  # n of the curves nu1 nu2 = cos^2(pi/n) that are drawn


def two_fold_map(
    kind: str,
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw the classes of one kind of two-fold over the $(nu1, nu2)$ plane, with every boundary.

    Parameters
    ----------
    kind : {"VV", "II", "VI", "IV"}
        V for visible, I for invisible; the fold of $F1$ first.
    ax : matplotlib Axes, optional
        Axes to draw into; default a new figure.
    size : (float, float), optional
        Inches, of a new figure.
    legend : bool, optional
        Whether a legend is drawn.
    colors : mapping, optional
        Colours by the names of the classes.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the boundaries.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    OptionError
        An unknown kind.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> ns.plot.two_fold_map("II").axes[0].get_xlabel()
    '$\\\\nu_1$'
    """
    if kind not in SIGMA:
        raise OptionError(f"kind={kind!r} is not one of {list(SIGMA)}.")
    with canvas(ax, size, (4.8, 6.2), colors=colors, look=look, title=_TITLES[kind]) as page:
        axes = page.ax
        _fill(page, kind)
        handles = _boundaries(page, kind)
        for name, point in label_points(kind).items():
            box = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none"}
            size_ = 8 if name in ("mix-C", "mix-F") else 9  # whose areas are small
            style.write(
                axes,
                point,
                name,
                fontsize=style.points(size_),
                bbox=box | {"alpha": 0.85},
                zorder=6,
            )
        for x, y in (([-REACH, REACH], [0, 0]), ([0, 0], [-REACH, REACH])):
            axes.plot(x, y, color=style.GREY, linewidth=0.5, zorder=1)
        axes.set(
            xlim=(-REACH, REACH),
            ylim=(-REACH, REACH),
            xlabel=r"$\nu_1$",
            ylabel=r"$\nu_2$",
        )
        axes.set_aspect("equal")
        if legend:
            key(axes, handles, loc="upper center", bbox_to_anchor=(0.5, -0.13))
    return page.drawn


def label_points(kind: str) -> dict[str, tuple[float, float]]:
    """Points of the names of the classes in the map of a kind."""
    return _NAMES[kind]


def areas(kind: str) -> list[tuple[str, Array]]:
    """Classes of a kind and the polygons (m, 2) they fill in the map; later ones lie on top."""
    r = REACH
    box = np.array([[-r, -r], [r, -r], [r, r], [-r, r]])
    if kind in ("VV", "II"):
        side = 1 if kind == "VV" else -1
        corner = np.vstack([_hyperbola(1.0, side), [[side * r, side * r]]])
        return (
            [("VV-C1", box), ("VV-F", corner)]
            if kind == "VV"
            else [("II-F", box), ("II-C", corner)]
        )
    curve = _hyperbola(-1.0, -1)[::-1]  # touches nu2 = nu1 + 2 at (-1, 1)
    left, right = curve[curve[:, 0] <= -1.0], curve[curve[:, 0] >= -1.0]
    found = {
        "mix-0": box,
        "mix-S": np.vstack([curve, [[-r, r]]]),
        "mix-C": np.vstack([left, [[-1.0, 1.0], [-r, 2.0 - r]]]),
        "mix-F": np.vstack([[[-1.0, 1.0]], right, [[r - 2.0, r]]]),
    }
    step = 1 if kind == "VI" else -1  # IV: the other side up, (nu1, nu2) -> (nu2, nu1)
    return [(label, polygon[:, ::step]) for label, polygon in found.items()]


def _fill(page: Canvas, kind: str) -> None:
    """Tint each class."""
    for label, polygon in areas(kind):
        tint, hatch = FILLS[label]
        look: Any = {"edgecolor": "#6A6A6A", "hatch": hatch, "linewidth": 0, "zorder": 0}
        page.ax.add_patch(Polygon(polygon, facecolor=page.color(label, tint), **look))


def _hyperbola(product: float, branch: int) -> Array:
    """Branch nu1 > 0 or nu1 < 0 of nu1 nu2 = product, within reach; (m, 2)."""
    low = abs(product) / REACH
    x = branch * np.geomspace(max(low, 1e-3), REACH, 200)
    return np.column_stack([x, product / x])


def _boundaries(page: Canvas, kind: str) -> list[Line2D]:
    if kind in ("VV", "II"):
        return _hyperbolas(page, kind)
    return _mixed_boundaries(page, kind)


def _hyperbolas(page: Canvas, kind: str) -> list[Line2D]:
    decisive = 1 if kind == "VV" else -1
    rest = r"$\nu_1\nu_2=1$ ($\Delta=0$): pseudo-equilibria"
    same = r"$\Delta=0$, same class; coincident fields"
    handles = [
        _stroke(page, _hyperbola(1.0, decisive), style.BLACK, 2.2, "-", rest),
        _stroke(page, _hyperbola(1.0, -decisive), style.BLACK, 1.4, (0, (5, 2)), same),
    ]
    if kind == "II":
        for k, n in enumerate(_FLIGHTS):
            curve = _hyperbola(math.cos(math.pi / n) ** 2, -1)
            text = r"$\nu_1\nu_2=\cos^2(\pi/n)$: $n-1$ | $n$ flights"
            handle = _stroke(page, curve, style.BLUE, 0.9, "-", text)
            handles += [handle] if k == 0 else []
            at = curve[np.argmin(np.abs(curve[:, 0] - curve[:, 1] - (0.9 - 0.45 * k)))]
            style.write(
                page.ax,
                at,
                f"{n}",
                fontsize=style.points(8),
                color=style.BLUE,
                zorder=3,
                path_effects=style.halo(2.5),
            )
        for line in ([[0, -REACH], [0, REACH]], [[-REACH, 0], [REACH, 0]]):
            handle = _stroke(
                page, np.array(line), style.VERMILLION, 1.2, ":", r"$\nu_i=0$: itinerary changes"
            )
        handles.append(handle)
    return handles


def _mixed_boundaries(page: Canvas, kind: str) -> list[Line2D]:
    swap = -1 if kind == "IV" else 1  # (nu1, nu2) -> (nu2, nu1)
    line = np.linspace(-REACH, REACH, 3)
    jordan = np.column_stack([line, line + 2.0])[:, ::swap]
    outside = np.column_stack([line, line - 2.0])[:, ::swap]
    rank = _hyperbola(-1.0, -1 if kind == "VI" else 1)
    harmless = _hyperbola(-1.0, 1 if kind == "VI" else -1)
    itinerary = np.column_stack([line, 0 * line])[:, ::swap]
    name = r"\nu_2-\nu_1" if kind == "VI" else r"\nu_1-\nu_2"
    fold = 2 if kind == "VI" else 1
    same = r"$\Delta=0$, same class; coincident fields"
    return [
        _stroke(page, jordan, style.BLACK, 2.2, "-", f"${name}=2$ (disc = 0)"),
        _stroke(page, rank, style.CANARD, 2.2, "-.", r"$\nu_1\nu_2=-1$ ($\Delta=0$)"),
        _stroke(page, outside, style.BLACK, 1.2, (0, (5, 2)), f"${name}=-2$, same class"),
        _stroke(page, harmless, style.CANARD, 1.2, (0, (5, 2)), same),
        _stroke(page, itinerary, style.VERMILLION, 1.2, ":", rf"$\nu_{fold}=0$: itinerary changes"),
    ]


def _stroke(page: Canvas, curve: Array, color: str, width: float, dashes: Any, text: str) -> Line2D:
    look = page.look("boundary", color=color, linewidth=width, linestyle=dashes, zorder=2)
    page.ax.plot(*curve.T, label=text, gid="boundary", **look)
    return Line2D([], [], label=text, **look)
