"""From the arrays of a run to a Trajectory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import repeat
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
from .recording import changes_of, codes_of, states_of_events


def trajectory(system: FilippovSystem, p: Array, options: Options, run: Run) -> Trajectory:
    """Convert a run."""
    status = Status(run.status)
    limit = None if math.isnan(run.limit) else run.limit
    events = Events.when_read(
        partial(_events, system, run), partial(_few_events, system, run) if run.few else None
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
            partial(_segments, system, run),
            partial(_few_segments, system, run) if run.few else None,
        ),
        status=status,
        message=message_of(system, options, run)
        + ("" if status.complete else f" {ADVICE[status]}")
        + _unfired(system, run),
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
    own, n, kept = run.written, system.dimension, len(run.motion) > 0
    columns = (own[f"event_{name}"].tolist() for name in ("kind", "before", "after", "guard"))
    labels, times = _labels(system, run, [*zip(*columns, strict=True)]), own["event_t"].tolist()
    before, after = (own[name][:, :n].copy() for name in ("event_x", "event_after_x"))
    motions: Any = repeat(None if not kept else NOT_KEPT, len(labels))
    if kept and run.dense:
        motions = own["event_motion"].copy()
    found = [*map(Label.event, labels, times, before, after, motions)]
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
    own, width = run.written, len(run.motion)
    states, rows, jumps = states_of_events(own, run.x)
    codes, keys = codes_of(own)
    t, labels = own["event_t"], _labels(system, run, keys)
    motions = own["event_motion"] if width and run.dense else np.zeros((0, width))
    if Status(run.status) is Status.STOPPED:
        motions = motions[:-1]
    else:
        t, rows, jumps = (
            np.append(a, b) for a, b in ((t, run.t[-1]), (rows, len(run.x) - 1), (jumps, False))
        )
        codes, labels = np.append(codes, np.int32(len(labels))), [*labels, _end_label(system, run)]
    if width:
        motions = np.concatenate([motions, run.motion[None]])
    return Events(t, states, rows, jumps, codes, tuple(labels), motions)


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
    own = run.written
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
    own, shown = run.written, [system.spelled(letters) for letters in run.letters]
    changes, labels = changes_of(own["step_mode"]), run.labels or [()] * len(shown)
    if not len(changes):
        return Segments.of([_only_segment(system, run)])
    times = np.append(own["start"][changes], run.t[-1])
    first = changes if run.dense else np.zeros(len(changes), np.int64)
    last = np.append(first[1:], len(run.starts)) if run.dense else first
    codes, modes = own["step_mode"][changes] & ~IMPLICIT_STEP, tuple(map(ShownMode, shown, labels))
    return Segments(times[:-1], times[1:], first, last, codes, modes)


def _unfired(system: FilippovSystem, run: Run) -> str:
    """Note on an event whose condition was true at the start and that did not fire."""
    names = [name for name, *_ in (*system.stops, *system.resets)]
    return "" if run.unfired < 0 else messages.UNFIRED.format(name=names[run.unfired])


def message_of(system: FilippovSystem, options: Options, run: Run) -> str:
    """The message of the end of a run."""
    found = messages.SENTENCES.get(REASONS[run.reason])
    return (found or messages.SENTENCES[str(Status(run.status))]).format_map(
        _Fields(system, options, run)
    )


class _Fields(dict[str, Any]):
    """Fields of the message of a run's end, computed on access."""

    def __init__(self, system: FilippovSystem, options: Options, run: Run):
        self._of = system, options, run

    def __missing__(self, name: str) -> Any:
        return _FIELDS[name](*self._of)


def _at_once(system: FilippovSystem, options: Options, run: Run) -> str:
    """Names of the events that repeat at one instant."""
    last = _events(system, run)[-1 - (options.max_jumps + 1) // 2 : -1]
    return _quoted(sorted({e.name for e in last if e.t == run.t[-1]}))


def _differing(system: FilippovSystem, run: Run) -> list[str]:
    """Names of the elements in which the admissible modes differ."""
    names = [system.surface_names[members[0]] for members in system.entries]
    letters = zip(*map(system.spelled, run.several), strict=True)
    pairs = zip([*names, *system.impacts], letters, strict=True)
    return [name for name, own in pairs if len(set(own)) > 1]


def _sets(system: FilippovSystem, run: Run) -> list[str]:
    """Names of the sets at the last point that was decided."""
    return [system.surface_names[m[0]] for m in system.sets if m[0] in run.active]


def _contacts(system: FilippovSystem, run: Run) -> list[str]:
    """Names of the contacts there."""
    m, names = system.surface_count, [*system.surface_names, *system.impacts]
    return [names[i] for i in run.active if i >= m or i in system.half_lines]


def _entries(system: FilippovSystem, run: Run) -> list[str]:
    """Names of the surfaces and sets there."""
    return [f"h{k}" for k, own in enumerate(system.entries) if any(i in run.active for i in own)]


def _quoted(names: Sequence[str]) -> str:
    return " and ".join(map(repr, names))


#: Fields of messages.
_FIELDS: dict[str, Callable[[FilippovSystem, Options, Run], Any]] = {
    "t": lambda s, o, run: float(run.t[-1]),
    "t_end": lambda s, o, run: o.t_end,
    "max_events": lambda s, o, run: o.max_events,
    "max_steps": lambda s, o, run: o.max_steps,
    "start_mode": lambda s, o, run: o.start_mode,
    "limit": lambda s, o, run: run.limit,
    "where": lambda s, o, run: run.where,
    "events": lambda s, o, run: run.event_count,
    "state": lambda s, o, run: messages.listed(run.x[-1].tolist()),
    "mode": lambda s, o, run: s.spelled(run.letters[run.mode]),
    "actual": lambda s, o, run: s.spelled(run.letters[run.where]),
    "entry": lambda s, o, run: s.entry_of(run.where),
    "surface": lambda s, o, run: s.surface_names[run.where],
    "argument": lambda s, o, run: str(s.written.surfaces[run.where]),
    "stop": lambda s, o, run: s.stops[run.where][0],
    "reset": lambda s, o, run: s.resets[run.where][0],
    "impact": lambda s, o, run: s.impacts[run.where],
    "constraint": lambda s, o, run: s.constraints[s.joints.index(run.where % s.surface_count)],
    "what": lambda s, o, run: "Function" if run.where < s.surface_count else "Rate of the function",
    "constraints": lambda s, o, run: _quoted(s.constraints),
    "contacts": lambda s, o, run: _quoted(_contacts(s, run)),
    "equations": lambda s, o, run: messages.EQUATIONS if s.algebraic else "",
    "entries": lambda s, o, run: " and ".join(_entries(s, run)),
    "sets": lambda s, o, run: " and ".join(_sets(s, run)),
    "jumps": _at_once,
    "shortest": lambda s, o, run: 4e-16 * max(1.0, abs(float(run.t[-1]))),
    "step": lambda s, o, run: float(run.t[-1] - run.t[-2]),
    "decay": lambda s, o, run: 8 / float(run.t[-1] - run.t[-2]),
    "implicit": lambda s, o, run: messages.NO_IMPLICIT if s.sets else messages.IMPLICIT,
    "differing": lambda s, o, run: " and ".join(_differing(s, run)),
    "modes": lambda s, o, run: ", ".join(repr(s.spelled(mode)) for mode in run.several),
    "situation": lambda s, o, run: messages.SITUATIONS[len(_differing(s, run)) > 1],
    "delay": lambda s, o, run: messages.DELAYS[len(_differing(s, run)) > 1],
}
