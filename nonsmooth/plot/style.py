"""Style of every picture: colours that colour-blind readers tell apart, lines that print in grey.

Use it for your own pictures. The palette is that of Okabe & Ito 2008:
``BLACK``, ``ORANGE``, ``SKY``, ``GREEN``, ``YELLOW``, ``BLUE``, ``VERMILLION``, ``PURPLE``, ``GREY``.
By meaning: ``ABOVE`` and ``BELOW`` for the fields F1 and F2 (``FIELDS`` has them by the letter
of the side), ``ATTRACTING`` and ``REPELLING`` for sliding orbits, ``TINT_ATTRACTING``,
``TINT_REPELLING`` and ``TINT_CROSSING`` for regions, ``CANARD`` and ``FAUX_CANARD``. Dashes:
``DASHED`` (invisible folds), ``LONG_DASH``, ``DASH_DOT``, ``DOTS``. ``CLOUD``: points of long runs.

Pictures are built inside ``settings()``, which fills in what your ``rcParams`` leave at matplotlib's
defaults and restores them afterwards. On a dark background lightness is inverted and hues stay.

Examples
--------
>>> import nonsmooth as ns
>>> with ns.plot.style.settings():
...     figure = ns.plot.style.new_figure((4, 3))
...     line, = figure.add_subplot().plot([0, 1], [0, 1], color=ns.plot.style.ABOVE)
>>> line.get_color()
'#D55E00'
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import matplotlib.patheffects as effects
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from numpy.typing import ArrayLike

from ..model import Array, OptionError

BLACK = "#000000"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
YELLOW = "#F0E442"
BLUE = "#0072B2"
VERMILLION = "#D55E00"
PURPLE = "#CC79A7"
GREY = "#7F7F7F"

#: The two fields: F1 (h > 0) and F2 (h < 0). F2 is also drawn dashed where the two meet.
ABOVE, BELOW = VERMILLION, BLUE
FIELDS = {"+": ABOVE, "-": BELOW}
#: Sliding orbits in the attracting and the repelling region.
ATTRACTING, REPELLING = "#1A1A1A", "#8A5A00"
#: Tints of the regions; their greys differ too (0.91, 0.81, 0.97).
TINT_ATTRACTING, TINT_REPELLING, TINT_CROSSING = "#DCEBF5", "#EFCB8C", "#F7F7F7"
CANARD, FAUX_CANARD = "#A8005C", GREEN

DASHED: Any = (0, (5, 2.5))
DASH_DOT: Any = (0, (4, 1.5, 1, 1.5))
DOTS: Any = (0, (1.2, 1.6))
LONG_DASH: Any = (0, (6, 1.4))
#: Points of long runs: as large on paper as on a screen, where "," is a pixel of either.
CLOUD: Any = dict(color="0.35", linestyle="none", marker=".", markersize=1.3, mew=0.0, zorder=0)

_SIZE = 9.0  # points, of a font where the user has not chosen another
_SMALLEST = 8.0  # points, of text in print
_SETTINGS: Any = {
    "font.size": _SIZE,
    "axes.edgecolor": "#333333",
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "legend.handlelength": 2.6,  # room for two dashes
    "lines.solid_capstyle": "round",
    "xtick.direction": "in",
    "ytick.direction": "in",
}
#: Points at a font size of _SIZE.
_TEXTS = {
    "axes.titlesize": 10.0,
    "figure.titlesize": 10.0,
    "axes.labelsize": 11.0,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
}


def chosen(name: Any) -> bool:
    """Return whether the user has changed a setting of matplotlib.

    Parameters
    ----------
    name : str
        Key of ``rcParams``.
    """
    return bool(mpl.rcParams[name] != mpl.rcParamsDefault[name])


def points(size: float) -> float:
    """Return a font size that follows ``rcParams["font.size"]``.

    Parameters
    ----------
    size : float
        Points, where ``rcParams["font.size"]`` is 9.

    Returns
    -------
    float
        Points.
    """
    base = float(mpl.rcParams["font.size"])
    return max(size * base / _SIZE, min(base, _SMALLEST))


@contextmanager
def settings(changes: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Fill in the look inside a ``with`` block where the user has chosen no other.

    Parameters
    ----------
    changes : mapping, optional
        Names and values of matplotlib's ``rcParams`` that are to differ.

    Examples
    --------
    >>> import matplotlib
    >>> before = matplotlib.rcParams["font.size"]
    >>> with settings():
    ...     pass
    >>> matplotlib.rcParams["font.size"] == before
    True
    """
    look: Any = {name: value for name, value in _SETTINGS.items() if not chosen(name)}
    look |= changes or {}
    with mpl.rc_context(look):
        texts: Any = {name: points(size) for name, size in _TEXTS.items() if not chosen(name)}
        mpl.rcParams.update(texts)
        yield


