"""Pictures of a fit: what it leaves (matplotlib; reached as ``bounce.plot.residuals``)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import nonsmooth as ns

from ..errors import require
from ..golf.fits.fit_result import FitResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

style = ns.plot.style


def residuals(found: FitResult) -> Figure:
    """Draw the residuals of each component against the measured value.

    Parameters
    ----------
    found : FitResult
        The fit, from :func:`bounce.golf.fit`.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, with ``savefig``; notebooks show it.

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
    with style.settings():
        figure = style.new_figure((min(7.0, 0.6 + 3.2 * len(names)), 2.8))
        axes = figure.subplots(1, len(names), squeeze=False)[0]
        for ax, name in zip(axes, names, strict=True):
            rms = found.rms[name]
            ax.axhline(0.0, color="0.3", linewidth=0.8)
            for sign in (-1, 1):
                ax.axhline(sign * rms, color="0.6", linewidth=0.8, linestyle="--")
            measured = found.measurements.lift_off[name]
            ax.plot(measured, found.residuals[name], "o", color=style.BLUE, markersize=4)
            label = "R omega" if name == "omega" and found.measurements.si else name
            ax.set_xlabel(f"measured {label}{unit}", fontsize=9)
            if ax is axes[0]:
                ax.set_ylabel(f"predicted less measured{unit}", fontsize=9)
            ax.set_title(f"rms (dashed) {rms:.3g}{' m/s' if found.measurements.si else ''}")
    return figure
