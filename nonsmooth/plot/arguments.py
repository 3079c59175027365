"""Checks of arguments that several pictures share."""

from __future__ import annotations

from typing import Any

from ..model import (
    DefinitionError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    require_continuous,
    require_system,
)


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


def require_one_surface(
    system: FilippovSystem, caller: str, dimension: int, others: str, smooth: bool = False
) -> None:
    """Raise DefinitionError unless a system has so many states, one surface and no explicit time.

    ``smooth`` allows one without surfaces.
    """
    runs = "Draw runs with trajectory."
    require_system(system, sets=True, hysteresis=True)
    require_continuous(system, caller)
    if system.dimension != dimension:
        received, advice = f"{system.dimension} states: {', '.join(system.state_names)}", others
    elif system.sets:
        received, advice = "a set of codimension two or three", runs
    elif system.surface_count > 1 or not (system.surface_count or smooth):
        received, advice = f"{system.surface_count} surfaces", runs
    elif system.time_dependent:
        received, advice = "explicit time", f"Hold time at a value. {runs}"
    elif any(system.nonlinear):
        received, advice = "hidden dynamics", "Its sliding field is not a convex combination."
    else:
        return
    raise DefinitionError(
        f"{caller} draws autonomous systems of {dimension} states and 1 surface, not {received}. {advice}"
    )
