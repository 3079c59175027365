"""Clocks: what happens periodically in time, such as the carrier of a pulse-width modulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from ..errors import DefinitionError, explain
from ..reading import Expression, column, listed, scalar
from .events import Reset


@dataclass(frozen=True, eq=False)
class Clock:
    """A phase that runs from 0 to its period and starts again.

    With ``FilippovSystem(..., clocks=clock)`` the phase becomes a state, after the others, so starts
    have a number more: where in the period the run begins. Functions of ``clock.phase`` are periodic
    in time; each tick is an event of kind ``reset`` with the clock's name, at which the other states
    may jump too.

    Parameters
    ----------
    period : expression or number
        Positive; may depend on parameters.
    map : sequence of expressions, optional
        The other states after a tick (a kick, a latch, a sampled control); unchanged unless given.
    name : str, optional
        Shown in events; ``at=`` takes it.

    Attributes
    ----------
    phase : SX symbol
        Time since the last tick.

    Notes
    -----
    A tick leads to ``phase - period``, which is zero to rounding: what rounding moved a tick is not
    lost, and clocks do not drift. A surface that the jump of the phase carries across changes its
    side in the same event (contract of events, 8).

    Examples
    --------
    A load switched on for the first 30 % of each period of 2:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, clock = ca.SX.sym("x"), ns.Clock(2.0)
    >>> switched = ns.FilippovSystem(
    ...     [x], surface=clock.phase - 0.6, above=[-x], below=[1 - x], clocks=clock)
    >>> switched
    FilippovSystem(2 states: x, clock_phase; 1 surface; reset 'clock')
    >>> run = ns.simulate(switched, [0.0, 0.0], t_end=40.0, at=ns.Section("clock", skip=18))
    >>> duty = (ca.exp(0.6) - 1) / (ca.exp(2) - 1)  # periodic by now
    >>> bool(abs(run.sample_x[-1, 0] - duty) < 1e-9)
    True
    """

    period: Expression
    map: Sequence[Expression] | None = None
    name: str = "clock"
    phase: ca.SX = field(init=False, repr=False)

    def __post_init__(self) -> None:
        period = scalar(self.period, f"period of {self.name!r}")
        if period.is_constant() and not float(period) > 0.0:
            raise DefinitionError(
                f"period of {self.name!r}: expected a positive number, received {float(period):g}."
            )
        object.__setattr__(self, "phase", ca.SX.sym(f"{self.name}_phase"))

    def __repr__(self) -> str:
        return f"Clock(period={self.period}, name={self.name!r})"


def with_clocks(clocks: Any, given: dict[str, Any]) -> dict[str, Any]:
    """Put clocks into the arguments of a definition: phases as states, ticks as resets."""
    clocks = [clocks] if isinstance(clocks, Clock) else listed(clocks)
    if not clocks:
        return given
    for i, clock in enumerate(clocks):
        if not isinstance(clock, Clock):
            raise DefinitionError(
                explain(
                    f"clocks[{i}]",
                    expected="a Clock",
                    received=f"{clock!r} ({type(clock).__name__})",
                    advice="Write clocks=[nonsmooth.Clock(period)].",
                )
            )
    states, phases = listed(given["states"]), [c.phase for c in clocks]
    n, result = len(states), {**given, "states": [*states, *phases]}
    for name in ("above", "below", "field", "rhs"):
        if given.get(name) is not None:
            entries = column(given[name], name, n)
            result[name] = [*ca.vertsplit(entries), *[1.0] * len(clocks)]
    resets = [given["resets"]] if isinstance(given["resets"], Reset) else listed(given["resets"])
    ticks = [_tick(clock, clocks, states) for clock in clocks]
    result["resets"] = [*[_widened(r, n, phases) for r in resets], *ticks]
    return result


def _widened(reset: Any, n: int, phases: Sequence[Any]) -> Any:
    """A reset of the other states, which leaves the phases as they are."""
    if not isinstance(reset, Reset) or len(listed(reset.map)) != n:
        return reset  # refused by the definition
    return Reset(reset.function, [*listed(reset.map), *phases], reset.direction, reset.name)


def _tick(clock: Clock, clocks: Sequence[Clock], states: Sequence[Any]) -> Reset:
    what = f"map of {clock.name!r}"
    jumped = states if clock.map is None else ca.vertsplit(column(clock.map, what, len(states)))
    phases = [c.phase - (c.period if c is clock else 0.0) for c in clocks]
    return Reset(clock.phase - clock.period, [*jumped, *phases], 1, clock.name)
