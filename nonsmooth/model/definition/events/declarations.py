"""Events of a system besides switching: stops, resets, impacts and clocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca

from ...checks import real
from ...errors import DefinitionError
from ...reading import Expression, column, items_of, listed, scalar
from ..discrete_states import without_choices


@dataclass(frozen=True)
class _Conditional:
    """Common attributes of stops and resets."""

    function: Expression
    when: Expression | None = field(default=None, kw_only=True)
    level: bool = field(default=False, kw_only=True)
    initially: bool | None = field(default=None, kw_only=True)
    by_jumps: bool = field(default=True, kw_only=True)
    priority: Expression = field(default=0.0, kw_only=True)
    persistent: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class Stop(_Conditional):
    """A condition that ends a run, with the status STOPPED.

    Parameters
    ----------
    function : expression
        A guard: the run ends where it passes zero. ``fmin`` and ``fmax`` of guards are allowed. Or a
        condition: comparisons, ``casadi.logic_and``, ``logic_or``, ``logic_not`` of them; the run ends
        where it becomes true.
    direction : {-1, 0, 1}
        Of a guard: only when falling, either way, only when rising.
    name : str
        Shown in events and messages.
    when, level, initially, by_jumps, priority, persistent : optional
        As in :class:`Reset`.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x = ca.SX.sym("x")
    >>> falling = ns.FilippovSystem([x], field=[-1], stops=ns.Stop(x - 2, name="floor"))
    >>> run = ns.simulate(falling, [5.0], t_end=10.0)
    >>> run.status.name, run.events[-1].name, run.events[-1].t
    ('STOPPED', 'floor', 3.0)
    """

    direction: int = 0
    name: str = "stop"


@dataclass(frozen=True)
class Reset(_Conditional):
    """A condition at which the state jumps to ``map``.

    Parameters
    ----------
    function : expression
        A guard: the jump happens where it passes zero. ``fmin`` and ``fmax`` of guards are allowed. Or a
        condition: comparisons, ``casadi.logic_and``, ``logic_or``, ``logic_not`` of them; the jump
        happens where it becomes true.
    map : sequence of expressions or mapping
        The new state, in the order of the states; or new values of some states, the others stay. It may
        have ``if_else``, ``fmin``, ``fmax`` and comparisons.
    direction : {-1, 0, 1}
        Of a guard: only when falling, either way, only when rising.
    name : str
        Shown in events and messages.
    when : condition, optional
        A filter: the event fires only if it is true at that instant.
    level : bool, optional
        Due while the condition (and ``when``) is true: at the start, after a jump, by the motion.
        Otherwise where the condition becomes true.
    initially : bool, optional
        True: due at the start if true there. False: never due at the start. Unless given, an event that is clearly
        true at the start is not due, and the run's message notes it if it does not fire later; a reset on its
        zero is due if the motion enters.
    by_jumps : bool, optional
        Whether a jump of another event that makes the condition true makes the event due.
    priority : number or expression, optional
        Of several events due at one instant the largest fires first, evaluated then; then in the order of
        definition. Stops fire before resets.
    persistent : bool, optional
        Stay due where another event of the instant makes the condition false.
    values : {"now", "trigger"}, optional
        State that the map takes: the present one, or the one when the event became due; such a map changes
        only the states that it names.

    Notes
    -----
    A jump that makes the condition of an event true makes it due at the same instant. Events that are due at
    one instant fire one at a time, and all conditions are evaluated again after each.

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

    map: Sequence[Expression] | Mapping[Any, Expression]
    direction: int = 0
    name: str = "reset"
    values: str = field(default="now", kw_only=True)


