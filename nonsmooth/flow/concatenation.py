"""Concatenation of trajectories, parts of them, and reversal of backward ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..model import Array
from .events import Event, Events, Segment, Segments
from .names import change
from .polynomial import shift
from .trajectory import Steps, Trajectory


def forward(run: Trajectory) -> Trajectory:
    """Reverse a trajectory that was integrated backward in time; only its end event is kept."""
    mode, count = run.segments[0].mode, len(run.steps)
    starts, coefficients = np.zeros(count), []
    for k, (begin, c) in enumerate(zip(run.steps.starts, run.steps.coefficients, strict=True)):
        end = float(run.steps.starts[k + 1] if k + 1 < count else run.t[-1])
        starts[count - 1 - k] = end
        coefficients.append(np.array([shift(row, end - begin) for row in c.tolist()]))
    last = float(run.t[0])
    return replace(
        run,
        t=run.t[::-1].copy(),
        x=run.x[::-1].copy(),
        events=Events.of([Event("end", last, run.x[0], mode, mode)]),
        segments=Segments.of([Segment(mode, float(run.t[-1]), last, 0, count)]),
        steps=Steps(starts, coefficients[::-1], run.steps.implicit[::-1]),
    )


def straight(run: Trajectory, t: float, x: Array) -> Trajectory:
    """Return a straight piece from (t, x) to the start of ``run``, in the mode of ``run``."""
    end, mode = float(run.t[0]), run.segments[0].mode
    slope = (run.x[0] - x) / (end - t)
    return replace(
        run,
        t=np.array([t, end]),
        x=np.array([x, run.x[0]]),
        events=Events.of([Event("end", end, run.x[0], mode, mode)]),
        segments=Segments.of([Segment(mode, t, end, 0, 1)]),
        steps=Steps(np.array([t]), [np.column_stack([x, slope])]),
    )


def until(run: Trajectory, t: float) -> Trajectory:
    """Return the part of a forward trajectory up to a time within it."""
    count = int(np.searchsorted(run.steps.starts, t, side="left"))
    kept = run.t < t
    mode = next((s.mode for s in run.segments if t <= s.t_end), run.segments[-1].mode)
    x = run(t)
    events = [e for e in run.events if e.kind != "end" and e.t < t]
    segments = [
        Segment(s.mode, s.t_start, min(s.t_end, t), s.first, min(s.last, count))
        for s in run.segments
        if s.t_start < t
    ]
    return replace(
        run,
        t=np.append(run.t[kept], t),
        x=np.vstack([run.x[kept], x]),
        events=Events.of([*events, Event("end", t, x, mode, mode)]),
        segments=Segments.of(segments),
        steps=run.steps.part(0, count),
    )


def join(pieces: Sequence[Trajectory]) -> Trajectory:
    """Put pieces end to end; each starts where and when the one before it ends."""
    pieces = [p for p in pieces[:-1] if len(p.steps)] + [pieces[-1]]
    times, states = [pieces[0].t], [pieces[0].x]
    events: list[Event] = []
    segments: list[Segment] = []
    steps = 0
    for k, piece in enumerate(pieces):
        if k:
            times.append(piece.t[1:])
            states.append(piece.x[1:])
            events += _seam(segments[-1].mode, piece)
        gone = ("zero",) if piece is pieces[-1] else ("zero", "stop", "end")
        events += [e for e in piece.events if e.kind not in gone]
        for s in piece.segments:
            first = s.first + steps
            if segments and segments[-1].mode == s.mode:
                first, start = segments[-1].first, segments.pop().t_start
                segments.append(Segment(s.mode, start, s.t_end, first, s.last + steps))
            elif s.last > s.first or not segments:
                segments.append(Segment(s.mode, s.t_start, s.t_end, first, s.last + steps))
        steps += len(piece.steps)
    return replace(
        pieces[-1],
        t=np.concatenate(times),
        x=np.vstack(states),
        events=Events.of(events),
        segments=Segments.of(segments),
        steps=Steps(
            np.concatenate([p.steps.starts for p in pieces]),
            [c for p in pieces for c in p.steps.coefficients],
            np.concatenate([p.steps.implicit for p in pieces]),
        ),
    )


def _seam(before: str, piece: Trajectory) -> list[Event]:
    after = piece.segments[0].mode
    if after == before:
        return []
    return [Event(change(before, after), float(piece.t[0]), piece.x[0], before, after, "chosen")]
