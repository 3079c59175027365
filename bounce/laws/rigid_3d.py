"""Rigid impact with side spin, in closed form: the direction of the slip does not change.

With friction in the plane and no compliance h' = -(1 + 1/inertia) mu u, u = h/|h|, in the normal impulse:
|h| obeys the planar law, and the tangential impulse is along the first slip. The travel X' is in general
not along it, so the ball is deflected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import LandingError, ModelError
from .rigid import RigidBounce

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RigidShot3D:
    """Lift-off after a rigid impact in 3-D; arrays of the broadcast shape (...) of the landings.

    Attributes
    ----------
    xdot, omega, slip : ndarray (..., 2)
        Velocity along the ground, spin and slip at lift-off, forward and to the right.
    ydot : ndarray (...)
        Velocity normal to the ground.
    case : ndarray of str (...)
        "I", "II" or "III" as of :class:`RigidShot`, without a sign.
    """

    xdot: Array
    ydot: Array
    omega: Array
    slip: Array
    case: NDArray[np.str_]

    @property
    def travel_angle(self) -> Array:
        """Direction in which the ball leaves along the ground (...), rad from forward to the right."""
        return np.arctan2(self.xdot[..., 1] + 0.0, self.xdot[..., 0])

    @property
    def slip_angle(self) -> Array:
        """Direction of the slip (...), rad from forward to the right; 0 where the ball rolls."""
        return np.arctan2(self.slip[..., 1] + 0.0, self.slip[..., 0])


def rigid_lift_off_3d(
    law: RigidBounce, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike
) -> RigidShot3D:
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
    RigidShot3D
        Speeds and spin at lift-off, and the case of the law.

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
            "own axes; bounce.golf.rebound turns a TiltedBounce."
        )
    v, w = (_pairs(name, value) for name, value in (("xdot", xdot), ("omega", omega)))
    try:
        v, w = np.broadcast_arrays(v, w)
        slip = v + w
        size = np.hypot(slip[..., 0], slip[..., 1])
        shape = np.broadcast_shapes(size.shape, np.shape(ydot))
    except ValueError as error:
        raise LandingError(
            f"landing: expected arrays that broadcast, received shapes {v.shape}, {np.shape(ydot)} and "
            f"{w.shape}."
        ) from error
    # In the planar law the slip alone decides: a ball that moves with it and does not spin.
    plane = law.lift_off(size, ydot, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.where(size[..., None] > 0, slip / size[..., None], 0.0)
    impulse = plane.tangential_impulse[..., None] * u
    after = np.where(plane.slip[..., None] > 0, plane.slip[..., None] * u, 0.0)
    full = (*shape, 2)
    return RigidShot3D(
        xdot=np.broadcast_to(v + impulse, full).copy(),
        ydot=plane.ydot,
        omega=np.broadcast_to(w + impulse / law.values["inertia"], full).copy(),
        slip=np.broadcast_to(after, full).copy(),
        case=np.char.rstrip(plane.case, "+-"),
    )


def _pairs(name: str, value: ArrayLike) -> Array:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise LandingError(f"{name}: expected numbers, received {value!r}.") from error
    if array.ndim == 0 or array.shape[-1] != 2:
        raise LandingError(
            f"{name}: expected an array (..., 2), forward and to the right on the last axis, received "
            f"shape {array.shape}."
        )
    if not np.all(np.isfinite(array)):
        raise LandingError(f"{name}: expected finite numbers, received {value!r}.")
    return array
