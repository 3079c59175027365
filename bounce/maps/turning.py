"""How compliance turns the slip of a ball that is not moving along its slip."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from ..contact.model import ContactModel
from ..errors import LandingError, ModelError
from ..parameters import numbers
from ..shot.simulate import simulate
from .lift_offs import lift_off

Array = NDArray[np.float64]

#: Points of Gauss's rule over the contact.
_POINTS = 60


class SlipTurn(NamedTuple):
    """By how much the slip turns from touch-down to lift-off.

    Attributes
    ----------
    eta : ndarray (n,)
        Tangential over normal natural frequency.
    turn : ndarray (n,)
        Computed, rad in $(-pi, pi]$, from forward to the right positive.
    first_order : ndarray (n,)
        By the formula, for a ball that slips throughout.
    """

    eta: Array
    turn: Array
    first_order: Array


def slip_turn(
    model: ContactModel,
    xdot: ArrayLike,
    omega: ArrayLike,
    eta: ArrayLike,
    ydot: float = -1.0,
    *,
    tol: float = 1e-10,
) -> SlipTurn:
    """Turn of the slip's direction with the stiffness along the ground, beside a formula.

    A rigid ground keeps the direction of the slip h. A compliant one pushes against the velocity V of
    the centre, so where V has a component $V_n$ normal to h (to the right of it), to first order

    $$
    turn = -V_n int_0^T (2 d1 eta + eta^2 t)/(|h_0| - (1 + 1/inertia) mu J(t)) dt
    $$

    with T the duration and $J(t)$ the impulse of the load.

    Parameters
    ----------
    model : ContactModel
        One with parameters ``d1`` and ``eta`` and the linear surface along the ground, and the load of
        a motion that does not depend on it.
    xdot, omega : array_like (2,)
        Velocity and spin at touch-down, forward and to the right.
    eta : array_like (n,)
        Tangential over normal natural frequency, one bounce for each.
    ydot : float, optional
        Velocity into the ground.
    tol : float, optional
        Of the bounces.

    Returns
    -------
    SlipTurn
        The turn as computed, and as the formula has it.

    Examples
    --------
    >>> import bounce, numpy as np
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    >>> found = bounce.slip_turn(turf, [2.0, 0.0], [0.5, 1.0], [0.01], tol=1e-9)
    >>> [f"{np.degrees(v[0]):.5f}" for v in (found.turn, found.first_order)]
    ['0.18914', '0.18806']
    """
    if not isinstance(model, ContactModel) or not {"d1", "eta"} <= set(model.values):
        raise ModelError(
            f"model: expected a ContactModel with parameters d1 and eta, received {model!r}."
        )
    v, w, ratios = (
        numbers(a, n, LandingError) for a, n in ((xdot, "xdot"), (omega, "omega"), (eta, "eta"))
    )
    if v.shape != (2,) or w.shape != (2,) or ratios.ndim != 1:
        raise LandingError(
            f"xdot, omega, eta: expected two numbers, two numbers and a list, received shapes {v.shape}, "
            f"{w.shape} and {ratios.shape}."
        )
    slip = v + w
    size = float(np.hypot(*slip))
    if size == 0.0:
        raise LandingError(
            "xdot, omega: expected a ball that slips, received no slip at touch-down."
        )
    off = lift_off(model.in_3d(), v, ydot, w, parameters={"eta": ratios}, tol=tol)
    cross = slip[0] * off.slip[:, 1] - slip[1] * off.slip[:, 0]
    turn = np.arctan2(cross + 0.0, off.slip @ slip)
    values = model.values
    shot = simulate(model.replace(eta=0.0), size, ydot, 0.0, tol=tol)
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    t, weights = shot.time * (nodes + 1) / 2, weights * shot.time / 2
    gravity = values["G"] * np.cos(values["slope"]) if model.convention == "contact" else 0.0
    impulse = shot(t)[:, 3] - ydot + gravity * t
    left = size - (1 + 1 / values["inertia"]) * values["mu"] * impulse
    if np.any(left <= 0.0):
        raise ns.OptionError(
            f"omega: expected a ball that slips throughout, received one that rolls with a slip of "
            f"{size:g} at touch-down: the formula does not hold."
        )
    normal = (slip[0] * v[1] - slip[1] * v[0]) / size
    first = [
        -normal * float(weights @ ((2 * values["d1"] * e + e**2 * t) / left))
        for e in ratios.tolist()
    ]
    return SlipTurn(ratios, turn, np.array(first))
