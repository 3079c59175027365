"""Orbits that fill a box evenly: each ends where it comes close to another, or to itself.

After Jobard & Lefer 1997, "Creating evenly-spaced streamlines of arbitrary density", with cells of a
grid for distances.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ..flow import Trajectory
from ..local.box import Box
from ..model import Array

_CELLS = 34  # across the box, for 12 orbits: one that enters a cell of another ends
_APART = 0.55  # from a start to the next orbit, in units of the box over the number of orbits
_AGAIN = 8  # a curve that has left a cell for so many others and comes back has closed

#: Part of a curve (m, 2) that is wanted.
Cut = Callable[[Array], Array]
#: From a start (2,), forward in time or backward, to where the cut says: the curve (m, 2).
Follow = Callable[[Array, bool, Cut], Array]


def polyline(run: Trajectory, scale: Array, step: float = 1 / 90) -> Array:
    """Points (m, n) of a run so close that straight lines between them draw its polynomials.

    Parameters
    ----------
    run : Trajectory
    scale : ndarray (n,)
        Width and height of the picture.
    step : float, optional
        Largest distance of neighbours, relative to ``scale``; each step has at least eight parts.
    """
    if run.t[-1] == run.t[0]:
        return run.x[:1]
    shares = np.linspace(0.0, 1.0, 9)[:-1]
    spans = np.diff(run.t)
    coarse = run((run.t[:-1, None] + shares * spans[:, None]).ravel())
    gaps = np.linalg.norm(np.diff(np.vstack([coarse, run.x[-1:]]), axis=0) / scale, axis=1)
    lengths = np.nan_to_num(gaps).reshape(-1, len(shares)).sum(axis=1)
    counts = np.clip(np.ceil(lengths / step), len(shares), 400).astype(int)
    times = [
        t + span * np.arange(n) / n for t, span, n in zip(run.t[:-1], spans, counts, strict=True)
    ]
    return np.vstack([run(np.concatenate(times)), run.x[-1:]])


class Spacing:
    """Where orbits have been, and what else no orbit shall start close to.

    Parameters
    ----------
    box : Box
    count : int
        About how many orbits fit across the box.
    avoid : sequence of ndarray (m, 2)
        Curves that orbits may meet, but do not start beside.
    """

    def __init__(self, box: Box, count: int, avoid: Sequence[Array] = ()):
        self.box, self.count = box, count
        self._cells_across = max(round(_CELLS * count / 12), 1)
        self._taken: set[tuple[int, int]] = set()
        self._points = [self._unit(curve) for curve in avoid if len(curve)]

    def _unit(self, points: Array) -> Array:
        return (np.atleast_2d(points) - self.box.corner) / self.box.size

    def _cells(self, curve: Array) -> list[tuple[int, int]]:
        return [(int(a), int(b)) for a, b in np.floor(self._unit(curve) * self._cells_across)]

    def free(self, point: Array) -> bool:
        """Whether no orbit is close to a point."""
        at, apart = self._unit(point), _APART / self.count
        return all(np.min(np.linalg.norm(p - at, axis=1)) >= apart for p in self._points)

    def until_met(self, curve: Array) -> Array:
        """Part of a curve before it comes close to another, or to itself long ago."""
        first: dict[tuple[int, int], int] = {}
        distinct = 0
        last: tuple[int, int] | None = None
        for k, cell in enumerate(self._cells(curve)):
            if cell == last:
                continue
            distinct, last = distinct + 1, cell
            if cell in self._taken or distinct - first.setdefault(cell, distinct) > _AGAIN:
                return curve[: k + 1]
        return curve

    def add(self, curve: Array) -> None:
        """Keep other orbits away from a curve."""
        self._taken.update(self._cells(curve))
        self._points.append(self._unit(curve))


def evenly_spaced(
    box: Box,
    count: int,
    follow: Follow,
    *,
    shortest: float = 0.09,
    avoid: Sequence[Array] = (),
) -> Iterator[tuple[Array, Array]]:
    """Follow orbits both ways from middles of count x count cells that are still free.

    Parameters
    ----------
    box : Box
    count : int
    follow : callable
        Returns an empty or single-point curve where there is no orbit.
    shortest : float, optional
        Curves shorter than this, in units of the box, are left out.
    avoid : sequence of ndarray (m, 2), optional
        Curves that orbits may meet, but do not start beside.

    Yields
    ------
    start : ndarray (2,)
    curve : ndarray (m, 2)
        In the direction of time.
    """
    spacing = Spacing(box, count, avoid)
    for start in np.random.default_rng(0).permutation(box.middles(count)):
        if not spacing.free(start):
            continue
        ahead = follow(start, True, spacing.until_met)
        behind = follow(start, False, spacing.until_met)
        whole = np.vstack([behind[:0:-1], ahead])
        if box.length(whole) > shortest:
            spacing.add(whole)
            yield start, whole
