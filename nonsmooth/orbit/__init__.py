"""What needs both a place and a motion: canards, the set of futures, curves of two-folds."""

from . import continuation
from .branch import Branch, BranchEnd, BranchEvent, FarSide
from .canards import Path, Slider, paths_from
from .equilibrium_branches import continue_equilibrium
from .futures import Departure, Funnel, funnel
from .two_fold_curves import TraceError, trace_two_folds

__all__ = [
    "Branch",
    "BranchEnd",
    "BranchEvent",
    "Departure",
    "FarSide",
    "Funnel",
    "Path",
    "Slider",
    "TraceError",
    "continuation",
    "continue_equilibrium",
    "funnel",
    "paths_from",
    "trace_two_folds",
]
