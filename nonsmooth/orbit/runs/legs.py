"""Legs of a run: one mode and the event that ends it, with flow and derivatives.

A run is a sequence of legs. Changes at one instant are one event: a reset and the change of mode
that it causes, an impact and the sliding that follows. Two guards that vanish at the same instant
without one causing the other are a corner, where a derivative depends on which comes first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np

from ...flow.constants import TIE
from ...flow.engine.columns import CarriedLegs, EndOfLeg
from ...flow.events import Event
from ...flow.fixed import flow_for
from ...flow.names import event_name, shown_mode
from ...flow.trajectory import Trajectory
from ...flow.variation import NONE, Arc, carry_legs, require_done
from ...model import Array, DegenerateError, FilippovSystem, Surfaces, coupled_of, multiplier_enters
from ...model.derivatives.event_maps import (
    AtEvent,
    EventMap,
    atoms_at,
    choices_at,
    deciding,
    event_map,
    instant_map,
    jumping,
    struck_by,
    surface_map,
    takes_in_space,
)
from ...model.derivatives.impact_in_space import ImpactInSpace, holding, ways_of
from ...model.derivatives.variational import VariationalField, variational_field
from .cells import cells_of

#: Errors of located events, relative to the size of the states.
_LOCATED = 1e-7

#: Switching functions of a set on which the mode was are zero to this part of their terms.
_ON_SET = 1e-14

#: Ratio of consecutive times between impacts below which their speeds are lost in rounding.
_LOST = 1e-6

#: Impulses and bounds that are negative by this part of the error of a location are zero.
_ROUNDED = 1e-4

#: Ways in which contacts and friction may take part in an impact, of which so many are tried.
_MOST_WAYS = 512

#: Directions that differ by less than this are one: the gradients of events at one instant.
_PARALLEL = 1e-7


@dataclass(frozen=True)
class Leg:
    """One mode and the event that ends it."""

    mode: str
    #: Of the event: crossing, entry, exit, reset, impact, release, stop; limit where infinitely many accumulate; end where
    #: a time ends it.
    kind: str = "end"
    #: element, side: As of Event.
    element: int = -1
    side: int = 0
    #: Sides of the friction at an impact.
    letters: str = ""
    #: Resets and impacts caused by the event, at the same instant.
    further: tuple[Leg, ...] = ()
    #: Values of the discrete states in it.
    discrete: tuple[float, ...] = ()
    #: The function of its event's condition that is zero there; -1 for the event's own.
    atom: int = -1
    #: Whether its event is a jump set in which the run starts: its time depends on nothing.
    at_start: bool = False
    #: Switching functions of the sets on which it begins, and which it leaves.
    left: tuple[int, ...] = ()
    #: Of a leg of infinitely many events: those that repeat, behind the last of which it begins.
    repeats: tuple[Leg, ...] = ()

    @property
    def timed(self) -> bool:
        """Whether a time ends it, not an event."""
        return self.kind == "end"

    def name(self, system: FilippovSystem) -> str:
        """Of its event; empty where a time ends it."""
        if self.timed or self.kind == "limit":
            return "limit" * (not self.timed)
        return event_name(system, self.mode, self.kind, self.element, self.side)

    def field(self, system: FilippovSystem, chosen: tuple[int, ...] = ()) -> VariationalField:
        """The variational field of the mode."""
        return variational_field(system, self.mode, chosen)

    def arc(self, system: FilippovSystem, x: Array, duration: float) -> Arc:
        """The leg from a start (N,) over a duration."""
        return Arc(self.mode, x, duration, self.ends(system), self.left)

    def ends(self, system: FilippovSystem) -> EndOfLeg | None:
        """The end of a leg by its mode's law: at a surface or set, of sliding, of a contact beside a set."""
        if self.kind not in ("crossing", "entry", "exit", "release") or self.further:
            return None
        if self.kind == "release":
            own = self.element - len(system.entries) + system.surface_count
            return EndOfLeg(guard="release", number=own) if system.sets else None
        members, slides = system.entries[self.element], self.mode[self.element] == "s"
        if self.kind == "entry" and len(members) > 1:
            return EndOfLeg(hit=members[0])
        if self.kind == "exit" and slides and len(members) > 1:
            return EndOfLeg(guard="slip", number=members[0])
        if not self._is_plain(system):
            return None
        if self.kind == "exit" and slides:
            return EndOfLeg(guard="exit", number=members[0], side=self.side)
        return EndOfLeg(guard="surface", number=members[0])

    def reaches_set(self, system: FilippovSystem) -> bool:
        """Whether its event is that of reaching a set."""
        ends = self.ends(system)
        return ends is not None and ends.hit >= 0

    def _is_plain(self, system: FilippovSystem) -> bool:
        """Whether its event is one of a table or a surface without memory, whose multipliers enter linearly."""
        return system.laws[self.element] in ("surface", "table") and not any(system.nonlinear)

    def map(self, system: FilippovSystem) -> EventMap | None:
        """The event's function and its map of the state; None where a time ends the leg."""
        if self.timed:
            return None
        return event_map(
            system, self.mode, self.kind, self.element, self.side, self.letters, self.atom
        )

    def at_event(self, system: FilippovSystem, x: Array, p: Array) -> AtEvent:
        """Event function and state after the event by the extended states (N,), further resets included; of infinitely
        many events by those with the time to their limit (N + 1,)."""
        if self.repeats:
            return _at_limit(x, p)
        at = self._own_event(system, x, p)
        for leg in self.further:
            at = _composed(at, leg._own_event(system, at.after, p))
        return at

    def _own_event(self, system: FilippovSystem, x: Array, p: Array) -> AtEvent:
        by_states = ["stop", "reset", "impact", "jump"]
        if system.sets or (self.kind in ("crossing", "entry") and self._is_plain(system)):
            by_states += ["crossing", "entry", "contact"]
        if self.kind in by_states:
            mode = system.widened(self.mode) if self.kind == "impact" else ""
            given = mode, self.kind, self.element, self.letters, self.atom
            at = instant_map(system, *given)(x, p)
            below = self.kind in ("crossing", "entry") and self.mode[self.element] == "-"
            return at.negative if below else at
        own, every = self.map(system), tuple(range(len(p)))
        assert own is not None
        if self.field(system).entries == len(x):
            return own(x, p)
        start, n = self.field(system, every).initial(x, p), len(x)
        at = own(start[:, 0], p)
        moved, by_p = start[:, 1 : 1 + n], start[:, 1 + n :]
        return replace(
            at,
            after_state=at.after_state @ moved,
            after_parameters=at.after_parameters + at.after_state @ by_p,
            gradient=at.gradient @ moved,
            by_parameters=at.by_parameters + at.gradient @ by_p,
        )


