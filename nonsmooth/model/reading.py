"""Reading of expressions that a user gave: scalars, columns, matrices, symbols."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain, islice
from typing import Any, NoReturn

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


def items_of(values: Any, kind: type[Any], what: str, form: str = "function, ...") -> list[Any]:
    """Read one object of a class or a sequence of them; ``form`` is how one is written."""
    items = [values] if isinstance(values, kind) else listed(values)
    for i, item in enumerate(items):
        if not isinstance(item, kind):
            raise DefinitionError(
                f"{what}[{i}]: expected a {kind.__name__}, received {item!r} ({type(item).__name__}). Write "
                f"{what}=[nonsmooth.{kind.__name__}({form})]."
            )
    return items


def scalar(value: Any, what: str) -> ca.SX:
    """Read a scalar expression or number."""
    return _without_calls(_scalar(value, what), what)


def _scalar(value: Any, what: str) -> ca.SX:
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
            else _scalar(value, "expression")
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
    entries = [_scalar(v, f"{what}[{i}]") for i, v in enumerate(items)]
    if _calls(ca.vertcat(*entries)):
        entries = [_without_calls(e, f"{what}[{i}]") for i, e in enumerate(entries)]
    return ca.vertcat(*entries)


def _without_calls(expression: ca.SX, what: str) -> ca.SX:
    """Write out the Functions that an expression calls; refuse those that are not SX operations."""
    if not _calls(expression):
        return expression
    inputs = ca.symvar(expression)
    function = ca.Function("expression", inputs, [expression])
    (entries,) = _outputs_of(function, [[s] for s in inputs], what)
    return ca.SX(expression.sparsity(), ca.vertcat(*entries))


def refuse_call(function: ca.Function, what: str) -> NoReturn:
    """Refuse a Function that is no graph of SX operations."""
    advice = (
        "Make it of SX symbols, or without never_inline=True."
        if function.class_name() == "MXFunction"
        else "Write it with SX operations; a table (casadi.interpolant) is nonsmooth.table(x, xs, ys), "
        "in FilippovSystem.from_expression."
    )
    raise DefinitionError(
        f"{what}: the expression calls the CasADi Function {function.name()!r} "
        f"({function.class_name()}), whose operations cannot be read. {advice}"
    )


def _calls(expression: ca.SX) -> bool:
    """Whether an expression calls Functions that CasADi has not inlined (tables, never_inline)."""
    if expression.is_constant():
        return False
    function = ca.Function("expression", [], [expression], {"allow_free": True})
    return bool(function.find_functions())


def _outputs_of(
    function: ca.Function, inputs: Sequence[Sequence[ca.SX]], what: str
) -> list[list[ca.SX]]:
    """Nonzeros of the outputs of a Function, with the Functions it calls written out."""
    if function.class_name() != "SXFunction":
        refuse_call(function, what)
    nodes, register = ca.vertsplit(function.instructions_sx()), dict[int, ca.SX]()
    outputs = [[ca.SX(0)] * function.nnz_out(k) for k in range(function.n_out())]
    for k, node in enumerate(nodes):
        op = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_CONST:
            register[target[0]] = ca.SX(function.instruction_constant(k))
        elif op == ca.OP_INPUT:
            register[target[0]] = inputs[source[0]][source[1]]
        elif op == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = register[source[0]]
        elif op == ca.OP_CALL:
            called, rest = node.which_function(), iter([register[a] for a in source])
            given = [list(islice(rest, called.nnz_in(i))) for i in range(called.n_in())]
            results = chain.from_iterable(_outputs_of(called, given, what))
            register.update(zip(target, results, strict=True))
        else:
            args = [register[a] for a in source]
            register[target[0]] = (ca.SX.unary if len(args) == 1 else ca.SX.binary)(op, *args)
    return outputs


def symbols(values: Any, what: str) -> ca.SX:
    """Read scalar symbols as a column."""
    items = listed(values)
    for i, item in enumerate(items):
        if not (isinstance(item, ca.SX) and item.is_scalar() and item.is_symbolic()):
            raise DefinitionError(
                f"{what}[{i}]: expected a scalar symbol made by casadi.SX.sym, received {item!r} "
                f"({type(item).__name__}). Expressions and strings are not symbols; FilippovSystem.from_dae reads a "
                "dictionary with 'x' and 'ode'."
            )
    return ca.vertcat(*items) if items else ca.SX(0, 1)


def require_unique(symbols: ca.SX) -> None:
    """Refuse symbols of one name."""
    names = [str(s) for s in ca.vertsplit(symbols)]
    twice = sorted(n for n, times in Counter(names).items() if times > 1)
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
            else "It is the multiplier of a Friction: give that in surfaces=."
            if any(str(s).startswith("friction(") for s in foreign)
            else "It is the phase of a Clock: give that in clocks=."
            if any(str(s).endswith("_phase") for s in foreign)
            else "Add it to states=, parameters= or time=, or give it a number."
        )
        raise DefinitionError(
            f"{what}: it contains {[str(s) for s in foreign]}, but the states are {list(states)} and "
            f"the parameters {list(parameters)}. {cause}"
        )
