"""Legs through tables, by the programs of their modes without breakpoints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...model import Array, FilippovSystem
from .cells import cells_of
from .leg_integration import LegFlows, LegIntegrator
from .legs import Leg


class CellLegs:
    """As LegIntegrator, with parameters that the cells of each leg set."""

    def __init__(self, system: FilippovSystem, legs: Sequence[Leg], chosen: tuple[int, ...] = ()):
        cells = cells_of(system)
        self._rows = np.array([cells.parameters(np.zeros(0), leg.mode) for leg in legs])
        self._legs = LegIntegrator(cells.system, [cells.leg(leg) for leg in legs], chosen, True)
        positions = [cells.breakpoint(leg.mode, leg.element) for leg in legs]
        #: The events' functions at breakpoints: sides times what the arguments are above levels.
        self._sides, self._levels = np.array(positions).T

    def _parameters(self, p: Array) -> Array:
        return np.hstack([np.tile(p, (len(self._rows), 1)), self._rows])

    def ends(
        self, starts: Array, durations: Array, p: Array, extended: bool
    ) -> tuple[Array, Array | None, Array] | None:
        """As of LegIntegrator."""
        found = self._legs.ends(starts, durations, self._parameters(p), extended)
        if found is None:
            return None
        after, rest, value = found
        return after, rest, self._sides * (value - self._levels)

    def __call__(self, starts: Array, durations: Array, p: Array, *tol: float) -> LegFlows:
        """Integrate all legs."""
        flows, own = self._legs(starts, durations, self._parameters(p), *tol), slice(p.size)
        return replace(
            flows,
            after_parameters=flows.after_parameters[:, :, own],
            value=self._sides * (flows.value - self._levels),
            gradient=self._sides[:, None] * flows.gradient,
            value_parameters=self._sides[:, None] * flows.value_parameters[:, own],
        )
