"""Segments of a run: arrays, from which a segment is made where one is looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..model import Array
from .saving import savable
from .sequences import LazySequence


@dataclass(frozen=True)
class Segment:
    """A stretch of motion in one mode, between two events.

    Attributes
    ----------
    mode : str
        One letter for each surface, and one for each impact.
    t_start, t_end : float
        Times at which it begins and ends.
    first, last : int
        Its steps are those with the numbers ``first`` to ``last - 1`` of ``Trajectory.steps``.
    discrete : tuple of float
        Values of the discrete states.
    """

    mode: str
    t_start: float
    t_end: float
    first: int
    last: int
    discrete: tuple[float, ...] = ()


@savable()
@dataclass(frozen=True)
class ShownMode:
    """A mode with the values of the discrete states."""

    mode: str
    discrete: tuple[float, ...] = ()


@savable(t_start="k", t_end="k", first="k", last="k", codes="k <modes")
@dataclass(frozen=True, eq=False, repr=False)
class Segments(LazySequence[Segment]):
    """Segments in order of time: a sequence of :class:`Segment`, kept as arrays.

    Attributes
    ----------
    t_start, t_end : ndarray (k,)
        Times at which they begin and end.
    first, last : ndarray (k,)
        Numbers of their first steps, and those after their last ones.
    codes : ndarray (k,)
        Positions in ``modes``.
    modes : tuple
        The modes, with the values of the discrete states.
    """

    t_start: Array
    t_end: Array
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    codes: NDArray[np.int32]
    modes: tuple[ShownMode, ...]

    @classmethod
    def of(cls, segments: Sequence[Segment]) -> Segments:
        """Return segments that were made one by one."""
        if isinstance(segments, Segments):
            return segments
        objects = list(segments)
        return cls.when_read(partial(cls._of, objects), lambda: objects)

    @classmethod
    def _of(cls, segments: list[Segment]) -> Segments:
        known: dict[ShownMode, int] = {}
        codes = [known.setdefault(ShownMode(s.mode, s.discrete), len(known)) for s in segments]
        return cls(
            np.array([s.t_start for s in segments], float),
            np.array([s.t_end for s in segments], float),
            np.array([s.first for s in segments], np.int64),
            np.array([s.last for s in segments], np.int64),
            np.array(codes, np.int32),
            tuple(known),
        )

    def shown(self, most: int) -> list[ShownMode]:
        """Return the modes of the first segments.

        Parameters
        ----------
        most : int
            Number of segments at most.

        Returns
        -------
        list
            Modes with the values of the discrete states.
        """
        objects = self._objects
        if objects is not None:
            return [ShownMode(s.mode, s.discrete) for s in objects[:most]]
        return [self.modes[k] for k in self.codes[:most].tolist()]

    def _size(self) -> int:
        return len(self.codes)

    def _made(self, k: int) -> Segment:
        shown, ends = self.modes[self.codes[k]], (float(self.t_start[k]), float(self.t_end[k]))
        return Segment(shown.mode, *ends, int(self.first[k]), int(self.last[k]), shown.discrete)

    def _part(self, which: slice) -> Self:
        t_start, t_end = self.t_start[which], self.t_end[which]
        first, last = self.first[which], self.last[which]
        return type(self)(t_start, t_end, first, last, self.codes[which], self.modes)
