"""Contact models and friction laws besides those at the top of ``bounce``."""

from .friction import Coulomb, Dahl, ExponentialDecay, FrictionLaw, LuGre, Stribeck, Viscous
from .generalised import Condition, Conditions
from .model import Contact3D
from .models import DepthDampedKelvinVoigt, HuntCrossley, KuwabaraKono, Maxwell, Tsuji

__all__ = [
    "Condition",
    "Conditions",
    "Contact3D",
    "Coulomb",
    "Dahl",
    "DepthDampedKelvinVoigt",
    "ExponentialDecay",
    "FrictionLaw",
    "HuntCrossley",
    "KuwabaraKono",
    "LuGre",
    "Maxwell",
    "Stribeck",
    "Tsuji",
    "Viscous",
]
