"""Bifurcation diagrams: branches with stability and events, and curves in two parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..local import Equilibrium
from ..model import Array, DefinitionError, NonsmoothError, OptionError
from ..orbit import BifurcationCurve, Branch, BranchEvent, Connection, PeriodicOrbit
from . import style
from .arguments import results, same
from .drawing import Colors, Drawn, canvas, key
from .labels import Labels

#: Marker and fill of each kind of event; shapes differ without colour.
MARKERS = {
    "fold": ("o", "white"),
    "pseudo-saddle-node": ("o", style.GREY),
    "branch point": ("P", "white"),
    "Hopf": ("s", "white"),
    "period doubling": ("s", style.YELLOW),
    "Neimark-Sacker": ("s", style.SKY),
    "pitchfork": ("P", style.YELLOW),
    "boundary equilibrium": ("D", style.YELLOW),
    "two-fold": ("X", style.PURPLE),
    "grazing-sliding": ("v", style.ORANGE),
    "crossing-sliding": ("^", style.SKY),
    "switching-sliding": (">", style.GREEN),
    "adding-sliding": ("<", style.PURPLE),
    "impact grazing": ("v", style.VERMILLION),
    "grazing of a soft switch": ("v", "white"),
    "grazing of a jumping force": ("v", style.YELLOW),
    "corner": ("d", "white"),
    "end of complete chatter": ("<", style.VERMILLION),
    "plastic impact": (">", style.VERMILLION),
    "homoclinic": ("*", style.BLACK),
}
_OTHER = ("X", "white")
_CURVES = (
    style.BLUE,
    style.VERMILLION,
    style.GREEN,
    style.PURPLE,
    style.ORANGE,
    style.SKY,
    style.BLACK,
)
_DASHES: tuple[Any, ...] = ("-", (0, (6, 1.5)), (0, (3, 1.2)), style.DASH_DOT, style.DOTS)
_SAMPLES = 240
_LISTED = 6  # entries of a legend; more are named beside the things themselves

Measure = str | Callable[[Any], float]


def branch(
    found: Branch | Sequence[Branch],
    *,
    against: Measure | None = None,
    events: bool = True,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw a bifurcation diagram: stable solutions as full lines, unstable ones dashed, events marked.

    Parameters
    ----------
    found : Branch or sequence of Branch
        From ``continue_equilibrium`` or ``continue_orbit``, in the same parameter.
    against : str or callable, optional
        What is drawn over the parameter: ``"period"``, the name of a state (of an orbit its largest
        value), or a function of a solution. By default the period of autonomous orbits, otherwise
        the first state.
    events : bool, optional
        Whether events are marked.
    ax : matplotlib Axes, optional
        A new figure is made without it.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture; the default says what is shown.
    colors : mapping, optional
        Colours by the names in the legend, such as ``{"stable orbit": "black"}``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the branches.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    DefinitionError
        Not branches.
    OptionError
        An unknown state, or branches in several parameters.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, mu = (ca.SX.sym(s) for s in ("x", "y", "mu"))
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[mu - x**2, 1 - y], below=[1, 1],
    ...                       parameters={mu: 0.5})
    >>> found = ns.continue_equilibrium(s, [0.7, 1.0], "mu", bounds=(-1, 1))
    >>> figure = ns.plot.branch(found)
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()
    ('mu', 'x')
    """
    advice = "continue_equilibrium and continue_orbit return them."
    several = results(found, Branch, advice, DefinitionError)
    parameter = same(several, "parameter")
    measure, label = _measure(several[0], against)
    with canvas(ax, size, (6.4, 4.4), colors=colors, look=look, title=title) as page:
        axes = page.ax
        looks: dict[str, Any] = {}
        marks: dict[str, Any] = {}
        labels = list[tuple[str, Any]]()
        for one in several:
            samples = line_of(one, measure, (axes.bbox.width, axes.bbox.height))
            points = np.array([[sample.value, sample.height] for sample in samples])
            for (name, usual), part in _parts(samples):
                line = page.look(name, zorder=3, **usual)
                axes.plot(*points[part].T, gid=name, **line)
                looks[name] = Line2D([], [], label=name, **line)
            for event in one.events if events else ():
                shape, fill = MARKERS.get(event.kind, _OTHER)
                fill = page.color(event.kind, fill)
                height = measure(_beside(one, event))
                axes.plot(
                    event.parameter,
                    height,
                    shape,
                    markerfacecolor=fill,
                    markeredgecolor=style.BLACK,
                    markersize=6,
                    zorder=5,
                    gid=f"event {event.kind}",
                )
                marks[event.kind] = style.marker(shape, event.kind, fill)
                labels.append((event.kind, (event.parameter, height)))
        axes.set(xlabel=parameter, ylabel=label)
        axes.margins(0.05)
        if legend:
            together = {**looks, **marks}
            many = len(together) > _LISTED
            key(axes, list((looks if many else together).values()))
            names = Labels(axes)
            for kind, point in labels if many else ():
                names.name(kind, point)
    return page.drawn


