"""Cancellation of common factors, so that a removable 0/0 is not evaluated.

While sliding, lambda = -a/b with L_F h = a + b lambda, and the field is F0 - (a/b) G. Where
F1 - F2 = n(x) g(x) both G and b carry the factor n; with it cancelled the sliding field is smooth
through n = 0 (two_fold theory, "coincident fields"; every single-contact Coulomb law does this).
Expressions are put in the form sum of coefficient * product of powers of atoms; sums are flattened
but products of two sums stay products, so nothing is expanded.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from .graph import NOT_SMOOTH, evaluate, instructions, operation

Monomial = tuple[tuple[int, int], ...]  # ((atom, power), ...) sorted by atom
Sum = dict[Monomial, float]

_ROUNDING = 8 * 2.220446049250313e-16


def _times(a: Monomial, b: Monomial) -> Monomial:
    powers = dict(a)
    for atom, power in b:
        powers[atom] = powers.get(atom, 0) + power
    return tuple(sorted((k, v) for k, v in powers.items() if v))


def _inverse(a: Monomial) -> Monomial:
    return tuple((atom, -power) for atom, power in a)


def _common(monomials: Sequence[Monomial]) -> Monomial:
    """Return the greatest common divisor; an atom that is missing counts with power 0."""
    shared = {atom: power for atom, power in monomials[0]}
    atoms = set(shared).union(*(dict(m) for m in monomials))
    low = {k: min(dict(m).get(k, 0) for m in monomials) for k in atoms}
    return tuple(sorted((k, v) for k, v in low.items() if v))


class Forms:
    """Normal forms of the nodes of one graph and the atoms they are made of."""

    def __init__(self) -> None:
        self.atoms: list[ca.SX] = []
        self._known: dict[Hashable, int] = {}
        self._sums: dict[Hashable, list[list[float]]] = {}

    def atom(self, key: Hashable, expression: ca.SX) -> Sum:
        if key not in self._known:
            self._known[key] = len(self.atoms)
            self.atoms.append(expression)
        return {((self._known[key], 1),): 1.0}

    def add(self, a: Sum, b: Sum, sign: float = 1.0) -> Sum:
        result = dict(a)
        for monomial, c in b.items():
            old = result.get(monomial, 0.0)
            new = old + sign * c
            if abs(new) <= _ROUNDING * max(abs(old), abs(c)):
                result.pop(monomial, None)
            else:
                result[monomial] = new
        return result

    def factor(self, a: Sum) -> tuple[float, Monomial]:
        """Write a nonzero sum as one coefficient times one monomial (a rest becomes an atom)."""
        if len(a) == 1:
            ((monomial, c),) = a.items()
            return c, monomial
        common = _common(list(a))
        rest = {_times(m, _inverse(common)): c for m, c in a.items()}
        lead = rest[min(rest)]
        rest = {m: c / lead for m, c in sorted(rest.items())}
        atom = self.atom(("sum", tuple(rest), self._like(rest)), self.expression(rest))
        ((monomial, _),) = atom.items()
        return lead, _times(common, monomial)

    def _like(self, rest: Sum) -> int:
        """Number the coefficients of a sum, the same number for those equal to rounding."""
        known = self._sums.setdefault(tuple(rest), [])
        values = list(rest.values())
        for k, other in enumerate(known):
            if all(abs(a - b) <= _ROUNDING * abs(b) for a, b in zip(values, other, strict=True)):
                return k
        known.append(values)
        return len(known) - 1

    def multiply(self, a: Sum, b: Sum) -> Sum:
        if not a or not b:
            return {}
        if len(a) > 1 and len(b) > 1:
            (ca_, ma), (cb, mb) = self.factor(a), self.factor(b)
            return {_times(ma, mb): ca_ * cb}
        if len(b) > 1:
            a, b = b, a
        ((monomial, c),) = b.items()
        return {_times(m, monomial): c * k for m, k in a.items()}

    def reciprocal(self, a: Sum) -> Sum:
        c, monomial = self.factor(a)
        return {_inverse(monomial): 1.0 / c}

    def expression(self, a: Sum) -> ca.SX:
        total = ca.SX(0)
        for monomial, c in a.items():
            total = total + self.product(c, monomial)
        return total

    def product(self, c: float, monomial: Monomial) -> ca.SX:
        top, bottom = ca.SX(c), ca.SX(1)
        for atom, power in monomial:
            for _ in range(abs(power)):
                if power > 0:
                    top = top * self.atoms[atom]
                else:
                    bottom = bottom * self.atoms[atom]
        return top / bottom


@dataclass(frozen=True)
class _Value:
    """A node's normal form, and the expression as it was written."""

    form: Sum
    expression: ca.SX


class _Normal:
    """The algebra of normal forms over the symbols of a graph."""

    def __init__(self, inputs: Sequence[ca.SX]):
        self.inputs, self.forms = inputs, Forms()

    def constant(self, value: float) -> _Value:
        return _Value({(): value} if value else {}, ca.SX(value))

    def symbol(self, vector: int, position: int) -> _Value:
        expression = self.inputs[vector][position]
        return _Value(self.forms.atom(("input", vector, position), expression), expression)

    def apply(self, op: str, args: Sequence[_Value]) -> _Value:
        expression = operation(op, [a.expression for a in args])
        return _Value(_combine(self.forms, op, [a.form for a in args], expression), expression)


