"""Sampled futures of one point: what a funnel is, once its members are known."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..flow.trajectory import Trajectory
from ..local import TwoFold
from ..model import Array, FilippovSystem, PointError, real_array


@dataclass(frozen=True)
class Departure:
    """How one member of a funnel goes.

    Attributes
    ----------
    side : {"+", "-", "s"}
        Where it leaves to; ``s`` slides as long as the sliding region lasts.
    t : float
        When it leaves.
    path : int
        Which sliding orbit it was on until then; -1 for none.
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
class Funnel:
    """Futures of one point: call it with a time to get the set of states there.

    Attributes
    ----------
    system : FilippovSystem
        The system whose future is not unique.
    t : float
        When the future stops being unique.
    point : ndarray (n,)
        The state at which it stops being unique.
    cause : str
        Why it stops being unique, such as ``"repelling sliding of h0"``.
    two_fold : TwoFold or None
        The two-fold that the set begins at, if it does at one.
    trajectories : tuple of Trajectory
        From ``point`` on. One that meets another point without a unique future ends there, with
        status NON_UNIQUE.
    departures : tuple of Departure
        How each of them goes.
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

    def __len__(self) -> int:
        return len(self.trajectories)

    def __call__(self, t: ArrayLike) -> Array:
        """Evaluate all members.

        Parameters
        ----------
        t : array_like (...)
            Times; before the funnel's start all members are on its past.

        Returns
        -------
        ndarray (samples, ..., n)
            NaN for a member that has ended before.

        Raises
        ------
        PointError
            A time before the start of the past.
        """
        times = real_array(t, "time")
        result = np.full((len(self), *times.shape, self.point.size), np.nan)
        before = times < self.t
        if before.any():
            if self.past is None:
                raise PointError(
                    f"time: expected values from {self.t:g} on, received {times.min():g}. The "
                    "funnel starts there."
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
