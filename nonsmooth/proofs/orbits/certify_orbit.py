"""Proofs of the itinerary, the events and the end of an orbit, or of all orbits from a box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import groupby
from typing import Any, NamedTuple

from ...model import FilippovSystem, OptionError, PointError, require_plain, require_system, whole
from ..arithmetic.decimals import enclosure, given
from ..arithmetic.flint import arb, ctx
from ..arithmetic.intervals import Numbers, exact, exact_range, precision
from ..proof import DigitsError, UnprovenError
from ..surface_functions import enclosed, parameter_ranges
from .itinerary import EnclosedEvent, OrbitEnclosure
from .modes import EventFunction, Modes
from .orbit_proof import OrbitProof, ProvenEvent


class InitialSet(NamedTuple):
    """Initial states, parameters and duration of orbits, as exact intervals."""

    start: list[tuple[Fraction, Fraction]]
    ranges: list[tuple[Fraction, Fraction]]
    duration: Fraction


def certify_orbit(
    system: FilippovSystem,
    x0: Sequence[Any],
    t_end: Any,
    *,
    parameters: Mapping[Any, Any] | None = None,
    t0: Any = 0,
    numbers: Numbers = "stored",
    bits: int = 64,
    max_bits: int = 256,
    max_steps: int = 2000,
) -> OrbitProof:
    """Prove which modes an orbit goes through, when its events are, and where it ends.

    Taylor series with proven remainders, guards by proven signs, events by interval Newton. Where
    something stays undecided (a tangency, a two-fold, two events at once, a start set too wide) the
    result says where and why, and holds what was proven up to there.

    Parameters
    ----------
    system : FilippovSystem
        May have stops, resets and impacts without friction. One surface at a time may slide; sliding along an intersection, closed contacts and hidden dynamics are not proven.
    x0 : sequence of n numbers, strings or pairs (low, high)
        The start; pairs make a box, and the theorem is for all orbits from it.
    t_end : number or string
        Duration after ``t0``.
    parameters : mapping, optional
        Values, or pairs (low, high).
    t0 : number or string, optional
        Time at the start, where the system depends on it.
    numbers : {"stored", "written"}
        As in :func:`certify`.
    bits, max_bits : int, optional
        Precision to start with, and to give up at.
    max_steps : int, optional
        The proof gives up after this many steps.

    Returns
    -------
    OrbitProof
        What was proven about the orbit, and with what bounds.

    Raises
    ------
    MissingError
        python-flint is not installed.
    DefinitionError
        ``system`` is no FilippovSystem; hidden dynamics, vector multipliers, or contacts with friction.
    PointError
        Not a number or a pair for each state.
    ParameterError
        An unknown parameter, one without a value, or a value that is no finite number or interval.
    OptionError
        A start or a time that is not finite; bits or a limit out of its range; ``numbers`` that are neither.
    NotSmoothError
        An operation that jumps or has a kink.

    Notes
    -----
    Moore 1966; Lohner 1987; Zgliczynski 2002; return maps as in CAPD (Kapela et al. 2021).

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> s = ns.FilippovSystem([x, v], surface=v - 0.5, above=[v, -x - 1], below=[v, 1 - x])
    >>> orbit = ns.certify_orbit(s, [0, 0], t_end=3)
    >>> orbit.proven, orbit.itinerary, str(orbit.events[0].t)
    (True, '- s -', '0.523598775598298873... +- ...')
    """
    require_system(system)
    require_plain(system, "certify_orbit")
    duration = exact(t_end, numbers, "t_end")
    if duration <= 0:
        raise OptionError(f"t_end={t_end!r} is not positive. Give the duration of the orbit.")
    whole(bits, "bits", least=32)
    whole(max_bits, "max_bits", least=32)
    whole(max_steps, "max_steps")
    start = _read_start(system, x0, numbers)
    start.append((exact(t0, numbers, "t0") if system.time_dependent else Fraction(0),) * 2)
    ranges = parameter_ranges(system, parameters, numbers)
    moving = [i for i, (a, b) in enumerate(ranges) if a < b]
    modes = Modes(system, numbers, moving)
    constant = modes.graph.constant
    end = modes.end_at("end", modes.clock, constant(start[modes.clock][0] + duration))
    points = all(a == b for a, b in (*start, *ranges))
    while True:
        with precision(bits):
            result, digits = _run(modes, InitialSet(start, ranges, duration), end, max_steps)
        if result.proven or not (points and digits) or 2 * bits > max_bits:
            return result
        bits *= 2


def _read_start(system: FilippovSystem, x0: Sequence[Any], numbers: Numbers) -> list[Any]:
    try:
        values = list(x0)
    except TypeError:
        values = []
    if len(values) != system.dimension:
        raise PointError(
            f"x0={x0!r} does not have {system.dimension} numbers or pairs (low, high), for "
            f"{', '.join(system.state_names)}."
        )
    return [
        exact_range(value, numbers, f"start of {name!r}", PointError)
        for name, value in zip(system.state_names, values, strict=True)
    ]


def _run(
    modes: Modes, initial: InitialSet, end: EventFunction, max_steps: int
) -> tuple[OrbitProof, bool]:
    """Integrate to the end, a stop or something undecided; whether more digits may decide it."""
    flow, why, status, digits = None, "", "", False
    moving = [r for r in initial.ranges if r[0] < r[1]]
    x = enclosed([*initial.start, *moving])
    try:
        on = modes.surfaces_at([*initial.start, *moving], initial.ranges)
        flow = OrbitEnclosure(modes, x, enclosed(initial.ranges), on)
        flow.smallest = min(1e-3, float(initial.duration) / (50 * max_steps))
        flow.end = end
        *_, last = flow.run(max_steps)
        status = last.function.name
    except UnprovenError as error:
        why, digits = str(error), not isinstance(error, DigitsError)
    except KeyboardInterrupt:
        why = "interrupted"
    return _result(modes, flow, initial, x, status, why), digits


def _result(
    modes: Modes,
    flow: OrbitEnclosure | None,
    initial: InitialSet,
    x: list[arb],
    status: str,
    why: str,
) -> OrbitProof:
    system = modes.system
    names = (*system.state_names, *(("t",) if system.time_dependent else ()))
    # Parameters that vary are states of the flow, and are left out.
    named = lambda values: dict(zip(names, map(enclosure, values), strict=False))
    events = flow.events if flow else []
    visited = [events[0].before if events else flow.mode] if flow else []
    visited += [e.after for e in events]
    ranges = [given(*pair) for pair in initial.ranges]
    return OrbitProof(
        proven=bool(status),
        status=status or "undecided",
        why=why,
        itinerary=" ".join(mode or "o" for mode, _ in groupby(visited)),
        events=tuple(_event(e, named) for e in events),
        start=dict(zip(names, (given(*pair) for pair in initial.start), strict=False)),
        parameters=dict(zip(system.parameter_names, ranges, strict=True)),
        t=given(*[initial.duration] * 2)
        if status == "end"
        else enclosure(flow.t if flow else arb(0)),
        end=named(flow.hull() if flow else x),
        steps=flow.steps if flow else 0,
        bits=int(ctx.prec),
        numbers=modes.numbers,
        first=visited[0] if visited else "",
        duration=str(initial.duration),
        system=system,
    )


def _event(event: EnclosedEvent, named: Any) -> ProvenEvent:
    return ProvenEvent(
        event.kind,
        event.function.name,
        enclosure(event.t),
        named(event.x),
        event.before,
        event.after,
    )
