"""Conditions of events as trees of relations between smooth functions, the atoms.

A tree is a list of numbers in postfix order: ``8 * atom + mask`` is a relation, ``AND`` and ``OR`` join the two
before them. A mask has the signs of the atom for which the relation is true.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import casadi as ca
import numpy as np

from ...errors import DefinitionError
from ...expressions.graph import IN_A_GUARD, require_smooth
from ...numbering import UNWATCHED

#: Signs of an atom in the mask of a relation.
BELOW, ZERO, ABOVE = 1, 2, 4
AND, OR = -1, -2

#: How an atom is located: falling, either way, rising; or not at all.
FALLING, EITHER, RISING = -1, 0, 1

Tree = tuple[int, ...]
V = TypeVar("V")


@dataclass(frozen=True)
class Rule:
    """The rule of a stop or reset: when it is due, and its options."""

    triggers: tuple[Tree, ...]  # due where one becomes true: one, or two without a direction
    when: Tree | None = None  # the filter as a tree; the expression is in ``Definition.whens``
    level: bool = False  # due while the condition is true
    initially: int = (
        -1
    )  # 1: due at a start if true; 0: never; -1: a reset on its zero, if the motion enters
    by_jumps: bool = True  # whether jumps make it due
    persistent: bool = False  # whether it stays due
    at_trigger: bool = False  # whether its map takes the state when it became due
    named: tuple[int, ...] = ()  # states that its map names

    @property
    def atoms(self) -> set[int]:
        """Atoms of its conditions."""
        return {code // 8 for tree in self.triggers for code in tree if code >= 0}

    @property
    def decided_by(self) -> set[int]:
        """Atoms of its conditions and of its filter."""
        return {
            code // 8 for tree in (*self.triggers, self.when or ()) for code in tree if code >= 0
        }

    @property
    def located(self) -> tuple[Tree, ...]:
        """Conditions whose changes along a motion are located: a filter only while it makes a level due."""
        return (*self.triggers, *([self.when] if self.when and self.level else []))

    def moved(self, first: int) -> Rule:
        """Return the rule with the atoms from ``first`` on counted one higher."""

        def tree(codes: Tree) -> Tree:
            return tuple(code + 8 if code >= 8 * first else code for code in codes)

        when = None if self.when is None else tree(self.when)
        return replace(self, triggers=tuple(map(tree, self.triggers)), when=when)


#: Masks of the conditions that a guard is passed falling, either way, rising.
_PASSED = {-1: (BELOW | ZERO,), 0: (ABOVE | ZERO, BELOW | ZERO), 1: (ABOVE | ZERO,)}


def passages(atom: int, direction: int) -> tuple[Tree, ...]:
    """Triggers of a guard that is passed in a direction."""
    return tuple((8 * atom + mask,) for mask in _PASSED[direction])


def folded(
    tree: Sequence[int], relation: Callable[[int, int], V], joined: Callable[[V, V, bool], V]
) -> V:
    """A condition as a value of its relations, by atoms and masks, joined by and, or."""
    stack: list[V] = []
    for code in tree:
        if code >= 0:
            stack.append(relation(*divmod(code, 8)))
        else:
            two, one = stack.pop(), stack.pop()
            stack.append(joined(one, two, code == AND))
    return stack[-1]


def holds(tree: Sequence[int], sides: Sequence[int]) -> bool:
    """Whether a condition is true for given signs of the atoms."""
    relation = lambda atom, mask: bool(mask >> (sides[atom] + 1) & 1)
    return folded(tree, relation, lambda one, two, both: one and two if both else one or two)


def decides(rule: Rule, atom: int, sides: Sequence[int]) -> bool:
    """Whether the sign of one atom decides if an event is due, for given signs of the others."""
    own, due = list(sides), list[bool]()
    for tree in rule.triggers:
        for side in (-1, 1):
            own[atom] = side
            due.append(holds(tree, own) and (rule.when is None or holds(rule.when, own)))
    return any(one != two for one, two in zip(due[::2], due[1::2], strict=True))


def is_boolean(e: ca.SX) -> bool:
    """Whether an expression is a relation, or and, or, not of such."""
    return any(e.is_op(op) for op in (*_RELATIONS, ca.OP_AND, ca.OP_OR, ca.OP_NOT))


def is_piecewise(e: ca.SX) -> bool:
    """Whether an expression has fmin, fmax or fabs of smooth ones at its head."""
    return isinstance(_pieces(e), _Choice)


#: Signs of the second argument less the first for which a relation is true.
_RELATIONS = {
    ca.OP_LE: ABOVE | ZERO,
    ca.OP_LT: ABOVE,
    ca.OP_EQ: ZERO,
    ca.OP_NE: ABOVE | BELOW,
}


@dataclass(frozen=True)
class _Choice:
    """The least or the largest of some functions."""

    least: bool
    pieces: tuple[ca.SX | _Choice, ...]

    def changed(self, change: object, turned: bool = False) -> _Choice:
        assert callable(change)
        pieces = [
            p.changed(change, turned) if isinstance(p, _Choice) else change(p) for p in self.pieces
        ]
        return _Choice(self.least != turned, tuple(pieces))


def _pieces(e: ca.SX) -> ca.SX | _Choice:
    """Write an expression as fmin and fmax of functions without them, where it is one."""
    if e.n_dep() == 0:
        return e
    if e.is_op(ca.OP_FMIN) or e.is_op(ca.OP_FMAX):
        return _Choice(e.is_op(ca.OP_FMIN), (_pieces(e.dep(0)), _pieces(e.dep(1))))
    parts = [_pieces(e.dep(k)) for k in range(e.n_dep())]
    one, two = parts[0], parts[-1]
    if not any(isinstance(part, _Choice) for part in parts):
        if e.is_op(ca.OP_FABS):
            return _Choice(False, (e.dep(0), -e.dep(0)))
        return e
    if e.is_op(ca.OP_NEG) and isinstance(one, _Choice):
        return one.changed(lambda p: -p, turned=True)
    if e.is_op(ca.OP_ADD):
        return _sum(one, two)
    if e.is_op(ca.OP_SUB):
        return _sum(one, two.changed(lambda p: -p, True) if isinstance(two, _Choice) else -two)
    if e.is_op(ca.OP_MUL):
        choice, factor = (one, e.dep(1)) if isinstance(one, _Choice) else (two, e.dep(0))
        if factor.is_constant() and isinstance(choice, _Choice) and float(factor) != 0.0:
            return choice.changed(lambda p: factor * p, turned=float(factor) < 0.0)
    return e


def _sum(one: ca.SX | _Choice, two: ca.SX | _Choice) -> ca.SX | _Choice:
    if isinstance(one, _Choice):
        return _Choice(one.least, tuple(_sum(p, two) for p in one.pieces))
    if isinstance(two, _Choice):
        return _Choice(two.least, tuple(_sum(one, p) for p in two.pieces))
    return one + two


@dataclass
class Atoms:
    """The smooth functions of the conditions of a system, each once."""

    states: ca.SX  # extended
    moving: ca.SX  # those of them that are not discrete
    parameters: ca.SX
    functions: list[ca.SX | None] = field(default_factory=list)
    slot: int | None = None  # of an event whose own atom is still to be found

    def tree(self, e: ca.SX, what: str) -> Tree:
        """Read a condition."""
        return self._boolean(e, what, True)

    def passages(self, e: ca.SX, direction: int, what: str) -> tuple[Tree, ...]:
        """Read a guard that is passed in a direction."""
        return tuple(self._signs(_pieces(e), mask, what) for mask in _PASSED[direction])

    def _boolean(self, e: ca.SX, what: str, holds: bool) -> Tree:
        if e.is_op(ca.OP_NOT):
            return self._boolean(e.dep(0), what, not holds)
        if e.is_op(ca.OP_AND) or e.is_op(ca.OP_OR):
            both = e.is_op(ca.OP_AND) == holds
            parts = [self._boolean(e.dep(k), what, holds) for k in (0, 1)]
            return (*parts[0], *parts[1], AND if both else OR)
        for op, mask in _RELATIONS.items():
            if e.is_op(op):
                own = mask if holds else 7 ^ mask
                return self._signs(_pieces(e.dep(1) - e.dep(0)), own, what)
        raise DefinitionError(
            f"{what}: expected a comparison, or casadi.logic_and, logic_or, logic_not of comparisons, "
            f"received {e}. Write the smooth functions whose signs decide, for example x >= 1."
        )

    def _signs(self, e: ca.SX | _Choice, mask: int, what: str) -> Tree:
        """The condition that a function has one of the signs of a mask."""
        if not isinstance(e, _Choice):
            return (8 * self.add(e, mask, what) + mask,)
        if mask in (ZERO, ABOVE | BELOW):
            raise DefinitionError(
                f"{what}: == and != compare a discrete state with a number, not fmin or fmax."
            )
        found = self._joined(e, mask, what)
        if isinstance(found, bool):
            raise DefinitionError(
                f"{what}: expected a condition that becomes true, received one that is "
                f"{'always' if found else 'never'} true: constants among the arguments of fmin and fmax, or the values "
                "of a table beyond its ends, decide it."
            )
        return found

    def _joined(self, e: ca.SX | _Choice, mask: int, what: str) -> Tree | bool:
        """The condition; a relation of constants is true or false."""
        if not isinstance(e, _Choice):
            if e.is_constant():
                return bool(mask >> (1 + int(np.sign(float(e)))) & 1)
            return self._signs(e, mask, what)
        # The least of several is above where all are; the largest is below where all are.
        joined, tree = AND if e.least == bool(mask & ABOVE) else OR, Tree()
        for part in (self._joined(p, mask, what) for p in e.pieces):
            if isinstance(part, bool):
                if part == (joined == OR):
                    return part
            else:
                tree = (*tree, *part, joined) if tree else part
        return tree or joined == AND

    def add(self, function: ca.SX, mask: int, what: str) -> int:
        """Number of an atom, a new one unless it is there."""
        if mask in (ZERO, ABOVE | BELOW) and ca.depends_on(function, self.moving):
            raise DefinitionError(
                f"{what}: == and != are for discrete states, received a comparison of {function}. A state "
                "that moves is equal to a number at single instants only; write >= or <=."
            )
        require_smooth(function, self.states, self.parameters, what, IN_A_GUARD)
        if self.slot is not None:
            at, self.slot = self.slot, None
            self.functions[at] = function
            return at
        for k, known in enumerate(self.functions):
            if known is not None and ca.is_equal(known, function, 30):
                return k
        self.functions.append(function)
        return len(self.functions) - 1


def located(rules: Sequence[Rule], atoms: Sequence[ca.SX], moving: ca.SX) -> list[int]:
    """How each atom is located along a motion."""
    found = [UNWATCHED] * len(atoms)
    for rule in rules:
        for code in (code for tree in rule.located for code in tree if code >= 0):
            atom, mask = divmod(code, 8)
            if not ca.depends_on(atoms[atom], moving):
                continue  # it changes at jumps only
            way = {ABOVE: RISING, BELOW: FALLING}.get(mask & (ABOVE | BELOW), EITHER)
            found[atom] = way if found[atom] in (way, UNWATCHED) else EITHER
    return found
