"""Bounce laws in closed form that people use today, and the values published for turf.

All are rigid impacts (:class:`RigidBounce`) with one change each: the plane of the impact is
tilted (Penner 2002, Biber et al. 2023), or the slip is thrown back (Cross 2002). They take and give
xdot, ydot and the surface speed of the spin (spin times radius) in one unit of speed, m/s where the
law has a speed in it. :func:`rebound` is the same in SI units for these laws and contact models.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from .contact import ContactModel
from .errors import ModelError
from .parameters import number
from .rigid import Restitution, RigidBounce, RigidShot
from .shot import State, simulate
from .units import GOLF, Ball, Landing, Scaling

Array = NDArray[np.float64]
Tilt = float | Callable[[Any, Any], ArrayLike]


class TiltedBounce(RigidBounce):
    """Rigid impact on a plane tilted towards the ball, as if it hit the front wall of its own dent.

    The plane's normal leans by ``tilt`` against the horizontal velocity, so some of the forward
    speed becomes height. A ball that falls vertically meets no tilt, so a constant tilt jumps there. A ball
    with much backspin may leave with ydot <= 0, into the ground: the law does not exclude it.

    Parameters
    ----------
    mu : float
    restitution : float or callable
        Of the normal speed relative to the tilted plane.
    tilt : float or callable
        rad in [0, pi/2); a function (speed, angle of descent in rad) is allowed.
    inertia : float, optional

    Source: Penner 2002, The run of a golf ball, Can. J. Phys. 80, 931.

    Examples
    --------
    >>> import bounce, math
    >>> law = bounce.TiltedBounce(mu=0.998, restitution=0.147, tilt=math.radians(18.4))
    >>> shot = law.lift_off(xdot=22.7, ydot=-17.3, omega=4.7)
    >>> [round(float(v), 3) for v in (shot.xdot, shot.ydot, shot.omega)]
    [8.529, 6.49, -10.142]
    """

    tilt: Tilt

    def __init__(self, *, restitution: Restitution, tilt: Tilt, **values: float):
        super().__init__(restitution=restitution, hypothesis="kinematic", **values)
        if not callable(tilt):
            _check_tilt(np.asarray(number(tilt, "tilt")))
        self._set("tilt", tilt)

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
        u, v, w = self._landing(xdot, ydot, omega)
        if callable(self.tilt):
            angle = np.arctan2(-v, np.abs(u))
            tilt = _check_tilt(np.asarray(self.tilt(np.hypot(u, v), angle), dtype=float))
        else:
            tilt = np.asarray(self.tilt)
        tilt = np.sign(u) * tilt
        cos, sin = np.cos(tilt), np.sin(tilt)
        shot = super().lift_off(u * cos + v * sin, v * cos - u * sin, w)
        xdot_off = shot.xdot * cos - shot.ydot * sin
        ydot_off = shot.ydot * cos + shot.xdot * sin
        return replace(shot, xdot=xdot_off, ydot=ydot_off, slip=xdot_off + shot.omega)

    def _landing(
        self, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Check the landing relative to the true ground and broadcast it."""
        shot = RigidBounce(mu=1.0, restitution=1.0).lift_off(xdot, ydot, omega)
        u, v, w = (
            np.broadcast_to(np.asarray(a, float), shot.xdot.shape) for a in (xdot, ydot, omega)
        )
        return u, v, w

    def _structure(self) -> tuple[Any, ...]:
        return (*super()._structure(), self.tilt)

    def _options(self) -> dict[str, Any]:
        return {**super()._options(), "tilt": self.tilt}


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

    0.510 - 0.0375 v + 0.000903 v^2 up to 20 m/s, 0.120 beyond.

    Parameters
    ----------
    speed : array_like (...)
        Normal speed in m/s.

    Returns
    -------
    ndarray (...)

    Notes
    -----
    Source: Penner 2002, p. 933, eq. 5, as quoted by public golf simulators.

    Examples
    --------
    >>> penner_restitution([1.0, 10.0, 16.07, 30.0]).round(3)
    array([0.473, 0.225, 0.141, 0.12 ])
    """
    v = np.asarray(speed, dtype=float)
    return np.where(v <= 20.0, 0.510 - 0.0375 * v + 0.000903 * v**2, 0.120)


def penner_tilt(speed: ArrayLike, angle: ArrayLike) -> Array:
    """Penner's tilt (rad) at a speed (m/s) and angle of descent (rad): zero for a vertical fall.

    15.4 deg (speed / 18.6 m/s) (phi / 44.4 deg), through one measured impact on a green, where phi
    is the angle of the path with the *vertical*. Some public simulators take that with the ground
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
    return measured * np.asarray(speed, dtype=float) * (math.pi / 2 - np.asarray(angle, float))


