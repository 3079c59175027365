"""Guards of modes of tables, by the programs of the modes without breakpoints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ...model import Array, FilippovSystem, Guard
from ...model.derivatives.variational import GuardedField, guarded_field
from .cells import cells_of


@dataclass(frozen=True)
class _OfMode:
    """Data of the motion of a mode."""

    system: FilippovSystem
    mode: str
    guards: tuple[Guard, ...]


class CellField:
    """The guards of a mode, as of a GuardedField, from those of the mode without its breakpoints."""

    def __init__(self, system: FilippovSystem, mode: str):
        self._cells, self.driven = (
            cells_of(system),
            guarded_field(cells_of(system).system, cells_of(system).mode(mode)),
        )
        beside, rows = self._cells.beside(mode), list[tuple[int, int, float, Guard]]()
        for k, guard in enumerate(self.driven.motion.guards):
            if guard.kind == "surface" and guard.index in beside:
                rows += [(k, own.side, level, own) for level, own in beside[guard.index]]
            else:
                rows.append((k, 1, 0.0, self._cells.guard(guard)))
        self.motion = _OfMode(system, mode, tuple(own for *_, own in rows))
        self._rows = [k for k, *_ in rows]
        self._sides = np.array([side for _, side, *_ in rows], float)
        self._levels = np.array([level for _, _, level, _ in rows])
        self.gradients = _Gradients(self)

    def parameters(self, p: Array) -> Array:
        """Parameters with those of its cells."""
        return self._cells.parameters(p, self.motion.mode)

    def gradients_at(self, y: Array, p: Array) -> Array:
        """Gradients of its guards at states."""
        own = self.driven.gradients.copied(y, self.parameters(p))[0][self._rows]
        return np.asarray(self._sides[:, None] * own)

    def values(self, driven: Array) -> Array:
        """Values of its guards, (..., guards), from those without breakpoints."""
        return np.asarray(self._sides * (driven[..., self._rows] - self._levels))

    def series(self, driven: Array) -> Array:
        """First coefficients of states and guards from those without breakpoints."""
        count = len(driven) - len(self.driven.motion.guards)
        own = self._sides[:, None] * driven[count:][self._rows]
        own[:, 0] -= self._sides * self._levels
        return np.vstack([driven[:count], own])

    def extrema(self, driven: Array) -> Array:
        """Rows of LegsWatch from those without breakpoints."""
        found = list[Array]()
        for j, (k, side, level) in enumerate(
            zip(self._rows, self._sides, self._levels, strict=True)
        ):
            own = driven[driven[:, 0] == k]
            own[:, 0], own[:, 2], own[:, 3] = j, side * (own[:, 2] - level), side * own[:, 3]
            found.append(own)
        return np.vstack(found) if found else driven[:0]


class _Gradients:
    """As an Evaluator of gradients."""

    def __init__(self, field: CellField):
        self._field = field

    def copied(self, y: Array, p: Array) -> list[Array]:
        """(y, p) -> gradients (g, N + k)."""
        return [self._field.gradients_at(y, p)]


#: Guards of a mode with their gradients.
Guarded: TypeAlias = GuardedField | CellField


def field_of(system: FilippovSystem, mode: str) -> Guarded:
    """The guards of a mode: with cells, where there are tables."""
    if not system.written.tables:
        return guarded_field(system, mode)
    return system.cached(("cell field", mode), lambda: CellField(system, mode))
