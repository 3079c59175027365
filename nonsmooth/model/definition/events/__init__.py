"""Events besides switching: stops, resets, impacts and clocks, and the conditions under which they are due."""

from .declarations import Clock, Impact, Reset, Stop, with_added_states

__all__ = ["Clock", "Impact", "Reset", "Stop", "with_added_states"]
