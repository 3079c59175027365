"""Nonsmooth systems: definition, Lie derivatives, Taylor series; the only layer that uses CasADi."""

from .calls import call
from .checks import is_real, real, real_array, whole
from .definition import instruction_form
from .definition.derived_systems import (
    SECTION,
    reversed_system,
    surface_of,
    with_section,
    with_stops,
)
from .definition.events import Clock, Impact, Reset, Stop
from .definition.events.held_events import HeldEvent, discrete_values, held_events, held_relay
from .definition.lift import LiftedSwitch
from .definition.parse_definition import read_function
from .definition.regularise import regularise
from .definition.switching import Switching
from .definition.system import (
    FilippovSystem,
    multiplier_enters,
    require_continuous,
    require_plain,
    require_system,
)
from .derivatives.forcing import clock_periods, is_function, periods, read_period
from .derivatives.given_functions import StartMap
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
from .laws.coupled import Coupled, coupled_of, driven_of, raised_of
from .laws.evaluators import Evaluator, Surfaces, evaluator
from .laws.followed import Followed, followed
from .laws.layer import Layer, LayerNumbers, layer_of
from .laws.motion import Motion, mode_field, motion, watched_functions
from .laws.multipliers import sliding_multipliers
from .laws.one_surface import OneSurface, condition_as_surface, has_elements, one_surface
from .laws.switches import Guard
from .reading import Parameters
from .values import Array
