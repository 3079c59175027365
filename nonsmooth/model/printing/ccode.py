"""Expressions printed as C: one statement per instruction, value-numbered over a whole program.

A :class:`Program` collects named functions of one system (jets of its modes, guards, surfaces) in
one graph, so that equal terms are computed once. Nodes of parameters alone are moved to a function ``prepare``
that runs once per trajectory and fills an array ``q``; the others are printed on a type ``T`` that is ``double``
or a vector of doubles.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from ..expressions.graph import Node, reached
from ..numbering import ARITHMETIC, LIBRARY, operation_in_c
from .terms import MASKS, Graph, Terms

#: Compilers take more than proportional time for long functions: statements of one that is not
#: split, and of a part.
_WHOLE, _PART = 5000, 250

#: Statements of a function that is short.
_SHORT = 150
_NAME = re.compile(r"\b[vm]\d+\b")
_DEFINED = re.compile(r"  const [TI] ([vm]\d+) =")


@dataclass(frozen=True)
class _Function:
    name: str
    arrays: tuple[str, ...]
    first: int  # of its outputs among all outputs of the program


class Program:
    """C functions ``void name(const T *x, const T *q, [extra,] T *a, ...)`` of one system."""

    # ``x`` are the states; ``q`` is prepared from the parameters. What differs between lanes and steps besides has
    # the types "T" or "I", a mask of all or no bits.
    def __init__(self, graph: Graph, types: Sequence[str]):
        self._graph, self._types = graph, tuple(types)
        self._functions: list[_Function] = []
        self._rows: list[list[int]] = []

    def add(self, name: str, **outputs: Terms) -> None:
        """Add a function that stores each output in the array of its name."""
        self._functions.append(_Function(name, tuple(outputs), len(self._rows)))
        self._rows += [[self._graph.whole(e).number for e in row] for row in outputs.values()]

    def text(self) -> str:
        """Return the C text: ``NQ``, ``prepare`` and all functions."""
        nodes, roots = self._graph.nodes, [j for row in self._rows for j in row]
        kept = reached([node.args for node in nodes], [True] * len(nodes), roots)
        number = {j: k for k, j in enumerate(kept)}
        own = [nodes[j]._replace(args=tuple(number[a] for a in nodes[j].args)) for j in kept]
        rows = [[number[j] for j in row] for row in self._rows]
        printed = _Printed(own, rows, self._types)
        parts = [printed.prepare()]
        for function in self._functions:
            outputs = rows[function.first : function.first + len(function.arrays)]
            parts.append(printed.function(function, outputs))
        return "\n".join(parts)


class _Printed:
    """A value-numbered program: which nodes are constants, prepared, or computed each time."""

    def __init__(self, nodes: Sequence[Node], rows: Sequence[Sequence[int]], types: Sequence[str]):
        self.nodes, self.types = nodes, types
        self.moving: list[bool] = []
        for node in nodes:
            own = node.op in MASKS or (node.op == "input" and node.source[0] != 1)
            self.moving.append(own or any(self.moving[a] for a in node.args))
        self.constant = [node.op == "const" for node in nodes]
        self._find_sums(rows)
        used = {j for row in rows for j in row}
        used.update(a for j, node in enumerate(nodes) if self.moving[j] for a in node.args)
        frontier = sorted(j for j in used if not self.moving[j] and not self.constant[j])
        self.prepared = {j: k for k, j in enumerate(frontier)}

    def _find_sums(self, rows: Sequence[Sequence[int]]) -> None:
        """Terms, with signs, of sums whose partial sums have no other use, in the order in which they are known."""
        # A convolution's oldest terms can then be added while its newest are still computed. The difference of
        # two sums stays one: where they are equal it is zero.
        users = [0] * len(self.nodes)
        for j in [a for node in self.nodes for a in node.args] + [j for row in rows for j in row]:
            users[j] += 1
        terms: dict[int, list[tuple[int, bool]]] = {}
        depth = [0] * len(self.nodes)  # operations one after the other until a node is known
        for j, node in enumerate(self.nodes):
            depth[j] = 1 + max((depth[a] for a in node.args), default=-1)
            if node.op not in ("add", "sub") or not self.moving[j]:
                continue
            if node.op == "sub" and node.args[1] in terms:
                continue
            terms[j] = []
            for a, minus in zip(node.args, (False, node.op == "sub"), strict=True):
                own = terms.pop(a) if a in terms and users[a] == 1 else [(a, False)]
                terms[j] += [(k, sign != minus) for k, sign in own]
            depth[j] = 2 + max(self._ready(k, depth) for k, _ in terms[j])
        self.sums = {
            j: sorted(t, key=lambda term: self._ready(term[0], depth))
            for j, t in terms.items()
            if len(t) > 2
        }

    def _ready(self, j: int, depth: Sequence[int]) -> int:
        """When a node can be computed: a product is one operation with the sum that it is a term of."""
        return max((depth[a] for a in self.nodes[j].args), default=0)

    def _sum(self, terms: Sequence[tuple[int, bool]]) -> str:
        """Two chains of the early terms, then the two last."""
        early, late = terms[:-2], terms[-2:]
        chains = [early] if len(early) < 4 else [early[0::2], early[1::2]]
        sums = [self._chain(c) for c in chains]
        total = sums[0] if len(sums) == 1 else f"({sums[0]}) + ({sums[1]})"
        for k, minus in late:
            total = f"({total}) {'-' if minus else '+'} {self.name(k)}"
        return total

    def _chain(self, terms: Sequence[tuple[int, bool]]) -> str:
        """A sum from left to right; it begins with a term that is added, if there is one."""
        (first, minus), *rest = sorted(terms, key=lambda term: term[1] and terms[0][1])
        text = f"(-{self.name(first)})" if minus else self.name(first)
        for k, minus in rest:
            text = f"({text}) {'-' if minus else '+'} {self.name(k)}"
        return text

    def name(self, j: int) -> str:
        """C of a node's value."""
        node = self.nodes[j]
        if node.op == "const":
            return _literal(_value(node))
        if j in self.prepared:
            return f"q[{self.prepared[j]}]"
        if node.op == "input":
            vector, position = node.source
            return f"x[{position}]" if vector == 0 else f"e{position}"
        return f"m{j}" if node.op in MASKS else f"v{j}"

    def prepare(self) -> str:
        """C of the function from parameters to q."""
        lines = []
        for j in self._reachable(list(self.prepared), moving=False):
            node = self.nodes[j]
            if node.op == "const":
                continue
            if node.op == "input":
                value = f"p[{node.source[1]}]"
            else:
                args = [
                    _literal(_value(self.nodes[a])) if self.constant[a] else f"v{a}"
                    for a in node.args
                ]
                value = operation_in_c(node.op, args)
            lines.append(f"  const double v{j} = {value};")
        lines += [f"  q[{k}] = v{j};" for j, k in self.prepared.items()]
        return (
            f"#define NQ {max(1, len(self.prepared))}\n"
            "static void prepare(const double *p, double *q) {\n  (void)p; (void)q;\n"
            + "\n".join(lines)
            + "\n}\n"
        )

    def function(self, function: _Function, outputs: Sequence[Sequence[int]]) -> str:
        """C of one function."""
        stores: dict[int, list[str]] = {}
        for array, row in zip(function.arrays, outputs, strict=True):
            for k, j in enumerate(row):
                stores.setdefault(j, []).append(f"{array}[{k}]")
        lines = []
        reachable = self._early(outputs)
        for j in reachable:
            if self.nodes[j].op != "input":
                kind = "I" if self.nodes[j].op in MASKS else "T"
                lines.append(f"  const {kind} {self.name(j)} = {self._value(j)};")
            lines += [f"  {target} = {self.name(j)};" for target in stores.pop(j, [])]
        for j, targets in stores.items():
            value = f"BC({self.name(j)})" if self.constant[j] else self.name(j)
            lines += [f"  {target} = {value};" for target in targets]
        extra = "".join(f", const {t} e{k}" for k, t in enumerate(self.types))
        arrays = "".join(f", T *restrict {a}" for a in function.arrays)
        head = f"{function.name}(const T *restrict x, const T *restrict q{extra}{arrays})"
        if len(lines) <= _WHOLE:
            # Compilers see into short functions that are needed in parts: other outputs are then not computed.
            short = len(lines) <= _SHORT and function.name.endswith("_values")
            return _define(f"{'INLINE void' if short else 'FUNCTION'} {head}", lines)
        parts, size = _parts(lines)
        given = ["x", "q", *(f"e{k}" for k in range(len(self.types))), *function.arrays, "w"]
        text, calls = "", [f"  T w[{size}];"]
        for k, part in enumerate(parts):
            name = f"{function.name}_part{k}"
            own = head.replace(function.name, name, 1).replace(")", ", T *restrict w)")
            text += _define(f"static __attribute__((noinline)) void {own}", part)
            calls.append(f"  {name}({', '.join(given)});")
        return text + _define(f"FUNCTION {head}", calls)

    def _reachable(self, roots: list[int], moving: bool) -> list[int]:
        found: set[int] = set()
        pending = [j for j in roots if self.moving[j] == moving]
        while pending:
            j = pending.pop()
            if j not in found:
                found.add(j)
                pending += [a for a in self._arguments(j) if self.moving[a] == moving]
        return sorted(found)

    def _early(self, outputs: Sequence[Sequence[int]]) -> list[int]:
        """Nodes in an order for their statements."""
        # At the end, where their numbers put them, all of that would have to be read again.
        first = self._reachable(list(outputs[0]), moving=True)
        key = {j: j for j in first}
        for j in self._reachable([j for row in outputs for j in row], moving=True):
            if j not in key:
                key[j] = max((key[a] for a in self._arguments(j) if a in key), default=-1)
        return sorted(key, key=lambda j: (key[j], j))

    def _arguments(self, j: int) -> list[int]:
        """Arguments of the statement that a node is printed as."""
        return [k for k, _ in self.sums[j]] if j in self.sums else list(self.nodes[j].args)

    def _value(self, j: int) -> str:
        node = self.nodes[j]
        if j in self.sums:
            return self._sum(self.sums[j])
        args = [self.name(a) for a in node.args]
        if node.op in ARITHMETIC:
            return ARITHMETIC[node.op].format(*args)
        if node.op == "select":
            return f"SELECT({args[0]}, {', '.join(map(self._broadcast, node.args[1:]))})"
        if node.op in MASKS:
            return f"(I)({args[0]} != 0)" if node.op == "nonzero" else " | ".join(args)
        call = LIBRARY[node.op].upper().replace("NS_", "") + "_"
        return f"{call}({', '.join(map(self._broadcast, node.args))})"

    def _broadcast(self, j: int) -> str:
        return f"BC({self.name(j)})" if self.constant[j] else self.name(j)


