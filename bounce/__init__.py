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
``Ball``, ``Landing`` and ``Scaling`` go to SI units and back.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .algebraic import (
    TURFS,
    CrossBounce,
    PennerBounce,
    PublishedFit,
    Rebound,
    TiltedBounce,
    penner_restitution,
    penner_tilt,
    rebound,
)
from .contact import ContactModel
from .dividing import (
    DividingCurve,
    DividingSurface,
    critical_eta,
    dividing_curve,
    dividing_surface,
)
from .errors import LandingError, LiftOffError, ModelError, UnknownNameError
from .fitting import FitError, FitResult, Start, fit
from .flight import AIRS, QUINTAVALLA, SMITS_SMITH, Air, Flight, flight
from .friction import Coulomb, Dahl, ExponentialDecay, FrictionLaw, LuGre, Stribeck, Viscous
from .generalised import Condition, Conditions, GeneralisedContact
from .measurements import DataError, Measurements, read_measurements
from .models import (
    DepthDampedKelvinVoigt,
    Hertz,
    HuntCrossley,
    KelvinVoigt,
    KuwabaraKono,
    Maxwell,
    Tsuji,
)
from .outcomes import BounceStatus, LiftOffs, OutcomeMap, lift_off, outcome_map
from .rigid import NormalKelvinVoigt, RigidBounce, RigidShot, kelvin_voigt_restitution
from .rollout import GREEN_ROLLING_FRICTION, Bounce, Glide, NoRestError, Run, play
from .sensitivity import Sensitivity, sensitivity
from .shot import Forces, Phase, Shot, State, simulate
from .tracing import Arc
from .units import BALLS, BASKETBALL, GOLF, TENNIS, Ball, Landing, Scaling

if TYPE_CHECKING:
    from . import plot as plot

__all__ = [
    "AIRS",
    "BALLS",
    "BASKETBALL",
    "GOLF",
    "GREEN_ROLLING_FRICTION",
    "QUINTAVALLA",
    "SMITS_SMITH",
    "TENNIS",
    "TURFS",
    "Air",
    "Arc",
    "Ball",
    "Bounce",
    "BounceStatus",
    "Condition",
    "Conditions",
    "ContactModel",
    "Coulomb",
    "CrossBounce",
    "Dahl",
    "DataError",
    "DepthDampedKelvinVoigt",
    "DividingCurve",
    "DividingSurface",
    "ExponentialDecay",
    "FitError",
    "FitResult",
    "Flight",
    "Forces",
    "FrictionLaw",
    "GeneralisedContact",
    "Glide",
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
    "Measurements",
    "ModelError",
    "NoRestError",
    "NormalKelvinVoigt",
    "OutcomeMap",
    "PennerBounce",
    "Phase",
    "PublishedFit",
    "Rebound",
    "RigidBounce",
    "RigidShot",
    "Run",
    "Scaling",
    "Sensitivity",
    "Shot",
    "Start",
    "State",
    "Stribeck",
    "TiltedBounce",
    "Tsuji",
    "UnknownNameError",
    "Viscous",
    "critical_eta",
    "dividing_curve",
    "dividing_surface",
    "fit",
    "flight",
    "kelvin_voigt_restitution",
    "lift_off",
    "outcome_map",
    "penner_restitution",
    "penner_tilt",
    "play",
    "plot",
    "read_measurements",
    "rebound",
    "sensitivity",
    "simulate",
]


def __getattr__(name: str) -> Any:
    """Load the pictures only when they are asked for (matplotlib is slow to import)."""
    if name == "plot":
        return importlib.import_module(".plot", __name__)
    raise AttributeError(f"module 'bounce' has no attribute {name!r}")
