"""The saltation matrix of one event at a given point."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...model import (
    Array,
    DefinitionError,
    FilippovSystem,
    Parameters,
    PointError,
    require_system,
)
from ...model.derivatives.event_maps import AtEvent, surface_map
from .guards import begin_violation, change_violation
from .itinerary import leg_between
from .legs import Leg, rate_at
from .saltation import saltation

#: Distance of a point from an event, relative to the largest state, within which it is on it.
_NEAR = 1e-9


def saltation_matrix(
    system: FilippovSystem,
    before: str,
    after: str,
    point: ArrayLike,
    *,
    event: str = "",
    t: float = 0.0,
    parameters: Parameters | None = None,
) -> Array:
    """The saltation matrix of one event: how perturbations of an orbit pass it.

    Parameters
    ----------
    system : FilippovSystem
        The system.
    before, after : str
        Modes before and after the event.
    point : array_like (n,)
        State at the event, before a reset.
    event : str, optional
        Name of the event (``"h0"``, a reset, an impact), where the modes do not determine it.
    t : float, optional
        Time, where the system depends on it.
    parameters : mapping, optional
        Values of parameters; default the system's.

    Returns
    -------
    ndarray (n, n)
        It maps small perturbations of the state before the event to those after it.

    Raises
    ------
    DegenerateError
        The orbit grazes the surface.
    OptionError
        The modes do not determine the event, or none of that name leads from one to the other.
    DefinitionError
        ``system`` is not a FilippovSystem, or has vector multipliers; modes that it does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    PointError
        A point of a wrong shape, not finite, or off the event, or at which the event does not lead from
        the one mode to the other.

    Notes
    -----
    $S = g_x + (f+ - g_x f-) e_x/(e_x f-)$, time included (Leine & Nijmeijer 2004, ch. 7).

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[1, -2], below=[3, -1])
    >>> ns.orbit.saltation_matrix(system, "+", "-", [0.0, 0.0])
    array([[ 1. , -1. ],
           [ 0. ,  0.5]])
    """
    require_system(system, sets=True, complementarity=True)
    if system.sets:
        raise DefinitionError(
            f"system: {system!r} has vector multipliers, of whose events a point does not determine the matrix: a motion "
            "enters a set at a direction of its own. sensitivity(run).dx_dx0 of a run through the event has it, and "
            "PeriodicOrbit.monodromy over a period."
        )
    p, x = system.parameter_vector(parameters), system.extended_point(point, t)
    for mode in (before, after):
        system.parse_letters(mode)  # raises for an invalid mode
    leg = leg_between(system, before, after, event)
    name = leg.name(system)
    at, n = leg.at_event(system, x, p), system.dimension
    _require_near(system, leg, at, x, p)
    rates = rate_at(system, leg, x, p), rate_at(system, Leg(after), at.after, p)
    matrix = saltation(at, *rates, f"{name!r} at {x[:n].tolist()}").matrix
    violation = ""
    if leg.kind != "reset":  # a reset may lead from any mode to any other
        violation = begin_violation(system, leg, x, p)
        violation = violation or change_violation(system, leg, after, x, at.after, p)
    if violation:
        raise PointError(
            f"point {x[:n].tolist()}: {name!r} does not lead from mode {before!r} to {after!r} there, "
            f"as {violation}. Change the point or the modes."
        )
    return np.asarray(matrix[:n, :n])


def _require_near(system: FilippovSystem, leg: Leg, at: AtEvent, x: Array, p: Array) -> None:
    """Raise for a point (N,) off the event, or off a surface on which the leg slides."""
    signs = system.parse_letters(leg.mode)[: system.surface_count]
    own = leg.name(system)
    zeros: list[tuple[str, Any]] = [(own if leg.kind == "exit" else f"{own} = 0", at)]
    zeros += [(f"h{i} = 0", surface_map(system, i)(x, p)) for i, s in enumerate(signs) if not s]
    for name, zero in zeros:
        size = float(np.abs(x).max()) + 1e-3
        allowed = _NEAR * size * float(np.linalg.norm(zero.gradient))
        if not abs(zero.value) <= allowed:
            raise PointError(
                f"point {x[: system.dimension].tolist()} is not where {own!r} happens in mode {leg.mode!r}: "
                f"{name} is violated by {zero.value:.6g}. Take event.x of a run with a small tol, or solve "
                "for it."
            )
