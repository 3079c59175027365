"""Rigid impact with Coulomb friction in closed form, with one or two directions along the ground.

In the normal impulse n the contact point's velocity obeys dv_N/dn = 1 and, while it slips,
dh/dn = -(1 + 1/inertia) mu u with u = h/|h|: the direction of the slip does not change, so |h| obeys
one law in the plane and in 3-D. Rolling needs no tangential force, so it lasts. For a sphere the
kinematic, Poisson and energetic coefficients of restitution coincide: friction does not change v_N.
The travel is in general not along the slip, so in 3-D the ball is deflected.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..errors import LandingError, ModelError
from ..parameters import number, numbers
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
        slip = u + w
        return self._impact(
            u, v, w, np.abs(slip), np.sign(slip), np.select([slip > 0, slip < 0], "+-", "")
        )

    def _impact(
        self, xdot: Array, ydot: Array, omega: Array, size: Array, unit: Array, sign: Any
    ) -> RigidShot:
        """The impact with a slip of this size and direction."""
        r, mu, inertia = self.restitution, self.values["mu"], self.values["inertia"]
        ratio = _unit_interval(_of_speed(r, -ydot) if callable(r) else np.asarray(r, dtype=float))
        drag = (1 + 1 / inertia) * mu
        total = _TOTAL_IMPULSE[self.hypothesis](-ydot, ratio)
        with np.errstate(divide="ignore", invalid="ignore"):  # without friction it never rolls
            onset = np.where(size == 0.0, 0.0, size / drag)
        slips = onset >= total
        friction, after = -mu * np.minimum(onset, total), np.where(slips, size - drag * total, 0.0)
        if unit.ndim > size.ndim:
            friction, after = friction[..., None], after[..., None]
        tangential = friction * unit
        return RigidShot(
            xdot=xdot + tangential,
            ydot=ydot + total,
            omega=omega + tangential / inertia,
            slip=after * unit + 0.0,  # not -0.0
            case=np.char.add(_cases(onset, -ydot, total), sign),
            normal_impulse=total,
            tangential_impulse=tangential,
            rolling_impulse=np.where(slips, np.nan, onset),
            rolling_speed=np.where(slips, np.nan, ydot + onset),
        )

    def _structure(self) -> tuple[Any, ...]:
        return (self.restitution, self.hypothesis)

    def options(self) -> dict[str, Any]:
        options: dict[str, Any] = {"restitution": self.restitution}
        if self.hypothesis != "kinematic":
            options["hypothesis"] = self.hypothesis
        return options


def rigid_lift_off_3d(
    law: RigidBounce, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike
) -> RigidShot:
    """Bounce balls with side spin on rigid ground.

    With $J = mu$ times the normal impulse, $u = h/|h|$ at touch-down, k the inertia: a ball that slips
    throughout, $|h| > (1 + 1/k) J$, leaves with $X' - J u$ and $W - J u/k$; else it rolls, $X' = -W = (X' - k W)/(1 + k)$.

    Parameters
    ----------
    law : RigidBounce
        Friction, restitution and inertia.
    xdot, omega : array_like (..., 2)
        At touch-down, forward and to the right; $omega = (omega_z, -omega_x)$ times the radius.
    ydot : array_like (...)
        Normal velocity, below zero.

    Returns
    -------
    RigidShot
        Speeds and spin at lift-off, and the case of the law, without a sign.

    Raises
    ------
    LandingError
        Not pairs, not finite, or not approaching.
    ModelError
        Another law than :class:`RigidBounce`.

    Examples
    --------
    >>> import bounce
    >>> hard = bounce.laws.RigidBounce(mu=0.3, restitution=0.5)
    >>> shot = bounce.laws.rigid_lift_off_3d(hard, [1.0, 0.0], -1.0, [0.2, 0.5])
    >>> str(shot.case), [round(float(v), 6) for v in shot.xdot]
    ('II', [0.657143, -0.142857])
    """
    if not isinstance(law, RigidBounce):
        raise ModelError(
            f"law: expected a RigidBounce, received {law!r}. On a tilted plane the impact is that of its "
            "own axes; bounce.golf.side_rebound turns a TiltedBounce."
        )
    pairs = [
        numbers(value, name, LandingError) for name, value in (("xdot", xdot), ("omega", omega))
    ]
    for name, pair in zip(("xdot", "omega"), pairs, strict=True):
        if pair.shape[-1:] != (2,):
            raise LandingError(
                f"{name} has shape {pair.shape}, but its last axis has two components, forward and to "
                "the right."
            )
    down = numbers(ydot, "ydot", LandingError)[..., None]
    v, down, w = checked_landings(pairs[0], down, pairs[1])
    slip = v + w
    size = np.hypot(slip[..., 0], slip[..., 1])
    with np.errstate(invalid="ignore"):
        unit = np.where(size[..., None] > 0, slip / size[..., None], 0.0)
    return law._impact(v, down[..., 0], w, size, unit, "")


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


def _cases(onset: Array, compression: Array, total: Array) -> NDArray[np.str_]:
    def near(a: Array, b: Array) -> NDArray[np.bool_]:
        return np.abs(a - b) <= _BOUNDARY * np.abs(b)

    return np.select(
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
