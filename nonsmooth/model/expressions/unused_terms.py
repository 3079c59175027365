"""Drop terms whose multiplier is zero in a mode, so that log or sqrt is not evaluated off its domain.

One program serves all modes, with the multipliers as numbers: a field log(1 - x) of one side is in it as
(1 - lambda)/2 log(1 - x), and 0 times NaN would be NaN. So a product that vanishes for a value of a multiplier
in some mode is zero where that factor is, if the other factor may be undefined.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca

from .float_arithmetic import BINARY, UNARY
from .graph import Node, evaluate, instructions, operation, shaped

#: Operations that have a finite value wherever their arguments have one of moderate size.
SAFE = frozenset(
    "assign neg twice sq add sub mul sin cos atan tanh asinh erf sign fabs fmin fmax copysign lt le eq ne not "
    "and or".split()
)

_ALL: dict[str, Callable[..., float]] = {**UNARY, **BINARY}
_VALUES = {op: _ALL[op] for op in "assign neg twice sq add sub mul".split()}

Side = tuple[int, float]  # index of a multiplier and its value


@dataclass(frozen=True)
class _Term:
    """An expression, whether it may be undefined, and its values at fixed multipliers."""

    e: ca.SX
    partial: bool = False
    always: float | None = None
    at: dict[Side, float] = field(default_factory=dict)

    def value(self, side: Side) -> float | None:
        return self.at.get(side, self.always)


def without_unused_terms(
    inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], held: Mapping[int, Sequence[float]]
) -> list[ca.SX]:
    """Return expressions whose unused terms are zero even where their functions are undefined."""
    if not held:
        return list(outputs)
    nodes, rows = instructions(inputs, outputs)
    if all(_is_safe(node, nodes) for node in nodes):
        return list(outputs)
    algebra = _Sides(inputs, held)
    terms = evaluate(nodes, algebra)
    if not algebra.found:
        return list(outputs)
    return shaped(outputs, [terms[j].e for row in rows for j in row])


def _is_safe(node: Node, nodes: Sequence[Node]) -> bool:
    """Whether a node has a finite value wherever its arguments have one of moderate size."""
    divisor = nodes[node.args[1]] if node.op == "div" else None
    by_number = divisor is not None and divisor.op == "const" and divisor.payload != 0.0
    return by_number or node.op in SAFE or node.op in ("const", "input")


class _Sides:
    """The algebra of expressions with their values at fixed multipliers."""

    def __init__(self, inputs: Sequence[ca.SX], held: Mapping[int, Sequence[float]]):
        self._inputs, self._held = inputs, held
        self.found = False

    def constant(self, value: float) -> _Term:
        return _Term(ca.SX(value), always=value)

    def symbol(self, vector: int, position: int) -> _Term:
        e = self._inputs[vector][position]
        values = () if vector else self._held.get(position, ())
        return _Term(e, at={(position, value): value for value in values})

    def apply(self, op: str, args: Sequence[_Term]) -> _Term:
        e = operation(op, [a.e for a in args])
        safe = op in SAFE or (op == "div" and bool(args[1].always))
        partial = not safe or any(a.partial for a in args)
        at = self._values(op, args)
        if partial and op in ("mul", "div"):
            e = self._guarded(op, e, args)
        return _Term(e, partial, at=at)

    def _values(self, op: str, args: Sequence[_Term]) -> dict[Side, float]:
        found: dict[Side, float] = {}
        for side in {side: None for a in args for side in a.at}:
            values = [a.value(side) for a in args]
            if (op == "mul" and 0.0 in values) or (op == "div" and values[0] == 0.0):
                found[side] = 0.0
            elif op == "div" and None not in values and values[1]:
                found[side] = values[0] / values[1]  # type: ignore[operator]
            elif op in _VALUES and None not in values:
                found[side] = _VALUES[op](*values)
        return found

    def _guarded(self, op: str, e: ca.SX, args: Sequence[_Term]) -> ca.SX:
        """A product or quotient that is zero where one factor is and the other may be undefined."""
        pairs = [(args[0], args[1]), (args[1], args[0])]
        for weight, other in pairs[: 2 if op == "mul" else 1]:
            unsafe = other.partial or (op == "div" and not other.always)
            if unsafe and 0.0 in weight.at.values():
                self.found = True
                e = operation("if_else_zero", [weight.e, e])
        return e
