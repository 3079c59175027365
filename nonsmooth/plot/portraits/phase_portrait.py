"""Phase portraits of planar Filippov systems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from contourpy import contour_generator
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from ...local import Equilibrium, Fold, PseudoEquilibrium
from ...local.scans.box import Box
from ...local.scans.plane_scan import Piece, PlaneScan
from ...model import Array, FilippovSystem, Parameters, PointError
from ...orbit.manifolds.plane_orbits import PlaneOrbits
from .. import style
from ..arguments import Held, held, require_one_surface
from ..drawing import Canvas, Colors, Drawn, canvas
from ..labels import Labels
from ..legends import beside
from .tapered_ends import draw_orbit

_ORBITS: dict[str, tuple[str, float, str]] = {
    "orbit": ("#444444", 0.9, "orbits"),
    "separatrix": (style.CANARD, 1.8, "separatrices"),
    "fold orbit": (style.GREEN, 1.5, "orbits through visible folds"),
}
_PIECES: dict[str, tuple[str, float, Any, str]] = {
    "attracting": (style.BLACK, 3.4, "-", "sliding, attracting"),
    "repelling": (style.ORANGE, 3.4, (0, (2.2, 1.0)), "sliding, repelling"),
    "crossing": (style.GREY, 1.2, "-", "crossing"),
}
#: What pieces of the boundary of a complementarity condition are.
_CLOSED = {"attracting": "closed condition", "crossing": "condition that opens"}
#: Markers by the last word of a kind.
_MARKERS = {
    "fold": "D",
    "cusp": "^",
    "pseudo-node": "s",
    "pseudo-saddle": "X",
    "pseudo-saddle-node": "P",
    "node": "o",
    "focus": "o",
    "centre": "o",
    "degenerate": "P",
    "saddle": "X",
}
_EVENT_GRID = 161
_EVENT_LINE: dict[str, Any] = {"color": style.PURPLE, "linewidth": 1.6, "linestyle": (0, (4, 2))}
_NO_MOTION = "#E6E6E6"
_ONE_MARK = 0.012  # points so close together, in units of the box, have one name
Special = Fold | PseudoEquilibrium | Equilibrium


def phase_portrait(
    system: FilippovSystem,
    box: Sequence[float] | Sequence[Sequence[float]],
    t_end: float | None = None,
    *,
    parameters: Parameters | None = None,
    holding: Mapping[Any, float] | None = None,
    starts: ArrayLike | None = None,
    separatrices: bool = True,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    labels: bool | None = None,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw the phase portrait of a planar system with one surface, or of a smooth one.

    The directions of both fields, orbits through crossing and sliding, the surface in its
    attracting, repelling and crossing pieces, folds, equilibria, pseudo-equilibria and
    separatrices: invariant manifolds of saddles and pseudo-saddles and the orbits through visible
    folds.

    Of a system with discrete states, or a relay with hysteresis, each panel is for one value of them: orbits end where a
    stop or reset is due, and there is no motion where one is due at once (``level=True``). Stops and resets of other
    systems are ignored. There is no motion where a gap or the y of a complementarity condition is negative;
    along the boundary of a condition pieces are attracting where it is closed.

    Parameters
    ----------
    system : FilippovSystem
        Two states besides discrete ones, one surface, relay or complementarity condition or none, no explicit time.
    box : (xmin, xmax, ymin, ymax) or ((xmin, xmax), (ymin, ymax))
        The window that is drawn, in the two states.
    parameters : mapping, optional
        Values that replace defaults.
    holding : mapping, optional
        Values of the discrete states; of a relay 1 or -1, by the name of its surface: ``{"h0": 1}``. By default all
        that they may have, in panels.
    starts : array_like (k, 2), optional
        Where orbits start, followed forward only; by default orbits fill the box evenly.
    t_end : float, optional
        Duration of each orbit each way; by default long enough to pass the box several times.
    separatrices : bool, optional
        Whether to draw them.
    ax : matplotlib Axes, optional
        Axes to draw into; default a new figure.
    size : (float, float), optional
        Inches, of a new figure.
    legend : bool, optional
        Whether a legend of the lines is drawn.
    labels : bool, optional
        Whether special points are named beside them; by default where there is a legend.
    title : str, optional
        Title of the picture; the default says what is shown.
    colors : mapping, optional
        Colours by ``"attracting"``, ``"repelling"``, ``"crossing"``, ``"orbit"``, ``"separatrix"``, ``"fold orbit"``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the orbits.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    DefinitionError
        The system is not planar, depends on time, or has several surfaces or constraints; discrete states whose values
        are not known.
    OptionError
        A box without an inside; a time or a size that is not positive; axes that are none, or for several panels.
    PointError
        Starts that are no rows of two finite numbers.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.

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
    shown = held(system, holding, "" if ax is None else "ax= is one picture")
    for one in shown:
        require_one_surface(
            one.system,
            "phase_portrait",
            2,
            "Use two_fold for a two-fold in three states; trajectory for runs.",
            smooth=True,
        )
    points = None if starts is None else _points(shown[0].system, starts)
    named, frame = legend if labels is None else labels, Box.read(box)
    scans = [PlaneScan.of(one.system, _values(one, parameters), frame, one.events) for one in shown]
    columns = min(len(shown), 3)
    rows = -(-len(shown) // columns)
    usual = (7.0, 4.8) if len(shown) == 1 else (4.2 * columns, 3.8 * rows + 0.6)
    with canvas(
        ax, size, usual, colors=colors, look=look, title=title, panels=len(shown) > 1
    ) as page:
        panels = page.panels(rows, columns) if len(shown) > 1 else [page]
        portraits = [_Portrait(own, scan, t_end) for own, scan in zip(panels, scans, strict=False)]
        for portrait, one in zip(portraits, shown, strict=True):
            portrait.draw(points, separatrices)
            names, limits = one.system.state_names, frame.limits
            portrait.ax.set(xlim=limits[:2], ylim=limits[2:], xlabel=names[0], ylabel=names[1])
            portrait.ax.set_title(one.name if title is None or len(shown) > 1 else title)
            if named:
                portrait.names()
        if legend and len(shown) == 1:
            beside(portraits[0].ax, portraits[0].handles())
        elif legend:
            handles = {h.get_label(): h for own in portraits for h in own.handles()}
            page.figure.legend(handles=[*handles.values()], loc="outside lower center", ncols=3)
    return page.drawn


def _values(one: Held, parameters: Parameters | None) -> dict[str, float]:
    system = one.system
    return dict(zip(system.parameter_names, system.parameter_vector(parameters), strict=True))


def _points(system: FilippovSystem, starts: ArrayLike) -> Array:
    try:
        points = np.asarray(starts, dtype=float)
    except (TypeError, ValueError):
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise PointError(
            f"starts has shape {points.shape}, but must have finite rows ({', '.join(system.state_names)}), "
            "one for each orbit."
        )
    return points


class _Portrait:
    """Draws one portrait: the results of a scan, and orbits."""

    def __init__(self, page: Canvas, scan: PlaneScan, t_end: float | None):
        self.page, self.ax, self.scan = page, page.ax, scan
        self.flow = PlaneOrbits(scan, t_end)
        self.special: list[Special] = [*scan.equilibria, *scan.folds, *scan.pseudo_equilibria]
        self.special += scan.boundary_equilibria
        self.drawn: set[str] = set()
        self.guards: dict[str, Array] = {}

    def draw(self, starts: Array | None, separatrices: bool) -> None:
        """Draw every part, from the back."""
        self.events()
        self.directions()
        special = list(self.flow.separatrices()) if separatrices else []
        self.orbits(starts, [curve for _, curve in special])
        for name, curve in special:
            self._draw(curve, name)
        self.surface()
        self.marks()

    def directions(self) -> None:
        """Faint arrows of the field on each side."""
        mesh, size = self.scan.box.middles(19), self.scan.box.size
        mesh = mesh[~self.scan.is_excluded(mesh)]
        numbers = self.scan.at(mesh)
        for k, (side, color) in enumerate(style.FIELDS.items()):
            chosen = numbers.h > 0 if side == "+" else numbers.h < 0
            arrows = numbers.fields[chosen, k] / size
            length = np.linalg.norm(arrows, axis=1, keepdims=True)
            arrows = np.divide(arrows, length, out=np.zeros_like(arrows), where=length > 0)
            arrows = arrows * size * 0.028
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

    def events(self) -> None:
        """Where there is no motion, and dashed lines where a stop or reset is due."""
        lines = self.scan.box.lines(_EVENT_GRID)
        grid = self.scan.box.grid(_EVENT_GRID)
        shape = (_EVENT_GRID, _EVENT_GRID)
        none = self.scan.is_excluded(grid).reshape(shape)
        if np.any(none):
            look: Any = {"colors": [_NO_MOTION], "zorder": 0.5}
            self.ax.contourf(*lines, none.astype(float), levels=[0.5, 1.5], **look)
            self.drawn.add("no motion")
        for event, value in zip(self.scan.events, self.scan.of_events(grid), strict=True):
            curves: Any = contour_generator(*lines, value.reshape(shape)).lines(0.0)
            for curve in curves:
                line = self.page.named(event.name, **_EVENT_LINE)
                self.ax.plot(*np.asarray(curve).T, gid=f"event {event.name}", zorder=2.5, **line)
            if curves:
                self.guards[event.name] = np.vstack([np.asarray(c) for c in curves])

    def orbits(self, starts: Array | None, avoid: list[Array]) -> None:
        """Orbits from given starts, or evenly spaced ones through the box."""
        if starts is None:
            for orbit in self.flow.spaced(avoid=avoid):
                self._draw(orbit.curve, "orbit", orbit.thins)
            return
        for start in starts:
            self._draw(self.flow.follow(start), "orbit")
            self.ax.plot(*start, ".", color=style.BLACK, markersize=5, zorder=2.2, gid="start")
            self.drawn.add("start")

    def surface(self) -> None:
        """The surface in its pieces, with the direction of sliding."""
        for piece in self.scan.pieces:
            line = {**self._piece(piece.kind), "solid_capstyle": "butt", "zorder": 4}
            self.ax.plot(*piece.points.T, gid=piece.kind, **line)
            if piece.kind != "crossing":
                self._sliding_arrows(piece)

    def _piece(self, kind: str) -> dict[str, Any]:
        color, width, dashes, _ = _PIECES[kind]
        return self.page.named(kind, color=color, linewidth=width, linestyle=dashes)

    def _orbit(self, name: str) -> dict[str, Any]:
        color, width, _ = _ORBITS[name]
        look = self.page.look if name == "orbit" else self.page.named
        return look(name, color=color, linewidth=width)

    def _sliding_arrows(self, piece: Piece) -> None:
        """One arrow between neighbouring pseudo-equilibria and ends."""
        points = piece.points
        velocity = self.scan.at((points[1:] + points[:-1]) / 2).sliding
        ahead = np.sum(velocity * np.diff(points, axis=0), axis=1) > 0
        cuts = [0, *(np.flatnonzero(ahead[1:] != ahead[:-1]) + 1), len(ahead)]
        for a, b in pairwise(cuts):
            part = points[a : b + 1]
            if self.scan.box.length(part) < 0.04:
                continue
            part = part if ahead[(a + b) // 2] else part[::-1]
            color = self._piece(piece.kind)["color"]
            style.arrowhead(self.ax, part, 0.55, color, mutation_scale=17, zorder=5)

    def marks(self) -> None:
        """Folds, equilibria and pseudo-equilibria."""
        for found in self.special:
            name = _name(found)
            shape, fill = _look(found)
            edge = style.BLACK
            if not isinstance(found, PseudoEquilibrium):
                edge = style.FIELDS[found.side]
                fill = edge if fill != "white" else fill
            self.ax.plot(
                *found.point,
                marker=shape,
                markersize=5.5 if isinstance(found, Fold) else 12 if shape == "*" else 8,
                linestyle="none",
                markeredgecolor=edge,
                markerfacecolor=fill,
                markeredgewidth=1.3,
                zorder=6,
                gid=name,
            )

    def handles(self) -> list[Any]:
        """Lines and marks with what they are, for a legend."""
        words = _CLOSED if self.scan.where.one_sided else {}
        handles: list[Any] = [
            Line2D([], [], label=words.get(kind, text), **self._piece(kind))
            for kind, (*_, text) in _PIECES.items()
            if any(piece.kind == kind for piece in self.scan.pieces)
        ]
        handles += [
            Line2D([], [], label=text, **self._orbit(name))
            for name, (*_, text) in _ORBITS.items()
            if name in self.drawn or name == "orbit"
        ]
        if "start" in self.drawn:
            handles.append(style.marker(".", "where they start", size=5))
        if self.guards:
            handles.append(
                Line2D([], [], label="stops and resets", **self.page.named("event", **_EVENT_LINE))
            )
        if "no motion" in self.drawn:
            handles.append(Patch(facecolor=_NO_MOTION, label="no motion"))
        return handles

    def names(self) -> None:
        """Name the sides of the surface and the special points, beside them."""
        labels = Labels(self.ax)
        mesh = self.scan.box.middles(9)
        mesh = mesh[~self.scan.is_excluded(mesh)]
        h = self.scan.at(mesh).h
        for side, color in style.FIELDS.items():
            chosen = mesh[h > 0 if side == "+" else h < 0]
            if len(chosen) and self.scan.where.mode:
                text = f"$h {'>' if side == '+' else '<'} 0$"
                labels.name(text, chosen, color, inside=True, fontsize=style.points(10))
        for name, curve in self.guards.items():
            labels.name(name, curve, _EVENT_LINE["color"])
        for name, points in _together(self.special, self.scan.box.size).items():
            for point in points:
                labels.name(name, point)

    def _draw(self, curve: Array, name: str, thins: tuple[bool, bool] = (False, False)) -> None:
        if len(curve) < 2:
            return
        self.drawn.add(name)
        order = 2.0 if name == "orbit" else 3.0
        line = {"zorder": order, "gid": name, **self._orbit(name)}
        color, width = line["color"], line.pop("linewidth")
        draw_orbit(self.ax, curve, thins, self.scan.box, width, **line)
        for piece in style.inside(curve, self.scan.box.limits):
            if self.scan.box.length(piece) > 0.1:
                style.arrowhead(
                    self.ax, piece, 0.5, color, mutation_scale=9 + 2 * width, zorder=order + 0.1
                )
                return


def _together(special: list[Special], size: Array) -> dict[str, list[Array]]:
    """Points by their names; coincident ones share a name."""
    groups = list[tuple[Array, list[str]]]()
    for found in special:
        point = np.asarray(found.point, dtype=float)
        near = [names for at, names in groups if np.linalg.norm((at - point) / size) < _ONE_MARK]
        names = near[0] if near else list[str]()
        if not near:
            groups.append((point, names))
        names.append(_name(found))
    together: dict[str, list[Array]] = {}
    for point, names in groups:
        seen = [name if names.count(name) == 1 else f"two {name}s" for name in dict.fromkeys(names)]
        together.setdefault(",\n".join(seen), []).append(point)
    return together


def _name(found: Special) -> str:
    """Name of a special point in the picture."""
    if isinstance(found, Fold):
        return f"{found.kind} fold" if found.order == 2 else found.kind
    name = found.kind
    if isinstance(found, Equilibrium) and name == "degenerate" and np.any(found.eigenvalues.imag):
        name = "centre"
    if isinstance(found, Equilibrium) and found.status == "boundary":
        name = f"boundary {name.rpartition(' ')[2]}"
    return name


def _look(found: Special) -> tuple[str, str]:
    """Marker and fill of a special point."""
    name = _name(found)
    if name.startswith("boundary") and isinstance(found, Equilibrium):
        return "*", style.BLACK if np.all(found.eigenvalues.real < 0) else "white"
    full = name.startswith(("visible", "stable")) or name == "saddle"
    return _MARKERS[name.rpartition(" ")[2]], style.BLACK if full else "white"
