"""Figures of section 2: the rigid bounce, the ranges of the experiments, slip before and after.

The measurements are not public. Where the paper shows them, the figures here show the published
ranges and what the models predict over them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from scipy.optimize import brentq
from scipy.stats import qmc

import bounce
from nonsmooth.plot import style as look

from .. import pictures
from .errata_linear import log_restitution_value
from .model import Array
from .records import picture
from .table import Row, recomputed

#: Rigid fits without tilt of the companion experiments (arXiv 2302.02758): r, mu.
FITS = {"astroturf": (0.544, 0.997), "turf": (0.260, 0.998)}
_NAMES = {"astroturf": "artificial turf", "turf": "teeing turf"}
ETA, TANGENTIAL_DAMPING = 0.5, 0.1


def rigid_slip(h0: Array, normal: Array, mu: float, r: float) -> Array:
    """H_F of the rigid bounce: cases I, II and III."""
    loss = 3.5 * mu * (1 + r) * np.abs(normal)
    return np.sign(h0) * np.maximum(np.abs(h0) - loss, 0.0)


@picture("Fig. 6")
def trajectories() -> Figure:
    """Tangential and normal velocity during a rigid bounce (mu = 0.3, r = 0.6). Dots: touch-down;
    diamonds: lift-off.
    """
    mu, r = 0.3, 0.6
    slope = 3.5 * mu
    edges = (slope, slope * (1 + r))
    figure = pictures.new_figure(6.2, 4.6)
    axes = figure.add_subplot()
    for side, color, style in ((1, look.ABOVE, "-"), (-1, look.BELOW, look.DASHED)):
        for start in (0.35, 0.7, 1.25, 1.5, 1.95, 2.3):
            turn = start / slope - 1
            ends = (
                [(start, -1), (0.0, turn), (0.0, r)]
                if turn < r
                else [(start, -1), (start - slope * (1 + r), r)]
            )
            points = np.array([(side * a, b) for a, b in ends])
            axes.plot(*points[:2].T, color=color, linestyle=style, linewidth=1.5, zorder=2)
            look.arrowhead(axes, points[:2], 0.5, color, mutation_scale=13, zorder=8)
            axes.plot(*points[0], "o", color="black", markersize=5, zorder=4)
            axes.plot(*points[-1], "D", color="white", markeredgecolor="black", zorder=5)
        for edge in edges:
            axes.plot([side * edge] * 2, [-1.0, -1.12], color="0.4", linewidth=1)
        middles = (edges[0] / 2, sum(edges) / 2, edges[1] + 0.5)
        for middle, name in zip(middles, ("III", "II", "I"), strict=True):
            axes.text(
                side * middle,
                -1.2,
                f"${name}_{'+' if side > 0 else '-'}$",
                ha="center",
                va="center",
            )
    roll = np.array([(0.0, -0.67), (0.0, r)])
    axes.plot(*roll.T, color=look.BLACK, linewidth=2.4, zorder=3)
    look.arrowhead(axes, roll, 0.62, look.BLACK, mutation_scale=15, zorder=8)
    axes.text(0.07, -0.12, "roll", va="center", path_effects=look.halo(), zorder=6)
    axes.axhline(0, color="0.5", linewidth=0.8, zorder=0)
    axes.axvline(0, color="0.5", linewidth=0.8, zorder=0)
    axes.set(
        xlim=(-2.6, 2.6),
        ylim=(-1.32, 0.8),
        yticks=[-1, 0, r],
        yticklabels=["$-1$", "$0$", "$r$"],
        xticks=[-edges[1], -edges[0], 0, edges[0], edges[1]],
    )
    axes.set_xticklabels(
        [
            r"$-\frac{7}{2}\mu(1+r)$",
            r"$-\frac{7}{2}\mu$",
            "$0$",
            r"$\frac{7}{2}\mu$",
            r"$\frac{7}{2}\mu(1+r)$",
        ]
    )
    axes.set_xlabel(r"tangential velocity $v_T/|\dot y_0|$")
    axes.set_ylabel(r"normal velocity $v_N/|\dot y_0|$")
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def ranges(surface: str) -> dict[str, tuple[float, float]]:
    """Dimensionless ranges of Table 1 as printed (rad/s and 1/s)."""
    rows = [row for row in recomputed() if row.surface == surface]
    result = {}
    for quantity in ("xdot0", "ydot0", "omega0"):
        low, high = (_printed(rows, f"{quantity} {end}") for end in ("min", "max"))
        result[quantity] = (low, high)
    return result


def _printed(rows: Sequence[Row], name: str) -> float:
    return float(next(row.printed for row in rows if row.quantity == name))


@picture("Fig. 3", name="ics")
def experiment_ranges() -> Figure:
    """Ranges of the experiments (Table 1), dimensionless as printed. Dotted: the largest spin as
    it follows from the printed rpm. The measured points are not public.
    """
    styles = {"astroturf": (look.VERMILLION, "-", "//"), "turf": (look.BLUE, look.DASHED, "")}
    pairs = (("xdot0", "ydot0"), ("xdot0", "omega0"))
    labels = {
        "xdot0": r"$\dot x_0/R$ (1/s)",
        "ydot0": r"$\dot y_0/R$ (1/s)",
        "omega0": r"$\omega_0$ (rad/s)",
    }
    figure = pictures.new_figure(7.0, 3.6)
    for axes, (a, b) in zip(figure.subplots(1, 2), pairs, strict=True):
        for surface, (color, style, hatch) in styles.items():
            box = ranges(surface)
            corner = (box[a][0], box[b][0])
            size = (box[a][1] - box[a][0], box[b][1] - box[b][0])
            axes.add_patch(
                Rectangle(
                    corner,
                    *size,
                    facecolor="none",
                    edgecolor=color,
                    linestyle=style,
                    linewidth=1.8,
                    label=_NAMES[surface],
                )
            )
            axes.add_patch(
                Rectangle(
                    corner,
                    *size,
                    facecolor=color,
                    alpha=0.1,
                    hatch=hatch,
                    edgecolor=color,
                    linewidth=0,
                )
            )
            if b == "omega0":
                row = next(
                    r for r in recomputed() if r.surface == surface and r.quantity == "omega0 max"
                )
                axes.plot(box[a], [row.computed] * 2, color=color, linestyle=":", linewidth=2)
        axes.set_xlabel(labels[a])
        axes.set_ylabel(labels[b])
        axes.autoscale_view()
        axes.spines[["top", "right"]].set_visible(False)
    axes.annotate(
        "top if the spin is in rpm,\nas printed",
        (900, 130),
        ha="center",
        va="bottom",
        path_effects=look.halo(),
    )
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


@cache
def predictions(surface: str, count: int = 256) -> tuple[Array, Array, Array]:
    """H_0 and H_F (1/s) of the compliant model and of the rigid law over the published ranges."""
    r, mu = FITS[surface]
    d2 = brentq(lambda d: np.exp(log_restitution_value(2 * d)) - r, 1e-6, 1 - 1e-9)
    ball = bounce.KelvinVoigt(mu=mu, d1=TANGENTIAL_DAMPING, d2=d2, eta=ETA, G=0.0)
    box = np.array(list(ranges(surface).values()))
    points = qmc.Sobol(3, seed=2022).random(count)
    landings = box[:, 0] + points * (box[:, 1] - box[:, 0])
    slips = []
    for xdot, ydot, omega in landings:
        scale = abs(ydot)  # without gravity the model is homogeneous of degree one
        shot = bounce.simulate(ball, xdot=xdot / scale, ydot=-1.0, omega=omega / scale, tol=1e-8)
        slips.append(scale * shot.slip)
    h0 = landings[:, 0] + landings[:, 2]
    return h0, np.array(slips), rigid_slip(h0, landings[:, 1], mu, r)


def _scatter(axes: Axes, surface: str) -> None:
    h0, compliant, rigid = predictions(surface)
    axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)
    axes.axvline(0, color="0.6", linewidth=0.8, zorder=0)
    slips = rigid != 0
    for chosen, mark, words in (
        (slips, "x", "rigid bounce, slips to lift-off"),
        (~slips, "|", "rigid bounce, rolls at lift-off"),
    ):
        axes.plot(h0[chosen], rigid[chosen], mark, color=look.BLUE, markersize=5, label=words)
    axes.plot(
        h0,
        compliant,
        "o",
        color=look.VERMILLION,
        markersize=3.5,
        markerfacecolor="none",
        label="compliant in both directions",
    )
    axes.set_title(f"{_NAMES[surface]}, simulated")
    axes.set_xlabel(r"slip at touch-down $H_0$ (1/s)")
    axes.spines[["top", "right"]].set_visible(False)


@picture("Fig. 4")
def tangential_velocity() -> Figure:
    """Simulated, not measured: the measurements are not public. Slip at lift-off against slip at
    touch-down, for 256 landings spread evenly over the ranges of Table 1. Circles: the paper's
    linear compliant model (d1 = 0.1, eta = 0.5, G = 0, with the r and mu that the companion
    experiments fitted). Crosses: the rigid law with the same r and mu; ticks: where it rolls at
    lift-off. Of the two classes that the paper describes, small negative slip appears in the
    compliant model on both surfaces, and never in the rigid law. Large positive slip appears in
    the rigid law on both, for few landings (at up to 1061/s on artificial turf and 1767/s on
    teeing turf). In the compliant model it appears on teeing turf, where 35 of 248 forward
    landings leave forward, at up to 780/s, and not on artificial turf, where 16 of 248 do, at
    no more than 6/s.
    """
    figure = pictures.new_figure(7.0, 3.9)
    panels = figure.subplots(1, 2)
    for axes, surface in zip(panels, FITS, strict=True):
        _scatter(axes, surface)
    panels[0].set_ylabel(r"slip at lift-off $H_F$ (1/s)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
