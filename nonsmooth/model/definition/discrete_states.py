"""Discrete states: comparisons of them in a field, as polynomials that agree at all values, and systems with fixed values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any

import casadi as ca

from ..checks import real
from ..errors import DefinitionError, PointError
from ..expressions.graph import NOT_SMOOTH, Expressions, evaluate, instructions, operation, shaped

if TYPE_CHECKING:
    from .parse_definition import Definition

_NONE = ca.SX(0, 1)


def held_values(d: Definition, values: Mapping[Any, float]) -> list[float]:
    """Numbers for all discrete states, in their order; keys are symbols or names."""
    names = d.names["states"][d.states.numel() - len(d.discrete) :]
    if not isinstance(values, Mapping):
        raise DefinitionError(
            f"values: expected a mapping of discrete states to numbers, received {values!r}. Write holding({{'q': 0}})."
        )
    given = {
        str(key): real(v, f"discrete state {key}", error=PointError) for key, v in values.items()
    }
    if not names or set(given) != set(names):
        raise DefinitionError(
            f"values: expected a number for each discrete state of {names}, received {sorted(given)}."
            + (f" Write holding({{{names[0]!r}: 0}})." if names else " The system has none.")
        )
    for name, allowed in zip(names, d.discrete, strict=True):
        require_allowed(name, given[name], allowed)
    return [given[name] for name in names]


def require_allowed(
    name: str, value: float, allowed: tuple[float, ...] | None, where: str = ""
) -> None:
    """Refuse a value that a discrete state does not have."""
    if allowed is not None and value not in allowed:
        raise PointError(
            f"{where}{name} = {value:g}, but the discrete state {name} has the values {allowed}. Give one of them."
        )


def with_values(d: Definition, values: list[float]) -> Definition:
    """The definition with numbers in place of its discrete states, without stops, resets and clocks."""
    count = d.states.numel() - len(values)
    still = d.states[count:]

    def put(expressions: ca.SX) -> ca.SX:
        return (
            ca.substitute(expressions, still, ca.DM(values)) if expressions.numel() else expressions
        )

    parts = {name: put(getattr(d, name)) for name in ("surfaces", "gaps", "restitutions")}
    events = dict.fromkeys(("guards", "whens", "priorities", "periods"), _NONE)
    return replace(
        d,
        states=d.states[:count],
        field=put(d.field)[:count],
        **parts,
        **events,
        maps=ca.horzcat(),
        stops=(),
        resets=(),
        rules=(),
        clocks=(),
        discrete=(),
        renamed=(),
    )


# Comparisons in a field -----------------------------------------------------------------------------

#: Most combinations of values by which one comparison is replaced.
_MOST = 1000

#: Logic of conditions that are 0 or 1.
_LOGIC: dict[str, Callable[..., ca.SX]] = {
    "and": lambda a, b: a * b,
    "or": lambda a, b: a + b - a * b,
    "not": lambda a: 1 - a,
}

Values = Mapping[Any, tuple[float, ...] | None]


def without_choices(expression: Any, values: Values, what: str) -> Any:
    """An expression whose comparisons of discrete states alone are polynomials of these."""
    if not isinstance(expression, (ca.SX, Sequence)) or isinstance(expression, str):
        return expression
    if not isinstance(expression, ca.SX):
        return [without_choices(one, values, what) for one in expression]
    if not all(isinstance(s, ca.SX) and s.is_symbolic() for s in values):
        return expression  # the definition refuses them
    still = ca.vertcat(*values)
    if not ca.depends_on(expression, still):
        return expression
    inputs = [ca.vertcat(*ca.symvar(expression))]
    nodes, rows = instructions(inputs, [expression])
    if all(node.op not in NOT_SMOOTH for node in nodes):
        return expression
    found = evaluate(nodes, _Polynomials(inputs[0], values, what))
    return shaped([expression], [found[k] for k in rows[0]])[0]


class _Polynomials(Expressions):
    """The algebra of expressions in which choices by discrete states are polynomials of these."""

    def __init__(self, symbols: ca.SX, values: Values, what: str):
        super().__init__([symbols])
        self._what = what
        self._mixed = set[int]()  # conditions of discrete states and of others
        self._values = {s.element_hash(): (s, own) for s, own in values.items()}

    def apply(self, op: str, args: Sequence[ca.SX]) -> ca.SX:
        if op == "if_else_zero" and self._is_discrete(args[:1]):
            return self._polynomial(args[0] != 0) * args[1]
        if op == "if_else_zero" and args[0].element_hash() in self._mixed:
            return args[0] * args[1]
        if op in NOT_SMOOTH and self._is_discrete(args):
            return self._polynomial(operation(op, args))
        if op in _LOGIC and any(
            self._is_discrete([a]) or a.element_hash() in self._mixed for a in args
        ):
            found = _LOGIC[op](*args)
            self._mixed.add(found.element_hash())
            return found
        return operation(op, args)

    def _is_discrete(self, args: Sequence[ca.SX]) -> bool:
        used = ca.symvar(ca.vertcat(*args))
        return bool(used) and all(s.element_hash() in self._values for s in used)

    def _polynomial(self, e: ca.SX) -> ca.SX:
        """The sum of the values of an expression times Lagrange's polynomials."""
        used = [self._values[s.element_hash()] for s in ca.symvar(e)]
        unknown = [str(s) for s, own in used if own is None]
        if unknown:
            raise DefinitionError(
                f"{self._what}: it compares the discrete state {unknown[0]}, whose values are not known. Give "
                f"them, as in discrete={{{unknown[0]}: (0, 1)}}."
            )
        choices = [own or () for _, own in used]
        if prod(map(len, choices)) > _MOST:
            raise DefinitionError(
                f"{self._what}: {e} chooses among more than {_MOST} values of discrete states. Split it up."
            )
        numbers = ca.Function("e", [ca.vertcat(*[s for s, _ in used])], [e])
        result = ca.SX(0)
        for point in product(*choices):
            factors = [
                (s - other) / (own - other)
                for (s, values), own in zip(used, point, strict=True)
                for other in values or ()
                if other != own
            ]
            result += float(numbers(list(point))) * prod(factors, start=ca.SX(1))
        return result
