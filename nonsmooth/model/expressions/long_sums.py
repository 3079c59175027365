"""Long sums of numbers times functions, such as rows of a network, each as one symbol.

A dense matrix times functions of n states is 3 n^2 operations of a graph; what reads such a graph operation by operation
sees the functions and a symbol for each sum instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .graph import OPERATIONS, function_of, operation, shaped
from .unused_terms import SAFE

#: Least number of terms of a sum that is long, and of operations of a graph in which they are looked for.
_TERMS, _OPERATIONS = 16, 4096

#: Operations whose results are terms, with a finite value everywhere: no products or sums, which are simplified with others.
_FUNCTIONS = frozenset("sin cos tanh atan asinh erf".split())

_CODES = {name: code for code, name in OPERATIONS.items()}


K = TypeVar("K", bound=int)


@dataclass(frozen=True)
class LongSums:
    """Symbols that stand for sums, the terms of all of them, and of each sum the factors and positions of its own."""

    symbols: ca.SX
    terms: ca.SX
    factors: list[list[float]]
    places: list[list[int]]

    def kinds(self, of_terms: Sequence[K]) -> list[K]:
        """The largest number of the terms of each sum."""
        return [max(of_terms[k] for k in own) for own in self.places]


class _Nodes:
    """Operations of a graph as arrays, by number; -1 where there is no argument."""

    def __init__(self, function: ca.Function, codes: NDArray[np.int64]):
        self.function = function
        self.at = np.flatnonzero(codes != ca.OP_OUTPUT)
        self.op = codes[self.at]
        self.args = np.full((len(self.at), 2), -1)
        source, none = function.instruction_input, (ca.OP_CONST, ca.OP_INPUT)
        rows = np.flatnonzero(~np.isin(self.op, none))
        found = [source(at) for at in self.at[rows].tolist()]
        self.args[rows, 0] = [own[0] for own in found]
        self.args[rows, 1] = [own[1] if len(own) > 1 else -1 for own in found]
        ends = np.flatnonzero(codes == ca.OP_OUTPUT).tolist()
        self.outputs = [(source(k)[0], function.instruction_output(k)) for k in ends]
        used = self.args[self.args >= 0].tolist() + [k for k, _ in self.outputs]
        self.users = np.bincount(used, minlength=len(self.op))

    def value(self, k: int) -> float:
        """The number of a constant."""
        return float(self.function.instruction_constant(int(self.at[k])))

    def terms(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The function in each node that is a number times one, else -1, and the node of the number, -1 for 1 and -2 for -1."""
        is_function = np.isin(self.op, [_CODES[name] for name in _FUNCTIONS])
        of, number = np.where(is_function, np.arange(len(self.op)), -1), np.full(len(self.op), -1)
        is_single = self.users == 1
        for one, two in ((0, 1), (1, 0)):
            a, b = self.args[:, one], self.args[:, two]
            found = (
                is_single & (self.op == ca.OP_MUL) & (self.op[a] == ca.OP_CONST) & is_function[b]
            )
            of[found], number[found] = b[found], a[found]
        negative = is_single & (self.op == ca.OP_NEG) & is_function[self.args[:, 0]]
        of[negative], number[negative] = self.args[negative, 0], -2
        return of, number


@dataclass(frozen=True)
class _Sum:
    """A sum that is added to a node, or to none (-1)."""

    rest: int
    factors: tuple[float, ...]
    functions: tuple[int, ...]


def _sums(nodes: _Nodes) -> dict[int, _Sum]:
    """The long sums of a graph by their last addition."""
    of, number = nodes.terms()
    a, b = nodes.args[:, 0], nodes.args[:, 1]
    adds = ((nodes.op == ca.OP_ADD) | (nodes.op == ca.OP_SUB)) & (of[b] >= 0)
    before = np.where(adds & adds[a] & (nodes.users[a] == 1), a, -1)
    is_last = adds.copy()
    is_last[before[before >= 0]] = False
    first, second, previous = a.tolist(), b.tolist(), before.tolist()
    subtracts, found = (nodes.op == ca.OP_SUB).tolist(), dict[int, _Sum]()

    def term(k: int, sign: float) -> tuple[float, int]:
        own = int(number[k])
        return sign * (nodes.value(own) if own >= 0 else -1.0 if own == -2 else 1.0), int(of[k])

    for last in np.flatnonzero(is_last).tolist():
        chain = [last]
        while previous[chain[-1]] >= 0:
            chain.append(previous[chain[-1]])
        if len(chain) < _TERMS:
            continue
        start = first[chain[-1]]
        own = [term(second[k], -1.0 if subtracts[k] else 1.0) for k in reversed(chain)]
        own = own if of[start] < 0 else [term(start, 1.0), *own]
        factors, functions = zip(*own, strict=True)
        if len(set(functions)) == len(functions):
            found[last] = _Sum(start if of[start] < 0 else -1, factors, functions)
    return found


