"""Shooting from landings to lift-off with the itinerary fixed.

Then every leg is a smooth flow, so the conditions at its end are smooth functions of the landing and
Newton's method solves them, also where the time of lift-off depends on the landing.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import contact_system, equations
from ..contact.model import ContactModel
from ..errors import LiftOffError
from ..shot.touch_down import approach

Array = NDArray[np.float64]


class Shooting(ns.orbit.EventPassages):
    """Motions from touch-down at x = y = 0 to lift-off, whose ``corner`` is H and the acceleration A."""

    def __init__(
        self, model: ContactModel, ydot: float, *, tol: float = 1e-13, t_max: float = 1000.0
    ):
        self.model, self.ydot, self.blueprint = model, ydot, model.blueprint()
        self.equations = equations(self.blueprint)
        super().__init__(
            contact_system(self.blueprint),
            "lift-off",
            self._touched,
            -ydot,
            parameters=model.values,
            tol=tol,
            t_max=t_max,
            exact=False,
        )

    def load(self, x: Array) -> tuple[float, float]:
        """The load at a state, and its rate in forward slip."""
        load = self.equations.load
        values = [load, self.system.lie_derivative("+", of=load)]
        one, other = (self.system.evaluate(v, x, self.model.values).item() for v in values)
        return one, other

    def land(self, u: Array) -> tuple[float, Array]:
        """Time and state at which contact begins, from u = (xdot, omega) at touch-down."""
        extra = list(self.equations.start.values())
        start = [0.0, float(u[0]), 0.0, self.ydot, float(u[1]), *extra]
        run, _, state = approach(self.blueprint, self.model.values, start, self.tol, self.t_max)
        return 0.0 if run is None else float(run.t[-1]), np.array(state)

    def _touched(self, u: Array) -> tuple[float, Array, None]:
        return *self.land(u), None

    # with the itinerary fixed -------------------------------------------------------------------

    def passage(self, u: Array, word: str) -> ns.orbit.Passage:
        """Follow an itinerary such as ``"+s"``; its last phase continues to lift-off, even past H = 0."""
        with self._lift_off():
            return super().passage(u, word)

    def slip(self, u: Array) -> ns.Trajectory:
        """Forward slip from touch-down to lift-off."""
        return self._follow("+", *self.land(u), "lift-off")

    def first_phase(self, u: Array) -> ns.Trajectory:
        """Forward slip from touch-down to its end: H = 0 or lift-off."""
        return self._follow("+", *self.land(u), ("h0", "lift-off"))

    def slip_then_roll(self, u: Array, mode: str, entry: float) -> tuple[float, ns.orbit.Passage]:
        """Slip until the time ``entry``, then roll to lift-off: H at entry, and the lift-off."""
        t, x = self.land(u)
        slip = self._follow(mode, t, x, (), entry)
        early = [
            e for e in slip.events if e.name in ("h0", "lift-off") and e.t < entry * (1 - 1e-7)
        ]
        what = "lifts off" if early and early[0].name == "lift-off" else "has H = 0"
        fault = f"the ball {what} at t = {early[0].t:.6g}, while slipping" if early else ""
        with self._lift_off():
            rolls = self.itinerary("s").arrive(slip.x[-1], entry)
        rolls = replace(rolls, fault=fault or rolls.fault)
        return float(slip.x[-1][1] + slip.x[-1][4]), self.decided(rolls, "s")

    def _follow(
        self,
        mode: str,
        t: float,
        x: Array,
        until: str | tuple[str, ...],
        t_end: float | None = None,
    ) -> ns.Trajectory:
        with self._lift_off():
            return self.itinerary(mode).leg(mode, t, x, until, t_end)

    @contextmanager
    def _lift_off(self) -> Iterator[None]:
        """Raise a ``LiftOffError`` where a phase does not end."""
        try:
            yield
        except ns.ConvergenceError as error:
            run = error.point if isinstance(error.point, ns.Trajectory) else None
            raise LiftOffError(f"The ball does not lift off: {error}", run) from error
