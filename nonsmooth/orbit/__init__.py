"""Derivatives of runs, periodic and homoclinic orbits, their branches, manifolds and basins."""

from ..result_tables import add_views
from ..solvers import continuation
from .basins import Attractor, Basins, attractors, basins
from .branches.bifurcation_curves import BifurcationCurve, CodimensionTwo, continue_bifurcation
from .branches.branch import Branch, BranchEnd, BranchEvent, FarSide
from .branches.continue_orbit import continue_orbit
from .branches.equilibrium_branches import continue_equilibrium
from .branches.two_fold_curves import TraceError, trace_two_folds
from .homoclinic.homoclinic_orbits import Connection, find_homoclinic
from .manifolds.canards import Path, Slider, paths_from
from .manifolds.dividing_surfaces import (
    ComputedStarts,
    DividingArc,
    DividingCurves,
    DividingTracer,
    EventPassages,
    Passage,
    StartCurve,
    joint_root,
)
from .manifolds.forward_reachable_set import Departure, Funnel, funnel
from .manifolds.invariant_manifolds import Manifold, manifold
from .periodic.find_periodic import VirtualOrbitError, periodic_orbit
from .periodic.master_stability import MasterStability, master_stability
from .periodic.orbit import PeriodicOrbit
from .periodic.orbit_functions import OrbitFunction, OrbitFunctions, orbit_functions
from .periodic.phase_response import PhaseResponse, phase_response
from .runs.itinerary import Arrival, FixedItinerary
from .runs.lyapunov import LyapunovSpectrum, lyapunov_spectrum
from .runs.poincare import PoincareOrbit, poincare
from .runs.saltation_matrix import saltation_matrix
from .runs.sensitivity import Gradient, gradient, sensitivity, vjp
from .runs.variation import Sensitivity

__all__ = [
    "Arrival",
    "Attractor",
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
    "MasterStability",
    "OrbitFunction",
    "OrbitFunctions",
    "Passage",
    "Path",
    "PeriodicOrbit",
    "PhaseResponse",
    "PoincareOrbit",
    "Sensitivity",
    "Slider",
    "StartCurve",
    "TraceError",
    "VirtualOrbitError",
    "attractors",
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
    "master_stability",
    "orbit_functions",
    "paths_from",
    "periodic_orbit",
    "phase_response",
    "poincare",
    "saltation_matrix",
    "sensitivity",
    "trace_two_folds",
    "vjp",
]

add_views(globals(), __all__)
