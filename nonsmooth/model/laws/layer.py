"""Field and rates of the surfaces at given multipliers, with their derivatives.

Where several surfaces meet, G_i(x, lambda) = grad h_i . f(x, lambda) are the rates at which they are left.
Sliding keeps those of its surfaces at zero; the layer problem eps lambda_i' = G_i says whether it attracts.
Reactions of impacts are zero: contacts are open.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..definition.system import FilippovSystem, require_system
from ..values import Array
from .evaluators import Evaluator


@dataclass(frozen=True, eq=False)
class LayerNumbers:
    """Values at a state and multipliers; N extended states, m surfaces."""

    h: Array
    h_x: Array
    field: Array
    field_x: Array
    field_l: Array
    rates: Array
    rates_x: Array
    rates_l: Array


class Layer:
    """The layer of a system, evaluated at numbers; made by ``layer_of``."""

    def __init__(self, system: FilippovSystem):
        require_system(system)
        self._m = system.surface_count
        x, lam = system.extended_states, ca.SX.sym("lambda", self._m)
        field = system.field_with(lam)
        h = ca.vertcat(system.definition.surfaces)
        gradient = ca.jacobian(h, x)
        rates = ca.mtimes(gradient, field)
        outputs = [h, gradient]
        for e in (field, rates):
            outputs += [e, ca.jacobian(e, x), ca.jacobian(e, lam)]
        inputs = [ca.vertcat(x, lam), system.parameter_symbols]
        #: Whether the multipliers enter linearly together, without products.
        self.affine = bool(ca.is_linear(field, lam))
        dense = [ca.densify(e) for e in outputs]
        self._evaluate = Evaluator(ca.Function("layer", inputs, dense, {"cse": True}))

    def at(self, x: Array, multipliers: Array, p: Array) -> LayerNumbers:
        """Evaluate at an extended state (N,) and multipliers (m,)."""
        found = self._evaluate.copied(np.concatenate([x, multipliers]), p)
        h, h_x, field, field_x, field_l, rates, rates_x, rates_l = found
        return LayerNumbers(
            h.ravel(), h_x, field.ravel(), field_x, field_l, rates.ravel(), rates_x, rates_l
        )


def layer_of(system: FilippovSystem) -> Layer:
    """Return the layer of a system, built once."""
    return system.cached("layer", lambda: Layer(system))
