"""Figures of the flow around the discontinuity surface in three dimensions.

Coordinates are those of the normal form, z1 along H and upwards, z2 and z3 in the surface. The
attracting region is in front and time runs from left to right.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

import nonsmooth as ns
from nonsmooth.plot import style as look

from .. import pictures
from .errata_general import fold_of
from .model import Array
from .records import picture

ATTRACTING, REPELLING, CROSSING = "#DCEBF5", "#F3D9A8", "#F6F6F6"
AZIMUTH, ELEVATION, STRETCH = np.radians(80.0), np.radians(36.0), 1.6
BEHIND, PLANE, FRONT_BELOW, SURFACE, ABOVE, TEXT = 1, 2, 3, 4, 6, 9


def project(z: Array) -> Array:
    """Project (..., 3) points to the picture (..., 2)."""
    z = np.asarray(z, dtype=float)
    c, s = np.cos(AZIMUTH), np.sin(AZIMUTH)
    right = -s * z[..., 1] + c * z[..., 2]
    away = -c * z[..., 1] - s * z[..., 2]
    up = np.sin(ELEVATION) * away + STRETCH * np.cos(ELEVATION) * z[..., 0]
    return np.stack([right, up], axis=-1)


@cache
def ball_normal_form() -> ns.FilippovSystem:
    """The normal form at the linear ball's two-fold, stopped at the lift-off plane."""
    fold = fold_of("linear")
    z = ca.SX.sym("z", 3)
    (s1, s2), (n1, n2) = fold.sigma, fold.nu
    load = z[1] / fold.phi + fold.phi * z[2]
    return ns.FilippovSystem(
        ca.vertsplit(z),
        surface=z[0],
        above=[-z[1], -s1, n1],
        below=[z[2], n2, s2],
        stops=[ns.Stop(load, -1, "lift-off")],
    )


