"""Rigid impact with Coulomb friction, in closed form.

In the normal impulse n the contact point's velocity obeys dv_N/dn = 1 and, while it slips,
dv_T/dn = -+ (1 + 1/inertia) mu; rolling needs no tangential force, so it lasts. For a sphere the
kinematic, Poisson and energetic coefficients of restitution coincide: friction does not change v_N.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..parameters import number
from .law import BounceLaw, RigidShot, checked_landings

Array = NDArray[np.float64]
Restitution = float | Callable[[Any], ArrayLike]

#: Relative width within which two cases count as their common boundary.
_BOUNDARY = 4e-15


class RigidBounce(BounceLaw):
    """Rigid ball, rigid ground, Coulomb friction: the limit that has no reversal of slip.

    Source: Biber, Champneys & Szalai 2022, Sec. 2.2; Stronge 2000, Impact Mechanics.

    Parameters
    ----------
    mu : float
        Friction coefficient.
    restitution : float or callable
        In [0, 1]; a function of the normal speed ``abs(ydot)`` (arrays in, arrays out) is allowed.
    inertia : float
        Moment of inertia over $m R^2$; 2/5 is a solid sphere.
    hypothesis : {"kinematic", "poisson", "energetic"}
        What ``restitution`` is the ratio of: normal speeds, normal impulses, or the square root of
        the ratio of the normal force's work. Equal for a sphere.

    Examples
    --------
    >>> import bounce
    >>> hard = bounce.laws.RigidBounce(mu=0.3, restitution=0.5)
    >>> shot = hard.lift_off(xdot=0.75, ydot=-1.25, omega=2.596875)
    >>> str(shot.case), float(shot.xdot), round(float(shot.omega), 12)
    ('I+', 0.1875, 1.190625)
    """

    restitution: Restitution
    hypothesis: str

    def __init__(
        self,
        *,
        restitution: Restitution,
        hypothesis: Literal["kinematic", "poisson", "energetic"] = "kinematic",
        **values: float,
    ):
        super().__init__(**values)
        if not callable(restitution):
            _unit_interval(np.asarray(number(restitution, "restitution")))
        if hypothesis not in _TOTAL_IMPULSE:
            raise ns.ParameterError(
                f"hypothesis: expected one of {list(_TOTAL_IMPULSE)}, received {hypothesis!r}."
            )
        self._set("restitution", restitution)
        self._set("hypothesis", hypothesis)

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
        u, v, w = checked_landings(xdot, ydot, omega)
        r = self.restitution
        ratio = _unit_interval(_of_speed(r, -v) if callable(r) else np.asarray(r, dtype=float))
        inverse_mass = 1 + 1 / self.values["inertia"]
        drag = inverse_mass * self.values["mu"]
        slip, sign = u + w, np.sign(u + w)
        compression = -v
        total = _TOTAL_IMPULSE[self.hypothesis](compression, ratio)
        with np.errstate(divide="ignore", invalid="ignore"):  # without friction it never rolls
            onset = np.where(slip == 0.0, 0.0, np.abs(slip) / drag)
        slips = onset >= total
        tangential = -sign * self.values["mu"] * np.minimum(onset, total)
        return RigidShot(
            xdot=u + tangential,
            ydot=v + total,
            omega=w + tangential / self.values["inertia"],
            slip=np.where(slips, slip - sign * drag * total, 0.0),
            case=_cases(onset, compression, total, sign),
            normal_impulse=total,
            tangential_impulse=tangential,
            rolling_impulse=np.where(slips, np.nan, onset),
            rolling_speed=np.where(slips, np.nan, v + onset),
        )

    def _structure(self) -> tuple[Any, ...]:
        return (self.restitution, self.hypothesis)

    def options(self) -> dict[str, Any]:
        options: dict[str, Any] = {"restitution": self.restitution}
        if self.hypothesis != "kinematic":
            options["hypothesis"] = self.hypothesis
        return options


def _of_speed(restitution: Callable[[Any], ArrayLike], speed: Array) -> Array:
    """Values of a restitution function, one for each speed."""
    value = restitution(speed)
    try:
        return np.broadcast_to(np.asarray(value, dtype=float), speed.shape)
    except (TypeError, ValueError) as error:
        raise ns.ParameterError(
            f"restitution: expected a function of the normal speed that returns an array of its shape "
            f"{speed.shape}, received {value!r}."
        ) from error


def _unit_interval(values: Array) -> Array:
    if not np.all((values >= 0) & (values <= 1)):
        wrong = values[~((values >= 0) & (values <= 1))].flat[0]
        raise ns.ParameterError(
            f"restitution: expected a number in [0, 1], received {wrong}. Above 1 the impact would "
            "create energy, below 0 the ball would pass through the ground."
        )
    return values


def _cases(onset: Array, compression: Array, total: Array, sign: Array) -> NDArray[np.str_]:
    def near(a: Array, b: Array) -> NDArray[np.bool_]:
        return np.abs(a - b) <= _BOUNDARY * np.abs(b)

    names = np.select(
        [
            near(onset, total) & near(onset, compression),
            near(onset, total),
            near(onset, compression),
            onset > total,
            onset > compression,
        ],
        ["I/III", "I/II", "II/III", "I", "II"],
        "III",
    )
    letters = np.select([sign > 0, sign < 0], ["+", "-"], "")
    return np.char.add(names, letters)


def _kinematic(speed: Array, r: Array) -> Array:
    """Impulse at which v_N = r * speed."""
    return speed + r * speed


def _poisson(speed: Array, r: Array) -> Array:
    """Impulse of compression times 1 + r."""
    return (1 + r) * speed


def _energetic(speed: Array, r: Array) -> Array:
    """Impulse at which the work of restitution, (n - speed)^2/2, is r^2 that of compression."""
    return speed + np.sqrt(r**2 * speed**2)


_TOTAL_IMPULSE: dict[str, Callable[[Array, Array], Array]] = {
    "kinematic": _kinematic,
    "poisson": _poisson,
    "energetic": _energetic,
}
