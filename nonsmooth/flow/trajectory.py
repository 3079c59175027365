"""Trajectory of a run: Taylor polynomials of its steps, events, itinerary, status."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model import Array, FilippovSystem, OptionError, PointError, real_array
from ..notebook import lines, representation
from ..result_tables import ResultTable
from .events import Events, Segments, ShownMode
from .names import shown_mode
from .other_names import ATTRIBUTES
from .saving import Savable, savable
from .status import Status

#: Coefficients that are read at once, so that they stay in the cache.
_BLOCK = 1 << 17

#: Letters of an itinerary in a representation.
_SHOWN = 40


@savable(starts="s", coefficients="s; N *", implicit="s")
@dataclass(frozen=True)
class Steps:
    """Accepted steps with the polynomials of the states.

    Attributes
    ----------
    starts : ndarray (s,)
        Times at which they begin.
    coefficients : sequence of ndarray (N, P+1)
        Of the states (time included where the system depends on it), in powers of the time since
        the start of the step. A step whose series ends early has fewer.
    implicit : ndarray (s,) of bool
        Whether a step is implicit (collocation at Radau points) in place of a Taylor step.
    """

    starts: Array = field(default_factory=lambda: np.zeros(0))
    coefficients: Sequence[Array] | Array = ()
    implicit: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        if len(self.implicit) != len(self.starts):
            object.__setattr__(self, "implicit", np.zeros(len(self.starts), bool))

    def __len__(self) -> int:
        return len(self.coefficients)

    def part(self, first: int, last: int) -> Steps:
        """Return the steps first to last - 1."""
        return Steps(
            self.starts[first:last], self.coefficients[first:last], self.implicit[first:last]
        )

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
    """Assumptions and errors of the decisions of a run.

    Attributes
    ----------
    depends_on_widths : bool
        Whether sliding on several surfaces is stable, or not, only for some ratios of the widths of their
        layers. It was decided for the ``layer_widths`` of the system.
    unproved : bool
        One solution was found for more than eight coupled elements, and no test proves that it is unique.
    rested_below : tuple of str
        Names of surfaces that ``rest_below=`` put to rest, with an error of its speed there.
    implicit_steps : int
        Number of implicit steps, taken where a decay rate limits explicit ones.
    t_error : float
        Largest error of the time of an event that rounding of its switching function hides, as near a multiple zero:
        0 where none of them moves a state by more than the tolerance.
    """

    depends_on_widths: bool = False
    unproved: bool = False
    rested_below: tuple[str, ...] = ()
    implicit_steps: int = 0
    t_error: float = 0.0


def _require_whole(run: Trajectory) -> None:
    """Raise ValueError where points, steps and segments of a saved run do not belong together."""
    steps = np.diff(run.t)
    if not len(run.t) or ((steps < 0).any() and (steps > 0).any()):
        raise ValueError("Trajectory.t: it is empty or turns back")
    first, last = run.segments.first, run.segments.last
    if ((first < 0) | (last < first) | (last > len(run.steps))).any():
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
    events : Events
        A sequence of Event in order of time. The last one is the end.
    itinerary : str
        Modes in order, separated by blanks.
    segments : Segments
        Pieces in one mode each, between events: a sequence of Segment.
    status : Status
        Why the run ended.
    message : str
        The status in words, with details.
    accumulation_time : float or None
        Estimated limit of the event times when the status is ACCUMULATION.
    steps : Steps
        Accepted steps with their Taylor polynomials; empty with ``dense=False``.
    sample_t, sample_x : ndarray (K,), (K, n) or None
        Times and states of the samples by ``t_eval`` (NaN after an early end) or ``at``.
    continuations : list of Continuation
        The motions that can continue from the last point, up to 16, when the status is NON_UNIQUE and they are
        known.
    facts : Facts
        Assumptions and errors of the decisions of the run.
    dense : bool
        Whether the polynomials were kept, so that the run can be read between its points.
    sampled_events : bool
        Whether the samples are at events, by ``at=``, whose times depend on the start.
    """

    system: FilippovSystem
    parameters: dict[str, float]
    t: Array
    x: Array
    events: Events
    segments: Segments
    status: Status
    message: str
    accumulation_time: float | None = None
    steps: Steps = field(default_factory=Steps)
    sample_t: Array | None = None
    sample_x: Array | None = None
    continuations: list[Continuation] = field(default_factory=list)
    facts: Facts = field(default_factory=Facts)
    dense: bool = True
    sampled_events: bool = False

    @property
    def itinerary(self) -> str:
        """Modes in order, separated by blanks, e.g. ``"- s -"``."""
        return self._itinerary(len(self.segments))

    def _itinerary(self, most: int) -> str:
        """The first modes of the itinerary."""
        shown: dict[ShownMode, str] = {}
        for one in (modes := self.segments.shown(most)):
            if one not in shown:
                shown[one] = shown_mode(self.system, one.mode, one.discrete) or "o"
        return " ".join([shown[one] for one in modes])

    def __getattr__(self, name: str) -> Any:
        hint = f". It has {ATTRIBUTES[name]}" if name in ATTRIBUTES else ""
        raise AttributeError(f"'Trajectory' object has no attribute {name!r}{hint}")

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
        OptionError
            A time between two points of a run with ``dense=False``.
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
        if not self.dense:
            return self._at_points(times, side)
        if not len(self.steps):
            return np.broadcast_to(self.x[-1], (*times.shape, n)).copy()
        forward = bool(self.t[-1] >= self.t[0])
        found = self.steps.at(times.ravel(), n, forward, side).reshape(*times.shape, n)
        if side == "right":
            found[times == self.t[-1]] = self.x[-1]
        else:
            found[times == self.t[0]] = self.x[0]
        return found

    def _at_points(self, times: Array, side: Any) -> Array:
        """States at points of the run."""
        k = np.searchsorted(self.t, times, side=side) - (side == "right")
        k = np.clip(k, 0, len(self.t) - 1)
        if not np.array_equal(self.t[k], times):
            self.require_dense("the run between its points")
        return self.x[k]

    def require_dense(self, what: str) -> None:
        """Raise an error if the run has no polynomials.

        Parameters
        ----------
        what : str
            What needs them, for the message.

        Raises
        ------
        OptionError
            The run was simulated with ``dense=False``.
        """
        if not self.dense:
            raise OptionError(
                f"dense=False kept no polynomials of this run, which {what} needs. Simulate with dense=True."
            )

    def _tables(self) -> dict[str, ResultTable]:
        labels = {"state": self.system.state_names}
        events = self.events._tables()["events"]
        tables = {
            "points": ResultTable({"t": self.t}, {"x": self.x}, labels),
            "events": ResultTable(events.index, events.columns, labels),
        }
        if self.sample_t is not None:
            samples = {"sample": ("t", self.sample_t)}
            tables["samples"] = ResultTable(samples, {"x": self.sample_x}, labels)
        return tables

    def _missing(self, what: str) -> str:
        return "; simulate with t_eval= or at= for samples" if what == "samples" else ""

    def _repr_html_(self) -> str:
        """Notebook representation: status, itinerary, states over time."""
        rows = (
            ("time", f"{self.t[0]:g} to {self.t[-1]:g}, {len(self.events)} events"),
            ("itinerary", self._shown_itinerary()),
            ("status", self.status),
            ("message", "" if self.status.complete else self.message),
        )
        times = np.linspace(self.t[0], self.t[-1], 240)
        if not self.dense:
            times = self.t[:: max(1, len(self.t) // 240)]
        states = self(times) if self.t[-1] > self.t[0] else self.x[:1]
        return representation(
            "Trajectory", rows, lines(times[: len(states)], states, self.system.state_names)
        )

    def __repr__(self) -> str:
        return (
            f"Trajectory(t = {self.t[0]:g} .. {self.t[-1]:g}, {len(self.t)} points, "
            f"{len(self.events)} events, itinerary {self._shown_itinerary()!r}, {self.status})"
        )

    def _shown_itinerary(self) -> str:
        text = self._itinerary(_SHOWN)
        return text if len(text) <= _SHOWN else text[: _SHOWN - 4] + " ..."
