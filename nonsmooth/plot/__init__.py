"""Pictures (matplotlib): two-folds, trajectories, phase portraits, branches, basins.

Every function that draws takes ``ax=`` (``figure=``, if it makes several axes) and returns it; without it,
a new matplotlib Figure that pyplot knows. It follows your ``rcParams`` and takes ``colors=`` and properties
of lines. Colours, dashes and arrows are in ``style``, and ``canvas`` makes your own pictures in this way.
``two_fold_explorer`` is a page for the browser on the classes of two-folds; ``offline_page`` puts such pages
together, as ``nonsmooth.explore`` does for a system.
"""

from . import style
from .basin_map import basins
from .branches import bifurcation_curves, branch
from .drawing import Canvas, canvas
from .explorer import ExplorerPage
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
    "Canvas",
    "ExplorerPage",
    "basins",
    "bifurcation_curves",
    "branch",
    "canvas",
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
