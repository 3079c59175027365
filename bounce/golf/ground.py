"""One bounce in SI units, on a law in closed form or a contact model with its scale.

Side spin, the part omega_x about the direction of travel, kicks the ball to the side; so does a side slope.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.model import Contact3D, ContactModel
from ..errors import ModelError
from ..laws import BounceLaw, RigidBounce, TiltedBounce, rigid_lift_off_3d
from ..laws.tilted import tilt_at
from ..shot.simulate import simulate
from ..units import GOLF, Ball, Landing, Scaling
from .side_spin import S, SideState, gravity_on, in_space, same_kind

Array = NDArray[np.float64]

#: Grounds for bounces in a vertical plane.
Model = BounceLaw | ContactModel


@dataclass(frozen=True)
class Rebound(Generic[S]):
    """One bounce in SI units.

    Attributes
    ----------
    landing, lift_off : Landing or SideState
        Of one kind. A law that keeps the ball down gives a lift-off that does not rise.
    time : float
        Duration of the contact, s; 0 for a rigid impact.
    x, y, z : float
        Centre at lift-off relative to touch-down, m: forward, up, to the right.
    itinerary : str
        Phases of a contact model, or the case of a law.
    slip_angle : float
        Direction of the slip at lift-off, rad from forward to the right; 0 if it rolls.
    """

    landing: S
    lift_off: S
    time: float
    x: float
    y: float
    itinerary: str
    z: float = 0.0
    slip_angle: float = 0.0

    @property
    def kick(self) -> float:
        """By how much it turns the direction of travel along the ground, rad, right positive."""
        turn = in_space(self.lift_off).heading - in_space(self.landing).heading
        return math.atan2(math.sin(turn), math.cos(turn))


class ExtrapolationWarning(UserWarning):
    """A shot leaves what a law, or the friction of rolling, was measured for."""


class _LiftOff(NamedTuple):
    """Lift-off in the axes of the ground, spins as the contact point's velocities."""

    xdot: Array  # forward, to the right
    ydot: float
    omega: Array  # these two, then about the normal
    slip: Array
    itinerary: str
    time: float = 0.0
    way: Array = np.zeros(3)


@dataclass(frozen=True)
class Ground:
    """A law or a contact model, with what gives its numbers their units."""

    model: Model | Contact3D
    ball: Ball
    scaling: Scaling | None
    side_slope: float
    tol: float

    def rebound(self, landing: S) -> Rebound[S]:
        """Return one bounce."""
        state, flat = in_space(landing), isinstance(landing, Landing)
        v, down = state.velocity[[0, 2]], float(state.velocity[1])
        w = self.ball.radius * np.array([state.spin[2], -state.spin[0], state.spin[1]])
        if isinstance(self.model, BounceLaw):
            after = (_by_law_in_plane if flat else _by_law)(self.model, v, down, w)
        else:
            after = self._by_contact(self.model, v, down, w, flat)
        w = after.omega / self.ball.radius
        velocity = np.array([after.xdot[0], after.ydot, after.xdot[1]])
        off = same_kind(landing, velocity, np.array([-w[1], w[2], w[0]]))
        x, y, z = after.way.tolist()
        slip = math.atan2(after.slip[1] + 0.0, after.slip[0])
        return Rebound(landing, off, after.time, x, y, after.itinerary, z, slip)

    def cautions(self, landing: Landing | SideState) -> tuple[str, ...]:
        """Return what is outside the landings that a law was fitted to, or beyond its form."""
        if not isinstance(self.model, BounceLaw):
            return ()
        hit = landing if isinstance(landing, Landing) else landing.in_plane
        covers, who = self.model.covers, type(self.model).__name__
        outside = "" if covers is None else covers.misses(hit.xdot, hit.ydot, hit.omega)
        beyond = self.model.caution(hit.xdot, hit.ydot)
        reasons = [f"outside what it was fitted to, with {outside}"] if outside else []
        reasons += [f"beyond what it can describe, with {beyond}"] if beyond else []
        if not reasons:
            return ()
        return (f"{who}: a landing {'; '.join(reasons)}. The rebound is an extrapolation.",)

    def require_slope(self, slope: float) -> None:
        """Refuse another slope than that in the equations of a contact model."""
        if not isinstance(self.model, BounceLaw) and self.model.values["slope"] != slope:
            raise ns.OptionError(
                f"slope: expected that of the model, {self.model.values['slope']!r}, received {slope!r}. "
                f"Use model.replace(slope={slope!r})."
            )

    def _by_contact(
        self, model: ContactModel | Contact3D, v: Array, down: float, w: Array, flat: bool
    ) -> _LiftOff:
        if not flat:
            model = (
                model if isinstance(model, Contact3D) else model.in_3d(side_slope=self.side_slope)
            )
            if model.values["side_slope"] != self.side_slope:
                raise ns.OptionError(
                    f"side_slope: expected that of the model, {model.values['side_slope']!r}, received "
                    f"{self.side_slope!r}."
                )
        scale = require_scaling(model, self.ball, self.scaling)
        unit, drills = scale.speed, isinstance(model, Contact3D) and model.drilling
        xdot, omega = (v / unit).tolist(), (w / unit).tolist()[: 3 if drills else 2]
        if flat:
            xdot, omega = xdot[0], omega[0]
        shot: Any = simulate(model, xdot, down / unit, omega, tol=self.tol)
        end = shot.lift_off
        spin, (x, z) = _padded(end.omega, 3 if drills else 2) * unit, _padded(end.x, 2)
        return _LiftOff(
            _padded(end.xdot, 2) * unit,
            end.ydot * unit,
            spin if drills else np.append(spin, w[2]),
            _padded(end.slip, 2) * unit,
            shot.itinerary,
            shot.time * scale.time,
            scale.length * np.array([x, end.y, z]),
        )


