"""Checks of arguments that several pictures share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..model import (
    DefinitionError,
    FilippovSystem,
    HeldEvent,
    NonsmoothError,
    OptionError,
    discrete_values,
    held_events,
    held_relay,
    require_system,
)

#: Most panels of a picture, one for each value of the discrete states.
_PANELS = 9


def results(
    found: Any, kind: type, advice: str, error: type[NonsmoothError] = OptionError
) -> list[Any]:
    """One result of a kind, or a sequence of them, as a list."""
    several = list(found) if isinstance(found, (list, tuple)) else [found]
    if not several or not all(isinstance(one, kind) for one in several):
        raise error(f"found is {repr(found)[:60]}, not a {kind.__name__} or several. {advice}")
    return several


def same(several: list[Any], attribute: str) -> Any:
    """The common value of an attribute of results that are drawn in one figure."""
    values = sorted({getattr(one, attribute) for one in several})
    if len(values) > 1:
        raise OptionError(
            f"found has several {attribute}: {values}. Draw them in separate figures."
        )
    return values[0]


@dataclass(frozen=True)
class Held:
    """A system whose discrete states have one value each, with the events that may happen then."""

    values: Mapping[str, float]
    system: FilippovSystem
    events: tuple[HeldEvent, ...] = ()

    @property
    def name(self) -> str:
        """The values, for a title."""
        return ", ".join(f"{name} = {value:g}" for name, value in self.values.items())


def held(system: FilippovSystem, holding: Mapping[Any, float] | None, one: str = "") -> list[Held]:
    """The system for each value of its discrete states, or for those given; ``one`` says why only one may be."""
    require_system(system, sets=True, hysteresis=True, complementarity=True, joints=True)
    if system.remembering and system.surface_count == 1:
        return _relays(system, holding, one)
    if holding is None and not system.definition.discrete:
        return [Held({}, system)]
    several = discrete_values(system) if holding is None else [holding]
    if len(several) > (1 if one else _PANELS):
        why = one or f"there are {len(several)} values"
        raise OptionError(
            f"holding: expected values of the discrete states, as {why}, received none. Say which, holding={several[0]}."
        )
    held = [(values, system.holding(values)) for values in several]
    named = [{str(name): float(v) for name, v in values.items()} for values, _ in held]
    own = [held_events(system, values) for values in named]
    return [Held(v, h, e) for v, (_, h), e in zip(named, held, own, strict=True)]


def _relays(system: FilippovSystem, holding: Mapping[Any, float] | None, one: str) -> list[Held]:
    """A system whose only surface has hysteresis, for each state of it or for that given."""
    (name,) = set(system.surface_names)
    given = (
        {1: 1.0, -1: -1.0} if holding is None else {float(v): float(v) for v in holding.values()}
    )
    wrong = holding is not None and [str(key) for key in holding] != [name]
    if wrong or not set(given) <= {1.0, -1.0} or (one and len(given) > 1):
        raise OptionError(
            f"holding: expected {{{name!r}: 1}} or {{{name!r}: -1}}, the state of the relay"
            + (f", as {one}" if one else "")
            + f", received {holding!r}."
        )
    return [Held({name: v}, *held_relay(system, v > 0.0)) for v in given.values()]


def require_one_surface(
    system: FilippovSystem, caller: str, dimension: int, others: str, smooth: bool = False
) -> None:
    """Raise DefinitionError unless a system has so many states, one surface or condition and no explicit time.

    ``smooth`` allows one without surfaces.
    """
    runs = "Draw runs with trajectory."
    require_system(system, sets=True, hysteresis=True, complementarity=True, joints=True)
    conditions, count = len(system.complementarity), system.surface_count
    if system.constraints:
        received = f"constraints: {', '.join(system.constraints)}"
        advice = f"Write the motion in coordinates that satisfy them. {runs}"
    elif system.dimension != dimension:
        received, advice = f"{system.dimension} states: {', '.join(system.state_names)}", others
    elif system.sets:
        received, advice = "a set of codimension two or three", runs
    elif system.remembering:
        received = "an element with hysteresis"
        advice = f"Write its state as a discrete one, changed by a Reset at each threshold. {runs}"
    elif conditions and (count > 1 or system.impacts):
        received, advice = f"conditions beside {count - conditions} surfaces and contacts", runs
    elif count > 1 or not (count or smooth):
        received, advice = f"{count} surfaces", runs
    elif system.time_dependent:
        received, advice = "explicit time", f"Hold time at a value. {runs}"
    elif any(system.nonlinear):
        received, advice = "hidden dynamics", "Its sliding field is not a convex combination."
    else:
        return
    raise DefinitionError(
        f"{caller} draws autonomous systems of {dimension} states and 1 surface, not {received}. {advice}"
    )
