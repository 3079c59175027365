"""Nonsmooth dynamics on automatic Lie derivatives: the front door.

A Filippov system is x' = f(x, lambda; p) with lambda in Sgn(h(x)). The surface h = 0 separates
the field F1 (h > 0, lambda = +1) from F2 (h < 0, lambda = -1). With L_i = F_i . grad h the surface
splits into crossing (L1 L2 > 0), attracting sliding (L1 < 0 < L2) and repelling sliding
(L2 < 0 < L1). On sliding regions lambda takes the value between -1 and +1 that keeps the motion on
the surface; alpha = (1 - lambda)/2 is the weight of F2, so F_s = (1 - alpha) F1 + alpha F2.

Regions meet at folds, L1 = 0 or L2 = 0: visible where the tangent orbit stays on its own side
(L11 > 0, respectively L22 < 0), invisible where it does not; where L11 = 0 too, a cusp. Two folds
meet at a two-fold, h = L1 = L2 = 0, where the sliding field is 0/0 and solutions can lose
uniqueness forward in time. Its normal form has two signs sigma and two numbers nu; they decide
which orbits reach it.

Along a smooth flow the Taylor coefficients of h are its Lie derivatives over k!, so one object, the
jet, integrates, locates events, tells a fold from a cusp and gives the normal form.

Conventions: one letter per surface names a mode, ``+`` ``-`` or ``s`` (sliding), and an itinerary
is the sequence of modes. States are on the last axis, float64. Every run ends in a named status and
never guesses where the future is not unique. Every error derives from NonsmoothError.

Here are the verbs, the nouns and the errors. The algebra of two-folds, which needs no system, is in
``two_folds``; the types that questions about a point return are in ``local``, those that questions about
orbits return in ``orbit``; curves of any equations are followed by ``continuation``; pictures are in
``plot`` and named systems with their closed-form answers in ``textbook``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import local, orbit
from .flow import (
    Ensemble,
    Event,
    Grid,
    Outcomes,
    RandomStarts,
    Section,
    Segment,
    Status,
    Trajectory,
    Work,
    ensemble,
    first_crossing,
    first_root,
    follow,
    load,
    outcomes,
    simulate,
)
from .local import (
    Region,
    TwoFold,
    alpha,
    boundary_equilibrium,
    classify,
    find_all,
    find_boundary_equilibrium,
    find_equilibrium,
    find_fold,
    find_pseudo_equilibrium,
    find_two_fold,
    fold,
    fold_fold,
    intersection,
    intersection_range,
    limit_directions,
    region,
    sliding_branches,
    sliding_field,
    two_fold,
    two_folds,
)
from .model import (
    Clock,
    ConvergenceError,
    DefinitionError,
    DegenerateError,
    FilippovSystem,
    Impact,
    NonsmoothError,
    NotSmoothError,
    OptionError,
    ParameterError,
    PointError,
    Reset,
    Stop,
    call,
    regularise,
)
from .orbit import (
    BranchEnd,
    FixedItinerary,
    PeriodicOrbit,
    Sensitivity,
    TraceError,
    VirtualOrbitError,
    basins,
    continue_bifurcation,
    continue_equilibrium,
    continue_orbit,
    find_homoclinic,
    funnel,
    gradient,
    lyapunov_spectrum,
    manifold,
    periodic_orbit,
    poincare,
    saltation_matrix,
    sensitivity,
    trace_two_folds,
    vjp,
)
from .solvers import continuation

if TYPE_CHECKING:
    from . import plot, textbook
    from .proofs import (
        Census,
        Enclosure,
        MissingError,
        OrbitProof,
        Proof,
        UnprovenError,
        certify,
        certify_orbit,
        prove_all,
    )

#: Names that come from the floor of proofs, loaded when asked for.
_OF_PROOFS = (
    "Census",
    "Enclosure",
    "MissingError",
    "OrbitProof",
    "Proof",
    "UnprovenError",
    "certify",
    "certify_orbit",
    "prove_all",
)

__version__ = "0.1.0.dev0"

__all__ = [
    "BranchEnd",
    "Census",
    "Clock",
    "ConvergenceError",
    "DefinitionError",
    "DegenerateError",
    "Enclosure",
    "Ensemble",
    "Event",
    "FilippovSystem",
    "FixedItinerary",
    "Grid",
    "Impact",
    "MissingError",
    "NonsmoothError",
    "NotSmoothError",
    "OptionError",
    "OrbitProof",
    "Outcomes",
    "ParameterError",
    "PeriodicOrbit",
    "PointError",
    "Proof",
    "RandomStarts",
    "Region",
    "Reset",
    "Section",
    "Segment",
    "Sensitivity",
    "Status",
    "Stop",
    "TraceError",
    "Trajectory",
    "TwoFold",
    "UnprovenError",
    "VirtualOrbitError",
    "Work",
    "alpha",
    "basins",
    "boundary_equilibrium",
    "call",
    "certify",
    "certify_orbit",
    "classify",
    "continuation",
    "continue_bifurcation",
    "continue_equilibrium",
    "continue_orbit",
    "ensemble",
    "find_all",
    "find_boundary_equilibrium",
    "find_equilibrium",
    "find_fold",
    "find_homoclinic",
    "find_pseudo_equilibrium",
    "find_two_fold",
    "first_crossing",
    "first_root",
    "fold",
    "fold_fold",
    "follow",
    "funnel",
    "gradient",
    "intersection",
    "intersection_range",
    "limit_directions",
    "load",
    "local",
    "lyapunov_spectrum",
    "manifold",
    "orbit",
    "outcomes",
    "periodic_orbit",
    "plot",
    "poincare",
    "prove_all",
    "region",
    "regularise",
    "saltation_matrix",
    "sensitivity",
    "simulate",
    "sliding_branches",
    "sliding_field",
    "textbook",
    "trace_two_folds",
    "two_fold",
    "two_folds",
    "vjp",
]


def __getattr__(name: str) -> object:
    """Load pictures, textbook and proofs only when they are asked for (matplotlib is slow to import)."""
    import importlib

    if name in ("plot", "proofs", "textbook"):
        return importlib.import_module(f".{name}", __name__)
    if name in _OF_PROOFS:
        return getattr(importlib.import_module(".proofs", __name__), name)
    raise AttributeError(f"module 'nonsmooth' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
