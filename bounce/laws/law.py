"""Base of bounce laws: lift-off from landing in closed form, without a contact that takes time."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import LandingError
from ..parameters import Parametrised
from ..shot.state import AlongTheGround

Array = NDArray[np.float64]

#: Meanings of the cases of a rigid impact; the sign after them is that of the slip at touch-down.
CASES = {
    "I": "slips throughout",
    "II": "slips, then rolls from restitution on",
    "III": "slips, then rolls from compression on",
    "grip": "slips, then grips the ground",
}


@dataclass(frozen=True)
class RigidShot(AlongTheGround):
    """Lift-off after a rigid impact; arrays of the broadcast shape (...) of the inputs.

    In 3-D ``xdot``, ``omega``, ``slip`` and ``tangential_impulse`` are arrays (..., 2), forward and to
    the right.

    Attributes
    ----------
    xdot, ydot, omega, slip : ndarray
        At lift-off; slip is $xdot + omega$.
    case : ndarray of str
        "I", "II" or "III" with the sign of the slip at touch-down: slipping throughout, rolling
        from restitution on, rolling from compression on. "I/II+" is a boundary; no sign without
        slip, and none in 3-D.
    normal_impulse, tangential_impulse : ndarray
        Impulses over the ball's mass, so speeds.
    rolling_impulse, rolling_speed : ndarray
        Normal impulse and normal speed when rolling begins; NaN in case I.
    """

    xdot: Array
    ydot: Array
    omega: Array
    slip: Array
    case: NDArray[np.str_]
    normal_impulse: Array
    tangential_impulse: Array
    rolling_impulse: Array
    rolling_speed: Array


@dataclass(frozen=True)
class LandingRange:
    """Landings that a law was fitted to, as a box.

    Attributes
    ----------
    xdot, ydot : (float, float)
        Lowest and highest speed along and into the ground, m/s.
    spin : (float, float)
        Lowest and highest spin, rad/s, backspin positive.
    source : str
        Where the range was read.

    Examples
    --------
    >>> import bounce
    >>> covers = bounce.laws.TURFS["natural"].law.covers
    >>> covers.holds(20.0, [-10.0, -40.0], 200.0)
    array([ True, False])
    """

    xdot: tuple[float, float]
    ydot: tuple[float, float]
    spin: tuple[float, float]
    source: str

    def holds(self, xdot: ArrayLike, ydot: ArrayLike, spin: ArrayLike) -> NDArray[np.bool_]:
        """Whether landings are inside.

        Parameters
        ----------
        xdot, ydot, spin : array_like
            m/s and rad/s, broadcast against each other; mirror images are the same.

        Returns
        -------
        ndarray of bool
            True where a landing is inside.
        """
        inside = [
            (low <= value) & (value <= high)
            for value, (low, high), *_ in self._pairs(xdot, ydot, spin)
        ]
        return np.logical_and.reduce(np.broadcast_arrays(*inside))

    def misses(self, xdot: float, ydot: float, spin: float) -> str:
        """Return in words which components of a landing are outside.

        Parameters
        ----------
        xdot, ydot, spin : float
            m/s and rad/s, as for :meth:`holds`.

        Returns
        -------
        str
            Empty for a landing inside.
        """
        words = []
        for value, (low, high), what, unit, factor in self._pairs(xdot, ydot, spin):
            if not low <= value <= high:
                v, a, b = (f"{_rounded(float(x) / factor):g}" for x in (value, low, high))
                words.append(f"{what} of {v} {unit} (fitted: {a} to {b})")
        return " and ".join(words)

    def _pairs(self, xdot: ArrayLike, ydot: ArrayLike, spin: ArrayLike) -> list[Any]:
        """Values to compare, their limits, and their names and units."""
        u, v, w = (np.asarray(a, dtype=float) for a in (xdot, ydot, spin))
        return [
            (np.abs(u), self.xdot, "a speed along the ground", "m/s", 1.0),
            (np.abs(v), self.ydot, "a speed into the ground", "m/s", 1.0),
            (np.where(u < 0, -w, w), self.spin, "a spin", "rpm", math.pi / 30),
        ]


def _rounded(value: float) -> float:
    """To three digits, or to whole numbers from 100; values below a thousandth become zero."""
    return round(value) if abs(value) >= 100 else float(f"{round(value, 4):.3g}")


class BounceLaw(Parametrised, ABC):
    """Base of the laws: friction ``mu``, a ball of ``inertia``, and a closed form ``lift_off``.

    Laws take and give xdot, ydot and the surface speed of the spin (spin times radius) in one unit
    of speed.

    Attributes
    ----------
    covers : LandingRange or None
        Landings that it was fitted to, where it was. No part of the law's value.
    """

    covers: LandingRange | None = None

    parameters = dict(mu=None, inertia=2 / 5)
    limits = dict(mu=">= 0", inertia="in (0, 1]")

    @abstractmethod
    def lift_off(self, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike) -> RigidShot:
        """Return the state after the impact.

        Parameters
        ----------
        xdot, ydot, omega : array_like
            At touch-down, broadcast against each other; ``ydot < 0``.

        Returns
        -------
        RigidShot
            Speeds and spin at lift-off, and the case of the law.

        Raises
        ------
        LandingError
            Not finite, or not approaching.
        """

    def covering(self, covers: LandingRange | None) -> Self:
        """Return the same law, with the range of landings that it was fitted to.

        Parameters
        ----------
        covers : LandingRange or None
            The range, or None for every landing.
        """
        copy = self.replace()
        copy._set("covers", covers)
        return copy

    def replace(self, **changes: Any) -> Self:
        """Return a copy with other parameters or options, and the same range of landings.

        Parameters
        ----------
        **changes
            New values by name.
        """
        copy = super().replace(**changes)
        copy._set("covers", self.covers)
        return copy

    def caution(self, xdot: float, ydot: float) -> str:
        """Return why the form of the law, whatever its numbers, does not hold for a landing.

        Parameters
        ----------
        xdot, ydot : float
            m/s.

        Returns
        -------
        str
            Empty where it holds.
        """
        return ""


def checked_landings(
    xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike
) -> tuple[Array, Array, Array]:
    """Return landings as finite arrays of one shape that approach the ground."""
    try:
        given = [np.asarray(a, dtype=float) for a in (xdot, ydot, omega)]
        u, v, w = np.broadcast_arrays(*given)
    except (TypeError, ValueError) as error:
        raise LandingError(
            f"xdot = {xdot!r}, ydot = {ydot!r} and omega = {omega!r} are no arrays of numbers that "
            "broadcast."
        ) from error
    for name, a in zip(("xdot", "ydot", "omega"), (u, v, w), strict=True):
        if not np.all(np.isfinite(a)):
            raise LandingError(
                f"{name}: expected finite numbers, received {a[~np.isfinite(a)][0]}."
            )
    if np.any(v >= 0):
        raise LandingError(
            f"ydot: expected negative numbers, received {v[v >= 0][0]}. The ball does not approach "
            "the ground (y points up)."
        )
    return u, v, w
