"""Piecewise polynomials with breakpoints, as expressions that a definition recognises."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import casadi as ca
import numpy as np

from ...errors import DefinitionError
from ...expressions.graph import NOT_SMOOTH, Node, operation, reached

#: Relative error of values.
_LOST = 1e-9

#: A curve is marked in expressions by a number that changes no value: this much and a part of it for each curve.
_MARK, _PART = 1e-300, 2.0**-52

#: Curves that are recognised: the last so many that were made.
_MOST = 1000


@dataclass(frozen=True)
class Curve:
    """Polynomials between breakpoints.

    Attributes
    ----------
    levels : tuple of float (k,)
        Breakpoints, increasing.
    pieces : tuple (k + 1,) of tuples (5,)
        Of each cell, from the lowest: a number, and coefficients in the distance from it.
    jumps : tuple (k,) of tuples (4,)
        What a breakpoint adds, in the distance from it; zero at an end that only bounds the range.
    closed : tuple of bool (2,)
        Whether there is no value below the first breakpoint, above the last one.
    """

    levels: tuple[float, ...]
    pieces: tuple[tuple[float, ...], ...]
    jumps: tuple[tuple[float, ...], ...]
    closed: tuple[bool, bool] = (False, False)

    @cached_property
    def kinks(self) -> tuple[float, ...]:
        """Breakpoints with a jump of a derivative."""
        return tuple(x for x, jump in zip(self.levels, self.jumps, strict=True) if any(jump))

    def of(self, u: ca.SX) -> ca.SX:
        """The curve as an expression: a sum over the breakpoints, or a choice among the pieces where sums lose digits.

        It is the root of a negative number, NaN, where the curve has no value.
        """
        is_lossy = self.lost > _LOST
        value = (
            self._chosen(u) if is_lossy else self.summed(u, ca.fmax(u - ca.DM(self.kinks), 0), 1)
        )
        if self.closed[0]:
            value = ca.if_else(u < self.levels[0], ca.sqrt(u - self.levels[0]), value)
        if self.closed[1]:
            value = ca.if_else(u > self.levels[-1], ca.sqrt(self.levels[-1] - u), value)
        return value

    def marked(self, argument: ca.SX) -> ca.SX:
        """The same, so that ``with_curves`` recognises it."""
        code = hashlib.sha256(repr(self).encode()).digest()
        mark = _MARK * (1.0 + int.from_bytes(code[:6], "big") * _PART)
        _MARKED[mark] = self
        _MARKED.move_to_end(mark)
        while len(_MARKED) > _MOST:
            _MARKED.popitem(last=False)
        u = ca.SX.sym("u")
        return ca.substitute(self.of(u), u, argument + mark) + 2.0 * mark

    def summed(self, u: ca.SX, beyond: ca.SX, weight: Any) -> ca.SX:
        """The lowest piece with a term for each kink, by how far the argument is beyond it."""
        if self.lost > _LOST:
            raise DefinitionError(
                f"table: added up breakpoint by breakpoint its values are known to {self.lost:.1e} only: it has too "
                "many, or some too close together. Runs do without that sum; use fewer here, or order=1."
            )
        result = polynomial(self.pieces[0][1:], u - self.pieces[0][0])
        if not self.kinks:
            return result
        jumps = [jump for jump in self.jumps if any(jump)]
        return result + ca.sum1(
            weight * polynomial([*map(ca.DM, zip(*jumps, strict=True))], beyond)
        )

    def moved(self, factor: float, shift: float) -> Curve:
        """The curve of an argument u, at factor u + shift."""
        if (factor, shift) == (1.0, 0.0):
            return self
        way, powers = slice(None, None, 1 if factor > 0 else -1), factor ** np.arange(4)
        levels = [(level - shift) / factor + 0.0 for level in self.levels[way]]
        pieces = [
            ((base - shift) / factor, *(powers * c).tolist()) for base, *c in self.pieces[way]
        ]
        jumps = [tuple((np.sign(factor) * powers * c).tolist()) for c in self.jumps[way]]
        closed = self.closed if factor > 0 else (self.closed[1], self.closed[0])
        return Curve(tuple(levels), tuple(pieces), tuple(jumps), closed)

    @cached_property
    def lost(self) -> float:
        """Error of that sum, as part of the largest value."""
        x = np.array(self.levels)
        if not len(x):
            return 0.0
        ends = np.concatenate(
            [[2 * x[0] - x[min(1, len(x) - 1)]], x, [2 * x[-1] - x[max(len(x) - 2, 0)]]]
        )
        at = np.concatenate([ends, (ends[:-1] + ends[1:]) / 2])[:: 1 + len(x) // 100]
        rows = np.array(self.pieces)[np.searchsorted(x, at, side="right")]
        base, *c = self.pieces[0]
        found = np.polynomial.polynomial.polyval(at - base, c)
        beyond = np.maximum(at[:, None] - x, 0.0)
        found += np.einsum(
            "ij,jk,ijk->i",
            np.ones_like(beyond),
            np.array(self.jumps),
            beyond[..., None] ** np.arange(4),
        )
        exact = np.einsum("ik,ik->i", rows[:, 1:], (at - rows[:, 0])[:, None] ** np.arange(4))
        return float(np.abs(found - exact).max() / max(np.abs(exact).max(), np.finfo(float).tiny))

    def _chosen(self, u: ca.SX) -> ca.SX:
        """The piece of the argument's cell, by halving."""
        base, *c = [ca.DM(column) for column in zip(*self.pieces, strict=True)]
        values, levels = polynomial(c, u - base), list(self.levels)
        while levels:  # each even cell with the one above it
            odd = values[-1:] if len(levels) % 2 == 0 else values[:0]
            below, above = values[: len(levels) + 1 - odd.numel() : 2], values[1::2]
            is_below = u < ca.DM(levels[::2])
            values = operation("if_else_zero", [is_below, below]) + operation(
                "if_else_zero", [ca.logic_not(is_below), above]
            )
            values, levels = ca.vertcat(values, odd), levels[1::2]
        return values


