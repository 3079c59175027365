"""The compiled engines: the interpreter of any system, and programs generated for one."""

from .arrays import Run
from .build import CompilerError, find_compiler
from .engine import Engine, engine_for
from .tape import TapeEngine, tape_for

__all__ = [
    "CompilerError",
    "Engine",
    "Run",
    "TapeEngine",
    "engine_for",
    "find_compiler",
    "tape_for",
]
