"""Periods: positive numbers, or functions of the parameters that can be kept and sent as text."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..checks import is_real
from ..errors import OptionError
from ..values import Array
from .system import FilippovSystem


def is_function(value: Any) -> bool:
    """Whether a value is one scalar expression."""
    return isinstance(value, ca.SX) and bool(value.is_scalar())


def read_period(system: FilippovSystem, value: Any) -> float | str | None:
    """Read a number, or an expression in parameters as a serialised function."""
    if is_real(value):
        return float(periods(float(value), np.zeros(0)))
    if not is_function(value):
        return None
    try:
        return str(ca.Function("period", [system.parameter_symbols], [value]).serialize())
    except RuntimeError:  # of other symbols
        return None


def periods(period: float | str, p: Array) -> Array:
    """Periods () or (m,) of parameters (np,) or (m, np); NaN where a parameter is."""
    values: Array = np.asarray(period if isinstance(period, float) else np.nan)
    if isinstance(period, str):
        found = np.array(ca.Function.deserialize(period)(p.T), float)
        values = found.reshape(p.shape[:-1])
    bad = values[np.isinf(values) | (values <= 0.0)]
    if bad.size:
        raise OptionError(f"period: expected a positive number, received {bad.flat[0]}.")
    return values