def check_size(size: object) -> tuple[float, float]:
    """Return (width, height) in inches.

    Parameters
    ----------
    size : (float, float)
        Width and height in inches.

    Returns
    -------
    (float, float)
        Width and height, as numbers.

    Raises
    ------
    OptionError
        Not two positive numbers.

    Examples
    --------
    >>> check_size((6, 4))
    (6.0, 4.0)
    """
    try:
        width, height = (float(v) for v in size)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        width = height = float("nan")
    if not (0 < width < np.inf and 0 < height < np.inf):
        raise OptionError(f"size={size!r} is not a width and a height in inches, such as (6, 5).")
    return width, height


#: TrueType fonts, which publishers take and whose text can be searched and edited; Type 3 otherwise.
_FONTS: Any = {"pdf.fonttype": 42, "ps.fonttype": 42}
_LAYOUTS = 5  # at most: three do so far


class PrintFigure(Figure):
    """A figure that saves TrueType fonts into PDF and PostScript, and settles its layout before that."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save the figure.

        Parameters
        ----------
        fname : path or file
            Where to.
        **options
            Of ``matplotlib.figure.Figure.savefig``.
        """
        with mpl.rc_context(_FONTS):
            self._settle()
            super().savefig(fname, **options)

    def _ipython_display_(self) -> None:
        """Leave it to pyplot to show the figure in a notebook, which would show it twice otherwise."""
        pyplot: Any = sys.modules.get("matplotlib.pyplot")
        shows = pyplot is not None and "inline" in str(mpl.get_backend())
        if not (shows and getattr(self, "number", None) in pyplot.get_fignums()):
            raise NotImplementedError  # then the figure is shown as any other

    def _settle(self) -> None:
        """Lay out until nothing moves, as heights of titles and square axes depend on the drawing."""
        before = list[tuple[int, ...]]()
        for _ in range(_LAYOUTS):
            self.draw_without_rendering()
            after = [tuple(map(round, map(float, axes.bbox.bounds))) for axes in self.axes]
            if after == before:
                return
            before = after


def new_figure(size: object) -> Figure:
    """Return an empty figure that pyplot does not keep, with TrueType fonts in its PDF files.

    Parameters
    ----------
    size : (float, float)
        Width and height in inches.

    Returns
    -------
    matplotlib Figure
        An empty figure.

    Raises
    ------
    OptionError
        Not two positive numbers.

    Examples
    --------
    >>> new_figure((6, 4)).get_size_inches()
    array([6., 4.])
    """
    return PrintFigure(figsize=check_size(size), layout="constrained")


def paper_of(place: Any) -> tuple[float, float, float, float]:
    """Return the colour behind axes or a figure.

    Parameters
    ----------
    place : matplotlib Axes or Figure
        Where.

    Returns
    -------
    (float, float, float, float)
        Red, green, blue and opacity.
    """
    own = to_rgba(place.get_facecolor())
    if own[3] == 1.0 or not isinstance(place, Axes):
        return own if own[3] else (1.0, 1.0, 1.0, 1.0)
    return paper_of(place.get_figure(root=True))


def luminance(color: Any) -> float:
    """Return the relative luminance (WCAG 2.1) of a colour.

    Parameters
    ----------
    color : optional
        Any colour that matplotlib knows.

    Returns
    -------
    float
        From 0, black, to 1, white.
    """
    parts = np.array(to_rgba(color)[:3])
    linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


class Halo(list[Any]):
    """Path effects of a halo, with what it takes to make them in another colour.

    Parameters
    ----------
    width : float
        In points.
    color : optional
        Any colour that matplotlib knows.
    """

    def __init__(self, width: float, color: Any):
        whole: Any = {"dash_offset": 0, "dash_list": None}  # nothing shows through gaps of dashes
        stroke = effects.Stroke(linewidth=width, foreground=color, dashes=whole)
        super().__init__([stroke, effects.Normal()])
        self.width = width


def halo(width: float = 2.5, color: Any = "white") -> list[Any]:
    """Return path effects that keep a line or a text legible on top of others.

    Parameters
    ----------
    width : float, optional
        In points.
    color : str, optional
        Any colour that matplotlib knows.

    Returns
    -------
    list
        For ``path_effects=``.
    """
    return Halo(width, color)


