"""Boundary value problem of a periodic orbit some of whose legs are divided: multiple shooting inside legs.

Where derivatives grow along a leg, the linearisation of Newton's method holds only very near the orbit. The leg is
divided into parts of equal duration, whose starts are unknowns too. Source: Stoer & Bulirsch 2002, sec. 7.3.5.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...flow.fixed import TOLERANCE
from ...model import Array, ConvergenceError
from ..runs.leg_integration import LegFlows
from ..runs.legs import Leg, integrate_leg
from .boundary_value_problem import BoundaryProblem, Evaluation

#: Growth of derivatives on a part of a leg beyond which it is divided, and to which; in units of the orbit.
_GROWN, _PART = 1e4, 1e2

#: Most parts of a leg.
_MOST = 256


@dataclass(frozen=True, eq=False)
class DividedProblem(BoundaryProblem):
    """Equations of legs in parts; the unknowns begin with the starts (M, n) of all parts but the first ones."""

    #: How many parts each leg has.
    parts: tuple[int, ...] = ()

    @cached_property
    def size(self) -> int:
        return self._inner + len(self.legs) * (self.dimension + 1)

    @cached_property
    def has_many(self) -> bool:
        return False

    @cached_property
    def whole(self) -> BoundaryProblem:
        """The same equations with undivided legs."""
        given = {f.name: getattr(self, f.name) for f in fields(BoundaryProblem) if f.init}
        return BoundaryProblem(**given)

    def undivided(self, u: Array) -> Array:
        return u[self._inner : self.size]

    def split(self, u: Array) -> tuple[Array, Array]:
        return super().split(u[self._inner :] if u.size >= self.size else u)

    def scales(self, u: Array, p: Array | None = None) -> Array:
        sizes = super().scales(u, p)
        return np.concatenate([np.resize(sizes[: self.dimension], self._inner), sizes])

    @cached_property
    def _inner(self) -> int:
        """Number of unknowns inside of legs."""
        return (sum(self.parts) - len(self.parts)) * self.dimension

    @cached_property
    def of_parts(self) -> BoundaryProblem:
        """The same orbit with the parts as its legs."""
        legs = [
            part for leg, k in zip(self.legs, self.parts, strict=True) for part in _parts(leg, k)
        ]
        return replace(self.whole, legs=tuple(legs))

    @cached_property
    def _parts(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """The leg of each part, the first and the last part of each leg."""
        ends = np.cumsum(self.parts)
        return np.repeat(np.arange(len(self.parts)), self.parts), ends - self.parts, ends - 1

    def _spread(self, u: Array) -> Array:
        """Unknowns of the problem of the parts."""
        (leg, first, _), (starts, durations) = self._parts, self.split(u)
        every = np.empty((leg.size, self.dimension))
        inside = np.setdiff1d(np.arange(leg.size), first)
        every[first], every[inside] = starts, u[: self._inner].reshape(-1, self.dimension)
        return self.of_parts.pack(every, (durations / self.parts)[leg])

    def evaluate(
        self, u: Array, p: Array, chosen: tuple[int, ...] = (), tol: float = TOLERANCE
    ) -> Evaluation:
        leg, first, last = self._parts
        at, (starts, durations) = (
            self.of_parts.evaluate(self._spread(u), p, chosen, tol),
            self.split(u),
        )
        count, n = leg.size, self.dimension
        inside = np.setdiff1d(np.arange(count), first)
        states = np.arange(count * n).reshape(count, n)
        inner = np.setdiff1d(np.arange(count), last)
        rows = np.concatenate([states[inner].ravel(), states[last].ravel(), count * n + last])
        columns = np.concatenate([states[inside].ravel(), states[first].ravel()])
        shares = np.zeros((count, len(self.legs)))
        shares[np.arange(count), leg] = 1.0 / np.asarray(self.parts)[leg]
        by_time = at.whole[rows, count * n : count * (n + 1)] @ shares
        by_p = at.whole[rows, count * (n + 1) :]
        whole = np.hstack([at.whole[np.ix_(rows, columns)], by_time, by_p])
        residual, flows = at.residual[rows], _joined(at.flows, first, last)
        return Evaluation(residual, whole, flows, starts, durations, at.allowed, at)

    def residual(self, u: Array, p: Array, extended: bool = False) -> Array | None:
        return None

    def begun_at(self, u: Array, i: int, t: float) -> tuple[Array, int, float, float]:
        starts, durations = self.split(u)
        k, n = self.parts[i], self.dimension
        j = min(max(int(k * t / durations[i]), 0), k - 1) if durations[i] > 0.0 else 0
        if j == 0:
            return starts[i], self._inner + i * n, t, 0.0
        at = (sum(self.parts[:i]) - i + j - 1) * n
        return u[at : at + n], at, t - j / k * durations[i], j / k

    def parts_of(self, i: int) -> range:
        _, first, last = self._parts
        return range(int(first[i]), int(last[i]) + 1)


def _parts(leg: Leg, count: int) -> list[Leg]:
    return [*[Leg(leg.mode, discrete=leg.discrete, left=leg.left)] * (count - 1), leg]


def _joined(parts: LegFlows, first: NDArray[Any], last: NDArray[Any]) -> LegFlows:
    """Flows of whole legs from those of their parts."""
    n = parts.by_start.shape[2]
    by_start, by_parameters = parts.by_start[last].copy(), parts.by_parameters[last].copy()
    for i, (a, b) in enumerate(zip(first, last, strict=True)):
        x, by_p = np.eye(n), np.zeros((n, by_parameters.shape[2]))
        with np.errstate(over="ignore", invalid="ignore"):  # far from the orbit
            for k in range(a, b):
                x, by_p = (
                    parts.by_start[k, :n] @ x,
                    parts.by_start[k, :n] @ by_p + parts.by_parameters[k, :n],
                )
            by_parameters[i] += by_start[i] @ by_p
            by_start[i] = by_start[i] @ x
    taken = {f.name: getattr(parts, f.name)[last] for f in fields(parts) if f.name != "sizes"}
    taken |= {"before": parts.before[first], "by_start": by_start, "by_parameters": by_parameters}
    return LegFlows(tuple(parts.sizes[k] for k in last), **taken)


def _divisible(problem: BoundaryProblem) -> bool:
    """Not an orbit without events, whose start may be where it varies least."""
    limits = any(leg.repeats for leg in problem.legs)
    phased = problem.phase is not None
    return not (limits or phased or problem.system.sets or problem.labels is not None)


def to_divide(problem: BoundaryProblem, at: Evaluation) -> bool:
    """Whether derivatives grow so much on a leg, or a part of one, that it should be divided."""
    return not growth(problem, at, (at.parts or at).flows) <= _GROWN


def growth(problem: BoundaryProblem, at: Evaluation, flows: LegFlows) -> float:
    """The largest derivative of the end of a leg, or a part of one, by its start, in units of the orbit."""
    if not _divisible(problem):
        return 0.0
    n, units = problem.dimension, np.array(problem.sizes(at.starts, at.durations)[0])
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.abs(flows.by_start[:, :n] * units / units[:, None]).max(initial=0.0))


def divided(problem: BoundaryProblem, u: Array, p: Array) -> tuple[BoundaryProblem, Array]:
    """Legs divided by the growth of derivatives along them; the same where nothing changes."""
    n, whole = problem.dimension, problem.whole
    if not _divisible(problem):
        return problem, u
    plain = problem.undivided(u)
    starts, durations = whole.split(plain)
    units = whole.scales(plain)[:n]
    known = [x[None] for x in starts]
    if isinstance(problem, DividedProblem):
        every = problem.of_parts.split(problem._spread(u))[0]
        known = [every[list(problem.parts_of(i))] for i in range(len(starts))]
    parts, inner = list[int](), list[Array]()
    for leg, nodes, duration in zip(whole.legs, known, durations, strict=True):
        for count in len(nodes) * 2 ** np.arange(12):
            found, largest = _nodes(problem, leg, nodes, float(duration), int(count), units, p)
            if found is None or count > _MOST:
                return problem, u
            if largest <= (_GROWN if count == len(nodes) else _PART):
                break
        parts.append(int(count))
        inner += [x for x in found[1:]] if found is not None else []
    if parts == [len(nodes) for nodes in known]:
        return problem, u
    given = {f.name: getattr(whole, f.name) for f in fields(BoundaryProblem) if f.init}
    return DividedProblem(**given, parts=tuple(parts)), np.concatenate([np.ravel(inner), plain])


def _nodes(
    problem: BoundaryProblem,
    leg: Leg,
    nodes: Array,
    duration: float,
    count: int,
    units: Array,
    p: Array,
) -> tuple[Array | None, float]:
    """Starts of ``count`` parts of a leg, from those of fewer, and the largest growth on one."""
    n, each, largest, found = problem.dimension, count // len(nodes), 0.0, list[Array]()
    for node in nodes:
        x = node
        for _ in range(each):
            found.append(x)
            try:
                flow = integrate_leg(problem.system, leg, x, duration / count, p)
            except ConvergenceError:
                return None, largest
            x = flow.end[:n]
            size = np.abs(flow.by_start[:n] * units / units[:, None])
            largest = max(largest, float(size.max()))
    return np.array(found), largest
