"""The rest of a shot with side spin: bounces that kick, hops that curve, sliding and rolling on a slope.

As ``rollout``, with both directions along the ground: a ball that stays down slides under Coulomb friction,
whose direction turns with the slip where the ground slopes, until it rolls, against a resistance opposite
to its velocity. Both are sets of codimension two, followed by ``nonsmooth``.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.model import Contact3D, ContactModel
from ..laws import BounceLaw
from ..parameters import require_positive
from ..units import GOLF, Ball, Scaling
from .air import Air
from .ground import ExtrapolationWarning, ground
from .rollout import GREEN_ROLLING_FRICTION, NoRestError, roll_cautions
from .side_flight import SideFlight, SideState, pull, side_flight
from .side_spin import bounced

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SideBounce:
    """One bounce and the hop after it.

    Attributes
    ----------
    t : float
        Touch-down, s.
    place : ndarray (2,)
        There, forward and to the right, m.
    landing, lift_off : SideState
        Before and after.
    itinerary : str
        Phases of a contact model, or the case of a law.
    hop : SideFlight or None
        None after the last bounce.
    """

    t: float
    place: Array
    landing: SideState
    lift_off: SideState
    itinerary: str
    hop: SideFlight | None

    @property
    def kick(self) -> float:
        """By how much it turns the direction of travel, rad, right positive."""
        turn = self.lift_off.heading - self.landing.heading
        return math.atan2(math.sin(turn), math.cos(turn))


@dataclass(frozen=True, eq=False)
class SideGlide:
    """A stretch on the ground: ``mode`` is "*" (slips) or "s" (rolls).

    Attributes
    ----------
    mode : str
        Whether the ball slips or rolls.
    t, time : float
        Its start and duration, s.
    run : nonsmooth.Trajectory
        Its first four states are the place and the velocity along the ground.
    """

    mode: str
    t: float
    time: float
    run: ns.Trajectory


@dataclass(frozen=True, eq=False)
class SideRun:
    """A shot with side spin from its first touch-down to rest.

    Attributes
    ----------
    bounces : tuple of SideBounce
        The bounces, in order.
    glides : tuple of SideGlide
        Sliding and rolling, in order.
    time : float
        Until rest, s.
    rest : ndarray (2,)
        Where the ball rests, forward and to the right of the first touch-down, m.
    extrapolated : int
        How many of the landings are outside those that the law was fitted to.
    cautions : tuple of str
        What of the first landing and of the roll is an extrapolation.
    """

    bounces: tuple[SideBounce, ...]
    glides: tuple[SideGlide, ...]
    time: float
    rest: Array
    extrapolated: int = 0
    cautions: tuple[str, ...] = ()

    @property
    def first_height(self) -> float:
        """Height of the first hop, m (0 if there is none)."""
        hop = self.bounces[0].hop
        return 0.0 if hop is None else hop.height

    @property
    def kick(self) -> float:
        """Of the first bounce, rad, right positive."""
        return self.bounces[0].kick

    def path(self, points: int = 50) -> Array:
        """Return points of the path.

        Parameters
        ----------
        points : int, optional
            For each hop and stretch.

        Returns
        -------
        ndarray (n, 4)
            t (s), x, y and z (m) from the first touch-down.
        """
        rows = [np.zeros((1, 4))]
        for bounce in self.bounces:
            if bounce.hop is not None:
                t = np.linspace(0.0, bounce.hop.time, points)
                rows.append(np.column_stack([bounce.t + t, bounce.hop(t)]))
        for glide in self.glides:
            t = np.linspace(0.0, glide.time, points)
            x = glide.run(t)
            rows.append(np.column_stack([glide.t + t, x[:, 0], np.zeros_like(t), x[:, 1]]))
        return np.concatenate(rows)

    def __repr__(self) -> str:
        return (
            f"SideRun({len(self.bounces)} bounces, the first kicks {math.degrees(self.kick):.2f} deg, rests "
            f"{self.rest[0]:.4g} m on and {self.rest[1]:.3g} m to the right after {self.time:.3g} s)"
        )


def side_play(
    model: BounceLaw | ContactModel | Contact3D,
    landing: SideState,
    ball: Ball = GOLF,
    *,
    scaling: Scaling | None = None,
    air: Air | None = None,
    slope: float = 0.0,
    side_slope: float = 0.0,
    rolling_friction: float = GREEN_ROLLING_FRICTION,
    sliding_friction: float | None = None,
    min_height: float = 5e-3,
    max_bounces: int = 1000,
    tol: float = 1e-10,
) -> SideRun:
    """Follow a shot with side spin from its first touch-down to rest.

    Parameters
    ----------
    model : RigidBounce, TiltedBounce, ContactModel or Contact3D
        What every bounce follows.
    landing : SideState
        The first landing, in the axes of the ground.
    ball : Ball, optional
        Radius, mass and moment of inertia; default ``bounce.golf.GOLF``.
    scaling : Scaling, optional
        Needed for a contact model, see :func:`rebound`.
    air : Air, optional
        Drag and lift; none by default.
    slope, side_slope : float, optional
        Of the ground, rad, uphill forward and to the right.
    rolling_friction, sliding_friction, min_height, max_bounces, tol : optional
        As for :func:`play`.

    Returns
    -------
    SideRun
        Every bounce and every stretch on the ground, until rest.

    Raises
    ------
    NoRestError
        More than ``max_bounces``, or no rest on the slope.
    ModelError, LandingError, LiftOffError, nonsmooth.OptionError
        As :func:`play` and :func:`side_rebound`.

    Warns
    -----
    ExtrapolationWarning
        As :func:`play`.

    Examples
    --------
    >>> import bounce, math
    >>> back, side, about = bounce.golf.axis_spin(900.0, math.radians(10), math.radians(28))
    >>> landing = SideState.of(bounce.Landing(15.0, -20.0, back), side, about)
    >>> side_play(bounce.laws.RigidBounce(mu=0.5, restitution=0.3), landing, rolling_friction=0.25)
    SideRun(4 bounces, the first kicks 4.81 deg, rests 17.12 m on and 1.44 m to the right after 4.74 s)
    """
    require_positive(rolling_friction=rolling_friction, min_height=min_height)
    gravity, state = pull(slope, side_slope), landing
    turf = ground(model.model if isinstance(model, Contact3D) else model, ball, scaling, tol)
    turf.require_slope(slope)
    bounces: list[SideBounce] = []
    extrapolated, t, place = 0, 0.0, np.zeros(2)
    while True:
        if len(bounces) >= max_bounces:
            raise NoRestError(
                f"max_bounces: expected rest within {max_bounces} bounces, received a hop at "
                f"{t:.3g} s. Raise max_bounces or min_height ({min_height:g} m); with a restitution of 1, or "
                "down a slope, there may be no rest."
            )
        extrapolated += bool(turf.cautions(state.in_plane))
        after = bounced(model, state, ball, scaling, side_slope, tol)
        off, hop, begun, from_ = after.state, None, t, place
        t, place, up = t + after.time, place + after.way[[0, 2]], float(off.velocity[1])
        if up > 0.0 and after.way[1] - up**2 / (2 * gravity[1]) >= min_height:
            start = (float(place[0]), float(after.way[1]), float(place[1]))
            hop = side_flight(
                off, ball, air=air, slope=slope, side_slope=side_slope, start=start, tol=tol
            )
        bounces.append(SideBounce(begun, from_, state, off, after.itinerary, hop))
        if hop is None:
            break
        t, place, state = t + hop.time, place + np.array([hop.range, hop.side]), hop.landing
    mu = turf.mu if sliding_friction is None else sliding_friction
    glides, rolls = _glides(off, place, ball, t, gravity, mu, rolling_friction, tol)
    if glides:
        t, place = t + sum(g.time for g in glides), glides[-1].run(glides[-1].time)[:2]
    cautions = (*turf.cautions(landing.in_plane), *roll_cautions(rolls, rolling_friction))
    for caution in cautions:
        warnings.warn(caution, ExtrapolationWarning, stacklevel=2)
    return SideRun(tuple(bounces), tuple(glides), t, place, extrapolated, cautions)


@lru_cache
def _ground_systems() -> tuple[ns.FilippovSystem, ns.FilippovSystem]:
    """A ball that slides until it rolls, and one that rolls to rest."""
    x, v, h, pull, lam = (ca.SX.sym(n, 2) for n in ("x", "v", "h", "pull", "lambda"))
    friction, inertia = ca.SX.sym("friction"), ca.SX.sym("inertia")
    parameters = ca.vertcat(pull, friction, inertia)
    force = -friction * lam
    slides = ns.FilippovSystem(
        ca.vertcat(x, v, h),
        field=ca.vertcat(v, pull + force, pull + force * (1 + 1 / inertia)),
        surfaces=[h],
        multipliers=[lam],
        parameters=parameters,
    )
    rolls = ns.FilippovSystem(
        ca.vertcat(x, v),
        field=ca.vertcat(v, (pull + force) / (1 + inertia)),
        surfaces=[v],
        multipliers=[lam],
        parameters=parameters,
    )
    return slides, rolls


def _glides(
    off: SideState,
    place: Array,
    ball: Ball,
    t: float,
    gravity: Array,
    mu: float,
    rolling: float,
    tol: float,
) -> tuple[list[SideGlide], float]:
    """Slide until the ball rolls, then roll to rest; and the speed with which it begins to roll."""
    normal, along, v = -float(gravity[1]), gravity[[0, 2]], off.velocity[[0, 2]]
    slip = v + ball.radius * np.array([off.spin[2], -off.spin[0]])
    values = {"pull_0": along[0], "pull_1": along[1], "inertia": ball.inertia}
    slides, rolls = _ground_systems()
    glides: list[SideGlide] = []

    def follow(
        mode: str, system: ns.FilippovSystem, start: Array, friction: float, bound: float
    ) -> ns.Event:
        """Follow a stretch to the set that ends it, within a bound of its time."""
        own = {**values, "friction": friction}
        run = ns.simulate(system, start, bound, parameters=own, tol=tol)
        hit = next((e for e in run.events if e.kind in ("entry", "crossing")), run.events[-1])
        glides.append(SideGlide(mode, t, hit.t, run))
        return hit

    steep, k = float(np.hypot(*along)), ball.inertia
    if np.hypot(*slip) > 1e-12 * np.hypot(*v):
        decay = mu * normal * (1 + 1 / k) - steep
        if decay <= 0.0:
            raise NoRestError(
                f"slope: expected one on which friction stops the slip, received a pull of {steep:g} m/s2 "
                f"with mu = {mu:g}: the ball slides down for ever."
            )
        bound = 1.01 * float(np.hypot(*slip)) / decay
        hit = follow("*", slides, np.concatenate([place, v, slip]), mu * normal, bound)
        t, place, v = t + hit.t, hit.x[:2], hit.x[2:4]
    if steep >= rolling * normal:
        raise NoRestError(
            f"slope: expected one on which a rolling ball stops, received a pull of {steep:g} m/s2 with a "
            f"rolling friction of {rolling:g}: it needs less than {rolling * normal:g}."
        )
    speed = float(np.hypot(*v))
    if speed > 0.0:
        bound = 1.01 * speed * (1 + k) / (rolling * normal - steep)
        follow("s", rolls, np.concatenate([place, v]), rolling * normal, bound)
    return glides, speed
