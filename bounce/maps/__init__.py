"""Many bounces: lift-offs over arrays, maps of outcomes, and the curve that divides them."""

from .dividing import Arc

__all__ = ["Arc"]
