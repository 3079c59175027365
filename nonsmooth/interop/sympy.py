"""Systems from equations in SymPy."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import casadi as ca

from ..model import DefinitionError, FilippovSystem
from ..result_tables import library

__all__ = ["expression", "system"]

#: Functions of SymPy, by class, in CasADi.
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{
        name: getattr(ca, name)
        for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log")
    },
    **{
        name: getattr(ca, name)
        for name in ("asin", "acos", "atan", "asinh", "acosh", "atanh", "atan2")
    },
    **{"sign": ca.sign, "Abs": ca.fabs, "floor": ca.floor, "ceiling": ca.ceil, "erf": ca.erf},
    "Heaviside": lambda x, *at_zero: (1 + ca.sign(x)) / 2,
    "Add": lambda *terms: reduce(operator.add, terms),
    "Mul": lambda *factors: reduce(operator.mul, factors),
    "Max": lambda *values: reduce(ca.fmax, values),
    "Min": lambda *values: reduce(ca.fmin, values),
    "And": lambda *parts: reduce(ca.logic_and, parts),
    "Or": lambda *parts: reduce(ca.logic_or, parts),
    "Not": ca.logic_not,
    **{"StrictLessThan": operator.lt, "LessThan": operator.le},
    **{"StrictGreaterThan": operator.gt, "GreaterThan": operator.ge},
    **{"Equality": operator.eq, "Unequality": operator.ne},
}


def expression(value: Any, symbols: Mapping[Any, ca.SX]) -> ca.SX:
    """A SymPy expression in CasADi, as for the ``stops`` and ``resets`` of a system.

    Parameters
    ----------
    value : sympy expression
        Arithmetic, elementary functions, sign, Abs, Max, Min, Heaviside, Piecewise, comparisons.
    symbols : mapping
        CasADi's symbol for each symbol, or function of time, of SymPy.

    Returns
    -------
    casadi.SX
        The same expression.

    Raises
    ------
    DefinitionError
        A symbol that is not in ``symbols``, or a function without a counterpart.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns, sympy
    >>> x = sympy.Symbol("x")
    >>> ns.interop.sympy.expression(2 * x + sympy.Abs(x), {x: ca.SX.sym("x")})
    SX(((2.*x)+fabs(x)))
    """
    sympy = library("sympy", "interop.sympy", "sympy")
    value, read = sympy.sympify(value), lambda part: expression(part, symbols)
    if value in symbols:
        return ca.SX(symbols[value])
    if value in (sympy.true, sympy.false) or (value.is_number and value.is_real):
        return ca.SX(float(value))
    if isinstance(value, sympy.Pow):
        root = value.exp == sympy.Rational(1, 2)
        return ca.sqrt(read(value.base)) if root else read(value.base) ** read(value.exp)
    if isinstance(value, sympy.Piecewise):
        if value.args[-1][1] != sympy.true:
            raise DefinitionError(f"{value} has no value in some cases. End it with (value, True).")
        found = read(value.args[-1][0])
        for part, condition in reversed(value.args[:-1]):
            found = ca.if_else(read(condition), read(part), found)
        return found
    made = _FUNCTIONS.get(type(value).__name__)
    if made is None:
        what = (
            "is no state, parameter or time" if value.is_Symbol else "has no counterpart in CasADi"
        )
        raise DefinitionError(f"{value} {what}. Known are {[str(name) for name in symbols]}.")
    return ca.SX(made(*map(read, value.args)))


def system(
    equations: Mapping[Any, Any],
    parameters: Mapping[Any, float] | None = None,
    *,
    time: Any = None,
) -> FilippovSystem:
    """System of equations in SymPy; sign, Abs, Max, Min, Heaviside and Piecewise become its surfaces.

    Parameters
    ----------
    equations : mapping
        The right-hand side of each state: a symbol ``x``, a function ``x(t)`` or ``Derivative(x(t), t)``.
    parameters : mapping, optional
        Default values by symbol.
    time : symbol, optional
        The time, where right-hand sides depend on it; that of ``x(t)`` is known.

    Returns
    -------
    FilippovSystem
        As from :meth:`FilippovSystem.from_expression`, with states and parameters under their names in SymPy.

    Raises
    ------
    DefinitionError
        A symbol that is no state, parameter or time, or a function without a counterpart in CasADi.

    Examples
    --------
    >>> import nonsmooth as ns, sympy
    >>> x, v, mu = sympy.symbols("x v mu")
    >>> ns.interop.sympy.system({x: v, v: -x - mu * sympy.sign(v)}, {mu: 0.5})
    FilippovSystem(2 states: x, v; 1 surface: v; parameters: mu)
    """
    sympy = library("sympy", "interop.sympy", "sympy")
    if not isinstance(equations, Mapping):
        raise DefinitionError(
            f"equations: expected a mapping from states to right-hand sides, received {equations!r}."
        )
    parameters = {sympy.sympify(key): value for key, value in (parameters or {}).items()}
    given = {sympy.sympify(key): value for key, value in equations.items()}
    plain = lambda key: key.expr if isinstance(key, sympy.Derivative) else key
    states = {plain(key): value for key, value in given.items()}
    times = {time} if time is not None else {key.args[0] for key in states if key.args}
    if len(times) > 1:
        raise DefinitionError(f"equations have the times {sorted(map(str, times))}. Give one.")
    named = lambda key: ca.SX.sym(key.func.__name__ if key.args else key.name)
    symbols = {key: named(key) for key in [*states, *parameters, *times]}
    rates = [expression(value, symbols) for value in states.values()]
    clock = next(
        (symbols[key] for key in times if ca.depends_on(ca.vertcat(*rates), symbols[key])), None
    )
    return FilippovSystem.from_expression(
        [symbols[key] for key in states],
        rates,
        parameters={symbols[key]: value for key, value in parameters.items()},
        time=clock,
    )
