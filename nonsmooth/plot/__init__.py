"""Pictures (matplotlib): two-folds, trajectories, phase portraits. Imported only on use.

Every function returns a matplotlib Figure and leaves matplotlib's global settings alone.
"""

from .atlas import two_fold_atlas, two_fold_map
from .plane import phase_portrait
from .portrait import two_fold
from .runs import trajectory
from .sliding_portrait import sliding_portrait
from .space import two_fold_3d

__all__ = [
    "phase_portrait",
    "sliding_portrait",
    "trajectory",
    "two_fold",
    "two_fold_3d",
    "two_fold_atlas",
    "two_fold_map",
]
