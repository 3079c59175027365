"""Orbits that go on beside another one: drawn thinner and thinner there, so that none ends in mid-air."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from ..local.box import Box
from ..model import Array

_OVER = 0.2  # length over which a line thins out, in units of the box
_PARTS = 24  # of that length, each of one width


def draw_orbit(
    ax: Axes, curve: Array, thins: tuple[bool, bool], box: Box, width: float, **options: Any
) -> None:
    """Draw an orbit, thinner and thinner to an end that is not where the orbit ends.

    Parameters
    ----------
    ax : matplotlib Axes
    curve : ndarray (m, 2)
    thins : (bool, bool)
        Whether its beginning, and its end, are such.
    box : Box
    width : float
        Of its line, in points.
    **options
        Of the line and of its thin ends: colour and so on.
    """
    for thin, step in zip(thins, (1, -1), strict=True):
        if thin:
            curve, end = _parted(curve[::step], box)
            curve = curve[::step]
            widths = width * np.linspace(0.0, 1.0, len(end) + 1)[1:]
            ax.add_collection(
                LineCollection(end, linewidths=widths, capstyle="butt", **options),
                autolim=False,
            )
    ax.plot(*curve.T, linewidth=width, **options)


def _parted(curve: Array, box: Box) -> tuple[Array, list[Array]]:
    """A curve without the length over which it thins out, and the parts (k, 2) of that, from its tip."""
    lengths = box.lengths(curve)
    cuts = np.linspace(0.0, min(_OVER, lengths[-1] / 2), _PARTS + 1)
    at = np.column_stack([np.interp(cuts, lengths, part) for part in curve.T])
    parts = [
        np.vstack([at[k], curve[(lengths > cuts[k]) & (lengths < cuts[k + 1])], at[k + 1]])
        for k in range(_PARTS)
    ]
    return np.vstack([at[-1:], curve[lengths > cuts[-1]]]), parts