def _at_limit(y: Array, p: Array) -> AtEvent:
    """The end of a leg of infinitely many events: where no time is left to their limit, the last of its states."""
    unit, none = np.eye(len(y)), np.zeros((len(y), len(p)))
    return AtEvent(y[:-1].copy(), unit[:-1], none[:-1], float(y[-1]), unit[-1], none[-1])


def shown_itinerary(system: FilippovSystem, legs: Sequence[Leg]) -> str:
    """Modes of legs with the values of the discrete states, separated by blanks; of infinitely many events with dots."""
    shown = [shown_mode(system, leg.mode, leg.discrete) or "o" for leg in legs]
    return " ".join(
        mode + "..." * (leg.kind == "limit") for mode, leg in zip(shown, legs, strict=True)
    )


def leg_name(system: FilippovSystem, leg: Leg) -> str:
    """Describe a leg by its mode and its event."""
    end = "" if leg.timed else f", ended by {leg.name(system)}"
    return f"({shown_mode(system, leg.mode, leg.discrete) or 'o'}{end})"


def _composed(first: AtEvent, then: AtEvent) -> AtEvent:
    """The map ``then`` after ``first``, at the event of ``first``."""
    n = len(first.after)
    slope = then.after_state[:, :n]
    return replace(
        first,
        after=then.after,
        after_state=slope @ first.after_state,
        after_parameters=slope @ first.after_parameters + then.after_parameters,
        smooth=first.smooth and then.smooth,
    )


