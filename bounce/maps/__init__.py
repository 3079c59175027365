"""Many bounces: lift-offs over arrays, maps of outcomes, and the curve that divides them."""

from .tracing import Arc

__all__ = ["Arc"]