def _beside(one: Branch, event: BranchEvent) -> Any:
    """The solution at an event; at a homoclinic orbit the last one of the branch."""
    if not isinstance(event.solution, Connection):
        return event.solution
    return one.solutions[int(np.argmin(np.abs(one.values - event.parameter)))]


def _measure(one: Branch, against: Measure | None) -> tuple[Callable[[Any], float], str]:
    """What is drawn, as a function of a solution, and its name."""
    if callable(against):
        return against, getattr(against, "__name__", "").replace("<lambda>", "")
    system, orbits = one.nodes[0][0].system, isinstance(one.solutions[0], PeriodicOrbit)
    if against is None:
        against = "period" if orbits and not system.time_dependent else system.state_names[0]
    if against == "period" and orbits:
        return lambda orbit: float(orbit.period), "period"
    if against not in system.state_names:
        raise OptionError(
            f"against={against!r} is not a state {list(system.state_names)}{', period' * orbits} or a "
            "function. Leave it out for the default."
        )
    k = system.state_names.index(against)
    if not orbits:
        return lambda at: float(np.asarray(getattr(at, "point", at))[k]), against
    return lambda orbit: float(samples(orbit)[:, k].max()), f"max {against}"


def samples(orbit: PeriodicOrbit) -> Array:
    """States (m, n) along one period of an orbit."""
    run = orbit.trajectory
    return np.asarray(run(np.linspace(run.t[0], run.t[-1], _SAMPLES)))


def _parts(samples: list[Sample]) -> Iterator[tuple[tuple[str, dict[str, Any]], slice]]:
    """Stretches of one look, each up to where the next one begins."""
    looks = [None if s.solution is None else _look(s.solution) for s in samples]
    for k in reversed(range(len(looks) - 1)):
        looks[k] = looks[k] or looks[k + 1]  # an event looks like what comes after it
    first = 0
    for _, group in groupby(look[0] if look else "" for look in looks):
        last = first + len(list(group))
        if look := looks[first]:
            yield look, slice(first, min(last + 1, len(looks)))
        first = last


def _look(solution: Any) -> tuple[str, dict[str, Any]]:
    """How a solution is drawn, and what the legend says."""
    if isinstance(solution, PeriodicOrbit):
        stable = "asymptotically stable" in solution.stability or "super" in solution.stability
        name, color = ("stable orbit" if stable else "unstable orbit"), style.BLUE
    elif isinstance(solution, Equilibrium):
        stable = solution.kind.startswith("stable") and solution.status != "virtual"
        name = f"{'stable' if stable else 'unstable'} equilibrium of {solution.side}"
        if solution.status == "virtual":
            name = "virtual equilibrium"
        color = style.FIELDS[solution.side]
    else:
        stable = bool(solution.stable) and solution.status == "real"
        name, color = ("stable" if stable else "unstable") + " pseudo-equilibrium", style.BLACK
        if solution.status == "virtual" and solution.margin > 1e-9:
            name = "virtual pseudo-equilibrium"
    dashes: Any = "-" if stable else style.DOTS if name.startswith("virtual") else style.DASHED
    return name, dict(color=color, linestyle=dashes, linewidth=1.9 if stable else 1.4)


