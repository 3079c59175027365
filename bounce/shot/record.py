"""What a bounce that lifted off is, in the plane or in 3-D, and how the contact is followed."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.equations import Blueprint, contact_system, energy_function, equations
from ..contact.model import ContactModel
from ..contact.space import Contact3D
from ..errors import LiftOffError, ModelError
from .touch_down import approach, no_lift_off, rests

Array = NDArray[np.float64]
Model = TypeVar("Model", bound=ContactModel | Contact3D)
#: What the ball is at one instant.
Point = TypeVar("Point")


class Forces(NamedTuple):
    """Forces on the ball at the times asked for.

    Attributes
    ----------
    load : ndarray (...)
        What ``mu`` multiplies: the surface's force, less gravity if the model says so.
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


@dataclass(frozen=True, repr=False)
class Record(Generic[Model, Point]):
    """A bounce that lifted off; attributes as those of :class:`Shot`."""

    model: Model
    landing: Point
    lift_off: Point
    time: float
    trajectory: ns.Trajectory
    approach: ns.Trajectory | None
    tol: float

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


def contact(
    blueprint: Blueprint, values: dict[str, float], x0: list[float], tol: float, limit: float
) -> tuple[ns.Trajectory | None, ns.Trajectory]:
    """Follow a ball from touch-down to lift-off.

    Returns
    -------
    before : nonsmooth.Trajectory or None
        The phase without friction, where the load was not positive at once.
    run : nonsmooth.Trajectory
        The contact with friction.

    Raises
    ------
    LandingError, LiftOffError
    """
    before, t_start, start = approach(blueprint, values, x0, tol, limit)
    options: dict[str, Any] = dict(t_start=t_start, parameters=values, tol=tol)
    run = _with_friction(blueprint, before is not None, start, limit, options)
    _require_lift_off(run, np.array(x0), limit)
    return before, run


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


def _with_friction(
    blueprint: Blueprint, fell: bool, start: list[float], limit: float, options: dict[str, Any]
) -> ns.Trajectory:
    """The contact with friction, to lift-off.

    After a frictionless phase the load has just become positive. A ball at H = 0 then rolls, also
    where rounding in a steep load hides its sign.
    """
    system = contact_system(blueprint)
    run = ns.simulate(system, start, limit, **options)
    undecided = run.status is ns.Status.NON_UNIQUE and run.t[-1] == options["t_start"]
    if fell and undecided:
        run = ns.simulate(system, start, limit, start_mode="s", **options)
    return run
