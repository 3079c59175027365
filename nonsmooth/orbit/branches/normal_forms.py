"""Coefficients of normal forms at Hopf, period-doubling, pitchfork and Neimark-Sacker points.

On the eigenvector q of the multiplier that is on the unit circle (or of the eigenvalue on the imaginary axis)
the dynamics is, to third order, decided by one number, from second and third derivatives B, C of the map or
field whose derivative is A (Kuznetsov 2004, sections 3.5, 5.4 and 10.2; p is the left eigenvector, p.q = 1):

    flip            x -> -x + c x^3     c = p.[C(q,q,q) + 3 B(q, (1-A)^-1 B(q,q))]/6
    Neimark-Sacker  a = Re e^(-i theta) p.[C(q,q,q*) + 2 B(q, (1-A)^-1 B(q,q*))
                                           + B(q*, (e^(2 i theta)-A)^-1 B(q,q))]/2
    Hopf            l1 = Re p.[C(q,q,q*) - 2 B(q, A^-1 B(q,q*)) + B(q*, (2 i w-A)^-1 B(q,q))]/(2 w)

The new branch is stable in these directions (supercritical) where c > 0, a < 0, l1 < 0. Only the matrices
B(q, .) and C(q, q*, .) are needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem, NonsmoothError
from ...model.derivatives.mode_derivatives import field_expansion
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation
from ..periodic.multipliers import return_map

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Expansion:
    """Derivatives of a map or field at a fixed point, along one eigenvector."""

    a: Array
    q: Complex
    p: Complex
    second: Complex
    third: Complex


def eigenvectors(a: Array, value: complex) -> tuple[Complex, Complex]:
    """Right and left eigenvectors of the eigenvalue next to a value, |q| = 1 and p.q = 1."""

    def of(matrix: Array) -> Complex:
        values, vectors = np.linalg.eig(matrix)
        return np.asarray(vectors[:, int(np.argmin(np.abs(values - value)))], complex)

    q, p = of(a), of(a.T)
    q = q / np.linalg.norm(q)
    return q, p / (p @ q)


def flip_coefficient(at: Expansion) -> float:
    """The number c of a map whose derivative has the eigenvalue -1."""
    h = np.linalg.solve(np.eye(len(at.a)) - at.a, at.second @ at.q)
    return float((at.p @ (at.third @ at.q + 3.0 * at.second @ h)).real / 6.0)


def torus_coefficient(at: Expansion, turn: complex) -> float:
    """The number a of a map whose derivative has the eigenvalue ``turn`` on the unit circle."""
    one = np.eye(len(at.a))
    still = np.linalg.solve(one - at.a, at.second @ at.q.conj())
    double = np.linalg.solve(turn**2 * one - at.a, at.second @ at.q)
    inner = at.third @ at.q + 2.0 * at.second @ still + at.second.conj() @ double
    return float((at.p @ inner / turn).real / 2.0)


def hopf_coefficient(
    system: FilippovSystem, mode: str, x: Array, p: Array, frequency: float
) -> float:
    """The first Lyapunov coefficient l1 of an equilibrium of one mode, which may slide."""
    forms = field_expansion(system, mode)
    a = forms.copied(np.append(x, np.zeros(x.size)), p)[0]
    q, left = eigenvectors(a, 1j * frequency)
    _, *real, gradient, bend = forms.copied(np.append(x, q.real), p)
    _, *imaginary, _, _ = forms.copied(np.append(x, q.imag), p)
    third = (real[1] + imaginary[1]).astype(complex)
    at = Expansion(a, q, left, real[0] + 1j * imaginary[0], third)
    matrix, right = a.astype(complex), -(at.second @ q.conj())
    if "s" in mode:  # a sliding field keeps h: its part across the surface follows the curvature
        matrix = np.vstack([matrix, gradient.reshape(1, -1)])
        right = np.append(right, -(q @ bend @ q.conj()))
    still = np.linalg.lstsq(matrix, right, rcond=None)[0]
    double = np.linalg.solve(2j * frequency * np.eye(len(a)) - a, at.second @ q)
    inner = at.third @ q + 2.0 * at.second @ still + at.second.conj() @ double
    return float((left @ inner).real / (2.0 * frequency))


# Return maps --------------------------------------------------------------------------------------

#: Steps of differences, relative to the orbit; the first that agrees with the last one is used.
_STEPS = (4e-3, 2e-3, 5e-4, 1.25e-4, 3e-5, 8e-6, 2e-6, 5e-7, 1.25e-7)

#: Relative difference at which two steps agree.
_AGREE = 1e-5

#: Newton's method for the return from a start beside the orbit.
_ITERATIONS, _TOLERANCE = 12, 1e-13


def normal_form(
    problem: BoundaryProblem, at: Evaluation, p: Array, kind: str
) -> Mapping[str, float]:
    """The coefficient c of a period doubling or pitchfork, or a of a Neimark-Sacker point, and its error."""
    # In unscaled states (and time), for an eigenvector of length one at the start of the first leg.
    n = problem.dimension
    units = problem.scales(problem.pack(at.starts, at.durations), p)[:n]
    a = return_map(problem, at) * (units / units[:, None])
    value, name = -1.0 + 0j, "cubic coefficient"
    if kind == "Neimark-Sacker":
        values = np.linalg.eigvals(a)
        one = values[torus_pair(values)[0]]
        value, name = one / abs(one), "first Lyapunov coefficient"
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
        if abs(now - before) < best[1]:  # of fourth order: the shorter one is far better
            best = now, abs(now - before)
        if best[1] < _AGREE * abs(now):
            break
        before = now
    if not np.isfinite(best[1]):
        return {}
    length = float(np.linalg.norm(units * q)) ** 2
    return {name: best[0] / length, "its error": best[1] / length}


def torus_pair(values: NDArray[Any]) -> list[int]:
    """Indices of the two multipliers whose product is nearest to one."""
    k, l = np.triu_indices(values.size, 1)
    near = int(np.argmin(np.abs(values[k] * values[l] - 1.0)))
    return [int(k[near]), int(l[near])]


class _Around:
    """Differences of the derivative of the return map beside an orbit."""

    def __init__(
        self, problem: BoundaryProblem, at: Evaluation, p: Array, units: Array, size: float
    ):
        self.problem, self.p, self.units, self.size = problem.whole, p, units, size
        self.start = problem.pack(at.starts, at.durations)
        self.sizes = problem.whole.scales(self.start, p)
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
        """The condition, for an orbit without events, of its return to its plane, and the derivative."""
        problem, flow = self.problem, at.by_leg[0]
        assert problem.phase is not None and problem.reference is not None
        back = problem.wrap @ flow.end[: problem.dimension] - problem.reference
        back[-1] -= problem.advance(self.p)[0]
        gap = float(problem.phase @ back)
        return np.array([gap]), np.array([[at.flows.gradient[0] @ flow.rate]])
