"""Shooting for the dividing surface: slip, then roll to lift-off, with the itinerary fixed.

With the itinerary fixed every piece is a smooth flow, so the conditions at its end are smooth
functions of the start, and Newton's method finds starts that meet them. This also holds where the
normal motion depends on the tangential one and lift-off comes at another time for every start.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..contact.equations import contact_system, equations
from ..contact.model import ContactModel
from ..errors import LiftOffError
from ..shot.touch_down import approach

Array = NDArray[np.float64]


class Arrival(NamedTuple):
    """The end of a contact with a fixed itinerary.

    Attributes
    ----------
    x : ndarray (n,)
        State at lift-off.
    t, entry : float
        Time of lift-off, and of the beginning of the last phase.
    slip, pull : float
        H = xdot + omega, and the tangential acceleration A without friction.
    fault : str
        Empty if a ball really moves so, else why not.
    """

    x: Array
    t: float
    entry: float
    slip: float
    pull: float
    fault: str


class Shooting:
    """Motions with a fixed itinerary from touch-down at x = y = 0.

    Parameters
    ----------
    model : ContactModel
    ydot : float
        Normal speed at touch-down, < 0.
    tol : float
    t_max : float
    """

    def __init__(
        self, model: ContactModel, ydot: float, *, tol: float = 1e-13, t_max: float = 1000.0
    ):
        self.model, self.ydot, self.tol, self.t_max = model, ydot, tol, t_max
        self.blueprint = model.blueprint()
        self.equations, self.system = equations(self.blueprint), contact_system(self.blueprint)
        self._values = list(model.values.values())
        self._function = self.system.function("bounce shooting", self._expressions)
        self._itineraries: dict[str, ns.FixedItinerary] = {}

    def _expressions(self) -> list[ca.SX]:
        lie = [self.system.lie_derivative(modes) for modes in ("+", "-", "++", "--")]
        load = self.equations.load
        rate = self.system.lie_derivative("+", of=load)
        return [lie[0], lie[1], (lie[0] + lie[1]) / 2, lie[2], lie[3], load, rate]

    def numbers(self, x: Array) -> Array:
        """L1, L2, A, L11, L22, the load and its rate at a state; (7,)."""
        return np.array([v.item() for v in ns.call(self._function, x, self._values)])

    def land(self, u: Array) -> tuple[float, Array]:
        """Time and state at which contact begins, from u = (xdot, omega) at touch-down."""
        extra = list(self.equations.start.values())
        start = [0.0, float(u[0]), 0.0, self.ydot, float(u[1]), *extra]
        run, _, state = approach(self.blueprint, self.model.values, start, self.tol, self.t_max)
        return 0.0 if run is None else float(run.t[-1]), np.array(state)

    # with the itinerary fixed -------------------------------------------------------------------

    def shoot(self, u: Array, word: str) -> Arrival:
        """Move with an itinerary such as ``"+s"``; the last phase goes on to lift-off.

        A last phase of rolling is not left, and one of slip does not end, where H = 0.
        """
        t, x = self.land(u)
        wrong = {"+": x[1] + x[4] < 0, "-": x[1] + x[4] > 0}.get(word[0], False)
        fault = "the slip at touch-down has the other sign" if wrong else ""
        with self._lift_off():
            found = self._itinerary(word).arrive(x, t)
        return self._arrival(found.x, found.t, found.entry, fault or found.fault, word[-1])

    def slip(self, u: Array) -> ns.Trajectory:
        """Forward slip from touch-down to lift-off."""
        return self._follow("+", *self.land(u), "lift-off")

    def first_phase(self, u: Array) -> ns.Trajectory:
        """Forward slip from touch-down to its end: H = 0 or lift-off."""
        return self._follow("+", *self.land(u), ("h0", "lift-off"))

    def slip_then_roll(self, u: Array, mode: str, entry: float) -> tuple[float, Arrival]:
        """Slip until the time ``entry``, then roll to lift-off: H at entry, and the lift-off."""
        t, x = self.land(u)
        slip = self._follow(mode, t, x, (), entry)
        early = [
            e for e in slip.events if e.name in ("h0", "lift-off") and e.t < entry * (1 - 1e-7)
        ]
        what = "lifts off" if early and early[0].name == "lift-off" else "has H = 0"
        fault = f"the ball {what} at t = {early[0].t:.6g}, while slipping" if early else ""
        roll = self._follow("s", entry, slip.x[-1], "lift-off")
        fault = fault or self._itinerary("s").inside(roll, "rolling")
        arrival = self._arrival(roll.x[-1], float(roll.t[-1]), entry, fault, "s")
        return float(slip.x[-1][1] + slip.x[-1][4]), arrival

    def _arrival(self, x: Array, t: float, entry: float, fault: str, mode: str) -> Arrival:
        """Describe a lift-off; one from rolling must be at a visible two-fold."""
        pull, above, below = self.numbers(x)[2:5]
        if mode == "s" and not above > 0 > below:
            fault = fault or "the two-fold at lift-off is not visible"
        return Arrival(x, t, entry, float(x[1] + x[4]), float(pull), fault)

    def _itinerary(self, word: str) -> ns.FixedItinerary:
        if word not in self._itineraries:
            self._itineraries[word] = ns.FixedItinerary(
                self.system,
                word,
                until="lift-off",
                parameters=self.model.values,
                tol=self.tol,
                t_max=self.t_max,
            )
        return self._itineraries[word]

    def _follow(
        self,
        mode: str,
        t: float,
        x: Array,
        until: str | tuple[str, ...],
        t_end: float | None = None,
    ) -> ns.Trajectory:
        with self._lift_off():
            return self._itinerary(mode).leg(mode, t, x, until, t_end)

    @contextmanager
    def _lift_off(self) -> Iterator[None]:
        """Say of a phase that does not end that there is no lift-off."""
        try:
            yield
        except ns.ConvergenceError as error:
            run = error.point if isinstance(error.point, ns.Trajectory) else None
            raise LiftOffError(f"lift-off: {error}", run) from error
