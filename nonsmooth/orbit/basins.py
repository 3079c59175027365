"""Basins of attraction, and the attractors that recurrences show.

Runs are sampled on a section (events, a period, or times), in rounds. A few runs over the whole time
show the attractors; every start is followed until all samples of a round are near one of them. Starts
that are near none after the whole time may show further attractors.

Source: Datseris & Wagemakers 2022 (Chaos 32, 023104), with samples at events instead of time steps and
distances instead of cells.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..flow.ensembles.ensemble import ensemble
from ..flow.ensembles.work import Work, checked_work
from ..flow.options import Tolerances, tolerances
from ..flow.saving import Savable, savable
from ..flow.section import Section
from ..flow.status import Status
from ..model import (
    Array,
    FilippovSystem,
    OptionError,
    Parameters,
    PointError,
    periods,
    read_period,
    real,
    real_array,
    require_system,
    whole,
)

#: Labels of starts that go to no attractor.
UNDECIDED, NON_UNIQUE, ACCUMULATION, STOPPED, FAILED = 0, -1, -2, -3, -4

#: Number of starts that are simulated over the whole time to find attractors.
_SEEDS = 48

#: Factor by which their samples are denser where they are taken at times: there a cycle is a curve.
_DENSE = 8

#: Number of searches for further attractors among the undecided runs.
_FURTHER = 4

#: Starts that are compared with an attractor in one call, during which Ctrl-C waits.
_ROWS = 4096


@savable(points="* n")
@dataclass(frozen=True, eq=False, repr=False)
class Attractor:
    """An attractor, as points of it.

    Attributes
    ----------
    points : ndarray (m, n)
        States on the section (or at times): one for an equilibrium or an orbit of period one.
    """

    points: Array

    def __repr__(self) -> str:
        middle = ", ".join(f"{v:.6g}" for v in self.points.mean(axis=0))
        return f"Attractor({len(self.points)} points about ({middle}))"


class Search:
    """Attractors and labels from runs that are simulated in rounds."""

    def __init__(
        self,
        system: FilippovSystem,
        starts: Array,
        *,
        t_start: float,
        t_end: float,
        section: Any,
        near: float,
        samples: int,
        rounds: int,
        parameters: Parameters | None,
        tolerances: Tolerances,
        work: Work,
    ):
        self.system, self.x0 = system, starts
        self.parameters, self.tolerances = parameters, tolerances
        self.work, self.near = work, near
        self.samples, self.t_start, self.begun = samples, t_start, 0
        if not t_end > t_start:
            raise OptionError(
                f"t_end = {t_end} is not after t_start = {t_start}. Give a later time."
            )
        self._read_section(section)
        self.rounds, self.length = rounds, (t_end - t_start) / rounds
        if self.period is not None:
            self.length = self.period * samples
            self.rounds = max(1, int((t_end - t_start) / self.length))
        self._measure(self.x0)
        self.labels = np.zeros(len(self.x0), np.int32)
        self.found: list[Attractor] = []
        self._trees: list[Any] = []

    def _read_section(self, section: Any) -> None:
        self.period: float | None = None
        self.section = (
            section if isinstance(section, Section) or section is None else Section(section)
        )
        if self.section is not None and not isinstance(self.section.at, str):
            function = read_period(self.system, self.section.at)
            if function is not None:
                p = self.system.parameter_vector(self.parameters)
                self.period = float(periods(function, p)) * self.section.every
        if self.system.time_dependent and self.period is None:
            raise OptionError(
                f"section={section!r}, but the system depends on time. Give the period of its forcing."
            )

    def _measure(self, x: Array) -> None:
        """Set the unit of distances and the box beyond which runs are lost, from states (m, n)."""
        finite = x[np.all(np.isfinite(x), axis=1)]
        low, high = finite.min(axis=0), finite.max(axis=0)
        self.scale = np.where(high > low, high - low, 1.0)
        self.box = low - 100 * self.scale, high + 100 * self.scale

    def known(self, points: Array) -> None:
        """Add an attractor, given by points (m, n)."""
        self.found.append(Attractor(points))
        self._trees.append(_tree(points / self.scale))

    def _near(self, sampled: Array) -> NDArray[np.int32]:
        """Number, from 1, of the attractor near all samples (m, K, n) of a run; 0 for none."""
        label = np.zeros(len(sampled), np.int32)
        for k, tree in enumerate(self._trees):
            for first in range(0, len(sampled), _ROWS):
                part = slice(first, first + _ROWS)
                distance, _ = tree.query(sampled[part] / self.scale, p=np.inf)
                label[part][np.all(distance <= self.near, axis=1) & (label[part] == 0)] = k + 1
        return label

    def _recurrent(self, history: Array) -> NDArray[np.int32]:
        """Labels of runs sampled at (m, R, n); one that recurs near no attractor defines a new one."""
        label = np.zeros(len(history), np.int32)
        half = history.shape[1] // 2
        late = slice(-max(1, min(self.samples, half)), None)
        for i, sampled in enumerate(history):
            if not np.all(np.isfinite(sampled)):
                continue
            label[i] = self._near(sampled[None, late])[0]
            if label[i]:
                continue
            settled = sampled[half:]
            label[i] = self._extended(settled)
            if label[i]:
                continue
            quarter = max(1, len(settled) // 4)
            before, after = settled[:-quarter], settled[-quarter:]
            tree = _tree(before / self.scale)
            if len(before) and np.all(tree.query(after / self.scale, p=np.inf)[0] <= self.near):
                self.known(_thinned(settled[::-1], self.scale, self.near / 8))
                label[i] = len(self.found)
        return label

    def _extended(self, points: Array) -> int:
        """Number of the attractor near most of the points, which is extended by them; 0 for none."""
        for k, tree in enumerate(self._trees):
            if np.mean(tree.query(points / self.scale, p=np.inf)[0] <= self.near) > 0.5:
                more = np.vstack([self.found[k].points, points])
                self.found[k] = Attractor(_thinned(more, self.scale, self.near / 8))
                self._trees[k] = _tree(self.found[k].points / self.scale)
                return k + 1
        return 0

    def run(self) -> bool:
        """Find attractors, then label all starts; False if interrupted."""
        try:
            self._seed()
            self._follow()
        except KeyboardInterrupt:
            return False
        return True

    def _seed(self) -> None:
        finite = np.flatnonzero(np.all(np.isfinite(self.x0), axis=1))
        chosen = np.random.default_rng(0).permutation(finite)[:_SEEDS]
        sampled = self._long(self.x0[chosen], self.t_start)
        seen = sampled[np.all(np.isfinite(sampled), axis=2)]
        if len(seen):  # without the outer 5 %: some runs may diverge
            ends = np.quantile(seen, [0.05, 0.95], axis=0)
            self._measure(np.vstack([self.x0, ends]))
            self._trees = [_tree(a.points / self.scale) for a in self.found]
        self._recurrent(sampled)

    def _long(self, x: Array, t: float) -> Array:
        """Samples (m, R, n) of a few runs over the whole time; NaN after an early end."""
        history, ended = list[Array](), np.zeros(len(x), bool)
        for _ in range(self.rounds):
            sampled, x, labels = self._sample(x, t, "seeds", 1 if self.section else _DENSE)
            ended |= labels != UNDECIDED
            sampled[ended] = np.nan
            history.append(sampled)
            t = self._next(t)
        return np.concatenate(history, axis=1)

    def _follow(self) -> None:
        left, x, t = np.arange(len(self.x0)), self.x0, self.t_start
        for _ in range(self.rounds):
            if not len(left):
                return
            sampled, x, labels = self._sample(x, t, "round")
            going = labels == UNDECIDED
            labels[going] = self._near(sampled[going])
            self.labels[left] = labels
            stays = labels == UNDECIDED
            stays &= ~np.any((x < self.box[0]) | (x > self.box[1]), axis=1)
            left, x, sampled, t = left[stays], x[stays], sampled[stays], self._next(t)
        for _ in range(_FURTHER):
            if not len(left):
                return
            label = np.zeros(len(left), np.int32)
            label[:_SEEDS] = self._recurrent(self._long(x[:_SEEDS], t))
            rest = label == UNDECIDED
            label[rest] = self._near(sampled[rest])
            self.labels[left] = label
            if not label.any():
                return
            left, x, sampled = (a[label == UNDECIDED] for a in (left, x, sampled))

    def _next(self, t: float) -> float:
        return t + self.length if self.period is not None else t

    def _sample(
        self, x: Array, t: float, what: str, dense: int = 1
    ) -> tuple[Array, Array, NDArray[np.int32]]:
        """Simulate a round: samples (m, K, n), last states (m, n), labels of the runs that ended."""
        count = self.samples * dense
        view: dict[str, Any] = {"t_eval": t + self.length * np.arange(1, count + 1) / count}
        if self.period is not None:
            view = {"at": Section(self.period)}
        elif self.section is not None:
            view = {"at": replace(self.section, count=self.samples)}
        end = t + self.length * (1 + 1e-9 * (self.period is not None))
        if "t_eval" in view:
            view["t_eval"][-1] = end
        many = ensemble(
            self.system,
            x,
            end,
            t_start=t,
            parameters=dict(self.parameters or {}),
            rtol=self.tolerances.rtol,
            atol=self.tolerances.atol,
            work=self._work(what),
            **view,
        )
        assert many.sample_x is not None
        sampled = many.sample_x
        full = np.all(np.isfinite(sampled[:, -1]), axis=-1)
        missing = np.any(np.isnan(sampled), axis=2)
        sampled = np.where(missing[..., None], many.x[:, None, :], sampled)
        labels = np.full(len(x), UNDECIDED, np.int32)
        labels[(many.status == Status.STOPPED) & ~full] = STOPPED
        labels[many.status == Status.NON_UNIQUE] = NON_UNIQUE
        labels[many.status == Status.ACCUMULATION] = ACCUMULATION
        labels[(labels == UNDECIDED) & ~many.complete] = FAILED
        return sampled, many.x if self.period is None else sampled[:, -1], labels

    def _work(self, what: str) -> Work:
        """The work of one round, with a checkpoint folder of its own."""
        self.begun += 1
        if self.work.store is None:
            return self.work
        folder = Path(self.work.store)
        folder.mkdir(parents=True, exist_ok=True)
        return replace(self.work, store=folder / f"{self.begun:03d}-{what}")


def _thinned(points: Array, scale: Array, least: float) -> Array:
    """Points of which no two are nearer than ``least``, in the order given."""
    kept: list[Array] = []
    for point in points:
        others = np.array(kept).reshape(-1, len(point))
        if not len(others) or np.abs((others - point) / scale).max(axis=1).min() > least:
            kept.append(point)
    return np.array(kept)


def _tree(points: Array) -> Any:
    from scipy.spatial import cKDTree  # here: it is not needed to import the library

    return cKDTree(points)


_NAMES = {
    UNDECIDED: "undecided or lost",
    NON_UNIQUE: "not unique",
    ACCUMULATION: "events accumulate",
    STOPPED: "stopped",
    FAILED: "failed",
}


@dataclass(frozen=True, eq=False, repr=False)
class Basins(Savable, labels="...", starts="... n nan", axes="*"):
    """Which attractor each start goes to.

    Attributes
    ----------
    labels : ndarray of int32 (...)
        From 1: number of the attractor. 0: undecided in the given time, or lost (far away); -1:
        NON_UNIQUE; -2: ACCUMULATION; -3: STOPPED by a stop of the system; -4: any other status.
    attractors : list of Attractor
        ``attractors[k - 1]`` has the label k.
    starts : ndarray (..., n)
        The starts, in the shape of the grid.
    axes : dict of str to ndarray
        The grid's axes by names of states, if it was given so.
    state_names : tuple of str
        Names of the states, in their order on the last axis.
    complete : bool
        False if the computation was interrupted; what was not decided by then has the label 0.
    """

    labels: NDArray[np.int32]
    attractors: list[Attractor]
    starts: Array
    axes: dict[str, Array] = field(default_factory=dict)
    state_names: tuple[str, ...] = ()
    complete: bool = True

    @property
    def fractions(self) -> dict[int, float]:
        """Part of the starts with each label that occurs."""
        found, number = np.unique(self.labels, return_counts=True)
        parts = (number / self.labels.size).tolist()
        return dict(zip(found.tolist(), parts, strict=True))

    @property
    def errors(self) -> dict[int, float]:
        """Standard errors of ``fractions`` where the starts were drawn at random."""
        size = self.labels.size
        return {k: float(np.sqrt(p * (1 - p) / size)) for k, p in self.fractions.items()}

    def name(self, label: int) -> str:
        """Say what a label means.

        Parameters
        ----------
        label : int
            An entry of ``labels``.

        Returns
        -------
        str
            For example ``"attractor 2"`` or ``"undecided"``.
        """
        return _NAMES.get(label, f"attractor {label}")

    def __repr__(self) -> str:
        parts = ", ".join(f"{self.name(k)} {p:.2%}" for k, p in self.fractions.items())
        cut = "" if self.complete else "; interrupted"
        return (
            f"Basins({self.labels.shape} starts, {len(self.attractors)} attractors: {parts}{cut})"
        )


def basins(
    system: FilippovSystem,
    grid: Mapping[str, ArrayLike] | ArrayLike,
    t_end: float,
    *,
    section: Any = None,
    attractors: Sequence[ArrayLike] = (),
    near: float = 0.01,
    samples: int = 16,
    rounds: int = 16,
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-9,
    rtol: float | None = None,
    atol: float | None = None,
    work: Work | None = None,
) -> Basins:
    """Label starts by the attractors that their runs go to.

    Parameters
    ----------
    system : FilippovSystem
        With scalar multipliers; where it depends on time, periodically.
    grid : mapping or array_like (..., n)
        Starts; or for each state, by name, a number or the values (k,) of an axis.
    t_end : float
        Time in which a run has to come to its attractor. Those that are there earlier end earlier.
    section : Section, str, number or expression, optional
        Where runs are sampled: an event, a surface of your own, a period (needed where the system
        depends on time). Without it they are sampled at equal time steps.
    attractors : sequence of array_like (n,) or (m, n), optional
        Points of attractors that are known; others are still found.
    near : float, optional
        Largest distance of a run from the points of its attractor, relative to the extent of the
        starts and runs. It must be less than the distance from an attractor to the boundary of its
        basin.
    samples : int, optional
        Samples in each round, all of which must be near.
    rounds : int, optional
        Rounds into which the time is divided; one should be long enough for a few returns.
    t_start, parameters, tol, rtol, atol : optional
        As in :func:`simulate`; parameters are numbers.
    work : Work, optional
        Threads or executor, progress bars, and a store: after an interruption the same call
        goes on from there.

    Returns
    -------
    Basins
        Ctrl-C ends with what was decided.

    Raises
    ------
    DefinitionError
        ``system`` is not a FilippovSystem, or has vector multipliers.
    OptionError
        A time, a number of samples or rounds or a section out of its range; no period, though the
        system depends on time.
    PointError
        Starts or attractors of a wrong shape or not finite, or no starts.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.

    Examples
    --------
    A mass between two springs that pull it to -1 and to 1, with friction:

    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> well = ns.FilippovSystem(
    ...     [x, v], surface=x, above=[v, 1 - x - 0.3 * v], below=[v, -1 - x - 0.3 * v])
    >>> found = ns.basins(well, {"x": np.linspace(-3, 3, 13), "v": 0.0}, t_end=100.0)
    >>> [a.points[0].round(3).tolist() for a in found.attractors], found.labels.tolist()
    ([[1.0, 0.0], [-1.0, -0.0]], [1, 2, 2, 2, 2, 2, -1, 1, 1, 1, 1, 1, 2])

    From rest on the edge, $x = 0$, two motions are possible: the label -1.
    """
    require_system(system, complementarity=True)
    starts, axes = _starts(system, grid)
    _require_finite(starts)
    search = Search(
        system,
        starts.reshape(-1, system.dimension),
        t_start=real(t_start, "t_start"),
        t_end=real(t_end, "t_end"),
        section=section,
        near=real(near, "near", expected="a number from 0 to 1", low=1e-12, high=1.0),
        samples=whole(samples, "samples"),
        rounds=whole(rounds, "rounds"),
        parameters=parameters,
        tolerances=tolerances(tol, rtol, atol),
        work=checked_work(work),
    )
    for points in _listed(system, attractors):
        search.known(points)
    complete = search.run()
    labels = search.labels.reshape(starts.shape[:-1])
    return Basins(labels, search.found, starts, axes, system.state_names, complete)


def _listed(system: FilippovSystem, attractors: Sequence[ArrayLike]) -> list[Array]:
    """Points (m, n) of the given attractors."""
    n = system.dimension
    try:
        found = [np.atleast_2d(real_array(points, "attractors")) for points in attractors]
    except TypeError:  # not a sequence
        found = [np.zeros((0, 0))]
    for points in found:
        if points.ndim != 2 or points.shape[1] != n or not np.isfinite(points).all():
            raise PointError(
                f"attractors={attractors!r}, but each attractor needs finite points of shape (m, {n}). "
                "For example attractors=[[0.0, 1.0], [2.0, 0.0]] are two, of one point each."
            )
    return found


def _require_finite(starts: Array) -> None:
    """Raise if starts (..., n) are empty or not finite."""
    rows = starts.reshape(-1, starts.shape[-1])
    wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(rows) and not wrong.size:
        return
    if not wrong.size:
        raise PointError("grid has no starts. Give at least one.")
    raise PointError(
        f"grid has {wrong.size} of {len(rows)} starts that are not finite, first "
        f"{rows[wrong[0]].tolist()}. Leave them out; a list (m, n) gives a part of a grid."
    )


def _starts(
    system: FilippovSystem, grid: Mapping[str, ArrayLike] | ArrayLike
) -> tuple[Array, dict[str, Array]]:
    """Starts (..., n) and the axes by name."""
    names = system.state_names
    if not isinstance(grid, Mapping):
        starts = real_array(grid, "grid")
        if starts.ndim == 0 or starts.shape[-1] != len(names):
            raise PointError(
                f"grid has shape {starts.shape}, but the system has {len(names)} states. Give an array "
                f"(..., {len(names)}) or a mapping of the states {list(names)}."
            )
        return starts, {}
    given = {str(k): real_array(v, f"grid {k}") for k, v in grid.items()}
    shapes = {k: v.shape for k, v in given.items()}
    if set(given) != set(names) or any(v.ndim > 1 for v in given.values()):
        raise PointError(
            f"grid has the shapes {shapes}, but needs a number or an "
            f"axis (k,) for each of the states {list(names)}."
        )
    axes = {name: given[name] for name in names if given[name].ndim}
    mesh = np.meshgrid(*axes.values(), indexing="ij") if axes else []
    shape = mesh[0].shape if mesh else ()
    columns = dict(zip(axes, mesh, strict=True))
    whole_grid = [np.broadcast_to(columns.get(n, given[n]), shape) for n in names]
    return np.stack(whole_grid, axis=-1), axes
