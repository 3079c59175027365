"""Planes of starts: states as functions of two coordinates, with derivatives."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..calls import call
from ..definition.system import FilippovSystem
from ..errors import NonsmoothError, OptionError
from ..reading import column
from ..values import Array


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
