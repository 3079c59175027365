"""Recorded instructions as polynomials with rational coefficients; other operations are atoms."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from intervals import CheckError, number

#: Products of so many terms, and coefficients of so many bits, are not computed.
_TERMS, _BITS = 1_000_000, 1 << 16

Monomial = tuple[tuple[Any, int], ...]
Polynomial = dict[Monomial, Fraction]


def add(a: Polynomial, b: Polynomial, sign: int) -> Polynomial:
    """a + sign b."""
    result = dict(a)
    for m, c in b.items():
        result[m] = result.get(m, Fraction(0)) + sign * c
        if result[m] == 0:
            del result[m]
    return result


def times(a: Polynomial, b: Polynomial) -> Polynomial:
    """a b."""
    if len(a) * len(b) > _TERMS:
        raise CheckError(f"a polynomial has more than {_TERMS} terms")
    result: Polynomial = {}
    for m, c in a.items():
        for n, d in b.items():
            powers = dict(m)
            for atom, k in n:
                powers[atom] = powers.get(atom, 0) + k
            key = tuple(sorted(powers.items(), key=repr))
            result[key] = result.get(key, Fraction(0)) + c * d
            if max(abs(result[key].numerator), result[key].denominator).bit_length() > _BITS:
                raise CheckError(f"a coefficient has more than {_BITS} bits")
            if result[key] == 0:
                del result[key]
    return result


def polynomials(
    graph: dict[str, Any], signs: list[int] | None = None, nodes: set[int] | None = None
) -> list[Polynomial]:
    """The polynomial of every node, or of some of them, where multipliers are those signs."""
    values: list[Polynomial] = []
    for k, (op, *rest) in enumerate(graph["nodes"]):
        if nodes is not None and k not in nodes:
            values.append({})
        elif op == "const" or (op == "input" and rest[0] == 3 and signs):
            c = number(rest[0]) if op == "const" else Fraction(signs[rest[1]])
            values.append({(): c} if c else {})
        elif op in ("add", "sub"):
            values.append(add(values[rest[0]], values[rest[1]], 1 if op == "add" else -1))
        elif op == "mul":
            values.append(times(values[rest[0]], values[rest[1]]))
        elif op == "div":
            values.append(times(values[rest[0]], _inverse(values[rest[1]], rest[1])))
        elif op == "inv":
            values.append(_inverse(values[rest[0]], rest[0]))
        elif op == "neg":
            values.append(add({}, values[rest[0]], -1))
        elif op == "twice":
            values.append(add(values[rest[0]], values[rest[0]], 1))
        elif op in ("sq", "power"):
            result = values[rest[0]]
            for _ in range((2 if op == "sq" else rest[1]) - 1):
                result = times(result, values[rest[0]])
            values.append(result)
        else:
            values.append({(((op, k), 1),): Fraction(1)})
    return values


def _inverse(p: Polynomial, node: int) -> Polynomial:
    """One over a number, or an inverse as an atom."""
    return {(): 1 / p[()]} if list(p) == [()] else {((("inv", node), 1),): Fraction(1)}


def is_multiple(graph: dict[str, Any]) -> bool:
    """Whether F1 - F2 = g G for the recorded factor g and direction G."""
    if "factor" not in graph:
        return False
    p = polynomials(graph)
    g = p[graph["factor"]]
    return all(
        not add(add(p[a], p[b], -1), times(g, p[d]), -1)
        for a, b, d in zip(graph["above"], graph["below"], graph["direction"], strict=True)
    )


def is_factored(
    graph: dict[str, Any], signs: tuple[list[int], list[int]], factor: int, direction: list[int]
) -> bool:
    """Whether the fields at two lists of multipliers differ by the factor times the direction."""
    todo, nodes = [*graph["field"], factor, *direction], set[int]()
    while todo:
        k = todo.pop()
        if k not in nodes:
            nodes.add(k)
            op, *rest = graph["nodes"][k]
            todo += [] if op in ("const", "input") else rest[:1] if op == "power" else rest
    p, q = (polynomials(graph, s, nodes) for s in signs)
    return all(
        not add(add(p[f], q[f], -1), times(p[factor], p[d]), -1) and not add(p[d], q[d], -1)
        for f, d in zip(graph["field"], direction, strict=True)
    ) and not add(p[factor], q[factor], -1)
