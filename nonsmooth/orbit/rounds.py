"""Orbits whose legs go round several times, and the same orbits once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from ..model import Array
from .boundary import BoundaryProblem
from .legs import fly
from .mirrors import mirrored

#: An orbit without an event is asked whether it goes round up to so many times.
_MOST_ROUNDS = 60

#: Halves of an orbit that are each other's image to this part of it are so at a branch point.
_MIRRORED = 1e-6

#: States of which the mirrors are tried one by one.
_MOST_STATES = 8

#: Starts of legs that are as near as this, relative to the orbit, are one.
_SAME = 1e-7


def once_round(problem: BoundaryProblem, u: Array, p: Array) -> tuple[BoundaryProblem, Array]:
    """The orbit once, where the legs go round it several times.

    The half of a symmetric orbit goes round an odd number of times.
    """
    starts, durations = problem.split(u)
    count, n = len(problem.legs), problem.system.dimension
    if not problem.legs[-1].name:
        return _leg_once(problem, starts[0], float(durations[0]), p)
    size = problem.scales(u)[:n] if count > 1 else np.ones(n)
    whole = float(np.abs(durations).sum()) or 1.0
    for k in range(1, count // 2 + 1):
        if count % k or (problem.symmetry is not None and count // k % 2 == 0):
            continue
        apart = starts[k : 2 * k, :n] @ problem.wrap[:n, :n].T - starts[:k, :n]
        later = np.abs(durations[k : 2 * k] - durations[:k]).max() / whole
        if not max(np.abs(apart / size).max(), later) < _SAME:
            continue
        legs = problem.legs[:k]
        following = legs if problem.symmetry is None else [mirrored(problem, leg) for leg in legs]
        if any(problem.legs[i] != (legs, following)[i // k % 2][i % k] for i in range(count)):
            continue
        # a part of a period where that was given as several
        once = replace(problem, legs=legs, periods=problem.periods * k / count)
        return once, once.pack(starts[:k], durations[:k])
    return problem, u


def _leg_once(
    problem: BoundaryProblem, x: Array, duration: float, p: Array
) -> tuple[BoundaryProblem, Array]:
    """The same for an orbit without an event."""
    n, half = problem.system.dimension, problem.symmetry is not None
    size = np.abs(x[:n]).max() or 1.0
    rounds = round(2 * problem.periods) if half else round(problem.periods)
    most = rounds if problem.forcing is not None else _MOST_ROUNDS
    for k in range(most, 1, -1):
        if (half and k % 2 == 0) or (problem.forcing is not None and rounds % k):
            continue
        there = (
            problem.wrap[:n, :n] @ fly(problem.system, problem.legs[0], x, duration / k, p).end[:n]
        )
        if np.abs(there - x[:n]).max() < _SAME * size:
            once = replace(problem, periods=problem.periods / k)
            return once, once.pack(x, np.array([duration / k]))
    return problem, problem.pack(x, np.array([duration]))


def halves(problem: BoundaryProblem, u: Array, p: Array) -> Iterator[tuple[BoundaryProblem, Array]]:
    """The same orbit as a half, for every reflection of coordinates that maps this to the other half.

    Whether the system has that symmetry too is not asked.
    """
    n, count = problem.system.dimension, len(problem.legs)
    single = not problem.legs[-1].name
    if problem.symmetry is not None or n > _MOST_STATES or (not single and count % 2):
        return
    starts, durations = problem.split(u)
    k = count if single else count // 2
    spans = durations / 2 if single else durations[:k]
    if single:
        other = fly(problem.system, problem.legs[0], starts[0], float(spans[0]), p).end[None, :]
    else:
        other = starts[k:]
        if np.abs(durations[k:] - spans).max() > _MIRRORED * np.abs(durations).sum():
            return
    size = np.abs(starts[:, :n]).max() or 1.0
    close = _MIRRORED * size
    if (np.abs(np.abs(other[:, :n]) - np.abs(starts[:k, :n])) > close).any():
        return
    for signs in product((-1.0, 1.0), repeat=n):
        mirror = np.diag(signs)
        if (np.abs(other[:, :n] @ mirror - starts[:k, :n]) > close).any() or min(signs) > 0.0:
            continue
        half = replace(problem, legs=problem.legs[:k], symmetry=mirror, periods=problem.periods / 2)
        if not single and any(
            mirrored(half, leg) != then
            for leg, then in zip(half.legs, problem.legs[k:], strict=True)
        ):
            continue
        yield half, half.pack(starts[:k], spans)
