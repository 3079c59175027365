"""Analysis at a point of a system with discrete states, which are fixed at their values there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import is_dataclass, replace
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np

from ..model import Array, FilippovSystem, Parameters, held_events
from ..model.definition.system import parted

P = ParamSpec("P")
R = TypeVar("R")


def with_discrete_states_held(analyse: Callable[P, R]) -> Callable[P, R]:
    """A function of a system and a point that analyses a system with discrete states as one without."""
    first, second = list(signature(analyse).parameters)[:2]

    @wraps(analyse)
    def held(*args: Any, **options: Any) -> Any:
        system = args[0] if args else options.get(first)
        hybrid = isinstance(system, FilippovSystem) and bool(system.definition.discrete)
        if not hybrid or (len(args) < 2 and second not in options):
            return analyse(*args, **options)
        assert isinstance(system, FilippovSystem)
        point = args[1] if len(args) > 1 else options.pop(second)
        options.pop(first, None)
        moving, values = parted(system, point)
        found = cast(Callable[..., Any], analyse)(
            system.holding(values), moving, *args[2:], **options
        )
        own = _named_virtual(found, system, values, options.get("parameters"))
        return _with_values(own, moving.size, list(values.values()))

    return cast(Callable[P, R], held)


def _named_virtual(
    found: Any, system: FilippovSystem, values: dict[str, float], parameters: Parameters | None
) -> Any:
    """Mark an equilibrium as virtual where a stop or reset is due at once, so that no motion reaches it."""
    own, kind = getattr(found, "status", None), getattr(found, "kind", "")
    named = kind in ("equilibrium", "pseudo-equilibrium")
    if own != "real" and not named:
        return found
    held = system.holding(values)
    regions = [event.region for event in held_events(system, values) if event.level]
    if all(held.evaluate(e, found.point, parameters).item() < 0.0 for e in regions):
        return found
    if own == "real":
        return replace(found, status="virtual")
    return replace(found, label=f"virtual {found.label.removeprefix('virtual ')}")


def _with_values(found: Any, count: int, values: list[float]) -> Any:
    """A result with the discrete states in its point, or zeros for them in a velocity."""
    if isinstance(found, np.ndarray):
        return np.concatenate([found, np.zeros(len(values))]) if found.shape == (count,) else found
    if isinstance(found, (list, tuple)):
        return type(found)(_with_values(one, count, values) for one in found)
    if not is_dataclass(found) or isinstance(found, type) or hasattr(found, "chart"):
        return found  # the chart of a two-fold is one of the states that move
    changed: dict[str, Any] = {}
    for name in ("point", "velocity", "detail"):
        part = getattr(found, name, None)
        if name == "detail" and part is not None:
            changed[name] = _with_values(part, count, values)
        elif isinstance(part, np.ndarray) and part.shape == (count,):
            tail: Array = np.array(values) if name == "point" else np.zeros(len(values))
            changed[name] = np.concatenate([part, tail])
    return replace(found, **changed) if changed else found