def _padded(value: Any, size: int) -> Array:
    """A number along the ground, or some, as so many components."""
    given = np.atleast_1d(np.asarray(value, dtype=float))
    return np.append(given, np.zeros(size - given.size))


def _by_law_in_plane(model: BounceLaw, v: Array, down: float, w: Array) -> _LiftOff:
    off = model.lift_off(v[0], down, w[0])
    return _LiftOff(
        _padded(off.xdot, 2),
        float(off.ydot),
        _padded(off.omega, 3),
        _padded(off.slip, 2),
        str(off.case),
    )


def _by_law(model: BounceLaw, v: Array, down: float, w: Array) -> _LiftOff:
    """Bounce by a rigid law, in the plane of the law if that is tilted towards the ball."""
    if isinstance(model, RigidBounce):
        off = rigid_lift_off_3d(model, v, down, w[:2])
        return _LiftOff(
            off.xdot, float(off.ydot), np.append(off.omega, w[2]), off.slip, str(off.case)
        )
    if not isinstance(model, TiltedBounce):
        raise ModelError(
            f"model: {model!r} holds in a vertical plane only. With side spin give a RigidBounce, a "
            "TiltedBounce or a contact model."
        )
    speed = float(np.hypot(*v))
    e = v / speed if speed else np.array([1.0, 0.0])
    turn = np.array([[e[0], e[1]], [-e[1], e[0]]])  # into the direction of travel
    b = float(tilt_at(model, speed, down)) if speed else 0.0
    cos, sin = math.cos(b), math.sin(b)
    along = turn @ w[:2]
    # -along[1] is the spin about the direction of travel; the plane's own is turned by b about z.
    about = -along[1] * cos + w[2] * sin
    normal = w[2] * cos + along[1] * sin
    into = down * cos - speed * sin
    hit = rigid_lift_off_3d(model.plane, [speed * cos + down * sin, 0.0], into, [along[0], -about])
    up = float(hit.ydot)
    velocity = np.array([hit.xdot[0] * cos - up * sin, hit.xdot[1]])
    forward = -hit.omega[1] * cos - normal * sin
    spin = np.array([hit.omega[0], -forward])
    vertical = -hit.omega[1] * sin + normal * cos
    return _LiftOff(
        turn.T @ velocity,
        up * cos + float(hit.xdot[0]) * sin,
        np.append(turn.T @ spin, vertical),
        turn.T @ (velocity + spin),
        str(hit.case),
    )


