"""Functions that a user gives beside a system, with their derivatives: costs, couplings, planes of starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..cache import Content
from ..calls import call
from ..definition.derived_systems import with_input
from ..definition.parse_definition import read_function
from ..definition.system import FilippovSystem
from ..errors import NonsmoothError, OptionError
from ..laws.evaluators import Evaluator
from ..reading import column, symbols
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


class Coupling:
    """Outputs H(x) of a system, one for each state, and the system with the field F + u - H(x)."""

    def __init__(self, system: FilippovSystem, rows: Sequence[Any]):
        n = system.dimension
        try:
            given = [rows[i] for i in range(n)] if len(rows) == n else None
        except TypeError:
            given = None
        if given is None:
            raise OptionError(
                f"coupling: expected {n} expressions, one for each state, received {rows!r}. Give 0 for "
                "rows of the field without coupling."
            )
        named = zip(system.state_names, given, strict=True)
        read = [
            read_function(system.definition, row, f"coupling of {name!r}") for name, row in named
        ]
        output = ca.vertcat(*read)
        slope = ca.jacobian(output, system.extended_states[:n])
        inputs = [system.extended_states, system.parameter_symbols]
        outputs = [ca.densify(output), ca.densify(slope)]
        #: (x, p) -> H (n, 1), DH (n, n)
        self.output = Evaluator(ca.Function("output", inputs, outputs))
        #: With the inputs u as its last parameters.
        self.driven = with_input(system, output)


class StartMap:
    """States of a system as a smooth function of two coordinates."""

    def __init__(self, system: FilippovSystem, starts: Any):
        u, n = ca.SX.sym("u", 2), system.dimension
        try:
            if callable(starts):
                states = column(starts(u[0], u[1]), "starts", n)
            else:
                rows = np.asarray(starts, dtype=float)
                if rows.shape != (3, n) or not np.all(np.isfinite(rows)):
                    raise ValueError(f"shape {rows.shape}")
                states = ca.SX(rows[0]) + ca.mtimes(ca.SX(rows[1:].T), u)
        except (TypeError, ValueError, NonsmoothError) as error:
            raise OptionError(
                f"starts: expected three finite rows of {n} states (a point and two directions), "
                f"or a function of two coordinates that returns {n} expressions, received "
                f"{starts!r} ({error}). For example lambda a, b: [a, 0, b, 1]."
            ) from error
        extra = [s for s in ca.symvar(states) if not ca.depends_on(u, s)]
        if extra:
            raise OptionError(
                f"starts: the expressions contain {[str(s) for s in extra]} besides the two coordinates. Give numbers for "
                "them."
            )
        self._function = ca.Function("starts", [u], [states, ca.jacobian(states, u)])

    def __call__(self, u: Array) -> tuple[Array, Array]:
        """The states (n,) at coordinates (2,), and their derivatives (n, 2)."""
        states, slope = call(self._function, u)
        return states[:, 0], slope
