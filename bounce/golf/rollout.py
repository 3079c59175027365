"""The rest of the shot: bounces with flight between them, then sliding, then rolling to rest.

What is modelled: one vertical plane; flat ground of constant slope; each bounce by one and the same
law or contact model; flight in still air or none; a ball that stays down slides under Coulomb
friction until it rolls, and rolls against a constant resistance. What is not: side spin (``side_run``), wind,
ground that changes, plugging, spin that decays while rolling, and the small hops left out below
``min_height``.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..parameters import LIMITS, number, require_positive
from ..units import GOLF, GRAVITY, Ball, Landing, Scaling
from .air import Air
from .flight import Flight, flight
from .ground import ExtrapolationWarning, Model, Rebound, ground

Array = NDArray[np.float64]

#: Penner's rolling friction of a putting green (2002, The run of a golf ball, p. 935; greens span
#: 0.065 to 0.196, The physics of putting, p. 85), as quoted by public golf simulators. A fairway
#: has more.
GREEN_ROLLING_FRICTION = 0.131


#: A putt across a whole green, some 15 m with that friction, m/s.
_FASTEST_PUTT = 5.0


class NoRestError(ns.NonsmoothError, RuntimeError):
    """The ball does not come to rest: too many bounces, or a slope that it runs down for ever."""


@dataclass(frozen=True)
class Bounce:
    """One bounce and the hop after it.

    Attributes
    ----------
    t, x : float
        Touch-down, s and m.
    rebound : Rebound
        The bounce itself: landing, lift-off and how it was found.
    hop : Flight or None
        None after the last bounce.
    """

    t: float
    x: float
    rebound: Rebound
    hop: Flight | None


@dataclass(frozen=True)
class Glide:
    """A stretch on the ground with constant acceleration: ``mode`` is "+", "-" (slip) or "s" (rolls).

    Attributes
    ----------
    mode : str
        Whether the ball slips or rolls.
    t, x, xdot : float
        At its start.
    time : float
        Duration, s.
    acceleration : float
        m/s².
    """

    mode: str
    t: float
    x: float
    xdot: float
    time: float
    acceleration: float

    @property
    def end(self) -> float:
        """Where it ends, m."""
        return self.x + self.xdot * self.time + self.acceleration * self.time**2 / 2


@dataclass(frozen=True)
class Run:
    """A shot from its first touch-down to rest.

    Attributes
    ----------
    bounces : tuple of Bounce
        In order; the last one has no hop after it.
    glides : tuple of Glide
        Sliding and rolling, in order; empty if the ball stops dead.
    time : float
        Until rest, s.
    run_out : float
        From the first touch-down to rest, m; negative is back.
    left_out : float
        Estimate of the distance of the hops below ``min_height``, m: that of the hop that the last
        bounce would have made.
    extrapolated : int
        How many of the landings are outside those that the law was fitted to; most later hops are
        slower than any that was measured.
    cautions : tuple of str
        What of the first landing and of the roll is an extrapolation.
    """

    bounces: tuple[Bounce, ...]
    glides: tuple[Glide, ...]
    time: float
    run_out: float
    left_out: float
    extrapolated: int = 0
    cautions: tuple[str, ...] = ()

    @property
    def first_height(self) -> float:
        """Height of the first hop, m (0 if there is none)."""
        hop = self.bounces[0].hop
        return 0.0 if hop is None else hop.height

    @property
    def bounced(self) -> float:
        """Distance from the first to the last touch-down, m."""
        return self.bounces[-1].x

    @property
    def rolled(self) -> float:
        """Distance that the ball rolls, m (negative is back)."""
        return sum(g.end - g.x for g in self.glides if g.mode == "s")

    def path(self, points: int = 50) -> Array:
        """Return points of the path.

        Parameters
        ----------
        points : int, optional
            For each hop and glide.

        Returns
        -------
        ndarray (n, 3)
            t (s), x and y (m) from the first touch-down.
        """
        rows = [np.array([[0.0, 0.0, 0.0]])]
        for bounce in self.bounces:
            if bounce.hop is not None:
                t = np.linspace(0.0, bounce.hop.time, points)
                start = bounce.t + bounce.rebound.time
                rows.append(np.column_stack([start + t, bounce.hop(t)]))
        for glide in self.glides:
            t = np.linspace(0.0, glide.time, points)
            x = glide.x + glide.xdot * t + glide.acceleration * t**2 / 2
            rows.append(np.column_stack([glide.t + t, x, np.zeros_like(t)]))
        return np.concatenate(rows)

    def __repr__(self) -> str:
        return (
            f"Run({len(self.bounces)} bounces, first {self.first_height:.3g} m high, bounced "
            f"{self.bounced:.3g} m, rolled {self.rolled:.3g} m, run-out {self.run_out:.4g} m in "
            f"{self.time:.3g} s)"
        )


def play(
    model: Model,
    landing: Landing,
    ball: Ball = GOLF,
    *,
    scaling: Scaling | None = None,
    air: Air | None = None,
    slope: float = 0.0,
    rolling_friction: float = GREEN_ROLLING_FRICTION,
    sliding_friction: float | None = None,
    min_height: float = 5e-3,
    max_bounces: int = 1000,
    tol: float = 1e-10,
) -> Run:
    """Follow a shot from its first touch-down to rest.

    The ball bounces until it would hop less than ``min_height`` above the ground, or a law keeps it
    down. Then it slides, $x'' = -+ mu g$, until $x' + R omega = 0$, and rolls with
    $x'' = -+ c g/(1 + inertia)$, c the rolling friction, each with the slope's part of gravity.

    Parameters
    ----------
    model : BounceLaw or ContactModel
        What every bounce follows.
    landing : Landing
        The first landing, in SI units.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    scaling : Scaling, optional
        Needed for a contact model, see :func:`rebound`.
    air : Air, optional
        Drag and lift; none by default.
    slope : float, optional
        Of the ground, rad, uphill for positive x; speeds are along and normal to it.
    rolling_friction : float, optional
        The lever of the rolling torque over the radius; default that of a putting green.
    sliding_friction : float, optional
        Coefficient while sliding; by default the model's ``mu``.
    min_height : float, optional
        m; 5 mm is Penner's choice (2002, p. 935).
    max_bounces : int, optional
        After so many the run ends with a status that says so.
    tol : float, optional
        Relative tolerance.

    Returns
    -------
    Run
        Every bounce, hop, slide and roll until rest, with their times, distances and cautions.

    Raises
    ------
    NoRestError
        More than ``max_bounces``, or no rest on the slope.
    LandingError
        A ball that does not move into the ground.
    LiftOffError
        A ball that does not lift off a contact model.
    ModelError
        As :func:`rebound`.
    nonsmooth.OptionError
        A slope outside of $-pi/2$ to $pi/2$; a friction or a height that is not positive.

    Warns
    -----
    ExtrapolationWarning
        A first landing outside the range that the law was fitted to, or a ball that rolls faster
        than any putt with the friction of a putting green. How a run splits into bounces and roll
        has not been compared with measurements.

    Examples
    --------
    >>> import bounce, math
    >>> drive = bounce.Landing.polar(28.5, math.radians(37.3), 2094)
    >>> bounce.golf.play(bounce.laws.TURFS["natural"].law, drive)
    Run(13 bounces, first 2.14 m high, bounced 23 m, rolled 0.183 m, run-out 23.19 m in 4.94 s)
    """
    require_positive(rolling_friction=rolling_friction, min_height=min_height)
    if not LIMITS["in (-pi/2, pi/2)"](number(slope, "slope", ns.OptionError)):
        raise ns.OptionError(f"slope: expected radians in (-pi/2, pi/2), received {slope!r}.")
    turf = ground(model, ball, scaling, tol)
    turf.require_slope(slope)
    bounces: list[Bounce] = []
    t, x = 0.0, 0.0
    while True:
        if len(bounces) >= max_bounces:
            raise NoRestError(
                f"max_bounces: expected rest within {max_bounces} bounces, received a hop of "
                f"{_height(landing, slope):.3g} m before the next. Raise max_bounces or min_height "
                f"({min_height:g} m); with a restitution of 1, or down a slope, there may be no rest."
            )
        hit = turf.rebound(landing)
        off, hop = hit.lift_off, None
        if off.ydot > 0.0 and hit.y + _height(off, slope) >= min_height:
            hop = flight(off, ball, air=air, slope=slope, start=(x + hit.x, hit.y), tol=tol)
        bounces.append(Bounce(t, x, hit, hop))
        t, x = t + hit.time, x + hit.x
        if hop is None:
            break
        t, x, landing = t + hop.time, x + hop.range, hop.landing
    mu = turf.mu if sliding_friction is None else sliding_friction
    glides = _glides(off, ball, t, x, slope, mu, rolling_friction)
    left_out = 2 * max(off.ydot, 0.0) * off.xdot / (GRAVITY * math.cos(slope))
    if glides:
        t, x = t + sum(g.time for g in glides), glides[-1].end
    fastest = max((abs(g.xdot) for g in glides if g.mode == "s"), default=0.0)
    cautions = (
        *turf.cautions(bounces[0].rebound.landing),
        *roll_cautions(fastest, rolling_friction),
    )
    for caution in cautions:
        warnings.warn(caution, ExtrapolationWarning, stacklevel=2)
    extrapolated = sum(bool(turf.cautions(b.rebound.landing)) for b in bounces)
    return Run(tuple(bounces), glides, t, x, left_out, extrapolated, cautions)


def roll_cautions(fastest: float, rolling_friction: float) -> tuple[str, ...]:
    """Say where the default friction is used for a ball that rolls as no putt does."""
    if rolling_friction != GREEN_ROLLING_FRICTION or fastest <= _FASTEST_PUTT:
        return ()
    return (
        f"rolling_friction: the ball rolls from {fastest:.3g} m/s with the friction of a putting green, "
        f"known for putts, at up to {_FASTEST_PUTT:g} m/s. How far it rolls is an extrapolation: give "
        "the friction of the ground that it rolls on.",
    )


def _height(launch: Landing, slope: float) -> float:
    return launch.ydot**2 / (2 * GRAVITY * math.cos(slope))


def _glides(
    off: Landing, ball: Ball, t: float, x: float, slope: float, mu: float, rolling: float
) -> tuple[Glide, ...]:
    """Slide until the ball rolls, then roll to rest."""
    down, along = GRAVITY * math.cos(slope), GRAVITY * math.sin(slope)
    k = ball.inertia
    glides: list[Glide] = []
    u, slip = off.xdot, off.xdot + ball.radius * off.omega
    if abs(slip) > 1e-12 * abs(u):
        sign = math.copysign(1.0, slip)
        decay = sign * mu * down * (1 + 1 / k) + along  # of the slip
        if decay * sign <= 0.0:
            raise NoRestError(
                f"slope: expected one on which friction stops the slip, received {slope:g} rad with "
                f"mu = {mu:g}: the ball slides down for ever."
            )
        slide = Glide("+" if sign > 0 else "-", t, x, u, slip / decay, -sign * mu * down - along)
        glides.append(slide)
        t, x, u = t + slide.time, slide.end, u + slide.acceleration * slide.time
    resist, pull = rolling * down / (1 + k), -along / (1 + k)
    while True:
        moving = math.copysign(1.0, u) if u != 0.0 else math.copysign(1.0, pull)
        acceleration = pull - moving * resist
        if u == 0.0 and acceleration * moving <= 0.0:
            return tuple(glides)
        if acceleration * moving >= 0.0:
            raise NoRestError(
                f"slope: expected one on which a rolling ball stops, received {slope:g} rad with a "
                f"rolling friction of {rolling:g}: it needs |tan(slope)| below that."
            )
        glide = Glide("s", t, x, u, -u / acceleration, acceleration)
        glides.append(glide)
        t, x, u = t + glide.time, glide.end, 0.0
