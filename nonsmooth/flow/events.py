"""Events and segments of a run: sequences kept as arrays, which make an object where one is read."""

from __future__ import annotations

import math
import operator
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Self, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from ..model import Array
from ..result_tables import ResultTable
from .saving import savable

T = TypeVar("T")


class LazySequence(Sequence[T]):
    """A sequence like a list. Subclasses are dataclasses of the arrays from which its objects are made."""

    # ``_make`` makes the arrays when one of them is first read; ``_list`` makes the objects of a short one,
    # for which arrays do not pay.

    @classmethod
    def when_read(
        cls, make: Callable[[], Self], listed: Callable[[], list[T]] | None = None
    ) -> Self:
        """Return a sequence whose arrays, or else whose objects, are made when they are read."""
        made = object.__new__(cls)
        vars(made).update(_make=make, _list=listed)
        return made

    @property
    def _objects(self) -> list[T] | None:
        own = vars(self)
        if own.get("_list") is not None:
            own["_made_objects"], own["_list"] = own["_list"](), None
        return own.get("_made_objects")

    def __getattr__(self, name: str) -> Any:
        own = vars(self)
        if name.startswith("_") or "_make" not in own:
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        if own["_make"] is not None:
            own.update(_state(own["_make"]()))
            own["_make"] = None
        if name not in own:
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        return own[name]

    def __getstate__(self) -> dict[str, Any]:
        return _state(self)

    @classmethod
    def of(cls, objects: Sequence[T]) -> Self:
        """Return a sequence of objects that were made one by one."""
        if isinstance(objects, cls):
            return objects
        made = list(objects)
        return cls.when_read(lambda: cls._of(made), lambda: made)

    @classmethod
    @abstractmethod
    def _of(cls, objects: list[T]) -> Self:
        """Return their arrays."""

    @abstractmethod
    def _size(self) -> int:
        """Number of objects."""

    @abstractmethod
    def _made(self, k: int) -> T:
        """Make the object of a number from 0."""

    @abstractmethod
    def _part(self, which: slice) -> Self:
        """Return a slice of it."""

    def __len__(self) -> int:
        objects = self._objects
        return self._size() if objects is None else len(objects)

    @overload
    def __getitem__(self, k: int) -> T: ...
    @overload
    def __getitem__(self, k: slice) -> Self: ...
    def __getitem__(self, k: int | slice) -> T | Self:
        objects = self._objects
        if isinstance(k, slice):
            return self._part(k) if objects is None else self.of(objects[k])
        number, size = operator.index(k), len(self)
        if not -size <= number < size:
            raise IndexError(f"index {number} is out of range for {size} entries")
        return self._made(number % size) if objects is None else objects[number]

    def __iter__(self) -> Iterator[T]:
        objects = self._objects
        return self._each() if objects is None else iter(objects)

    def _each(self) -> Iterator[T]:
        """Make all objects in turn."""
        return map(self._made, range(self._size()))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, (list, LazySequence)):
            return NotImplemented
        return len(self) == len(other) and all(map(operator.eq, self, other))

    __hash__ = None  # type: ignore[assignment]  # as that of a list

    def __add__(self, other: Sequence[T]) -> list[T]:
        return [*self, *other]

    def __radd__(self, other: Sequence[T]) -> list[T]:
        return [*other, *self]

    def __repr__(self) -> str:
        return repr([*self])


def _state(made: Any) -> dict[str, Any]:
    """The arrays of a sequence by name."""
    return {field.name: getattr(made, field.name) for field in fields(made)}


# Events -------------------------------------------------------------------------------------------

