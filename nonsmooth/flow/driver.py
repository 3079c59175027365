"""The reference driver: Taylor steps, event location and Filippov's logic in pure Python.

It needs no compiler and is the truth that faster engines are tested against. One loop: expand the
mode at the state, choose the step, look for the first guard to fall, advance; at a guard decide
which mode continues. Everything difficult is in the three modules it calls: ``stepper`` (numbers),
``polynomial`` (roots), ``switching`` (logic).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..model import Array, FilippovSystem, Intersection, Resets, Surfaces, motion
from . import messages
from .accumulation import remaining_time
from .options import Options
from .status import ADVICE, Status
from .stepper import EPSILON, ON_SURFACE, Expansion, Hit, Sides, Stepper
from .switching import Continuation, decide, is_two_fold
from .trajectory import Event, Segment, Trajectory


@dataclass
class _Record:
    """What a run has produced so far."""

    t: list[float] = field(default_factory=list)
    x: list[Array] = field(default_factory=list)
    starts: list[float] = field(default_factory=list)
    coefficients: list[Array] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    segments: list[Segment] = field(default_factory=list)
    intervals: list[float] = field(default_factory=list)
    patterns: list[str] = field(default_factory=list)


class Driver:
    """One run of one system.

    Parameters
    ----------
    system : FilippovSystem
    x : ndarray (N,)
        Extended start.
    p : ndarray
    options : Options
    """

    def __init__(self, system: FilippovSystem, x: Array, p: Array, options: Options):
        self.system, self.p, self.options = system, p, options
        self.stepper = Stepper(system, p, options.rtol, options.atol)
        self.surfaces, self.resets = Surfaces(system), Resets(system)
        self.t, self.x = options.t_start, x
        self.multipliers = np.zeros(0)  # of an intersection, where they are further states
        self.mode = ""
        self.drops: dict[int, int] = {}
        self.record = _Record()
        self._segment_start = (self.t, 0)
        self._last_event = self.t
        self._ended: tuple[Status, str] | None = None
        self._limit: float | None = None
        self._repelling = False  # sliding that only start_mode chooses
        self._due: int | None = None  # a reset to be served where the run stands
        self._sides: Sides = {}

    # the loop ----------------------------------------------------------------------------------

    def run(self) -> Trajectory:
        """Run to the end and return the trajectory."""
        self._note()
        self._begin(self.options.start_mode)
        while self._ended is None:
            self._step()
        return self._trajectory()

    def _step(self) -> None:
        if self._due is not None:
            guard = self.stepper.guards(self.mode)[self._due]
            return self._reset(guard.index, guard.name)
        left = self.options.t_end - self.t
        if left <= 0.0:
            return self._end(Status.REACHED_END, messages.reached_end(self.options.t_end))
        if len(self.record.starts) >= self.options.max_steps:
            return self._end(
                Status.TOO_MANY_STEPS, messages.too_many("steps", self.options.max_steps)
            )
        e = self._expand()
        if not e.finite:
            return self._singular_step(e, left)
        h = min(self.stepper.step_size(e), self.options.max_step)
        if h <= 4 * EPSILON * max(1.0, abs(self.t)) and h < left:
            if len(self.multipliers) == 1:
                return self._leave_branch(e)
            return self._end(Status.STEP_TOO_SMALL, messages.step_too_small(h))
        last = h >= left
        h = min(h, left)
        hit = self.stepper.first_hit(e, h, self.drops, self.t, self._repelling, self._sides)
        dt = self.stepper.reach(e, hit.dt if hit else h)
        if dt is None:
            return self._end(Status.STEP_TOO_SMALL, messages.branch_point(self.t))
        if dt < (hit.dt if hit else h):
            hit, last = None, False
        if dt > 0.0:
            self._sides = self.stepper.sides(e, dt)
        self._advance(e, e.states, dt)
        if hit is not None:
            self._serve(hit)
        elif last:
            self.t = self.options.t_end
            self.record.t[-1] = self.t
        elif "s" in self.mode and not hit:
            self._watch_two_fold()

    def _expand(self) -> Expansion:
        if self.multipliers.size:
            return self.stepper.expand(self.mode, np.concatenate([self.x, self.multipliers]))
        return self.stepper.expand(self.mode, self.x)

    def _advance(self, e: Expansion, coefficients: Array, dt: float) -> None:
        self.record.starts.append(self.t)
        self.record.coefficients.append(coefficients)
        x = self.stepper.advance(e if coefficients is e.states else _with(e, coefficients), dt)
        self.t += dt
        if self.system.time_dependent:
            x[self.system.dimension] = self.t
        self._settle(x)
        self.drops = {}
        self._note()

    def _settle(self, x: Array) -> None:
        """Keep a sliding state on its surfaces, and multipliers on their equations."""
        size = self.system.extended_dimension
        sliding = [i for i, c in enumerate(self.mode) if c == "s"]
        self.x = self.surfaces.project(x[:size], self.p, sliding)
        if x.size > size:
            of_mode = motion(self.system, self.mode)
            assert isinstance(of_mode, Intersection)
            values = of_mode.improve(np.concatenate([self.x, x[size:]]), self.p)
            self.multipliers = values[size:]

    def _singular_step(self, e: Expansion, left: float) -> None:
        """Leave a point where only low derivatives exist; guards are looked at after the step."""
        coefficients, h = self.stepper.singular_step(e, min(left, self.options.max_step))
        if h == 0.0:
            return self._end(
                Status.NOT_FINITE, messages.field_not_finite(self.mode, self.x.tolist())
            )
        drops, self._sides = self.drops, {}
        self._advance(e, coefficients, h)
        self.drops = {row: k for row, k in drops.items() if k > e.guards.shape[1]}

    def _watch_two_fold(self) -> None:
        if motion(self.system, self.mode).cancelled:
            return
        e = self._expand()
        surface = self.mode.index("s")
        if is_two_fold(self.stepper, e, surface, self.options.rtol):
            self._end(
                Status.NON_UNIQUE,
                messages.slid_to_two_fold(surface),
            )

    # events ------------------------------------------------------------------------------------

    def _serve(self, hit: Hit) -> None:
        guard = hit.guard
        if guard.kind == "stop":
            self._event("stop", self.mode, guard.name)
            return self._end(Status.STOPPED, messages.stopped(guard.name, self.t))
        if guard.kind == "reset":
            return self._reset(guard.index, guard.name)
        i, before = guard.index, self.mode
        active = self._active({i}, self.mode)
        self.x = self.surfaces.project(self.x, self.p, active)
        self.record.x[-1] = self.x[: self.system.dimension].copy()
        known: dict[tuple[str, int, int], int] = {}
        if guard.kind == "exit":
            self._watch_two_fold()
            known = {("exit", i, guard.side): 1, ("surface", i, guard.side): 2}
        layer = (float(guard.side), -guard.side) if guard.kind == "surface" else None
        self._continue(active, known, before, guard.name, layer)

    def _leave_branch(self, e: Expansion) -> None:
        """A hidden sliding solution merges with an unstable one; lambda moves on at once."""
        direction = 1 if e.states[-1, 1] > 0 else -1
        layer = (float(self.multipliers[0]), direction)
        surface = self.mode.index("s")
        self._continue([surface], {}, self.mode, "stability of sliding", layer)

    def _continue(
        self,
        active: Sequence[int],
        known: dict[tuple[str, int, int], int],
        before: str,
        name: str,
        layer: tuple[float, int] | None = None,
        letters: str | None = None,
    ) -> None:
        if self._ended is not None:
            return
        mode = self.mode if letters is None else letters
        decision = decide(self.stepper, self.x, mode, active, known, layer)
        if decision.continuation is None:
            self._end(decision.status, decision.message)
            return
        self._adopt(decision.continuation)
        if self.mode != before:
            kind = _kind(before, self.mode)
            self._event(kind, before, name)
        if len(self.record.events) >= self.options.max_events:
            self._end(Status.TOO_MANY_EVENTS, messages.too_many("events", self.options.max_events))

    def _reset(self, index: int, name: str) -> None:
        self._event("reset", self.mode, name)
        self.x, self._sides = self.resets.apply(index, self.x, self.p), {}
        if not np.all(np.isfinite(self.x)):
            return self._end(Status.NOT_FINITE, messages.reset_not_finite(name, self.t))
        self._note()
        letters = self._letters()
        active = self._active(set(), letters)
        self._continue(active, {}, self.mode, name, letters=letters)
        self._drop_zero_guards()

    def _letters(self) -> str:
        """Sides of all surfaces; what is on a surface counts as below until it is decided."""
        h = self.surfaces.values(self.x, self.p)[0]
        return "".join("+" if v > 0 else "-" for v in h)

    def _begin(self, start_mode: str | None) -> None:
        """Decide the first mode, or take the one asked for."""
        h, _ = self.surfaces.values(self.x, self.p)
        if not np.all(np.isfinite(h)):
            return self._end(Status.NOT_FINITE, messages.surface_not_finite())
        self.mode = self._letters()
        active = self._active(set(), self.mode)
        self.x = self.surfaces.project(self.x, self.p, active)
        self.record.x[-1] = self.x[: self.system.dimension].copy()
        if start_mode is not None:
            self._start_in(start_mode, active)
        elif active:
            decision = decide(self.stepper, self.x, self.mode, active, {})
            if decision.continuation is None:
                return self._end(decision.status, decision.message)
            self._adopt(decision.continuation)
        self._drop_zero_guards()

    def _start_in(self, mode: str, active: Sequence[int]) -> None:
        self.system.parse_mode(mode)
        wrong = [i for i, c in enumerate(mode) if i not in active and c != self.mode[i]]
        if wrong:
            return self._end(
                Status.NON_UNIQUE,
                messages.wrong_start(mode, self.mode),
            )
        self.mode = mode
        of_mode = motion(self.system, mode)
        if isinstance(of_mode, Intersection):
            solutions = of_mode.solutions(self.x, self.p)
            if len(solutions) != 1:
                return self._end(
                    Status.NON_UNIQUE,
                    f"start_mode {mode!r} has {len(solutions)} stable sliding solutions here.",
                )
            self.multipliers = solutions[0][self.x.size :]
        e, leading = self._expand(), {}
        for row, guard in enumerate(self.stepper.guards(mode)):
            if guard.index in active and guard.kind in ("surface", "exit"):
                k, value = self.stepper.leading(e, row, 1 if guard.kind == "surface" else 0)
                leading[row] = (guard.kind, value)
                self.drops[row] = k
        exits = [value for kind, value in leading.values() if kind == "exit"]
        self._repelling = bool(exits) and max(exits) <= 0.0 and min(exits) < 0.0
        holds = self._repelling or all(value >= 0.0 for value in exits)
        if not holds or any(kind == "surface" and value < 0.0 for kind, value in leading.values()):
            self._end(Status.NON_UNIQUE, messages.impossible_start(mode))

    def _drop_zero_guards(self) -> None:
        """A start on a stopping surface is not an event; one pressed into a reset is."""
        self._due = None
        if self._ended is not None:
            return
        e = self._expand()
        for row, guard in enumerate(self.stepper.guards(self.mode)):
            if guard.kind in ("stop", "reset"):
                k, value = self.stepper.leading(e, row, 0)
                self.drops[row] = k
                if guard.kind == "reset" and k > 0 and value * guard.side > 0.0:
                    self._due = row

    def _adopt(self, continuation: Continuation) -> None:
        self._close_segment(continuation.mode)
        self.mode, self.drops = continuation.mode, dict(continuation.drops)
        self.multipliers = continuation.multipliers
        self._repelling = False

    def _active(self, certain: set[int], mode: str) -> list[int]:
        """Surfaces through the present state, to rounding, and those known to be."""
        h, gradient = self.surfaces.values(self.x, self.p)
        scale = np.abs(gradient) @ (1.0 + np.abs(self.x))
        near = {i for i in range(len(h)) if abs(h[i]) <= ON_SURFACE * EPSILON * scale[i]}
        near |= {i for i, c in enumerate(mode) if c == "s"}
        return sorted(near | certain)

    # bookkeeping -------------------------------------------------------------------------------

    def _note(self) -> None:
        self.record.t.append(self.t)
        self.record.x.append(self.x[: self.system.dimension].copy())

    def _event(self, kind: str, before: str, name: str) -> None:
        state = self.x[: self.system.dimension].copy()
        self.record.events.append(Event(kind, self.t, state, before, self.mode, name))
        if kind in ("end", "stop"):
            return
        self.record.intervals.append(self.t - self._last_event)
        self.record.patterns.append(f"{kind} {before} {self.mode} {name}")
        self._last_event = self.t
        left = remaining_time(
            self.record.intervals, self.record.patterns, self.t - self.options.t_start
        )
        if left is not None:
            self._limit = self.t + left
            self._end(
                Status.ACCUMULATION,
                messages.accumulation(len(self.record.events), self._limit),
            )

    def _close_segment(self, following: str) -> None:
        start, first = self._segment_start
        count = len(self.record.starts)
        if following == self.mode:
            return
        if count > first:
            self.record.segments.append(Segment(self.mode, start, self.t, first, count))
        self._segment_start = (self.t, count)

    def _end(self, status: Status, message: str) -> None:
        if self._ended is None:
            self._ended = (status, message)

    def _trajectory(self) -> Trajectory:
        assert self._ended is not None
        status, message = self._ended
        start, first = self._segment_start
        count = len(self.record.starts)
        if count > first or not self.record.segments:
            self.record.segments.append(Segment(self.mode, start, self.t, first, count))
        if status is not Status.STOPPED:
            self._event("end", self.mode, str(status))
        return Trajectory(
            system=self.system,
            parameters=dict(zip(self.system.parameter_names, self.p.tolist(), strict=True)),
            t=np.array(self.record.t),
            x=np.array(self.record.x),
            events=self.record.events,
            segments=self.record.segments,
            status=status,
            message=f"{message} {ADVICE[status]}",
            accumulation_time=self._limit,
            _starts=np.array(self.record.starts),
            _coefficients=self.record.coefficients,
        )


def _with(e: Expansion, states: Array) -> Expansion:
    return Expansion(e.mode, states, e.guards, e.scales, e.gradient, True)


def _kind(before: str, after: str) -> str:
    if after.count("s") > before.count("s"):
        return "entry"
    return "exit" if after.count("s") < before.count("s") else "crossing"
