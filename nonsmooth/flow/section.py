"""Where a run is looked at: at events of a name or kind, at multiples of a period, at given times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model import Array, OptionError, periods, whole
from .constants import KINDS
from .saving import savable
from .trajectory import Event

#: Kinds of events that a section can be at: all but the end.
KINDS_OF_SECTIONS = KINDS[:-1]


@savable()
@dataclass(frozen=True)
class Section:
    """Where a run is looked at, for Poincare maps, stroboscopic pictures and bifurcation diagrams.

    Parameters
    ----------
    at : str, number or expression
        A name: of a surface (``"h0"``, ``"h1"``, ...), a stop, a reset or an impact (all to which it
        was given), or else a kind of event (``"crossing"``, ``"entry"``, ``"exit"``, ``"reset"``, ...). A number, or an
        expression in parameters, is a period: the run is looked at after each, from ``t_start``. An
        expression in states is a section of its own: the system gets a reset named ``"section"``
        where it is zero, which changes nothing. One that is a surface of the system, written alike,
        means that surface.
    direction : {-1, 0, 1}, optional
        Of a surface or expression: only where it falls, either way, only where it rises. Stops and
        resets have directions of their own.
    every : int, optional
        Keep each ``every``-th hit.
    skip : int, optional
        Hits that are passed over before, to let transients die out.
    count : int, optional
        How many to keep. A run ends with the last of them, STOPPED; one at a period goes on in
        ensembles, where the periods differ.
    after : bool, optional
        The state after a reset or an impact instead of the one before.

    Notes
    -----
    What happens at the start itself, to rounding, is no hit: a map from a section leads back to it.

    Raises
    ------
    OptionError
        A direction other than -1, 0 and 1; a number of hits that is not positive or whole. An unknown
        name is refused by what the section is given to, which knows the system.

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
                "direction: expected -1 (falling), 0 (both) or 1 (rising), received "
                f"{self.direction!r}."
            )
        for name, least in (("every", 1), ("skip", 0), ("count", 1)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, whole(value, name, least=least))


@dataclass(frozen=True)
class Hits:
    """Events that a section keeps."""

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
        """Number of the hit that ends a run."""
        return math.inf if self.count is None else self.skip + self.every * self.count

    def meets(self, t: float, kind: str, name: str, before: str) -> bool:
        """Whether an event is a hit."""
        if (
            t <= self.begin
            or kind not in self.kinds
            or (self.names is not None and name not in self.names)
        ):
            return False
        return self.letter is None or before[self.letter[0]] == self.letter[1]

    def select(self, events: Sequence[Event]) -> list[Event]:
        """Return the hits that are kept."""
        hits = [e for e in events if self.meets(e.t, e.kind, e.name, e.mode_before)]
        kept = hits[self.skip + self.every - 1 :: self.every]
        return kept if self.count is None else kept[: self.count]

    def fill(self, events: Sequence[Event], t: Array, x: Array) -> None:
        """Write the hits that are kept into arrays (K,) and (K, n)."""
        for k, event in enumerate(self.select(events)[: len(t)]):
            t[k], x[k] = event.t, event.x_after if self.after else event.x


@dataclass(frozen=True)
class Times:
    """Times at which runs are looked at, the same for all, or multiples of each one's own
    period."""

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
