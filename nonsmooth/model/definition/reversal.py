"""Time reversal of a system: its orbits in the opposite direction."""

from __future__ import annotations

from dataclasses import replace

from ..errors import DefinitionError
from .system import FilippovSystem


def reversed_system(system: FilippovSystem) -> FilippovSystem:
    """Return the system with all fields reversed, without its stops."""
    for what, found in (
        ("explicit time", system.time_dependent),
        ("resets", system.resets),
        ("impacts", system.impacts),
    ):
        if found:
            raise DefinitionError(
                f"system: {system!r} has {what} and cannot be reversed in time. "
                "nonsmooth.flow.follow runs one smooth mode backward."
            )

    def build() -> FilippovSystem:
        d = system.definition
        definition = replace(d, field=-d.field, guards=d.guards[:0], stops=())
        back = FilippovSystem.__new__(FilippovSystem)
        back.__setstate__({**definition.state(), "lifted": system.lifted})
        return back

    return system.cached("reversed", build)
