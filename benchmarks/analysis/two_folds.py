"""Two-folds over a grid of parameters, found and classified, beside a script written by hand.

No peer classifies two-folds. The script is for this one system: derivatives by hand, a root finder and
the decision table.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import fsolve

import nonsmooth as ns

from ..timing import alternate


def system() -> ns.FilippovSystem:
    """Return a system in three states whose two-fold moves with the parameters a and b."""
    x, y, z, a, b = (ca.SX.sym(s) for s in "xyzab")
    return ns.FilippovSystem(
        [x, y, z],
        surface=x + 0.1 * y * z,
        above=[-y + 0.1 * a, -1 + 0.3 * z, a + x],
        below=[z + 0.2 * y**2 - 0.1 * b, b, 1 + 0.1 * y],
        parameters={a: 0.0, b: 0.0},
    )


def library(grid: np.ndarray) -> list[str]:
    """Labels by the library."""
    s = system()
    labels = []
    for a, b in grid:
        fold = ns.find_two_fold(s, [0.0, 0.0, 0.0], parameters={"a": a, "b": b})
        labels.append(fold.label)
    return labels


def by_hand(grid: np.ndarray) -> list[str]:
    """Labels by the script for this one system."""
    return [_label(a, b) for a, b in grid]


def _functions(a: float, b: float) -> tuple[Callable[..., Any], ...]:
    def f1(p: Any) -> Any:
        x, y, z = p
        return np.array([-y + 0.1 * a, -1 + 0.3 * z, a + x])

    def f2(p: Any) -> Any:
        _, y, z = p
        return np.array([z + 0.2 * y**2 - 0.1 * b, b, 1 + 0.1 * y])

    def equations(p: Any) -> Any:
        x, y, z = p
        slope = np.array([1.0, 0.1 * z, 0.1 * y])
        return [x + 0.1 * y * z, slope @ f1(p), slope @ f2(p)]

    def gradients(p: Any) -> tuple[Any, Any]:
        """Of L1 and L2, by hand: a product rule for each state."""
        _, y, z = p
        u, v = f1(p), f2(p)
        one = [0.1 * y, -1 + 0.1 * u[2], 0.1 * u[1] + 0.03 * z]
        two = [0.0, 0.4 * y + 0.1 * v[2] + 0.01 * y, 1 + 0.1 * v[1]]
        return np.array(one), np.array(two)

    return f1, f2, equations, gradients


def _label(a: float, b: float) -> str:
    f1, f2, equations, gradients = _functions(a, b)
    point = fsolve(equations, [0.0, 0.0, 0.0], xtol=1e-12)
    u, v = f1(point), f2(point)
    one, two = gradients(point)
    l11, l12, l21, l22 = u @ one, u @ two, v @ one, v @ two
    root = math.sqrt(abs(l11 * l22))
    s1, s2, n1, n2 = np.sign(l11), np.sign(l22), l12 / root, -l21 / root
    trace, delta, split = n1 + n2, n1 * n2 + s1 * s2, (n1 - n2) ** 2 - 4 * s1 * s2
    if s1 * s2 < 0:
        low = 0.5 * (trace - math.sqrt(split))
        high = 0.5 * (trace + math.sqrt(split))
        if s1 > 0:
            return "VV-C1" if low < 0 else "VV-F"
        return "II-C" if high < 0 else "II-F"
    if s1 * (n2 - n1) < 2:
        return "mix-0"
    if delta < 0:
        return "mix-S"
    return "mix-C" if trace < 0 else "mix-F"


def run(quick: bool) -> dict[str, Any]:
    """Time both over a grid of (a, b), and compare the labels."""
    side = 8 if quick else 40
    axis = np.linspace(-3.0, 3.0, side)
    grid = np.array([(a, b) for a in axis for b in axis])
    mine, theirs = library(grid), by_hand(grid)
    timings = alternate(
        {"nonsmooth": lambda: library(grid), "by hand": lambda: by_hand(grid)}, 3 if quick else 7
    )
    result = {
        "two-folds": len(grid),
        "classes": {str(c): mine.count(c) for c in sorted(set(mine))},
        "labels that differ": sum(m != t for m, t in zip(mine, theirs, strict=True)),
        "solvers": {k: t.as_dict() | {"rate": t.rate(len(grid))} for k, t in timings.items()},
    }
    print(f"  {result}", flush=True)
    return result
