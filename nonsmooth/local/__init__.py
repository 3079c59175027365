"""Analysis at points of surfaces, without time stepping: regions, folds, two-folds, equilibria."""

from ..model import mode_field
from ..result_tables import add_views
from . import two_folds
from .classify import LocalObject, classify
from .point.higher_codimension import LimitDirection, limit_directions
from .point.intersections import Continuation, Intersection, intersection, intersection_range
from .point.regions import Region, alpha, region, sliding_field
from .point.sliding_branches import SlidingBranch, sliding_branches
from .searches.boundary_cycles import BoundaryCycle
from .searches.boundary_equilibria import (
    BoundaryBifurcation,
    BoundaryEquilibrium,
    boundary_equilibrium,
    find_boundary_equilibrium,
)
from .searches.equilibria import Equilibrium, find_equilibrium
from .searches.find_two_fold import TwoFold, find_two_fold, two_fold
from .searches.fold_folds import FoldFold, fold_fold
from .searches.folds import Fold, find_fold, fold
from .searches.pseudo_equilibria import PseudoEquilibrium, find_pseudo_equilibrium
from .searches.search import find_all

__all__ = [
    "BoundaryBifurcation",
    "BoundaryCycle",
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
    "mode_field",
    "region",
    "sliding_branches",
    "sliding_field",
    "two_fold",
    "two_folds",
]

add_views(globals(), __all__)
