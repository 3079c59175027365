"""One bounce: from touch-down to lift-off, and its derivatives."""

from .shot import Forces, Phase

__all__ = ["Forces", "Phase"]
