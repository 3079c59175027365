"""Orbits as curves of a given length, forward or backward, through switches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...flow.concatenation import join
from ...flow.saving import savable
from ...flow.simulate import simulate
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...model import Array, FilippovSystem, reversed_system

#: Steps between looks at the length of an orbit, and of all of it.
_CHUNK, _LONGEST = 16, 20_000

#: A chunk that is so many times as long as the orbit is to be is cut.
_FAR = 4.0

#: An orbit that grows by less than this part of its length in a chunk has come to rest.
_RESTS = 1e-7

#: Points of a step from which its length is taken.
_FINE = 64


@savable(points="m n", t="m")
@dataclass(frozen=True, eq=False, repr=False)
class Arc:
    """A curve along an orbit.

    Attributes
    ----------
    points : ndarray (m, n)
        At equal distances along the curve, both ends included.
    t : ndarray (m,)
        Times since the start, negative where the orbit was followed backward.
    itinerary : str
        Modes in the order in which they were met.
    end : str
        ``"length"`` reached, or why it is shorter: ``"rest"``, ``"sliding"`` (backward: what arrives
        there comes from everywhere beside it), ``"interrupted"``, or the name of a status.
    """

    points: Array
    t: Array
    itinerary: str
    end: str

    def __repr__(self) -> str:
        length = float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())
        return f"Arc(length {length:.4g}, itinerary {self.itinerary!r}, ends by {self.end})"


class InterruptedOrbit(KeyboardInterrupt):
    """Ctrl-C while an orbit was followed; ``run`` is what there is of it, and ``arc`` its curve."""

    def __init__(self, run: Trajectory):
        super().__init__()
        self.run = run
        self.arc: Arc | None = None


@dataclass(frozen=True)
class Follower:
    """Follows orbits of a system in one direction of time."""

    system: FilippovSystem
    parameters: dict[str, float]
    ahead: bool
    length: float
    spacing: float
    tol: float

    def arc(self, start: Array, mode: str | None = None) -> Arc | None:
        """Follow the orbit from a start; None where it cannot leave in the mode asked for."""
        try:
            found = self.run(start, mode)
        except InterruptedOrbit as stopped:
            stopped.arc = self._resampled(stopped.run, "interrupted")
            raise
        return None if found is None else self._resampled(*found)

    def run(self, start: Array, mode: str | None = None) -> tuple[Trajectory, str] | None:
        """The orbit as a run (of the reversed system, if backward), and why it ends."""
        system = self.system if self.ahead else reversed_system(self.system)
        pieces, x, t, grown, end = list[Trajectory](), start, 0.0, 0.0, "length"
        span = 1e9
        while grown < self.length:
            try:
                part = simulate(
                    system,
                    x,
                    t + span,
                    t_start=t,
                    parameters=self.parameters,
                    tol=self.tol,
                    start_mode=mode,
                    max_steps=_CHUNK,
                )
            except KeyboardInterrupt:
                if not pieces:
                    raise
                raise InterruptedOrbit(join(pieces)) from None
            far = float(lengths(part)[1][-1]) if len(part.steps) else 0.0
            if not far <= _FAR * self.length:  # steps of a simple field are as long as one likes
                span = (
                    (self.length / far) ** 0.125 * float(part.t[-1] - t)
                    if far < np.inf
                    else span / 8
                )
                continue
            if not len(part.steps):
                if not pieces:
                    return None
                end = str(part.status)
                break
            pieces.append(part)
            more, ended = far, part.status is Status.REACHED_END
            grown += more
            slides = _slides(part) if not self.ahead and (mode is None or "s" not in mode) else None
            if slides is not None or not (ended or part.status is Status.TOO_MANY_STEPS):
                end = "sliding" if slides is not None else str(part.status)
                break
            span = 4.0 * span if ended else span
            if (more < _RESTS * self.length and not ended) or len(pieces) * _CHUNK >= _LONGEST:
                end = "rest" if more < _RESTS * self.length else str(part.status)
                break
            x, t, mode = part.x[-1], float(part.t[-1]), part.events[-1].mode_after
        return join(pieces), end

    def _resampled(self, run: Trajectory, end: str) -> Arc:
        (t, s), length = lengths(run), self.length
        until = _slides(run) if end == "sliding" else None
        if until is not None:
            s = s[t <= until]
            t = t[t <= until]
        whole = float(s[-1])
        if whole >= length:
            whole, end = length, "length"
        count = max(1, round(whole / self.spacing))
        wanted = whole * np.arange(count + 1) / count if whole < length else None
        if wanted is None:
            wanted = np.minimum(self.spacing * np.arange(count + 1), whole)
            wanted[-1] = whole
        rising = np.concatenate([[True], np.diff(s) > 0.0])
        times = np.interp(wanted, s[rising], t[rising])
        sign = 1.0 if self.ahead else -1.0
        modes = [p.mode or "o" for p in run.segments if p.t_start <= times[-1]]
        return Arc(run(times), sign * times, " ".join(modes), end)


def lengths(run: Trajectory) -> tuple[Array, Array]:
    """Times within the steps of a run, and the length of the curve up to each."""
    edges = np.unique(run.t)
    if len(edges) < 2:
        return edges, np.zeros(len(edges))
    parts = np.linspace(edges[:-1], edges[1:], _FINE, endpoint=False, axis=1).ravel()
    t = np.append(parts, edges[-1])
    steps = np.linalg.norm(np.diff(run(t), axis=0), axis=1)
    return t, np.concatenate([[0.0], np.cumsum(steps)])


def _slides(run: Trajectory) -> float | None:
    """When a run begins to slide."""
    return next((e.t for e in run.events if e.kind == "entry"), None)
