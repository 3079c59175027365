"""Warnings, once in a process, about the line of the caller."""

from __future__ import annotations

import sys
import warnings
from functools import lru_cache
from pathlib import Path

_HERE = str(Path(__file__).parents[1])


class CompilerWarning(UserWarning):
    """A compiler failed, or the cache of compiled libraries is not used."""


@lru_cache(maxsize=64)
def warn_once(message: str) -> None:
    """Warn, once in a process for each message, about the caller's line and not one of ours."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, CompilerWarning, stacklevel=level)
