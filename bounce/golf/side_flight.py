"""Flight with side spin: the curve of a draw or a fade, in SI units.

Axes are along the ground (x forward and uphill, z to the right) and normal to it (y); the ball is a point with
a spin vector whose direction stays:

    v' = g - k |v| (Cd v - Cl e x v),  omega' = -decay |v| omega / radius,  e = omega/|omega|,

with Cd, Cl, k and the decay of :class:`Air`. With the axis across the path it is the flight in a vertical
plane; the lift falls as the sine of the angle between axis and path.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..errors import require
from ..parameters import LIMITS, number, numbers
from ..units import GOLF, GRAVITY, Ball, Landing
from .air import Air
from .flight import fly
from .ground import ExtrapolationWarning

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SideState:
    """A ball with side spin: velocity and spin in the axes of the ground.

    Parameters
    ----------
    velocity : array_like (3,)
        Forward, normal to the ground, to the right; m/s.
    spin : array_like (3,)
        About these axes, rad/s: side spin (right positive), about the normal, backspin.

    Examples
    --------
    >>> import bounce
    >>> SideState.of(bounce.Landing(15.0, -20.0, 900.0), side_spin=100.0).spin
    array([100.,   0., 900.])
    """

    velocity: Array
    spin: Array

    def __post_init__(self) -> None:
        for name in ("velocity", "spin"):
            given = numbers(getattr(self, name), name, ns.PointError)
            if given.shape != (3,) or not np.all(np.isfinite(given)):
                raise ns.PointError(
                    f"{name}: expected three finite numbers (forward, up, right), received "
                    f"{getattr(self, name)!r}."
                )
            object.__setattr__(self, name, given)

    @classmethod
    def of(
        cls,
        state: Landing,
        side_spin: float = 0.0,
        vertical_spin: float = 0.0,
        side_slope: float = 0.0,
    ) -> SideState:
        """Return a state in a vertical plane, with spins about the other axes, in the ground's axes.

        Parameters
        ----------
        state : Landing
            Speed forward, speed up, backspin.
        side_spin, vertical_spin : float, optional
            About the direction of travel and the vertical, rad/s (see :func:`axis_spin`).
        side_slope : float, optional
            Of the ground, uphill to the right, rad: its normal leans to the left.
        """
        cos, sin = math.cos(side_slope), math.sin(side_slope)
        velocity = [state.xdot, state.ydot * cos, state.ydot * sin]
        normal = vertical_spin * cos - state.omega * sin
        return cls(
            np.array(velocity),
            np.array([side_spin, normal, state.omega * cos + vertical_spin * sin]),
        )

    @property
    def heading(self) -> float:
        """Direction along the ground, rad from forward to the right."""
        return math.atan2(self.velocity[2] + 0.0, self.velocity[0])

    @property
    def in_plane(self) -> Landing:
        """In the plane of travel: speed along the ground, speed up, backspin across it."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        along = float(np.hypot(self.velocity[0], self.velocity[2]))
        return Landing(along, float(self.velocity[1]), float(self.spin[2] * c - self.spin[0] * s))


@dataclass(frozen=True, eq=False)
class SideFlight:
    """A flight with side spin that ended on the ground.

    Attributes
    ----------
    launch, landing : SideState
        Start and end.
    time : float
        s.
    start : tuple of float
        x, y and z at launch, m.
    range, side : float
        Way forward and to the right until landing, m.
    height : float
        Largest y, m.
    cautions : tuple of str
        What of it is an extrapolation.
    """

    launch: SideState
    landing: SideState
    time: float
    start: tuple[float, float, float]
    range: float
    side: float
    height: float
    _path: Callable[[Array], Array]
    cautions: tuple[str, ...] = ()

    def __call__(self, t: ArrayLike) -> Array:
        """Return x, y and z at times after launch.

        Parameters
        ----------
        t : array_like (...)
            From 0 to ``time``, s.

        Returns
        -------
        ndarray (..., 3)
        """
        return self._path(np.asarray(t, dtype=float))


def pull(slope: float, side_slope: float) -> Array:
    """Gravity in the axes of the ground, ndarray (3,).

    Raises
    ------
    nonsmooth.OptionError
        A slope outside of -pi/2 to pi/2.
    """
    for name, value in (("slope", slope), ("side_slope", side_slope)):
        if not LIMITS["in (-pi/2, pi/2)"](number(value, name, ns.OptionError)):
            raise ns.OptionError(f"{name}: expected radians in (-pi/2, pi/2), received {value!r}.")
    across = math.cos(slope)
    along = [math.sin(slope), across * math.cos(side_slope), across * math.sin(side_slope)]
    return -GRAVITY * np.array(along)


