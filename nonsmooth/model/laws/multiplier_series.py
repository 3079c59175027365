"""The multipliers of a mode as power series, order by order beside those of the states.

With G = grad h . f(x, lambda) the rates of the switching functions:

- on a surface or set that slides, coefficient k of lambda keeps coefficient k of G at zero;
- off a set (letter ``*``) lambda = h/|h|, from the coefficients of h;
- close to a set that was left (``b``) the same, with h' = G carried along, so that no digits of its
  direction are lost to the rounding of states that are far larger;
- at the moment of leaving (``l``) h = r u with |u| = 1 and u = lambda itself: the coefficients k of u
  and k + 1 of r keep coefficient k of (r u)' - G at zero.

The last is a convergent series where the set is left at a rate; at the end of sliding, where the rate is
zero, it is asymptotic: its coefficients grow as factorials.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..values import Array

if TYPE_CHECKING:
    from .coupled import Coupled

#: A step ends where |h| has fallen to this part: towards h = 0 a series may go on as -|h|.
FALL = 0.1

#: The same for friction's limit on the set, whose square is compared with that of what is needed.
LIMIT_FALL = 1e-3

#: A rate of leaving below this part of its terms is zero by rounding.
_STILL = 64 * np.finfo(float).eps

Outputs = Sequence[Sequence[float | None]]


def unit(h: Array) -> Array:
    """Direction of a vector of any size; NaN for zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        scaled = h / np.abs(h).max()
        return np.asarray(scaled / np.linalg.norm(scaled))


class Direction:
    """The series of h/|h|, order by order."""

    def __init__(self, size: int, order: int):
        self.radius = 0.0
        self.h, self.u = np.zeros((size, order + 1)), np.zeros((size, order + 1))
        self._root = np.zeros(order + 1)

    def push(self, k: int, h: Array) -> Array:
        """Coefficient k of the direction from that of h."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            if k == 0:
                largest = float(np.abs(h).max())
                self.radius = largest * float(np.linalg.norm(h / largest))
            own, root = self.h, self._root
            own[:, k] = h / self.radius
            # Along a line the products are those of the root, exactly so along an axis.
            curved = sum(_inner(row, k) for row in own) - _inner(root, k)
            root[k] = float(own[:, 0] @ own[:, k]) + 0.5 * curved if k else 1.0
            self.u[:, k] = own[:, k] - self.u[:, :k] @ root[k:0:-1]
        return self.u[:, k]


class MultiplierSeries:
    """The multipliers of one step."""

    def __init__(
        self,
        coupled: Coupled,
        mode: str,
        unknowns: Array,
        held: Array,
        slope: Array,
        factors: Array,
        order: int,
    ):
        self.mode, self.order = mode, order
        self.sliding = coupled.sliding(mode)
        self._slope = slope[np.ix_(self.sliding, self.sliding)]
        self._inverse: Array | None = None
        self.held, self.series = np.zeros((2, coupled.count, order + 1))
        self.limits = np.zeros((0, order + 1))
        self.held[:, 0] = held
        self.series[self.sliding, 0] = unknowns[self.sliding]
        sets = coupled.moving_sets(mode)
        self._off = {s: Direction(len(s), order) for s in sets if mode[s[0]] != "l"}
        self._leaving = [list(s) for s in sets if mode[s[0]] == "l"]
        for s in self._off:
            if mode[s[0]] == "b":
                self.series[list(s), 0] = unknowns[list(s)]
        self._radii = np.zeros((len(self._leaving), order + 2))
        if self._leaving:
            rates = slope * factors  # by the multipliers themselves
            columns = [i for s in self._leaving for i in s]
            self._rates = np.concatenate([slope[:, self.sliding], rates[:, columns]], axis=1)
        self.acting = self.series if not sets else np.zeros_like(self.series)
        self.acting[self.sliding, 0] = self.series[self.sliding, 0]

    def follow(self, k: int, heights: Sequence[float | None]) -> bool:
        """Coefficients k of what is h/|h|; whether there is any that was not known."""
        for s, direction in self._off.items():
            own = list(s)
            if self.mode[s[0]] == "b":
                h = self.series[own, k]
            else:
                h = np.array([heights[i] or 0.0 for i in own])
            self.held[own, k] = direction.push(k, h)
        return bool(self._off) and k > 0

    def solve(self, k: int, layer: Sequence[float | None]) -> bool:
        """Coefficients k of what keeps the rates where they have to be; whether there is any."""
        if self._leaving:
            self._leave(k, layer)
            return k > 0
        if not k or not self.sliding:
            return False
        residual = np.array([layer[i] or 0.0 for i in self.sliding])
        if self._inverse is None:
            self._inverse = _inverse(self._slope)
        self.series[self.sliding, k] = self.acting[self.sliding, k] = -self._inverse @ residual
        return True

    def close(self, k: int, layer: Sequence[float | None]) -> None:
        """Coefficients k + 1 of h that is carried along."""
        if k == self.order:
            return
        for s in self._off:
            if self.mode[s[0]] == "b":
                self.series[list(s), k + 1] = [(layer[i] or 0.0) / (k + 1) for i in s]
        for j, own in enumerate(self._leaving):
            radius, u = self._radii[j], self.held[own]
            self.series[own, k + 1] = u[:, : k + 1] @ radius[k + 1 : 0 : -1]

    def _leave(self, k: int, layer: Sequence[float | None]) -> None:
        """Coefficients k of the directions and k + 1 of the distances, with those of what slides."""
        rates = np.array([v or 0.0 for v in layer])
        if k == 0:
            for radius, own in zip(self._radii, self._leaving, strict=True):
                u, g = self.held[own, 0], rates[own]
                size = np.abs(u) @ (np.abs(g) + np.abs(self._rates[own]).sum(axis=1))
                rate = float(u @ g)
                radius[1] = rate if abs(rate) > _STILL * size else 0.0
            return
        slides, n = len(self.sliding), self._rates.shape[1]
        rows = [*self.sliding, *[i for own in self._leaving for i in own]]
        matrix = np.zeros((n + len(self._leaving),) * 2)
        right = np.zeros(n + len(self._leaving))
        matrix[:n, :n], right[:n] = self._rates[rows], -rates[rows]
        first = slides
        for j, (radius, own) in enumerate(zip(self._radii, self._leaving, strict=True)):
            u, last = self.held[own], first + len(own)
            here = slice(first, last)
            matrix[here, here] -= (k + 1) * radius[1] * np.eye(len(own))
            matrix[here, n + j] = -(k + 1) * u[:, 0]
            matrix[n + j, here] = u[:, 0]
            right[here] += (k + 1) * (u[:, 1:k] @ radius[k:1:-1])
            right[n + j] = -0.5 * float((u[:, 1:k] * u[:, k - 1 : 0 : -1]).sum())
            first = last
        found = _solve(matrix, right)
        self.series[self.sliding, k] = self.acting[self.sliding, k] = found[:slides]
        first = slides
        for j, own in enumerate(self._leaving):
            self.held[own, k] = found[first : first + len(own)]
            self._radii[j, k + 1] = found[n + j]
            first += len(own)

    def rows(self, heights: Array, factors: Array, coupled: Coupled) -> list[list[Array]]:
        """Series of the guards of each set: how far |h| has fallen, or how far friction can rise."""
        result: list[list[Array]] = []
        self.limits = factors[[s[0] for s in coupled.system.sets]]
        for s, limit in zip(coupled.system.sets, self.limits, strict=True):
            own, letter = list(s), self.mode[s[0]]
            if letter in "si":
                result.append(_on(self.series[own], limit, abs(limit[0]), coupled.scaled[s[0]]))
            elif letter == "l":
                j = self._leaving.index(own)
                result.append([self._radii[j, : self.order + 1]])
            else:
                h = heights[own] if letter == "*" else self.series[own]
                result.append([remaining(h, self._off[s].radius)])
        return result

    @property
    def directions(self) -> Array:
        """Series whose relative accuracy counts, whatever the size of the states."""
        rows: list[Array] = []
        for s, direction in self._off.items():
            if self.mode[s[0]] == "b":
                rows += [*direction.u, *direction.h]
        rows += [row for own in self._leaving for row in self.held[own]]
        return np.array(rows) if rows else np.zeros((0, self.order + 1))

    def radii(self, coupled: Coupled) -> Array:
        """|h| at the start for each set, and on it the magnitude of its factor (sets,)."""
        pairs = zip(coupled.system.sets, self.limits, strict=True)
        off = self._off
        return np.array([off[s].radius if s in off else abs(limit[0]) for s, limit in pairs])


def _inner(row: Array, k: int) -> float:
    """Coefficient k of a square, without its first and last products."""
    return float(row[1:k] @ row[k - 1 : 0 : -1]) if k > 1 else 0.0


def product(a: Array, b: Array) -> Array:
    """Product of two series of one length."""
    return np.convolve(a, b)[: len(a)]


def _on(unknowns: Array, factor: Array, size: float, scaled: bool) -> list[Array]:
    """Guards on a set: friction's limit is not reached, and has not fallen too far for its square."""
    rows = [room(unknowns, factor)]
    if scaled and size > 0.0:
        rows.append(remaining(factor[None, :], size, LIMIT_FALL))
    elif scaled:
        rows.append(np.eye(1, factor.size)[0])
    return rows