class PennerBounce(TiltedBounce):
    """Penner's law: the plane tilts and the restitution falls with speed; speeds in m/s.

    Parameters
    ----------
    mu : float, optional
        0.40 (Penner 2002, p. 933).
    inertia : float, optional

    Source: Penner 2002, The run of a golf ball, Can. J. Phys. 80, 931, as quoted by public golf
    simulators. It gives his worked heights of the first bounce: 1.176 m (printed: 1.17) for a drive
    that lands at 26.2 m/s, 46.2 deg from the vertical, with 315 rad/s of backspin, and 2.817 m
    (2.82) for 26.8 m/s, 68.0 deg, 224 rad/s.

    Examples
    --------
    >>> import bounce
    >>> shot = bounce.PennerBounce().lift_off(xdot=22.7, ydot=-17.3, omega=4.7)
    >>> f"{float(shot.ydot)**2 / (2 * 9.80665):.2f} m high"
    '1.91 m high'
    """

    parameters = dict(mu=0.40)

    def __init__(self, **values: float):
        super().__init__(restitution=penner_restitution, tilt=penner_tilt, **values)

    def _options(self) -> dict[str, Any]:
        return {}


class CrossBounce(RigidBounce):
    """Rigid impact whose grip throws the slip back: slip after = -tangential_restitution * before.

    Where that needs more than friction can give, the ball slips throughout. With
    ``tangential_restitution = 0`` it is :class:`RigidBounce`.

    Parameters
    ----------
    mu : float
    restitution : float or callable
    tangential_restitution : float
        In [0, 1]: 0 leaves the ball rolling, 1 is a perfect super ball.
    inertia : float, optional

    Source: Cross 2002, Grip-slip behavior of a bouncing ball, Am. J. Phys. 70, 1093; Garwin 1969
    for the super ball.

    Examples
    --------
    >>> import bounce
    >>> law = bounce.CrossBounce(mu=0.8, restitution=0.7, tangential_restitution=0.2)
    >>> shot = law.lift_off(xdot=1.0, ydot=-3.0, omega=1.0)
    >>> str(shot.case), float(shot.slip.round(12))
    ('grip+', -0.4)
    """

    parameters = dict(mu=None, tangential_restitution=None)
    limits = dict(tangential_restitution="in [0, 1]")

    def lift_off(self, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike) -> RigidShot:
        """Return the state after the impact; ``case`` is "I" (slips throughout) or "grip", signed.

        Parameters
        ----------
        xdot, ydot, omega : array_like
            At touch-down, broadcast against each other; ``ydot < 0``.

        Returns
        -------
        RigidShot
        """
        rigid = super().lift_off(xdot, ydot, omega)
        back = self.values["tangential_restitution"]
        before = np.asarray(xdot, dtype=float) + np.asarray(omega, dtype=float)
        sign = np.sign(before)
        grip = (1 + back) * np.abs(before) / (1 + 1 / self.values["inertia"])
        most = self.values["mu"] * rigid.normal_impulse
        tangential = -sign * np.minimum(grip, most)
        change = tangential - rigid.tangential_impulse
        letters = np.select([sign > 0, sign < 0], ["+", "-"], "")
        return replace(
            rigid,
            xdot=rigid.xdot + change,
            omega=rigid.omega + change / self.values["inertia"],
            slip=np.where(
                grip > most, before + tangential * (1 + 1 / self.values["inertia"]), -back * before
            ),
            case=np.char.add(np.where(grip > most, "I", "grip"), letters),
            tangential_impulse=tangential,
            rolling_impulse=np.full_like(tangential, np.nan),
            rolling_speed=np.full_like(tangential, np.nan),
        )


@dataclass(frozen=True)
class PublishedFit:
    """A law with published values.

    Attributes
    ----------
    law : RigidBounce
    source : str
    checked : str
        What the values here were compared with.
    """

    law: RigidBounce
    source: str
    checked: str


_BIBER = (
    "Biber, Jones, Champneys, Green & Szalai 2023, Measurements and linearized models for golf ball "
    "bounce on a green, Sports Engineering 26 (arXiv 2302.02758), {}"
)
_QUOTED = "As quoted by public golf simulators; the paper itself was not at hand."

