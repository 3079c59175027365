"""Moving pictures of the gallery: each is a figure that is drawn again for each moment.

They are written as WebP while the site is built, with a still picture of the last moment for readers whose
browser is set to reduced motion.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

import bounce
import nonsmooth as ns

STYLE = ns.plot.style


@dataclass(frozen=True)
class Animation:
    """A moving picture; ``frames`` yields the same figure, drawn anew, at each of so many moments."""

    name: str
    title: str
    text: str
    frames: Callable[[int], Iterator[Figure]]


def bounce_in_its_cone(count: int) -> Iterator[Figure]:
    """The forces of a bounce in the friction cone, beside the ball."""
    turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    shot = bounce.simulate(turf, xdot=0.3, ydot=-1.0, omega=0.1)
    trajectory = shot.trajectory
    begin, end = trajectory.t[0], trajectory.t[-1]
    times = np.linspace(
        begin + 1e-3 * (end - begin), end, count
    )  # forces act from the first picture on
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    for t in times:
        figure.clear()
        left, right = figure.subplots(1, 2)
        _cone(left, shot, t)
        _ball(right, trajectory, t)
        yield figure


def _cone(axes: Axes, shot: bounce.Shot, t: float) -> None:
    axes.fill([-0.3, 0.0, 0.3], [1.0, 0.0, 1.0], color="0.92")
    for phase in shot.phases:
        if phase.t_start < t or t == phase.t_start == 0.0:
            inner = np.linspace(phase.t_start, min(t, phase.t_end), 60)[1:-1]
            forces = shot.forces(inner)
            colour = {"+": STYLE.ABOVE, "-": STYLE.BELOW, "s": "black"}[phase.mode]
            axes.plot(forces.friction, forces.load, color=colour, linewidth=2)
            if t <= phase.t_end:
                axes.plot(forces.friction[-1], forces.load[-1], "o", color=colour)
    axes.text(0.0, 0.95, "friction cone", color="0.35", ha="center", va="center")
    axes.set(xlim=(-0.33, 0.33), ylim=(-0.05, 1.0), xlabel="friction", ylabel="load")
    modes = {"+": "slips forward", "-": "slips in reverse", "s": "rolls"}
    now = next((p.mode for p in shot.phases if t <= p.t_end), shot.phases[-1].mode)
    axes.set_title(modes[now])


def _ball(axes: Axes, trajectory: ns.Trajectory, t: float) -> None:
    x, _, y, _, _ = trajectory(t)
    past = np.linspace(trajectory.t[0], max(t, trajectory.t[0] + 1e-9), 40)
    spin = np.trapezoid(trajectory(past)[:, 4], past)
    turn = np.linspace(0, 2 * np.pi, 100)
    axes.fill_between([-1.6, 2.0], -2.1, -1.0, color="0.85")
    axes.fill(x + np.cos(turn), y + np.sin(turn), facecolor="white", edgecolor="black", alpha=0.8)
    for k in range(3):
        angle = spin + 2 * np.pi * k / 3
        axes.plot([x, x + np.cos(angle)], [y, y + np.sin(angle)], color="0.4")
    axes.set(xlim=(-1.6, 2.0), ylim=(-2.1, 1.3), aspect="equal")
    axes.set_axis_off()


def funnel(count: int) -> Iterator[Figure]:
    """Orbits that share a past and part at a two-fold."""
    system = ns.textbook.two_fold("VV-C1").system
    fold = ns.find_two_fold(system, near=[0.0, 0.0, 0.0])
    slope = fold.classification.into.low
    run = ns.simulate(system, [0.0, 0.5, 0.5 * slope], t_end=10.0)
    funnel = ns.orbit.funnel(run, t_end=run.t[-1] + 1.0, samples=41)
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    for t in np.linspace(0.02, funnel.t + 1.0, count):
        figure.clear()
        axes = figure.add_subplot()
        before = np.linspace(0.0, min(t, funnel.t), 60)
        axes.plot(before, run(before)[:, 0], color="black", linewidth=2)
        if t > funnel.t:
            after = np.linspace(funnel.t, t, 80)
            for states, departure in zip(funnel(after), funnel.departures, strict=True):
                colour = {"+": STYLE.ABOVE, "-": STYLE.BELOW, "s": "black"}[departure.side]
                order, width = (
                    (3, 2) if departure.side == "s" else (2, 0.9)
                )  # slides until it leaves
                axes.plot(after, states[:, 0], color=colour, linewidth=width, zorder=order)
        axes.axvline(funnel.t, color="0.7", linewidth=0.8)
        axes.set(xlim=(0.0, funnel.t + 1.0), ylim=(-0.65, 0.65))
        for y, word, colour in (
            (0.55, "leaves up", STYLE.ABOVE),
            (-0.55, "leaves down", STYLE.BELOW),
        ):
            axes.text(0.05, y, word, color=colour, va="center")
        axes.text(funnel.t + 0.02, 0.55, "two-fold", color="0.35", va="center")
        axes.set(xlabel="time", ylabel="height over the surface")
        axes.set_title("one past" if t <= funnel.t else "many continuations")
        yield figure


ANIMATIONS = (
    Animation(
        "bounce_in_its_cone",
        "A bounce in its friction cone",
        "While the ball slips, friction and load lie on an edge of the cone; while it rolls, inside. At "
        "lift-off the load is zero, so each bounce ends in the tip, and almost each leaves along an edge: "
        "here the ball rolls for most of the time, and lifts off in reverse slip.",
        bounce_in_its_cone,
    ),
    Animation(
        "funnel",
        "One past, many continuations",
        "Sliding comes to a visible two-fold at the grey line. From there the motion may slide on for any "
        "while and leave to either side at any time. Forty-one of these motions are drawn.",
        funnel,
    ),
)


def write(animation: Animation, folder: Path, count: int = 40) -> list[Path]:
    """Write the moving picture as WebP and its last moment as PNG."""
    images = [_image(figure) for figure in animation.frames(count)]
    folder.mkdir(parents=True, exist_ok=True)
    moving, still = (folder / f"{animation.name}.{kind}" for kind in ("webp", "png"))
    durations = [100] * (len(images) - 1) + [1500]
    images[0].save(moving, save_all=True, append_images=images[1:], duration=durations, loop=0)
    images[-1].save(still)
    return [moving, still]


def _image(figure: Figure) -> Image.Image:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    stream.seek(0)
    return Image.open(stream).convert("RGB")


def animations() -> str:
    """The part of the gallery that moves."""
    parts = []
    for a in ANIMATIONS:
        parts.append(
            f"### {a.title}\n\n{a.text}\n\n"
            f'<picture><source srcset="gallery/{a.name}.png" media="(prefers-reduced-motion: reduce)">'
            f'<img alt="{a.title}" src="gallery/{a.name}.webp"></picture>\n'
        )
    return "\n".join(parts)
