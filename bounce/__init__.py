"""The bounce of a spinning ball on compliant ground with dry friction.

A ball of unit radius and mass, centre (x, y), spin omega (positive is backspin for xdot > 0), lands
at y = 0 with ydot < 0. The ground acts with a normal and a tangential force, and with dry friction:

    x'' = tangential_force + Lambda_T,  y'' = normal_force - G,  omega' = Lambda_T / inertia,
    Lambda_T = -lambda mu Lambda_N,  lambda in Sgn(H),  H = xdot + omega.

H is the velocity of the contact point: the ball slips forward (``+``), slips in reverse (``-``) or
rolls (``s``, sliding in Filippov's sense). It lifts off where the load Lambda_N first falls to zero.
A ball that lifts off rolling passes through a two-fold, so almost none does. A rigid ground cannot
reverse the slip; any tangential compliance can (Biber, Champneys & Szalai 2022). With side spin
xdot, omega and H are vectors, forward and to the right.

``simulate(model, xdot, ydot, omega)`` follows one bounce, ``lift_off`` many. A model is a
``ContactModel``: two forces written once, one of ``bounce.contact`` or your own. Numbers are
dimensionless as the model is; ``Ball``, ``Landing`` and ``Scaling`` convert from and to SI units.

- ``bounce.contact``: contact models and friction laws.
- ``bounce.shot``: what one bounce returns.
- ``bounce.maps``: results of many bounces, the dividing surface, vortices, proven maps.
- ``bounce.laws``: laws in closed form.
- ``bounce.golf``: flight, bounces and roll of a golf ball, and fits to measurements.
- ``bounce.plot``: pictures.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import nonsmooth as ns

from . import contact, golf, laws, maps, shot
from .contact.generalised import GeneralisedContact
from .contact.model import ContactModel
from .contact.models import Hertz, KelvinVoigt, NormalKelvinVoigt
from .errors import EnergyWarning, LandingError, LiftOffError, ModelError, UnknownNameError
from .maps.dividing import dividing_curve
from .maps.lift_offs import lift_off
from .maps.outcomes import outcome_map
from .maps.results import BounceStatus
from .maps.slip_directions import slip_map
from .shot.certify import certify
from .shot.sensitivity import sensitivity
from .shot.shot import Shot
from .shot.simulate import simulate
from .units import BALLS, Ball, Landing, Scaling

if TYPE_CHECKING:
    from . import plot as plot
    from .plot.explorer import explore as explore

__all__ = [
    "BALLS",
    "Ball",
    "BounceStatus",
    "ContactModel",
    "EnergyWarning",
    "GeneralisedContact",
    "Hertz",
    "KelvinVoigt",
    "Landing",
    "LandingError",
    "LiftOffError",
    "ModelError",
    "NormalKelvinVoigt",
    "Scaling",
    "Shot",
    "UnknownNameError",
    "certify",
    "contact",
    "dividing_curve",
    "explore",
    "golf",
    "laws",
    "lift_off",
    "maps",
    "outcome_map",
    "plot",
    "sensitivity",
    "shot",
    "simulate",
    "slip_map",
]


ns.result_tables.add_views(globals(), __all__)


def __getattr__(name: str) -> Any:
    """Load the pictures on first use (matplotlib is slow to import)."""
    if name == "__version__":
        return ns.__version__
    if name == "plot":
        return importlib.import_module(".plot", __name__)
    if name == "explore":
        return importlib.import_module(".plot.explorer", __name__).explore
    raise AttributeError(f"module 'bounce' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted([*__all__, *(name for name in globals() if name.startswith("__"))])
