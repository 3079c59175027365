"""Names and kinds of events in results: made here only, compared whole, never parsed."""

from __future__ import annotations

from collections.abc import Sequence

from ..model import FilippovSystem, Guard


def guard_name(system: FilippovSystem, guard: Guard) -> str:
    """Name of a guard: of a surface, of an end of sliding, or as the definition names an event."""
    k, kind = guard.element, guard.kind
    if kind in ("stop", "reset"):
        return (system.stops if kind == "stop" else system.resets)[k][0]
    if kind == "zero":
        return f"f{k}"
    if kind == "atom":
        names = [name for name, _ in (*system.stops, *system.resets)]
        own = len(names) + k
        rules = zip(names, system.definition.rules, strict=True)
        return next((f"a function of {name}" for name, r in rules if own in r.decided_by), f"f{k}")
    if k >= len(system.entries):
        return system.impacts[k - len(system.entries)]
    if _is_condition(system, k):
        return system.surface_names[system.entries[k][0]]
    number = system.numbers[k]
    if kind in ("surface", "near"):
        return f"h{number}"
    if len(system.entries[k]) > 1:
        return f"|lambda{number}| = 1"
    return f"lambda{number} = {guard.side}" if guard.side else "stability of sliding"


def _is_condition(system: FilippovSystem, k: int) -> bool:
    """Whether entry k is a complementarity condition."""
    return k < len(system.entries) and system.entries[k][0] in system.half_lines


def described(system: FilippovSystem, guard: Guard) -> str:
    """A guard's condition in words."""
    k, name = guard.element, guard_name(system, guard)
    if _is_condition(system, k) and guard.kind in ("surface", "release"):
        return f"{'y' if guard.kind == 'surface' else 'the multiplier'} of {name!r} >= 0"
    number = system.numbers[k] if k < len(system.entries) else 0
    if k < len(system.entries) and len(system.entries[k]) > 1:
        return f"|h{number}| > 0" if guard.kind == "surface" else f"|lambda{number}| <= 1"
    if guard.kind == "surface":
        return f"h{number} {'>' if guard.side > 0 else '<'} 0"
    if guard.kind == "exit":
        return f"lambda{number} {'<= 1' if guard.side > 0 else '>= -1'}"
    of = {"impact": "gap", "release": "reaction"}.get(guard.kind)
    return f"the {of} of {name!r} >= 0" if of else name


def shown_mode(system: FilippovSystem, mode: str, values: Sequence[float]) -> str:
    """A mode with the values of the discrete states, as itineraries show it."""
    names = system.state_names[system.dimension - len(values) :]
    labels = [f"{name}={value:g}" for name, value in zip(names, values, strict=True)]
    return ",".join([mode, *labels] if mode else labels)


def event_name(system: FilippovSystem, mode: str, kind: str, element: int, side: int = 0) -> str:
    """Name of the event of a kind that ends a mode."""
    if element < 0:
        return kind
    guards = {"s": "exit", "+": "surface", "-": "surface", "*": "near"}
    own = kind if kind in ("stop", "reset") else guards.get(mode[element:][:1], kind)
    return guard_name(system, Guard(own, element, side, element))


def change(before: str, after: str) -> str:
    """Kind of the event between two modes."""
    closed = after.count("c") - before.count("c")
    if closed:
        return "contact" if closed > 0 else "release"
    more = after.count("s") - before.count("s")
    return "entry" if more > 0 else ("exit" if more < 0 else "crossing")
