"""The figures, drawn again from the normal form."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

import nonsmooth as ns
from nonsmooth.plot import style as look

from .. import pictures
from .model import (
    AFTER,
    AT,
    BEFORE,
    SIGMA,
    Array,
    V,
    flights,
    formula_for_flights,
    most_flights,
    run,
)
from .results import COUNTS

picture = pictures.Pictures()

_CASES = (("a", BEFORE, "$V^+V^- < 1$"), ("b", AT, "$V^+V^- = 1$"), ("c", AFTER, "$V^+V^- > 1$"))
_FINITE: V = (-0.75, -1.0)  # at most 5 flights
_COLORS = ("#E3E3E3", "#DCEBF5", "#A9CCE3", "#6FA8CF", "#3C7FB1", "#1B4F72")


def _numbers(v: V) -> str:
    return f"({v[0]:g}, {v[1]:g})".replace("-", "−")


@picture("flow")
def space() -> Figure:
    """The flow near the two-fold before, at and after the bifurcation, with (z1, z2, z3) for (x,
    y, z). Orbits above and below the surface cross it repeatedly; after the bifurcation,
    invariant lines bound those that fall into the singularity.
    """
    figure = pictures.new_figure(7.0, 5.4)
    *axes, key = figure.subplots(2, 2).ravel()
    for ax, (letter, v, words) in zip(axes, _CASES, strict=True):
        title = f"({letter}) {words}: $V$ = {_numbers(v)}"
        ns.plot.two_fold_3d((SIGMA, v), ax=ax, legend=False, labels=True, title=title)
    handles = [
        look.line(look.ABOVE, "orbits in $x > 0$, field $F_1$"),
        look.line(look.BELOW, "orbits in $x < 0$, field $F_2$", dashes=look.DASHED),
        look.line(look.BLACK, "sliding, attracting", 0.9),
        look.line(look.REPELLING, "sliding, repelling", 0.9),
        look.line("#B5B5B5", "shadows of orbits above", 1.0),
    ]
    key.set_axis_off()
    key.legend(handles=handles, loc="center")
    return figure


@picture("sliding")
def sliding() -> Figure:
    """The sliding portraits. Before the bifurcation sliding orbits turn away from the singularity;
    at V+ V- = 1 one eigenvalue is 0, a line of pseudo-equilibria; after it every sliding orbit
    passes through the singularity (hatched).
    """
    figure = pictures.new_figure(7.0, 6.6)
    *axes, key = figure.subplots(2, 2).ravel()
    for ax, (letter, v, words) in zip(axes, _CASES, strict=True):
        title = f"({letter}) {words}: $V$ = {_numbers(v)}"
        ns.plot.two_fold((SIGMA, v), ax=ax, legend=False, labels=True, title=title)
        ax.set(xlabel="$y$", ylabel="$z$")
    handles = [
        Patch(facecolor=look.TINT_ATTRACTING, label="$D_a$: attracting sliding"),
        Patch(facecolor=look.TINT_REPELLING, label="$D_r$: repelling sliding"),
        look.line(look.ABOVE, "orbits in $x > 0$, field $F_1$"),
        look.line(look.BELOW, "orbits in $x < 0$, field $F_2$", dashes=look.DASHED),
        Patch(
            facecolor="white",
            edgecolor=look.GREY,
            hatch="////",
            label="all pass $D_a$ to $D_r$",
        ),
    ]
    key.set_axis_off()
    key.legend(handles=handles, loc="center")
    return figure


def _arcs(start: Array, above: bool) -> tuple[Array, Array, Array]:
    """Surface of the arcs from the ray through ``start``; its edges cross the diabolo's axis at right angles."""
    share = np.linspace(0.0, 1.0, 81)
    y, z = start
    t = -2 * (y if above else z) * share
    if above:
        arc = _turned(-y * t - t**2 / 2, y + t, z + AFTER[0] * t)
    else:
        arc = _turned(z * t + t**2 / 2, y + AFTER[1] * t, z + t)
    size = np.linspace(0.0, 1.0, 25)[:, None] / np.abs(arc[0])
    return size * arc[0], size * arc[1], size**2 * arc[2]


