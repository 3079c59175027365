"""Motion in time: trajectories and ensembles, their options, results and files.

``compiled`` has the driver, which decides at events; the modules here turn its arrays into results.

The contract of events (``tests/flow/test_runs.py`` and ``events/test_event_cases.py`` check each sentence):

1. A stop or reset is due when its condition becomes true. The condition of a guard is that it passes zero in
   its direction: falling (-1), rising (1), either way (0). A touch without a passage is no event.
2. A passage is one event. A map that keeps its own guard at zero does not make its event due again.
3. A jump that makes a condition true makes that event due at the same instant, unless it has
   ``by_jumps=False``. Where a jump ends on a zero, the motion that follows decides.
4. Of several events at one instant one is served at a time: stops first, then resets by ``priority``, then in
   the order of definition, then impacts. All conditions are evaluated again after each jump; an event whose
   condition has become false is no longer due, unless it is ``persistent``.
5. ``when`` is a filter: an event is served only if it holds at that instant. An event with ``level=True`` is due
   while its condition and ``when`` hold.
6. Surfaces take their sides after the last jump of an instant. A jump across a surface is no event of it.
7. What is true at a start is not due. A reset on its zero is, if the motion goes in; a stop is not. A reset
   without a direction that would reverse the motion there is a wall whose side is not given: NON_UNIQUE.
8. An event at ``t_end``, to rounding, happens, with all that follows at that instant.
9. A motion that a reset leaves pressed against its zero, without a rate, rests there: ACCUMULATION. More than
   ``max_jumps`` jumps at one instant end the run: ENDLESS_JUMPS.
"""

from ..tables import add_views
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
