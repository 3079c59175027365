"""Modes of a system with tables: cells in the driver, a letter for each breakpoint in results."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem
from ...model.definition.tables.pieces import first_surfaces

#: Reasons of which ``where`` is a function.
_OF_FUNCTIONS = (
    *("two_fold", "slid_to_two_fold", "multiple_zero", "indefinite", "no_jump"),
    *("stability_lost", "high_degree", "spiral_out"),
)


class Shown:
    """Conversion between the modes of the driver and those of results, with a surface for each breakpoint."""

    def __init__(self, system: FilippovSystem):
        self.system, self.driven, self.tables = system, system.of_pieces, system.written.tables
        #: Parameters of the user, before those that cells set.
        self.parameters = len(system.parameter_names)
        self._cells = len(self.driven.parameter_names) - self.parameters
        #: For each table, how many of its surfaces are below each cell.
        self._above = {
            t.element: list(accumulate([i >= 0 for i in t.shown], initial=0)) for t in self.tables
        }
        #: The number of each function, of a table that of its first breakpoint.
        *first, count = first_surfaces(system.written)
        self.functions = [*first, *range(count, count + len(system.impacts))]

    def with_cells(self, p: Array) -> Array:
        """Parameters (..., np) with room for those of cells."""
        whole = np.zeros((*p.shape[:-1], p.shape[-1] + self._cells + 1))
        whole[..., : p.shape[-1]] = p
        return whole

    def where(self, reason: str, function: int) -> int:
        """Where a run ended, in results."""
        return self.functions[function] if reason in _OF_FUNCTIONS else function

    def widened(self, letters: str, cells: NDArray[np.float64]) -> str:
        """Letters of a mode, with those of breakpoints: above below the cell, and the other way round."""
        parts = list(letters)
        for table, cell in zip(self.tables, cells.tolist(), strict=True):
            above = self._above[table.element][max(int(cell), 0)]
            parts[table.element] = "+" * above + "-" * (table.count - above)
        return "".join(parts)

    def narrowed(self, mode: str) -> tuple[int, ...]:
        """Letters that the driver reads: a table has one, as its cell follows from the state."""
        letters = self.system.parse_letters(mode)
        if not self.tables:
            return letters
        tables = {table.element for table in self.tables}
        return tuple(1 if i in tables else letters[k] for i, k in enumerate(self.functions))
