"""Motion in time: events and resets, drivers, trajectories, ensembles.

The contract of events (``tests/flow/test_contract.py`` checks each sentence):

1. A stop or reset fires where its function passes through zero in its direction: falling (-1), rising (1),
   either way (0). A touch without a passage does not fire it.
2. An event exactly at ``t_end``, to rounding, happens.
3. At one instant a stop comes first and ends the run; then resets, in the order in which they were given;
   then surfaces. After a reset the events of the new state are determined again. A zero that a jump moves
   the state across is no event.
4. A start on the zero of a stop is no event: the stop can fire once the motion has left its zero.
5. A start on the zero of a reset with a direction fires it at once if the motion leaves zero that way.
6. A start on the zero of a reset without a direction does not fire it. If the reset would reverse the
   motion there, it is a wall whose side is not given: NON_UNIQUE.
7. After firing, a reset can fire again only once its function has been nonzero. A motion that it leaves
   pressed against its zero, without a rate, rests there: ACCUMULATION.
8. A reset that changes the side of a surface is one event, with the mode that starts after it.
9. After a reset that ends on the zero of another stop or reset, that one fires if the motion continues
   through zero, from its side before the reset to the other.
"""

from .ensembles.ensemble import ensemble
from .ensembles.lazy_starts import Grid, RandomStarts
from .ensembles.outcomes import Outcomes, outcomes
from .ensembles.work import Work
from .follow import follow
from .polynomial import first_crossing, first_root
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
