"""Profile of the sum of squares over one parameter, the others refitted."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .least_squares import Problem

Array = NDArray[np.float64]

#: An end of an interval where the sum of squares has risen by less than this share of what its
#: parabola says: the interval is too narrow there.
_SHARE = 0.7
#: Intervals narrower than this share of the value are nothing but rounding.
_ROUNDING = 1e-5
#: A parameter that the data let grow by this factor has no end.
_FAR = 1e4


class Profile:
    """The least sum of squares for each value of one parameter, the others refitted."""

    def __init__(self, problem: Problem, best: Array, covariance: Array, low: Array, high: Array):
        self.problem, self.best, self.covariance = problem, best, covariance
        self.low, self.high = low, high
        self.least = self._cost(best)
        self.variance = self.least / (problem.measured.size - len(best))

    def too_narrow(self, width: float) -> tuple[str, ...]:
        """Parameters whose linearised interval ends where the sum of squares has hardly risen."""
        return tuple(
            name
            for k, name in enumerate(self.problem.names)
            if any(self._flat(k, side, width) for side in (-1, 1))
        )

    def _flat(self, k: int, side: int, width: float) -> bool:
        half = width * math.sqrt(self.covariance[k, k])
        size = max(abs(self.best[k]), abs(self.problem.initial[k]))
        if not _ROUNDING * size < half < math.inf:
            return False
        value = min(max(self.best[k] + side * half, self.low[k]), self.high[k])
        share = abs(value - self.best[k]) / half
        if share < 0.1:  # on its bound, which at_bound names
            return False
        expected = self.variance * (share * width) ** 2
        return self.at(k, value) - self.least < _SHARE * expected

    def interval(self, k: int, width: float) -> tuple[float, float]:
        """Return where the sum of squares has risen by ``width**2`` variances, else the bounds."""
        lower, upper = (self._end(k, side, width) for side in (-1, 1))
        return lower, upper

    def _end(self, k: int, side: int, width: float) -> float:
        best = float(self.best[k])
        bound = float((self.low if side < 0 else self.high)[k])
        size = max(abs(best), abs(float(self.problem.initial[k])), 1e-3)
        error = math.sqrt(self.covariance[k, k])
        step = width * error if 0 < error < size else 0.1 * size
        target = self.least + width**2 * self.variance
        inside = best
        while True:
            outside = best + side * step
            if side * (outside - bound) >= 0:
                outside = bound
            if self.at(k, outside) >= target:
                break
            if outside == bound:
                return bound
            if step > _FAR * size:
                return side * math.inf
            inside, step = outside, 2 * step
        while abs(outside - inside) > 1e-4 * min(abs(outside - best), abs(outside) + abs(inside)):
            middle = (inside + outside) / 2
            if self.at(k, middle) >= target:
                outside = middle
            else:
                inside = middle
        return (inside + outside) / 2

    def at(self, k: int, value: float) -> float:
        others = np.arange(len(self.best)) != k
        point = self.best.copy()
        point[k] = value
        if not others.any():
            return self._cost(point)
        variance = self.covariance[k, k]
        if 0 < variance < math.inf:  # along the valley that the covariance shows
            shift = self.covariance[others, k] / variance * (value - self.best[k])
            point[others] += np.where(np.isfinite(shift), shift, 0.0)
        low, high = self.low[others], self.high[others]
        point[others] = np.clip(point[others], low, high)
        if not math.isfinite(self._cost(point)):
            point[others] = self.best[others]
        return self._refit(point, others, low, high)

    def _refit(self, point: Array, others: NDArray[np.bool_], low: Array, high: Array) -> float:
        from scipy.optimize import least_squares

        def full(values: Array) -> Array:
            moved = point.copy()
            moved[others] = values
            return moved

        start = np.clip(point[others], low + 1e-12, high - 1e-12)
        if not math.isfinite(self._cost(full(start))):
            return math.inf
        run: Any = least_squares(
            lambda values: self.problem.residuals(full(values)),
            start,
            jac=lambda values: self.problem.jacobian(full(values))[:, others],
            bounds=(low, high),
            x_scale="jac",
            ftol=1e-4,
            max_nfev=20,
        )
        return float(2 * run.cost)

    def _cost(self, values: Array) -> float:
        cost = float(np.sum(self.problem.residuals(values) ** 2))
        return cost if math.isfinite(cost) else math.inf
