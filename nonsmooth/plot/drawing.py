"""The canvas of a drawing function: axes in the user's style, known to pyplot unless they are given."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from weakref import WeakKeyDictionary, WeakSet

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cbook import normalize_kwargs
from matplotlib.collections import Collection
from matplotlib.colors import ListedColormap, is_color_like, to_rgba
from matplotlib.figure import FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.spines import Spine
from matplotlib.text import Text

from ..model import OptionError
from . import style

#: What a drawing function returns: its new figure, or the axes or the figure that it was given.
Drawn = Any
#: Colours by the names of what is drawn.
Colors = Mapping[str, Any] | None

_PALETTE = "nonsmooth"  # name of the colour maps of regions
_ADAPTED: WeakSet[Artist] = WeakSet()  # in axes that were drawn on their own before their figure
_DARK = 0.5  # luminance of a background below which lightness is inverted


class Canvas:
    """Axes to draw on, and the colours and line styles of the user."""

    def __init__(self, place: Any, drawn: Drawn, colors: Colors, look: dict[str, Any]):
        self.figure: Any = place.get_figure(root=True) if isinstance(place, Axes) else place
        self.ax: Any = place
        self.drawn = drawn
        face = style.paper_of(place)
        self.dark = style.luminance(face) < _DARK
        self.paper = face
        label = place.xaxis.label.get_color() if isinstance(place, Axes) else None
        self.ink = to_rgba(label or mpl.rcParams["axes.labelcolor"])
        self.colors = _checked(colors)
        self.own = _checked_look(look)
        self.stroke = mpl.rcParams["lines.linewidth"] / mpl.rcParamsDefault["lines.linewidth"]

    def panels(self, rows: int, columns: int) -> list[Canvas]:
        """Return canvases of new axes in the figure.

        Parameters
        ----------
        rows, columns : int
            Of panels.

        Returns
        -------
        list of Canvas
            Row by row.
        """
        axes = self.figure.subplots(rows, columns, squeeze=False).ravel()
        return [Canvas(ax, self.drawn, self.colors, self.own) for ax in axes]

    def color(self, name: str, default: Any) -> Any:
        """Return the user's colour of a thing, or the default; for areas and marks.

        Parameters
        ----------
        name : str
            A key of ``colors=``.
        default : optional
            A colour, for white paper.

        Returns
        -------
        color
            For matplotlib.
        """
        return self._theirs(self.colors[name]) if name in self.colors else default

    def named(self, name: str, **default: Any) -> dict[str, Any]:
        """Return properties of a line: the defaults and the user's colour for its name.

        Parameters
        ----------
        name : str
            A key of ``colors=``.
        **default
            Properties of ``matplotlib.lines.Line2D``, for white paper.

        Returns
        -------
        dict
            For ``Axes.plot``.
        """
        line: Any = normalize_kwargs(default, Line2D)
        if "linewidth" in line:
            line["linewidth"] *= self.stroke
        if name in self.colors:
            line["color"] = self._theirs(self.colors[name])
        return line

    def look(self, name: str, **default: Any) -> dict[str, Any]:
        """Return properties of a main line of the picture: those of :meth:`named`, then the user's.

        Parameters
        ----------
        name : str
            A key of ``colors=``.
        **default
            Properties of ``matplotlib.lines.Line2D``, for white paper.

        Returns
        -------
        dict
            For ``Axes.plot``.
        """
        line = self.named(name, **default)
        for key, value in self.own.items():
            line[key] = self._theirs(value) if "color" in key else value
        return line

    def _theirs(self, color: Any) -> Any:
        """A colour that :meth:`_adapt` turns into the user's."""
        return _inverted(to_rgba(color)) if self.dark and color is not None else color

    def palette(self, colors: Iterable[Any]) -> ListedColormap:
        """Return colours of regions for ``cmap=``, which follow the background.

        Parameters
        ----------
        colors : iterable
            For white paper.

        Returns
        -------
        matplotlib ListedColormap
            One colour for each.
        """
        return _palette(colors)

    def _adapt(self, artists: set[Artist]) -> None:
        """Draw artists for the background: white becomes the background, dark and light change places."""
        if not self.dark and self.paper[:3] == (1.0, 1.0, 1.0):
            return
        for artist in artists - set(_ADAPTED):
            _recolor(artist, self.on_paper)
            _ADAPTED.add(artist)

    def on_paper(self, color: Any) -> Any:
        """Return a colour that is meant for white paper, on the background there is.

        Parameters
        ----------
        color : optional
            Any colour that matplotlib knows.

        Returns
        -------
        (float, float, float, float)
            Red, green, blue and opacity.
        """
        rgba = to_rgba(color)
        white, black = rgba[:3] == (1.0, 1.0, 1.0), rgba[:3] == (0.0, 0.0, 0.0)
        if white:
            return (*self.paper[:3], rgba[3])
        if not self.dark:
            return rgba
        return (*self.ink[:3], rgba[3]) if black else _inverted(rgba)


