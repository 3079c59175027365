"""Forward-reachable sets of points at which solutions are not unique.

In repelling sliding a motion can leave to either side at once, or slide on and leave later; at a
two-fold it can do the same along the canards that continue into repelling sliding. Each choice is one
solution in Filippov's sense. A funnel samples them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ...flow.concatenation import join, until
from ...flow.options import Tolerances, tolerances
from ...flow.simulate import simulate
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...local import TwoFold, find_two_fold
from ...local.point.surface_point import LocalSurface, Numbers, surface_at
from ...model import (
    Array,
    FilippovSystem,
    OptionError,
    Parameters,
    PointError,
    Surfaces,
    real,
    real_array,
    require_system,
)
from ...result_tables import ResultTable, Tabular, joined, stacked
from .canards import Path, Slider, paths_from


@dataclass(frozen=True)
class Departure:
    """How one member of a funnel leaves sliding.

    Attributes
    ----------
    side : {"+", "-", "s"}
        The side to which it leaves; ``s`` slides to the end of the sliding region.
    t : float
        The time at which it leaves.
    path : int
        Number of the sliding orbit that it leaves; -1 for none.
    """

    side: str
    t: float
    path: int

    def __str__(self) -> str:
        along = f" from path {self.path}" if self.path >= 0 else ""
        if self.side == "s":
            return f"slides along path {self.path} until t = {self.t:.6g}"
        return f"leaves to {self.side}{along} at t = {self.t:.6g}"


@dataclass(frozen=True, repr=False)
class Funnel(Tabular):
    """Samples of a forward-reachable set: call it with a time to get the set of states there.

    Attributes
    ----------
    system : FilippovSystem
        The system.
    t : float
        Time at which forward uniqueness fails.
    point : ndarray (n,)
        State at which it fails.
    cause : str
        Why it fails, such as ``"repelling sliding of h0"``.
    two_fold : TwoFold or None
        The two-fold at which the set begins, if any.
    trajectories : tuple of Trajectory
        Members, from ``point``. One that reaches another point of non-uniqueness ends there, with
        status NON_UNIQUE.
    departures : tuple of Departure
        How each of them leaves sliding.
    past : Trajectory or None
        The motion up to ``point``.
    """

    system: FilippovSystem
    t: float
    point: Array
    cause: str
    trajectories: tuple[Trajectory, ...]
    departures: tuple[Departure, ...]
    two_fold: TwoFold | None = None
    past: Trajectory | None = field(default=None)

    def _tables(self) -> dict[str, ResultTable]:
        parts = [{"t": run.t, "x": run.x} for run in self.trajectories]
        members = {"run": len(self.departures)}
        return {
            "points": joined("number", parts, self.system.state_names),
            "departures": stacked(self.departures, members),
        }

    def __len__(self) -> int:
        return len(self.trajectories)

    def __call__(self, t: ArrayLike) -> Array:
        """Evaluate all members."""
        times = real_array(t, "time")
        result = np.full((len(self), *times.shape, self.point.size), np.nan)
        before = times < self.t
        if before.any():
            if self.past is None:
                raise PointError(
                    f"time {times.min():g} is before the start of the funnel. Give times from {self.t:g} on."
                )
            result[:, before] = self.past(np.minimum(times[before], self.past.t[-1]))
        for row, run in zip(result, self.trajectories, strict=True):
            alive = ~before & (times <= run.t[-1])
            row[alive] = run(times[alive])
        return result

    @property
    def first_up(self) -> Trajectory | None:
        """The first member that leaves to +, a bounding curve; None if none does."""
        return self._first("+")

    @property
    def first_down(self) -> Trajectory | None:
        """The first member that leaves to -, a bounding curve; None if none does."""
        return self._first("-")

    @property
    def longest(self) -> Trajectory | None:
        """The member that slides longest; None if none slides."""
        sliding = [(d.t, k) for k, d in enumerate(self.departures) if d.side == "s"]
        return self.trajectories[max(sliding)[1]] if sliding else None

    def _first(self, side: str) -> Trajectory | None:
        leaving = [(d.t, k) for k, d in enumerate(self.departures) if d.side == side]
        return self.trajectories[min(leaving)[1]] if leaving else None

    def __repr__(self) -> str:
        sides = [d.side for d in self.departures]
        counts = ", ".join(f"{sides.count(c)} {c}" for c in "+-s" if c in sides)
        return f"Funnel({self.cause} at t = {self.t:g}, {len(self)} members: {counts})"


_ANGLE = 1e-8  # of a field that counts as tangent to the surface


def funnel(
    start: FilippovSystem | Trajectory,
    point: ArrayLike | None = None,
    t_end: float | None = None,
    *,
    samples: int = 33,
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
) -> Funnel:
    """Sample the forward-reachable set of a point where uniqueness fails.

    Parameters
    ----------
    start : FilippovSystem or Trajectory
        A system, or a run that ended with NON_UNIQUE, which is continued.
    point : array_like (n,)
        With a system: a start in repelling sliding or at a two-fold, or one from which the motion
        gets there. Not with a trajectory.
    t_end : float
        Final time of all members.
    samples : int, optional
        Approximate number of members, at least 3. Times of leaving are spread evenly over each sliding
        orbit; where a sector of sliding orbits leaves a two-fold, directions within it too.
    t_start, parameters, tol, rtol, atol : optional
        As in :func:`simulate`. A trajectory has its own time and parameters.

    Returns
    -------
    Funnel
        Sampled motions, and how each of them leaves.

    Raises
    ------
    PointError
        The motion is unique until ``t_end``, or the point is on several surfaces or has hidden
        dynamics.
    DegenerateError
        A two-fold that is not generic.
    OptionError
        Fewer than three samples, or a time out of its range.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    DefinitionError
        ``start`` is neither a system nor a run, or has vector multipliers.

    Notes
    -----
    Members leave repelling sliding up or down at a sampled time, or slide on until their region
    ends. At a two-fold they leave at once along a field whose fold is visible there, or slide out
    along canards and faux canards (``nonsmooth/orbit/manifolds/canards.py``); from a Teixeira singularity
    (II-C) also flights along the diabolo lines start, which are not sampled.

    Source: Filippov 1988, sec. 10 (uniqueness) and 19 (two-folds); Colombo & Jeffrey 2011.

    Examples
    --------
    Orbits of $x' = sgn x$ from 0 fill $abs(x) <= t$:

    >>> import casadi as ca, nonsmooth as ns
    >>> x = ca.SX.sym("x")
    >>> system = ns.FilippovSystem([x], surface=x, above=[1], below=[-1])
    >>> reached = ns.orbit.funnel(system, [0.0], 2.0, samples=5)
    >>> reached
    Funnel(repelling sliding of h0 at t = 0, 5 members: 2 +, 2 -, 1 s)
    >>> reached(1.5)[:, 0]
    array([ 1.5,  0.5, -1.5, -0.5,  0. ])
    >>> print(reached.departures[1])
    leaves to + from path 0 at t = 1
    """
    if isinstance(samples, bool) or not isinstance(samples, (int, np.integer)) or samples < 3:
        raise OptionError(
            f"samples={samples!r} is no integer of at least 3. Give one for each way to leave: up, down, "
            "sliding."
        )
    chosen = tolerances(tol, rtol, atol)
    past = _past(start, point, t_end, t_start, parameters, chosen)
    assert t_end is not None
    return _Sampler(past, float(t_end), int(samples), chosen).run()


def _past(
    start: FilippovSystem | Trajectory,
    point: ArrayLike | None,
    t_end: float | None,
    t_start: float,
    parameters: Parameters | None,
    tolerances: Tolerances,
) -> Trajectory:
    """The run up to the point at which uniqueness fails."""
    if t_end is None:
        raise OptionError("t_end is missing. Give the final time of the funnel.")
    t_end = real(t_end, "t_end")
    if isinstance(start, Trajectory):
        if point is not None or parameters is not None:
            raise OptionError(
                "point and parameters do not go with a trajectory, which has its own. Drop them."
            )
        if not t_end > start.t[-1]:
            raise OptionError(
                f"t_end = {t_end!r} is not after the end of the trajectory. Give a time after "
                f"{start.t[-1]:g}."
            )
        past = start
        require_system(past.system)
    else:
        require_system(start)
        if point is None:
            raise OptionError(
                "point is missing. Give a start, or a trajectory that ended NON_UNIQUE."
            )
        past = simulate(
            start,
            point,
            t_end,
            t_start=t_start,
            parameters=parameters,
            rtol=tolerances.rtol,
            atol=tolerances.atol,
        )
    if past.status is not Status.NON_UNIQUE:
        raise PointError(
            f"funnel: the motion is unique until t = {past.t[-1]:g} ({past.status}, itinerary "
            f"{past.itinerary!r}). Start in repelling sliding or at a two-fold, or raise t_end."
        )
    return past


class _Sampler:
    """Computes the members of one funnel."""

    def __init__(self, past: Trajectory, t_end: float, samples: int, tolerances: Tolerances):
        self.system, self.past = past.system, past
        self.t, self.t_end, self.samples = float(past.t[-1]), t_end, samples
        self.tolerances = tolerances
        self.x = self.system.extended_point(past.x[-1], self.t)
        self.surfaces = Surfaces(self.system)
        self.where = self._surface()
        self.slider = Slider(self.where, self.surfaces, t_end, tolerances)
        self.members: list[Trajectory] = []
        self.departures: list[Departure] = []

    def run(self) -> Funnel:
        numbers = self.where.finite_at(self.x)
        fold: TwoFold | None = None
        if np.all(np.abs(numbers.angles) <= _ANGLE):
            cause = f"two-fold of h{self.where.surface}"
            if self.system.dimension > 2:
                fold = self._two_fold()
                cause = f"two-fold {fold.label} of h{self.where.surface}"
                self.x = self.system.extended_point(fold.point, self.t)
            self._leave_two_fold(self.where.at(self.x).second)
        else:
            self._require_repelling(numbers)
            cause = f"repelling sliding of h{self.where.surface}"
            path = Path(self.slider.path(self.x, self.t), True)
            self._leave_paths([path], self.samples, at_once=True)
        if not self.members:
            raise PointError(
                f"funnel: no motion from the {cause} at {self.x.tolist()} can be sampled. From an invisible "
                "two-fold without canards it crosses from side to side: simulate from beside it."
            )
        return Funnel(
            system=self.system,
            t=self.t,
            point=self.x[: self.system.dimension].copy(),
            cause=cause,
            trajectories=tuple(self.members),
            departures=tuple(self.departures),
            two_fold=fold,
            past=self.past if len(self.past.t) > 1 else None,
        )

    def _surface(self) -> LocalSurface:
        """The one surface through the point."""
        parameters = self.past.parameters
        p = self.system.parameter_vector(parameters)
        h, gradient = self.surfaces.values(self.x, p)
        scale = np.abs(gradient) @ (1.0 + np.abs(self.x))
        active = np.flatnonzero(np.abs(h) <= 1e-12 * scale)
        if len(active) != 1 or self.system.nonlinear[active[0]]:
            kind = (
                "hidden dynamics there"
                if len(active) == 1
                else f"{len(active)} surfaces through it ({', '.join(f'h{i}' for i in active)})"
            )
            raise PointError(
                f"point {self.x.tolist()} has {kind}. Choose a continuation with simulate(start_mode=...)."
            )
        n = self.system.dimension
        where, _ = surface_at(self.system, self.x[:n], parameters, self.t, int(active[0]))
        return where

    def _two_fold(self) -> TwoFold:
        n = self.system.dimension
        return find_two_fold(
            self.system,
            self.x[:n],
            parameters=self.past.parameters,
            t=self.t,
            surface=self.where.surface,
            mode=self.where.mode,
        )

    def _require_repelling(self, numbers: Numbers) -> None:
        above, below = numbers.angles
        if not (above >= -_ANGLE and below <= _ANGLE):
            raise PointError(
                f"point {self.x.tolist()} has L1 = {numbers.lie[0]:.6g} and L2 = {numbers.lie[1]:.6g}: "
                f"neither repelling sliding nor a generic two-fold ({self.past.message}) Choose a "
                "continuation with simulate(start_mode=...)."
            )

    def _leave_two_fold(self, second: dict[str, float]) -> None:
        """Add members that leave at once to visible sides, and from every outgoing sliding orbit."""
        for side, visible in (("+", second["L11"] > 0.0), ("-", second["L22"] < 0.0)):
            if visible:
                self._add([], self.x, self.t, side, -1)
        left = max(self.samples - len(self.members), 1)
        paths = paths_from(self.x, self.t, self.slider, left)
        self._leave_paths(paths, left, at_once=False)

    def _leave_paths(self, paths: list[Path], samples: int, at_once: bool) -> None:
        open_ones = sum(p.repelling for p in paths)
        each = max(1, (samples - len(paths)) // (2 * open_ones)) if open_ones else 0
        for number, path in enumerate(paths):
            if path.repelling:
                self._leave_path(path, number, each, at_once)
            self._slide_on(path, number)

    def _leave_path(self, path: Path, number: int, count: int, at_once: bool) -> None:
        for side in "+-":
            for t in _times(path.run, count, at_once):
                pieces = [until(path.run, t)] if t > path.run.t[0] else []
                x = self.system.extended_point(path.run(t), t)
                self._add(pieces, x, t, side, number)

    def _slide_on(self, path: Path, number: int) -> None:
        end = float(path.run.t[-1])
        pieces = [path.run]
        if end < self.t_end and self._may_go_on(path.run):
            pieces.append(self._simulate(self.system.extended_point(path.run.x[-1], end), end))
        self.members.append(join(pieces))
        self.departures.append(Departure("s", end, number))

    def _may_go_on(self, run: Trajectory) -> bool:
        """Whether the path ended at a fold or another surface, not at a stop, reset or failure."""
        name = run.events[-1].name if run.events else ""
        return run.status is Status.STOPPED and name not in dict(
            run.system.stops + run.system.resets
        )

    def _add(self, before: list[Trajectory], x: Array, t: float, side: str, number: int) -> None:
        run = self._simulate(x, t, self.where.side(side))
        self.members.append(join([*before, run]))
        self.departures.append(Departure(side, t, number))

    def _simulate(self, x: Array, t: float, mode: str | None = None) -> Trajectory:
        return simulate(
            self.system,
            self.slider.on(x)[: self.system.dimension],
            self.t_end,
            t_start=t,
            parameters=self.past.parameters,
            rtol=self.tolerances.rtol,
            atol=self.tolerances.atol,
            start_mode=mode,
        )


def _times(run: Trajectory, count: int, at_once: bool) -> Iterator[float]:
    """Times of leaving, without the end of the path and with its start only if ``at_once``."""
    start, end = float(run.t[0]), float(run.t[-1])
    for k in range(count):
        part = k / count if at_once else (k + 1) / (count + 1)
        yield start + part * (end - start)
