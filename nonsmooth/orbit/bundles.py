"""Surfaces swept by orbits: a bundle of arcs, denser where they part, and the triangles between."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..model import Array
from .arcs import Arc

#: Neighbours in a bundle are at most so many spacings apart, or there is a hole between them.
_APART = 1.0
_HOLE = 2.5

#: A seed is put between two others down to this distance of their parameters.
_CLOSEST = 1e-10


def bundle(
    seed: Callable[[float], Arc | None],
    closed: bool,
    spacing: float,
    count: int,
    most: int,
    report: Callable[[], object] = lambda: None,
) -> tuple[list[tuple[float, Arc]], bool]:
    """Arcs from seeds on a curve with the parameter 0 to 1, with further ones where they part.

    Parameters
    ----------
    seed : callable
        The arc of a parameter, None where there is none.
    closed : bool
        Whether 1 is 0 again.
    spacing : float
        Distance of neighbours that is aimed at, and of points on an arc.
    count, most : int
        Arcs at the beginning, and at most.
    report : callable, optional
        Called with every arc.

    Returns
    -------
    arcs : list of (parameter, Arc)
        In the order of their parameters.
    complete : bool
        False if interrupted.

    Notes
    -----
    Krauskopf et al. 2005 (Int. J. Bifurcation Chaos 15, 763) compare this with other methods.
    """
    arcs: dict[float, Arc] = {}
    tried: set[float] = set()
    new = np.linspace(0.0, 1.0, count, endpoint=not closed).tolist()
    try:
        while new:
            tried.update(new)
            for u in new:
                arc = seed(u)
                if arc is not None:
                    arcs[u] = arc
                report()
            new = [u for u in _wide(arcs, closed, spacing) if u not in tried][: most - len(arcs)]
    except KeyboardInterrupt:
        if len(arcs) < 2:
            raise
        return sorted(arcs.items()), False
    return sorted(arcs.items()), True


def _wide(arcs: dict[float, Arc], closed: bool, spacing: float) -> list[float]:
    """Parameters in the middle of neighbours that are too far apart."""
    order = sorted(arcs)
    ends = [*order[1:], order[0] + 1.0] if closed and order else order[1:]
    return [
        (a + b) / 2 % 1.0
        for a, b in zip(order, ends, strict=False)
        if b - a > _CLOSEST and _gap(arcs[a], arcs[b % 1.0 if closed else b]) > _APART * spacing
    ]


def _gap(one: Arc, other: Arc) -> float:
    """Largest distance of two arcs at equal length."""
    m = min(len(one.points), len(other.points))
    return float(np.linalg.norm(one.points[:m] - other.points[:m], axis=1).max())


def triangles(
    arcs: list[tuple[float, Arc]], closed: bool, spacing: float
) -> tuple[Array, NDArray[np.int64]]:
    """Points (k, n) of all arcs and triangles (q, 3) between neighbours, but for holes."""
    starts = np.cumsum([0, *[len(arc.points) for _, arc in arcs]])
    points = np.concatenate([arc.points for _, arc in arcs])
    found: list[tuple[int, int, int]] = []
    count = len(arcs)
    for i in range(count if closed and count > 2 else count - 1):
        j = (i + 1) % count
        m, n = len(arcs[i][1].points), len(arcs[j][1].points)
        for k in range(max(m, n) - 1):
            a, b = starts[i] + min(k, m - 1), starts[i] + min(k + 1, m - 1)
            c, d = starts[j] + min(k, n - 1), starts[j] + min(k + 1, n - 1)
            found += [t for t in ((a, b, c), (b, d, c)) if len(set(t)) == 3]
    table = np.array(found, dtype=np.int64).reshape(-1, 3)
    edges = points[table] - points[np.roll(table, 1, axis=1)]
    small = np.linalg.norm(edges, axis=2).max(axis=1) <= _HOLE * spacing
    return points, table[small]