class NormalForms:
    """Normal forms of expressions of the same symbols, one after the other, over the same atoms."""

    def __init__(self, inputs: Sequence[ca.SX]):
        self._inputs, self._algebra = list(inputs), _Normal(inputs)
        self.forms = self._algebra.forms

    def rows(self, outputs: Sequence[ca.SX]) -> list[list[Sum]]:
        """The sums of coefficients times monomials of the entries of each output."""
        nodes, rows = instructions(self._inputs, outputs)
        values = evaluate(nodes, self._algebra)
        return [[values[k].form for k in row] for row in rows]

    def of(self, expression: ca.SX) -> Sum:
        """The same of a scalar."""
        return self.rows([expression])[0][0]


def ratio(first: Sum, second: Sum) -> float:
    """The number c with first = c second to rounding, or 0 if there is none."""
    if first.keys() != second.keys() or not first:
        return 0.0
    ratios = [first[monomial] / second[monomial] for monomial in first]
    c = ratios[0]
    return c if all(abs(r - c) <= 2 * _ROUNDING * abs(c) for r in ratios) else 0.0


def _combine(forms: Forms, op: str, args: list[Sum], expression: ca.SX) -> Sum:
    if op in ("add", "sub", "twice"):
        return forms.add(args[0], args[-1], -1.0 if op == "sub" else 1.0)
    if op == "neg":
        return forms.add({}, args[0], -1.0)
    if op in ("mul", "sq"):
        return forms.multiply(args[0], args[-1])
    if op == "div" and args[1]:
        return forms.multiply(args[0], forms.reciprocal(args[1]))
    if op == "inv" and args[0]:
        return forms.reciprocal(args[0])
    return forms.atom((op, *(tuple(sorted(a.items())) for a in args)), expression)


def powers(expression: ca.SX, variables: ca.SX, others: ca.SX) -> list[tuple[ca.SX, int]]:
    """Visible factors of a scalar expression, with their powers."""
    normal = NormalForms([variables, others])
    form, forms = normal.of(expression), normal.forms
    return [(forms.atoms[a], power) for a, power in forms.factor(form)[1]] if form else []


def simple_zeros(expression: ca.SX, variables: ca.SX, others: ca.SX) -> ca.SX:
    """Return an expression of the same sign without its visible powers."""
    normal = NormalForms([variables, others])
    form = normal.of(expression)
    c, monomial = normal.forms.factor(form) if form else (0.0, ())
    if all(abs(power) < 2 for _, power in monomial):
        return expression
    return normal.forms.product(c, tuple((atom, 1) for atom, power in monomial if power % 2))


def cancel_common_factor(
    expressions: Sequence[ca.SX], variables: ca.SX, others: ca.SX
) -> tuple[list[ca.SX], ca.SX]:
    """Divide scalar expressions by the factors that all of them have."""
    normal = NormalForms([variables, others])
    forms, sums = normal.forms, [row[0] for row in normal.rows(expressions)]
    factored = [forms.factor(s) if s else None for s in sums]
    monomials = [f[1] for f in factored if f is not None]
    shared = _common(monomials) if monomials else ()
    common = tuple((atom, power) for atom, power in shared if power > 0)
    if not common:
        return list(expressions), ca.SX(1)
    reduced = [
        ca.SX(0) if f is None else forms.product(f[0], _times(f[1], _inverse(common)))
        for f in factored
    ]
    return reduced, forms.product(1.0, common)


# Dependent rows -----------------------------------------------------------------------------------

# A step whose field was checked need not be checked with what is a linear combination of its rows and of an affine
# function, as normal forces and Lie derivatives are.

#: Part of a function that may be left over by rounding.
_LEFT = 1e-9


def in_span(
    functions: Sequence[ca.SX], rows: Sequence[ca.SX], variables: ca.SX, others: ca.SX
) -> list[bool]:
    """Whether each function is found to be a combination of rows and an affine function."""
    # The coefficients may depend on ``others``, smoothly.
    nodes, _ = instructions([variables, others], [ca.vertcat(*rows, *functions)])
    if any(node.op in NOT_SMOOTH for node in nodes):
        return [False for _ in functions]  # other values of ``others`` have other combinations
    numbers = np.random.default_rng(1).uniform(0.3, 1.7, others.numel())
    fixed = [ca.substitute(ca.SX(e), others, ca.DM(numbers)) for e in [*rows, *functions]]
    normal = NormalForms([variables, others])
    bent = [_nonlinear(row[0], normal.forms) for row in normal.rows(fixed)]
    monomials = sorted({m for form in bent for m in form})
    table = np.array([[form.get(m, 0.0) for m in monomials] for form in bent])
    table = table.reshape(len(bent), len(monomials))
    known = table[: len(rows)]
    basis, result = known[np.isfinite(known).all(axis=1)].T, []
    for function, target in zip(functions, table[len(rows) :], strict=True):
        unseen = not target.any() and not ca.is_linear(function, variables)
        if unseen or not np.isfinite(target).all():
            result.append(False)
            continue  # coefficients below the least number, or none for these ``others``
        weights = np.linalg.lstsq(basis, target, rcond=None)[0] if basis.size else np.zeros(0)
        left = target - basis @ weights if basis.size else target
        result.append(bool(np.abs(left).max(initial=0.0) <= _LEFT * np.abs(target).max(initial=0)))
    return result


def _nonlinear(form: Sum, forms: Forms) -> dict[Monomial, float]:
    """Leave out the constant and multiples of one variable."""
    linear = lambda m: len(m) == 1 and m[0][1] == 1 and forms.atoms[m[0][0]].is_symbolic()
    return {m: c for m, c in form.items() if m and not linear(m)}
