"""Stops and resets of a system with fixed discrete states: where they are due among the other states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import casadi as ca

from ...errors import DefinitionError
from ..discrete_states import held_values
from ..system import FilippovSystem
from .conditions import ABOVE, BELOW, ZERO, folded
from .declarations import Stop

#: A condition that is always true, or never.
_ALWAYS = float("inf")


@dataclass(frozen=True, eq=False)
class HeldEvent:
    """A stop or reset as functions of the states that move.

    Attributes
    ----------
    name : str
    due : SX scalar
        Not negative where its condition is true.
    when : SX scalar or None
        Not negative where its filter is true; None if it always is.
    level : bool
        Whether it is due while its condition is true, so that there is no motion where it is.
    direction : {0, 1}
        Whether it is due where ``due`` rises through zero, or (0) where it passes zero either way.
    """

    name: str
    due: ca.SX
    when: ca.SX | None
    level: bool
    direction: int

    @property
    def region(self) -> ca.SX:
        """Not negative where a level event is due."""
        return self.due if self.when is None else ca.fmin(self.due, self.when)

    @property
    def functions(self) -> tuple[ca.SX, ca.SX]:
        """A function that is zero where it becomes due, and one that is not negative where its filter is true."""
        if self.level or self.when is None:
            return self.region if self.level else self.due, ca.SX(0.0)
        return self.due, self.when

    def stop(self, ahead: bool = True) -> Stop:
        """A stop where the event is due, or in reversed time."""
        more: dict[str, Any] = {} if self.when is None else {"when": self.when >= 0}
        if self.level:
            return Stop(self.due >= 0, name=self.name, level=True, **more)
        return Stop(self.due, self.direction if ahead else -self.direction, self.name, **more)


def discrete_values(system: FilippovSystem) -> list[dict[str, float]]:
    """All values that the discrete states may have together."""
    d = system.definition
    names = system.state_names[d.states.numel() - len(d.discrete) :]
    if any(allowed is None for allowed in d.discrete):
        raise DefinitionError(
            f"system: {system!r} does not say which values its discrete states {list(names)} may have. Say so, "
            f"discrete={{{names[0]}: (0, 1)}}, or hold them."
        )
    choices = [allowed or () for allowed in d.discrete]
    return [dict(zip(names, one, strict=True)) for one in product(*choices)]


def held_events(system: FilippovSystem, values: Mapping[Any, float]) -> tuple[HeldEvent, ...]:
    """Stops and resets that may happen while the discrete states have these values, without clocks."""
    d = system.definition
    numbers = held_values(d, values) if d.discrete else []
    count = d.states.numel() - len(numbers)
    atoms = d.guards
    if numbers and atoms.numel():
        atoms = ca.substitute(atoms, d.states[count:], ca.DM(numbers))
    every = ca.vertsplit(ca.densify(atoms))[: atoms.numel()]
    ticks = {len(d.stops) + reset for reset, _ in d.clocks}
    found = list[HeldEvent]()
    for k, ((name, _), rule) in enumerate(zip((*d.stops, *d.resets), d.rules, strict=True)):
        when = _ALWAYS if rule.when is None else _function(rule.when, every)
        due = _function(rule.triggers[0], every)
        never = -_ALWAYS in [e for e in (when, due) if isinstance(e, float)]
        if k in ticks or never or (isinstance(due, float) and not rule.level):
            continue
        filtered = None if isinstance(when, float) else when
        due, direction = ca.SX(due), 2 - len(rule.triggers)
        found.append(HeldEvent(name, due, filtered, rule.level, direction))
    return tuple(found)


def _function(tree: Sequence[int], atoms: Sequence[ca.SX]) -> ca.SX | float:
    """A function that is not negative where a condition is true; plus or minus inf where it always or never is."""
    return folded(tree, lambda atom, mask: _relation(atoms[atom], mask), _joined)


def _joined(one: ca.SX | float, two: ca.SX | float, both: bool) -> ca.SX | float:
    decided = -_ALWAYS if both else _ALWAYS
    if decided in [e for e in (one, two) if isinstance(e, float)]:
        return decided
    if isinstance(one, float) or isinstance(two, float):
        return two if isinstance(one, float) else one
    return ca.fmin(one, two) if both else ca.fmax(one, two)


def _relation(atom: ca.SX, mask: int) -> ca.SX | float:
    if atom.is_constant():
        value = float(atom)
        sign = ABOVE if value > 0 else BELOW if value < 0 else ZERO
        return _ALWAYS if mask & sign else -_ALWAYS
    return atom if mask & ABOVE else -atom


def held_relay(system: FilippovSystem, on: bool) -> tuple[FilippovSystem, tuple[HeldEvent, ...]]:
    """A system with one surface, of hysteresis, while its multiplier is +1 or -1, and where that ends."""
    d = system.definition
    h = d.surfaces[0]
    field = ca.vertsplit(system.field("+" if on else "-")[: system.dimension])
    smooth = FilippovSystem(**d.frame(), field=field)
    due = -h if on else h - d.hysteresis[0]
    return smooth, (HeldEvent("off" if on else "on", due, None, True, 1),)