def remaining(h: Array, radius: float, fall: float = FALL) -> Array:
    """Series (k, n) of h to that of |h|^2/|h(0)|^2 - fall^2."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        scaled = h / radius
        total = sum((product(row, row) for row in scaled), np.zeros(h.shape[1]))
    total[0] -= fall * fall
    return np.asarray(total)


def room(unknowns: Array, factor: Array) -> Array:
    """Series of n^2 - |nu|^2, which is positive while |lambda| < 1."""
    used = sum((product(row, row) for row in unknowns), np.zeros(factor.size))
    return np.asarray(product(factor, factor) - used)


def set_values(
    coupled: Coupled, mode: str, unknowns: Array, heights: Array, factors: Array, radii: Array
) -> list[list[Array]]:
    """Values of the guards of all sets, as ``MultiplierSeries.rows``."""
    result: list[list[Array]] = []
    for s, radius in zip(coupled.system.sets, radii, strict=True):
        own, letter = list(s), mode[s[0]]
        if letter in "si":
            result.append(_on(unknowns[own], factors[own[0]], radius, coupled.scaled[own[0]]))
        elif letter == "l":
            result.append([np.array([np.linalg.norm(unknowns[own])])])
        else:
            result.append([remaining(heights[own] if letter == "*" else unknowns[own], radius)])
    return result


def _inverse(matrix: Array) -> Array:
    """Inverse of a matrix; NaN where it has none."""
    try:
        return np.asarray(np.linalg.inv(matrix), float)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)


def _solve(matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right), float)
    except np.linalg.LinAlgError:
        return np.full_like(right, np.nan)
