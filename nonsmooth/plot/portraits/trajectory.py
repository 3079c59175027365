"""Trajectories: states over time with modes and events, and the phase plane of planar systems."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from ...flow import Segment, Trajectory
from ...flow.names import shown_mode
from ...model import Array, DefinitionError, FilippovSystem, OptionError, whole
from .. import style
from ..arguments import results
from ..drawing import Canvas, Colors, Drawn, canvas
from .surfaces import draw_surfaces

#: Marker of each kind of event; shapes differ without colour.
MARKERS = {
    "crossing": ("o", "white", "crossing"),
    "entry": ("v", style.BLACK, "entry into sliding"),
    "exit": ("^", "white", "exit from sliding"),
    "stop": ("s", style.BLACK, "stop"),
    "reset": ("D", "white", "reset"),
    "impact": ("d", style.GREY, "impact"),
    "contact": ("p", style.BLACK, "contact"),
    "release": ("h", "white", "release"),
    "jump": ("D", style.BLACK, "jump"),
    "rest": ("*", style.BLACK, "rest"),
    "rest_below": ("*", "white", "rest below a speed"),
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
_JUMPS = ("reset", "impact", "jump")
_CYCLE = (style.ABOVE, style.BLUE, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
_GRID_FROM = 5  # states; fewer are stacked in one column
_LISTED = 6  # entries of a legend
_SHORT = 12  # letters of a name that stands beside its panel
_MANY = 300  # events; more are not marked one by one


def trajectory(
    run: Trajectory | Sequence[Trajectory],
    *,
    states: list[str] | None = None,
    phase_plane: bool | None = None,
    samples: int = 2000,
    ax: Axes | None = None,
    figure: FigureBase | None = None,
    size: tuple[float, float] | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw states against time, one panel each, with modes and events marked.

    The strip on top of a column names the mode of each segment; sliding is also drawn thick, motion
    below the surface dashed. A planar system gets its phase plane with the surface beside it. With
    ``ax=`` there is one panel: the phase plane, or all states against time.

    Parameters
    ----------
    run : Trajectory or sequence of Trajectory
        From ``simulate`` or ``follow``; several of one system are drawn over each other.
    states : list of str, optional
        Names of the states to draw; all by default.
    phase_plane : bool, optional
        Whether to draw the phase plane; by default for two states.
    samples : int, optional
        Points in time at which the dense output is drawn, besides the steps.
    ax : matplotlib Axes, optional
        Where to draw one panel, without a legend.
    figure : matplotlib Figure, optional
        Where to draw the panels; a new one by default.
    size : (float, float), optional
        Of a new figure, in inches.
    colors : mapping, optional
        Colours by mode, such as ``{"s": "tab:red"}``.
    **look
        Properties of ``matplotlib.lines.Line2D`` (``color``, ``linestyle``, ...) for all modes.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the figure or the axes if they were given.

    Raises
    ------
    DefinitionError
        ``run`` is not a trajectory, or a phase plane of a system that is not planar.
    OptionError
        An unknown state, no positive number of samples, or both axes and a figure.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> block = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])
    >>> figure = ns.plot.trajectory(ns.simulate(block, [3.0, 0.0], t_end=15.0))
    >>> [ax.get_ylabel() for ax in figure.axes if ax.get_ylabel()]
    ['x', 'v', 'v']
    """
    runs = results(run, Trajectory, "simulate(system, x0, t_end) returns one.", DefinitionError)
    system = runs[0].system
    names = _states(system, states)
    plane = system.dimension == 2 if phase_plane is None else phase_plane
    if plane and (system.dimension != 2 or any(one.system.dimension != 2 for one in runs)):
        raise DefinitionError(
            f"phase_plane=True needs 2 states, but the system has {system.dimension}: "
            f"{', '.join(system.state_names)}. Leave it out to draw states against time."
        )
    if ax is not None and figure is not None:
        raise OptionError("ax and figure are both given. Give one of them.")
    columns = 1 if len(names) < _GRID_FROM else math.ceil(len(names) / 4)
    rows = math.ceil(len(names) / columns)
    usual = (7.0 if plane or columns > 1 else 5.0, max(1.3 * rows + 1.2, 3.4))
    panels = ax is None
    place, count = (figure if panels else ax), whole(samples, "samples")
    with canvas(place, size, usual, colors=colors, look=look, panels=panels) as page:
        picture = _Picture(page, runs, count)
        if not panels:
            picture.phase_plane(page.ax) if plane else picture.against_time(page.ax, names)
            return page.drawn
        grid = page.figure.add_gridspec(
            rows + 1,
            columns + plane,
            height_ratios=[0.13, *[1.0] * rows],
            width_ratios=[1.0] * columns + [1.0 if columns == 1 else 1.2] * plane,
        )
        for column in range(columns):
            picture.time_column(grid, column, names[column * rows : (column + 1) * rows])
        if plane:
            picture.phase_plane(page.figure.add_subplot(grid[1:, columns]))
        picture.explain(plane)
    return page.drawn


