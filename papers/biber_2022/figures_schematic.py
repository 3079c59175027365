"""Schematic figures: notation, contact mechanisms, Filippov's convex combination."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon, Rectangle

from nonsmooth.plot import style as look

from .. import pictures
from .records import picture

_GROUND = "0.85"


def _ground(
    axes: Axes, left: float, right: float, level: float, depth: float = 0.18, hatch: str = "////"
) -> None:
    axes.add_patch(
        Rectangle(
            (left, level - depth),
            right - left,
            depth,
            facecolor=_GROUND,
            edgecolor="none",
            hatch=hatch,
            zorder=0,
        )
    )
    axes.plot([left, right], [level, level], color="0.2", linewidth=1.2)


def _ball(axes: Axes, centre: tuple[float, float], radius: float) -> None:
    axes.add_patch(Circle(centre, radius, facecolor="white", edgecolor="black", linewidth=1.6))
    axes.plot(*centre, "o", color="black", markersize=4)
    x, y = centre
    axes.add_patch(
        Arc(
            centre,
            1.24 * radius,
            1.24 * radius,
            theta1=20,
            theta2=125,
            color=look.GREEN,
            linewidth=1.6,
        )
    )
    tip = np.radians(125)
    end = np.array([x + 0.62 * radius * np.cos(tip), y + 0.62 * radius * np.sin(tip)])
    back = end + 0.01 * np.array([np.sin(tip), -np.cos(tip)])
    look.arrow(axes, back, end, look.GREEN, linewidth=0)
    axes.text(x + 0.08 * radius, y + 0.72 * radius, r"$\omega$", color=look.GREEN, ha="left")


def _spring(axes: Axes, start: np.ndarray, end: np.ndarray, coils: int = 5) -> None:
    along = end - start
    across = np.array([-along[1], along[0]]) / np.hypot(*along) * 0.09
    s = np.concatenate([[0, 0.2], np.linspace(0.2, 0.8, 2 * coils + 1)[1:-1], [0.8, 1]])
    side = np.concatenate([[0, 0], [(-1) ** k for k in range(2 * coils - 1)], [0, 0]])
    points = start + s[:, None] * along + side[:, None] * across
    axes.plot(*points.T, color="black", linewidth=1.3)


def _dashpot(axes: Axes, start: np.ndarray, end: np.ndarray) -> None:
    along = end - start
    across = np.array([-along[1], along[0]]) / np.hypot(*along) * 0.09
    cup, piston = start + 0.62 * along, start + 0.5 * along
    wall = [
        cup + across,
        start + 0.36 * along + across,
        start + 0.36 * along - across,
        cup - across,
    ]
    axes.plot(*np.array(wall).T, color="black", linewidth=1.3)
    axes.plot(*np.array([start, start + 0.36 * along]).T, color="black", linewidth=1.3)
    axes.plot(
        *np.array([piston + 0.8 * across, piston - 0.8 * across]).T, color="black", linewidth=2.4
    )
    axes.plot(*np.array([piston, end]).T, color="black", linewidth=1.3)


@picture("Fig. 2")
def setting_notation() -> Figure:
    """Notation. Counter-clockwise rotation, omega > 0, is backspin for a ball that moves right."""
    figure, axes = pictures.canvas(5.0, 4.2)
    axes.set(xlim=(-1.9, 2.3), ylim=(-1.35, 2.0))
    _ground(axes, -1.8, 2.2, -0.9, 0.3, hatch="")
    _ball(axes, (0.0, 0.0), 1.0)
    axes.add_patch(
        Polygon(
            [(-0.43, -0.9), (0.43, -0.9), (0.3, -0.955), (0.0, -1.0), (-0.3, -0.955)],
            facecolor="white",
            edgecolor="none",
            zorder=0.5,
        )
    )
    axes.text(-0.07, -0.06, "$(x, y)$", ha="right", va="top")
    look.arrow(axes, (0, -1), (0, -0.3), look.BELOW, linewidth=2)
    axes.text(0.08, -0.5, r"$\lambda_N$", color=look.BELOW)
    look.arrow(axes, (0, -1), (0.8, -1), look.ABOVE, linewidth=2, zorder=5)
    axes.text(0.87, -1.05, r"$\lambda_T$", color=look.ABOVE, va="center", path_effects=look.halo())
    for end, name, offset in (((-1.1, 1.3), "$x$", (0.12, 0)), ((-1.6, 1.8), "$y$", (0, 0.12))):
        look.arrow(axes, (-1.6, 1.3), end, "0.3")
        axes.text(end[0] + offset[0], end[1] + offset[1], name, ha="center", va="center")
    axes.text(1.15, 0.55, "backspin: $\\omega>0$\n" r"slip: $H=\dot x+\omega$", fontsize=9.5)
    return figure


def _mechanism(labels: dict[str, str]) -> Figure:
    """A ball held by springs and dashpots in both directions, with friction below it."""
    figure, axes = pictures.canvas(6.4, 4.6)
    axes.set(xlim=(-2.3, 3.0), ylim=(-1.95, 1.55))
    _ground(axes, -1.9, 1.4, -1.6)
    axes.add_patch(
        Rectangle((2.3, -1.78), 0.2, 2.6, facecolor=_GROUND, hatch="////", edgecolor="none")
    )
    axes.plot([2.3, 2.3], [-1.78, 0.82], color="0.2", linewidth=1.2)
    _ball(axes, (-0.5, 0.55), 0.75)
    axes.text(-0.56, 0.5, "$(x, y)$", ha="right", va="top", fontsize=9.5)
    axes.add_patch(Rectangle((-1.5, -0.3), 2.0, 0.1, facecolor="0.35", edgecolor="none"))
    for x, draw in ((-1.0, _spring), (0.0, _dashpot)):
        draw(axes, np.array([x, -1.6]), np.array([x, -0.3]))
    axes.plot([0.25, 0.9], [0.55, 0.55], color="black", linewidth=1.3)
    axes.plot([0.9, 0.9], [0.25, 0.85], color="black", linewidth=1.3)
    for y, draw in ((0.85, _spring), (0.25, _dashpot)):
        draw(axes, np.array([2.3, y - 0.03]), np.array([0.9, y - 0.03]))
    look.arrow(axes, (-0.5, -0.2), (-0.5, 0.3), look.BELOW, linewidth=1.8)
    axes.text(-0.4, 0.0, r"$\lambda_N$", color=look.BELOW, va="center")
    look.arrow(axes, (-0.5, -0.2), (0.15, -0.2), look.ABOVE, linewidth=1.8, zorder=5)
    axes.text(0.2, -0.08, r"$\lambda_T$", color=look.ABOVE, va="center")
    axes.text(-1.15, -1.0, labels["k"], ha="right", va="center")
    axes.text(0.15, -1.0, labels["d"], ha="left", va="center")
    axes.text(1.6, 1.0, labels["z"], ha="center", va="bottom")
    axes.text(1.6, 0.03, labels["u"], ha="center", va="top")
    return figure


@picture("Fig. 7")
def settings_kv() -> Figure:
    """The linear mechanism."""
    return _mechanism(
        {
            "k": r"$\dfrac{1}{\varepsilon_2^2}$",
            "d": r"$\dfrac{2d_2}{\varepsilon_2}$",
            "z": r"$\dfrac{1}{\varepsilon_1^2}$",
            "u": r"$\dfrac{2d_1}{\varepsilon_1}$",
        }
    )


@picture("Fig. 11")
def setting_generic() -> Figure:
    """The generalised mechanism."""
    return _mechanism(
        {
            "k": r"$k(y,\dot y)$",
            "d": r"$d(y,\dot y)$",
            "z": r"$z(x,\dot x,y,\dot y,\omega)$",
            "u": r"$u(x,\dot x,y,\dot y,\omega)$",
        }
    )


@picture("Fig. 8")
def filippov_convexity() -> Figure:
    """F_s is the point of the line between the tips of F1 and F2 that lies in the surface. Drawn
    for attracting sliding: each field points at the surface, so F1, which holds above it,
    points down, behind it.
    """

    def put(x: float, y: float, z: float) -> np.ndarray:
        return np.array([x + 0.45 * y, 0.5 * y + z])

    start = np.array([0.0, 0.0, 0.0])
    first, second = np.array([1.25, 0.1, -0.75]), np.array([1.6, 0.7, 1.1])  # above, below
    weight = first[2] / (first[2] - second[2])
    slide = (1 - weight) * first + weight * second
    figure, axes = pictures.canvas(6.0, 3.9)
    axes.set(xlim=(-1.35, 3.1), ylim=(-1.2, 1.75))
    corners = [put(*c) for c in ((-0.7, -0.9, 0), (2.3, -0.9, 0), (2.3, 1.1, 0), (-0.7, 1.1, 0))]
    axes.add_patch(Polygon(corners, facecolor="0.92", edgecolor="0.5", alpha=0.85, zorder=1))
    axes.text(*(put(-0.55, -0.75, 0)), r"$H(p)=0$", va="bottom")
    tips = [put(*v) for v in (first, second, slide)]
    styles = (
        (look.ABOVE, "$F_1$", 0.5, (0.08, -0.06)),  # below the surface, which hides it
        (look.BELOW, "$F_2$", 4, (0.08, 0.04)),
        (look.BLACK, "$F_s$", 4, (0.1, -0.1)),
    )
    for tip, (color, name, order, offset) in zip(tips, styles, strict=True):
        look.arrow(axes, put(*start), tip, color, linewidth=2.2, zorder=order)
        axes.text(
            *(tip + offset),
            name,
            color=color,
            fontsize=12,
            ha="left",
            va="center",
            path_effects=look.halo(),
            zorder=6,
        )
    for ends, order in (((tips[0], tips[2]), 0.5), ((tips[2], tips[1]), 3)):
        axes.plot(*np.array(ends).T, color="0.25", linestyle=look.DASHED, zorder=order)
    axes.plot(*put(*start), "o", color="black", zorder=6)
    axes.text(-0.08, 0.1, "$p$", ha="right")
    axes.text(-1.3, 1.5, "$H>0$", color=look.ABOVE)
    axes.text(-1.3, -1.1, "$H<0$", color=look.BELOW)
    return figure
