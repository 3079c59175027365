"""A mode as one smooth field of the states, with its multipliers solved for.

``motion`` eliminates the multiplier of one surface. Of several surfaces, closed contacts and friction
on them the multipliers solve grad h_i . f(x, lambda) = 0, rates of gaps included: linear equations
are solved here symbolically; where they are not linear (products of multipliers, hidden dynamics) the
multipliers are further states, with the rate that keeps the equations.
"""

from __future__ import annotations

import casadi as ca

from ..definition.system import FilippovSystem, require_system
from .coupled import coupled_of
from .motion import Motion, motion
from .switches import Guarded

#: Determinants of more unknowns than these are not written out.
_WRITTEN_OUT = 3


class Solved:
    """The law of a mode of coupled surfaces and contacts (see ``switches.Sliding``)."""

    def __init__(self, system: FilippovSystem, mode: str):
        coupled, x = coupled_of(system), system.extended_states
        self.system, self.mode, self.coupled = system, mode, coupled
        sliding = coupled.sliding(mode)
        self.surfaces = tuple(i for i in sliding if i < system.surface_count)
        own = [coupled.unknown(i) for i in sliding]
        symbols = ca.vertcat(*own) if own else ca.SX(0, 1)
        field, layer = coupled.held_at(mode, [coupled.field, coupled.layer])
        residual = layer[sliding] if sliding else ca.SX(0, 1)
        self.unknowns: tuple[int, ...] = ()
        self.states, self.values, self.field = x, symbols, field
        if not sliding:
            return
        slope = ca.jacobian(residual, symbols)
        if not ca.depends_on(slope, symbols):
            self.values = -solved(slope, ca.substitute(residual, symbols, 0))
            self.field = ca.substitute(field, symbols, self.values)
            return
        self.unknowns = tuple(sliding)
        self.states = ca.vertcat(x, symbols)
        drift = ca.mtimes(ca.jacobian(residual, x), field)
        self.field = ca.vertcat(field, -solved(slope, drift))

    def exits(self, surface: int) -> Guarded:
        """Return the guards of a sliding surface."""
        return [(g, f) for g, f in self.guarded() if g.kind == "exit" and g.index == surface]

    def stability(self) -> Guarded:
        """Return none: a leg of known duration leaves no branch."""
        return []

    def guarded(self) -> Guarded:
        """Guards of the mode, in the order of ``Coupled.guards``, and their functions."""
        coupled, m = self.coupled, self.system.surface_count
        signs = self.system.parse_letters(self.mode)
        layer, heights, factors, stops = coupled.held_at(
            self.mode, [coupled.layer, coupled.heights, coupled.factors, coupled.stops]
        )
        sliding = coupled.sliding(self.mode)
        functions: list[ca.SX] = []
        for i, sign in enumerate(signs):
            if sign:
                functions.append(sign * heights[i])
            elif i >= m:
                functions.append(self.values[sliding.index(i)])
            elif i in self.system.joints:
                continue
            elif i not in sliding:
                functions += [-layer[i], layer[i]]
            else:
                u, n = self.values[sliding.index(i)], factors[i]
                turn = 1 if n.is_one() else n  # n^2 (1 -+ lambda) has the sign of 1 -+ lambda
                functions += [turn * (n - u), turn * (n + u)]
        functions += ca.vertsplit(stops)[: stops.numel()]
        guards = coupled.guards(self.mode)
        own = coupled.symbols_of(sliding)
        if own.numel() and not self.unknowns:
            functions = [ca.substitute(f, own, self.values) for f in functions]
        return list(zip(guards, functions, strict=True))


def solved(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solution of linear equations, written out for few unknowns."""
    k = matrix.shape[0]
    if k == 1:
        return ca.simplify(right / matrix)
    if k <= _WRITTEN_OUT:
        return ca.mtimes(ca.adj(ca.densify(matrix)), right) / ca.det(ca.densify(matrix))
    return ca.solve(matrix, right)


def explicit(system: FilippovSystem, mode: str) -> Motion:
    """Return the motion of a mode as a field of the states, for any system; built once."""
    require_system(system, joints=True)
    if not system.coupled:
        return motion(system, mode)

    def build() -> Motion:
        law = Solved(system, mode)
        return Motion(system, mode, law, law.guarded(), "explicit")

    return system.cached(("explicit", mode), build)
