"""Conditions, contacts and joints at a point: which of them it is on, and the letters of the others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...model import (
    Array,
    DefinitionError,
    FilippovSystem,
    OptionError,
    PointError,
    coupled_of,
    has_elements,
)

#: Up to so many conditions and contacts all letters are tried.
_TRIED = 10


def acts(system: FilippovSystem, x: Array, p: Array, mode: str | None, tol: float) -> bool:
    """Whether a condition, a joint or a closed contact takes part at a point, or in a mode."""
    if not has_elements(system) or system.sets:
        return False
    if system.complementarity or system.constraints:
        return True
    if mode is not None:
        return 0 in system.parse_letters(mode)[system.surface_count :]
    heights = _Numbers(system, x, p, tol)
    return any(heights.is_zero(i) or heights.h[i] < 0.0 for i in heights.contacts)


@dataclass(frozen=True)
class Situation:
    """Letters at a point and the element that may change there; None where none may."""

    mode: str
    element: int | None


def situation(
    system: FilippovSystem, x: Array, p: Array, surface: int, mode: str | None, tol: float
) -> Situation:
    """Letters of all elements at a point, or those given, and which one the point is on."""
    at = _Numbers(system, x, p, tol)
    at.require_kept()
    if mode is None:
        return at.found()
    letters = list(system.parse_letters(mode))
    if surface in at.surfaces:
        letters[surface] = 0
    on = [i for i in at.surfaces if letters[i] == 0]
    if len(on) > 1:
        raise DefinitionError(
            f"mode {mode!r}: surfaces {on} slide, but beside conditions, contacts and joints one surface at a time is "
            "analysed. Give + or - to the others, and surface= which one."
        )
    half = surface in (*system.half_lines, *at.contacts) and at.is_zero(surface)
    return Situation(at.spelled(letters), on[0] if on else surface if half else None)


def chosen(system: FilippovSystem, surface: int, mode: str | None) -> Situation:
    """The element with a number, the others with the letters of a mode."""
    if mode is None:
        raise OptionError(
            f"mode: expected one letter for each of {[*system.surface_names, *system.impacts]}, received none. Beside "
            "conditions, contacts and joints a search needs them: the modes of the conditions and surfaces are "
            f"{list(system.modes)}, and contacts follow with o or c."
        )
    letters = list(system.parse_letters(mode))
    if surface in system.joints or not 0 <= surface < len(letters):
        raise DefinitionError(
            f"surface: expected the number of a surface, condition or contact among the letters {mode!r}, received {surface}."
        )
    letters[surface] = 0
    return Situation(_spelled(system, letters), surface)


def _spelled(system: FilippovSystem, letters: Sequence[int]) -> str:
    """Letters of a mode for signs."""
    half = {*system.half_lines, *range(system.surface_count, len(letters))}
    return "".join(("oc" if i in half else "+s-")[1 - sign] for i, sign in enumerate(letters))


class _Numbers:
    """Functions of all elements at a point, and the equations of their multipliers."""

    def __init__(self, system: FilippovSystem, x: Array, p: Array, tol: float):
        self.system, self.x, self.p, self.tol = system, x, p, tol
        self.coupled = coupled_of(system)
        self.h, gradient = self.coupled.kept_at(x, p)
        self.lengths = np.linalg.norm(gradient, axis=1)
        first = min((*system.half_lines, *system.joints, system.surface_count))
        self.surfaces = range(first)
        self.contacts = range(system.surface_count, self.coupled.count)
        self.one_sided = [
            *(i for i in system.half_lines if i not in system.algebraic),
            *self.contacts,
        ]

    def is_zero(self, i: int) -> bool:
        """Whether the point is on the zero of a function, to first order."""
        size = self.lengths[i] * (1.0 + float(np.linalg.norm(self.x)))
        return abs(float(self.h[i])) <= self.tol * size

    def name(self, i: int) -> str:
        """An element in words."""
        system = self.system
        if i >= system.surface_count:
            return f"the contact {system.impacts[i - system.surface_count]!r}"
        if i in system.half_lines:
            return f"the condition {system.surface_names[i]!r}"
        return f"surface {i}"

    def spelled(self, letters: Sequence[int]) -> str:
        """Letters of a mode for signs."""
        return _spelled(self.system, letters)

    def require_kept(self) -> None:
        """Refuse points that no motion reaches: off a joint, or beyond a condition or contact."""
        system, tol = self.system, self.tol
        self.tol = max(tol, 1e-8)
        joined = [(i, name) for i, name in zip(system.joints, system.constraints, strict=True)]
        for i, name in joined:
            if not self.is_zero(i):
                raise PointError(
                    f"point {self.x.tolist()}: the function of the constraint {name!r} is {self.h[i]:.6g} there, not zero. "
                    "Give a point that satisfies it."
                )
        rates = self.coupled.count + len(self.contacts)
        if joined and any(not self.is_zero(k) for k in range(rates, self.h.size)):
            raise PointError(
                f"point {self.x.tolist()}: the rate of a constraint is {self.h[rates:].tolist()} there, not zero. Give "
                "velocities that the joints allow."
            )
        self.tol = tol
        for i in self.one_sided:
            if self.h[i] < 0.0 and not self.is_zero(i):
                what = "gap" if i in self.contacts else "function y"
                raise PointError(
                    f"point {self.x.tolist()}: the {what} of {self.name(i)} is {self.h[i]:.6g} there, below zero, where "
                    "there is no motion. Give a point where it is not negative."
                )

    def found(self) -> Situation:
        """Letters by the signs of functions and, where they are zero, by the multipliers."""
        letters = np.where(self.h[: self.coupled.count] < 0.0, -1, 1)
        letters[list(self.system.joints)] = 0
        on = [i for i in self.surfaces if self.is_zero(i)]
        touched = [i for i in self.one_sided if self.is_zero(i)]
        letters[self.one_sided] = 1
        open_set = [*self.system.algebraic, *[i for i in touched if self._may_close(i)]]
        solved = list(self._solutions(letters, on, open_set))
        distinct = {tuple(one.tolist()) for one, _ in solved}
        if not distinct:
            raise PointError(
                f"point {self.x.tolist()}: no motion continues there, neither with closed conditions and contacts nor with open "
                "ones (Painleve's paradox, or a negative load). Check the friction and the loads."
            )
        between = {i for _, zeros in solved for i in zeros if i in self.system.algebraic}
        if len(on) == 1 and len(distinct) == 1 and not between:
            return Situation(self.spelled(next(iter(distinct))), on[0])
        struck = [i for i in touched if not self._may_close(i)]
        own = [*on, *sorted(between), *struck] if on or between or struck else touched
        if len(own) == 1 and len(distinct) <= 2:
            letters = np.array(min(distinct))  # closed, where it may be either
            return Situation(self.spelled(letters.tolist()), own[0])
        if not own and len(distinct) == 1:
            return Situation(self.spelled(next(iter(distinct))), None)
        if not on and not between and len(distinct) == 1 and all(not z for _, z in solved):
            return Situation(self.spelled(next(iter(distinct))), None)
        names = " and ".join(self.name(i) for i in {*on, *touched, *between})
        raise PointError(
            f"point {self.x.tolist()}: it is on {names or 'no mode'} at once, and the admissible letters there are "
            f"{sorted({self.spelled(one) for one in distinct})}. Give mode=, one letter for each element, in which all "
            "but one are chosen; simulate continues the motion."
        )

    def _may_close(self, i: int) -> bool:
        """Whether a touched element is not left by the speed that it has."""
        if i not in self.contacts:
            return True
        return self.is_zero(i + len(self.contacts))

    def _solutions(
        self, letters: NDArray[np.int64], on: Sequence[int], which: Sequence[int]
    ) -> Iterator[tuple[NDArray[np.int64], list[int]]]:
        """Letters of conditions and contacts with multipliers and rates that are not negative, and what is zero."""
        if len(which) > _TRIED:
            raise PointError(
                f"point {self.x.tolist()}: {len(which)} conditions and contacts could close there. Give mode=, one "
                "letter for each element."
            )
        for sides in product((1, -1), repeat=len(on)):
            own = letters.copy()
            own[list(on)] = sides
            yield from self._of_sides(own, on, which)

    def _of_sides(
        self, letters: NDArray[np.int64], on: Sequence[int], which: Sequence[int]
    ) -> Iterator[tuple[NDArray[np.int64], list[int]]]:
        coupled, joints = self.coupled, list(self.system.joints)
        held = np.array(letters, float)
        held[[*self.system.half_lines, *joints, *self.contacts]] = 0.0
        at = coupled.layer_at(self.x, held, np.zeros(coupled.count), self.p)
        rows = coupled.layer_gradients_at(self.x, held, self.p)
        units = np.linalg.norm(rows, axis=1) * (1.0 + float(np.linalg.norm(self.x)))
        for chosen in product((1, 0), repeat=len(which)):
            own = letters.copy()
            own[list(which)] = chosen
            closed = [*joints, *[i for i, sign in zip(which, chosen, strict=True) if not sign]]
            unknowns = np.zeros(coupled.count)
            m = at.slope[np.ix_(closed, closed)]
            unknowns[closed] = np.linalg.lstsq(m, -at.layer[closed], rcond=1e-12)[0]
            w = at.layer + at.slope @ unknowns
            size = np.abs(at.layer) + np.abs(at.slope) @ np.abs(unknowns) + units
            small = self.tol * size
            loads = np.abs(np.diag(at.slope)) * unknowns
            values = np.array([w[i] if own[i] else loads[i] for i in which])
            bound = small[list(which)]
            if np.any(values < -bound) or np.any(np.abs(w[closed]) > 1e-8 * size[closed]):
                continue
            own[list(on)] = 0
            yield own, [i for i, v, b in zip(which, values, bound, strict=True) if v <= b]
