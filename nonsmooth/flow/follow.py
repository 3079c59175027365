"""The smooth flow of one mode, forward or backward in time, with its event functions.

Manifolds and dividing surfaces are computed with it. The mode never changes, so the backward flow is a smooth
problem too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..model import (
    Array,
    Coupled,
    FilippovSystem,
    Guard,
    OptionError,
    Parameters,
    Surfaces,
    followed,
    motion,
    real,
    require_system,
    watched_functions,
)
from . import messages
from .names import guard_name
from .options import Options, tolerances
from .reference.coupled_modes import CoupledModes
from .reference.modes import Expansion, Modes, SeparateModes, powers
from .reference.polynomial import first_crossing
from .reference.record import Record
from .reference.stepper import Hit, Stepper
from .status import Status
from .trajectory import Segment, Trajectory


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
        With scalar multipliers.
    point : array_like (n,)
        Where the orbit starts.
    t_end : float
        Final time; before ``t_start`` the flow is followed backward.
    mode : str
        One letter per surface. With ``s`` the sliding field is followed on the level of h through
        the point.
    until : str, expression, or sequence of them, optional
        End at a zero of these: names of the mode's own event functions (``"h0"``,
        ``"lambda0 = 1"``, ``"lambda0 = -1"``, names of stops and resets) or expressions in states,
        parameters and time. A zero at the start is not counted.
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
    DefinitionError
        ``system`` is none, or has vector multipliers; a ``mode`` that it does not have.
    PointError
        A point of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        A tolerance, a limit or a time out of its range; an unknown name in ``until``.
    NotSmoothError
        A watched expression with a kink or a jump.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[1, 1])
    >>> run = ns.flow.follow(system, [2.0, 0.0], -10.0, mode="+", until="h0")
    >>> run.status.name, run.x[-1].round(12) + 0.0
    ('STOPPED', array([-2.,  0.]))
    """
    require_system(system)
    t_start, t_end = real(t_start, "t_start"), real(t_end, "t_end")
    rtol, atol = tolerances(tol, rtol, atol)
    options = Options(
        t_end=max(t_end, t_start),
        t_start=min(t_end, t_start),
        rtol=rtol,
        atol=atol,
        max_step=max_step,
        max_steps=max_steps,
    )
    ends, further = _several(until), _several(watch)
    expressions = [u for u in ends if not isinstance(u, str)] + further
    p = system.parameter_vector(parameters)
    chosen = _chosen(system, mode, expressions, p, options)
    names = [guard_name(system, g) for g in chosen.guards]
    ending = {f"f{k}" for k in range(sum(not isinstance(u, str) for u in ends))}
    for name in (u for u in ends if isinstance(u, str)):
        if name not in names:
            raise OptionError(
                f"until has {name!r}, which is no event function. Give a name among {names} or an "
                "expression."
            )
        ending.add(name)
    x = system.extended_point(point, t_start)
    return _Follower(system, chosen, x, p, options, t_start, t_end, ending).run()


def _several(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple)) else [value]


@dataclass(frozen=True)
class _Chosen:
    """The mode that is followed, with its guards."""

    mode: str
    modes: Modes
    sliding: list[int]
    guards: tuple[Guard, ...]


def _chosen(
    system: FilippovSystem, mode: str, watched: Sequence[Any], p: Array, options: Options
) -> _Chosen:
    signs = system.parse_mode(mode)
    sliding = [i for i, sign in enumerate(signs) if sign == 0]
    if len(sliding) > 1 or any(system.nonlinear[i] for i in sliding):
        coupled = Coupled(system, watched_functions(system, watched))
        guards = coupled.guards(mode)
        zeros = tuple(Guard("zero", k, 0, k) for k in range(len(guards)))
        modes: Modes = CoupledModes(system, coupled, p, options, lambda m: zeros)
        return _Chosen(mode, modes, sliding, guards)
    only_watched = followed(system, mode, watched)
    further = [Guard("zero", k, 0, k) for k in range(len(watched))]
    guards = (*motion(system, mode).guards, *further)
    modes = SeparateModes(system, p, options, lambda s, m: only_watched)
    return _Chosen(mode, modes, sliding, guards)


