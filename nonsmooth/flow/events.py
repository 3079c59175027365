"""Events of a run: arrays, from which an event is made where one is looked at."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..model import Array
from .saving import savable
from .sequences import LazySequence

#: The motion of an event within a run with dense=False, which keeps that of its end only.
NOT_KEPT = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Event:
    """Something that happened at one instant.

    Attributes
    ----------
    kind : {"crossing", "entry", "exit", "stop", "reset", "zero", "end"}
        ``entry`` and ``exit`` are of sliding; ``zero`` is a zero found by ``follow``.
    t : float
        Time of the event.
    x : ndarray (n,)
        State before a reset, on the surface otherwise.
    mode_before, mode_after : str
        Equal at a stop, a zero and the end. After a reset the mode that starts there, also where
        the jump went through a surface.
    name : str
        Of the surface (``h0``, ``h1``, ...), the limit of a multiplier at which sliding ends
        (``lambda0 = 1``, ``lambda0 = -1``, ``|lambda0| = 1`` of a set), the stop, reset, impact or
        function.
    x_after : ndarray (n,)
        State after a reset, ``x`` otherwise.
    element : int
        What it belongs to: position of the surface, set or contact among the letters of the modes;
        number of the stop or reset, clocks counted after the resets; -1 for none.
    side : int
        Of a crossing or entry the side, +1 or -1, from which the motion comes; of the end of sliding
        the one to which it goes; of a stop or reset its direction; of an impact 1; otherwise 0.
    motion : ndarray or None
        Sides of all conditions and what else is due then, for ``simulate(system, start=event)``.
    """

    kind: str
    t: float
    x: Array
    mode_before: str
    mode_after: str
    name: str = ""
    x_after: Array = None  # type: ignore[assignment]  # x unless given
    element: int = -1
    side: int = 0
    motion: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.x_after is None:
            object.__setattr__(self, "x_after", self.x)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Event):
            return NotImplemented
        pairs = [(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)]
        return all(
            np.array_equal(a, b, equal_nan=True) if np.ndarray in (type(a), type(b)) else a == b
            for a, b in pairs
        )

    __hash__ = None  # type: ignore[assignment]  # its arrays have none


@savable()
@dataclass(frozen=True)
class Label:
    """What many events of a run have in common: all but their times and states."""

    kind: str
    mode_before: str
    mode_after: str
    name: str = ""
    element: int = -1
    side: int = 0

    def event(self, t: float, x: Array, after: Array, motion: Array | None) -> Event:
        """Make an event."""
        modes = self.mode_before, self.mode_after
        return Event(self.kind, t, x, *modes, self.name, after, self.element, self.side, motion)


def _require_rows(events: Events) -> None:
    """Raise ValueError where a jump leads to no state, or there are more motions than events."""
    rows, jumps = events.rows, events.jumps
    if (rows[jumps] + 1 >= len(events.states)).any():
        raise ValueError("Events.rows: a jump leads to no state")
    if len(events.motions) > len(rows):
        raise ValueError("Events.motions: they are more than the events")


@savable(
    check=_require_rows,
    t="e",
    states="k n",
    rows="e <states",
    jumps="e",
    codes="e <labels",
    motions="* * nan",
)
@dataclass(frozen=True, eq=False, repr=False)
class Events(LazySequence[Event]):
    """Events in order of time: a sequence of :class:`Event`, kept as arrays.

    Indices, slices, loops and comparisons work as with a list. An event is made when it is looked at, so that
    a run with a million of them needs little time and memory; the arrays have all of them at once.

    Attributes
    ----------
    t : ndarray (e,)
        Times.
    x, x_after : ndarray (e, n)
        States before resets and after them.
    states : ndarray (k, n)
        Points of the run, among which the states of the events are.
    rows, jumps : ndarray (e,)
        Row of an event's state, and whether the state after it is the next row.
    codes : ndarray (e,)
        Positions in ``labels``.
    labels : tuple
        What events have in common: kind, modes, name, element and side.
    motions : ndarray (m, w)
        Motions of the last m events.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> block = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])
    >>> events = ns.simulate(block, [3.0, 0.0], t_end=15.0).events
    >>> events.column("kind").tolist(), (events.t[:-1] / 3.141592653589793).round(9).tolist()
    (['crossing', 'crossing', 'crossing', 'entry', 'end'], [1.0, 2.0, 3.0, 4.0])
    """

    t: Array
    states: Array
    rows: NDArray[np.int64]
    jumps: NDArray[np.bool_]
    codes: NDArray[np.int32]
    labels: tuple[Label, ...]
    motions: Array

    @classmethod
    def of(cls, events: Sequence[Event]) -> Events:
        """Return events that were made one by one."""
        if isinstance(events, Events):
            return events
        objects = list(events)
        return cls.when_read(partial(cls._of, objects), lambda: objects)

    @classmethod
    def _of(cls, events: list[Event]) -> Events:
        known: dict[Label, int] = {}
        labels = [
            Label(e.kind, e.mode_before, e.mode_after, e.name, e.element, e.side) for e in events
        ]
        codes = [known.setdefault(label, len(known)) for label in labels]
        states = [x for e in events for x in (e.x, e.x_after)]
        return cls(
            np.array([e.t for e in events], float),
            np.array(states, float) if states else np.zeros((0, 0)),
            2 * np.arange(len(events), dtype=np.int64),
            np.ones(len(events), np.bool_),
            np.array(codes, np.int32),
            tuple(known),
            _motions([e.motion for e in events]),
        )

    @property
    def x(self) -> Array:
        """States before resets."""
        return self.states[self.rows]

    @property
    def x_after(self) -> Array:
        """States after resets."""
        return self.states[self.rows + self.jumps]

    def column(self, attribute: str) -> NDArray[Any]:
        """Return an attribute of all events that is one of their labels', for example ``"kind"``.

        Parameters
        ----------
        attribute : {"kind", "mode_before", "mode_after", "name", "element", "side"}
            Name of the attribute.

        Returns
        -------
        ndarray (e,)
            Of texts (``object``) or integers.
        """
        values = [getattr(label, attribute) for label in self.labels]
        kind = np.int64 if attribute in ("element", "side") else np.object_
        return np.array(values, kind)[self.codes]

    def _size(self) -> int:
        return len(self.t)

    def _made(self, k: int) -> Event:
        row, label = int(self.rows[k]), self.labels[self.codes[k]]
        x = self.states[row].copy()
        after = self.states[row + 1].copy() if self.jumps[k] else x
        return label.event(float(self.t[k]), x, after, self._motion(k))

    def _each(self) -> Iterator[Event]:
        x, after = self.x, self.x_after
        rows = zip(self.t.tolist(), self.codes.tolist(), self.jumps.tolist(), strict=True)
        for k, (t, code, jumps) in enumerate(rows):
            own = x[k]
            yield self.labels[code].event(t, own, after[k] if jumps else own, self._motion(k))

    def _motion(self, k: int) -> Array | None:
        own = k - self._size() + len(self.motions)
        if not self.motions.shape[1]:
            return None
        first = math.inf if own < 0 else float(self.motions[own, 0])
        if first == math.inf:
            return NOT_KEPT
        return None if math.isnan(first) else self.motions[own].copy()

    def _part(self, which: slice) -> Self:
        chosen = np.arange(len(self))[which]
        own = chosen - len(self) + len(self.motions)
        if not own.size or own[0] <= own[-1]:  # those that are kept come last again
            motions = self.motions[own[own >= 0]]
        else:
            motions = np.full((len(own), self.motions.shape[1]), np.inf)
            motions[own >= 0] = self.motions[own[own >= 0]]
        rows, jumps = self.rows[which], self.jumps[which]
        return type(self)(
            self.t[which], self.states, rows, jumps, self.codes[which], self.labels, motions
        )


def _motions(given: Sequence[Array | None]) -> Array:
    """Motions as an array; the first number of a row is NaN where there is none, inf where it is not kept."""
    width = max((len(m) for m in given if m is not None), default=0)
    motions = np.full((len(given), width), np.nan)
    for row, motion in zip(motions, given, strict=True):
        if motion is not None and width:
            row[: max(len(motion), 1)] = motion if len(motion) else np.inf
    return motions
