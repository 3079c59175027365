"""What a ball bounces on, in SI units: a law in closed form, or a contact model with its scale."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import nonsmooth as ns

from ..contact.model import ContactModel
from ..errors import ModelError
from ..laws import BounceLaw
from ..shot.simulate import simulate
from ..units import GOLF, Ball, Landing, Scaling

#: What a ball can bounce on.
Model = BounceLaw | ContactModel


@dataclass(frozen=True)
class Rebound:
    """One bounce in SI units.

    Attributes
    ----------
    landing, lift_off : Landing
        ``lift_off.ydot <= 0`` is a law's way to say that the ball stays down.
    time : float
        Duration of the contact, s; 0 for a rigid impact.
    x, y : float
        Centre at lift-off relative to touch-down, m.
    itinerary : str
        Phases of a contact model, or the case of a law.
    """

    landing: Landing
    lift_off: Landing
    time: float
    x: float
    y: float
    itinerary: str


class ExtrapolationWarning(UserWarning):
    """A shot leaves what a law, or the friction of rolling, was measured for."""


class Ground(ABC):
    """What the rest of a shot asks of the ground.

    Attributes
    ----------
    model : BounceLaw or ContactModel
        The ground: a contact model or a law in closed form.
    """

    model: Model

    @property
    def mu(self) -> float:
        """Coefficient of friction."""
        return self.model.values["mu"]

    @abstractmethod
    def rebound(self, landing: Landing) -> Rebound:
        """Return one bounce."""

    def cautions(self, landing: Landing) -> tuple[str, ...]:
        """Say why a rebound is an extrapolation, if it is one."""
        return ()

    @property
    def slope(self) -> float | None:
        """Slope that is in its equations, rad; None where it holds on any."""
        return None

    def require_slope(self, slope: float) -> None:
        """Refuse a run on another slope than that of the equations.

        Raises
        ------
        nonsmooth.OptionError
        """
        if self.slope not in (None, slope):
            raise ns.OptionError(
                f"slope: expected that of the model, {self.slope!r}, received {slope!r}. Use "
                f"model.replace(slope={slope!r})."
            )


@dataclass(frozen=True)
class LawGround(Ground):
    """A law in closed form, along and normal to ground of any slope."""

    model: BounceLaw
    ball: Ball

    def rebound(self, landing: Landing) -> Rebound:
        """Return one bounce, which takes no time."""
        radius = self.ball.radius
        shot = self.model.lift_off(landing.xdot, landing.ydot, landing.omega * radius)
        after = Landing(float(shot.xdot), float(shot.ydot), float(shot.omega) / radius)
        return Rebound(landing, after, 0.0, 0.0, 0.0, str(shot.case))

    def cautions(self, landing: Landing) -> tuple[str, ...]:
        """Say what is outside the landings that the law was fitted to, or beyond its form."""
        covers, who = self.model.covers, type(self.model).__name__
        outside = "" if covers is None else covers.misses(landing.xdot, landing.ydot, landing.omega)
        beyond = self.model.caution(landing.xdot, landing.ydot)
        said = [f"outside what it was fitted to, with {outside}"] if outside else []
        said += [f"beyond what it can describe, with {beyond}"] if beyond else []
        if not said:
            return ()
        return (f"{who}: a landing {'; '.join(said)}. The rebound is an extrapolation.",)


@dataclass(frozen=True)
class ContactGround(Ground):
    """A contact model, whose numbers mean what its scale says; nobody has measured where it holds."""

    model: ContactModel
    scaling: Scaling
    tol: float

    def rebound(self, landing: Landing) -> Rebound:
        """Return one bounce."""
        unit = self.scaling
        start = unit.state(landing)
        run = simulate(self.model, start.xdot, start.ydot, start.omega, tol=self.tol)
        return Rebound(
            landing,
            unit.landing(run.lift_off),
            run.time * unit.time,
            run.lift_off.x * unit.length,
            run.lift_off.y * unit.length,
            run.itinerary,
        )

    @property
    def slope(self) -> float:
        """Slope that is in its equations, rad."""
        return self.model.values["slope"]


def ground(model: Model, ball: Ball, scaling: Scaling | None, tol: float) -> Ground:
    """Return what a ball bounces on.

    Raises
    ------
    ModelError
        As :func:`rebound`.
    """
    require_model(model)
    if model.values["inertia"] != ball.inertia:
        raise ModelError(
            f"inertia: expected that of the ball, {ball.inertia:g}, received "
            f"{model.values['inertia']:g} in {model!r}. Use model.replace(inertia={ball.inertia!r})."
        )
    if isinstance(model, BounceLaw):
        return LawGround(model, ball)
    return ContactGround(model, require_scaling(model, ball, scaling), tol)


def require_model(model: Any) -> None:
    """Refuse what a ball cannot bounce on."""
    if not isinstance(model, Model):
        raise ModelError(
            "model: expected a law such as bounce.laws.TURFS['natural'].law or a ContactModel, "
            f"received {model!r}."
        )


def require_scaling(model: ContactModel, ball: Ball, scaling: Scaling | None) -> Scaling:
    """Return the scale of a contact model that meets SI units, or say how to make one."""
    if scaling is None:
        raise ModelError(
            f"scaling: expected a Scaling for the dimensionless {type(model).__name__}, which is to "
            "meet SI units, received none. Scaling.from_stiffness(ball, newtons_per_metre) makes one."
        )
    if scaling.ball != ball:
        raise ModelError(
            f"ball: expected that of the scaling, {scaling.ball!r}, received {ball!r}."
        )
    return scaling


def rebound(
    model: Model,
    landing: Landing,
    ball: Ball = GOLF,
    *,
    scaling: Scaling | None = None,
    tol: float = 1e-10,
) -> Rebound:
    """Bounce a ball once, in SI units, on any law or contact model.

    Parameters
    ----------
    model : BounceLaw or ContactModel
        The ground: a contact model or a law in closed form.
    landing : Landing
        The landing, in SI units.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    scaling : Scaling, optional
        The units of a contact model (needed for one, unused by a law). Its scaled gravity is the
        model's own ``G``; ``scaling.gravity`` is the value that fits the ball.
    tol : float, optional
        Relative tolerance.

    Returns
    -------
    Rebound
        The bounce, from touch-down to lift-off.

    Raises
    ------
    ModelError
        Neither a law nor a contact model, no scaling for a contact model, another moment of
        inertia or ball than the scaling's.
    LandingError
        A ball that does not move into the ground.
    LiftOffError
        A ball that does not lift off a contact model.
    nonsmooth.OptionError
        A tolerance out of its range.

    Warns
    -----
    ExtrapolationWarning
        A landing outside the range that a law was fitted to.

    Examples
    --------
    >>> import bounce, math
    >>> drive = bounce.Landing.polar(28.5, math.radians(37.3), 2094)
    >>> after = bounce.golf.rebound(bounce.laws.TURFS["natural"].law, drive).lift_off
    >>> f"{after.speed:.2f} m/s, {math.degrees(after.angle):.1f} deg, {after.backspin_rpm:.0f} rpm"
    '10.71 m/s, 37.3 deg, -4536 rpm'
    """
    turf = ground(model, ball, scaling, tol)
    hit = turf.rebound(landing)
    for caution in turf.cautions(landing):
        warnings.warn(caution, ExtrapolationWarning, stacklevel=2)
    return hit
