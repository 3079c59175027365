"""Nonsmooth dynamics on automatic Lie derivatives: the public API.

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
never guesses where the continuation is not unique. Every error derives from NonsmoothError.

The top level has the functions, the classes and the errors that most programs use. Analysis at one point
and its results are in ``local``, events and parts of runs in ``flow``, orbits, derivatives and their results
in ``orbit``, proofs and enclosures in ``proofs``. The algebra of two-folds, which needs no system, is in
``two_folds``; ``continuation`` follows curves of any equations; ``plot`` draws, ``interop`` connects to JAX,
PyTorch and SymPy, and ``textbook`` has named systems with closed-form answers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import flow, local, orbit
from .flow import (
    Ensemble,
    Grid,
    RandomStarts,
    Section,
    Status,
    Trajectory,
    Work,
    ensemble,
    load,
    outcomes,
    simulate,
)
from .local import (
    Region,
    alpha,
    classify,
    find_all,
    find_boundary_equilibrium,
    find_equilibrium,
    find_fold,
    find_pseudo_equilibrium,
    find_two_fold,
    region,
    sliding_field,
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
from .model.definition.constraints import Constraint
from .model.definition.elements import Complementarity, Relay
from .model.definition.friction import Friction
from .model.definition.tables.table import table
from .orbit import (
    attractors,
    basins,
    continue_bifurcation,
    continue_equilibrium,
    continue_orbit,
    find_homoclinic,
    gradient,
    lyapunov_spectrum,
    manifold,
    master_stability,
    orbit_functions,
    periodic_orbit,
    phase_response,
    sensitivity,
    vjp,
)
from .solvers import continuation

if TYPE_CHECKING:
    from . import interop, plot, proofs, textbook
    from .plot.explorer import explore
    from .proofs import (
        certify,
        certify_orbit,
        prove_all,
    )

#: Functions of ``proofs``, which is imported on first use.
_OF_PROOFS = (
    "certify",
    "certify_orbit",
    "prove_all",
)

__version__ = "0.1.0rc1"

__all__ = [
    "Clock",
    "Complementarity",
    "Constraint",
    "ConvergenceError",
    "DefinitionError",
    "DegenerateError",
    "Ensemble",
    "FilippovSystem",
    "Friction",
    "Grid",
    "Impact",
    "NonsmoothError",
    "NotSmoothError",
    "OptionError",
    "ParameterError",
    "PointError",
    "RandomStarts",
    "Region",
    "Relay",
    "Reset",
    "Section",
    "Status",
    "Stop",
    "Trajectory",
    "Work",
    "alpha",
    "attractors",
    "basins",
    "call",
    "certify",
    "certify_orbit",
    "classify",
    "continuation",
    "continue_bifurcation",
    "continue_equilibrium",
    "continue_orbit",
    "ensemble",
    "explore",
    "find_all",
    "find_boundary_equilibrium",
    "find_equilibrium",
    "find_fold",
    "find_homoclinic",
    "find_pseudo_equilibrium",
    "find_two_fold",
    "flow",
    "gradient",
    "interop",
    "load",
    "local",
    "lyapunov_spectrum",
    "manifold",
    "master_stability",
    "orbit",
    "orbit_functions",
    "outcomes",
    "periodic_orbit",
    "phase_response",
    "plot",
    "proofs",
    "prove_all",
    "region",
    "regularise",
    "sensitivity",
    "simulate",
    "sliding_field",
    "table",
    "textbook",
    "two_folds",
    "vjp",
]


def __getattr__(name: str) -> object:
    """Import pictures, bridges, textbook and proofs on first use (matplotlib is slow to import)."""
    import importlib

    if name in ("interop", "plot", "proofs", "textbook"):
        return importlib.import_module(f".{name}", __name__)
    if name == "explore":
        return importlib.import_module(".plot.explorer", __name__).explore
    if name in _OF_PROOFS:
        return getattr(importlib.import_module(".proofs", __name__), name)
    for home in ("flow", "local", "orbit"):
        if name in globals()[home].__all__:
            raise AttributeError(
                f"module 'nonsmooth' has {name} in nonsmooth.{home}: use ns.{home}.{name}"
            )
    raise AttributeError(f"module 'nonsmooth' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
