"""What needs a place and a motion: derivatives of runs, periodic orbits, branches, basins, futures."""

from . import continuation
from .basins import (
    Basins,
    basins,
)
from .bifurcation_curves import BifurcationCurve, CodimensionTwo, continue_bifurcation
from .branch import Branch, BranchEnd, BranchEvent, FarSide
from .canards import Path, Slider, paths_from
from .connections import Connection, find_homoclinic
from .dividing import DividingCurves
from .dividing_arcs import DividingArc, DividingTracer, Passage, StartCurve, joint_root
from .dividing_passages import ComputedStarts, EventPassages
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
from .manifold import manifold
from .manifold_growth import Manifold
from .periodic import PeriodicOrbit
from .poincare import (
    PoincareOrbit,
    poincare,
)
from .saltation_matrix import saltation_matrix
from .sensitivity import Gradient, gradient, sensitivity, vjp
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
    "ComputedStarts",
    "Connection",
    "Departure",
    "DividingArc",
    "DividingCurves",
    "DividingTracer",
    "EventPassages",
    "FarSide",
    "FixedItinerary",
    "Funnel",
    "Gradient",
    "LyapunovSpectrum",
    "Manifold",
    "Passage",
    "Path",
    "PeriodicOrbit",
    "PoincareOrbit",
    "Sensitivity",
    "Slider",
    "StartCurve",
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
    "joint_root",
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
