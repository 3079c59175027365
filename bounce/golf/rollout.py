"""The rest of the shot: bounces with flight between them, then sliding, then rolling to rest.

The ground is flat with a constant slope. Each bounce follows one law or contact model, and each hop is a flight
in air or none. A ball that stays down slides under Coulomb friction until it rolls, and rolls against a
constant resistance opposite to its velocity; on a side slope the direction of friction turns. Not modelled:
plugging, ground that changes, spin that decays while rolling, and hops below ``min_height``.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Generic

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.model import Contact3D
from ..parameters import require_positive
from ..units import GOLF, Ball, Scaling
from .air import Air
from .flight import Flight, flight
from .ground import ExtrapolationWarning, Model, Rebound, ground
from .side_spin import S, SideState, gravity_on, in_space, upward

Array = NDArray[np.float64]

#: Penner's rolling friction of a putting green (2002, The run of a golf ball, p. 935; greens span 0.065
#: to 0.196, The physics of putting, p. 85), as quoted by golf simulators. A fairway has more.
GREEN_ROLLING_FRICTION = 0.131
#: A putt across a whole green, some 15 m with that friction, m/s.
_FASTEST_PUTT = 5.0


class NoRestError(ns.NonsmoothError, RuntimeError):
    """The ball does not come to rest: too many bounces, or a slope that it runs down for ever."""


@dataclass(frozen=True)
class Bounce(Generic[S]):
    """One bounce and the hop after it.

    Attributes
    ----------
    t, x, z : float
        Touch-down, s, and its place forward and to the right, m.
    rebound : Rebound
        The bounce itself: landing, lift-off and how it was found.
    hop : Flight or None
        None after the last bounce.
    """

    t: float
    x: float
    rebound: Rebound[S]
    hop: Flight[S] | None
    z: float = 0.0


@dataclass(frozen=True)
class Glide:
    """A stretch on the ground, sliding or rolling.

    Attributes
    ----------
    mode : str
        "+" or "-" (slips forward or in reverse), with side spin "*" (slips), or "s" (rolls).
    t, x, xdot : float
        At its start: time, place forward and velocity forward.
    time : float
        Duration, s.
    acceleration : float
        Forward, at its start, m/s². It is constant unless a side slope bends the path.
    """

    mode: str
    t: float
    x: float
    xdot: float
    time: float
    acceleration: float
    _path: Callable[[Array], Array]

    def __call__(self, t: ArrayLike) -> Array:
        """Return place and velocity along the ground at times after its start.

        Parameters
        ----------
        t : array_like (...)
            From 0 to ``time``, s.

        Returns
        -------
        ndarray (..., 4)
            x, z, xdot, zdot: forward and to the right.
        """
        return self._path(np.asarray(t, dtype=float))[..., :4]

    @property
    def end(self) -> float:
        """Where it ends, forward, m."""
        return float(self(self.time)[0])


@dataclass(frozen=True, repr=False)
class Run(Generic[S]):
    """A shot from its first touch-down to rest.

    Attributes
    ----------
    bounces : tuple of Bounce
        In order; the last one has no hop after it.
    glides : tuple of Glide
        Sliding and rolling, in order; empty if the ball stops dead.
    time : float
        Until rest, s.
    run_out, side : float
        From the first touch-down to rest, forward (negative is back) and to the right, m.
    left_out : float
        Estimate of the way forward of the hops below ``min_height``: that of the first of them, m.
    extrapolated : int
        How many of the landings are outside those that the law was fitted to; most later hops are
        slower than any that was measured.
    cautions : tuple of str
        What of the first landing and of the roll is an extrapolation.
    """

    bounces: tuple[Bounce[S], ...]
    glides: tuple[Glide, ...]
    time: float
    run_out: float
    left_out: float
    extrapolated: int = 0
    cautions: tuple[str, ...] = ()
    side: float = 0.0

    def _tables(self) -> dict[str, ns.result_tables.ResultTable]:
        bounces, glides = {"bounce": len(self.bounces)}, {"glide": len(self.glides)}
        return {
            "bounces": ns.result_tables.stacked(self.bounces, bounces),
            "glides": ns.result_tables.stacked(self.glides, glides),
        }

    @property
    def first_height(self) -> float:
        """Height of the first hop, m (0 if there is none)."""
        hop = self.bounces[0].hop
        return 0.0 if hop is None else hop.height

    @property
    def kick(self) -> float:
        """Of the first bounce, rad, right positive."""
        return self.bounces[0].rebound.kick

    @property
    def bounced(self) -> float:
        """Distance from the first to the last touch-down, forward, m."""
        return self.bounces[-1].x

    @property
    def rolled(self) -> float:
        """Distance that the ball rolls, forward, m (negative is back)."""
        return sum(g.end - g.x for g in self.glides if g.mode == "s")

    @property
    def _in_space(self) -> bool:
        return isinstance(self.bounces[0].rebound.landing, SideState)

    def path(self, points: int = 50) -> Array:
        """Return points of the path.

        Parameters
        ----------
        points : int, optional
            For each hop and glide.

        Returns
        -------
        ndarray (n, 3) or (n, 4)
            t (s), x and y (m) from the first touch-down; z too if it landed with a SideState.
        """
        axes = 4 if self._in_space else 3
        rows = [np.zeros((1, axes))]
        for bounce in self.bounces:
            if bounce.hop is not None:
                t = np.linspace(0.0, bounce.hop.time, points)
                start = bounce.t + bounce.rebound.time
                rows.append(np.column_stack([start + t, bounce.hop(t)]))
        for glide in self.glides:
            t = np.linspace(0.0, glide.time, points)
            x, z = glide(t)[:, :2].T
            rows.append(np.column_stack([glide.t + t, x, np.zeros_like(t), z])[:, :axes])
        return np.concatenate(rows)

    def __repr__(self) -> str:
        side = f" and {self.side:.3g} m to the right" if self._in_space else ""
        return (
            f"Run({len(self.bounces)} bounces, first {self.first_height:.3g} m high, bounced "
            f"{self.bounced:.3g} m, rolled {self.rolled:.3g} m, run-out {self.run_out:.4g} m{side} in "
            f"{self.time:.3g} s)"
        )


def play(
    model: Model | Contact3D,
    landing: S,
    ball: Ball = GOLF,
    *,
    scaling: Scaling | None = None,
    air: Air | None = None,
    wind: tuple[float, float] = (0.0, 0.0),
    slope: float = 0.0,
    side_slope: float = 0.0,
    rolling_friction: float = GREEN_ROLLING_FRICTION,
    sliding_friction: float | None = None,
    min_height: float = 5e-3,
    max_bounces: int = 1000,
    tol: float = 1e-10,
) -> Run[S]:
    """Follow a shot from its first touch-down to rest.

    The ball bounces until it would hop less than ``min_height`` above the ground, or a law keeps it
    down. Then it slides, $x'' = -+ mu g$, until $x' + R omega = 0$, and rolls with
    $x'' = -+ c g/(1 + inertia)$, c the rolling friction, each with the slope's part of gravity.

    Parameters
    ----------
    model : BounceLaw, ContactModel or Contact3D
        What every bounce follows; see :func:`rebound`.
    landing : Landing or SideState
        The first landing, in SI units and in the axes of the ground; a SideState has side spin.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    scaling : Scaling, optional
        Needed for a contact model, see :func:`rebound`.
    air : Air, optional
        Drag and lift; none by default.
    wind : (float, float), optional
        During the hops, as of :func:`flight`.
    slope, side_slope : float, optional
        Of the ground, rad, uphill forward and to the right; speeds are along and normal to it. A side
        slope needs a SideState.
    rolling_friction : float, optional
        The lever of the rolling torque over the radius; default that of a putting green.
    sliding_friction : float, optional
        Coefficient while sliding; by default the model's ``mu``.
    min_height : float, optional
        m; 5 mm is Penner's choice (2002, p. 935).
    max_bounces : int, optional
        The most bounces before an error.
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
    turf = ground(model, ball, scaling, tol, side_slope)
    gravity = gravity_on(landing, "landing", slope, side_slope)
    turf.require_slope(slope)
    bounces: list[Bounce[S]] = []
    t, x, z, state = 0.0, 0.0, 0.0, landing
    while True:
        if len(bounces) >= max_bounces:
            raise NoRestError(
                f"max_bounces: the ball still hops {_height(state, gravity):.3g} m after {max_bounces} "
                f"bounces. Raise max_bounces or min_height ({min_height:g} m); with a restitution of 1, "
                "or down a slope, there may be no rest."
            )
        hit = turf.rebound(state)
        off, hop = hit.lift_off, None
        if upward(off) > 0.0 and hit.y + _height(off, gravity) >= min_height:
            options: dict[str, Any] = dict(slope=slope, side_slope=side_slope, tol=tol, wind=wind)
            hop = flight(off, ball, air=air, start=(x + hit.x, hit.y, z + hit.z), **options)
        bounces.append(Bounce(t, x, hit, hop, z))
        t, x, z = t + hit.time, x + hit.x, z + hit.z
        if hop is None:
            break
        t, x, z, state = t + hop.time, x + hop.range, z + hop.side, hop.landing
    mu = turf.model.values["mu"] if sliding_friction is None else sliding_friction
    glides, fastest = _glides(off, ball, t, np.array([x, z]), gravity, mu, rolling_friction, tol)
    if glides:
        t, (x, z) = t + sum(g.time for g in glides), glides[-1](glides[-1].time)[:2].tolist()
    forward = float(in_space(off).velocity[0])
    left_out = 2 * max(upward(off), 0.0) * forward / -float(gravity[1])
    cautions = (*turf.cautions(landing), *_roll_cautions(fastest, rolling_friction))
    for caution in cautions:
        warnings.warn(caution, ExtrapolationWarning, stacklevel=2)
    extrapolated = sum(bool(turf.cautions(b.rebound.landing)) for b in bounces)
    return Run(tuple(bounces), tuple(glides), t, x, left_out, extrapolated, cautions, z)