@dataclass(frozen=True)
class Impact:
    """A unilateral contact: a gap that is never negative, with restitution.

    The contact is open (letter ``o``) or closed (``c``). Where the gap falls to zero with a rate v,
    an impulse along the reaction changes it to -restitution v. Impacts that accumulate end in the
    closed contact, in which the reaction keeps the gap at zero; it opens when the reaction falls to
    zero.

    Parameters
    ----------
    gap : expression
        Of states, parameters and time; not negative. Its rate must not depend on multipliers.
    restitution : expression or number, optional
        The coefficient, from 0 to 1.
    reaction : SX symbol, optional
        A multiplier in the field, not negative and linear there: how the reaction acts. Unless given,
        one is added that acts along the gradient of the gap's rate (unit masses). Friction at the
        contact is a surface whose multiplier is multiplied with it.
    name : str, optional
        Shown in events and messages.
    law : {"newton", "moreau", "poisson"}, optional
        How several contacts share an impact; the same for all impacts of a system.

    Notes
    -----
    Of coupled closed contacts, ``"newton"`` chooses as many as possible to have an impulse: each of them changes its
    rate v to -restitution v, the others open or stay closed without one. ``"moreau"`` solves one complementarity
    problem: each contact separates at -restitution v at least, and exactly so if its impulse is positive.
    ``"poisson"`` first ends the compression, as with restitution 0; in the expansion each contact gets at least
    restitution times that impulse. Friction at the contacts is bounded by their impulses in all three. One contact without friction has the same impact in each. Friction at several contacts may leave no impulse that
    fits, and then the run ends, and Poisson's law may depend on impulses that are not determined.

    Source: Acary & Brogliato 2008, Numerical Methods for Nonsmooth Dynamical Systems, chapter 3; Glocker & Pfeiffer
    1995.

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
    law: str = field(default="newton", kw_only=True)


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
    map : sequence of expressions or mapping, optional
        The other states after a tick (a kick, a latch, a sampled control), or some of them; unchanged unless
        given.
    name : str, optional
        Shown in events; ``at=`` takes it.

    Attributes
    ----------
    phase : SX symbol
        Time since the last tick.

    Notes
    -----
    Tick n is at the time of the first plus n periods, counted and never summed, so clocks do not drift. A start
    has a phase from 0 to below the period. If the jump of the phase changes the side of a surface, that is part
    of the same event.

    Examples
    --------
    A load switched on for the first 30 % of each period of 2:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, clock = ca.SX.sym("x"), ns.Clock(2.0)
    >>> switched = ns.FilippovSystem(
    ...     [x], surface=clock.phase - 0.6, above=[-x], below=[1 - x], clocks=clock)
    >>> switched
    FilippovSystem(2 states: x, clock_phase; 1 surface (velocity continuous); reset 'clock')
    >>> run = ns.simulate(switched, [0.0, 0.0], t_end=40.0, at=ns.Section("clock", skip=18))
    >>> duty = (ca.exp(0.6) - 1) / (ca.exp(2) - 1)  # periodic by now
    >>> bool(abs(run.sample_x[-1, 0] - duty) < 1e-9)
    True
    """

    period: Expression
    map: Sequence[Expression] | Mapping[Any, Expression] | None = None
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


def with_added_states(given: dict[str, Any]) -> dict[str, Any]:
    """Add clocks and discrete states to the arguments of a definition: as states, with ticks as resets."""
    clocks, discrete = items_of(given["clocks"], Clock, "clocks", "period"), given["discrete"]
    values = dict(discrete) if isinstance(discrete, Mapping) else dict.fromkeys(listed(discrete))
    states, phases = listed(given["states"]), [c.phase for c in clocks]
    n, still = len(states), list(values)
    result = {**given, "states": [*states, *phases, *still], "clocks": clocks}
    result["discrete"] = [_values(symbol, given) for symbol, given in values.items()]
    if not clocks and not still:
        return result
    allowed = dict(zip(still, result["discrete"], strict=True))
    for name in ("surface", "surfaces"):
        if still and given.get(name) is not None:
            result[name] = without_choices(given[name], allowed, name)
    for name in ("above", "below", "field", "rhs"):
        if given.get(name) is not None:
            entries = column(given[name], name, n)
            entries = without_choices(entries, allowed, name) if still else entries
            result[name] = [*ca.vertsplit(entries)[: entries.numel()], *[1.0] * len(clocks)]
            result[name] += [0.0] * len(still)
    resets = [given["resets"]] if isinstance(given["resets"], Reset) else listed(given["resets"])
    ticks = [_tick(clock, states, still) for clock in clocks]
    result["resets"] = [*[_widened(r, states, phases, still) for r in resets], *ticks]
    return result


def _values(symbol: Any, values: Any) -> tuple[float, ...] | None:
    """The values that a discrete state may have; None for any."""
    if values is None:
        return None
    what = f"values of {symbol}"
    found = tuple(real(v, what, error=DefinitionError) for v in listed(values))
    if not found:
        raise DefinitionError(
            f"{what}: expected numbers, received none. Write {{{symbol}: (0, 1)}}."
        )
    return found


def _widened(reset: Any, states: list[Any], phases: list[Any], still: list[Any]) -> Any:
    """A reset of the other states, which leaves the phases as they are."""
    if not isinstance(reset, Reset) or isinstance(reset.map, Mapping):
        return reset
    n, entries = len(states), listed(reset.map)
    if len(entries) != n + len(still):
        return reset  # the definition refuses it
    return replace(reset, map=[*entries[:n], *phases, *entries[n:]])


def _tick(clock: Clock, states: list[Any], still: list[Any]) -> Reset:
    jumped: dict[Any, Any]
    if clock.map is None or isinstance(clock.map, Mapping):
        jumped = dict(clock.map or {})
    else:
        others = [*states, *still]
        entries = column(clock.map, f"map of {clock.name!r}", len(others))
        jumped = dict(zip(others, ca.vertsplit(entries), strict=True))
    jumped[clock.phase] = clock.phase - clock.period
    return Reset(clock.phase - clock.period, jumped, 1, clock.name, level=True)
