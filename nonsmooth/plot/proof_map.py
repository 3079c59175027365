"""Map of what is proven over ranges of parameters."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from ..model import OptionError
from . import style
from .basin_map import COLORS
from .drawing import Colors, Drawn, canvas, key

#: Pieces where only existence is proven, and where nothing is.
_EXISTS, _NOTHING = "#bdbdbd", "#ffffff"


def proof_map(
    proof: Any,
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw a map of what is proven over one range of parameters or two.

    Pieces have the colour of the class that is proven for all of them; grey where there is a point with an
    undecided class, white where nothing is proven. Held states with a range count as parameters.

    Parameters
    ----------
    proof : Proof
        From :func:`nonsmooth.certify`, for one range or two.
    ax : matplotlib Axes, optional
        A new figure is made without it.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture.
    colors : mapping, optional
        Colours by the names in the legend.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the edges of pieces.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    OptionError
        ``proof`` is no Proof for one range or two.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z, m = (ca.SX.sym(name) for name in ("x", "y", "z", "m"))
    >>> s = ns.FilippovSystem(
    ...     [x, y, z], surface=x, above=[-y, 1, -m], below=[z, -1, 1 + 0.1 * y], parameters={m: 2})
    >>> fold = ns.find_two_fold(s, near=[0.0, 0.1, -0.1])
    >>> proof = ns.certify(fold, parameters={"m": (0.5, 3)}, max_pieces=32)
    >>> [t.get_text() for t in ns.plot.proof_map(proof).axes[0].get_legend().get_texts()]
    ['II-F', 'II-C', 'class undecided']
    """
    ranges = {k: v for k, v in getattr(proof, "parameters", {}).items() if v.low != v.high}
    if not hasattr(proof, "pieces") or not 1 <= len(ranges) <= 2:
        raise OptionError(
            f"proof is {proof!r} with {len(ranges)} ranges of parameters, but must have one or two "
            "ranges. Give certify pairs (low, high) for one or two names."
        )
    names, pieces = list(ranges), sorted(proof.pieces or (proof,), key=_corner(list(ranges)))
    labels = list(dict.fromkeys(_label(p) for p in pieces))
    shown = [v for v in labels if v not in (_UNDECIDED, _OPEN)]
    usual = {v: COLORS[k % len(COLORS)] for k, v in enumerate(shown)}
    usual |= {_UNDECIDED: _EXISTS, _OPEN: _NOTHING}
    with canvas(ax, size, (6.4, 4.4), colors=colors, look=look, title=title) as page:
        axes = page.ax
        fills = {name: page.color(name, color) for name, color in usual.items()}
        for piece in pieces:
            (a, b), (c, d) = [_ends(piece.parameters[k]) for k in names] + [(0.0, 1.0)] * (
                2 - len(names)
            )
            edge = page.look("edges", color=style.GREY, linewidth=0.4)
            edge = {"edgecolor": edge.pop("color"), **edge}
            axes.add_patch(Rectangle((a, c), b - a, d - c, facecolor=fills[_label(piece)], **edge))
        axes.set_xlim(*_ends(ranges[names[0]]))
        axes.set_ylim(*(_ends(ranges[names[1]]) if len(names) == 2 else (0.0, 1.0)))
        axes.set_xlabel(names[0])
        if len(names) == 2:
            axes.set_ylabel(names[1])
        else:
            axes.set_yticks([])
        if legend:
            handles = [
                Patch(facecolor=fills[v], edgecolor=style.GREY, label=v)
                for v in [*shown, *(v for v in (_UNDECIDED, _OPEN) if v in labels)]
            ]
            key(axes, handles, title="proven")
    return page.drawn


_UNDECIDED, _OPEN = "class undecided", "nothing"


def _label(piece: Any) -> str:
    """Class that is proven for a piece."""
    if piece.proven:
        return str(piece.label)
    return _UNDECIDED if piece.exists else _OPEN


def _ends(value: Any) -> tuple[float, float]:
    low, high = value.ends
    return float(low), float(high)


def _corner(names: list[str]) -> Any:
    return lambda piece: [piece.parameters[k].ends[0] for k in names]
