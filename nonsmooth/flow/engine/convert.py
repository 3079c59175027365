"""From the arrays of a run to a Trajectory."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...model import Array, FilippovSystem, Guard
from .. import messages
from ..constants import DEPENDS_ON_WIDTHS, KINDS, REASONS, UNPROVED
from ..events import Events, Label
from ..names import guard_name
from ..options import Options
from ..segments import Segment, Segments, ShownMode
from ..status import ADVICE, Status
from ..trajectory import Continuation, Facts, Steps, Trajectory
from ..warn import warn_of_facts
from .arrays import Run


def trajectory(system: FilippovSystem, p: Array, options: Options, run: Run) -> Trajectory:
    """Convert a run."""
    status = Status(run.status)
    limit = None if math.isnan(run.limit) else run.limit
    facts = Facts(bool(run.facts & DEPENDS_ON_WIDTHS), bool(run.facts & UNPROVED))
    warn_of_facts(facts.depends_on_widths, facts.unproved)
    return Trajectory(
        system=system,
        parameters=dict(zip(system.parameter_names, p.tolist(), strict=True)),
        t=run.t,
        x=run.x,
        events=_events(system, run),
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
        dense=run.dense,
    )


def _events(system: FilippovSystem, run: Run) -> Events:
    """Events of a run, with its end unless a stop is the last of them."""
    modes, known = run.letters, system.cached("labels of events", dict[Any, Label])
    labels = []
    for kind, one, two, row in run.event_keys:
        key = (kind, modes[one], modes[two], row)
        if key not in known:
            known[key] = _label(system, run, *key)
        labels.append(known[key])
    t, rows, jumps, codes = run.event_t, run.event_rows, run.event_jumps, run.event_codes
    status, width = Status(run.status), len(run.motion)
    motions = run.event_motions if width else np.zeros((0, 0))
    if status is not Status.STOPPED:
        letters = system.spelled(modes[run.mode])
        t, rows = np.append(t, run.t[-1]), np.append(rows, len(run.t) - 1)
        jumps, codes = np.append(jumps, False), np.append(codes, np.int32(len(labels)))
        labels.append(Label("end", letters, letters, str(status)))
    elif width:
        motions = motions[:-1]
    if width:
        motions = np.concatenate([motions, run.motion[None]])
    return Events(t, run.event_states, rows, jumps, codes, tuple(labels), motions)


def _label(
    system: FilippovSystem, run: Run, kind: int, before: str, after: str, row: int
) -> Label:
    """Kind, modes, name, element and side of an event."""
    if row >= len(run.guards(before)):  # of stability, of which the driver has more
        k = system.entry_of(before.index("s"))
        own = [Guard("branch", k, 0, k)]
        name = guard_name(system, own[0])
    elif row >= 0:
        own = [run.guards(before)[row]]
        name = guard_name(system, own[0])
    else:  # what comes to rest together where events accumulate
        held = run.guards(before)
        own = [g for g in run.guards(after) if g not in held]
        own = [g for g in own if g.kind == "release" or (g.kind == "exit" and g.side > 0)]
        own = [replace(g, kind="surface", side=0) if g.kind == "exit" else g for g in own]
        name = " and ".join([guard_name(system, guard) for guard in own])
    of = (own[0].element, own[0].side) if own else (-1, 0)
    return Label(KINDS[kind], system.spelled(before), system.spelled(after), name, *of)


def _segments(system: FilippovSystem, run: Run) -> Segments:
    """Stretches of steps in one mode; a run without a step has its one mode."""
    shown, t_last = [system.spelled(letters) for letters in run.letters], float(run.t[-1])
    labels = run.labels or [()] * len(shown)
    if not len(run.segment_modes):
        own = run.x[-1][system.dimension - len(system.definition.discrete) :]
        return Segments.of([Segment(shown[run.mode], t_last, t_last, 0, 0, tuple(own.tolist()))])
    times = np.append(run.segment_starts, t_last)
    first = last = run.segment_firsts
    if run.dense:
        bounds = np.append(first, len(run.starts))
        first, last = bounds[:-1], bounds[1:]
    modes = tuple(map(ShownMode, shown, labels))
    return Segments(times[:-1], times[1:], first, last, run.segment_modes, modes)


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
        happened = _events(system, run)[: len(run.event_t)]
        at_once = [e for e in happened[np.searchsorted(run.event_t, t) :]][-options.max_jumps // 2 :]
        return messages.endless_jumps(sorted({e.name for e in at_once}), t)
    if status is Status.ACCUMULATION and REASONS[run.reason] == "pressed":
        return messages.pressed(system.resets[run.where][0], t)
    if status is Status.ACCUMULATION:
        return messages.accumulation(len(run.event_t), run.limit)
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
