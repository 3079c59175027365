"""The figures, drawn again from the normal form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

import nonsmooth as ns

from .. import look
from ..pictures import Picture
from .model import BEND, CALM, CLASSES, RECURRENT, excursions, recurrent, slid_from


def _legend() -> list[Line2D | Patch]:
    return [
        look.line(look.ABOVE, "fold of $x > 0$, visible", 2.2),
        look.line(look.ABOVE, "the same, invisible", 2.2, look.DASHED),
        look.line(look.BELOW, "fold of $x < 0$, visible", 2.2),
        look.line(look.BELOW, "the same, invisible", 2.2, look.DASHED),
        look.line(look.CANARD, "canard", 2.6),
        look.line(look.GREEN, "faux canard", 2.6, look.DASHED),
        Patch(
            facecolor="white", edgecolor=look.GREY, hatch="////", label="all pass $D_a$ to $D_r$"
        ),
        Patch(facecolor="white", edgecolor=look.GREY, hatch="...", label="all pass $D_r$ to $D_a$"),
    ]


def _portraits(names: tuple[str, ...]) -> Callable[[], Figure]:
    def draw() -> Figure:
        with look.settings():
            figure = look.new_figure(4.1 * len(names) + 0.4, 5.2)
            for ax, name in zip(figure.subplots(1, len(names)), names, strict=True):
                ns.plot.two_fold(CLASSES[name], ax=ax, legend=False)
                ax.set(xlabel="$y$", ylabel="$z$")
            columns = 4 if len(names) > 2 else 3
            figure.legend(handles=_legend(), loc="outside lower center", ncols=columns)
        return figure

    return draw


def space() -> Figure:
    """One two-fold of each kind, with the flow on both sides."""
    names = ("VV-C1", "II-F", "II-C", "mix-C")
    with look.settings():
        figure = look.new_figure(10.4, 7.6)
        for ax, name in zip(figure.subplots(2, 2).ravel(), names, strict=True):
            ns.plot.two_fold_3d(CLASSES[name], ax=ax, legend=False)
        figure.legend(handles=_legend()[:6], loc="outside lower center", ncols=6)
    return figure


def maps() -> Figure:
    """Classes over the plane of nu1 and nu2, for each kind."""
    with look.settings():
        figure = look.new_figure(14.0, 6.4)
        for ax, kind in zip(figure.subplots(1, 3), ("VV", "II", "VI"), strict=True):
            ns.plot.two_fold_map(kind, ax=ax)
    return figure


def funnel() -> Figure:
    """Excursions from the singularity and back, in space."""
    with look.settings():
        figure = look.new_figure(8.0, 6.2)
        ax = figure.add_subplot(projection="3d")
        for k, (e, color) in enumerate(
            zip(
                excursions()[:5],
                (look.ABOVE, look.BLUE, look.GREEN, look.PURPLE, look.ORANGE),
                strict=True,
            )
        ):
            t = np.linspace(0, e.trajectory.t[-1], 3000)
            x, y, z = np.vstack([slid_from(tuple(e.start)), e.trajectory(t)]).T
            ax.plot(y, z, x, color=color, linewidth=1.3, label=f"excursion {k + 1}")
        ax.plot([0], [0], [0], "o", color="black", markersize=6)
        ax.set(xlabel="$y$", ylabel="$z$", zlabel="$x$")
        ax.view_init(elev=20, azim=-55)
        ax.set_box_aspect((1, 1, 0.75))
        ax.legend(loc="upper left")
    return figure


def series() -> Figure:
    """One solution: excursion after excursion, each drawn by chance at the singularity."""
    with look.settings():
        figure = look.new_figure(9.6, 4.8)
        top, bottom = figure.subplots(2, 1, height_ratios=(2, 1))
        now, amplitudes = 0.0, []
        for e in excursions():
            t = np.linspace(0, e.trajectory.t[-1], 1200)
            if now < 150:
                top.plot(now + t, e.trajectory(t)[:, 0], color=look.BLACK, linewidth=0.9)
                top.plot(now, 0, "o", color=look.VERMILLION, markersize=4)
            now += e.trajectory.t[-1]
            amplitudes.append(e.amplitude)
        top.set(xlabel="time", ylabel="$x$", xlim=(0, 150), ylim=(-0.6, 1.45))
        bottom.plot(np.arange(1, len(amplitudes) + 1), amplitudes, "o", color=look.BLUE, ms=4)
        bottom.set(xlabel="excursion", ylabel="largest $x$", ylim=(0, None))
        handles = [
            Line2D([], [], color=look.VERMILLION, marker="o", ls="none", label="at the two-fold")
        ]
        top.legend(handles=handles, loc="upper right")
    return figure


def surface() -> Figure:
    """Sliding portraits of the recurrent system on both sides of the bifurcation."""
    with look.settings():
        figure = look.new_figure(12.4, 5.0)
        left, right = figure.subplots(1, 2)
        for ax, nu in ((left, RECURRENT), (right, CALM)):
            ns.plot.sliding_portrait(
                recurrent(),
                (-0.5, 0.5, -0.5, 0.5),
                parameters={"nu1": nu, "nu2": nu},
                ax=ax,
                legend=ax is right,
                title=rf"$\nu_1 = \nu_2$ = {nu:g}".replace("-", "−"),
            )
            ax.set_aspect("equal")
    return figure


PICTURES: tuple[Picture, ...] = (
    Picture(
        "visible",
        "visible two-folds",
        "The two sliding portraits of a visible two-fold.",
        _portraits(("VV-C1", "VV-F")),
    ),
    Picture(
        "invisible",
        "invisible two-folds",
        "The two sliding portraits of an invisible two-fold, on both sides of nu1 nu2 = 1.",
        _portraits(("II-F", "II-C")),
    ),
    Picture(
        "mixed",
        "mixed two-folds",
        "The four sliding portraits of a visible-invisible two-fold.",
        _portraits(("mix-0", "mix-S", "mix-C", "mix-F")),
    ),
    Picture(
        "space",
        "flow in space",
        "Two-folds of the three kinds, with (z1, z2, z3) for (x, y, z).",
        space,
    ),
    Picture(
        "maps",
        "classes",
        "The class of a two-fold by its numbers nu1 and nu2, for each kind.",
        maps,
    ),
    Picture(
        "excursions",
        "excursions",
        f"Five excursions from the two-fold of x > 0: (-y, 1, nu1 + {BEND:g} x), x < 0: (z, nu2, 1), "
        f"nu1 = nu2 = {RECURRENT}: each slides on for a while, leaves to one side, crosses, slides, "
        "and ends where it began.",
        funnel,
    ),
    Picture(
        "series",
        "nondeterministic chaos",
        "One solution of the same system. At each visit of the two-fold what follows is drawn by chance.",
        series,
    ),
    Picture(
        "surface",
        "recurrent system",
        "Its sliding portrait. Left, nu1 nu2 > 1: every attracting sliding orbit nearby reaches the "
        "two-fold. Right, nu1 nu2 < 1: none does.",
        surface,
    ),
)
