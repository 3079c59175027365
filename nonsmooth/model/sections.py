"""Sections that a system does not have itself: a function of the states, looked at where it is zero."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca

from .cache import Content
from .definition import read_function
from .errors import DefinitionError
from .system import FilippovSystem

#: Name of the section of a system that was given one.
SECTION = "section"


def with_section(system: FilippovSystem, function: Any, direction: int) -> FilippovSystem:
    """Return the system with a reset at a function's zeros that changes nothing.

    Parameters
    ----------
    system : FilippovSystem
    function : expression
        In states, parameters and time.
    direction : {-1, 0, 1}

    Raises
    ------
    DefinitionError, NotSmoothError
    """
    d = system.definition
    h = read_function(d, function, SECTION)
    if not ca.depends_on(h, d.extended_states):
        raise DefinitionError(f"section: expected a function of the states, received {h}.")
    known = ca.vertcat(d.extended_states, d.parameters)

    def build() -> FilippovSystem:
        definition = replace(
            d,
            guards=ca.vertcat(d.guards, h) if d.guards.numel() else h,
            maps=ca.horzcat(d.maps, d.states) if d.resets else d.states,
            resets=(*d.resets, (SECTION, direction)),
        )
        wider = FilippovSystem.__new__(FilippovSystem)
        wider.__setstate__({**definition.state(), "lifted": system.lifted})
        return wider

    return system.cached((SECTION, Content([known], h), direction), build)
