"""Tables in a definition: the element of one argument, and the two systems that follow from it.

A definition with tables has a parameter for the value of each curve, and the argument of each element among its
surfaces. ``by_pieces`` makes of it the system of runs: the values are polynomials whose coefficients are parameters,
which the cell of the element sets. ``by_breakpoints`` makes the system in which each breakpoint is a surface.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ...reading import listed
from ...values import Array
from ..elements import Element, Entry
from .curves import Curve, polynomial

if TYPE_CHECKING:
    from ..parse_definition import Definition


#: Zeros that are this close, relatively, are one.
_SAME = 1e-15

#: Surfaces by number, and a side of each.
Sides = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Argument(Element):
    """The argument of tables, in place of a surface."""

    function: ca.SX

    def entry(self, what: str) -> Entry:
        """Read nothing: the function was made by lifting."""
        del what
        return Entry("table", (self.function,), (ca.SX(0),))


@dataclass(frozen=True)
class Table:
    """The curves of one argument.

    Attributes
    ----------
    element : int
        The argument's index among the surfaces.
    curves : tuple of Curve
        Their values are parameters of the definition, in their order.
    sides : tuple of Sides
        Sides on which each curve is in use.
    twins : tuple of (breakpoint, surface, sign)
        Breakpoints, by number, at the zeros of other surfaces, whose functions have this sign above.
    """

    element: int
    curves: tuple[Curve, ...]
    sides: tuple[Sides, ...]
    twins: tuple[tuple[int, int, int], ...] = ()

    @cached_property
    def levels(self) -> tuple[float, ...]:
        """Breakpoints of all curves."""
        return tuple(sorted({level for curve in self.curves for level in curve.levels}))

    @cached_property
    def shown(self) -> tuple[int, ...]:
        """The number of each among those that are surfaces; -1 for what is no kink of a curve, or a surface already."""
        kinks = {x for curve in self.curves for x in curve.kinks} - {
            self.levels[k] for k, *_ in self.twins
        }
        numbers = {level: i for i, level in enumerate(sorted(kinks))}
        return tuple(numbers.get(level, -1) for level in self.levels)

    @property
    def limits(self) -> list[tuple[int, int, Sides]]:
        """Of curves with ends the first and the last cell, and the sides on which it is in use."""
        found = []
        for curve, sides in zip(self.curves, self.sides, strict=True):
            low, high = curve.closed
            first = self.levels.index(curve.levels[0]) + 1 if low else 0
            last = self.levels.index(curve.levels[-1]) if high else len(self.levels)
            found += [(first, last, sides)] * (low or high)
        return found

    @cached_property
    def count(self) -> int:
        """Number of its breakpoints that are surfaces."""
        return max(self.shown, default=-1) + 1

    def values(self) -> Array:
        """For each cell (k + 1,), for each curve the number and the coefficients of its piece."""
        rows = []
        for curve in self.curves:
            cells = [0, *[bisect_right(curve.levels, level) for level in self.levels]]
            rows.append(np.array(curve.pieces)[cells])
        return np.hstack(rows)


def twins_of(table: Table, zeros: Sequence[tuple[float, int, int]]) -> Table:
    """The same with the breakpoints that are zeros of other surfaces: an argument, the surface and its sign above."""
    levels = np.array(table.levels)
    pairs = [(int(np.abs(levels - x).argmin()), x, i, sign) for x, i, sign in zeros if len(levels)]
    same = [(k, i, sign) for k, x, i, sign in pairs if abs(levels[k] - x) <= _SAME * abs(x)]
    return replace(table, twins=tuple(same))


def _parted(d: Definition) -> tuple[ca.SX, list[list[ca.SX]]]:
    """Parameters of the user, and values of the curves of each table."""
    every = listed(d.parameters)
    counts = [len(table.curves) for table in d.tables]
    ends = list(accumulate(counts, initial=len(every) - sum(counts)))
    own = ca.vertcat(*every[: ends[0]]) if ends[0] else ca.SX(0, 1)
    return own, [every[a:b] for a, b in pairwise(ends)]


def by_pieces(d: Definition) -> Definition:
    """The definition in which the pieces of a cell are parameters: five for each curve."""
    (p, values), cells, pieces = _parted(d), list[ca.SX](), list[ca.SX]()
    for table, own in zip(d.tables, values, strict=True):
        u = d.surfaces[table.element]
        for value, curve in zip(own, table.curves, strict=True):
            base, *c = [ca.SX.sym(f"{value.name()}_{j}") for j in range(5)]
            cells += [base, *c]
            degree = max((j for piece in curve.pieces for j in range(4) if piece[1 + j]), default=0)
            pieces.append(polynomial(c[: degree + 1], u - base))
    every = ca.vertcat(*[value for own in values for value in own])
    field = ca.substitute(d.field, every, ca.vertcat(*pieces))
    defaults = d.defaults | {cell.name(): 0.0 for cell in cells}
    return replace(d, parameters=ca.vertcat(p, *cells), field=field, defaults=defaults, tables=())


def first_surfaces(d: Definition) -> list[int]:
    """The first surface of each function where breakpoints are surfaces, and their number."""
    counts = {table.element: table.count for table in d.tables}
    return [*accumulate((counts.get(i, 1) for i in range(d.surfaces.numel())), initial=0)]


def beyond_cells(d: Definition, signs: Sequence[float]) -> set[int]:
    """Surfaces of breakpoints that are not adjacent to the cell given by signs: others are reached before them."""
    positions, found = first_surfaces(d), set[int]()
    for table in d.tables:
        first = positions[table.element]
        own = signs[first : first + table.count]
        above = own.count(1)
        if own[:above].count(1) == above and own.count(-1) == table.count - above:
            found |= {*range(first, first + table.count)} - {first + above - 1, first + above}
    return found


def in_cells(d: Definition, signs: Sequence[float]) -> ca.SX | None:
    """The field where surfaces and breakpoints have signs; None where these are of no cell."""
    positions, (_, values), found = first_surfaces(d), _parted(d), list[ca.SX]()
    elements = {table.element for table in d.tables}
    own = [signs[k] if i not in elements else 0.0 for i, k in enumerate(positions[:-1])]
    for table in d.tables:
        above = {
            k: signs[positions[table.element] + i] for k, i in enumerate(table.shown) if i >= 0
        }
        above |= {k: sign * signs[positions[i]] for k, i, sign in table.twins}
        cell = max((k + 1 for k, sign in above.items() if sign == 1), default=0)
        if any(sign != (1 if k < cell else -1) for k, sign in above.items()):
            return None
        u, pieces = d.surfaces[table.element], table.values()[cell].reshape(-1, 5)
        found += [polynomial(c, u - base) for base, *c in pieces.tolist()]
    known = [*[value for each in values for value in each], *listed(d.multipliers)]
    return ca.substitute(d.field, ca.vertcat(*known), ca.vertcat(*found, *own))


def by_breakpoints(d: Definition) -> Definition:
    """The definition in which each breakpoint is a surface with a multiplier."""
    p, values = _parted(d)
    surfaces, multipliers = [[*ca.vertsplit(e)] for e in (d.surfaces, d.multipliers)]
    shown = [([h], [lam]) for h, lam in zip(surfaces, multipliers, strict=True)]
    sums = []
    for table in d.tables:
        u, name = surfaces[table.element], multipliers[table.element].name()
        levels = {level: i for level, i in zip(table.levels, table.shown, strict=True) if i >= 0}
        own = [ca.SX.sym(f"{name}_{i}") for i in range(table.count)]
        shown[table.element] = (ca.vertsplit(u - ca.DM([*levels])) if levels else [], own)
        above = {level: own[i] for level, i in levels.items()}
        above |= {table.levels[k]: sign * multipliers[i] for k, i, sign in table.twins}
        sums.append((u, above, table.curves))

    def field() -> ca.SX:
        found = []
        for u, above, curves in sums:
            for curve in curves:
                weights = [(1 + above[x]) / 2 for x in curve.kinks]
                found.append(curve.summed(u, u - ca.DM(curve.kinks), ca.vertcat(*weights)))
        return ca.substitute(
            d.field, ca.vertcat(*[value for own in values for value in own]), ca.vertcat(*found)
        )

    positions = first_surfaces(d)
    breakpoints = [positions[table.element] + i for table in d.tables for i in range(table.count)]
    laws = tuple(
        name
        for law, own in zip(d.laws, shown, strict=True)
        for name in (("surface",) * len(own[0]) if law == "table" else (law,))
    )
    return replace(
        d,
        parameters=p,
        field=field,
        surfaces=ca.vertcat(*[h for own, _ in shown for h in own]),
        multipliers=ca.vertcat(*[lam for _, own in shown for lam in own]),
        laws=laws if set(laws) - {"surface"} else (),
        tables=(),
        breakpoints=frozenset(breakpoints),
    )
