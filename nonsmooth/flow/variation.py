"""Flow and derivatives along one mode over a known duration, by the driver in C."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model import Array, DegenerateError, FilippovSystem
from ..model.derivatives.variational import ORDER
from .engine.columns import LEAVING, NOT_UNIQUE, STUCK, CarriedLeg, ColumnsEngine, EndOfLeg
from .fixed import MOST_STEPS, TOLERANCE, stuck


class CarriedField:
    """One mode of a system, along which the driver carries states and derivatives."""

    def __init__(
        self,
        system: FilippovSystem,
        mode: str,
        chosen: tuple[int, ...] = (),
        left: tuple[int, ...] = (),
    ):
        # ``left``: switching functions of the sets on which the mode begins, and which it leaves.
        self.system, self.mode, self.chosen = system, mode, chosen
        self._letters = list(system.parse_letters(mode))
        for i in left:
            self._letters[i] = LEAVING
        self._engine = system.cached("columns", lambda: ColumnsEngine(system, ORDER))

    def states_at(self, x: Array, p: Array) -> Array:
        """The states of a leg at an extended state: the state itself."""
        return x

    def initial(self, x: Array, p: Array) -> Array:
        """State and its derivatives by the start, (N, 1 + N)."""
        return np.column_stack([x, np.eye(len(x))])

    def rate_at(self, x: Array, p: Array) -> Array:
        """The field at an extended state (N,)."""
        return self._carry(x, p, 0.0, (), None).start_rate

    def flow(self, x: Array, p: Array, duration: float, ends: EndOfLeg | None = None) -> CarriedLeg:
        """State and derivatives after a duration, from those of a state that is on the sets of the mode at once."""
        return self._carry(x, p, duration, self.chosen, ends)

    def _carry(
        self, x: Array, p: Array, duration: float, chosen: Sequence[int], ends: EndOfLeg | None
    ) -> CarriedLeg:
        given = (self._letters, x, p, chosen, duration, TOLERANCE, MOST_STEPS)
        found = self._engine.carry(*given, ends)
        if found.status == NOT_UNIQUE:
            raise DegenerateError(
                f"mode {self.system.spelled(self.mode)!r} at {x.tolist()}: expected one set of multipliers that "
                "keeps the sliding, received none or several. Start elsewhere."
            )
        if found.status == STUCK:
            raise stuck(duration, found.left, found.end)
        return found
