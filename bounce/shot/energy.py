"""Check whether a ball leaves with more energy than it came with: a mistake in most models.

Friction hides a gain, so the motion along y is checked alone where it depends on itself only.
The usual cause is adhesion: the default load, the normal force, vanishes where the surface begins
to pull, so the contact ends before the pull has taken back the work that it did.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import Blueprint, energy_function
from ..contact.model import Contact3D, ContactModel

Array = NDArray[np.float64]

#: Gain that counts, relative to the energy, in units of the tolerance.
_TOLERANCES = 1e3


def gains(
    blueprint: Blueprint, landing: Array, lift_off: Array, p: Array, tol: float
) -> NDArray[np.bool_]:
    """Whether balls, in columns, gained energy beyond the tolerance from y = 0 to lift-off."""
    function = energy_function(blueprint)
    before, after = (ns.call(function, x, p)[1][0] for x in (landing, lift_off))
    change: NDArray[np.bool_] = after - before > _TOLERANCES * tol * np.abs(before)
    return change


def advice(model: ContactModel | Contact3D, count: int, of: int) -> str:
    """The text of an ``EnergyWarning``."""
    surface = model.model if isinstance(model, Contact3D) else model
    who = "The ball leaves" if of == 1 else f"{count} of {of} bounces leave"
    return (
        f"{type(surface).__name__}: {who} faster than it came: the surface did work on it. "
        "If it pulls as well as pushes, the normal force vanishes before the contact ends: give "
        "the model a load and a lift_off of its own (obligations 6 and 7 of ContactModel)."
    )
