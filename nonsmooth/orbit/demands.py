"""What is asked of Newton's method where the equations of a whole orbit are solved in one call."""

from __future__ import annotations

from ..flow.compiled.shooting import Demands
from ..flow.fixed import MOST_STEPS, TOLERANCE, values_program
from ..model.forcing import Forcing
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
NOISE = 1e-11


def demands_of(
    forcing: Forcing | None,
    periods: float,
    *,
    tol: float = CLOSE,
    noise: float = NOISE,
    longest: float = 0.0,
    most: int = 1,
    most_steps: int = MOST_STEPS,
) -> Demands:
    """Demands on an orbit.

    Parameters
    ----------
    forcing : Forcing or None
    periods : float
        Of the forcing, by which the legs advance the time.
    tol, noise : float, optional
    longest : float, optional
        No leg may last longer.
    most, most_steps : int, optional
        Steps of Newton's method, and along a leg.
    """
    period = None if forcing is None else values_program(forcing).pointer
    local = (TOLERANCE, COARSE, EXTENDED, FINAL, ROUNDING)
    return Demands(tol, noise, *local, longest, periods, period, most, most_steps)
