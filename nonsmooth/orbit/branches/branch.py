"""Branches of solutions as one parameter varies: what is returned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from ...local.read_only import ReadOnly
from ...model import Array, NonsmoothError, PointError, explain, real
from ...notebook import card
from ...solvers.continuation import Point


class BranchEnd(Enum):
    """Why a branch ends.

    It reached a bound of the parameter (REACHED_BOUND), closed (CLOSED), met an event that nothing
    continues (EVENT), has a period that diverges (PERIOD_DIVERGES), needs shorter steps than there are
    (STEP_TOO_SMALL), has the number of points asked for (TOO_MANY_POINTS), or was interrupted
    (INTERRUPTED).
    """

    REACHED_BOUND = "bound"
    CLOSED = "closed"
    EVENT = "event"
    PERIOD_DIVERGES = "period"
    STEP_TOO_SMALL = "step too small"
    TOO_MANY_POINTS = "points"
    INTERRUPTED = "interrupted"

    def __str__(self) -> str:
        return self.name

    @property
    def advice(self) -> str:
        """The reason in a sentence, with what to do."""
        return _ADVICE[self]


_ADVICE = {
    BranchEnd.REACHED_BOUND: "The parameter reached its bound.",
    BranchEnd.CLOSED: "The branch is a closed curve.",
    BranchEnd.EVENT: "The branch ends at an event: nothing continues it, or through=False.",
    BranchEnd.PERIOD_DIVERGES: "The period grows without bound: a homoclinic orbit is near.",
    BranchEnd.STEP_TOO_SMALL: "Steps became too short: the solutions end here, or the equations do.",
    BranchEnd.TOO_MANY_POINTS: "Raise max_points to go on.",
    BranchEnd.INTERRUPTED: "Interrupted; what was computed is here.",
}


@dataclass(frozen=True, eq=False)
class FarSide:
    """What is beyond an event.

    Attributes
    ----------
    itinerary : str
        Or the kind of solution; empty if nothing continues the branch.
    verdict : str
        What becomes of the solutions there, in words.
    numbers : mapping of str to float
        What the verdict rests on.
    """

    itinerary: str = ""
    verdict: str = ""
    numbers: Mapping[str, float] = field(default_factory=lambda: ReadOnly({}))

    def __str__(self) -> str:
        parts = [part for part in (self.itinerary, self.verdict) if part]
        return ": ".join(parts) if parts else "nothing changes"


@dataclass(frozen=True, eq=False, repr=False)
class BranchEvent:
    """A bifurcation on a branch.

    Attributes
    ----------
    kind : str
        ``"fold"``, ``"Hopf"``, ``"period doubling"``, ``"grazing-sliding"``, ...
    parameter : float
        Where the branch parameter is.
    solution
        What is continued, there: an equilibrium or a periodic orbit.
    far_side : FarSide
        What continues the branch beyond the event.
    coefficients : mapping of str to float
        Of normal forms and conditions.
    curve, point, test
        The equations that were continued, the point on them and the test that vanishes there, from
        which ``continue_bifurcation`` and branch switching start.
    """

    kind: str
    parameter: float
    solution: Any
    far_side: FarSide = field(default_factory=FarSide)
    coefficients: Mapping[str, float] = field(default_factory=lambda: ReadOnly({}))
    curve: Any = None
    point: Point | None = None
    test: str = ""

    @property
    def orbit(self) -> Any:
        """The solution, where it is a periodic orbit."""
        return self.solution

    def __repr__(self) -> str:
        return f"BranchEvent({self.kind!r}, {self.parameter:.10g}, {self.far_side})"


def _beside(choices: Sequence[tuple[Any, Point]], wanted: float) -> list[Any]:
    """The solution next to an event, in the first itinerary that holds there."""
    for (curve, point), (_, far) in zip(choices, reversed(choices), strict=True):
        try:
            guess = curve.toward(point.u, wanted, float(far.u[-1]))
            found = curve.solution_at(guess, wanted)
        except NonsmoothError:
            continue
        if not getattr(found, "is_virtual", getattr(found, "status", "") == "virtual"):
            return [found]
    return []


@dataclass(frozen=True, eq=False, repr=False)
class Branch:
    """Solutions as a parameter varies.

    Attributes
    ----------
    parameter : str
        Name of the parameter that varies.
    values : ndarray (k,)
        Of the parameter; a branch that turns back has values more than once.
    solutions : tuple of k solutions
        Equilibria or periodic orbits.
    events : tuple of BranchEvent
        In their order along the branch.
    ends : tuple of two BranchEnd
        Why it ends at its first and its last point.
    nodes : tuple of (curve, Point)
        For each solution the equations and the point of their curve.
    """

    parameter: str
    values: Array
    solutions: tuple[Any, ...]
    events: tuple[BranchEvent, ...]
    ends: tuple[BranchEnd, BranchEnd]
    nodes: tuple[tuple[Any, Point], ...] = ()

    @property
    def orbits(self) -> tuple[Any, ...]:
        """The solutions, where they are periodic orbits."""
        return self.solutions

    def __len__(self) -> int:
        return len(self.values)

    def at(self, value: float) -> list[Any]:
        """Solve for the solutions at a value of the parameter.

        Parameters
        ----------
        value : float
            Of the parameter.

        Returns
        -------
        list
            Equilibria or orbits, in their order along the branch.

        Raises
        ------
        PointError
            A value that the branch does not reach.

        See Also
        --------
        __getitem__ : the only one, or the first.
        """
        wanted = real(value, "value", expected="a finite number", advice="Give one.")
        found = []
        for k in range(len(self) - 1):
            (curve, a), (other, b) = self.nodes[k], self.nodes[k + 1]
            va, vb = curve.value(a.u), other.value(b.u)
            if not min(va, vb) <= wanted <= max(va, vb) or va == vb:
                continue
            if curve is not other:  # beside an event, in the itinerary on whose side it is not
                before = any(event.point is b for event in self.events)
                ways = [(curve, a), (other, b)] if before else [(other, b), (curve, a)]
                found += [] if wanted in (va, vb) else _beside(ways, wanted)
                continue
            if wanted == va and k and self.nodes[k - 1][0] is curve:
                continue  # found as the end of the step before
            guess = a.u + (wanted - va) / (vb - va) * (b.u - a.u)
            found.append(curve.solution_at(guess, wanted))
        if not found:
            raise PointError(
                explain(
                    f"{self.parameter} = {wanted:.10g}",
                    expected=f"a value that the branch reaches, in [{self.values.min():.10g}, "
                    f"{self.values.max():.10g}]",
                    received="one at which it has no solution",
                    advice="Widen the bounds of the continuation.",
                )
            )
        return found

    def __getitem__(self, value: float) -> Any:
        return self.at(value)[0]

    def table(self) -> str:
        """The events as lines of text; empty if there are none."""
        if not self.events:
            return ""
        rows = [f"{self.parameter:>18}  event"]
        rows += [f"{e.parameter:18.12g}  {e.kind}; {e.far_side}" for e in self.events]
        return "\n".join(rows)

    def __str__(self) -> str:
        low, high = self.values.min(), self.values.max()
        return (
            f"Branch of {len(self)} points, {self.parameter} from {low:.10g} to {high:.10g}, "
            f"ends {self.ends[0]} and {self.ends[1]}, {len(self.events)} events\n{self.table()}"
        ).rstrip()

    def _repr_html_(self) -> str:
        """How a notebook shows the branch: its range, its ends, its events."""
        rows = [
            (self.parameter, f"{self.values.min():.10g} to {self.values.max():.10g}"),
            ("ends", f"{self.ends[0]} and {self.ends[1]}"),
            *((f"{e.parameter:.10g}", f"{e.kind}; {e.far_side}") for e in self.events),
        ]
        return card(f"Branch of {len(self)} points", rows)

    def __repr__(self) -> str:
        kinds = ", ".join(f"{e.kind} {e.parameter:.6g}" for e in self.events)
        return f"Branch({self.parameter!r}, {len(self)} points; {kinds or 'no events'})"
