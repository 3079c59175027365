"""Flow map of a fixed itinerary, and a check that the guards admit it.

With modes and events fixed, the end of a motion is a smooth function of its start, so Newton's method
works across changes of itinerary. ``Arrival.fault`` describes the first guard that is violated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...flow.fixed import first_terms
from ...flow.follow import follow
from ...flow.names import described, guard_name
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    ConvergenceError,
    FilippovSystem,
    OptionError,
    Parameters,
    explain,
    mode_field,
    require_system,
)
from ...model.derivatives.event_maps import event_map, function_map
from ...model.derivatives.variational import guarded_field, states_at
from ...model.laws.motion import motion
from ...model.laws.switches import event_guards
from .guards import change_violation
from .legs import Leg, LegFlow, integrate_leg, rate_at
from .saltation import saltation

#: An Euler step of this length leaves a power law's zero, where a field has no Taylor series; its
#: error is below rounding.
_INSTANT = 1e-13

#: Parts of a leg's duration beside its ends in which a zero of a guard is that of the end's event. Both
#: exits of sliding vanish at a two-fold, which is reached up to rounding.
_NEAR = {"surface": 1e-7, "exit": 1e-5, "impact": 1e-7, "release": 1e-7}


@dataclass(frozen=True, eq=False)
class Arrival:
    """The end of a motion with a fixed itinerary.

    Attributes
    ----------
    x : ndarray (n,)
        State at the end.
    t, entry : float
        Time of the end, and of the beginning of the last leg.
    fault : str
        The first violation of a guard; empty if there is none.
    legs : tuple of Leg
    starts : tuple of ndarray (N,)
        Extended states at the starts of the legs.
    durations : tuple of float
    """

    x: Array
    t: float
    entry: float
    fault: str
    legs: tuple[Leg, ...] = ()
    starts: tuple[Array, ...] = ()
    durations: tuple[float, ...] = ()


def read_word(system: FilippovSystem, word: str | Sequence[str]) -> list[str]:
    """Modes of an itinerary: ``"- s +"``, ``"-s+"`` for one surface, or a sequence of modes."""
    modes = word.split() if isinstance(word, str) else list(word)
    width = system.surface_count + len(system.impacts)
    if isinstance(word, str) and len(modes) == 1 and width == 1:
        modes = list(modes[0])
    if isinstance(word, str) and width == 0:
        modes = [""] * max(1, len(modes))
    if not modes:
        raise OptionError(
            "itinerary: expected at least one mode, received none. Write for example '+ s -'."
        )
    modes = ["" if m == "o" and not width else m for m in modes]
    for mode in modes:
        system.parse_letters(mode)
    return modes


def leg_between(system: FilippovSystem, mode: str, following: str, name: str = "") -> Leg:
    """The leg of a mode that another mode follows; the letters or ``name`` decide the event."""
    events = {guard_name(system, guard): guard for guard in event_guards(system)}
    if name in events:
        return Leg(mode, events[name].kind, events[name].element, events[name].side)
    if name in system.impacts:
        return _of_contact(system, mode, system.impacts.index(name))
    if name in system.complementarity:
        return _of_condition(system, mode, system.surface_names.index(name))
    names = [*events, *system.complementarity, *system.impacts]
    leg = _by_letters(system, mode, following, names)
    names.append(leg.name(system))
    if name not in ("", names[-1]):
        raise OptionError(
            explain(
                "itinerary",
                expected=f"an event among {list(dict.fromkeys(names))} to end the leg in "
                f"mode {mode!r} that {following!r} follows",
                received=repr(name),
                advice="Correct the name, or leave it out.",
            )
        )
    return leg


def _by_letters(system: FilippovSystem, mode: str, following: str, named: list[str]) -> Leg:
    """The leg between two modes, from the letter that changes."""
    changed = [i for i, (a, b) in enumerate(zip(mode, following, strict=False)) if a != b]
    if not changed and len(system.resets) + len(system.impacts) == 1:
        return leg_between(system, mode, following, [*dict(system.resets), *system.impacts][0])
    if len(changed) != 1:
        raise OptionError(
            explain(
                "itinerary",
                expected="modes that follow each other by one event each",
                received=f"{mode!r} followed by {following!r}, where "
                + ("no letter changes" if not changed else f"{len(changed)} letters change"),
                advice="Give the event's name: itinerary=[(mode, event), ...], with an event of "
                f"{named} or of a surface.",
            )
        )
    (i,) = changed
    before, after = mode[i], following[i]
    if i >= system.surface_count:
        return _of_contact(system, mode, i - system.surface_count)
    if i in system.half_lines:
        return _of_condition(system, mode, i)
    kind = "exit" if before == "s" else "entry" if after == "s" else "crossing"
    return Leg(mode, kind, i, 1 if (after if kind == "exit" else before) == "+" else -1)


def _of_condition(system: FilippovSystem, mode: str, i: int) -> Leg:
    side = system.parse_letters(mode)[i]
    return Leg(mode, "contact" if side else "release", system.entry_of(i), side)


def _of_contact(system: FilippovSystem, mode: str, contact: int) -> Leg:
    side = system.parse_letters(mode)[system.surface_count + contact]
    return Leg(mode, "impact" if side else "release", len(system.entries) + contact, side)


@dataclass(frozen=True, eq=False)
class FixedItinerary:
    """The motion through given modes to a given end, as a function of its start.

    Parameters
    ----------
    system : FilippovSystem
        With scalar multipliers.
    word : str or sequence of str
        Modes in order, e.g. ``"+ s"``; ``modes`` has them one by one.
    until : str or expression
        What ends the last leg: the name of an event, or a function of states, parameters and time.
        Other zeros of guards are violations, not the end.
    parameters : mapping, optional
        Values of parameters; default the system's.
    tol : float, optional
        Relative tolerance.
    t_max : float, optional
        Longest duration of a leg.

    Examples
    --------
    A block thrown along a belt first slips, then sticks to it until the spring is strong enough:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> block = ns.FilippovSystem([x, v], surface=v - 1, above=[v, -x - 1], below=[v, -x + 1])
    >>> itinerary = FixedItinerary(block, "- s", until="lambda0 = -1")
    >>> arrival = itinerary.arrive([-1.0, 0.0])
    >>> arrival.x.round(12), arrival.fault
    (array([1., 1.]), '')
    """

    system: FilippovSystem
    word: str | Sequence[str]
    until: object
    parameters: Parameters | None = None
    tol: float = 1e-13
    t_max: float = 1000.0
    modes: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        require_system(self.system, complementarity=True)
        object.__setattr__(self, "modes", tuple(read_word(self.system, self.word)))

    def arrive(self, start: ArrayLike, t_start: float = 0.0) -> Arrival:
        """Move through the itinerary, each leg to its own event.

        Parameters
        ----------
        start : array_like (n,)
            The states at the start.
        t_start : float, optional
            Time at the start.

        Returns
        -------
        Arrival
            Its end ``x`` and ``t``, its legs, and ``fault``: the first violation, or empty.

        Raises
        ------
        ConvergenceError
            A leg does not reach its event.
        """
        system, p = self.system, self.system.parameter_vector(self.parameters)
        x, t, entry, fault = np.asarray(start, float), float(t_start), float(t_start), ""
        legs, starts, durations = list[Leg](), list[Array](), list[float]()
        for k, mode in enumerate(self.modes):
            last, entry = k + 1 == len(self.modes), t
            leg = None if last else leg_between(system, mode, self.modes[k + 1])
            run = self.leg(mode, t, x, self.until if leg is None else self._ends(leg))
            name, what = run.events[-1].name, f"leg {k + 1} ({mode})"
            if leg is not None and name != leg.name(system):
                fault = fault or f"{what} ends by {name!r}, not by {leg.name(system)!r}"
            fault = fault or self.inside(run, what)
            begin = system.extended_point(x, t)
            durations.append(float(run.t[-1]) - t)
            t, x = float(run.t[-1]), run.x[-1]
            if not fault and leg is not None:
                at = system.extended_point(x, t)
                fault = change_violation(system, leg, self.modes[k + 1], at, at, p)
                fault = f"{what}: {fault}" if fault else ""
            legs.append(leg or Leg(mode))
            starts.append(begin)
        return Arrival(x, t, entry, fault, tuple(legs), tuple(starts), tuple(durations))

    def _ends(self, leg: Leg) -> tuple[object, ...]:
        """Events that may end a leg: its own, its sibling, and the end of the itinerary."""
        names = {guard_name(self.system, g): g for g in motion(self.system, leg.mode).guards}
        exits = [name for name, g in names.items() if (g.kind, g.element) == ("exit", leg.element)]
        own = tuple(exits) if leg.kind == "exit" and exits else (leg.name(self.system),)
        end = isinstance(self.until, str) and (self.until not in names or self.until in own)
        return own if end else (*own, self.until)

    def inside(self, run: Trajectory, what: str) -> str:
        """A guard of its mode that a leg violates; empty if there is none.

        Zeros near the ends are those of the events there.

        Parameters
        ----------
        run : Trajectory
            Of one mode, as :meth:`leg` returns it.
        what : str
            Named in the message.
        """
        system, mode = self.system, run.segments[0].mode
        start, end = float(run.t[0]), float(run.t[-1])
        if end <= start:
            return f"{what} has the duration {end - start:.3g}"
        of_mode = motion(system, mode)
        kinds = {guard_name(system, g): g for g in of_mode.guards if g.kind in _NEAR}
        for event in run.events:
            guard = kinds.get(event.name)
            if guard is None or event.kind == "end":
                continue
            near = _NEAR[guard.kind] * (end - start)
            if start + near < event.t < end - near:
                return f"{what}: {described(system, guard)} fails at t = {event.t:.6g}"
        middle = system.extended_point(run(0.5 * (start + end)), 0.5 * (start + end))
        p = system.parameter_vector(self.parameters)
        y = states_at(system, mode, middle, p)
        values = first_terms(guarded_field(system, mode), y, p)[1][:, 0]
        for guard, value in zip(of_mode.guards, values, strict=True):
            if guard.kind in _NEAR and value <= 0.0:
                return f"{what}: {described(system, guard)} fails"
        return ""

    def leg(
        self, mode: str, t: float, x: Array, until: object, t_end: float | None = None
    ) -> Trajectory:
        """Follow one mode from a time and state to one of some events, or to a time.

        Parameters
        ----------
        mode, t, x
            The mode, whose guards are ignored, and the start.
        until, t_end
            The events, and the time that ends it in place of an event.

        Raises
        ------
        ConvergenceError
            The mode does not reach the event; ``point`` is the run.
        """
        run = self._run(mode, t, x, until, t_end)
        if run.status is Status.NOT_FINITE and len(run.t) == 1:
            rate = self._rate(mode, t, x)
            if rate is not None:
                run = self._run(mode, t, x + _INSTANT * rate, until, t_end)
        required = Status.STOPPED if t_end is None else Status.REACHED_END
        if run.status is not required:
            raise ConvergenceError(
                f"leg in mode {mode!r} from {np.array2string(np.asarray(x), precision=6)} at "
                f"t = {t:.6g}: {until!r} was not reached. {run.status}: {run.message}",
                point=run,
            )
        return run

    def _rate(self, mode: str, t: float, x: Array) -> Array | None:
        """The field where a mode has no Taylor series, if some mode's is finite there."""
        for letter in dict.fromkeys([mode, mode.replace("s", "+"), mode.replace("s", "-")]):
            rate = self.system.evaluate(mode_field(self.system, letter), x, self.parameters, t)
            if np.all(np.isfinite(rate)):
                return np.asarray(rate[: self.system.dimension, 0])
        return None

    def _run(self, mode: str, t: float, x: Array, until: object, t_end: float | None) -> Trajectory:
        return follow(
            self.system,
            x,
            t + self.t_max if t_end is None else t_end,
            mode=mode,
            until=until,
            t_start=t,
            parameters=self.parameters,
            tol=self.tol,
        )

    def derivative(self, arrival: Arrival) -> tuple[Array, Array]:
        """Derivatives of the end of an ``arrival`` by its start.

        Returns
        -------
        plain, at_event : ndarray (n, n)
            With the time of the end kept, and with the end on its event.
        """
        system, p, n = self.system, self.system.parameter_vector(self.parameters), self._n
        dx = np.eye(system.extended_dimension)
        flow: LegFlow | None = None
        for k, leg in enumerate(arrival.legs):
            flow = integrate_leg(system, leg, arrival.starts[k], arrival.durations[k], p)
            dx = flow.by_start @ dx
            if k + 1 < len(arrival.legs):
                at = leg.at_event(system, flow.end, p)
                rate = rate_at(system, arrival.legs[k + 1], at.after, p)
                dx = saltation(at, flow.rate, rate, f"leg {k + 1} ({leg.mode})").matrix @ dx
        assert flow is not None
        return dx[:n, :n], self._on_event(arrival, flow, dx, p)[:n, :n]

    @property
    def _n(self) -> int:
        return self.system.dimension

    def _on_event(self, arrival: Arrival, flow: LegFlow, dx: Array, p: Array) -> Array:
        mode = arrival.legs[-1].mode
        system, until = self.system, self.until
        if isinstance(until, str):
            guards = motion(system, mode).guards
            own = next(g for g in guards if guard_name(system, g) == until)
            at = event_map(system, mode, own.kind, own.element, own.side)(flow.end, p)
        else:
            at = function_map(system, mode, until)(flow.end, p)
        speed = float(at.gradient @ flow.rate)
        if not math.isfinite(speed) or speed == 0.0:
            return np.full_like(dx, np.nan)
        return dx - np.outer(flow.rate, at.gradient @ dx) / speed


