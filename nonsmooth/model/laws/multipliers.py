"""The multipliers that keep the sliding surfaces of a mode, at one point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..values import Array
from .coupled import Coupled


def sliding_multipliers(
    of: Coupled, mode: str, x: Array, p: Array, stable_only: bool = True
) -> list[Array]:
    """Multipliers (surfaces,) that keep the sliding surfaces of a mode of a system without sets."""
    # Linear equations have one set, those of a mode may be linear although others are not; for others
    # Newton's method starts from a grid (bilinear equations of two multipliers have at most two sets).
    sliding = of.sliding(mode)
    unknowns = np.zeros(of.count)
    if not sliding:
        return [unknowns]
    k = len(sliding)
    starts = [np.zeros(k)]
    if not of.affine and not _is_linear(of, mode, x, unknowns, p):
        grid = np.linspace(-0.95, 0.95, 21 if k == 1 else 5 if k < 4 else 1)
        starts = list(np.stack(np.meshgrid(*[grid] * k), axis=-1).reshape(-1, k))
    found: list[Array] = []
    for start in starts:
        unknowns[sliding] = start
        lam = newton_multipliers(of, mode, x, unknowns, p, 1 if of.affine else 30)
        if lam is None or not _is_solution(of, mode, x, lam, p, stable_only):
            continue
        if all(np.abs(lam - other).max() > 1e-7 for other in found):
            found.append(lam)
    return found


def _is_linear(of: Coupled, mode: str, x: Array, unknowns: Array, p: Array) -> bool:
    """Whether the slope of the sliding functions is equal at some values of their multipliers, of which it is a polynomial."""
    if any(of.system.nonlinear):
        return False
    held, sliding, slopes = of.held(mode), of.sliding(mode), []
    for size in (-0.7, 0.3, 0.9):
        moved = unknowns.copy()
        moved[sliding] = size * np.linspace(1.0, 0.5, len(sliding))
        at = of.layer_at(x, held, moved, p)
        slopes.append(at.slope[np.ix_(sliding, sliding)])
    change = max(float(np.abs(slope - slopes[0]).max()) for slope in slopes[1:])
    return change <= 1e-13 * float(np.abs(slopes[0]).max())


def _is_solution(
    of: Coupled, mode: str, x: Array, unknowns: Array, p: Array, stable_only: bool
) -> bool:
    sliding = of.sliding(mode)
    at = of.layer_at(x, of.held(mode), unknowns, p)
    slope = at.slope[np.ix_(sliding, sliding)]
    g = at.layer[sliding]
    small = np.abs(g).max() <= 1e-10 * (1.0 + np.abs(slope).max())
    largest = np.abs(at.factors[sliding]) * (1.0 + 1e-9)
    if not of.affine and not (small and np.all(np.abs(unknowns[sliding]) <= largest)):
        return False
    if not np.all(np.isfinite(slope)):
        return False
    return not stable_only or is_stable(of, sliding, slope, at.factors)


def is_stable(of: Coupled, sliding: Sequence[int], slope: Array, factors: Array) -> bool:
    """Whether sliding is stable across the layer, from its slope dG/d(unknowns)."""
    system = of.system
    surfaces = {*range(system.surface_count)} - {*system.half_lines}
    own = [k for k, i in enumerate(sliding) if i in surfaces]
    stable = slope[np.ix_(own, own)] * np.sign(factors)[np.array(sliding, int)[own]]
    return not own or bool(np.linalg.eigvals(stable).real.max() < 0.0)


def newton_multipliers(
    of: Coupled, mode: str, x: Array, unknowns: Array, p: Array, iterations: int
) -> Array | None:
    """Newton's method for the multipliers of a mode, from those given."""
    held, sliding = of.held(mode), of.sliding(mode)
    result = unknowns.copy()
    for _ in range(iterations):
        at = of.layer_at(x, held, result, p)
        try:
            step = np.linalg.solve(at.slope[np.ix_(sliding, sliding)], at.layer[sliding])
        except np.linalg.LinAlgError:
            return None
        result[sliding] -= step
        if not np.all(np.isfinite(step)):
            return None
        if np.abs(step).max(initial=0.0) <= 1e-16 * (1.0 + np.abs(result).max()):
            break
    return result
