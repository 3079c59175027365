"""The portraits around each bifurcation, and what happens over the threshold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import nonsmooth as ns
from nonsmooth.plot import style as look

from .. import pictures
from .model import (
    BOUNDARY_FOCUS,
    BOUNDARY_NODE,
    FREE_FOLD,
    HARVESTED_FOLD,
    SADDLE_NODE,
    SYSTEM,
    at,
    free_cycle,
    landing,
    period,
    pseudo_equilibria,
    run_from_fold,
    sliding_homoclinic,
)

picture = pictures.Pictures()

_STAR: dict[str, Any] = {
    "markersize": 13,
    "markerfacecolor": "#F0E442",
    "markeredgecolor": look.BLACK,
}
Box = tuple[float, float, float, float]


def _legend(*missing: str) -> list[Line2D]:
    """What lines are, without those that a picture does not have."""
    lines = [
        look.line(look.BLACK, "sliding", 3.4),
        look.line(look.GREY, "crossing", 1.2),
        look.line(look.GREEN, "orbit through a visible fold", 1.6),
        look.line(look.CANARD, "separatrix", 1.8),
    ]
    return [line for line in lines if line.get_label() not in missing]


def _around(
    levels: tuple[float, float, float], boxes: Callable[[float], Box], x1: float, *missing: str
) -> Figure:
    """Portraits before, at and after a bifurcation, which happens at x1; without the missing lines."""
    figure = pictures.new_figure(7.0, 6.2)
    *axes, key = figure.subplots(2, 2).ravel()
    for ax, alpha in zip(axes, levels, strict=True):
        ns.plot.phase_portrait(
            SYSTEM,
            boxes(alpha),
            parameters=at(alpha),
            ax=ax,
            legend=False,
            labels=True,
            title=f"$\\alpha$ = {alpha:.6g}",
            t_end=150.0,
        )
        ax.set(xlabel="$x_1$", ylabel="$x_2$")
    axes[1].plot(x1, levels[1], "*", **_STAR, zorder=9)
    star = Line2D([], [], ls="none", marker="*", **_STAR, label="the bifurcation")
    key.set_axis_off()
    key.legend(handles=[*_legend(*missing), star], loc="center")
    return figure


@picture("boundary node", name="boundary_node")
def node() -> Figure:
    """Before, at and after the boundary node (BN1): the stable node above the threshold turns into
    a stable pseudo-node.
    """
    levels = (BOUNDARY_NODE - 0.02, BOUNDARY_NODE, BOUNDARY_NODE + 0.02)
    return _around(
        levels,
        lambda alpha: (0.55, 0.85, alpha - 0.06, alpha + 0.06),
        HARVESTED_FOLD,
        "separatrix",
    )


@picture("boundary focus", name="boundary_focus")
def focus() -> Figure:
    """Before, at and after the boundary focus (BF3): an unstable focus and a pseudo-saddle appear
    together. The orbit from the visible fold (green) lands beyond the pseudo-saddle.
    """
    levels = (BOUNDARY_FOCUS - 0.015, BOUNDARY_FOCUS, BOUNDARY_FOCUS + 0.015)
    return _around(levels, lambda alpha: (0.02, 0.075, alpha - 0.06, alpha + 0.02), FREE_FOLD)


@picture("pseudo-saddle-node", name="pseudo_saddle_node")
def saddle_node() -> Figure:
    """Before, at and after the pseudo-saddle-node: the pseudo-equilibria merge and vanish, and
    sliding then runs from right to left throughout.
    """
    levels = (SADDLE_NODE - 0.02, SADDLE_NODE, SADDLE_NODE + 0.02)
    return _around(
        levels,
        lambda alpha: (0.15, 0.55, alpha - 0.15, alpha + 0.15),
        pseudo_equilibria(SADDLE_NODE - 1e-15)[0],
        "crossing",
        "orbit through a visible fold",
    )


@picture("four regimes", name="regimes")
def whole() -> Figure:
    """Stable node (0.75), stable pseudo-node (0.88), with pseudo-saddle and unstable focus (1.05),
    stable sliding cycle (1.3).
    """
    figure = pictures.new_figure(7.0, 6.6)
    for ax, alpha in zip(figure.subplots(2, 2).ravel(), (0.75, 0.88, 1.05, 1.3), strict=True):
        ns.plot.phase_portrait(
            SYSTEM,
            (0.0, 1.1, 0.05, 1.7),
            parameters=at(alpha),
            ax=ax,
            legend=False,
            labels=True,
            title=f"$\\alpha$ = {alpha:g}",
            t_end=150.0,
        )
        ax.set(xlabel="$x_1$", ylabel="$x_2$")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=4)
    return figure


@picture("sliding cycles")
def cycles() -> Figure:
    """Sliding cycles through the fold of the free field (dotted line), and the cycle of the model
    without harvest, which touches the threshold from below at alpha = 2.40009.
    """
    figure = pictures.new_figure(7.0, 4.6)
    ax = figure.add_subplot()
    for alpha in (1.2, 1.5, 2.0, 2.3):
        run = run_from_fold(alpha, period(alpha))
        curve = run(np.linspace(0, run.t[-1], 1500))
        ax.plot(*curve.T, color=look.BLUE, linewidth=1.2)
        look.arrowhead(ax, curve, 0.62, look.BLUE)
        end = landing(alpha)[1]
        ax.plot([FREE_FOLD, end], [alpha, alpha], color=look.BLACK, linewidth=3.0)
        ax.text(FREE_FOLD + 0.03, alpha - 0.09, f"$\\alpha$ = {alpha:g}")
    top, curve = free_cycle()
    ax.plot(*curve.T, color=look.VERMILLION, linewidth=1.4, linestyle=look.DASHED)
    look.arrowhead(ax, curve, 0.55, look.VERMILLION)
    ax.plot(FREE_FOLD, top, "D", color=look.VERMILLION, markersize=5)
    ax.axvline(FREE_FOLD, color=look.GREY, linewidth=0.7, linestyle=look.DOTS)
    ax.text(FREE_FOLD + 0.02, top + 0.06, "visible fold, where the cycle grazes the threshold")
    ax.text(FREE_FOLD + 0.01, 0.05, "folds of the free field")
    ax.set(xlabel="$x_1$", ylabel="$x_2$", xlim=(0, 1), ylim=(0, 2.7))
    handles = [
        look.line(look.BLUE, "sliding cycle", 1.2),
        look.line(look.BLACK, "its sliding part", 3.0),
        look.line(look.VERMILLION, "cycle without harvest", 1.4, look.DASHED),
    ]
    ax.legend(handles=handles, loc="upper right", bbox_to_anchor=(1.0, 0.93))
    return figure


@picture("bifurcation diagram")
def diagram() -> Figure:
    """All that lies on the threshold, and the period of the sliding cycle."""
    top, _ = free_cycle()
    figure = pictures.new_figure(7.0, 6.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for x, visible in ((FREE_FOLD, BOUNDARY_FOCUS), (HARVESTED_FOLD, BOUNDARY_NODE)):
        # the free fold is visible above its threshold, the harvested one below its own
        low, high = (0.7, visible), (visible, 2.5)
        solid, dashed = (high, low) if x == FREE_FOLD else (low, high)
        color = look.BELOW if x == FREE_FOLD else look.ABOVE
        upper.plot(solid, (x, x), color=color, linewidth=2.0)
        upper.plot(dashed, (x, x), color=color, linewidth=2.0, linestyle=look.DASHED)
    for start, which, dashes in ((BOUNDARY_FOCUS, 0, look.DASHED), (BOUNDARY_NODE, 1, "-")):
        levels = np.append(np.linspace(start, SADDLE_NODE, 300)[:-1], SADDLE_NODE * (1 - 1e-15))
        roots = [pseudo_equilibria(a) for a in levels]
        points = [r[which] if r else np.nan for r in roots]
        upper.plot(levels, points, color=look.BLACK, linestyle=dashes, linewidth=1.6)
    ends = top - np.geomspace(0.1, 1e-6, 12)  # where it ends as a square root does
    begun = [*np.linspace(BOUNDARY_FOCUS + 1e-3, top - 0.11, 24), *ends]
    born = sliding_homoclinic()
    levels, values = pictures.sampled(lambda a: landing(a)[1], [*begun, born])
    landings = values[:, 0]
    for part, dashes, width, name in (
        (levels <= born, look.DOTS, 1.4, "landing of the fold's orbit"),
        (levels >= born, "-", 1.8, "landing of the sliding cycle"),
    ):
        curve = levels[part], landings[part]
        upper.plot(*curve, color=look.GREEN, linestyle=dashes, linewidth=width, gid=name)
    _bifurcations(upper, lower, top)
    begun = [*(born + np.geomspace(2e-6, 0.3, 20)), *np.linspace(born + 0.32, top - 1e-3, 12)]
    later, logs = pictures.sampled(lambda a: np.log10(period(a, 2500.0)), begun)
    lower.plot(later, 10 ** logs[:, 0], color=look.GREEN, linewidth=1.8)
    upper.set(ylabel="$x_1$ on $x_2 = \\alpha$", ylim=(0, 0.9))
    lower.set(xlabel="$\\alpha$", ylabel="period", yscale="log", xlim=(0.7, 2.5))
    _names(upper)
    return figure


def _names(ax: Axes) -> None:
    """Name the curves beside them; those that lie to both sides of a bifurcation twice."""
    labels = pictures.Labels(ax)
    for x, level, color, name in (
        (FREE_FOLD, BOUNDARY_FOCUS, look.BELOW, "fold of the free field"),
        (HARVESTED_FOLD, BOUNDARY_NODE, look.ABOVE, "fold of the harvested field"),
    ):
        after, before = ("visible", "invisible") if x == FREE_FOLD else ("invisible", "visible")
        labels.name(f"{name}, {after}", [(a, x) for a in np.linspace(1.3, 2.4, 12)], color)
        labels.name(before, [((0.7 + level) / 2, x)], color)
    curves = {line.get_gid(): line.get_xydata() for line in ax.lines if line.get_gid()}
    for height, name in ((0.648, "stable\npseudo-node"), (0.055, "pseudo-\nsaddle")):
        ax.text(1.18, height, name, fontsize=8, ha="right", va="bottom", linespacing=1.0)
    for name in ("landing of the sliding cycle", "landing of the fold's orbit"):
        points = np.asarray(curves[name])
        labels.name(name, points[np.all(np.isfinite(points), axis=1)], look.GREEN)


def _bifurcations(upper: Axes, lower: Axes, top: float) -> None:
    names = (
        (BOUNDARY_NODE, "boundary node"),
        (BOUNDARY_FOCUS, "boundary focus"),
        (SADDLE_NODE, "sliding homoclinic,\npseudo-saddle-node"),
        (top, "grazing-\nsliding"),
    )
    for value, name in names:
        for ax in (upper, lower):
            ax.axvline(value, color=look.GREY, linewidth=0.8, linestyle=look.DOTS)
        right = value == top
        upper.text(
            value - 0.01 if right else value + 0.01,
            0.55 if "boundary" in name else 0.885,
            name,
            fontsize=8,
            va="top",
            ha="right" if right else "left",
            rotation=90 if "boundary" in name else 0,
        )