_MARKED: OrderedDict[float, Curve] = OrderedDict()


def polynomial(c: Sequence[Any], u: ca.SX) -> ca.SX:
    """A polynomial with coefficients from the lowest."""
    result = ca.SX(0)
    for a in c[::-1]:
        result = result * u + a
    return result


def with_curves(nodes: list[Node], rows: list[list[int]]) -> tuple[list[Node], list[list[int]]]:
    """A graph in which a marked curve is a node ``curve`` of its argument, with the curve as payload.

    One on which a switch depends stays as it is without its mark, and so does a single kink.
    """
    constants = {
        j: cast("float", node.payload) for j, node in enumerate(nodes) if node.op == "const"
    }
    sums = {
        j: (constants[one], other, node.op == "sub")
        for j, node in enumerate(nodes)
        if node.op in ("add", "sub")
        for one, other in (node.args, node.args[::-1])
        if one in constants and (node.op == "add" or one == node.args[0])
    }
    curves = {j: _MARKED[c / 2.0] for j, (c, *_) in sums.items() if c / 2.0 in _MARKED}
    switched, arguments = _switched(nodes) if curves else [], [node.args for node in nodes]
    inner = dict[int, int]()
    for j, curve in curves.items():
        found = None if switched[j] else _argument(nodes[j].args, sums[j][0] / 2.0, nodes, sums)
        if found is not None and len(curve.levels) + sum(curve.closed) > 1:
            inner[j], arguments[j] = found, (sums[found][1],)
    ends = {j for j, (c, *_) in sums.items() if c in _MARKED and any(_MARKED[c].closed)}
    if ends - {*inner.values()}:
        raise DefinitionError(
            "table: outside='error' holds for the value of a table, not for its derivative or within another switch as "
            "sign. Use 'constant' or 'linear', and a Stop at each end."
        )
    unmarked = {
        j: own for j, own in sums.items() if j not in inner and (j in curves or own[0] in _MARKED)
    }
    arguments = [(unmarked[j][1],) if j in unmarked else own for j, own in enumerate(arguments)]
    made, number = list[Node](), dict[int, int]()
    for j in reached(arguments, [True] * len(nodes), [j for row in rows for j in row]):
        args = tuple(number[k] for k in arguments[j])
        if sums[inner[j]][2] if j in inner else j in unmarked and unmarked[j][2]:
            made.append(Node("neg", args))
            args = (len(made) - 1,)
        if j in unmarked:
            number[j] = args[0]
            continue
        made.append(Node("curve", args, curves[j]) if j in inner else nodes[j]._replace(args=args))
        number[j] = len(made) - 1
    return made, [[number[j] for j in row] for row in rows]


def _switched(nodes: Sequence[Node]) -> list[bool]:
    """Nodes on which a switch depends."""
    found = [False] * len(nodes)
    for j in reversed(range(len(nodes))):
        op, args = nodes[j].op, nodes[j].args
        own = args if found[j] else args[:1] if op == "if_else_zero" else args * (op in NOT_SMOOTH)
        for k in own:
            found[k] = True
    return found


def _argument(
    roots: Sequence[int],
    mark: float,
    nodes: Sequence[Node],
    sums: Mapping[int, tuple[float, int, bool]],
) -> int | None:
    """The node from which a curve with a mark is made; None where it is not one."""
    found, seen, pending = set[int](), set[int](), list(roots)
    while pending:
        j = pending.pop()
        if j in seen:
            continue
        seen.add(j)
        if j in sums and sums[j][0] == mark:
            found.add(j)
        else:
            pending += nodes[j].args
    return found.pop() if len(found) == 1 else None
