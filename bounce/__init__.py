"""The bounce of a spinning ball on compliant ground with dry friction: the front door.

A ball of unit radius and mass, centre (x, y), spin omega (positive is backspin for xdot > 0), lands
at y = 0 with ydot < 0. The ground pushes with a normal force and a tangential one, and rubs:

    x'' = tangential_force + Lambda_T,  y'' = normal_force - G,  omega' = Lambda_T / inertia,
    Lambda_T = -lambda mu Lambda_N,  lambda in Sgn(H),  H = xdot + omega.

H is the velocity of the contact point: the ball slips forward (``+``), slips in reverse (``-``) or
rolls (``s``, sliding in Filippov's words); where the load Lambda_N first falls to zero it lifts
off. A ball that lifts off rolling passes through a two-fold, so almost none does. A rigid ground
cannot reverse the slip; any tangential compliance can (Biber, Champneys & Szalai 2022).

``simulate(model, xdot, ydot, omega)`` follows one bounce. A model is a ``ContactModel``: two forces
written once, either one of those here or your own. Numbers are dimensionless as the model is;
``Ball``, ``Landing`` and ``Scaling`` go to SI units and back. ``bounce.laws`` has the laws in closed
form, ``bounce.golf`` what happens before, between and after bounces, ``bounce.plot`` the pictures.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from . import golf, laws
from .contact.friction import Coulomb, Dahl, ExponentialDecay, FrictionLaw, LuGre, Stribeck, Viscous
from .contact.generalised import GeneralisedContact
from .contact.model import Contact3D, ContactModel
from .contact.models import (
    DepthDampedKelvinVoigt,
    Hertz,
    HuntCrossley,
    KelvinVoigt,
    KuwabaraKono,
    Maxwell,
    NormalKelvinVoigt,
    Tsuji,
)
from .errors import EnergyWarning, LandingError, LiftOffError, ModelError, UnknownNameError
from .maps.dividing import (
    DividingCurve,
    DividingSurface,
    critical_eta,
    dividing_curve,
    dividing_surface,
)
from .maps.lift_offs import lift_off
from .maps.outcomes import OutcomeMap, outcome_map
from .maps.proven import ProvenMap, proven_map
from .maps.results import BounceStatus, LiftOffs
from .maps.slip_directions import (
    SlipMap,
    SlipTurn,
    Vortex,
    find_vortices,
    slip_map,
    slip_turn,
    winding_number,
)
from .shot.certify import BounceProof, certify
from .shot.sensitivity import Sensitivity, sensitivity
from .shot.shot import Shot
from .shot.simulate import simulate
from .shot.state import State
from .units import BALLS, Ball, Landing, Scaling

if TYPE_CHECKING:
    from . import plot as plot

__all__ = [
    "BALLS",
    "Ball",
    "BounceProof",
    "BounceStatus",
    "Contact3D",
    "ContactModel",
    "Coulomb",
    "Dahl",
    "DepthDampedKelvinVoigt",
    "DividingCurve",
    "DividingSurface",
    "EnergyWarning",
    "ExponentialDecay",
    "FrictionLaw",
    "GeneralisedContact",
    "Hertz",
    "HuntCrossley",
    "KelvinVoigt",
    "KuwabaraKono",
    "Landing",
    "LandingError",
    "LiftOffError",
    "LiftOffs",
    "LuGre",
    "Maxwell",
    "ModelError",
    "NormalKelvinVoigt",
    "OutcomeMap",
    "ProvenMap",
    "Scaling",
    "Sensitivity",
    "Shot",
    "SlipMap",
    "SlipTurn",
    "State",
    "Stribeck",
    "Tsuji",
    "UnknownNameError",
    "Viscous",
    "Vortex",
    "certify",
    "critical_eta",
    "dividing_curve",
    "dividing_surface",
    "find_vortices",
    "golf",
    "laws",
    "lift_off",
    "outcome_map",
    "plot",
    "proven_map",
    "sensitivity",
    "simulate",
    "slip_map",
    "slip_turn",
    "winding_number",
]


def __getattr__(name: str) -> Any:
    """Load the pictures only when they are asked for (matplotlib is slow to import)."""
    if name == "plot":
        return importlib.import_module(".plot", __name__)
    raise AttributeError(f"module 'bounce' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return what the front door offers, without what it needs itself."""
    return sorted([*__all__, *(name for name in globals() if name.startswith("__"))])
