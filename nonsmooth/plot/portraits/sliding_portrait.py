"""Sliding portraits: regions, folds and sliding orbits on a surface of a system of three states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ...local.point.regions import Region
from ...local.scans.box import Box
from ...local.scans.surface_scan import REGIONS, SurfaceScan
from ...model import Array, FilippovSystem, Parameters, condition_as_surface, real, whole
from ...orbit.manifolds.sliding_orbits import SlidingOrbits
from .. import style
from ..arguments import held, require_one_surface
from ..drawing import Canvas, Colors, Drawn, canvas
from ..labels import Labels
from ..legends import beside
from .tapered_ends import draw_orbit

_ATTRACTING, _REPELLING = REGIONS.index(Region.ATTRACTING), REGIONS.index(Region.REPELLING)
_NAMES = ("$D_a$", "$D_r$", "$C_1$", "$C_2$")
_TINTS = (style.TINT_ATTRACTING, style.TINT_REPELLING, style.TINT_CROSSING, "#E4E4E4")
_TEXTS = (
    "$D_a$: attracting sliding",
    "$D_r$: repelling sliding",
    "$C_1$: crossing up",
    "$C_2$: crossing down",
)
_OF_CONDITION = ("$D_a$: closed", "", "$C_1$: opens", "$C_2$: closes")
_DASHES: dict[bool, Any] = {True: "-", False: style.DASHED}
_CANARD, _FAUX, _MANIFOLD = "canard", "faux canard", "manifold of a pseudo-saddle"
_SPECIAL: dict[str, tuple[str, Any]] = {
    _CANARD: (style.CANARD, "-"),
    _FAUX: (style.FAUX_CANARD, style.LONG_DASH),
    _MANIFOLD: (style.PURPLE, "-"),
}
_MARKERS = {"node": "s", "focus": "o", "saddle": "X"}
_SMALLEST = 0.008  # share of the box below which a region gets no name


def sliding_portrait(
    system: FilippovSystem,
    box: Sequence[float] | Sequence[Sequence[float]],
    *,
    coordinates: Sequence[str] | None = None,
    guess: float = 0.0,
    parameters: Parameters | None = None,
    holding: Mapping[Any, float] | None = None,
    orbits: int = 12,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    labels: bool | None = None,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw the switching surface of a system of three states over two of them.

    The regions of sliding and crossing, the fold curves (visible: solid, invisible: dashed),
    cusps, two-folds with their class, pseudo-equilibria, and sliding orbits with the direction of
    time; canards through two-folds and the manifolds of pseudo-saddles stand out. Everything is
    found on a grid of 1/200 of the box and then solved for, so closer pairs can be missed. Stops
    and resets are ignored.

    Parameters
    ----------
    system : FilippovSystem
        Three states besides discrete ones, one surface or complementarity condition, no explicit time. A condition slides
        where it is closed.
    box : (xmin, xmax, ymin, ymax) or ((xmin, xmax), (ymin, ymax))
        Limits of the two coordinates.
    coordinates : (str, str), optional
        Names of the states drawn to the right and up. By default the state along which the
        surface is steepest is left out.
    guess : float, optional
        Of the remaining state: where the search for the surface starts.
    parameters : mapping, optional
        Values that replace defaults.
    holding : mapping, optional
        Values of the discrete states, where the system has such.
    orbits : int, optional
        About how many sliding orbits would fit across the box; 0 for none.
    ax : matplotlib Axes, optional
        Axes to draw into; default a new figure.
    size : (float, float), optional
        Inches, of a new figure.
    legend : bool, optional
        Whether the regions and their orbits are explained in a legend.
    labels : bool, optional
        Whether folds, canards and special points are named beside them; by default where there is a
        legend.
    title : str, optional
        Title of the picture; the default says what is shown.
    colors : mapping, optional
        Colours by ``"orbit"``, ``"canard"``, ``"faux canard"`` and the names in the legend.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the sliding orbits.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    DefinitionError
        Not three states, explicit time, several surfaces, hidden dynamics; a state that is none;
        no surface in the box.
    OptionError
        Discrete states without ``holding``; a box without an inside; a number of orbits or a size out of its range; axes that are none.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> problem = ns.textbook.two_fold("VV-C1")
    >>> figure = ns.plot.sliding_portrait(problem.system, (-1, 1, -1, 1))
    >>> figure.axes[0].get_xlabel()
    'z2'
    """
    (one,) = held(system, holding, "this picture has no panels")
    system = one.system
    texts = _OF_CONDITION if system.complementarity else _TEXTS
    require_one_surface(
        system,
        "sliding_portrait",
        3,
        "Use phase_portrait for two states; hold states of a larger one.",
    )
    whole(orbits, "orbits", least=0)
    if system.complementarity:
        system = condition_as_surface(system)
    values = dict(zip(system.parameter_names, system.parameter_vector(parameters), strict=True))
    scan = SurfaceScan.of(system, values, Box.read(box), coordinates, real(guess, "guess"))
    with canvas(ax, size, (7.0, 4.8), colors=colors, look=look, title=title) as page:
        axes = page.ax
        portrait = _Portrait(page, scan, texts)
        portrait.draw(orbits)
        names, limits = [system.state_names[i] for i in scan.shown], scan.box.limits
        axes.set(xlim=limits[:2], ylim=limits[2:], xlabel=names[0], ylabel=names[1])
        if legend:
            portrait.legend()
        if legend if labels is None else labels:
            portrait.line_names()
    return page.drawn


