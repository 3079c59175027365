"""Guards of a mode."""

from __future__ import annotations

from dataclasses import dataclass

from ..definition.system import FilippovSystem


@dataclass(frozen=True)
class Guard:
    """The meaning of a zero of one event function."""

    kind: str  # of ``GUARDS`` in flow/constants.py, or "zero"
    index: int  # of the switching function, gap, stop or reset in the definition
    #: For an exit the side, +1 or -1, to which the motion leaves; for a surface or an open contact the side on which the
    #: motion is; for stops and resets the direction; else 0.
    side: int
    element: int  # of the surface, set or contact among the letters of a mode; ``index`` for others

    def ends(self, kind: str, element: int, side: int) -> bool:
        """Whether its zero is the event of a kind, of an element, to a side (of an exit)."""
        if self.kind == "branch":  # sliding ends there to any side
            return kind in ("exit", "stability") and self.element == element
        given = kind if kind in ("stop", "reset") else ""
        own = self.kind if self.kind in ("stop", "reset", "zero") else ""
        return (own, self.element) == (given, element) and (
            self.kind != "exit" or self.side == side
        )


def event_guards(system: FilippovSystem) -> list[Guard]:
    """Guards of stops and resets, the same in all modes."""
    kinds = (("stop", system.stops), ("reset", system.resets))
    events = [Guard(kind, j, d, j) for kind, own in kinds for j, (_, d) in enumerate(own)]
    further = range(system.definition.guards.numel() - len(events))
    return [*events, *[Guard("atom", k, 0, k) for k in further]]
