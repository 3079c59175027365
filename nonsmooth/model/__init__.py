"""WHAT a nonsmooth system is: definition, Lie derivatives, jets. The only floor on CasADi."""

from . import complementarity
from .calls import call
from .checks import is_real, real, real_array, require_system, whole
from .clock import Clock
from .coupled import Coupled, coupled_of
from .definition import read_function
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
from .evaluators import Evaluator, Resets, Surfaces, evaluator
from .events import Impact, Reset, Stop
from .found_switches import LiftedSwitch
from .layer import Layer, LayerNumbers, Loop, layer_of, loop_at
from .motion import Motion, followed, motion, watched_functions
from .multipliers import sliding_multipliers
from .periods import is_function, periods, read_period
from .reading import Parameters
from .regularise import regularise
from .reversal import reversed_system
from .sections import SECTION, surface_of, with_section
from .start_maps import StartMap
from .switches import Guard
from .system import FilippovSystem
from .values import Array
from .vectors import multiplier_enters
from .yardsticks import Yardsticks

__all__ = [
    "SECTION",
    "Array",
    "Clock",
    "ConvergenceError",
    "Coupled",
    "DefinitionError",
    "DegenerateError",
    "Evaluator",
    "FilippovSystem",
    "Guard",
    "Impact",
    "Layer",
    "LayerNumbers",
    "LiftedSwitch",
    "Loop",
    "Motion",
    "NonsmoothError",
    "NotSmoothError",
    "OptionError",
    "ParameterError",
    "Parameters",
    "PointError",
    "Reset",
    "Resets",
    "StartMap",
    "Stop",
    "Surfaces",
    "Yardsticks",
    "call",
    "complementarity",
    "coupled_of",
    "evaluator",
    "explain",
    "followed",
    "is_function",
    "is_real",
    "layer_of",
    "loop_at",
    "motion",
    "multiplier_enters",
    "periods",
    "read_function",
    "read_period",
    "real",
    "real_array",
    "regularise",
    "require_system",
    "reversed_system",
    "sliding_multipliers",
    "surface_of",
    "watched_functions",
    "whole",
    "with_section",
]
