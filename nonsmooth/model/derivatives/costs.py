"""Sums of a cost over states, with derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..cache import Content
from ..definition.parse_definition import read_function
from ..definition.system import FilippovSystem
from ..errors import OptionError
from ..reading import symbols
from ..values import Array, real_array


class CostOver(NamedTuple):
    """Sum of a cost over states (K, N), with its derivatives by each and by the parameters."""

    value: float
    by_states: Array  # (K, N)
    by_parameters: Array  # (np,)


def cost_over(
    system: FilippovSystem, cost: Any, data: Mapping[Any, ArrayLike], states: Array, p: Array
) -> CostOver:
    """Sum of a cost over extended states (K, N); ``data`` are values (K,) of its further symbols."""
    if not isinstance(data, Mapping):
        raise OptionError(f"samples is {data!r}. Give a mapping of symbols to values, or {{}}.")
    d, own, rows = system.definition, symbols(list(data), "samples"), np.zeros((0, len(states)))
    for symbol, values in data.items():
        given = real_array(values, "samples")
        if given.shape != (len(states),):
            raise OptionError(
                f"samples has values of shape {given.shape} for {symbol}, but the run has {len(states)} samples. "
                "Give one number for each."
            )
        rows = np.vstack([rows, given])
    plain = ca.substitute(ca.SX(cost), own, 0.5) if data and isinstance(cost, ca.SX) else cost
    read = read_function(d, plain, "cost")  # with its further symbols as numbers
    whole, inputs = (
        cost if data and isinstance(cost, ca.SX) else read,
        [d.extended_states, d.parameters, own],
    )

    def build() -> ca.Function:
        outputs = [whole, *(ca.densify(ca.gradient(whole, v)) for v in inputs[:2])]
        return ca.Function("cost", inputs, outputs, {"cse": True})

    function = system.cached(("cost", Content(inputs, whole)), build)
    every = np.repeat(p[:, None], len(states), axis=1)
    value, by_states, by_p = (np.array(v, float) for v in function(states.T, every, rows))
    return CostOver(float(value.sum()), by_states.T, by_p.sum(axis=1))