class _Follower:
    """One run of :func:`follow`; time runs as ``sign`` times a forward variable."""

    def __init__(
        self,
        system: FilippovSystem,
        chosen: _Chosen,
        x: Array,
        p: Array,
        options: Options,
        t_start: float,
        t_end: float,
        ending: set[str],
    ):
        self.system, self.p, self.options = system, p, options
        self.mode, self.modes, self.sliding = chosen.mode, chosen.modes, chosen.sliding
        self.guards = chosen.guards
        self.stepper = Stepper(system, self.modes, options)
        self.surfaces = Surfaces(system)
        self.unknowns = np.zeros(system.surface_count)  # multipliers of the sliding surfaces
        self.x, self.t, self.t_end, self.ending = x, t_start, t_end, ending
        self.sign = -1.0 if t_end < t_start else 1.0
        self.levels = self.surfaces.values(x, p)[0][self.sliding]
        self.record = Record(system, p)
        self.record.point(t_start, x)
        # functions that are zero at the start of the step, and how many coefficients vanish
        self.fresh = dict.fromkeys(range(len(self.guards)), 0)

    def run(self) -> Trajectory:
        solutions = self.modes.solutions(self.mode, self.x, stable_only=False)
        if len(solutions) == 1:
            self.unknowns = solutions[0]
            status, message = self._loop()
        else:
            message = messages.start_solutions(self.mode, len(solutions))
            status = Status.NON_UNIQUE
        mode, record = self.mode, self.record
        if status is not Status.STOPPED:
            record.event("end", self.t, self.x, mode, mode, None, str(status))
        record.segments.append(Segment(mode, record.t[0], self.t, 0, len(record.starts)))
        return record.trajectory(status, message)

    def _loop(self) -> tuple[Status, str]:
        while True:
            left = abs(self.t_end - self.t)
            if left == 0.0:
                return Status.REACHED_END, f"t = {self.t_end:g} reached."
            if len(self.record.starts) >= self.options.max_steps:
                return Status.TOO_MANY_STEPS, messages.too_many("steps", self.options.max_steps)
            e = self._expand()
            if not np.all(np.isfinite(e.states)):
                if self._leave_singular_point(e, left):
                    continue
                return Status.NOT_FINITE, messages.field_not_finite(self.mode, self.x.tolist())
            find = partial(self._zeros, e)
            plan = self.stepper.plan(e, left, self.options.max_step, self.t, find, self.sign)
            if plan.fault:
                return Status.STEP_TOO_SMALL, plan.fault
            if not self._advance(e, plan.dt):
                return Status.NOT_FINITE, messages.state_not_finite(self.t)
            if plan.last:
                self.t = self.record.t[-1] = self.t_end
            found = [hit.number for hit in plan.hits if hit.dt <= plan.dt + self._blur()]
            self.fresh = dict.fromkeys(found, 1)
            stopped = self._report(found)
            if stopped:
                return Status.STOPPED, messages.stopped(stopped, self.t)

    def _blur(self) -> float:
        """Largest distance in time between simultaneous zeros."""
        return 1e-14 * max(1.0, abs(self.t))

    def _expand(self) -> Expansion:
        e = self.stepper.expand(self.mode, self.x, self.unknowns)
        if self.sign > 0:
            return e
        flip = self.sign ** np.arange(e.states.shape[1])
        return replace(
            e, states=e.states * flip, guards=e.guards * flip, unknowns=e.unknowns * flip
        )

    def _leave_singular_point(self, e: Expansion, left: float) -> bool:
        """Take a short step where high derivatives do not exist; forward only."""
        if self.sign < 0:
            return False
        coefficients, h = self.stepper.singular_step(e, min(left, self.options.max_step))
        return h > 0.0 and self._advance(replace(e, states=coefficients, finite=True), h)

    def _zeros(self, e: Expansion, h: float) -> list[Hit]:
        hits = []
        for row, guard in enumerate(self.modes.guards(self.mode)):
            c = e.guards[row]
            if not np.all(np.isfinite(c)):
                continue
            drop = self.stepper.leading(e, row, self.fresh[row])[0] if row in self.fresh else 0
            dt = first_crossing(c[drop:].tolist(), h, 0)
            if dt is not None:
                hits.append(Hit(dt, row, guard))
        return hits

    def _advance(self, e: Expansion, dt: float) -> bool:
        x = self.stepper.advance(e, dt)
        if not np.all(np.isfinite(x)):
            return False
        flip = self.sign ** np.arange(e.states.shape[1])
        self.record.step(self.t, e.states * flip)
        self.t += self.sign * dt
        if self.system.time_dependent:
            x[-1] = self.t
        if self.sliding:
            x = self.surfaces.project(x, self.p, self.sliding, self.levels)
            if e.unknowns.size:
                ahead = e.unknowns @ powers(dt, e.unknowns.shape[1])
                self.unknowns = self.modes.improve(self.mode, x, ahead)
        self.x = x
        self.record.point(self.t, x)
        return True

    def _report(self, rows: list[int]) -> str | None:
        stopped, mode = None, self.mode
        for row in rows:
            name = guard_name(self.system, self.guards[row])
            kind = "stop" if name in self.ending else "zero"
            stopped = name if kind == "stop" else stopped
            self.record.event(kind, self.t, self.x, mode, mode, self.guards[row])
        return stopped
