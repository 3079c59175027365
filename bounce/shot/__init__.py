"""One bounce: from touch-down to lift-off, and its derivatives."""

from .record import Forces, Phase

__all__ = ["Forces", "Phase"]
