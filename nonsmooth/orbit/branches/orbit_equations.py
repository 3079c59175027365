"""The equations of periodic orbits with free parameters, as a curve: what is solved, and how."""

from __future__ import annotations

import numpy as np

from ...model import Array
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation, eliminated
from .branch import BranchCurve
from .conditions import Condition


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

    def values(self, u: Array) -> Array | None:
        return self.problem.residual(u[: self.problem.size], self.parameters_at(u))

    def solve(self, matrix: Array, right: Array) -> Array:
        return self.problem.solve(matrix, right)

    def along(self, jacobian: Array, before: Array) -> tuple[Array, float]:
        if not self.problem.has_many:
            return super().along(jacobian, before)
        target = np.zeros(before.size)
        target[-1] = 1.0
        small = eliminated(self.problem, np.vstack([jacobian, before]), target)
        tangent = small.solution()
        length = float(np.linalg.norm(tangent))
        return tangent / length, small.determinant() * length

    def determinant(self, matrix: Array) -> float:
        if not self.problem.has_many:
            return super().determinant(matrix)
        return eliminated(self.problem, matrix, np.zeros(len(matrix))).determinant()
