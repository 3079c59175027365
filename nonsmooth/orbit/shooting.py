"""Newton's method on a whole orbit in one call, where every leg ends by one event.

It does what ``find_periodic`` does step by step for orbits of every kind: full steps with exact
derivatives, the last of them with residuals in extended precision. What does not converge so is left to
that, which can say why.
"""

from __future__ import annotations

import numpy as np

from ..flow.compiled.shooting import Demands
from ..flow.fixed import TOLERANCE
from ..model import Array
from .boundary import BoundaryProblem, Evaluation
from .flight import EXTENDED

#: Newton's method ends when the next step would be below this, relative to the orbit.
CLOSE = 1e-10

#: Steps below this, relative to the orbit, are rounding.
ROUNDING = 1e-14

#: Legs far from the orbit are flown with local errors up to this.
COARSE = 1e-8

#: Steps below this, relative to the orbit, change its derivatives by rounding.
FINAL = 1e-13

#: Steps below this that do not shrink are rounding of the equations.
_NOISE = 1e-11

#: Legs of more steps than this are left to what hears an interrupt between them.
_MOST_STEPS = 1000


def shot(
    problem: BoundaryProblem, u: Array, p: Array, longest: float, most: int
) -> tuple[Array, Evaluation, int] | None:
    """The orbit near some unknowns, to rounding.

    Parameters
    ----------
    problem : BoundaryProblem
    u : ndarray (m,)
        A guess.
    p : ndarray
        All parameters.
    longest : float
        No leg may last longer.
    most : int
        Steps.

    Returns
    -------
    unknowns, evaluation, steps
        None where Newton's method does not converge, and for equations of other kinds: legs without
        an event, events at one instant, orbits that slide all the time on one surface.
    """
    if problem.phase is not None or problem.kept:
        return None
    demands = Demands(
        CLOSE,
        _NOISE,
        TOLERANCE,
        COARSE,
        EXTENDED,
        FINAL,
        ROUNDING,
        longest,
        problem.advance(p)[0],
        most,
        _MOST_STEPS,
    )
    wrap = None if problem.symmetry is None else problem.wrap
    found = problem.flights().newton(u, p, problem.scales(u), wrap, demands)
    if found is None:
        return None
    solved, flight = found
    u, no_columns = solved.unknowns, np.zeros((problem.size, 0))
    at = Evaluation(solved.residual, solved.jacobian, no_columns, flight, *problem.split(u))
    return u, at, solved.steps
