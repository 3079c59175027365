"""The functions of a system with one set, for lanes, as a C program: a jet for each of its modes.

Off the set lambda = h/|h|; on it the unknowns nu = factor lambda keep h' = G at zero; where it is left h = r u
with |u| = 1 and u = lambda (``multiplier_series``). Each is written out order by order.

Near a set that is reached or was left, series in time converge up to the branch point there only. With dt = (1 - w s/3)^2 ds, 1/w the time to
it (negative: since it), that point is at s = 3/w, and a step of a part f of the way in s is one of
1 - (1 - f)^3 in time.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from ..laws.coupled import Coupled
from .ccode import Program
from .programs import Shape
from .terms import Graph, OfInstructions, Term, Terms

Rows = list[list["Term | None"]]


def set_program(coupled: Coupled, order: int) -> tuple[str, Shape]:
    """Write the functions of a system with one set of codimension two or more and nothing else."""
    return _Writer(coupled, order).program()


class _Writer(OfInstructions):
    """Its modes in terms."""

    def __init__(self, coupled: Coupled, order: int):
        super().__init__(coupled)
        self.order, self.k, self.scaled = order, self.m, coupled.scaled[0]
        self._none: list[Term | None] = [None] * (order + 1)
        *self.lam, self.stretch = self.graph.inputs(2, self.k + 1)
        point = self.point(self._acting(None))
        self.rates, self.factor = point.layer, point.factors[0]
        self.rate_slopes, self.factor_slopes = point.layer_gradient, point.factor_gradient[: self.n]
        self.push = [point.slope[i * self.k : (i + 1) * self.k] for i in range(self.k)]
        self.pull = [self._scaled(row) for row in self.push]  # -M of h' = a - M lambda

    def _scaled(self, row: Terms) -> list[Term | None]:
        """The unknown of each multiplier."""
        return [self.graph.inner([e], [self.factor]) if self.scaled else e for e in row]

    def _acting(
        self, unknowns: Terms | None, multipliers: Terms | None = None
    ) -> list[Term | None]:
        """Multipliers, and unknowns where these are others."""
        none: list[Term | None] = [None] * self.k
        if not self.scaled:
            return [*(unknowns or multipliers or none)]
        return [*(multipliers or none), *(unknowns or none)]

    def program(self) -> tuple[str, Shape]:
        graph, program = self.graph, Program(self.graph, ("T",) * (self.k + 1))
        jets = {"off": self._off(), "on": self._on(), "leave": self._leave()}
        for name, jet in jets.items():
            arrays = {key: [e for row in rows for e in row] for key, rows in jet.items()}
            program.add(f"{name}_jet", **arrays)
        heights, height_slopes = self.surfaces()
        stops, stop_slopes = self.stops()
        slip, slip_slopes = self._slip()
        program.add("surface_values", h=heights, gradient=height_slopes)
        negative = [None if e is None else -e for row in self.pull for e in row]
        program.add("frozen_values", a=self.rates, m=negative)
        free, field = (self.expansion((0,)).advance(0, [*self.x, *own])[0] for own in (
            self._acting(None), self._acting(None, self.lam)))  # fmt: skip
        program.add("field_values", f=field)
        columns = self.columns(self._acting(None))
        acts = [graph.inner([lam], [self.factor]) if self.scaled else lam for lam in self.lam]
        flow = [
            graph.total(graph.inner([self.stretch], [own]), graph.inner(row, acts))
            for own, row in zip(free, columns, strict=True)
        ]
        program.add("flow_values", f=flow)
        program.add("stop_values", value=stops, gradient=stop_slopes)
        program.add("slip_values", value=slip, gradient=slip_slopes)
        shape = self._shape([self.x.index(h) for h in heights if h in self.x])
        for name in ("off", "on"):
            series = [row[0] for row in jets[name]["g"]]
            own = [series[j] if j < len(series) else None for j in shape.slots]
            program.add(f"{name}_check", f=[jets[name]["c"][i][1] for i in shape.rows], g=own)
        return program.text(), shape

    def _slip(self) -> tuple[list[Term | None], list[Term | None]]:
        """The unknowns that keep h' at zero and their limit, with their gradients."""
        values = [*self._kept(self.rates), self.factor]
        n, slopes = self.n, list[Term | None]()
        columns = [self._kept(self.rate_slopes[j::n]) for j in range(n)]
        for i in range(self.k):
            slopes += [column[i] for column in columns]
        return values, [*slopes, *self.factor_slopes]

    def _kept(self, rates: Terms) -> list[Term | None]:
        """The unknowns that take rates away."""
        found = self._times(_inverse(self.graph, self.push), rates)
        return [None if e is None else -e for e in found]

    def _times(self, matrix: Sequence[Terms], vector: Terms) -> list[Term | None]:
        return [self.graph.inner(row, vector) for row in matrix]

    def _shape(self, states: list[int]) -> Shape:
        """Affine parts off the set and on it; the unknowns follow the guards."""
        of, k = self.coupled, self.k
        x, unknown = of.system.extended_states, of.symbols_of(range(k))
        lam = of.multipliers if self.scaled else ca.SX(0, 1)
        field, layer = ca.substitute([of.field, of.layer], [lam], [ca.SX.zeros(lam.numel(), 1)])
        free = ca.substitute([field, layer], [unknown], [ca.SX.zeros(k, 1)])
        kept = -ca.mtimes(ca.inv(ca.jacobian(layer, unknown)), free[1])
        on, acts = ca.substitute(field, unknown, kept), of.columns_of_field.sparsity().row()
        rows = [i for i in range(self.n) if i in acts or not ca.is_linear(free[0][i], x)]
        affine = [True, True, *(ca.is_linear(e, x) for e in ca.vertsplit(of.stops) if e.numel())]
        slots = [j for j, known in enumerate(affine) if not known]
        slip = ca.is_linear(ca.vertcat(kept, of.factors[0]), x)
        modes = [False, slip and all(affine) and ca.is_linear(on, x), False]
        slots += [] if slip else [len(affine) + i for i in range(k)]
        return Shape(rows, slots, affine, modes, states if len(states) == k else ())

    # jets --------------------------------------------------------------------------------------

    def _off(self) -> dict[str, Rows]:
        """Off the set: coefficients of states, of |h| over its first, of stops; the last ones of h."""
        expansion = self.expansion((0, 2, 3, 4))
        jet = self.begun()
        direction = _Direction(self.graph, self.k, self.scaled)
        stops, fields = Rows(), Rows()
        for k in range(self.order + 1):
            now = [row[k] for row in jet]
            _, heights, factors, _ = expansion.advance(k, [*now, *self._acting(None)])
            found = direction.push(k, heights, factors[0])
            known = expansion.again(k, [*now, *self._acting(found)], self.late)
            stops.append(known[3])
            fields.append(known[0])
            if k < self.order:
                for row, value in zip(jet, self._stretched(fields), strict=True):
                    row.append(value)
        ends = [row[k] for row in direction.own for k in (self.order - 1, self.order)]
        guards = [direction.root, self._none, *map(list, zip(*stops, strict=True))]
        return dict(c=jet, g=guards, ends=[ends], radius=[[direction.radius]])

    def _on(self) -> dict[str, Rows]:
        """On the set: coefficients of states, of stops, of the unknowns and of their limit."""
        graph, expansion, jet = self.graph, self.expansion((0, 1, 3, 4)), self.begun()
        series: Rows = [[] for _ in range(self.k)]
        limit: list[Term | None] = []
        stops = Rows()
        for k in range(self.order + 1):
            now = [row[k] for row in jet]
            known = expansion.advance(k, [*now, *self._acting(None)])
            found = self._kept(known[1])
            known = expansion.again(k, [*now, *self._acting(found)], self.late)
            for row, value in zip(series, found, strict=True):
                row.append(value)
            limit.append(known[2][0])
            stops.append(known[3])
            self.extend(jet, known[0], k, self.order)
        room = []
        for k in range(self.order + 1):
            square: Term | None = None
            for row in series:
                square = graph.total(square, _square(graph, row, k))
            room.append(graph.difference(_square(graph, limit, k), square))
        return dict(c=jet, g=[room, limit, *map(list, zip(*stops, strict=True)), *series])

    def _leave(self) -> dict[str, Rows]:
        """Leaving the set at no rate yet."""
        graph, expansion, jet = self.graph, self.expansion((0, 1, 4)), self.begun()
        inverse = _inverse(graph, self.pull)
        turned = self._times(inverse, self.lam)
        per = graph.constant(1.0) / graph.whole(graph.inner(self.lam, turned))
        u: Rows = [[lam] for lam in self.lam]
        radius: list[Term | None] = [None, None]
        stops = Rows()
        for k in range(self.order + 1):
            now, none = [row[k] for row in jet], [None] * self.k
            first = self.lam if k == 0 else none
            known = expansion.advance(k, [*now, *self._acting(None, first)])
            if k:
                right: list[Term | None] = []
                for row, rate in zip(u, known[1], strict=True):
                    more = graph.convolved(row, radius, k + 1, 1, k - 1)
                    own = None if more is None else float(k + 1) * more
                    right.append(graph.difference(own, rate))
                short: Term | None = None  # half of the squares
                for row in u:
                    short = graph.total(short, _inner(graph, row, k))
                back = self._times(inverse, right)
                along = graph.total(short, graph.inner(self.lam, back))
                rate = graph.inner([graph.difference(None, along)], [per])
                for row, one, two in zip(u, back, turned, strict=True):
                    row.append(graph.total(one, graph.inner([rate], [two])))
                radius.append(None if rate is None else (1.0 / (k + 1)) * rate)
                known = expansion.again(
                    k, [*now, *self._acting(None, [row[k] for row in u])], self.late
                )
            stops.append(known[2])
            self.extend(jet, known[0], k, self.order)
        distance = [*radius[2:], *[None] * (self.order + 3 - len(radius))]
        return dict(c=jet, g=[distance, self._none, *map(list, zip(*stops, strict=True)), *u])

    def _stretched(self, fields: Rows) -> list[Term | None]:
        """The next coefficients of states, from those of (1 - w s/3)^2 times the field."""
        w, per = self.stretch, 1.0 / len(fields)
        weights = (self.graph.constant(per), (-2 / 3 * per) * w, (1 / 9 * per) * (w * w))
        return [
            self.graph.inner(weights[: len(row)], row)
            for row in zip(*reversed(fields[-3:]), strict=True)
        ]


