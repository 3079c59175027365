"""Simplification of expressions so that their jets need fewer products of functions of the state.

In a jet a product of two such functions is a convolution at every order, while a sum or a product
with a constant is one operation. So constant coefficients are collected, terms that several sums
have in common are added once, and what products in a sum have in common is taken out:
a b + a c = a (b + c) is one convolution instead of two. Terms that are used several times stay
shared, and no product is multiplied out.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from .graph import Node, depends_on, instructions, operation, shaped

Product = tuple[int, ...]  # factors, sorted; () is the constant term
Sum = dict[Product, ca.SX]  # coefficients that do not depend on the variables

_LEAST = 1e-100  # coefficients smaller than this, or larger than its inverse, stay where they are

_DEPTH = 12  # coefficients count as equal when their expressions are, to this depth


def simplified(
    inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], variable: Sequence[bool]
) -> list[ca.SX]:
    """Rewrite ``outputs`` with fewer products of functions of the variables."""
    reader = _Reader(inputs, outputs, variable)
    writer = _Writer(reader, [reader.sum(j) for row in reader.rows for j in row])
    return shaped(outputs, writer.expressions())


@dataclass(frozen=True)
class _Factor:
    """An operation on sums; a single sum where ``node`` is None."""

    node: Node | None
    sums: tuple[Sum, ...] = ()


@dataclass(frozen=True)
class _Side:
    """A factor 1 + sign u, and the sum that it is multiplied with."""

    factor: int
    u: Product
    sign: float
    rest: Sum


class _Reader:
    """Every node of a graph as a sum of products of factors."""

    def __init__(self, inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], variable: Sequence[bool]):
        self._inputs = inputs
        self._nodes, self.rows = instructions(inputs, outputs)
        self._moving = depends_on(self._nodes, variable)
        self._users = Counter(a for node in self._nodes for a in node.args)
        self._users.update(j for row in self.rows for j in row)
        self.factors: list[_Factor] = []
        self.whole: dict[Product, Product] = {}  # products that are also factors
        self._several: set[Product] = set()  # products with several users
        self._sums: list[Sum] = []
        for j, node in enumerate(self._nodes):
            if self._moving[j]:
                terms = self._terms(node)
                if self._users[j] > 1 and len(terms) > 1:
                    terms = {self._new(_Factor(None, (terms,))): ca.SX(1)}
                elif self._users[j] > 1:
                    self._several.update(terms)
            else:
                terms = {(): self.apply(node, [self._constant(a) for a in node.args])}
            self._sums.append(terms)

    def sum(self, j: int) -> Sum:
        """Return node j."""
        return self._sums[j]

    def apply(self, node: Node, args: Sequence[ca.SX]) -> ca.SX:
        """Return the expression of an operation."""
        if node.op == "const":
            return ca.SX(node.payload)
        if node.op == "input":
            vector, position = node.source
            return self._inputs[vector][position]
        return operation(node.op, args)

    def _constant(self, j: int) -> ca.SX:
        return self._sums[j][()]

    def _new(self, factor: _Factor) -> Product:
        self.factors.append(factor)
        return (len(self.factors) - 1,)

    def _terms(self, node: Node) -> Sum:
        args = node.args
        if node.op == "assign":
            return self._sums[args[0]]
        if node.op in ("add", "sub"):
            a, b = self._sums[args[0]], self._sums[args[1]]
            if node.op == "sub":
                b = {product: -c for product, c in b.items()}
            one, two = self._side(a), self._side(b)
            joined = self._joined(one, two) if one and two else None
            if joined is not None:
                return joined
            own = self._users[args[0]] == 1 and self._nodes[args[0]].op in ("add", "sub")
            return _add(a if own else dict(a), b)  # a long sum is not copied for each term
        if node.op in ("neg", "twice"):
            return self._scaled(args[0], ca.SX(-1.0 if node.op == "neg" else 2.0))
        if node.op == "mul" and not all(self._moving[a] for a in args):
            moving, constant = args if self._moving[args[0]] else args[::-1]
            return self._scaled(moving, self._constant(constant))
        if node.op in ("mul", "sq"):
            return self._product(args[0], args[-1])
        if node.op == "div" and not self._moving[args[1]]:
            return self._scaled(args[0], 1.0 / self._constant(args[1]))
        return {self._new(_Factor(node, tuple(self._sums[a] for a in args))): ca.SX(1)}

    def _side(self, terms: Sum) -> _Side | None:
        """A product with 1 + u or 1 - u."""
        if len(terms) != 1:
            return None
        ((product, coefficient),) = terms.items()
        for f in product:
            own = self.factors[f].sums[0] if self.factors[f].node is None else {}
            if len(own) != 2 or () not in own or not own[()].is_one():
                continue
            u = next(p for p in own if p)
            if abs(_number(own[u])) == 1.0:
                k = product.index(f)
                rest = product[:k] + product[k + 1 :]
                whole = len(rest) == 1 and self.factors[rest[0]].node is None
                inside = self.factors[rest[0]].sums[0] if whole else {rest: ca.SX(1)}
                return _Side(f, u, _number(own[u]), {p: coefficient * c for p, c in inside.items()})
        return None

    def _joined(self, one: _Side, two: _Side) -> Sum | None:
        """(1 + u) a + (1 - u) b with what a and b have in common, or with another sign, taken out."""
        if (one.u, one.sign) != (two.u, -two.sign):
            return None
        a, b, result = dict(one.rest), dict(two.rest), Sum()
        for product in {**a, **b}:
            if product and not (product in a and product in b):
                continue
            c, d = a.get(product, ca.SX(0)), b.get(product, ca.SX(0))
            mean, half = c + d, c - d
            if _are_equal(c, d):
                mean, half = 2.0 * c, ca.SX(0)
            elif ca.simplify(mean).is_zero():
                mean, half = ca.SX(0), 2.0 * c
            elif (_number(mean + half), _number(mean - half)) != (2 * _number(c), 2 * _number(d)):
                continue  # rounding would make others of the sides
            a.pop(product, None), b.pop(product, None)
            turned = tuple(sorted(product + one.u))
            result = _add(_add(result, {product: mean}), {turned: one.sign * half})
        for side, rest in ((one, a), (two, b)):
            if result and rest:
                inside = self._new(_Factor(None, (rest,)))
                result = _add(result, {tuple(sorted((side.factor, *inside))): ca.SX(1)})
        return {product: c for product, c in result.items() if not c.is_zero()} or None

    def _scaled(self, j: int, factor: ca.SX) -> Sum:
        """One scaling of a sum instead of one for each of its terms."""
        coefficient, product = self._single(j)
        new = _times(coefficient, factor)
        if _is_extreme(new) and not factor.is_zero():
            return {self._inside(j): factor}
        return {} if new.is_zero() else {product: new}

    def _product(self, a: int, b: int) -> Sum:
        total, factors = ca.SX(1), Product()
        (c, product), (d, _) = self._single(a), self._single(b)
        # The powers of a coefficient overflow or underflow before those of what it belongs to.
        if _is_extreme(_times(c, d)) or (a == b and len(product) > 1 and not c.is_one()):
            return {tuple(sorted(self._inside(a) + self._inside(b))): ca.SX(1)}
        for coefficient, product in (self._single(a), self._single(b)):
            # A square costs half as much as a product.
            whole = len(product) > 1 and (a == b or product in self._several)
            factors += self._as_factor(product) if whole else product
            total = _times(total, coefficient)
        return {} if total.is_zero() else {tuple(sorted(factors)): total}

    def _single(self, j: int) -> tuple[ca.SX, Product]:
        """Node j as one coefficient times one product; a sum becomes a factor."""
        terms = self._sums[j]
        if len(terms) != 1 or () in terms:
            terms = {self._new(_Factor(None, (terms,))): ca.SX(1)}
            self._sums[j] = terms
        ((product, coefficient),) = terms.items()
        return coefficient, product

    def _inside(self, j: int) -> Product:
        """Node j as one factor, its coefficient included."""
        terms = self._sums[j]
        if terms.keys() and next(iter(terms.values())).is_one() and len(next(iter(terms))) == 1:
            return next(iter(terms))
        self._sums[j] = {self._new(_Factor(None, (terms,))): ca.SX(1)}
        return next(iter(self._sums[j]))

    def _as_factor(self, product: Product) -> Product:
        if product not in self.whole:
            self.whole[product] = self._new(_Factor(None, ({product: ca.SX(1)},)))
        return self.whole[product]


def _number(coefficient: ca.SX) -> float:
    """Value of a number; NaN for an expression."""
    return float(coefficient) if coefficient.is_constant() else math.nan


def _is_extreme(coefficient: ca.SX) -> bool:
    """Whether a number is so large or small that products with it leave the range of doubles."""
    if not coefficient.is_constant():
        return False
    return not _LEAST < abs(float(coefficient)) < 1.0 / _LEAST


def _add(result: Sum, b: Sum) -> Sum:
    """Add to a sum."""
    for product, coefficient in b.items():
        old = result.pop(product, None)
        new = coefficient if old is None else ca.SX.binary(ca.OP_ADD, old, coefficient)
        if not new.is_zero():
            result[product] = new
    return result


def _times(a: ca.SX, b: ca.SX) -> ca.SX:
    """A product; CasADi's own operator takes ten times as long."""
    return ca.SX.binary(ca.OP_MUL, a, b)


