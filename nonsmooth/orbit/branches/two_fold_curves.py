"""Curves of two-folds at given values of a parameter or a state.

For n states two-folds form a set of dimension n - 3, of dimension n - 2 with a parameter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...local.point.surface_point import LocalSurface, surface_at
from ...local.searches.find_two_fold import TwoFold, search_two_fold
from ...local.searches.search import unknowns
from ...model import (
    Array,
    ConvergenceError,
    DefinitionError,
    DegenerateError,
    FilippovSystem,
    Parameters,
    PointError,
    require_continuous,
    require_system,
)
from ...solvers.continuation import Curve, trace


class TraceError(ConvergenceError):
    """A trace of two-folds ended early.

    Attributes
    ----------
    value : float
        Value of the parameter or state at which no two-fold was found.
    folds : list of TwoFold
        Two-folds at the values before.
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

    From one value to the next the curve of two-folds is continued by
    :mod:`nonsmooth.continuation`, in as many steps as it needs. It ends at a turning point in the
    value: trace over another coordinate there. Where two-folds form a set of higher dimension each
    search starts from the two-fold before.

    Parameters
    ----------
    system, parameters, t, surface, mode, hold, tol, max_iterations
        As in :func:`find_two_fold`.
    near : array_like (n,)
        Guess of the first two-fold.
    over : str or SX symbol
        Name of a parameter, or of a state (for $n > 3$, where two-folds form a set of dimension
        n - 3).
    values : array_like (k,)
        Values in their order along the curve.

    Returns
    -------
    list of k TwoFold
        The two-folds along the curve, in order.

    Raises
    ------
    TraceError
        A search failed or reached a degenerate two-fold; ``value`` and the ``folds`` before it.
    DefinitionError
        ``over`` is neither a parameter nor a state; ``values`` are not finite; and as in
        :func:`find_two_fold`.
    ParameterError, PointError, OptionError
        As in :func:`find_two_fold`.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, z, a = (ca.SX.sym(s) for s in "xyza")
    >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[a - y, 1, -2], below=[z, -1, 1],
    ...                       parameters={a: 0.0})
    >>> [fold.point.tolist() for fold in trace_two_folds(s, [0, 0, 0], over="a", values=[0, 0.5])]
    [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]]
    """
    require_system(system)
    require_continuous(system, "trace_two_folds")
    name, numbers = str(over), _values(values)
    state = name in system.state_names
    if not state and name not in system.parameter_names:
        raise DefinitionError(
            f"over={name!r} is unknown. Give the name or symbol of a parameter "
            f"{list(system.parameter_names)} or a state {list(system.state_names)}."
        )
    start = system.extended_point(near, t)[: system.dimension]
    held = [hold] if isinstance(hold, str) else [str(h) for h in hold]
    held = [*held, name] if state and name not in held else held
    free = unknowns(system, held, 3, "two-fold")
    folds: list[TwoFold] = []
    for value in numbers:
        given = _given(parameters, {} if state else {name: value})
        last = folds[-1].point if folds else start
        where, x = surface_at(system, last, given, t, surface, mode)
        x = x.copy()
        if state:
            x[system.state_names.index(name)] = value
        if folds and len(free) == 3:
            x = _ahead(TwoFoldCurve(where, x, free, name), last, numbers[len(folds) - 1], value)
        try:
            folds.append(search_two_fold(where, x, free, tol, max_iterations))
        except (ConvergenceError, DegenerateError, PointError) as error:
            raise TraceError(
                f"values: no two-fold was found at {name} = {value:.6g}, after {len(folds)} of "
                f"{len(numbers)} values: {error} Take smaller steps in the values, or another coordinate; "
                "the exception's folds has the two-folds before.",
                value=value,
                folds=folds,
                residual=error.residual if isinstance(error, ConvergenceError) else math.nan,
                point=error.point if isinstance(error, ConvergenceError) else x,
            ) from error
    return folds


def _values(values: ArrayLike) -> list[float]:
    try:
        numbers = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        numbers = np.array(math.nan)
    if numbers.ndim != 1 or numbers.size == 0 or not np.all(np.isfinite(numbers)):
        raise DefinitionError(f"values={values!r} are no finite numbers. Give a list of them.")
    return [float(v) for v in numbers]


def _given(parameters: Parameters | None, changed: dict[str, float]) -> dict[str, Any]:
    """Parameters by name, some of them changed."""
    return {str(k): v for k, v in (parameters or {}).items()} | changed


class TwoFoldCurve(Curve):
    """h = L1 = L2 = 0 in three states and a parameter, or a fourth state, for continuation."""

    def __init__(self, where: LocalSurface, x: Array, free: Sequence[int], name: str):
        names = where.system.state_names
        self.where, self.x, self.free = where, x, list(free)
        self.state = names.index(name) if name in names else -1
        self.index = -1 if self.state >= 0 else where.system.parameter_names.index(name)
        self.scale = np.ones(len(self.free) + 1)

    def point_at(self, u: Array) -> Array:
        """The extended point of unknowns."""
        x = self.x.copy()
        x[self.free] = u[:-1]
        if self.state >= 0:
            x[self.state] = u[-1]
        return x

    def equations(self, u: Array) -> tuple[Array, Array]:
        x, p = self.point_at(u), self.where.parameters.copy()
        if self.index >= 0:
            p[self.index] = u[-1]
        here = replace(self.where, parameters=p)
        numbers = here.at(x)
        last = (
            numbers.gradients[:, self.state]
            if self.state >= 0
            else here.lie_parameter_derivatives(x)[:, self.index]
        )
        values = np.array([numbers.h, *numbers.lie])
        return values, np.column_stack([numbers.gradients[:, self.free], last])


def _ahead(curve: TwoFoldCurve, last: Array, before: float, value: float) -> Array:
    """Guess at the next value: the point at which the curve reaches it, or the last one."""
    start = np.append(last[curve.free], before)
    if value == before:
        return curve.point_at(start)
    size = max(1.0, float(np.abs(last).max()))
    curve.scale = np.append(np.full(len(curve.free), size), abs(value - before))
    tangent = np.zeros(start.size)
    tangent[-1] = np.sign(value - before)
    low, high = min(before, value), max(before, value)
    bounds = [(start.size - 1, low, high)]
    arc = trace(curve, [start], tangent, step=0.2, first=0.2, most=200, bounds=bounds)
    if arc.end == "interrupted":
        raise KeyboardInterrupt
    end = arc.points[-1].u
    return curve.point_at(end if arc.end == "bound" and end[-1] == value else start)
