"""Pictures (matplotlib): two-folds, trajectories, phase portraits, basins. Imported only on use.

Every function that draws returns a matplotlib Figure and leaves matplotlib's global settings alone.
What they share of colours, dashes and arrows is in ``style``, for pictures of one's own.
``two_fold_explorer`` is a page for the browser, and ``offline_page`` puts such pages together.
"""

from . import style
from .basin_map import (
    basins,
)
from .branches import bifurcation_curves, branch
from .dividing_picture import dividing_curves
from .manifold_picture import (
    manifold,
)
from .offline_page import offline_page
from .orbits import multipliers, periodic_orbit
from .phase_portrait import phase_portrait
from .proven_ranges import proof_map
from .sliding_portrait import sliding_portrait
from .trajectory import trajectory
from .two_fold_atlas import two_fold_atlas, two_fold_atlas_pages
from .two_fold_explorer import two_fold_explorer
from .two_fold_map import two_fold_map
from .two_fold_portrait import two_fold
from .two_fold_space import two_fold_3d

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