def arrow(ax: Axes, start: ArrayLike, end: ArrayLike, color: str = BLACK, **options: Any) -> None:
    """Draw a straight arrow between two points, clipped to the axes.

    Parameters
    ----------
    ax : matplotlib Axes
        Axes to draw into.
    start, end : array_like (2,)
        In data coordinates.
    color : str, optional
        Any colour that matplotlib knows.
    **options
        Of ``matplotlib.patches.FancyArrowPatch``.
    """
    options = {"arrowstyle": "-|>", "mutation_scale": 11, "linewidth": 1.0, **options}
    ends = [tuple(np.asarray(point, float)) for point in (start, end)]
    patch = FancyArrowPatch(*ends, shrinkA=0, shrinkB=0, color=color, **options)
    patch.set_clip_on(True)
    ax.add_patch(patch)


def write(ax: Axes, place: ArrayLike, text: str, **options: Any) -> None:
    """Write a text centred on a point.

    Parameters
    ----------
    ax : matplotlib Axes
        Axes to draw into.
    place : array_like (2,)
        In data coordinates.
    text : str
        What is written.
    **options
        Of ``Axes.text``.
    """
    x, y = np.asarray(place, dtype=float)
    ax.text(x, y, text, **{"ha": "center", "va": "center", **options})


def arrowhead(
    ax: Axes,
    curve: ArrayLike,
    at: float,
    color: str,
    *,
    scale: ArrayLike = (1.0, 1.0),
    **options: Any,
) -> None:
    """Put an arrowhead on a polyline at a fraction of its length, along its direction.

    Parameters
    ----------
    ax : matplotlib Axes
        Axes to draw into.
    curve : array_like (m, 2)
        In data coordinates.
    at : float
        From 0 at the start to 1 at the end.
    color : str
        Any colour that matplotlib knows.
    scale : array_like (2,), optional
        Units of the two coordinates in which the length is measured; where the axes have very
        different ones, the widths of what is shown.
    **options
        Of :func:`arrow`.
    """
    points = np.asarray(curve, dtype=float)
    steps = np.hypot(*(np.diff(points, axis=0) / np.asarray(scale, dtype=float)).T)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    if not length[-1] > 0:
        return
    tip = np.array([np.interp(at * length[-1], length, c) for c in points.T])
    back = max(at * length[-1] - 1e-3 * length[-1], 0.0)
    tail = np.array([np.interp(back, length, c) for c in points.T])
    if np.all(tail == tip):
        tail = 2 * points[0] - points[1]
    arrow(ax, tail, tip, color, **{"linewidth": 0.0, **options})


def inside(curve: ArrayLike, box: tuple[float, float, float, float]) -> list[Array]:
    """Return the pieces of a polyline with all points in a box.

    Parameters
    ----------
    curve : array_like (m, 2)
        Points along the curve; NaN separates its parts.
    box : (float, float, float, float)
        xmin, xmax, ymin, ymax.

    Returns
    -------
    list of ndarray (k, 2)
        The pieces, in the order of the curve.

    Examples
    --------
    >>> [piece.tolist() for piece in inside([[0, 0], [2, 0], [0.5, 0], [0, 1]], (0, 1, 0, 1))]
    [[[0.0, 0.0]], [[0.5, 0.0], [0.0, 1.0]]]
    """
    points = np.asarray(curve, dtype=float)
    x, y = points.T
    good = (box[0] <= x) & (x <= box[1]) & (box[2] <= y) & (y <= box[3])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]])))
    return [points[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True)]


def line(
    color: str,
    label: str,
    width: float = 1.4,
    dashes: Any = "-",
    alpha: float | None = None,
) -> Line2D:
    """Return an entry of a legend: a line.

    Parameters
    ----------
    color, label : str
        Colour, and text of its entry in the legend.
    width : float, optional
        In points.
    dashes : optional
        A line style of matplotlib.
    alpha : float, optional
        Opacity, between 0 and 1.

    Returns
    -------
    matplotlib Line2D
        For ``handles=`` of a legend.
    """
    return Line2D([], [], color=color, linewidth=width, linestyle=dashes, label=label, alpha=alpha)


def marker(shape: str, label: str, fill: str = BLACK, size: float = 6.0, **options: Any) -> Line2D:
    """Return an entry of a legend: a marker with a black edge.

    Parameters
    ----------
    shape : str
        A marker of matplotlib.
    label : str
        Text of its entry in the legend.
    fill : str, optional
        Colour inside.
    size : float, optional
        In points.
    **options
        Of ``matplotlib.lines.Line2D``.

    Returns
    -------
    matplotlib Line2D
        For ``handles=`` of a legend.
    """
    look = {"markeredgecolor": BLACK, "markerfacecolor": fill, "markersize": size, **options}
    return Line2D([], [], linestyle="none", marker=shape, label=label, **look)
