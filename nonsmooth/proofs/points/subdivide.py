"""All zeros of a square system in a box, by subdivision with proofs that discarded pieces are empty.

A piece is discarded if an equation has no zero on it (natural interval extension or mean value form),
if Krawczyk's operator maps it outside, or if it lies in a box of uniqueness of a known zero. Where
|I - C J| < 1, a piece has at most one zero. Other pieces are halved across the direction in which the
equations change most; tiny ones are undecided. (Neumaier 1990, ch. 5; Kearfott 1996.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arithmetic.equations import Equations
from ..arithmetic.flint import arb
from ..arithmetic.instructions import Program
from ..arithmetic.interval_arrays import Floats, Intervals, evaluate_many, of_enclosure, points
from ..arithmetic.intervals import within
from ..arithmetic.krawczyk import Zero, prove_zero

_MANY = 4096  # pieces at once


@dataclass
class Search:
    """A search in progress, with its results."""

    equations: Equations
    low: Floats
    high: Floats
    smallest: float = 1e-7
    max_boxes: int = 200_000
    max_failures: int = 64
    zeros: list[Zero] = field(default_factory=list)
    undecided: list[tuple[Floats, Floats]] = field(default_factory=list)
    boxes: int = 0
    stopped: str = ""

    def __post_init__(self) -> None:
        self.n, self.size = self.low.size, self.high - self.low
        self._regions: list[tuple[Floats, Floats]] = []
        self._tried: list[Floats] = []
        self._failures = 0
        held = self.equations.held
        self._held = [[of_enclosure(v) for v in vector] for vector in held]

    def run(self) -> None:
        """Search until no piece is left; Ctrl-C keeps the results so far."""
        todo = [(self.low[None, :], self.high[None, :])]
        try:
            while todo:
                low, high = todo.pop()
                if len(low) > _MANY:
                    todo.append((low[_MANY:], high[_MANY:]))
                    low, high = low[:_MANY], high[:_MANY]
                self.boxes += len(low)
                todo.append((low, high))  # kept if interrupted
                if self.boxes > self.max_boxes:
                    self.stopped = f"more than {self.max_boxes} pieces"
                elif self._failures > self.max_failures:
                    self.stopped = f"more than {self.max_failures} pieces whose zero is not simple"
                if self.stopped:
                    break
                rest = self._sweep(low, high)
                todo.pop()
                if len(rest[0]):
                    todo.append(rest)
        except KeyboardInterrupt:
            self.stopped = "interrupted"
        for low, high in todo:
            self.undecided += list(zip(low, high, strict=True))

    # one sweep -----------------------------------------------------------------------------------

    def _evaluate(self, program: Program, x: Intervals) -> Any:
        """Rows of values at pieces (B, n)."""
        vectors = [list(v) for v in self._held]
        for j, (vector, position) in enumerate(self.equations.unknowns):
            vectors[vector][position] = x[:, j]
        return evaluate_many(program, vectors, self.equations.numbers)

    def _sweep(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        values, both = self.equations.programs
        (f,) = self._evaluate(values, Intervals(low, high))
        over = _stacked([f], len(low))[:, 0]
        keep = np.all(over.has_zero, axis=1)
        # Without finite values a function may jump, even if its derivative is finite.
        smooth = np.all(np.isfinite(over.low) & np.isfinite(over.high), axis=1)[keep]
        low, high = low[keep], high[keep]
        if not len(low):
            return low, high
        _, *rows = self._evaluate(both, Intervals(low, high))
        slopes = _stacked(rows, len(low))
        middle = 0.5 * (low + high)
        (f,) = self._evaluate(values, points(middle))
        at_middle = _stacked([f], len(low))[:, 0]
        move = Intervals(low, high) - points(middle)
        with np.errstate(all="ignore"):
            mean = at_middle + _times(slopes, move)
        keep = np.all(mean.has_zero, axis=1) | ~smooth
        low, high, middle = low[keep], high[keep], middle[keep]
        slopes, at_middle, move = slopes[keep], at_middle[keep], move[keep]
        smooth = smooth[keep]
        low, high, single, keep = _krawczyk(low, high, middle, slopes, at_middle, move, smooth)
        low, high, single, slopes = low[keep], high[keep], single[keep], slopes[keep]
        open_ = self._resolve(low, high, single)
        low, high, slopes = low[open_], high[open_], slopes[open_]
        tiny = np.max((high - low) / self.size, axis=1, initial=0.0) < self.smallest
        self.undecided += list(zip(low[tiny], high[tiny], strict=True))
        return self._halved(low[~tiny], high[~tiny], slopes.size[~tiny])

    def _resolve(self, low: Floats, high: Floats, single: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which pieces are still open, after an attempt to prove a zero in each."""
        open_ = np.ones(len(low), bool)
        for a, b in self._regions:
            open_ &= ~(np.all(a <= low, axis=1) & np.all(high <= b, axis=1))
        wide = np.max((high - low) / self.size, axis=1, initial=0.0)
        for k in np.flatnonzero(open_ & (single | (wide < 1e-3))):
            if self._known(low[k], high[k], bool(single[k])):
                open_[k] = False
                continue
            middle = 0.5 * (low[k] + high[k])
            near = [np.max(np.abs(middle - t) / self.size) for t in self._tried]
            if self._failures > self.max_failures or (
                not single[k] and near and min(near) < wide[k] / 2
            ):
                continue
            self._tried.append(middle)
            self._prove(middle)
            open_[k] = not self._known(low[k], high[k], bool(single[k]))
        return open_

    def _known(self, low: Floats, high: Floats, single: bool) -> bool:
        """Whether a piece holds known zeros only."""
        if any(np.all(a <= low) and np.all(high <= b) for a, b in self._regions):
            return True
        return single and any(_holds(low, high, zero.point) for zero in self.zeros)

    def _prove(self, middle: Floats) -> None:
        found = prove_zero(self.equations, [arb(float(v)) for v in middle], list(self.size))
        if found is None:
            self._failures += 1
            return
        known = [within(found.point, z.box) or within(z.point, found.box) for z in self.zeros]
        near = [
            all(a.overlaps(b) for a, b in zip(found.point, z.point, strict=True))
            for z in self.zeros
        ]
        if any(k is False and n for k, n in zip(known, near, strict=True)):
            self._failures += 1  # two enclosures that may or may not be of one zero
            return
        self._regions.append(_inner(found.box))
        if not any(known):
            self.zeros.append(found)

    def _halved(self, low: Floats, high: Floats, slopes: Floats) -> tuple[Floats, Floats]:
        """Halve pieces across the direction in which an equation changes most."""
        if not len(low):
            return low, high
        rows = np.where(np.isfinite(slopes), slopes, 1e300)
        rows = rows / np.maximum(rows.max(axis=2, keepdims=True), 1e-300)
        change = np.maximum(rows.max(axis=1), 1e-3) * (high - low) / self.size
        axis, row = np.argmax(change, axis=1), np.arange(len(low))
        cut = 0.5 * (low[row, axis] + high[row, axis])
        left, right = high.copy(), low.copy()
        left[row, axis] = right[row, axis] = cut
        return np.concatenate([low, right]), np.concatenate([left, high])


