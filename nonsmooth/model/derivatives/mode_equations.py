"""Equations of the equilibria of a mode: its field, what it keeps at zero, and its guards."""

from __future__ import annotations

import casadi as ca

from ..definition.system import FilippovSystem
from ..errors import DefinitionError
from ..laws.coupled import coupled_of
from ..laws.evaluators import Evaluator, evaluator
from ..laws.motion import motion


def mode_equations(system: FilippovSystem, mode: str) -> Evaluator:
    """(x, p) -> field, its derivative, functions that are kept at zero, theirs, and guards without events."""

    def build() -> list[ca.SX]:
        of_mode, x = motion(system, mode), system.extended_states
        if of_mode.states.numel() != x.numel():
            raise DefinitionError(
                f"mode {mode!r}: its multipliers are no functions of the states, so that it has no field."
            )
        letters = system.parse_letters(mode)
        coupled, contacts = coupled_of(system), len(system.impacts)
        every, lower = coupled.kept, system.surface_count + 2 * contacts
        kept = [i for i, s in enumerate(letters) if s == 0 and i not in system.algebraic]
        kept += [i + contacts for i in kept if i >= system.surface_count]
        kept += range(lower, every.numel())  # derivatives of joints
        guards = [
            k
            for k, guard in enumerate(of_mode.guards)
            if guard.kind in ("surface", "exit", "impact", "release")
        ]
        field, h, functions = of_mode.field, every[kept], of_mode.functions[guards]
        return [field, ca.jacobian(field, x), h, ca.jacobian(h, x), functions]

    return evaluator(system, ("equations of a mode", mode), build)
