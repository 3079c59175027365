"""diffrax: all trajectories in one vmap, one compiled call for one stretch of every trajectory.

The mode is a number beside the state, the field is chosen by it, and the three guards are events
with a Newton root finder. Between stretches (JAX, too, but outside the event) every trajectory gets
its next mode; trajectories that have ended wait for the slowest.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np

from ..problems import MINUS, PLUS, SLIDING, T_MAX, Array, Problem, bounce
from ..reference import Ends
from . import NUDGE

#: Events are seen at the ends of steps only; longer steps jump over more of them.
_LONGEST = 0.1


def available() -> bool:
    """Whether diffrax is installed."""
    return importlib.util.find_spec("diffrax") is not None


def make(name: str, tolerance: float, lanes: int = 0) -> Callable[[Array], Ends]:
    """Solver of a bounce; all starts of a call are one vmap."""
    import jax

    jax.config.update("jax_enable_x64", True)
    problem = bounce(name)
    stretch = jax.jit(jax.vmap(_stretch(problem, tolerance)))

    def solve(starts: Array) -> Ends:
        x, t = jax.numpy.asarray(starts), jax.numpy.zeros(len(starts))
        mode = jax.numpy.where(problem.surface(*starts.T) > 0.0, PLUS, MINUS)
        code, live = mode + 1, jax.numpy.ones(len(starts), bool)
        for _ in range(20):
            t, x, mode, code, live = stretch(t, x, mode, code, live)
            if not bool(live.any()):
                break
        return Ends(np.asarray(t), np.asarray(x), np.asarray(code, np.int64))

    return solve


def _choose(mode: Any, values: Any) -> Any:
    import jax.numpy as jnp

    return jnp.where(mode == PLUS, values[0], jnp.where(mode == SLIDING, values[1], values[2]))


def _event(problem: Problem, tolerance: float) -> Any:
    """The guards of the three modes as three falling events; the last is the stop."""
    import diffrax as dx
    import optimistix as optx

    def guard(number: int) -> Callable[..., Any]:
        def value(t: Any, y: Any, args: Any, **_: Any) -> Any:
            # A mode with fewer guards repeats its first.
            order = [[0, 0, 1], [0, 1, 2], [0, 0, 1]]
            chosen = [problem.guards[m][order[m][number]].value(*y) for m in range(3)]
            return _choose(args, chosen)

        return value

    finder: Any = optx.Newton(rtol=tolerance, atol=tolerance)
    return dx.Event([guard(k) for k in range(3)], finder, direction=[False] * 3)


def _stretch(problem: Problem, tolerance: float) -> Callable[..., Any]:
    """One trajectory from its state to its next event, and the mode that follows there."""
    import diffrax as dx
    import jax.numpy as jnp

    def field(t: Any, x: Any, mode: Any) -> Any:
        fields = [jnp.stack([v + 0.0 * x[0] for v in f(*x)]) for f in problem.fields]
        return _choose(mode, fields)

    term, event = dx.ODETerm(field), _event(problem, 1e-3 * tolerance)
    controller = dx.PIDController(rtol=tolerance, atol=1e-2 * tolerance, dtmax=_LONGEST)

    def advance(t: Any, x: Any, mode: Any, code: Any, live: Any) -> Any:
        end = jnp.where(live, T_MAX, t)
        run = dx.diffeqsolve(
            term,
            dx.Dopri8(),
            t,
            end,
            None,
            x,
            args=mode,
            event=event,
            stepsize_controller=controller,
            saveat=dx.SaveAt(t1=True),
            max_steps=4096,
            throw=False,
        )
        hit = jnp.stack([jnp.asarray(m) for m in run.event_mask])
        t_new, x_new = run.ts[0], run.ys[0]
        ended = hit[2] | ~hit.any()
        on = x_new.at[problem.free].add(-problem.surface(*x_new))
        low, high = problem.slopes(*on)
        decided = jnp.where((low < 0.0) & (high > 0.0), SLIDING, 2 - mode)
        new = jnp.where(mode == SLIDING, jnp.where(hit[0], PLUS, MINUS), decided)
        push = jnp.where(new == PLUS, NUDGE, jnp.where(new == MINUS, -NUDGE, 0.0))
        go = live & ~ended
        x_go = on.at[problem.free].add(push)
        return (
            jnp.where(live, t_new, t),
            jnp.where(go, x_go, jnp.where(live, x_new, x)),
            jnp.where(go, new, mode),
            jnp.where(go, 4 * code + new + 1, code),
            go,
        )

    return advance
