"""The compiled engine: the reference driver's algorithm in C, generated and built per system."""

from .build import CompilerError, find_compiler
from .engine import Engine, Run, engine_for, simulate_arrays

__all__ = ["CompilerError", "Engine", "Run", "engine_for", "find_compiler", "simulate_arrays"]
