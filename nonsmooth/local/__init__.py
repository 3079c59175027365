"""WHAT HAPPENS at a point of a surface, without time stepping: regions, folds, two-folds."""

from .branches import SlidingBranch, sliding_branches
from .classification import Boundary, Classification, Slopes, classify_two_fold
from .crossing import (
    accumulation_time,
    diabolo_slopes,
    flight_above,
    flight_below,
    max_flights,
    return_matrix,
)
from .equilibria import (
    Equilibrium,
    PseudoEquilibrium,
    find_all,
    find_boundary_equilibrium,
    find_equilibrium,
    find_pseudo_equilibrium,
)
from .folds import Fold, find_fold, fold
from .intersection import intersection_range
from .normal_form import NormalForm, ReducedFlow, normal_form
from .objects import LocalObject, classify
from .planar import BoundaryEquilibrium, FoldFold, boundary_equilibrium, fold_fold
from .regions import Region, alpha, region, sliding_field
from .tracing import TraceError, trace_two_folds
from .two_fold import TwoFold, find_two_fold, two_fold

__all__ = [
    "Boundary",
    "BoundaryEquilibrium",
    "Classification",
    "Equilibrium",
    "Fold",
    "FoldFold",
    "LocalObject",
    "NormalForm",
    "PseudoEquilibrium",
    "ReducedFlow",
    "Region",
    "SlidingBranch",
    "Slopes",
    "TraceError",
    "TwoFold",
    "accumulation_time",
    "alpha",
    "boundary_equilibrium",
    "classify",
    "classify_two_fold",
    "diabolo_slopes",
    "find_all",
    "find_boundary_equilibrium",
    "find_equilibrium",
    "find_fold",
    "find_pseudo_equilibrium",
    "find_two_fold",
    "flight_above",
    "flight_below",
    "fold",
    "fold_fold",
    "intersection_range",
    "max_flights",
    "normal_form",
    "region",
    "return_matrix",
    "sliding_branches",
    "sliding_field",
    "trace_two_folds",
    "two_fold",
]
