"""Equilibria of modes with conditions, contacts and joints as a parameter varies.

In a mode the field F keeps functions h at zero. With G their derivative, F + G^T h = 0 has the equilibria as solutions
and is regular off h = 0. A guard that vanishes on the branch is a boundary equilibrium: a condition or contact opens
or closes, a surface is reached or left. Where the branch of the mode beyond leaves to the other side of the parameter
it is persistence, to the same side a nonsmooth fold.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...flow.names import guard_name
from ...local.point.surface_point import null_space
from ...local.searches.equilibria import Equilibrium, by_real_part, equilibrium_of_mode
from ...local.searches.search import Found
from ...model import (
    Array,
    FilippovSystem,
    Guard,
    NonsmoothError,
    coupled_of,
    motion,
)
from ...model.derivatives.mode_derivatives import mode_equations
from ...solvers.continuation import Departure, Point, Zero, depart
from .branch import BranchCurve, BranchEvent, FarSide
from .equilibrium_branches import START, VIRTUAL, Equilibria

#: Part of the scales by which a guard's slope along a branch is a difference.
_STEP = 1e-6

_BOUNDARY = "boundary equilibrium of "


class ModeEquilibria(Equilibria):
    """F + G^T h = 0 in the unknowns (x, p) of a mode, for continuation."""

    def __init__(
        self, system: FilippovSystem, mode: str, p: Array, free: tuple[int, ...], scale: Array
    ):
        self.system, self.mode, self.free, self.scale = system, mode, free, scale
        self._p, self.n = p, system.dimension
        guards = [g for g in motion(system, mode).guards if g.kind in _KINDS]
        self._guards = {_BOUNDARY + guard_name(system, g): g for g in guards}
        self._numbers = mode_equations(system, mode)

    def parameters_at(self, u: Array) -> Array:
        p = self._p.copy()
        p[list(self.free)] = u[-len(self.free) :]
        return p

    def freed(self, u: Array, free: tuple[int, ...], widths: Array) -> tuple[BranchCurve, Array]:
        curve, k = copy(self), u.size - len(self.free)
        curve._p, curve.free = self.parameters_at(u), free
        curve.scale = np.append(self.scale[:k], widths)
        return curve, np.append(u[:k], curve._p[list(free)])

    def _at(self, u: Array) -> list[Array]:
        return self._numbers.copied(u[: self.n], self.parameters_at(u))

    def equations(self, u: Array) -> tuple[Array, Array]:
        field, slope, h, rows, _, field_p, h_p = self._at(u)
        free, back = list(self.free), rows.T
        return field.ravel() + back @ h.ravel(), np.hstack(
            [slope + back @ rows, (field_p + back @ h_p)[:, free]]
        )

    def eigenvalues(self, u: Array) -> NDArray[Any]:
        _, slope, _, rows, *_ = self._at(u)
        along = null_space(rows) if rows.size else np.eye(self.n)
        return by_real_part(along.T @ slope @ along)

    def mode_at(self, u: Array) -> str:
        return self.mode

    def lyapunov(self, u: Array, frequency: float) -> float:
        return float("nan") if self._at(u)[2].size else super().lyapunov(u, frequency)

    def double_zero(self, u: Array) -> bool:
        return self.eigenvalues(u).size > 1 and super().double_zero(u)

    def tests(self, point: Point) -> Mapping[str, float]:
        found = dict(zip(self._guards, self._at(point.u)[4].ravel().tolist(), strict=True))
        if self.eigenvalues(point.u).size > 1:
            found["Hopf"] = self.hopf(point.u)
        return found

    def codimension_two(self, name: str, u: Array, touch: float | None) -> Mapping[str, float]:
        return self.bautin(u) if name == "Hopf" else {}

    def faults(self, u: Array) -> list[str]:
        values = zip(self._guards, self._at(u)[4].ravel().tolist(), strict=True)
        return [name for name, value in values if value < -VIRTUAL]

    def ends(self, name: str) -> bool:
        return name in self._guards

    def named(self, test: str, u: Array) -> str:
        return "boundary equilibrium" if test in self._guards else test

    def describe(self, u: Array) -> Equilibrium:
        found = Found(u[: self.n])
        return equilibrium_of_mode(self.system, self.mode, found, self.parameters_at(u))

    def event(self, zero: Zero) -> BranchEvent | None:
        if zero.name not in self._guards:
            return self.smooth_event(zero, "fold")
        beyond = self._beyond(zero)
        if beyond is None:
            side = FarSide(
                "", "not followed: no mode of one more or fewer letters has equilibria beyond"
            )
            return self.described(zero, "boundary equilibrium", far_side=side)
        curve, name = beyond
        own, other = (
            self._inward(zero.point.u, zero.name)[-1],
            curve._inward(zero.point.u, name)[-1],
        )
        verdict = (
            "persistence: one continues the other"
            if own * other < 0.0
            else f"nonsmooth fold: equilibria of modes {self.mode} and {curve.mode} annihilate"
        )
        side = FarSide(f"equilibrium of mode {curve.mode}", verdict)
        return self.described(zero, "boundary equilibrium", far_side=side)

    def onward(self, event: BranchEvent, zero: Zero) -> Departure | None:
        """The equilibria of the mode beyond, where its guard is positive."""
        beyond = self._beyond(zero) if zero.name in self._guards else None
        if beyond is None:
            return None
        curve, name = beyond
        inward = curve._inward(zero.point.u, name)
        return depart(curve, zero.point.u, inward, START, inward)

    def _inward(self, u: Array, name: str) -> Array:
        """The tangent, in scaled unknowns, along which a guard grows."""
        tangent = np.linalg.svd(self.scaled(u / self.scale)[1])[2][-1]
        ends = (u + sign * _STEP * tangent * self.scale for sign in (1.0, -1.0))
        high, low = (self.tests(Point(end, tangent))[name] for end in ends)
        return np.asarray(tangent if high > low else -tangent)

    def _beyond(self, zero: Zero) -> tuple[ModeEquilibria, str] | None:
        """The equilibria of the mode in which the letter of a guard changes, and the guard there."""
        guard, u = self._guards[zero.name], zero.point.u
        letter = _changed(self.system, guard, self.mode[guard.element])
        mode = self.mode[: guard.element] + letter + self.mode[guard.element + 1 :]
        try:
            curve = ModeEquilibria(self.system, mode, self._p, self.free, self.scale)
        except NonsmoothError:
            return None
        of_element = {n: g for n, g in curve._guards.items() if g.element == guard.element}
        side = guard.side if letter == "s" else 0
        names = [n for n, g in of_element.items() if not side or g.side == side]
        if (
            not names
            or not np.abs(curve.equations(u)[0]).max() <= 1e-6 * self.scale[: self.n].max()
        ):
            return None
        return curve, names[0]


_KINDS = ("surface", "exit", "impact", "release")


def _changed(system: FilippovSystem, guard: Guard, letter: str) -> str:
    """The letter of an element beyond the zero of its guard."""
    if letter in "oc":
        return "co"["oc".index(letter)]
    if letter == "s":
        return "+" if guard.side > 0 else "-"
    is_continuous = coupled_of(system).continuous[guard.index]
    return {"+": "-", "-": "+"}[letter] if is_continuous else "s"
