"""Numbers at a set of codimension two or more: multipliers that hold there, ways to leave it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ...model import Array, Coupled
from ...model.laws.frozen import Frozen, frozen
from ...model.laws.limit_directions import leaving_direction, limit_directions_of
from ...model.laws.multipliers import is_stable, sliding_multipliers
from ..constants import EPSILON

if TYPE_CHECKING:
    from .modes import Expansion


def unknowns_of_sets(
    coupled: Coupled, mode: str, x: Array, p: Array, kept: Array, stable_only: bool
) -> list[Array]:
    """Unknowns (m,) of a mode in which sets slide or are left: none, one, or several."""
    # ``kept`` are h of sets that were just left.
    carried = np.where(np.array(list(mode)) == "b", kept, 0.0) if mode else kept
    leaving = [s for s in coupled.system.sets if mode[s[0]] == "l"]
    if not leaving:
        return sliding_multipliers(coupled, mode, x, p, stable_only, carried)
    own = [i for s in leaving for i in s]
    law = frozen(coupled, mode, x, carried + _any_direction(mode), p, own)
    if not np.all(np.isfinite(law.a)):
        return []
    result: list[Array] = []
    for u in _leaving_directions(law, [len(s) for s in leaving]):
        unknowns = carried.copy()
        unknowns[own] = u
        sliding = coupled.sliding(mode)
        if sliding:
            held = coupled.known_multipliers(mode, x, unknowns, p)
            marks = coupled.error_scales(x, held, np.zeros(coupled.count), p)
            slope = marks.slope[np.ix_(sliding, sliding)]
            try:
                unknowns[sliding] = -np.linalg.solve(slope, marks.layer[sliding])
            except np.linalg.LinAlgError:
                continue
            if stable_only and not is_stable(coupled, sliding, slope, marks.factors):
                continue
        result.append(unknowns)
    return result


def _any_direction(mode: str) -> Array:
    """Something to take the place of directions that are not known yet."""
    return np.where(np.array(list(mode)) == "l", 1.0, 0.0)


def _leaving_directions(law: Frozen, sizes: Sequence[int]) -> list[Array]:
    """Directions in which one or several sets are left at rates that are not negative."""
    if len(sizes) == 1:
        symmetric = np.abs(law.m - law.m.T).max() <= 1e-13 * np.abs(law.m).max()
        if law.definite and symmetric:
            u = leaving_direction(law.a, law.m)[1]
            return [u] if np.all(np.isfinite(u)) else []
        size = float(np.abs(law.a).max() + np.abs(law.m).max())
        return [u for s, u in limit_directions_of(law.a, law.m) if s > -1e-10 * size]
    lam = bounded_multipliers(law, sizes)
    return [] if lam is None else [lam]


def bounded_multipliers(law: Frozen, sizes: Sequence[int]) -> Array | None:
    """Multipliers of several sets at h = 0 together, each of at most length 1."""
    size = np.abs(law.m).max(initial=0.0)
    if not law.definite or np.abs(law.m - law.m.T).max() > 1e-12 * size:
        return None
    edges = list(pairwise(np.concatenate([[0], np.cumsum(sizes)]).tolist()))
    lam = np.zeros(len(law.a))
    for _ in range(2000):
        before = lam.copy()
        for first, last in edges:
            block = law.m[first:last, first:last]
            rest = law.a[first:last] - law.m[first:last] @ lam + block @ lam[first:last]
            inside = np.linalg.solve(block, rest)
            if float(inside @ inside) > 1.0:
                inside = leaving_direction(rest, block)[1]
            lam[first:last] = inside
        if np.abs(lam - before).max() <= 4 * EPSILON:
            return lam
    return lam if np.all(np.isfinite(lam)) else None


def slip_root(
    e: Expansion, sets: Sequence[tuple[int, ...]], index: int, dt: float, h: float
) -> float:
    """Time at which |nu| = |n|, from that at which their squares are equal to rounding."""
    j = next(k for k, members in enumerate(sets) if members[0] == index)
    nu, n, root = e.unknowns[list(sets[j])], e.limits[j], dt
    degrees = np.arange(1, n.size)
    for _ in range(3):
        powered = root ** np.arange(n.size)
        size, limit = float(np.linalg.norm(nu @ powered)), float(n @ powered)
        if size == 0.0 or limit == 0.0:
            return dt
        rates = nu[:, 1:] @ (degrees * powered[:-1]), float(n[1:] @ (degrees * powered[:-1]))
        slope = np.sign(limit) * rates[1] - float((nu @ powered) @ rates[0]) / size
        if not slope < 0.0:
            return dt
        root = min(max(root - (abs(limit) - size) / slope, 0.0), h)
    return root if abs(root - dt) <= 1e-6 * h else dt
