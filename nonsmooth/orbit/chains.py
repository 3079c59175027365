"""The legs of a periodic orbit while its itinerary is edited."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..model import Array
from .boundary import BoundaryProblem
from .conditions import Condition
from .legs import Leg
from .mirrors import TURNED, mirrored


@dataclass(frozen=True, eq=False)
class Edited:
    """An itinerary on the other side of a bifurcation.

    Attributes
    ----------
    problem : BoundaryProblem
    u : ndarray (m,)
        Unknowns of the same orbit in it.
    origin : tuple of int
        For each leg its number before; -1 for a new one, -2 for one that grows from zero.
    test : str
        In an itinerary with fewer legs the condition that vanishes there; else empty.
    """

    problem: BoundaryProblem
    u: Array
    origin: tuple[int, ...]
    test: str = ""

    @property
    def fresh(self) -> tuple[int, ...]:
        """The legs that grow from zero; several in an orbit that is symmetric."""
        return tuple(i for i, before in enumerate(self.origin) if before == -2)


class Chain:
    """The legs of a problem while they are edited."""

    def __init__(self, problem: BoundaryProblem, u: Array, origin: Sequence[int]):
        self.problem, self.legs, self.origin = problem, list(problem.legs), list(origin)
        starts, durations = problem.split(u)
        self.starts, self.durations = [np.array(x) for x in starts], durations.tolist()

    def insert(self, k: int, leg: Leg, start: Array) -> None:
        """A new leg of no duration."""
        self.legs.insert(k, leg)
        self.starts.insert(k, start)
        self.durations.insert(k, 0.0)
        self.origin.insert(k, -1)

    def remove(self, k: int) -> None:
        for rows in (self.legs, self.starts, self.durations, self.origin):
            del rows[k]

    def done(self, *fresh: int, test: Condition | None = None) -> Edited:
        whole = replace(self.problem, legs=tuple(self.legs))
        u = whole.pack(np.array(self.starts), np.array(self.durations))
        for k in fresh:
            self.origin[k] = -2
        return Edited(whole, u, tuple(self.origin), "" if test is None else test.name)


def mode_after(leg: Leg) -> str:
    """The mode that follows the event of a leg, where its letters tell it; else empty."""
    if leg.kind not in ("crossing", "entry", "exit"):
        return ""
    if leg.name.startswith("L_"):
        k = leg.mode.index("s")
        letter = "+" if leg.name == "L_F1 h" else "-"
    else:
        k = int(leg.name.removeprefix("lambda").removeprefix("h"))
        turned = leg.mode[k].translate(TURNED)
        letter = {"crossing": turned, "entry": "s"}.get(leg.kind, "+" if leg.side > 0 else "-")
    return leg.mode[:k] + letter + leg.mode[k + 1 :]


def with_letter(mode: str, surface: int, letter: str) -> str:
    return mode[:surface] + letter + mode[surface + 1 :]


def rotated(before: Edited, k: int, p: Array) -> Edited:
    """The same orbit from leg ``k``; legs moved to the end are those of the next round."""
    problem, (starts, durations) = before.problem, before.problem.split(before.u)
    legs = (*problem.legs[k:], *(mirrored(problem, leg) for leg in problem.legs[:k]))
    shift = np.zeros(problem.dimension)
    if problem.forcing is not None:
        shift[-1] = problem.advance(p)[0]
    back = np.linalg.inv(problem.wrap)
    moved = [*starts[k:], *(back @ (x + shift) for x in starts[:k])]
    whole = replace(problem, legs=legs)
    u = whole.pack(np.array(moved), np.concatenate([durations[k:], durations[:k]]))
    return Edited(whole, u, (*before.origin[k:], *before.origin[:k]))
