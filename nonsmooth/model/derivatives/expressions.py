"""Expressions in states, parameters and time, given as graphs or as text, with their gradients."""

from __future__ import annotations

import ast
from typing import Any

import casadi as ca

from ..definition.system import FilippovSystem
from ..errors import DefinitionError
from ..laws.switches import Guard
from .event_maps import EventMap
from .forcing import is_function

_FUNCTIONS = {
    name: getattr(ca, name) for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "fabs", "tanh")
} | {"abs": ca.fabs}
_OPERATORS: dict[type, Any] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}


def expression_map(system: FilippovSystem, value: Any) -> EventMap:
    """An expression as a map on the extended states: its value and its gradients."""
    expression = _parsed(system, value) if isinstance(value, str) else value
    if is_function(expression):
        try:
            found = EventMap(system, system.extended_states, expression, Guard("zero", 0, 0, 0))
            found.values  # noqa: B018  # fails for symbols of no system
            return found
        except RuntimeError:
            pass
    names = [*system.state_names, *system.parameter_names]
    raise DefinitionError(
        f"{value!r} is no scalar expression of the system. Write one in its names {names}, such as "
        f"'{names[0]}**2', or as a CasADi expression in its symbols."
    )


def _parsed(system: FilippovSystem, text: str) -> Any:
    """The graph of a text; None if it is no expression in the names of the system."""
    names = dict(zip(system.state_names, ca.vertsplit(system.extended_states), strict=False))
    names |= dict(zip(system.parameter_names, ca.vertsplit(system.parameter_symbols), strict=True))
    if system.time_dependent:
        names |= {str(system.definition.time): system.definition.time}

    def read(node: ast.AST) -> Any:
        if isinstance(node, ast.Expression):
            return read(node.body)
        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
            return ca.SX(node.value)
        if isinstance(node, ast.Name):
            return names[node.id]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return -read(node.operand)
        if isinstance(node, ast.BinOp):
            return _OPERATORS[type(node.op)](read(node.left), read(node.right))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            return _FUNCTIONS[node.func.id](*map(read, node.args))
        raise KeyError(node)

    try:
        return read(ast.parse(text, mode="eval"))
    except (SyntaxError, KeyError, TypeError, NotImplementedError):
        return None