class _Portrait:
    """Draws one portrait."""

    def __init__(self, page: Canvas, scan: SurfaceScan, texts: Sequence[str]):
        self.page, self.ax, self.scan, self.texts = page, page.ax, scan, texts
        self.flow = SlidingOrbits(scan)
        self.labels = Labels(self.ax)
        self.named: dict[str, Array] = {}
        self.separated: list[Array] = []

    def draw(self, orbits: int) -> None:
        """Draw every part, from the back."""
        self.tints()
        self.separatrices()
        if orbits:
            self.orbits(orbits)
        for fold in self.scan.folds:
            color = style.FIELDS[fold.side]
            for piece, visible in fold.pieces:
                self.ax.plot(
                    *piece.T,
                    color=color,
                    linewidth=2.2,
                    linestyle=_DASHES[visible],
                    zorder=4,
                    gid=f"{'visible' if visible else 'invisible'} fold",
                )
        self.marks()
        self.names()

    def tints(self) -> None:
        """Colour the regions."""
        u, v = self.scan.mesh
        shown = np.ma.masked_less(self.scan.regions, 0)
        self.ax.pcolormesh(
            u,
            v,
            shown,
            cmap=self.page.palette(self._tint(kind) for kind in range(4)),
            vmin=-0.5,
            vmax=3.5,
            shading="nearest",
            rasterized=True,
            zorder=0,
        )

    def _tint(self, kind: int) -> Any:
        return self.page.color(self.texts[kind], _TINTS[kind])

    def _orbit(self, attracting: bool) -> dict[str, Any]:
        color = style.ATTRACTING if attracting else style.REPELLING
        return self.page.look("orbit", color=color, linewidth=0.9)

    def separatrices(self) -> None:
        """Eigenlines of two-folds and manifolds of pseudo-saddles."""
        for fold in self.scan.two_folds:
            for name, curve in self.flow.eigenlines(fold):
                self._separatrix(name, curve)
        for found in self.scan.pseudo_equilibria:
            if found.kind == "pseudo-saddle":
                for curve in self.flow.manifolds(found):
                    self._separatrix(_MANIFOLD, curve)

    def _separatrix(self, name: str, curve: Array) -> None:
        if len(curve) < 3:
            return
        color, dashes = _SPECIAL[name]
        line = self.page.named(name, color=color, linewidth=2.4, linestyle=dashes)
        self.ax.plot(*curve.T, zorder=3, gid=name, path_effects=style.halo(3.6), **line)
        style.arrowhead(self.ax, curve, 0.5, line["color"], mutation_scale=15, zorder=3.1)
        self.named.setdefault(name, curve)
        self.separated.append(curve)

    def orbits(self, count: int) -> None:
        """Sliding orbits, about evenly spaced."""
        for orbit, attracting in self.flow.spaced(count, self.separated):
            line: Any = {"zorder": 2, "gid": "orbit", **self._orbit(attracting)}
            color, width = line["color"], line.pop("linewidth")
            draw_orbit(self.ax, orbit.curve, orbit.thins, self.scan.box, width, **line)
            if self.scan.box.length(orbit.curve) > 0.1:
                style.arrowhead(self.ax, orbit.curve, 0.55, color, mutation_scale=10, zorder=2.1)

    def marks(self) -> None:
        """Cusps, two-folds and pseudo-equilibria."""
        for fold in self.scan.folds:
            for cusp in fold.cusps:
                self._mark(cusp, "^", style.FIELDS[fold.side], gid="cusp")
        for found in self.scan.two_folds:
            point = self.scan.flat(found.point)
            self._mark(point, "o", style.BLACK, gid="two-fold")
            name = found.label.removeprefix("boundary ")
            name = name.replace("Delta", "Δ").replace("nu", "ν")
            self.labels.name(name, point, fontsize=style.points(9))
        for rest in self.scan.pseudo_equilibria:
            marker = _MARKERS.get(rest.kind.rpartition("-")[2], "P")
            fill = style.BLACK if rest.stable or "saddle" in rest.kind else "white"
            point = self.scan.flat(rest.point)
            self._mark(point, marker, fill, gid=rest.kind, markersize=8)

    def _mark(self, point: Array, marker: str, fill: str, **options: Any) -> None:
        style_ = {"markersize": 6.5, "markeredgecolor": style.BLACK, "zorder": 7, **options}
        self.ax.plot(*point, linestyle="none", marker=marker, markerfacecolor=fill, **style_)

    def _free(self) -> NDArray[np.bool_]:
        """Grid points that are not close to a mark or a separatrix."""
        from scipy.ndimage import binary_dilation

        scan, regions = self.scan, self.scan.regions
        marks = [scan.flat(f.point) for f in scan.two_folds]
        marks += [scan.flat(e.point) for e in scan.pseudo_equilibria]
        points = np.vstack([np.reshape(marks, (-1, 2)), *self.separated])
        n = len(regions)
        j, i = np.clip((points - scan.box.corner) / scan.box.size * n, 0, n - 1).astype(int).T
        taken = np.zeros(regions.shape, dtype=bool)
        taken[i, j] = True
        return np.asarray(~binary_dilation(taken, iterations=n // 18))

    def names(self) -> None:
        """Write the name of each region where it has most room."""
        from scipy.ndimage import distance_transform_edt, label

        (u, v), free = self.scan.mesh, self._free()
        box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
        for kind, name in enumerate(_NAMES):
            parts, count = label(self.scan.regions == kind)
            for k in range(1, count + 1):
                part = parts == k
                if part.mean() < _SMALLEST:
                    continue
                room = part & free if np.any(part & free) else part
                deep = distance_transform_edt(np.pad(room, 1))[1:-1, 1:-1]
                i, j = np.unravel_index(int(np.argmax(deep)), deep.shape)
                point = (float(u[j]), float(v[i]))
                style.write(
                    self.ax,
                    point,
                    name,
                    fontsize=style.points(13),
                    zorder=7.5,
                    bbox=box,
                    gid="region",
                )

    def legend(self) -> None:
        """Explain colours, lines and marks beside the axes."""
        handles: list[Line2D | Patch] = [
            Patch(facecolor=self._tint(k), edgecolor="#BBBBBB", label=self.texts[k])
            for k in range(4)
            if np.any(self.scan.regions == k)
        ]
        if np.any(self.scan.regions == _ATTRACTING):
            handles.append(Line2D([], [], label="sliding orbits in $D_a$", **self._orbit(True)))
        if np.any(self.scan.regions == _REPELLING):
            handles.append(Line2D([], [], label="sliding orbits in $D_r$", **self._orbit(False)))
        beside(self.ax, handles)

    def line_names(self) -> None:
        """Name folds, canards, manifolds and special points beside them."""
        for side, name in (("+", "F_1"), ("-", "F_2")):
            for visible, visibility in ((True, "visible"), (False, "invisible")):
                pieces = [
                    piece
                    for fold in self.scan.folds
                    for piece, seen in fold.pieces
                    if fold.side == side and seen is visible
                ]
                if pieces:
                    text = f"fold of ${name}$,\n{visibility}"
                    self.labels.name(text, np.vstack(pieces), style.FIELDS[side])
        for name, curve in self.named.items():
            self.labels.name(name, curve, _SPECIAL[name][0])
        for fold in self.scan.folds:
            for cusp in fold.cusps:
                self.labels.name("cusp", cusp)
        for found in self.scan.pseudo_equilibria:
            self.labels.name(found.kind, self.scan.flat(found.point))
