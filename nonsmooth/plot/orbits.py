"""Periodic orbits in a phase plane, and Floquet multipliers beside the unit circle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..model import DefinitionError, OptionError
from ..orbit import Branch, PeriodicOrbit
from . import style
from .drawing import Colors, Drawn, canvas, key
from .labels import Labels
from .portraits.surfaces import draw_surfaces

_MODES: dict[str, dict[str, Any]] = {
    "+": {"color": style.ABOVE, "linewidth": 1.8},
    "-": {"color": style.BELOW, "linestyle": (0, (5, 1.5)), "linewidth": 1.8},
    "s": {"color": style.BLACK, "linewidth": 3.2},
}
_CYCLE = (style.GREEN, style.PURPLE, style.ORANGE, style.SKY, style.BLUE)
_POINTS = 120  # of a leg
_ENTRIES = 6  # of a legend


def periodic_orbit(
    orbit: PeriodicOrbit,
    *,
    states: Sequence[str] | None = None,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw a periodic orbit in a plane of two states, with its modes and events.

    Parameters
    ----------
    orbit : PeriodicOrbit
        The orbit to draw.
    states : two str, optional
        Names of the states of the plane; the first two by default.
    ax : matplotlib Axes, optional
        For example that of a phase portrait, over which it is drawn. A new figure is made without
        it; for a planar autonomous system with the surfaces.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        By default period and stability.
    colors : mapping, optional
        Colours by modes, such as ``{"s": "tab:red"}``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the orbit.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    DefinitionError, OptionError
        Not a periodic orbit; unknown states.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> block = ns.FilippovSystem([x, v], surface=v - 0.5, above=[v, -x - 1 + 0.2 * (v - 0.5)],
    ...                           below=[v, -x + 1 + 0.2 * (v - 0.5)])
    >>> orbit = ns.periodic_orbit(block, ns.simulate(block, [0.3, 0.4], 30))
    >>> figure = ns.plot.periodic_orbit(orbit)
    >>> [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    ['mode −', 'mode s', 'event', 'surface']
    """
    if not isinstance(orbit, PeriodicOrbit):
        raise DefinitionError(
            f"orbit is {repr(orbit)[:60]}, not a PeriodicOrbit. periodic_orbit(system, guess) finds one."
        )
    system, names = orbit.system, list(states or orbit.system.state_names[:2])
    if len(names) != 2 or not set(names) <= set(system.state_names):
        raise OptionError(
            f"states={states!r} are not two names among {list(system.state_names)}. A system of one state "
            "has no plane: draw orbit.trajectory."
        )
    i, j = (system.state_names.index(name) for name in names)
    run = orbit.trajectory
    title = f"period {orbit.period:.6g}, {orbit.stability}" if title is None else title
    with canvas(ax, size, (5.4, 4.6), colors=colors, look=look, title=title) as page:
        axes = page.ax
        modes = list(dict.fromkeys(segment.mode for segment in run.segments))
        looks = {mode: page.look(mode, **_look(mode, k)) for k, mode in enumerate(modes)}
        for segment in run.segments:
            line = {"zorder": 6, **looks[segment.mode]}
            x = run(np.linspace(segment.t_start, segment.t_end, _POINTS))
            axes.plot(x[:, i], x[:, j], **line)
            if segment.mode.count("s") == 0 and np.ptp(x[:, [i, j]], axis=0).max() > 0:
                style.arrowhead(axes, x[:, [i, j]], 0.5, line["color"], mutation_scale=11, zorder=7)
        starts = np.array([leg.start[[i, j]] for leg in orbit.legs])
        axes.plot(
            *starts.T, "o", color="white", markeredgecolor=style.BLACK, markersize=4.5, zorder=8
        )
        axes.margins(0.08)
        box = (*axes.get_xlim(), *axes.get_ylim())
        surfaces = ax is None and system.dimension == 2 and not system.time_dependent
        if surfaces:
            draw_surfaces(axes, system, orbit.parameter_vector, box)
            axes.set(xlim=box[:2], ylim=box[2:])
        axes.set(xlabel=names[0], ylabel=names[1])
        if legend:
            handles = [Line2D([], [], label=_words(m), **line) for m, line in looks.items()]
            handles.append(style.marker("o", "event", fill="white", size=4.5))
            if surfaces:
                handles.append(style.line(style.GREY, "surface", 2.2))
            key(axes, handles[:_ENTRIES])
    return page.drawn


