"""The flow at a two-fold in three dimensions.

Orbits of the two fields of the normal form are parabolas, which are drawn exactly. The picture is an
orthographic projection, painted in the order below, on and above the surface. This order is right for
every view from above and gives vector graphics without hidden-line artefacts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import ArrayLike

from ...local.point.surface_point import SIDES, Side, other
from ...local.scans.box import Box
from ...local.two_folds import ReducedFlow, diabolo_slopes, flight_above, flight_below
from ...local.two_folds.flights import has_diabolo
from ...local.two_folds.parabolas import arc, flight, passage
from ...local.two_folds.reduced_flow import eigenlines, sectors
from ...model import Array, OptionError
from .. import style
from ..drawing import Canvas, Colors, Drawn, canvas
from ..labels import Labels
from ..legends import beside
from ..portraits.tapered_ends import draw_orbit
from .annotation import TINTS, Portrait, label_points, line_style, portrait_of, title_of


@dataclass(frozen=True)
class Camera:
    """Orthographic projection of (z1, z2, z3), z1 upwards, seen from above Da."""

    azimuth: float = math.radians(72.0)
    elevation: float = math.radians(37.0)
    stretch: float = 1.0

    def __call__(self, z: ArrayLike) -> Array:
        """Project points (..., 3) to the picture (..., 2)."""
        z = np.asarray(z, dtype=float)
        c, s = math.cos(self.azimuth), math.sin(self.azimuth)
        right = -s * z[..., 1] + c * z[..., 2]
        away = -c * z[..., 1] - s * z[..., 2]
        up = math.sin(self.elevation) * away + math.cos(self.elevation) * self.stretch * z[..., 0]
        return np.stack([right, up], axis=-1)


def azimuth_of(flow: ReducedFlow) -> float:
    """Direction of view with Da in front and neither field along the line of sight."""
    (s1, s2), (n1, n2) = flow.sigma, flow.nu

    def seen(angle: float) -> float:
        right = np.array([-math.sin(angle), math.cos(angle)])
        fields = np.array([[-s1, n1], [n2, s2]]) / [[math.hypot(1, n1)], [math.hypot(1, n2)]]
        return float(np.min(np.abs(fields @ right)))

    return max((math.radians(d) for d in (72.0, 62.0, 28.0, 18.0)), key=seen)


def stretch_of(flow: ReducedFlow) -> float:
    """Stretch of z1 that makes flights over invisible folds about as high as they are wide."""
    if has_diabolo(flow):
        heights = []
        for slope in diabolo_slopes(flow.nu):
            line = np.array([-1.0, slope])
            above, below = flight(flow, line, "+"), flight(flow, flight_above(line, flow.nu), "-")
            for curve in (above, below):
                size = np.max(np.abs(curve[:, 1:]))
                heights.append(np.max(np.abs(curve[:, 0])) / size**2)
        return float(np.clip(0.5 / max(heights), 1.5, 8.0))
    return {"VV": 1.6, "II": 4.0}.get(flow.folds, 2.2)


_HEIGHT = 0.75  # of what is drawn above and below the unit square of the surface
_UNIT = Box(0.0, 1.0, 0.0, 1.0)  # of lengths on the paper
_SHADOW = "#B5B5B5"  # of orbits above, on the surface
_REACH = 1.08  # of what is drawn, in z2 and z3


def two_fold_3d(
    fold: object,
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    azimuth: float | None = None,
    elevation: float = 37.0,
    legend: bool = True,
    labels: bool | None = None,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw the flow around a two-fold in three dimensions, in normal-form coordinates.

    Tangent orbits at visible folds, flights over invisible ones with their crossings, orbits that
    land in Da, sliding orbits, canards, and the nonsmooth diabolo where it exists.

    Parameters
    ----------
    fold : TwoFold or pair (sigma, nu)
        The two-fold, or its two signs and two numbers.
    ax : matplotlib Axes, optional
        Where to draw (plain axes, not 3-D ones); a new figure by default.
    size : (float, float), optional
        Inches, of a new figure.
    azimuth, elevation : float, optional
        Of the viewer, in degrees: from the $z2$ axis towards the $z3$ axis, by default where neither
        field is seen end on; and above the surface, between 5 and 85.
    legend : bool, optional
        Whether to explain the orbits beside the picture.
    labels : bool, optional
        Whether to name folds, canards and the diabolo beside them; by default where there is a legend.
    title : str, optional
        Instead of the class and the numbers of the normal form.
    colors : mapping, optional
        Colours by ``"+"`` (above), ``"-"`` (below), ``"s"`` (sliding).
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the orbits.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    DefinitionError
        ``fold`` is not a two-fold.
    OptionError
        An elevation outside 5 to 85 degrees; a size that is not positive; axes that are none.

    Examples
    --------
    >>> import nonsmooth as ns
    >>> figure = ns.plot.two_fold_3d(((-1, 1), (-2.0, -1.0)))
    >>> len(figure.axes)
    1
    """
    portrait = portrait_of(fold, "two_fold_3d")
    if not 5.0 <= elevation <= 85.0:
        raise OptionError(
            f"elevation={elevation!r} is not within 5 to 85 degrees. The surface is seen from above."
        )
    direction = azimuth_of(portrait.flow) if azimuth is None else math.radians(azimuth)
    camera = Camera(direction, math.radians(elevation), stretch_of(portrait.flow))
    with canvas(ax, size, (7.0, 4.2), colors=colors, look=look, title=title) as page:
        axes = page.ax
        scene = _Scene(page, camera, portrait)
        scene.draw()
        axes.set_title(title if title is not None else title_of(portrait))
        if legend:
            scene.legend()
        if legend if labels is None else labels:
            scene.line_names()
    return page.drawn