class _Direction:
    """The series of h/|h|, or of n h/|h|, and of |h| over its first value (``Direction``)."""

    def __init__(self, graph: Graph, size: int, scaled: bool):
        self._graph = graph
        self.own: Rows = [[] for _ in range(size)]
        self.u: Rows = [[] for _ in range(size)]
        self.root: list[Term | None] = []
        self._scaled, self._part = scaled, list["Term | None"]()  # of n |h| at first over |h|

    def push(self, k: int, h: Terms, factor: Term | None) -> list[Term | None]:
        """Coefficients k of the direction, or n times that, from those of h and of n."""
        graph = self._graph
        if k == 0:
            self.radius = graph.apply("sqrt", [graph.inner(h, h)])
            self._per = graph.constant(1.0) / self.radius
        for row, value in zip(self.own, h, strict=True):
            row.append(None if value is None else value * self._per)
        if k == 0:
            self.root.append(graph.constant(1.0))
        else:
            total = graph.inner([row[0] for row in self.own], [row[k] for row in self.own])
            curved: Term | None = None
            for row in self.own:
                curved = graph.total(curved, _inner(graph, row, k))
            self.root.append(
                graph.total(total, graph.difference(curved, _inner(graph, self.root, k)))
            )
        if self._scaled:
            # (n/|h|) h has a product less than n (h/|h|).
            known = graph.convolved(self._part, self.root, k, 0, k - 1)
            self._part.append(graph.difference(factor, known))
            return [graph.convolved(self._part, row, k, 0, k) for row in self.own]
        for row, own in zip(self.u, self.own, strict=True):
            row.append(graph.difference(own[k], graph.convolved(row, self.root, k, 0, k - 1)))
        return [row[k] for row in self.u]