def _words(mode: str) -> str:
    """Entry of a legend for a mode."""
    return f"mode {mode}".replace("-", "\N{MINUS SIGN}") if mode else "smooth"


def _look(mode: str, k: int) -> dict[str, Any]:
    width = 3.2 if "s" in mode else 1.8
    return _MODES.get(mode) or {"color": _CYCLE[k % len(_CYCLE)], "linewidth": width}


def multipliers(
    found: PeriodicOrbit | Branch,
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw Floquet multipliers beside the unit circle; along a branch coloured by its parameter.

    Parameters
    ----------
    found : PeriodicOrbit or Branch
        Structural multipliers (1 of the flow, 0 of sliding) are drawn as crosses.
    ax : matplotlib Axes, optional
        A new figure is made without it.
    size : (width, height), optional
        Of a new figure, in inches.
    title : str, optional
        Title of the picture; the default says what is shown.
    colors : mapping, optional
        Colours by ``"multipliers"`` and ``"unit circle"``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the circle.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    DefinitionError
        Neither an orbit nor a branch of orbits.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, t, a = (ca.SX.sym(s) for s in ("x", "t", "a"))
    >>> relay = ns.FilippovSystem([x], surface=x, time=t, parameters={a: 2.5},
    ...                           above=[a * ca.cos(t) - 1], below=[a * ca.cos(t) + 1])
    >>> figure = ns.plot.multipliers(ns.periodic_orbit(relay, [0.5]))
    >>> figure.axes[0].get_xlabel()
    'Re μ'
    """
    orbits = [found] if isinstance(found, PeriodicOrbit) else list(getattr(found, "solutions", ()))
    if not orbits or not all(isinstance(orbit, PeriodicOrbit) for orbit in orbits):
        raise DefinitionError(
            f"found is {repr(found)[:60]}, not a PeriodicOrbit or a Branch of them. periodic_orbit and "
            "continue_orbit return them."
        )
    with canvas(ax, size, (4.8, 4.6), colors=colors, look=look, title=title) as page:
        axes = page.ax
        circle = np.exp(1j * np.linspace(0, 2 * np.pi, 361))
        line = page.look("unit circle", color=style.GREY, linewidth=1.2, zorder=1)
        axes.plot(circle.real, circle.imag, **line)
        axes.axhline(0, color=style.GREY, linewidth=0.6, zorder=0)
        axes.axvline(0, color=style.GREY, linewidth=0.6, zorder=0)
        free, along = [], []
        for k, orbit in enumerate(orbits):
            values = orbit.floquet.values
            free.append(values[np.abs(values) > 0])
            value = found.values[k] if isinstance(found, Branch) else 0.0
            along.append(np.full(free[-1].size, value))
        points, shade = np.concatenate(free), np.concatenate(along)
        drawn = axes.scatter(
            points.real,
            points.imag,
            c=shade if isinstance(found, Branch) else page.color("multipliers", style.BLUE),
            cmap="viridis" if isinstance(found, Branch) else None,
            s=26,
            edgecolors=style.BLACK,
            linewidths=0.4,
            zorder=4,
            gid="multipliers",
        )
        structural = [0.0] * bool(orbits[-1].floquet.zeros)
        structural += [1.0] * (not orbits[-1].system.time_dependent)
        axes.plot(structural, np.zeros(len(structural)), "x", color=style.BLACK, zorder=5)
        labels = Labels(axes)
        for value in structural:
            labels.name("of the flow" if value else "of sliding", (value, 0.0))
        if isinstance(found, Branch):
            page.figure.colorbar(drawn, ax=axes, label=found.parameter)
        axes.set(xlabel="Re μ", ylabel="Im μ")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
    return page.drawn
