"""Textbook problems: named nonsmooth systems with reference values.

Each function returns a :class:`Problem`: system, parameters, start, end time, and its reference
values as :class:`Reference`.

Examples
--------
>>> import nonsmooth.textbook as textbook
>>> problem = textbook.bouncing_ball()
>>> problem["first impact"].agrees(problem.run().events[0].t)
True
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from types import MappingProxyType

from ..model import OptionError
from ..result_tables import add_views
from .control import abs_brake, drill_string, super_twisting, tank_cascade, twisting
from .converters import boost_converter, diode_bridge, resonant_converter
from .friction import dry_friction, leine_stick_slip, stick_slip_exponential
from .hybrid import (
    gearbox,
    glacial_cycles,
    integrate_and_fire,
    integrate_and_fire_network,
    integrate_and_fire_pair,
    rocking_block,
    thermostat,
)
from .impacts import bouncing_ball, impact_oscillator, kelvin_voigt_bounce
from .mechanisms import painleve_rod, slider_crank, woodpecker
from .models import harvested_prey_predator, state_dependent_jump, welander_box
from .periodic import (
    belt_oscillator,
    buck_converter,
    forced_dry_friction,
    multi_sliding_relay,
    simplest_walker,
)
from .planar import (
    piecewise_cycle,
    planar_relay,
    pseudo_hopf,
    scalar_repelling,
    scalar_sliding,
    spiral_oscillator,
)
from .plane_friction import (
    block_on_belt,
    block_on_disc,
    block_on_incline,
    cue_ball,
    pivoting_disc,
    shaken_block,
    turntable,
)
from .problem import Problem, Reference
from .several_surfaces import ambiguous_exit, glass_loop, hidden_dynamics, two_relay_spiral
from .springs import backlash, bilinear_oscillator, chua_circuit, mckean_neuron, soft_stop
from .thresholds import sir_threshold, stommel_box, threshold_harvesting
from .two_folds import TWO_FOLDS, two_fold

__all__ = [
    "PROBLEMS",
    "TWO_FOLDS",
    "Problem",
    "Reference",
    "abs_brake",
    "ambiguous_exit",
    "backlash",
    "belt_oscillator",
    "bilinear_oscillator",
    "block_on_belt",
    "block_on_disc",
    "block_on_incline",
    "boost_converter",
    "bouncing_ball",
    "buck_converter",
    "by_name",
    "chua_circuit",
    "cue_ball",
    "diode_bridge",
    "drill_string",
    "dry_friction",
    "forced_dry_friction",
    "gearbox",
    "glacial_cycles",
    "glass_loop",
    "harvested_prey_predator",
    "hidden_dynamics",
    "impact_oscillator",
    "integrate_and_fire",
    "integrate_and_fire_network",
    "integrate_and_fire_pair",
    "kelvin_voigt_bounce",
    "leine_stick_slip",
    "mckean_neuron",
    "multi_sliding_relay",
    "painleve_rod",
    "piecewise_cycle",
    "pivoting_disc",
    "planar_relay",
    "pseudo_hopf",
    "resonant_converter",
    "rocking_block",
    "scalar_repelling",
    "scalar_sliding",
    "shaken_block",
    "simplest_walker",
    "sir_threshold",
    "slider_crank",
    "soft_stop",
    "spiral_oscillator",
    "state_dependent_jump",
    "stick_slip_exponential",
    "stommel_box",
    "super_twisting",
    "tank_cascade",
    "thermostat",
    "threshold_harvesting",
    "turntable",
    "twisting",
    "two_fold",
    "two_relay_spiral",
    "welander_box",
    "woodpecker",
]

add_views(globals(), __all__)

#: Every problem by name.
PROBLEMS: Mapping[str, Callable[[], Problem]] = MappingProxyType(
    {name: globals()[name] for name in __all__ if name.islower() and name != "by_name"}
)


def by_name(name: str) -> Problem:
    """Build the problem of a name.

    Parameters
    ----------
    name : str
        One of ``PROBLEMS``.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Raises
    ------
    OptionError
        No problem of that name.

    Examples
    --------
    >>> by_name("dry_friction").start
    (3.0, 0.0)
    """
    if name not in PROBLEMS:
        near = difflib.get_close_matches(str(name), PROBLEMS, 3, 0.5)
        alike = f" Near it are {', '.join(near)}." if near else ""
        raise OptionError(
            f"name: no problem is called {name!r}.{alike} `python -m nonsmooth list` prints all, and "
            "nonsmooth.textbook.PROBLEMS has them."
        )
    return PROBLEMS[name]()