class _Part:
    """One segment with times and states at which it is drawn."""

    def __init__(self, run: Trajectory, segment: Segment, samples: int, jumps: Array):
        span = abs(run.t[-1] - run.t[0]) or 1.0
        low, high = sorted((segment.t_start, segment.t_end))
        count = max(int(samples * (high - low) / span), 8)
        steps = run.t[(run.t > low) & (run.t < high)] if len(run.t) < samples else run.t[:0]
        # stay inside: at the ends, a jump would show the state after it
        inner = (high - low) * 1e-9
        times = np.union1d(np.linspace(low + inner, high - inner, count), steps)
        jumps = jumps[(low < jumps) & (jumps < high)]
        around = np.concatenate([jumps - inner, jumps + inner])
        times = np.union1d(times, np.clip(around, low, high)) if len(jumps) else times
        x = run(times)
        # a jump is a gap in the curve
        k = np.searchsorted(times, jumps)
        self.segment, self.t, self.x = (
            segment,
            np.insert(times, k, jumps),
            np.insert(x, k, np.nan, axis=0),
        )


def _states(system: FilippovSystem, states: list[str] | None) -> list[str]:
    known = list(system.state_names)
    unknown = [name for name in states or [] if name not in known]
    if unknown or states == []:
        raise OptionError(
            f"states={states!r} are not names among {known}. Leave states= out to draw all of them."
        )
    return list(states) if states else known


