"""Checked values of the states and parameters of a system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import real, real_array
from .errors import ParameterError, PointError
from .reading import Parameters

Array = NDArray[np.float64]


def parameter_values(
    names: Sequence[str], defaults: Mapping[str, float | None], parameters: Parameters | None
) -> Array:
    """Numbers for all parameters, defaults replaced by ``parameters`` (keys: symbols or names)."""
    values, given = dict(defaults), dict[str, Any]()
    if parameters is not None and not isinstance(parameters, Mapping):
        raise ParameterError(
            "parameters: expected a mapping from names or symbols to numbers, received "
            f"{parameters!r} ({type(parameters).__name__}). The names are {list(names)}."
        )
    for key, value in (parameters or {}).items():
        name = key if isinstance(key, str) else str(key)
        if name in given:
            raise ParameterError(
                f"parameters: expected one value for {name!r}, received {given[name]!r} and "
                f"{value!r}, under its name and its symbol. Keep one of them."
            )
        given[name] = value
        if name not in values:
            raise ParameterError(
                f"parameters: expected names among {list(names)}, received {name!r}. Declare it "
                "in the system's parameters=, or correct the name."
            )
        values[name] = value
    missing = [name for name, value in values.items() if value is None]
    if missing:
        raise ParameterError(
            f"parameters: expected a value for {missing}, received none. They have no default: "
            "pass parameters={name: value}."
        )
    return np.array([real(values[n], f"parameter {n!r}", error=ParameterError) for n in names])


def state_values(names: Sequence[str], point: ArrayLike) -> Array:
    """Numbers for all states."""
    values = real_array(point, "point", f"{len(names)} numbers")
    if values.shape != (len(names),):
        raise PointError(
            f"point: expected shape ({len(names)},) for the states {tuple(names)}, received shape "
            f"{values.shape}. Give one number for each state."
        )
    if not np.isfinite(values).all():
        raise PointError(
            f"point: expected finite numbers, received {values}. NaN or inf often comes from an "
            "earlier division by zero."
        )
    return values
