"""Draw the picture of the architecture again: `python docs/tools/architecture.py`."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

import nonsmooth as ns
from nonsmooth.plot import style

PICTURE = Path(__file__).parents[1] / "images" / "architecture.png"

#: From top to bottom: names of one layer, and what it is for.
LAYERS = (
    (("bounce",), "a bouncing ball with friction"),
    (("textbook", "plot", "proofs"), "named systems; pictures; theorems"),
    (("orbit",), "periodic, branches, manifolds, ..."),
    (("local", "flow"), "at a point; in time, many runs too"),
    (("solvers",), "Newton, continuation, zeros"),
    (("model",), "definition, expressions, derivatives, laws"),
)

#: The path of a run: where, and what is done there.
PATH = (
    ("definition", "FilippovSystem: states,\nfields, elements, events"),
    ("derivatives", "Taylor series of states,\nmultipliers and guards"),
    ("printing", "the same series as data or as C"),
    ("expand", "polynomials on a step of length h"),
    ("first root", "of all guards of the mode"),
    ("check, advance", "field at the end; store the step"),
    ("decide", "events; the admissible mode"),
    ("results", "Trajectory: dense output,\nevents, itinerary, status"),
)
LOOP = (3, 6)  # expand to decide, until the end


def box(ax: Axes, x: float, y: float, width: float, text: str, colour: str) -> None:
    """A rounded box with a text in its middle."""
    shape = FancyBboxPatch(
        (x, y), width, 0.62, boxstyle="round,pad=0,rounding_size=0.08", fc=colour, ec="0.3", lw=0.8
    )
    ax.add_patch(shape)
    ax.text(x + width / 2, y + 0.31, text, ha="center", va="center", weight="bold")


def draw_layers(ax: Axes) -> None:
    """The layers; each imports only from those below it."""
    for k, (names, about) in enumerate(reversed(LAYERS)):
        width = 3.0 / len(names)
        for j, name in enumerate(names):
            colour = "#FBE3D3" if name == "bounce" else style.TINT_ATTRACTING
            box(ax, j * width, 1.15 * k, width - 0.06, name, colour)
        ax.text(0.0, 1.15 * k - 0.06, about, va="top")
    ax.annotate("", (3.4, 0.0), (3.4, 6.4), arrowprops=dict(arrowstyle="-|>", color="0.3"))
    ax.text(3.48, 3.2, "imports", rotation=90, va="center", color="0.3")
    ax.set(xlim=(-0.05, 3.75), ylim=(-0.4, 6.75), title="Layers")


def draw_path(ax: Axes) -> None:
    """From the definition to the trajectory."""
    count = len(PATH)
    for k, (name, about) in enumerate(PATH):
        y = 0.86 * (count - 1 - k)
        inside = LOOP[0] <= k <= LOOP[1]
        box(ax, 0, y, 1.45, name, style.TINT_REPELLING if inside else style.TINT_ATTRACTING)
        ax.text(1.55, y + 0.31, about, va="center")
        if k + 1 < count:
            ax.annotate(
                "", (0.72, y - 0.24), (0.72, y), arrowprops=dict(arrowstyle="-|>", color="0.3")
            )
    bottom, top = (0.86 * (count - 1 - LOOP[k]) + 0.31 for k in (1, 0))
    ax.annotate(
        "",
        (0, top),
        (0, bottom),
        arrowprops=dict(
            arrowstyle="-|>",
            color="0.3",
            connectionstyle="bar,fraction=-0.12",
            shrinkA=0,
            shrinkB=0,
        ),
    )
    ax.text(-0.52, (top + bottom) / 2, "until the end", rotation=90, va="center", color="0.3")
    ax.set(xlim=(-0.65, 4.0), ylim=(-0.4, 6.75), title="The path of a run")


def draw_run(velocity: Axes, multiplier: Axes) -> None:
    """A forced block with dry friction: its arcs, events and guards."""
    v, t, lam = ca.SX.sym("v"), ca.SX.sym("t"), ca.SX.sym("lam")
    system = ns.FilippovSystem(
        [v], field=[1.5 * ca.cos(t) - lam], multipliers=[lam], surfaces=[v], time=t
    )
    run = ns.simulate(system, [0.6], 6.6)
    for segment in run.segments:
        times = np.linspace(segment.t_start, segment.t_end, 200)
        speed = run(times)[:, 0]
        colour = {"+": style.ABOVE, "-": style.BELOW, "s": style.BLACK}[segment.mode]
        held = {"+": np.ones(200), "-": -np.ones(200)}.get(segment.mode, 1.5 * np.cos(times))
        velocity.plot(times, speed, color=colour, lw=2)
        multiplier.plot(times, held, color=colour, lw=2)
        middle = (segment.t_start + segment.t_end) / 2
        velocity.text(middle, 1.0, f"{segment.mode}", color=colour, ha="center", weight="bold")
    for event in run.events[:4]:  # not the end
        for ax in (velocity, multiplier):
            ax.axvline(event.t, color="0.6", lw=0.7, zorder=0)
        velocity.plot(event.t, event.x[0], "o", color="white", mec="black", ms=5, zorder=5)
    velocity.axhline(0, color="0.6", lw=0.7, zorder=0)
    velocity.set(ylabel="$h = v$", ylim=(-0.75, 1.3), xticklabels=[])
    velocity.set_title(f"One element, $v' = 1.5\\,\\cos t - \\lambda$: itinerary {run.itinerary}")
    multiplier.set(ylabel="$\\lambda$", xlabel="$t$", ylim=(-1.6, 1.6))
    for level in (-1, 1):
        multiplier.axhline(level, color="0.6", lw=0.7, zorder=0)
    entry, leave = run.events[0].t, run.events[1].t
    for ax, text, at, to in (
        (velocity, "guard $h = 0$:\nthe block stops", (entry, 0.0), (entry - 0.95, -0.55)),
        (multiplier, "guard $|\\lambda| = 1$: the block slips", (leave, -1.0), (leave + 0.4, -0.3)),
    ):
        arrow = dict(arrowstyle="->", color="0.3")
        ax.annotate(text, at, to, arrowprops=arrow)
    velocity.text(3.6, 0.13, "an arc: one mode, from event to event", ha="center")
    for ax in (velocity, multiplier):
        ax.set_xlim(0, 6.6)


def figure() -> Figure:
    """The picture: layers, the path of a run, and a run."""
    with style.settings({"font.size": 8.0, "axes.titlesize": 9.5}):
        drawn = style.new_figure((7.0, 7.6))
        grid = drawn.add_gridspec(3, 2, height_ratios=(5.2, 1.2, 1.0), width_ratios=(1.0, 1.2))
        for k, draw in enumerate((draw_layers, draw_path)):
            ax = drawn.add_subplot(grid[0, k])
            ax.set_axis_off()
            draw(ax)
        draw_run(drawn.add_subplot(grid[1, :]), drawn.add_subplot(grid[2, :]))
        return drawn


if __name__ == "__main__":
    figure().savefig(PICTURE, dpi=120)
    print(f"docs/images/{PICTURE.name}")
