"""Simulation of one bounce, from touch-down to lift-off."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import Blueprint, contact_system, equations
from ..contact.model import Contact3D, ContactModel
from ..errors import EnergyWarning, LiftOffError
from .energy import advice, gains
from .shot import Shot
from .state import (
    check_approach,
    is_vector,
    landing_number,
    landings,
    require_model,
    state_of,
    time_limit,
)
from .touch_down import approach, no_lift_off, rests

Array = NDArray[np.float64]
Vector = Sequence[float] | Array


@overload
def simulate(
    model: ContactModel,
    xdot: float,
    ydot: float,
    omega: float,
    x: float = 0.0,
    y: float = 0.0,
    *,
    tol: float = 1e-10,
    t_max: float = 100.0,
) -> Shot[ContactModel, float]: ...


@overload
def simulate(
    model: ContactModel | Contact3D,
    xdot: Vector,
    ydot: float,
    omega: Vector,
    x: float | Vector = 0.0,
    y: float = 0.0,
    *,
    tol: float = 1e-10,
    t_max: float = 100.0,
) -> Shot[Contact3D, Array]: ...


def simulate(
    model: ContactModel | Contact3D,
    xdot: Any,
    ydot: float,
    omega: Any,
    x: Any = 0.0,
    y: float = 0.0,
    *,
    tol: float = 1e-10,
    t_max: float = 100.0,
) -> Shot[Any, Any]:
    """Bounce a ball once: from touch-down to the first downward zero of the load.

    Where the load is not positive just after touch-down (``load="net"`` with little damping) there
    is no friction until it is: a phase ``F``.

    Parameters
    ----------
    model : ContactModel or Contact3D
        The surface, with its friction.
    xdot, ydot, omega : float
        Speeds along and normal to the ground and spin at touch-down. ``ydot < 0``, unless the ball
        starts in the ground. In 3-D ``xdot`` and ``omega`` are pairs, forward and to the right:
        ``omega``, $(omega_z, -omega_x)$, is the contact point's velocity due to spin. With drilling
        friction a third number of ``omega`` is the spin $omega_y$ about the vertical.
    x, y : float, optional
        Position of the centre, ``x`` a pair in 3-D; ``y < 0`` is a start in the middle of a contact,
        with any ``ydot``.
    tol : float, optional
        Relative and absolute tolerance.
    t_max : float, optional
        Longest time before lift-off; a linear bounce takes about $pi$.

    Returns
    -------
    Shot
        The bounce: phases, forces, and the state at lift-off.

    Raises
    ------
    LandingError
        A number that is not finite, a ball above the ground or moving away from it, a pair beside
        a number.
    LiftOffError
        No lift-off before ``t_max``, or a continuation that is not unique.

    Warns
    -----
    EnergyWarning
        The ball leaves faster than it came, because the surface did work on it.

    Examples
    --------
    >>> import bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    >>> shot = bounce.simulate(turf, xdot=0.2, ydot=-1.0, omega=1.0)
    >>> shot.itinerary
    '+ s +'
    >>> [f"{v:.6f}" for v in (shot.time, shot.slip, shot.lift_off.ydot)]
    ['2.956310', '0.001762', '0.744065']

    With side spin the ball leaves to the right or the left, and its slip turns:

    >>> shot = bounce.simulate(turf, xdot=[1.0, 0.0], ydot=-1.0, omega=[0.2, 0.1])
    >>> shot
    Shot('* s *', lift-off at t = 2.95631: ...
    """
    if not isinstance(model, Contact3D):
        require_model(model)
        if any(map(is_vector, (xdot, omega, x))):
            model = model.in_3d()
    given = dict(xdot=xdot, ydot=ydot, omega=omega, x=x, y=y)
    landing = landings(model, given, landing_number)
    check_approach(landing["y"], landing["ydot"])
    limit = time_limit(t_max)
    blueprint = model.blueprint()
    eq = equations(blueprint)
    x0 = np.array([{**landing, **eq.start}[name] for name in eq.names])
    before, run = _contact(blueprint, model.values, x0, tol, limit)
    start, end = state_of(eq, x0), state_of(eq, run.x[-1])
    if start.y == 0.0 and end.ydot > -start.ydot:
        p = np.array(list(model.values.values()))[:, None]
        if gains(blueprint, x0[:, None], run.x[-1][:, None], p, tol)[0]:
            warnings.warn(advice(model, 1, 1), EnergyWarning, stacklevel=2)
    return Shot(model, start, end, float(run.t[-1]), run, before, tol)


def _contact(
    blueprint: Blueprint, values: dict[str, float], x0: Array, tol: float, limit: float
) -> tuple[ns.Trajectory | None, ns.Trajectory]:
    """The phase without friction, if the load is not positive at once, and the contact to lift-off."""
    before, t_start, start = approach(blueprint, values, x0.tolist(), tol, limit)
    options: dict[str, Any] = dict(t_start=t_start, parameters=values, tol=tol)
    run = _with_friction(blueprint, before is not None, start, limit, options)
    _require_lift_off(run, x0, limit)
    return before, run


def _require_lift_off(run: ns.Trajectory, start: Array, limit: float) -> None:
    """Refuse a contact that did not end, or that ended with the ball at rest."""
    if run.status is not ns.Status.STOPPED:
        raise LiftOffError(no_lift_off(run, limit), run)
    if rests(run.x[-1], start):
        raise LiftOffError(
            f"The ball has come to rest in the ground at y = {run.x[-1, 2]:.6g} and does not lift off. It "
            "lands too slowly, or the surface damps too much.",
            run,
        )


def _with_friction(
    blueprint: Blueprint, fell: bool, start: list[float], limit: float, options: dict[str, Any]
) -> ns.Trajectory:
    """The contact with friction, to lift-off."""
    # After a frictionless phase the load has just become positive. A ball at H = 0 then rolls, also
    # where rounding in a steep load hides its sign.
    system = contact_system(blueprint)
    run = ns.simulate(system, start, limit, **options)
    undecided = run.status is ns.Status.NON_UNIQUE and run.t[-1] == options["t_start"]
    if fell and undecided:
        run = ns.simulate(system, start, limit, start_mode="s", **options)
    return run
