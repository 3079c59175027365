"""MOVING through time: events and resets, drivers, trajectories, ensembles.

The contract of events, the same in every engine (``tests/flow/test_contract.py`` has each sentence):

1. A stop or reset is met where its function passes zero in its direction: falling (-1), rising (1),
   either way (0). A touch without a passage is not met.
2. What happens exactly at ``t_end``, to rounding, happens.
3. At one instant a stop is served first and ends the run; then resets, in the order in which they
   were given; then surfaces. After a reset the state that it led to is looked at anew. What a jump
   carries across is not met.
4. A start on the zero of a stop is no event: the stop is armed once the motion has left it.
5. A start on the zero of a reset with a direction is met at once if the motion leaves zero that way.
6. A start on the zero of one without a direction is not met. If the reset would turn the motion round
   there, it is a wall and nobody has said on which side the body is: NON_UNIQUE.
7. A reset is not met again before the motion has left its zero. A motion that it leaves pressed
   against its zero, without a rate, rests there: ACCUMULATION.
8. A reset that changes the side of a surface is one event, with the mode that starts after it.
9. After a reset that ends on the zero of another stop or reset, that one is met if the motion goes
   on from the side where it was to the other.
"""

from .ensembles.ensemble import ensemble
from .ensembles.lazy_starts import Grid, RandomStarts
from .ensembles.outcomes import Outcomes, outcomes
from .ensembles.work import Work
from .follow import follow
from .reference.polynomial import first_crossing, first_root
from .results import Ensemble
from .saving import load
from .section import Section
from .simulate import simulate
from .status import Status
from .trajectory import Event, Segment, Trajectory

__all__ = [
    "Ensemble",
    "Event",
    "Grid",
    "Outcomes",
    "RandomStarts",
    "Section",
    "Segment",
    "Status",
    "Trajectory",
    "Work",
    "ensemble",
    "first_crossing",
    "first_root",
    "follow",
    "load",
    "outcomes",
    "simulate",
]
