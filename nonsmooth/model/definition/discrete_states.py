"""A system with its discrete states held: what the motion obeys between two events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi as ca

from ..checks import real
from ..errors import DefinitionError, PointError
from .parse_definition import Definition

_NONE = ca.SX(0, 1)


def held_values(d: Definition, values: Mapping[Any, float]) -> list[float]:
    """Numbers for all discrete states, in their order; keys are symbols or names."""
    names = d.names["states"][d.states.numel() - len(d.discrete) :]
    if not isinstance(values, Mapping):
        raise DefinitionError(
            f"values: expected a mapping of discrete states to numbers, received {values!r}. Write holding({{'q': 0}})."
        )
    given = {
        str(key): real(v, f"discrete state {key}", error=PointError) for key, v in values.items()
    }
    if not names or set(given) != set(names):
        raise DefinitionError(
            f"values: expected a number for each discrete state of {names}, received {sorted(given)}."
            + (f" Write holding({{{names[0]!r}: 0}})." if names else " The system has none.")
        )
    for name, allowed in zip(names, d.discrete, strict=True):
        require_allowed(name, given[name], allowed)
    return [given[name] for name in names]


def require_allowed(
    name: str, value: float, allowed: tuple[float, ...] | None, where: str = ""
) -> None:
    """Refuse a value that a discrete state does not have."""
    if allowed is not None and value not in allowed:
        raise PointError(
            f"{where}{name} = {value:g}, but the discrete state {name} has the values {allowed}. Give one of them."
        )


def with_values(d: Definition, values: list[float]) -> Definition:
    """The definition with numbers in place of its discrete states, without stops, resets and clocks."""
    count = d.states.numel() - len(values)
    still = d.states[count:]

    def put(expressions: ca.SX) -> ca.SX:
        return (
            ca.substitute(expressions, still, ca.DM(values)) if expressions.numel() else expressions
        )

    parts = {name: put(getattr(d, name)) for name in ("surfaces", "gaps", "restitutions")}
    events = dict.fromkeys(("guards", "whens", "priorities", "periods"), _NONE)
    return replace(
        d,
        states=d.states[:count],
        field=put(d.field)[:count],
        **parts,
        **events,
        maps=ca.horzcat(),
        stops=(),
        resets=(),
        rules=(),
        clocks=(),
        discrete=(),
        renamed=(),
    )
