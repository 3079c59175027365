"""The functions of a system that a compiled driver calls, as two C programs.

``modes_program``: every mode by itself, for one trajectory at a time.
``lanes_program``: the modes of one surface blended, for several trajectories in step.
"""

from __future__ import annotations

import casadi as ca

from .blend import blended_jet
from .ccode import Program
from .jets import taylor
from .motion import motion
from .system import FilippovSystem


def modes_program(system: FilippovSystem, order: int) -> str:
    """C of ``jet_k``, ``guard_values_k`` for mode k, ``surface_values`` and ``reset_map_j``.

    ``field_k`` is the field, for modes whose field has branch points.

    Arrays are row by row: states (N, order+1), guards (m, order+1), gradients (m, N).
    """
    x, p = system.extended_states, system.parameter_symbols
    program = Program(x, p)
    for k, mode in enumerate(system.modes):
        m = motion(system, mode)
        states, guards = taylor(m.field, m.functions, x, p, order)
        program.add(f"jet_{k}", c=states, g=guards)
        program.add(f"guard_values_{k}", value=m.functions, gradient=_gradient(m.functions, x))
        if m.branches:
            program.add(f"field_{k}", f=m.field)
    if system.surface_count:
        h = _surfaces(system)
        program.add("surface_values", h=h, gradient=_gradient(h, x))
    for j in range(len(system.resets)):
        program.add(f"reset_map_{j}", y=system._maps[:, j])
    return program.text()


def lanes_program(system: FilippovSystem, order: int) -> tuple[str, list[bool]]:
    """C of ``jet``, ``surface_values``, ``lie_values``, ``stop_values``, and which guards are affine.

    ``lie_values`` are L_F1 h and L_F2 h; each comes with its gradient, which measures rounding.
    ``field_values`` is there where a field has branch points.
    """
    x, p = system.extended_states, system.parameter_symbols
    blend = blended_jet(system, order)
    program = Program(x, p, blend.extra, ("I", "I", "T"))
    program.add("jet", c=blend.states, g=blend.guards)
    if system.surface_count:
        h = _surfaces(system)
        program.add("surface_values", h=h, gradient=_gradient(h, x))
        values = ca.vertcat(system.lie_derivative("+"), system.lie_derivative("-"))
        program.add("lie_values", value=values, gradient=_gradient(values, x))
    stops = ca.densify(system._guards) if system._guards.numel() else ca.SX(0, 1)
    program.add("stop_values", value=stops, gradient=_gradient(stops, x))
    if has_branches(system):
        program.add("field_values", f=blend.field)
    return program.text(), blend.affine


def _surfaces(system: FilippovSystem) -> ca.SX:
    return ca.vertcat(*[system.surface_function(i) for i in range(system.surface_count)])


def _gradient(functions: ca.SX, x: ca.SX) -> ca.SX:
    return ca.densify(ca.jacobian(functions, x)) if functions.numel() else ca.SX(0, x.numel())


def has_branches(system: FilippovSystem) -> bool:
    """Whether the field of some mode has branch points."""
    return any(motion(system, mode).branches for mode in system.modes)


def is_flat(system: FilippovSystem) -> bool:
    """Whether every surface is a plane: one Newton step then projects onto it exactly."""
    if not system.surface_count:
        return True
    return bool(ca.is_linear(_surfaces(system), system.extended_states))
