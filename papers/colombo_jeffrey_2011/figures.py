"""The figures, drawn again from the normal form."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

import nonsmooth as ns
from nonsmooth.plot import style as look
from nonsmooth.plot.two_folds.class_map import FILLS

from .. import pictures
from .model import BEND, CALM, CLASSES, RECURRENT, excursions, recurrent, slid_from

picture = pictures.Pictures()

_HIGH = 0.3  # of the highest arc of an excursion: lower ones have no arrow


def _legend(names: Sequence[str] = ()) -> list[Line2D | Patch]:
    """What areas and lines are; hatches only where one of the named portraits has them."""
    classes = [ns.two_folds.classify_two_fold(*CLASSES[name]) for name in names]
    hatches = [
        (any(f.canards == math.inf for f in classes), "////", "all pass $D_a$ to $D_r$"),
        (any(f.faux_canards == math.inf for f in classes), "...", "all pass $D_r$ to $D_a$"),
    ]
    return [
        Patch(facecolor=look.TINT_ATTRACTING, label="$D_a$: attracting sliding"),
        Patch(facecolor=look.TINT_REPELLING, label="$D_r$: repelling sliding"),
        look.line(look.ABOVE, "orbits in $x > 0$, field $F_1$"),
        look.line(look.BELOW, "orbits in $x < 0$, field $F_2$", dashes=look.DASHED),
        *(
            Patch(facecolor="white", edgecolor=look.GREY, hatch=hatch, label=text)
            for seen, hatch, text in hatches
            if seen
        ),
    ]


def _portraits(names: tuple[str, ...]) -> Callable[[], Figure]:
    def draw() -> Figure:
        rows = (len(names) + 1) // 2
        figure = pictures.new_figure(7.0, 3.2 * rows + (1.4 if len(names) == 2 else 0.9))
        axes = figure.subplots(rows, 2).ravel()
        for ax, name in zip(axes, names, strict=False):
            ns.plot.two_fold(CLASSES[name], ax=ax, legend=False, labels=True)
            ax.set(xlabel="$y$", ylabel="$z$")
        if len(names) % 2:
            axes[-1].set_axis_off()
            axes[-1].legend(handles=_legend(names), loc="center")
        else:
            figure.legend(handles=_legend(names), loc="outside lower center", ncols=3)
        return figure

    return draw


picture(
    "visible two-folds", name="visible", caption="The two sliding portraits of a visible two-fold."
)(_portraits(("VV-C1", "VV-F")))
picture(
    "invisible two-folds",
    name="invisible",
    caption="The two sliding portraits of an invisible two-fold, on both sides of nu1 nu2 = 1.",
)(_portraits(("II-F", "II-C")))
picture(
    "mixed two-folds",
    name="mixed",
    caption="The four sliding portraits of a visible-invisible two-fold.",
)(_portraits(("mix-0", "mix-S", "mix-C", "mix-F")))


@picture("flow in space")
def space() -> Figure:
    """Two-folds of the three kinds, with (z1, z2, z3) for (x, y, z)."""
    names = ("VV-C1", "II-F", "II-C", "mix-C")
    figure = pictures.new_figure(7.0, 5.8)
    for ax, name in zip(figure.subplots(2, 2).ravel(), names, strict=True):
        ns.plot.two_fold_3d(CLASSES[name], ax=ax, legend=False, labels=True)
    shadows = look.line("#B5B5B5", "shadows of orbits above", 1.0)
    figure.legend(handles=[*_legend(), shadows], loc="outside lower center", ncols=3)
    return figure


@picture("classes")
def maps() -> Figure:
    """The class of a two-fold by its numbers nu1 and nu2, for each kind."""
    figure = pictures.new_figure(7.0, 8.6)
    axes = figure.subplots(2, 2).ravel()
    for ax, kind in zip(axes, ("VV", "II", "VI"), strict=False):
        ns.plot.two_fold_map(kind, ax=ax)
    handles = [
        Patch(facecolor=FILLS["VV-C1"][0], label="one canard"),
        Patch(facecolor=FILLS["II-C"][0], hatch="//", label="infinitely many canards"),
        Patch(facecolor=FILLS["II-F"][0], label="one faux canard"),
        Patch(facecolor=FILLS["VV-F"][0], hatch="..", label="infinitely many faux canards"),
        Patch(facecolor=FILLS["mix-S"][0], label="one canard, one faux canard"),
        Patch(facecolor=FILLS["mix-0"][0], label="none"),
    ]
    axes[3].set_axis_off()
    axes[3].legend(handles=handles, loc="center")
    return figure


@picture(
    "excursions",
    name="excursions",
    caption=f"Two excursions from the two-fold of x > 0: (-y, 1, nu1 + {BEND:g} x), x < 0: (z, nu2, 1), "
    f"nu1 = nu2 = {RECURRENT}: each slides on for a while, leaves to one side, crosses, slides, "
    "and ends where it began. Arrows: the direction of time.",
)
def funnel() -> Figure:
    """Excursions from the singularity and back, in space."""
    figure = pictures.new_figure(7.0, 4.6)
    # Axes in space are square: taller than the figure, so that they are as wide.
    figure.set_layout_engine("none")
    place = (0, 0.53 - 3.5 / 4.6, 1, 7 / 4.6)
    ax = figure.add_axes(place, projection="3d", computed_zorder=False)
    kinds = ((1, look.TINT_ATTRACTING, "$D_a$"), (-1, look.TINT_REPELLING, "$D_r$"))
    for sign, tint, name in kinds:
        corners = sign * np.array([[0, 0, 0], [1, 0, 0], [1, 0.8, 0], [0, 0.8, 0]])
        ax.add_collection3d(Poly3DCollection([corners], facecolor=tint, zorder=1))
        ax.text(0.88 * sign, 0.62 * sign, 0, name, fontsize=11, zorder=7)
    edge = np.array([[-1, -1, 1, 1, -1], [-0.8, 0.8, 0.8, -0.8, -0.8]])
    ax.plot(*edge, [0] * 5, color=look.GREY, linewidth=0.8, zorder=1)
    ax.plot([0, 0], [-0.8, 0.8], [0, 0], color=look.ABOVE, linestyle=look.DASHED, zorder=2)
    ax.plot([-1, 1], [0, 0], [0, 0], color=look.BELOW, linestyle=look.DASHED, zorder=2)
    ax.set_axis_off()
    ax.view_init(elev=17, azim=-62)
    ax.set_box_aspect((1.3, 1, 0.72), zoom=1.35)
    orbits = []
    for e, color in zip(excursions()[1:3], (look.BLACK, look.CANARD), strict=True):
        t = np.linspace(0, e.trajectory.t[-1], 3000)
        x, y, z = np.vstack([slid_from(tuple(e.start)), e.trajectory(t)]).T
        for side, order, width in ((-1, 0, 0.8), (1, 4, 1.5)):
            shown = [np.where(side * x >= -1e-9, c, np.nan) for c in (y, z, x)]
            ax.plot(*shown, color=color, linewidth=width, zorder=order)
        orbits.append((np.column_stack([y, z, x]), color))
    ax.plot([0], [0], [0], "o", color="black", markersize=5, zorder=6)
    for orbit, color in orbits:  # the limits of the axes are known
        _times(ax, orbit, color)
    handles = [
        look.line(look.BLACK, "an excursion, thin below the surface"),
        look.line(look.CANARD, "another excursion"),
        look.line(look.ABOVE, "fold of $x > 0$", dashes=look.DASHED),
        look.line(look.BELOW, "fold of $x < 0$", dashes=look.DASHED),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=2)
    return figure


def _times(ax: Axes3D, orbit: NDArray[np.float64], color: str) -> None:
    """Arrows of time: one on each arc above the surface that is high enough to be seen."""
    flat = np.column_stack(proj3d.proj_transform(*orbit.T, ax.get_proj())[:2])
    high = np.concatenate([[False], orbit[:, 2] > 1e-9, [False]])
    edges = np.flatnonzero(np.diff(high.astype(int)))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if orbit[first:last, 2].max() > _HIGH * orbit[:, 2].max():
            arc = flat[first:last]
            far = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(arc, axis=0).T))])
            k = int(np.searchsorted(far, 0.35 * far[-1]))
            head = dict(
                arrowstyle="-|>", color=color, lw=0, shrinkA=0, shrinkB=0, mutation_scale=12
            )
            ax.annotate("", arc[k + 1], arc[k - 1], arrowprops=head, zorder=8)


@picture("nondeterministic chaos")
def series() -> Figure:
    """One solution of the same system. At each visit of the two-fold what follows is drawn by
    chance.
    """
    figure = pictures.new_figure(7.0, 4.0)
    top, bottom = figure.subplots(2, 1, height_ratios=(2, 1))
    now, amplitudes = 0.0, []
    for e in excursions():
        t = np.linspace(0, e.trajectory.t[-1], 1200)
        if now < 150:
            top.plot(now + t, e.trajectory(t)[:, 0], color=look.BLACK, linewidth=0.9)
            for piece in e.trajectory.segments:
                if piece.mode == "s":
                    top.axvspan(now + piece.t_start, now + piece.t_end, color=look.TINT_ATTRACTING)
            top.plot(now, 0, "o", color=look.VERMILLION, markersize=4)
        now += e.trajectory.t[-1]
        amplitudes.append(e.amplitude)
    top.set(xlabel="time", ylabel="$x$", xlim=(0, 150), ylim=(-0.6, 1.5))
    bottom.plot(np.arange(1, len(amplitudes) + 1), amplitudes, "o", color=look.BLUE, ms=4)
    bottom.set(xlabel="excursion", ylabel="largest $x$", ylim=(0, 1.4))
    handles = [
        Line2D([], [], color=look.VERMILLION, marker="o", ls="none", label="at the two-fold"),
        Patch(facecolor=look.TINT_ATTRACTING, label="sliding"),
    ]
    top.legend(handles=handles, loc="lower right", bbox_to_anchor=(1, 1), ncols=2)
    return figure


@picture("recurrent system")
def surface() -> Figure:
    """Its sliding portrait. Left, nu1 nu2 > 1: every attracting sliding orbit nearby reaches the
    two-fold. Right, nu1 nu2 < 1: none does.
    """
    figure = pictures.new_figure(7.0, 4.2)
    left, right = figure.subplots(1, 2)
    for ax, nu in ((left, RECURRENT), (right, CALM)):
        ns.plot.sliding_portrait(
            recurrent(),
            (-0.5, 0.5, -0.5, 0.5),
            parameters={"nu1": nu, "nu2": nu},
            ax=ax,
            legend=False,
            labels=True,
            title=rf"$\nu_1 = \nu_2$ = {nu:g}".replace("-", "−"),
        )
        ax.set_aspect("equal")
    handles = [
        Patch(facecolor=look.TINT_ATTRACTING, label="$D_a$: attracting sliding"),
        Patch(facecolor=look.TINT_REPELLING, label="$D_r$: repelling sliding"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure
