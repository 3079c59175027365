"""Pictures (matplotlib): two-folds, trajectories, phase portraits. Imported only on use.

Every function returns a matplotlib Figure and leaves matplotlib's global settings alone.
"""

from .portrait import two_fold
from .runs import trajectory
from .space import two_fold_3d

__all__ = ["trajectory", "two_fold", "two_fold_3d"]