def _inner(graph: Graph, row: Terms, k: int) -> Term | None:
    """Half of coefficient k of a square, without its first and last products."""
    middle = row[k // 2] if k % 2 == 0 and k else None
    half = None if middle is None else 0.5 * (middle * middle)
    return graph.total(graph.convolved(row, row, k, 1, (k - 1) // 2), half)


def _square(graph: Graph, row: Terms, k: int) -> Term | None:
    """Coefficient k of a square."""
    ends = graph.inner([row[0]], [row[k]])
    total = graph.total(ends, _inner(graph, row, k)) if k else None
    return ends if k == 0 else None if total is None else 2.0 * total


def _inverse(graph: Graph, m: Sequence[Terms]) -> list[list[Term | None]]:
    """Inverse of a matrix of two or three rows, from its cofactors."""
    size = len(m)

    def cofactor(i: int, j: int) -> Term | None:
        rows, columns = ([(k + s) % size for s in range(1, size)] for k in (i, j))
        if size == 2:
            own = m[rows[0]][columns[0]]
            return graph.difference(None, own) if (i + j) % 2 else own
        (a, b), (c, d) = ([m[r][q] for q in columns] for r in rows)
        return graph.difference(graph.inner([a], [d]), graph.inner([b], [c]))

    adjugate = [[cofactor(j, i) for j in range(size)] for i in range(size)]
    determinant = graph.whole(graph.inner(m[0], [row[0] for row in adjugate]))
    per = graph.constant(1.0) / determinant
    return [[graph.inner([e], [per]) for e in row] for row in adjugate]
