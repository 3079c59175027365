"""Orbits with ends that taper where the orbit continues beyond what is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from ...local.scans.box import Box
from ...model import Array

_OVER = 0.2  # length over which a line thins out, in units of the box
_PARTS = 24  # of that length, each of one width
_OF_COLLECTIONS = ("alpha", "color", "gid", "path_effects", "zorder")
_FEW, _DRAWN = 4, 0.7  # parts of a dashed line, and how much of each is drawn


def draw_orbit(
    ax: Axes, curve: Array, thins: tuple[bool, bool], box: Box, width: float, **options: Any
) -> None:
    """Draw an orbit, tapered at ends beyond which it continues."""
    dashed = options.get("linestyle", "-") != "-"
    look = {name: value for name, value in options.items() if name in _OF_COLLECTIONS}
    for thin, step in zip(thins, (1, -1), strict=True):
        if thin:
            curve, end = _parted(curve[::step], box, _FEW if dashed else _PARTS, dashed)
            curve = curve[::step]
            widths = width * np.linspace(0.0, 1.0, len(end) + 1)[1:]
            ax.add_collection(
                LineCollection(end, linewidths=widths, capstyle="butt", **look),
                autolim=False,
            )
    ax.plot(*curve.T, linewidth=width, **options)


def _parted(curve: Array, box: Box, count: int, dashed: bool) -> tuple[Array, list[Array]]:
    """A curve without its tapered end, and the parts (k, 2) of that end from its tip."""
    lengths = box.lengths(curve)
    cuts = np.linspace(0.0, min(_OVER, lengths[-1] / 2), count + 1)
    begins = cuts[:-1] + (1.0 - _DRAWN) * np.diff(cuts) if dashed else cuts[:-1]

    def at(length: float) -> Array:
        return np.array([np.interp(length, lengths, part) for part in curve.T])

    parts = [
        np.vstack([at(a), curve[(lengths > a) & (lengths < b)], at(b)])
        for a, b in zip(begins, cuts[1:], strict=True)
    ]
    return np.vstack([at(cuts[-1]), curve[lengths > cuts[-1]]]), parts
