"""The verb ``continue_orbit``: a periodic orbit, or the branch that crosses at an event, followed."""

from __future__ import annotations

import numpy as np

from ...local.checks import parameter_index
from ...model import Array, DefinitionError, explain, whole
from ...model.checks import positive
from ...solvers.continuation import Departure
from ..periodic.orbit import PeriodicOrbit
from .branch import Branch, BranchEvent
from .branch_curves import check_bounds, follow_branch
from .orbit_branches import OrbitCurve
from .switching_branches import switched

#: An orbit this many times as long as the first one is near a homoclinic orbit.
_LONG = 10.0


def continue_orbit(
    orbit: PeriodicOrbit | BranchEvent,
    parameter: str,
    *,
    bounds: tuple[float, float],
    step: float = 0.05,
    max_points: int = 1000,
    through: bool = True,
    progress: bool = False,
) -> Branch:
    """Follow a periodic orbit as a parameter varies.

    Pseudo-arclength continuation both ways to the bounds, with multipliers at each point. The
    itinerary is kept as long as it holds; what ends it is located in the itinerary with fewer legs,
    where it is regular, and named.

    Parameters
    ----------
    orbit : PeriodicOrbit or BranchEvent
        Where to start; at a period doubling, pitchfork or branch point the other branch is followed
        (from a period doubling one way only: the other half has the same orbits, a round later), at a
        Hopf point of equilibria the orbits around it.
    parameter : str
        Name of the parameter that varies.
    bounds : (float, float)
        Where the branch ends.
    step : float, optional
        Largest step where the branch bends, relative to the width of the bounds and to the size of
        the orbit.
    max_points : int, optional
        Of each piece.
    through : bool, optional
        Whether to edit the itinerary and go on beyond what changes it.
    progress : bool, optional
        Whether to show a bar that counts points. An interrupt (Ctrl-C) returns what was computed.

    Returns
    -------
    Branch
        Its ``solutions`` (or ``orbits``) are PeriodicOrbits. Events: ``"fold"``, ``"period
        doubling"``, ``"Neimark-Sacker"``, ``"pitchfork"`` (of symmetric orbits), ``"branch
        point"``, ``"grazing-sliding"``, ``"crossing-sliding"``, ``"switching-sliding"``,
        ``"adding-sliding"``, ``"impact grazing"``, ``"grazing, escaping"``, ``"corner"``,
        ``"two-fold"``; ``"Hopf"`` where orbits without events shrink to an equilibrium,
        ``"boundary equilibrium"`` (with its class) or ``"two-fold"`` where others shrink to a point of a
        surface.

    Raises
    ------
    ConvergenceError
        The orbit at the start does not solve its equations, or a branch cannot be entered.
    DefinitionError
        Neither an orbit nor an event from which orbits start; a parameter that the system does not have.
    OptionError
        Bounds in the wrong order, or without the start; ``step`` or ``max_points`` out of its range; a
        parameter that breaks the symmetry by which half of the orbit is solved for.

    Examples
    --------
    A relay that is forced, $x' = A cos t - sgn x$: crossing orbits end to cross at
    $A = sqrt(1 + pi^2/4)$, below which they slide.

    >>> import casadi as ca, nonsmooth as ns
    >>> x, t, a = (ca.SX.sym(s) for s in ("x", "t", "a"))
    >>> relay = ns.FilippovSystem([x], surface=x, time=t, parameters={a: 2.5},
    ...                           above=[a * ca.cos(t) - 1], below=[a * ca.cos(t) + 1])
    >>> orbit = ns.periodic_orbit(relay, [0.5])
    >>> branch = ns.continue_orbit(orbit, "a", bounds=(1.5, 3.0))
    >>> [(e.kind, round(e.parameter, 12)) for e in branch.events]
    [('crossing-sliding', 1.862095889119)]
    """
    positive(step, "step")
    whole(max_points, "max_points", least=2)
    curve, rows = _begin(orbit, parameter)
    start = rows[-1]
    low, high = check_bounds(bounds, float(start[-1]), parameter)
    curve.widths = np.array([high - low])
    curve.scale = np.append(curve.scale[:-1], high - low)
    away = Departure(curve, rows, (start - rows[0]) / curve.scale) if len(rows) > 1 else None
    return follow_branch(
        curve,
        start,
        name=parameter,
        bounds=(low, high),
        step=step,
        max_points=max_points,
        through=through,
        progress=progress,
        away=away,
    )


def _begin(orbit: PeriodicOrbit | BranchEvent, parameter: str) -> tuple[OrbitCurve, list[Array]]:
    """The curve and its first point; at a period doubling that one before."""
    if not isinstance(orbit, (PeriodicOrbit, BranchEvent)):
        raise DefinitionError(
            explain(
                "orbit",
                expected="a PeriodicOrbit or an event of a branch of them",
                received=repr(orbit),
                advice="periodic_orbit(system, guess) finds one.",
            )
        )
    system = orbit.system if isinstance(orbit, PeriodicOrbit) else orbit.curve.system
    free = (parameter_index(system, parameter),)
    if isinstance(orbit, BranchEvent):
        return switched(orbit, free)
    p, u = orbit.parameter_vector, orbit.unknowns
    longest = _LONG * float(orbit.evaluation.durations.sum())
    curve = OrbitCurve(orbit.problem, p, free, np.ones(1), u, longest)
    return curve, [np.append(u, p[list(free)])]
