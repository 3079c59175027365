"""Pictures of one bounce: friction force against load, with the cone that bounds it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

import nonsmooth as ns

from ..contact.equations import equations
from ..contact.model import Contact3D, ContactModel
from ..shot.shot import Shot
from .keys import below, is_narrow

if TYPE_CHECKING:
    from matplotlib.axes import Axes

style = ns.plot.style
Canvas = ns.plot.Canvas
canvas = ns.plot.canvas

#: Colours that differ in grey too, line styles and names of the phases.
STYLES: dict[str, dict[str, Any]] = {
    "+": dict(color=style.VERMILLION, linestyle="-", label="forward slip, $H>0$"),
    "-": dict(color=style.BLUE, linestyle=(0, (5, 1.5)), label="reverse slip, $H<0$"),
    "s": dict(color=style.BLACK, linestyle=(0, (1, 1)), label="rolling, $H=0$"),
    "F": dict(color="#999999", linestyle="-.", label="no friction yet"),
}
_WIDTH = {"+": 2.0, "-": 2.0, "s": 2.6, "F": 1.6}
_POINTS = 400
_SEEN = 0.04  # of the width of the picture: a shorter jump has no name
_LONG = 0.33  # of a column: over a shorter jump its name takes two lines


def friction_cone(
    shot: Shot[ContactModel, float],
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Mapping[str, Any] | None = None,
    **look: Any,
) -> Any:
    """Draw the friction force against the load, with the cone that bounds it.

    Parameters
    ----------
    shot : Shot
        The bounce, from :func:`bounce.simulate`.
    ax : matplotlib Axes, optional
        Draw here instead of in a new figure.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture.
    colors : mapping, optional
        Colours by phases, such as ``{"s": "tab:red"}``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the force.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    nonsmooth.OptionError
        A bounce in 3-D.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> shot = bounce.simulate(turf, xdot=0.3, ydot=-1.0, omega=0.1)
    >>> bounce.plot.friction_cone(shot).axes[0].get_xlabel()
    'friction force $\\\\Lambda_T$'
    """
    if not isinstance(shot, Shot) or isinstance(shot.model, Contact3D):
        raise ns.OptionError(
            f"shot: expected a bounce in the plane, received {shot!r}. In 3-D draw the components of shot.forces(t)."
        )
    with canvas(ax, size, (6.4, 5.2), colors=colors, look=look, title=title) as page:
        ax = page.ax
        names = ns.plot.labels.Labels(ax)
        _cone(ax, shot, names)
        _phases(page, shot, names)
        _markers(ax, shot)
        ax.axhline(0.0, color="0.3", linewidth=0.8, zorder=1)
        ax.set_xlabel(r"friction force $\Lambda_T$")
        ax.set_ylabel(r"load $\Lambda_N$")
        if legend:
            below(ax, *ax.get_legend_handles_labels())
    return page.drawn


def _cone(ax: Axes, shot: Shot[ContactModel, float], names: Any) -> None:
    """Shade |Lambda_T| <= mu Lambda_N, with mu that of rest, and set the limits of the axes."""
    forces = shot.forces(np.linspace(0.0, shot.time, _POINTS))
    top = 1.15 * float(forces.load.max())
    mu = _static_coefficient(shot)
    ax.fill_betweenx(
        [0.0, top], [0.0, -mu * top], [0.0, mu * top], color="0.92", zorder=0, linewidth=0
    )
    height = top * np.linspace(0.4, 0.93, 12)
    for side, sign in ((-1, "-"), (1, "")):
        ax.plot([0.0, side * mu * top], [0.0, top], color="0.45", linewidth=1.0, zorder=1)
        names.name(
            rf"$\Lambda_T={sign}\mu\Lambda_N$",
            np.column_stack([side * mu * height, height]),
            "0.3",
            keep=lambda p, side=side: side * p[:, 0] > mu * p[:, 1],
            fontsize=style.points(9.0),
        )
    half = (1.45 * mu or 0.5) * top  # without friction the cone is a line
    ax.set_xlim(-half, half)
    ax.set_ylim(min(0.0, 1.1 * float(forces.load.min())) - 0.06 * top, top)
    ax.locator_params(nbins=5)


def _static_coefficient(shot: Shot[ContactModel, float]) -> float:
    import casadi as ca

    model = shot.model
    eq = equations(model.blueprint())
    coefficient = ca.SX(model.friction_coefficient(eq.s, eq.q))
    rest = ca.substitute(coefficient, eq.s.slip, 0)
    x, p = shot(0.0), list(model.values.values())
    return float(eq.function([rest])(x, p))


def _phases(page: Canvas, shot: Shot[ContactModel, float], names: Any) -> None:
    """One line per phase, with an arrow in the direction of time, and a thin one where friction jumps."""
    ax = page.ax
    labelled: set[str] = set()
    jumps: list[np.ndarray] = []
    before = np.zeros(2)
    for phase in shot.phases:
        t = np.linspace(phase.t_start, phase.t_end, _POINTS)
        # A transition belongs to the later phase: end just before it.
        t[-1] = np.nextafter(phase.t_end, phase.t_start)
        forces = shot.forces(t)
        points = np.column_stack([forces.friction, forces.load])
        if labelled:  # friction jumps where slip ends in rolling or in reverse slip
            jumps.append(np.linspace(before, points[0], 12))
            ax.plot(*jumps[-1].T, color="0.6", linewidth=0.9, zorder=2)
        before = points[-1]
        look = page.look(phase.mode, linewidth=_WIDTH[phase.mode], zorder=3, **STYLES[phase.mode])
        text = look.pop("label")
        label = None if phase.mode in labelled else text
        labelled.add(phase.mode)
        if phase.mode == "F" and label:
            names.name(label, points, "0.3")
            label = None
        ax.plot(*points.T, label=label, **look)
        _arrow(ax, points, look["color"])
    longest = max(jumps, key=lambda jump: abs(jump[-1, 0] - jump[0, 0]), default=np.zeros((2, 2)))
    share = abs(longest[-1, 0] - longest[0, 0]) / np.ptp(ax.get_xlim())
    if share > _SEEN:
        mu = _static_coefficient(shot)
        words = "friction\njumps" if is_narrow(ax) and share < _LONG else "friction jumps"
        inside = lambda p: np.abs(p[:, 0]) < mu * p[:, 1]
        names.name(words, longest[2:-2], "0.3", keep=inside)


def _arrow(ax: Axes, curve: np.ndarray, color: str) -> None:
    """An arrow head at the middle of a curve's length, as it is seen on the axes."""
    scale = np.array([np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())])
    if np.linalg.norm(np.diff(curve, axis=0) / scale, axis=1).sum() >= 0.06:
        style.arrowhead(ax, curve, 0.45, color, scale=scale, mutation_scale=16, zorder=4)


def _markers(ax: Axes, shot: Shot[ContactModel, float]) -> None:
    """Touch-down, transitions and lift-off."""
    start = shot.forces(0.0)
    inner = np.array([phase.t_start for phase in shot.phases[1:]])
    face: dict[str, Any] = dict(markerfacecolor="white", markeredgecolor="black")
    common: dict[str, Any] = dict(linestyle="none", clip_on=False)
    touch: dict[str, Any] = dict(color="black", markersize=7, label="touch-down")
    ax.plot(start.friction, start.load, "o", zorder=6, **touch, **common)  # not under lift-off
    if inner.size:
        at = shot.forces(inner)
        ax.plot(
            at.friction, at.load, "s", markersize=6, label="transition", zorder=5, **face, **common
        )
    ax.plot(0.0, 0.0, "D", markersize=9, label="lift-off", zorder=5, **face, **common)