def side_flight(
    launch: SideState,
    ball: Ball = GOLF,
    *,
    air: Air | None = None,
    slope: float = 0.0,
    side_slope: float = 0.0,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tol: float = 1e-10,
) -> SideFlight:
    """Fly a ball with side spin until it comes down to $y = 0$.

    Parameters
    ----------
    launch : SideState
        Velocity and spin.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    air : Air, optional
        Drag and lift; none by default.
    slope, side_slope : float, optional
        Of the ground, rad, uphill forward and to the right.
    start : tuple of float, optional
        x, y and z of the centre, m.
    tol : float, optional
        Relative tolerance (with air only).

    Returns
    -------
    SideFlight
        Carry, way to the side, height, time and landing; called with a time, the place.

    Raises
    ------
    nonsmooth.PointError
        A launch that never rises above the ground.
    nonsmooth.OptionError
        A slope outside of $-pi/2$ to $pi/2$; coefficients with which the ball never comes down.

    Warns
    -----
    ExtrapolationWarning
        A launch faster than any that the coefficients of the air were measured for.

    Examples
    --------
    A drive whose axis is tilted by ten degrees, a fade of a right-handed player:

    >>> import bounce, math
    >>> spin = bounce.golf.axis_spin(283.0, math.radians(10), 0.19)
    >>> launch = bounce.Landing(70 * math.cos(0.19), 70 * math.sin(0.19), spin.backspin)
    >>> fade = side_flight(SideState.of(launch, spin.side, spin.vertical), air=bounce.golf.SMITS_SMITH)
    >>> f"{fade.range:.0f} m, {fade.side:.0f} m to the right"
    '212 m, 19 m to the right'
    """
    require(launch, SideState, "launch", "bounce.golf.SideState.of(landing, side=...) is one.")
    gravity = pull(slope, side_slope)
    place = np.array([number(value, "start", ns.PointError) for value in start])
    up, height = float(launch.velocity[1]), float(place[1])
    if height <= 0.0 and not (up > 0.0 and up**2 > 2 * gravity[1] * height):
        raise ns.PointError(
            f"launch: expected a ball that rises above the ground, received ydot = {up!r} at "
            f"y = {height!r}."
        )
    down = -float(gravity[1])
    in_vacuum = (up + math.sqrt(up**2 + 2 * down * height)) / down
    if air is None:
        return _parabola(launch, gravity, place, in_vacuum)
    found = _through_air(launch, ball, air, gravity, place, in_vacuum, tol)
    for caution in found.cautions:
        warnings.warn(caution, ExtrapolationWarning, stacklevel=2)
    return found


def _parabola(launch: SideState, gravity: Array, place: Array, time: float) -> SideFlight:
    def path(t: Array) -> Array:
        t = t[..., None]
        return np.asarray(place + launch.velocity * t + gravity * t**2 / 2)

    end = path(np.array(time)) - place
    landing = SideState(launch.velocity + gravity * time, launch.spin)
    height = float(place[1] - max(launch.velocity[1], 0.0) ** 2 / (2 * gravity[1]))
    start = (float(place[0]), float(place[1]), float(place[2]))
    return SideFlight(launch, landing, time, start, float(end[0]), float(end[2]), height, path)


def _through_air(
    launch: SideState,
    ball: Ball,
    air: Air,
    gravity: Array,
    place: Array,
    in_vacuum: float,
    tol: float,
) -> SideFlight:
    begin = np.concatenate([place, launch.velocity, launch.spin])
    fall = fly(_field(ball, air, gravity), begin, 3, in_vacuum, tol)
    way, start = fall.end[:3] - place, (float(place[0]), float(place[1]), float(place[2]))
    landing = SideState(fall.end[3:6], fall.end[6:])
    sizes = (float(way[0]), float(way[2]), fall.height)
    cautions = air.cautions(float(np.linalg.norm(launch.velocity)), ball)
    return SideFlight(launch, landing, fall.time, start, *sizes, fall.path, cautions)


def _field(ball: Ball, air: Air, gravity: Array) -> Callable[[float, Array], list[float]]:
    k = air.density * math.pi * ball.radius**2 / (2 * ball.mass)

    g = gravity.tolist()

    def field(t: float, z: Array) -> list[float]:
        # plain numbers: NumPy's are slow three by three
        _, _, _, u, v, w, p, q, r = z.tolist()
        speed, turning = math.hypot(u, v, w), math.hypot(p, q, r)
        if speed == 0.0:
            return [u, v, w, *g, 0.0, 0.0, 0.0]
        ratio = min(ball.radius * turning / speed, air.largest_spin_ratio)
        reynolds = 2 * ball.radius * speed / air.viscosity
        drag = k * speed * air.drag(ratio, reynolds)
        lift = k * speed * air.lift(ratio, reynolds) / turning if turning else 0.0
        decay = air.spin_decay * speed / ball.radius
        return [
            u,
            v,
            w,
            g[0] - drag * u + lift * (q * w - r * v),
            g[1] - drag * v + lift * (r * u - p * w),
            g[2] - drag * w + lift * (p * v - q * u),
            -decay * p,
            -decay * q,
            -decay * r,
        ]

    return field