class Scene:
    """Axes with the surface, painted from back to front."""

    def __init__(self, axes: Axes, size: float = 1.0):
        self.axes, self.size = axes, size

    def region(self, corners: Sequence[Sequence[float]], color: str, order: float) -> None:
        """Tint a polygon of (z2, z3) corners on the surface."""
        points = project(np.array([[0.0, *c] for c in corners]))
        self.axes.add_patch(
            Polygon(
                points,
                facecolor=color,
                edgecolor="0.45",
                linewidth=0.6,
                zorder=order,
                alpha=0.6 if order >= SURFACE else 1.0,
            )
        )

    def surface(self) -> None:
        """Four regions, those beyond the lift-off plane first."""
        a = self.size
        self.region([(0, 0), (0, -a), (-a, -a), (-a, 0)], REPELLING, BEHIND)
        for sign in (1, -1):
            corner = (a * sign, -a * sign)
            other = (0, -a) if sign > 0 else (-a, 0)
            self.region([(0, 0), corner, other], CROSSING, BEHIND)
            near = (a, 0) if sign > 0 else (0, a)
            self.region([(0, 0), corner, near], CROSSING, SURFACE)
        self.region([(0, 0), (a, 0), (a, a), (0, a)], ATTRACTING, SURFACE)

    def lift_off_plane(self) -> None:
        """The plane Lambda_N = 0, through both crossing regions."""
        a, b = self.size, 0.45
        corners = np.array([[-b, a, -a], [-b, -a, a], [b, -a, a], [b, a, -a]])
        self.axes.add_patch(
            Polygon(project(corners), facecolor="0.72", alpha=0.55, edgecolor="0.3", zorder=PLANE)
        )

    def folds(self, visible: tuple[bool, bool] = (True, True)) -> None:
        """The lines z2 = 0 (of F1) and z3 = 0 (of F2); invisible folds are dashed."""
        a = self.size
        for k, color in ((0, look.ABOVE), (1, look.BELOW)):
            end = np.array([0.0, 0.0, a] if k == 0 else [0.0, a, 0.0])
            for side, order in ((1, SURFACE + 1), (-1, BEHIND + 0.5)):
                line = project(np.array([[0.0, 0, 0], side * end]))
                self.axes.plot(
                    *line.T,
                    color=color,
                    linewidth=2.0,
                    zorder=order,
                    linestyle="-" if visible[k] else look.DASHED,
                )

    def curve(
        self,
        z: Array,
        color: str,
        order: float,
        style: object = "-",
        width: float = 1.8,
        at: Sequence[float] = (0.5,),
    ) -> None:
        """Draw an orbit (m, 3) with arrowheads."""
        points = project(z)
        self.axes.plot(*points.T, color=color, linestyle=style, linewidth=width, zorder=order)
        for fraction in at:
            look.arrowhead(self.axes, points, fraction, color, mutation_scale=11, zorder=8)

    def text(self, z: Sequence[float], words: str, **options: object) -> None:
        """Write at a point of space."""
        options = {
            "ha": "center",
            "va": "center",
            "zorder": TEXT,
            "path_effects": look.halo(),
            **options,
        }
        self.axes.text(*project(np.array(z)), words, **options)

    def run(self, start: Sequence[float], width: float = 1.9) -> ns.Trajectory:
        """Draw the orbit of the ball's normal form from a start to lift-off."""
        run = ns.simulate(ball_normal_form(), start, 10.0, tol=1e-11)
        styles = {
            "+": (look.ABOVE, "-", ABOVE),
            "-": (look.BELOW, look.DASHED, FRONT_BELOW),
            "s": (look.BLACK, "-", SURFACE + 1.5),
        }
        for segment in run.segments:
            color, style, order = styles[segment.mode]
            z = run(np.linspace(segment.t_start, segment.t_end, 80))
            long = segment.t_end - segment.t_start > 0.25
            self.curve(z, color, order, style, width, at=(0.55,) if long else ())
        self.lift_off(run.x[-1])
        return run

    def lift_off(self, z: Array) -> None:
        """Mark the end of an orbit."""
        order = ABOVE + 1 if z[0] >= 0 else FRONT_BELOW + 0.5
        self.axes.plot(
            *project(z),
            "D",
            color="white",
            markeredgecolor="black",
            markersize=6,
            zorder=order,
            gid="lift-off",
        )

    def grazing(self, side: str, centre: float) -> None:
        """Draw the orbit that touches a visible fold at ``centre``, to lift-off."""
        flow = fold_of("linear")
        n1, n2 = flow.nu
        if side == "+":
            end = flow.phi * centre / (1 / flow.phi - flow.phi * n1)  # where the load is zero
            t = np.linspace(-0.45, end, 60)
            z = np.column_stack([t**2 / 2, -t, centre + n1 * t])
            self.curve(z, look.ABOVE, ABOVE, width=1.6, at=(0.25, 0.75))
        else:
            end = centre / flow.phi / (flow.phi - n2 / flow.phi)
            t = np.linspace(-0.45, end, 60)
            z = np.column_stack([-(t**2) / 2, centre + n2 * t, -t])
            self.curve(z, look.BELOW, FRONT_BELOW, look.DASHED, 1.6, at=(0.25, 0.75))
        order = ABOVE if side == "+" else FRONT_BELOW
        self.axes.plot(*project(z[0]), "o", color="black", markersize=4, zorder=order + 0.1)
        self.lift_off(z[-1])


def _ball(height: float) -> tuple[Figure, Axes, Scene]:
    """The surface H = 0 with its folds, the lift-off plane and the axis of slip."""
    figure, axes = pictures.canvas(7.0, height)
    scene = Scene(axes, 1.25)
    axes.set(xlim=(-1.95, 1.75), ylim=(-1.32, 1.22))
    scene.surface()
    scene.lift_off_plane()
    scene.folds()
    look.arrow(axes, project(np.zeros(3)), project(np.array([0.85, 0, 0])), zorder=PLANE + 0.5)
    scene.text([0.91, 0, 0], "$H$")
    axes.plot(0, 0, "o", color="black", markersize=6, zorder=TEXT)
    scene.text([-0.06, -0.04, 0.02], "$s$")
    return figure, axes, scene