#: Published laws by name, for golf balls in m/s. The piecewise-affine map of Biber et al. 2023 is
#: not among them: its coefficients were not at hand.
TURFS: dict[str, PublishedFit] = {
    "natural": PublishedFit(
        TiltedBounce(mu=0.998, restitution=0.147, tilt=math.radians(18.4)),
        _BIBER.format("Table 3, fixed beta, natural teeing turf, 693 bounces"),
        _QUOTED,
    ),
    "artificial": PublishedFit(
        TiltedBounce(mu=0.852, restitution=0.420, tilt=math.radians(12.9)),
        _BIBER.format("Table 3, fixed beta, artificial turf"),
        _QUOTED,
    ),
    "natural-rigid": PublishedFit(
        RigidBounce(mu=0.998, restitution=0.260), _BIBER.format("untilted, natural turf"), _QUOTED
    ),
    "artificial-rigid": PublishedFit(
        RigidBounce(mu=0.997, restitution=0.544),
        _BIBER.format("untilted, artificial turf"),
        _QUOTED,
    ),
    "penner": PublishedFit(
        PennerBounce(),
        "Penner 2002, The run of a golf ball, Can. J. Phys. 80, 931",
        "As quoted by public golf simulators; reproduces the paper's two worked heights (p. 936).",
    ),
}


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
        Phases of a contact model, or the case of a rigid law.
    """

    landing: Landing
    lift_off: Landing
    time: float
    x: float
    y: float
    itinerary: str


def rebound(
    model: RigidBounce | ContactModel,
    landing: Landing,
    ball: Ball = GOLF,
    *,
    scaling: Scaling | None = None,
    tol: float = 1e-10,
) -> Rebound:
    """Bounce a ball once, in SI units, on any law or contact model.

    Parameters
    ----------
    model : RigidBounce or ContactModel
    landing : Landing
    ball : Ball, optional
    scaling : Scaling, optional
        The units of a contact model (needed for one, unused by a law). Its scaled gravity is the
        model's own ``G``; ``scaling.gravity`` is the value that fits the ball.
    tol : float, optional

    Returns
    -------
    Rebound

    Raises
    ------
    ModelError
        Neither a law nor a contact model, no scaling for a contact model, another moment of
        inertia or ball than the scaling's.
    LandingError, LiftOffError

    Examples
    --------
    >>> import bounce, math
    >>> drive = bounce.Landing.polar(28.5, math.radians(37.3), 2094)
    >>> after = bounce.rebound(bounce.TURFS["natural"].law, drive).lift_off
    >>> f"{after.speed:.2f} m/s, {math.degrees(after.angle):.1f} deg, {after.backspin_rpm:.0f} rpm"
    '10.71 m/s, 37.3 deg, -4536 rpm'
    """
    _check_model(model, ball, scaling)
    if isinstance(model, RigidBounce):
        shot = model.lift_off(landing.xdot, landing.ydot, landing.omega * ball.radius)
        after = Landing(float(shot.xdot), float(shot.ydot), float(shot.omega) / ball.radius)
        return Rebound(landing, after, 0.0, 0.0, 0.0, str(shot.case))
    assert scaling is not None
    start = scaling.state(landing)
    run = simulate(model, start.xdot, start.ydot, start.omega, tol=tol)
    end: State = run.lift_off
    return Rebound(
        landing,
        scaling.landing(end),
        run.time * scaling.time,
        end.x * scaling.length,
        end.y * scaling.length,
        run.itinerary,
    )


def _check_model(model: Any, ball: Ball, scaling: Scaling | None) -> None:
    if not isinstance(model, RigidBounce | ContactModel):
        raise ModelError(
            f"model: expected a law such as bounce.TURFS['natural'].law or a ContactModel, received "
            f"{model!r}."
        )
    if model.values["inertia"] != ball.inertia:
        raise ModelError(
            f"inertia: expected that of the ball, {ball.inertia:g}, received "
            f"{model.values['inertia']:g} in {model!r}. Use model.replace(inertia={ball.inertia!r})."
        )
    if isinstance(model, RigidBounce):
        return
    if scaling is None:
        raise ModelError(
            f"scaling: expected a Scaling for the dimensionless {type(model).__name__}, received "
            "none. Scaling.from_stiffness(ball, newtons_per_metre) makes one."
        )
    if scaling.ball != ball:
        raise ModelError(
            f"ball: expected that of the scaling, {scaling.ball!r}, received {ball!r}."
        )