@dataclass(eq=False)
class LegFlow:
    """Flow of a leg from its start over its duration."""

    #: (N,): State at the end, before the event; of a leg of infinitely many events with the time to their limit.
    end: Array
    #: by_start, by_parameters (N, N), (N, q): Derivatives of ``end``.
    by_start: Array
    by_parameters: Array
    #: (N,): The field there.
    rate: Array
    #: Its event, where that is one of the law of the mode.
    at: AtEvent | None = None
    #: (N,): The field at the start.
    before: Array | None = None
    #: (K, N, N + q): Derivatives at samples.
    at_samples: Array | None = None
    #: The legs of which it is one, with its number, along which rows are pulled back if they were recorded.
    carried: tuple[CarriedLegs, int] | None = None

    @property
    def parts(self) -> tuple[Array, Array]:
        """Times since the start (k,) at which derivatives begin anew, and those before (k, N, N)."""
        if self.carried is None:
            return NONE, np.zeros((0, 0, 0))
        found, leg = self.carried
        return found.parts[leg]


def integrate_leg(
    system: FilippovSystem,
    leg: Leg,
    x: Array,
    duration: float,
    p: Array,
    chosen: tuple[int, ...] = (),
    to_end: bool = False,
) -> LegFlow:
    """The flow of a leg's mode from ``x`` (N,) over a duration of either sign, with derivatives.

    ``to_end``: to the set that ends it, if one does, where the mode has no field.
    """
    if leg.repeats:
        from .limit_leg import limit_flow  # which needs this module

        return limit_flow(system, leg, x, duration, p, chosen)[0]
    field = None if system.sets else leg.field(system, chosen)
    if field is None or field.entries > len(x):
        hit = leg.ends(system) if to_end and leg.reaches_set(system) else None
        arcs = [Arc(leg.mode, x, duration, hit, _still_left(system, leg, x, p))]
        carried = carry_legs(system, arcs, p, chosen)
        require_done(system, arcs, carried)
        return flows_of(carried)[0]
    whole = field.matrix(flow_for(field, field.start(x), p, duration))
    n, end = field.by_start, whole[:, 0]
    return LegFlow(end, whole[:, 1 : 1 + n], whole[:, 1 + n :], field.rate_at(end, p))


def _still_left(system: FilippovSystem, leg: Leg, x: Array, p: Array) -> tuple[int, ...]:
    """The sets that a leg leaves, if a state (N,) is where it begins."""
    at = [surface_map(system, i)(x, p) for i in leg.left]
    return leg.left if all(_is_zero(h, x) for h in at) else ()


def carry_leg(
    system: FilippovSystem,
    leg: Leg,
    x: Array,
    duration: float,
    p: Array,
    chosen: tuple[int, ...] = (),
    times: Array = NONE,
) -> LegFlow:
    """The same of a leg of a run, by the states alone; at times since its start."""
    if not (system.sets or len(times)):  # one leg costs less by its own program
        none = np.zeros((0, len(x), len(x) + len(chosen)))
        return replace(integrate_leg(system, leg, x, duration, p, chosen), at_samples=none)
    arcs = [leg.arc(system, x, duration)]
    carried = carry_legs(system, arcs, p, chosen, times)
    require_done(system, arcs, carried)
    return flows_of(carried)[0]


