"""From the arrays of a run to a Trajectory."""

from __future__ import annotations

import math
from dataclasses import replace

from ...model import Array, FilippovSystem, Guard
from .. import messages
from ..constants import DEPENDS_ON_WIDTHS, KINDS, REASONS, UNPROVED
from ..names import guard_name
from ..options import Options
from ..status import ADVICE, Status
from ..trajectory import Continuation, Event, Facts, Segment, Steps, Trajectory
from ..warn import warn_of_facts
from .arrays import Run, guard_of


def trajectory(system: FilippovSystem, p: Array, options: Options, run: Run) -> Trajectory:
    """Convert a dense run."""
    status, modes = Status(run.status), run.letters
    limit = None if math.isnan(run.limit) else run.limit
    facts = Facts(bool(run.facts & DEPENDS_ON_WIDTHS), bool(run.facts & UNPROVED))
    warn_of_facts(facts.depends_on_widths, facts.unproved)
    events = _events(system, run)
    motion = run.motion if len(run.motion) else None
    if status is not Status.STOPPED:
        letters = system.spelled(modes[run.mode])
        last = run.x[-1]
        events.append(
            Event("end", float(run.t[-1]), last, letters, letters, str(status), motion=motion)
        )
    elif motion is not None:
        events[-1] = replace(events[-1], motion=motion)
    return Trajectory(
        system=system,
        parameters=dict(zip(system.parameter_names, p.tolist(), strict=True)),
        t=run.t,
        x=run.x,
        events=events,
        segments=_segments(system, run),
        status=status,
        message=f"{message_of(system, options, run)} {ADVICE[status]}",
        accumulation_time=limit if status is Status.ACCUMULATION else None,
        steps=Steps(run.starts, run.coefficients),
        continuations=[
            Continuation(system.spelled(mode), rates)
            for mode, rates in zip(run.several, run.rates, strict=True)
            if status is Status.NON_UNIQUE
        ],
        facts=facts,
    )


def _events(system: FilippovSystem, run: Run) -> list[Event]:
    modes, found = run.letters, []
    known: dict[tuple[str, str, int], tuple[str, str, str, int, int]]
    known = system.cached("events of compiled runs", dict)
    numbers = (run.event_before, run.event_after, run.event_guards)
    for k, (one, two, code) in enumerate(zip(*(a.tolist() for a in numbers), strict=True)):
        key = (modes[one], modes[two], code)
        if key not in known:
            known[key] = _named(system, *key)
        before, after, name, element, side = known[key]
        t, kind = float(run.event_t[k]), KINDS[run.event_kinds[k]]
        states = run.event_x[k].copy(), run.event_after_x[k].copy()
        motion = run.event_motions[k].copy() if len(run.motion) else None
        found.append(
            Event(kind, t, states[0], before, after, name, states[1], element, side, motion)
        )
    return found


def _named(
    system: FilippovSystem, before: str, after: str, code: int
) -> tuple[str, str, str, int, int]:
    """Modes, name, element and side of an event."""
    if code >= 0:
        own = [guard_of(system, code)]
    else:  # what comes to rest together where events accumulate
        m, pairs = system.surface_count, enumerate(zip(before, after, strict=True))
        rests = [
            i for i, (one, two) in pairs if two in "sc" and one != two and i not in system.set_of
        ]
        surfaces = [Guard("surface", i, 0, system.entry_of(i)) for i in rests if i < m]
        first = len(system.entries) - m
        own = [*surfaces, *[Guard("release", i - m, 0, first + i) for i in rests if i >= m]]
    name = " and ".join([guard_name(system, guard) for guard in own])
    of = (own[0].element, own[0].side) if own else (-1, 0)
    return system.spelled(before), system.spelled(after), name, *of


def _segments(system: FilippovSystem, run: Run) -> list[Segment]:
    """Stretches of steps in one mode; a run without a step has its one mode."""
    t_last, shown = float(run.t[-1]), [system.spelled(letters) for letters in run.letters]
    discrete = len(system.definition.discrete)
    labels = run.labels or [()] * len(shown)
    if not len(run.modes):
        own = tuple(run.x[-1][system.dimension - discrete :].tolist())
        return [Segment(shown[run.mode], t_last, t_last, 0, 0, own)]
    changes = (run.modes[1:] != run.modes[:-1]).nonzero()[0] + 1
    bounds = [0, *changes.tolist(), len(run.modes)]
    ends = [*(float(run.starts[k]) for k in changes), t_last]
    return [
        Segment(shown[run.modes[a]], float(run.starts[a]), end, a, b, labels[run.modes[a]])
        for a, b, end in zip(bounds[:-1], bounds[1:], ends, strict=True)
    ]


