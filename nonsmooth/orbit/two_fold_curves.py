"""Two-folds followed while a parameter or a state takes given values.

For n states two-folds form a set of dimension n - 3, and a curve of them as a parameter varies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..local.find_two_fold import search_two_fold
from ..local.place import place
from ..local.search import unknowns
from ..local.two_fold import TwoFold
from ..model import (
    Array,
    ConvergenceError,
    DefinitionError,
    DegenerateError,
    FilippovSystem,
    Parameters,
    PointError,
    explain,
)


class TraceError(ConvergenceError):
    """A trace of two-folds ended early.

    Attributes
    ----------
    value : float
        The value at which it failed.
    folds : list of TwoFold
        Those found before.
    residual, point
        As in ConvergenceError.
    """

    def __init__(self, message: str, *, value: float, folds: list[TwoFold], **details: Any):
        super().__init__(message, **details)
        self.value = value
        self.folds = folds


def trace_two_folds(
    system: FilippovSystem,
    near: ArrayLike,
    *,
    over: Any,
    values: ArrayLike,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    hold: Sequence[str] = (),
    tol: float = 1e-12,
    max_iterations: int = 50,
) -> list[TwoFold]:
    """Follow two-folds while a parameter, or one coordinate of the state, takes given values.

    Natural continuation: each search starts from the two-fold before, extrapolated along the last
    two. It does not go round a turning point in the value: trace over another coordinate there.

    Parameters
    ----------
    system, parameters, t, surface, mode, hold, tol, max_iterations
        As in :func:`find_two_fold`.
    near : array_like (n,)
        Start of the first search.
    over : str or SX symbol
        Name of a parameter, or of a state (for n > 3, where two-folds form a set of dimension
        n - 3).
    values : array_like (k,)
        In the order in which they are visited.

    Returns
    -------
    list of k TwoFold

    Raises
    ------
    TraceError
        A search failed or met a degenerate two-fold; ``value`` and the ``folds`` before it.
    DefinitionError, ParameterError, PointError, OptionError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z, a = (ca.SX.sym(s) for s in "xyza")
    >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[a - y, 1, -2], below=[z, -1, 1],
    ...                       parameters={a: 0.0})
    >>> [fold.point.tolist() for fold in trace_two_folds(s, [0, 0, 0], over="a", values=[0, 0.5])]
    [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]]
    """
    name, numbers = str(over), _values(values)
    state = name in system.state_names
    if not state and name not in system.parameter_names:
        raise DefinitionError(
            explain(
                "over",
                expected=f"a parameter {list(system.parameter_names)} or a state "
                f"{list(system.state_names)}",
                received=repr(name),
                advice="Give its name or its symbol.",
            )
        )
    start = system.extended_point(near, t)[: system.dimension]
    held = [hold] if isinstance(hold, str) else [str(h) for h in hold]
    held = [*held, name] if state and name not in held else held
    free = unknowns(system, held, 3, "two-fold")
    folds: list[TwoFold] = []
    for value in numbers:
        guess = _predict(start, folds, numbers)
        given = dict(parameters or {})
        if state:
            guess[system.state_names.index(name)] = value
        else:
            given = {k: v for k, v in given.items() if str(k) != name} | {name: value}
        where, x = place(system, guess, given, t, surface, mode)
        try:
            folds.append(search_two_fold(where, x, free, tol, max_iterations))
        except (ConvergenceError, DegenerateError, PointError) as error:
            raise TraceError(
                f"trace over {name!r}: expected a two-fold at {name} = {value:.6g}, received after "
                f"{len(folds)} of {len(numbers)} values: {error} The two-folds before are in the "
                "exception's folds; take smaller steps in the values, or another coordinate.",
                value=value,
                folds=folds,
                residual=error.residual if isinstance(error, ConvergenceError) else math.nan,
                point=error.point if isinstance(error, ConvergenceError) else guess,
            ) from error
    return folds


def _values(values: ArrayLike) -> list[float]:
    try:
        numbers = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        numbers = np.array(math.nan)
    if numbers.ndim != 1 or numbers.size == 0 or not np.all(np.isfinite(numbers)):
        raise DefinitionError(f"values: expected a list of finite numbers, received {values!r}.")
    return [float(v) for v in numbers]


def _predict(start: Array, folds: list[TwoFold], values: list[float]) -> Array:
    """Extrapolate the last two two-folds to the next value; the last one, or the start, if few."""
    k = len(folds)
    if k == 0:
        return start.copy()
    if k == 1 or values[k - 1] == values[k - 2]:
        return folds[-1].point.copy()
    ratio = (values[k] - values[k - 1]) / (values[k - 1] - values[k - 2])
    return folds[-1].point + np.clip(ratio, -2, 2) * (folds[-1].point - folds[-2].point)
