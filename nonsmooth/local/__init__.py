"""WHAT HAPPENS at a point of a surface, without time stepping: regions, folds, two-folds."""

from . import two_folds
from .boundary_equilibria import (
    BoundaryBifurcation,
    BoundaryEquilibrium,
    boundary_equilibrium,
    find_boundary_equilibrium,
)
from .branches import SlidingBranch, sliding_branches
from .classify import classify
from .equilibria import Equilibrium, find_equilibrium
from .find_two_fold import find_two_fold, two_fold
from .fold_folds import FoldFold, fold_fold
from .folds import Fold, find_fold, fold
from .intersection import intersection_range
from .intersections import Continuation, Intersection, intersection
from .local_object import LocalObject
from .pseudo_equilibria import find_pseudo_equilibrium
from .pseudo_equilibrium import PseudoEquilibrium
from .regions import Region, alpha, region, sliding_field
from .search import find_all
from .two_fold import TwoFold
from .vector_sets import LimitDirection, limit_directions

__all__ = [
    "BoundaryBifurcation",
    "BoundaryEquilibrium",
    "Continuation",
    "Equilibrium",
    "Fold",
    "FoldFold",
    "Intersection",
    "LimitDirection",
    "LocalObject",
    "PseudoEquilibrium",
    "Region",
    "SlidingBranch",
    "TwoFold",
    "alpha",
    "boundary_equilibrium",
    "classify",
    "find_all",
    "find_boundary_equilibrium",
    "find_equilibrium",
    "find_fold",
    "find_pseudo_equilibrium",
    "find_two_fold",
    "fold",
    "fold_fold",
    "intersection",
    "intersection_range",
    "limit_directions",
    "region",
    "sliding_branches",
    "sliding_field",
    "two_fold",
    "two_folds",
]
