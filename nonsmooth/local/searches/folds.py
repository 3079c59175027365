"""Folds and cusps: points of a surface where one field is tangent to it (Filippov 1988).

The order of contact is read from the jet of h along the field, h = sum_k (L_i^k h) t^k/k!: the
first k >= 1 with a nonzero coefficient, 2 for a fold and 3 for a cusp.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...model import Array, DefinitionError, FilippovSystem, Parameters, PointError
from ...model.checks import positive
from ...result_tables import Tabular
from ..checks import require_generic
from ..discrete_states import with_discrete_states_held
from ..point.surface_point import (
    FIELDS,
    TOLERANCE,
    LocalSurface,
    Numbers,
    Side,
    on_surface,
    side_index,
    surface_at,
)
from .equilibria import equilibrium_distance
from .search import Found, search, unknowns


@dataclass(frozen=True, eq=False)
class Fold(Tabular):
    """A tangency of one field with the surface.

    Attributes
    ----------
    point : ndarray (n,)
        The point, in the order of the states.
    side : {"+", "-"}
        Of the field $F1$ above the surface or $F2$ below it.
    order : int or None
        First k with $L^k h != 0$; None if there is none up to the order that was computed.
    kind : {"visible", "invisible", "cusp", "degenerate"}
        A fold (order 2) is visible if the orbit of its field through the point stays on the
        field's side; order 3 is a cusp; anything higher is degenerate.
    lie : ndarray (max_order + 1,)
        $L^k h$ for k from 0.
    other : float
        First Lie derivative of h along the other field: attracting or repelling sliding begins
        here unless it is zero too.
    distance : float
        From the start of the search; 0 if the point was given.
    residual : float
        Distance to the solution of $h = L_i = 0$ to first order.
    iterations : int
        Iterations that Newton's method took; 0 where nothing was searched.
    """

    point: Array
    side: Side
    order: int | None
    kind: str
    lie: Array
    other: float
    distance: float
    residual: float
    iterations: int

    def __str__(self) -> str:
        if self.order is None:
            contact = (
                f"no nonzero derivative of h along it up to order {len(self.lie) - 1}: an "
                "equilibrium on the surface, or an orbit inside it"
            )
        else:
            name = {2: "fold", 3: "cusp"}.get(self.order, "tangency")
            contact = (
                f"{self.kind} {name}" if name != self.kind else name
            ) + f" of order {self.order}, L^{self.order} h = {self.lie[self.order]:.6g}"
        found = f"; found {self.distance:.3g} from the start" if self.iterations else ""
        return f"{FIELDS[self.side]} at {self.point.tolist()}: {contact}{found}."


def contact(where: LocalSurface, x: Array, side: Side, max_order: int, tol: float) -> Array:
    """Derivatives L^k h for k = 0..max_order, with rounding-level values set to zero."""
    # The k-th Taylor coefficient counts as zero below ``tol |grad h| |F| r^(k-1)``, where r is the
    # rate, per time, at which the coefficients of the orbit and of h grow.
    states, h = where.orbit(x, side, max_order)
    speed = float(np.linalg.norm(states[:, 1]))
    size = speed * float(np.linalg.norm(where.at(x).gradient))
    if not (np.all(np.isfinite(states)) and np.all(np.isfinite(h))):
        raise PointError(
            f"point {x}: expected derivatives of h up to order {max_order}, received NaN or inf. "
            "The field is not that smooth here; lower max_order."
        )
    k = side_index(side)
    rests = equilibrium_distance(where.at(x).fields[k], where.jacobians(x)[k], x) <= TOLERANCE
    if rests:
        h[1:] = 0.0
    elif size > 0:
        powers = 1.0 / np.arange(1, max_order)
        growth = np.maximum(np.linalg.norm(states[:, 2:], axis=0) / speed, np.abs(h[2:]) / size)
        rate = float(np.max(growth**powers))
        with np.errstate(under="ignore"):
            small = np.abs(h[1:]) <= tol * size * rate ** np.arange(max_order)
        h[1:][small] = 0.0
    return h * np.array([math.factorial(k) for k in range(max_order + 1)])


def bend(numbers: Numbers, k: int, second: float) -> float:
    """Curvature of an orbit of field k against the surface, times 1 + |x|: zero at a cusp."""
    speed, slope = float(np.linalg.norm(numbers.fields[k])), float(np.linalg.norm(numbers.gradient))
    return abs(second) / (speed**2 * slope) * (1 + float(np.linalg.norm(numbers.x)))


def _kind(order: int | None, value: float, side: Side) -> str:
    if order == 2:
        return "visible" if (value > 0) == (side == "+") else "invisible"
    return "cusp" if order == 3 else "degenerate"


def fold_at(where: LocalSurface, found: Found, side: Side, max_order: int, tol: float) -> Fold:
    """Describe the fold at a point where L_i h = 0."""
    lie = contact(where, found.x, side, max_order, tol)
    lie[1] = 0.0
    nonzero = np.flatnonzero(lie[2:])
    order = int(nonzero[0]) + 2 if nonzero.size else None
    kind = _kind(order, float(lie[order]) if order else 0.0, side)
    other = float(where.at(found.x).lie[1 - side_index(side)])
    x = found.x[: where.system.dimension]
    return Fold(x, side, order, kind, lie, other, **found.effort)


def _check_order(max_order: int) -> None:
    if isinstance(max_order, bool) or not isinstance(max_order, int) or max_order < 2:
        raise DefinitionError(f"max_order: expected a whole number >= 2, received {max_order!r}.")


@with_discrete_states_held
def fold(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    side: Side = "+",
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    max_order: int = 6,
    tol: float = TOLERANCE,
) -> Fold:
    """Describe the tangency at a point where one field is tangent to the surface.

    Parameters
    ----------
    system, point, parameters, t, surface, mode, tol
        As in :func:`region`.
    side : {"+", "-"}
        Whose field: ``"+"`` is $F1$ (above), ``"-"`` is $F2$ (below).
    max_order : int, optional
        Highest order of contact to compute, at least 2.

    Returns
    -------
    Fold
        The tangency: its side, its order and whether it is visible.

    Raises
    ------
    PointError
        The field is not tangent there (angle above ``tol``), and as in :func:`region`.
    DefinitionError
        As in :func:`region`; a surface on which nothing slides; a ``side`` that is none; ``max_order`` below 2.
    ParameterError, OptionError
        As in :func:`region`.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[1, x], below=[0, 1])
    >>> print(fold(s, [0, 0]))
    F1 (above) at [0.0, 0.0]: visible fold of order 2, L^2 h = 1.
    """
    k = side_index(side)
    _check_order(max_order)
    where, x = surface_at(system, point, parameters, t, surface, mode)
    require_generic(where.system, where.surface, where.mode, "fold")
    numbers = on_surface(where, x, positive(tol, "tol"))
    if abs(numbers.angles[k]) > tol:
        raise PointError(
            f"point {x}: expected L{k + 1} = 0, the field {FIELDS[side]} tangent to the surface, "
            f"received L{k + 1} = {numbers.lie[k]:.6g}. find_fold(system, near=point) goes to the "
            "nearest fold."
        )
    length = float(np.linalg.norm(numbers.lie_gradients[k])) or 1.0
    residual = max(numbers.distance, abs(float(numbers.lie[k])) / length)
    return fold_at(where, Found(x, residual=residual), side, max_order, tol)


@with_discrete_states_held
def find_fold(
    system: FilippovSystem,
    near: ArrayLike,
    *,
    side: Side = "+",
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    hold: Sequence[str] = (),
    max_order: int = 6,
    tol: float = 1e-12,
    max_iterations: int = 50,
) -> Fold:
    """Find a fold close to a point: $h = 0$ and $L_i h = 0$.

    Newton's method with exact gradients and least-norm steps. For $n > 2$ folds form a set of
    dimension n - 2; the one found is near the start, not exactly the nearest. A cusp of a planar
    system is a double root: it is found to about 1e-8 and named.

    Parameters
    ----------
    system, parameters, t, surface, mode
        As in :func:`region`; the point need not be on the surface.
    near : array_like (n,)
        Where the search starts.
    side : {"+", "-"}, optional
        Whose fold: of $F1$ or $F2$.
    hold : sequence of str, optional
        Names of states that keep their value.
    max_order : int, optional
        Highest order of contact to compute.
    tol : float, optional
        Accepted residual (a distance), relative to $1 + |x|$; the search itself goes to rounding.
    max_iterations : int, optional
        Newton's method gives up after this many.

    Returns
    -------
    Fold
        The fold, with its distance from the start of the search.

    Raises
    ------
    ConvergenceError
        Newton's method does not converge from this start; ``residual`` and ``point`` are the last ones.
    DefinitionError
        Vector multipliers; no surface, or one on which nothing slides; a ``mode``, ``surface``, ``side`` or
        state to ``hold`` that the system does not have; ``max_order`` below 2.
    PointError
        A start of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` or ``max_iterations`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[1, ca.sin(x)], below=[0, 1])
    >>> print(find_fold(s, [3.0, 0.1]).kind, find_fold(s, [0.2, 0.1]).kind)
    invisible visible
    """
    _check_order(max_order)
    where, x = surface_at(system, near, parameters, t, surface, mode, search=True)
    free = unknowns(system, hold, 2, "fold")
    require_generic(where.system, where.surface, where.mode, "fold")
    return tangency_near(where, x, side, free, max_order, tol, max_iterations)


def tangency_near(
    where: LocalSurface,
    x: Array,
    side: Side,
    free: Sequence[int],
    max_order: int,
    tol: float = 1e-12,
    max_iterations: int = 50,
) -> Fold:
    """Find where one field is tangent to the surface, changing the states ``free`` only."""
    k, everywhere = side_index(side), where.free

    def equations(u: Array) -> tuple[Array, Array]:
        numbers = everywhere.at(u)
        values = np.array([numbers.h, numbers.lie[k]])
        return values, np.vstack([numbers.gradient, numbers.lie_gradients[k]])

    what = f"fold of {FIELDS[side]}"
    found = search(
        where.with_kept(equations), x, free, tol=tol, max_iterations=max_iterations, what=what
    )
    # a multiple root is a cusp or worse, known to the square root of rounding only
    return fold_at(where, found, side, max_order, 1e-5 if found.linear else TOLERANCE)