def rate_at(system: FilippovSystem, leg: Leg, x: Array, p: Array) -> Array:
    """The field of a leg's mode at an extended state (N,)."""
    if not system.sets:
        field = leg.field(system)
        return np.asarray(field.rate_at(field.states_at(x, p), p)[: len(x)])
    arcs = [Arc(leg.mode, x, 0.0, None, leg.left)]
    found = carry_legs(system, arcs, p, back=True)
    require_done(system, arcs, found)
    return found.before[0]


def flows_of(found: CarriedLegs) -> list[LegFlow]:
    """Legs that were carried, one by one."""
    n, result, first = found.ends.shape[1], list[LegFlow](), found.given.first.tolist()
    derivatives, at_samples = found.derivatives, found.at_samples
    for i, ends in enumerate(found.given.ends):
        at, by, own = None, derivatives[i], found.gradients[i]
        if ends is not None:
            at = AtEvent.smooth_at(found.ends[i], 0.0, own[:n], own[n:])
        sampled = at_samples[first[i] : first[i + 1]]
        kept = at, found.before[i], sampled, (found, i)
        result.append(LegFlow(found.ends[i], by[:, :n], by[:, n:], found.rates[i], *kept))
    return result


@dataclass(eq=False)  # made for each event: frozen ones take thrice the time
class Stretch:
    """A leg of a run: where it starts and ends."""

    leg: Leg
    t: float
    duration: float
    #: start, end, after (N,): Extended states: at the start, before and after the event that ends
    #: it.
    start: Array
    end: Array
    after: Array
    #: The system of its mode, and all its parameters.
    system: FilippovSystem
    p: Array
    #: Its mode and the element of its event as results show them.
    as_shown: tuple[str, int]

    @property
    def shown(self) -> Leg:
        """The leg as results show it."""
        mode, element = self.as_shown
        return replace(self.leg, mode=mode, element=element)


def parameters_of(run: Trajectory) -> Array:
    """Numbers for all parameters of a run."""
    return np.array([run.parameters[name] for name in run.system.parameter_names], float)


def stretches(run: Trajectory, begins: bool = True, driven: bool = False) -> list[Stretch]:
    """Split a run into legs, one for each instant with events; ``begins``: those at its start count; ``driven``: with
    the system of pieces, whose tables have cells."""
    cells, own_p = cells_of(run.system) if driven else None, parameters_of(run)
    system = cells.system if cells else run.system
    mode, p = run.events[0].mode_before, own_p
    if cells:
        mode, p = cells.mode(mode), cells.parameters(p, mode)
    t, x = float(run.t[0]), _extended(system, run.x[0], float(run.t[0]))
    result: list[Stretch] = []
    if len(system.joints) > 1:
        _require_independent(system, mode, x, p)
    if begins and system.sets:
        _require_held(system, mode, x, p)
    known: dict[tuple[object, ...], Leg] = {}
    discrete = len(system.definition.discrete)
    for group in _instants(run.events):
        first, last, shown = group[0], group[-1], group[0]
        if cells:
            p = cells.parameters(own_p, first.mode_before)
            group = [e for e in group if not cells.is_breakpoint(e)] or group[:1]
            shown, group = group[0], [cells.event(e) for e in group]
            first, last = group[0], group[-1]
        x_end = _extended(system, first.x, first.t)
        if len(group) == 1 and (
            first.kind in ("crossing", "entry", "exit") or _strikes_alone(system, first)
        ):
            key = (first.mode_before, first.kind, first.element, first.side, first.mode_after)
            leg = known.get(key) or known.setdefault(key, leg_of(system, first, p))
        else:
            leg = leg_of(system, first, p)
            if system.resets or not system.definition.plain:
                _require_smooth_choices(system, group, p)
                _require_present_state(system, group)
            if first.kind == "jump":
                leg = replace(leg, at_start=True)
            if not system.definition.plain:
                if begins or first.t > t:
                    leg = _located(system, first, x_end, p, leg, not result and first.t == t)
            further = [leg_of(system, e, p) for e in group[1:] if e.kind not in ("end", "stop")]
            if further:
                leg = replace(leg, further=_caused(system, leg, further, x_end, p, first.t))
        after = _extended(system, last.x_after, last.t)
        if discrete:
            own = x[system.dimension - discrete : system.dimension]
            leg = replace(leg, discrete=tuple(own.tolist()))
        if result and system.sets:
            before = held_before(system, result[-1].leg)
            leg = replace(leg, left=sets_left(system, before, leg.mode, x, p))
        as_shown = shown.mode_before, shown.element
        result.append(Stretch(leg, t, first.t - t, x, x_end, after, system, p, as_shown))
        t, x = last.t, after
        if _closes(result, last.mode_after):  # at a speed that is lost in rounding
            none = Leg(leg.mode, "limit", leg.element)
            result.append(Stretch(none, t, 0.0, x, x, x, system, p, as_shown))
    if run.accumulation_time is not None:  # the run ends where no motion follows the limit
        cut = result.pop() if result[-1].leg.timed else None
        t, x = (t, x) if cut is None else (cut.t, cut.start)
        mode, left = run.events[-1].mode_before, run.accumulation_time - t
        leg = Leg(cells.mode(mode) if cells else mode, "limit")
        result.append(Stretch(leg, t, left, x, x, x, system, p, (mode, -1)))
    return result


