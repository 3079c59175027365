"""MOVING through time: first roots, the event-driven driver, trajectories."""

from .ensemble import Ensemble, ensemble
from .follow import follow
from .polynomial import first_crossing, first_root
from .simulate import simulate
from .status import Status
from .trajectory import Event, Segment, Trajectory

__all__ = [
    "Ensemble",
    "Event",
    "Segment",
    "Status",
    "Trajectory",
    "ensemble",
    "first_crossing",
    "first_root",
    "follow",
    "simulate",
]
