"""Runs through tables as the driver integrates them: modes without breakpoints, whose cells set parameters."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...flow.events import Event
from ...model import Array, FilippovSystem, Guard
from ...model.definition.tables.pieces import Table

if TYPE_CHECKING:
    from .legs import Leg

#: Events that no letter of a mode stands for.
_WITHOUT_LETTER = ("stop", "reset", "zero", "end")


class Cells:
    """Modes and events of a system in terms of ``system``, that of pieces, which is the same without tables."""

    def __init__(self, shown: FilippovSystem):
        self.system, self._shown = shown.of_pieces, shown
        self.tables = {t.element: t for t in shown.written.tables}
        #: Of each table parameters of the cells, its entry, and its breakpoints that are surfaces.
        self._rows = {i: t.values() for i, t in self.tables.items()}
        self._entries = {i: self.system.entry_of(i) for i in self.tables}
        self._breakpoints = {
            i: np.flatnonzero(np.array(t.shown) >= 0).tolist() for i, t in self.tables.items()
        }
        #: Where letters of each entry and contact begin in modes that are shown.
        self._first = [*self.system.numbers]
        self._first += [self._first[-1] + 1 + j for j in range(len(self.system.impacts) - 1)]

    def mode(self, mode: str) -> str:
        """Its letters, with one for each table."""
        if not self.tables:
            return mode
        *first, contacts = self.system.numbers
        own = {*self._entries.values()}
        letters = ["+" if k in own else mode[at] for k, at in enumerate(first)]
        return "".join(letters) + mode[contacts:]

    def element(self, element: int) -> int:
        """Number of an entry or contact from that of a letter that is shown."""
        return bisect_right(self._first, element) - 1 if self.tables else element

    def is_breakpoint(self, event: Event) -> bool:
        """Whether an event is that of a table alone."""
        if not self.tables or event.kind in _WITHOUT_LETTER:
            return False
        return self.element(event.element) in self._entries.values()

    def event(self, event: Event) -> Event:
        """The same with its modes and element."""
        if not self.tables:
            return event
        before, after = self.mode(event.mode_before), self.mode(event.mode_after)
        own = event.element
        own = own if event.kind in _WITHOUT_LETTER or own < 0 else self.element(own)
        kept = event.name, event.x_after, own, event.side, event.motion
        return Event(event.kind, event.t, event.x, before, after, *kept)

    def leg(self, leg: Leg) -> Leg:
        """A leg with its mode and element."""
        own = leg.element
        own = own if leg.kind in _WITHOUT_LETTER or own < 0 else self.element(own)
        further = tuple(self.leg(then) for then in leg.further)
        return replace(leg, mode=self.mode(leg.mode), element=own, further=further)

    def guard(self, guard: Guard) -> Guard:
        """A guard of no table as one of a mode that is shown."""
        if guard.kind in (*_WITHOUT_LETTER, "atom"):
            return guard
        entries, element = self._shown.entries, self._first[guard.element]
        index = entries[element][0] if element < len(entries) else guard.index
        return replace(guard, element=element, index=index)

    def breakpoint(self, mode: str, element: int) -> tuple[float, float]:
        """On which side of a breakpoint a mode is, and where that is, by its letter; (1, 0) for others."""
        own = -1 if element < 0 else self.element(element)
        for i, entry in self._entries.items():
            if own == entry:
                level = self.tables[i].levels[self._breakpoints[i][element - self._first[entry]]]
                return (1.0 if mode[element] == "+" else -1.0), level
        return 1.0, 0.0

    def _above(self, table: Table, mode: str) -> int:
        """How many surfaces of a table are below its cell."""
        first = self._first[self._entries[table.element]]
        return mode[first : first + table.count].count("+")

    def cell(self, table: Table, mode: str) -> int:
        """The cell of a table in a mode that is shown."""
        above = self._above(table, mode)
        found = self._breakpoints[table.element][above - 1] + 1 if above else 0
        for k, i, sign in table.twins:
            if mode[self._first[self.system.entry_of(i)]] == "-+"[sign > 0]:
                found = max(found, k + 1)
        return found

    def beside(self, mode: str) -> dict[int, list[tuple[float, Guard]]]:
        """Of the function of each table the breakpoints beside the cell of a mode that is shown, with their guards."""
        found = dict[int, list[tuple[float, Guard]]]()
        for i, t in self.tables.items():
            above, positions, first = self._above(t, mode), self._breakpoints[i], self._entries[i]
            own = [(above - 1, 1)] * (above > 0) + [(above, -1)] * (above < t.count)
            guards = [
                Guard("surface", self._shown.entries[j][0], side, j)
                for k, side in own
                for j in (self._first[first] + k,)
            ]
            found[i] = [(t.levels[positions[k]], g) for (k, _), g in zip(own, guards, strict=True)]
        return found

    def parameters(self, p: Array, mode: str) -> Array:
        """Parameters (np,) with those of the cells of a mode that is shown."""
        if not self.tables:
            return p
        rows = [self._rows[i][self.cell(t, mode)] for i, t in self.tables.items()]
        return np.concatenate([p, *rows])


def cells_of(system: FilippovSystem) -> Cells:
    """Return the cells of a system, found once."""
    return system.cached("cells", lambda: Cells(system))
