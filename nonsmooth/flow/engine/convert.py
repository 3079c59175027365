"""From the arrays of a run to a Trajectory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...model import Array, FilippovSystem, Guard
from .. import messages
from ..constants import DEPENDS_ON_WIDTHS, IMPLICIT_STEP, KINDS, REASONS, UNPROVED
from ..events import NOT_KEPT, Event, Events, Label, Segment, Segments, ShownMode
from ..names import guard_name
from ..options import Options
from ..status import ADVICE, Status
from ..trajectory import Continuation, Facts, Steps, Trajectory
from ..warn import warn_of_facts
from .arrays import Run, guard_of


def trajectory(system: FilippovSystem, p: Array, options: Options, run: Run) -> Trajectory:
    """Convert a run."""
    status, few = Status(run.status), run.few or None
    limit = None if math.isnan(run.limit) else run.limit
    events = Events.when_read(
        partial(_events, system, run), few and partial(_few_events, system, run)
    )
    rested = {e.name: None for e in events if e.kind == "rest_below"} if options.rest_below else ()
    facts = Facts(
        bool(run.facts & DEPENDS_ON_WIDTHS),
        bool(run.facts & UNPROVED),
        tuple(rested),
        run.implicit_steps,
        run.t_error,
    )
    warn_of_facts(facts.depends_on_widths, facts.unproved, facts.t_error)
    return Trajectory(
        system=system,
        parameters=dict(zip(system.parameter_names, p.tolist(), strict=True)),
        t=run.t,
        x=run.x,
        events=events,
        segments=Segments.when_read(
            partial(_segments, system, run), few and partial(_few_segments, system, run)
        ),
        status=status,
        message=f"{message_of(system, options, run)} {ADVICE[status]}{_unmet(system, run)}",
        accumulation_time=limit if status is Status.ACCUMULATION else None,
        steps=Steps(run.starts, run.coefficients, run.implicit),
        continuations=[
            Continuation(system.spelled(mode), rates)
            for mode, rates in zip(run.several, run.rates, strict=True)
            if status is Status.NON_UNIQUE
        ],
        facts=facts,
        dense=run.dense,
    )


def _few_events(system: FilippovSystem, run: Run) -> list[Event]:
    """Events of a short run, one by one."""
    n, own, found, kept = system.dimension, run.few or {}, list[Event](), len(run.motion) > 0
    columns = (own[f"event_{name}"].tolist() for name in ("kind", "before", "after", "guard"))
    keys, times = [*zip(*columns, strict=True)], own["event_t"].tolist()
    for k, (label, t) in enumerate(zip(_labels(system, run, keys), times, strict=True)):
        x, after = (own[name][k, :n].copy() for name in ("event_x", "event_after_x"))
        motion = own["event_motion"][k].copy() if run.dense else NOT_KEPT
        found.append(label.event(t, x, after, motion if kept else None))
    last = run.motion if kept else None
    if run.status != Status.STOPPED:
        end, x = float(run.t[-1]), run.x[-1].copy()
        found.append(_end_label(system, run).event(end, x, x, last))
    elif kept:
        found[-1] = replace(found[-1], motion=last)
    return found


def _labels(system: FilippovSystem, run: Run, keys: Sequence[tuple[int, ...]]) -> list[Label]:
    """Labels of events from their kinds, modes and guards."""
    modes, known, labels = run.letters, system.cached("labels of events", dict[Any, Label]), []
    for kind, one, two, row in keys:
        key = (kind, modes[one], modes[two], row)
        if key not in known:
            known[key] = _label(system, *key)
        labels.append(known[key])
    return labels


def _events(system: FilippovSystem, run: Run) -> Events:
    """Events of a run, with its end unless a stop is the last of them."""
    found = run.happened
    labels = _labels(system, run, found.keys)
    status, width = Status(run.status), len(run.motion)
    motions = found.event_motions if width else np.zeros((0, 0))
    labels, own = [*labels, _end_label(system, run)], slice(None)
    if status is Status.STOPPED:  # by the last event
        motions, own = motions[:-1], slice(-1)
    if width:
        motions = np.concatenate([motions, run.motion[None]])
    numbers = found.event_rows[own], found.event_jumps[own], found.event_codes[own]
    return Events(found.event_t[own], found.states, *numbers, tuple(labels), motions)


def _end_label(system: FilippovSystem, run: Run) -> Label:
    letters = system.spelled(run.letters[run.mode])
    return Label("end", letters, letters, str(Status(run.status)))


def _label(system: FilippovSystem, kind: int, before: str, after: str, code: int) -> Label:
    """Kind, modes, name, element and side of an event."""
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
    return Label(KINDS[kind], system.spelled(before), system.spelled(after), name, *of)


def _few_segments(system: FilippovSystem, run: Run) -> list[Segment]:
    """Segments of a short run, one by one."""
    own = run.few or {}
    modes = (own["step_mode"] & ~IMPLICIT_STEP).tolist()
    starts, end = own["start"].tolist(), float(run.t[-1])
    shown, discrete = run.letters, len(system.definition.discrete)
    if not modes:
        return [_only_segment(system, run)]
    bounds = [k for k, mode in enumerate(modes) if not k or mode != modes[k - 1]]
    ends = [*(starts[k] for k in bounds[1:]), end]
    lasts = [*bounds[1:], len(modes)]
    return [
        Segment(
            system.spelled(shown[modes[a]]),
            starts[a],
            t,
            a * run.dense,
            b * run.dense,
            run.labels[modes[a]] if discrete else (),
        )
        for a, b, t in zip(bounds, lasts, ends, strict=True)
    ]


def _only_segment(system: FilippovSystem, run: Run) -> Segment:
    """The segment of a run without a step, which has its one mode."""
    t, values = float(run.t[-1]), run.x[-1][system.dimension - len(system.definition.discrete) :]
    return Segment(system.spelled(run.letters[run.mode]), t, t, 0, 0, tuple(values.tolist()))


def _segments(system: FilippovSystem, run: Run) -> Segments:
    """Stretches of steps in one mode."""
    found, shown = run.happened, [system.spelled(letters) for letters in run.letters]
    labels = run.labels or [()] * len(shown)
    if not len(found.segment_modes):
        return Segments.of([_only_segment(system, run)])
    times, first = found.segment_starts, found.segment_firsts
    last = np.append(first[1:], len(run.starts)) if run.dense else first
    modes = tuple(map(ShownMode, shown, labels))
    return Segments(times[:-1], times[1:], first, last, found.segment_modes, modes)


def _unmet(system: FilippovSystem, run: Run) -> str:
    """What is said of an event that was true at the start and silent."""
    names = [name for name, *_ in (*system.stops, *system.resets)]
    return "" if run.unmet < 0 else f" {messages.unmet(names[run.unmet])}"


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
        at_once = _events(system, run)[-1 - (options.max_jumps + 1) // 2 : -1]
        return messages.endless_jumps(sorted({e.name for e in at_once if e.t == t}), t)
    if status is Status.ACCUMULATION and REASONS[run.reason] == "pressed":
        return messages.pressed(system.resets[run.where][0], t)
    if status is Status.ACCUMULATION:
        return messages.accumulation(run.event_count, run.limit)
    if status is Status.TOO_MANY_EVENTS:
        return messages.too_many("events", options.max_events)
    if status is Status.TOO_MANY_STEPS and REASONS[run.reason] == "decay":
        return messages.held_by_decay(t, float(run.t[-1] - run.t[-2]), not system.sets)
    if status is Status.TOO_MANY_STEPS:
        return messages.too_many("steps", options.max_steps)
    if status is Status.STEP_TOO_SMALL and REASONS[run.reason] == "branch_point":
        return messages.branch_point(t)
    if status is Status.STEP_TOO_SMALL:
        return messages.step_too_small(4e-16 * max(1.0, abs(t)))
    return _reason(system, options, run)


def _reason(system: FilippovSystem, options: Options, run: Run) -> str:
    found = _SENTENCES.get(REASONS[run.reason])
    return found(system, options, run) if found else messages.degenerate()


def _ambiguous(system: FilippovSystem, _: Options, run: Run) -> str:
    names = [system.surface_names[members[0]] for members in system.entries]
    several = [system.spelled(mode) for mode in run.several]
    return messages.ambiguous(several, [*names, *system.impacts])


def _off_constraint(system: FilippovSystem, _: Options, run: Run) -> str:
    what = "Function" if run.where < system.surface_count else "Rate of the function"
    name = system.constraints[system.joints.index(run.where % system.surface_count)]
    return messages.off_constraint(name, what, run.limit, _end(run))


def _undetermined(system: FilippovSystem, _: Options, run: Run) -> str:
    firsts = [i for i in run.active if i in system.set_of and i == system.set_of[i][0]]
    return messages.undetermined([system.surface_names[i] for i in firsts])


def _end(run: Run) -> float:
    return float(run.t[-1])


def _entries(system: FilippovSystem, run: Run) -> list[int]:
    """Entries of what was decided last."""
    return [k for k, own in enumerate(system.entries) if any(i in run.active for i in own)]


#: What is said of a run's end, by its reason.
_SENTENCES: dict[str, Callable[[FilippovSystem, Options, Run], str]] = {
    "two_fold": lambda s, o, run: messages.two_fold(s.entry_of(run.where)),
    "slid_to_two_fold": lambda s, o, run: messages.slid_to_two_fold(s.entry_of(run.where)),
    "ambiguous": _ambiguous,
    "wrong_start": lambda s, o, run: messages.wrong_start(
        str(o.start_mode), s.spelled(run.letters[run.where])
    ),
    "start_solutions": lambda s, o, run: messages.start_solutions(str(o.start_mode), run.where),
    "impossible_start": lambda s, o, run: messages.impossible_start(str(o.start_mode)),
    "several_directions": lambda s, o, run: messages.several_directions(run.where),
    "indefinite": lambda s, o, run: messages.indefinite(s.surface_names[run.where]),
    "undetermined": _undetermined,
    "field": lambda s, o, run: messages.field_not_finite(
        s.spelled(run.letters[run.mode]), run.x[-1].tolist()
    ),
    "state": lambda s, o, run: messages.state_not_finite(_end(run)),
    "multiple_zero": lambda s, o, run: messages.multiple_zero(s.entry_of(run.where)),
    "two_sided": lambda s, o, run: messages.two_sided(s.resets[run.where][0]),
    "behind": lambda s, o, run: messages.behind(s.impacts[run.where], _end(run)),
    "no_jump": lambda s, o, run: messages.no_jump(s.surface_names[run.where], _end(run)),
    "off_constraint": _off_constraint,
    "dead_point": lambda s, o, run: messages.dead_point(s.constraints, _end(run)),
    "no_impulse": lambda s, o, run: messages.no_impulse(s.impacts[run.where], _end(run)),
    "restitution": lambda s, o, run: messages.restitution(s.impacts[run.where], _end(run)),
    "no_reaction": lambda s, o, run: messages.no_reaction(_contacts(s, run), bool(s.algebraic)),
    "no_stable_motion": lambda s, o, run: messages.no_stable_motion(_entries(s, run)),
    "undetermined_rates": lambda s, o, run: messages.undetermined_rates(_entries(s, run)),
    "stability_lost": lambda s, o, run: messages.stability_lost(
        s.surface_names[run.where], _end(run)
    ),
    "high_degree": lambda s, o, run: messages.high_degree(s.entry_of(run.where)),
    "possibly_several": lambda s, o, run: messages.possibly_several(_entries(s, run)),
    "discrete_value": lambda s, o, run: messages.discrete_value(s.resets[run.where][0], _end(run)),
    "reset_map": lambda s, o, run: messages.reset_not_finite(s.resets[run.where][0], _end(run)),
    "surface": lambda s, o, run: messages.surface_not_finite(),
    "out_of_table": lambda s, o, run: messages.out_of_table(
        str(s.written.surfaces[run.where]), _end(run)
    ),
}


def _contacts(system: FilippovSystem, run: Run) -> list[str]:
    """Names of the contacts at the last point that was decided."""
    m, names = system.surface_count, [*system.surface_names, *system.impacts]
    return [names[i] for i in run.active if i >= m or i in system.half_lines]