def _are_equal(a: ca.SX, b: ca.SX) -> bool:
    """Whether coefficients are equal."""
    if a.is_constant() and b.is_constant():
        return float(a) == float(b)
    return bool(ca.is_equal(a, b, _DEPTH))


def _power(u: ca.SX, n: int) -> ca.SX:
    if n == 1:
        return u
    half = _power(_times(u, u), n // 2)
    return _times(u, half) if n % 2 else half


class _Writer:
    """Expressions of sums, after their common parts were found."""

    def __init__(self, reader: _Reader, roots: Sequence[Sum]):
        self._reader = reader
        self._factors = list(reader.factors)
        self._expressions: dict[int, ca.SX] = {}
        self._sums = [*roots, *(s for factor in reader.factors for s in factor.sums)]
        self._group()
        self._count = Counter(product for s in self._sums for product in s)
        self._count.update(list(reader.whole))
        self._roots = [self._take_out(terms) for terms in roots]
        for j, factor in enumerate(self._factors):  # which grows
            sums = tuple(self._take_out(terms) for terms in factor.sums)
            self._factors[j] = _Factor(factor.node, sums)

    def _group(self) -> None:
        """Add terms once that occur together, up to a sign, in the same sums."""
        where: dict[Product, list[int]] = {}
        for k, terms in enumerate(self._sums):
            for product in terms:
                where.setdefault(product, []).append(k)
        together: dict[tuple[tuple[int, ...], tuple[int, ...]], list[Product]] = {}
        for product, found in where.items():
            if len(found) > 1 and 0 not in (signs := self._signs(product, found)):
                together.setdefault((tuple(found), signs), []).append(product)
        for (sums, signs), products in together.items():
            if len(products) > 1:
                self._replace(products, sums, signs)

    def _signs(self, product: Product, where: Sequence[int]) -> tuple[int, ...]:
        """Signs of a term's coefficients beside the first; 0 for one of another size."""
        plus = self._sums[where[0]][product]
        minus = -plus
        return tuple(
            int(_are_equal(plus, c)) - int(_are_equal(minus, c))
            for c in (self._sums[k][product] for k in where)
        )

    def _replace(
        self, products: Sequence[Product], where: Sequence[int], signs: Sequence[int]
    ) -> None:
        common = {p: self._sums[where[0]][p] for p in products}
        self._factors.append(_Factor(None, (common,)))
        for k, sign in zip(where, signs, strict=True):
            for p in products:
                del self._sums[k][p]
            self._sums[k][(len(self._factors) - 1,)] = ca.SX(sign)
        self._sums.append(common)

    def expressions(self) -> list[ca.SX]:
        """Return the expressions of the roots."""
        for j in range(len(self._factors)):
            self._express(j)
        return [self._write(terms) for terms in self._roots]

    def _express(self, first: int) -> None:
        """Write a factor and those it needs; a stack, because graphs can be deep."""
        stack = [first]
        while stack:
            if stack[-1] in self._expressions:
                stack.pop()
                continue
            factor = self._factors[stack[-1]]
            needed = {f for terms in factor.sums for product in terms for f in product}
            missing = needed.difference(self._expressions)
            if missing:
                stack += missing
                continue
            j, args = stack.pop(), [self._write(terms) for terms in factor.sums]
            node = factor.node
            self._expressions[j] = args[0] if node is None else self._reader.apply(node, args)

    def _write(self, terms: Sum) -> ca.SX:
        total = None
        for product, coefficient in terms.items():
            code = ca.OP_SUB if coefficient.is_minus_one() else ca.OP_ADD
            term = self._multiply(product)
            if code == ca.OP_ADD and not coefficient.is_one():
                term = _times(coefficient, term)
            if total is None:
                total = term if code == ca.OP_ADD else -term
            else:
                total = ca.SX.binary(code, total, term)
        return ca.SX(0) if total is None else total

    def _multiply(self, product: Product) -> ca.SX:
        if len(product) == 1:
            return self._expressions[product[0]]
        result = ca.SX(1)
        for factor, n in Counter(product).items():
            result = _times(result, _power(self._expressions[factor], n))
        return result

    def _take_out(self, terms: Sum) -> Sum:
        """Take factors that several products have in common out of them, the commonest first."""
        # Products that are needed elsewhere too stay what they are.
        terms = dict(terms)
        free = {p for p in terms if len(p) > 1 and self._count[p] < 2}
        while True:
            count = Counter(f for product in free for f in set(product))
            common, times = max(count.items(), key=lambda item: item[1], default=(-1, 0))
            if times < 2:
                return terms
            rest: Sum = {}
            for product in [p for p in terms if p in free and common in p]:
                k = product.index(common)
                rest[product[:k] + product[k + 1 :]] = terms.pop(product)
                free.remove(product)
            self._factors.append(_Factor(None, (rest,)))
            product = tuple(sorted((common, len(self._factors) - 1)))
            terms[product] = ca.SX(1)
            free.add(product)
