"""Shooting for the dividing surface: slip, then roll to lift-off, with the itinerary fixed.

With the itinerary fixed every piece is a smooth flow, so the conditions at its end are smooth
functions of the start, and Newton's method finds starts that meet them. This also holds where the
normal motion depends on the tangential one and lift-off comes at another time for every start.
"""

from __future__ import annotations

from itertools import pairwise
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

#: An Euler step of this length leaves a power law's zero; its error is below rounding.
_INSTANT = 1e-13


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

    def _expressions(self) -> list[ca.SX]:
        lie = [self.system.lie_derivative(modes) for modes in ("+", "-", "++", "--")]
        load = self.equations.load
        rate = self.system.lie_derivative("+", of=load)
        return [lie[0], lie[1], (lie[0] + lie[1]) / 2, lie[2], lie[3], load, rate]

    def numbers(self, x: Array) -> Array:
        """L1, L2, A, L11, L22, the load and its rate at a state; (7,)."""
        return np.array([float(v) for v in self._function(x, self._values)])

    def land(self, u: Array) -> tuple[float, Array]:
        """Time and state at which contact begins, from u = (xdot, omega) at touch-down."""
        extra = list(self.equations.start.values())
        start = [0.0, float(u[0]), 0.0, self.ydot, float(u[1]), *extra]
        run, state = approach(self.blueprint, self.model.values, start, self.tol, self.t_max)
        return 0.0 if run is None else float(run.t[-1]), np.array(state)

    # with the itinerary fixed -------------------------------------------------------------------

    def shoot(self, u: Array, word: str) -> Arrival:
        """Move with an itinerary such as ``"+s"``; the last phase goes on to lift-off.

        A last phase of rolling is not left, and one of slip does not end, where H = 0.
        """
        t, x = self.land(u)
        wrong = {"+": x[1] + x[4] < 0, "-": x[1] + x[4] > 0}.get(word[0], False)
        fault = "the slip at touch-down has the other sign" if wrong else ""
        for mode, following in pairwise(word):
            names = ("L_F1 h", "L_F2 h") if mode == "s" else ("h0",)
            run = self._follow(mode, t, x, (*names, "lift-off"))
            t, x = float(run.t[-1]), run.x[-1]
            fault = fault or self._change_fault(mode, following, run.events[-1].name, x)
        return self._last(word[-1], t, x, fault)

    def slip(self, u: Array) -> ns.Trajectory:
        """Forward slip from touch-down to lift-off."""
        return self._follow("+", *self.land(u), ("lift-off",))

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
        return float(slip.x[-1][1] + slip.x[-1][4]), self._last("s", entry, slip.x[-1], fault)

    def _last(self, mode: str, t: float, x: Array, fault: str) -> Arrival:
        run = self._follow(mode, t, x, ("lift-off",))
        end = run.x[-1]
        fault = fault or (self._roll_fault(run) if mode == "s" else self._slip_fault(run, mode))
        slip, pull = float(end[1] + end[4]), float(self.numbers(end)[2])
        return Arrival(end, float(run.t[-1]), t, slip, pull, fault)

    def _follow(
        self, mode: str, t: float, x: Array, until: tuple[str, ...], t_end: float | None = None
    ) -> ns.Trajectory:
        run = self._run(mode, t, x, until, t_end)
        if run.status is ns.Status.NOT_FINITE and len(run.t) == 1 and x[2] == 0.0:
            # A power law at y = 0 has no Taylor series there.
            # There the load is zero, so the field is that of every mode.
            field = self.system.evaluate(self.system.field("+"), x, self.model.values)[:, 0]
            run = self._run(mode, t, x + _INSTANT * field, until, t_end)
        wanted = ns.Status.STOPPED if t_end is None else ns.Status.REACHED_END
        if run.status is not wanted:
            doing = "rolling" if mode == "s" else "slipping"
            raise LiftOffError(
                f"lift-off: expected after {doing} from xdot = {x[1]:.6g}, omega = {x[4]:.6g}, "
                f"received {run.status}: {run.message}",
                run,
            )
        return run

    def _run(
        self, mode: str, t: float, x: Array, until: tuple[str, ...], t_end: float | None
    ) -> ns.Trajectory:
        return ns.follow(
            self.system,
            x,
            t + self.t_max if t_end is None else t_end,
            mode=mode,
            until=until,
            t_start=t,
            parameters=self.model.values,
            tol=self.tol,
        )

    # whether a ball really moves so -------------------------------------------------------------

    def _change_fault(self, mode: str, following: str, name: str, x: Array) -> str:
        """A phase must end as the itinerary says: by entry, crossing, or exit to that side."""
        above, below = self.numbers(x)[:2]
        if name == "lift-off":
            return f"lift-off in a phase {mode!r} that is not the last"
        if mode == "s":
            wanted = "L_F1 h" if following == "+" else "L_F2 h"
            return "" if name == wanted else "rolling ends to the other side"
        if following == "s":
            return "" if above <= 0 <= below else "the ball cannot roll where slip ends"
        crosses = above < 0 and below < 0 if following == "-" else above > 0 and below > 0
        return "" if crosses else "the slip cannot change sign where it vanishes"

    def _slip_fault(self, run: ns.Trajectory, mode: str) -> str:
        """H must keep its sign strictly between the ends, which may be zeros."""
        start, end = float(run.t[0]), float(run.t[-1])
        near = 1e-7 * (end - start)
        early = any(e.name == "h0" and start + near < e.t < end - near for e in run.events)
        middle = run(0.5 * (start + end))
        if early or (1 if mode == "+" else -1) * (middle[1] + middle[4]) <= 0.0:
            return "H changes sign while slipping"
        return ""

    def _roll_fault(self, run: ns.Trajectory) -> str:
        """Rolling needs L1 < 0 < L2 until both vanish at a visible two-fold."""
        start, end = float(run.t[0]), float(run.t[-1])
        near = 1e-5 * (end - start)
        names = ("L_F1 h", "L_F2 h")
        early = any(e.name in names and start + near < e.t < end - near for e in run.events)
        first, middle = self.numbers(run.x[0]), self.numbers(run(0.5 * (start + end)))
        if early or not (first[0] <= 0 <= first[1] and middle[0] <= 0 <= middle[1]):
            return "friction does not suffice to roll"
        above, below = self.numbers(run.x[-1])[3:5]
        return "" if above > 0 > below else "the two-fold at lift-off is not visible"
