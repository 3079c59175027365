"""What can go wrong with a bounce; every error also derives from ``nonsmooth.NonsmoothError``."""

from __future__ import annotations

from typing import Any

import nonsmooth as ns


class ModelError(ns.DefinitionError):
    """A contact model breaks one of the obligations listed in ``ContactModel``."""


class UnknownNameError(ModelError, AttributeError):
    """A force asks for a state or parameter that the model does not have."""


class EnergyWarning(UserWarning):
    """A ball leaves faster than it came: the surface did work on it."""


class LandingError(ns.PointError):
    """The state at touch-down is not a landing: not finite, above the ground, or moving away."""


class LiftOffError(ns.NonsmoothError, RuntimeError):
    """The ball did not lift off.

    Attributes
    ----------
    trajectory : nonsmooth.Trajectory or None
        What was computed until then.
    """

    def __init__(self, message: str, trajectory: ns.Trajectory | None = None):
        super().__init__(message)
        self.trajectory = trajectory

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.trajectory)
