"""A coupling of equal systems: what each row of a field receives from the others, with its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from ..definition.derived_systems import with_input
from ..definition.parse_definition import read_function
from ..definition.system import FilippovSystem
from ..errors import OptionError
from ..laws.evaluators import Evaluator


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
                "rows of the field that receive nothing."
            )
        named = zip(system.state_names, given, strict=True)
        read = [
            read_function(system.definition, row, f"coupling of {name!r}") for name, row in named
        ]
        output = ca.vertcat(*read)
        slope = ca.jacobian(output, system.extended_states[:n])
        symbols = [system.extended_states, system.parameter_symbols]
        outputs = [ca.densify(output), ca.densify(slope)]
        #: (x, p) -> H (n, 1), DH (n, n)
        self.output = Evaluator(ca.Function("output", symbols, outputs))
        #: With the inputs u as its last parameters.
        self.driven = with_input(system, output)


__all__ = ["Coupling"]