class _Scene:
    """Paints one portrait on plain axes; orders of painting are zorders."""

    BELOW, SURFACE, SLIDING, ABOVE, TEXT = 1.0, 2.0, 3.0, 4.0, 6.0

    def __init__(self, page: Canvas, camera: Camera, portrait: Portrait):
        self.page, self.ax, self.camera, self.flow = page, page.ax, camera, portrait.flow
        self.portrait = portrait
        self.ax.set_aspect("equal")
        self.ax.set_axis_off()

    def draw(self) -> None:
        """Draw every part."""
        self.frame()
        self.surface()
        self.sliding()
        self.arcs()
        self.crossings()
        self.diabolo()
        self.names()

    # parts -------------------------------------------------------------------------------------

    def surface(self) -> None:
        """Four tinted regions and the two folds."""
        for (a, b), tint in TINTS.items():
            corners = np.array([[0, 0, 0], [0, a, 0], [0, a, b], [0, 0, b]], dtype=float)
            patch = Polygon(
                self.camera(corners),
                facecolor=tint,
                alpha=0.7,
                edgecolor="none",
                zorder=self.SURFACE,
            )
            self.ax.add_patch(patch)
        frame = self.camera([[0, 1, 1], [0, -1, 1], [0, -1, -1], [0, 1, -1], [0, 1, 1]])
        self.ax.plot(*frame.T, color=style.GREY, linewidth=0.8, zorder=self.SURFACE + 0.1)
        for k, ends in enumerate(([[0, 0, -1], [0, 0, 1]], [[0, -1, 0], [0, 1, 0]])):
            dashes = "-" if self.flow.folds[k] == "V" else style.DASHED
            color = (style.ABOVE, style.BELOW)[k]
            self.ax.plot(
                *self.camera(ends).T,
                color=color,
                linewidth=2.0,
                linestyle=dashes,
                zorder=self.SLIDING,
                gid="fold",
            )

    def sliding(self) -> None:
        """Sliding orbits, canards and faux canards."""
        for part in sectors(self.flow):
            if part.high - part.low < 0.1:
                continue
            for scale in (0.3, 0.65, 1.0, 1.35):
                for sign, color in ((1, style.ATTRACTING), (-1, style.REPELLING)):
                    points = part.orbit.points if sign > 0 else -part.orbit.points[::-1]
                    for piece in style.inside(scale * points, (-1.0, 1.0, -1.0, 1.0)):
                        self._curve(self._flat(piece), color, 0.9, self.SLIDING, at=0.5, mode="s")
        for value, m in eigenlines(self.flow):
            color, _, dashes = line_style(value, self.flow)
            end = np.array([1.0, m]) / max(1.0, m)
            line = np.outer(np.linspace(1, -1, 41) * (1 if value < 0 else -1), end)
            self._curve(self._flat(line), color, 2.4, self.SLIDING + 0.2, dashes=dashes)
            if dashes != ":":
                for piece in (line[:21], line[21:]):
                    style.arrowhead(
                        self.ax,
                        self.camera(self._flat(piece)),
                        0.55,
                        color,
                        mutation_scale=15,
                        zorder=self.SLIDING + 0.3,
                    )

    def arcs(self) -> None:
        """Orbits off the surface near each fold: tangent where visible, flights where not."""
        if has_diabolo(self.flow):
            return  # its cones are flights, and enough of them
        for side, fold, nu in zip(SIDES, self.flow.folds, self.flow.nu, strict=True):
            slip = abs(nu)
            centres = (-0.6, 0.6) if slip > 1 and fold == "V" else (-0.7, -0.35, 0.35, 0.7)
            for centre in centres:
                if fold == "V":
                    half = 0.85 / math.hypot(1.0, slip / 2)
                    self._off(self._within(arc(self.flow, side, centre, half)), side)
                else:
                    half = 0.6 * abs(centre) / math.hypot(1.0, slip)
                    height = (half**2 if side == "+" else -(half**2)) / 2
                    self._off(arc(self.flow, side, centre, half, height), side)

    def crossings(self) -> None:
        """Orbits through C1 and C2: both parts, and the flights that follow."""
        self._through(np.array([-0.4, 0.4]), "+")
        self._through(np.array([0.4, -0.4]), "-")

    def diabolo(self) -> None:
        """Cones of flights from the invariant lines of the return map."""
        if not has_diabolo(self.flow):
            return
        looks = (("grow", style.FAUX_CANARD), ("shrink", style.CANARD))
        for slope, (name, color) in zip(diabolo_slopes(self.flow.nu), looks, strict=True):
            line = np.array([-1.0, slope]) / max(1.0, slope)
            starts: dict[Side, Array] = {"+": line, "-": flight_above(line, self.flow.nu)}
            for side, start in starts.items():
                curve = flight(self.flow, start, side)
                size = np.max(np.abs(curve[:, 1:]))
                curve, start = curve / [size**2, size, size], start / size
                height = self.ABOVE if side == "+" else self.BELOW
                cone = np.vstack([self.camera([[0.0, 0.0, 0.0]]), self.camera(curve)])
                self.ax.add_patch(
                    Polygon(
                        cone, facecolor=color, alpha=0.13, edgecolor="none", zorder=height - 0.2
                    )
                )
                for scale in (1.0, 0.55, 0.3):
                    shrunk = curve * np.array([scale**2, scale, scale])
                    self._off(shrunk, side, color, f"flights {name}")
                ends = np.array([[0.0, 0.0], start])
                self._curve(self._flat(ends), color, 1.2, self.SLIDING, dashes=style.DASH_DOT)

    def names(self) -> None:
        """Regions, axes and the two-fold."""
        box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
        for name, (a, b) in label_points(sectors(self.flow)).items():
            style.write(
                self.ax,
                self.camera([0.0, a, b]),
                name,
                fontsize=style.points(12),
                zorder=self.TEXT,
                bbox={**box, "alpha": 0.75},
            )
        self.ax.plot(
            *self.camera([0.0, 0.0, 0.0]), "o", color="black", markersize=4.5, zorder=self.TEXT
        )
        top = self.camera([[0.0, 0.0, 0.0], [_HEIGHT / self.camera.stretch, 0.0, 0.0]])
        axes = {
            "$z_2$": ([0, 1.0, 0], [0, 1.22, 0]),
            "$z_3$": ([0, 0, 1.0], [0, 0, 1.22]),
        }
        for name, ends in axes.items():
            start, end = self.camera(ends)
            style.arrow(self.ax, start, end, style.BLACK, linewidth=0.9, zorder=self.TEXT)
            style.write(
                self.ax,
                (end + 0.06 * (end - start) / np.linalg.norm(end - start)),
                name,
                fontsize=style.points(11),
                zorder=self.TEXT,
            )
        style.arrow(self.ax, top[0], top[1], style.BLACK, linewidth=0.9, zorder=self.ABOVE - 0.5)
        style.write(
            self.ax,
            (top[1] + [0.05, 0.0]),
            "$z_1$",
            fontsize=style.points(11),
            ha="left",
            zorder=self.TEXT,
        )

    def frame(self) -> None:
        """The same limits for every two-fold, so that portraits can be compared."""
        corners = [[0, a, b] for a in (-1.25, 1.25) for b in (-1.25, 1.25)]
        x, y = self.camera(np.array(corners, dtype=float)).T
        top = self.camera([1.15 * _HEIGHT / self.camera.stretch, 0.0, 0.0])[1]
        self.ax.set_xlim(x.min(), x.max())
        self.ax.set_ylim(min(y.min(), -top), max(y.max(), top))

    def legend(self) -> None:
        """Explain the lines beside the picture."""
        handles = [
            self._handle("+", "orbits above, $F_1$", style.ABOVE, 1.3),
            self._handle("-", "orbits below, $F_2$", style.BELOW, 1.3, (0, (3.5, 1.3))),
            self._handle("s", "sliding, attracting", style.ATTRACTING, 0.9),
            self._handle("s", "sliding, repelling", style.REPELLING, 0.9),
        ]
        if any(line.get_gid() == "shadow" for line in self.ax.lines):
            handles.append(style.line(_SHADOW, "shadows on the surface", 1.0))
        beside(self.ax, handles, loc="center left", bbox_to_anchor=(1.0, 0.5))

    def _handle(self, mode: str, text: str, color: str, width: float, dashes: Any = "-") -> Line2D:
        line = self.page.look(mode, color=color, linewidth=width, linestyle=dashes)
        return Line2D([], [], label=text, **line)

    def line_names(self) -> None:
        """Name folds, eigenlines and the diabolo beside them."""
        labels, along = Labels(self.ax), np.linspace(-1, 1, 25)[:, None]
        for k, (end, color) in enumerate((([0, 0, 1], style.ABOVE), ([0, 1, 0], style.BELOW))):
            seen = "visible" if self.flow.folds[k] == "V" else "invisible"
            labels.name(f"fold of $F_{k + 1}$,\n{seen}", self.camera(along * end), color)
        for value, m in eigenlines(self.flow):
            color, name, _ = line_style(value, self.flow)
            labels.name(name, self.camera(along * [0.0, 1.0, m] / max(1.0, m)), color)
        for name, color in (("grow", style.FAUX_CANARD), ("shrink", style.CANARD)):
            gid = f"flights {name}"
            points = [
                np.asarray(line.get_xydata())[::4]
                for line in self.ax.lines
                if line.get_gid() == gid
            ]
            if points:
                labels.name(f"diabolo,\n{gid}", np.vstack(points), color)

        for line in (line for line in self.ax.lines if line.get_gid() == "landing"):
            labels.name("slides from here", np.asarray(line.get_xydata()))

    # strokes -----------------------------------------------------------------------------------

    def _through(self, z: Array, side: Side) -> None:
        """Draw an orbit that crosses at z towards ``side``: the part before, and the flights after."""
        s1, s2 = self.flow.sigma
        before = passage(self.flow, z, other(side), ahead=False)
        self._off(self._within(before), other(side))
        for _ in range(4):
            invisible = s1 < 0 if side == "+" else s2 > 0
            if not invisible:
                self._off(self._within(passage(self.flow, z, side, ahead=True)), side)
                return
            curve = flight(self.flow, z, side)
            if np.max(np.abs(curve[:, 1:])) > _REACH:
                self._off(self._within(curve), side)
                return
            self._off(curve, side)
            z = (flight_above if side == "+" else flight_below)(z, self.flow.nu)
            side = other(side)
            if z[0] * z[1] >= 0:
                look: Any = {"color": style.BLACK, "markersize": 4, "zorder": self.SLIDING + 0.5}
                self.ax.plot(*self.camera([0.0, *z]), ".", gid="landing", **look)
                return

    def _off(self, curve: Array, side: Side, color: str | None = None, gid: str = "arc") -> None:
        """Draw an orbit above or below the surface, with an arrow."""
        if len(curve) < 4:
            return
        color = color or style.FIELDS[side]
        dashes = "-" if side == "+" else (0, (3.5, 1.3))
        order = self.ABOVE if side == "+" else self.BELOW
        begin, end = np.abs(curve[[0, -1], 0]) > 1e-9  # it continues above or below what is drawn
        thins = (bool(begin), bool(end))
        mode = side if gid == "arc" else ""
        looks: Any = {"dashes": dashes, "gid": gid, "thins": thins, "mode": mode}
        self._curve(curve, color, 1.2, order, at=0.62, **looks)

    def _curve(
        self,
        curve: Array,
        color: str,
        width: float,
        order: float,
        *,
        dashes: Any = "-",
        at: float | None = None,
        gid: str | None = None,
        thins: tuple[bool, bool] = (False, False),
        mode: str = "",
    ) -> None:
        points = self.camera(curve)
        bed = 2.2 if order == self.ABOVE else 3.6 if width > 2.0 else None
        effects = None if bed is None else style.halo(bed)
        if order == self.ABOVE:
            for piece in style.inside(curve[:, 1:], (-1.0, 1.0, -1.0, 1.0)):
                shadow = self.camera(self._flat(piece))
                look: Any = {"color": _SHADOW, "lw": 1.0, "zorder": self.SURFACE + 0.2}
                self.ax.plot(*shadow.T, gid="shadow", **look)
        look = self.page.look if mode else self.page.named
        line = look(mode, color=color, linestyle=dashes, linewidth=width, zorder=order, gid=gid)
        color, width = line["color"], line.pop("linewidth")
        draw_orbit(self.ax, points, thins, _UNIT, width, **line, path_effects=effects)
        length = np.hypot(*np.diff(points, axis=0).T).sum()
        if at is not None and length > 0.15:
            style.arrowhead(self.ax, points, at, color, mutation_scale=9, zorder=order + 0.05)

    @staticmethod
    def _flat(z: ArrayLike) -> Array:
        z = np.asarray(z, dtype=float)
        return np.column_stack([np.zeros(len(z)), z])

    def _within(self, curve: Array) -> Array:
        """Keep the connected part of a curve in the drawn volume that starts where it is lowest."""
        good = (np.abs(curve[:, 0]) <= _HEIGHT / self.camera.stretch) & np.all(
            np.abs(curve[:, 1:]) <= _REACH, axis=1
        )
        low, high = self.ax.get_ylim()
        good &= (self.camera(curve)[:, 1] > low) & (self.camera(curve)[:, 1] < high)
        k = int(np.argmin(np.abs(curve[:, 0])))
        if not good[k]:
            return curve[:0]
        outside = np.flatnonzero(~good)
        first = outside[outside < k].max(initial=-1) + 1
        last = outside[outside > k].min(initial=len(curve))
        return curve[first:last]
