"""Checks and margins common to the functions of ``local``."""

from __future__ import annotations

from ..model import DefinitionError, FilippovSystem, require_system

#: A class that is closer than this to a change is not named.
MARGIN = 1e-6


def require_surface(system: FilippovSystem) -> None:
    """Refuse a smooth system."""
    if not system.surface_count:
        raise DefinitionError(
            "system: expected at least one switching surface, received a smooth system. Give "
            "surface= with above= and below=, or surfaces= with multipliers=."
        )


def require_autonomous(system: FilippovSystem, what: str, elements: bool = False) -> None:
    """Refuse explicit time; a flag allows complementarity conditions and constraints."""
    require_system(system, complementarity=elements, joints=elements)
    if system.time_dependent:
        raise DefinitionError(
            f"{what}: expected a system without explicit time, received one that depends on "
            f"{system.extended_states[-1]}. Make the time a state, or freeze it at a value."
        )


def require_linear(system: FilippovSystem, surface: int | None, what: str) -> None:
    """Refuse a multiplier that enters nonlinearly, for which alpha is not Filippov's weight."""
    if surface is not None and surface < len(system.nonlinear) and system.nonlinear[surface]:
        raise DefinitionError(
            f"{what}: expected multiplier {surface} to enter the field linearly, received hidden "
            "dynamics. The sliding field is then not a convex combination of two fields; follow "
            "it with simulate."
        )


def require_generic(
    system: FilippovSystem, surface: int, mode: str | None, what: str, force: bool = False
) -> None:
    """Refuse a surface on which nothing slides, but not, if ``force``, one where a force jumps."""
    found = system.switching(surface, mode=mode if system.surface_count > 1 else None)
    if not found.slides and not (force and found.kind == "velocity continuous"):
        raise DefinitionError(
            f"{what}: expected a surface on which orbits can slide, received surface {surface}, which is "
            f"{found.name}: both fields have the same L on it, and where L = 0 an orbit only touches it. classify "
            "names touches, points of rest between two forces, and equilibria on it."
        )


def parameter_index(
    system: FilippovSystem, name: str, what: str = "parameter", advice: str = "Give its name."
) -> int:
    """Index of a parameter by its name."""
    if name not in system.parameter_names:
        raise DefinitionError(
            f"{what}: expected a parameter among {list(system.parameter_names)}, received "
            f"{name!r}. {advice}"
        )
    return system.parameter_names.index(name)


def relative_difference(u: float, v: float) -> float:
    """|u - v| relative to |u| + |v|."""
    return abs(u - v) / (abs(u) + abs(v))
