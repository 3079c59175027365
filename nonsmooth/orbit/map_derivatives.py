"""Second and third derivatives of the return map of a periodic orbit along one direction.

The derivative of the return map is exact wherever an orbit of its itinerary starts; its differences along the
eigenvector of a multiplier on the unit circle are the derivatives that a normal form needs.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..model import Array, NonsmoothError
from .boundary import BoundaryProblem, Evaluation
from .multipliers import return_map
from .normal_forms import (
    Complex,
    Expansion,
    eigenvectors,
    flip_coefficient,
    torus_coefficient,
)

#: Distances of the differences, relative to the orbit: of two that agree the shorter one is taken.
_STEPS = (4e-3, 2e-3, 5e-4, 1.25e-4, 3e-5)

#: They agree to this part.
_AGREE = 1e-5

#: Newton's method for the flight from a start beside the orbit.
_ITERATIONS, _TOLERANCE = 12, 1e-13


def normal_form(
    problem: BoundaryProblem, at: Evaluation, p: Array, kind: str
) -> Mapping[str, float]:
    """The coefficient of a period doubling or pitchfork (c), or of a Neimark-Sacker point (a).

    In states (and time) as they are, with an eigenvector of length one where the first leg starts, and
    the error of the differences.

    Returns
    -------
    mapping
        Empty where the orbits beside the event cannot be flown.
    """
    n = problem.dimension
    units = problem.scales(problem.pack(at.starts, at.durations), p)[:n]
    a = return_map(problem, at) * (units / units[:, None])
    value, name = -1.0 + 0j, "cubic coefficient"
    if kind == "Neimark-Sacker":
        values = np.linalg.eigvals(a)
        k, l = np.triu_indices(n, 1)
        pair = values[k[int(np.argmin(np.abs(values[k] * values[l] - 1.0)))]]
        value, name = pair / abs(pair), "first Lyapunov coefficient"
    q, left = eigenvectors(a, value)
    turning, best, before = kind == "Neimark-Sacker", (0.0, np.inf), np.nan
    for size in _STEPS:
        try:
            around = _Around(problem, at, p, units, size)
            whole = Expansion(a, q, left, *around.along(q, turning))
            now = torus_coefficient(whole, value) if turning else flip_coefficient(whole)
        except (NonsmoothError, np.linalg.LinAlgError):
            before = np.nan
            continue
        if abs(now - before) < best[1]:  # of fourth order: the shorter one is better by far
            best = now, abs(now - before)
        if best[1] < _AGREE * abs(now):
            break
        before = now
    if not np.isfinite(best[1]):
        return {}
    length = float(np.linalg.norm(units * q)) ** 2
    return {name: best[0] / length, "its error": best[1] / length}


class _Around:
    """Differences of the derivative of the return map beside an orbit."""

    def __init__(
        self, problem: BoundaryProblem, at: Evaluation, p: Array, units: Array, size: float
    ):
        self.problem, self.p, self.units, self.size = problem, p, units, size
        self.start = problem.pack(at.starts, at.durations)
        self.sizes = problem.scales(self.start, p)
        self.here = self._slope_at(np.zeros(problem.dimension))

    def along(self, q: Complex, turning: bool) -> tuple[Complex, Complex]:
        """B(q, .) and C(q, q*, .)."""
        second, third = self._differences(q.real)
        if not turning:
            return second.astype(complex), third.astype(complex)
        more, further = self._differences(q.imag)
        return second + 1j * more, (third + further).astype(complex)

    def _differences(self, direction: Array) -> tuple[Array, Array]:
        h = self.size
        far, near, ahead, further = (self._slope_at(k * h * direction) for k in (-2, -1, 1, 2))
        first = (8.0 * (ahead - near) - (further - far)) / (12.0 * h)
        second = (16.0 * (ahead + near) - (further + far) - 30.0 * self.here) / (12.0 * h**2)
        return first, second

    def _slope_at(self, away: Array) -> Array:
        """The derivative of the return map from a start beside the orbit, in its units."""
        problem, n, count = self.problem, self.problem.dimension, len(self.problem.legs)
        u, sizes = self.start.copy(), self.sizes
        u[:n] += self.units * away
        rows = np.delete(np.arange(u.size), slice((count - 1) * n, count * n))
        at = problem.evaluate(u, self.p)
        for _ in range(_ITERATIONS):
            residual, matrix = at.residual[rows], at.jacobian[np.ix_(rows, np.arange(n, u.size))]
            if problem.phase is not None:
                residual, matrix = self._returning(at)
            step = np.linalg.solve(matrix * sizes[n:], -residual)
            u[n:] += step * sizes[n:]
            at = problem.evaluate(u, self.p)
            if np.abs(step).max() < _TOLERANCE:
                break
        return return_map(problem, at) * (self.units / self.units[:, None])

    def _returning(self, at: Evaluation) -> tuple[Array, Array]:
        """Of an orbit without events: when it is back on its plane."""
        problem, flown = self.problem, at.flown[0]
        assert problem.phase is not None and problem.reference is not None
        back = problem.wrap @ flown.end[: problem.dimension] - problem.reference
        back[-1] -= problem.advance(self.p)[0]
        gap = float(problem.phase @ back)
        return np.array([gap]), np.array([[at.flight.gradient[0] @ flown.rate]])
