"""The driver in C, which decides at events of any system (``interpreter``), and lanes for many trajectories.

What decides a question is one file of ``interpreter``; ``docs/decisions/one_driver.md`` lists them. ``tape``
gives it a system as data, ``arrays`` its options and arrays; ``convert`` makes a Trajectory of a run. ``lanes``
and ``device`` take steps that are clear; ``building`` compiles and keeps libraries.
"""

from .arrays import Run
from .building.build import CompilerError, find_compiler
from .lanes.engine import Lanes, lanes_for
from .tape import TapeEngine, tape_for

__all__ = [
    "CompilerError",
    "Lanes",
    "Run",
    "TapeEngine",
    "find_compiler",
    "lanes_for",
    "tape_for",
]
