"""Measured curves: a table of values as an expression whose breakpoints are switches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import DefinitionError
from ...expressions.graph import evaluate, instructions
from ...reading import Expression, scalar
from ...values import Array
from .curves import Curve

#: Jumps of a derivative below this part of it are rounding.
_ROUNDING = 1e-12

Bounds = tuple[float, float]


def table(
    argument: Expression,
    xs: ArrayLike,
    ys: ArrayLike,
    order: Literal[1, 3] = 1,
    outside: Literal["constant", "linear", "error"] = "constant",
) -> ca.SX:
    """Interpolate a table, for use in ``FilippovSystem.from_expression``.

    A step ends at each breakpoint that it passes, where the curve has a kink (order 1) or a jump of its third
    derivative (order 3). Breakpoints that the argument cannot pass, as 0 for an absolute value, are left out. A run
    has the cell of a table between two breakpoints as part of its state: the cost of a step does not depend on their
    number, nor does that of the derivatives of a leg
    (``sensitivity``, ``gradient``, ``vjp``, ``lyapunov_spectrum``). Elsewhere, as in ``periodic_orbit``, each breakpoint is
    a switch.

    Parameters
    ----------
    argument : expression
        Of states, parameters and time.
    xs : array_like (k,)
        Increasing, at least two.
    ys : array_like (k,)
        Values there.
    order : {1, 3}, optional
        Straight lines, or a cubic spline.
    outside : {"constant", "linear", "error"}, optional
        Beyond the ends: the last value, the last slope, or the end of the run (NOT_FINITE). A spline has the slope
        zero at its ends for the first, the curvature zero for the others.

    Returns
    -------
    SX
        The expression. Within another switch, as sign of a table, its breakpoints are switches one by one, and at
        most six.

    Raises
    ------
    DefinitionError
        Values that are not finite, not increasing, too few or of different lengths; another order or outside.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> spring = ns.table(x, [-1.0, 0.0, 2.0], [-3.0, 0.0, 1.0], outside="linear")
    >>> system = ns.FilippovSystem.from_expression([x, v], [v, -spring])
    >>> system
    FilippovSystem(2 states: x, v; 1 surface (continuous of order 1): x)
    """
    e = scalar(argument, "argument of the table")
    x, y = _read(xs, ys)
    if order not in (1, 3):
        raise DefinitionError(
            f"order of the table: expected 1 (straight lines) or 3 (a cubic spline), received {order!r}."
        )
    if outside not in ("constant", "linear", "error"):
        raise DefinitionError(
            f"outside of the table: expected 'constant', 'linear' or 'error', received {outside!r}."
        )
    pieces, (low, high) = _pieces(x, y, order, outside), _bounds_of(e)
    first = int(np.searchsorted(x, low, side="right"))  # the piece at the lowest argument
    last = int(np.searchsorted(x, high))
    if outside == "error" and (low >= x[-1] or high <= x[0]):
        raise DefinitionError(
            f"table: its argument is from {low:g} to {high:g}, and its breakpoints from {x[0]:g} to {x[-1]:g}, so that it "
            "has no value with outside='error'."
        )
    closed = (outside == "error" and first == 0, outside == "error" and last == len(x))
    jumps = _jumps(pieces, x, order, outside)
    is_kept = np.array(jumps != 0.0).any(axis=1) | _ends(len(x), closed)
    kept = first + np.flatnonzero(is_kept[first:last])
    cells = np.concatenate([[first], kept + 1])
    rows = np.column_stack([x[np.maximum(cells - 1, 0)], pieces[cells]])
    levels, own, jumped = x[kept].tolist(), rows.tolist(), jumps[kept].tolist()
    return Curve(tuple(levels), tuple(map(tuple, own)), tuple(map(tuple, jumped)), closed).marked(e)


def _ends(count: int, closed: tuple[bool, bool]) -> NDArray[np.bool_]:
    found = np.zeros(count, bool)
    found[[0, -1]] = closed
    return found


def _read(xs: ArrayLike, ys: ArrayLike) -> tuple[Array, Array]:
    try:
        x, y = np.array(xs, dtype=float), np.array(ys, dtype=float)
    except (TypeError, ValueError):
        raise DefinitionError("table: expected two lists of numbers, xs and ys.") from None
    if x.ndim != 1 or x.shape != y.shape or len(x) < 2:
        raise DefinitionError(
            f"table: expected as many xs as ys, at least two, received shapes {x.shape} and {y.shape}."
        )
    if not (np.isfinite(x).all() and np.isfinite(y).all() and (np.diff(x) > 0).all()):
        raise DefinitionError(
            "table: expected finite numbers, and xs that increase. Sort the table, and leave out points that are twice "
            "in it or not known."
        )
    return x, y


def _pieces(x: Array, y: Array, order: int, outside: str) -> Array:
    """Coefficients (k + 1, 4) of the polynomials before, between and after the breakpoints.

    Each is in the distance from the breakpoint before it, the first from the first breakpoint.
    """
    pieces = np.zeros((len(x) + 1, 4))
    pieces[0, 0], pieces[-1, 0] = y[0], y[-1]
    if order == 1:
        pieces[1:-1, 0], pieces[1:-1, 1] = y[:-1], np.diff(y) / np.diff(x)
    else:
        from scipy.interpolate import CubicSpline

        ends = "clamped" if outside == "constant" else "natural"
        pieces[1:-1] = CubicSpline(x, y, bc_type=ends).c[::-1].T
    if outside == "linear":
        pieces[0, 1] = pieces[1, 1]
        pieces[-1, 1] = _moved(pieces[-2:-1], x[-1:] - x[-2:-1])[0, 1]
    if outside == "error":  # the first and the last piece, up to the end of a step
        pieces[0], pieces[-1] = pieces[1], _moved(pieces[-2:-1], x[-1:] - x[-2:-1])[0]
    return pieces


def _jumps(pieces: Array, x: Array, order: int, outside: str) -> Array:
    """What each breakpoint adds (k, 4), from its first derivative that can jump on."""
    before = _moved(pieces[:-1], np.diff(x, prepend=x[0]))
    jumps = pieces[1:] - before
    jumps[np.abs(jumps) <= _ROUNDING * (np.abs(before) + np.abs(pieces[1:]))] = 0.0
    curvatures = jumps[[0, -1], 2]
    jumps[:, : 1 if order == 1 else 3] = 0.0
    if order == 3 and outside == "constant":
        jumps[[0, -1], 2] = curvatures
    if outside == "error":
        jumps[[0, -1]] = 0.0
    return jumps


def _moved(c: Array, by: Array) -> Array:
    """Coefficients (k, 4) of cubics about points further on (k,)."""
    a0, a1, a2, a3 = c.T
    moved = [
        a0 + by * (a1 + by * (a2 + by * a3)),
        a1 + by * (2 * a2 + 3 * a3 * by),
        a2 + 3 * a3 * by,
        a3,
    ]
    return np.stack(moved, axis=1)


# What an argument can be --------------------------------------------------------------------------


def _bounds_of(e: ca.SX) -> Bounds:
    """Bounds of an expression whatever its symbols are."""
    nodes, rows = instructions([ca.vertcat(*ca.symvar(e))], [e])
    return evaluate(nodes, _Bounds())[rows[0][0]]


class _Bounds:
    """The algebra of bounds; unknown operations are unbounded."""

    def constant(self, value: float) -> Bounds:
        return value, value

    def symbol(self, vector: int, position: int) -> Bounds:
        del vector, position
        return -math.inf, math.inf

    def apply(self, op: str, args: Sequence[Bounds]) -> Bounds:
        (a, b), (c, d) = args[0], args[-1]
        if op in ("sq", "fabs"):
            ends = (a * a, b * b) if op == "sq" else (abs(a), abs(b))
            return (0.0 if a <= 0 <= b else min(ends)), max(ends)
        if op in ("exp", "sqrt", "cosh"):
            return {"exp": 0.0, "sqrt": 0.0, "cosh": 1.0}[op], math.inf
        if op in ("sin", "cos", "tanh", "erf", "sign"):
            return -1.0, 1.0
        if op in ("add", "sub"):
            return (a + c, b + d) if op == "add" else (a - d, b - c)
        if op in ("neg", "twice"):
            return (-b, -a) if op == "neg" else (2 * a, 2 * b)
        if op in ("fmin", "fmax"):
            pick = min if op == "fmin" else max
            return pick(a, c), pick(b, d)
        if op == "mul":
            products = [0.0 if 0.0 in (p, q) else p * q for p in (a, b) for q in (c, d)]
            return min(products), max(products)
        return -math.inf, math.inf
