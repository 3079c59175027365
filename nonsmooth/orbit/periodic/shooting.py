"""Newton's method on a whole orbit in one call, where every leg ends by one event.

It does what ``find_periodic`` does step by step for orbits of every kind: full steps with exact
derivatives, the last of them with residuals in extended precision. What does not converge so is left to
that, which can say why.
"""

from __future__ import annotations

from ...model import Array
from .boundary_value_problem import BoundaryProblem, Evaluation, demands_of

#: Legs of more steps than this are left to what hears an interrupt between them.
_MOST_STEPS = 1000


def shot(
    problem: BoundaryProblem, u: Array, p: Array, longest: float, most: int
) -> tuple[Array, Evaluation, int] | None:
    """The orbit near some unknowns, to rounding."""
    if problem.phase is not None or problem.kept:
        return None
    forcing, periods = problem.forcing, problem.periods
    demands = demands_of(forcing, periods, longest=longest, most=most, most_steps=_MOST_STEPS)
    wrap = None if problem.symmetry is None else problem.wrap
    found = problem.flights().newton(u, p, problem.scales(u), wrap, demands)
    if found is None:
        return None
    solved, flight = found
    u = solved.unknowns
    return u, Evaluation(solved.residual, solved.jacobian, flight, *problem.split(u)), solved.steps
