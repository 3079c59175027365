"""Trajectories: states over time with modes and events, and the phase plane of planar systems."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from ...flow import Event, Segment, Trajectory
from ...model import Array, DefinitionError, OptionError, whole
from .. import style
from .surfaces import draw_surfaces

#: Marker of each kind of event; shapes differ without colour.
MARKERS = {
    "crossing": ("o", "white", "crossing"),
    "entry": ("v", style.BLACK, "entry into sliding"),
    "exit": ("^", "white", "exit from sliding"),
    "stop": ("s", style.BLACK, "stop"),
    "reset": ("D", "white", "reset"),
    "zero": ("P", "white", "zero"),
    "end": ("X", style.GREY, "end"),
}
_MODES = {
    "+": (style.ABOVE, "-", 1.5, "+  above, h > 0"),
    "-": (style.BELOW, (0, (5, 1.5)), 1.5, "−  below, h < 0"),
    "s": (style.BLACK, "-", 3.0, "s  sliding"),
    "*": (style.ABOVE, "-", 1.5, "*  off the set, h ≠ 0"),
    "": (style.BLUE, "-", 1.5, "smooth"),
}
_CYCLE = (style.ABOVE, style.BLUE, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
_GRID_FROM = 5  # states; fewer are stacked in one column
_LISTED = 6  # entries of a legend
_SHORT = 12  # letters of a name that stands beside its panel
_ABOVE: Any = {"loc": "left", "fontsize": 8.5, "pad": 3.0}
_MANY = 300  # events; more are not marked one by one


def trajectory(
    run: Trajectory,
    *,
    states: list[str] | None = None,
    phase_plane: bool | None = None,
    samples: int = 2000,
    size: tuple[float, float] | None = None,
    figure: Figure | None = None,
) -> Figure:
    """Draw states against time, one panel each, with modes and events marked.

    The strip on top of a column names the mode of each segment; sliding is also drawn thick, motion
    below the surface dashed. A planar system gets its phase plane with the surface beside it.

    Parameters
    ----------
    run : Trajectory
        From ``simulate`` or ``follow``.
    states : list of str, optional
        Names of the states to draw; all by default.
    phase_plane : bool, optional
        Whether to draw the phase plane; by default for two states.
    samples : int, optional
        Points in time at which the dense output is drawn, besides the steps.
    size : (float, float), optional
        Inches.
    figure : matplotlib Figure, optional
        Where to draw; a new one by default.

    Returns
    -------
    matplotlib Figure
        The figure, with ``savefig``; notebooks show it.

    Raises
    ------
    DefinitionError
        ``run`` is not a trajectory, or a phase plane of a system that is not planar.
    OptionError
        An unknown state, or no positive number of samples.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> block = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])
    >>> figure = ns.plot.trajectory(ns.simulate(block, [3.0, 0.0], t_end=15.0))
    >>> [ax.get_ylabel() for ax in figure.axes if ax.get_ylabel()]
    ['x', 'v', 'v']
    """
    run = _checked(run)
    names = _states(run, states)
    plane = run.system.dimension == 2 if phase_plane is None else phase_plane
    if plane and run.system.dimension != 2:
        raise DefinitionError(
            f"phase_plane=True needs 2 states, but the system has {run.system.dimension}: "
            f"{', '.join(run.system.state_names)}. Leave it out to draw states against time."
        )
    return _draw(run, names, plane, whole(samples, "samples"), size, figure)


def _draw(
    run: Trajectory,
    names: list[str],
    plane: bool,
    samples: int,
    size: tuple[float, float] | None,
    figure: Figure | None,
) -> Figure:
    """Lay out the panels and fill them."""
    columns = 1 if len(names) < _GRID_FROM else math.ceil(len(names) / 4)
    rows = math.ceil(len(names) / columns)
    if size is None:
        size = (7.0 if plane or columns > 1 else 5.0, max(1.3 * rows + 1.2, 3.4))
    with style.settings():
        figure = style.new_figure(size) if figure is None else figure
        resets = run.events.t[run.events.column("kind") == "reset"]
        parts = [_Part(run, segment, samples, resets) for segment in run.segments]
        looks = _looks([part.segment.mode for part in parts])
        grid = figure.add_gridspec(
            rows + 1,
            columns + plane,
            height_ratios=[0.13, *[1.0] * rows],
            width_ratios=[1.0] * columns + [1.0 if columns == 1 else 1.2] * plane,
        )
        for column in range(columns):
            chosen = names[column * rows : (column + 1) * rows]
            _time_column(figure, grid, column, chosen, run, parts, looks)
        if plane:
            ax = figure.add_subplot(grid[1:, columns])
            _phase_plane(ax, run, parts, looks)
        _explain(figure, _title(run, figure), _legend(run, looks, plane), len(looks))
    return figure


class _Part:
    """One segment with times and states at which it is drawn."""

    def __init__(self, run: Trajectory, segment: Segment, samples: int, resets: Array):
        span = abs(run.t[-1] - run.t[0]) or 1.0
        low, high = sorted((segment.t_start, segment.t_end))
        count = max(int(samples * (high - low) / span), 8)
        steps = run.t[(run.t > low) & (run.t < high)] if len(run.t) < samples else run.t[:0]
        # stay inside: at the ends, a reset would show the state after it
        inner = (high - low) * 1e-9
        times = np.union1d(np.linspace(low + inner, high - inner, count), steps)
        resets = resets[(low < resets) & (resets < high)]
        around = np.concatenate([resets - inner, resets + inner])
        times = np.union1d(times, np.clip(around, low, high)) if len(resets) else times
        x = run(times)
        # a jump is a gap in the curve
        k = np.searchsorted(times, resets)
        self.segment, self.t, self.x = (
            segment,
            np.insert(times, k, resets),
            np.insert(x, k, np.nan, axis=0),
        )


def _checked(run: object) -> Trajectory:
    if not isinstance(run, Trajectory):
        raise DefinitionError(
            f"trajectory cannot draw a {type(run).__name__}. Make a Trajectory with simulate(system, x0, t_end)."
        )
    return run


def _states(run: Trajectory, states: list[str] | None) -> list[str]:
    known = list(run.system.state_names)
    unknown = [name for name in states or [] if name not in known]
    if unknown or states == []:
        raise OptionError(
            f"states={states!r} are not names among {known}. Leave states= out to draw all of them."
        )
    return list(states) if states else known


def _looks(modes: list[str]) -> dict[str, tuple[str, Any, float, str]]:
    """Colour, dashes, width and explanation of each mode, in order of appearance."""
    looks: dict[str, tuple[str, Any, float, str]] = {}
    several = any(len(mode) > 1 for mode in modes)
    for mode in dict.fromkeys(modes):
        if not several:
            looks[mode] = _MODES[mode]
            continue
        k = len(looks)
        width = 3.0 if "s" in mode else 1.5
        text = mode.replace("-", "−")
        looks[mode] = (_CYCLE[k % 6], "-" if "s" in mode else _DASHES[k % 4], width, text)
    return looks


def _time_column(
    figure: Figure,
    grid: Any,
    column: int,
    names: list[str],
    run: Trajectory,
    parts: list[_Part],
    looks: dict[str, tuple[str, Any, float, str]],
) -> None:
    if not names:
        return
    strip = figure.add_subplot(grid[0, column])
    _strip(strip, run, looks)
    for row, name in enumerate(names):
        ax = figure.add_subplot(grid[row + 1, column], sharex=strip)
        k = run.system.state_names.index(name)
        for part in parts:
            color, dashes, width, _ = looks[part.segment.mode]
            ax.plot(part.t, part.x[:, k], color=color, linestyle=dashes, linewidth=width)
            if "s" in part.segment.mode:
                ax.axvspan(part.segment.t_start, part.segment.t_end, color="#EDEDED", zorder=0)
        _mark(ax, run.events, lambda event, k=k: (event.t, event.x[k]))
        if run.accumulation_time is not None:
            ax.axvline(run.accumulation_time, color=style.PURPLE, linestyle=":", linewidth=1.2)
        if len(name) <= _SHORT:
            ax.set_ylabel(name)
        else:  # longer than the panel is high
            ax.set_title(
                _broken(name, 0.75 * grid.figure.get_figwidth() / grid.ncols, 5.5), **_ABOVE
            )
        ax.tick_params(labelbottom=row == len(names) - 1)
    ax.set_xlabel("t")
    ax.margins(x=0.02)


def _strip(ax: Axes, run: Trajectory, looks: dict[str, tuple[str, Any, float, str]]) -> None:
    """Bar with the mode of each segment, if the segment is wide enough."""
    span = abs(run.t[-1] - run.t[0]) or 1.0
    letter = 0.11 * ax.get_figure(root=True).dpi / ax.bbox.width  # type: ignore[union-attr]
    for segment in run.segments:
        low, high = sorted((segment.t_start, segment.t_end))
        color = looks[segment.mode][0]
        hatch = "///" if "s" in segment.mode else None
        box = Rectangle(
            (low, 0.0),
            high - low,
            1.0,
            facecolor=color,
            alpha=0.3,
            edgecolor="white",
            linewidth=0.5,
            hatch=hatch,
        )
        ax.add_patch(box)
        if (high - low) / span > letter * max(len(segment.mode), 1):
            ax.text(
                (low + high) / 2,
                0.45,
                segment.mode.replace("-", "−"),
                ha="center",
                va="center",
                fontsize=9,
                fontweight="bold",
                path_effects=style.halo(2.0),
            )
    ax.set(ylim=(0, 1), yticks=[])
    ax.tick_params(bottom=False, labelbottom=False)
    for side in ("top", "left", "right", "bottom"):
        ax.spines[side].set_visible(False)


def _mark(ax: Axes, events: Sequence[Event], where: Any) -> None:
    if len(events) > _MANY:
        events = events[-1:]
    for kind, (marker, face, _) in MARKERS.items():
        points = np.array([where(event) for event in events if event.kind == kind])
        if len(points):
            ax.plot(
                *points.T,
                linestyle="none",
                marker=marker,
                markersize=5,
                zorder=5,
                markerfacecolor=face,
                markeredgecolor=style.BLACK,
                markeredgewidth=0.8,
                gid=f"event {kind}",
            )


def _phase_plane(
    ax: Axes, run: Trajectory, parts: list[_Part], looks: dict[str, tuple[str, Any, float, str]]
) -> None:
    for part in parts:
        color, dashes, width, _ = looks[part.segment.mode]
        ax.plot(*part.x.T, color=color, linestyle=dashes, linewidth=width, zorder=3)
        if "s" not in part.segment.mode and np.all(np.isfinite(part.x)):
            style.arrowhead(ax, part.x, 0.5, color, mutation_scale=11, zorder=4)
    ax.plot(*run.x[0], "o", color=style.GREEN, markersize=6, zorder=5, gid="start")
    _mark(ax, run.events, lambda event: event.x)
    ax.margins(0.08)
    ax.locator_params(axis="x", nbins=5)  # more would move the frame, which moves them
    low, high = ax.get_xlim(), ax.get_ylim()
    if not run.system.time_dependent:
        draw_surfaces(ax, run.system, np.array(list(run.parameters.values())), (*low, *high))
    figure: Any = ax.get_figure(root=True)
    room = 0.38 * figure.get_figwidth(), 0.5 * figure.get_figheight()
    x, y = (_broken(name, r, 7.0) for name, r in zip(run.system.state_names, room, strict=True))
    ax.set(xlim=low, ylim=high, xlabel=x, ylabel=y)


def _broken(name: str, room: float, letter: float) -> str:
    """A name in lines that fit the room in inches, with letters of a width in points."""
    letters = max(int(72 * room / letter), 4)
    lines = textwrap.wrap(name.replace("_", "_ "), letters)
    return "\n".join(line.replace("_ ", "_") for line in lines) if len(name) > letters else name


def _title(run: Trajectory, figure: Figure) -> str:
    itinerary = run.itinerary.replace("-", "−")
    room = min(48, int(12 * figure.get_figwidth()) - 12)  # letters in a line
    if len(itinerary) > room:
        itinerary = itinerary[: room - 4].rstrip() + " …"
    gap = "   " if figure.get_figwidth() > 4.6 else "\n"
    return f"itinerary: {itinerary}{gap}status: {run.status}"


def _explain(figure: Figure, title: str, handles: list[Line2D | Patch], modes: int) -> None:
    """A title and a legend; a long legend is split into modes above and marks below."""
    columns = min(4, max(1, int(figure.get_figwidth() / 1.6)))
    if len(handles) <= _LISTED:
        figure.suptitle(title, fontsize=10, fontfamily="monospace")
        figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), columns))
        return
    upper = figure.legend(
        handles=_shortened(handles[:modes]),
        loc="outside upper center",
        ncols=min(modes, columns),
        title=title,
    )
    upper.get_title().set_fontproperties(FontProperties(family="monospace", size=10))
    rest = _shortened(handles[modes:])
    if rest:
        figure.legend(handles=rest, loc="outside lower center", ncols=min(len(rest), columns))


def _shortened(handles: list[Line2D | Patch]) -> list[Line2D | Patch]:
    if len(handles) <= _LISTED:
        return handles
    more = f"and {len(handles) - _LISTED + 1} more, named above the panels"
    return [*handles[: _LISTED - 1], Patch(alpha=0.0, label=more)]


def _legend(
    run: Trajectory, looks: dict[str, tuple[str, Any, float, str]], plane: bool
) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        style.line(color, text, width, dashes) for color, dashes, width, text in looks.values()
    ]
    present = {*run.events.column("kind").tolist()}
    if len(run.events) > _MANY:
        present = {run.events[-1].kind}
    for kind, (marker, face, text) in MARKERS.items():
        if kind in present:
            handles.append(style.marker(marker, text, face, size=5))
    if plane:
        handles.append(
            Line2D([], [], linestyle="none", marker="o", color=style.GREEN, label="start")
        )
    if run.accumulation_time is not None:
        handles.append(Line2D([], [], color=style.PURPLE, linestyle=":", label="accumulation time"))
    if plane and run.system.surface_count and not run.system.time_dependent:
        handles.append(Line2D([], [], color=style.GREY, linewidth=2.2, alpha=0.7, label="surface"))
    return handles
