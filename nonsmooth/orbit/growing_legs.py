"""Guesses for an orbit whose new legs have begun to grow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model import Array
from .boundary import BoundaryProblem
from .legs import fly


def grown(problem: BoundaryProblem, u: Array, p: Array, fresh: Sequence[int], by: float) -> Array:
    """Unknowns near an orbit whose legs ``fresh`` last for ``by``.

    A flight that is added inside a slide begins before the point where the slide touched its boundary
    and ends after it: h = L11 t^2/2 + L111 t^3/6 with an exit at -t/3 of a flight of the duration t.

    Parameters
    ----------
    problem : BoundaryProblem
    u : ndarray (m,)
        The orbit at the event, with new legs of no duration.
    p : ndarray
    fresh : sequence of int
    by : float
    """
    starts, durations = (np.array(part) for part in problem.split(u))
    legs = problem.legs
    for i in fresh:
        durations[i] = by
        added = 0 < i < len(legs) - 1 and legs[i].kind == "entry" and legs[i - 1].kind == "exit"
        if not added or durations[i - 1] < by or durations[i + 1] < by:
            continue
        durations[i - 1] -= by / 3
        durations[i + 1] -= 2 * by / 3
        for k in (i - 1, i):
            flown = fly(problem.system, legs[k], starts[k], float(durations[k]), p)
            starts[k + 1] = flown.end[: problem.dimension]
    return problem.pack(starts, durations)