def bifurcation_curves(
    found: BifurcationCurve | Sequence[BifurcationCurve],
    *,
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Colors = None,
    **look: Any,
) -> Drawn:
    """Draw curves of bifurcations in the plane of two parameters, with points of codimension two.

    Parameters
    ----------
    found : BifurcationCurve or sequence of BifurcationCurve
        From ``continue_bifurcation``, in the same two parameters.
    ax : matplotlib Axes, optional
        A new figure is made without it.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture; the default says what is shown.
    colors : mapping, optional
        Colours by the kinds of bifurcations, such as ``{"fold": "black"}``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the curves.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    DefinitionError, OptionError
        Not curves, or curves in other parameters.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, a, b = (ca.SX.sym(s) for s in ("x", "y", "a", "b"))
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[a + b * x - x**3, 1 - y], below=[1, 1],
    ...                       parameters={a: -1.0, b: 0.75})
    >>> found = ns.continue_equilibrium(s, [-1.5, 1.0], "a", bounds=(-2, 2))
    >>> cusp = ns.continue_bifurcation(found.events[0], ("a", "b"), bounds=[(-1, 1), (-1, 1)])
    >>> figure = ns.plot.bifurcation_curves(cusp)
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()
    ('a', 'b')
    """
    advice = "continue_bifurcation returns them."
    several = results(found, BifurcationCurve, advice, DefinitionError)
    parameters = same(several, "parameters")
    with canvas(ax, size, (6.0, 4.8), colors=colors, look=look, title=title) as page:
        axes = page.ax
        kinds = list(dict.fromkeys(one.kind for one in several))
        handles: dict[str, Any] = {}
        labels = Labels(axes)
        for one in several:
            k = kinds.index(one.kind)
            color, dashes = _CURVES[k % len(_CURVES)], _DASHES[k % len(_DASHES)]
            line = page.look(one.kind, color=color, linestyle=dashes, linewidth=1.8)
            axes.plot(*one.values.T, gid=one.kind, **line)
            handles[one.kind] = Line2D([], [], label=one.kind, **line)
            if len(kinds) > _LISTED and legend:
                labels.name(one.kind, one.values, line["color"])
            for point in one.special:
                axes.plot(
                    *point.values, "o", color=style.BLACK, markersize=5.5, zorder=5, gid=point.kind
                )
                labels.name(point.kind, point.values)
        axes.set(xlabel=parameters[0], ylabel=parameters[1])
        axes.margins(0.06)
        if legend and len(kinds) <= _LISTED:
            key(axes, list(handles.values()))
    return page.drawn


# A branch as a smooth line: solutions are added between nodes where chords would show corners -----

_TURN = np.radians(3.0)  # between neighbouring chords, at which a reader sees a corner
_SHORT = 0.004  # of the width of the picture: chords that are not divided further
_MOST = 240  # points between the nodes of a branch
_DETOUR = 0.3  # by which the way over an event may be longer than its chord


@dataclass
class Sample:
    """A point of a line."""

    value: float
    height: float
    solution: Any
    curve: Any = None
    u: Any = None


