"""The sheet of orbits that slide into two-folds, and the distance of a point of the surface from it.

In n states two-folds h = L1 = L2 = 0 form a set of dimension n - 3, and into each of them slides one orbit
where it is a saddle of the sliding flow in its own time, x' = L2 F1 - L1 F2. Together these orbits are
a sheet of dimension n - 2 in the surface, which has n - 1. Forward orbits beside it diverge, so it
is computed backward: from a two-fold q along the eigenvector e(q) of the rate that leads into it,

    e = -(m F1 - F2)/rate,   L11 m^2 - (L12 + L21) m + L22 = 0,   rate = m L11 - L21 < 0,   m < 0,

with L_ij = F_i . grad L_j, L2 = m L1 and L1 = -1 along e; backward errors shrink. The gap of a point y of
the surface is its distance from the sheet along a direction d across it: a smooth function of y, whose
derivative follows from the same linear equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...flow.follow import follow
from ...flow.names import event_name
from ...flow.status import Status
from ...local.point.surface_point import surface_at
from ...model import Array, ConvergenceError, DegenerateError, FilippovSystem, Parameters, evaluator
from ..runs.legs import Leg, integrate_leg

#: Distance from the two-fold at which sliding orbits begin, relative to the size of the problem; the
#: error is of second order.
_NEAR = 1e-7

#: Largest gap, relative to the size, at which guards of sliding are checked, and the tolerance of that.
_CLOSE, _COARSE = 1e-6, 1e-8

_STEPS = 40
_LAST = 1e-14  # relative size of the last step of Newton's method
_NOISE = 1e-9  # relative size below which steps that do not shrink are rounding


@dataclass(frozen=True, eq=False)
class Meeting:
    """The point of the sheet next to a point of the surface."""

    fold: Array
    duration: float
    left: float
    gap: float
    across: Array
    slope: Array
    fault: str


class TwoFoldSheet:
    """The sheet of orbits that slide into the two-folds about one of them."""

    def __init__(
        self, system: FilippovSystem, fold: Array, size: float, parameters: Parameters | None = None
    ):
        self.system, self.size, self.fold = system, size, fold
        self.where, _ = surface_at(system, fold, parameters)
        self.parameters = self.where.parameters
        self._values = self.where.values
        self.root = self._root(fold)
        direction, _ = self._direction(fold)
        self.distance = _NEAR * size / float(np.linalg.norm(direction))

    def _slopes(self, x: Array) -> list[tuple[float, float]]:
        """Both slopes m = L2/L1 of the eigenvectors, with their rates; the smaller slope first."""
        second = self.where.at(x).second
        a, b, c = second["L11"], second["L12"] + second["L21"], second["L22"]
        square = b * b - 4.0 * a * c
        if not square > 0.0 or a == 0.0:
            return []
        roots = [(b + sign * np.sqrt(square)) / (2.0 * a) for sign in (-1.0, 1.0)]
        return [(float(m), float(m * a - second["L21"])) for m in roots]

    def _root(self, x: Array) -> int:
        """The root of the quadratic that leads into the two-fold from attracting sliding: -1 or 1."""
        found = self._slopes(x)
        inward = [k for k, (m, rate) in enumerate(found) if m < 0.0 > rate]
        strong = [k for k in inward if found[1 - k][1] > found[k][1]]
        if len(inward) != 1 or not strong:
            many = "infinitely many" if inward else "none"
            raise DegenerateError(
                f"of: the two-fold at {x.tolist()} has {many} of the canards into it through attracting "
                "sliding. Give one with exactly one, which divides the orbits beside it."
            )
        return (-1, 1)[inward[0]]

    def _direction(self, x: Array) -> tuple[Array, Array]:
        """The eigenvector e (n,) at a two-fold, and its derivative (n, n)."""
        system, root = self.system, self.root

        def build() -> Sequence[Any]:
            lie = {sides: system.lie_derivative(sides) for sides in ("++", "+-", "-+", "--")}
            a, b, c = lie["++"], lie["+-"] + lie["-+"], lie["--"]
            m = (b + root * (b * b - 4 * a * c) ** 0.5) / (2 * a)
            e = (system.field("-") - m * system.field("+")) / (m * a - lie["-+"])
            return [e, *(system.gradient(e[i]) for i in range(system.dimension))]

        vector, *rows = evaluator(system, ("into two-folds", root), build).copied(
            x, self.parameters
        )
        return vector.ravel(), np.array([row.ravel() for row in rows])

    def _back(self, fold: Array, duration: float) -> tuple[Array, Array, Array]:
        """The point of the sheet a duration before a two-fold; derivatives by both."""
        e, by_fold = self._direction(fold)
        start = fold + self.distance * e
        flow = integrate_leg(self.system, Leg("s"), start, -duration, self.parameters)
        turn = np.eye(fold.size) + self.distance * by_fold
        return flow.end, flow.by_start @ turn, -flow.rate

    def guess(self, point: Array, leaves: Array, duration: float) -> Meeting:
        """A first meeting, from an orbit that slides from a point and leaves close to a two-fold."""
        fold = self.nearest(leaves)
        return Meeting(
            fold, duration, 0.0, 0.0, self._across(point, fold, duration), 0.0 * fold, ""
        )

    def nearest(self, x: Array) -> Array:
        """The two-fold near a point."""
        for _ in range(_STEPS):
            at = self.where.at(x)
            values = np.array([at.h, *at.lie])
            step = np.linalg.lstsq(at.gradients, values, rcond=None)[0]
            x = x - step
            if not np.linalg.norm(step) > 1e-14 * self.size:
                break
        return np.asarray(x)

    def _across(self, point: Array, fold: Array, duration: float) -> Array:
        """A unit vector in the surface across the sheet."""
        _, by_fold, by_time = self._back(fold, duration)
        at = self.where.at(fold)
        along = by_fold @ np.linalg.svd(at.gradients)[2][3:].T
        columns = np.column_stack([along, by_time, self.where.at(point).gradient])
        columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        return np.asarray(np.linalg.svd(columns)[0][:, -1])

    def meet(self, point: Array, near: Meeting | None) -> Meeting:
        """The meeting of a point of the surface, by Newton's method from another one."""
        if near is None:
            near = self.guess(point, self.fold, self._time_to(point))
        n, across = point.size, near.across
        normal = self.where.at(point).gradient
        fold, duration, gap, lift = near.fold, near.duration, near.gap, 0.0
        last = np.inf
        for _ in range(_STEPS):
            x, by_fold, by_time = self._back(fold, duration)
            at = self.where.at(fold)
            values = np.concatenate([[at.h], at.lie, x - point - gap * across - lift * normal])
            matrix = np.zeros((n + 3, n + 3))
            matrix[:3, :n], matrix[3:, :n] = at.gradients, by_fold
            matrix[3:, n], matrix[3:, n + 1], matrix[3:, n + 2] = by_time, -across, -normal
            if not (np.isfinite(values).all() and np.isfinite(matrix).all()):
                break
            step = -np.linalg.solve(matrix, values)
            shrink = 1.0
            if duration + step[n] <= 0.0:  # stay before the two-fold
                shrink = -0.7 * duration / step[n]
            fold = self.nearest(fold + shrink * step[:n])  # sliding orbits end only in two-folds
            duration += shrink * float(step[n])
            gap, lift = gap + shrink * float(step[n + 1]), lift + shrink * float(step[n + 2])
            length = float(np.linalg.norm(np.append(step[:n], step[n + 1]))) / self.size
            if shrink == 1.0 and (length <= _LAST or (length <= _NOISE and length >= 0.25 * last)):
                return self._meeting_at(point, fold, duration, gap, across, matrix)
            last = length
        raise ConvergenceError(
            f"two-fold: Newton's method found no orbit from {np.array2string(point, precision=6)} that "
            f"slides into a two-fold near {self.fold.tolist()}. Give a smaller box.",
            point=point,
        )

    def _meeting_at(
        self, point: Array, fold: Array, duration: float, gap: float, across: Array, matrix: Array
    ) -> Meeting:
        n = point.size
        target = np.zeros(n + 3)
        target[n + 1] = 1.0
        slope = np.asarray(np.linalg.solve(matrix.T, target)[3:], float)
        turned = self._across(point, fold, duration)
        turned = turned if turned @ across >= 0.0 else -turned
        m, rate = self._slopes(fold)[(self.root + 1) // 2]
        left = (m - 1.0) * self.distance / rate
        near = abs(gap) <= _CLOSE * self.size
        fault = self._violation(fold, duration) if near else ""
        return Meeting(fold, duration, left, gap, turned, slope, fault)

    def _violation(self, fold: Array, duration: float) -> str:
        """The guard of sliding that fails on the way to a two-fold; empty if none does."""
        e, _ = self._direction(fold)
        run = follow(
            self.system,
            fold + self.distance * e,
            -duration,
            mode="s",
            parameters=self._values,
            tol=_COARSE,
        )
        if run.status is not Status.REACHED_END:
            return f"the sliding orbit into the two-fold ends before: {run.message}"
        ends = {1: "L1 <= 0", -1: "L2 >= 0"}
        names = {event_name(self.system, "s", "exit", 0, side): ends[side] for side in ends}
        near = 1e-5 * duration
        for event in run.events:
            if event.name in names and event.t > near - duration:
                condition = names[event.name]
                return (
                    f"the condition {condition} of sliding fails {-event.t:.6g} before the two-fold"
                )
        return ""

    def _time_to(self, point: Array) -> float:
        """A first guess of the time of sliding to the two-fold."""
        at = self.where.at(point)
        jump = float(at.lie[1] - at.lie[0])
        if not jump > 0.0:
            return 1.0
        alpha = float(at.lie[1]) / jump
        speed = float(np.linalg.norm(alpha * at.fields[0] + (1.0 - alpha) * at.fields[1]))
        return float(np.linalg.norm(point - self.fold)) / (speed or 1.0)
