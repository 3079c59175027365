"""Velocity and spin of a ball with side spin, and the parts of the spin about a tilted axis.

A golf ball's spin axis, horizontal for pure backspin, is tilted in the plane normal to its launch. The
axis keeps its direction in flight, so the ball lands with the part omega_x = omega sin(tilt) sin(launch
angle) about the direction of travel. That is what friction feels on level ground; the part about the
vertical counts where the ground acts as if it were tilted, and with drilling friction. Positive tilt and
positive omega_x are to the right, where the ball also curves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..errors import require
from ..parameters import LIMITS, number, numbers
from ..units import GRAVITY, Landing

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

    Raises
    ------
    nonsmooth.PointError
        Not three finite numbers.

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
            Of the ground, uphill to the right, rad: its normal leans to the left, and a ball that falls
            in a vertical plane lands with a speed to the foot of the slope.
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
    def side_spin(self) -> float:
        """Spin about the direction of travel along the ground, rad/s, right positive."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return float(self.spin[0] * c + self.spin[2] * s)

    @property
    def in_plane(self) -> Landing:
        """In the plane of travel: speed along the ground, speed up, backspin across it."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        along = float(np.hypot(self.velocity[0], self.velocity[2]))
        return Landing(along, float(self.velocity[1]), float(self.spin[2] * c - self.spin[0] * s))


#: A state in a vertical plane or with side spin; what is computed from one is of the same kind.
S = TypeVar("S", bound=Landing | SideState)


def in_space(state: Landing | SideState) -> SideState:
    """Return a state in the axes of level ground."""
    return SideState.of(state) if isinstance(state, Landing) else state


def upward(state: Landing | SideState) -> float:
    """Return the velocity normal to the ground."""
    return state.ydot if isinstance(state, Landing) else float(state.velocity[1])


def same_kind(given: S, velocity: Any, spin: Any) -> S:
    """Return a state of the kind of another one."""
    state: Any
    if isinstance(given, Landing):
        state = Landing(float(velocity[0]), float(velocity[1]), float(spin[2]))
    else:
        state = SideState(velocity, spin)
    return state


def gravity_on(state: Landing | SideState, name: str, slope: float, side_slope: float) -> Array:
    """Return gravity in the axes of the ground (3,), for a state that fits its slopes."""
    require(state, (Landing, SideState), name, "Speeds and spins are in SI units.")
    for what, value in (("slope", slope), ("side_slope", side_slope)):
        if not LIMITS["in (-pi/2, pi/2)"](number(value, what, ns.OptionError)):
            raise ns.OptionError(f"{what}: expected radians in (-pi/2, pi/2), received {value!r}.")
    if side_slope and isinstance(state, Landing):
        raise ns.OptionError(
            f"side_slope: {side_slope!r} needs a state in the axes of the ground. Give "
            f"bounce.golf.SideState.of({name}, side_slope={side_slope!r})."
        )
    across = math.cos(slope)
    along = [math.sin(slope), across * math.cos(side_slope), across * math.sin(side_slope)]
    return -GRAVITY * np.array(along)


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

    Raises
    ------
    nonsmooth.OptionError
        Numbers that are not finite; angles outside $[-pi/2, pi/2]$ and $[0, pi/2]$.

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
