"""Phase portraits of planar Filippov systems."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from ..flow import simulate
from ..model import (
    Array,
    DefinitionError,
    FilippovSystem,
    OptionError,
    Parameters,
    PointError,
    Stop,
    explain,
)
from . import style
from .planar import Mark, Piece, Plane

_TOLERANCE = 1e-8  # of orbits: far below what a picture resolves
_CELLS = 34  # of the mesh that keeps orbits apart
_SEPARATRIX, _FOLD_ORBIT = style.CANARD, style.GREEN
_PIECES: dict[str, tuple[str, float, Any, str]] = {
    "attracting": (style.BLACK, 3.4, "-", "sliding, attracting"),
    "repelling": (style.ORANGE, 3.4, (0, (2.2, 1.0)), "sliding, repelling"),
    "crossing": (style.GREY, 1.2, "-", "crossing"),
}
_MARKERS = {
    "visible fold": ("D", "visible fold"),
    "invisible fold": ("D", "invisible fold (open)"),
    "pseudo-node": ("s", "pseudo-node"),
    "pseudo-saddle": ("X", "pseudo-saddle"),
    "node": ("o", "node"),
    "focus": ("o", "focus"),
    "centre": ("o", "centre"),
    "saddle": ("X", "saddle"),
}


def phase_portrait(
    system: FilippovSystem,
    box: Sequence[float] | Sequence[Sequence[float]],
    *,
    parameters: Parameters | None = None,
    starts: ArrayLike | None = None,
    t_end: float | None = None,
    separatrices: bool = True,
    ax: Axes | None = None,
    size: tuple[float, float] = (7.6, 5.0),
    legend: bool = True,
    title: str | None = None,
) -> Figure:
    """Draw the phase portrait of a planar system with one surface.

    The directions of both fields, orbits through crossing and sliding, the surface in its
    attracting, repelling and crossing pieces, folds, equilibria, pseudo-equilibria and
    separatrices: invariant manifolds of saddles and pseudo-saddles and the orbits through visible
    folds. Stops and resets of the system are ignored.

    Parameters
    ----------
    system : FilippovSystem
        Two states, one surface, no explicit time.
    box : (xmin, xmax, ymin, ymax) or ((xmin, xmax), (ymin, ymax))
    parameters : mapping, optional
        Values that replace defaults.
    starts : array_like (k, 2), optional
        Where orbits start, followed forward only; by default orbits fill the box evenly.
    t_end : float, optional
        Duration of each orbit each way; by default long enough to pass the box several times.
    separatrices : bool, optional
        Whether to draw them.
    ax : matplotlib Axes, optional
    size : (float, float), optional
        Inches, of a new figure.
    legend : bool, optional
    title : str, optional

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    DefinitionError
        The system is not planar, depends on time, or has not exactly one surface.
    OptionError, PointError, ParameterError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> relay = ns.FilippovSystem(
    ...     [x, y], surface=x + y, above=[y - x, 3 * y - 10], below=[y - x, 3 * y + 10])
    >>> figure = ns.plot.phase_portrait(relay, (-4, 4, -4, 4))
    >>> figure.axes[0].get_xlabel()
    'x'
    """
    limits = _limits(system, box)
    plane = Plane(system, system.parameter_vector(parameters), limits)
    with style.settings():
        figure, axes = style.axes_for(ax, size)
        portrait = _Portrait(axes, plane, t_end)
        portrait.draw(None if starts is None else _points(system, starts), separatrices)
        names = system.state_names
        axes.set(xlim=limits[:2], ylim=limits[2:], xlabel=names[0], ylabel=names[1])
        if title is not None:
            axes.set_title(title)
        if legend:
            portrait.legend()
    return figure


def _limits(system: object, box: object) -> tuple[float, float, float, float]:
    if not isinstance(system, FilippovSystem):
        received, advice = type(system).__name__, "Give the system first, then the box."
    elif system.dimension != 2:
        received = f"{system.dimension} states: {', '.join(system.state_names)}"
        advice = "For a two-fold in three states use two_fold; for runs use trajectory."
    elif system.surface_count != 1:
        received = f"{system.surface_count} surfaces"
        advice = "Portraits with several surfaces are not built; draw runs with trajectory."
    elif system.time_dependent:
        received, advice = "explicit time", "Its orbits cross in the plane of the states."
    else:
        try:
            values = np.asarray(box, dtype=float).ravel()
        except (TypeError, ValueError):
            values = np.empty(0)
        if (
            values.shape != (4,)
            or not np.all(np.isfinite(values))
            or not (values[0] < values[1] and values[2] < values[3])
        ):
            raise OptionError(
                explain(
                    "box",
                    expected="(xmin, xmax, ymin, ymax) with xmin < xmax and ymin < ymax",
                    received=repr(box),
                    advice="For example (-1, 1, -2, 2).",
                )
            )
        x0, x1, y0, y1 = values.tolist()
        return x0, x1, y0, y1
    raise DefinitionError(
        explain(
            "phase_portrait",
            expected="an autonomous FilippovSystem of 2 states and 1 surface",
            received=received,
            advice=advice,
        )
    )


def _points(system: FilippovSystem, starts: ArrayLike) -> Array:
    try:
        points = np.asarray(starts, dtype=float)
    except (TypeError, ValueError):
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise PointError(
            explain(
                "starts",
                expected="finite numbers of shape (k, 2)",
                received=f"shape {points.shape}" if points.size else repr(starts),
                advice=f"One row ({', '.join(system.state_names)}) for each orbit.",
            )
        )
    return points


class _Portrait:
    """Draws one portrait; orbits come from ``simulate`` on the system and on its time reversal."""

    def __init__(self, ax: Axes, plane: Plane, t_end: float | None):
        self.ax, self.plane = ax, plane
        self.curves = plane.curves()
        self.pieces: list[Piece] = [p for curve in self.curves for p in plane.pieces(curve)]
        self.found: list[Mark] = plane.equilibria()
        for curve in self.curves:
            self.found += plane.folds(curve) + plane.pseudo_equilibria(curve)
        self.forward, self.backward = _bounded(plane, 1), _bounded(plane, -1)
        self.t_end = _duration(plane) if t_end is None else t_end
        self.drawn: set[str] = set()

    def draw(self, starts: Array | None, separatrices: bool) -> None:
        """Draw every part, from the back."""
        self.directions()
        self.orbits(starts)
        if separatrices:
            self.separatrices()
        self.surface()
        self.marks()

    def directions(self) -> None:
        """Faint arrows of the field on each side."""
        x0, x1, y0, y1 = self.plane.box
        n = 19
        x = np.linspace(x0, x1, 2 * n + 1)[1::2]
        y = np.linspace(y0, y1, 2 * n + 1)[1::2]
        mesh = np.column_stack([v.ravel() for v in np.meshgrid(x, y)])
        values = self.plane.at(mesh)
        for side, field, color in ((1, values.above, style.ABOVE), (-1, values.below, style.BELOW)):
            chosen = side * values.h > 0
            arrows = field[chosen] / self.plane.scale
            length = np.linalg.norm(arrows, axis=1, keepdims=True)
            arrows = np.divide(arrows, length, out=np.zeros_like(arrows), where=length > 0)
            arrows = arrows * self.plane.scale * 0.028
            self.ax.quiver(
                *mesh[chosen].T,
                *arrows.T,
                color=color,
                alpha=0.33,
                pivot="mid",
                angles="xy",
                scale_units="xy",
                scale=1.0,
                width=0.0022,
                headwidth=4.5,
                headlength=5,
                zorder=1,
            )

    def orbits(self, starts: Array | None) -> None:
        """Orbits from given starts, or evenly spaced ones through the box."""
        if starts is not None:
            for start in starts:
                self._draw(self._run(self.forward, start), style.BLACK, 1.0, "orbit")
            return
        n = 12
        mesh = _Mesh(self.plane)
        cells = np.array([(i, j) for i in range(n) for j in range(n)], dtype=float)
        order = np.random.default_rng(0).permutation(len(cells))
        for cell in cells[order]:
            start = np.array(self.plane.box[::2]) + (cell + 0.5) / n * self.plane.scale
            if not mesh.free(start):
                continue
            ahead = mesh.until_met(self._run(self.forward, start))
            behind = mesh.until_met(self._run(self.backward, start))
            whole = np.vstack([behind[:0:-1], ahead])
            if _length(whole, self.plane.scale) > 0.09:
                mesh.add(whole)
                self._draw(whole, "#444444", 0.9, "orbit")

    def separatrices(self) -> None:
        """Manifolds of saddles and pseudo-saddles, orbits through visible folds."""
        for mark in self.found:
            if mark.kind == "visible fold":
                letter = "+" if mark.side > 0 else "-"
                for system, order in ((self.backward, -1), (self.forward, 1)):
                    curve = self._run(system, mark.point, letter)[::order]
                    self._draw(curve, _FOLD_ORBIT, 1.5, "fold orbit")
            elif mark.kind == "saddle" and mark.directions is not None:
                for direction, system, order in zip(
                    mark.directions, (self.backward, self.forward), (-1, 1), strict=True
                ):
                    for sign in (1, -1):
                        start = mark.point + sign * 1e-4 * self.plane.scale.min() * direction
                        self._draw(
                            self._run(system, start)[::order], _SEPARATRIX, 1.8, "separatrix"
                        )
            elif mark.kind == "pseudo-saddle":
                attracting = bool(self.plane.at(mark.point).l1[0] < 0)
                system, order = (self.backward, -1) if attracting else (self.forward, 1)
                for letter in "+-":
                    curve = self._run(system, mark.point, letter)[::order]
                    self._draw(curve, _SEPARATRIX, 1.8, "separatrix")

    def surface(self) -> None:
        """The surface in its pieces, with the direction of sliding."""
        for piece in self.pieces:
            color, width, dashes, _ = _PIECES[piece.kind]
            self.ax.plot(
                *piece.points.T,
                color=color,
                linewidth=width,
                linestyle=dashes,
                zorder=4,
                solid_capstyle="butt",
                gid=piece.kind,
            )
            if piece.kind != "crossing":
                self._sliding_arrows(piece)

    def _sliding_arrows(self, piece: Piece) -> None:
        """One arrow between neighbouring pseudo-equilibria and ends."""
        points = piece.points
        velocity = self.plane.at((points[1:] + points[:-1]) / 2).sliding
        ahead = np.sum(velocity * np.diff(points, axis=0), axis=1) > 0
        cuts = [0, *(np.flatnonzero(ahead[1:] != ahead[:-1]) + 1), len(ahead)]
        for a, b in pairwise(cuts):
            part = points[a : b + 1]
            if _length(part, self.plane.scale) < 0.04:
                continue
            part = part if ahead[(a + b) // 2] else part[::-1]
            color = _PIECES[piece.kind][0]
            style.arrowhead(self.ax, part, 0.55, color, mutation_scale=17, zorder=5)

    def marks(self) -> None:
        """Folds, equilibria and pseudo-equilibria."""
        for mark in self.found:
            if not self.plane.inside(mark.point):
                continue
            marker, _ = _MARKERS[mark.kind]
            color = {1: style.ABOVE, -1: style.BELOW, 0: style.BLACK}[mark.side]
            filled = mark.kind == "visible fold" or mark.stable or "saddle" in mark.kind
            self.ax.plot(
                *mark.point,
                marker=marker,
                markersize=5.5 if "fold" in mark.kind else 8,
                linestyle="none",
                markeredgecolor=color if mark.side else style.BLACK,
                markerfacecolor=color if filled else "white",
                markeredgewidth=1.3,
                zorder=6,
                gid=mark.kind,
            )

    def legend(self) -> None:
        """Explain lines and marks beside the axes."""
        handles = [
            _line(style.ABOVE, "field above, $h>0$", 1.0, alpha=0.5),
            _line(style.BELOW, "field below, $h<0$", 1.0, alpha=0.5),
            _line("#444444", "orbits", 0.9),
        ]
        for kind, (color, width, dashes, text) in _PIECES.items():
            if any(piece.kind == kind for piece in self.pieces):
                handles.append(_line(color, text, width, dashes))
        if "separatrix" in self.drawn:
            handles.append(_line(_SEPARATRIX, "separatrices", 1.8))
        if "fold orbit" in self.drawn:
            handles.append(_line(_FOLD_ORBIT, "orbits through visible folds", 1.5))
        for kind, (marker, text) in _MARKERS.items():
            for stable in (True, False, None):
                if any(
                    m.kind == kind and m.stable is stable and self.plane.inside(m.point)
                    for m in self.found
                ):
                    handles.append(_marker(marker, kind, text, stable))
        self.ax.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0
        )

    # strokes -----------------------------------------------------------------------------------

    def _run(self, system: FilippovSystem, start: Array, mode: str | None = None) -> Array:
        if not np.all(np.isfinite(start)):
            return np.empty((0, 2))
        run = simulate(
            system,
            start,
            t_end=self.t_end,
            tol=_TOLERANCE,
            start_mode=mode,
            max_events=200,
            max_steps=4000,
        )
        if run.t[-1] == run.t[0]:
            return run.x[:1]
        # a step is a Taylor polynomial: a few points in each draw it
        share = np.linspace(0.0, 1.0, 13)[:-1]
        times = (run.t[:-1, None] + share * np.diff(run.t)[:, None]).ravel()
        return np.vstack([run(times), run.x[-1:]])

    def _draw(self, curve: Array, color: str, width: float, name: str) -> None:
        if len(curve) < 2:
            return
        self.drawn.add(name)
        order = 2.0 if name == "orbit" else 3.0
        self.ax.plot(*curve.T, color=color, linewidth=width, zorder=order, gid=name)
        for piece in style.inside(curve, self.plane.box):
            if _length(piece, self.plane.scale) > 0.1:
                style.arrowhead(
                    self.ax, piece, 0.5, color, mutation_scale=9 + 2 * width, zorder=order + 0.1
                )
                return


class _Mesh:
    """Cells of the box that orbits have visited."""

    def __init__(self, plane: Plane):
        self.low, self.scale = np.array(plane.box[::2]), plane.scale
        self.taken: set[tuple[int, int]] = set()

    def _cells(self, curve: Array) -> list[tuple[int, int]]:
        unit = (np.atleast_2d(curve) - self.low) / self.scale * _CELLS
        return [(int(a), int(b)) for a, b in np.floor(unit)]

    def free(self, point: Array) -> bool:
        """Whether no orbit is in the cell of a point or in its neighbours."""
        i, j = self._cells(point)[0]
        return not any((i + a, j + b) in self.taken for a in (-1, 0, 1) for b in (-1, 0, 1))

    def until_met(self, curve: Array) -> Array:
        """Part of a curve before it comes to a cell taken by another, or by itself long ago."""
        first: dict[tuple[int, int], int] = {}
        distinct = 0
        last: tuple[int, int] | None = None
        for k, cell in enumerate(self._cells(curve)):
            if cell == last:
                continue
            distinct, last = distinct + 1, cell
            if cell in self.taken or distinct - first.setdefault(cell, distinct) > 8:
                return curve[: k + 1]
        return curve

    def add(self, curve: Array) -> None:
        """Take the cells of a curve."""
        self.taken.update(self._cells(curve))


def _bounded(plane: Plane, direction: int) -> FilippovSystem:
    """Return the system, or its time reversal, with stops a little outside the box."""
    system = plane.system
    x, y = system.extended_states[0], system.extended_states[1]
    x0, x1, y0, y1 = plane.box
    dx, dy = 0.03 * plane.scale
    walls = [x - (x0 - dx), (x1 + dx) - x, y - (y0 - dy), (y1 + dy) - y]
    symbols = [system.parameter_symbols[k] for k in range(len(plane.parameters))]
    above, below = ([direction * system.field(m)[k] for k in (0, 1)] for m in "+-")
    return FilippovSystem(
        [x, y],
        surface=system.surface_function(0),
        above=above,
        below=below,
        parameters=dict(zip(symbols, plane.parameters.tolist(), strict=True)),
        stops=[Stop(wall, -1, f"wall {k}") for k, wall in enumerate(walls)],
    )


def _duration(plane: Plane) -> float:
    """Time in which a typical orbit passes the box several times."""
    rng = np.random.default_rng(0)
    points = np.array(plane.box[::2]) + rng.uniform(size=(400, 2)) * plane.scale
    values = plane.at(points)
    fields = np.where(values.h[:, None] > 0, values.above, values.below)
    speed = np.linalg.norm(fields / plane.scale, axis=1)
    speed = speed[np.isfinite(speed) & (speed > 0)]
    return 8.0 / float(np.quantile(speed, 0.25)) if speed.size else 1.0


def _length(curve: Array, scale: Array) -> float:
    return float(np.linalg.norm(np.diff(curve, axis=0) / scale, axis=1).sum())


def _line(color: str, text: str, width: float, dashes: Any = "-", alpha: float = 1.0) -> Line2D:
    return Line2D([], [], color=color, linewidth=width, linestyle=dashes, label=text, alpha=alpha)


def _marker(marker: str, kind: str, text: str, stable: bool | None) -> Line2D:
    word = {True: "stable ", False: "unstable ", None: ""}[stable]
    filled = stable or kind == "visible fold" or "saddle" in kind
    return Line2D(
        [],
        [],
        linestyle="none",
        marker=marker,
        markersize=6,
        markeredgecolor=style.BLACK,
        markerfacecolor=style.BLACK if filled else "white",
        label=word + text,
    )
