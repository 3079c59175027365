"""Bordered equations of an orbit with many legs, solved from leg to leg.

Durations are eliminated first, then all starts but the first; what is left is a system of the first
start and the parameters, n^3 operations for each leg. Turning points need no special care: the border
takes part in the small system.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model import Array
from .boundary import BoundaryProblem


@dataclass(frozen=True, eq=False)
class Small:
    """What elimination leaves of bordered equations.

    Attributes
    ----------
    matrix, right : ndarray (n + k, n + k), (n + k,)
        Equations of the first start and the k parameters.
    starts, durations : list of (ndarray, ndarray), list of (ndarray, float)
        Of each leg as affine functions of these.
    pivots : float
        Product of the pivots of the durations, of rows of length 1.
    """

    matrix: Array
    right: Array
    starts: list[tuple[Array, Array]]
    durations: list[tuple[Array, float]]
    pivots: float

    def determinant(self) -> float:
        """Of all equations, up to a factor that keeps its sign."""
        return float(np.linalg.det(self.matrix)) * self.pivots

    def solution(self) -> Array:
        """All unknowns.

        Raises
        ------
        numpy.linalg.LinAlgError
        """
        few = np.linalg.solve(self.matrix, self.right)
        n = self.starts[0][0].shape[0]
        rows = [a @ few + c for a, c in self.starts]
        times = [float(b @ few + d) for b, d in self.durations]
        return np.concatenate([*rows, times, few[n:]])


def applies(problem: BoundaryProblem) -> bool:
    """Whether every leg has an event that determines its duration, and nothing else is demanded."""
    return not problem.kept and all(leg.name for leg in problem.legs)


def eliminated(problem: BoundaryProblem, matrix: Array, right: Array) -> Small:
    """Reduce equations (m + k, m + k): those of an orbit, then k rows of a border.

    Columns and rows may be scaled.

    Raises
    ------
    numpy.linalg.LinAlgError
        An event is grazed to all digits.
    """
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
