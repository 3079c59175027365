"""Roots and powers of switching functions, which are zero on their surfaces and have no derivatives there."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from ..expressions.graph import (
    POWERS,
    Expressions,
    content_of,
    evaluate,
    instructions,
    operation,
    power_of,
)
from ..expressions.identity import vanish_on

#: Random points at which signs are compared.
_DRAWS = 21


class _Gated(Expressions):
    """The algebra of expressions in which roots of switching functions are there on their side only."""

    def __init__(self, symbols: ca.SX, surfaces: Sequence[ca.SX], x: ca.SX, gates: Sequence[ca.SX]):
        super().__init__([symbols])
        self._surfaces, self._x, self._gates = surfaces, x, gates
        #: Smallest exponent by surface.
        self.powers: dict[int, float] = {}

    def apply(self, op: str, args: Sequence[ca.SX]) -> ca.SX:
        result, power = operation(op, args), power_of(op, args)
        if power is None or not ca.depends_on(args[0], self._x):
            return result
        base, times = (args[0].dep(0), 2) if args[0].op() == ca.OP_SQ else (args[0], 1)
        for i, h in enumerate(self._surfaces):
            if vanish_on([base], h, self._x):
                self.powers[i] = min(times * power, self.powers.get(i, times * power))
                side, gate = _side(args[0], h), self._gates[i]
                result *= side * gate * (1 + side * gate) / 2 if side else gate * gate
        return result


def _side(e: ca.SX, h: ca.SX) -> int:
    """Whether an expression that vanishes with h is positive where h is (1), where -h is (-1), or neither (0)."""
    symbols = ca.vertcat(*ca.symvar(ca.vertcat(e, h)))
    value = ca.Function("side", [symbols], [e * h])
    generator = np.random.default_rng(0)
    draws = [float(value(generator.normal(size=symbols.numel()))) for _ in range(_DRAWS)]
    signs = {np.sign(p) for p in draws if np.isfinite(p)} - {0.0}
    return int(signs.pop()) if len(signs) == 1 else 0


def roots_of(field: ca.SX, surfaces: ca.SX, x: ca.SX) -> dict[int, float]:
    """The smallest exponent of a root of each switching function, in a field or in switching functions."""
    gates, found = ca.vertsplit(ca.SX.ones(surfaces.numel())), dict[int, float]()
    for e in (field, surfaces) if surfaces.numel() else ():
        for i, power in gate_roots(e, surfaces, x, gates)[1].items():
            found[i] = min(power, found.get(i, power))
    return found


def gate_roots(
    field: ca.SX, surfaces: ca.SX, x: ca.SX, gates: Sequence[ca.SX]
) -> tuple[ca.SX, dict[int, float]]:
    """Multiply each root of a switching function by its gate; also the smallest exponent for each surface."""
    # A gate is 1 or -1, the side, or 0; a root is multiplied by 1 on the side where it is defined, else by 0.
    if not field.numel() or POWERS.isdisjoint(content_of(field).operations):
        return field, {}
    symbols = ca.vertcat(*ca.symvar(field))
    nodes, rows = instructions([symbols], [field])
    algebra = _Gated(symbols, ca.vertsplit(surfaces)[: surfaces.numel()], x, gates)
    values = evaluate(nodes, algebra)
    return ca.vertcat(*[values[k] for k in rows[0]]), algebra.powers
