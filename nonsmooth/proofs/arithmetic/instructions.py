"""Expressions and their derivatives as instructions over exact constants.

CasADi folds constants in doubles while it differentiates (d/dx of 0.1*(0.3*x*x) becomes 0.06*x), so
its derivatives are not those of the expression that it stores, and a proof through them could be
false in the seventeenth digit. Here the stored instructions themselves are differentiated, by the
rules below, and nothing is folded but whole numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, cast

from ...model import NotSmoothError
from ...model.expressions.graph import Node, evaluate, instructions

#: Constants are folded where they are whole multiples of 1/_PARTS and at most _PARTS: these have the
#: same value as doubles and as decimals, and their sums and products are exact in doubles.
_PARTS = 1024

#: Jump somewhere: the values around a jump are enclosed, but no theorem about roots holds across.
_JUMPS = {"sign", "floor", "ceil", "fmod", "remainder", "copysign", "if_else_zero"} | {
    *("lt", "le", "eq", "ne", "not", "and", "or"),
}
#: Operations with a kink: allowed of parameters only.
KINKS = {"fabs", "fmin", "fmax"}


class ExpressionGraph:
    """Instructions, each stored once; an algebra of their numbers."""

    # ``input`` nodes are (vector, position): vector 0 holds states, 1 parameters, 2 further unknowns.

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._known: dict[tuple[Node, type], int] = {}
        self._gradients: dict[int, dict[int, int]] = {}

    # an algebra of node numbers ------------------------------------------------------------------

    def node(self, op: str, *args: int, payload: Any = None) -> int:
        """Return the number of an instruction, new or known."""
        new = Node(op, args, payload)
        key = new, type(payload)  # a float may mean a decimal, an equal fraction never does
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append(new)
        return self._known[key]

    def constant(self, value: float | Fraction) -> int:
        """Return a constant: a float as the graph holds it, or an exact fraction."""
        value = Fraction(value) if isinstance(value, int) else value
        if isinstance(value, Fraction) and value.denominator == 1 and abs(value) <= _PARTS:
            value = float(value)
        return self.node("const", payload=value + 0 if isinstance(value, float) else value)

    def symbol(self, vector: int, position: int) -> int:
        """Return an input."""
        return self.node("input", payload=(vector, position))

    def apply(self, op: str, args: Sequence[int]) -> int:
        """Return an operation, simplified only where that is exact."""
        if op in ("pow", "constpow"):
            return self._power(args)
        simplify = _SIMPLER.get(op)
        found = simplify(self, *args) if simplify else None
        if found is not None:
            return found
        if op not in PARTIALS and op not in _JUMPS:
            raise NotSmoothError(
                f"the operation {op!r} has no known derivative. "
                "Write it with arithmetic, powers and elementary functions."
            )
        return self.node(op, *args)

    def plain(self, k: int) -> float | None:
        """The value of a constant that may be folded."""
        node = self.nodes[k]
        return _plain(node.payload) if node.op == "const" else None

    def _power(self, args: Sequence[int]) -> int:
        exponent = self.plain(args[1])
        if exponent is None or not exponent.is_integer():
            return self.node("pow", *args)
        if exponent < 0:
            return self.apply("inv", [self.power(args[0], -int(exponent))])
        return self.power(args[0], int(exponent))

    def power(self, a: int, n: int) -> int:
        """Return a natural power."""
        if n < 3:
            return [self.constant(1), a, self.apply("sq", [a])][n]
        return self.node("power", a, payload=n)

    def add(self, *terms: int) -> int:
        """Return a sum."""
        total = self.constant(0)
        for term in terms:
            total = self.apply("add", [total, term])
        return total

    def dot(self, a: Iterable[int], b: Iterable[int]) -> int:
        """Return a sum of products."""
        return self.add(*(self.apply("mul", [u, v]) for u, v in zip(a, b, strict=True)))

    # graphs --------------------------------------------------------------------------------------

    def insert(self, expressions: Sequence[Any], symbols: Sequence[Any], values: Any) -> list[Any]:
        """Add CasADi expressions to the graph."""
        nodes, rows = instructions(symbols, expressions)
        numbers = evaluate(nodes, _Inserted(self, values))
        return [[numbers[k] for k in row] for row in rows]

    # derivatives ---------------------------------------------------------------------------------

    def gradient(self, root: int, inputs: Sequence[int]) -> list[int]:
        """Derivatives of a node with respect to input nodes."""
        for k in self.ancestors([root]):
            if k not in self._gradients:
                self._gradients[k] = self._rule(k)
        zero = self.constant(0)
        return [self._gradients[root].get(i, zero) for i in inputs]

    def _rule(self, k: int) -> dict[int, int]:
        node = self.nodes[k]
        if node.op == "input":
            moving = cast("tuple[int, int]", node.payload)[0] != 1  # parameters do not move
            return {k: self.constant(1)} if moving else {}
        inner = [self._gradients[a] for a in node.args]
        if not any(inner):
            return {}
        if node.op in KINKS:
            raise NotSmoothError(
                f"the operation {node.op!r} of a state has a kink. Declare the switch as a surface."
            )
        result: dict[int, int] = {}
        for partial, slopes in zip(PARTIALS[node.op](self, k, node), inner, strict=True):
            for i, slope in slopes.items() if slopes else ():
                term = self.apply("mul", [partial(), slope])
                result[i] = self.apply("add", [result[i], term]) if i in result else term
        return result

    def ancestors(self, roots: Iterable[int]) -> list[int]:
        """Every node that others are made of, in order."""
        todo, found = list(roots), set[int]()
        while todo:
            k = todo.pop()
            if k not in found:
                found.add(k)
                todo += self.nodes[k].args
        return sorted(found)

    def inputs(self, roots: Iterable[int]) -> list[tuple[int, int]]:
        """The inputs that nodes depend on."""
        return [self.nodes[k].source for k in self.ancestors(roots) if self.nodes[k].op == "input"]


@dataclass(frozen=True)
class _Inserted:
    """The algebra that maps symbols to nodes of a graph."""

    graph: ExpressionGraph
    values: Sequence[Sequence[int]]

    def constant(self, value: float) -> int:
        return self.graph.constant(value)

    def symbol(self, vector: int, position: int) -> int:
        return self.values[vector][position]

    def apply(self, op: str, args: Sequence[int]) -> int:
        if op in _JUMPS:
            raise NotSmoothError(
                f"the operation {op!r} jumps, and no theorem holds across a jump. Declare the switch as a "
                "surface; of parameters alone, give its value."
            )
        return self.graph.apply(op, args)


class Program:
    """Nodes of a graph that are evaluated together, with the nodes they depend on."""

    def __init__(self, graph: ExpressionGraph, rows: Sequence[Sequence[int]]):
        chosen = graph.ancestors(k for row in rows for k in row)
        new = {k: j for j, k in enumerate(chosen)}
        self.nodes = [
            Node(
                graph.nodes[k].op,
                tuple(new[a] for a in graph.nodes[k].args),
                graph.nodes[k].payload,
            )
            for k in chosen
        ]
        self.rows = [[new[k] for k in row] for row in rows]

    def __call__(self, arithmetic: Any) -> list[list[Any]]:
        """Values of the rows in an arithmetic (an Algebra that also takes fractions, powers)."""
        values: list[Any] = []
        apply = arithmetic.apply
        for node in self.nodes:
            if node.op == "const":
                values.append(arithmetic.constant(node.payload))
            elif node.op == "input":
                values.append(arithmetic.symbol(*node.source))
            elif node.op == "power":
                values.append(arithmetic.power(values[node.args[0]], node.payload))
            else:
                values.append(apply(node.op, [values[k] for k in node.args]))
        return [[values[k] for k in row] for row in self.rows]


# Simplifications that are exact ------------------------------------------------------------------


def _plain(value: Any) -> float | None:
    """A number that may be folded, or None."""
    plain = isinstance(value, float) and abs(value) <= _PARTS and (value * _PARTS).is_integer()
    return value if plain else None


def _folded(t: ExpressionGraph, value: float) -> int | None:
    return None if _plain(value) is None else t.constant(value)


def _add(t: ExpressionGraph, a: int, b: int) -> int | None:
    x, y = t.plain(a), t.plain(b)
    if x == 0:
        return b
    if y == 0:
        return a
    return None if x is None or y is None else _folded(t, x + y)


def _sub(t: ExpressionGraph, a: int, b: int) -> int | None:
    x, y = t.plain(a), t.plain(b)
    if y == 0:
        return a
    if x == 0:
        return t.apply("neg", [b])
    return None if x is None or y is None else _folded(t, x - y)


def _mul(t: ExpressionGraph, a: int, b: int) -> int | None:
    x, y = t.plain(a), t.plain(b)
    if x == 0 or y == 0:
        return t.constant(0)
    for value, other in ((x, b), (y, a)):
        if value in (1, -1):
            return other if value == 1 else t.apply("neg", [other])
    if a == b and x is None:
        return t.apply("sq", [a])
    return None if x is None or y is None else _folded(t, x * y)


def _div(t: ExpressionGraph, a: int, b: int) -> int | None:
    x, y = t.plain(a), t.plain(b)
    if y == 1:
        return a
    # A quotient of plain numbers is folded only by powers of two, where it is exact.
    return _folded(t, x / y) if x is not None and y in (2, 4, 8, 0.5, 0.25) else None


def _neg(t: ExpressionGraph, a: int) -> int | None:
    x = t.plain(a)
    if x is not None:
        return t.constant(-x)
    return t.nodes[a].args[0] if t.nodes[a].op == "neg" else None


def _unary(function: Callable[[float], float]) -> Callable[[ExpressionGraph, int], int | None]:
    def folded(t: ExpressionGraph, a: int) -> int | None:
        x = t.plain(a)
        return None if x is None else _folded(t, function(x))

    return folded


_SIMPLER: dict[str, Callable[..., int | None]] = {
    "assign": lambda t, a: a,
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "div": _div,
    "neg": _neg,
    "twice": _unary(lambda x: 2 * x),
    "sq": _unary(lambda x: x * x),
}


# Partial derivatives of each operation, as instructions --------------------------------------------

Partial = Callable[[], int]


def _chain(*steps: str) -> Callable[[ExpressionGraph, int, Node], list[Partial]]:
    """The derivative of a function of one variable by a formula of ``_FORMULAS``."""

    def partials(t: ExpressionGraph, w: int, node: Node) -> list[Partial]:
        return [lambda: _run(t, steps, {"w": w, "a": node.args[0]})]

    return partials


def _run(t: ExpressionGraph, steps: Sequence[str], names: dict[str, int]) -> int:
    """Evaluate steps in reverse Polish notation: names, whole numbers, operations."""
    stack: list[int] = []
    for step in steps:
        if step in names:
            stack.append(names[step])
        elif step.lstrip("-").isdigit():
            stack.append(t.constant(float(step)))
        elif step == "pi":
            stack.append(t.node("pi"))
        else:
            count = 2 if step in ("add", "sub", "mul", "div") else 1
            args, stack = stack[-count:], stack[:-count]
            stack.append(t.apply(step, args))
    return stack[0]


_FORMULAS = {  # derivatives of w = f(a)
    "twice": "2",
    "neg": "-1",
    "sq": "a twice",
    "inv": "w sq neg",
    "sqrt": "1 w twice div",
    "exp": "w",
    "expm1": "w 1 add",
    "log": "a inv",
    "log1p": "1 a add inv",
    "sin": "a cos",
    "cos": "a sin neg",
    "tan": "1 w sq add",
    "asin": "1 a sq sub sqrt inv",
    "acos": "1 a sq sub sqrt inv neg",
    "atan": "1 a sq add inv",
    "sinh": "a cosh",
    "cosh": "a sinh",
    "tanh": "1 w sq sub",
    "asinh": "1 a sq add sqrt inv",
    "acosh": "a sq 1 sub sqrt inv",
    "atanh": "1 a sq sub inv",
    "erf": "2 pi sqrt div a sq neg exp mul",
    "erfinv": "pi sqrt 2 div w sq exp mul",
}

PARTIALS: dict[str, Callable[[ExpressionGraph, int, Node], list[Partial]]] = {
    **{op: _chain(*text.split()) for op, text in _FORMULAS.items()},
    "add": lambda t, w, n: [lambda: t.constant(1)] * 2,
    "sub": lambda t, w, n: [lambda: t.constant(1), lambda: t.constant(-1)],
    "mul": lambda t, w, n: [lambda: n.args[1], lambda: n.args[0]],
    "div": lambda t, w, n: [
        lambda: t.apply("inv", [n.args[1]]),
        lambda: t.apply("neg", [t.apply("div", [w, n.args[1]])]),
    ],
    "power": lambda t, w, n: [
        lambda: t.apply(
            "mul",
            [t.constant(cast("int", n.payload)), t.power(n.args[0], cast("int", n.payload) - 1)],
        )
    ],
    "pow": lambda t, w, n: [
        lambda: t.apply("div", [t.apply("mul", [n.args[1], w]), n.args[0]]),
        lambda: t.apply("mul", [w, t.apply("log", [n.args[0]])]),
    ],
    "hypot": lambda t, w, n: [
        lambda: t.apply("div", [n.args[0], w]),
        lambda: t.apply("div", [n.args[1], w]),
    ],
    "atan2": lambda t, w, n: [
        lambda: t.apply("div", [n.args[1], _radius(t, n)]),
        lambda: t.apply("neg", [t.apply("div", [n.args[0], _radius(t, n)])]),
    ],
    **{op: lambda t, w, n: [] for op in ("pi", *KINKS)},
}


def _radius(t: ExpressionGraph, n: Node) -> int:
    return t.add(t.apply("sq", [n.args[0]]), t.apply("sq", [n.args[1]]))
