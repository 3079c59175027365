"""heyoka, in its fastest form: one integrator whose parameters are the mode.

The friction is p0*load + p1*along, so that a Python callback at each event changes the mode and the
integrator continues without returning. The push off the surface is needed: without it 114 (linear) and
252 (nonlinear) of 500 itineraries were wrong, with it none, whatever the cooldown.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..problems import FORCES, KAPPA, MINUS, MU, PLUS, SLIDING, SPIN, T_MAX, Array
from ..reference import Ends
from . import NUDGE
from .heyoka_modes import available as available

#: p0, p1, the sign of the guard H (0 while rolling), and 1 outside of rolling.
_PARAMETERS = {
    PLUS: (-MU, 0.0, 1.0, 1.0),
    SLIDING: (0.0, -1 / KAPPA, 0.0, 0.0),
    MINUS: (MU, 0.0, -1.0, 1.0),
}
_PUSH = {PLUS: NUDGE, SLIDING: 0.0, MINUS: -NUDGE}


class Heyoka:
    """One ``taylor_adaptive`` for all modes of a bounce."""

    def __init__(self, name: str, tolerance: float):
        import heyoka as hy

        self.forces = FORCES[name]
        self.mode = self.code = 0
        X, V, Y, W, O = symbols = list(hy.make_vars("X", "V", "Y", "W", "O"))
        load, along = self.forces(X, V, Y, W)
        friction, slipping = hy.par[0] * load + hy.par[1] * along, hy.par[3]
        rates = (V, along + friction, W, load, SPIN * friction)
        cone = KAPPA * MU * load
        guards = (
            (hy.par[2] * (V + O) + (1 - slipping), lambda ta, sign: self._meet(ta)),
            ((1 - slipping) * (cone - along) + slipping, lambda ta, sign: self._go(ta, PLUS)),
            ((1 - slipping) * (cone + along) + slipping, lambda ta, sign: self._go(ta, MINUS)),
        )
        down = hy.event_direction.negative
        events = [hy.t_event(g, callback=c, direction=down, cooldown=0.0) for g, c in guards]
        events.append(hy.t_event(load, direction=down))
        self.integrator = hy.taylor_adaptive(
            list(zip(symbols, rates, strict=True)),
            [0.1] * 5,
            t_events=events,
            tol=tolerance,
            pars=[0.0] * 4,
        )
        self.state, self.parameters = self.integrator.state, self.integrator.pars

    def _meet(self, integrator: Any) -> bool:
        X, V, Y, W, _ = integrator.state.tolist()
        load, along = self.forces(X, V, Y, W)
        cone = KAPPA * MU * load
        slides = along - cone < 0.0 < along + cone
        return self._go(integrator, SLIDING if slides else 2 - self.mode)

    def _go(self, integrator: Any, mode: int) -> bool:
        self.mode = mode
        self.code = 4 * self.code + mode + 1
        integrator.pars[:] = _PARAMETERS[mode]
        state = integrator.state
        state[4] = _PUSH[mode] - state[1]
        return True

    def solve(self, starts: Array) -> Ends:
        """Run every start to its lift-off."""
        count, integrator, state = len(starts), self.integrator, self.state
        t, x, codes = np.empty(count), np.empty(starts.shape), np.empty(count, np.int64)
        for i in range(count):
            state[:] = starts[i]
            integrator.time = 0.0
            integrator.reset_cooldowns()
            self.mode = PLUS if state[1] + state[4] > 0.0 else MINUS
            self.code = self.mode + 1
            self.parameters[:] = _PARAMETERS[self.mode]
            integrator.propagate_until(T_MAX)
            t[i], x[i], codes[i] = integrator.time, state, self.code
        return Ends(t, x, codes)


def make(name: str, tolerance: float) -> Callable[[Array], Ends]:
    """Solver of a bounce."""
    return Heyoka(name, tolerance).solve