def _roll_cautions(fastest: float, rolling_friction: float) -> tuple[str, ...]:
    if rolling_friction != GREEN_ROLLING_FRICTION or fastest <= _FASTEST_PUTT:
        return ()
    return (
        f"rolling_friction: the ball rolls from {fastest:.3g} m/s with the friction of a putting green, "
        f"known for putts, at up to {_FASTEST_PUTT:g} m/s. How far it rolls is an extrapolation: give "
        "the friction of the ground that it rolls on.",
    )


def _height(state: S, gravity: Array) -> float:
    """Height of a parabola that begins or ends with a state."""
    return float(upward(state) ** 2 / (-2 * gravity[1]))


def _glides(
    off: S, ball: Ball, t: float, x: Array, gravity: Array, mu: float, rolling: float, tol: float
) -> tuple[list[Glide], float]:
    """Slide until the ball rolls, then roll to rest; and the speed with which it begins to roll."""
    state, normal, pull, k = in_space(off), -float(gravity[1]), gravity[[0, 2]], ball.inertia
    glides, v = list[Glide](), state.velocity[[0, 2]]
    slip = v + ball.radius * np.array([state.spin[2], -state.spin[0]])
    if np.hypot(*slip) > 1e-12 * np.hypot(*v):
        mode = "*" if isinstance(off, SideState) else "+" if slip[0] > 0 else "-"
        start = np.concatenate([x, v, slip])
        glides.append(_glide(mode, t, start, pull, mu * normal, 1 + 1 / k, tol))
        t, (x, v) = t + glides[0].time, np.split(glides[0](glides[0].time), 2)
    if np.hypot(*pull) >= rolling * normal:
        raise _no_rest("rolling", pull, rolling * normal)
    speed = float(np.hypot(*v))
    if speed > 0.0:
        start, share = np.concatenate([x, v, v]), 1 + k
        glides.append(_glide("s", t, start, pull / share, rolling * normal / share, 1.0, tol))
    return glides, speed