class _Picture:
    """Draws runs of one system into panels."""

    def __init__(self, page: Canvas, runs: list[Trajectory], samples: int):
        self.page, self.runs, self.run = page, runs, runs[0]
        jumps = [run.events.t[np.isin(run.events.column("kind"), _JUMPS)] for run in runs]
        self.parts = [
            _Part(run, segment, samples, own)
            for run, own in zip(runs, jumps, strict=True)
            for segment in run.segments
        ]
        few = sum(len(run.events) for run in runs) <= _MANY
        self.events = [e for run in runs for e in run.events] if few else [runs[-1].events[-1]]
        self.looks, self.texts = self._looks()

    def _looks(self) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
        """Properties of the lines of each mode, and its explanation, in order of appearance."""
        modes = {self._name(part.segment): part.segment.mode for part in self.parts}
        several = any(mode not in _MODES or len(name) > 1 for name, mode in modes.items())
        looks, texts = dict[str, dict[str, Any]](), dict[str, str]()
        for k, (name, mode) in enumerate(modes.items()):
            color, dashes, width, text = _MODES.get(mode, _MODES[""])
            if several:
                width, text = (3.0 if "s" in mode else 1.5), name.replace("-", "−")
                color, dashes = _CYCLE[k % 6], "-" if "s" in mode else _DASHES[k % 4]
            looks[name] = self.page.look(name, color=color, linestyle=dashes, linewidth=width)
            texts[name] = text
        return looks, texts

    def _name(self, segment: Segment) -> str:
        """The mode of a segment, with the values of the discrete states."""
        return shown_mode(self.run.system, segment.mode, segment.discrete)

    def time_column(self, grid: Any, column: int, names: list[str]) -> None:
        """Panels of states below a strip with the modes."""
        if not names:
            return
        strip = self.page.figure.add_subplot(grid[0, column])
        if len(self.runs) == 1:
            self._strip(strip)
        else:
            strip.set_axis_off()
        for row, name in enumerate(names):
            ax = self.page.figure.add_subplot(grid[row + 1, column], sharex=strip)
            self.against_time(ax, [name])
            if len(name) > _SHORT:  # longer than the panel is high
                ax.set_ylabel("")
                ax.set_title(
                    _broken(name, 0.75 * grid.figure.get_figwidth() / grid.ncols, 5.5),
                    loc="left",
                    fontsize=style.points(8.5),
                    pad=3.0,
                )
            if row < len(names) - 1:
                ax.set_xlabel("")
                ax.tick_params(labelbottom=False)

    def against_time(self, ax: Axes, names: list[str]) -> None:
        """States against time in one panel."""
        index = [self.run.system.state_names.index(name) for name in names]
        for part in self.parts:
            for k in index:
                ax.plot(part.t, part.x[:, k], **self.looks[self._name(part.segment)])
            if "s" in part.segment.mode:
                ax.axvspan(part.segment.t_start, part.segment.t_end, color="#EDEDED", zorder=0)
        for k in index:
            self._mark(ax, lambda event, k=k: (event.t, event.x[k]))
        for time in (run.accumulation_time for run in self.runs):
            if time is not None:
                ax.axvline(time, color=style.PURPLE, linestyle=":", linewidth=1.2)
        ax.set(xlabel="t", ylabel=", ".join(names))
        ax.margins(x=0.02)

    def _strip(self, ax: Axes) -> None:
        """Bar with the mode of each segment, if the segment is wide enough."""
        span = abs(self.run.t[-1] - self.run.t[0]) or 1.0
        letter = 0.012 * style.points(9) * self.page.figure.dpi / ax.bbox.width
        for segment in self.run.segments:
            low, high = sorted((segment.t_start, segment.t_end))
            hatch = "///" if "s" in segment.mode else None
            look: Any = {
                "facecolor": self.looks[self._name(segment)]["color"],
                "edgecolor": "white",
            }
            box = Rectangle((low, 0.0), high - low, 1.0, **look, linewidth=0.5, hatch=hatch)
            box.set_alpha(0.3)
            ax.add_patch(box)
            text = self._name(segment).replace("-", "−")
            if (high - low) / span > letter * max(len(text), 1):
                name: Any = {"fontsize": style.points(9), "fontweight": "bold"}
                halo = style.halo(2.0)
                style.write(ax, ((low + high) / 2, 0.45), text, path_effects=halo, **name)
        ax.set(ylim=(0, 1), yticks=[])
        ax.tick_params(bottom=False, labelbottom=False)
        for side in ("top", "left", "right", "bottom"):
            ax.spines[side].set_visible(False)

    def _mark(self, ax: Axes, where: Any) -> None:
        for kind, (marker, face, _) in MARKERS.items():
            points = np.array([where(event) for event in self.events if event.kind == kind])
            if len(points):
                mark = style.marker(marker, "", face, size=5, markeredgewidth=0.8)
                mark.set(data=points.T, gid=f"event {kind}", zorder=5)
                ax.add_line(mark)

    def phase_plane(self, ax: Axes) -> None:
        """The runs in the plane of both states, with the surface."""
        for part in self.parts:
            line = {"zorder": 3, **self.looks[self._name(part.segment)]}
            ax.plot(*part.x.T, **line)
            if "s" not in part.segment.mode and np.all(np.isfinite(part.x)):
                style.arrowhead(ax, part.x, 0.5, line["color"], mutation_scale=11, zorder=4)
        for run in self.runs:
            ax.plot(*run.x[0], "o", color=style.GREEN, markersize=6, zorder=5, gid="start")
        self._mark(ax, lambda event: event.x)
        ax.margins(0.08)
        ax.locator_params(axis="x", nbins=5)  # more would move the frame, which moves them
        low, high = ax.get_xlim(), ax.get_ylim()
        run = self.run
        if not run.system.time_dependent:
            draw_surfaces(ax, run.system, np.array(list(run.parameters.values())), (*low, *high))
        figure = self.page.figure
        room = 0.38 * figure.get_figwidth(), 0.5 * figure.get_figheight()
        x, y = (_broken(name, r, 7.0) for name, r in zip(run.system.state_names, room, strict=True))
        ax.set(xlim=low, ylim=high, xlabel=x, ylabel=y)

    def explain(self, plane: bool) -> None:
        """A title and a legend; a long legend is split into modes above and marks below."""
        figure, handles, modes = self.page.figure, self._legend(plane), len(self.looks)
        columns = min(4, max(1, int(figure.get_figwidth() / 1.6)))
        title = self._title() if len(self.runs) == 1 else ""
        if len(handles) <= _LISTED:
            figure.suptitle(title, fontfamily="monospace")
            count = min(len(handles), columns)
            figure.legend(handles=handles, loc="outside lower center", ncols=count)
            return
        upper = figure.legend(
            handles=_shortened(handles[:modes]),
            loc="outside upper center",
            ncols=min(modes, columns),
            title=title,
        )
        font = FontProperties(family="monospace", size=style.points(10))
        upper.get_title().set_fontproperties(font)
        rest = _shortened(handles[modes:])
        if rest:
            figure.legend(handles=rest, loc="outside lower center", ncols=min(len(rest), columns))

    def _title(self) -> str:
        itinerary, width = self.run.itinerary.replace("-", "−"), self.page.figure.get_figwidth()
        line = int(12 * width)  # letters
        room = min(48, line - 12)
        if len(itinerary) > room:
            itinerary = itinerary[: room - 4].rstrip() + " …"
        parts = f"itinerary: {itinerary}", f"status: {self.run.status}"
        gap = "   " if sum(map(len, parts)) + 3 <= line else "\n"
        return gap.join(parts)

    def _legend(self, plane: bool) -> list[Line2D | Patch]:
        handles: list[Line2D | Patch] = [
            Line2D([], [], label=self.texts[mode], **line) for mode, line in self.looks.items()
        ]
        present = {event.kind for event in self.events}
        for kind, (marker, face, text) in MARKERS.items():
            if kind in present:
                handles.append(style.marker(marker, text, face, size=5))
        if plane:
            start: Any = {"color": style.GREEN, "markeredgecolor": style.GREEN}
            handles.append(Line2D([], [], linestyle="none", marker="o", label="start", **start))
        if any(run.accumulation_time is not None for run in self.runs):
            handles.append(style.line(style.PURPLE, "accumulation time", dashes=":"))
        lines = [line for ax in self.page.figure.axes for line in ax.lines]
        if any(line.get_gid() == "surface" for line in lines):
            handles.append(style.line(style.GREY, "surface", 2.2, alpha=0.7))
        return handles


def _broken(name: str, room: float, letter: float) -> str:
    """A name in lines that fit the room in inches, with letters of a width in points."""
    letters = max(int(72 * room / letter), 4)
    lines = textwrap.wrap(name.replace("_", "_ "), letters)
    return "\n".join(line.replace("_ ", "_") for line in lines) if len(name) > letters else name


def _shortened(handles: list[Line2D | Patch]) -> list[Line2D | Patch]:
    if len(handles) <= _LISTED:
        return handles
    more = f"and {len(handles) - _LISTED + 1} more, named above the panels"
    return [*handles[: _LISTED - 1], Patch(alpha=0.0, label=more)]
