"""Orbits of a Poincare map, with their exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...flow.options import tolerances
from ...flow.saving import Savable
from ...flow.section import Section, sectioned
from ...flow.simulate import simulate
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    FilippovSystem,
    OptionError,
    Parameters,
    is_real,
    periods,
    read_period,
    real,
    require_system,
    whole,
)
from ...result_tables import ResultTable
from .legs import LegFlow, Stretch, carry_leg, stretches
from .saltation import Saltation
from .sensitivity import sensitivity
from .variation import saltation_after

#: Duration of a run that ends at the last return, or by its limits of steps or events.
_ENDLESS = 1e12


@dataclass(frozen=True, eq=False, repr=False)
class PoincareOrbit(Savable, points="m n", t="m"):
    """Successive returns to a section.

    Attributes
    ----------
    points : ndarray (m, n)
        States on the section; fewer than ``count`` if the run ended early.
    t : ndarray (m,)
        Their times.
    run : Trajectory
        The run, with the status STOPPED after the last return.
    section : Section
        The section.
    """

    points: Array
    t: Array
    run: Trajectory
    section: Section

    def _tables(self) -> dict[str, ResultTable]:
        columns, labels = {"t": self.t, "x": self.points}, {"state": self.run.system.state_names}
        return {"points": ResultTable({"return": len(self.t)}, columns, labels)}

    def jacobian(self, k: int, since: int | None = None) -> Array:
        """Derivative of a return by an earlier one.

        Parameters
        ----------
        k : int
            Number of the return, from 0.
        since : int, optional
            Number of the earlier one, -1 for the start of the run; k - 1 by default.

        Returns
        -------
        ndarray (n, n)
            Derivative of the return map, extended to neighbours of the section along the flow: it has
            an eigenvalue 0 with the flow's direction unless the section is at fixed times.

        Raises
        ------
        OptionError
            Numbers of returns that the run does not have.
        DegenerateError
            The run grazes a surface, or meets two at one instant.
        """
        k = whole(k, "k", least=0)
        since = k - 1 if since is None else whole(since, "since", least=-1)
        if not -1 <= since < k < len(self.t):
            raise OptionError(
                f"k = {k!r} and since = {since!r}, but returns are numbered from 0 to {len(self.t) - 1}. Give "
                "k among them, and since from -1 to k - 1."
            )
        if is_real(self.section.at):
            return self._between_times(k, since)
        return self._between_events(k, since)

    def _between_times(self, k: int, since: int) -> Array:
        run = self.run
        t = float(run.t[0] if since < 0 else self.t[since])
        x = run.x[0] if since < 0 else self.points[since]
        part = simulate(
            run.system, x, float(self.t[k]), t_start=t, parameters=run.parameters, tol=1e-12
        )
        return sensitivity(part, wrt="x0").dx_dx0

    def _between_events(self, k: int, since: int) -> Array:
        run, system, n = self.run, self.run.system, self.run.system.dimension
        parts = stretches(run, driven=True)
        ends = np.array([part.t + part.duration for part in parts])
        last = int(np.argmin(np.abs(ends - self.t[k])))
        first = 0 if since < 0 else int(np.argmin(np.abs(ends - self.t[since])))
        dx = np.eye(system.extended_dimension)
        for j in range(first, last):
            flow, event = self._passage(parts, j)
            if j == first and since >= 0:  # from the section itself
                dx = dx if self.section.after else event.matrix[:, : len(dx)]
            else:
                dx = event.matrix @ (flow.by_start @ dx)
        flow, event = self._passage(parts, last)
        dx = flow.by_start @ dx
        moved = event.time_by_state @ dx
        if not self.section.after:
            return (dx + np.outer(flow.rate, moved))[:n, :n]
        following = parts[last + 1] if last + 1 < len(parts) else None
        if following is None:
            raise OptionError(
                f"k = {k} is the last return, after which the field is not known. Compute one more return."
            )
        rate = carry_leg(following.system, following.leg, following.start, 0.0, following.p).rate
        return (event.matrix @ dx + np.outer(rate, moved))[:n, :n]

    def _passage(self, parts: list[Stretch], j: int) -> tuple[LegFlow, Saltation]:
        """A leg and the event that ends it, with derivatives."""
        run, part = self.run, parts[j]
        flow = carry_leg(part.system, part.leg, part.start, part.duration, part.p)
        following = parts[j + 1] if parts[j + 1 :] else None
        event = saltation_after(run, part, flow, following, None)
        assert event is not None  # all legs up to a return end with an event
        return flow, event

    def __repr__(self) -> str:
        return (
            f"PoincareOrbit({len(self.t)} returns to {self.section.at} in t = {self.run.t[0]:g} .. "
            f"{self.run.t[-1]:g}, {self.run.status})"
        )


def poincare(
    system: FilippovSystem,
    section: Any,
    x0: ArrayLike,
    *,
    count: int,
    direction: int = 1,
    skip: int = 0,
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    max_steps: int = 1_000_000,
    max_events: int = 1_000_000,
) -> PoincareOrbit:
    """Follow a run from section to section.

    Parameters
    ----------
    system : FilippovSystem
        The system to follow.
    section : expression, str, number or Section
        A function of states, parameters and time; a name of a surface, reset or impact, or a kind of
        event; a period. See :class:`Section`.
    x0 : array_like (n,)
        The start; one on the section does not count as a return.
    count : int
        Number of returns.
    direction : {-1, 0, 1}, optional
        Whether an expression or a surface function falls, does either, or rises at a return.
    skip : int, optional
        Number of first returns that are left out.
    t_start, parameters, tol, rtol, atol, max_steps, max_events : optional
        As in :func:`simulate`.

    Returns
    -------
    PoincareOrbit
        The returns to the section, in order.

    Raises
    ------
    DefinitionError
        ``system`` is not a FilippovSystem.
    PointError
        A start of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        An unknown name of a section; a direction or a number of returns out of its range.
    NotSmoothError
        A section with a kink or a jump.

    Examples
    --------
    Returns of a spiral whose radius shrinks by $exp(-2 pi/10)$ each turn:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> spiral = ns.FilippovSystem([x, y], field=[-x / 10 - y, x - y / 10])
    >>> returns = ns.orbit.poincare(spiral, y, [1.0, 0.0], count=3)
    >>> (returns.points[:, 0] * ca.exp(2 * ca.pi / 10 * ca.DM([1, 2, 3]))).T
    DM([[1, 1, 1]])
    >>> returns.jacobian(2)[0, 0].round(9), returns.points[2, 0] / returns.points[1, 0].round(9)
    (np.float64(0.533488091), np.float64(0.53348809...))
    """
    require_system(system, sets=True, complementarity=True, joints=True)
    count, t_start = whole(count, "count"), real(t_start, "t_start")
    if isinstance(section, Section):
        target = replace(section, count=count, skip=section.skip + whole(skip, "skip", least=0))
    else:
        target = _section(system, section, direction, skip, count)
    t_end = t_start + _ENDLESS
    period = None if isinstance(target.at, str) else read_period(system, target.at)
    if period is not None:
        length = float(periods(period, system.parameter_vector(parameters)))
        target = replace(target, at=length, direction=0)
        t_end = t_start + length * (target.skip + target.every * count + 0.5)
    system, target = sectioned(system, target)
    rtol, atol = tolerances(tol, rtol, atol)
    run = simulate(
        system,
        x0,
        t_end,
        t_start=t_start,
        parameters=parameters,
        rtol=rtol,
        atol=atol,
        max_steps=max_steps,
        max_events=max_events,
        at=target,
    )
    assert run.sample_t is not None and run.sample_x is not None
    reached = np.isfinite(run.sample_t)
    return PoincareOrbit(run.sample_x[reached], run.sample_t[reached], run, target)


def _section(
    system: FilippovSystem, section: Any, direction: int, skip: int, count: int
) -> Section:
    named = isinstance(section, str) and section not in system.surface_names
    undirected = is_real(section) or named
    return Section(section, 0 if undirected else direction, skip=skip, count=count)
