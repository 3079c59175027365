"""Atlas of generic two-folds: portraits of every class and boundary, and the class maps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ...model import OptionError, whole
from .. import style
from ..drawing import Colors, Drawn, canvas
from .class_map import two_fold_map
from .flow_in_space import two_fold_3d
from .sliding_flow import two_fold

Numbers = tuple[tuple[int, int], tuple[float, float]]

#: One two-fold of each class, and of each boundary that changes something.
CASES: dict[str, Numbers] = {
    "VV-C1": ((1, -1), (-2.0, -1.0)),
    "VV-F": ((1, -1), (2.0, 1.0)),
    "II-C": ((-1, 1), (-2.0, -1.0)),
    "II-F": ((-1, 1), (-0.5, -0.5)),
    "mix-0": ((1, 1), (0.0, 0.5)),
    "mix-S": ((1, 1), (-1.5, 1.5)),
    "mix-C": ((1, 1), (-3.0, -0.5)),
    "mix-F": ((1, 1), (0.5, 3.0)),
    "VV-C1 with Δ=0": ((1, -1), (-2.0, -0.5)),
    "VV-C1|VV-F": ((1, -1), (2.0, 0.5)),
    "II-F with Δ=0": ((-1, 1), (2.0, 0.5)),
    "II-C|II-F": ((-1, 1), (-2.0, -0.5)),
    "mix-0|mix-C": ((1, 1), (-1.5, 0.5)),
    "mix-0|mix-F": ((1, 1), (-0.5, 1.5)),
    "mix-S|mix-C": ((1, 1), (-2.0, 0.5)),
    "mix-S|mix-F": ((1, 1), (-0.5, 2.0)),
    "II-F with ν1=0": ((-1, 1), (0.0, -1.0)),
    "mix-0 with ν2=0": ((1, 1), (0.5, 0.0)),
}


_ON_PAGE = 2  # two-folds on a page


def two_fold_atlas(
    cases: Sequence[str] | None = None,
    *,
    maps: bool = True,
    columns: int = 1,
    figure: FigureBase | None = None,
    size: tuple[float, float] | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw two-folds of every class and boundary: sliding portrait, flow in space, class maps.

    On one sheet, as tall as it takes: :func:`two_fold_atlas_pages` divides it for print.

    Parameters
    ----------
    cases : sequence of str, optional
        Names among the keys of ``CASES``; all by default.
    maps : bool, optional
        Whether to draw the class maps of the three kinds at the bottom.
    columns : int, optional
        Two-folds side by side; each takes two panels and 7 inches, the width of a page.
    figure : matplotlib Figure, optional
        Where to draw; a new one by default.
    size : (float, float), optional
        Of a new figure, in inches.
    colors : mapping, optional
        Colours as of :func:`two_fold`, :func:`two_fold_3d` and :func:`two_fold_map`.
    **look
        Properties of ``matplotlib.lines.Line2D`` for the orbits of the portraits.

    Returns
    -------
    matplotlib Figure
        The figure; a new one is known to pyplot. Tall: save it as PDF or SVG, or name a few cases.

    Raises
    ------
    OptionError
        An unknown case.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> figure = ns.plot.two_fold_atlas(["II-C", "II-F"], maps=False)
    >>> len(figure.axes)
    4
    """
    chosen = _chosen(cases)
    columns = min(whole(columns, "columns"), len(chosen))
    rows = math.ceil(len(chosen) / columns)
    below = {1: 8.6, 2: 5.2}.get(columns, 4.6)
    usual = (7.0 * columns, 3.1 * rows + below * maps + 1.2)
    with canvas(figure, size, usual, panels=True) as page:
        ratios = [3.1 * rows + 1.2, below]
        parts: Any = page.figure.subfigures(2, 1, height_ratios=ratios) if maps else [page.figure]
        grid = parts[0].add_gridspec(rows, 2 * columns, width_ratios=[1.0, 1.35] * columns)
        for k, name in enumerate(chosen):
            row, column = divmod(k, columns)
            flat = parts[0].add_subplot(grid[row, 2 * column])
            space = parts[0].add_subplot(grid[row, 2 * column + 1])
            own: Any = {"legend": False, "colors": colors, **look}
            two_fold(CASES[name], ax=flat, orbits=6, labels="lines", **own)
            two_fold_3d(CASES[name], ax=space, labels=True, title="", **own)
        parts[0].legend(handles=_legend(), loc="outside upper center", ncols=3 * columns)
        if maps:
            _maps(parts[1], columns == 1, colors)
    return page.drawn


def two_fold_atlas_pages(
    cases: Sequence[str] | None = None, *, maps: bool = True, colors: Colors = None, **look: Any
) -> list[Figure]:
    """Draw the atlas in parts that fit a page: two two-folds on each, and the class maps on the last.

    Parameters
    ----------
    cases : sequence of str, optional
        Names among the keys of ``CASES``; all by default.
    maps : bool, optional
        Whether to draw the class maps of the three kinds.
    colors : mapping, optional
        Colours as of :func:`two_fold`, :func:`two_fold_3d` and :func:`two_fold_map`.
    **look
        Properties of ``matplotlib.lines.Line2D`` for the orbits of the portraits.

    Returns
    -------
    list of matplotlib Figure
        7 inches wide, and less than 9 high.

    Raises
    ------
    OptionError
        An unknown case.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> pages = ns.plot.two_fold_atlas_pages(["II-C", "II-F", "mix-S"])
    >>> [len(page.axes) for page in pages]
    [4, 2, 3]
    """
    chosen = _chosen(cases)
    pairs = [chosen[k : k + _ON_PAGE] for k in range(0, len(chosen), _ON_PAGE)]
    pages = [two_fold_atlas(pair, maps=False, colors=colors, **look) for pair in pairs]
    if maps:
        with canvas(None, None, (7.0, 8.6), panels=True) as page:
            _maps(page.figure, True, colors)
        pages.append(page.drawn)
    return pages


def _chosen(cases: Sequence[str] | None) -> list[str]:
    chosen = list(CASES) if cases is None else list(cases) if isinstance(cases, Iterable) else []
    unknown = [name for name in chosen if name not in CASES]
    if unknown or not chosen or isinstance(cases, str):
        raise OptionError(
            f"cases={cases!r} are not names among {list(CASES)}. Leave cases= out to draw all of them."
        )
    return chosen


def _maps(figure: Any, narrow: bool, colors: Colors) -> None:
    """The class maps, two in a row or all."""
    panels = figure.subplots(2, 2).flat if narrow else figure.subplots(1, 3)
    for ax, kind in zip(panels, ("VV", "II", "VI"), strict=False):
        two_fold_map(kind, ax=ax, colors=colors)
    for ax in figure.axes[3:]:
        ax.remove()


def _legend() -> list[Line2D | Patch]:
    """Legend of all portraits."""
    return [
        Patch(facecolor=style.TINT_ATTRACTING, label="$D_a$: attracting sliding"),
        Patch(facecolor=style.TINT_REPELLING, label="$D_r$: repelling sliding"),
        Patch(
            facecolor="white", edgecolor="#9A9A9A", hatch="////", label="all $D_a\\to s\\to D_r$"
        ),
        Patch(facecolor="white", edgecolor="#9A9A9A", hatch="...", label="all $D_r\\to s\\to D_a$"),
        style.line(style.ABOVE, "orbits above; grey: shadow", 1.2, "-"),
        style.line(style.BELOW, "orbits below", 1.2, (0, (3.5, 1.3))),
    ]
