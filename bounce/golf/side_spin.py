"""Side spin: the kick of a draw or a fade, and of a side slope, in SI units.

A golf ball's spin axis, horizontal for pure backspin, is tilted in the plane normal to its launch. The
axis keeps its direction in flight, so the ball lands with the part omega_x = omega sin(tilt) sin(launch
angle) about the direction of travel. That is what friction feels on level ground; the part about the
vertical counts where the ground acts as if it were tilted, and with drilling friction. Positive tilt and
positive omega_x are to the right, where the ball also curves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.model import Contact3D, ContactModel
from ..errors import ModelError
from ..laws import BounceLaw, RigidBounce, TiltedBounce, rigid_lift_off_3d
from ..parameters import LIMITS, number
from ..shot.simulate import simulate
from ..units import GOLF, Ball, Landing, Scaling
from .ground import require_scaling
from .side_flight import SideState

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SideRebound:
    """One bounce with side spin, in SI units.

    Attributes
    ----------
    landing, lift_off : Landing
        In the vertical planes of travel: before the bounce, and after it. ``lift_off.xdot`` is the
        speed along the ground in the direction in which the ball leaves, ``lift_off.omega`` its
        backspin about the axis across that direction.
    side_spin, side_spin_after : float
        $omega_x$, rad/s, before and after: about the direction of travel, right positive.
    kick : float
        Angle from the direction of travel before to that after, rad, right positive.
    slip_angle : float
        Direction of the slip at lift-off, rad from the first direction of travel; 0 if it rolls.
    itinerary : str
        Phases of a contact model, or the case of a law.
    """

    landing: Landing
    lift_off: Landing
    side_spin: float
    side_spin_after: float
    kick: float
    slip_angle: float
    itinerary: str


class AxisSpin(NamedTuple):
    """Spin about the horizontal axes across and along the travel, and about the vertical.

    Attributes
    ----------
    backspin, side, vertical : float
        $omega_z$, $omega_x$ (right positive) and $omega_y$.
    """

    backspin: float
    side: float
    vertical: float


def axis_spin(spin: float, axis_tilt: float, launch_angle: float) -> AxisSpin:
    """Return the spin of a ball whose axis was tilted at launch, by its parts.

    Parameters
    ----------
    spin : float
        About the tilted axis, rad/s or any unit.
    axis_tilt : float
        rad; positive is a fade of a right-handed player, curving right.
    launch_angle : float
        Of the path above the ground at launch, rad in $[0, pi/2]$.

    Returns
    -------
    AxisSpin
        In the unit of ``spin``.

    Examples
    --------
    >>> import math
    >>> back, side, vertical = axis_spin(2094.0, math.radians(10), math.radians(11))
    >>> f"{back:.1f}, {side:.1f}, {vertical:.1f} rpm"
    '2062.2, 69.4, -356.9 rpm'
    """
    total = number(spin, "spin", ns.OptionError)
    tilt = number(axis_tilt, "axis_tilt", ns.OptionError)
    launch = number(launch_angle, "launch_angle", ns.OptionError)
    if abs(tilt) > math.pi / 2 or not 0.0 <= launch <= math.pi / 2:
        raise ns.OptionError(
            f"axis_tilt, launch_angle: expected radians in [-pi/2, pi/2] and [0, pi/2], received "
            f"{axis_tilt!r} and {launch_angle!r}."
        )
    across = total * math.sin(tilt)
    return AxisSpin(total * math.cos(tilt), across * math.sin(launch), -across * math.cos(launch))


def side_rebound(
    model: BounceLaw | ContactModel | Contact3D,
    landing: Landing,
    side_spin: float,
    ball: Ball = GOLF,
    *,
    vertical_spin: float = 0.0,
    scaling: Scaling | None = None,
    side_slope: float = 0.0,
    tol: float = 1e-10,
) -> SideRebound:
    """Bounce a ball with side spin once, in SI units.

    Parameters
    ----------
    model : RigidBounce, TiltedBounce, ContactModel or Contact3D
        The ground, as a law in closed form or a contact model.
    landing : Landing
        The landing, with the backspin (see :func:`axis_spin`).
    side_spin : float
        $omega_x$, rad/s, right positive.
    ball : Ball, optional
        Radius, mass and moment of inertia.
    vertical_spin : float, optional
        $omega_y$, rad/s: it counts on a tilted plane, and with drilling friction.
    scaling : Scaling, optional
        Needed for a contact model, see :func:`rebound`.
    side_slope : float, optional
        Of the ground, uphill to the right, rad; speeds are along and normal to the ground. A ball that
        falls in a vertical plane lands on a side slope with a speed to its foot.
    tol : float, optional
        Relative tolerance.

    Returns
    -------
    SideRebound
        The bounce, with what goes to the side.

    Raises
    ------
    ModelError
        Another law or model than these, or no scaling for a contact model.
    LandingError
        A ball that does not move into the ground.
    LiftOffError
        A ball that does not lift off a contact model.
    nonsmooth.OptionError
        Spins that are not finite; a slope outside of $-pi/2$ to $pi/2$.

    Examples
    --------
    A wedge shot with a tilted axis kicks to the side to which it curves:

    >>> import bounce, math
    >>> back, side, _ = bounce.golf.axis_spin(1000.0, math.radians(10), math.radians(28))
    >>> law = bounce.laws.RigidBounce(mu=0.5, restitution=0.3)
    >>> hit = bounce.golf.side_rebound(law, bounce.Landing(15.0, -20.0, back), side)
    >>> f"{math.degrees(hit.kick):.1f} deg"
    '6.0 deg'
    """
    turn = number(side_spin, "side_spin", ns.OptionError)
    slope = number(side_slope, "side_slope", ns.OptionError)
    if not LIMITS["in (-pi/2, pi/2)"](slope):
        raise ns.OptionError(
            f"side_slope: expected radians in (-pi/2, pi/2), received {side_slope!r}."
        )
    if model_inertia(model) != ball.inertia:
        raise ModelError(
            f"inertia: expected that of the ball, {ball.inertia:g}, received {model_inertia(model):g}."
        )
    about = number(vertical_spin, "vertical_spin", ns.OptionError)
    state = SideState.of(landing, turn, about, slope)
    after = bounced(model, state, ball, scaling, slope, tol)
    angle, spin = after.state.heading, after.state.spin
    side = float(spin[0] * math.cos(angle) + spin[2] * math.sin(angle))
    return SideRebound(
        landing,
        after.state.in_plane,
        turn,
        side,
        angle,
        math.atan2(after.slip[1] + 0.0, after.slip[0]),
        after.itinerary,
    )


class Bounced(NamedTuple):
    """A bounce in the axes of the ground.

    Attributes
    ----------
    state : SideState
        At lift-off.
    slip : ndarray (2,)
        There, forward and to the right, m/s.
    itinerary : str
    time : float
        Duration, s.
    way : ndarray (3,)
        Of the centre meanwhile, m.
    """

    state: SideState
    slip: Array
    itinerary: str
    time: float
    way: Array


def bounced(
    model: BounceLaw | ContactModel | Contact3D,
    landing: SideState,
    ball: Ball,
    scaling: Scaling | None,
    side_slope: float,
    tol: float,
) -> Bounced:
    """Bounce a ball once, in the axes of the ground.

    Raises
    ------
    ModelError, LandingError, LiftOffError, nonsmooth.OptionError
        As :func:`side_rebound`.
    """
    velocity, down, about = landing.velocity[[0, 2]], float(landing.velocity[1]), landing.spin
    w = ball.radius * np.array([about[2], -about[0], about[1]])
    if isinstance(model, BounceLaw):
        after = _by_law(model, velocity, down, w)
    else:
        after = _by_contact(model, velocity, down, w, ball, scaling, side_slope, tol)
    w = after.omega / ball.radius
    v = np.array([after.xdot[0], after.ydot, after.xdot[1]])
    off = SideState(v, np.array([-w[1], w[2], w[0]]))
    return Bounced(off, after.slip, after.itinerary, after.time, after.way)


def model_inertia(model: BounceLaw | ContactModel | Contact3D) -> float:
    """Moment of inertia of a model's ball, or a refusal of what is no model.

    Raises
    ------
    ModelError
    """
    if not isinstance(model, (BounceLaw, ContactModel, Contact3D)):
        raise ModelError(f"model: expected a law or a contact model, received {model!r}.")
    return model.values["inertia"]


class _After(NamedTuple):
    """Lift-off in the axes of the ground: velocities, the spin's part of the contact point's with that about
    the normal as its third component, time and way."""

    xdot: Array
    ydot: float
    omega: Array
    slip: Array
    itinerary: str
    time: float = 0.0
    way: Array = np.zeros(3)


def _by_law(model: BounceLaw, v: Array, down: float, w: Array) -> _After:
    """Bounce by a rigid law, in its own plane if that is tilted towards the ball."""
    if isinstance(model, RigidBounce):
        off = rigid_lift_off_3d(model, v, down, w[:2])
        return _After(
            off.xdot, float(off.ydot), np.append(off.omega, w[2]), off.slip, str(off.case)
        )
    if not isinstance(model, TiltedBounce):
        raise ModelError(
            f"model: expected RigidBounce, TiltedBounce or a contact model, received {model!r}. The other "
            "laws are known in the plane of the bounce only."
        )
    speed = float(np.hypot(*v))
    e = v / speed if speed else np.array([1.0, 0.0])
    turn = np.array([[e[0], e[1]], [-e[1], e[0]]])  # into the direction of travel
    tilt = (
        model.tilt(math.hypot(speed, down), math.atan2(-down, speed))
        if callable(model.tilt)
        else model.tilt
    )
    b = float(np.asarray(tilt)) if speed else 0.0
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
    return _After(
        turn.T @ velocity,
        up * cos + float(hit.xdot[0]) * sin,
        np.append(turn.T @ spin, vertical),
        turn.T @ (velocity + spin),
        str(hit.case),
    )


def _by_contact(
    model: ContactModel | Contact3D,
    v: Array,
    down: float,
    w: Array,
    ball: Ball,
    scaling: Scaling | None,
    slope: float,
    tol: float,
) -> _After:
    surface = model if isinstance(model, Contact3D) else model.in_3d(side_slope=slope)
    if surface.values["side_slope"] != slope:
        raise ns.OptionError(
            f"side_slope: expected that of the model, {surface.values['side_slope']!r}, received {slope!r}."
        )
    scale = require_scaling(surface.model, ball, scaling)
    unit = scale.speed
    spin = (w if surface.drilling else w[:2]) / unit
    shot = simulate(surface, (v / unit).tolist(), down / unit, spin.tolist(), tol=tol)
    end = shot.lift_off
    about = end.omega * unit if surface.drilling else np.append(end.omega * unit, w[2])
    way = scale.length * np.array([end.x[0], end.y, end.x[1]])
    return _After(
        end.xdot * unit,
        end.ydot * unit,
        about,
        end.slip * unit,
        shot.itinerary,
        shot.time * scale.time,
        way,
    )
