"""The equations of periodic orbits with free parameters, as a curve: what is solved, and how."""

from __future__ import annotations

import numpy as np

from ..flow.compiled.shooting import bordered_direction
from ..flow.fixed import has_interpreter
from ..model import Array
from .boundary import BoundaryProblem, Evaluation
from .branch_curves import BranchCurve
from .conditions import Condition
from .demands import demands_of
from .elimination import applies, eliminated

#: Equations of more unknowns are solved from leg to leg.
_MANY = 24

#: Steps below this that do not shrink are rounding: near a branch point it is magnified.
_NOISE = 1e-8

#: Newton's method in one call: steps of it, along a leg, and unknowns. Others are left to what hears an interrupt.
_MOST, _MOST_STEPS, _UNKNOWNS = 10, 1000, 100


class OrbitEquations(BranchCurve):
    """Periodic orbits of one itinerary in the unknowns (starts, durations, parameters).

    Parameters
    ----------
    problem : BoundaryProblem
    p : ndarray
        All parameters.
    free : tuple of int
        Those that vary.
    scale : ndarray
    longest : float
        Where the period counts as divergent.
    """

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
            self._keep(key, self.problem.evaluate(unknowns, p, self.free))
        return self._found[key]

    def _keep(self, key: bytes, at: Evaluation) -> None:
        self._found.pop(self._last, None)
        self._found[key], self._last = at, key

    def equations(self, u: Array) -> tuple[Array, Array]:
        at = self.evaluation(u)
        return at.residual, at.whole

    def correct(self, guess: Array, across: Array, *, max_iterations: int = _MOST) -> Array | None:
        """As of any curve; in one call where that can be, which leaves the equations at the point too."""
        problem = self.problem
        if problem.is_direct and len(self.free) == 1 and guess.size <= _UNKNOWNS:
            wrap = None if problem.symmetry is None else problem.wrap
            demands = demands_of(
                problem.forcing,
                problem.periods,
                tol=self.tol,
                noise=_NOISE,
                most=_MOST,
                most_steps=_MOST_STEPS,
            )
            flights = problem.flights(self.free)
            found = flights.corrected(guess, self.p, self.scale, wrap, across, demands)
            if found is not None:
                u = found[0].unknowns
                self._keep(u.tobytes(), problem.evaluation(*found))
                return u
        return super().correct(guess, across, max_iterations=max_iterations)

    def solve(self, matrix: Array, right: Array) -> Array:
        if not self._many:
            return super().solve(matrix, right)
        return eliminated(self.problem, matrix, right).solution()

    def along(self, jacobian: Array, before: Array) -> tuple[Array, float]:
        if self._many or not has_interpreter():
            return super().along(jacobian, before)
        found = bordered_direction(jacobian, before)
        if found is None:
            raise np.linalg.LinAlgError("the equations are singular: a branch point")
        return found

    def determinant(self, matrix: Array) -> float:
        if not self._many:
            return super().determinant(matrix)
        return eliminated(self.problem, matrix, np.zeros(len(matrix))).determinant()
