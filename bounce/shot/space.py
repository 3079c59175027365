"""One bounce in 3-D: slip is a vector, which turns."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.equations import equations
from ..contact.model import ContactModel
from ..contact.space import Contact3D
from ..contact.space_equations import STATES_3D, SpaceEquations
from ..errors import EnergyWarning, LandingError
from ..parameters import number
from .energy import advice, gains
from .landing import check_approach, is_vector, landing_number, require_model, time_limit
from .record import Forces, Phase, Record, contact

Array = NDArray[np.float64]
Vector = Sequence[float] | Array


@dataclass(frozen=True, eq=False)
class State3D:
    """The ball at one instant, or at many: arrays of the shape (...) of the times.

    Attributes
    ----------
    xdot : ndarray (..., 2)
        Velocity of the centre along the ground, forward and to the right.
    ydot : float or ndarray (...)
        Velocity normal to the ground.
    omega : ndarray (..., 2)
        The spin's part of the contact point's velocity, $(omega_z, -omega_x)$; with drilling a third
        component is the spin $omega_y$ about the vertical.
    x : ndarray (..., 2)
        Place of the centre along the ground.
    y : float or ndarray (...)
        Its height, 0 at touch-down.
    slip : ndarray (..., 2)
        Velocity of the contact point, ``xdot + omega``: known to its own relative accuracy, however
        small it is.
    """

    xdot: Array
    ydot: Any
    omega: Array
    x: Array
    y: Any
    slip: Array


@dataclass(frozen=True, repr=False)
class Shot3D(Record[Contact3D, State3D]):
    """A bounce in 3-D that lifted off.

    Attributes
    ----------
    model : Contact3D
        The surface, in 3-D.
    landing, lift_off : State3D
        The ball at touch-down and at lift-off.
    time : float
        Duration of the bounce, in the model's unit.
    trajectory : nonsmooth.Trajectory
        The contact; its states are those of :meth:`Contact3D.system`.
    approach : nonsmooth.Trajectory or None
        The frictionless phase before it, where the load was not positive yet.
    tol : float
        Tolerance of the computation.
    """

    @property
    def slip(self) -> Array:
        """Velocity of the contact point at lift-off, ndarray (2,): forward and to the right."""
        return self.lift_off.slip

    @property
    def slip_speed(self) -> float:
        """Its length."""
        return float(np.hypot(*self.slip))

    @property
    def slip_angle(self) -> float:
        """Direction of the slip at lift-off, rad from forward to the right; 0 without slip."""
        return direction(self.slip)

    @property
    def travel_angle(self) -> float:
        """Direction in which the ball leaves along the ground, rad from forward to the right."""
        return direction(self.lift_off.xdot)

    @property
    def kick(self) -> float:
        """By how much the bounce turns the direction of travel, rad in $(-pi, pi]$, right positive.

        Zero for a ball that comes straight down.
        """
        return _between(self.landing.xdot, self.lift_off.xdot)

    @property
    def turn(self) -> float:
        """By how much the slip's direction differs from that at touch-down, rad in $(-pi, pi]$."""
        return _between(self.landing.slip, self.slip)

    @property
    def reversal(self) -> bool:
        """Whether the slip at lift-off has a component against that at touch-down."""
        return bool(self.landing.slip @ self.slip < 0)

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The phases with their times: ``*`` slips, ``s`` rolls, ``F`` before the load is positive."""
        return tuple(phase._replace(mode=phase.mode or "*") for phase in super().phases)

    @property
    def restitution(self) -> float:
        """Normal speed at lift-off over that at touch-down."""
        return float(-self.lift_off.ydot / self.landing.ydot)

    def state(self, t: ArrayLike) -> State3D:
        """Return the ball at times of the bounce.

        Parameters
        ----------
        t : array_like (...)
            From 0 to ``time``.

        Returns
        -------
        State3D
            Arrays of the shape of ``t``.
        """
        return state_3d(self(t), self.model.drilling)

    def forces(self, t: ArrayLike) -> Forces:
        """Load and friction force along the bounce.

        Parameters
        ----------
        t : array_like (...)
            Times since touch-down.

        Returns
        -------
        Forces
            Load $Lambda_N$ (...) and friction (..., 2); both zero at lift-off.
        """
        times = np.asarray(t, dtype=float)
        states = self(times).reshape(-1, self.trajectory.x.shape[1]).T
        values = np.array(list(self.model.values.values()))[:, None]
        load, slips, rolls = ns.call(_forces_function(self.model.blueprint()), states, values)
        mode = self.mode(times).reshape(-1)
        friction = np.where((mode == "s") | np.isnan(slips), rolls, slips)
        friction[:, (mode == "F") | (times.reshape(-1) >= self.time)] = 0.0
        ended = times >= self.time
        return Forces(
            np.where(ended, 0.0, load.reshape(times.shape)), friction.T.reshape(*times.shape, 2)
        )

    def __repr__(self) -> str:
        v, h = self.lift_off.xdot, self.slip
        return (
            f"Shot3D({self.itinerary!r}, lift-off at t = {self.time:.6g}: xdot = [{v[0]:.6g}, "
            f"{v[1]:.6g}], ydot = {self.lift_off.ydot:.6g}, slip = [{h[0]:.6g}, {h[1]:.6g}])"
        )


@lru_cache(maxsize=64)
def _forces_function(blueprint: Contact3D) -> ca.Function:
    return _space(blueprint).forces()


def _space(blueprint: Contact3D) -> SpaceEquations:
    """The equations of a blueprint in 3-D, as such."""
    eq = equations(blueprint)
    assert isinstance(eq, SpaceEquations)
    return eq


def _between(before: Array, after: Array) -> float:
    """Angle from one vector to another; zero where one of them is zero."""
    cross = before[0] * after[1] - before[1] * after[0]
    return math.atan2(cross + 0.0, float(before @ after))


def direction(vector: Array) -> float:
    """Angle of a vector (2,) from forward to the right, in (-pi, pi]."""
    return math.atan2(vector[1] + 0.0, vector[0])  # -0.0 is no other side


def state_3d(states: Array, drilling: bool) -> State3D:
    """Return states of :meth:`Contact3D.system`, ndarray (..., n), by what they are."""
    x, xdot, y, ydot, z, zdot, slip_x, slip_z = (states[..., k] for k in range(len(STATES_3D)))
    slip, velocity = np.stack([slip_x, slip_z], axis=-1), np.stack([xdot, zdot], axis=-1)
    omega = slip - velocity
    if drilling:
        omega = np.concatenate([omega, states[..., [len(STATES_3D)]]], axis=-1)
    place = np.stack([x, z], axis=-1)
    return State3D(velocity, _plain(ydot), omega, place, _plain(y), slip)


def _plain(value: Array) -> Any:
    return float(value) if np.ndim(value) == 0 else value


def simulate_3d(
    model: ContactModel | Contact3D,
    xdot: Any,
    ydot: float,
    omega: Any,
    x: Any = 0.0,
    y: float = 0.0,
    *,
    tol: float = 1e-10,
    t_max: float = 100.0,
) -> Shot3D:
    """Bounce a ball once in 3-D, as :func:`simulate` says.

    Raises
    ------
    LandingError, LiftOffError, ModelError
    """
    if not isinstance(model, Contact3D):
        require_model(model)
        model = model.in_3d()
    velocity, place, spin = _pairs(model, xdot, omega, x)
    down, height = landing_number(ydot, "ydot"), landing_number(y, "y")
    check_approach(height, down)
    limit = time_limit(t_max)
    blueprint = model.blueprint()
    x0 = start_3d(model, velocity, down, spin, place, height)
    before, run = contact(blueprint, model.values, x0, tol, limit)
    landing = state_3d(np.array(x0), model.drilling)
    lift_off = state_3d(run.x[-1], model.drilling)
    if height == 0.0 and lift_off.ydot > -down:
        p = np.array(list(model.values.values()))[:, None]
        if gains(blueprint, np.array(x0)[:, None], run.x[-1][:, None], p, tol)[0]:
            warnings.warn(advice(model.model, 1, 1), EnergyWarning, stacklevel=3)
    return Shot3D(model, landing, lift_off, float(run.t[-1]), run, before, tol)


def start_3d(
    model: Contact3D,
    velocity: list[float],
    ydot: float,
    spin: list[float],
    place: list[float],
    y: float,
) -> list[float]:
    """Return a landing as the states of the contact."""
    further = equations(model.blueprint()).start.values()
    slip = [v + w for v, w in zip(velocity, spin[:2], strict=True)]
    turning = [spin[2] if len(spin) > 2 else 0.0] if model.drilling else []
    pair = zip(place, velocity, strict=True)
    (x, xdot), (z, zdot) = pair
    return [x, xdot, y, ydot, z, zdot, *slip, *turning, *further]


def _pairs(
    model: Contact3D, xdot: Any, omega: Any, x: Any
) -> tuple[list[float], list[float], list[float]]:
    """Velocity, place and spin, checked together."""
    given = dict(xdot=xdot, omega=omega)
    numbers = [name for name, value in given.items() if not is_vector(value)]
    if len(numbers) == 1:
        (vector,) = set(given) - set(numbers)
        raise LandingError(
            f"{vector}: expected one number, received {np.shape(given[vector])} of them beside "
            f"{numbers[0]} = {given[numbers[0]]!r}. In 3-D xdot and omega are both pairs, forward and to "
            "the right; simulate follows one bounce."
        )
    if numbers:
        raise LandingError(
            f"xdot, omega: expected pairs, forward and to the right, received {xdot!r} and {omega!r}. "
            "In the plane the model is given without in_3d()."
        )
    place = [0.0, 0.0] if not is_vector(x) and number(x, "x", LandingError) == 0.0 else x
    if not is_vector(place):
        raise LandingError(
            f"x: expected two numbers, forward and to the right, received {x!r} beside pairs."
        )
    return (
        _vector(xdot, "xdot", (2,)),
        _vector(place, "x", (2,)),
        _vector(omega, "omega", (2, 3) if model.drilling else (2,)),
    )


def _vector(value: Any, name: str, lengths: tuple[int, ...]) -> list[float]:
    if np.ndim(value) != 1 or len(value) not in lengths:
        more = " (forward, to the right)"
        if name == "omega":
            more = " (omega_z, -omega_x)" + (", then omega_y" if 3 in lengths else "")
        hint = "" if name != "omega" or 3 in lengths else (
            " The spin about the vertical is a third one with drilling friction only: "
            "model.in_3d(drilling_radius=...)."
        )  # fmt: skip
        raise LandingError(
            f"{name}: expected {' or '.join(map(str, lengths))} numbers{more}, received "
            f"{np.shape(value)} of them. simulate follows one bounce.{hint}"
        )
    return [number(v, f"{name}[{i}]", LandingError) for i, v in enumerate(value)]
