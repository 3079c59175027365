"""Wrong itineraries of random starts, and of starts bisected to 1e-9 of boundaries between itineraries.

Runs at the default tolerance are compared with runs at 1e-14 for all random starts, and with mpmath for a
sample; at boundaries with mpmath for all.
"""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from .. import library, reference
from ..problems import LETTERS, Array, Codes, landings, random_starts

DEFAULT, TIGHT = 1e-10, 1e-14
#: Distance between the two ends of a bisected pair of starts.
GAP = 1e-9


def run(name: str, folder: Path, quick: bool) -> dict[str, Any]:
    """Count wrong itineraries of one bounce."""
    count = 5_000 if quick else 1_000_000
    starts = random_starts(count, seed=5)
    solve, tight = library.make(name, DEFAULT), library.make(name, TIGHT)
    ends, exact = solve(starts), tight(starts)
    some = slice(0, 50 if quick else 500)
    solution = reference.solve(name, starts[some])
    result: dict[str, Any] = {
        "random starts": count,
        "wrong at the default tolerance": _differ(ends.itinerary, exact.itinerary),
        "largest difference": float(reference.error(ends, exact).max()),
        "against mpmath": len(solution.t),
        "wrong against mpmath": _differ(ends.itinerary[some], solution.itinerary),
        "boundaries": _boundaries(name, starts, exact.itinerary, 4 if quick else 40),
    }
    print(f"  {name}: {result}", flush=True)
    return result


def _differ(a: Codes, b: Codes) -> int:
    return int((a != b).sum())


def letters(number: int) -> str:
    """Itinerary of a code."""
    itinerary = ""
    while number:
        number, digit = divmod(number - 1, 4)
        itinerary = LETTERS[digit] + itinerary
    return itinerary


def _boundaries(name: str, starts: Array, codes: Codes, each: int) -> dict[str, dict[str, Any]]:
    """Starts and wrong itineraries, by mpmath, for each pair of neighbours."""
    # The engine at a tight tolerance found the boundaries, so it may be wrong in the same way.
    low, high, a, b = pairs(name, starts, codes, each, GAP)
    solve = library.make(name, DEFAULT)
    keys = [
        " | ".join(sorted((letters(int(u)), letters(int(v))))) for u, v in zip(a, b, strict=True)
    ]
    result: dict[str, dict[str, Any]] = {
        key: {"starts": 0, "wrong": 0, "differs from 1e-14": 0, "which": []} for key in keys
    }
    for x, tight in ((low, a), (high, b)):
        mine, solution = solve(x).itinerary, reference.solve(name, x).itinerary
        for i, key in enumerate(keys):
            row = result[key]
            row["starts"] += 1
            row["differs from 1e-14"] += int(mine[i] != tight[i])
            if mine[i] != solution[i]:
                row["wrong"] += 1
                given, right = letters(int(mine[i])), letters(int(solution[i]))
                row["which"].append([float(x[i, 1]), float(x[i, 4]), given, right])
    return result


def pairs(
    name: str, starts: Array, codes: Codes, each: int, gap: float
) -> tuple[Array, Array, Codes, Codes]:
    """Bisect segments between starts of different itineraries until their ends are ``gap`` apart."""
    rng = np.random.default_rng(6)
    low, high = [], []
    for one, other in combinations(np.unique(codes), 2):
        first, second = np.flatnonzero(codes == one), np.flatnonzero(codes == other)
        low.append(starts[rng.choice(first, each)])
        high.append(starts[rng.choice(second, each)])
    x, y = np.concatenate(low), np.concatenate(high)
    solve = library.make(name, TIGHT)
    a, b = solve(x).itinerary, solve(y).itinerary
    while True:
        middle = landings(0.5 * (x[:, 1] + y[:, 1]), 0.5 * (x[:, 4] + y[:, 4]))
        between = (middle != x).any(axis=1) & (middle != y).any(axis=1)
        if not (between & (np.abs(x - y).max(axis=1) > gap)).any():
            return x, y, a, b
        c = solve(middle).itinerary
        left = c != a
        y[left], b[left] = middle[left], c[left]
        x[~left] = middle[~left]
