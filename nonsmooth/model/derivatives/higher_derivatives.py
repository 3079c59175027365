"""Second and third derivatives of fields and guards, for normal forms and tangencies."""

from __future__ import annotations

import casadi as ca

from ..definition.system import FilippovSystem
from ..laws.evaluators import Evaluator, evaluator
from ..laws.motion import mode_field
from ..laws.switches import Guard
from .variational import guarded_field


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
    motion = guarded_field(system, mode).motion

    def build() -> list[ca.SX]:
        k = motion.guards.index(guard)
        rate = ca.mtimes(ca.jacobian(motion.functions[k], motion.states), motion.field)
        return [ca.jacobian(rate, motion.states)]

    return evaluator(system, ("rate of a guard", mode, guard), build, motion.states)
