"""Attractors and basins of attraction, by returns to a section.

Runs are sampled at returns (events, a period) or, without a section, at times. A run without a label is
integrated again from its start, to twice as many returns. No run restarts at an event, where a reset would be lost.

- Cycles: every p-th return of a run approaches one point. Newton's method on the legs (``periodic_orbit``) gives the
  cycle and its multipliers. Two cycles are the same if their points on the section agree.
- Rest: the run has no more returns, or its samples converge. It is a point if neighbours converge to it; other
  rest points form one set.
- Recurrence: the last quarter of a run stays near its earlier samples, and neighbours do too. Chaotic attractors are
  found so, and cycles without a section.

Source: Datseris & Wagemakers 2022 (Chaos 32, 023104) for the last of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..flow.ensembles.ensemble import ensemble
from ..flow.ensembles.work import Work, checked_work
from ..flow.options import Tolerances, tolerances
from ..flow.saving import Savable, savable
from ..flow.section import Section
from ..flow.simulate import simulate
from ..flow.status import Status
from ..model import (
    Array,
    FilippovSystem,
    NonsmoothError,
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
from ..result_tables import ResultTable, Tabular, joined
from .periodic.find_periodic import periodic_orbit
from .periodic.orbit import PeriodicOrbit

#: Labels of starts without an attractor.
UNDECIDED, NON_UNIQUE, ACCUMULATION, STOPPED, FAILED, INFINITY = 0, -1, -2, -3, -4, -5

#: Number of starts that are first integrated over all returns, to find attractors.
_SEEDS = 48

#: Factor by which their samples are denser where they are taken at times: there a cycle is a curve.
_DENSE = 16

#: Number of searches for further attractors among the undecided runs.
_FURTHER = 4

#: Starts that are compared with an attractor in one call, during which Ctrl-C waits.
_ROWS = 4096

#: States at rest that are compared with what is known in one call.
_TOGETHER = 256

#: Numbers that samples may hold in one call; those of one that come into memory that was used before.
_HELD, _AGAIN = 2**24, 2**21

#: Largest number of returns in a cycle that is recognised before the end of the run.
_LONGEST = 8

#: Distance of neighbours that must converge to a point of rest, in units of ``near``.
_ISOLATED = 0.01

#: Neighbours of a recurrent run; a third must converge to it, as a cycle may attract from one side only.
_BESIDE = 24

#: Distance of these neighbours, in units of ``near``.
_BESIDE_BY = 10.0

#: Relative distance within which points of two attractors are one.
_EQUAL = 1e-6

#: Relative change over a further time below which a run rests.
_STILL = 1e-8


@savable(points="* n", period="nan", multipliers="*")
@dataclass(frozen=True, eq=False, repr=False)
class Attractor(Tabular):
    """An attractor, as points of it.

    Attributes
    ----------
    points : ndarray (m, n)
        States on the section (or at times): one for an equilibrium or an orbit of period one.
    kind : str
        ``"cycle"``; ``"point"``, at which runs rest; ``"rest"``, a set of such points; ``"recurrent"``: runs come
        back near all its points again and again, as on a chaotic attractor, or on a cycle without a section;
        ``"given"``.
    period : float
        Of a cycle, otherwise NaN.
    multipliers : ndarray of complex
        Of a cycle, as those of :class:`PeriodicOrbit`; empty where Newton's method did not find it.
    """

    points: Array
    kind: str = "given"
    period: float = float("nan")
    multipliers: NDArray[np.complex128] = field(default_factory=lambda: np.zeros(0, complex))

    def __repr__(self) -> str:
        small = 1e-9 * float(np.abs(self.points).max(initial=0.0))
        means = self.points.mean(axis=0)
        middle = ", ".join(f"{v if abs(v) > small else 0:.6g}" for v in means)
        period = f" of period {self.period:.10g}" if self.kind == "cycle" else ""
        points = f"{len(self.points)} point" + "s" * (len(self.points) != 1)
        return f"Attractor({self.kind}{period}, {points} about ({middle}))"


class _Returns(NamedTuple):
    """Runs sampled at returns."""

    #: x, t (m, K, n), (m, K): States and times of the samples; NaN after the last of a run.
    x: Array
    t: Array
    #: (m,): Samples that each run has.
    number: NDArray[np.intp]
    #: (m, n)
    end: Array
    #: (m,): Of runs that ended in a status of their own, or far away; 0 for the others.
    labels: NDArray[np.int32]

    def late(self, back: int, rows: NDArray[np.intp] | None = None) -> Array:
        """States (m, n) of some runs so many samples before their last ones; NaN where there is none."""
        rows = np.arange(len(self.x)) if rows is None else rows
        number = self.number[rows] - 1 - back
        found: Array = self.x[rows, np.maximum(number, 0)]
        found[number < 0] = np.nan
        return found


class Search:
    """Attractors and labels of starts, from their runs."""

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
        self.parameters: Any = dict(parameters or {})
        self.tolerances = tolerances
        self.work, self.near, self.samples = work, near, samples
        self.t_start, self.t_end, self.begun = t_start, t_end, 0
        if not t_end > t_start:
            raise OptionError(
                f"t_end = {t_end} is not after t_start = {t_start}. Give a later time."
            )
        self._read_section(section)
        span = t_end - t_start
        self.most = samples * rounds
        self.step = span / self.most
        if self.period is not None:
            self.most, self.step = max(1, int(span / self.period * (1 + 1e-12))), self.period
        self._measure(self.x0)
        self.labels = np.zeros(len(self.x0), np.int32)
        self.found: list[Attractor] = []
        self._trees: list[Any] = []
        self._failures = 0

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
        rounding = self.tolerances.atol + self.tolerances.rtol * np.maximum(
            np.abs(low), np.abs(high)
        )
        self.scale = np.where(high - low > 10 * rounding, high - low, 1.0)
        self.box = low - 100 * self.scale, high + 100 * self.scale

    def known(self, attractor: Attractor) -> int:
        """Add an attractor; its label."""
        self.found.append(attractor)
        self._trees.append(_tree(attractor.points / self.scale))
        return len(self.found)

    def run(self) -> bool:
        """Find attractors from a few starts, then label all; False if interrupted."""
        try:
            finite = np.flatnonzero(np.all(np.isfinite(self.x0), axis=1))
            chosen = np.random.default_rng(0).permutation(finite)[:_SEEDS]
            dense = _DENSE if self.section is None else 1
            count = (
                min(self.samples, self.most) * _DENSE
            )  # at times: on a section states may be zero
            times = self.t_start + self.step / _DENSE * np.arange(1, count + 1)
            first = self._ensemble(self.x0[chosen], times[-1], "scale", t_eval=times).sample_x
            seen = first[np.all(np.isfinite(first), axis=2)]
            if len(seen):  # without the outer 5 %: some runs may diverge
                ends = np.quantile(seen, [0.05, 0.95], axis=0)
                self._measure(np.vstack([self.x0, ends]))
                self._trees = [_tree(a.points / self.scale) for a in self.found]
            self._follow(chosen, "seeds", dense)
            self._follow(np.flatnonzero(self.labels == UNDECIDED), "round")
            if self._by_events:  # runs without further returns
                self.section = None
                self._follow(np.flatnonzero(self.labels == UNDECIDED), "times")
        except KeyboardInterrupt:
            return False
        return True

    # runs ---------------------------------------------------------------------------------------

    def _follow(self, left: NDArray[np.intp], what: str, dense: int = 1) -> None:
        """Label starts, followed to twice as many returns until their labels are known."""
        count, over = min(self.samples, self.most), list[NDArray[np.intp]]()
        late = np.full((len(self.x0), min(self.samples, count), self.x0.shape[1]), np.nan)
        self._failures = 0
        while len(left):
            rows = max(1, _AGAIN // (count * dense * self.x0.shape[1]))
            going = list[NDArray[np.intp]]()
            for part in np.split(left, range(rows, len(left), rows)):
                at = self._sample(self.x0[part], count, what, dense)
                self.labels[part] = self._decided(at, part)
                undecided = self.labels[part] == UNDECIDED
                for back in range(late.shape[1]):
                    late[part, -1 - back] = at.late(back)
                last = np.full(len(part), not self._by_events and count >= self.most)
                last |= self._by_events & (at.number < count)
                going.append(part[undecided & ~last])
                over.append(part[undecided & last])
            left, count = np.concatenate(going), 2 * count
            count = count if self._by_events else min(count, self.most)
        self._compare(np.concatenate(over) if over else left, late)

    @property
    def _by_events(self) -> bool:
        """Whether returns are events, of which runs may have any number."""
        return self.section is not None and self.period is None

    def _compare(self, left: NDArray[np.intp], late: Array) -> None:
        """Label runs that return near their earlier samples, over the whole time."""
        dense = _DENSE if self.section is None else 1
        for _ in range(_FURTHER):
            if not len(left):
                return
            some = left[:_SEEDS]
            count = self.most
            if self._by_events:
                count = self._longest(some)
            history = self._sample(self.x0[some], count, "long", dense)
            self.labels[some] = self._recurrent(history)
            rest = left[len(some) :]
            full = np.all(np.isfinite(late[rest]), axis=(1, 2))
            self.labels[rest[full]] = self._near(late[rest[full]])
            new = np.flatnonzero(self.labels[left])
            left = left[self.labels[left] == UNDECIDED]
            if not len(new):
                return

    def _longest(self, rows: NDArray[np.intp]) -> int:
        """Largest number of returns of a run in the whole time, or of kept ones."""
        count = self.samples
        most = max(self.samples, _HELD // (len(rows) * self.x0.shape[1]))
        while count < most:
            count = min(2 * count, most)
            if not np.any(self._sample(self.x0[rows], count, "long").number == count):
                break
        return count

    def _sample(self, starts: Array, count: int, what: str, dense: int = 1) -> _Returns:
        """Runs from starts (m, n), sampled ``count`` times."""
        view: dict[str, Any]
        end = self.t_start + self.step * count
        if self.period is not None:
            end, view = end * (1 + 1e-12) + 1e-9 * self.step, {"at": Section(self.period)}
        elif self.section is not None:
            end, view = self.t_end, {"at": replace(self.section, count=count)}
        else:
            times = self.t_start + self.step / dense * np.arange(1, count * dense + 1)
            times[-1] = end
            view = {"t_eval": times}
        many = self._ensemble(starts, end, what, **view)
        assert many.sample_x is not None and many.sample_t is not None
        x = many.sample_x[:, : count * dense]
        number = np.isfinite(x).all(axis=2).sum(axis=1)
        labels = np.full(len(starts), UNDECIDED, np.int32)
        labels[(many.status == Status.STOPPED) & (number < count)] = STOPPED
        labels[many.status == Status.NON_UNIQUE] = NON_UNIQUE
        labels[many.status == Status.ACCUMULATION] = ACCUMULATION
        labels[(labels == UNDECIDED) & ~many.complete] = FAILED
        lost = np.any((many.x < self.box[0]) | (many.x > self.box[1]), axis=1)
        labels[lost & ((labels == FAILED) | (labels == UNDECIDED))] = INFINITY
        return _Returns(x, many.sample_t[:, : count * dense], number, many.x, labels)

    def _ensemble(self, x: Array, t_end: float, what: str, **view: Any) -> Any:
        self.begun += 1
        work = self.work
        if work.store is not None:  # a folder of its own
            folder = Path(work.store)
            folder.mkdir(parents=True, exist_ok=True)
            work = replace(work, store=folder / f"{self.begun:03d}-{what}")
        return ensemble(
            self.system,
            x,
            t_end,
            t_start=self.t_start,
            parameters=self.parameters,
            rtol=self.tolerances.rtol,
            atol=self.tolerances.atol,
            work=work,
            **view,
        )

    # decisions ----------------------------------------------------------------------------------

    def _decided(self, at: _Returns, rows: NDArray[np.intp]) -> NDArray[np.int32]:
        """Labels of runs: their status, an attractor that they come to, or 0."""
        labels = at.labels.copy()
        self._label_known(labels, at)
        if self.section is None:
            closing = np.flatnonzero(self._closing(at, 1, 0.1 * self.near) & (labels == UNDECIDED))
            self._label_resting(labels, closing, at)
            return labels
        for p in range(1, _LONGEST + 1):
            for i in np.flatnonzero(
                self._closing(at, p, self.near) & (labels == UNDECIDED)
            ).tolist():
                if labels[i] == UNDECIDED:
                    known = len(self.found)
                    labels[i] = self._of_cycle(at, i, rows[i], p)
                    if len(self.found) > known:
                        self._label_known(labels, at)
        if self._by_events:
            spent = np.flatnonzero((labels == UNDECIDED) & (at.number < at.x.shape[1]))
            self._label_resting(labels, spent, at)
        return labels

    def _closing(self, at: _Returns, p: int, least: float) -> NDArray[np.bool_]:
        """Whether each p-th sample of runs comes nearer to the one before, and is near it."""
        change, before = (self._distance(at.late(i), at.late(i + p)) for i in (0, p))
        return (change <= least) & ((change < before) | (change <= _EQUAL))

    def _distance(self, a: Array, b: Array) -> Array:
        """Largest difference of states (m, n), in the unit of distances; infinite where there is none."""
        found = np.abs((a - b) / self.scale).max(axis=1)
        return np.where(np.isnan(found), np.inf, found)

    def _label_known(self, labels: NDArray[np.int32], at: _Returns) -> None:
        """Label runs that come to a known attractor."""
        for k, attractor in enumerate(self.found):
            left = np.flatnonzero(labels == UNDECIDED)
            if attractor.kind in ("cycle", "point"):
                left = left[self._away(k, at.late(0, left)) <= self._radius(k)]
                width = max(len(attractor.points), min(_LONGEST, at.x.shape[1] // 2))
                now, before = (
                    np.max([self._away(k, at.late(i + first, left)) for i in range(width)], axis=0)
                    for first in (0, width)
                )
                comes = (now <= self._radius(k)) & ((now < before) | (now <= _EQUAL))
                labels[left[comes]] = k + 1
            if attractor.kind == "point":  # that attracts all runs this near
                left = np.flatnonzero(labels == UNDECIDED)
                labels[left[self._away(k, at.end[left]) <= _ISOLATED * self.near]] = k + 1
        left = np.flatnonzero((labels == UNDECIDED) & (at.number >= self.samples))
        late = np.stack([at.late(i, left) for i in range(self.samples)], axis=1)
        labels[left] = self._near(late)

    def _away(self, k: int, x: Array) -> Array:
        """Distances of states (m, n) from an attractor; infinite where there is none."""
        found = np.full(len(x), np.inf)
        there = np.isfinite(x).all(axis=1)
        found[there] = self._trees[k].query(x[there] / self.scale, p=np.inf)[0]
        return found

    def _radius(self, k: int) -> float:
        """Distance from an attractor's points within which a run that approaches them belongs to it."""
        others = [a.points for i, a in enumerate(self.found) if i != k]
        if not others:
            return self.near
        return min(self.near, 0.3 * float(self._away(k, np.vstack(others)).min()))

    def _near(self, sampled: Array) -> NDArray[np.int32]:
        """Label, from 1, of the given or recurrent attractor near all samples (m, K, n); 0 for none."""
        label = np.zeros(len(sampled), np.int32)
        for k, tree in enumerate(self._trees):
            if self.found[k].kind not in ("given", "recurrent"):
                continue
            for first in range(0, len(sampled), _ROWS):
                part = slice(first, first + _ROWS)
                distance, _ = tree.query(sampled[part] / self.scale, p=np.inf)
                label[part][np.all(distance <= self.near, axis=1) & (label[part] == 0)] = k + 1
        return label

    # cycles -------------------------------------------------------------------------------------

    def _of_cycle(self, at: _Returns, i: int, row: int, p: int) -> int:
        """Label of the cycle that a run approaches, new or known; 0 if Newton's method finds none there."""
        last = int(at.number[i]) - 1
        period = float(at.t[i, last] - at.t[i, last - p])
        found = None
        if self._failures < _SEEDS:
            found = self._polished(at, i, row, p, period)
            self._failures += found is None
        x = at.x[i, : last + 1]
        back = x[
            last - p * np.arange(1, 1 + max(1, last // 4 // p))
        ]  # a slow focus comes nearer yet
        change = np.abs((x[last] - back) / self.scale).max(axis=1)
        if found is None and change[0] <= _STILL and change.max() <= 0.1 * _EQUAL:
            if np.abs((x[p:] - x[:-p]) / self.scale).max() < 1e3 * _STILL:
                return UNDECIDED  # its returns never approached a limit
            if not self._moves(x[last], period):
                end, still = self._settled(at.end[i : i + 1])
                return self._at_rest(end[0]) if still[0] else UNDECIDED
            found = Attractor(x[last - p + 1 :].copy(), "cycle", period)
        if found is None:
            return UNDECIDED
        given = int(self._near(found.points[None])[0])
        if given:
            return given
        for k, other in enumerate(self.found):
            if (
                other.kind == "cycle"
                and len(other.points) == len(found.points)
                and self._away(k, found.points).max() <= _EQUAL
            ):
                return k + 1
        return self.known(found)

    def _moves(self, x: Array, span: float) -> bool:
        """Whether a run leads away from a state."""
        given: dict[str, Any] = {"t_start": self.t_start, "parameters": self.parameters}
        try:
            run = simulate(self.system, x, self.t_start + span, **given)
        except NonsmoothError:  # it is no start, as of a clock at its tick
            return True
        return bool(np.abs(np.ptp(run.x, axis=0) / self.scale).max() > _EQUAL)

    def _polished(self, at: _Returns, i: int, row: int, p: int, period: float) -> Attractor | None:
        """The stable cycle that a run approaches, with its points on the section."""
        given: dict[str, Any] = {"parameters": self.parameters}
        section, count = self.section, int(at.number[i])
        assert section is not None
        end = float(at.t[i, count - 1])
        try:
            run = simulate(self.system, self.x0[row], end, t_start=self.t_start, **given)
            orbit = self._orbit(run, period)
            turns = round(period / orbit.period)
            if abs(turns * orbit.period - period) > 0.05 * orbit.period:
                return None
            points = self._points(orbit, p, period, at.x[i, count - 1])
        except NonsmoothError:
            return None
        if points is None or not orbit.stability.startswith(("asymptotically", "super")):
            return None
        same = [
            d
            for d in range(1, p + 1)
            if p % d == 0 and self._distance(points, np.roll(points, d, axis=0)).max() <= _EQUAL
        ]
        period, points = turns * orbit.period * same[0] / p, points[: same[0]]
        return Attractor(points, "cycle", period, orbit.multipliers ** round(period / orbit.period))

    def _orbit(self, run: Any, period: float) -> PeriodicOrbit:
        """The orbit that a run approaches; a period of returns may contain several turns of it."""
        assert self.section is not None
        given: dict[str, Any] = {"parameters": self.parameters}
        every = self.section.every
        if self.period is not None:
            return periodic_orbit(self.system, run, period=self.period / every, **given)
        for turns in (d for d in range(every, 1, -1) if every % d == 0):
            try:
                return periodic_orbit(self.system, run, period=period / turns, **given)
            except NonsmoothError:  # it is a longer one
                continue
        return periodic_orbit(self.system, run, period=period, **given)

    def _points(self, orbit: PeriodicOrbit, p: int, period: float, x: Array) -> Array | None:
        """Points (p, n) of a cycle on the section, of which the last is near a state; None if none is."""
        begin = orbit.legs[0].t
        if self.period is not None:
            times = (self.t_start - begin + np.arange(1, p + 1) * self.period) % orbit.period
            found = np.array([orbit.trajectory(begin + t) for t in times])
        else:
            assert self.section is not None
            middle, every = begin + 0.5 * orbit.legs[0].duration, self.section.every
            run = simulate(
                self.system,
                orbit.trajectory(middle),
                middle + 2.5 * period,
                t_start=middle,
                at=replace(self.section, count=(p + 1) * every, every=1, skip=0),
                parameters=self.parameters,
            )
            passed = run.sample_x
            if passed is None or len(passed) < (p + 1) * every:
                return None
            first = int(self._distance(passed[: p * every], x).argmin()) % every
            found = passed[first::every][:p]
        away = self._distance(found, x)
        if away.min() > self.near:
            return None
        return np.roll(found, p - 1 - int(away.argmin()), axis=0)

    # rest ---------------------------------------------------------------------------------------

    def _label_resting(
        self, labels: NDArray[np.int32], rows: NDArray[np.intp], at: _Returns
    ) -> None:
        """Label runs that come to rest."""
        if not len(rows):
            return
        ends, still = self._settled(at.end[rows])
        rows, ends = rows[still], ends[still]
        while len(rows):  # up to the next one that changes what is known
            known = self._at_known_rest(ends[:_TOGETHER])
            new = np.flatnonzero(known == UNDECIDED)[:1]
            if len(new):
                known = known[: new[0] + 1]
                known[-1] = self._at_rest(ends[new[0]])
            labels[rows[: len(known)]] = known
            rows, ends = rows[len(known) :], ends[len(known) :]

    def _settled(self, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """States (m, n) after the whole time again, and whether they rest there."""
        span = self.t_end - self.t_start
        one = self._ensemble(x, self.t_end, "rest").x
        two = self._ensemble(one, self.t_start + span / 16, "rest").x
        return one, self._distance(one, two) <= _STILL

    def _at_known_rest(self, x: Array) -> NDArray[np.int32]:
        """Labels of the known points or sets at which states (m, n) rest, or 0."""
        label = self._near(x[:, None])
        for k, attractor in enumerate(self.found):
            if attractor.kind in ("point", "rest"):
                left = np.flatnonzero(label == UNDECIDED)
                least = self._radius(k) if attractor.kind == "point" else self.near / 8
                label[left[self._away(k, x[left]) <= least]] = k + 1
        return label

    def _at_rest(self, x: Array) -> int:
        """Label of another point or a larger set, at which a state (n,) rests."""
        step = _ISOLATED * self.near * self.scale
        around = np.vstack([x + step * e for e in (*np.eye(len(x)), *-np.eye(len(x)))])
        back, still = self._settled(around)
        if np.all(self._distance(back, x) <= 1e-3 * self.near) and still.all():
            return self.known(Attractor(x[None], "point"))
        for k, attractor in enumerate(self.found):
            if attractor.kind == "rest":
                points = _thinned(np.vstack([attractor.points, x]), self.scale, self.near / 8)
                self.found[k] = Attractor(points, "rest")
                self._trees[k] = _tree(points / self.scale)
                return k + 1
        return self.known(Attractor(x[None], "rest"))

    # recurrence ---------------------------------------------------------------------------------

    def _recurrent(self, at: _Returns) -> NDArray[np.int32]:
        """Labels of runs; one that recurs near no attractor defines a new one."""
        label = at.labels.copy()
        for i, (sampled, count) in enumerate(zip(at.x, at.number.tolist(), strict=True)):
            if label[i] or count < self.samples:
                continue
            half = count // 2
            settled = sampled[half:count]
            label[i] = self._near(settled[None, -min(self.samples, half) :])[0]
            label[i] = label[i] or self._extended(settled)
            if label[i]:
                continue
            quarter = max(1, len(settled) // 4)
            before, after = settled[:-quarter], settled[-quarter:]
            tree = _tree(before / self.scale)
            if len(before) and np.all(tree.query(after / self.scale, p=np.inf)[0] <= self.near):
                if self._attracts(settled):
                    points = _thinned(settled[::-1], self.scale, self.near / 8)
                    label[i] = self.known(Attractor(points, "recurrent"))
        return label

    def _attracts(self, points: Array) -> bool:
        """Whether runs from beside points come back near them."""
        rng = np.random.default_rng(len(points))
        chosen = points[rng.integers(len(points), size=_BESIDE)]
        off = rng.choice([-1, 1], chosen.shape) * rng.uniform(0.5, 1.5, chosen.shape)
        beside = chosen + _BESIDE_BY * self.near * self.scale * off
        try:
            last = self._sample(beside, self.most, "beside").late(0)
        except NonsmoothError:  # these are no starts, as of a clock at its tick
            return True
        away = _tree(points / self.scale).query(
            last[np.isfinite(last).all(axis=1)] / self.scale, p=np.inf
        )[0]
        return bool(np.sum(away <= self.near) > _BESIDE / 3)

    def _extended(self, points: Array) -> int:
        """Number of the recurrent attractor near most of the points, which is extended by them; 0 for none."""
        for k, tree in enumerate(self._trees):
            if self.found[k].kind not in ("given", "recurrent"):
                continue
            if np.mean(tree.query(points / self.scale, p=np.inf)[0] <= self.near) > 0.5:
                more = np.vstack([self.found[k].points, points])
                kept = _thinned(more, self.scale, self.near / 8)
                self.found[k] = Attractor(kept, self.found[k].kind)
                self._trees[k] = _tree(kept / self.scale)
                return k + 1
        return 0


def _thinned(points: Array, scale: Array, least: float) -> Array:
    """The first point in each cell of size ``least``, in the order given."""
    cells = np.floor(points / (scale * least))
    return points[np.sort(np.unique(cells, axis=0, return_index=True)[1])]


def _tree(points: Array) -> Any:
    from scipy.spatial import cKDTree  # here: it is not needed to import the library

    return cKDTree(points)


_NAMES = {
    UNDECIDED: "undecided",
    NON_UNIQUE: "not unique",
    ACCUMULATION: "events accumulate",
    STOPPED: "stopped",
    FAILED: "failed",
    INFINITY: "to infinity",
}


@dataclass(frozen=True, eq=False, repr=False)
class Basins(Savable, labels="...", starts="... n nan", axes="*"):
    """Basins of attraction: the attractor of each start.

    Attributes
    ----------
    labels : ndarray of int32 (...)
        From 1: number of the attractor. 0: undecided in the given time; -1: NON_UNIQUE; -2: ACCUMULATION;
        -3: STOPPED by a stop of the system; -5: to infinity (a hundred times as far as the starts and runs are
        apart); -4: any other status.
    attractors : list of Attractor
        ``attractors[k - 1]`` has the label k.
    starts : ndarray (..., n)
        The starts, in the shape of the grid.
    axes : dict of str to ndarray
        The grid's axes by names of states, if it was given so.
    state_names : tuple of str
        Names of the states, in their order on the last axis.
    complete : bool
        False if the computation was interrupted; undecided starts then have the label 0.
    """

    labels: NDArray[np.int32]
    attractors: list[Attractor]
    starts: Array
    axes: dict[str, Array] = field(default_factory=dict)
    state_names: tuple[str, ...] = ()
    complete: bool = True

    def _tables(self) -> dict[str, ResultTable]:
        named = bool(self.axes)
        axes = self.axes if named else {f"start_{k}": m for k, m in enumerate(self.labels.shape)}
        columns = {"label": self.labels} | ({} if named else {"x": self.starts})
        kinds = [np.full(len(one.points), one.kind, object) for one in self.attractors]
        parts = [{"kind": k, "x": a.points} for k, a in zip(kinds, self.attractors, strict=True)]
        labels = {"state": self.state_names} if self.state_names else {}
        attractors = joined("attractor", parts, self.state_names)
        return {"starts": ResultTable(axes, columns, labels), "attractors": attractors}

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
        """Return a label in words.

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
        Time in which a run has to reach its attractor. Runs that reach it earlier end earlier.
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
        Number of returns in the first integration; it doubles for runs without a label. A run belongs to a given or
        recurrent attractor if so many samples in a row are near it.
    rounds : int, optional
        Without a section, runs are sampled at ``samples * rounds`` equal time steps.
    t_start, parameters, tol, rtol, atol : optional
        As in :func:`simulate`; parameters are numbers.
    work : Work, optional
        Threads or executor, progress bars, and a store: after an interruption the same call
        continues from there.

    Returns
    -------
    Basins
        After Ctrl-C it has the labels that were decided.

    Raises
    ------
    DefinitionError
        ``system`` is not a FilippovSystem.
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
    >>> [(a.points[0].round(3) + 0).tolist() for a in found.attractors], found.labels.tolist()
    ([[-1.0, 0.0], [1.0, 0.0]], [2, 1, 1, 1, 1, 1, -1, 2, 2, 2, 2, 2, 1])

    From rest on the edge, $x = 0$, two motions are possible: the label -1. A cycle is polished, at its returns to
    a section:

    >>> swing = ns.FilippovSystem([x, v], field=[v, (1 - x**2) * v - x])
    >>> ns.basins(swing, {"x": np.linspace(-3, 3, 4), "v": 1.0}, t_end=100.0, section=x).attractors
    [Attractor(cycle of period 6.663286859, 2 points about (0, 0))]
    """
    require_system(system, sets=True, complementarity=True)
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
        search.known(Attractor(points))
    complete = search.run()
    labels = search.labels.reshape(starts.shape[:-1])
    return Basins(labels, search.found, starts, axes, system.state_names, complete)


def attractors(
    system: FilippovSystem,
    starts: Mapping[str, ArrayLike] | ArrayLike,
    t_end: float,
    **options: Any,
) -> list[Attractor]:
    """Find the attractors to which runs go.

    Parameters
    ----------
    system, starts, t_end
        As in :func:`basins`, of which ``starts`` are the grid; about fifty are enough for an overview.
    **options
        As in :func:`basins`: ``section``, ``near``, ``samples``, ``t_start``, ``parameters``, ``tol``, ``work``, ...

    Returns
    -------
    list of Attractor
        Cycles with their periods and multipliers, points and sets of rest, and recurrent attractors, such as chaotic
        ones; those with more of the starts first.

    Raises
    ------
    DefinitionError, OptionError, PointError, ParameterError
        As in :func:`basins`.

    Examples
    --------
    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> kick = ns.Reset(x, [x, v + 0.3], direction=1, name="kick")
    >>> system = ns.FilippovSystem([x, v], field=[v, -x - 0.1 * v], resets=kick)
    >>> (found,) = ns.attractors(system, {"x": np.linspace(-2, 2, 5), "v": [0.1, 1]}, 300.0, section="kick")
    >>> found.points.round(9) + 0, found.multipliers.real.round(9)
    (array([[0.        , 0.81158613]]), array([1.        , 0.73011538]))
    """
    found = basins(system, starts, t_end, **options)
    part = found.fractions
    order = sorted(range(len(found.attractors)), key=lambda k: -part.get(k + 1, 0.0))
    return [found.attractors[k] for k in order]


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
