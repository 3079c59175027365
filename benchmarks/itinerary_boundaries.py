"""Wrong itineraries of starts bisected to rounding, and how far from the boundary they occur.

``python -m benchmarks.itinerary_boundaries``; the reference is mpmath. A
run decides by states that have an error, which shifts the boundary in the starts. The ends of a pair of
neighbours, and starts at growing distances from it on both sides, measure the shift.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from . import library, reference
from .bouncing.itineraries import pairs
from .problems import Array, Codes, landings, random_starts

BOUNCES = ("linear", "nonlinear")
TOLERANCES = (1e-10, 1e-12, 1e-14)
#: Distances from a pair's ends, away from the boundary: none, then powers of two of rounding.
DISTANCES = (0.0, *(2.0**-53 * 2.0**k for k in range(21)))


def run(name: str, each: int) -> dict[str, Any]:
    """Wrong starts of one bounce at each tolerance, beside the boundary and farther from it."""
    starts = random_starts(100_000, seed=5)
    codes = library.make(name, TOLERANCES[-1])(starts).itinerary
    low, high, a, b = pairs(name, starts, codes, each, 0.0)
    ends, believed = np.concatenate([low, high]), np.concatenate([a, b])
    solution = reference.solve(name, ends).itinerary
    outward = _outward(low, high)
    result: dict[str, Any] = {"starts": len(ends), "gap": float(np.abs(low - high).max())}
    for tolerance in TOLERANCES:
        solve = library.make(name, tolerance)
        wrong = int((solve(ends).itinerary != solution).sum())
        farthest, judged = _farthest(name, solve, ends, outward, believed)
        result[f"{tolerance:g}"] = {"wrong": wrong, "farthest": farthest, "judged": judged}
        print(f"  {name} {tolerance:g}: {result[f'{tolerance:g}']} of {len(ends)}", flush=True)
    return result


def _outward(low: Array, high: Array) -> Array:
    """Unit vectors from each end away from the other, in speed and spin."""
    apart = (low - high)[:, [1, 4]]
    apart /= np.linalg.norm(apart, axis=1, keepdims=True)
    return np.concatenate([apart, -apart])


def _farthest(
    name: str, solve: Any, ends: Array, outward: Array, believed: Codes
) -> tuple[float, int]:
    """Largest distance at which mpmath contradicts the engine, -1 if none, and starts it solved."""
    # It solves starts whose itinerary is not that of the end, which is on the same side.
    judged = 0
    for distance in reversed(DISTANCES):
        moved = ends[:, [1, 4]] + distance * outward
        x = landings(moved[:, 0], moved[:, 1])
        given = solve(x).itinerary
        doubtful = np.flatnonzero(given != believed)
        judged += doubtful.size
        if (
            doubtful.size
            and (reference.solve(name, x[doubtful]).itinerary != given[doubtful]).any()
        ):
            return distance, judged
    return -1.0, judged


def main() -> None:
    """Print the table of both bounces."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=BOUNCES, nargs="*", default=BOUNCES, help="some bounces")
    parser.add_argument("--each", type=int, default=60, help="pairs for each two itineraries (60)")
    options = parser.parse_args()
    for name in options.only:
        print(name, run(name, options.each), flush=True)


if __name__ == "__main__":
    main()
