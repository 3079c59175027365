"""The period of a recorded system that depends on time, by polynomials of its instructions."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from intervals import PI, CheckError, Iv, whole
from polynomials import Polynomial, polynomials
from series import Dual

_LISTS = ("surfaces", "field", "guards", "gaps", "restitutions")


def forcing_period(graph: dict[str, Any], time: int, values: list[Dual]) -> Iv:
    """2 pi/(g r), where all rates of phases of sines and cosines are whole multiples of g r."""
    # The time enters nothing but phases, linearly; ``values`` are those of all nodes, of which only those of
    # parameters are used.
    nodes, p = graph["nodes"], polynomials(graph)
    timed = {("input", k) for k, node in enumerate(nodes) if node == ["input", 0, time]}
    still = [op in ("const", "pi") or (op == "input" and rest[0] == 1) for op, *rest in nodes]
    for k, (op, *rest) in enumerate(nodes):
        if op not in ("const", "input", "pi"):
            still[k] = all(still[i] for i in (rest[:1] if op == "power" else rest))
    plain = ("const", "input", "add", "sub", "mul", "neg", "twice", "sq", "power", "pi")
    rates: list[Polynomial] = []
    for op, *rest in nodes:
        for k in () if op in plain else rest[1:] if op == "div" else rest:
            rates += _rate(p[k], timed, still, op)
    for row in [*(graph[name] for name in _LISTS), *graph["maps"]]:
        for k in row:
            rates += _rate(p[k], timed, still, "")
    if not rates:
        raise CheckError("the time enters no sine or cosine")
    ratios = [_ratio(rate, rates[0]) for rate in rates]
    denominator = math.lcm(*(q.denominator for q in ratios))
    divisor = Fraction(math.gcd(*(int(q * denominator) for q in ratios)), denominator)
    rate = whole(0)
    for powers, c in rates[0].items():
        term = Iv.of(c * divisor)
        for (op, k), n in powers:
            for _ in range(n):
                v = values[k].v[0]
                term = term / v if op == "inv" else term * v
        rate = rate + term
    period = whole(2) * PI / rate
    return period if period.sign() > 0 else -period


def _rate(p: Polynomial, timed: set[Any], still: list[bool], op: str) -> list[Polynomial]:
    """The rate of a phase, none where the time does not enter."""
    rate: Polynomial = {}
    for powers, c in p.items():
        if any(atom in timed for atom, _ in powers):
            rest = tuple((atom, n) for atom, n in powers if atom not in timed)
            linear = sum(n for atom, n in powers if atom in timed) == 1
            if op not in ("sin", "cos") or not linear or not all(still[k] for (_, k), _ in rest):
                raise CheckError("the time enters other than through phases of sines and cosines")
            rate[rest] = rate.get(rest, Fraction(0)) + c
    rate = {powers: c for powers, c in rate.items() if c}
    return [rate] if rate else []


def _ratio(rate: Polynomial, other: Polynomial) -> Fraction:
    """The rational number by which one rate is a multiple of another."""
    key = next(iter(other))
    q = rate.get(key, Fraction(0)) / other[key]
    if not q or rate != {powers: q * c for powers, c in other.items()}:
        raise CheckError("two frequencies have no rational ratio")
    return q
