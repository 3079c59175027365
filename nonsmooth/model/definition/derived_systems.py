"""Systems derived from a system: with a Poincare section, with an input, or reversed in time."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, count
from typing import Any

import casadi as ca

from ..cache import Content
from ..errors import DefinitionError
from ..numbering import UNWATCHED
from ..reading import listed
from .events.conditions import Rule, passages
from .parse_definition import read_function
from .system import FilippovSystem

#: Name of the section of a system that was given one.
SECTION = "section"


def _changed(system: FilippovSystem, **changes: Any) -> FilippovSystem:
    """A system with some parts of its definition replaced."""
    own = system.definition if "field" in changes else system.written
    return FilippovSystem._of(replace(own, **changes), system.lifted)


def reversed_system(system: FilippovSystem) -> FilippovSystem:
    """Return the system with all fields reversed, without its stops."""
    for what, found in (
        ("explicit time", system.time_dependent),
        ("resets", system.resets),
        ("impacts", system.impacts),
    ):
        if found:
            raise DefinitionError(
                f"system: {system!r} has {what} and cannot be reversed in time. "
                "nonsmooth.flow.follow runs one smooth mode backward."
            )
    d = system.definition
    none: dict[str, Any] = dict.fromkeys(("guards", "whens", "priorities"), d.guards[:0])
    none |= {"stops": (), "rules": ()}
    return system.cached("reversed", lambda: _changed(system, field=-d.field, **none))


def with_section(system: FilippovSystem, function: Any, direction: int) -> FilippovSystem:
    """Return the system with a last reset, at a function's zeros, that does not change the state."""
    d = system.definition
    h = read_function(d, function, SECTION)
    if not ca.depends_on(h, d.extended_states):
        raise DefinitionError(f"section: expected a function of the states, received {h}.")
    known = ca.vertcat(d.extended_states, d.parameters)
    taken = {*d.impacts, *(n for n, _ in (*d.stops, *d.resets))}
    numbered = (f"{SECTION} {k}" for k in count(2))
    name = next(n for n in chain([SECTION], numbered) if n not in taken)

    def build() -> FilippovSystem:
        count = len(d.stops) + len(d.resets)
        own, others = d.guards[:count], d.guards[count:]
        rule = Rule(passages(count, direction), by_jumps=False)
        return _changed(
            system,
            guards=ca.vertcat(*[g for g in (own, h, others) if g.numel()]),
            maps=ca.horzcat(d.maps, d.states) if d.resets else d.states,
            whens=ca.vertcat(d.whens, 1) if count else ca.SX(1),
            priorities=ca.vertcat(d.priorities, 0) if count else ca.SX(0),
            resets=(*d.resets, (name, direction)),
            rules=(*[r.moved(count) for r in d.rules], rule),
        )

    return system.cached((SECTION, Content([known], h), direction), build)


def with_stops(system: FilippovSystem, surfaces: bool) -> FilippovSystem:
    """Return the system that stops at all guards of its events that are located, then at gaps.

    With ``surfaces`` it stops at these before gaps too; their multipliers are the last parameters.
    """
    d, none = system.definition, ca.SX(0, 1)
    found = [(a, way) for a, way in enumerate(d.located) if way != UNWATCHED]
    h, names = (d.surfaces, listed(d.multipliers)) if surfaces else (none, [])
    ways = [*[way for _, way in found], *[0] * h.numel(), *[-1] * len(d.impacts)]

    def build() -> FilippovSystem:
        parts: dict[str, Any] = dict.fromkeys(
            ("reactions", "gaps", "restitutions", "periods"), none
        )
        parts |= dict.fromkeys(("resets", "impacts", "clocks", "discrete"), ())
        if surfaces:
            parts |= dict.fromkeys(("multipliers", "surfaces", "hysteresis"), none)
            parts |= dict.fromkeys(("sizes", "laws", "layer_widths"), ())
            parts["parameters"] = ca.vertcat(d.parameters, d.multipliers)
        return _changed(
            system,
            field=ca.substitute(d.field, d.reactions, 0) if d.impacts else d.field,
            defaults={**d.defaults, **{str(name): None for name in names}},
            guards=ca.vertcat(*[d.guards[a] for a, _ in found], h, d.gaps),
            maps=d.maps[:, :0],
            whens=ca.SX.ones(len(ways), 1),
            priorities=ca.SX.zeros(len(ways), 1),
            stops=tuple((f"guard {k}", way) for k, way in enumerate(ways)),
            rules=tuple(Rule(passages(k, way)) for k, way in enumerate(ways)),
            **parts,
        )

    return system.cached(("with stops", surfaces), build)


def with_input(system: FilippovSystem, output: ca.SX) -> FilippovSystem:
    """Return the system with the field F + u - H(x), of outputs H (n,) and inputs u, n more last parameters."""
    d = system.definition
    taken = {*system.parameter_names, *system.state_names}
    names = [next(n for n in chain([base], (f"{base} {k}" for k in count(2))) if n not in taken)
             for base in (f"input of {s}" for s in system.state_names)]  # fmt: skip
    u = ca.vertcat(*[ca.SX.sym(name) for name in names])

    def build() -> FilippovSystem:
        return _changed(
            system,
            field=d.field + u - output,
            parameters=ca.vertcat(d.parameters, u),
            defaults={**d.defaults, **dict.fromkeys(names, 0.0)},
        )

    return system.cached(
        ("input", Content([ca.vertcat(d.extended_states, d.parameters)], output)), build
    )


def surface_of(system: FilippovSystem, function: Any) -> tuple[str, int] | None:
    """Name of the surface h = 0 with h = +-function, and that sign; components of a set do not count."""
    for i in range(system.surface_count):
        if i in system.set_of:
            continue
        for sign in (1, -1):
            h, other = system.surface_function(i), sign * ca.SX(function)
            if ca.is_equal(h, other, 20) or _vanishes(ca.simplify(h - other)):
                return system.surface_names[i], sign
    return None


def _vanishes(expression: ca.SX) -> bool:
    """Whether a linear expression is zero after simplification."""
    symbols = ca.vertcat(*ca.symvar(expression))
    if not ca.is_linear(expression, symbols):
        return False
    slope = ca.simplify(ca.jacobian(expression, symbols))
    rest = ca.simplify(ca.substitute(expression, symbols, ca.SX.zeros(symbols.numel(), 1)))
    return bool(slope.is_zero() or ca.densify(slope).is_zero()) and bool(rest.is_zero())
