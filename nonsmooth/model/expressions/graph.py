"""CasADi expressions as value-numbered lists of instructions, and the check that they are smooth.

Everything that reads an expression graph does so through :func:`instructions`; CasADi's operation
codes are used here only.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple, Protocol, TypeVar, cast

import casadi as ca

from ..errors import DefinitionError, NotSmoothError
from ..reading import refuse_call
from .float_arithmetic import BINARY, UNARY

#: CasADi's operation codes by number, e.g. ``OPERATIONS[4] == "mul"``.
OPERATIONS: dict[int, str] = {
    getattr(ca, name): name[3:].lower() for name in dir(ca) if name.startswith("OP_")
}

#: Operations without derivatives of every order, and the declaration that replaces each.
NOT_SMOOTH: dict[str, str] = {
    "sign": "sign",
    "fabs": "fabs (absolute value; sqrt(e**2) becomes fabs(e) in CasADi)",
    "fmin": "fmin",
    "fmax": "fmax",
    "if_else_zero": "if_else",
    "lt": "a comparison (<)",
    "le": "a comparison (<=)",
    "eq": "a comparison (==)",
    "ne": "a comparison (!=)",
    "not": "logic_not",
    "and": "logic_and",
    "or": "logic_or",
    "floor": "floor",
    "ceil": "ceil",
    "fmod": "fmod",
    "remainder": "remainder",
    "copysign": "copysign",
}


#: Operations that may be a power that is not a whole number.
POWERS = frozenset(("sqrt", "pow", "constpow"))

#: Smooth operations that are no longer so where one of their arguments is always zero.
_BESIDE_ZERO: dict[str, str] = {
    "atan2": "atan2 with an argument that is zero (a jump where the other one changes its sign)",
    "hypot": "hypot with an argument that is zero (the absolute value of the other one)",
}


#: Operations that are smooth whatever their arguments are.
_SMOOTH = {*UNARY, *BINARY, "const", "input", "output"} - NOT_SMOOTH.keys() - _BESIDE_ZERO.keys()


class Node(NamedTuple):
    """One operation: its name, its arguments (node numbers) and a payload."""

    op: str
    args: tuple[int, ...]
    payload: Hashable = None  # the value of a ``const``, (input, position) of an ``input``

    @property
    def source(self) -> tuple[int, int]:
        """Input vector and position of an ``input`` node."""
        return cast("tuple[int, int]", self.payload)


def instructions(
    inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], merged: bool = True
) -> tuple[list[Node], list[list[int]]]:
    """Value-number the graph of dense ``outputs`` over ``inputs``, unless not ``merged``."""
    outputs = [_dense(o) for o in outputs]
    read = lambda: _read(function_of(inputs, outputs), merged)
    own, given = (sum(e.numel() for e in some) for some in (outputs, inputs))
    if 4 * own < given:  # small, and sooner read than compared
        return read()
    kept = [*inputs, *outputs]  # so that the hashes stay theirs
    hashes = (tuple(e.element_hash() for e in ca.vertsplit(ca.vec(o))) for o in kept)
    key = (merged, len(inputs), *hashes)
    found = next((own for known, own, _ in _READ if known == key), None) or read()
    _READ[:] = [(key, found, kept), *(one for one in _READ if one[0] != key)][:2]
    return [*found[0]], [*map(list, found[1])]


#: The graphs that were read last: some are read several times.
_READ: list[tuple[Hashable, tuple[list[Node], list[list[int]]], list[ca.SX]]] = []


def function_of(inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]) -> ca.Function:
    """A Function whose instructions, without those of outputs, are numbered by their results."""
    return ca.Function("graph", list(inputs), list(outputs), {"live_variables": False})


def _read(function: ca.Function, merged: bool) -> tuple[list[Node], list[list[int]]]:
    nodes: list[Node] = []
    known: dict[Node, int] = {}
    register: list[int] = []
    rows: list[list[int]] = [[-1] * function.numel_out(k) for k in range(function.n_out())]
    source_of = function.instruction_input
    for k, code in enumerate(map(function.instruction_id, range(function.n_instructions()))):
        op = OPERATIONS[code]
        if op == "const":
            node = Node(op, (), float(function.instruction_constant(k)))
        elif op == "input":
            node = Node(op, (), tuple(source_of(k)))
        elif op == "output":
            vector, position = function.instruction_output(k)
            rows[vector][position] = register[source_of(k)[0]]
            continue
        elif op == "call":
            refuse_call(function.instructions_sx()[k].which_function(), "expression")
        elif op == "printme":  # prints its second argument where CasADi evaluates it
            register.append(register[source_of(k)[0]])
            continue
        elif op not in UNARY and op not in BINARY:
            raise DefinitionError(
                f"expression: CasADi's operation {op!r} is not supported. Write it with "
                f"arithmetic and elementary functions: {', '.join((*UNARY, *BINARY))}."
            )
        else:
            node = Node(op, tuple([register[a] for a in source_of(k)]))
        number = known.setdefault(node, len(nodes)) if merged else len(nodes)
        if number == len(nodes):
            nodes.append(node)
        register.append(number)
    return nodes, rows


class Content(NamedTuple):
    """Names of the operations of an expression, and a constant that is no finite number."""

    expression: ca.SX  # so that the hashes stay its
    hashes: frozenset[int]
    operations: frozenset[str]
    infinite: float | None


def content_of(expression: ca.SX) -> Content:
    """What an expression contains, or one that was read before and has all of its entries."""
    expression, last = _dense(expression), next(iter(_LAST), None)
    hashes = frozenset(e.element_hash() for e in ca.vertsplit(ca.vec(expression)))
    if last and (last.hashes == hashes or (last.hashes > hashes and last.infinite is None)):
        return last
    function = function_of([ca.vertcat(*ca.symvar(expression))], [expression])
    codes = [*map(function.instruction_id, range(function.n_instructions()))]
    numbers = (function.instruction_constant(k) for k, c in enumerate(codes) if c == ca.OP_CONST)
    infinite = next((number for number in numbers if not math.isfinite(number)), None)
    found = Content(expression, hashes, frozenset(OPERATIONS[c] for c in {*codes}), infinite)
    _LAST[:] = [found]
    return found


#: The content that was read last.
_LAST: list[Content] = []


def _dense(output: ca.SX) -> ca.SX:
    """A dense output; CasADi's conversions lose Ctrl-C, so only what needs one has one."""
    dense = isinstance(output, ca.SX) and output.is_dense()
    return output if dense else ca.densify(ca.SX(output))


