"""Events of a system besides switching: stops, resets, impacts and clocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from ..errors import DefinitionError
from ..reading import Expression, column, listed, scalar


@dataclass(frozen=True)
class Stop:
    """A surface that ends a run, with the status STOPPED.

    Parameters
    ----------
    function : expression
        The run ends where it is zero.
    direction : {-1, 0, 1}
        Only when falling, either way, only when rising.
    name : str
        Shown in events and messages.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x = ca.SX.sym("x")
    >>> falling = ns.FilippovSystem([x], field=[-1], stops=ns.Stop(x - 2, name="floor"))
    >>> run = ns.simulate(falling, [5.0], t_end=10.0)
    >>> run.status.name, run.events[-1].name, run.events[-1].t
    ('STOPPED', 'floor', 3.0)
    """

    function: Expression
    direction: int = 0
    name: str = "stop"


@dataclass(frozen=True)
class Reset:
    """A surface on which the state jumps to ``map``.

    Parameters
    ----------
    function : expression
        The jump happens where it is zero.
    map : sequence of expressions
        The new state, in the order of the states.
    direction : {-1, 0, 1}
        Only when falling, either way, only when rising.
    name : str
        Shown in events and messages.

    Examples
    --------
    A mass that keeps four fifths of its speed at the floor:

    >>> import casadi as ca, nonsmooth as ns
    >>> y, v = ca.SX.sym("y"), ca.SX.sym("v")
    >>> hit = ns.Reset(y, [y, -0.8 * v], direction=-1, name="floor")
    >>> mass = ns.FilippovSystem([y, v], field=[v, -2.0], resets=hit)
    >>> run = ns.simulate(mass, [1.0, 0.0], t_end=1.5)
    >>> round(run.events[0].t, 12), (run.events[0].x_after.round(12) + 0.0).tolist()
    (1.0, [0.0, 1.6])
    """

    function: Expression
    map: Sequence[Expression]
    direction: int = 0
    name: str = "reset"


@dataclass(frozen=True)
class Impact:
    """A unilateral contact: a gap that is never negative, with Newton's restitution.

    The contact is open (letter ``o``) or closed (``c``). Where the gap falls to zero with a rate v,
    an impulse along the reaction turns it into -restitution v. Impacts that accumulate end in the
    closed contact, in which the reaction keeps the gap at zero; it opens when the reaction falls to
    zero.

    Parameters
    ----------
    gap : expression
        Of states, parameters and time; not negative. Its rate must not depend on multipliers.
    restitution : expression or number, optional
        Newton's coefficient, from 0 to 1.
    reaction : SX symbol, optional
        A multiplier in the field, not negative and linear there: how the reaction acts. Unless given,
        one is added that acts along the gradient of the gap's rate (unit masses). Friction at the
        contact is a surface whose multiplier is multiplied with it.
    name : str, optional
        Shown in events and messages.

    Examples
    --------
    A mass on a shaken table, and a block that slides on a floor with friction:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, u, v, t, lam, r = (ca.SX.sym(s) for s in ("x", "y", "u", "v", "t", "lam", "r"))
    >>> gap = y - 0.1 * ca.sin(5 * t)
    >>> ns.FilippovSystem([y, v], field=[v, -9.81], impacts=ns.Impact(gap, restitution=0.5), time=t)
    FilippovSystem(2 states: y, v; 0 surfaces; time t; impact 'impact')
    >>> block = ns.FilippovSystem(
    ...     [x, y, u, v], field=[u, v, -0.3 * lam * r, r - 9.81], surface=u, multipliers=lam,
    ...     impacts=ns.Impact(y, reaction=r))
    """

    gap: Expression
    restitution: Expression = 0.0
    reaction: Expression | None = None
    name: str = "impact"


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
    A tick leads to ``phase - period``, which is zero to rounding, so clocks do not drift. If the jump of
    the phase changes the side of a surface, that is part of the same event (contract of events, 8).

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
                f"clocks[{i}]: expected a Clock, received {clock!r} ({type(clock).__name__}). "
                "Write clocks=[nonsmooth.Clock(period)]."
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
        return reset  # the definition refuses it
    return Reset(reset.function, [*listed(reset.map), *phases], reset.direction, reset.name)


def _tick(clock: Clock, clocks: Sequence[Clock], states: Sequence[Any]) -> Reset:
    what = f"map of {clock.name!r}"
    jumped = states if clock.map is None else ca.vertsplit(column(clock.map, what, len(states)))
    phases = [c.phase - (c.period if c is clock else 0.0) for c in clocks]
    return Reset(clock.phase - clock.period, [*jumped, *phases], 1, clock.name)
