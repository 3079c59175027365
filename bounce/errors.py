"""Errors of ``bounce``; every one derives from ``nonsmooth.NonsmoothError``."""

from __future__ import annotations

from typing import Any

import nonsmooth as ns


class ModelError(ns.DefinitionError):
    """A contact model breaks one of the obligations listed in ``ContactModel``."""


class UnknownNameError(ModelError, AttributeError):
    """A force uses a state or parameter that the model does not have."""


class EnergyWarning(UserWarning):
    """A ball leaves faster than it came: the surface did work on it."""


class LandingError(ns.PointError):
    """The state at touch-down is not a landing: not finite, above the ground, or moving away."""


def require(value: Any, kinds: type | tuple[type, ...], name: str, advice: str) -> None:
    """Raise an ``OptionError`` unless the argument has one of these types."""
    if not isinstance(value, kinds):
        names = " or ".join(k.__name__ for k in (kinds if isinstance(kinds, tuple) else (kinds,)))
        raise ns.OptionError(f"{name}: expected {names}, received {value!r}. {advice}")


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