def line_of(
    one: Branch, measure: Callable[[Any], float], shape: tuple[float, float] = (1.0, 1.0)
) -> list[Sample]:
    """The samples of a branch in their order."""
    nodes = [
        Sample(float(value), measure(solution), solution, curve, point.u)
        for value, solution, (curve, point) in zip(
            one.values, one.solutions, one.nodes, strict=True
        )
    ]
    after: dict[int, list[tuple[float, Sample]]] = {}
    for event in one.events:
        if event.point is None or isinstance(event.solution, Connection):
            continue
        if any(event.point is point for _, point in one.nodes):
            continue  # nodes at the same point are on either side of it
        found = _between(nodes, np.asarray(event.point.u, dtype=float))
        if found is not None:
            k, share = found
            height, curve = measure(event.solution), nodes[k].curve
            sample = Sample(float(event.parameter), height, None, curve, event.point.u)
            after.setdefault(k, []).append((share, sample))
    samples = list[Sample]()
    for k, node in enumerate(nodes):
        samples += [node, *(s for _, s in sorted(after.get(k, []), key=lambda pair: pair[0]))]
    return _smooth(samples, measure, np.array(shape) / shape[0])


def _between(nodes: list[Sample], u: Array) -> tuple[int, float] | None:
    """The node before a point of the curve, and how far it is from there to the next node."""
    best: tuple[float, int, float] | None = None
    same = np.array([n.u for n in nodes if np.shape(n.u) == u.shape] or [u])
    scale = np.maximum(np.ptp(same, axis=0), 1e-6 * (1.0 + np.abs(same).max(axis=0)))
    for k, (a, b) in enumerate(pairwise(nodes)):
        if a.curve is not b.curve or np.shape(a.u) != u.shape:
            continue
        to, on, chord = (
            float(np.linalg.norm(step / scale)) for step in (u - a.u, b.u - u, b.u - a.u)
        )
        detour = (to + on) / chord - 1.0 if chord > 0 else np.inf
        if detour < _DETOUR and (best is None or detour < best[0]):
            best = detour, k, to / (to + on)
    return None if best is None else best[1:]


def _smooth(samples: list[Sample], measure: Callable[[Any], float], shape: Array) -> list[Sample]:
    """Divide chords between which a line would seem to have a corner."""
    points = np.array([[s.value, s.height] for s in samples])
    size = np.ptp(points, axis=0)
    size = np.where(size > 0, size, 1.0) / shape
    added, given_up = 0, set[int]()
    while added < _MOST:
        scaled = np.array([[s.value, s.height] for s in samples]) / size
        chosen = [k for k in _coarse(scaled) if id(samples[k]) not in given_up]
        if not chosen:
            break
        for k in reversed(chosen):
            middle = _middle(samples[k], samples[k + 1], measure)
            if middle is None:
                given_up.add(id(samples[k]))
            else:
                samples = [*samples[: k + 1], middle, *samples[k + 1 :]]
                added += 1
    return samples


def _coarse(scaled: Array) -> list[int]:
    """The chords beside which a polyline turns visibly and that are long enough to be divided."""
    steps = np.diff(scaled, axis=0)
    length = np.linalg.norm(steps, axis=1)
    solid = np.flatnonzero(length > 0)  # at events two nodes coincide
    angle = np.arctan2(*steps[solid].T[::-1])
    turn = np.abs((np.diff(angle) + np.pi) % (2 * np.pi) - np.pi)
    bent = turn > _TURN
    beside = np.concatenate([bent, [False]]) | np.concatenate([[False], bent])
    return [int(k) for k in solid[beside] if length[k] > _SHORT]


def _middle(a: Sample, b: Sample, measure: Callable[[Any], float]) -> Sample | None:
    """The sample half-way between two; None where the equations have no solution there."""
    if a.curve is None or a.curve is not b.curve or a.value == b.value:
        return None
    value = (a.value + b.value) / 2
    guess = (np.asarray(a.u, dtype=float) + np.asarray(b.u, dtype=float)) / 2
    try:
        solution = a.curve.solution_at(guess, value)
        height = measure(solution)
    except (NonsmoothError, ValueError):
        return None
    low, high = sorted((a.height, b.height))
    if not low - (high - low) <= height <= high + (high - low):
        return None  # it converged to another part of the branch
    return Sample(value, height, solution, a.curve, guess)
