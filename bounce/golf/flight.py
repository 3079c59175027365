"""Ballistic flight between bounces, in a vertical plane, with published drag and lift or without.

Axes are along the ground (x, uphill) and normal to it (y); the ball is a point with spin:

    xddot = -g sin(slope) - k v (Cd xdot + Cl ydot),  yddot = -g cos(slope) - k v (Cd ydot - Cl xdot),
    omegadot = -decay v omega / radius,  k = density area / (2 mass),

with Cd and Cl of the spin ratio S = radius |omega| / v and the Reynolds number Re = 2 radius v /
viscosity; Cl has the sign of the backspin. Still air, no side spin. Without air the path is the
parabola, in closed form.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..errors import require
from ..parameters import LIMITS, number
from ..units import GOLF, GRAVITY, Ball, Landing
from .air import Air
from .ground import ExtrapolationWarning

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Flight:
    """A flight that ended on the ground.

    Attributes
    ----------
    launch, landing : Landing
        Start and end; ``landing.ydot < 0``.
    time : float
        s.
    start : tuple of float
        x and y at launch, m.
    range : float
        x at landing less x at launch, m.
    height : float
        Largest y, m.
    cautions : tuple of str
        What of it is an extrapolation.
    """

    launch: Landing
    landing: Landing
    time: float
    start: tuple[float, float]
    range: float
    height: float
    _path: Callable[[Array], Array]
    cautions: tuple[str, ...] = ()

    def __call__(self, t: ArrayLike) -> Array:
        """Return x and y at times after launch.

        Parameters
        ----------
        t : array_like (...)
            From 0 to ``time``, s.

        Returns
        -------
        ndarray (..., 2)
        """
        return self._path(np.asarray(t, dtype=float))


def flight(
    launch: Landing,
    ball: Ball = GOLF,
    *,
    air: Air | None = None,
    slope: float = 0.0,
    start: tuple[float, float] = (0.0, 0.0),
    tol: float = 1e-10,
) -> Flight:
    """Fly a ball until it comes down to $y = 0$.

    Parameters
    ----------
    launch : Landing
        With ``ydot > 0``, or any where ``start`` is above the ground.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    air : Air, optional
        Drag and lift; none by default.
    slope : float, optional
        Of the ground, rad, uphill for positive x.
    start : tuple of float, optional
        x and y of the centre relative to a ball that touches the ground, m; y may be a little
        below 0, as at lift-off from soft ground.
    tol : float, optional
        Relative tolerance (with air only).

    Returns
    -------
    Flight
        Carry, height, time and landing; called with a time, the place.

    Raises
    ------
    nonsmooth.PointError
        A launch that never rises above the ground.
    nonsmooth.OptionError
        A slope outside of $-pi/2$ to $pi/2$.

    Warns
    -----
    ExtrapolationWarning
        A launch faster than any that the coefficients of the air were measured for.

    Examples
    --------
    >>> out = flight(Landing(10.0, 9.80665, 0.0))
    >>> out.time, out.range, round(out.height, 12)
    (2.0, 20.0, 4.903325)
    >>> from bounce.golf import SMITS_SMITH
    >>> drive = flight(Landing(70 * math.cos(0.19), 70 * math.sin(0.19), 283.0), air=SMITS_SMITH)
    >>> f"{drive.range:.0f} m, lands at {math.degrees(drive.landing.angle):.0f} deg"
    '215 m, lands at 39 deg'
    """
    require(launch, Landing, "launch", "bounce.Landing(xdot, ydot, omega) is one, in SI units.")
    tilt = number(slope, "slope", ns.OptionError)
    if not LIMITS["in (-pi/2, pi/2)"](tilt):
        raise ns.OptionError(f"slope: expected radians in (-pi/2, pi/2), received {slope!r}.")
    x0, y0 = (number(value, "start", ns.PointError) for value in start)
    lift = GRAVITY * math.cos(tilt)
    rises = launch.ydot > 0 and launch.ydot**2 > -2 * lift * y0
    if y0 <= 0.0 and not rises:
        raise ns.PointError(
            f"launch: expected a ball that rises above the ground, received ydot = {launch.ydot!r} at "
            f"y = {y0!r}."
        )
    if air is None:
        return _parabola(launch, tilt, x0, y0)
    found = _through_air(launch, ball, air, tilt, x0, y0, tol)
    for caution in found.cautions:
        warnings.warn(caution, ExtrapolationWarning, stacklevel=2)
    return found


def _parabola(launch: Landing, slope: float, x0: float, y0: float) -> Flight:
    along, down = GRAVITY * math.sin(slope), GRAVITY * math.cos(slope)
    u, v = launch.xdot, launch.ydot
    time = (v + math.sqrt(v**2 + 2 * down * y0)) / down

    def path(t: Array) -> Array:
        x, y = x0 + u * t - along * t**2 / 2, y0 + v * t - down * t**2 / 2
        return np.stack([x, y], axis=-1)

    landing = Landing(u - along * time, v - down * time, launch.omega)
    height = y0 + max(v, 0.0) ** 2 / (2 * down)
    return Flight(launch, landing, time, (x0, y0), u * time - along * time**2 / 2, height, path)


def _through_air(
    launch: Landing, ball: Ball, air: Air, slope: float, x0: float, y0: float, tol: float
) -> Flight:
    start = [x0, y0, launch.xdot, launch.ydot, launch.omega]
    in_vacuum = _parabola(launch, slope, x0, y0).time
    fall = fly(_field(ball, air, slope), start, 2, in_vacuum, tol)
    x, _, xdot, ydot, omega = (float(value) for value in fall.end)
    landing = Landing(xdot, ydot, omega)
    cautions = air.cautions(launch.speed, ball)
    return Flight(launch, landing, fall.time, (x0, y0), x - x0, fall.height, fall.path, cautions)


class Fall(NamedTuple):
    """A flight through air in numbers.

    Attributes
    ----------
    end : ndarray
        The state on the ground.
    time : float
    height : float
        The greatest.
    path : callable
        The place at times.
    """

    end: Array
    time: float
    height: float
    path: Callable[[Array], Array]


def fly(
    field: Callable[[float, Any], Any], start: ArrayLike, axes: int, in_vacuum: float, tol: float
) -> Fall:
    """Integrate a flight through air until the ball is on the ground.

    Parameters
    ----------
    field : callable
        Rate of the state: the place, then the velocity, then the spin; the second axis is up.
    start : array_like
        The state at first.
    axes : int
        Of the place.
    in_vacuum : float
        How long it would fly there, s.
    tol : float
        Relative and absolute tolerance.

    Raises
    ------
    nonsmooth.OptionError
        It does not come down.
    """
    from scipy.integrate import solve_ivp

    def ground(t: float, z: Any) -> float:
        return float(z[1])

    def apex(t: float, z: Any) -> float:
        return float(z[axes + 1])

    ground.terminal, ground.direction = True, -1  # type: ignore[attr-defined]
    apex.direction = -1  # type: ignore[attr-defined]

    def solve(dense: bool) -> Any:
        return solve_ivp(
            field,
            (0.0, 10 * in_vacuum + 10.0),
            start,
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
            f"air: expected a ball that comes down, received {run.message} after {run.t[-1]:g} s. Are "
            "the coefficients of drag and lift sensible?"
        )

    @cache
    def between() -> Any:
        return solve(True).sol  # three evaluations a step more: only for those who ask for the path

    def path(t: Array) -> Array:
        return np.moveaxis(between()(t.ravel())[:axes].reshape(axes, *t.shape), 0, -1)

    tops = [float(state[1]) for state in run.y_events[1]]
    return Fall(run.y[:, -1], float(run.t[-1]), max([float(run.y[1, 0]), *tops]), path)


def _field(ball: Ball, air: Air, slope: float) -> Callable[[float, Any], list[float]]:
    area = math.pi * ball.radius**2
    k = air.density * area / (2 * ball.mass)
    along, down = GRAVITY * math.sin(slope), GRAVITY * math.cos(slope)

    def field(t: float, z: Any) -> list[float]:
        _, _, u, v, omega = z.tolist()  # plain numbers: NumPy's are slow one by one
        speed = math.hypot(u, v)
        if speed == 0.0:
            return [u, v, -along, -down, 0.0]
        ratio = min(ball.radius * abs(omega) / speed, air.largest_spin_ratio)
        reynolds = 2 * ball.radius * speed / air.viscosity
        drag = k * speed * air.drag(ratio, reynolds)
        lift = k * speed * air.lift(ratio, reynolds) * ((omega > 0) - (omega < 0))
        return [
            u,
            v,
            -along - drag * u - lift * v,
            -down - drag * v + lift * u,
            -air.spin_decay * speed * omega / ball.radius,
        ]

    return field
