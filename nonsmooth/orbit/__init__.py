"""What needs both a place and a motion: canards, the set of futures, curves of two-folds."""

from . import continuation
from .basins import (
    Basins,
    basins,
)
from .bifurcation_curves import BifurcationCurve, CodimensionTwo, continue_bifurcation
from .branch import Branch, BranchEnd, BranchEvent, FarSide
from .canards import Path, Slider, paths_from
from .connections import Connection, find_homoclinic
from .find_periodic import VirtualOrbitError, periodic_orbit
from .follow_equilibria import continue_equilibrium
from .follow_orbits import continue_orbit
from .funnels import Departure, Funnel
from .futures import funnel
from .itinerary import Arrival, FixedItinerary
from .lyapunov import (
    LyapunovSpectrum,
    lyapunov_spectrum,
)
from .manifold import (
    Manifold,
    manifold,
)
from .periodic import PeriodicOrbit
from .poincare import (
    PoincareOrbit,
    poincare,
)
from .sensitivity import Gradient, gradient, saltation_matrix, sensitivity, vjp
from .two_fold_curves import TraceError, trace_two_folds
from .variation import Sensitivity

__all__ = [
    "Arrival",
    "Basins",
    "BifurcationCurve",
    "Branch",
    "BranchEnd",
    "BranchEvent",
    "CodimensionTwo",
    "Connection",
    "Departure",
    "FarSide",
    "FixedItinerary",
    "Funnel",
    "Gradient",
    "LyapunovSpectrum",
    "Manifold",
    "Path",
    "PeriodicOrbit",
    "PoincareOrbit",
    "Sensitivity",
    "Slider",
    "TraceError",
    "VirtualOrbitError",
    "basins",
    "continuation",
    "continue_bifurcation",
    "continue_equilibrium",
    "continue_orbit",
    "find_homoclinic",
    "funnel",
    "gradient",
    "lyapunov_spectrum",
    "manifold",
    "paths_from",
    "periodic_orbit",
    "poincare",
    "saltation_matrix",
    "sensitivity",
    "trace_two_folds",
    "vjp",
]
