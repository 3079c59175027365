"""Evenly spaced orbits in a box, for portraits.

Source: Jobard & Lefer 1997, "Creating evenly-spaced streamlines of arbitrary density", with cells of a
grid for distances. Their streamlines end close to another one. Here an orbit continues until it touches
another or comes to rest, so that it ends at the equilibrium or surface where both meet. An orbit that stays
close to another for too long ends with a tapered line, as theirs do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...flow import Trajectory
from ...local.scans.box import Box
from ...model import Array

# Lengths are in units of the box.
_CELLS = 34  # across the box, for 12 orbits; an orbit is close to another in a cell of it
_APART = 0.55  # from a start to the next orbit, times the number of orbits
_AGAIN = 8  # cells between two visits to a cell after which a curve is closed
_FINE = 12  # fine cells across a cell; curves in one of them coincide to the eye
_BESIDE = 0.7  # largest length of a curve close to another
_ON = 0.1  # part of it that is drawn, tapered
_AT_REST = 4e-3  # distance from an equilibrium at which a curve ends
_STEP = 1 / 90  # between points of a curve

#: Shortens a curve (m, 2).
Cut = Callable[[Array], Array]
#: The orbit (m, 2) from a start (2,), forward or backward in time, to where the cut shortens it.
Follow = Callable[[Array, bool, Cut], Array]


class SpacedOrbit(NamedTuple):
    """One of many orbits through a box."""

    start: Array
    curve: Array
    thins: tuple[bool, bool] = (False, False)


def polyline(run: Trajectory, scale: Array, until: tuple[float, Array] | None = None) -> Array:
    """Points (m, n) of a run, dense enough to draw it by straight lines."""
    ends, last = run.t, run.x[-1]
    if until is not None:
        ends, last = np.append(run.t[run.t < until[0]], until[0]), until[1]
    if ends[-1] == ends[0]:
        return last[None, :]
    shares = np.linspace(0.0, 1.0, 9)[:-1]
    spans = np.diff(ends)
    coarse = run((ends[:-1, None] + shares * spans[:, None]).ravel())
    gaps = np.linalg.norm(np.diff(np.vstack([coarse, last]), axis=0) / scale, axis=1)
    lengths = np.nan_to_num(gaps).reshape(-1, len(shares)).sum(axis=1)
    counts = np.clip(np.ceil(lengths / _STEP), len(shares), 400).astype(int)
    times = [
        t + span * np.arange(n) / n for t, span, n in zip(ends[:-1], spans, counts, strict=True)
    ]
    return np.vstack([run(np.concatenate(times)), last])


def until_rest(curve: Array, rests: Sequence[Array], size: Array) -> Array | None:
    """Part of a curve up to the equilibrium that it reaches, other than its start; None if none."""
    found = None
    for rest in rests:
        near = np.linalg.norm((curve - rest) / size, axis=1) < _AT_REST
        after = np.flatnonzero(near & (np.cumsum(~near) > 0))
        if after.size and (found is None or after[0] + 1 < len(found)):
            found = np.vstack([curve[: after[0]], rest])
    return found


class Spacing:
    """Cells of the box that orbits occupy, and points to which no start may be close."""

    def __init__(
        self, box: Box, count: int, avoid: Sequence[Array] = (), rests: Sequence[Array] = ()
    ):
        self.thins = False
        self.box, self.count = box, count
        self._cells_across = max(round(_CELLS * count / 12), 1)
        self._taken: set[tuple[int, int]] = set()
        self._points = [self._unit(curve) for curve in avoid if len(curve)]
        self._rests = [np.asarray(rest, dtype=float) for rest in rests]
        self._lines: set[tuple[int, int]] = set()
        for curve in avoid:
            self._lines.update(self._fine(curve)[0])

    def _unit(self, points: Array) -> Array:
        return (np.atleast_2d(points) - self.box.corner) / self.box.size

    def _cells(self, curve: Array) -> list[tuple[int, int]]:
        return [(int(a), int(b)) for a, b in np.floor(self._unit(curve) * self._cells_across)]

    def free(self, point: Array) -> bool:
        """Whether no orbit is close to a point."""
        at, apart = self._unit(point), _APART / self.count
        return all(np.min(np.linalg.norm(p - at, axis=1)) >= apart for p in self._points)

    def _fine(self, curve: Array) -> tuple[list[tuple[int, int]], list[int]]:
        """Fine cells that a curve passes, and the indices of its points before them."""
        across = _FINE * self._cells_across
        at = self._unit(curve) * across
        parts = np.ceil(2.0 * np.linalg.norm(np.diff(at, axis=0), axis=1))
        parts = np.clip(np.nan_to_num(parts, nan=1.0), 1, 4 * across).astype(int)
        index = np.repeat(np.arange(len(parts)), parts)
        share = np.arange(len(index)) - np.repeat(np.cumsum(parts) - parts, parts)
        dense = at[index] + (share / parts[index])[:, None] * np.diff(at, axis=0)[index]
        cells = [(int(a), int(b)) for a, b in np.floor(np.vstack([dense, at[-1:]]))]
        return cells, [*index.tolist(), len(at) - 1]

    def until_contact(self, curve: Array) -> Array:
        """Part of a curve until it rests or touches another or itself, or a little beside another."""
        self.thins = False
        first: dict[tuple[int, int], int] = {}
        distinct, close = 0, len(curve)
        last: tuple[int, int] | None = None
        for k, cell in enumerate(self._cells(curve)):
            if cell == last:
                continue
            distinct, last = distinct + 1, cell
            if cell in self._taken or distinct - first.setdefault(cell, distinct) > _AGAIN:
                close = k
                break
        rested = until_rest(curve, self._rests, self.box.size)
        if rested is not None and len(rested) <= close + 1:
            return rested
        if close == len(curve):
            return curve
        lines = self._lines.union(self._fine(curve[: close + 1])[0][: -2 * _FINE])
        beside = curve[close:]
        cells, index = self._fine(beside)
        touches = next((i for c, i in zip(cells, index, strict=True) if c in lines), len(beside))
        kept = curve if touches == len(beside) else curve[: close + touches + 2]
        if rested is not None and len(rested) <= len(kept):
            kept = rested
        lengths = self.box.lengths(kept[close:])
        self.thins = bool(lengths[-1] > _BESIDE)
        return kept[: close + 1 + int(np.searchsorted(lengths, _ON))] if self.thins else kept

    def add(self, curve: Array) -> None:
        """Mark the cells of a curve as occupied."""
        self._taken.update(self._cells(curve))
        self._lines.update(self._fine(curve)[0])
        self._points.append(self._unit(curve))


def evenly_spaced(
    box: Box,
    count: int,
    follow: Follow,
    *,
    shortest: float = 0.09,
    avoid: Sequence[Array] = (),
    rests: Sequence[Array] = (),
) -> Iterator[SpacedOrbit]:
    """Follow orbits both ways from the middles of those of count x count cells that are free."""
    spacing = Spacing(box, count, avoid, rests)

    def along(start: Array, ahead: bool) -> tuple[Array, bool]:
        spacing.thins = False
        return follow(start, ahead, spacing.until_contact), spacing.thins

    for start in np.random.default_rng(0).permutation(box.middles(count)):
        if not spacing.free(start):
            continue
        (ahead, end), (behind, begin) = along(start, True), along(start, False)
        whole = np.vstack([behind[:0:-1], ahead])
        if box.length(whole) > shortest:
            spacing.add(whole)
            yield SpacedOrbit(start, whole, (begin, end))