def _extended(system: FilippovSystem, x: Array, t: float) -> Array:
    if not system.time_dependent:
        return np.array(x)
    extended = np.empty(len(x) + 1)
    extended[:-1], extended[-1] = x, t
    return extended


def held_before(system: FilippovSystem, leg: Leg) -> str:
    """The mode of a leg, in which friction in space sticks if it did so at the impact that ends the leg."""
    if leg.kind != "impact":
        return leg.mode
    contact = leg.element - len(system.entries)
    holds = holding(system, leg.mode, contact, leg.letters)
    letters = zip(leg.mode, system.entries, strict=False)
    own = "".join("s" if members[0] in holds else letter for letter, members in letters)
    return own + leg.mode[len(own) :]


def sets_left(
    system: FilippovSystem, before: str, after: str, x: Array, p: Array
) -> tuple[int, ...]:
    """Switching functions of the sets that one mode is on and another leaves at a state (N,)."""
    letters = zip(before, after, system.entries, strict=False) if system.sets else ()
    found = list[int]()
    for members in (s for a, b, s in letters if len(s) > 1 and a == "s" != b):
        at = [surface_map(system, i)(x, p) for i in members]
        if all(abs(h.value) <= _ON_SET * float(np.abs(h.gradient) @ np.abs(x)) for h in at):
            found += members
    return tuple(found)


def _require_independent(system: FilippovSystem, mode: str, x: Array, p: Array) -> None:
    """Refuse constraints that depend on one another at a state (N,): their reactions have no derivatives."""
    coupled, own = coupled_of(system), list(system.joints)
    slope = coupled.layer_at(x, coupled.held(mode), np.zeros(coupled.count), p).slope[own][:, own]
    if np.linalg.matrix_rank(slope, tol=_ON_SET * float(np.abs(slope).max()) * len(own)) < len(own):
        raise DegenerateError(
            f"Constraints {', '.join(map(repr, system.constraints))} depend on one another: derivatives are implemented "
            "where their reactions are determined. Leave out those that follow from the others; the motion is the same."
        )


def _require_held(system: FilippovSystem, mode: str, x: Array, p: Array) -> None:
    """Refuse a start (N,) on a set off which the mode is, which neighbours leave from elsewhere."""
    coupled, letters = coupled_of(system), system.parse_letters(mode)
    h, is_open = coupled.heights_at(x, p), letters[system.surface_count :]
    for members in system.sets:
        if (own := coupled.carriers[members[0]]) and all(is_open[j] for j in own):
            continue  # friction without load
        leaves = letters[members[0]] and not h[list(members)].any()
        if leaves and multiplier_enters(system, members, p):
            raise DegenerateError(
                "run: expected a start off the sets that it leaves, received one on h = 0. "
                "Neighbours leave from elsewhere: start a little later."
            )


