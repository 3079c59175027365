"""Keys below the axes of a picture, at a fixed distance from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import nonsmooth as ns

if TYPE_CHECKING:
    from matplotlib.axes import Axes

style = ns.plot.style

_NARROW = 4.6  # inches: figures as wide as a column of a journal
_UNDER = 36.0  # points from the axes to the key: the numbers of the axis and its name are between


def is_narrow(ax: Axes) -> bool:
    """Whether the figure of axes is as narrow as a column."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    return bool(figure.get_figwidth() < _NARROW)


def below(ax: Axes, handles: Sequence[Any], labels: Sequence[str], columns: int = 2) -> None:
    """Put a key below the axes, as their legend or, if they have one, as an artist of its own."""
    if not handles:
        return
    from matplotlib.transforms import ScaledTranslation

    figure = ax.get_figure(root=True)
    assert figure is not None
    down = ScaledTranslation(0.0, -_UNDER / 72, figure.dpi_scale_trans)
    look: dict[str, Any] = dict(
        loc="upper center", bbox_to_anchor=(0.5, 0.0), bbox_transform=ax.transAxes + down,
        borderaxespad=0.0, ncols=columns, frameon=False, fontsize=style.points(8.0), columnspacing=1.2,
    )  # fmt: skip
    if ax.get_legend() is None:
        ax.legend(handles, labels, **look)
        return
    from matplotlib.legend import Legend

    key = ax.add_artist(Legend(ax, handles, labels, **look))
    key.set_clip_on(False)  # the layout leaves out what it takes for clipped to the axes


def keys(ax: Axes, patches: Sequence[Any], lines: dict[str, Any], title: str) -> None:
    """Put a key of the lines below a map, and of the patches beside it, or below a narrow one too."""
    if is_narrow(ax):
        labels = [str(patch.get_label()) for patch in patches]
        below(ax, [*lines.values(), *patches], [*lines, *labels])
        return
    if patches:
        ax.legend(
            handles=patches, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0,
            frameon=False, fontsize=style.points(8), title=title, title_fontsize=style.points(8),
        )  # fmt: skip
    below(ax, list(lines.values()), list(lines))
