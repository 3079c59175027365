"""Orbits of a plane of starts up to where their side is decided: at an event, or at a two-fold.

Two ways in which a plane of starts is divided:

- orbits end at an *event*, and both fields agree across the surface there (a contact that opens: with
  the load its friction vanishes). They end on one side of the surface, on the other, or in it;
- they go on, and a *two-fold* parts them: to one side of it they leave for one side of the surface, to the
  other side for the other. Where they do not slide into it they part where they just touch the surface
  and what has touched it crosses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...flow.follow import follow
from ...flow.simulate import simulate
from ...local.point.surface_point import Numbers, place
from ...local.searches.find_two_fold import TwoFold
from ...model import (
    Array,
    ConvergenceError,
    DegenerateError,
    FilippovSystem,
    OptionError,
    Parameters,
    explain,
)
from ...model.derivatives.event_maps import function_map
from ..runs.guards import change_fault
from ..runs.itinerary import Arrival, FixedItinerary, leg_between, read_word
from .dividing_arcs import Passage, last_side
from .two_fold_sheet import Meeting, TwoFoldSheet

# What a dividing surface of orbits that end at an event needs of the event.

#: Relative distance of a two-fold from its event, and sine of the angle of both zeros there.
_AT_EVENT = 1e-7


def require_event(
    system: FilippovSystem, until: object, fold: TwoFold, parameters: dict[str, float]
) -> None:
    """Refuse an event unless at it both fields have the same component across the surface."""
    names = [name for name, _ in system.stops]
    if until not in names:
        raise OptionError(
            explain(
                "until",
                expected=f"the name of a stop of the system, among {names}",
                received=repr(until),
                advice="Stops are given with stops=[nonsmooth.Stop(function, name=...)].",
            )
        )
    event = system.definition.guards[names.index(until)]
    jump = system.lie_derivative("+") - system.lie_derivative("-")
    p = system.parameter_vector(parameters)
    at, gap = (function_map(system, "+", of)(fold.point, p) for of in (event, jump))
    sizes = np.array([np.linalg.norm(row.gradient) for row in (at, gap)])
    unit = np.array([at.gradient, gap.gradient]) / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    aside = abs(at.value) / (sizes[0] or 1.0) / (1.0 + float(np.linalg.norm(fold.point)))
    angle = float(np.linalg.svd(unit)[1][1])
    if not sizes.min() > 0.0 or aside > _AT_EVENT or angle > _AT_EVENT:
        raise DegenerateError(
            f"of: expected a two-fold at the event {until!r}, and fields with the same component across "
            f"the surface wherever it happens, received {fold.point.round(9).tolist()}, where the event's "
            f"function is {at.value:.3g} and its zeros turn from those of the difference by {angle:.3g}. "
            "Leave until out where orbits go on and two-folds part them."
        )


def read_begin(system: FilippovSystem, begin: Any) -> list[tuple[str, Array]]:
    """Points of a curve with their itineraries, one letter for each leg."""
    if begin is None:
        return []
    try:
        pairs = [("".join(read_word(system, word)), np.array(u, dtype=float)) for word, u in begin]
    except (TypeError, ValueError):
        pairs = []
    if len(pairs) < 2 or any(u.shape != (2,) or not np.isfinite(u).all() for _, u in pairs):
        raise OptionError(
            explain(
                "begin",
                expected="two points or more of a curve, each as its itinerary and its two coordinates",
                received=repr(begin),
                advice="For example begin=[('+ s', (0.1, -0.5)), ('+ s', (0.11, -0.5))].",
            )
        )
    return pairs


#: Time and state (n,) at which an orbit begins, and the derivatives of the state by the coordinates
#: of the plane (n, 2), if they are known.
Start = tuple[float, Array, Array | None]


@dataclass(frozen=True)
class ComputedStarts:
    """Starts of orbits that no formula gives, such as the ends of other runs.

    Attributes
    ----------
    function : callable
        Takes coordinates (2,) and returns the time and the state (n,) at which an orbit begins.
    scale : float
        Size of the coordinates: the unit of spacings, and of steps for differences.

    Examples
    --------
    Starts that a body comes to after a flight of the duration 1 without friction:

    >>> starts = ComputedStarts(lambda u: (1.0, [u[0], u[1] - 1.0, 0.0]), scale=1.0)
    >>> starts(np.array([0.5, 3.0]))
    (1.0, array([0.5, 2. , 0. ]), None)
    """

    function: Callable[[Array], Any]
    scale: float = 1.0

    def __call__(self, u: Array) -> Start:
        t, x = self.function(u)
        return float(t), np.asarray(x, dtype=float), None


class EventPassages:
    """Orbits that end at an event at which both fields have the same component across the surface.

    Parameters
    ----------
    system : FilippovSystem
        With one surface.
    until : str
        Name of the event: a stop.
    start : callable
        Takes coordinates (2,) of the plane and returns where the orbit begins.
    scale : float
        Size of the coordinates.
    parameters, tol, t_max : optional
        As of :class:`FixedItinerary`.
    exact : bool, optional
        Whether ``start`` gives derivatives.
    """

    def __init__(
        self,
        system: FilippovSystem,
        until: str,
        start: Callable[[Array], Start],
        scale: Any,
        *,
        parameters: Parameters | None = None,
        tol: float = 1e-13,
        t_max: float = 1000.0,
        exact: bool = True,
    ):
        self.system, self.until, self.start, self.scale = system, until, start, scale
        self.tol, self.t_max, self.exact = tol, t_max, exact
        self.parameters = parameters
        self._itineraries: dict[str, FixedItinerary] = {}

    def itinerary(self, word: str) -> FixedItinerary:
        """The map of an itinerary to the event."""
        if word not in self._itineraries:
            self._itineraries[word] = FixedItinerary(
                self.system,
                word,
                until=self.until,
                parameters=self.parameters,
                tol=self.tol,
                t_max=self.t_max,
            )
        return self._itineraries[word]

    def numbers(self, x: Array, t: float = 0.0) -> Numbers:
        """h, L1, L2 and their gradients at a state."""
        where, extended = place(self.system, x, self.parameters, t)
        return where.at(extended)

    def passage(self, u: Array, word: str) -> Passage:
        """The orbit from a start to the event: of L1 + L2 after sliding, of h else.

        Parameters
        ----------
        u : ndarray (2,)
            Coordinates of the start.
        word : str
            Its itinerary; a last leg of sliding is not left before the event.
        """
        t, x, slope = self.start(u)
        itinerary = self.itinerary(word)
        arrival = itinerary.arrive(x, t)
        by_start = None if slope is None else itinerary.derivative(arrival)[1] @ slope
        found = self.decided(arrival, word, by_start)
        if last_side(word[0]) * self.numbers(x, t).h < 0.0:
            return replace(found, fault="the start is on the other side of the surface")
        return found

    def seed(self, u: Array, word: str) -> None:
        """Nothing has to be known of an itinerary before its passages are computed.

        Parameters
        ----------
        u : ndarray (2,)
        word : str
        """

    def decided(self, arrival: Arrival, word: str, by_start: Array | None = None) -> Passage:
        """Describe the end of an orbit; one that slid there must be at a visible two-fold.

        Parameters
        ----------
        arrival : Arrival
        word : str
        by_start : ndarray (n, 2), optional
            Derivatives of its end by the coordinates of the plane.
        """
        at, slides, fault = self.numbers(arrival.x, arrival.t), word[-1] == "s", arrival.fault
        second = at.second
        if slides and not second["L11"] > 0 > second["L22"]:
            fault = fault or "the two-fold at its end is not visible"
        corner = np.array([at.h, at.lie.mean()])
        slopes = None
        if by_start is not None:
            n = self.system.dimension
            rows = np.array([at.gradient[:n], at.lie_gradients.mean(axis=0)[:n]])
            slopes = rows @ by_start
        which = int(slides)
        return Passage(
            arrival.x,
            arrival.t,
            arrival.entry,
            float(corner[which]),
            corner,
            fault,
            None if slopes is None else slopes[which : which + 1],
            slopes,
        )

    def simulated(self, u: Array) -> str:
        """The itinerary to the event that a start really takes, one letter for each leg."""
        t, x, _ = self.start(u)
        run = simulate(
            self.system,
            x,
            t + self.t_max,
            t_start=t,
            parameters=self.parameters,
            tol=max(self.tol, 1e-12),
        )
        return run.itinerary.replace(" ", "")


class TwoFoldPassages:
    """Orbits that two-folds of a system part."""

    exact = True

    def __init__(
        self,
        system: FilippovSystem,
        sheet: TwoFoldSheet,
        start: Callable[[Array], Start],
        scale: Any,
        duration: float,
        *,
        parameters: Parameters | None = None,
        tol: float = 1e-13,
    ):
        self.system, self.sheet, self.start, self.scale = system, sheet, start, scale
        self.duration, self.parameters, self.tol = duration, parameters, tol
        self._met: dict[str, Meeting] = {}

    def passage(self, u: Array, word: str) -> Passage:
        """The orbit from a start."""
        return self._slides(u, word) if word.endswith("s") else self._touches(u, word)

    def simulated(self, u: Array) -> str:
        """The itinerary that a start really takes, one letter for each leg."""
        _, x, _ = self.start(u)
        run = simulate(
            self.system, x, self.duration, parameters=self.parameters, tol=max(self.tol, 1e-12)
        )
        return run.itinerary.replace(" ", "")

    def seed(self, u: Array, word: str) -> None:
        """Take from a simulation beside a dividing surface where orbits of an itinerary meet the
        sheet."""
        _, x, _ = self.start(u)
        run = simulate(
            self.system, x, self.duration, parameters=self.parameters, tol=max(self.tol, 1e-12)
        )
        legs = len(word)
        if len(run.events) < legs or not word.endswith("s"):
            return
        entry = run.events[legs - 2] if legs > 1 else None
        leaves = run.events[legs - 1]
        start = (run.t[0], run.x[0]) if entry is None else (entry.t, entry.x_after)
        self._met[word] = self.sheet.guess(start[1], leaves.x, leaves.t - start[0])

    def _itinerary(self, word: str, until: object) -> FixedItinerary:
        return FixedItinerary(
            self.system, word, until, parameters=self.parameters, tol=self.tol, t_max=self.duration
        )

    # sliding into a two-fold --------------------------------------------------------------------

    def _slides(self, u: Array, word: str) -> Passage:
        _, x, slope = self.start(u)
        assert slope is not None
        entry, fault, by_start = 0.0, "", slope
        if len(word) > 1:
            itinerary = self._itinerary(word[:-1], "h0")
            arrival = itinerary.arrive(x)
            by_start = itinerary.derivative(arrival)[1] @ slope
            x, entry = arrival.x, arrival.t
            fault = arrival.fault or self._entry_fault(word, x)
        met = self.sheet.meet(x, self._met.get(word))
        self._met[word] = met
        return Passage(
            met.fold,
            entry + met.duration + met.left,
            entry,
            met.gap,
            np.full(2, np.nan),
            fault or met.fault,
            (met.slope @ by_start)[None, :],
        )

    def _entry_fault(self, word: str, x: Array) -> str:
        leg, p = leg_between(self.system, word[-2], "s"), self.sheet.parameters
        return change_fault(self.system, leg, "s", x, x, p)

    # touching the surface -----------------------------------------------------------------------

    def _touches(self, u: Array, word: str) -> Passage:
        """The last leg turns back from the surface: h is least there, and zero on the arc."""
        _, x, slope = self.start(u)
        assert slope is not None
        itinerary = self._itinerary(word, self._lie(word[-1]))
        arrival = self._turned(itinerary, itinerary.arrive(x), word[-1])
        by_start = itinerary.derivative(arrival)[1] @ slope
        at = self.sheet.where.at(arrival.x)
        other = 1 if word[-1] == "+" else 0
        corner = np.array([at.h, at.lie[other]])
        slopes = np.array([at.gradient, at.lie_gradients[other]]) @ by_start
        fault = arrival.fault
        sign = 1.0 if word[-1] == "+" else -1.0
        if not sign * at.lie[other] < 0.0:
            fault = fault or "what has touched the surface does not cross it, but slides"
        return Passage(arrival.x, arrival.t, arrival.entry, at.h, corner, fault, slopes[:1], slopes)

    def _lie(self, letter: str) -> Any:
        return self.system.lie_derivative(letter)

    def _turned(self, itinerary: FixedItinerary, arrival: Arrival, letter: str) -> Arrival:
        """The same orbit up to the turn at which it is nearest to the surface."""
        start, t = arrival.starts[-1], arrival.entry
        run = follow(
            self.system,
            start,
            t + self.duration,
            mode=letter,
            watch=[self._lie(letter)],
            t_start=t,
            parameters=self.parameters,
            tol=self.tol,
        )
        sign = 1.0 if letter == "+" else -1.0
        turns: list[tuple[float, float, Array]] = []
        for event in run.events:
            if event.name != "f0" or event.kind != "zero":
                continue
            at = self.sheet.where.at(event.x)
            if sign * at.second["L11" if sign > 0 else "L22"] > 0.0:
                turns.append((abs(at.h), event.t, event.x))
        if not turns:
            raise ConvergenceError(
                f"leg in mode {letter!r} from {np.array2string(start, precision=6)}: expected a turn "
                f"back from the surface within {self.duration:g}, received none."
            )
        _, end, x = min(turns, key=lambda turn: turn[0])
        fault = arrival.fault
        if end != arrival.t:
            last = itinerary.leg(letter, t, start, (), t_end=end)
            fault = itinerary.inside(last, f"leg {len(arrival.legs)} ({letter})")
        durations = (*arrival.durations[:-1], end - t)
        return replace(arrival, x=x, t=end, fault=fault, durations=durations)