def _define(head: str, lines: Sequence[str]) -> str:
    return f"{head} {{\n  (void)x; (void)q;\n" + "\n".join(lines) + "\n}\n"


def _parts(lines: Sequence[str]) -> tuple[list[list[str]], int]:
    """Split a long function; what one part needs of another goes through an array w of that size."""
    home = {m[1]: k // _PART for k, line in enumerate(lines) if (m := _DEFINED.match(line))}
    shared: dict[str, int] = {}
    for k, line in enumerate(lines):
        for name in _NAME.findall(line):
            if home[name] != k // _PART:
                shared.setdefault(name, len(shared))
    read = lambda name: f"{'(I)' * (name[0] == 'm')}w[{shared[name]}]"
    parts: list[list[str]] = [[] for _ in range(0, len(lines), _PART)]
    for k, line in enumerate(lines):
        here = lambda m, k=k: m[0] if home[m[0]] == k // _PART else read(m[0])
        parts[k // _PART].append(_NAME.sub(here, line))
        if (m := _DEFINED.match(line)) and m[1] in shared:
            parts[k // _PART].append(f"  w[{shared[m[1]]}] = (T){m[1]};")
    return parts, len(shared)


def _value(node: Node) -> float:
    """Value of a constant."""
    assert isinstance(node.payload, float)
    return node.payload


def _literal(value: float) -> str:
    if not math.isfinite(value):
        return "NAN" if math.isnan(value) else ("INFINITY" if value > 0 else "(-INFINITY)")
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text
