"""Warnings, once in a process, about the line of the caller."""

from __future__ import annotations

import sys
import warnings
from functools import lru_cache
from pathlib import Path

_HERE = str(Path(__file__).parents[1])


class CompilerWarning(UserWarning):
    """A compiler failed, or the cache of compiled libraries is not used."""


class DecisionWarning(UserWarning):
    """A decision of a run depends on a convention, or is not proved."""


def warn_of_facts(depends_on_widths: bool, unproved: bool, t_error: float) -> None:
    """Warn of assumptions and errors of the decisions of a run."""
    if depends_on_widths:
        warn_once(
            "Whether sliding on several surfaces is stable depends here on the widths of their layers, which are "
            "equal in the units of the functions unless layer_widths= is given (run.facts.depends_on_widths).",
            DecisionWarning,
        )
    if unproved:
        warn_once(
            "One motion was found for more than eight coupled elements; no test proves that it is unique "
            "(run.facts.unproved).",
            DecisionWarning,
        )
    if t_error > 0.0:
        warn_once(
            "Rounding of a switching function makes the time of its zero uncertain by more than the tolerance "
            "(run.facts.t_error). Write it with a simple zero, x - 1 instead of an expanded (x - 1)**3.",
            DecisionWarning,
        )


@lru_cache(maxsize=64)
def warn_once(message: str, kind: type[UserWarning] = CompilerWarning) -> None:
    """Warn, once in a process for each message, about the caller's line and not one of ours."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, kind, stacklevel=level)