def _instants(events: Sequence[Event]) -> list[list[Event]]:
    """Events that happen at one time together."""
    groups: list[list[Event]] = []
    for event in events:
        if groups and abs(event.t - groups[-1][0].t) <= TIE * max(1.0, abs(event.t)):
            if event.kind == "end":
                continue  # the run ends at an event
            groups[-1].append(event)
        else:
            groups.append([event])
    return groups


def _is_limit(event: Event, entries: int) -> bool:
    """Whether events accumulate at an event, without end."""
    return event.kind == "rest" or (event.kind == "contact" and event.element >= entries)


def _closes(parts: Sequence[Stretch], letters: str) -> bool:
    """Whether the last impact closes a contact that impacts before it left open."""
    if len(parts) < 2 or parts[-1].leg.kind != "impact":
        return False
    before, leg = parts[-2].leg, parts[-1].leg
    same = (before.kind, before.element, before.mode) == (leg.kind, leg.element, leg.mode)
    lost = parts[-1].duration < _LOST * max(part.duration for part in parts[-6:])
    return same and lost and letters[leg.element] == "c" != leg.mode[leg.element]


def leg_of(system: FilippovSystem, event: Event, p: Array) -> Leg:
    """The leg that an event of a run ends."""
    if event.kind == "end":
        return Leg(event.mode_before)
    if _is_limit(event, len(system.entries)):
        return Leg(event.mode_before, "limit", event.element)
    _require_one_surface(system, event, p)
    letters = _letters(system, event, p) if event.kind == "impact" else ""
    if event.kind == "jump":
        x, after = (_extended(system, v, event.t) for v in (event.x, event.x_after))
        letters = jumping(system, x, after, p)
    return Leg(event.mode_before, event.kind, event.element, event.side, letters)


def _is_zero(at: AtEvent, y: Array) -> bool:
    """Whether an event's function is zero at a state, to the error of its location."""
    return abs(at.value) <= _LOCATED * float(np.abs(at.gradient) @ (1.0 + np.abs(y)))


def _located(
    system: FilippovSystem, event: Event, x: Array, p: Array, leg: Leg, starts: bool
) -> Leg:
    """The leg with the function of its event's condition that determines when it happens."""
    if event.kind not in ("stop", "reset"):
        return leg
    size = 1.0 + float(np.abs(x).max())
    values = atoms_at(system, event.kind, event.element, x, p)
    vanishing = [k for k, value in values.items() if abs(value) <= _LOCATED * size]
    if len(vanishing) == 1:
        found = leg if _is_zero(leg.at_event(system, x, p), x) else replace(leg, atom=vanishing[0])
        if _is_zero(found.at_event(system, x, p), x):
            return found
    elif not vanishing and starts:
        return replace(leg, at_start=True)
    elif vanishing:
        raise DegenerateError(
            f"event at t = {event.t:.10g}: expected one function of the condition of {event.name!r} to "
            f"vanish, received {len(vanishing)} (a corner). Its derivatives are one-sided: move the start or "
            "a parameter."
        )
    raise DegenerateError(
        f"event at t = {event.t:.10g}: expected a function of the condition of {event.name!r} to pass zero "
        "there, received none that does. Its derivatives are not known: start after it."
    )


def _require_smooth_choices(system: FilippovSystem, group: Sequence[Event], p: Array) -> None:
    """Refuse an instant at which a comparison in a map or filter changes: a corner."""
    served = [event for event in group if event.kind in ("stop", "reset")]
    if not any(deciding(system, event.kind, event.element) for event in served):
        return
    moves = np.eye(system.extended_dimension)  # of the state by that before the instant
    for event in served:
        x = _extended(system, event.x, event.t)
        values, gradient = choices_at(system, event.kind, event.element, x, p)
        near = np.abs(values) <= _LOCATED * (1.0 + np.abs(gradient) @ np.abs(x))
        if np.any(gradient[near] @ moves):
            raise DegenerateError(
                f"event at t = {event.t:.10g}: a comparison in the map or when= of {event.name!r} changes "
                "there (a corner), so that derivatives are one-sided. Move the start or a parameter."
            )
        own = instant_map(system, event.mode_before, event.kind, event.element)
        moves = own(x, p).after_state @ moves


