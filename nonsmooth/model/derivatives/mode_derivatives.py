"""Derivatives of fields and guards of a mode, for equilibria, normal forms and tangencies."""

from __future__ import annotations

import casadi as ca

from ..definition.system import FilippovSystem
from ..errors import DefinitionError
from ..laws.coupled import coupled_of
from ..laws.evaluators import Evaluator, evaluator
from ..laws.motion import mode_field, motion
from ..laws.switches import Guard


def field_expansion(system: FilippovSystem, mode: str) -> Evaluator:
    """(x, u), p -> A, B(u, .), C(u, u, .) of a mode's field; h_x, h_xx of the sliding surface or 0."""

    x = system.extended_states
    u = ca.SX.sym("u", x.numel())

    def build() -> list[ca.SX]:
        f = mode_field(system, mode)
        first = ca.jtimes(f, x, u)
        third = ca.jacobian(ca.jtimes(first, x, u), x)
        h = system.surface_function(mode.index("s")) if "s" in mode else ca.SX(0.0)
        hessian, gradient = ca.hessian(h, x)
        return [ca.jacobian(f, x), ca.jacobian(first, x), third, gradient, hessian]

    return evaluator(system, ("field expansion", mode), build, ca.vertcat(x, u))


def contact_expansion(system: FilippovSystem, mode: str, surface: int, side: int) -> Evaluator:
    """x, p -> the field F of a mode, the field across one of its surfaces, and grad L_F h."""

    def build() -> list[ca.SX]:
        own, d, (i, *_) = mode_field(system, mode), system.definition, system.entries[surface]
        rate = ca.mtimes(system.gradient(d.open_surfaces[i]), own)
        if (
            i in system.half_lines
        ):  # with any multiplier: what follows depends on its direction alone
            push = ca.densify(ca.jacobian(d.field, d.multipliers[i]))
            return [own, own + ca.vertcat(push, ca.SX.zeros(d.time.numel())), system.gradient(rate)]
        turned = mode[:surface] + ("-" if side > 0 else "+") + mode[surface + 1 :]
        return [own, mode_field(system, turned), system.gradient(rate)]

    return evaluator(system, ("contact", mode, surface, side), build)


def guard_rate_gradient(system: FilippovSystem, mode: str, guard: Guard) -> Evaluator:
    """x, p -> the gradient of the rate of a guard along the field of its mode."""
    own = motion(system, mode)

    def build() -> list[ca.SX]:
        k = own.guards.index(guard)
        rate = ca.mtimes(ca.jacobian(own.functions[k], own.states), own.field)
        return [ca.jacobian(rate, own.states)]

    return evaluator(system, ("rate of a guard", mode, guard), build, own.states)


def mode_equations(system: FilippovSystem, mode: str) -> Evaluator:
    """(x, p) -> field, its derivative, functions that are kept at zero, theirs, guards without events, and derivatives of
    field and functions by parameters."""

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
        of_p = [ca.jacobian(e, system.parameter_symbols) for e in (field, h)]
        return [field, ca.jacobian(field, x), h, ca.jacobian(h, x), functions, *of_p]

    return evaluator(system, ("equations of a mode", mode), build)
