"""heyoka: one adaptive Taylor integrator for each mode, terminal events in compiled code.

Constants are baked into the integrators, the compact mode is off, views of the states are kept, and
Python does nothing between runs but choose the next mode. ``lanes`` advances trajectories of one
mode in a batch integrator, a lane being refilled when its own event stops the batch.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np

from ..problems import DECIDE, MINUS, PLUS, SLIDING, STOP, T_MAX, Array, Problem, bounce
from ..reference import Ends
from . import NUDGE


def available() -> bool:
    """Whether heyoka is installed."""
    return importlib.util.find_spec("heyoka") is not None


class Heyoka:
    """One ``taylor_adaptive`` per mode."""

    def __init__(self, problem: Problem, tolerance: float, lanes: int = 0):
        import heyoka as hy

        self.problem, self.lanes = problem, lanes
        self.name = [f"y{i}" for i in range(problem.dimension)]
        event = hy.t_event_batch if lanes else hy.t_event
        falling = hy.event_direction.negative
        self.integrators = []
        for mode in range(3):
            symbols = list(hy.make_vars(*self.name))
            field = problem.fields[mode](*symbols)
            equations = [(s, hy.expression(0.0) + f) for s, f in zip(symbols, field, strict=True)]
            events = [event(g.value(*symbols), direction=falling) for g in problem.guards[mode]]
            start = np.full((problem.dimension, lanes) if lanes else problem.dimension, 0.1)
            new = hy.taylor_adaptive_batch if lanes else hy.taylor_adaptive
            self.integrators.append(
                new(equations, start, t_events=events, tol=tolerance, compact_mode=False)
            )
        self.states = [integrator.state for integrator in self.integrators]
        self.segments: list[Any] = []
        self.goes_to = [[g.goes_to for g in guards] for guards in problem.guards]

    def solve(self, starts: Array, t_end: float = T_MAX, dense: bool = False) -> Ends:
        """Run every start to its stop, or to ``t_end``."""
        if self.lanes:
            return _solve_lanes(self, starts, t_end)
        count = len(starts)
        t, x, codes = np.empty(count), np.empty(starts.shape), np.empty(count, np.int64)
        for i in range(count):
            t[i], codes[i] = self._one(starts[i], x[i], t_end, dense)
        return Ends(t, x, codes)

    def _one(self, start: Array, out: Array, t_end: float, dense: bool) -> tuple[float, int]:
        problem, free, states = self.problem, self.problem.free, self.states
        integrators, goes_to, slopes = self.integrators, self.goes_to, problem.slopes
        values, t = start.tolist(), 0.0
        mode = PLUS if problem.surface(*values) > 0.0 else MINUS
        code, kept, state, on = mode + 1, self.segments, start, values[free]
        kept.clear()
        while True:
            integrator, before = integrators[mode], state
            state = states[mode]
            if state is not before:
                state[:] = before
            state[free] = on
            integrator.time = t
            integrator.reset_cooldowns()
            outcome = integrator.propagate_until(t_end, c_output=dense)
            t = integrator.time
            if dense:
                kept.append(outcome[4])
            hit = -int(outcome[0]) - 1
            if hit < 0 or hit >= len(goes_to[mode]):
                break
            after = goes_to[mode][hit]
            if after == STOP:
                break
            values = state.tolist()
            on = values[free] - problem.surface(*values)
            if after == DECIDE:
                below_zero, above_zero = slopes(*values)
                after = SLIDING if below_zero < 0.0 < above_zero else 2 - mode
            mode = after
            # The code of a long run would not fit; what counts there are the events.
            code = (4 * code + mode + 1) & 0x3FFFFFFFFFFFFFFF
            if mode != SLIDING:
                on += NUDGE if mode == PLUS else -NUDGE
        out[:] = state
        return t, code


def _solve_lanes(engine: Heyoka, starts: Array, t_end: float) -> Ends:
    """Trajectories grouped by mode; each group keeps all lanes of its integrator busy."""
    x, t = starts.copy(), np.zeros(len(starts))
    mode = np.array([engine.problem.first_mode(s) for s in starts])
    codes = (mode + 1).astype(np.int64)
    live = np.ones(len(starts), bool)
    while live.any():
        for m in range(3):
            waiting = np.flatnonzero(live & (mode == m)).tolist()
            if waiting:
                _run_mode(engine, m, waiting, (t, x, mode, codes, live), t_end)
    return Ends(t, x, codes)


def _run_mode(
    engine: Heyoka, m: int, waiting: list[int], data: tuple[Any, ...], t_end: float
) -> None:
    t, x, mode, codes, live = data
    problem, integrator, state = engine.problem, engine.integrators[m], engine.states[m]
    goes_to, free = engine.goes_to[m], problem.free
    inside = [-1] * engine.lanes
    until = np.full(engine.lanes, t_end)
    while True:
        times = integrator.time.copy()
        for lane, who in enumerate(inside):
            if who < 0 and waiting:
                inside[lane] = waiting.pop()
                state[:, lane] = x[inside[lane]]
                times[lane] = t[inside[lane]]
                integrator.reset_cooldowns(lane)
        busy = [lane for lane, who in enumerate(inside) if who >= 0]
        if not busy:
            return
        integrator.set_time(times)
        for lane, who in enumerate(inside):
            until[lane] = t_end if who >= 0 else times[lane]
        integrator.propagate_until(until)
        outcomes, now = integrator.propagate_res, integrator.time
        for lane in busy:
            hit = -int(outcomes[lane][0]) - 1
            if not 0 <= hit < len(goes_to):
                continue
            who, inside[lane] = inside[lane], -1
            values = state[:, lane].tolist()
            t[who] = now[lane]
            if goes_to[hit] == STOP:
                x[who], live[who] = values, False
                continue
            values[free] -= problem.surface(*values)
            new = problem.decide(values, m) if goes_to[hit] == DECIDE else goes_to[hit]
            if new != SLIDING:
                values[free] += NUDGE if new == PLUS else -NUDGE
            x[who], mode[who], codes[who] = values, new, 4 * codes[who] + new + 1


def make(name: str, tolerance: float, lanes: int = 0) -> Callable[[Array], Ends]:
    """Solver of a bounce."""
    return Heyoka(bounce(name), tolerance, lanes).solve
