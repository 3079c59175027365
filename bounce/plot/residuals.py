"""Pictures of the residuals of a fit (matplotlib; reached as ``bounce.plot.residuals``)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import nonsmooth as ns

from ..errors import require
from ..golf.fits.fit_result import FitResult

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

style = ns.plot.style
canvas = ns.plot.canvas


def residuals(
    found: FitResult,
    *,
    figure: FigureBase | None = None,
    size: tuple[float, float] | None = None,
    colors: Mapping[str, Any] | None = None,
    **look: Any,
) -> Any:
    """Draw the residuals of each component against the measured value.

    Parameters
    ----------
    found : FitResult
        The fit, from :func:`bounce.golf.fit`.
    figure : matplotlib Figure, optional
        Where to draw; a new one by default.
    size : (width, height), optional
        Of a new figure, in inches.
    colors : mapping, optional
        Colours by the names of components.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the points.

    Returns
    -------
    matplotlib Figure
        The new figure, which pyplot knows; the figure if it was given.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> law, u = bounce.laws.RigidBounce(mu=0.3, restitution=0.5), np.linspace(1, 2, 5)
    >>> data = dict(xdot=u, ydot=-u, omega=0 * u, lift_off_ydot=0.5 * u + [0.01, 0, -0.01, 0, 0])
    >>> found = bounce.golf.fit(law, data, parameters=["restitution"], starts=0)
    >>> bounce.plot.residuals(found).axes[0].get_title()
    'rms (dashed) 0.00629'
    """
    require(found, FitResult, "found", "bounce.golf.fit returns one.")
    names = list(found.residuals)
    unit = " [m/s]" if found.measurements.si else ""
    usual = (min(7.0, 0.6 + 3.2 * len(names)), 2.8)
    with canvas(figure, size, usual, colors=colors, look=look, panels=True) as page:
        axes = page.figure.subplots(1, len(names), squeeze=False)[0]
        for ax, name in zip(axes, names, strict=True):
            rms = found.rms[name]
            ax.axhline(0.0, color="0.3", linewidth=0.8)
            for sign in (-1, 1):
                ax.axhline(sign * rms, color="0.6", linewidth=0.8, linestyle="--")
            measured = found.measurements.lift_off[name]
            dots: Any = {"linestyle": "none", "marker": "o", "markersize": 4, "color": style.BLUE}
            ax.plot(measured, found.residuals[name], **page.look(name, **dots))
            label = "R omega" if name == "omega" and found.measurements.si else name
            ax.set_xlabel(f"measured {label}{unit}", fontsize=style.points(9))
            if ax is axes[0]:
                ax.set_ylabel(f"predicted less measured{unit}", fontsize=style.points(9))
            ax.set_title(f"rms (dashed) {rms:.3g}{' m/s' if found.measurements.si else ''}")
    return page.drawn
