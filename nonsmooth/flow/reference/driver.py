"""The reference driver: Taylor steps, event location and Filippov's logic in pure Python.

It needs no compiler and is the truth that faster engines are tested against. One loop: expand the
mode at the state, choose the step, look for the first guard to fall, advance; at a guard decide
which mode continues. Everything difficult is in the three modules it calls: ``stepper`` (numbers),
``polynomial`` (roots), ``switching`` (logic).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...model import Array, FilippovSystem, Guard, Resets, Surfaces, coupled_of
from .. import messages
from ..facts import ON_SURFACE, PRIORITY, VANISHES, change
from ..options import Options
from ..status import Status
from ..trajectory import Segment, Trajectory
from .accumulation import remaining_time
from .contacts import Contacts
from .modes import Expansion, modes_of, powers, rounding_scale
from .record import Record
from .stepper import Hit, Sides, Stepper
from .switching import Continuation, decide, is_two_fold


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
        self.modes = modes_of(system, p, options)
        self.stepper = Stepper(system, self.modes, options)
        self.surfaces, self.resets = Surfaces(system), Resets(system)
        self.t, self.x = options.t_start, x
        self.unknowns = np.zeros(system.surface_count + len(system.impacts))  # of what slides
        self.contacts = self._contacts()
        self.mode = ""
        self.drops: dict[int, int] = {}
        self.record = Record(system, p)
        self.intervals: list[float] = []
        self.patterns: list[str] = []
        self._segment_start = (self.t, 0)
        self._last_event = self.t
        self._ended: tuple[Status, str] | None = None
        self._limit: float | None = None
        self._repelling = False  # sliding that only start_mode chooses
        self._due: int | None = None  # row of a stop or reset to be served where the run stands
        self._due_impact: Guard | None = None  # of a gap that is closing where the run stands
        self._sides: Sides = {}
        self._fired: set[int] = set()  # resets since the motion last moved
        self._hits = 0  # of the section where the run is looked at

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
            return self._serve(self.stepper.guards(self.mode)[self._due])
        if self._due_impact is not None:
            return self._impact(self._due_impact)
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

        def find(h: float) -> list[Hit]:
            hit = self.stepper.first_hit(e, h, self.drops, self.t, self._repelling, self._sides)
            return [] if hit is None else [hit]

        plan = self.stepper.plan(e, left, self.options.max_step, self.t, find)
        if plan.fault:
            if self.system.hidden and self.mode.count("s") == 1:
                return self._leave_branch(e)
            return self._end(Status.STEP_TOO_SMALL, plan.fault)
        if plan.dt > 0.0:
            self._sides, self._fired = self.stepper.sides(e, plan.dt), set()
        if not self._advance(e, plan.dt):
            return None
        if plan.last:
            self.t = self.record.t[-1] = self.options.t_end
            if self.system.time_dependent:
                self.x[self.system.dimension] = self.t
        if plan.hits:
            self._serve(plan.hits[0].guard)
        elif not plan.last and "s" in self.mode:
            self._watch_two_fold()

    def _expand(self) -> Expansion:
        return self.stepper.expand(self.mode, self.x, self.unknowns)

    def _advance(self, e: Expansion, dt: float) -> bool:
        """Take a step; whether the state after it is finite, without which the run ends before."""
        x = self.stepper.advance(e, dt)
        if not np.all(np.isfinite(x)):
            self._end(Status.NOT_FINITE, messages.state_not_finite(self.t))
            return False
        self.record.step(self.t, e.states)
        self.t += dt
        if self.system.time_dependent:
            x[self.system.dimension] = self.t
        self._settle(e, x, dt)
        self.drops = {}
        self._note()
        return True

    def _settle(self, e: Expansion, x: Array, dt: float) -> None:
        """Keep a sliding state on its surfaces, and multipliers on their equations."""
        kept = self._kept(self.mode)
        self.x = self.surfaces.project(x, self.p, kept)
        if e.unknowns.size and kept:
            ahead = e.unknowns @ powers(dt, e.unknowns.shape[1])
            self.unknowns = self.modes.improve(self.mode, self.x, ahead)

    def _kept(self, mode: str) -> list[int]:
        """Functions that a mode keeps at zero: surfaces, gaps and their rates."""
        m, c = self.system.surface_count, len(self.system.impacts)
        closed = [i for i, letter in enumerate(mode) if letter == "c"]
        sliding = [i for i, letter in enumerate(mode) if letter == "s"]
        return [*sliding, *closed, *[i + c for i in closed if i >= m]]

    def _singular_step(self, e: Expansion, left: float) -> None:
        """Leave a point where only low derivatives exist; guards are looked at after the step."""
        coefficients, h = self.stepper.singular_step(e, min(left, self.options.max_step))
        if h == 0.0:
            return self._end(
                Status.NOT_FINITE, messages.field_not_finite(self.mode, self.x.tolist())
            )
        drops, self._sides, self._fired = self.drops, {}, set()
        if self._advance(replace(e, states=coefficients, finite=True), h):
            self.drops = {row: k for row, k in drops.items() if k > e.guards.shape[1]}

    def _watch_two_fold(self) -> None:
        if self.mode.count("s") != 1:
            return
        surface = self.mode.index("s")
        if is_two_fold(self.modes, self.mode, self.x, surface, self.options.rtol):
            self._end(
                Status.NON_UNIQUE,
                messages.slid_to_two_fold(surface),
            )

    # events ------------------------------------------------------------------------------------

    def _serve(self, guard: Guard) -> None:
        if guard.kind == "stop":
            self._event("stop", self.mode, guard.name)
            return self._end(Status.STOPPED, messages.stopped(guard.name, self.t))
        if guard.kind == "reset":
            return self._reset(guard)
        if guard.kind == "impact":
            return self._impact(guard)
        if guard.kind == "release":
            return self._release(guard)
        i, before = guard.index, self.mode
        active = self._active({i}, self.mode)
        self.x = self.surfaces.project(self.x, self.p, active)
        self.record.correct(self.x)
        if guard.kind == "surface" and not self._is_on(i):
            return self._end(Status.NON_UNIQUE, messages.multiple_zero(i))
        known: dict[tuple[str, int, int], int] = {}
        if guard.kind in ("exit", "branch"):
            self._watch_two_fold()
        if guard.kind == "exit":
            known = {("exit", i, guard.side): 1, ("surface", i, guard.side): 2}
        layer = (float(guard.side), -guard.side) if guard.kind == "surface" else None
        self._continue(active, known, before, guard.name, layer)

    def _is_on(self, surface: int) -> bool:
        """Whether Newton's steps have led onto a surface: not where its zero is a multiple one."""
        h, gradient = self.surfaces.values(self.x, self.p)
        scale = rounding_scale(np.abs(gradient), self.x, self.options.size)
        return bool(abs(h[surface]) <= VANISHES * scale[surface])

    def _leave_branch(self, e: Expansion) -> None:
        """A hidden sliding solution merges with an unstable one; lambda moves on at once."""
        surface = self.mode.index("s")
        direction = 1 if e.unknowns[surface, 1] > 0 else -1
        layer = (float(self.unknowns[surface]), direction)
        self._continue([surface], {}, self.mode, "stability of sliding", layer)

    def _continue(
        self,
        active: Sequence[int],
        known: dict[tuple[str, int, int], int],
        before: str,
        name: str,
        layer: tuple[float, int] | None = None,
    ) -> None:
        if self._ended is not None or not self._choose(active, self.mode, known, layer):
            return
        if self.mode != before:
            self._event(change(before, self.mode), before, name)

    def _choose(
        self,
        active: Sequence[int],
        letters: str,
        known: dict[tuple[str, int, int], int],
        layer: tuple[float, int] | None = None,
    ) -> bool:
        """Adopt the mode that continues; False where there is none or more than one."""
        decision = decide(self.stepper, self.x, letters, active, known, layer)
        if decision.continuation is None:
            self._end(decision.status, decision.message)
            return False
        self._adopt(decision.continuation)
        return True

    def _reset(self, guard: Guard) -> None:
        before, x = self.mode, self.x
        self.x = self.resets.apply(guard.index, x, self.p)
        if np.all(np.isfinite(self.x)):
            self._note()
            self._settle_in()
        else:
            self.x = x
            self._end(Status.NOT_FINITE, messages.reset_not_finite(guard.name, self.t))
        self._event("reset", before, guard.name, x)
        self._fired.add(guard.index)
        self._arm(guard)

    def _settle_in(self, known: dict[tuple[str, int, int], int] | None = None) -> None:
        """Find the mode of a state that was jumped to."""
        letters = self._letters()
        active = self._active(set(), letters)
        if self._ended is None:
            self._choose(active, letters, known or {})
            self._strike_due()

    def _letters(self) -> str:
        """Sides of all surfaces; what is on a surface counts as below until it is decided."""
        h = self.surfaces.values(self.x, self.p)[0][: self.system.surface_count]
        return "".join("+" if v > 0 else "-" for v in h) + "o" * len(self.system.impacts)

    def _begin(self, start_mode: str | None) -> None:
        """Decide the first mode, or take the one asked for."""
        h, _ = self.surfaces.values(self.x, self.p)
        if not np.all(np.isfinite(h)):
            return self._end(Status.NOT_FINITE, messages.surface_not_finite())
        self.mode = self._letters()
        active = self._active(set(), self.mode)
        if self._ended is not None:
            return
        surfaces = [i for i in active if i < self.system.surface_count]
        self.x = self.surfaces.project(self.x, self.p, surfaces)
        self.record.correct(self.x)
        if start_mode is not None:
            self._start_in(start_mode, active)
        elif active:
            decision = decide(self.stepper, self.x, self.mode, active, {})
            if decision.continuation is None:
                return self._end(decision.status, decision.message)
            self._adopt(decision.continuation)
        self._strike_due()
        self._arm()

    def _start_in(self, mode: str, active: Sequence[int]) -> None:
        self.system.parse_letters(mode)
        mode = mode.ljust(len(self.mode), "o")
        wrong = [i for i, c in enumerate(mode) if i not in active and c != self.mode[i]]
        if wrong:
            return self._end(
                Status.NON_UNIQUE,
                messages.wrong_start(mode, self.mode),
            )
        self.mode = mode
        affine = not any(self.system.nonlinear)
        solutions = self.modes.solutions(mode, self.x, stable_only=not affine)
        if len(solutions) != 1:
            return self._end(Status.NON_UNIQUE, messages.start_solutions(mode, len(solutions)))
        self.unknowns = solutions[0]
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

    def _arm(self, fired: Guard | None = None) -> None:
        """Look at the stops and resets on whose zero the run stands: is one of them met?

        ``fired`` is the reset that led here, if one did.
        """
        self._due, due = None, list[tuple[int, int]]()
        guards = self.stepper.guards(self.mode)
        if self._ended is not None or not any(g.kind in ("stop", "reset") for g in guards):
            return
        e = self._expand()
        for row, guard in enumerate(guards):
            if guard.kind not in ("stop", "reset"):
                continue
            self.drops[row], value = self.stepper.leading(e, row, 0)
            key, known = (guard.kind, guard.index), self.drops[row] == 0
            side = self._sides.get(key, 0)
            if known:  # where a jump carried it is no passage
                self._sides[key] = 1 if value > 0.0 else -1
            if known or value == 0.0:
                continue
            if fired is not None and key == (fired.kind, fired.index):
                self._pass(guard, self.drops[row], value, side)
            elif guard.kind == "reset" and guard.index in self._fired:
                continue
            elif side:
                if side * value < 0.0 and side * guard.side <= 0:
                    due.append((PRIORITY[guard.kind], row))
            elif guard.kind == "reset" and self._is_pressed(guard, row, value):
                due.append((PRIORITY[guard.kind], row))
        self._due = min(due)[1] if due else None

    def _pass(self, guard: Guard, zeros: int, value: float, side: int) -> None:
        """After a reset that stays on its zero: the motion turns round or passes, or is pressed."""
        heading = -side or guard.side
        if zeros > 1 and value * heading > 0.0:
            self._limit = self.t
            self._end(Status.ACCUMULATION, messages.pressed(guard.name, self.t))

    def _is_pressed(self, guard: Guard, row: int, value: float) -> bool:
        """Whether a start on the zero of a reset is met at once."""
        if guard.side:
            return value * guard.side > 0.0
        after = self.resets.apply(guard.index, self.x, self.p)
        e = self.stepper.expand(self.mode, after, self.unknowns)
        zeros, back = self.stepper.leading(e, row, 0)
        if zeros > 0 and (back * value <= 0.0 or min(zeros, self.drops[row]) > 1):
            self._end(Status.NON_UNIQUE, messages.two_sided(guard.name))
        return False

    def _adopt(self, continuation: Continuation) -> None:
        self._close_segment(continuation.mode)
        self.mode, self.drops = continuation.mode, dict(continuation.drops)
        self.unknowns = continuation.unknowns
        self._repelling = False

    def _active(self, certain: set[int], mode: str) -> list[int]:
        """Surfaces through the present state, to rounding, and those known to be."""
        h, gradient = self.surfaces.values(self.x, self.p)
        scale = rounding_scale(np.abs(gradient), self.x, self.options.size)
        near = {i for i in range(self.system.surface_count) if abs(h[i]) <= ON_SURFACE * scale[i]}
        near |= {i for i, c in enumerate(mode) if c in "sc"}
        return sorted(near | certain | set(self._resting()))

    # contacts ------------------------------------------------------------------------------------

    def _contacts(self) -> Contacts | None:
        if not self.system.impacts:
            return None
        coupled = coupled_of(self.system)
        return Contacts(self.system, coupled, self.surfaces, self.p, self.options)

    def _resting(self) -> list[int]:
        """Contacts with neither a gap nor a rate; the run ends where a gap is negative."""
        if self.contacts is None:
            return []
        behind = self.contacts.behind(self.x)
        if behind is not None:
            message = messages.behind(self.system.impacts[behind], self.t)
            self._end(Status.INCONSISTENT, message)
        gaps, rates = self.contacts.gaps(self.x)
        first = self.system.surface_count
        return [first + j for j in np.flatnonzero((gaps == 0.0) & (rates == 0.0)).tolist()]

    def _strike_due(self) -> None:
        """Look at the closed gaps: one that is closing further is struck at once, one that opens has
        a known zero."""
        if self.contacts is None or self._ended is not None:
            return
        gaps, rates = self.contacts.gaps(self.x)
        self._due_impact = None
        for row, guard in enumerate(self.stepper.guards(self.mode)):
            if guard.kind == "impact" and gaps[guard.index] == 0.0:
                if rates[guard.index] < 0.0:
                    self._due_impact = guard
                elif rates[guard.index] > 0.0:
                    self.drops[row] = 1

    def _impact(self, guard: Guard) -> None:
        """The impulses of a gap that closes, and of the contacts that are closed there."""
        assert self.contacts is not None
        before, x = self.mode, self.x
        self.x = self._closed(x, guard.index)
        self.record.correct(self.x)
        x = self.x
        gaps, rates = self.contacts.gaps(x)
        involved = [j for j in range(len(gaps)) if gaps[j] == 0.0 and rates[j] <= 0.0]
        after = self.contacts.strike(x, self.mode, sorted({*involved, guard.index}), False)
        if after is None:
            return self._end(Status.INCONSISTENT, messages.no_impulse(guard.name, self.t))
        self.x = after
        self._note()
        self._settle_in()
        self._event("impact", before, guard.name, x)
        self._arm()

    def _closed(self, x: Array, contact: int) -> Array:
        """Move a state onto a gap that it meets."""
        return self.surfaces.project(x, self.p, [self.system.surface_count + contact])

    def _release(self, guard: Guard) -> None:
        before, j = self.mode, guard.index
        active = self._active({self.system.surface_count + j}, self.mode)
        known = {("release", j, 0): 1, ("impact", j, 1): 3}
        self._continue(active, known, before, guard.name)

    def _come_to_rest(self, left: float) -> bool:
        """After impacts that accumulate the contact is closed; whether there is one."""
        if self.contacts is None or not all(p.startswith("impact") for p in self.patterns[-6:]):
            return False
        gaps, _ = self.contacts.gaps(self.x)
        involved = np.flatnonzero(gaps == 0.0).tolist()
        x = self.contacts.strike(self.x, self.mode, involved, True)
        if x is None:
            return False
        before, first = self.mode, self.system.surface_count
        self.x = self.surfaces.project(x, self.p, self._kept_by(involved))
        letters = self._letters()
        active = self._active({first + j for j in involved}, letters)
        if not self._choose(active, letters, {}):
            return True
        self._note()
        self.intervals, self.patterns = [], []
        e = self._expand()
        if "c" in self.mode and e.finite and self._advance(e, left):
            name = " and ".join(self.system.impacts[j] for j in involved)
            self._limit = self.t
            self._event(change(before, self.mode), before, name)
        return True

    def _kept_by(self, contacts: Sequence[int]) -> list[int]:
        m, c = self.system.surface_count, len(self.system.impacts)
        return [*[m + j for j in contacts], *[m + c + j for j in contacts]]

    # bookkeeping -------------------------------------------------------------------------------

    def _note(self) -> None:
        self.record.point(self.t, self.x)

    def _event(self, kind: str, before: str, name: str, x: Array | None = None) -> None:
        """Note an event at the state ``x``, the present one unless the event changed it."""
        self.record.event(
            kind, self.t, x if x is not None else self.x, before, self.mode, name, self.x
        )
        self._count_hit(kind, before, name)
        if kind in ("end", "stop"):
            return
        self.intervals.append(self.t - self._last_event)
        self.patterns.append(f"{kind} {before} {self.mode} {name}")
        self._last_event = self.t
        left = remaining_time(self.intervals, self.patterns, self.t - self.options.t_start)
        if left is not None and not (self._ended is None and self._come_to_rest(left)):
            self._limit = self.t + left
            message = messages.accumulation(len(self.record.events), self._limit)
            self._end(Status.ACCUMULATION, message)
        elif len(self.record.events) >= self.options.max_events:
            self._end(Status.TOO_MANY_EVENTS, messages.too_many("events", self.options.max_events))

    def _count_hit(self, kind: str, before: str, name: str) -> None:
        hits = self.options.hits
        if hits is not None and hits.meets(self.t, kind, name, before):
            self._hits += 1
            if self._hits >= hits.last:
                self._end(Status.STOPPED, messages.looked_at(hits.count or 0, self.t))

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
        return self.record.trajectory(status, message, self._limit)
