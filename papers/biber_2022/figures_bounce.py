"""Figures of section 3: trajectories in the friction cone and their slip."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nonsmooth.plot import style as look

from .. import pictures
from .records import picture
from .results import kv_pert_data, kv_pert_shot

#: Name in the paper, trajectory, colour, line style.
RUNS = (
    ("A", "A_exact", look.BLACK, "-"),
    ("B", "B", look.ABOVE, look.DASHED),
    ("C", "C", look.BELOW, look.DASH_DOT),
)
_UNIT = 1e4  # figures are in units of 1e-4


def _cone(axes: Axes, mu: float, top: float) -> None:
    axes.fill_betweenx([0, top], [0, -mu * top], [0, mu * top], color="0.93", zorder=0)
    for side in (-1, 1):
        axes.plot([0, side * mu * top], [0, top], color="0.35", linewidth=1.2, zorder=1)


@picture("Fig. 10 (a)", name="kv_pert_a")
def kv_pert_cone() -> Figure:
    """The end of bounces (A), (B), (C) in the friction cone. The paper gives mu and p0 only; here
    d1 = 0.098, d2 = 0.007, eta = 0.09, G = 0, and X'0 changed by -+0.02 with Omega0 = -X'0.
    """
    mu = kv_pert_data()["parameters"]["mu"]
    top = 11.0
    figure = pictures.new_figure(6.4, 5.2)
    axes = figure.add_subplot()
    inset = axes.inset_axes((0.06, 0.09, 0.25, 0.34))
    _cone(axes, mu, top)
    _cone(inset, mu, 0.115)
    for label, name, color, style in RUNS:
        shot = kv_pert_shot(name)
        before = np.concatenate([np.geomspace(shot.time, 1e-9, 1500), [0.0]])
        forces = shot.forces(shot.time - before)
        shown = _UNIT * forces.load <= top
        x, y = _UNIT * forces.friction[shown], _UNIT * forces.load[shown]
        axes.plot(x, y, color=color, linestyle=style, linewidth=2.2, label=f"({label})")
        look.arrowhead(axes, np.column_stack([x, y]), 0.35, color, mutation_scale=13, zorder=8)
        axes.text(x[0], top + 0.12, f"({label})", color=color, ha="center", va="bottom")
        inset.plot(forces.friction, forces.load, color=color, linestyle=style, linewidth=1.3)
    axes.plot(0, 0, "D", color="white", markeredgecolor="black", markersize=9, zorder=9)
    axes.annotate("lift-off", (0.0, 0.0), (0.28, -0.05), va="center")
    for side, sign in ((-1, "-"), (1, "")):
        axes.text(
            side * (mu * 7.6 + 0.1),
            7.6,
            rf"$\Lambda_T={sign}\mu\,\Lambda_N$",
            ha="right" if side < 0 else "left",
            va="top",
        )
    axes.set(xlim=(-4.3, 4.3), ylim=(-0.45, top))
    axes.set_xlabel(r"friction $\Lambda_T \times 10^{4}$")
    axes.set_ylabel(r"load $\Lambda_N \times 10^{4}$")
    inset.set(xlim=(-0.04, 0.04), ylim=(0, 0.115), xticks=[-0.03, 0, 0.03], yticks=[0, 0.1])
    inset.tick_params(labelsize=8)
    inset.set_title("from the start", fontsize=8.5)
    return figure


@picture("Fig. 10 (b)", name="kv_pert_b")
def kv_pert_slip() -> Figure:
    """Slip velocity of the same bounces: (A) rolls to lift-off, (B) and (C) begin to slip 1e-4
    before it.
    """
    figure = pictures.new_figure(6.0, 5.2)
    panels = figure.subplots(3, 1, sharex=True, sharey=True)
    for axes, (label, name, color, style) in zip(panels, RUNS, strict=True):
        shot = kv_pert_shot(name)
        before = np.linspace(2.5e-4, 0.0, 1500)
        states = shot(shot.time - before)
        slip = 1e8 * (states[:, 1] + states[:, 4])
        axes.axhline(0, color="0.6", linewidth=0.8)
        axes.plot(-_UNIT * before, slip, color=color, linestyle=style, linewidth=2.2)
        axes.plot(
            0,
            slip[-1],
            "D",
            color="white",
            markeredgecolor="black",
            clip_on=False,
            markersize=7,
            zorder=9,
        )
        axes.text(0.02, 0.95, f"({label})", transform=axes.transAxes, va="top", color=color)
        exits = [e.t for e in shot.trajectory.events if e.kind == "exit"]
        for t in exits:
            x = _UNIT * (t - shot.time)
            axes.plot(x, 0, "s", color="white", markeredgecolor=color, zorder=9)
            axes.annotate(
                "slip begins",
                (x, 0),
                (0, 9 if slip[-1] < 0 else -9),
                ha="center",
                va="bottom" if slip[-1] < 0 else "top",
                textcoords="offset points",
                fontsize=9,
            )
        if not exits:
            axes.annotate(
                "rolls to lift-off",
                (-1.25, 0),
                (0, 7),
                ha="center",
                va="bottom",
                textcoords="offset points",
                fontsize=9,
            )
        axes.set(ylim=(-2.2, 2.2), xlim=(-2.5, 0.06))
        axes.spines[["top", "right"]].set_visible(False)
    panels[1].set_ylabel(r"slip velocity $H \times 10^{8}$")
    panels[2].set_xlabel(r"time to lift-off $(\tau - \tau_F) \times 10^{4}$")
    return figure
