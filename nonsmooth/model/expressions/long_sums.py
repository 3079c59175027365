"""Long sums of numbers times functions, such as rows of a network, each as one symbol.

A dense matrix times functions of n states is 3 n^2 operations of a graph; what reads such a graph operation by operation
sees the functions and a symbol for each sum instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..values import Array
from .float_arithmetic import BINARY, UNARY
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
    factors: list[Array]
    places: list[NDArray[np.int64]]

    def kinds(self, of_terms: Sequence[K]) -> list[K]:
        """The largest number of the terms of each sum."""
        return [max(of_terms[k] for k in own.tolist()) for own in self.places]


class _Nodes:
    """Operations of a graph as arrays, by number; -1 where there is no argument."""

    def __init__(self, function: ca.Function, codes: NDArray[np.int64]):
        self.function = function
        self.at = np.flatnonzero(codes != ca.OP_OUTPUT)
        self.op = codes[self.at]
        self.args = np.full((len(self.at), 2), -1)
        for count, names in ((1, UNARY), (2, BINARY)):
            rows = np.flatnonzero(np.isin(self.op, [_CODES[name] for name in names]))
            found = chain.from_iterable(map(function.instruction_input, self.at[rows].tolist()))
            self.args[rows, :count] = np.fromiter(found, int, count * len(rows)).reshape(-1, count)
        source, ends = function.instruction_input, np.flatnonzero(codes == ca.OP_OUTPUT).tolist()
        self.outputs = [(source(k)[0], function.instruction_output(k)) for k in ends]
        used = np.concatenate([self.args[self.args >= 0], [k for k, _ in self.outputs]])
        self.users = np.bincount(used.astype(int), minlength=len(self.op))
        constants = np.flatnonzero(self.op == ca.OP_CONST)
        self.value = np.ones(len(self.op))
        numbers = map(function.instruction_constant, self.at[constants].tolist())
        self.value[constants] = np.fromiter(numbers, float, len(constants))

    def terms(self) -> tuple[NDArray[np.int64], Array]:
        """The function in each node that is a number times one, else -1, and the number."""
        is_function = np.isin(self.op, [_CODES[name] for name in _FUNCTIONS])
        of, number = np.where(is_function, np.arange(len(self.op)), -1), np.ones(len(self.op))
        is_single = self.users == 1
        for one, two in ((0, 1), (1, 0)):
            a, b = self.args[:, one], self.args[:, two]
            found = (
                is_single & (self.op == ca.OP_MUL) & (self.op[a] == ca.OP_CONST) & is_function[b]
            )
            of[found], number[found] = b[found], self.value[a[found]]
        negative = is_single & (self.op == ca.OP_NEG) & is_function[self.args[:, 0]]
        of[negative], number[negative] = self.args[negative, 0], -1.0
        return of, number


@dataclass(frozen=True)
class _Sum:
    """A sum that is added to a node, or to none (-1)."""

    rest: int
    factors: Array
    functions: NDArray[np.int64]

    @property
    def key(self) -> tuple[bytes, bytes]:
        """Equal for equal sums."""
        return self.factors.tobytes(), self.functions.tobytes()


def _sums(nodes: _Nodes) -> dict[int, _Sum]:
    """The long sums of a graph by their last addition."""
    of, number = nodes.terms()
    a, b = nodes.args[:, 0], nodes.args[:, 1]
    adds = ((nodes.op == ca.OP_ADD) | (nodes.op == ca.OP_SUB)) & (of[b] >= 0)
    before = np.where(adds & adds[a] & (nodes.users[a] == 1), a, -1)
    is_last = adds.copy()
    is_last[before[before >= 0]] = False
    sign = np.where(nodes.op == ca.OP_SUB, -1.0, 1.0)
    previous, found = before.tolist(), dict[int, _Sum]()
    for last in np.flatnonzero(is_last).tolist():
        links = [last]
        while previous[links[-1]] >= 0:
            links.append(previous[links[-1]])
        if len(links) < _TERMS:
            continue
        links.reverse()
        start, own, signs = int(a[links[0]]), b[links], sign[links]
        if of[start] >= 0:
            start, own, signs = -1, np.append(start, own), np.append(1.0, signs)
        if len(np.unique(of[own])) == len(own):
            found[last] = _Sum(start, signs * number[own], of[own])
    return found


def _have_common_parts(sums: Sequence[_Sum]) -> bool:
    """Whether two terms occur together, up to a sign, in the same sums: they are better added once."""
    function, factor = (
        np.concatenate([getattr(own, of) for own in sums]) for of in ("functions", "factors")
    )
    number = np.repeat(np.arange(len(sums)), [len(own.factors) for own in sums])
    order = np.lexsort((number, function))
    number, factor = number[order], factor[order]
    ends = [*np.flatnonzero(np.diff(function[order], prepend=-1)).tolist(), len(order)]
    keys = [
        (number[i:j].tobytes(), (factor[i:j] == factor[i]).tobytes())
        for i, j in pairwise(ends)
        if j > i + 1 and (abs(factor[i:j]) == abs(factor[i])).all()
    ]
    return len({*keys}) < len(keys)


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
    different = {own.key: own for own in found.values()}
    if not found or _have_common_parts([*different.values()]):
        return None
    functions = np.unique(np.concatenate([own.functions for own in different.values()]))
    symbols = ca.SX.sym("sum", len(different))
    of_sum = dict(zip(different, ca.vertsplit(symbols), strict=True))
    short = _Shortened(nodes, inputs, {k: (own, of_sum[own.key]) for k, own in found.items()})
    terms = ca.vertcat(*[short.expression(k) for k in functions.tolist()])
    if not short.is_plain(functions.tolist()):
        return None
    entries = [[ca.SX(0)] * output.numel() for output in outputs]
    for k, (vector, position) in nodes.outputs:
        entries[vector][position] = short.expression(k)
    sums = LongSums(
        symbols,
        terms,
        [own.factors for own in different.values()],
        [np.searchsorted(functions, own.functions) for own in different.values()],
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
            return ca.SX(self._nodes.value[k])
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
