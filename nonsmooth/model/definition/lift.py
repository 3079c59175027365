"""Lifting: sign, fabs, fmin, fmax, if_else and tables in an expression become surfaces and multipliers.

Each switch of the right-hand side is replaced by its values on the two sides of the zero set of a
smooth switching function h, with one multiplier lam = sgn h for all switches on the same set:

    sign(h)        lam                           h
    fabs(h)        lam h                         h
    fmax(a, b)     (1+lam)/2 a + (1-lam)/2 b     a - b
    fmin(a, b)     (1-lam)/2 a + (1+lam)/2 b     a - b
    a < b          (1+lam)/2                     b - a     also <=, and the condition of if_else
    copysign(a, b) fabs(a) sign(b)

A table is one element for each argument, on its sides like the other switches; its value in the field is a
parameter of a cell (``pieces.py``).

``not``, ``and``, ``or`` act on conditions. Two functions that differ by a constant factor are one
surface; the first one found is used, and a negative factor changes the sign of the multiplier.

A switch inside a switch, such as fmax(fmin(x, 1), -1), is expanded over the sides of the inner one:
sgn h(x, lam) = sum over lam = +1, -1 of its weight times sgn h(x, +-1). This is exact off the
surfaces. It adds a surface for each side, which has no effect where the inner switch is on its
other side.

The result is affine in each multiplier: Filippov's convention (Filippov 1988, sec. 4), by which
only the values beside a surface count. Where a multiplier enters in another way, as in sign(x)**2
or exp(sign(x)), it is replaced by the affine function with the same values at +1 and -1; this too
is exact off the surfaces. On the surface the expression as written could be read as Jeffrey's
hidden dynamics instead (Jeffrey 2018), with another sliding field: ``LiftedSwitch.hidden`` is
true then, and ``hidden=True`` keeps the expression. fabs(h), fmin and fmax are
continuous and leave no such choice: fabs(h) = 0 on h = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, cast

import casadi as ca

from ..errors import DefinitionError, NotSmoothError
from ..expressions.cancel import NormalForms, Sum, ratio, simple_zeros
from ..expressions.graph import (
    NOT_SMOOTH,
    POWERS,
    Expressions,
    evaluate,
    instructions,
    operation,
    power_of,
)
from .tables.curves import Curve, with_curves
from .tables.pieces import Argument, Sides, Table, twins_of


@dataclass(frozen=True)
class LiftedSwitch:
    """A surface that was found in an expression."""

    surface: str
    multiplier: str
    function: str
    origins: tuple[str, ...]
    hidden: bool = False

    def __str__(self) -> str:
        note = "; other readings on the surface: hidden dynamics" if self.hidden else ""
        return f"{self.surface} = {self.function} ({', '.join(self.origins)}){note}"


@dataclass
class Switch:
    """A surface under construction."""

    h: ca.SX
    lam: ca.SX
    even: ca.SX  # the multiplier inside continuous switches, which becomes ``lam`` at the end
    form: Sum = field(default_factory=dict)
    origins: list[str] = field(default_factory=list)
    hidden: bool = False


@dataclass
class Curves:
    """Tables of one argument under construction: curves, their values, the sides on which they are in use."""

    h: ca.SX
    form: Sum
    multiplier: ca.SX
    curves: list[Curve] = field(default_factory=list)
    values: list[ca.SX] = field(default_factory=list)
    sides: list[Sides] = field(default_factory=list)


class Switches:
    """Surfaces with their multipliers, and arguments of tables, in the order in which they are found."""

    def __init__(self, states: ca.SX, inputs: list[ca.SX]):
        self.states, self.inputs = states, inputs
        self.all: list[Switch] = []
        self.tables: list[Curves] = []
        self._forms = NormalForms(inputs)
        names = {str(s) for s in ca.vertsplit(ca.vertcat(*inputs))}
        self.prefix = next(p for p in _prefixes() if not any(n.startswith(p) for n in names))

    def __getitem__(self, number: int) -> Switch:
        return self.all[number]

    def find(self, h: ca.SX, origin: str) -> tuple[int | None, Any]:
        """Number of the surface h = 0 and the sign of h over its function; None, sgn h if constant."""
        factor, rest = _factored(h, self.inputs[0])
        if ca.symvar(factor):  # of parameters
            number, side = self.find(rest, origin)
            return number, ca.sign(factor) * side
        h = self._on_both_sides(simple_zeros(h, *self.inputs))
        form = self._forms.of(h)
        if all(monomial == () for monomial in form):
            c = form.get((), 0.0)
            return None, int(c > 0) - int(c < 0)
        for i, other in enumerate(self.all):
            c = ratio(form, other.form)
            if c:
                if origin not in self.all[i].origins:
                    self.all[i].origins.append(origin)
                return i, 1 if c > 0 else -1
        if not ca.depends_on(h, self.inputs[0]):
            raise DefinitionError(
                f"a switch: {origin} of {h} depends neither on the states nor on the time. Give a number "
                "in place of it, or make the parameter a state."
            )
        k = len(self.all)
        lam, even = ca.SX.sym(f"{self.prefix}{k}"), ca.SX.sym(f"{self.prefix}{k}_even")
        self.all.append(Switch(h, lam, even, form, [origin]))
        return k, 1

    def reduced(self, e: ca.SX) -> ca.SX:
        """An expression, as a number where all else in it cancels."""
        form = self._forms.of(e)
        return ca.SX(form.get((), 0.0)) if not form.keys() - {()} else e

    def value(self, curve: Curve, u: ca.SX, sides: Sides) -> ca.SX:
        """The value of a curve at an argument, a symbol."""
        form = self._forms.of(u)
        for own in self.tables:
            factor, shift = _line(form, own.form)
            if factor:
                curve = curve.moved(factor, shift)
                break
        else:
            own = Curves(u, form, ca.SX.sym(f"{self.prefix}_table{len(self.tables)}"))
            self.tables.append(own)
        found = [
            k
            for k, pair in enumerate(zip(own.curves, own.sides, strict=True))
            if pair == (curve, sides)
        ]
        if not found:
            found = [len(own.curves)]
            own.curves.append(curve)
            own.sides.append(sides)
            own.values.append(ca.SX.sym(f"{own.multiplier.name()}_{found[0]}"))
        return own.values[found[0]]

    def _on_both_sides(self, h: ca.SX) -> ca.SX:
        """A function of |g|^p, g another switch, on one of its sides, as one that is a number on the other too."""
        nodes, rows = instructions(self.inputs, [h])
        if all(node.op not in POWERS for node in nodes):
            return h
        return evaluate(nodes, _EvenPowers(self))[rows[0][0]]

    def is_found(self, g: ca.SX) -> bool:
        """Whether a function is a multiple of one that has been found."""
        form = self._forms.of(g)
        return any(ratio(form, other.form) for other in self.all)

    def report(self, f: ca.SX) -> tuple[list[Switch | Curves], list[Table]]:
        """The switches and tables of a field in the order of their states, and the elements of the tables."""
        kept: list[Switch | Curves] = [s for s in self.all if ca.depends_on(f, s.lam)]
        kept += [t for t in self.tables if ca.depends_on(f, ca.vertcat(*t.values))]
        kept.sort(key=lambda s: self._states_of(s.h))
        index = {id(s): i for i, s in enumerate(kept)}
        elements = list[Table]()
        for own in (t for t in kept if isinstance(t, Curves)):
            sides = [
                tuple((index[id(self.all[i])], s) for i, s in pairs if id(self.all[i]) in index)
                for pairs in own.sides
            ]
            lines = [
                (index[id(s)], *_line(s.form, own.form)) for s in kept if isinstance(s, Switch)
            ]
            zeros = [
                (-shift / factor, i, 1 if factor > 0 else -1)
                for i, factor, shift in lines
                if factor
            ]
            elements.append(twins_of(Table(index[id(own)], tuple(own.curves), tuple(sides)), zeros))
        return kept, elements

    def _states_of(self, h: ca.SX) -> tuple[int, ...]:
        return tuple(i for i in range(self.states.numel()) if ca.depends_on(h, self.states[i]))


class _EvenPowers(Expressions):
    """The algebra of expressions in which powers of switching functions are those of their magnitude."""

    def __init__(self, switches: Switches):
        super().__init__(switches.inputs)
        self._switches = switches

    def apply(self, op: str, args: Sequence[ca.SX]) -> ca.SX:
        power = power_of(op, args)
        if power is None or not self._switches.is_found(args[0]):
            return operation(op, args)
        return (args[0] * args[0]) ** (power / 2)


def _line(first: Sum, second: Sum) -> tuple[float, float]:
    """The numbers a and b with first = a second + b; zeros if there are none."""
    one, two = ({k: v for k, v in form.items() if k} for form in (first, second))
    factor = ratio(one, two)
    return factor, first.get((), 0.0) - factor * second.get((), 0.0) if factor else 0.0


def _factored(h: ca.SX, moving: ca.SX) -> tuple[ca.SX, ca.SX]:
    """A factor that does not depend on states and time, and the other one."""
    if not ca.depends_on(h, moving):
        return h, ca.SX(1)
    if h.is_op(ca.OP_NEG):
        factor, rest = _factored(h.dep(0), moving)
        return -factor, rest
    if h.is_op(ca.OP_MUL) or h.is_op(ca.OP_DIV):
        (a, one), (b, two) = (_factored(h.dep(k), moving) for k in (0, 1))
        return (a * b, one * two) if h.is_op(ca.OP_MUL) else (a / b, one / two)
    return ca.SX(1), h


def _terms(e: ca.SX) -> list[tuple[int, ca.SX]]:
    """The terms of a sum with their signs, in their order."""
    found, left = list[tuple[int, ca.SX]](), [(1, e)]
    while left:
        sign, term = left.pop()
        if term.is_op(ca.OP_ADD) or term.is_op(ca.OP_SUB):
            second = sign if term.is_op(ca.OP_ADD) else -sign
            left += [(second, term.dep(1)), (sign, term.dep(0))]
        elif term.is_op(ca.OP_NEG):
            left.append((-sign, term.dep(0)))
        else:
            found.append((sign, term))
    return found


def _prefixes() -> Iterator[str]:
    return ("lam" + "_" * k for k in range(100))


#: A switch that depends on more switches than this is refused: 2^n copies of it would be needed.
_MOST_NESTED = 6

_INFINITELY_MANY = (
    "It switches on infinitely many surfaces. Declare those that the motion can reach, each as "
    "sign(x - c) or as a surface with its multiplier; a jump of a state is a Reset, and what is periodic in time "
    "is a function of the phase of a Clock."
)
_EQUALITY = (
    "Equality is true on a surface only, where the value of a field does not matter in Filippov's "
    "convention. Write the comparison as < or >, or leave the case out."
)
_REFUSED: dict[str, str] = {
    "eq": _EQUALITY,
    "ne": _EQUALITY,
    "floor": _INFINITELY_MANY,
    "ceil": _INFINITELY_MANY,
    "fmod": _INFINITELY_MANY,
    "remainder": _INFINITELY_MANY,
}


@dataclass(frozen=True)
class Lifting:
    """A right-hand side with its switches replaced: field (n,), multipliers and surfaces (m,), values of tables."""

    field: ca.SX
    multipliers: ca.SX
    surfaces: list[ca.SX | Argument]
    switches: tuple[LiftedSwitch, ...]
    tables: tuple[Table, ...]
    values: list[ca.SX]


@dataclass(frozen=True)
class _Value:
    """An expression and the numbers of the switches in it."""

    e: ca.SX
    inside: frozenset[int] = frozenset()


def lift(
    rhs: ca.SX, states: ca.SX, time: ca.SX, parameters: ca.SX, *, hidden: bool = False
) -> Lifting:
    """Replace the switches of a right-hand side by multipliers."""
    return _Lifter(rhs, states, time, parameters, hidden).run()


class _Lifter:
    """The algebra in which evaluating a graph replaces its switches by multipliers."""

    def __init__(self, rhs: ca.SX, states: ca.SX, time: ca.SX, parameters: ca.SX, hidden: bool):
        self.hidden = hidden
        self.inputs = [ca.vertcat(states, time), parameters]
        self.states, self.moving = states, self.inputs[0]
        self.nodes, self.rows = with_curves(*instructions(self.inputs, [rhs]))
        self.switches = Switches(states, self.inputs)
        self.done = 0  # nodes evaluated: the number of the one under way

    def run(self) -> Lifting:
        values = evaluate(self.nodes, self)
        entries = [self._affine(values[k]) for k in self.rows[0]]
        return self._finish(ca.vertcat(*entries))

    def _finish(self, f: ca.SX) -> Lifting:
        kept, tables = self.switches.report(f)
        described, own = list[LiftedSwitch](), iter(tables)
        for s in kept:
            if isinstance(s, Switch):
                what = (str(s.lam), str(s.h), tuple(sorted(s.origins)), s.hidden)
                described.append(LiftedSwitch(f"h{len(described)}", *what))
                continue
            table = next(own)
            for level, i in zip(table.levels, table.shown, strict=True):
                if i >= 0:
                    name, function = f"h{len(described)}", str(s.h - level)
                    described.append(
                        LiftedSwitch(name, f"{s.multiplier}_{i}", function, ("table",))
                    )
        lam = [s.lam if isinstance(s, Switch) else s.multiplier for s in kept]
        h = [s.h if isinstance(s, Switch) else Argument(s.h) for s in kept]
        values = [value for s in kept if isinstance(s, Curves) for value in s.values]
        return Lifting(
            f, ca.vertcat(*lam) if lam else ca.SX(0, 1), h, tuple(described), tuple(tables), values
        )

    # the algebra of the graph's evaluation -----------------------------------------------------

    def constant(self, value: float) -> _Value:
        return self._counted(_Value(ca.SX(value)))

    def symbol(self, vector: int, position: int) -> _Value:
        return self._counted(_Value(self.inputs[vector][position]))

    def apply(self, op: str, args: Sequence[_Value]) -> _Value:
        try:
            return self._counted(self._operation(op, args))
        except (NotSmoothError, DefinitionError) as error:
            raise type(error)(f"{self._entry_of(self.done)}: {error}") from None

    def _counted(self, value: _Value) -> _Value:
        self.done += 1
        return value

    def _operation(self, op: str, args: Sequence[_Value]) -> _Value:
        if op == "if_else_zero":
            return self._if_else(*args)
        if op == "curve":
            return self._curve(cast("Curve", self.nodes[self.done].payload), args[0])
        inside = frozenset().union(*(a.inside for a in args))
        if op in NOT_SMOOTH:
            return self._over_sides(list(args), inside, lambda e, _=(): self._switch(op, e))
        if op == "sqrt" and args[0].e.op() == ca.OP_SQ:  # CasADi would make it fabs by itself
            inner = [_Value(args[0].e.dep(0), inside)]
            return self._over_sides(inner, inside, lambda e, _=(): self._switch("fabs", e))
        return _Value(operation(op, [a.e for a in args]), inside)

    def _over_sides(
        self, args: list[_Value], inside: frozenset[int], build: Callable[..., _Value]
    ) -> _Value:
        """Sum ``build`` of arguments and sides over the sides of the switches ``inside``, with their weights."""
        if not inside:
            return build(args)
        if len(inside) > _MOST_NESTED:
            raise DefinitionError(
                f"a switch inside a switch: it depends on {len(inside)} others, but at most "
                f"{_MOST_NESTED} can be lifted. Write the cases out as a field with multipliers=."
            )
        numbers, found = sorted(inside), set(inside)
        weights, values = [], []
        for sides in product((1, -1), repeat=len(numbers)):
            chosen = dict(zip(numbers, sides, strict=True))
            own = [_Value(self._at(a.e, chosen), a.inside - inside) for a in args]
            value = build(own, tuple(chosen.items()))
            weight = ca.SX(1)
            for i, side in chosen.items():
                weight = weight * (1 + side * self._symbol(i, args)) / 2
            weights.append(weight)
            values.append(value.e)
            found |= value.inside
        return _Value(_weighted(weights, values), frozenset(found))

    def _symbol(self, i: int, args: list[_Value]) -> ca.SX:
        """Multiplier of a switch; ``even`` if all arguments are continuous on its surface."""
        s = self.switches[i]
        return s.lam if any(ca.depends_on(a.e, s.lam) for a in args) else s.even

    def _at(self, e: ca.SX, sides: dict[int, int]) -> ca.SX:
        """Return an expression on given sides of some switches."""
        for i, side in sides.items():
            s = self.switches[i]
            e = ca.substitute(e, ca.vertcat(s.lam, s.even), ca.DM([side, side]))
        return e

    def _curve(self, curve: Curve, argument: _Value) -> _Value:
        """The value of a table, on each side of the switches in its argument."""
        if not ca.depends_on(argument.e, self.moving):
            return _Value(curve.of(argument.e))

        def value(args: list[_Value], sides: Sides = ()) -> _Value:
            u = self.switches.reduced(args[0].e)
            constant = not ca.depends_on(u, self.moving)
            return _Value(curve.of(u) if constant else self.switches.value(curve, u, sides))

        return self._over_sides([argument], argument.inside, value)

    # the switches, of smooth arguments ---------------------------------------------------------

    def _if_else(self, condition: _Value, value: _Value) -> _Value:
        """Expand the condition over its sides, and the value too if it has the same switches."""
        if condition.inside & value.inside:
            return self._over_sides([condition, value], condition.inside, self._if_else_zero)
        one = _Value(ca.SX(1))
        factor = self._over_sides([condition, one], condition.inside, self._if_else_zero)
        return _Value(factor.e * value.e, factor.inside | value.inside)

    def _if_else_zero(self, args: list[_Value], _: Sides = ()) -> _Value:
        condition, value = args
        if ca.depends_on(condition.e, self.moving):
            raise _cannot(
                "if_else", condition.e, "Its condition must be a comparison. " + _EQUALITY
            )
        return _Value(operation("if_else_zero", [condition.e, value.e]), value.inside)

    def _switch(self, op: str, args: list[_Value]) -> _Value:
        e = [a.e for a in args]
        if not any(ca.depends_on(a, self.moving) for a in e):
            return _Value(operation(op, e))
        if op == "sign":
            return self._sign(e[0], "sign")
        if op == "fabs":
            return self._choice(e[0], e[0], -e[0], "fabs")
        if op in ("lt", "le"):
            side = self._sign(e[1] - e[0], "comparison")
            if side.e.is_zero():  # both sides are the same function
                return _Value(ca.SX(op == "le"))
            return _Value((1 + side.e) / 2, side.inside)
        if op in ("fmax", "fmin"):
            larger, smaller = (0, 1) if op == "fmax" else (1, 0)
            return self._choice(e[0] - e[1], e[larger], e[smaller], op)
        if op == "copysign":
            size, side = self._choice(e[0], e[0], -e[0], op), self._sign(e[1], op, of_zero=1)
            return _Value(size.e * side.e, size.inside | side.inside)
        advice = _REFUSED.get(op, "Logic acts on conditions: compare the argument with a number.")
        raise _cannot(NOT_SMOOTH[op], operation(op, e), advice)

    def _sign(self, h: ca.SX, origin: str, of_zero: int = 0) -> _Value:
        number, side = self.switches.find(h, origin)
        if number is None:
            return _Value(ca.SX(side or of_zero) if isinstance(side, int) else side)
        return _Value(side * self.switches[number].lam, frozenset([number]))

    def _choice(self, h: ca.SX, above: ca.SX, below: ca.SX, origin: str) -> _Value:
        """Return ``above`` where h > 0 and ``below`` where h < 0; they are equal on h = 0."""
        number, side = self.switches.find(h, origin)
        if number is None:
            return _Value(ca.if_else(side >= 0, above, below))
        lam = side * self.switches[number].even
        if ca.is_equal(above, -below, 20):
            return _Value(lam * above, frozenset([number]))
        return _Value((1 + lam) / 2 * above + (1 - lam) / 2 * below, frozenset([number]))

    # the result --------------------------------------------------------------------------------

    def _affine(self, value: _Value) -> ca.SX:
        """Make one entry of the field affine in every multiplier, exactly off the surfaces."""
        f, inside = value.e, set(value.inside)
        own = [self.switches[i] for i in sorted(inside)]
        if own:  # most switches enter linearly, all of them together
            lam, even = (ca.vertcat(*[getattr(s, name) for s in own]) for name in ("lam", "even"))
            curved = ca.which_depends(ca.substitute(f, even, lam), lam, 2, False)
            plain = [s for s, bent in zip(own, curved, strict=True) if not bent]
            inside = {i for i, bent in zip(sorted(inside), curved, strict=True) if bent}
            if plain:
                evens, lams = (
                    ca.vertcat(*[s.even for s in plain]),
                    ca.vertcat(*[s.lam for s in plain]),
                )
                f = ca.substitute(f, evens, lams)
        hidden = {i for i in inside if not ca.is_linear(f, self.switches[i].lam)}
        for i in sorted(inside):
            s = self.switches[i]
            s.hidden = s.hidden or i in hidden
            written = ca.substitute(f, s.even, s.lam)
            if ca.is_linear(written, s.lam) or (self.hidden and i in hidden):
                f = written
                continue
            f = self._joined(f, i)
        return f

    def _joined(self, f: ca.SX, i: int) -> ca.SX:
        """The affine function of a multiplier with the values of an expression at +1 and -1, term by term."""
        lam, own = self.switches[i].lam, ca.vertcat(self.switches[i].lam, self.switches[i].even)
        above, below = self._at(f, {i: 1}), self._at(f, {i: -1})
        if ca.is_equal(above, below, 20):
            return above
        result = ca.SX(0)
        for sign, term in _terms(f):
            if ca.depends_on(term, own):
                above, below = self._at(term, {i: 1}), self._at(term, {i: -1})
                same = ca.is_equal(above, below, 20)
                term = above if same else (1 + lam) / 2 * above + (1 - lam) / 2 * below
            result = result + term if sign > 0 else result - term
        return result

    def _entry_of(self, number: int) -> str:
        """Name the first entry of the right-hand side that uses a node."""
        for entry, row in enumerate(self.rows[0]):
            todo, seen = [row], {row}
            while todo:
                for k in self.nodes[todo.pop()].args:
                    if k not in seen:
                        seen.add(k)
                        todo.append(k)
            if number in seen:
                return f"rhs[{entry}]"
        return "rhs"


def _weighted(weights: list[ca.SX], values: list[ca.SX]) -> ca.SX:
    """Sum of weight times value; the weights add up to one, which shortens conditions."""
    ones = [w for w, v in zip(weights, values, strict=True) if v.is_one()]
    zeros = [w for w, v in zip(weights, values, strict=True) if v.is_zero()]
    if len(ones) + len(zeros) == len(values) > 1:
        return sum(ones, ca.SX(0)) if len(ones) <= len(zeros) else 1 - sum(zeros, ca.SX(0))
    terms = [w * v for w, v in zip(weights, values, strict=True)]
    return sum(terms[1:], terms[0])


def _cannot(op: str, e: ca.SX, advice: str) -> NotSmoothError:
    return NotSmoothError(
        f"{op}: {e} cannot be lifted. Switches that can are sign, fabs, fmin, fmax, copysign, if_else, "
        f"comparisons, and logic on these. {advice}"
    )