def _have_common_parts(sums: Sequence[_Sum]) -> bool:
    """Whether two terms occur together, up to a sign, in the same sums: they are better added once."""
    where: dict[int, list[tuple[int, float]]] = {}
    for i, own in enumerate(sums):
        for factor, k in zip(own.factors, own.functions, strict=True):
            where.setdefault(k, []).append((i, factor))
    several = [own for own in where.values() if len(own) > 1 and len({abs(f) for _, f in own}) == 1]
    return len({tuple((i, f == own[0][1]) for i, f in own) for own in several}) < len(several)


def long_sums(
    inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]
) -> tuple[list[ca.SX], LongSums] | None:
    """Dense expressions with symbols for their long sums of functions of the first vector, and these; None without any."""
    outputs = [ca.densify(e) for e in outputs]
    function = function_of(inputs, outputs)
    if function.n_instructions() < _OPERATIONS:
        return None
    codes = np.array([*map(function.instruction_id, range(function.n_instructions()))])
    if not {_CODES["call"], _CODES["printme"]}.isdisjoint(codes.tolist()):
        return None
    nodes = _Nodes(function, codes)
    found = _sums(nodes)
    different = [*dict.fromkeys((own.factors, own.functions) for own in found.values())]
    if not found or _have_common_parts([_Sum(-1, *own) for own in different]):
        return None
    functions = sorted({k for _, own in different for k in own})
    symbols = ca.SX.sym("sum", len(different))
    of_sum = dict(zip(different, ca.vertsplit(symbols), strict=True))
    short = _Shortened(
        nodes, inputs, {k: (own, of_sum[own.factors, own.functions]) for k, own in found.items()}
    )
    terms = ca.vertcat(*[short.expression(k) for k in functions])
    if not short.is_plain(functions):
        return None
    entries = [[ca.SX(0)] * output.numel() for output in outputs]
    for k, (vector, position) in nodes.outputs:
        entries[vector][position] = short.expression(k)
    place = {k: i for i, k in enumerate(functions)}
    sums = LongSums(
        symbols,
        terms,
        [[*factors] for factors, _ in different],
        [[place[k] for k in own] for _, own in different],
    )
    return shaped(outputs, [e for own in entries for e in own]), sums


class _Shortened:
    """Expressions of nodes, with symbols for sums."""

    def __init__(self, nodes: _Nodes, inputs: Sequence[ca.SX], sums: dict[int, tuple[_Sum, ca.SX]]):
        self._nodes, self._inputs, self._sums = nodes, inputs, sums
        self._found: dict[int, ca.SX] = {}
        self._names = [OPERATIONS[code] for code in nodes.op.tolist()]

    def _below(self, k: int) -> list[int]:
        """Nodes from which the expression of a node follows."""
        own = self._sums.get(k)
        return [
            a for a in (self._nodes.args[k].tolist() if own is None else [own[0].rest]) if a >= 0
        ]

    def expression(self, k: int) -> ca.SX:
        """Return the expression of a node; a stack, because graphs can be deep."""
        stack = [k]
        while stack:
            j = stack[-1]
            missing = (
                [a for a in self._below(j) if a not in self._found] if j not in self._found else []
            )
            stack += missing
            if not missing:
                stack.pop()
                if j not in self._found:
                    self._found[j] = self._made(j)
        return self._found[k]

    def _made(self, k: int) -> ca.SX:
        own, args = self._sums.get(k), [self._found[a] for a in self._below(k)]
        if own is not None:
            return args[0] + own[1] if args else own[1]
        name, function = self._names[k], self._nodes.function
        if name == "const":
            return ca.SX(self._nodes.value(k))
        if name == "input":
            vector, position = function.instruction_input(int(self._nodes.at[k]))
            return self._inputs[vector][position]
        return operation(name, args)

    def is_plain(self, functions: Sequence[int]) -> bool:
        """Whether terms have no sums in them, a value everywhere, and depend on the first vector."""
        found: dict[int, tuple[bool, bool]] = {}
        for k in sorted(self._found):
            below = [found[a] for a in self._below(k)]
            name = self._names[k]
            moves = any(own for own, _ in below)
            if name == "input":
                moves = self._nodes.function.instruction_input(int(self._nodes.at[k]))[0] == 0
            plain = k not in self._sums and (name in SAFE or name in ("const", "input"))
            found[k] = moves, plain and all(own for _, own in below)
        return all(all(found[k]) for k in functions)
