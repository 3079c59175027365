"""Rigid impact whose grip throws the slip back (Cross 2002)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .law import BounceLaw, RigidShot
from .rigid import Restitution, RigidBounce


class CrossBounce(BounceLaw):
    """Rigid impact whose grip throws the slip back, by the factor ``-tangential_restitution``.

    Where that needs more than friction can give, the ball slips throughout. With
    ``tangential_restitution = 0`` it is :class:`RigidBounce`.

    Source: Cross 2002, Grip-slip behavior of a bouncing ball, Am. J. Phys. 70, 1093; Garwin 1969
    for the super ball.

    Parameters
    ----------
    mu : float
        Friction coefficient.
    restitution : float or callable
        Of the normal speed, between 0 and 1, or a function of it.
    tangential_restitution : float
        In [0, 1]: 0 leaves the ball rolling, 1 is a perfect super ball.
    inertia : float, optional
        Moment of inertia over mass and radius squared; default $2/5$.

    Examples
    --------
    >>> import bounce
    >>> law = bounce.laws.CrossBounce(mu=0.8, restitution=0.7, tangential_restitution=0.2)
    >>> shot = law.lift_off(xdot=1.0, ydot=-3.0, omega=1.0)
    >>> str(shot.case), float(shot.slip.round(12))
    ('grip+', -0.4)
    """

    parameters = dict(mu=None, tangential_restitution=None)
    limits = dict(tangential_restitution="in [0, 1]")

    rigid: RigidBounce

    def __init__(self, *, restitution: Restitution, **values: float):
        super().__init__(**values)
        mu, inertia = self.values["mu"], self.values["inertia"]
        self._set("rigid", RigidBounce(restitution=restitution, mu=mu, inertia=inertia))

    @property
    def restitution(self) -> Restitution:
        """Of the normal speed."""
        return self.rigid.restitution

    def lift_off(self, xdot: ArrayLike, ydot: ArrayLike, omega: ArrayLike) -> RigidShot:
        """Return the state after the impact; ``case`` is "I" (slips throughout) or "grip", signed.

        Parameters
        ----------
        xdot, ydot, omega : array_like
            At touch-down, broadcast against each other; ``ydot < 0``.

        Returns
        -------
        RigidShot
            Speeds and spin at lift-off, and the case of the law.
        """
        rigid = self.rigid.lift_off(xdot, ydot, omega)
        back = self.values["tangential_restitution"]
        before = np.asarray(xdot, dtype=float) + np.asarray(omega, dtype=float)
        sign = np.sign(before)
        grip = (1 + back) * np.abs(before) / (1 + 1 / self.values["inertia"])
        most = self.values["mu"] * rigid.normal_impulse
        tangential = -sign * np.minimum(grip, most)
        change = tangential - rigid.tangential_impulse
        signs = np.select([sign > 0, sign < 0], ["+", "-"], "")
        return replace(
            rigid,
            xdot=rigid.xdot + change,
            omega=rigid.omega + change / self.values["inertia"],
            slip=np.where(
                grip > most, before + tangential * (1 + 1 / self.values["inertia"]), -back * before
            ),
            case=np.char.add(np.where(grip > most, "I", "grip"), signs),
            tangential_impulse=tangential,
            rolling_impulse=np.full_like(tangential, np.nan),
            rolling_speed=np.full_like(tangential, np.nan),
        )

    def _structure(self) -> tuple[Any, ...]:
        return (self.restitution,)

    def options(self) -> dict[str, Any]:
        return {"restitution": self.restitution}