def _stacked(rows: Sequence[Sequence[Intervals]], count: int) -> Intervals:
    """Rows of values as one array (count, rows, columns)."""
    shape = (len(rows), len(rows[0]), count)
    low, high = np.empty(shape), np.empty(shape)
    for i, row in enumerate(rows):
        for j, v in enumerate(row):
            low[i, j], high[i, j] = v.low, v.high
    return Intervals(np.moveaxis(low, 2, 0), np.moveaxis(high, 2, 0))


def _times(matrices: Intervals, vectors: Intervals) -> Intervals:
    """Matrices (B, n, n) times vectors (B, n)."""
    total = matrices[:, :, 0] * vectors[:, None, 0]
    for j in range(1, vectors.low.shape[1]):
        total = total + matrices[:, :, j] * vectors[:, None, j]
    return total


def _krawczyk(
    low: Floats,
    high: Floats,
    middle: Floats,
    slopes: Intervals,
    at_middle: Intervals,
    move: Intervals,
    smooth: NDArray[np.bool_],
) -> tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Pieces contracted by Krawczyk's operator; which hold one zero at most; which are not empty."""
    n = low.shape[1]
    with np.errstate(all="ignore"):
        mean = 0.5 * (slopes.low + slopes.high)
        usable = smooth & np.all(np.isfinite(mean), axis=(1, 2))
        usable[usable] &= np.abs(np.linalg.det(mean[usable])) > 1e-280
        inverse = np.zeros_like(mean)
        inverse[usable] = np.linalg.inv(mean[usable])
        inverse[~np.isfinite(inverse)] = 0.0
        c = points(inverse)
        product = c[:, :, 0, None] * slopes[:, 0, None, :]
        for j in range(1, n):
            product = product + c[:, :, j, None] * slopes[:, j, None, :]
        rest = points(np.eye(n)) - product
        image = points(middle) - _times(c, at_middle) + _times(rest, move)
    single = usable & (np.max(np.sum(rest.size, axis=2), axis=1, initial=0.0) < 0.99)
    new_low = np.where(usable[:, None], np.maximum(image.low, low), low)
    new_high = np.where(usable[:, None], np.minimum(image.high, high), high)
    return new_low, new_high, single, np.all(new_low <= new_high, axis=1)


def _holds(low: Floats, high: Floats, point: Sequence[arb]) -> bool:
    """Whether an enclosure lies in a piece."""
    return all(
        arb(float(a)) <= v and v <= arb(float(b)) for a, b, v in zip(low, high, point, strict=True)
    )


def _inner(box: Sequence[arb]) -> tuple[Floats, Floats]:
    """Doubles inside a box."""
    low = np.array([np.nextafter(float(b.lower()), np.inf) for b in box])
    high = np.array([np.nextafter(float(b.upper()), -np.inf) for b in box])
    return low, high


def clusters(pieces: Sequence[tuple[Floats, Floats]], size: Floats) -> list[tuple[Floats, Floats]]:
    """Hulls of pieces that touch, to a thousandth of the box."""
    hulls: list[tuple[Floats, Floats]] = []
    for low, high in pieces:
        near = [
            h
            for h in hulls
            if np.all(low <= h[1] + 1e-3 * size) and np.all(high >= h[0] - 1e-3 * size)
        ]
        hulls = [h for h in hulls if not any(h is o for o in near)]
        for a, b in near:
            low, high = np.minimum(low, a), np.maximum(high, b)
        hulls.append((low, high))
    return hulls
