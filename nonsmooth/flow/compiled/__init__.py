"""The compiled engines: the interpreter of any system, and lanes."""

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
