"""Legends beside the axes, or below them in figures as narrow as a column of a journal."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes

from .drawing import key

_NARROW = 4.6  # inches: a legend beside the axes would leave little room
_SHORT = 20  # letters of entries of which two are side by side in a column


def is_narrow(ax: Axes) -> bool:
    """Whether axes fill a figure as narrow as a column."""
    figure: Any = ax.get_figure(root=True)
    return bool(figure.get_figwidth() < _NARROW and len(figure.axes) == 1)


def beside(ax: Axes, handles: list[Any], **options: Any) -> None:
    """Draw a legend to the right of the axes, or below them in a narrow figure."""
    if is_narrow(ax):
        figure: Any = ax.get_figure(root=True)
        longest = max((len(str(handle.get_label())) for handle in handles), default=0)
        columns = 2 if longest <= _SHORT and len(handles) > 2 else 1
        figure.legend(handles=handles, loc="outside lower center", ncols=columns)
        return
    look = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0), "borderaxespad": 0.0}
    key(ax, handles, **{**look, **options})
