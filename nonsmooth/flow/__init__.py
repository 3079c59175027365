"""MOVING through time: first roots, the event-driven driver, trajectories."""

from .ensemble import Ensemble, ensemble
from .follow import follow
from .funnel import Departure, Funnel, funnel
from .polynomial import first_crossing, first_root
from .simulate import simulate
from .status import Status
from .trajectory import Event, Segment, Trajectory

__all__ = [
    "Departure",
    "Ensemble",
    "Event",
    "Funnel",
    "Segment",
    "Status",
    "Trajectory",
    "ensemble",
    "first_crossing",
    "first_root",
    "follow",
    "funnel",
    "simulate",
]
