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
    """A decision of a run rests on a convention, or is not proved."""


def warn_of_facts(depends_on_widths: bool, unproved: bool, t_error: float) -> None:
    """Warn of what the decisions of a run rest on."""
    if depends_on_widths:
        warn_once(
            "Whether sliding on several surfaces is stable depends here on the widths of their layers, which are "
            "equal in the units of the functions unless layer_widths= is given (run.facts.depends_on_widths).",
            DecisionWarning,
        )
    if unproved:
        warn_once(
            "One motion was found for more than eight elements that act on one another; no test shows that it is "
            "the only one (run.facts.unproved).",
            DecisionWarning,
        )
    if t_error > 0.0:
        warn_once(
            "Rounding of a switching function hides when it passes zero, by more than the tolerance (run.facts.t_error "
            "says how long). Write it with a simple zero, x - 1 instead of an expanded (x - 1)**3.",
            DecisionWarning,
        )


@lru_cache(maxsize=64)
def warn_once(message: str, kind: type[UserWarning] = CompilerWarning) -> None:
    """Warn, once in a process for each message, about the caller's line and not one of ours."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, kind, stacklevel=level)
