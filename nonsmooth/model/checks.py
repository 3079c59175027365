"""Checks of arguments that are numbers: real, whole, positive, arrays.

Booleans, strings and complex numbers are refused, also where Python or NumPy would convert them.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .errors import NonsmoothError, OptionError, PointError

_NO_NUMBER = (str, bytes, bool, np.bool_, complex, np.complexfloating)


def is_real(value: Any) -> bool:
    """Whether a value is one finite real number (NumPy's and CasADi's scalars included)."""
    if type(value) is float:
        return math.isfinite(value)
    if isinstance(value, (ca.DM, ca.SX)):
        return value.numel() == 1 and _finite(value)
    if isinstance(value, np.ndarray) and (value.ndim or value.dtype.kind not in "iuf"):
        return False
    return not isinstance(value, _NO_NUMBER) and _finite(value)


def _finite(value: Any) -> bool:
    try:
        return math.isfinite(float(value))
    except (TypeError, ValueError, OverflowError, NotImplementedError, RuntimeError):
        return False


def real(
    value: Any,
    what: str,
    *,
    expected: str = "a finite number",
    advice: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    error: type[NonsmoothError] = OptionError,
) -> float:
    """Return a finite number from ``low`` to ``high`` or raise."""
    if type(value) is float and low <= value <= high and math.isfinite(value):
        return value
    if not is_real(value) or not low <= float(value) <= high:
        raise error(f"{what}: expected {expected}, received {value!r}. {advice}".rstrip())
    return float(value)


def whole(value: Any, what: str, *, least: int = 1, advice: str = "") -> int:
    """Return a whole number of at least ``least`` or raise OptionError; 1e6 is one too."""
    if type(value) is int and value >= least:
        return value
    exact = isinstance(value, int)  # one beyond 2**53 may be no float
    if not is_real(value) or not (exact or float(value) == int(value)) or value < least:
        expected = "a positive whole number" if least == 1 else f"a whole number >= {least}"
        raise OptionError(f"{what}: expected {expected}, received {value!r}. {advice}".rstrip())
    return int(value)


def real_array(values: Any, what: str, expected: str = "real numbers") -> NDArray[np.float64]:
    """Return an array of real numbers, NaN and inf included, or raise PointError."""
    # A CasADi column or row is one axis.
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and type(values) is np.ndarray:
        return values
    if isinstance(values, ca.DM) and 1 in values.shape:
        return np.array(values, dtype=float).ravel()
    if values is None:
        return np.array(np.nan)  # a wrong shape, which the caller refuses
    try:
        array = np.asarray(values)
        fits = array.dtype.kind in "iuf" and not _is_masked(values)
        if array.dtype.kind == "O":
            fits = array.size > 0 and all(_number(v) for v in array.ravel())
        if fits or array.size == 0:
            return array.astype(float)
    except (TypeError, ValueError, NotImplementedError, RuntimeError):
        pass
    raise PointError(
        f"{what}: expected {expected}, received {values!r}. States must be real numbers: no "
        "strings, booleans, complex numbers, symbols or missing values."
    )


def _is_masked(values: Any) -> bool:
    """Whether some numbers are masked; numpy.ma, slow to import, is loaded only by its users."""
    ma = sys.modules.get("numpy.ma")
    return ma is not None and bool(ma.is_masked(values))


def _number(value: Any) -> bool:
    return is_real(value) or (isinstance(value, float) and not math.isfinite(value))


def positive(value: float, name: str) -> float:
    """Return a positive finite number or raise OptionError."""
    return real(
        value,
        name,
        expected="a positive finite number",
        advice="Leave it out for the default.",
        low=math.nextafter(0.0, 1.0),
    )
