"""The flow of one mode as a smooth system, forward or backward in time, whose stops are the zeros to report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from ..cache import Content
from ..definition.events import Stop
from ..definition.system import FilippovSystem
from .motion import motion, watched_functions
from .switches import Guard


@dataclass(frozen=True)
class Followed:
    """A mode's flow."""

    system: FilippovSystem  # of the states and of the multipliers that are states; backward in -t
    guards: tuple[Guard, ...]  # those of the mode, then the further functions
    stops: tuple[int, ...]  # guards of the system's stops; constant ones have none
    unknowns: tuple[int, ...]  # multipliers that are states


def followed(
    system: FilippovSystem, mode: str, watched: Sequence[ca.SX], backward: bool
) -> Followed:
    """Return the flow of a mode with further functions, built once."""
    expressions = watched_functions(system, watched)
    symbols = [system.extended_states, system.parameter_symbols]
    key = Content(symbols, ca.vertcat(*expressions)) if expressions else ()
    made = ("followed", mode, key, backward)
    return system.cached(made, lambda: _made(system, mode, expressions, backward))


def _made(
    system: FilippovSystem, mode: str, expressions: Sequence[ca.SX], backward: bool
) -> Followed:
    of_mode, n = motion(system, mode), system.dimension
    functions = [of_mode.functions[k] for k in range(len(of_mode.guards))] + [*expressions]
    guards = (*of_mode.guards, *(Guard("zero", k, 0, k) for k in range(len(expressions))))
    own = ca.vertsplit(of_mode.states)
    time = own.pop(n) if system.time_dependent else None
    rates = [of_mode.field[k] for k in range(of_mode.states.numel()) if time is None or k != n]
    multipliers = [ca.SX.sym(f"multiplier {k}") for k in range(len(own) - n)]
    old, new = [ca.vertcat(*own[n:])], [ca.vertcat(*multipliers)]
    if backward and time is not None:  # the system's time is -t
        old, new = [*old, time], [*new, -time]
    changed = ca.substitute([*rates, *functions], old, new)
    field = [-rate if backward else rate for rate in changed[: len(rates)]]
    states = ca.vertcat(*own[:n], *multipliers)
    moving = ca.vertcat(states, *([] if time is None else [time]))
    stops = {
        k: Stop(function, name=f"zero {k}")
        for k, function in enumerate(changed[len(rates) :])
        if ca.depends_on(function, moving)
    }
    made = FilippovSystem(
        states,
        field=field,
        parameters=ca.vertsplit(system.parameter_symbols),
        time=time,
        stops=list(stops.values()),
    )
    return Followed(made, guards, tuple(stops), of_mode.unknowns)
