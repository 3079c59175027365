"""One bounce, from touch-down to lift-off."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.equations import equations, forces_function
from ..contact.model import ContactModel
from ..contact.space import Contact3D
from ..errors import EnergyWarning
from .energy import advice, gains
from .landing import check_approach, is_vector, landing_number, require_model, time_limit
from .record import Forces, Record, contact
from .space import Shot3D, Vector, simulate_3d

Array = NDArray[np.float64]


class State(NamedTuple):
    """The ball at one instant.

    Attributes
    ----------
    xdot, ydot : float
        Velocity of the centre, along and normal to the ground.
    omega : float
        Spin, in units in which the contact point moves at ``xdot + omega``.
    x, y : float
        Position of the centre; ``y`` is 0 at touch-down.
    """

    xdot: float
    ydot: float
    omega: float
    x: float = 0.0
    y: float = 0.0

    @property
    def slip(self) -> float:
        """Speed of the contact point, ``xdot + omega``."""
        return self.xdot + self.omega


@dataclass(frozen=True, repr=False)
class Shot(Record[ContactModel, State]):
    """A bounce that lifted off.

    Attributes
    ----------
    model : ContactModel
        The surface, with its friction.
    landing, lift_off : State
        The ball at touch-down and at lift-off.
    time : float
        Duration of the bounce, in the model's unit.
    trajectory : nonsmooth.Trajectory
        The contact; its states are ``x, xdot, y, ydot, omega`` and the extra ones.
    approach : nonsmooth.Trajectory or None
        The frictionless phase before it, where the load was not positive yet.
    tol : float
        Tolerance of the computation.
    """

    @property
    def slip(self) -> float:
        """Slip ``xdot + omega`` at lift-off; below zero is reverse slip."""
        return self.lift_off.slip

    @property
    def restitution(self) -> float:
        """Normal speed at lift-off over that at touch-down."""
        return -self.lift_off.ydot / self.landing.ydot

    def forces(self, t: ArrayLike) -> Forces:
        """Load and friction force along the bounce.

        Parameters
        ----------
        t : array_like (...)
            Times since touch-down.

        Returns
        -------
        Forces
            Load $Lambda_N$ and friction $Lambda_T$, arrays (...); both zero at lift-off.
        """
        times = np.asarray(t, dtype=float)
        function = forces_function(self.model.blueprint())
        load, forward, reverse, rolling = self._evaluate(function, times)
        mode = self.mode(times)
        friction = np.select([mode == "+", mode == "-", mode == "s"], [forward, reverse, rolling])
        ended = times >= self.time
        return Forces(np.where(ended, 0.0, load), np.where(ended, 0.0, friction))

    def __repr__(self) -> str:
        end = self.lift_off
        return (
            f"Shot({self.itinerary!r}, lift-off at t = {self.time:.6g}: xdot = {end.xdot:.6g}, "
            f"ydot = {end.ydot:.6g}, omega = {end.omega:.6g}, slip = {self.slip:.6g})"
        )


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
) -> Shot: ...


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
) -> Shot3D: ...


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
) -> Shot | Shot3D:
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
    Shot or Shot3D
        The bounce: phases, forces, and the state at lift-off.

    Raises
    ------
    LandingError
        A number that is not finite, a ball above the ground or moving away from it, a pair beside
        a number.
    LiftOffError
        No lift-off before ``t_max``, or a future that is not unique.

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
    Shot3D('* s *', lift-off at t = 2.95631: ...
    """
    if isinstance(model, Contact3D) or any(map(is_vector, (xdot, omega, x))):
        return simulate_3d(model, xdot, ydot, omega, x, y, tol=tol, t_max=t_max)
    require_model(model)
    given = dict(xdot=xdot, ydot=ydot, omega=omega, x=x, y=y)
    landing = State(**{name: landing_number(value, name) for name, value in given.items()})
    check_approach(landing.y, landing.ydot)
    limit = time_limit(t_max)
    blueprint = model.blueprint()
    further = equations(blueprint).start.values()
    x0 = [landing.x, landing.xdot, landing.y, landing.ydot, landing.omega, *further]
    before, run = contact(blueprint, model.values, x0, tol, limit)
    end = dict(zip(run.system.state_names, run.x[-1].tolist(), strict=True))
    lift_off = State(**{name: end[name] for name in State._fields})
    if landing.y == 0.0 and lift_off.ydot > -landing.ydot:
        p = np.array(list(model.values.values()))[:, None]
        if gains(blueprint, np.array(x0)[:, None], run.x[-1][:, None], p, tol)[0]:
            warnings.warn(advice(model, 1, 1), EnergyWarning, stacklevel=2)
    return Shot(model, landing, lift_off, float(run.t[-1]), run, before, tol)
