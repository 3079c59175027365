"""Motion in time: trajectories and ensembles, their options, results and files.

``engine`` has the driver, which decides at events; the modules here convert its arrays to results.

The contract of events (``tests/flow/test_runs.py`` and ``events/test_event_cases.py`` check each sentence):

1. A stop or reset is due when its condition becomes true. The condition of a guard is that it passes zero in
   its direction: falling (-1), rising (1), either way (0). A touch without a passage is no event.
2. A passage is one event. A map that keeps its own guard at zero does not make its event due again.
3. A jump that makes a condition true makes that event due at the same instant, unless it has
   ``by_jumps=False``. Where a jump ends on a zero, the motion that follows decides.
4. Events at one instant fire one at a time: stops first, then resets by ``priority``, then in the order of
   definition, then impacts. All conditions are evaluated again after each jump; an event whose condition has become
   false is no longer due, unless it is ``persistent``.
5. ``when`` is a filter: an event fires only if it is true at that instant. An event with ``level=True`` is due
   while its condition and ``when`` are true.
6. Surfaces take their sides after the last jump of an instant. A jump across a surface is no event of it.
7. An event whose condition is true at the start is not due, except a reset on its zero that the motion enters. A reset
   without a direction that would reverse the motion there is a wall whose side is not given: NON_UNIQUE.
8. An event at ``t_end``, to rounding, occurs, with all that follow at that instant.
9. A motion that a reset directs into its own zero, at rate zero, rests there: ACCUMULATION. More than
   ``max_jumps`` jumps at one instant end the run: ENDLESS_JUMPS.
"""

from ..result_tables import add_views
from .ensembles.ensemble import ensemble
from .ensembles.lazy_starts import Grid, RandomStarts
from .ensembles.outcomes import Outcomes, outcomes
from .ensembles.work import Work
from .events import Event, Events, Segment, Segments
from .follow import follow
from .polynomial import first_crossing, first_root
from .results import Ensemble
from .saving import load
from .section import Section
from .simulate import simulate
from .status import Status
from .trajectory import Trajectory

__all__ = [
    "Ensemble",
    "Event",
    "Events",
    "Grid",
    "Outcomes",
    "RandomStarts",
    "Section",
    "Segment",
    "Segments",
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

add_views(globals(), __all__)
