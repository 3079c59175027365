"""The functions of a system that the lanes call, as a C program: the modes of one surface blended."""

from __future__ import annotations

import casadi as ca

from ..definition.system import FilippovSystem
from .blend import Blend, blended_jet
from .ccode import Program


def lanes_program(system: FilippovSystem, order: int) -> tuple[str, Blend]:
    """C of ``jet``, ``surface_values``, ``lie_values``, ``stop_values``, and the blended modes."""
    x, p = system.extended_states, system.parameter_symbols
    blend = blended_jet(system, order)
    program = Program(x, p, blend.extra, ("I", "I", "T"))
    program.add("jet", c=blend.states, g=blend.guards)
    if system.surface_count:
        h = _surfaces(system)
        program.add("surface_values", h=h, gradient=_gradient(h, x))
        values = ca.vertcat(system.lie_derivative("+"), system.lie_derivative("-"))
        program.add("lie_values", value=values, gradient=_gradient(values, x))
    stops = (
        ca.densify(system.definition.guards) if system.definition.guards.numel() else ca.SX(0, 1)
    )
    program.add("stop_values", value=stops, gradient=_gradient(stops, x))
    if blend.checked != ((), ()):
        rows, slots = (list(part) for part in blend.checked)
        program.add("check_values", f=blend.states[rows, 1], g=blend.guards[slots, 0])
    return program.text(), blend


def _surfaces(system: FilippovSystem) -> ca.SX:
    return ca.vertcat(*[system.surface_function(i) for i in range(system.surface_count)])


def _gradient(functions: ca.SX, x: ca.SX) -> ca.SX:
    return ca.densify(ca.jacobian(functions, x)) if functions.numel() else ca.SX(0, x.numel())


def is_flat(system: FilippovSystem) -> bool:
    """Whether every surface is a plane: one Newton step then projects onto it exactly."""
    if not system.surface_count:
        return True
    return bool(ca.is_linear(_surfaces(system), system.extended_states))
