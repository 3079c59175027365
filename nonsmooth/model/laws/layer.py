"""Field and rates of the surfaces at given multipliers, with their derivatives.

Where several surfaces meet, G_i(x, lambda) = grad h_i . f(x, lambda) are the rates at which they are left.
Sliding keeps those of its surfaces at zero; the layer problem eps lambda_i' = G_i says whether it attracts.
Reactions of impacts are zero: contacts are open.
"""

from __future__ import annotations

from collections.abc import Sequence
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


@dataclass(frozen=True)
class Loop:
    """How an orbit comes back to where two surfaces meet in the plane: r -> ratio r (1 + bend r).

    Attributes
    ----------
    ratio : float
        Below 1 the intersection is reached in finite time, above 1 it is left.
    bend : float
        Decides where the ratio is 1; per unit of h.
    exact : bool
        Whether the ratio is 1 to rounding.
    """

    ratio: float
    bend: float
    exact: bool

    @property
    def attracts(self) -> bool | None:
        """Whether orbits spiral in; None if they are closed to second order."""
        if not self.exact:
            return self.ratio < 1.0
        return None if self.bend == 0.0 else self.bend < 0.0


def loop_at(
    layer: Layer, x: Array, surfaces: Sequence[int], multipliers: Array, p: Array
) -> Loop | None:
    """Follow an orbit once round the point of the plane where two surfaces meet, to second
    order."""
    i, j = surfaces
    ratio, bend, size = 1.0, 0.0, 0.0
    quadrants = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    try:
        numbers = {q: _in_surfaces(layer, x, (i, j), q, multipliers, p) for q in quadrants}
    except np.linalg.LinAlgError:
        return None
    turn = 1 if numbers[1, 1][0][0] < 0.0 else -1  # counterclockwise in (h_i, h_j), or clockwise
    for q in quadrants if turn > 0 else [(1, 1), (1, -1), (-1, -1), (-1, 1)]:
        # From the half axis where ``near`` is on its own side to the one where it is zero.
        near = 0 if (q[0] * q[1] > 0) == (turn > 0) else 1
        far, (f, df) = 1 - near, numbers[q]
        u, v = f[near] * q[near], f[far] * q[far]
        if not (u < 0.0 < v):
            return None
        # The start is r on the near axis; all in units of r.
        s = np.array(q, float)
        d = df * s[:, None] * s[None, :]
        accel = d @ (f * s)
        with np.errstate(over="ignore", invalid="ignore"):
            first = -1.0 / u
            second = -(d[near, near] * first + 0.5 * accel[near] * first**2) / u
            factor = v * first
            grown = (v * second + d[far, near] * first + 0.5 * accel[far] * first**2) / factor
            bend += grown * ratio  # relative change per unit of the first radius
            size += abs(grown) * ratio
            ratio *= factor
    if not np.isfinite(ratio * size):
        return None
    exact = bool(abs(ratio - 1.0) <= 1e-12)
    return Loop(float(ratio), float(bend) if abs(bend) > 1e-12 * size else 0.0, exact)


def _in_surfaces(
    layer: Layer,
    x: Array,
    surfaces: tuple[int, int],
    quadrant: tuple[int, int],
    multipliers: Array,
    p: Array,
) -> tuple[Array, Array]:
    """Rates of the two surfaces in a quadrant (2,), and their derivatives by the surfaces (2, 2)."""
    chosen, values = list(surfaces), multipliers.copy()
    values[chosen] = quadrant
    found = layer.at(x, values, p)
    return found.rates[chosen], found.rates_x[chosen] @ np.linalg.inv(found.h_x[chosen])
