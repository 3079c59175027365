"""Trajectory of a run: Taylor polynomials of its steps, events, itinerary, status."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model import Array, FilippovSystem, PointError, real_array
from ..notebook import card, lines
from . import tables
from .names import shown_mode
from .saving import Savable, savable
from .status import Status

#: Coefficients that are read at once, so that they stay in the cache.
_BLOCK = 1 << 17


@savable(x="n", x_after="n", motion="* nan")
@dataclass(frozen=True)
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


@savable()
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


@savable(starts="s", coefficients="s; N *")
@dataclass(frozen=True)
class Steps:
    """Accepted steps with the Taylor polynomials of the states.

    Attributes
    ----------
    starts : ndarray (s,)
        Times at which they begin.
    coefficients : sequence of ndarray (N, P+1)
        Of the states (time included where the system depends on it), in powers of the time since
        the start of the step. A step whose series ends early has fewer.
    """

    starts: Array = field(default_factory=lambda: np.zeros(0))
    coefficients: Sequence[Array] | Array = ()

    def __len__(self) -> int:
        return len(self.coefficients)

    def part(self, first: int, last: int) -> Steps:
        """Return the steps first to last - 1."""
        return Steps(self.starts[first:last], self.coefficients[first:last])

    def at(self, t: Array, n: int, forward: bool = True, side: Any = "right") -> Array:
        """Evaluate the first n states at times (m,); (m, n)."""
        starts = self.starts if forward else -self.starts
        step = np.searchsorted(starts, t if forward else -t, side=side) - 1
        step = np.clip(step, 0, len(starts) - 1)
        s, result = (t - self.starts[step])[:, None], np.empty((t.size, n))
        for chosen, rows, c in _stacks(self.coefficients, step):
            block = max(1, _BLOCK // (c.shape[1] * c.shape[2]))
            for k in range(0, rows.size, block):
                part = chosen[k : k + block]
                result[part] = _horner(c[rows[k : k + block], :n], s[part])
        return result


def _stacks(
    coefficients: Sequence[Array] | Array, step: NDArray[np.intp]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp], Array]]:
    """Stacks of polynomials of one length: the times read from each, their rows in it, the stack."""
    if isinstance(coefficients, np.ndarray):
        yield np.arange(step.size), step, coefficients
        return
    used, row = np.unique(step, return_inverse=True)
    lengths = np.array([coefficients[k].shape[1] for k in used], int)
    for length in np.unique(lengths):
        own = lengths == length
        chosen = np.flatnonzero(own[row])
        stack = np.stack([coefficients[k] for k in used[own]])
        yield chosen, (np.cumsum(own) - 1)[row[chosen]], stack


def _horner(c: Array, s: Array) -> Array:
    """Values (m, n) at times (m, 1) of polynomials with coefficients (m, n, P+1)."""
    value = c[..., -1].copy()
    for j in range(c.shape[-1] - 2, -1, -1):
        value *= s
        value += c[..., j]
    return value


@savable(rates="n")
@dataclass(frozen=True)
class Continuation:
    """A motion that can continue where more than one can.

    Attributes
    ----------
    mode : str
        Its letters.
    rates : ndarray (n,)
        Rates of the states with which it begins.
    """

    mode: str
    rates: Array


@savable()
@dataclass(frozen=True)
class Facts:
    """What the decisions of a run rest on.

    Attributes
    ----------
    depends_on_widths : bool
        Whether sliding on several surfaces is stable, or not, only for some ratios of the widths of their
        layers. It was decided for the ``layer_widths`` of the system.
    unproved : bool
        One solution was found for more than eight elements that act on one another, and no test shows that it
        is the only one.
    """

    depends_on_widths: bool = False
    unproved: bool = False


def _require_whole(run: Trajectory) -> None:
    """Raise ValueError where points, steps and segments of a saved run do not belong together."""
    steps = np.diff(run.t)
    if not len(run.t) or ((steps < 0).any() and (steps > 0).any()):
        raise ValueError("Trajectory.t: it is empty or turns back")
    if any(not 0 <= s.first <= s.last <= len(run.steps) for s in run.segments):
        raise ValueError("Trajectory.segments: they have other steps than the run")


@dataclass(frozen=True, repr=False)
class Trajectory(
    Savable, check=_require_whole, t="m", x="m n", sample_t="k nan", sample_x="k n nan"
):
    """A solution: call it with times to evaluate its dense output.

    Attributes
    ----------
    system : FilippovSystem
        The system that was run.
    parameters : dict
        Name and value of every parameter of the run.
    t, x : ndarray (m,), (m, n)
        Accepted steps and events, both ends included; a reset appears twice at its time.
    events : list of Event
        What happened, in order of time; the last one is the end.
    itinerary : str
        Modes in order, separated by blanks.
    segments : list of Segment
        Pieces in one mode each, between events.
    status : Status
        Why the run ended.
    message : str
        What happened, in words.
    accumulation_time : float or None
        Estimated limit of the event times when the status is ACCUMULATION.
    steps : Steps
        Accepted steps with their Taylor polynomials.
    sample_t, sample_x : ndarray (K,), (K, n) or None
        Times and states of the samples by ``t_eval`` (NaN after an early end) or ``at``.
    continuations : list of Continuation
        The motions that can continue from the last point, up to 16, when the status is NON_UNIQUE and they are
        known.
    facts : Facts
        What the decisions of the run rest on.
    """

    system: FilippovSystem
    parameters: dict[str, float]
    t: Array
    x: Array
    events: list[Event]
    segments: list[Segment]
    status: Status
    message: str
    accumulation_time: float | None = None
    steps: Steps = field(default_factory=Steps)
    sample_t: Array | None = None
    sample_x: Array | None = None
    continuations: list[Continuation] = field(default_factory=list)
    facts: Facts = field(default_factory=Facts)

    @property
    def itinerary(self) -> str:
        """Modes in order, separated by blanks, e.g. ``"- s -"``."""
        shown = [shown_mode(self.system, s.mode, s.discrete) for s in self.segments]
        return " ".join(mode or "o" for mode in shown)

    def __call__(self, t: ArrayLike, side: str = "right") -> Array:
        """Evaluate the dense output.

        Parameters
        ----------
        t : array_like
            Times of the run.
        side : {"right", "left"}, optional
            At a jump the value after all jumps of that instant, or the value before them.

        Returns
        -------
        ndarray (..., n)
            States. The right value at the end is ``x[-1]``.

        Raises
        ------
        PointError
            Times outside the run, or another ``side``.
        """
        if side not in ("right", "left"):
            raise PointError(f'side is {side!r}. Give "right" or "left".')
        times = real_array(t, "time")
        low, high = sorted((float(self.t[0]), float(self.t[-1])))
        slack = 1e-12 * max(1.0, abs(low), abs(high))
        if times.size and not (low - slack <= times.min() and times.max() <= high + slack):
            raise PointError(
                f"time has values from {times.min()} to {times.max()}. Give times in [{low}, {high}]: "
                f"the run ended with status {self.status}. {self.message}"
            )
        n = self.x.shape[1]
        if not len(self.steps):
            return np.broadcast_to(self.x[-1], (*times.shape, n)).copy()
        forward = bool(self.t[-1] >= self.t[0])
        found = self.steps.at(times.ravel(), n, forward, side).reshape(*times.shape, n)
        if side == "right":
            found[times == self.t[-1]] = self.x[-1]
        else:
            found[times == self.t[0]] = self.x[0]
        return found

    def to_pandas(self, what: str = "points") -> Any:
        """Return a DataFrame: steps and events in time, a row each event, or the samples.

        Parameters
        ----------
        what : {"points", "events", "samples"}, optional
            ``points`` and ``samples`` have the time as index and a column for each state; ``events``
            has time, kind, name, element, side, modes, and the states before and after
            (``x_after``, ...).

        Returns
        -------
        pandas.DataFrame
            With the names of the states as columns.

        Raises
        ------
        OptionError
            pandas is not installed; the run has no samples.
        """
        return tables.trajectory_table(self, what)

    def to_xarray(self) -> Any:
        """Return a Dataset with ``x`` (t, state), and ``sample_x`` (sample, state) if there are any.

        Returns
        -------
        xarray.Dataset
            With the names of the states as a coordinate.

        Raises
        ------
        OptionError
            xarray is not installed.
        """
        return tables.trajectory_set(self)

    def _repr_html_(self) -> str:
        """Notebook representation: status, itinerary, states over time."""
        rows = (
            ("time", f"{self.t[0]:g} to {self.t[-1]:g}, {len(self.events)} events"),
            ("itinerary", _shorten(self.itinerary)),
            ("status", self.status),
            ("message", "" if self.status.complete else self.message),
        )
        times = np.linspace(self.t[0], self.t[-1], 240)
        states = self(times) if self.t[-1] > self.t[0] else self.x[:1]
        return card(
            "Trajectory", rows, lines(times[: len(states)], states, self.system.state_names)
        )

    def __repr__(self) -> str:
        return (
            f"Trajectory(t = {self.t[0]:g} .. {self.t[-1]:g}, {len(self.t)} points, "
            f"{len(self.events)} events, itinerary {_shorten(self.itinerary)!r}, {self.status})"
        )


def _shorten(text: str, width: int = 40) -> str:
    return text if len(text) <= width else text[: width - 4] + " ..."
