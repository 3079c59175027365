"""One chosen mode's smooth flow, forward or backward in time, with its event functions.

The building block for manifolds and dividing surfaces: no switching, no stopping at guards unless
asked. Backward flows are smooth problems here because the mode is fixed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..model import (
    Array,
    FilippovSystem,
    Followed,
    OptionError,
    Parameters,
    Surfaces,
    followed,
    real,
    require_system,
)
from . import messages
from .options import Options
from .polynomial import first_crossing
from .status import ADVICE, Status
from .stepper import Expansion, Stepper
from .trajectory import Event, Segment, Trajectory


def follow(
    system: FilippovSystem,
    point: ArrayLike,
    t_end: float,
    *,
    mode: str,
    until: Sequence[Any] | Any = (),
    watch: Sequence[Any] | Any = (),
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float = math.inf,
    max_steps: int = 1_000_000,
) -> Trajectory:
    """Follow the smooth flow of one mode from a point on or off the surface.

    Parameters
    ----------
    system : FilippovSystem
    point : array_like (n,)
    t_end : float
        Final time; before ``t_start`` the flow is followed backward.
    mode : str
        One letter per surface. With ``s`` the sliding field is followed on the level of h through
        the point.
    until : str, expression, or sequence of them, optional
        End at a zero of these: names of the mode's own event functions (``"h0"``, ``"L_F1 h"``,
        ``"L_F2 h"``, names of stops and resets) or expressions in states, parameters and time. A
        zero at the start is not counted.
    watch : expression or sequence of them, optional
        Further functions whose zeros are reported (named ``f0``, ``f1``, ...).
    t_start, parameters, tol, rtol, atol, max_step, max_steps : optional
        As in :func:`simulate`.

    Returns
    -------
    Trajectory
        ``events`` of kind ``zero`` for every zero of the mode's event functions and of the watched
        ones, ``stop`` for the one that ended it. The status is REACHED_END, STOPPED,
        STEP_TOO_SMALL, NOT_FINITE or TOO_MANY_STEPS.

    Raises
    ------
    PointError, ParameterError, OptionError, DefinitionError, NotSmoothError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[1, 1])
    >>> run = ns.follow(system, [2.0, 0.0], -10.0, mode="+", until="h0")
    >>> run.status.name, run.x[-1].round(12) + 0.0
    ('STOPPED', array([-2.,  0.]))
    """
    require_system(system)
    t_start, t_end = real(t_start, "t_start"), real(t_end, "t_end")
    options = Options(
        t_end=max(t_end, t_start),
        t_start=min(t_end, t_start),
        rtol=tol if rtol is None else rtol,
        atol=tol if atol is None else atol,
        max_step=max_step,
        max_steps=max_steps,
    )
    ends, further = _several(until), _several(watch)
    expressions = [u for u in ends if not isinstance(u, str)] + further
    motion = followed(system, mode, expressions)
    names = [g.name for g in motion.guards]
    ending = {f"f{k}" for k in range(sum(not isinstance(u, str) for u in ends))}
    for name in (u for u in ends if isinstance(u, str)):
        if name not in names:
            raise OptionError(
                f"until: expected a name among {names} or an expression, received {name!r}."
            )
        ending.add(name)
    x = system.extended_point(point, t_start)
    p = system.parameter_vector(parameters)
    return _Follower(system, motion, x, p, options, t_start, t_end, ending).run()


def _several(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple)) else [value]


class _Follower:
    """One run of :func:`follow`; time runs as ``sign`` times a forward variable."""

    def __init__(
        self,
        system: FilippovSystem,
        motion: Followed,
        x: Array,
        p: Array,
        options: Options,
        t_start: float,
        t_end: float,
        ending: set[str],
    ):
        self.system, self.motion, self.p, self.options = system, motion, p, options
        self.stepper = Stepper(system, p, options.rtol, options.atol, lambda s, m: motion)
        self.surfaces = Surfaces(system)
        self.x, self.t, self.t_end, self.ending = x, t_start, t_end, ending
        self.sign = -1.0 if t_end < t_start else 1.0
        self.level = 0.0
        if motion.sliding is not None:
            self.level = float(self.surfaces.values(x, p)[0][motion.sliding])
        self.times, self.points = [t_start], [x[: system.dimension].copy()]
        self.starts: list[float] = []
        self.coefficients: list[Array] = []
        self.events: list[Event] = []

    def run(self) -> Trajectory:
        status, message = self._loop()
        mode = self.motion.mode
        if status is not Status.STOPPED:
            self.events.append(Event("end", self.t, self.points[-1], mode, mode, str(status)))
        span = Segment(mode, self.times[0], self.t, 0, len(self.starts))
        return Trajectory(
            system=self.system,
            parameters=dict(zip(self.system.parameter_names, self.p.tolist(), strict=True)),
            t=np.array(self.times),
            x=np.array(self.points),
            events=self.events,
            segments=[span],
            status=status,
            message=f"{message} {ADVICE[status]}",
            _starts=np.array(self.starts),
            _coefficients=self.coefficients,
        )

    def _loop(self) -> tuple[Status, str]:
        # functions whose zero here is not news, and how many coefficients are known to vanish
        fresh = dict.fromkeys(range(len(self.motion.guards)), 0)
        while True:
            left = abs(self.t_end - self.t)
            if left == 0.0:
                return Status.REACHED_END, f"t = {self.t_end:g} reached."
            if len(self.starts) >= self.options.max_steps:
                return Status.TOO_MANY_STEPS, messages.too_many("steps", self.options.max_steps)
            e = self._expand()
            if not np.all(np.isfinite(e.states)):
                if self._leave_singular_point(e, left):
                    continue
                return Status.NOT_FINITE, messages.field_not_finite(
                    self.motion.mode, self.x.tolist()
                )
            h = min(self.stepper.step_size(e), self.options.max_step)
            if h <= 1e-15 * max(1.0, abs(self.t)) and h < left:
                return Status.STEP_TOO_SMALL, messages.step_too_small(h)
            last, h = h >= left, min(h, left)
            hits = self._zeros(e, h, fresh)
            wanted = min((d for d, _ in hits), default=h)
            dt = self.stepper.reach(e, wanted, self.sign)
            if dt is None:
                return Status.STEP_TOO_SMALL, messages.branch_point(self.t)
            if dt < wanted:
                last, hits = False, []
            self._advance(e, dt)
            if last and not hits:
                self.t = self.times[-1] = self.t_end
            found = [row for d, row in hits if d <= dt + 1e-14 * max(1.0, abs(self.t))]
            fresh = dict.fromkeys(found, 1)
            stopped = self._report(found)
            if stopped:
                return Status.STOPPED, f"{stopped!r} is zero at t = {self.t:.10g}."

    def _expand(self) -> Expansion:
        e = self.stepper.expand(self.motion.mode, self.x)
        if self.sign > 0:
            return e
        flip = self.sign ** np.arange(e.states.shape[1])
        return Expansion(e.mode, e.states * flip, e.guards * flip, e.scales, e.gradient, e.finite)

    def _leave_singular_point(self, e: Expansion, left: float) -> bool:
        """Take the driver's short step where high derivatives do not exist; forward only."""
        if self.sign < 0:
            return False
        coefficients, h = self.stepper.singular_step(e, min(left, self.options.max_step))
        if h > 0.0:
            self._advance(Expansion(e.mode, coefficients, e.guards, e.scales, e.gradient, True), h)
        return h > 0.0

    def _zeros(self, e: Expansion, h: float, fresh: dict[int, int]) -> list[tuple[float, int]]:
        hits = []
        for row in range(len(self.motion.guards)):
            c = e.guards[row]
            if not np.all(np.isfinite(c)):
                continue
            drop = self.stepper.leading(e, row, fresh[row])[0] if row in fresh else 0
            dt = first_crossing(c[drop:].tolist(), h, 0)
            if dt is not None:
                hits.append((dt, row))
        return hits

    def _advance(self, e: Expansion, dt: float) -> None:
        self.starts.append(self.t)
        flip = self.sign ** np.arange(e.states.shape[1])
        self.coefficients.append(e.states * flip)
        x = self.stepper.advance(e, dt)
        self.t += self.sign * dt
        if self.system.time_dependent:
            x[-1] = self.t
        if self.motion.sliding is not None:
            x = self.surfaces.project(x, self.p, [self.motion.sliding], self.level)
        self.x = x
        self.times.append(self.t)
        self.points.append(x[: self.system.dimension].copy())

    def _report(self, rows: list[int]) -> str | None:
        stopped, mode = None, self.motion.mode
        for row in rows:
            name = self.motion.guards[row].name
            kind = "stop" if name in self.ending else "zero"
            stopped = name if kind == "stop" else stopped
            self.events.append(Event(kind, self.t, self.points[-1], mode, mode, name))
        return stopped
