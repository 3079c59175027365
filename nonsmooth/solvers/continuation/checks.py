"""What is asked of a curve of one's own, and of where it is to be followed from: refused in words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...model import (
    Array,
    DefinitionError,
    NonsmoothError,
    OptionError,
    PointError,
    explain,
    is_real,
    real_array,
    whole,
)
from .curve import Curve


def require_curve(curve: Any) -> None:
    """Refuse what is no curve."""
    if not isinstance(curve, Curve):
        raise DefinitionError(
            explain(
                "curve",
                expected="an instance of a subclass of nonsmooth.continuation.Curve",
                received=repr(curve),
                advice="Write class Mine(Curve) with equations(self, u), and give Mine().",
            )
        )


def vector(values: Any, what: str, size: int | None = None) -> Array:
    """A vector of finite numbers, of a given length."""
    found = real_array(values, what)
    expected = "a vector" if size is None else f"a vector ({size},)"
    if found.ndim != 1 or (size is not None and found.size != size) or not found.size:
        received = f"shape {found.shape}"
    elif not np.isfinite(found).all():
        received = str(found)
    else:
        return np.asarray(found, float)
    raise PointError(
        explain(
            what,
            expected=f"{expected} of finite numbers",
            received=received,
            advice="One for each unknown of the curve, the parameter included.",
        )
    )


def check_trace(
    curve: Any,
    rows: Any,
    tangent: Any,
    lengths: dict[str, Any],
    most: Any,
    bounds: Any,
    report: Callable[..., Any] | None,
) -> tuple[list[Array], Array]:
    """Check the arguments of ``trace``; the rows and the tangent as arrays."""
    require_curve(curve)
    if not isinstance(rows, (Sequence, np.ndarray)) or isinstance(rows, str) or not len(rows):
        raise PointError(
            explain(
                "rows",
                expected="a list of points of the curve, at least one",
                received=repr(rows),
                advice="Write [np.array([...])].",
            )
        )
    size = vector(rows[-1], "rows[-1]").size
    found = [vector(row, f"rows[{i}]", size) for i, row in enumerate(rows)]
    way = vector(tangent, "tangent", size)
    if not way.any():
        raise PointError("tangent: expected a direction, received zero. Give which way to go.")
    for name, value in lengths.items():
        if not is_real(value) or not 0.0 < float(value) < np.inf:
            raise OptionError(f"{name}: expected a positive finite number, received {value!r}.")
    whole(most, "most")
    _check_bounds(bounds, size)
    if report is not None and not callable(report):
        raise OptionError(f"report: expected a function of a point, or None, received {report!r}.")
    _check_curve(curve, found[-1])
    return found, way


def _check_bounds(bounds: Any, size: int) -> None:
    for entry in bounds if isinstance(bounds, (Sequence, np.ndarray)) else [bounds]:
        if isinstance(entry, (Sequence, np.ndarray)) and len(entry) == 3:
            if all(isinstance(e, (int, float, np.number)) for e in entry):
                k, low, high = entry
                if k in range(-size, size) and low <= high:
                    continue
        raise OptionError(
            explain(
                "bounds",
                expected=f"entries (index, low, high) with an index below {size} and low <= high",
                received=repr(entry),
                advice="For example bounds=[(0, -1.0, 1.0)].",
            )
        )


def _check_curve(curve: Curve, u: Array) -> None:
    """Refuse a curve whose attributes or equations do not fit its unknowns."""
    n, scale = u.size, np.asarray(curve.scale)
    if scale.dtype.kind not in "iuf" or scale.shape not in ((), (n,)) or not (scale > 0.0).all():
        raise DefinitionError(
            f"curve.scale: expected a positive number or vector ({n},), received {curve.scale!r}. It "
            "holds the sizes of the unknowns."
        )
    if curve.parameter is not None and curve.parameter not in range(-n, n):
        raise DefinitionError(
            f"curve.parameter: expected the index of one of {n} unknowns, or None, received "
            f"{curve.parameter!r}."
        )
    if type(curve).equations is Curve.equations:
        raise DefinitionError(
            "curve: expected one with equations, received a subclass of Curve without. Write "
            "equations(self, u), which returns their values and their Jacobian."
        )
    if not curve.exact:
        return  # estimates of a derivative keep what they have seen
    try:
        given = curve.equations(u)
    except (NonsmoothError, np.linalg.LinAlgError):
        return  # the arc ends there, and says so
    try:
        shapes = [part.shape for part in given if isinstance(part, np.ndarray)]
    except TypeError:
        shapes = []
    if shapes != [(n - 1,), (n - 1, n)]:
        raise DefinitionError(
            f"curve.equations: expected arrays ({n - 1},) and ({n - 1}, {n}) for {n} unknowns, the "
            f"values and their derivatives, received {given!r}. Return both as numpy arrays."
        )