@contextmanager
def canvas(
    place: Axes | FigureBase | None,
    size: tuple[float, float] | None,
    usual: tuple[float, float],
    *,
    colors: Colors = None,
    look: dict[str, Any] | None = None,
    title: str | None = None,
    projection: str | None = None,
    panels: bool = False,
) -> Iterator[Canvas]:
    """Draw in the user's style on given axes (or a given figure, for ``panels``), or in a new figure.

    Parameters
    ----------
    place : matplotlib Axes or Figure, optional
        Where to draw; a new figure that pyplot knows without it.
    size : (float, float), optional
        Inches, of a new figure; by default ``rcParams["figure.figsize"]`` if the user has set it.
    usual : (float, float)
        Inches, if the user has set none.
    colors : mapping, optional
        The user's colours by name.
    look : dict, optional
        The user's properties of lines.
    title : str, optional
        Title of the axes.
    projection : str, optional
        Of new axes.
    panels : bool, optional
        Whether the drawing function makes its axes itself.

    Yields
    ------
    Canvas
        With ``figure``, ``ax``, and ``drawn``, which the drawing function returns.

    Raises
    ------
    OptionError
        ``place`` is not axes (a figure), or a size, colour or property that matplotlib does not know.
    """
    if place is not None:
        _require(place, FigureBase if panels else Axes)
    usual = tuple(mpl.rcParams["figure.figsize"]) if style.chosen("figure.figsize") else usual
    number = None
    with style.settings():
        drawn = place
        if place is None:
            drawn = _figure(usual if size is None else size)
            number = drawn.number
            place = drawn if panels else drawn.add_subplot(projection=projection)
        try:
            page = Canvas(place, drawn, colors, look or {})
            before = set(_artists(page.figure))
            with mpl.rc_context({"text.color": "black"} if page.dark else {}):
                yield page
            page._adapt(set(_artists(page.figure)) - before)
            if title is not None:
                page.ax.set_title(title)
        except BaseException:
            _close(number)
            raise


def _figure(size: object) -> Any:
    """A new figure that pyplot knows."""
    from matplotlib import pyplot

    inches = style.check_size(size)
    return pyplot.figure(FigureClass=style.PrintFigure, figsize=inches, layout="constrained")


def _close(number: int | None) -> None:
    if number is not None:
        from matplotlib import pyplot

        pyplot.close(number)


def _require(place: Any, kind: type) -> None:
    name, example = (
        ("ax", "pyplot.subplots()[1]") if kind is Axes else ("figure", "pyplot.figure()")
    )
    if not isinstance(place, kind):
        what = "axes" if kind is Axes else "a figure"
        raise OptionError(
            f"{name} is a {type(place).__name__}, not matplotlib {what}. For example {name}={example}."
        )


