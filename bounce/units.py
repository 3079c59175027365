"""Balls and landings in SI units, and their conversion to and from dimensionless models.

Both consistent scalings have a unit of time T (eps2 in seconds, 1/T the natural frequency of the
normal spring), a unit of speed U, of length U T and of spin U/R:

- ``length`` (X = x/R):  U = R/T, so Omega = T omega and G = g T^2 / R. All of the paper's Y is in
  ball radii.
- ``speed`` (X' = xdot/R in 1/s):  U = R/(1 s), so speeds and spins keep their numbers in radii and
  radians per second, lengths are in R T/(1 s) and G = g T (1 s)/R.

The printed scaling of the paper mixes the two: it keeps X = x and Omega = omega at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import nonsmooth as ns

from .parameters import LIMITS, number
from .shot.state import State

#: Standard gravity, m/s^2 (BIPM, The International System of Units, 9th ed.).
GRAVITY = 9.80665

#: Factor of each unit to m/s, rad/s, rad, m or s.
UNITS: dict[str, dict[str, float]] = {
    "speed": {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "ft/s": 0.3048},
    "spin": {
        "rad/s": 1.0,
        "rpm": 2 * math.pi / 60,
        "rev/s": 2 * math.pi,
        "deg/s": math.pi / 180,
    },
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "length": {"m": 1.0, "yd": 0.9144, "ft": 0.3048},
    "time": {"s": 1.0},
}

#: For ``str.translate``: the minus sign of typeset numbers, as they are copied from a page.
MINUS = {0x2212: "-"}

_RPM = UNITS["spin"]["rpm"]


@dataclass(frozen=True)
class Ball:
    """A ball in SI units.

    Parameters
    ----------
    mass : float
        kg.
    radius : float
        m.
    inertia : float, optional
        Moment of inertia over $m R^2$: 2/5 for a solid sphere, 2/3 for a thin shell.
    name : str, optional
        What the ball is called in print.
    source : str, optional
        Where the numbers are from.

    Examples
    --------
    >>> GOLF.radius
    0.021335
    """

    mass: float
    radius: float
    inertia: float = 2 / 5
    name: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        for what, limit in dict(mass="> 0", radius="> 0", inertia="in (0, 1]").items():
            value = number(getattr(self, what), f"Ball: {what}")
            if not LIMITS[limit](value):
                raise ns.ParameterError(
                    f"Ball: {what}: expected a number {limit}, received {value!r}."
                )


GOLF = Ball(
    0.04593,
    0.021335,
    2 / 5,
    "golf",
    "R&A and USGA Equipment Rules: at most 45.93 g, diameter at least 42.67 mm; inertia of a "
    "uniform sphere",
)
TENNIS = Ball(
    0.0577,
    0.0335,
    2 / 3,
    "tennis",
    "ITF Rules of Tennis, Appendix I, type 2: middle of 56.0-59.4 g and 6.54-6.86 cm; inertia of a "
    "thin shell (the wall is thick: a measured value is lower)",
)
BASKETBALL = Ball(
    0.6085,
    0.12167,
    2 / 3,
    "basketball",
    "FIBA size 7: middle of 567-650 g and 749-780 mm circumference; inertia of a thin shell",
)

#: The balls by name.
BALLS = {ball.name: ball for ball in (GOLF, TENNIS, BASKETBALL)}


@dataclass(frozen=True)
class Landing:
    """Speeds and spin in SI units, at touch-down or at lift-off.

    Parameters
    ----------
    xdot, ydot : float
        m/s, along and normal to the ground; a negative ``ydot`` approaches it.
    omega : float
        rad/s, backspin positive.

    Examples
    --------
    >>> Landing.polar(speed=28.5, angle=math.radians(37.3), backspin_rpm=2094)
    Landing(xdot=22.670..., ydot=-17.270..., omega=219.283...)
    """

    xdot: float
    ydot: float
    omega: float

    def __post_init__(self) -> None:
        for what in ("xdot", "ydot", "omega"):
            number(getattr(self, what), f"Landing: {what}", ns.PointError)

    @classmethod
    def polar(cls, speed: float, angle: float, backspin_rpm: float) -> Landing:
        """Make a landing from the speed (m/s), the angle of descent (rad) and the spin (rpm).

        Parameters
        ----------
        speed : float
            Speed of the centre, m/s.
        angle : float
            Between the path and the ground, in $(0, pi/2]$.
        backspin_rpm : float
            Backspin in turns a minute.
        """
        v, a = number(speed, "speed", ns.PointError), number(angle, "angle", ns.PointError)
        if v <= 0.0:
            raise ns.PointError(f"speed: expected a positive number of m/s, received {speed!r}.")
        if not 0.0 < a <= math.pi / 2:
            raise ns.PointError(
                f"angle: expected radians in (0, pi/2], received {angle!r}. Degrees go through "
                "math.radians."
            )
        spin = number(backspin_rpm, "backspin_rpm", ns.PointError) * _RPM
        return cls(v * math.cos(a), -v * math.sin(a), spin)

    @property
    def speed(self) -> float:
        """Speed, m/s."""
        return math.hypot(self.xdot, self.ydot)

    @property
    def angle(self) -> float:
        """Angle between the path and the ground, rad."""
        return math.atan2(abs(self.ydot), abs(self.xdot))

    @property
    def backspin_rpm(self) -> float:
        """Spin in revolutions per minute."""
        return self.omega / _RPM


@dataclass(frozen=True)
class Scaling:
    """The units of a dimensionless model of a given ball on a given ground.

    Parameters
    ----------
    ball : Ball
        Radius, mass and moment of inertia of the ball.
    time : float
        T in seconds: the inverse of the natural frequency of the normal spring.
    convention : {"length", "speed"}
        Which of the two consistent scalings, with the radius R: ``"length"`` measures lengths in R, so
        speeds in R/T and spins in 1/T; ``"speed"`` measures speeds in R/(1 s), so spins in rad/s and
        lengths in R T/(1 s).

    Examples
    --------
    >>> units = Scaling.from_stiffness(GOLF, stiffness=20e3)
    >>> landing = Landing.polar(28.5, math.radians(37.3), 2094)
    >>> state = units.state(landing)
    >>> f"{units.gravity:.3e}", f"{state.ydot:.5f}", f"{state.omega:.5f}"
    ('1.056e-03', '-1.22673', '0.33231')
    >>> units.landing(state) == landing
    True
    """

    ball: Ball
    time: float
    convention: Literal["length", "speed"] = "length"

    def __post_init__(self) -> None:
        if not number(self.time, "Scaling: time") > 0:
            raise ns.ParameterError(
                f"Scaling: time: expected a positive number of seconds, received {self.time!r}."
            )
        if self.convention not in ("length", "speed"):
            raise ns.ParameterError(
                f"Scaling: convention: expected 'length' or 'speed', received {self.convention!r}."
            )

    @classmethod
    def from_stiffness(
        cls, ball: Ball, stiffness: float, convention: Literal["length", "speed"] = "length"
    ) -> Scaling:
        """Make a scaling from the stiffness of the normal spring (N/m): $T = sqrt(m / stiffness)$.

        Parameters
        ----------
        ball : Ball
            The ball.
        stiffness : float
            Of the normal spring, N/m.
        convention : {"length", "speed"}, optional
            As for the class.

        Raises
        ------
        nonsmooth.ParameterError
            A stiffness that is not positive.
        """
        if not number(stiffness, "stiffness") > 0:
            raise ns.ParameterError(
                f"stiffness: expected a positive number of N/m, received {stiffness!r}."
            )
        return cls(ball, math.sqrt(ball.mass / stiffness), convention)

    @property
    def speed(self) -> float:
        """Unit of speed U, m/s."""
        return self.ball.radius / (self.time if self.convention == "length" else 1.0)

    @property
    def length(self) -> float:
        """Unit of length, m."""
        return self.speed * self.time

    @property
    def force(self) -> float:
        """Unit of force, N."""
        return self.ball.mass * self.speed / self.time

    @property
    def gravity(self) -> float:
        """Scaled gravity G of the models."""
        return GRAVITY * self.time / self.speed

    def state(self, landing: Landing) -> State:
        """Return a landing in the model's units, at the origin.

        Parameters
        ----------
        landing : Landing
            In SI units.
        """
        spin = landing.omega * self.ball.radius / self.speed
        return State(landing.xdot / self.speed, landing.ydot / self.speed, spin)

    def landing(self, state: State) -> Landing:
        """Return a state's speeds and spin in SI units.

        Parameters
        ----------
        state : State
            In the model's units.
        """
        spin = state.omega * self.speed / self.ball.radius
        return Landing(state.xdot * self.speed, state.ydot * self.speed, spin)
