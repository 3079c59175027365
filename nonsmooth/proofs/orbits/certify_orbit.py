"""Theorems about one orbit: its itinerary, its events and its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import groupby
from typing import Any, NamedTuple

from ...model import FilippovSystem, OptionError, PointError, explain, require_system, whole
from ..arithmetic.decimals import enclosure, given
from ..arithmetic.enclosure import Enclosure
from ..arithmetic.flint import arb, ctx
from ..arithmetic.intervals import Numbers, exact, precision
from ..proof import DigitsError, UnprovenError
from ..surface_functions import enclosed, parameter_ranges
from .itinerary import Journey, Met
from .modes import Modes
from .orbit_proof import OrbitProof, ProvenEvent


class Begin(NamedTuple):
    """Where orbits start, and their parameters, as exact intervals."""

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
        Stops, resets and impacts without friction are served. Of several surfaces one may slide at a
        time; sliding along an intersection, closed contacts and hidden dynamics are not proven.
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
        ``system`` is none; hidden dynamics, vector multipliers, or contacts with friction.
    PointError
        Not a number or a pair for each state.
    ParameterError
        An unknown parameter, one without a value, or a value that is no finite number or interval.
    OptionError
        A start or a time that is not finite; bits or a limit out of its range.
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
    duration = exact(t_end, numbers, "t_end")
    if duration <= 0:
        raise OptionError(
            explain("t_end", expected="a positive time", received=repr(t_end), advice="")
        )
    whole(bits, "bits", least=32)
    whole(max_bits, "max_bits", least=32)
    whole(max_steps, "max_steps")
    start = _read_start(system, x0, numbers)
    if system.time_dependent:
        t = exact(t0, numbers, "t0")
        start.append((t, t))
    ranges = parameter_ranges(system, parameters, numbers)
    moving = [i for i, (a, b) in enumerate(ranges) if a < b]
    modes = Modes(system, numbers, moving)
    points = all(a == b for a, b in (*start, *ranges))
    while True:
        with precision(bits):
            end = enclosed([(duration, duration)])[0]
            result, digits = _run(modes, Begin(start, ranges, duration), end, max_steps)
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
            explain(
                "x0",
                expected=f"{system.dimension} numbers or pairs, for {', '.join(system.state_names)}",
                received=repr(x0),
                advice="A pair (low, high) makes a box.",
            )
        )
    result = []
    for name, value in zip(system.state_names, values, strict=True):
        ends = list(value) if isinstance(value, (tuple, list)) else [value, value]
        fractions = [exact(v, numbers, f"start of {name!r}") for v in ends]
        if len(fractions) != 2 or fractions[0] > fractions[1]:
            raise PointError(
                explain(
                    f"start of {name!r}",
                    expected="a number or (low, high)",
                    received=repr(value),
                    advice="",
                )
            )
        result.append((fractions[0], fractions[1]))
    return result


def _run(modes: Modes, begin: Begin, t_end: arb, max_steps: int) -> tuple[OrbitProof, bool]:
    """Follow until the end, a stop, or something undecided, and whether more digits may decide it."""
    follower, why, status, digits = None, "", "", False
    moving = [r for r in begin.ranges if r[0] < r[1]]
    x = enclosed([*begin.start, *moving])
    try:
        order = max(12, int(ctx.prec * 0.3))
        exactly = [*begin.start, *moving], begin.ranges
        follower = Journey(modes, x, enclosed(begin.ranges), order, exactly)
        follower.smallest = min(1e-3, float(t_end.mid()) / (50 * max_steps))
        while not status:
            if follower.steps >= max_steps:
                raise DigitsError(f"more than {max_steps} steps")
            met = follower.travel(t_end)
            if met is not None and met.kind == "stop":
                status = met.watch.name
            elif met is None and not (t_end - follower.t) > 0:
                status = "end"
    except UnprovenError as error:
        why, digits = str(error), not isinstance(error, DigitsError)
    except KeyboardInterrupt:
        why = "interrupted"
    return _result(modes, follower, begin, x, status, why), digits


def _result(
    modes: Modes, follower: Journey | None, begin: Begin, x: list[arb], status: str, why: str
) -> OrbitProof:
    system = modes.system
    names = (*system.state_names, *(("t",) if system.time_dependent else ()))
    # Parameters that were followed as states are left out.
    named = lambda values: dict(zip(names, map(enclosure, values), strict=False))
    events = follower.events if follower else []
    modes_met = [events[0].before if events else follower.mode] if follower else []
    modes_met += [e.after for e in events]
    ranges = [given(*pair) for pair in begin.ranges]
    return OrbitProof(
        proven=bool(status),
        status=status or "undecided",
        why=why,
        itinerary=" ".join(word or "o" for word, _ in groupby(modes_met)),
        events=tuple(_event(e, named) for e in events),
        start=dict(zip(names, (given(*pair) for pair in begin.start), strict=True)),
        parameters=dict(zip(system.parameter_names, ranges, strict=True)),
        t=enclosure(follower.t) if follower else Enclosure("0", "0"),
        end=named(follower.hull() if follower else x),
        steps=follower.steps if follower else 0,
        bits=int(ctx.prec),
        numbers=modes.numbers,
        first=modes_met[0] if modes_met else "",
        duration=str(begin.duration),
        system=system,
    )


def _event(met: Met, named: Any) -> ProvenEvent:
    return ProvenEvent(
        met.kind, met.watch.name, enclosure(met.t), named(met.x), met.before, met.after
    )