def _require_present_state(system: FilippovSystem, group: Sequence[Event]) -> None:
    """Refuse a map of the state at its trigger after another event of the instant."""
    for event in group[1:]:
        rules = system.definition.rules[len(system.stops) :]
        if event.kind == "reset" and event.element < len(rules) and rules[event.element].at_trigger:
            raise DegenerateError(
                f"event at t = {event.t:.10g}: derivatives of {event.name!r}, which takes the state at its "
                f"trigger, are not implemented after {group[0].name!r} at the same instant. Give it the present "
                "state or the larger priority."
            )


def _require_one_surface(system: FilippovSystem, event: Event, p: Array) -> None:
    """Refuse an event on two surfaces at once."""
    if event.kind in ("crossing", "entry", "exit", "contact", "release"):
        _require_one_condition(system, event, p)
    if event.kind not in ("crossing", "entry", "exit", *["release"] * bool(system.sets)):
        return
    letters = zip(event.mode_before, event.mode_after, strict=False)
    changed = [k for k, (a, b) in enumerate(letters) if a != b and a in "+-*"]
    if event.kind == "crossing" and len(system.entries[event.element]) > 1:
        raise DegenerateError(
            f"run: expected entries to sets and ends of sliding only, received {event.kind!r} at "
            f"t = {event.t:.10g}. A set that is crossed exactly is a corner: perturb the start."
        )
    others = [k for k in changed if k != event.element]
    if others:
        other = event_name(system, event.mode_before, event.kind, others[0])
        raise DegenerateError(corner(event.t, event.name, other))


def _require_one_condition(system: FilippovSystem, event: Event, p: Array) -> None:
    """Refuse an event at which a complementarity condition closes that another function does not close with it."""
    letters = zip(event.mode_before, event.mode_after, strict=True)
    closed = [k for k, pair in enumerate(letters) if pair == ("o", "c") and k != event.element]
    closed = [i for i in system.half_lines if system.entry_of(i) in closed]
    x = _extended(system, event.x, event.t)
    for i in closed:
        if i in system.algebraic:
            continue  # the field is continuous there
        own = Leg(event.mode_before, event.kind, event.element, event.side).at_event(system, x, p)
        if not parallel(surface_map(system, i)(x, p).gradient, own.gradient):
            raise DegenerateError(corner(event.t, event.name, system.surface_names[i]))


def corner(t: float, one: str, other: str) -> str:
    """Message for two guards that vanish at one instant."""
    return (
        f"event at t = {t:.10g}: expected one event, or events that follow from it, received {one!r} "
        f"and {other!r} at the same instant (a corner). Its derivative depends on which of them comes "
        "first: move the start or a parameter."
    )


def _strikes_alone(system: FilippovSystem, event: Event) -> bool:
    """Whether an event is an impact in which nothing else may take part."""
    if event.kind != "impact" or len(system.impacts) > 1:
        return False
    mode = event.mode_before
    by = lambda: not struck_by(system, system.widened(mode), 0).carried
    return bool(system.cached(("strikes alone", mode), by))


def _letters(system: FilippovSystem, event: Event, p: Array) -> str:
    """The sides with which friction acted at an impact: those that give the state after it."""
    x = _extended(system, event.x, event.t)
    own = Leg(event.mode_before, event.kind, event.element, event.side)
    after = _extended(system, event.x_after, event.t)
    mode, contact = system.widened(event.mode_before), event.element - len(system.entries)
    if takes_in_space(system, mode, contact):
        return _letters_in_space(system, mode, contact, x, after, p)
    choice = lambda letters: replace(own, letters=letters).at_event(system, x, p)
    return struck_letters(system, event.mode_before, event.element, choice, after)


