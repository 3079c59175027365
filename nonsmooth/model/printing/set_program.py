"""The functions of a system with one set, for lanes, as a C program: a jet for each of its modes.

Off the set lambda = h/|h|; on it the unknowns nu = factor lambda keep h' = G at zero; where it is left h = r u
with |u| = 1 and u = lambda (``multiplier_series``). Each is written out order by order.

Near a set that is reached or was left, series in time converge up to the branch point there only. With dt = (1 - w s/3)^2 ds, 1/w the time to
it (negative: since it), that point is at s = 3/w, and a step of a part f of the way in s is one of
1 - (1 - f)^3 in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from ..definition.system import FilippovSystem
from ..expressions.graph import depends_on, instructions
from ..expressions.jets import Coefficient, Expansion, Expressions, scaled, value_of
from ..expressions.simplification import simplified
from ..expressions.taylor_rules import lower, touched
from ..laws.coupled import Coupled
from .ccode import Program

#: Lines of functions that are short.
_SHORT = 150


@dataclass(frozen=True)
class SetProgram:
    """A program and its sizes."""

    text: str
    rows: tuple[int, ...]
    on_rows: tuple[int, ...]
    bent_slip: bool
    bent_stops: bool
    states: tuple[int, ...]


def set_program(coupled: Coupled, order: int) -> SetProgram:
    """Write the functions of a system with one set of codimension two or more and nothing else."""
    return _Writer(coupled, order).program()


class _Writer:
    def __init__(self, coupled: Coupled, order: int):
        system: FilippovSystem = coupled.system
        self.system, self.order = system, order
        self.x, self.p = system.extended_states, system.parameter_symbols
        self.n, self.k = int(self.x.numel()), system.surface_count
        self.lam, self.stretch = coupled.multipliers, ca.SX.sym("stretch")
        nu = ca.vertcat(*[coupled.unknown(i) for i in range(self.k)])
        field, layer, heights, factor, stops = coupled.outputs
        none = ca.SX.zeros(self.k, 1)
        #: Field, layer and stops off the set in states and lambda; on it in states and nu.
        self.scaled = coupled.scaled[0]
        off = ca.substitute([field, layer], [nu], [none]) if self.scaled else [field, layer]
        on = ca.substitute([field, layer], [self.lam], [none]) if self.scaled else [field, layer]
        self.off_field, self.off_layer = (ca.densify(e) for e in off)
        self.on_field, self.on_layer = (ca.densify(e) for e in on)
        self.nu, self.heights, self.factor = nu, ca.densify(heights), factor[0]
        if self.scaled:
            self._count_in_loads()
        self.stops = stops
        self.pull = ca.jacobian(self.off_layer, self.lam)  # -M of h' = a - M lambda
        self.push = ca.jacobian(self.on_layer, nu)
        rates = ca.substitute(self.on_layer, nu, none)
        self.nu_at = -_inverse(self.push) @ rates

    def _count_in_loads(self) -> None:
        """Let the factor be a load as the field has it, if it has one: the same sums, expanded once."""
        loads = ca.densify(ca.jacobian(self.off_field, self.lam[0]))
        parts = ca.densify(ca.jacobian(self.on_field, self.nu[0]))
        for load, part in zip(ca.vertsplit(loads), ca.vertsplit(parts), strict=True):
            if not load.is_zero() and not ca.depends_on(part, self.x):
                on = [self.on_field, self.on_layer]
                self.on_field, self.on_layer = ca.substitute(on, [self.nu], [self.nu / part])
                self.factor = load
                return

    def program(self) -> SetProgram:
        x, k = self.x, self.k
        program = Program(x, self.p, ca.vertcat(self.lam, self.stretch), ("T",) * (k + 1))
        program.add("off_jet", **self._off())
        program.add("on_jet", **self._on())
        program.add("leave_jet", **self._leave())
        program.add("height_values", h=self.heights, gradient=_gradient(self.heights, x))
        rates = ca.substitute(self.off_layer, self.lam, ca.SX.zeros(k, 1))
        program.add("frozen_values", a=rates, m=-self.pull)
        program.add("field_values", f=self.off_field)
        own = ca.substitute(self.off_field, self.lam, ca.SX.zeros(k, 1))
        flow = self.stretch * own + ca.jacobian(self.off_field, self.lam) @ self.lam
        program.add("flow_values", f=flow)
        program.add("stop_values", value=self.stops, gradient=_gradient(self.stops, x))
        used = ca.vertcat(self.nu_at, self.factor)
        program.add("slip_values", value=used, gradient=_gradient(used, x))
        radius = ca.sqrt(ca.sumsqr(self.heights))
        off = ca.substitute(self.off_field, self.lam, self.heights / radius)
        on = ca.substitute(self.on_field, self.nu, self.nu_at)
        rows, on_rows = (
            tuple(i for i in range(self.n) if not ca.is_linear(f[i], x)) for f in (off, on)
        )
        program.add("off_check", f=off[list(rows)], value=self.stops)
        program.add("on_check", f=on[list(on_rows)], value=self.stops)
        bent_slip = not ca.is_linear(used, x)
        bent_stops = bool(self.stops.numel()) and not ca.is_linear(self.stops, x)
        text = self._slopes(height=self.heights, slip=used, stop=self.stops)
        text += _short_inline(program.text())
        return SetProgram(text, rows, on_rows, bent_slip, bent_stops, self._states())

    def _slopes(self, **functions: ca.SX) -> str:
        """Which of their derivatives by states are not zero."""
        lines = []
        for name, values in functions.items():
            there = [
                [int(not e.is_zero()) for e in ca.horzsplit(row)]
                for row in ca.vertsplit(_gradient(values, self.x))
            ]
            rows = ", ".join("{" + ", ".join(map(str, row)) + "}" for row in there) or "{0}"
            lines.append(
                f"__attribute__((unused)) static const char {name.upper()}_SLOPES[][N] = {{{rows}}};\n"
            )
        return "".join(lines)

    def _states(self) -> tuple[int, ...]:
        found = []
        for h in ca.vertsplit(self.heights):
            found += [i for i in range(self.n) if ca.is_equal(h, self.x[i])]
        return tuple(found) if len(found) == self.k else ()

    # jets --------------------------------------------------------------------------------------

    def _expansion(self, outputs: Sequence[ca.SX], unknowns: ca.SX) -> tuple[Expansion, list[int]]:
        """The series of some outputs in states and unknowns, and the rules that unknowns enter."""
        inputs = [ca.vertcat(self.x, unknowns), self.p]
        outputs = [ca.densify(e) for e in outputs]
        nodes, rows = instructions(inputs, simplified(inputs, outputs, [True, False]))
        rules, rule_of = lower(nodes, depends_on(nodes, [True, False]))
        rows = [[rule_of[j] for j in row] for row in rows]
        still = [self.p[i] for i in range(self.p.numel())]
        return Expansion(rules, rows, still, Expressions()), touched(rules, self.n)

    def _off(self) -> dict[str, ca.SX]:
        """Off the set: coefficients of states, of |h| over its first, of stops; the last ones of h."""
        field, unknowns = (self.on_field, self.nu) if self.scaled else (self.off_field, self.lam)
        outputs = [field, self.heights, self.factor, self.stops]
        expansion, late = self._expansion(outputs, unknowns)
        jet = self._begin()
        direction = _Direction(self.k, self.scaled)
        stops: list[list[Coefficient]] = []
        fields: list[list[Coefficient]] = []
        none: list[Coefficient] = [None] * self.k
        for k in range(self.order + 1):
            now = [row[k] for row in jet]
            if k == 0:
                heights = [clean(h) for h in ca.vertsplit(self.heights)]
                known = expansion.advance(0, [*now, *direction.push(0, heights, self.factor)])
            else:
                _, heights, (factor,), _ = expansion.advance(k, [*now, *none])
                known = expansion.again(k, [*now, *direction.push(k, heights, factor)], late)
            stops.append(known[3])
            fields.append(known[0])
            if k < self.order:
                for row, value in zip(jet, self._stretched(fields), strict=True):
                    row.append(value)
        return dict(
            c=_matrix(jet),
            g=_matrix([direction.root, *zip(*stops, strict=True)]),
            ends=_column([row[k] for row in direction.own for k in (self.order - 1, self.order)]),
            radius=direction.radius,
        )

    def _on(self) -> dict[str, ca.SX]:
        """On the set: coefficients of states, of stops, of the unknowns and of their limit."""
        outputs = [self.on_field, self.on_layer, self.factor, self.stops]
        expansion, late = self._expansion(outputs, self.nu)
        jet = self._begin()
        inverse = _inverse(self.push)
        first: list[Coefficient] = [clean(e) for e in ca.vertsplit(self.nu_at)]
        series: list[list[Coefficient]] = [[] for _ in range(self.k)]
        limit: list[Coefficient] = []
        stops: list[list[Coefficient]] = []
        for k in range(self.order + 1):
            now = [row[k] for row in jet]
            known = expansion.advance(k, [*now, *(first if k == 0 else [None] * self.k)])
            found = first
            if k:
                found = [clean(e) for e in ca.vertsplit(-inverse @ _column(known[1]))]
                known = expansion.again(k, [*now, *found], late)
            for row, value in zip(series, found, strict=True):
                row.append(value)
            limit.append(known[2][0])
            stops.append(known[3])
            self._next(jet, known[0], k)
        room = [
            clean(
                value_of(_square(limit, k))
                - sum((value_of(_square(row, k)) for row in series), ca.SX(0))
            )
            for k in range(self.order + 1)
        ]
        return dict(
            c=_matrix(jet), g=_matrix([room, *zip(*stops, strict=True), limit]), nu=_matrix(series)
        )

    def _leave(self) -> dict[str, ca.SX]:
        """Leaving the set at no rate yet."""
        expansion, late = self._expansion([self.off_field, self.off_layer, self.stops], self.lam)
        jet = self._begin()
        start = self.lam
        inverse = _inverse(self.pull)
        turned = inverse @ start
        per = 1 / ca.dot(start, turned)
        u: list[list[Coefficient]] = [[start[i]] for i in range(self.k)]
        radius: list[Coefficient] = [None, None]
        stops: list[list[Coefficient]] = []
        for k in range(self.order + 1):
            now = [row[k] for row in jet]
            known = expansion.advance(
                k, [*now, *([row[0] for row in u] if k == 0 else [None] * self.k)]
            )
            if k:
                right = -_column(known[1])
                for i in range(self.k):
                    right[i] += (k + 1) * value_of(_products(u[i], radius, 1, k - 1, k + 1))
                short = sum(
                    (value_of(_inner(row, k)) for row in u), ca.SX(0)
                )  # half of the squares
                back = inverse @ right
                rate = (-short - ca.dot(start, back)) * per
                found = back + rate * turned
                for row, value in zip(u, ca.vertsplit(found), strict=True):
                    row.append(clean(value))
                radius.append(clean(rate / (k + 1)))
                known = expansion.again(k, [*now, *[row[k] for row in u]], late)
            stops.append(known[2])
            self._next(jet, known[0], k)
        distance = [*radius[2:], *[None] * (self.order + 3 - len(radius))]
        return dict(
            c=_matrix(jet), g=_matrix([distance, *zip(*stops, strict=True)]), u=_matrix(u)
        )  # fmt: skip

    def _stretched(self, fields: Sequence[Sequence[Coefficient]]) -> list[Coefficient]:
        """The next coefficients of states, from those of (1 - w s/3)^2 times the field."""
        w, per = self.stretch, 1.0 / len(fields)
        weights = (per, w * (-2 / 3 * per), w * w * (1 / 9 * per))
        result = []
        for row in zip(*reversed(fields[-3:]), strict=True):
            terms = [weights[i] * value_of(c) for i, c in enumerate(row) if c is not None]
            result.append(clean(sum(terms[1:], terms[0])) if terms else None)
        return result

    def _begin(self) -> list[list[Coefficient]]:
        return [[self.x[i]] for i in range(self.n)]

    def _next(self, jet: list[list[Coefficient]], field: Sequence[Coefficient], k: int) -> None:
        if k < self.order:
            for row, value in zip(jet, field, strict=True):
                row.append(scaled(value, 1.0 / (k + 1)))


class _Direction:
    """The series of h/|h|, or of n h/|h|, and of |h| over its first value, as expressions (``Direction``)."""

    def __init__(self, size: int, scaled: bool):
        self.own: list[list[Coefficient]] = [[] for _ in range(size)]
        self.u: list[list[Coefficient]] = [[] for _ in range(size)]
        self.root: list[Coefficient] = []
        self.radius, self._per = ca.SX(1), ca.SX(1)
        self._scaled, self._part = scaled, list[Coefficient]()  # of n |h| at first over |h|

    def push(self, k: int, h: Sequence[Coefficient], factor: Coefficient) -> list[Coefficient]:
        """Coefficients k of the direction, or n times that, from those of h and of n."""
        if k == 0:
            self.radius = ca.sqrt(ca.sumsqr(_column(h)))
            self._per = 1 / self.radius
        for row, value in zip(self.own, h, strict=True):
            row.append(None if value is None else value * self._per)
        if k == 0:
            self.root.append(ca.SX(1))
        else:
            total = sum((value_of(row[0]) * value_of(row[k]) for row in self.own), ca.SX(0))
            curved = sum((value_of(_inner(row, k)) for row in self.own), ca.SX(0))
            self.root.append(clean(total + (curved - value_of(_inner(self.root, k)))))
        if self._scaled:
            # (n/|h|) h has a product less than n (h/|h|).
            known = _products(self._part, self.root, 0, k - 1, k)
            self._part.append(clean(value_of(factor) - value_of(known)))
            return [_products(self._part, row, 0, k, k) for row in self.own]
        for row, own in zip(self.u, self.own, strict=True):
            known = _products(row, self.root, 0, k - 1, k)
            row.append(clean(value_of(own[k]) - value_of(known)))
        return [row[k] for row in self.u]


def _short_inline(text: str) -> str:
    """Let compilers see into short functions that are needed in parts: their other outputs are then not computed."""
    for name in ("height", "frozen", "slip", "stop"):
        head, body = f"FUNCTION {name}_values(", text.partition(f"FUNCTION {name}_values(")[2]
        if body.partition("\n}\n")[0].count("\n") <= _SHORT:
            text = text.replace(head, f"INLINE void {name}_values(")
    return text


def clean(a: ca.SX) -> Coefficient:
    """Return None for zero."""
    return None if a.is_zero() else a


def _products(
    u: Sequence[Coefficient], v: Sequence[Coefficient], first: int, last: int, k: int
) -> Coefficient:
    """Sum of u_i v_(k-i) for i from first to last."""
    total: Coefficient = None
    for i in range(first, last + 1):
        a, b = u[i], v[k - i]
        if a is not None and b is not None:
            total = a * b if total is None else total + a * b
    return total


def _inner(row: Sequence[Coefficient], k: int) -> Coefficient:
    """Half of coefficient k of a square, without its first and last products."""
    total = _products(row, row, 1, (k - 1) // 2, k)
    middle = row[k // 2] if k % 2 == 0 and k else None
    if middle is None:
        return total
    half = 0.5 * (middle * middle)
    return half if total is None else total + half


def _square(row: Sequence[Coefficient], k: int) -> Coefficient:
    """Coefficient k of a square."""
    ends = _products(row, row, 0, 0, k)
    if k == 0:
        return ends
    total = value_of(ends) + value_of(_inner(row, k))
    return clean(2.0 * total)


def _inverse(m: ca.SX) -> ca.SX:
    """Inverse of a matrix of two or three rows, from its cofactors."""
    m = ca.densify(m)
    if m.shape[0] == 2:
        adjugate = ca.vertcat(ca.horzcat(m[1, 1], -m[0, 1]), ca.horzcat(-m[1, 0], m[0, 0]))
    else:
        adjugate = ca.adj(m)
    determinant = ca.mtimes(m[0, :], adjugate[:, 0])
    return adjugate * (1 / determinant)


def _gradient(functions: ca.SX, x: ca.SX) -> ca.SX:
    return ca.densify(ca.jacobian(functions, x)) if functions.numel() else ca.SX(0, x.numel())


def _column(values: Sequence[Coefficient]) -> ca.SX:
    return ca.vertcat(*[value_of(v) for v in values])


def _matrix(rows: Sequence[Sequence[Coefficient]], order: int = 0) -> ca.SX:
    if not rows:
        return ca.SX(0, order + 1)
    return ca.vertcat(*[ca.horzcat(*[value_of(v) for v in row]) for row in rows])
