"""Values and derivatives of the field, functions, rates and factors of all modes of a system.

They are functions of the extended states x, of a (multipliers, reactions, and the unknowns nu that
replace a multiplier with a factor, ``factors``), and of the parameters p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..definition.system import FilippovSystem
from ..values import Array
from .coupled import Coupled, coupled_of
from .evaluators import Evaluator


@dataclass(frozen=True, eq=False)
class Derived:
    """A vector of functions of x, a and p, with its derivatives."""

    value: Array
    x: Array
    a: Array
    p: Array

    def along(self, by_state: Array) -> Array:
        """Derivatives by the states where what acts moves with them."""
        return np.asarray(self.x + self.a @ by_state)

    def by_parameters(self, of_acting: Array) -> Array:
        """Derivatives by the parameters where what acts moves with them."""
        return np.asarray(self.p + self.a @ of_acting)


@dataclass(frozen=True, eq=False)
class AtMode:
    """Values at a state."""

    field: Derived
    heights: Derived
    rates: Derived
    factors: Derived


class ModeDerivatives:
    """The functions of a system; made by ``mode_derivatives``."""

    def __init__(self, system: FilippovSystem):
        self.coupled: Coupled = coupled_of(system)
        of, n, q = self.coupled, system.extended_dimension, system.parameter_symbols
        x, a = of.moving[:n], of.moving[n:]
        self.size = int(a.numel())
        extra = np.cumsum([0, *of.scaled]).tolist()
        own = range(len(of.scaled))
        self.column = [of.count + extra[i] if of.scaled[i] else i for i in own]
        self.column += list(range(len(of.scaled), of.count))
        outputs = []
        for e in (of.field, of.heights, of.layer, of.factors):
            outputs += [e, ca.jacobian(e, x), ca.jacobian(e, a), ca.jacobian(e, q)]
        dense = [ca.densify(e) for e in outputs]
        self._evaluate = Evaluator(ca.Function("derivatives", [of.moving, q], dense, {"cse": True}))

    def at(self, x: Array, acting: Array, p: Array, chosen: Sequence[int]) -> AtMode:
        """Evaluate at an extended state and what acts, with derivatives by chosen parameters."""
        found = self._evaluate.copied(np.concatenate([x, acting]), p)
        columns = list(chosen)
        parts = [found[i : i + 4] for i in range(0, len(found), 4)]
        return AtMode(*[Derived(v.ravel(), x, a, p[:, columns]) for v, x, a, p in parts])


def mode_derivatives(system: FilippovSystem) -> ModeDerivatives:
    """Return the functions of a system, built once."""
    return system.cached("mode derivatives", lambda: ModeDerivatives(system))
