"""Flight between bounces, with published drag and lift or without, and with side spin or without.

Axes are along the ground (x forward and uphill, z to the right) and normal to it (y); the ball is a point
with a spin vector whose direction stays:

    v' = g - k |v| (Cd v - Cl e x v),  omega' = -decay |v| omega / radius,  e = omega/|omega|,

with k = density area / (2 mass), and Cd and Cl of the spin ratio S = radius |omega| / |v| and the Reynolds
number Re = 2 radius |v| / viscosity; the lift falls as the sine of the angle between axis and path. In wind, which
is the same at every height, v is the velocity through the air. Without air the path is the parabola, in closed form.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..parameters import number
from ..units import GOLF, Ball, Landing
from .air import Air
from .ground import ExtrapolationWarning
from .side_spin import S, SideState, gravity_on, in_space, same_kind

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Flight(Generic[S]):
    """A flight that ended on the ground.

    Attributes
    ----------
    launch, landing : Landing or SideState
        Start and end, of one kind; the ball lands with a speed into the ground.
    time : float
        s.
    start : tuple of float
        x and y at launch, m; with a SideState x, y and z.
    range, side : float
        Way forward and to the right until landing, m.
    height : float
        Largest y, m.
    cautions : tuple of str
        What of it is an extrapolation.
    """

    launch: S
    landing: S
    time: float
    start: tuple[float, ...]
    range: float
    side: float
    height: float
    _path: Callable[[Array], Array]
    cautions: tuple[str, ...] = ()

    def __call__(self, t: ArrayLike) -> Array:
        """Return x and y, with a SideState x, y and z, at times after launch.

        Parameters
        ----------
        t : array_like (...)
            From 0 to ``time``, s.

        Returns
        -------
        ndarray (..., 2) or (..., 3)
        """
        return self._path(np.asarray(t, dtype=float))[..., : len(self.start)]


def flight(
    launch: S,
    ball: Ball = GOLF,
    *,
    air: Air | None = None,
    slope: float = 0.0,
    side_slope: float = 0.0,
    wind: tuple[float, float] = (0.0, 0.0),
    start: tuple[float, ...] = (0.0, 0.0),
    tol: float = 1e-10,
) -> Flight[S]:
    """Fly a ball until it comes down to $y = 0$.

    Parameters
    ----------
    launch : Landing or SideState
        A launch in a vertical plane, or with side spin. It rises, unless ``start`` is above the ground.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    air : Air, optional
        Drag and lift; none by default.
    slope, side_slope : float, optional
        Of the ground, rad, uphill forward and to the right; a side slope needs a SideState.
    wind : (float, float), optional
        m/s forward (from behind) and to the right, along the ground; it needs ``air``, and to the right a
        SideState.
    start : tuple of float, optional
        x, y and perhaps z of the centre relative to a ball that touches the ground, m; y may be a
        little below 0, as at lift-off from soft ground.
    tol : float, optional
        Relative tolerance (with air only).

    Returns
    -------
    Flight
        Carry, way to the side, height, time and landing; called with a time, the place.

    Raises
    ------
    nonsmooth.PointError
        A launch that never rises above the ground.
    nonsmooth.OptionError
        A launch of another type; a slope outside of $-pi/2$ to $pi/2$; wind without air; coefficients of
        air with which the ball never comes down.

    Warns
    -----
    ExtrapolationWarning
        A launch faster than any that the coefficients of the air were measured for.

    Examples
    --------
    >>> out = flight(Landing(10.0, 9.80665, 0.0))
    >>> out.time, out.range, round(out.height, 12)
    (2.0, 20.0, 4.903325)

    A drive, and one whose axis is tilted by ten degrees, a fade of a right-handed player:

    >>> from bounce.golf import SMITS_SMITH, axis_spin
    >>> drive = flight(Landing(70 * math.cos(0.19), 70 * math.sin(0.19), 283.0), air=SMITS_SMITH)
    >>> f"{drive.range:.0f} m, lands at {math.degrees(drive.landing.angle):.0f} deg"
    '215 m, lands at 39 deg'
    >>> back, side, vertical = axis_spin(283.0, math.radians(10), 0.19)
    >>> launch = Landing(70 * math.cos(0.19), 70 * math.sin(0.19), back)
    >>> fade = flight(SideState.of(launch, side, vertical), air=SMITS_SMITH)
    >>> f"{fade.range:.0f} m, {fade.side:.0f} m to the right"
    '212 m, 19 m to the right'
    """
    gravity, state = gravity_on(launch, "launch", slope, side_slope), in_space(launch)
    given = [number(value, "start", ns.PointError) for value in start]
    if len(given) not in (2, 3):
        raise ns.PointError(f"start: expected x, y and perhaps z, received {start!r}.")
    place = np.array([*given, 0.0][:3])
    blown = _wind(wind, air, launch)
    up, height, down = float(state.velocity[1]), float(place[1]), -float(gravity[1])
    if height <= 0.0 and not (up > 0.0 and up**2 > -2 * down * height):
        raise ns.PointError(
            f"launch: the ball never rises above the ground, from y = {height!r} with ydot = {up!r}. "
            "Give a launch with a larger ydot, or a start above the ground."
        )
    in_vacuum = (up + math.sqrt(up**2 + 2 * down * height)) / down
    cautions: tuple[str, ...] = ()
    if air is None:
        fall = _parabola(state, gravity, place, in_vacuum)
    else:
        fall = _through_air(state, ball, air, gravity, blown, place, in_vacuum, tol)
        cautions = air.cautions(math.hypot(*(state.velocity - blown)), ball)
    for caution in cautions:
        warnings.warn(caution, ExtrapolationWarning, stacklevel=2)
    landing = same_kind(launch, fall.velocity, fall.spin)
    begin = tuple(place.tolist()[: 2 if isinstance(launch, Landing) else 3])
    way = (float(fall.way[0]), float(fall.way[2]))
    return Flight(launch, landing, fall.time, begin, *way, fall.height, fall.path, cautions)


def _wind(wind: tuple[float, float], air: Air | None, launch: object) -> Array:
    """The velocity of the air, forward, up and to the right."""
    try:
        along, across = (number(value, "wind", ns.OptionError) for value in wind)
    except (TypeError, ValueError) as error:
        raise ns.OptionError(f"wind={wind!r}: expected m/s forward and to the right.") from error
    if (along or across) and air is None:
        raise ns.OptionError(f"wind={wind!r}: there is no air. Give air=, such as SMITS_SMITH.")
    if across and not isinstance(launch, SideState):
        raise ns.OptionError(
            f"wind={wind!r}: it blows across the plane of the flight. Give the launch as a SideState."
        )
    return np.array([along, 0.0, across])


class _Fall(NamedTuple):
    """A flight in numbers: the way from the start and the state at the end, and the path."""

    way: Array
    velocity: Array
    spin: Array
    time: float
    height: float
    path: Callable[[Array], Array]


def _parabola(state: SideState, gravity: Array, place: Array, time: float) -> _Fall:
    def path(t: Array) -> Array:
        t = t[..., None]
        return np.asarray(place + state.velocity * t + gravity * t**2 / 2)

    way = state.velocity * time + gravity * time**2 / 2
    height = float(place[1] - max(state.velocity[1], 0.0) ** 2 / (2 * gravity[1]))
    return _Fall(way, state.velocity + gravity * time, state.spin, time, height, path)


def _through_air(
    state: SideState,
    ball: Ball,
    air: Air,
    gravity: Array,
    wind: Array,
    place: Array,
    in_vacuum: float,
    tol: float,
) -> _Fall:
    """Integrate place, velocity and spin, in a vertical plane only those that change."""
    from scipy.integrate import solve_ivp

    velocity, spin = state.velocity.copy(), state.spin.copy()
    flat = not (velocity[2] or gravity[2] or wind[2] or spin[0] or spin[1])
    axes, turning = (2, slice(2, 3)) if flat else (3, slice(3))

    def ground(t: float, z: Any) -> float:
        return float(z[1])

    def apex(t: float, z: Any) -> float:
        return float(z[axes + 1])

    ground.terminal, ground.direction = True, -1  # type: ignore[attr-defined]
    apex.direction = -1  # type: ignore[attr-defined]

    def solve(dense: bool) -> Any:
        return solve_ivp(
            _field(ball, air, gravity.tolist(), wind.tolist(), flat),
            (0.0, 10 * in_vacuum + 10.0),
            np.concatenate([place[:axes], state.velocity[:axes], state.spin[turning]]),
            method="DOP853",
            rtol=max(tol, 1e-13),
            atol=max(tol, 1e-13),
            events=(ground, apex),
            dense_output=dense,
            max_step=in_vacuum / 20,  # no step over a whole hop
        )

    run = solve(False)
    if run.status != 1:
        raise ns.OptionError(
            f"air: the ball does not come down within {run.t[-1]:g} s ({run.message}). Check the "
            "coefficients of drag and lift."
        )

    @cache
    def between() -> Any:
        return solve(True).sol  # three more evaluations a step, for the path only

    def path(t: Array) -> Array:
        positions = np.repeat(place[:, None], t.size, axis=1)
        positions[:axes] = between()(t.ravel())[:axes]
        return np.moveaxis(positions.reshape(3, *t.shape), 0, -1)

    end, way = run.y[:, -1], np.zeros(3)
    way[:axes] = end[:axes] - place[:axes]
    velocity[:axes], spin[turning] = end[axes : 2 * axes], end[2 * axes :]
    height = max([float(place[1]), *(float(top[1]) for top in run.y_events[1])])
    return _Fall(way, velocity, spin, float(run.t[-1]), height, path)


def _field(
    ball: Ball, air: Air, gravity: list[float], wind: list[float], flat: bool
) -> Callable[[float, Any], list[float]]:
    area = math.pi * ball.radius**2
    k = air.density * area / (2 * ball.mass)
    gx, gy, gz = gravity
    wind_x, _, wind_z = wind

    def field(t: float, z: Any) -> list[float]:
        x = z.tolist()  # plain numbers: NumPy's are slow one by one
        u, v, w, p, q, r = (*x[2:4], 0.0, 0.0, 0.0, x[4]) if flat else x[3:]
        moved_x, moved_z = u, w
        u, w = u - wind_x, w - wind_z
        speed, turning = math.hypot(u, v, w), math.hypot(p, q, r)
        drag, lift, decay, (a, b, c) = 0.0, 0.0, -air.spin_decay * speed, (0.0, 0.0, 0.0)
        if speed > 0.0:
            ratio = min(ball.radius * turning / speed, air.largest_spin_ratio)
            reynolds = 2 * ball.radius * speed / air.viscosity
            drag = k * speed * air.drag(ratio, reynolds)
            lift = k * speed * air.lift(ratio, reynolds)
        if turning > 0.0:
            a, b, c = p / turning, q / turning, r / turning
        forward = gx - drag * u + lift * (b * w - c * v)
        up = gy - drag * v + lift * (c * u - a * w)
        if flat:
            return [moved_x, v, forward, up, decay * r / ball.radius]
        right = gz - drag * w + lift * (a * v - b * u)
        return [
            moved_x,
            v,
            moved_z,
            forward,
            up,
            right,
            *(decay * s / ball.radius for s in (p, q, r)),
        ]

    return field
