"""Attractors found by runs that come back, and starts labelled by staying beside them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..flow.ensembles.ensemble import ensemble
from ..flow.ensembles.work import Work
from ..flow.options import Tolerances
from ..flow.saving import savable
from ..flow.section import Section
from ..flow.status import Status
from ..model import Array, FilippovSystem, OptionError, Parameters, PointError, periods, read_period

#: Labels that are no attractors.
UNDECIDED, NON_UNIQUE, ACCUMULATION, STOPPED, FAILED = 0, -1, -2, -3, -4

#: Starts that are run over the whole time to find attractors.
_SEEDS = 48

#: Looks at them are so many times as dense where they are at times, because cycles are curves there.
_DENSE = 8

#: So many times the runs that are left over after the whole time may show further attractors.
_FURTHER = 4


@savable(points="* n")
@dataclass(frozen=True, eq=False, repr=False)
class Attractor:
    """What runs come back to.

    Attributes
    ----------
    points : ndarray (m, n)
        States on the section (or at times): one for an equilibrium or a periodic orbit met once.
    """

    points: Array

    def __repr__(self) -> str:
        middle = ", ".join(f"{v:.6g}" for v in self.points.mean(axis=0))
        return f"Attractor({len(self.points)} points about ({middle}))"


class Search:
    """Runs in rounds, and the attractors that they show."""

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
            raise OptionError(f"t_end: expected a time after {t_start}, received {t_end}.")
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
                "section: expected the period of a system that depends on time, received "
                f"{section!r}. At other sections its runs would come back at different phases."
            )

    def _measure(self, x: Array) -> None:
        """Take the extent of states (m, n): the unit of distances, and a box that is far away."""
        finite = x[np.all(np.isfinite(x), axis=1)]
        low, high = finite.min(axis=0), finite.max(axis=0)
        self.scale = np.where(high > low, high - low, 1.0)
        self.box = low - 100 * self.scale, high + 100 * self.scale

    # attractors ----------------------------------------------------------------------------------

    def known(self, points: Array) -> None:
        """Take the points (m, n) of an attractor."""
        if points.shape[1] != self.system.dimension:
            raise PointError(
                f"attractors: expected points (m, {self.system.dimension}), received {points.shape}."
            )
        self.found.append(Attractor(points))
        self._trees.append(_tree(points / self.scale))

    def _beside(self, looks: Array) -> NDArray[np.int32]:
        """Attractor beside which all looks (m, K, n) are, from 1; 0 where there is none."""
        label = np.zeros(len(looks), np.int32)
        for k, tree in enumerate(self._trees):
            distance, _ = tree.query(looks / self.scale, p=np.inf)
            label[np.all(distance <= self.near, axis=1) & (label == 0)] = k + 1
        return label

    def _learn(self, history: Array) -> NDArray[np.int32]:
        """Labels of runs with looks (m, R, n); those that come back beside no attractor show one."""
        label = np.zeros(len(history), np.int32)
        half = history.shape[1] // 2
        late = slice(-max(1, min(self.samples, half)), None)
        for i, looks in enumerate(history):
            if not np.all(np.isfinite(looks)):
                continue
            label[i] = self._beside(looks[None, late])[0]
            if label[i]:
                continue
            settled = looks[half:]
            label[i] = self._joined(settled)
            if label[i]:
                continue
            quarter = max(1, len(settled) // 4)
            before, after = settled[:-quarter], settled[-quarter:]
            tree = _tree(before / self.scale)
            if len(before) and np.all(tree.query(after / self.scale, p=np.inf)[0] <= self.near):
                self.known(_thinned(settled[::-1], self.scale, self.near / 8))
                label[i] = len(self.found)
        return label

    def _joined(self, points: Array) -> int:
        """Attractor beside which most of the points are, from 1, which gets the others too; or 0."""
        for k, tree in enumerate(self._trees):
            if np.mean(tree.query(points / self.scale, p=np.inf)[0] <= self.near) > 0.5:
                more = np.vstack([self.found[k].points, points])
                self.found[k] = Attractor(_thinned(more, self.scale, self.near / 8))
                self._trees[k] = _tree(self.found[k].points / self.scale)
                return k + 1
        return 0

    # runs ----------------------------------------------------------------------------------------

    def run(self) -> bool:
        """Find attractors, then follow all starts until they are beside one; False if interrupted."""
        try:
            self._seed()
            self._follow()
        except KeyboardInterrupt:
            return False
        return True

    def _seed(self) -> None:
        finite = np.flatnonzero(np.all(np.isfinite(self.x0), axis=1))
        chosen = np.random.default_rng(0).permutation(finite)[:_SEEDS]
        looks = self._long(self.x0[chosen], self.t_start)
        seen = looks[np.all(np.isfinite(looks), axis=2)]
        if len(seen):  # but for a twentieth: some may run away
            ends = np.quantile(seen, [0.05, 0.95], axis=0)
            self._measure(np.vstack([self.x0, ends]))
            self._trees = [_tree(a.points / self.scale) for a in self.found]
        self._learn(looks)

    def _long(self, x: Array, t: float) -> Array:
        """Looks (m, R, n) at a few runs over the whole time; NaN from where one ended otherwise."""
        history, ended = list[Array](), np.zeros(len(x), bool)
        for _ in range(self.rounds):
            looks, x, labels = self._look(x, t, "seeds", 1 if self.section else _DENSE)
            ended |= labels != UNDECIDED
            looks[ended] = np.nan
            history.append(looks)
            t = self._next(t)
        return np.concatenate(history, axis=1)

    def _follow(self) -> None:
        left, x, t = np.arange(len(self.x0)), self.x0, self.t_start
        for _ in range(self.rounds):
            if not len(left):
                return
            looks, x, labels = self._look(x, t, "round")
            going = labels == UNDECIDED
            labels[going] = self._beside(looks[going])
            self.labels[left] = labels
            stays = labels == UNDECIDED
            stays &= ~np.any((x < self.box[0]) | (x > self.box[1]), axis=1)
            left, x, looks, t = left[stays], x[stays], looks[stays], self._next(t)
        for _ in range(_FURTHER):
            if not len(left):
                return
            label = np.zeros(len(left), np.int32)
            label[:_SEEDS] = self._learn(self._long(x[:_SEEDS], t))
            rest = label == UNDECIDED
            label[rest] = self._beside(looks[rest])
            self.labels[left] = label
            if not label.any():
                return
            left, x, looks = (a[label == UNDECIDED] for a in (left, x, looks))

    def _next(self, t: float) -> float:
        return t + self.length if self.period is not None else t

    def _look(
        self, x: Array, t: float, what: str, dense: int = 1
    ) -> tuple[Array, Array, NDArray[np.int32]]:
        """Run a round: looks (m, K, n), last states (m, n), labels of the runs that ended."""
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
        looks = many.sample_x
        full = np.all(np.isfinite(looks[:, -1]), axis=-1)
        missing = np.any(np.isnan(looks), axis=2)
        looks = np.where(missing[..., None], many.x[:, None, :], looks)
        labels = np.full(len(x), UNDECIDED, np.int32)
        labels[(many.status == Status.STOPPED) & ~full] = STOPPED
        labels[many.status == Status.NON_UNIQUE] = NON_UNIQUE
        labels[many.status == Status.ACCUMULATION] = ACCUMULATION
        labels[(labels == UNDECIDED) & ~many.complete] = FAILED
        return looks, many.x if self.period is None else looks[:, -1], labels

    def _work(self, what: str) -> Work:
        """The work of one round: its checkpoint is a folder of its own."""
        self.begun += 1
        if self.work.checkpoint is None:
            return self.work
        folder = Path(self.work.checkpoint)
        folder.mkdir(parents=True, exist_ok=True)
        return replace(self.work, checkpoint=folder / f"{self.begun:03d}-{what}")


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
