"""The one form of a system, whichever way it was written: a field with multipliers, functions, names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..reading import listed


@dataclass(frozen=True)
class Definition:
    """A system as symbols and expressions."""

    states: ca.SX
    time: ca.SX
    parameters: ca.SX
    multipliers: ca.SX
    field: ca.SX
    surfaces: ca.SX
    guards: ca.SX
    maps: ca.SX
    reactions: ca.SX
    gaps: ca.SX
    restitutions: ca.SX
    stops: tuple[tuple[str, int], ...]
    resets: tuple[tuple[str, int], ...]
    impacts: tuple[str, ...]
    defaults: dict[str, float | None]
    hidden: bool
    sizes: tuple[int, ...] = ()
    renamed: tuple[tuple[str, str], ...] = ()

    @property
    def extended_states(self) -> ca.SX:
        """The states, followed by the time where the system depends on it."""
        return ca.vertcat(self.states, self.time)

    @property
    def gap_rates(self) -> ca.SX:
        """Rates of the gaps (c,), in states, parameters and time."""
        x = self.extended_states
        free = ca.vertcat(self.field, ca.SX.ones(self.time.numel(), 1))
        rates = ca.jtimes(self.gaps, x, free) if self.gaps.numel() else ca.SX(0, 1)
        return ca.densify(rates)

    @property
    def names(self) -> dict[str, list[str]]:
        """Names of the states and of the parameters."""
        return {
            "states": [s.name() for s in listed(self.states)],
            "parameters": [s.name() for s in listed(self.parameters)],
        }

    def state(self) -> dict[str, Any]:
        """Plain values from which ``from_state`` makes an equal definition."""
        inputs = [self.states, self.time, self.parameters, self.multipliers, self.reactions]
        outputs = [self.field, self.surfaces, self.guards, self.maps, self.gaps, self.restitutions]
        some: dict[str, Any] = {"sizes": self.sizes, "renamed": self.renamed}
        return {
            **{name: value for name, value in some.items() if value},
            "definition": ca.Function("definition", inputs, outputs).serialize(),
            "names": [[str(s) for s in listed(v)] for v in inputs],
            "defaults": self.defaults,
            "stops": self.stops,
            "resets": self.resets,
            "impacts": self.impacts,
            "hidden": self.hidden,
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> Definition:
        """Make the definition that ``state`` was taken from, over new symbols."""
        function = ca.Function.deserialize(state["definition"])
        vectors = [ca.vertcat(*map(ca.SX.sym, names)) for names in state["names"]]
        vectors = [v if v.numel() else ca.SX(0, 1) for v in vectors]
        expressions = [ca.SX(e) for e in function.call(vectors)]
        inputs = ("states", "time", "parameters", "multipliers", "reactions")
        outputs = ("field", "surfaces", "guards", "maps", "gaps", "restitutions")
        rest = {k: state[k] for k in ("stops", "resets", "impacts", "defaults", "hidden")}
        parts = dict(zip((*inputs, *outputs), (*vectors, *expressions), strict=True))
        sizes, renamed = tuple(state.get("sizes", ())), tuple(state.get("renamed", ()))
        return cls(**parts, **rest, sizes=sizes, renamed=renamed)
