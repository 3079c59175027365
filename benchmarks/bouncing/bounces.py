"""Work and precision of every solver on the two bounces, then the fastest settings in turns."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import library, reference
from ..peers import diffrax_modes, heyoka_callbacks, heyoka_modes, scipy_dop853
from ..problems import Array, random_starts
from ..reference import Ends
from ..timing import alternate

#: Largest error on the random starts at which speeds are compared.
TARGET = 1e-9

Make = Callable[[str, float], Callable[[Array], Ends]]


@dataclass(frozen=True)
class Solver:
    """A solver in the comparison."""

    label: str
    make: Make
    tolerances: tuple[float, ...]
    count: int
    timed: int
    available: Callable[[], bool] = lambda: True


def ladder(loose: float, tight: float, each: int) -> tuple[float, ...]:
    """Tolerances from 10**loose to 10**tight, ``each`` of them to a factor of ten."""
    count = round((loose - tight) * each) + 1
    return tuple(float(f"{10**e:.3g}") for e in np.linspace(loose, tight, count))


def solvers() -> list[Solver]:
    """The solvers; the first is the library."""
    hy, sp = heyoka_modes, scipy_dop853
    taylor = ladder(-4, -14, 4)
    fixed = lambda make, **options: lambda name, tol: make(name, tol, **options)
    return [
        Solver("nonsmooth", library.make, taylor, 100_000, 200_000),
        Solver("heyoka, one integrator per mode", hy.make, taylor, 100_000, 10_000, hy.available),
        Solver(
            "heyoka, one integrator and callbacks",
            heyoka_callbacks.make,
            taylor,
            100_000,
            10_000,
            hy.available,
        ),
        Solver(
            "heyoka, 8 lanes per mode",
            fixed(hy.make, lanes=8),
            ladder(-4, -12, 2),
            100_000,
            10_000,
            hy.available,
        ),
        Solver("scipy DOP853", sp.make, ladder(-6, -13, 2), 500, 60),
        Solver(
            "scipy DOP853, numba",
            fixed(sp.make, numba=True),
            ladder(-6, -13, 2),
            500,
            60,
            sp.numba_available,
        ),
        Solver(
            "diffrax Dopri8",
            diffrax_modes.make,
            ladder(-7, -13, 1),
            500,
            500,
            diffrax_modes.available,
        ),
    ]


def run(name: str, folder: Path, quick: bool) -> dict[str, Any]:
    """Measure one bounce with every solver that is installed."""
    count = 60 if quick else 500
    starts = random_starts(count, seed=1)
    solution = reference.kept(name, starts, folder)
    chosen: dict[Solver, float] = {}
    result: dict[str, Any] = {"starts": count, "target": TARGET, "solvers": {}}
    for solver in solvers():
        if not solver.available():
            result["solvers"][solver.label] = {"missing": "not installed"}
            continue
        rows = precision(solver, name, starts, solution, quick)
        good = [r for r in rows if r["error"] <= TARGET and r["wrong"] == 0]
        pick = max(good, key=lambda r: r["rate"]) if good else min(rows, key=lambda r: r["error"])
        result["solvers"][solver.label] = {"rows": rows, "pick": pick, "reached": bool(good)}
        chosen[solver] = pick["tolerance"]
        print(f"  {name}, {solver.label}: {pick}", flush=True)
    for label, timing in _in_turns(chosen, name, quick).items():
        result["solvers"][label].update(timing)
    return result


def precision(
    solver: Solver, name: str, starts: Array, solution: Ends, quick: bool
) -> list[dict[str, Any]]:
    """Errors, wrong itineraries and a first speed over the solver's tolerances."""
    rows = []
    part = slice(0, solver.count)
    expected = Ends(solution.t[part], solution.x[part], solution.itinerary[part])
    tolerances = solver.tolerances[:: 4 if quick else 1]
    work = random_starts(min(solver.timed, 200 if quick else solver.timed), seed=2)
    for tolerance in tolerances:
        solve = solver.make(name, tolerance)
        ends = solve(starts[part])
        errors = reference.error(ends, expected)
        rows.append(
            {
                "tolerance": tolerance,
                "error": float(errors.max()),
                "median error": float(np.median(errors)),
                "wrong": int((ends.itinerary != expected.itinerary).sum()),
                "of": len(expected.t),
                "rate": _rate(solve, work),
            }
        )
        if rows[-1]["error"] < 1e-13:
            break
    return rows


def _rate(solve: Callable[[Array], Ends], work: Array) -> float:
    """Bounces per second; the better of two turns after one that is not timed."""
    solve(work)
    seconds = []
    for _ in range(2):
        begin = time.process_time()
        solve(work)
        seconds.append(time.process_time() - begin)
    return len(work) / min(seconds)


def _in_turns(chosen: dict[Solver, float], name: str, quick: bool) -> dict[str, dict[str, Any]]:
    work: dict[str, Callable[[], Any]] = {}
    counts = {}
    for solver, tolerance in chosen.items():
        solve = solver.make(name, tolerance)
        starts = random_starts(min(solver.timed, 200) if quick else solver.timed, seed=3)
        counts[solver.label] = len(starts)
        work[solver.label] = lambda solve=solve, starts=starts: solve(starts)  # type: ignore[misc]
    timings = alternate(work, 3 if quick else 15)
    return {
        label: {
            "rate": timing.rate(counts[label]),
            "slowest": counts[label] / timing.high,
            "fastest": counts[label] / timing.low,
            "turns": timing.turns,
        }
        for label, timing in timings.items()
    }