def _checked(colors: Colors) -> Mapping[str, Any]:
    if colors is not None and not isinstance(colors, Mapping):
        raise OptionError(
            f"colors={colors!r} is not a mapping of names to colours, such as {{'+': 'tab:red'}}."
        )
    for name, color in (colors or {}).items():
        if not is_color_like(color):
            raise OptionError(f"colors[{name!r}] is {color!r}, which matplotlib does not know.")
    return colors or {}


def _checked_look(look: dict[str, Any]) -> dict[str, Any]:
    own: dict[str, Any] = normalize_kwargs(look, Line2D)
    unknown = [name for name in own if not hasattr(Line2D, f"set_{name}")]
    if unknown:
        raise TypeError(
            f"unexpected keyword argument {unknown[0]!r}: neither an option of this function nor a "
            "property of matplotlib.lines.Line2D."
        )
    return own


#: Entries and position of the legends of axes on which several pictures are drawn.
_KEYS: WeakKeyDictionary[Axes, tuple[dict[str, Any], dict[str, Any]]] = WeakKeyDictionary()


def key(ax: Axes, handles: list[Any], **options: Any) -> None:
    """Draw the legend of axes; entries and position of an earlier one that this function drew stay."""
    if ax not in _KEYS or ax.get_legend() is None:
        _KEYS[ax] = {}, {"loc": "best", **options}
    entries, place = _KEYS[ax]
    entries |= {handle.get_label(): handle for handle in handles}
    if entries:
        ax.legend(list(entries.values()), list(entries), **place)


def _palette(colors: Iterable[Any]) -> ListedColormap:
    return ListedColormap([to_rgba(color) for color in colors], name=_PALETTE)


# Colours on a background ----------------------------------------------------------------------------


def _artists(artist: Artist) -> Iterator[Artist]:
    """All artists below one, without those that have their colours from ``rcParams``."""
    own = [getattr(artist, name, None) for name in ("patch", "legendPatch")]
    for child in artist.get_children():
        if isinstance(child, (Axis, Spine)) or any(child is one for one in own):
            continue
        yield child
        yield from _artists(child)


def _inverted(rgba: Any) -> Any:
    """The colour of the same hue and chroma with the lightness inverted (in HLS); its own inverse."""
    r, g, b, alpha = rgba
    shift = 1.0 - (max(r, g, b) + min(r, g, b))
    return (*(min(max(c + shift, 0.0), 1.0) for c in (r, g, b)), alpha)


def _recolor(artist: Any, on_paper: Any) -> None:
    """Change every colour of an artist."""
    if isinstance(artist, Line2D):
        _each(artist, ("color", "markerfacecolor", "markeredgecolor"), on_paper)
    elif isinstance(artist, Text):
        _each(artist, ("color",), on_paper)
        for patch in (artist.get_bbox_patch(), getattr(artist, "arrow_patch", None)):
            if patch is not None:
                _recolor(patch, on_paper)
    elif isinstance(artist, Patch):
        _each(artist, ("edgecolor", "facecolor"), on_paper)
    elif isinstance(artist, Collection):
        mapped = artist.get_array() is not None
        if mapped and artist.get_cmap().name == _PALETTE:
            colors: Any = artist.get_cmap()
            artist.set_cmap(_palette(on_paper(color) for color in colors.colors))
        for name in ("edgecolor",) if mapped else ("facecolor", "edgecolor"):
            several = getattr(artist, f"get_{name}")()
            if len(several):
                getattr(artist, f"set_{name}")([on_paper(color) for color in several])
    halo = artist.get_path_effects()
    if isinstance(halo, style.Halo):
        artist.set_path_effects(style.halo(halo.width, on_paper("white")))


def _each(artist: Any, names: tuple[str, ...], on_paper: Any) -> None:
    colors = [getattr(artist, f"get_{name}")() for name in names]  # some follow others
    for name, color in zip(names, colors, strict=True):
        if is_color_like(color) and to_rgba(color)[3] > 0.0:
            getattr(artist, f"set_{name}")(on_paper(color))
