"""Sections and sample times: the states that ``t_eval=`` and ``at=`` keep of runs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..model import (
    Array,
    FilippovSystem,
    OptionError,
    PointError,
    is_function,
    is_real,
    periods,
    read_period,
    real_array,
    surface_of,
    whole,
    with_section,
)
from .constants import KINDS
from .events import Events, Label
from .saving import savable
from .trajectory import Trajectory

#: Kinds of events that a section can be at: all but the end.
KINDS_OF_SECTIONS = KINDS[:-1]


@savable()
@dataclass(frozen=True)
class Section:
    """Section at which a run is sampled, for Poincare maps, stroboscopic pictures and bifurcation diagrams.

    Parameters
    ----------
    at : str, number or expression
        A name: of a surface (``"h0"``, ``"h1"``, ...), a complementarity condition, a stop, a reset or an
        impact (all to which it was given), or else a kind of event (``"crossing"``, ``"entry"``, ``"exit"``, ``"reset"``, ...). A number, or an
        expression in parameters, is a period: the run is sampled after each, from ``t_start``. An
        expression in states is a section of its own: the system gets a reset named ``"section"``
        where it is zero, which changes nothing. One that is a surface of the system, written alike,
        means that surface.
    direction : {-1, 0, 1}, optional
        Of a surface or expression: only where it falls, either way, only where it rises. Stops and
        resets have directions of their own.
    every : int, optional
        Sample each ``every``-th event.
    skip : int, optional
        Number of events to skip before, to let transients decay.
    count : int, optional
        Number of samples. A run ends with the last of them, STOPPED; one at a period continues in
        ensembles, where the periods differ.
    after : bool, optional
        The state after a reset or an impact instead of the one before.

    Notes
    -----
    An event at the start itself, to rounding, is no sample, so that a map from a section leads back to it.

    Raises
    ------
    OptionError
        A direction other than -1, 0 and 1; a number of samples that is not positive or whole. Names are
        checked later, with the system.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> oscillator = ns.FilippovSystem([x, v], surface=x, above=[v, -x], below=[v, -4 * x])
    >>> run = ns.simulate(oscillator, [0.0, 1.0], 100.0, at=ns.Section("h0", direction=1, count=3))
    >>> (run.sample_t / 3.141592653589793).round(9), run.sample_x[:, 1].round(9)
    (array([1.5, 3. , 4.5]), array([1., 1., 1.]))
    """

    at: Any
    direction: int = 0
    every: int = 1
    skip: int = 0
    count: int | None = None
    after: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.direction, bool) or self.direction not in (-1, 0, 1):
            raise OptionError(
                f"direction is {self.direction!r}. Give -1 (falling), 0 (both) or 1 (rising)."
            )
        for name, least in (("every", 1), ("skip", 0), ("count", 1)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, whole(value, name, least=least))


@dataclass(frozen=True)
class Hits:
    """Events at which a run is sampled."""

    kinds: tuple[str, ...]
    names: tuple[str, ...] | None
    letter: tuple[int, str] | None
    every: int
    skip: int
    count: int | None
    after: bool
    begin: float

    @property
    def last(self) -> float:
        """Number of the event that ends a run."""
        return math.inf if self.count is None else self.skip + self.every * self.count

    def has(self, label: Label) -> bool:
        """Whether events of a label are at the section."""
        named = self.names is None or label.name in self.names
        if label.kind not in self.kinds or not named:
            return False
        return self.letter is None or label.mode_before[self.letter[0]] == self.letter[1]

    def samples(self, events: Events) -> tuple[Array, Array]:
        """Times (K,) and states (K, n) of the events that are sampled."""
        own = np.array([self.has(label) for label in events.labels], bool)
        hits = np.flatnonzero((events.t > self.begin) & own[events.codes])
        t = events.t[hits[self.skip + self.every - 1 :: self.every][: self.count]]
        # the first and the last of the events of an instant
        if self.after:
            k = np.searchsorted(events.t, t, side="right") - 1
            return t, events.states[events.rows[k] + events.jumps[k]]
        return t, events.states[events.rows[np.searchsorted(events.t, t, side="left")]]


@dataclass(frozen=True)
class Times:
    """Sample times, the same for all runs, or multiples of the period of each."""

    given: tuple[float, ...] = ()
    period: float | str = math.nan
    t_start: float = 0.0
    every: int = 1
    skip: int = 0
    count: int = 0

    def of(self, p: Array) -> Array:
        """Return the times (K,), or (m, K) for parameters (m, np) that the period depends on."""
        if self.given:
            return np.array(self.given)
        multiples = self.skip + self.every * np.arange(1.0, self.count + 1)
        return self.t_start + periods(self.period, p)[..., None] * multiples


@dataclass(frozen=True)
class Sampling:
    """Events or times at which runs are sampled, and the number of samples if it is known."""

    hits: Hits | None = None
    times: Times | None = None
    room: int | None = None


def read_sampling(
    system: FilippovSystem,
    t_eval: ArrayLike | None,
    at: Any,
    t_start: float,
    t_end: float,
    p: Array,
) -> Sampling:
    """Read ``t_eval`` and ``at``, with the parameters (np,) or (m, np) of all runs."""
    if t_eval is not None and at is not None:
        raise OptionError("t_eval and at are both given. Give one of them, and run twice for both.")
    if t_eval is not None:
        given = _given(t_eval, t_start, t_end)
        return Sampling(None, given, len(given.given))
    if at is None:
        return Sampling()
    section = at if isinstance(at, Section) else Section(at)
    if isinstance(section.at, str):
        hits = _hits(system, section, t_start)
        return Sampling(hits, None, hits.count)
    times = _strobe(section, _period(system, section), t_start, t_end, p)
    return Sampling(None, times, times.count)


def sectioned(system: FilippovSystem, at: Any) -> tuple[FilippovSystem, Any]:
    """Add a section that is a function of the states to the system, and refer to it by name."""
    section = at if isinstance(at, Section) else None if at is None else Section(at)
    if section is None or isinstance(section.at, str) or is_real(section.at):
        return system, at
    if not is_function(section.at) or read_period(system, section.at) is not None:
        return system, at
    surface = surface_of(system, section.at)
    if surface is not None:  # the motion may slide there, and stay on it
        name, sign = surface
        return system, replace(section, at=name, direction=sign * section.direction)
    wider = with_section(system, section.at, section.direction)
    return wider, replace(section, at=wider.resets[-1][0], direction=0)


def _period(system: FilippovSystem, section: Section) -> float | str:
    period = read_period(system, section.at)
    if period is None:
        raise OptionError(
            f"at is {section.at!r}, a {type(section.at).__name__}. Give a Section, a name, a kind of "
            'event, a period or an expression, for example at="h0".'
        )
    if section.direction or section.after:
        raise OptionError(
            "at is a period, but has direction= or after=. Give these with a surface, reset or impact only."
        )
    return period


def _hits(system: FilippovSystem, section: Section, t_start: float) -> Hits:
    """Events of a name, or of a kind where nothing has the name."""
    name, letter = str(section.at), None
    surfaces = list(dict.fromkeys(system.surface_names))
    items = {
        "stop": [n for n, _ in system.stops],
        "reset": [n for n, _ in system.resets],
        "impact": list(system.impacts),
    }
    given = dict(system.definition.renamed)
    called = {
        kind: [n for n in names if name in (n, given.get(n))] for kind, names in items.items()
    }
    owners = tuple(kind for kind, names in called.items() if names and name not in surfaces)
    kinds: tuple[str, ...] = owners or (name,)
    names = tuple(n for kind in owners for n in called[kind]) or None
    if name in surfaces:
        kinds, names = KINDS_OF_SECTIONS, (name,)
        if section.direction and name in system.complementarity:
            kinds = ("contact" if section.direction < 0 else "release",)
        elif section.direction:
            letter = _side_before(system, name, section.direction)
    elif section.direction and (owners or name in KINDS_OF_SECTIONS):
        raise OptionError(
            f"direction is {section.direction}, but {name!r} is no surface. Leave it out; stops and "
            "resets have directions of their own."
        )
    elif not owners and name not in KINDS_OF_SECTIONS:
        known = [*surfaces, *items["stop"], *items["reset"], *items["impact"]]
        raise OptionError(
            f"at is {name!r}, which is no name and no kind of event. Give one of the names {known} or "
            f"kinds {list(KINDS_OF_SECTIONS)}, or an expression in states, for example at=x - 1."
        )
    rest = section.every, section.skip, section.count, section.after
    return Hits(kinds, names, letter, *rest, begin=t_start)


def _side_before(system: FilippovSystem, name: str, direction: int) -> tuple[int, str]:
    """Number of a surface in modes, and its letter before it is crossed in a direction."""
    surface = list(dict.fromkeys(system.surface_names)).index(name)
    if len(system.entries[surface]) > 1:
        raise OptionError(
            f"direction is {direction}, but {name!r} is a set, which is reached from all sides. Leave it "
            'out, or give at="entry" or at="exit".'
        )
    return surface, "+" if direction < 0 else "-"


def _given(t_eval: ArrayLike, t_start: float, t_end: float) -> Times:
    try:
        times = real_array(t_eval, "t_eval")
    except PointError as error:
        raise OptionError(
            f"t_eval is {t_eval!r}. Give an array of times, for example "
            "numpy.linspace(t_start, t_end, 101)."
        ) from error
    wrong = None
    if times.ndim != 1 or not times.size:
        wrong = f"has shape {times.shape}"
    elif not np.all(np.isfinite(times)):
        wrong = "has times that are not finite"
    elif np.any(np.diff(times) < 0.0):
        wrong = "has times that decrease"
    elif times[0] < t_start or times[-1] > t_end:
        wrong = f"has times from {times[0]} to {times[-1]}"
    if wrong:
        raise OptionError(
            f"t_eval {wrong}. Give sorted times of shape (K,) from t_start = {t_start} to "
            f"t_end = {t_end}."
        )
    return Times(given=tuple(times.tolist()))


def _strobe(section: Section, period: float | str, t_start: float, t_end: float, p: Array) -> Times:
    """Multiples of a period from t_start to t_end, as many as the shortest has."""
    shortest = float(np.fmin.reduce(periods(period, p), axis=None, initial=math.inf))
    fit = (t_end - t_start) / shortest * (1 + 4 * np.finfo(float).eps)
    count = int((math.floor(fit) - section.skip) // section.every)
    if section.count is not None:
        count = min(count, section.count)
    if count < 1:
        raise OptionError(
            f"at needs {section.skip + section.every} periods of length {shortest:.6g}, but the run has "
            f"{fit:.6g}. Raise t_end, or lower skip and every."
        )
    return Times((), period, t_start, section.every, section.skip, count)


def sampled(run: Trajectory, times: Array, read: Array | None) -> tuple[Array, Array]:
    """Return times (K,) and states (K, n) of a run; NaN beyond its end. ``read``: those before it, if known."""
    t, x = np.full(times.shape, np.nan), np.full((times.size, run.x.shape[1]), np.nan)
    last = float(run.t[-1])
    within, ends = times < last, times == last
    t[within | ends] = times[within | ends]
    x[within] = run(times[within]) if read is None else read
    x[ends] = run.x[-1]
    return t, x
