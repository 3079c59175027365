"""Rigid impact on a plane tilted towards the ball (Penner 2002, Biber et al. 2023)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..parameters import number, numbers
from .law import BounceLaw, RigidShot, checked_landings
from .rigid import Restitution, RigidBounce

Array = NDArray[np.float64]
Tilt = float | Callable[[Any, Any], ArrayLike]


class TiltedBounce(BounceLaw):
    """Rigid impact on a plane tilted towards the ball, as if it hit the front wall of its own dent.

    The plane's normal leans by ``tilt`` against the horizontal velocity, so some of the forward
    speed becomes height. A ball that falls vertically meets no tilt, so a constant tilt jumps there. A ball
    with much backspin may leave with ``ydot`` not positive, into the ground: the law does not exclude it.

    Source: Penner 2002, The run of a golf ball, Can. J. Phys. 80, 931.

    Parameters
    ----------
    mu : float
        Friction coefficient.
    restitution : float or callable
        Of the normal speed relative to the tilted plane.
    tilt : float or callable
        rad in $[0, pi/2)$; a function (speed, angle of descent in rad) is allowed.
    inertia : float, optional
        Moment of inertia over mass and radius squared; default $2/5$.

    Examples
    --------
    >>> import bounce, math
    >>> law = bounce.laws.TiltedBounce(mu=0.998, restitution=0.147, tilt=math.radians(18.4))
    >>> shot = law.lift_off(xdot=22.7, ydot=-17.3, omega=4.7)
    >>> [round(float(v), 3) for v in (shot.xdot, shot.ydot, shot.omega)]
    [8.529, 6.49, -10.142]
    """

    plane: RigidBounce
    tilt: Tilt

    def __init__(self, *, restitution: Restitution, tilt: Tilt, **values: float):
        super().__init__(**values)
        mu, inertia = self.values["mu"], self.values["inertia"]
        self._set("plane", RigidBounce(restitution=restitution, mu=mu, inertia=inertia))
        if not callable(tilt):
            _check_tilt(np.asarray(number(tilt, "tilt")))
        self._set("tilt", tilt)

    @property
    def restitution(self) -> Restitution:
        """Of the normal speed relative to the tilted plane."""
        return self.plane.restitution

    def lift_off(self, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike) -> RigidShot:
        """Return the state after the impact.

        Parameters
        ----------
        xdot, ydot, omega : array_like
            At touch-down, broadcast against each other; ``ydot < 0``.

        Returns
        -------
        RigidShot
            Speeds along the true ground; impulses and case along the tilted plane.
        """
        u, v, w = checked_landings(xdot, ydot, omega)
        tilt = np.sign(u) * tilt_at(self, u, v)
        cos, sin = np.cos(tilt), np.sin(tilt)
        shot = self.plane.lift_off(u * cos + v * sin, v * cos - u * sin, w)
        xdot_off = shot.xdot * cos - shot.ydot * sin
        ydot_off = shot.ydot * cos + shot.xdot * sin
        return replace(shot, xdot=xdot_off, ydot=ydot_off, slip=xdot_off + shot.omega)

    def caution(self, xdot: float, ydot: float) -> str:
        """Return in words whether the ball comes in beyond the normal of its tilted plane.

        Parameters
        ----------
        xdot, ydot : float
            m/s.
        """
        angle = math.atan2(-ydot, abs(xdot))
        steepest = math.pi / 2 - float(tilt_at(self, xdot, ydot))
        if angle <= steepest:
            return ""
        return (
            f"a descent of {math.degrees(angle):.3g} deg, steeper than {math.degrees(steepest):.3g} deg, "
            "the normal of the tilted plane, which throws the ball back"
        )

    def _structure(self) -> tuple[Any, ...]:
        return (self.restitution, self.tilt)

    def options(self) -> dict[str, Any]:
        return {"restitution": self.restitution, "tilt": self.tilt}


def tilt_at(law: TiltedBounce, xdot: ArrayLike, ydot: ArrayLike) -> Array:
    """The tilt for speeds along the ground and down onto it."""
    if not callable(law.tilt):
        return np.asarray(law.tilt)
    angle = np.arctan2(-np.asarray(ydot), np.abs(xdot))
    return _check_tilt(np.asarray(law.tilt(np.hypot(xdot, ydot), angle), dtype=float))


def _check_tilt(tilt: Array) -> Array:
    if not np.all((tilt >= 0) & (tilt < math.pi / 2)):
        wrong = tilt[~((tilt >= 0) & (tilt < math.pi / 2))].flat[0]
        raise ns.ParameterError(
            f"tilt: expected radians in [0, pi/2), received {wrong}. Degrees go through math.radians; "
            "a law that extrapolates beyond its data can exceed a right angle."
        )
    return tilt


def penner_restitution(speed: ArrayLike) -> Array:
    """Restitution of a golf ball on turf at a normal speed (m/s) relative to the tilted plane.

    $0.510 - 0.0375 v + 0.000903 v^2$ up to 20 m/s, 0.120 beyond.

    Parameters
    ----------
    speed : array_like (...)
        Normal speed in m/s.

    Returns
    -------
    ndarray (...)
        Normal speed after the impact over that before, relative to the tilted plane.

    Notes
    -----
    Source: Penner 2002, p. 933, eq. 5, as quoted by public golf simulators.

    Examples
    --------
    >>> penner_restitution([1.0, 10.0, 16.07, 30.0]).round(3)
    array([0.473, 0.225, 0.141, 0.12 ])
    """
    v = numbers(speed, "speed")
    return np.where(v <= 20.0, 0.510 - 0.0375 * v + 0.000903 * v**2, 0.120)


def penner_tilt(speed: ArrayLike, angle: ArrayLike) -> Array:
    """Penner's tilt (rad) at a speed (m/s) and angle of descent (rad): zero for a vertical fall.

    $15.4 (v/18.6) (phi/44.4)$ degrees at v m/s, through one measured impact on a green, where $phi$ is
    the angle of the path with the *vertical* in degrees. Some public simulators take that with the ground
    instead; Penner's worked heights come out with the vertical only (tests/bounce).

    Parameters
    ----------
    speed : array_like (...)
        Speed of landing in m/s.
    angle : array_like (...)
        Angle of descent below the horizontal in rad.

    Returns
    -------
    ndarray (...)
        Angle of the plane's normal from the vertical, rad.

    Notes
    -----
    Source: Penner 2002, p. 934, eqs. 6-8, as quoted by public golf simulators.

    Examples
    --------
    >>> import math
    >>> f"{math.degrees(penner_tilt(28.5, math.radians(37.3))):.2f}"
    '28.01'
    """
    measured = math.radians(15.4) / (18.6 * math.radians(44.4))
    return measured * numbers(speed, "speed") * (math.pi / 2 - numbers(angle, "angle"))


class PennerBounce(BounceLaw):
    """Penner's law: the plane tilts and the restitution falls with speed; speeds in m/s.

    Source: Penner 2002, The run of a golf ball, Can. J. Phys. 80, 931, as quoted by public golf
    simulators. It gives his worked heights of the first bounce: 1.176 m (printed: 1.17) for a drive
    that lands at 26.2 m/s, 46.2 deg from the vertical, with 315 rad/s of backspin, and 2.817 m
    (2.82) for 26.8 m/s, 68.0 deg, 224 rad/s.

    Parameters
    ----------
    mu : float, optional
        0.40 (Penner 2002, p. 933).
    inertia : float, optional
        Moment of inertia over mass and radius squared; default $2/5$.

    Examples
    --------
    >>> import bounce
    >>> shot = bounce.laws.PennerBounce().lift_off(xdot=22.7, ydot=-17.3, omega=4.7)
    >>> f"{float(shot.ydot)**2 / (2 * 9.80665):.2f} m high"
    '1.91 m high'
    """

    parameters = dict(mu=0.40)

    tilted: TiltedBounce

    def __init__(self, **values: float):
        super().__init__(**values)
        law = TiltedBounce(restitution=penner_restitution, tilt=penner_tilt, **self.values)
        self._set("tilted", law)

    def lift_off(self, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike) -> RigidShot:
        """Return the state after the impact, in m/s.

        Parameters
        ----------
        xdot, ydot, omega : array_like
            At touch-down, broadcast against each other; ``ydot < 0``.

        Returns
        -------
        RigidShot
            As of :class:`TiltedBounce`.
        """
        return self.tilted.lift_off(xdot, ydot, omega)

    def caution(self, xdot: float, ydot: float) -> str:
        """Return in words whether the ball comes in beyond the normal of its tilted plane.

        Parameters
        ----------
        xdot, ydot : float
            m/s.
        """
        return self.tilted.caution(xdot, ydot)
