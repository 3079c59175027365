"""Reading of expressions that a user gave: scalars, columns, matrices, symbols."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from .errors import DefinitionError

Expression = Any  # a CasADi SX scalar, a number, or (for vectors) a sequence of these
Parameters = Mapping[Any, float | None]


#: Advice where a function was given instead of an expression.
_CALL = (
    " Call it with the symbols and give what it returns, field=f(x, v). Inside, symbols have no truth "
    "value: write casadi.if_else(x > 0, a, b) and use FilippovSystem.from_expression, not 'if'."
)


def listed(value: Any) -> list[Any]:
    """Return a list of what a user gave: one item, a vector, a sequence, or None for an empty one."""
    if value is None:
        return []
    if isinstance(value, (ca.SX, ca.DM)):
        return ca.vertsplit(ca.vec(ca.SX(value))) if value.numel() else []
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        return [value]
    return list(value)


def scalar(value: Any, what: str) -> ca.SX:
    """Read a scalar expression or number."""
    if isinstance(value, ca.MX):
        raise DefinitionError(
            f"{what}: expected CasADi SX expressions, received MX. Make the symbols with "
            "casadi.SX.sym."
        )
    try:
        result = ca.SX(value) if isinstance(value, (ca.SX, ca.DM)) else ca.SX(float(value))
    except (TypeError, ValueError, NotImplementedError) as error:
        raise DefinitionError(
            f"{what}: expected a CasADi SX expression or a number, received {value!r} "
            f"({type(value).__name__}).{_CALL if callable(value) else ''}"
        ) from error
    if result.shape != (1, 1):
        raise DefinitionError(f"{what}: expected a scalar, received shape {result.shape}.")
    return ca.densify(result)


def matrix(value: Any) -> ca.SX:
    """Read an expression of any shape: an SX, or a (nested) sequence of scalars."""
    if not isinstance(value, (list, tuple, np.ndarray)):
        return (
            ca.densify(ca.SX(value))
            if isinstance(value, (ca.SX, ca.DM))
            else scalar(value, "expression")
        )
    return ca.densify(ca.vertcat(*[matrix(v).T for v in value]))


def column(values: Any, what: str, length: int) -> ca.SX:
    """Read ``length`` scalars as a column."""
    if values is None:
        raise DefinitionError(
            f"{what}: expected {length} expressions, received none. Give above= and below= with "
            "surface=, or field= with multipliers= and surfaces=."
        )
    if callable(values):
        raise DefinitionError(
            f"{what}: expected {length} expressions, received the function {values!r}.{_CALL}"
        )
    items = listed(values)
    if len(items) != length:
        expected = "one expression" if length == 1 else f"{length} expressions, one for each state"
        raise DefinitionError(
            f"{what}: expected {expected}, received {len(items)}. The order is that of the states."
        )
    return ca.vertcat(*[scalar(v, f"{what}[{i}]") for i, v in enumerate(items)])


def symbols(values: Any, what: str) -> ca.SX:
    """Read scalar symbols as a column."""
    items = listed(values)
    for i, item in enumerate(items):
        if not (isinstance(item, ca.SX) and item.is_scalar() and item.is_symbolic()):
            raise DefinitionError(
                f"{what}[{i}]: expected a scalar symbol made by casadi.SX.sym, received {item!r} "
                f"({type(item).__name__}). MX symbols, expressions and strings are not symbols."
            )
    return ca.vertcat(*items) if items else ca.SX(0, 1)


def require_unique(symbols: ca.SX) -> None:
    """Refuse symbols of one name."""
    names = [str(s) for s in ca.vertsplit(symbols)]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise DefinitionError(
            f"symbols: expected one name for each state, parameter, multiplier and time, received "
            f"{twice} more than once. Names are how parameters are set and results are labelled."
        )


def require_known(
    expression: ca.SX, known: ca.SX, what: str, states: Sequence[str], parameters: Sequence[str]
) -> None:
    """Refuse symbols other than ``known``, whose names are listed in the message."""
    present = ca.symvar(expression)
    listed = ca.vertsplit(known)
    own = {k.element_hash() for k in listed}
    foreign = [s for s in present if s.element_hash() not in own]
    if foreign:
        names = {str(k) for k in listed}
        clash = [str(s) for s in foreign if str(s) in names]
        cause = (
            f"{clash} has the name of a declared symbol but is another symbol: create each symbol "
            "once and reuse it."
            if clash
            else "Add it to states=, parameters= or time=, or give it a number."
        )
        raise DefinitionError(
            f"{what}: it contains {[str(s) for s in foreign]}, but the states are {list(states)} and "
            f"the parameters {list(parameters)}. {cause}"
        )


def require_finite(expression: ca.SX, known: ca.SX, what: str) -> None:
    """Refuse NaN and infinite constants."""
    f = ca.Function("constants", [known], [expression])
    for k in range(f.n_instructions()):
        if f.instruction_id(k) == ca.OP_CONST and not math.isfinite(f.instruction_constant(k)):
            raise DefinitionError(
                f"{what}: expected finite constants, received {f.instruction_constant(k)} in "
                f"{expression}. Functions of Python's math turn a symbol into NaN: write casadi.sin(x), "
                "not math.sin(x)."
            )
