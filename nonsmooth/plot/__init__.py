"""Pictures (matplotlib): two-folds, trajectories, phase portraits, branches, basins.

Every function that draws returns a matplotlib Figure and leaves matplotlib's global settings alone.
Colours, dashes and arrows are in ``style``, also for your own pictures.
``two_fold_explorer`` is a page for the browser, and ``offline_page`` puts such pages together.
"""

from . import style
from .basin_map import basins
from .branches import bifurcation_curves, branch
from .offline_page import offline_page
from .orbits import multipliers, periodic_orbit
from .portraits.dividing_curves import dividing_curves
from .portraits.manifolds import manifold
from .portraits.phase_portrait import phase_portrait
from .portraits.sliding_portrait import sliding_portrait
from .portraits.trajectory import trajectory
from .proof_map import proof_map
from .two_folds.atlas import two_fold_atlas, two_fold_atlas_pages
from .two_folds.class_map import two_fold_map
from .two_folds.explorer import two_fold_explorer
from .two_folds.flow_in_space import two_fold_3d
from .two_folds.sliding_flow import two_fold

__all__ = [
    "basins",
    "bifurcation_curves",
    "branch",
    "dividing_curves",
    "manifold",
    "multipliers",
    "offline_page",
    "periodic_orbit",
    "phase_portrait",
    "proof_map",
    "sliding_portrait",
    "style",
    "trajectory",
    "two_fold",
    "two_fold_3d",
    "two_fold_atlas",
    "two_fold_atlas_pages",
    "two_fold_explorer",
    "two_fold_map",
]
