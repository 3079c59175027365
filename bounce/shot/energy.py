"""Whether a ball leaves with more energy than it came with: a mistake in most models.

Friction hides a gain, so it is looked for in the motion along y where that depends on itself only.
The usual cause is adhesion. The default load, the normal force, vanishes where the surface begins
to pull, so the ball is let go there and does not pay back the work that the pull did before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import Blueprint, energy_function
from ..contact.model import ContactModel

Array = NDArray[np.float64]

#: Gain that counts, relative to the energy, in units of the tolerance.
_TOLERANCES = 1e3


def gains(
    blueprint: Blueprint, landing: Array, lift_off: Array, p: Array, tol: float
) -> NDArray[np.bool_]:
    """Whether balls gained energy beyond the tolerance.

    Parameters
    ----------
    blueprint : ContactModel or Contact3D
    landing, lift_off : ndarray (n, m)
        States at touch-down, with y = 0, and at lift-off, in columns.
    p : ndarray (k, m)
        Parameters.
    tol : float

    Returns
    -------
    ndarray of bool (m,)
    """
    function = energy_function(blueprint)
    before, after = (ns.call(function, x, p)[1][0] for x in (landing, lift_off))
    change: NDArray[np.bool_] = after - before > _TOLERANCES * tol * np.abs(before)
    return change


def advice(model: ContactModel, count: int, of: int) -> str:
    """Say what it may mean."""
    who = "The ball leaves" if of == 1 else f"{count} of {of} bounces leave"
    return (
        f"{type(model).__name__}: {who} faster than it came: the surface did work on it. "
        "If it pulls as well as pushes, the normal force vanishes before the contact ends: give "
        "the model a load and a lift_off of its own (obligations 6 and 7 of ContactModel)."
    )
