"""Portraits over the threshold, the oscillation in time, and the bifurcation diagram."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

import nonsmooth as ns
from nonsmooth.plot import style as look

from .. import pictures
from .model import (
    BOUNDARY_MIXED,
    BOUNDARY_RESTING,
    DENSITY,
    FOLD_FOLD,
    MERGING,
    MIXED,
    RESTING,
    A,
    Array,
    cycle,
    point,
    simulate,
    threshold_of,
)

picture = pictures.Pictures()

_LEVELS = (-0.06, -0.03, -0.01, 0.0, 0.05, 0.22)


def _cycle_points(eps: float) -> tuple[Array, Array, Array]:
    """Times over one period of the cycle, its states, and whether it mixes."""
    temperature, period, _ = cycle(eps)
    run = simulate(point(temperature, eps), eps, period, "-")
    t = np.linspace(0, run.t[-1], 800)
    x = run(t)
    return t, x, x[:, 1] - A * x[:, 0] > eps


@picture("portraits")
def portraits() -> Figure:
    """The box for six thresholds: mixed all the time (-0.06), oscillating (-0.03, -0.01), the
    stable fused focus (0), balanced on the surface (0.05), resting (0.22).
    """
    figure = pictures.new_figure(7.0, 8.4)
    for ax, eps in zip(figure.subplots(3, 2).ravel(), _LEVELS, strict=True):
        ns.plot.phase_portrait(
            DENSITY,
            (0.0, 1.12, -0.12, 0.26),
            parameters={"eps": eps},
            ax=ax,
            legend=False,
            labels=True,
            t_end=8.0,
            title=rf"$\varepsilon$ = {eps:g}".replace("-", "−"),
        )
        if BOUNDARY_MIXED < eps < 0:
            temperature, salinity = _cycle_points(eps)[1].T
            loop = (temperature, salinity - A * temperature)
            ax.plot(*loop, color=look.PURPLE, linewidth=2.6, zorder=5)
        ax.set(xlabel="$T$", ylabel="$S - aT$")
    handles = [
        look.line(look.BLACK, "sliding, attracting", 3.4),
        look.line(look.ORANGE, "sliding, repelling", 3.4, look.DASHED),
        look.line(look.GREY, "crossing", 1.2),
        look.line(look.PURPLE, "stable cycle", 2.6),
        look.line(look.CANARD, "separatrix", 1.8),
        look.line(look.GREEN, "orbit through a visible fold", 1.5),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


@picture("oscillation")
def oscillation() -> Figure:
    """Three periods of the oscillation at eps = -0.01: while the box rests it slowly warms and
    takes up salt; when its density reaches the threshold it mixes, for a short time.
    """
    eps = -0.01
    t, x, mixing = _cycle_points(eps)
    figure = pictures.new_figure(7.0, 4.2)
    top, bottom = figure.subplots(2, 1, sharex=True)
    for k in range(3):
        now = t + k * t[-1]
        top.plot(now, x[:, 0], color=look.VERMILLION, linewidth=1.6)
        top.plot(now, x[:, 1], color=look.BLUE, linewidth=1.6, linestyle=look.DASHED)
        bottom.plot(now, x[:, 1] - A * x[:, 0], color=look.BLACK, linewidth=1.6)
        for ax in (top, bottom):
            ax.axvspan(now[mixing][0], now[mixing][-1], color="#EFCB8C", alpha=0.6, linewidth=0)
    bottom.axhline(eps, color=look.GREY, linewidth=0.9, linestyle=look.DOTS)
    top.set(ylabel="temperature, salinity", xlim=(0, 3 * t[-1]))
    bottom.set(ylabel="density $S - aT$", xlabel="time")
    handles: list[Line2D | Patch] = [
        look.line(look.VERMILLION, "$T$", 1.6),
        look.line(look.BLUE, "$S$", 1.6, look.DASHED),
        Patch(color="#EFCB8C", alpha=0.6, label="mixing"),
        look.line(look.GREY, r"threshold $\varepsilon$", 0.9, look.DOTS),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
    return figure


@picture("bifurcation diagram")
def diagram() -> Figure:
    """Equilibria, pseudo-equilibria and the cycle over the threshold. Two pseudo-equilibria in
    repelling sliding merge at eps = -0.0702. The cycle begins at the fused focus and ends in a
    homoclinic orbit of the boundary equilibrium at eps = -7/165; there its period has no bound.
    """
    figure = pictures.new_figure(7.0, 5.8)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for low, high, color, dashes in (
        (MIXED[0], MERGING, look.BLACK, look.DASHED),
        (MERGING, FOLD_FOLD[0], look.ORANGE, look.DASHED),
        (FOLD_FOLD[0], RESTING[0], look.BLACK, "-"),
    ):
        branch = np.linspace(low, high, 200)
        upper.plot(threshold_of(branch), branch, color=color, linestyle=dashes, linewidth=1.8)
    upper.plot([-0.08, BOUNDARY_MIXED], [MIXED[0]] * 2, color=look.ABOVE, linewidth=2.2)
    upper.plot([BOUNDARY_RESTING, 0.25], [RESTING[0]] * 2, color=look.BELOW, linewidth=2.2)
    begun = [*(BOUNDARY_MIXED + np.geomspace(1e-7, 1e-2, 16)), *-np.geomspace(0.032, 1e-5, 16)]
    levels, extremes = pictures.sampled(_extremes, begun)
    upper.fill_between(levels, *extremes[:, :2].T, color=look.PURPLE, alpha=0.15, linewidth=0)
    for k in (0, 1):
        upper.plot(levels, extremes[:, k], color=look.PURPLE, linewidth=1.8)
    lower.plot(levels, extremes[:, 2], color=look.PURPLE, linewidth=1.8)
    upper.plot(0, FOLD_FOLD[0], "*", color="#F0E442", markeredgecolor="black", markersize=12)
    for value in (BOUNDARY_MIXED, 0.0, BOUNDARY_RESTING):
        for ax in (upper, lower):
            ax.axvline(value, color=look.GREY, linewidth=0.8, linestyle=look.DOTS)
    for value, words in (
        (BOUNDARY_MIXED, "mixed equilibrium\nmeets the threshold"),
        (BOUNDARY_RESTING, "resting equilibrium\nmeets the threshold"),
    ):
        upper.text(value, 1.12, words, ha="center", va="bottom")
    upper.set(ylabel="$T$", xlim=(-0.08, 0.25), ylim=(0, 1.1))
    lower.set(xlabel=r"$\varepsilon$", ylabel="period", ylim=(0, None))
    _names(upper, levels, extremes[:, 1])
    return figure


def _names(ax: Axes, levels: Array, warmest: Array) -> None:
    """Name the curves of the diagram beside them."""
    labels = pictures.Labels(ax)
    for low, high, color, name in (  # names of the unstable ones left of the cycle
        (0.9 * MIXED[0] + 0.1 * MERGING, 0.5 * (MIXED[0] + MERGING), look.BLACK, "pseudo-\nsaddle"),
        (MERGING + 0.05, MERGING + 0.2, look.REPELLING, "unstable\npseudo-\nnode"),
        (FOLD_FOLD[0] + 0.05, RESTING[0], look.BLACK, "stable pseudo-node"),
    ):
        branch = np.linspace(low, high, 30)
        labels.name(name, np.column_stack([threshold_of(branch), branch]), color)
    for name, low, high, value, color in (
        ("mixed equilibrium,\nstable", -0.08, BOUNDARY_MIXED, MIXED[0], look.ABOVE),
        ("resting equilibrium,\nstable", BOUNDARY_RESTING, 0.25, RESTING[0], look.BELOW),
    ):
        labels.name(name, [(x, value) for x in np.linspace(low, high, 9)], color)
    labels.name("cycle: least\nand largest $T$", np.column_stack([levels, warmest]), look.PURPLE)
    labels.name("fused focus", (0.0, FOLD_FOLD[0]))


def _extremes(eps: float) -> tuple[float, float, float]:
    """Least and largest temperature of the cycle, and its period."""
    t, x, _ = _cycle_points(eps)
    return float(x[:, 0].min()), float(x[:, 0].max()), float(t[-1])
