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


def require(value: Any, kinds: type | tuple[type, ...], name: str, advice: str) -> None:
    """Refuse what is of another kind than the one that is asked for.

    Parameters
    ----------
    value : object
        What was given.
    kinds : type or tuple of type
        What is expected.
    name : str
        Of the argument.
    advice : str
        Where one gets what is expected.

    Raises
    ------
    nonsmooth.OptionError

    Examples
    --------
    >>> require(3, (int, float), "size", "Count it.")
    >>> require("x", (int, float), "size", "Count it.")
    Traceback (most recent call last):
        ...
    nonsmooth.model.errors.OptionError: size: expected int or float, received 'x'. Count it.
    """
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
