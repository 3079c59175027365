"""Solvers of this library, as its users call it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import nonsmooth as ns

from .problems import T_MAX, Array, bounce_system, code
from .reference import Ends


def make(name: str, tolerance: float, threads: int = 1) -> Callable[[Array], Ends]:
    """Solver of a bounce: one call of ``ns.ensemble``, the compiled engine."""
    system = bounce_system(name)

    def solve(starts: Array) -> Ends:
        many = ns.ensemble(
            system,
            starts,
            T_MAX,
            tol=tolerance,
            engine="compiled",
            work=ns.Work(threads=threads, progress=False),
        )
        numbers = np.array([*map(code, many.itineraries), -1], np.int64)
        if not many.complete.all():
            many.t[~many.complete] = np.nan
        return Ends(many.t, many.x, numbers[many.itinerary_code])

    return solve


def reference_driver(name: str, tolerance: float) -> Callable[[Array], Ends]:
    """Solver of a bounce: the reference driver, pure Python and NumPy."""
    system = bounce_system(name)

    def solve(starts: Array) -> Ends:
        runs = [ns.simulate(system, x, T_MAX, tol=tolerance, engine="reference") for x in starts]
        return Ends(
            np.array([run.t[-1] for run in runs]),
            np.array([run.x[-1] for run in runs]),
            np.array([code(run.itinerary) for run in runs], np.int64),
        )

    return solve
