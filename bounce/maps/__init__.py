"""Many bounces: results of maps, the dividing surface, vortices of the slip, and proven maps."""

import nonsmooth as ns

from .dividing import Arc, DividingCurve, DividingSurface, critical_eta, dividing_surface
from .outcomes import OutcomeMap
from .proven import ProvenMap, proven_map
from .results import LiftOffs
from .slip_directions import SlipMap, SlipTurn, Vortex, find_vortices, slip_turn, winding_number

__all__ = [
    "Arc",
    "DividingCurve",
    "DividingSurface",
    "LiftOffs",
    "OutcomeMap",
    "ProvenMap",
    "SlipMap",
    "SlipTurn",
    "Vortex",
    "critical_eta",
    "dividing_surface",
    "find_vortices",
    "proven_map",
    "slip_turn",
    "winding_number",
]

ns.result_tables.add_views(globals(), __all__)