def _glide(
    mode: str, t: float, start: Array, pull: Array, friction: float, lever: float, tol: float
) -> Glide:
    """Follow place, velocity and h, the slip or the velocity, until h is zero."""
    place, v, h = np.split(start, 3)
    size = float(np.hypot(*h))
    e = h / size
    acceleration = pull - friction * e
    straight = pull[0] * h[1] == pull[1] * h[0]  # the direction of friction stays
    decay = friction * lever - float(pull @ e if straight else np.hypot(*pull))
    if decay <= 0.0:
        raise _no_rest("the slip", pull, friction * lever)
    time = size / decay
    path: Callable[[Array], Array] = partial(_parabola, place, v, acceleration)
    if not straight:
        values = dict(pull_0=pull[0], pull_1=pull[1], friction=friction, lever=lever)
        run = ns.simulate(_ground_system(), start, 1.01 * time, parameters=values, tol=tol)
        ends = (e.t for e in run.events if e.kind in ("entry", "crossing"))
        time, path = next(ends, run.events[-1].t), run
    return Glide(mode, t, float(place[0]), float(v[0]), time, float(acceleration[0]), path)


def _parabola(place: Array, v: Array, acceleration: Array, t: Array) -> Array:
    s = t[..., None]
    positions = place + v * s + acceleration * s**2 / 2
    return np.concatenate([positions, v + acceleration * s], axis=-1)


def _no_rest(what: str, pull: Array, friction: float) -> NoRestError:
    return NoRestError(
        f"slope: gravity pulls along the ground with {np.hypot(*pull):.3g} m/s2, and friction against "
        f"{what}, {friction:.3g} m/s2, does not stop the ball. Use a gentler slope or more friction."
    )


@lru_cache
def _ground_system() -> ns.FilippovSystem:
    """A ball that slides or rolls until h, its slip or its velocity, is zero."""
    x, v, h, pull, lam = (ca.SX.sym(n, 2) for n in ("x", "v", "h", "pull", "lambda"))
    friction, lever = ca.SX.sym("friction"), ca.SX.sym("lever")
    force = -friction * lam
    return ns.FilippovSystem(
        ca.vertcat(x, v, h),
        field=ca.vertcat(v, pull + force, pull + force * lever),
        surfaces=[h],
        multipliers=[lam],
        parameters=ca.vertcat(pull, friction, lever),
    )