V = TypeVar("V")


class Algebra(Protocol[V]):
    """An algebra in which a graph is evaluated: expressions, numbers, enclosures, normal forms."""

    def constant(self, value: float) -> V:
        """Return a constant of the graph."""
        ...

    def symbol(self, vector: int, position: int) -> V:
        """Return an entry of an input vector."""
        ...

    def apply(self, op: str, args: Sequence[V]) -> V:
        """Return the value of an operation, named as in ``OPERATIONS``."""
        ...


def evaluate(nodes: Sequence[Node], algebra: Algebra[V]) -> list[V]:
    """Values of all nodes of a graph in an algebra."""
    values: list[V] = []
    for node in nodes:
        if node.op == "const":
            values.append(algebra.constant(cast("float", node.payload)))
        elif node.op == "input":
            values.append(algebra.symbol(*node.source))
        else:
            values.append(algebra.apply(node.op, [values[k] for k in node.args]))
    return values


class Expressions:
    """The algebra of expressions: operations as they are, over vectors of symbols."""

    def __init__(self, vectors: Sequence[ca.SX]):
        self.vectors = vectors
        self.constant = ca.SX

    def symbol(self, vector: int, position: int) -> ca.SX:
        """Return an entry of a vector."""
        return self.vectors[vector][position]

    def apply(self, op: str, args: Sequence[ca.SX]) -> ca.SX:
        """Return an operation."""
        return operation(op, args)


