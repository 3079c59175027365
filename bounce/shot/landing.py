"""What a landing must be, in the plane and in 3-D; refusals say what was received."""

from __future__ import annotations

from typing import Any

import numpy as np

import nonsmooth as ns

from ..contact.model import ContactModel
from ..errors import LandingError, ModelError
from ..parameters import Parametrised, number


def require_model(model: Any) -> None:
    """Refuse what is no contact model.

    Raises
    ------
    ModelError
    """
    if isinstance(model, ContactModel):
        return
    hint = " A class was given: make an instance of it." if isinstance(model, type) else ""
    if isinstance(model, Parametrised):
        hint = " A law of bounce.laws takes no time: use its lift_off(xdot, ydot, omega)."
    raise ModelError(f"model: expected a ContactModel, received {model!r}.{hint}")


def is_vector(value: Any) -> bool:
    """Whether something is meant as a vector, not as a number."""
    return isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim > 0)


def landing_number(value: Any, name: str) -> float:
    """Return one finite number of a landing.

    Raises
    ------
    LandingError
    """
    if is_vector(value):
        raise LandingError(
            f"{name}: expected one number, received {np.shape(value)} of them. simulate follows one "
            "bounce."
        )
    return number(value, name, LandingError)


def check_approach(y: float, ydot: float) -> None:
    """Refuse a ball above the ground or moving away from it.

    Raises
    ------
    LandingError
    """
    if y > 0.0:
        raise LandingError(
            f"y: expected at most 0 (in the ground), received {y!r}. The ball is in the air; "
            "touch-down is at y = 0."
        )
    if y == 0.0 and ydot >= 0.0:
        raise LandingError(
            f"ydot: expected a negative number at y = 0, received {ydot!r}. The ball does not "
            "approach the ground (y points up)."
        )


def time_limit(t_max: float) -> float:
    """Return the longest time of a contact.

    Raises
    ------
    nonsmooth.OptionError
    """
    limit = number(t_max, "t_max", ns.OptionError)
    if limit <= 0:
        raise ns.OptionError(f"t_max: expected a positive time, received {t_max!r}.")
    return limit