#: The motion of an event within a run with dense=False, which keeps that of its end only.
NOT_KEPT = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Event:
    """Something that happened at one instant.

    Attributes
    ----------
    kind : {"crossing", "entry", "exit", "stop", "reset", "impact", "contact", "release", "jump", "stability", \
"rest", "rest_below", "zero", "end"}
        ``entry`` and ``exit`` are of sliding; contacts and complementarity conditions close (``contact``) and open
        (``release``); ``jump`` leads from a forbidden state; ``stability`` is lost by sliding on several surfaces;
        a relay in a position comes to ``rest``; ``zero`` is one of ``flow.follow``.
    t : float
        Time of the event.
    x : ndarray (n,)
        State before a reset or jump, on the surface otherwise.
    mode_before, mode_after : str
        Equal at a stop, a zero and the end. After a reset the mode that starts there, also where
        the jump went through a surface.
    name : str
        Of the surface (``h0``, ``h1``, ...), the complementarity condition, the limit of a multiplier at which sliding ends
        (``lambda0 = 1``, ``lambda0 = -1``, ``|lambda0| = 1`` of a set), the stop, reset, impact or
        function.
    x_after : ndarray (n,)
        State after a reset, impact or jump, ``x`` otherwise.
    element : int
        What it belongs to: position of the surface, set or contact among the letters of the modes;
        number of the stop or reset, clocks counted after the resets; -1 for none.
    side : int
        Of a crossing or entry the side, +1 or -1, from which the motion comes; of the end of sliding
        the one to which it goes; of a stop or reset its direction; of an impact, or a condition that closes, 1;
        otherwise 0.
    motion : ndarray or None
        Sides of all conditions and due events, for ``simulate(system, start=event)``.
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
    """Common data of many events of a run: all but their times and states."""

    kind: str
    mode_before: str
    mode_after: str
    name: str = ""
    element: int = -1
    side: int = 0

    def event(self, t: float, x: Array, after: Array, motion: Array | None) -> Event:
        """Make an event."""
        made = object.__new__(
            Event
        )  # a quarter of the time of __init__, which sets a frozen object's fields
        vars(made).update(vars(self), t=t, x=x, x_after=after, motion=motion)
        return made


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

    Indices, slices, loops and comparisons work as with a list. An event object is made when it is read, so that
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
        Common data of events: kind, modes, name, element and side.
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
    def _of(cls, objects: list[Event]) -> Events:
        known: dict[Label, int] = {}
        labels = [
            Label(e.kind, e.mode_before, e.mode_after, e.name, e.element, e.side) for e in objects
        ]
        codes = [known.setdefault(label, len(known)) for label in labels]
        states = [x for e in objects for x in (e.x, e.x_after)]
        return cls(
            np.array([e.t for e in objects], float),
            np.array(states, float) if states else np.zeros((0, 0)),
            2 * np.arange(len(objects), dtype=np.int64),
            np.ones(len(objects), np.bool_),
            np.array(codes, np.int32),
            tuple(known),
            _motions([e.motion for e in objects]),
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

    def _tables(self) -> dict[str, ResultTable]:
        names = ("kind", "name", "element", "side", "mode_before", "mode_after")
        columns = {"t": self.t, **{name: self.column(name) for name in names}}
        states = {"x": self.x, "x_after": self.x_after}
        return {"events": ResultTable({"event": len(self)}, columns | states)}

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


# Segments -----------------------------------------------------------------------------------------


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
    def _of(cls, objects: list[Segment]) -> Segments:
        known: dict[ShownMode, int] = {}
        codes = [known.setdefault(ShownMode(s.mode, s.discrete), len(known)) for s in objects]
        return cls(
            np.array([s.t_start for s in objects], float),
            np.array([s.t_end for s in objects], float),
            np.array([s.first for s in objects], np.int64),
            np.array([s.last for s in objects], np.int64),
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

    def _tables(self) -> dict[str, ResultTable]:
        names = ("t_start", "t_end", "first", "last")
        columns = {"mode": [one.mode for one in self]} | {n: getattr(self, n) for n in names}
        return {"segments": ResultTable({"segment": len(self)}, columns)}

    def _size(self) -> int:
        return len(self.codes)

    def _made(self, k: int) -> Segment:
        shown, ends = self.modes[self.codes[k]], (float(self.t_start[k]), float(self.t_end[k]))
        return Segment(shown.mode, *ends, int(self.first[k]), int(self.last[k]), shown.discrete)

    def _part(self, which: slice) -> Self:
        t_start, t_end = self.t_start[which], self.t_end[which]
        first, last = self.first[which], self.last[which]
        return type(self)(t_start, t_end, first, last, self.codes[which], self.modes)
