"""Rigid impact with Coulomb friction, in closed form, and the restitution of compliant ground.

In the normal impulse n the contact point's velocity obeys dv_N/dn = 1 and, while it slips,
dv_T/dn = -+ (1 + 1/inertia) mu; rolling needs no tangential force, so it lasts. For a sphere the
kinematic, Poisson and energetic coefficients of restitution coincide: friction does not change v_N.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from .contact import ContactModel
from .errors import LandingError
from .parameters import LIMITS, Names, Parametrised, number

Array = NDArray[np.float64]
Restitution = float | Callable[[Any], ArrayLike]

#: Relative width within which two cases count as their common boundary.
_BOUNDARY = 4e-15


@dataclass(frozen=True)
class RigidShot:
    """Lift-off after a rigid impact; arrays of the broadcast shape of the inputs.

    Attributes
    ----------
    xdot, ydot, omega, slip : ndarray
        At lift-off; slip is xdot + omega.
    case : ndarray of str
        "I", "II" or "III" with the sign of the slip at touch-down: slipping throughout, rolling
        from restitution on, rolling from compression on. "I/II+" is a boundary; no sign without
        slip.
    normal_impulse, tangential_impulse : ndarray
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


class RigidBounce(Parametrised):
    """Rigid ball, rigid ground, Coulomb friction: the limit that has no reversal of slip.

    Parameters
    ----------
    mu : float
        Friction coefficient.
    restitution : float or callable
        In [0, 1]; a function of the normal speed abs(ydot) (arrays in, arrays out) is allowed.
    inertia : float
        I = inertia m R^2; 2/5 is a solid sphere.
    hypothesis : {"kinematic", "poisson", "energetic"}
        What ``restitution`` is the ratio of: normal speeds, normal impulses, or the square root of
        the ratio of the normal force's work. Equal for a sphere.

    Source: Biber, Champneys & Szalai 2022, Sec. 2.2; Stronge 2000, Impact Mechanics.

    Examples
    --------
    >>> import bounce
    >>> hard = bounce.RigidBounce(mu=0.3, restitution=0.5)
    >>> shot = hard.lift_off(xdot=0.75, ydot=-1.25, omega=2.596875)
    >>> str(shot.case), float(shot.xdot), round(float(shot.omega), 12)
    ('I+', 0.1875, 1.190625)
    """

    parameters = dict(mu=None, inertia=2 / 5)
    limits = dict(mu="> 0", inertia="in (0, 1]")

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

        Raises
        ------
        LandingError
            Not finite, or not approaching.
        """
        u, v, w = _landings(xdot, ydot, omega)
        r = self.restitution
        ratio = _unit_interval(_of_speed(r, -v) if callable(r) else np.asarray(r, dtype=float))
        inverse_mass = 1 + 1 / self.values["inertia"]
        drag = inverse_mass * self.values["mu"]
        slip, sign = u + w, np.sign(u + w)
        compression = -v
        total = _TOTAL_IMPULSE[self.hypothesis](compression, ratio)
        onset = np.abs(slip) / drag
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

    def _options(self) -> dict[str, Any]:
        options: dict[str, Any] = {"restitution": self.restitution}
        if self.hypothesis != "kinematic":
            options["hypothesis"] = self.hypothesis
        return options


def _landings(xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike) -> tuple[Array, Array, Array]:
    try:
        given = [np.asarray(a, dtype=float) for a in (xdot, ydot, omega)]
        u, v, w = np.broadcast_arrays(*given)
    except (TypeError, ValueError) as error:
        raise LandingError(
            f"landing: expected numbers or arrays that broadcast, received xdot = {xdot!r}, ydot = "
            f"{ydot!r}, omega = {omega!r}."
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


def kelvin_voigt_restitution(d2: float) -> float:
    """Restitution of Y'' + 2 d2 Y' + Y = 0 from touch-down to zero force, for any damping ratio.

    -ln r = 2 c cot c with c = arccos d2, and its continuation 2 a coth a, a = arcosh d2, beyond
    critical damping. With b = arcsin d2 this is r = exp(-tan b (pi - 2 b)); for d = 2 d2 small it
    is exp(-pi d/2 + d^2/2 - pi d^3/16 + ...).

    Parameters
    ----------
    d2 : float
        Damping ratio, >= 0.

    Returns
    -------
    float

    Examples
    --------
    >>> round(kelvin_voigt_restitution(0.1), 12), round(kelvin_voigt_restitution(1.0), 12)
    (0.744..., 0.135335283237)
    """
    ratio = number(d2, "d2")
    if not LIMITS[">= 0"](ratio):
        raise ns.ParameterError(f"d2: expected a number >= 0, received {d2!r}.")
    if ratio == 1.0:
        return math.exp(-2.0)
    c = math.acos(ratio) if ratio < 1 else math.acosh(ratio)
    return math.exp(-2 * c / (math.tan(c) if ratio < 1 else math.tanh(c)))


class NormalKelvinVoigt(ContactModel):
    """Normal spring and damper, rigid tangential contact: rolling, once begun, lasts.

    Its lift-off without gravity is that of :class:`RigidBounce` with the exact ``restitution``.

    Parameters
    ----------
    mu, d2 : float
    G : float, optional

    Examples
    --------
    >>> import bounce
    >>> soft = bounce.NormalKelvinVoigt(mu=0.3, d2=0.1)
    >>> shot = bounce.simulate(soft, xdot=1.0, ydot=-1.0, omega=0.5, tol=1e-12)
    >>> abs(shot.restitution - soft.restitution) < 1e-12
    True
    """

    parameters = dict(mu=None, d2=None, G=0.0)
    limits = dict(d2=">= 0")

    def normal_force(self, s: Names, p: Names) -> Any:
        return -2 * p.d2 * s.ydot - s.y

    def tangential_force(self, s: Names, p: Names) -> Any:
        return 0

    def stored_energy(self, s: Names, p: Names) -> Any:
        """Elastic energy of the normal spring."""
        return 0.5 * s.y**2

    @property
    def restitution(self) -> float:
        """Exact restitution without gravity."""
        return kelvin_voigt_restitution(self.values["d2"])
