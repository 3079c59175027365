"""Switching surfaces of a planar system, as grey lines in a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from contourpy import contour_generator
from matplotlib.axes import Axes

from ...model import Array, FilippovSystem, call
from .. import style


def draw_surfaces(
    ax: Axes, system: FilippovSystem, parameters: Array, box: tuple[float, float, float, float]
) -> None:
    """Draw the switching surfaces of a planar system in a box as grey lines.

    Conditions of complementarity that hold a multiplier are no functions of the state, and are not drawn.
    """
    x, y = np.meshgrid(np.linspace(*box[:2], 161), np.linspace(*box[2:], 161))
    points = np.vstack([x.ravel(), y.ravel()])
    drawn = {*range(system.surface_count)} - {*system.algebraic, *system.joints}
    function = system.function(
        ("plot surfaces",), lambda: [system.surface_function(i) for i in sorted(drawn)]
    )
    values = call(function, points, parameters) if drawn else []
    for value in values:
        h = value.reshape(x.shape)
        look: Any = {"color": style.GREY, "linewidth": 2.2, "alpha": 0.7, "zorder": 1}
        curves: Any = contour_generator(x, y, h).lines(0.0)
        for curve in curves:
            ax.plot(*curve.T, gid="surface", **look)
