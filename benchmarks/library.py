"""Solvers of this library, as its users call it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import nonsmooth as ns

from .problems import T_MAX, Array, bounce_system, code
from .reference import Ends


def make(name: str, tolerance: float, threads: int = 1) -> Callable[[Array], Ends]:
    """Solver of a bounce: one call of ``ns.ensemble``."""
    system = bounce_system(name)

    def solve(starts: Array) -> Ends:
        many = ns.ensemble(
            system,
            starts,
            T_MAX,
            tol=tolerance,
            work=ns.Work(threads=threads, progress=False),
        )
        numbers = np.array([*map(code, many.itineraries), -1], np.int64)
        if not many.complete.all():
            many.t[~many.complete] = np.nan
        return Ends(many.t, many.x, numbers[many.itinerary_code])

    return solve
