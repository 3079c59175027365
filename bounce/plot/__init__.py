"""Pictures (matplotlib; loaded as ``bounce.plot`` on first use)."""

from .explorer import explorer
from .outcomes import outcome_map
from .proven import proven_map
from .residuals import residuals
from .shot import STYLES, friction_cone

__all__ = ["STYLES", "explorer", "friction_cone", "outcome_map", "proven_map", "residuals"]
