"""The equations of periodic orbits with free parameters, as a curve: what is solved, and how."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import Array
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation
from .branch_curves import BranchCurve
from .conditions import Condition

# Bordered equations of an orbit with many legs, solved from leg to leg.


@dataclass(frozen=True, eq=False)
class Small:
    """What elimination leaves of bordered equations."""

    matrix: Array
    right: Array
    starts: list[tuple[Array, Array]]
    durations: list[tuple[Array, float]]
    pivots: float

    def determinant(self) -> float:
        """Of all equations, up to a factor that keeps its sign."""
        return float(np.linalg.det(self.matrix)) * self.pivots

    def solution(self) -> Array:
        """All unknowns."""
        few = np.linalg.solve(self.matrix, self.right)
        n = self.starts[0][0].shape[0]
        rows = [a @ few + c for a, c in self.starts]
        times = [float(b @ few + d) for b, d in self.durations]
        return np.concatenate([*rows, times, few[n:]])


def applies(problem: BoundaryProblem) -> bool:
    """Whether every leg has an event that determines its duration, and nothing else is demanded."""
    return not problem.kept and all(leg.name for leg in problem.legs)


def eliminated(problem: BoundaryProblem, matrix: Array, right: Array) -> Small:
    """Reduce equations (m + k, m + k): those of an orbit, then k rows of a border."""
    # Columns and rows may be scaled.
    count, n, m = len(problem.legs), problem.dimension, problem.size
    k = len(matrix) - m
    few = n + k
    a, c = np.eye(n, few), np.zeros(n)
    starts, durations = list[tuple[Array, Array]](), list[tuple[Array, float]]()
    border = np.zeros((k, few))
    border[:, n:] = matrix[m:, m:]
    level = right[m:].copy()
    pivots = 1.0
    small, rest = np.zeros((n, few)), np.zeros(n)
    for i in range(count):
        own, time = slice(i * n, (i + 1) * n), count * n + i
        row = matrix[time]
        if row[time] == 0.0:  # the leg's event is grazed
            raise np.linalg.LinAlgError(f"leg {i + 1}: its event does not determine its duration")
        pivots *= float(row[time] / np.linalg.norm(row))
        b = -(row[own] @ a) / row[time]
        b[n:] -= row[m:] / row[time]
        d = float((right[time] - row[own] @ c) / row[time])
        starts.append((a, c))
        durations.append((b, d))
        border += matrix[m:, own] @ a + np.outer(matrix[m:, time], b)
        level -= matrix[m:, own] @ c + matrix[m:, time] * d
        ahead = matrix[own, own] @ a + np.outer(matrix[own, time], b)
        ahead[:, n:] += matrix[own, m:]
        constant = matrix[own, own] @ c + matrix[own, time] * d - right[own]
        if i + 1 == count:
            small, rest = ahead, -constant
            if count > 1:
                small[:, :n] += matrix[own, :n]
            break
        diagonal = -np.diag(matrix[own, (i + 1) * n : (i + 2) * n])
        a, c = ahead / diagonal[:, None], constant / diagonal
    return Small(np.vstack([small, border]), np.append(rest, level), starts, durations, pivots)


#: Equations of more unknowns are solved from leg to leg.
_MANY = 24


class OrbitEquations(BranchCurve):
    """Periodic orbits of one itinerary in the unknowns (starts, durations, parameters)."""

    def __init__(
        self,
        problem: BoundaryProblem,
        p: Array,
        free: tuple[int, ...],
        widths: Array,
        u: Array,
        longest: float,
    ):
        self.problem, self.p, self.free, self.longest = problem, p, free, longest
        self.begin = np.append(u[: problem.size], p[list(free)])
        self.system, self.widths = problem.system, widths
        self.scale = np.append(problem.scales(u, p), widths)
        self.known: dict[str, Condition] = {}
        self._many = problem.size > _MANY and applies(problem)
        self._found, self._last = dict[bytes, Evaluation](), b""  # of points, and the last untested

    # equations ----------------------------------------------------------------------------------

    def parameters_at(self, u: Array) -> Array:
        p = self.p.copy()
        p[list(self.free)] = u[-len(self.free) :]
        return p

    def freed(self, u: Array, free: tuple[int, ...], widths: Array) -> tuple[BranchCurve, Array]:
        p, unknowns = self.parameters_at(u), u[: self.problem.size]
        curve = type(self)(self.problem, p, free, widths, unknowns, self.longest)
        curve.known = self.known
        return curve, np.append(unknowns, p[list(free)])

    def evaluation(self, u: Array) -> Evaluation:
        """The equations at a point, computed once."""
        key = u.tobytes()
        if key not in self._found:
            p, unknowns = self.parameters_at(u), u[: self.problem.size]
            at = self.problem.evaluate(unknowns, p, self.free)
            self._found.pop(self._last, None)
            self._found[key], self._last = at, key
        return self._found[key]

    def equations(self, u: Array) -> tuple[Array, Array]:
        at = self.evaluation(u)
        return at.residual, at.whole

    def solve(self, matrix: Array, right: Array) -> Array:
        if not self._many:
            return super().solve(matrix, right)
        return eliminated(self.problem, matrix, right).solution()

    def determinant(self, matrix: Array) -> float:
        if not self._many:
            return super().determinant(matrix)
        return eliminated(self.problem, matrix, np.zeros(len(matrix))).determinant()
