"""The reference driver: Taylor steps, event location and Filippov's logic in pure Python.

It needs no compiler and is the truth that faster engines are tested against. One loop: expand the
mode at the state, choose the step, look for the first guard to fall, advance; at a guard decide
which mode continues. Everything difficult is in the three modules it calls: ``stepper`` (numbers),
``polynomial`` (roots), ``switching`` (logic).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...model import Array, Coupled, FilippovSystem, Guard, Resets, Surfaces, coupled_of
from .. import messages
from ..constants import ON_SURFACE, PRIORITY, VANISHES
from ..names import change, guard_name
from ..options import Options
from ..status import Status
from ..trajectory import Trajectory
from . import impacts, sets
from .bookkeeping import Bookkeeping
from .coupled_modes import modes_of
from .modes import Expansion, powers, rounding_scale
from .stepper import Hit, Sides, Stepper
from .switching import Continuation, decide, is_two_fold


class Driver(Bookkeeping):
    """One run of one system."""

    def __init__(self, system: FilippovSystem, x: Array, p: Array, options: Options):
        super().__init__(system, x, p, options)
        self.modes = modes_of(system, p, options)
        self.stepper = Stepper(system, self.modes, options)
        self.surfaces, self.resets = Surfaces(system), Resets(system)
        self.unknowns = np.zeros(system.surface_count + len(system.impacts))  # of what slides
        self.contacts = impacts.contacts_of(self)
        self._idle = sets.idle(system, p)
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
            return impacts.impact(self, self.due_impact)
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
            sets.look(self)
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
            sets.after_step(self)

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
            return impacts.impact(self, guard)
        if guard.kind == "release":
            return impacts.release(self, guard)
        if guard.kind == "near":
            return sets.near(self, guard)
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
            impacts.strike_due(self)

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
        impacts.strike_due(self)
        self.arm()

    def _start_in(self, mode: str, active: Sequence[int]) -> None:
        self.system.parse_letters(mode)
        mode = sets.asked(self.system.widened(mode).ljust(len(self.mode), "o"), self.mode, active)
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
            if guard.index in active and sets.decides(guard, mode):
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
            if mode[members[0]] not in "bli" and sets.met(self, mode, members, h):
                near |= {*members}
        near |= {i for i, c in enumerate(mode) if c in "sc"}
        return sorted(near | certain | set(impacts.resting(self)))

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
        return impacts.come_to_rest(self, left)