def _turned(x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Coordinates with y = z as the first axis, along which the two surfaces open."""
    return (y + z) / math.sqrt(2), (z - y) / math.sqrt(2), x


@picture(
    "nonsmooth diabolo",
    caption=f"The two invariant surfaces for V = {_numbers(AFTER)} and an orbit on the one whose orbits "
    "fall into the singularity, crossing infinitely often until t = 3.828427.",
)
def diabolo() -> Figure:
    """The pair of invariant surfaces with an orbit on the one whose orbits fall in."""
    low, high = ns.two_folds.diabolo_slopes(AFTER)
    figure = pictures.new_figure(7.0, 3.4)
    # Axes in space are square: taller than the figure, so that they are as wide.
    figure.set_layout_engine("none")
    place = (0, 0.55 - 3.5 / 3.4, 1, 7 / 3.4)
    ax = figure.add_axes(place, projection="3d", computed_zorder=False)
    plane = 0.8 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]).T
    ax.plot(*_turned(np.zeros(5), *plane), color=look.GREY, linewidth=0.8, zorder=1)
    for y, z in (([-0.8, 0.8], [0, 0]), ([0, 0], [-0.8, 0.8])):
        fold = _turned(np.zeros(2), np.array(y), np.array(z))
        ax.plot(*fold, color=look.GREY, linewidth=0.8, zorder=1, linestyle=look.DASHED)
    for slope, color in ((low, look.ORANGE), (high, look.BLUE)):
        up = np.array([-1.0, slope])
        for above in (False, True):
            surface = _arcs(up if above else ns.two_folds.flight_above(up, AFTER), above)
            ax.plot_surface(*surface, color=color, alpha=0.25, linewidth=0, zorder=2 + above)
            for ring in (-1, 16, 8):
                ax.plot(*(c[ring] for c in surface), color=color, linewidth=1.0, zorder=4)
            ax.plot(*(c[:, 0] for c in surface), color=color, linewidth=1.8, zorder=4)
    size = math.sqrt(2) / (high - 1)  # begins where the surface is cut off
    orbit = run(AFTER, (-size, size * high), 3.828427 * size)
    t = orbit.t[-1] * (1 - np.concatenate([[0], np.geomspace(1e-4, 1, 800)])[::-1])
    x, y, z = orbit(t).T
    for side, color in ((1, look.ABOVE), (-1, look.BLACK)):
        shown = [np.where(side * x >= 0, c, np.nan) for c in _turned(x, y, z)]
        ax.plot(*shown, color=color, linewidth=2.0, zorder=5)
    ax.plot([0], [0], [0], "o", color="black", markersize=5, zorder=6)
    for at, words, side in (
        ((1.2, 0.2, 0), "$D_a$", "right"),
        ((-1.25, -0.2, 0), "$D_r$", "left"),
    ):
        ax.text(*at, words, ha=side, fontsize=10, zorder=7, path_effects=look.halo())
    ax.set_axis_off()
    ax.view_init(elev=16, azim=-78)
    ax.set_box_aspect((2, 1.4, 0.62), zoom=1.24)
    handles = [
        Patch(color=look.BLUE, alpha=0.4, label="orbits fall in"),
        Patch(color=look.ORANGE, alpha=0.4, label="orbits come out"),
        look.line(look.ABOVE, "an orbit, $x > 0$"),
        look.line(look.BLACK, "the same orbit, $x < 0$"),
        look.line(look.GREY, "surface $x = 0$ and its folds", 0.8, look.DASHED),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3)
    return figure


def _flights_by_slope(v: V) -> tuple[Array, list[int]]:
    """Edges of angles in the crossing region y < 0 < z, and the flights from between them."""
    edges = np.linspace(0.0, math.pi / 2, 91)
    middles = (edges[1:] + edges[:-1]) / 2
    runs = [run(v, (-math.cos(a), math.sin(a)), 60.0, tol=1e-8) for a in middles]
    return edges, [flights(r) if "s" in r.itinerary else 0 for r in runs]


@picture("regions of attraction")
def regions() -> Figure:
    """How many flights an orbit makes that starts on the surface, by simulation. Before the
    bifurcation everything comes to slide; after it only what starts inside the surface on which
    orbits fall in (violet lines), and all of that reaches the singularity. Green: the surface
    on which they come out of it.
    """
    figure = pictures.new_figure(7.0, 3.4)
    axes = figure.subplots(1, 2)
    for ax, v in zip(axes, (_FINITE, AFTER), strict=True):
        for turn in (1, -1):
            # below the surface the roles of y and z, and of V+ and V-, are exchanged
            edges, counts = _flights_by_slope(v if turn > 0 else (v[1], v[0]))
            for a, b, n in zip(edges[:-1], edges[1:], counts, strict=True):
                corners = np.array([[0, 0], *[[-math.cos(q), math.sin(q)] for q in (a, b)]])
                corners = corners if turn > 0 else corners[:, ::-1]
                color = _COLORS[min(n, 5)]
                ax.add_patch(Polygon(2 * corners, facecolor=color, edgecolor=color, lw=0.3))
        _dress(ax, v)
    scale = ListedColormap(_COLORS)
    bar = figure.colorbar(
        ScalarMappable(BoundaryNorm(np.arange(-0.5, 6), 6), scale), ax=axes, shrink=0.85
    )
    bar.set_ticks(range(6), labels=["none", "1", "2", "3", "4", "5 or more"])
    bar.set_label("flights before it slides")
    return figure


def _dress(ax: Axes, v: V) -> None:
    """Folds, names, and the diabolo lines where there are some."""
    for x, y in (([-1, 1], [0, 0]), ([0, 0], [-1, 1])):
        ax.plot(x, y, color="black", linewidth=1.6, linestyle=look.DASHED)
    if v[0] * v[1] > 1:
        names = (
            (look.GREEN, "come out", (-0.71, 0.13)),
            (look.CANARD, "fall in", (-0.5, 0.86)),
        )
        for slope, (color, words, place) in zip(ns.two_folds.diabolo_slopes(v), names, strict=True):
            look.write(ax, place, words, color=color, path_effects=look.halo(), rotation=0)
            start = np.array([-1.0, slope])
            for z in (start, ns.two_folds.flight_above(start, v)):
                ax.plot(*np.array([0 * z, z / np.abs(z).max()]).T, color=color, linewidth=2.2)
    ax.text(0.5, 0.5, "attracting\nsliding", ha="center", va="center")
    ax.text(-0.5, -0.5, "repelling\nsliding", ha="center", va="center")
    ax.set(xlim=(-1, 1), ylim=(-1, 1), xlabel="$y$", ylabel="$z$", title=f"$V$ = {_numbers(v)}")
    ax.set_aspect("equal")


@picture("number of crossings")
def crossings() -> Figure:
    """Largest number of flights before sliding, by formula and by simulation."""
    figure = pictures.new_figure(3.4, 2.7)
    ax = figure.add_subplot()
    away = np.geomspace(1, 2e-3, 4000)[1:]
    ax.plot(away, [formula_for_flights(1 - a) for a in away], color=look.BLACK, lw=1.2)
    for v, _ in COUNTS:
        ax.plot(1 - v[0] * v[1], most_flights(v), "o", color=look.ABOVE, markersize=7)
    ax.set(xscale="log", yscale="log", xlabel="$1 - V^+V^-$", ylabel="most flights")
    ax.invert_xaxis()
    ticks = [2, 3, 5, 9, 20, 31, 60]
    ax.set_yticks(ticks, labels=[str(n) for n in ticks])
    ax.minorticks_off()
    handles = [
        Line2D([], [], color="black", label=r"$\lceil\pi/\arccos\sqrt{V^+V^-}\,\rceil - 1$"),
        Line2D([], [], color=look.ABOVE, marker="o", ls="none", label="simulated orbits"),
    ]
    ax.legend(handles=handles, loc="upper left")
    return figure


@picture("return map")
def eigenvalues() -> Figure:
    """Eigenvalues of the return map move round the unit circle and meet at 1 as V+ V- reaches 1.
    Of each pair one is labelled; the other is its conjugate, or on the right of 1 its inverse.
    """
    figure = pictures.new_figure(7.0, 3.2)
    left, right = figure.subplots(1, 2)
    circle = np.linspace(0, 2 * math.pi, 200)
    left.plot(np.cos(circle), np.sin(circle), color=look.GREY, linewidth=0.8)
    for p in (0.05, 0.25, 0.5, 0.75, 0.9, 1.0, 1.05, 1.2):
        values = np.linalg.eigvals(ns.two_folds.return_matrix((-p, -1.0)))
        color = look.BLUE if p < 1 else look.VERMILLION
        left.plot(values.real, values.imag, "o" if p < 1 else "D", color=color, markersize=5)
        at = complex(values.real.max(), abs(values.imag[0]))
        away = at / abs(at) if p < 1 else complex(0.5, 0.75)  # outwards from the circle
        left.annotate(
            f"{p:g}",
            (at.real, at.imag),
            xytext=(11 * away.real, 10 * away.imag),
            fontsize=8,
            textcoords="offset points",
            ha="center" if p < 1 else "left",
            va="center",
        )
    left.set(xlabel="Re", ylabel="Im", title="eigenvalues, labelled by $V^+V^-$")
    left.set(xlim=(-1.6, 3.0), ylim=(-1.4, 1.4))
    left.set_aspect("equal")
    p = np.linspace(0, 2.5, 501)
    root = np.sqrt((p - 1).astype(complex))
    for sign, dashes in ((1, "-"), (-1, look.DASHED)):
        size = np.abs((np.sqrt(p) + sign * root) ** 2)
        right.plot(p, size, color=look.BLACK, linestyle=dashes)
    right.axvline(1, color=look.GREY, linewidth=0.8)
    right.set(yscale="log", xlabel="$V^+V^-$", ylabel="modulus")
    ticks = [0.15, 0.3, 0.5, 1, 2, 3, 6]
    right.set_yticks(ticks, labels=[f"{v:g}" for v in ticks])
    right.minorticks_off()
    right.set_title("moduli: 1 until $V^+V^- = 1$")
    return figure
