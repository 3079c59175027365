"""The reference driver: Taylor steps, event location and Filippov's logic in pure Python.

It needs no compiler and is the truth that faster engines are tested against. One loop: expand the
mode at the state, choose the step, look for the first guard to fall, advance; at a guard decide
which mode continues. Everything difficult is in the three modules it calls: ``stepper`` (numbers),
``polynomial`` (roots), ``switching`` (logic).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...model import (
    Array,
    Coupled,
    FilippovSystem,
    Guard,
    Resets,
    Surfaces,
    coupled_of,
    multiplier_enters,
)
from ...model.laws.coupled import unit
from ...model.laws.frozen import field_at, frozen
from .. import messages
from ..constants import (
    AT_ONCE,
    BLOCKS,
    EPSILON,
    LAGS,
    LEFT,
    ON_SURFACE,
    OVERFLOW,
    PRIORITY,
    REACHED,
    REMAINING,
    SHORTEST,
    SHRINKS,
    SPREAD,
    TENFOLD,
    VANISHES,
)
from ..names import change, guard_name
from ..options import Options
from ..status import Status
from ..trajectory import Segment, Trajectory
from .contacts import Contacts
from .coupled_modes import modes_of
from .modes import Expansion, powers, rounding_scale, tolerances
from .record import Record
from .stepper import Hit, Sides, Stepper
from .switching import Continuation, decide, is_two_fold

# Record of a run and accumulation of events --------------------------------------------------------


def remaining_time(
    intervals: Sequence[float], patterns: Sequence[str], elapsed: float
) -> float | None:
    """Estimate the time left until events accumulate, or None if they do not (yet)."""
    if len(intervals) > AT_ONCE and not any(intervals[-AT_ONCE:]):
        return 0.0
    for lag in LAGS:
        need = lag * BLOCKS
        if len(intervals) < need + lag:
            return None
        recent = list(patterns[-need:])
        if recent != list(patterns[-need - lag : -lag]):
            continue
        tail = list(intervals[-need:])
        blocks = [sum(tail[k : k + lag]) for k in range(0, need, lag)]
        if min(blocks) <= 0.0:
            continue
        ratios = [b / a for a, b in pairwise(blocks)]
        r = ratios[-1]
        if max(ratios) < SHRINKS and max(ratios) - min(ratios) <= SPREAD * (1.0 - r):
            left = blocks[-1] * r / (1.0 - r)
            if left < REMAINING * elapsed:
                return left
    return None


class Bookkeeping:
    """State of one run, and what is known of its past."""

    def __init__(self, system: FilippovSystem, x: Array, p: Array, options: Options):
        self.system, self.p, self.options = system, p, options
        self.t, self.x, self.mode = options.t_start, x, ""
        self.record = Record(system, p)
        self.intervals: list[float] = []
        self.patterns: list[str] = []
        self.ended: tuple[Status, str] | None = None
        self.limit: float | None = None
        self._segment_start = (self.t, 0)
        self._last_event = self.t
        self._hits = 0  # of the section where the run is looked at

    def come_to_rest(self, left: float) -> bool:
        """Whether the run goes on after events that accumulate in the time left."""
        return False

    def note(self) -> None:
        """Note the state."""
        self.record.point(self.t, self.x)

    def event(
        self, kind: str, before: str, guard: Guard | None, x: Array | None = None, name: str = ""
    ) -> None:
        """Note an event at the state ``x``, the present one unless the event changed it."""
        before, after = self.system.spelled(before), self.system.spelled(self.mode)
        state = x if x is not None else self.x
        name = self.record.event(kind, self.t, state, before, after, guard, name, self.x).name
        self._count_hit(kind, before, name)
        if kind in ("end", "stop"):
            return
        self.intervals.append(self.t - self._last_event)
        self.patterns.append(f"{kind} {before} {after} {name}")
        self._last_event = self.t
        left = remaining_time(self.intervals, self.patterns, self.t - self.options.t_start)
        if left is not None and not (self.ended is None and self.come_to_rest(left)):
            self.limit = self.t + left
            message = messages.accumulation(len(self.record.events), self.limit)
            self.end(Status.ACCUMULATION, message)
        elif len(self.record.events) >= self.options.max_events:
            self.end(Status.TOO_MANY_EVENTS, messages.too_many("events", self.options.max_events))

    def _count_hit(self, kind: str, before: str, name: str) -> None:
        hits = self.options.hits
        if hits is not None and hits.has(self.t, kind, name, before):
            self._hits += 1
            if self._hits >= hits.last:
                self.end(Status.STOPPED, messages.sampled(hits.count or 0, self.t))

    def close_segment(self, following: str) -> None:
        """End the stretch of steps in a mode, where another follows."""
        start, first = self._segment_start
        count = len(self.record.starts)
        if following == self.mode.replace("b", "*") or following == self.mode:
            return
        if count > first:
            self.record.segments.append(self._segment(start, first, count))
        self._segment_start = (self.t, count)

    def _segment(self, start: float, first: int, last: int) -> Segment:
        return Segment(self.system.spelled(self.mode), start, self.t, first, last)

    def end(self, status: Status, message: str) -> None:
        """End the run, if it has not ended."""
        if self.ended is None:
            self.ended = (status, message)

    def trajectory(self) -> Trajectory:
        """Return the run."""
        assert self.ended is not None
        status, message = self.ended
        start, first = self._segment_start
        count = len(self.record.starts)
        if count > first or not self.record.segments:
            self.record.segments.append(self._segment(start, first, count))
        if status is not Status.STOPPED:
            self.event("end", self.mode, None, name=str(status))
        return self.record.trajectory(status, message, self.limit)


class Driver(Bookkeeping):
    """One run of one system."""

    def __init__(self, system: FilippovSystem, x: Array, p: Array, options: Options):
        super().__init__(system, x, p, options)
        self.modes = modes_of(system, p, options)
        self.stepper = Stepper(system, self.modes, options)
        self.surfaces, self.resets = Surfaces(system), Resets(system)
        self.unknowns = np.zeros(system.surface_count + len(system.impacts))  # of what slides
        self.contacts = contacts_of(self)
        self._idle = idle_sets(system, p)
        self.drops: dict[int, int] = {}
        self._repelling = False  # sliding that only start_mode chooses
        self._due: int | None = None  # row of a stop or reset to be served where the run stands
        self.due_impact: Guard | None = None  # of a gap that is closing where the run stands
        self._sides: Sides = {}
        self._fired: set[int] = set()  # resets since the motion last moved

    # the loop ----------------------------------------------------------------------------------

    def run(self) -> Trajectory:
        """Run to the end and return the trajectory."""
        self.note()
        self._begin(self.options.start_mode)
        while self.ended is None:
            self._step()
        return self.trajectory()

    def _step(self) -> None:
        if self._due is not None:
            return self._serve(self.stepper.guards(self.mode)[self._due])
        if self.due_impact is not None:
            return apply_impact(self, self.due_impact)
        left = self.options.t_end - self.t
        if left <= 0.0:
            return self.end(Status.REACHED_END, messages.reached_end(self.options.t_end))
        if len(self.record.starts) >= self.options.max_steps:
            return self.end(
                Status.TOO_MANY_STEPS, messages.too_many("steps", self.options.max_steps)
            )
        e = self.expand()
        if not e.finite:
            return self._singular_step(e, left)

        def find(h: float) -> list[Hit]:
            hit = self.stepper.first_hit(e, h, self.drops, self.t, self._repelling, self._sides)
            return [] if hit is None else [hit]

        plan = self.stepper.plan(e, left, self.options.max_step, self.t, find)
        if plan.fault:
            if self.system.hidden and self.mode.count("s") == 1:
                return self._leave_branch(e)
            return self.end(Status.STEP_TOO_SMALL, plan.fault)
        if plan.dt > 0.0:
            self._sides, self._fired = self.stepper.sides(e, plan.dt), set()
        if not self.advance(e, plan.dt):
            return None
        if plan.last:
            self.t = self.record.t[-1] = self.options.t_end
            if self.system.time_dependent:
                self.x[self.system.dimension] = self.t
        if plan.hits:
            self._serve(plan.hits[0].guard)
        elif not plan.last:
            watch_sets(self)
            self._watch_two_fold()

    def expand(self) -> Expansion:
        return self.stepper.expand(self.mode, self.x, self.unknowns)

    def advance(self, e: Expansion, dt: float) -> bool:
        """Take a step; whether the state after it is finite, without which the run ends before."""
        x = self.stepper.advance(e, dt)
        if not np.all(np.isfinite(x)):
            self.end(Status.NOT_FINITE, messages.state_not_finite(self.t))
            return False
        self.record.step(self.t, e.states)
        self.t += dt
        if self.system.time_dependent:
            x[self.system.dimension] = self.t
        self._settle(e, x, dt)
        self.drops = {}
        self.note()
        return True

    def _settle(self, e: Expansion, x: Array, dt: float) -> None:
        """Keep a sliding state on its surfaces, and multipliers on their equations."""
        kept = self.kept(self.mode)
        self.x = self.surfaces.project(x, self.p, kept)
        if e.unknowns.size and (kept or self.system.sets):
            ahead = e.unknowns @ powers(dt, e.unknowns.shape[1])
            self.unknowns = self.modes.improve(self.mode, self.x, ahead)
        if self.system.sets:
            after_step(self)

    def kept(self, mode: str) -> list[int]:
        """Functions that a mode keeps at zero: surfaces, gaps and their rates."""
        m, c = self.system.surface_count, len(self.system.impacts)
        closed = [i for i, letter in enumerate(mode) if letter == "c"]
        sliding = [i for i, letter in enumerate(mode) if letter == "s"]
        return [*sliding, *closed, *[i + c for i in closed if i >= m]]

    def _singular_step(self, e: Expansion, left: float) -> None:
        """Leave a point where only low derivatives exist; guards are looked at after the step."""
        coefficients, h = self.stepper.singular_step(e, min(left, self.options.max_step))
        if h == 0.0 or e.overflows:
            mode = self.system.spelled(self.mode)
            return self.end(Status.NOT_FINITE, messages.field_not_finite(mode, self.x.tolist()))
        drops, self._sides, self._fired = self.drops, {}, set()
        if self.advance(replace(e, states=coefficients, finite=True), h):
            self.drops = {row: k for row, k in drops.items() if k > e.guards.shape[1]}

    def _watch_two_fold(self) -> None:
        if self.mode.count("s") != 1:
            return
        surface = self.mode.index("s")
        if is_two_fold(self.modes, self.mode, self.x, surface, self.options.rtol):
            entry = self.system.entry_of(surface)
            self.end(Status.NON_UNIQUE, messages.slid_to_two_fold(entry))

    # events ------------------------------------------------------------------------------------

    def _serve(self, guard: Guard) -> None:
        if guard.kind == "stop":
            self.event("stop", self.mode, guard)
            return self.end(
                Status.STOPPED, messages.stopped(guard_name(self.system, guard), self.t)
            )
        if guard.kind == "reset":
            return self._reset(guard)
        if guard.kind == "impact":
            return apply_impact(self, guard)
        if guard.kind == "release":
            return release_contact(self, guard)
        if guard.kind == "near":
            return near_set(self, guard)
        i, before = guard.index, self.mode
        active = self.active({*self.system.set_of.get(i, (i,))}, self.mode)
        self.x = self.surfaces.project(self.x, self.p, active)
        self.record.correct(self.x)
        if guard.kind == "surface" and not self._is_on(i):
            return self.end(Status.NON_UNIQUE, messages.multiple_zero(self.system.entry_of(i)))
        known: dict[tuple[str, int, int], int] = {}
        if guard.kind in ("exit", "branch"):
            self._watch_two_fold()
        if guard.kind == "exit":
            known = {("exit", i, guard.side): 1, ("surface", i, guard.side): 2}
        if guard.kind == "slip":
            known = {("slip", i, 0): 1, ("near", i, 0): 2}
        layer = (float(guard.side), -guard.side) if guard.kind == "surface" else None
        self.go_on(active, known, before, guard, layer)

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
        branch = Guard("branch", surface, 0, self.system.entry_of(surface))
        self.go_on([surface], {}, self.mode, branch, layer)

    def go_on(
        self,
        active: Sequence[int],
        known: dict[tuple[str, int, int], int],
        before: str,
        guard: Guard,
        layer: tuple[float, int] | None = None,
    ) -> None:
        if self.ended is not None or not self.choose(active, self.mode, known, layer):
            return
        if self.mode != before:
            self.event(change(before, self.mode), before, guard)

    def choose(
        self,
        active: Sequence[int],
        letters: str,
        known: dict[tuple[str, int, int], int],
        layer: tuple[float, int] | None = None,
    ) -> bool:
        """Adopt the mode that continues; False where there is none or more than one."""
        decision = decide(self.stepper, self.x, letters, active, known, layer, self.unknowns)
        if decision.continuation is None:
            self.end(decision.status, decision.message)
            return False
        self._adopt(decision.continuation)
        return True

    def _reset(self, guard: Guard) -> None:
        before, x = self.mode, self.x
        self.x = self.resets.apply(guard.index, x, self.p)
        if np.all(np.isfinite(self.x)):
            self.note()
            self.settle_in()
        else:
            self.x = x
            self.end(
                Status.NOT_FINITE, messages.reset_not_finite(guard_name(self.system, guard), self.t)
            )
        self.event("reset", before, guard, x)
        self._fired.add(guard.index)
        self.arm(guard)

    def settle_in(self, known: dict[tuple[str, int, int], int] | None = None) -> None:
        """Find the mode of a state that was jumped to."""
        letters = self.letters()
        active = self.active(set(), letters)
        if self.ended is None:
            self.choose(active, letters, known or {})
            strike_due(self)

    def letters(self) -> str:
        """Sides of all surfaces; what is on a surface counts as below until it is decided."""
        h = self.surfaces.values(self.x, self.p)[0][: self.system.surface_count]
        signs = ["+" if v > 0 else "-" for v in h]
        for i, members in self.system.set_of.items():
            signs[i] = "i" if members in self._idle else "*"
        return "".join(signs) + "o" * len(self.system.impacts)

    def _begin(self, start_mode: str | None) -> None:
        """Decide the first mode, or take the one asked for."""
        h, _ = self.surfaces.values(self.x, self.p)
        if not np.all(np.isfinite(h)):
            return self.end(Status.NOT_FINITE, messages.surface_not_finite())
        self.mode = self.letters()
        active = self.active(set(), self.mode)
        if self.ended is not None:
            return
        surfaces = [i for i in active if i < self.system.surface_count]
        self.x = self.surfaces.project(self.x, self.p, surfaces)
        self.record.correct(self.x)
        if start_mode is not None:
            self._start_in(start_mode, active)
        elif active:
            decision = decide(self.stepper, self.x, self.mode, active, {})
            if decision.continuation is None:
                return self.end(decision.status, decision.message)
            self._adopt(decision.continuation)
        strike_due(self)
        self.arm()

    def _start_in(self, mode: str, active: Sequence[int]) -> None:
        self.system.parse_letters(mode)
        mode = start_letters(
            self.system.widened(mode).ljust(len(self.mode), "o"), self.mode, active
        )
        wrong = [i for i, c in enumerate(mode) if i not in active and c != self.mode[i]]
        asked, actual = self.system.spelled(mode), self.system.spelled(self.mode)
        if wrong:
            return self.end(Status.NON_UNIQUE, messages.wrong_start(asked, actual))
        self.mode, affine = mode, not any(self.system.nonlinear)
        solutions = self.modes.solutions(mode, self.x, stable_only=not affine)
        if len(solutions) != 1:
            return self.end(Status.NON_UNIQUE, messages.start_solutions(asked, len(solutions)))
        self.unknowns = solutions[0]
        e, leading = self.expand(), {}
        for row, guard in enumerate(self.stepper.guards(mode)):
            if guard.index in active and decides(guard, mode):
                zeros = 1 if guard.kind in ("surface", "near") else 0
                k, value = self.stepper.leading(e, row, zeros)
                leading[row] = (guard.kind, value)
                self.drops[row] = k
        leaves = any(value < 0.0 for kind, value in leading.values() if kind in ("near", "slip"))
        exits = [value for kind, value in leading.values() if kind == "exit"]
        self._repelling = bool(exits) and max(exits) <= 0.0 and min(exits) < 0.0
        holds = self._repelling or all(value >= 0.0 for value in exits)
        if (
            not holds
            or leaves
            or any(kind == "surface" and value < 0.0 for kind, value in leading.values())
        ):
            self.end(Status.NON_UNIQUE, messages.impossible_start(asked))

    def arm(self, fired: Guard | None = None) -> None:
        """Look at the stops and resets on whose zero the run stands: is one of them met?"""
        # ``fired`` is the reset that led here, if one did.
        self._due, due = None, list[tuple[int, int]]()
        guards = self.stepper.guards(self.mode)
        if self.ended is not None or not any(g.kind in ("stop", "reset") for g in guards):
            return
        e = self.expand()
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
            self.limit = self.t
            self.end(Status.ACCUMULATION, messages.pressed(guard_name(self.system, guard), self.t))

    def _is_pressed(self, guard: Guard, row: int, value: float) -> bool:
        """Whether a start on the zero of a reset is met at once."""
        if guard.side:
            return value * guard.side > 0.0
        after = self.resets.apply(guard.index, self.x, self.p)
        e = self.stepper.expand(self.mode, after, self.unknowns)
        zeros, back = self.stepper.leading(e, row, 0)
        if zeros > 0 and (back * value <= 0.0 or min(zeros, self.drops[row]) > 1):
            self.end(Status.NON_UNIQUE, messages.two_sided(guard_name(self.system, guard)))
        return False

    def _adopt(self, continuation: Continuation) -> None:
        self.close_segment(continuation.mode)
        self.mode, self.drops = continuation.mode, dict(continuation.drops)
        self.unknowns = continuation.unknowns
        self._repelling = False

    def active(self, certain: set[int], mode: str) -> list[int]:
        """Surfaces through the present state, to rounding, and those known to be."""
        h, gradient = self.surfaces.values(self.x, self.p)
        scale = rounding_scale(np.abs(gradient), self.x, self.options.size)
        near = {i for i in range(self.system.surface_count) if abs(h[i]) <= ON_SURFACE * scale[i]}
        for members in self.system.sets:
            near -= {*members}
            if mode[members[0]] not in "bli" and reaches_set(self, mode, members, h):
                near |= {*members}
        near |= {i for i, c in enumerate(mode) if c in "sc"}
        return sorted(near | certain | set(resting_contacts(self)))

    @cached_property
    def coupled(self) -> Coupled:
        """The program of all modes."""
        return coupled_of(self.system)

    def jump(self, rate: Array, dt: float) -> None:
        """Go on along a straight line for a time that is too short for a step."""
        x = self.x
        self.record.step(self.t, np.column_stack([x, rate]))
        self.t, self.x = self.t + dt, x + dt * rate
        if self.system.time_dependent:
            self.x[self.system.dimension] = self.t
        self.drops = {}
        self.note()

    def come_to_rest(self, left: float) -> bool:
        """Whether contacts close after impacts that accumulate in the time left."""
        return rest_on_contacts(self, left)


# Impacts: impulses, rest after accumulation, release -----------------------------------------------


def contacts_of(driver: Driver) -> Contacts | None:
    """Return the laws of the contacts of a run, if it has any."""
    if not driver.system.impacts:
        return None
    coupled = coupled_of(driver.system)
    return Contacts(driver.system, coupled, driver.surfaces, driver.p, driver.options)


def resting_contacts(driver: Driver) -> list[int]:
    """Contacts with neither a gap nor a rate; the run ends where a gap is negative."""
    if driver.contacts is None:
        return []
    behind = driver.contacts.behind(driver.x)
    if behind is not None:
        message = messages.behind(driver.system.impacts[behind], driver.t)
        driver.end(Status.INCONSISTENT, message)
    gaps, rates = driver.contacts.gaps(driver.x)
    first = driver.system.surface_count
    return [first + j for j in np.flatnonzero((gaps == 0.0) & (rates == 0.0)).tolist()]


def strike_due(driver: Driver) -> None:
    """Look at the closed gaps."""
    if driver.contacts is None or driver.ended is not None:
        return
    gaps, rates = driver.contacts.gaps(driver.x)
    driver.due_impact = None
    for row, guard in enumerate(driver.stepper.guards(driver.mode)):
        if guard.kind == "impact" and gaps[guard.index] == 0.0:
            if rates[guard.index] < 0.0:
                driver.due_impact = guard
            elif rates[guard.index] > 0.0:
                driver.drops[row] = 1


def apply_impact(driver: Driver, guard: Guard) -> None:
    """The impulses of a gap that closes, and of the contacts that are closed there."""
    assert driver.contacts is not None
    before, x = driver.mode, driver.x
    onto = {driver.system.surface_count + guard.index, *driver.kept(driver.mode)}
    driver.x = driver.surfaces.project(x, driver.p, sorted(onto))
    first = driver.system.surface_count
    touched = {first + j for j in driver.contacts.touched(driver.x)} - onto
    if touched:  # by what the root's error moves a neighbour
        driver.x = driver.surfaces.project(driver.x, driver.p, sorted(onto | touched))
    driver.record.correct(driver.x)
    x = driver.x
    gaps, rates = driver.contacts.gaps(x)
    involved = [j for j in range(len(gaps)) if gaps[j] == 0.0 and rates[j] <= 0.0]
    involved = sorted({*involved, guard.index})
    improper = driver.contacts.improper(x, involved)
    if improper is not None:
        message = messages.restitution(driver.system.impacts[improper], driver.t)
        return driver.end(Status.INCONSISTENT, message)
    after = driver.contacts.strike(x, driver.mode, involved, False)
    if after is None:
        return driver.end(
            Status.INCONSISTENT, messages.no_impulse(guard_name(driver.system, guard), driver.t)
        )
    driver.x = after
    driver.note()
    driver.settle_in()
    driver.event("impact", before, guard, x)
    driver.arm()


def release_contact(driver: Driver, guard: Guard) -> None:
    """Let a contact go whose reaction has fallen to zero."""
    before, j = driver.mode, guard.index
    active = driver.active({driver.system.surface_count + j}, driver.mode)
    known = {("release", j, 0): 1, ("impact", j, 1): 3}
    driver.go_on(active, known, before, guard)


def rest_on_contacts(driver: Driver, left: float) -> bool:
    """After impacts that accumulate the contact is closed; whether there is one."""
    if driver.contacts is None or not all(p.startswith("impact") for p in driver.patterns[-6:]):
        return False
    gaps, _ = driver.contacts.gaps(driver.x)
    involved = np.flatnonzero(gaps == 0.0).tolist()
    x = driver.contacts.strike(driver.x, driver.mode, involved, True)
    if x is None:
        return False
    before, first = driver.mode, driver.system.surface_count
    driver.x = driver.surfaces.project(x, driver.p, _kept_by(driver, involved))
    letters = driver.letters()
    active = driver.active({first + j for j in involved}, letters)
    if not driver.choose(active, letters, {}):
        return True
    driver.note()
    driver.intervals, driver.patterns = [], []
    e = driver.expand()
    if "c" in driver.mode and e.finite and driver.advance(e, left):
        closed = [j for j in involved if before[first + j] != driver.mode[first + j]]
        name = " and ".join(driver.system.impacts[j] for j in closed)
        driver.limit = driver.t
        of = [Guard("release", j, 0, len(driver.system.entries) + j) for j in closed]
        driver.event(change(before, driver.mode), before, of[0] if of else None, name=name)
    return True


def _kept_by(driver: Driver, contacts: Sequence[int]) -> list[int]:
    m, c = driver.system.surface_count, len(driver.system.impacts)
    return [*[m + j for j in contacts], *[m + c + j for j in contacts]]


# Sets of codimension two and three: arrival, passage, rolling, exit --------------------------------

#: Only where |h| is this much of its terms its time to zero is asked for.
CLOSE = 1e-8


# reaching ------------------------------------------------------------------------------------------


def near_set(driver: Driver, guard: Guard, fell: bool = True) -> None:
    """|h| has fallen tenfold, or is small."""
    # What has fallen to rounding is zero, whatever its direction says.
    own = list(driver.system.set_of[guard.index])
    if driver.mode[own[0]] == "s":
        return  # friction's limit has fallen: the next step sees its digits
    coupled, mode, x, p = driver.coupled, driver.mode, driver.x, driver.p
    h = slip_of(driver, own)
    scale = scale_of(driver, own)
    law = frozen(coupled, mode, x, driver.unknowns, p, own)
    r = math.hypot(*h)
    at_floor = r <= VANISHES * scale
    hits = law.attracts
    dt = law.time_left(h) if hits else law.straight(h)
    at_floor = at_floor or dt < max(shortest_approach(driver), swallowed_step(driver))
    if not hits and not at_floor:
        return
    if not (0.0 < dt < np.inf):
        if not (at_floor and (hits or fell)):
            return
        dt = 0.0
    if dt > 0.0:
        u = unit(h)
        mean = law.mean(h, dt) if hits else u
        rate = field_at(coupled, mode, x, driver.unknowns, p, own, mean)
        end = x + dt * rate
        later = frozen(coupled, mode, end, driver.unknowns, p, own)
        bend = float(np.abs(later.a - law.a).sum() + np.abs(later.m - law.m).sum()) * dt
        if not at_floor:
            turn = np.abs(rate - field_at(coupled, mode, x, driver.unknowns, p, own, u))
            turn += np.abs(rate - field_at(coupled, mode, end, driver.unknowns, p, own, mean))
            allowed = REACHED * tolerances(driver.system, x, driver.options)
            allowed += EPSILON * (driver.options.size + np.abs(x))
            if np.any(turn * dt > allowed) or bend > REACHED * r:
                return
        if bend <= r:  # else it is reached to rounding, and slowly
            driver.jump(rate, min(dt, driver.options.t_end - driver.t))
    before = mode
    active = driver.active({*own}, mode)
    driver.x = driver.surfaces.project(driver.x, p, active)
    driver.record.correct(driver.x)
    driver.go_on(active, {}, before, guard)


def watch_sets(driver: Driver) -> None:
    """After a step that ended with no guard: sets that are close may be reached to rounding."""
    if not driver.system.sets:
        return None
    for row, guard in enumerate(driver.stepper.guards(driver.mode)):
        members = driver.system.set_of.get(guard.index, ())
        if guard.kind != "near" or driver.mode[guard.index] == "s" or driver.drops.get(row, 0):
            continue
        if math.hypot(*slip_of(driver, list(members))) <= CLOSE * scale_of(driver, list(members)):
            return near_set(driver, guard, fell=False)
    return None


def shortest_approach(driver: Driver) -> float:
    """Time to a set below which coefficients of series are too large for numbers."""
    return float(OVERFLOW ** (-1.0 / driver.options.order))


def swallowed_step(driver: Driver) -> float:
    """Time to a set below which rounding of the time leaves no room for a step of a tenfold fall."""
    return TENFOLD * SHORTEST * max(abs(driver.t), abs(driver.t - driver.options.t_start))


def reaches_set(driver: Driver, mode: str, members: tuple[int, ...], h: Array) -> bool:
    """Whether a state is on a set, or as close as no series can begin."""
    own = list(members)
    r, scale = math.hypot(*h[own]), scale_of(driver, own)
    if r <= VANISHES * scale or r > CLOSE * scale:
        return r <= VANISHES * scale
    law = frozen(driver.coupled, mode, driver.x, driver.unknowns, driver.p, own)
    speed = float(np.linalg.norm(law.a) + np.linalg.norm(law.m))
    return r < shortest_approach(driver) * speed


def idle_sets(system: FilippovSystem, p: Array) -> set[tuple[int, ...]]:
    """Sets whose multiplier does not enter the field with these parameters: no friction, mu = 0."""
    return {s for s in system.sets if not multiplier_enters(system, s, p)}


def start_letters(mode: str, actual: str, active: Sequence[int]) -> str:
    """Letters of a run that starts in a mode asked for."""
    kinds = {"*": "l"}
    return "".join(
        kinds.get(letter, letter)
        if i in active
        else ("i" if letter == "*" and actual[i] == "i" else letter)
        for i, letter in enumerate(mode)
    )


def decides(guard: Guard, mode: str) -> bool:
    """Whether a mode can continue only where a guard is positive; others only end steps."""
    on_set = guard.kind == "near" and mode[guard.index] == "s"
    return guard.kind in ("surface", "exit", "slip", "near") and not on_set


def slip_of(driver: Driver, own: Sequence[int]) -> Array:
    """h of a set, with all the digits that are known."""
    if driver.mode[own[0]] == "b":
        return driver.unknowns[list(own)]
    return driver.coupled.heights_at(driver.x, driver.p)[list(own)]


def scale_of(driver: Driver, own: Sequence[int]) -> float:
    """Rounding scale of |h| of a set: |dh/dx| (size + |x|)."""
    gradient = np.abs(driver.surfaces.values(driver.x, driver.p)[1])
    return float(rounding_scale(gradient, driver.x, driver.options.size)[list(own)].max())


# leaving -------------------------------------------------------------------------------------------


def after_step(driver: Driver) -> None:
    """Sets that were left a step ago: h is carried along until it is far above rounding."""
    letters = list(driver.mode)
    for members in driver.system.sets:
        own = list(members)
        if letters[own[0]] == "l":
            for i in own:
                letters[i] = "b"
        elif letters[own[0]] == "b":
            if math.hypot(*driver.unknowns[own]) > LEFT * scale_of(driver, own):
                for i in own:
                    letters[i] = "*"
                driver.unknowns[own] = 0.0
    driver.mode = "".join(letters)
    carried = [i for i, letter in enumerate(driver.mode) if letter == "b"]
    if carried:
        level = driver.unknowns[carried]
        driver.x = driver.surfaces.project(driver.x, driver.p, carried, level)
