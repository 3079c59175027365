"""The smooth motion of one mode: its field and its guards.

A guard is a function that is positive inside the mode; the mode ends where it falls through zero:

- ``surface``: s_i h_i for a surface that does not slide (s_i = +1 or -1);
- ``exit``: the end of its kind of sliding (``switches``).

Stops and resets follow the guards as they were given; the driver checks their direction.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import casadi as ca

from ..definition.parse_definition import read_function
from ..definition.system import FilippovSystem, require_system
from .switches import Guarded, Law, guards_of, kind_of


class Motion:
    """Field and guards of one mode of a system; made by ``motion`` and ``followed``."""

    def __init__(
        self,
        system: FilippovSystem,
        mode: str,
        law: Law,
        guarded: Guarded,
        key: Hashable = (),
    ):
        self.system, self.mode, self.law, self._key = system, mode, law, key
        self.states, self.field = law.states, law.field
        self.guards = tuple(guard for guard, _ in guarded)
        functions = [function for _, function in guarded]
        self.functions = ca.densify(ca.vertcat(*functions)) if functions else ca.SX(0, 1)

    def value_function(self) -> ca.Function:
        """Return (x, p) -> the field (N, 1) and the guard functions (m, 1)."""
        values = [self.field, self.functions]
        return self.system.function(("values", self.mode, self._key), lambda: values, self.states)

    def gradient_function(self) -> ca.Function:
        """Return (x, p) -> gradients of the guard functions (m, N), the error scale of rounding."""

        def build() -> Sequence[ca.SX]:
            return [ca.jacobian(self.functions, self.states)]

        return self.system.function(("gradient", self.mode, self._key), build, self.states)


def motion(system: FilippovSystem, mode: str) -> Motion:
    """Return the motion of a mode, built once per system."""
    require_system(system)

    def build() -> Motion:
        law = kind_of(system, mode)
        return Motion(system, mode, law, guards_of(system, mode, law))

    return system.cached(("motion", mode), build)


def watched_functions(system: FilippovSystem, watched: Sequence[ca.SX]) -> list[ca.SX]:
    """Check functions that a user gives to be watched."""
    return [
        read_function(system.definition, w, f"watched function {k}") for k, w in enumerate(watched)
    ]
