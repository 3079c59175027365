"""The kinds of sliding of a mode, each with its field, exits and letters.

``Free`` has no sliding surface. ``Affine`` slides on one surface whose multiplier enters linearly:
the multiplier is eliminated symbolically. What slides on several surfaces, or on one whose multiplier enters
nonlinearly, is ``explicit.Solved``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from ..definition.system import FilippovSystem
from ..errors import DefinitionError
from ..expressions.cancel import cancel_common_factor, normal_forms
from ..expressions.identity import vanish_on


@dataclass(frozen=True)
class Guard:
    """What the zero of one event function means.

    Attributes
    ----------
    kind : {"surface", "exit", "near", "slip", "branch", "impact", "release", "stop", "reset", "atom", "zero"}
    index : int
        Of the switching function, gap, stop or reset in the definition.
    side : int
        For an exit the side, +1 or -1, to which the motion leaves; for a surface or an open contact
        the side on which the motion is; for stops and resets the direction; else 0.
    element : int
        Of the surface, set or contact among the letters of a mode; ``index`` for others.
    """

    kind: str
    index: int
    side: int
    element: int

    def ends(self, kind: str, element: int, side: int) -> bool:
        """Whether its zero is the event of a kind, of an element, to a side (of an exit)."""
        if self.kind == "branch":  # sliding ends there to any side
            return kind in ("exit", "stability") and self.element == element
        given = kind if kind in ("stop", "reset") else ""
        own = self.kind if self.kind in ("stop", "reset", "zero") else ""
        return (own, self.element) == (given, element) and (
            self.kind != "exit" or self.side == side
        )


Guarded = list[tuple[Guard, ca.SX]]


class Law(Protocol):
    """What a mode's motion is made of."""

    @property
    def states(self) -> ca.SX: ...
    @property
    def field(self) -> ca.SX: ...
    @property
    def unknowns(self) -> tuple[int, ...]:
        """Multipliers that are states."""
        ...


class Free:
    """No surface slides."""

    unknowns: tuple[int, ...] = ()

    def __init__(self, system: FilippovSystem, mode: str):
        self.states = system.extended_states
        self.field = system.field(mode)

    def exits(self, surface: int) -> Guarded:
        """Return none."""
        return []


class Affine:
    """One surface slides and its multiplier enters linearly."""

    unknowns: tuple[int, ...] = ()

    def __init__(self, system: FilippovSystem, mode: str, surface: int):
        self.system, self.mode = system, mode
        self.states = system.extended_states
        multipliers, lam = ca.SX([float(s) for s in system.parse_mode(mode)]), ca.SX.sym("lambda")
        multipliers[surface] = lam
        field = system.field_with(multipliers)
        middle = ca.substitute(field, lam, 0)
        entries = ca.vertsplit(ca.densify(ca.jacobian(field, lam)))
        if self._continuous(entries, surface):
            self.field = middle
            return
        gradient = ca.jacobian(system.surface_function(surface), self.states)
        a = ca.simplify(ca.mtimes(gradient, middle))
        # A factor of G is one of b = grad h . G too, and there it may no longer be in sight.
        reduced, _ = cancel_common_factor(entries, self.states, system.parameter_symbols)
        b = ca.simplify(ca.mtimes(gradient, ca.vertcat(*reduced)))
        self.field = middle - (a / b) * ca.vertcat(*reduced)

    def exits(self, surface: int) -> Guarded:
        """Return -L_F+ h and L_F- h, which vanish where sliding stops being attracting."""
        sides = {
            1: _with_letter(self.mode, surface, "+"),
            -1: _with_letter(self.mode, surface, "-"),
        }
        return [
            (
                Guard("exit", surface, side, surface),
                -side * self.system.lie_derivative([sides[side]], surface),
            )
            for side in (1, -1)
        ]

    def _continuous(self, difference: list[ca.SX], surface: int) -> bool:
        """Whether the two fields are one field on the surface."""
        h, p = self.system.surface_function(surface), self.system.parameter_symbols
        forms = normal_forms([self.states, p], difference)[1]  # to rounding of the coefficients
        pieces = [e for e, form in zip(difference, forms, strict=True) if form[0]]
        if not pieces:
            return True
        reduced, _ = cancel_common_factor([*pieces, h], self.states, p)
        return not ca.depends_on(reduced[-1], self.states) or vanish_on(pieces, h, self.states)


def _with_letter(mode: str, surface: int, letter: str) -> str:
    return mode[:surface] + letter + mode[surface + 1 :]


def kind_of(system: FilippovSystem, mode: str) -> Free | Affine:
    """Return the kind of sliding that a mode has, for a field that is explicit."""
    surfaces = [i for i, s in enumerate(system.parse_mode(mode)) if s == 0]
    if not surfaces:
        return Free(system, mode)
    if len(surfaces) == 1 and not system.nonlinear[surfaces[0]]:
        return Affine(system, mode, surfaces[0])
    raise DefinitionError(
        f"mode {mode!r} has no explicit field: on several surfaces, or with a nonlinear multiplier, "
        "there is only an equation. Use sliding_branches."
    )


def guards_of(system: FilippovSystem, mode: str, law: Free | Affine) -> Guarded:
    """Guards of a mode: surfaces and exits, stops and resets."""
    result: Guarded = []
    for i, sign in enumerate(system.parse_mode(mode)):
        if sign:
            result.append((Guard("surface", i, sign, i), sign * system.surface_function(i)))
        else:
            result += law.exits(i)
    functions = system.definition.guards
    of_events = zip(event_guards(system), ca.vertsplit(functions)[: functions.numel()], strict=True)
    return [*result, *of_events]


def event_guards(system: FilippovSystem) -> list[Guard]:
    """Guards of stops and resets, the same in all modes."""
    kinds = (("stop", system.stops), ("reset", system.resets))
    events = [Guard(kind, j, d, j) for kind, own in kinds for j, (_, d) in enumerate(own)]
    further = range(system.definition.guards.numel() - len(events))
    return [*events, *[Guard("atom", k, 0, k) for k in further]]
