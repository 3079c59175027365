"""Measured curves: a table of values as an expression whose breakpoints are switches of the class they have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..errors import DefinitionError
from ..expressions.graph import evaluate, instructions
from ..reading import Expression, scalar
from ..values import Array

#: Most breakpoints, each a surface.
_MOST = 500

#: Jumps of a derivative below this part of it are rounding.
_ROUNDING = 1e-12

#: Part of the largest value that values may be off by.
_LOST = 1e-9

Bounds = tuple[float, float]


def table(
    argument: Expression,
    xs: ArrayLike,
    ys: ArrayLike,
    order: Literal[1, 3] = 1,
    outside: Literal["constant", "linear"] = "constant",
) -> ca.SX:
    """Interpolate a table, for use in ``FilippovSystem.from_expression``.

    Nothing is interpolated behind the solver's back: a run stops at each breakpoint that it passes, where the
    curve has a kink (order 1) or a jump of its third derivative (order 3). Breakpoints that the argument cannot
    pass, as that at 0 of the absolute value of something, are none.

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
    outside : {"constant", "linear"}, optional
        Beyond the ends: the last value, or the last slope. A spline has the slope zero at its ends for the first,
        the curvature zero for the second.

    Returns
    -------
    SX
        The expression, with ``fmax`` of the argument and the breakpoints.

    Raises
    ------
    DefinitionError
        Values that are not finite, not increasing, too few or of different lengths; another order or outside;
        more than 500 breakpoints, or breakpoints with which the values lose their digits.

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
    if outside not in ("constant", "linear"):
        raise DefinitionError(
            f"outside of the table: expected 'constant' or 'linear', received {outside!r}. A Stop at the first or "
            "last breakpoint ends a run there."
        )
    pieces, (low, high) = _pieces(x, y, order, outside), _bounds_of(e)
    first = int(np.searchsorted(x, low, side="right"))  # the piece at the lowest argument
    last = int(np.searchsorted(x, high))
    jumps = [_jump(pieces, x, k, order, outside) for k in range(first, last)]
    u = ca.SX.sym("u")
    curve = _polynomial(pieces[first], u - x[max(first - 1, 0)])
    for k, jump in enumerate(jumps, first):
        if jump.any():
            curve += _polynomial(jump, ca.fmax(u - x[k], 0))
    _require_exact(ca.Function("table", [u], [curve]), pieces, x, first, last)
    return ca.substitute(curve, u, e)


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
    if len(x) > _MOST:
        raise DefinitionError(
            f"table: expected at most {_MOST} breakpoints, received {len(x)}. Fit a spline of fewer, or a formula."
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
        pieces[-1, 1] = _moved(pieces[-2], x[-1] - x[-2])[1]
    return pieces


def _jump(pieces: Array, x: Array, k: int, order: int, outside: str) -> Array:
    """What a breakpoint adds, from its first derivative that can jump on."""
    before = _moved(pieces[k], x[k] - x[max(k - 1, 0)])
    jump = pieces[k + 1] - before
    jump[np.abs(jump) <= _ROUNDING * (np.abs(before) + np.abs(pieces[k + 1]))] = 0.0
    at_end = k in (0, len(x) - 1) and outside == "constant"
    jump[: 1 if order == 1 else 2 if at_end else 3] = 0.0
    return jump


def _require_exact(curve: ca.Function, pieces: Array, x: Array, first: int, last: int) -> None:
    """Refuse tables whose terms, added up, lose the digits of the values."""
    if last - first < 1:
        return
    ends = np.concatenate([[2 * x[0] - x[1]], x, [2 * x[-1] - x[-2]]])
    at = np.concatenate(
        [ends[first : last + 2], (ends[first : last + 1] + ends[first + 1 : last + 2]) / 2]
    )
    which = np.searchsorted(x, at, side="right")
    exact = np.array(
        [_moved(pieces[k], u - x[max(k - 1, 0)])[0] for k, u in zip(which, at, strict=True)]
    )
    wrong = float(np.abs(np.array(curve(at[None, :])).ravel() - exact).max())
    size = float(np.abs(exact).max())
    if wrong > _LOST * size:
        raise DefinitionError(
            f"table: added up piece by piece its values are known to {wrong:.1e} only, of {size:.1e}: it has "
            "too many breakpoints for a spline, or some too close together. Use fewer, or order=1."
        )


def _moved(c: Array, by: float) -> Array:
    """Coefficients of a cubic about a point further on."""
    a0, a1, a2, a3 = c
    return np.array(
        [
            a0 + by * (a1 + by * (a2 + by * a3)),
            a1 + by * (2 * a2 + 3 * a3 * by),
            a2 + 3 * a3 * by,
            a3,
        ]
    )


def _polynomial(c: Array, u: ca.SX) -> ca.SX:
    result = ca.SX(0)
    for a in c[::-1]:
        result = result * u + float(a)
    return result


# What an argument can be --------------------------------------------------------------------------


def _bounds_of(e: ca.SX) -> Bounds:
    """Bounds of an expression whatever its symbols are."""
    nodes, rows = instructions([ca.vertcat(*ca.symvar(e))], [e])
    return evaluate(nodes, _Bounds())[rows[0][0]]


class _Bounds:
    """The algebra of bounds; what is not known is not bounded."""

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
