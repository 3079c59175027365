"""WHAT a nonsmooth system is: definition, Lie derivatives, jets. The only floor on CasADi."""

from .checks import real, real_array, require_system, whole
from .errors import (
    ConvergenceError,
    DefinitionError,
    DegenerateError,
    NonsmoothError,
    NotSmoothError,
    OptionError,
    ParameterError,
    PointError,
    explain,
)
from .motion import (
    Evaluator,
    Followed,
    Guard,
    Intersection,
    Motion,
    Resets,
    Surfaces,
    evaluator,
    followed,
    motion,
)
from .regularise import regularise
from .system import Array, FilippovSystem, Parameters, Reset, Stop, read_function

__all__ = [
    "Array",
    "ConvergenceError",
    "DefinitionError",
    "DegenerateError",
    "Evaluator",
    "FilippovSystem",
    "Followed",
    "Guard",
    "Intersection",
    "Motion",
    "NonsmoothError",
    "NotSmoothError",
    "OptionError",
    "ParameterError",
    "Parameters",
    "PointError",
    "Reset",
    "Resets",
    "Stop",
    "Surfaces",
    "evaluator",
    "explain",
    "followed",
    "motion",
    "read_function",
    "real",
    "real_array",
    "regularise",
    "require_system",
    "whole",
]