def message_of(system: FilippovSystem, options: Options, run: Run) -> str:
    """The message of the end of a run."""
    status, t = Status(run.status), float(run.t[-1])
    if status is Status.REACHED_END:
        return messages.reached_end(options.t_end)
    if status is Status.STOPPED and REASONS[run.reason] == "sampled":
        return messages.sampled(run.where, t)
    if status is Status.STOPPED:
        return messages.stopped(system.stops[run.where][0], t)
    if status is Status.ENDLESS_JUMPS:
        at_once = [e for e in _events(system, run) if e.t == t][-options.max_jumps // 2 :]
        return messages.endless_jumps(sorted({e.name for e in at_once}), t)
    if status is Status.ACCUMULATION and REASONS[run.reason] == "pressed":
        return messages.pressed(system.resets[run.where][0], t)
    if status is Status.ACCUMULATION:
        return messages.accumulation(len(run.event_kinds), run.limit)
    if status is Status.TOO_MANY_EVENTS:
        return messages.too_many("events", options.max_events)
    if status is Status.TOO_MANY_STEPS:
        return messages.too_many("steps", options.max_steps)
    if status is Status.STEP_TOO_SMALL and REASONS[run.reason] == "branch_point":
        return messages.branch_point(t)
    if status is Status.STEP_TOO_SMALL:
        return messages.step_too_small(4e-16 * max(1.0, abs(t)))
    return _reason(system, options, run)


def _reason(system: FilippovSystem, options: Options, run: Run) -> str:
    modes, t = [system.spelled(mode) for mode in run.letters], float(run.t[-1])
    reason = REASONS[run.reason]
    entries = [k for k, own in enumerate(system.entries) if any(i in run.active for i in own)]
    if reason == "two_fold":
        return messages.two_fold(system.entry_of(run.where))
    if reason == "slid_to_two_fold":
        return messages.slid_to_two_fold(system.entry_of(run.where))
    if reason == "ambiguous":
        return messages.ambiguous([system.spelled(mode) for mode in run.several])
    if reason == "wrong_start":
        return messages.wrong_start(str(options.start_mode), modes[run.where])
    if reason == "start_solutions":
        return messages.start_solutions(str(options.start_mode), run.where)
    if reason == "impossible_start":
        return messages.impossible_start(str(options.start_mode))
    if reason == "several_directions":
        return messages.several_directions(run.where)
    if reason == "indefinite":
        return messages.indefinite(system.surface_names[run.where])
    if reason == "undetermined":
        firsts = [i for i in run.active if i in system.set_of and i == system.set_of[i][0]]
        return messages.undetermined([system.surface_names[i] for i in firsts])
    if reason == "field":
        return messages.field_not_finite(modes[run.mode], run.x[-1].tolist())
    if reason == "state":
        return messages.state_not_finite(t)
    if reason == "multiple_zero":
        return messages.multiple_zero(system.entry_of(run.where))
    if reason == "two_sided":
        return messages.two_sided(system.resets[run.where][0])
    contacts = _contacts(system, run)
    if reason == "behind":
        return messages.behind(system.impacts[run.where], t)
    if reason == "no_impulse":
        return messages.no_impulse(system.impacts[run.where], t)
    if reason == "restitution":
        return messages.restitution(system.impacts[run.where], t)
    if reason == "no_reaction":
        return messages.no_reaction(contacts)
    if reason == "no_stable_motion":
        return messages.no_stable_motion(entries)
    if reason == "undetermined_rates":
        return messages.undetermined_rates(entries)
    if reason == "stability_lost":
        return messages.stability_lost(system.surface_names[run.where], t)
    if reason == "high_degree":
        return messages.high_degree(system.entry_of(run.where))
    if reason == "possibly_several":
        return messages.possibly_several(entries)
    if reason == "discrete_value":
        return messages.discrete_value(system.resets[run.where][0], t)
    if reason == "reset_map":
        return messages.reset_not_finite(system.resets[run.where][0], t)
    return messages.surface_not_finite() if reason == "surface" else messages.degenerate()


def _contacts(system: FilippovSystem, run: Run) -> list[str]:
    """Names of the contacts at the last point that was decided."""
    first = system.surface_count
    return [system.impacts[i - first] for i in run.active if i >= first]
