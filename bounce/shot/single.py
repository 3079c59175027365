"""One bounce, from touch-down to lift-off."""

from __future__ import annotations

import html
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.equations import contact_system, energy_function, equations, forces_function
from ..contact.model import ContactModel
from ..errors import EnergyWarning, LandingError, LiftOffError, ModelError
from ..parameters import Parametrised, number
from .energy import advice, gains
from .touch_down import approach, no_lift_off, rests

Array = NDArray[np.float64]


class State(NamedTuple):
    """The ball at one instant: speeds, spin, position of its centre (y = 0 at touch-down)."""

    xdot: float
    ydot: float
    omega: float
    x: float = 0.0
    y: float = 0.0

    @property
    def slip(self) -> float:
        """Speed of the contact point, H = xdot + omega."""
        return self.xdot + self.omega


class Forces(NamedTuple):
    """Load (what ``mu`` multiplies) and friction at the times asked for."""

    load: Array
    friction: Array


class Phase(NamedTuple):
    """A stretch of the bounce: ``+`` forward slip, ``-`` reverse slip, ``s`` rolling, ``F`` free."""

    mode: str
    t_start: float
    t_end: float


@dataclass(frozen=True, repr=False)
class Shot:
    """A bounce that lifted off.

    Attributes
    ----------
    model : ContactModel
        The contact model.
    landing, lift_off : State
        Touch-down and lift-off.
    time : float
        Duration.
    trajectory : nonsmooth.Trajectory
        The contact; its states are (x, xdot, y, ydot, omega, extra states).
    approach : nonsmooth.Trajectory or None
        The frictionless phase before it, where the load was not positive yet.
    tol : float
        Tolerance of the computation.
    """

    model: ContactModel
    landing: State
    lift_off: State
    time: float
    trajectory: ns.Trajectory
    approach: ns.Trajectory | None
    tol: float

    @property
    def slip(self) -> float:
        """H_F = xdot + omega at lift-off; below zero is reverse slip."""
        return self.lift_off.slip

    @property
    def itinerary(self) -> str:
        """Phases in order: ``+`` and ``-`` slip, ``s`` rolling, ``F`` before the load is positive."""
        return " ".join(phase.mode for phase in self.phases)

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The phases with their times."""
        first = [] if self.approach is None else [Phase("F", 0.0, float(self.approach.t[-1]))]
        rest = [Phase(s.mode, s.t_start, s.t_end) for s in self.trajectory.segments]
        return (*first, *rest)

    @property
    def restitution(self) -> float:
        """Normal speed at lift-off over that at touch-down."""
        return -self.lift_off.ydot / self.landing.ydot

    def __call__(self, t: ArrayLike) -> Array:
        """State at times of the bounce (dense output).

        Parameters
        ----------
        t : array_like (...)
            From 0 to ``time``.

        Returns
        -------
        ndarray (..., n)
            x, xdot, y, ydot, omega and extra states.
        """
        times = np.asarray(t, dtype=float)
        if self.approach is None:
            return self.trajectory(times)
        early = times < self.approach.t[-1]
        contact = self.trajectory(np.where(early, self.trajectory.t[0], times))
        before = self.approach(np.where(early, times, 0.0))
        return np.where(early[..., None], before, contact)

    def mode(self, t: ArrayLike) -> NDArray[np.str_]:
        """Letter of the phase at each time; at a transition the later one's.

        Parameters
        ----------
        t : array_like (...)
            Times since touch-down.

        Returns
        -------
        ndarray of str (...)
        """
        ends = np.array([phase.t_end for phase in self.phases[:-1]])
        letters = np.array([phase.mode for phase in self.phases])
        return letters[np.searchsorted(ends, np.asarray(t, dtype=float), side="right")]

    def forces(self, t: ArrayLike) -> Forces:
        """Load and friction force along the bounce.

        Parameters
        ----------
        t : array_like (...)
            Times since touch-down.

        Returns
        -------
        Forces
            Arrays (...), load Lambda_N and friction Lambda_T; both zero at lift-off.
        """
        times = np.asarray(t, dtype=float)
        function = forces_function(self.model.blueprint())
        load, forward, reverse, rolling = self._evaluate(function, times)
        mode = self.mode(times)
        friction = np.select([mode == "+", mode == "-", mode == "s"], [forward, reverse, rolling])
        ended = times >= self.time
        return Forces(np.where(ended, 0.0, load), np.where(ended, 0.0, friction))

    def energy(self, t: ArrayLike) -> Array:
        """Kinetic, gravitational and elastic energy per mass of the ball.

        Raises
        ------
        ModelError
            The model defines no ``stored_energy``.
        """
        eq = equations(self.model.blueprint())
        if eq.stored is None:
            raise ModelError(
                f"{type(self.model).__name__}: expected a method stored_energy(s, p), received none. "
                "Define it to get the energy of a shot."
            )
        times = np.asarray(t, dtype=float)
        own, _ = self._evaluate(energy_function(self.model.blueprint()), times)
        (stored,) = self._evaluate(eq.function([eq.stored]), times)
        return own + stored

    def _evaluate(self, function: ca.Function, times: Array) -> list[Array]:
        """Outputs of a function of states and parameters along the bounce."""
        states = self(times)
        states = states.reshape(-1, states.shape[-1]).T
        values = np.array(list(self.model.values.values()))[:, None]
        return [r.reshape(times.shape) for r in ns.call(function, states, values)]

    def _repr_html_(self) -> str:
        """How a notebook shows the bounce: its lift-off, then the run."""
        text = html.escape(repr(self))
        return f"<div><b>{text}</b></div>{self.trajectory._repr_html_()}"

    def __repr__(self) -> str:
        end = self.lift_off
        return (
            f"Shot({self.itinerary!r}, lift-off at t = {self.time:.6g}: xdot = {end.xdot:.6g}, "
            f"ydot = {end.ydot:.6g}, omega = {end.omega:.6g}, slip = {self.slip:.6g})"
        )


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
) -> Shot:
    """Bounce a ball once: from touch-down to the first downward zero of the load.

    Where the load is not positive just after touch-down (``load="net"`` with little damping) there
    is no friction until it is: a phase ``F``.

    Parameters
    ----------
    model : ContactModel
        The contact model to bounce on.
    xdot, ydot, omega : float
        Speeds along and normal to the ground and spin at touch-down. ``ydot < 0``, unless the ball
        starts in the ground.
    x, y : float, optional
        Position of the centre; ``y < 0`` is a start in the middle of a contact, with any ``ydot``.
    tol : float, optional
        Relative and absolute tolerance.
    t_max : float, optional
        Longest time before lift-off; a linear bounce takes about pi.

    Returns
    -------
    Shot

    Raises
    ------
    LandingError
        A number that is not finite, a ball above the ground or moving away from it.
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
    """
    if not isinstance(model, ContactModel):
        hint = " A class was given: make an instance of it." if isinstance(model, type) else ""
        if isinstance(model, Parametrised):
            hint = " A law of bounce.laws takes no time: use its lift_off(xdot, ydot, omega)."
        raise ModelError(f"model: expected a ContactModel, received {model!r}.{hint}")
    given = dict(xdot=xdot, ydot=ydot, omega=omega, x=x, y=y)
    landing = State(**{name: _landing_number(value, name) for name, value in given.items()})
    _check_landing(landing)
    limit = number(t_max, "t_max", ns.OptionError)
    if limit <= 0:
        raise ns.OptionError(f"t_max: expected a positive time, received {t_max!r}.")
    blueprint = model.blueprint()
    further = equations(blueprint).start.values()
    x0 = [landing.x, landing.xdot, landing.y, landing.ydot, landing.omega, *further]
    before, start = approach(blueprint, model.values, x0, tol, limit)
    run = _contact(blueprint, model.values, before, start, tol, limit)
    _require_lift_off(run, np.array(x0), limit)
    end = dict(zip(run.system.state_names, run.x[-1].tolist(), strict=True))
    lift_off = State(**{name: end[name] for name in State._fields})
    if landing.y == 0.0 and lift_off.ydot > -landing.ydot:
        p = np.array(list(model.values.values()))[:, None]
        if gains(blueprint, np.array(x0)[:, None], run.x[-1][:, None], p, tol)[0]:
            warnings.warn(advice(model, 1, 1), EnergyWarning, stacklevel=2)
    return Shot(model, landing, lift_off, float(run.t[-1]), run, before, tol)


def _require_lift_off(run: ns.Trajectory, start: Array, limit: float) -> None:
    """Refuse a contact that did not end, or whose load ended because the ball came to rest."""
    if run.status is not ns.Status.STOPPED:
        raise LiftOffError(no_lift_off(run, limit), run)
    if rests(run.x[-1], start):
        raise LiftOffError(
            f"lift-off: expected before t_max = {limit:g}, received a ball at rest in the ground, y = "
            f"{run.x[-1, 2]:.6g}, whose load is zero but for rounding. It lands too slowly, or the "
            "surface damps too much.",
            run,
        )


def _contact(
    blueprint: ContactModel,
    values: dict[str, float],
    before: ns.Trajectory | None,
    start: list[float],
    tol: float,
    limit: float,
) -> ns.Trajectory:
    """The contact with friction, to lift-off.

    After a frictionless phase the load has just become positive. A ball at H = 0 then rolls, also
    where rounding in a steep load hides its sign.
    """
    options: dict[str, Any] = dict(
        t_start=0.0 if before is None else float(before.t[-1]), parameters=values, tol=tol
    )
    system = contact_system(blueprint)
    run = ns.simulate(system, start, limit, **options)
    undecided = run.status is ns.Status.NON_UNIQUE and run.t[-1] == options["t_start"]
    if before is not None and undecided:
        run = ns.simulate(system, start, limit, start_mode="s", **options)
    return run


def _landing_number(value: Any, name: str) -> float:
    if (isinstance(value, np.ndarray) and value.ndim) or isinstance(value, (list, tuple)):
        raise LandingError(
            f"{name}: expected one number, received {np.shape(value)} of them. simulate follows one "
            "bounce."
        )
    return number(value, name, LandingError)


def _check_landing(landing: State) -> None:
    if landing.y > 0.0:
        raise LandingError(
            f"y: expected at most 0 (in the ground), received {landing.y!r}. The ball is in the air; "
            "touch-down is at y = 0."
        )
    if landing.y == 0.0 and landing.ydot >= 0.0:
        raise LandingError(
            f"ydot: expected a negative number at y = 0, received {landing.ydot!r}. The ball does not "
            "approach the ground (y points up)."
        )
