"""The verb ``saltation_matrix``: what one event does to neighbours, at a point where it happens."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...model import Array, FilippovSystem, Parameters, PointError, explain, require_system
from ...model.derivatives.event_maps import AtEvent, surface_map
from .guards import begin_fault, change_fault
from .itinerary import leg_between
from .legs import Leg
from .saltation import saltation

#: An event happens at points as near as this, relative to the largest state; as guards are judged.
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
        The one with the event.
    before, after : str
        Modes on the two sides of the event.
    point : array_like (n,)
        Where the event happens, before a reset.
    event : str, optional
        Name of the event (``"h0"``, a reset, an impact), where the letters of the modes do not tell it.
    t : float, optional
        Time, where the system depends on it.
    parameters : mapping, optional
        Values of parameters; default the system's.

    Returns
    -------
    ndarray (n, n)
        It maps small deviations of the state before the event to those after it.

    Raises
    ------
    DegenerateError
        The orbit grazes the surface.
    OptionError
        The modes do not tell the event, or none of that name joins them.
    DefinitionError
        ``system`` is none, or has vector multipliers; modes that it does not have.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    PointError
        A point of a wrong shape or not finite, where the event does not happen, or where it does not lead
        from the one mode to the other.

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
    require_system(system)
    p, x = system.parameter_vector(parameters), system.extended_point(point, t)
    for mode in (before, after):
        system.parse_letters(mode)  # refuses what is no mode
    leg = leg_between(system, before, after, event)
    name = leg.name(system)
    field, following = leg.field(system), Leg(after).field(system)
    y = field.initial(x, p)
    at, size, n = leg.at_end(system, y[:, 0], p), system.extended_dimension, system.dimension
    _require_near(system, leg, at, x, p)
    start = following.states_at(at.after, p)
    rates = field.rate.copied(y[:, 0], p)[0][:, 0], following.rate.copied(start, p)[0][:, 0]
    matrix = saltation(at, rates[0], rates[1][:size], f"{name!r} at {x[:n].tolist()}").matrix
    fault = ""
    if leg.kind != "reset":  # of which both modes are said, on a surface too
        fault = begin_fault(system, leg, y[:, 0], p)
        fault = fault or change_fault(system, leg, after, y[:, 0], at.after, p)
    if fault:
        raise PointError(
            explain(
                "point",
                expected=f"one at which {name!r} leads from mode {before!r} to {after!r}",
                received=f"{x[:n].tolist()}, where it does not: {fault}",
                advice="Change the point, or the modes: a run through it says which they are.",
            )
        )
    return np.asarray((matrix @ y[:, 1 : 1 + size])[:n, :n])


def _require_near(system: FilippovSystem, leg: Leg, at: AtEvent, x: Array, p: Array) -> None:
    """Refuse a point (N,) that is off the event, or off a surface on which the leg slides."""
    signs = system.parse_letters(leg.mode)[: system.surface_count]
    own = leg.name(system)
    zeros: list[tuple[str, Any]] = [(own if leg.kind == "exit" else f"{own} = 0", at)]
    zeros += [(f"h{i} = 0", surface_map(system, i)(x, p)) for i, s in enumerate(signs) if not s]
    for name, zero in zeros:
        size = float(np.abs(x).max()) + 1e-3
        allowed = _NEAR * size * float(np.linalg.norm(zero.gradient))
        if not abs(zero.value) <= allowed:
            raise PointError(
                explain(
                    "point",
                    expected=f"one at which {own!r} happens in mode {leg.mode!r}: {name}",
                    received=f"{x[: system.dimension].tolist()}, where it is {zero.value:.6g}",
                    advice="Take it from a run (event.x; with a smaller tol it is nearer), or solve for it.",
                )
            )
