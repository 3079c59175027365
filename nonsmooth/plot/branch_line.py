"""A branch as a line: between its nodes it is solved for again where a chord would show as a corner."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..model import Array, NonsmoothError
from ..orbit import Branch, Connection

_TURN = np.radians(3.0)  # between neighbouring chords, at which a reader sees a corner
_SHORT = 0.004  # of the width of the picture: chords that are not divided further
_MOST = 240  # points between the nodes of a branch
_DETOUR = 0.3  # by which the way over an event may be longer than its chord


@dataclass
class Sample:
    """A point of a line.

    Attributes
    ----------
    value, height : float
        Of the parameter, and what is drawn over it.
    solution
        What says whether it is stable; None at an event, after which the line goes on as the next
        sample says.
    curve, u
        The equations that it solves, and their unknowns (N,); None where chords beside it are not divided.
    """

    value: float
    height: float
    solution: Any
    curve: Any = None
    u: Any = None


def line_of(
    one: Branch, measure: Callable[[Any], float], shape: tuple[float, float] = (1.0, 1.0)
) -> list[Sample]:
    """The samples of a branch in their order: nodes, the events between them, and what is solved for.

    Parameters
    ----------
    one : Branch
    measure : callable
        What is drawn, as a function of a solution.
    shape : (float, float), optional
        Width and height of the picture, in any unit.

    Returns
    -------
    list of Sample

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, mu = (ca.SX.sym(s) for s in ("x", "y", "mu"))
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[mu - x**2, 1 - y], below=[1, 1],
    ...                       parameters={mu: 0.5})
    >>> fold = ns.continue_equilibrium(s, [0.7, 1.0], "mu", bounds=(-1, 1))
    >>> samples = line_of(fold, lambda at: at.point[0])
    >>> all(abs(sample.value - sample.height**2) < 1e-12 for sample in samples)
    True
    """
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
            continue  # the line has a node on either side of it, in the same place
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
        places = np.array([[s.value, s.height] for s in samples]) / size
        chosen = [k for k in _coarse(places) if id(samples[k]) not in given_up]
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


def _coarse(places: Array) -> list[int]:
    """The chords beside which a polyline turns visibly, and that are long enough for it to be seen."""
    steps = np.diff(places, axis=0)
    length = np.linalg.norm(steps, axis=1)
    solid = np.flatnonzero(length > 0)  # at events two nodes are in one place
    angle = np.arctan2(*steps[solid].T[::-1])
    turn = np.abs((np.diff(angle) + np.pi) % (2 * np.pi) - np.pi)
    bent = turn > _TURN
    beside = np.concatenate([bent, [False]]) | np.concatenate([[False], bent])
    return [int(k) for k in solid[beside] if length[k] > _SHORT]


def _middle(a: Sample, b: Sample, measure: Callable[[Any], float]) -> Sample | None:
    """What is half-way between two samples; None where the equations have no answer there."""
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