@picture("Fig. 9")
def geometries() -> Figure:
    """What a bounce can do near lift-off, computed with the normal form of the linear ball's
    two-fold (mu = 0.3, d1 = d2 = 0.1, eta = 0.5, G = 1e-4): (a) forward slip throughout, (b)
    reverse slip throughout, (c, d) slip, roll, and slip again through a fold. Diamonds:
    lift-off. Dotted: from a start straight to the surface, at a cross. Pale: behind or below a
    surface.
    """
    figure, axes, scene = _ball(5.4)
    for name, start, offset in (
        ("(a)", (0.33, 0.5, 1.15), (-0.05, 0.09)),
        ("(b)", (-0.33, 1.15, 0.3), (-0.11, 0.0)),
        ("(c)", (0.3, 1.2, 0.75), (-0.02, 0.1)),
        ("(d)", (-0.3, 0.62, 1.2), (0.1, -0.08)),
    ):
        scene.run(start)
        foot = project(np.array([[0.0, *start[1:]], start])).T
        axes.plot(*foot, color=look.GREY, linewidth=0.9, linestyle=look.DOTS, zorder=TEXT - 0.1)
        axes.plot(*foot[:, 0], "+", color=look.GREY, markersize=5, zorder=TEXT - 0.1)
        x, y = project(np.array(start))
        axes.plot(x, y, "o", color="black", markersize=5, zorder=TEXT)
        axes.text(
            x + offset[0],
            y + offset[1],
            name,
            ha="center",
            va="center",
            zorder=TEXT,
            path_effects=look.halo(),
        )
    _ball_labels(axes, scene)
    return figure


def _ball_labels(axes: Axes, scene: Scene) -> None:
    a = scene.size
    scene.text([-0.36, -1.0, 1.0], r"lift-off, $\Lambda_N=0$", fontsize=9.5)
    scene.text(
        [0, 1.03 * a, -0.12],
        "$F_2\\cdot\\nabla H=0$\n" r"$\alpha=1$",
        ha="right",
        va="top",
        color=look.BELOW,
    )
    scene.text(
        [-0.11, -0.16, 1.06 * a],
        "$F_1\\cdot\\nabla H=0$\n" r"$\alpha=0$",
        ha="left",
        va="top",
        color=look.ABOVE,
    )
    scene.text([0, 0.8 * a, 0.8 * a], r"$H=0$: rolling", ha="left")
    axes.text(0.2, 0.95, "$H>0$: forward slip, $F_1$", color=look.ABOVE)
    axes.text(-1.9, -1.22, "$H<0$: reverse slip, $F_2$", color=look.BELOW)


@picture("Fig. 12 (a)", name="two_fold_a")
def two_fold_visible() -> Figure:
    """The ball's visible two-fold with the lift-off surface. Thick: the only rolling orbit that
    reaches s. Orange: H > 0; blue, dashed: H < 0; black: rolling. Diamonds: lift-off, where
    every orbit but that one ends. Pale: behind or below a surface.
    """
    flow = fold_of("linear")
    figure, _, scene = _ball(5.3)
    slope = flow.slopes[0]
    canard = np.array([[0, 1, slope], [0, 0, 0], [0, -1, -slope]])
    canard *= scene.size / max(1.0, slope)  # to the edges of the surface
    scene.curve(canard[:2], look.CANARD, SURFACE + 1.6, width=3.0, at=(0.5,))
    scene.curve(canard[1:], look.CANARD, BEHIND + 0.6, width=3.0, at=(0.6,))
    for start in ((0, 1.25, 0.55), (0, 1.25, 0.9), (0, 0.55, 1.25), (0, 0.9, 1.25)):
        scene.run(start, width=1.4)
    for centre in (0.42, 0.85):
        scene.grazing("+", centre)
        scene.grazing("-", centre)
    _region_labels(scene)
    scene.text([-0.3, -0.92, 0.92], r"lift-off, $\Lambda_N=0$", fontsize=9.5)
    return figure


def _region_labels(scene: Scene) -> None:
    a = scene.size
    scene.text([0, 0.84 * a, 0.69 * a], r"$D_a$", fontsize=13)
    scene.text([0, -0.78 * a, -0.5 * a], r"$D_r$", fontsize=13)
    scene.text([0, 0.72 * a, -0.5 * a], r"$C_2$", fontsize=13)
    scene.text([0, -0.5 * a, 0.72 * a], r"$C_1$", fontsize=13)
    scene.text(
        [0, 1.05 * a, -0.05], "$z_3=0$\n" r"$\alpha=1$", ha="right", va="top", color=look.BELOW
    )
    scene.text(
        [-0.06, -0.05, 1.03 * a], "$z_2=0$\n" r"$\alpha=0$", ha="left", va="top", color=look.ABOVE
    )
