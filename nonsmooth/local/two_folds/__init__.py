"""The algebra of generic two-folds from two signs and two numbers, without a system.

At a two-fold of a system these are ``fold.sigma`` and ``fold.nu`` of :func:`nonsmooth.find_two_fold`.

Examples
--------
>>> import nonsmooth as ns
>>> ns.two_folds.classify_two_fold((-1, 1), (-2.0, -1.0)).label
'II-C'
>>> [round(r, 6) for r in ns.two_folds.diabolo_slopes((-2.0, -1.0))]
[0.585786, 3.414214]
"""

from ...result_tables import add_views
from .classification import Boundary, Classification, Slopes, classify_two_fold
from .flights import (
    accumulation_time,
    diabolo_slopes,
    flight_above,
    flight_below,
    max_flights,
    return_matrix,
)
from .normal_form import NormalForm, normal_form
from .reduced_flow import ReducedFlow

__all__ = [
    "Boundary",
    "Classification",
    "NormalForm",
    "ReducedFlow",
    "Slopes",
    "accumulation_time",
    "classify_two_fold",
    "diabolo_slopes",
    "flight_above",
    "flight_below",
    "max_flights",
    "normal_form",
    "return_matrix",
]

add_views(globals(), __all__)
