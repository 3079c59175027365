"""One bounce from touch-down to lift-off: its states, phases, forces, derivatives and proof."""

import nonsmooth as ns

from .certify import BounceProof
from .sensitivity import Sensitivity
from .shot import Forces, Phase
from .state import State

__all__ = ["BounceProof", "Forces", "Phase", "Sensitivity", "State"]

ns.result_tables.add_views(globals(), __all__)
