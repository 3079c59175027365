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
from .evaluators import evaluator


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
        x, lam = system.extended_states, ca.SX.sym("lambda", system.surface_count)
        field, h = system.field_with(lam), ca.vertcat(system.definition.surfaces)
        gradient = ca.jacobian(h, x)
        outputs = [h, gradient]
        for e in (field, ca.mtimes(gradient, field)):
            outputs += [e, ca.jacobian(e, x), ca.jacobian(e, lam)]
        #: Whether the multipliers enter linearly together, without products.
        self.affine = bool(ca.is_linear(field, lam))
        self._evaluate = evaluator(system, "layer at", lambda: outputs, ca.vertcat(x, lam))

    def at(self, x: Array, multipliers: Array, p: Array) -> LayerNumbers:
        """Evaluate at an extended state (N,) and multipliers (m,)."""
        given = np.append(x, multipliers)
        h, h_x, f, f_x, f_l, w, w_x, w_l = self._evaluate.copied(given, p)
        return LayerNumbers(h.ravel(), h_x, f.ravel(), f_x, f_l, w.ravel(), w_x, w_l)


def layer_of(system: FilippovSystem) -> Layer:
    """Return the layer of a system, built once."""
    return system.cached("layer", lambda: Layer(system))
