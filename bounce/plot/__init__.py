"""Pictures (matplotlib; loaded as ``bounce.plot`` on first use)."""

from .outcomes import outcome_map
from .proven import proven_map
from .residuals import residuals
from .shot import STYLES, friction_cone
from .slip_directions import direction_colours, slip_map

__all__ = [
    "STYLES",
    "direction_colours",
    "friction_cone",
    "outcome_map",
    "proven_map",
    "residuals",
    "slip_map",
]
