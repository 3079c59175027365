"""What needs both a place and a motion: canards, the set of futures, curves of two-folds."""

from . import continuation
from .canards import Path, Slider, paths_from
from .futures import Departure, Funnel, funnel
from .two_fold_curves import TraceError, trace_two_folds

__all__ = [
    "Departure",
    "Funnel",
    "Path",
    "Slider",
    "TraceError",
    "continuation",
    "funnel",
    "paths_from",
    "trace_two_folds",
]