def ground(
    model: Model | Contact3D,
    ball: Ball,
    scaling: Scaling | None,
    tol: float,
    side_slope: float = 0.0,
) -> Ground:
    """Return what a ball bounces on, if it fits the ball."""
    require_model(model.model if isinstance(model, Contact3D) else model)
    if model.values["inertia"] != ball.inertia:
        raise ModelError(
            f"inertia: expected that of the ball, {ball.inertia:g}, received "
            f"{model.values['inertia']:g} in {model!r}. Use model.replace(inertia={ball.inertia!r})."
        )
    if not isinstance(model, BounceLaw):
        require_scaling(model, ball, scaling)
    return Ground(model, ball, scaling, side_slope, tol)


def require_model(model: Any) -> None:
    """Refuse what is neither a law nor a contact model."""
    if not isinstance(model, Model):
        raise ModelError(
            "model: expected a law such as bounce.laws.TURFS['natural'].law or a ContactModel, "
            f"received {model!r}."
        )


def require_scaling(
    model: ContactModel | Contact3D, ball: Ball, scaling: Scaling | None
) -> Scaling:
    """Return the scale of a dimensionless model, which must be that of the ball."""
    if scaling is None:
        raise ModelError(
            f"scaling: {type(model).__name__} is dimensionless, and landings are in SI units. Give "
            "scaling=bounce.Scaling.from_stiffness(ball, newtons_per_metre)."
        )
    if scaling.ball != ball:
        raise ModelError(
            f"ball: expected that of the scaling, {scaling.ball!r}, received {ball!r}."
        )
    return scaling


def rebound(
    model: Model | Contact3D,
    landing: S,
    ball: Ball = GOLF,
    *,
    scaling: Scaling | None = None,
    side_slope: float = 0.0,
    tol: float = 1e-10,
) -> Rebound[S]:
    """Bounce a ball once, in SI units, on any law or contact model.

    Parameters
    ----------
    model : BounceLaw, ContactModel or Contact3D
        The ground: a law in closed form or a contact model. With side spin a law is a RigidBounce or a
        TiltedBounce; a Contact3D is for side spin only.
    landing : Landing or SideState
        The landing, in SI units; a SideState has side spin.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    scaling : Scaling, optional
        The units of a contact model (needed for one, unused by a law). Its scaled gravity is the
        model's own ``G``; ``scaling.gravity`` is the value that fits the ball.
    side_slope : float, optional
        Of the ground, uphill to the right, rad. It needs a SideState, whose axes are those of the ground.
    tol : float, optional
        Relative tolerance.

    Returns
    -------
    Rebound
        The bounce, from touch-down to lift-off.

    Raises
    ------
    ModelError
        Neither a law nor a contact model, a law that holds in a vertical plane only, no scaling for a
        contact model, another moment of inertia or ball than the scaling's.
    LandingError
        A ball that does not move into the ground; a Contact3D for a Landing.
    LiftOffError
        A ball that does not lift off a contact model.
    nonsmooth.OptionError
        A landing of another type; a tolerance or slope out of its range.

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

    A wedge shot with a tilted axis kicks to the side to which it curves:

    >>> back, side, _ = bounce.golf.axis_spin(1000.0, math.radians(10), math.radians(28))
    >>> landing = SideState.of(bounce.Landing(15.0, -20.0, back), side)
    >>> hit = bounce.golf.rebound(bounce.laws.RigidBounce(mu=0.5, restitution=0.3), landing)
    >>> f"{math.degrees(hit.kick):.1f} deg"
    '6.0 deg'
    """
    turf = ground(model, ball, scaling, tol, side_slope)
    gravity_on(landing, "landing", 0.0, side_slope)
    hit = turf.rebound(landing)
    for caution in turf.cautions(landing):
        warnings.warn(caution, ExtrapolationWarning, stacklevel=2)
    return hit
