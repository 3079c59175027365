"""A bounce that lifted off: its phases, its forces and its energy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.equations import Equations, energy_function, equations, forces_function
from ..contact.model import Contact3D, ContactModel
from ..errors import ModelError
from .state import Along, State, forward_and_right, state_of

Array = NDArray[np.float64]
Model = TypeVar("Model", bound=ContactModel | Contact3D)


class Forces(NamedTuple):
    """Forces on the ball at given times.

    Attributes
    ----------
    load : ndarray (...)
        What ``mu`` multiplies: the surface's force, less gravity with ``load="net"``.
    friction : ndarray (...) or (..., 2)
        The friction force along the ground, with its sign.
    """

    load: Array
    friction: Array


class Phase(NamedTuple):
    """A stretch of the bounce in one mode.

    Attributes
    ----------
    mode : str
        ``+`` forward slip, ``-`` reverse slip, ``s`` rolling, ``F`` free of friction; in 3-D ``*`` slips.
    t_start, t_end : float
        Its times since touch-down.
    """

    mode: str
    t_start: float
    t_end: float


@dataclass(frozen=True, eq=False, repr=False)
class Shot(Generic[Model, Along]):
    """A bounce that lifted off, in the plane or in 3-D.

    Attributes
    ----------
    model : ContactModel or Contact3D
        The surface, with its friction.
    landing, lift_off : State
        The ball at touch-down and at lift-off.
    time : float
        Duration of the bounce, in the model's unit.
    trajectory : nonsmooth.Trajectory
        The contact; its states are ``x, xdot, y, ydot, omega`` and the extra ones, in 3-D those of
        :meth:`Contact3D.system`.
    approach : nonsmooth.Trajectory or None
        The frictionless phase before it, where the load was not positive yet.
    tol : float
        Tolerance of the computation.
    """

    model: Model
    landing: State[Along]
    lift_off: State[Along]
    time: float
    trajectory: ns.Trajectory
    approach: ns.Trajectory | None
    tol: float

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        return self.trajectory._tables()

    @property
    def slip(self) -> Along:
        """Slip ``xdot + omega`` at lift-off: below zero is reverse slip; in 3-D a vector (2,)."""
        return self.lift_off.slip

    @property
    def slip_speed(self) -> float:
        """Length of the slip at lift-off."""
        return float(self.lift_off.slip_speed)

    @property
    def slip_angle(self) -> float:
        """Direction of the slip at lift-off, rad from forward to the right; 0 without slip."""
        return float(self.lift_off.slip_angle)

    @property
    def travel_angle(self) -> float:
        """Direction in which the ball leaves along the ground, rad from forward to the right."""
        return float(self.lift_off.travel_angle)

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
        return float(np.dot(self.landing.slip, self.slip)) < 0

    @property
    def restitution(self) -> float:
        """Normal speed at lift-off over that at touch-down."""
        return float(-self.lift_off.ydot / self.landing.ydot)

    @property
    def itinerary(self) -> str:
        """Phases in order: ``+`` and ``-`` slip, ``s`` rolling, ``F`` before the load is positive.

        In 3-D ``*`` is slip.
        """
        return " ".join(phase.mode for phase in self.phases)

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The phases with their times."""
        first = [] if self.approach is None else [Phase("F", 0.0, float(self.approach.t[-1]))]
        rest = [Phase(s.mode or "*", s.t_start, s.t_end) for s in self.trajectory.segments]
        return (*first, *rest)

    def __call__(self, t: ArrayLike) -> Array:
        """State at times of the bounce (dense output).

        Parameters
        ----------
        t : array_like (...)
            From 0 to ``time``.

        Returns
        -------
        ndarray (..., n)
            x, xdot, y, ydot, omega and extra states; in 3-D the states of :meth:`Contact3D.system`.
        """
        times = np.asarray(t, dtype=float)
        if self.approach is None:
            return self.trajectory(np.maximum(times, self.trajectory.t[0]))
        early = times < self.approach.t[-1]
        contact = self.trajectory(np.where(early, self.trajectory.t[0], times))
        before = self.approach(np.where(early, times, 0.0))
        return np.where(early[..., None], before, contact)

    def state(self, t: ArrayLike) -> State[Any]:
        """Return the ball at times of the bounce.

        Parameters
        ----------
        t : array_like (...)
            From 0 to ``time``.

        Returns
        -------
        State
            Arrays of the shape of ``t``.
        """
        return state_of(self._equations, self(t))

    def mode(self, t: ArrayLike) -> NDArray[np.str_]:
        """Mode at each time; at a transition that of the later phase.

        Parameters
        ----------
        t : array_like (...)
            Times since touch-down.

        Returns
        -------
        ndarray of str (...)
            Modes as in :class:`Phase`.
        """
        ends = np.array([phase.t_end for phase in self.phases[:-1]])
        modes = np.array([phase.mode for phase in self.phases])
        return modes[np.searchsorted(ends, np.asarray(t, dtype=float), side="right")]

    def forces(self, t: ArrayLike) -> Forces:
        """Load and friction force along the bounce.

        Parameters
        ----------
        t : array_like (...)
            Times since touch-down.

        Returns
        -------
        Forces
            Load $Lambda_N$ (...) and friction $Lambda_T$ (...), in 3-D (..., 2); both zero at lift-off.
        """
        times = np.asarray(t, dtype=float)
        modes, function = forces_function(self.model.blueprint())
        load, *in_modes = self._evaluate(function, times)
        mode, ended = (
            np.asarray(self.mode(times))[..., None],
            np.asarray(times >= self.time)[..., None],
        )
        friction = np.select([mode == m for m in modes], in_modes)
        load, friction = (np.where(ended, 0.0, force) for force in (load, friction))
        return Forces(
            load[..., 0], friction if self._equations.directions > 1 else friction[..., 0]
        )

    def energy(self, t: ArrayLike) -> Array:
        """Kinetic, gravitational and elastic energy per mass of the ball.

        Parameters
        ----------
        t : array_like (...)
            Times since touch-down.

        Raises
        ------
        ModelError
            The model defines no ``stored_energy``.
        """
        eq = self._equations
        if eq.stored is None:
            raise ModelError(
                f"{type(self.model).__name__} has no stored_energy(s, p). Define it to get the energy of "
                "a shot."
            )
        times = np.asarray(t, dtype=float)
        own, _ = self._evaluate(energy_function(self.model.blueprint()), times)
        (stored,) = self._evaluate(eq.function([eq.stored]), times)
        return (own + stored)[..., 0]

    @property
    def _equations(self) -> Equations:
        return equations(self.model.blueprint())

    def _evaluate(self, function: ca.Function, times: Array) -> list[Array]:
        """Outputs (..., k) of a function of states and parameters along the bounce."""
        states = self(times)
        states = states.reshape(-1, states.shape[-1]).T
        values = np.array(list(self.model.values.values()))[:, None]
        return [r.T.reshape(*times.shape, len(r)) for r in ns.call(function, states, values)]

    def __repr__(self) -> str:
        end = self.lift_off
        return (
            f"Shot({self.itinerary!r}, lift-off at t = {self.time:.6g}: xdot = {_short(end.xdot)}, "
            f"ydot = {end.ydot:.6g}, omega = {_short(end.omega)}, slip = {_short(self.slip)})"
        )

    def _repr_html_(self) -> str:
        """Representation in a notebook: the lift-off, then the run."""
        end = self.lift_off
        rows = [("phases", self.itinerary), ("lift-off", f"t = {self.time:.6g}")]
        rows += [(n, _short(getattr(end, n))) for n in ("xdot", "ydot", "omega")]
        picture = self.trajectory._repr_html_()
        return ns.notebook.representation("Shot", [*rows, ("slip", _short(self.slip))], picture)


def _short(along: Any) -> str:
    text = ", ".join(f"{v:.6g}" for v in np.ravel(along).tolist())
    return f"[{text}]" if np.ndim(along) else text


def _between(before: Any, after: Any) -> float:
    """Angle from one vector along the ground to another; zero where one of them is zero."""
    (a, b), (c, d) = forward_and_right(before, 0.0), forward_and_right(after, 0.0)
    return math.atan2(a * d - b * c + 0.0, a * c + b * d + 0.0)