def shaped(outputs: Sequence[ca.SX], entries: Sequence[ca.SX]) -> list[ca.SX]:
    """Return expressions with the shapes of others, of entries one after the other."""
    ends = accumulate((output.numel() for output in outputs), initial=0)
    parts = [entries[a:b] for a, b in pairwise(ends)]
    return [
        ca.reshape(ca.vertcat(*own), *output.shape) if own else ca.SX.zeros(*output.shape)
        for own, output in zip(parts, outputs, strict=True)
    ]


def operation(op: str, args: Sequence[ca.SX]) -> ca.SX:
    """Return the expression of an operation, named as in ``OPERATIONS``."""
    code = getattr(ca, "OP_" + op.upper())
    return ca.SX.unary(code, args[0]) if len(args) == 1 else ca.SX.binary(code, *args)


def depends_on(nodes: Sequence[Node], variable: Sequence[bool]) -> list[bool]:
    """Which nodes depend on an input vector marked true in ``variable``."""
    result: list[bool] = []
    for node in nodes:
        if node.op == "input":
            result.append(variable[node.source[0]])
        else:
            result.append(any(result[a] for a in node.args))
    return result


def reached(
    arguments: Sequence[Sequence[int]], required: Sequence[bool], roots: Sequence[int]
) -> list[int]:
    """Return the nodes from which some nodes follow, in order, as far as they are required."""
    found, pending = set[int](), list(roots)
    while pending:
        j = pending.pop()
        if j not in found and required[j]:
            found.add(j)
            pending += arguments[j]
    return sorted(found)


#: What to write in place of a switch in a field, and in other functions.
IN_A_FIELD = (
    "Let FilippovSystem.from_expression find the switches of a field, or declare each as a surface: give the smooth "
    "pieces as above= and below= with surface= the argument whose sign decides, or write sign(h) as a multiplier "
    "lam with surfaces=[h], multipliers=[lam] (fabs(h) is lam*h, fmax(a, b) is (a + b + lam*(a - b))/2 with h = a - b)."
)
IN_A_GUARD = (
    "fmin and fmax of smooth functions are guards too; other choices are conditions, such as "
    "casadi.logic_and(a > 0, b > 0)."
)
IN_A_SURFACE = (
    "Make each smooth piece a surface with a multiplier of its own, or let FilippovSystem.from_expression find the "
    "switches of the field."
)
IN_A_GAP = "Give each smooth piece of the gap an Impact of its own."


def require_finite(expression: ca.SX, what: str) -> None:
    """Refuse NaN and infinite constants."""
    if (found := content_of(expression).infinite) is not None:
        raise DefinitionError(
            f"{what}: expected finite constants, received {found} in {expression}. Functions of Python's math turn a "
            "symbol into NaN: write casadi.sin(x), not math.sin(x)."
        )


def require_smooth(
    expression: ca.SX, variables: ca.SX, others: ca.SX, what: str, advice: str = IN_A_FIELD
) -> None:
    """Refuse an expression that is not smooth in ``variables``; in ``others`` it need not be."""
    if content_of(expression).operations <= _SMOOTH:
        return
    nodes, _ = instructions([variables, others], [expression])
    moving = depends_on(nodes, [True, False])
    for node, moves in zip(nodes, moving, strict=True):
        if not moves:
            continue
        if found := NOT_SMOOTH.get(node.op) or _beside_zero(node, nodes):
            raise NotSmoothError(
                f"{what}: expected an expression with derivatives of every order, received one "
                f"with {found} of the states. {advice}"
            )


def _beside_zero(node: Node, nodes: Sequence[Node]) -> str | None:
    """Name an operation that is not smooth because one of its arguments is zero."""
    zero = any(nodes[a].op == "const" and nodes[a].payload == 0.0 for a in node.args)
    return _BESIDE_ZERO.get(node.op) if zero else None


def power_of(op: str, args: Sequence[ca.SX]) -> float | None:
    """The exponent of a positive power that is not a whole number."""
    if op == "sqrt":
        return 0.5
    if op not in POWERS or not args[1].is_constant():
        return None
    power = float(args[1])
    return power if power > 0.0 and power != int(power) else None