def _letters_in_space(
    system: FilippovSystem, mode: str, contact: int, x: Array, after: Array, p: Array
) -> str:
    """The ways in which contacts and friction took part in an impact with friction in space."""
    h, gradient = Surfaces(system).values(after, p)
    h = np.where(np.abs(h) > _LOCATED * (np.abs(gradient) @ (1.0 + np.abs(after))), h, 0.0)
    near = _LOCATED * (1.0 + float(np.abs(after).max()))
    for letters in islice(ways_of(system, mode, contact, h), _MOST_WAYS):
        element = len(system.entries) + contact
        struck = instant_map(system, mode, "impact", element, letters)
        assert isinstance(struck, ImpactInSpace)
        at, margin = struck.at(x, p)
        if margin >= -_ROUNDED * near and float(np.abs(at.after - after).max()) <= near:
            return letters
    raise DegenerateError(
        f"impact of {system.impacts[contact]!r}: its derivatives are implemented where one contact closes, impulses "
        "are determined, and friction in space clearly holds or clearly slips. Start after it, or move the start."
    )


def struck_letters(
    system: FilippovSystem, mode: str, element: int, struck: Callable[[str], AtEvent], after: Array
) -> str:
    """The sides with which friction acted at an impact, of those that are possible."""
    mode, contact = system.widened(mode), element - len(system.entries)
    misses: list[tuple[float, str]] = []
    for choice in product(*struck_by(system, mode, contact).choices(mode)):
        letters = "".join(choice)
        miss = float(np.abs(struck(letters).after - after).max())
        misses.append((miss if np.isfinite(miss) else np.inf, letters))
    miss, letters = min(misses)
    if miss > _LOCATED * (1.0 + float(np.abs(after).max())):
        raise DegenerateError(
            f"impact of {system.impacts[contact]!r}: its derivatives are implemented where one contact closes, "
            "and friction acts in one way throughout the impact. Start after it."
        )
    return letters


def _caused(
    system: FilippovSystem, leg: Leg, further: Sequence[Leg], x: Array, p: Array, t: float
) -> tuple[Leg, ...]:
    """The resets among events that follow at once, each of which the ones before must cause."""
    kept: tuple[Leg, ...] = ()
    for then in further:
        if system.sets and any(_ends_by_law(system, own) for own in (leg, then)):
            raise DegenerateError(corner(t, leg.name(system), then.name(system)))
        at = replace(leg, further=kept).at_event(system, x, p)
        other = then.at_event(system, at.after, p)
        if then.kind == "jump":
            kept = (*kept, then)
            continue
        if then.kind in ("reset", "stop") and not _is_zero(other, at.after):
            kept = (*kept, then) if then.kind == "reset" else kept
            continue  # a jump led clearly to its other side: it follows, whatever the times are
        if not parallel(other.gradient @ at.after_state, at.gradient):
            raise DegenerateError(corner(t, leg.name(system), then.name(system)))
        if then.kind in ("reset", "impact"):
            kept = (*kept, then)
    return kept


def _ends_by_law(system: FilippovSystem, leg: Leg) -> bool:
    """Whether more than a function of the states ends a leg."""
    ends = leg.ends(system)
    return ends is not None and ends.guard != "surface"


def parallel(a: Array, b: Array) -> bool:
    size = float(np.linalg.norm(b))
    along = b * (a @ b) / size**2 if size else b
    return bool(np.linalg.norm(a - along) <= _PARALLEL * max(float(np.linalg.norm(a)), 1e-300))


def surface_of(system: FilippovSystem, leg: Leg) -> int:
    """The switching surface of a leg's event; -1 if it has none."""
    own = leg.kind in ("crossing", "entry", "exit") and leg.element < len(system.entries)
    return leg.element if own and len(system.entries[leg.element]) == 1 else -1