# Conversion of an itinerary, given as a string or a list, to legs.

Itinerary = str | Sequence[str] | Sequence[tuple[str, str]]


def word_legs(system: FilippovSystem, itinerary: Itinerary, mirrored: bool) -> tuple[Leg, ...]:
    """The legs of a closed itinerary; if ``mirrored``, the image of the first follows the last."""
    word: Any = itinerary if isinstance(itinerary, str) else _listed(itinerary)

    def legs() -> tuple[Leg, ...]:
        modes = read_word(system, word) if isinstance(word, str) or not word else word
        pairs = [(e, "") if isinstance(e, str) else e for e in modes]
        following = [mode for mode, _ in pairs[1:]] + [pairs[0][0]]
        if mirrored:
            following[-1] = following[-1].translate(str.maketrans("+-", "-+"))
        both = zip(pairs, following, strict=True)
        return tuple(leg_between(system, mode, then, name) for (mode, name), then in both)

    try:
        return system.cached(("word", word, mirrored), legs)
    except TypeError:  # of lists, which are no keys
        return legs()


def lone_leg(system: FilippovSystem, itinerary: Itinerary) -> Leg | None:
    """The leg without an event that a single mode means; None with resets or contacts."""
    if system.resets or system.impacts:
        return None
    word: Any = itinerary if isinstance(itinerary, str) else _listed(itinerary)
    modes = read_word(system, word) if isinstance(word, str) else word
    if len(modes) != 1 or not isinstance(modes[0], str):
        return None
    system.parse_letters(modes[0])
    return Leg(modes[0])


def _listed(itinerary: Any) -> tuple[Any, ...]:
    """Modes, or pairs of a mode and a name, as they were given."""
    try:
        word = tuple(itinerary)
    except TypeError:
        word = (None,)
    for entry in word:
        names = (entry,) if isinstance(entry, str) else entry
        pair = isinstance(names, (tuple, list)) and len(names) in (1, 2)
        if not pair or not all(isinstance(name, str) for name in names):
            raise OptionError(
                explain(
                    "itinerary",
                    expected="modes, such as '+ s -', or pairs of a mode and the name of its event",
                    received=repr(itinerary),
                    advice="Write for example '+ s -' or [('', 'floor')].",
                )
            )
    return tuple(e if isinstance(e, str) else tuple(e) for e in word)
