"""Equations of a curve of bifurcations in two parameters, with the tests of its codimension-two points.

The test of the event is added to the equations of the branch, and a second parameter is free. At a fold
the Jacobian without the parameters is singular, which a bordered system measures (Griewank & Reddien 1984;
Kuznetsov 2004, sec. 10.2). At a touch inside a leg the time of the touch is one more unknown, at which a guard
and its rate vanish, so that the equations stay regular where the touch comes to an end of its leg. Other tests
are updated along the curve by secants (Broyden 1965): these rows only guide Newton's method, and the accuracy is
that of the test.

On a curve of grazing-sliding the touch is of higher order (L11 = 0), or at a two-fold (L2 = 0), or a multiplier
with contact is 1 or -1, or the orbit touches a second time; on one of crossing- or switching-sliding L11 = 0
turns one into the other. On a curve of Neimark-Sacker points the angle is resonant; where the pair meets at 1
or -1 the curve ends, as the numbers beyond are a neutral saddle's. There and on curves of period doublings the
cubic coefficient of the normal form may vanish.

Source: Kowalczyk, di Bernardo, Champneys et al. 2006 (Int. J. Bifurcation Chaos 16, 601).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...flow.fixed import first_terms
from ...model import Array, DegenerateError, NonsmoothError
from ...model.derivatives.event_maps import surface_map
from ...model.derivatives.variational import guarded_field, states_at
from ...solvers.continuation import Curve, Departure, Point, Secant, Zero
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation
from ..periodic.multipliers import return_map
from ..periodic.orbit import PeriodicOrbit
from ..runs.guards import CONDITIONS
from ..runs.legs import Leg, integrate_leg
from .branch import DIVIDE, BranchCurve
from .conditions import Condition, minima, touching
from .itinerary_changes import grown, soft_switch
from .normal_forms import normal_form, torus_pair
from .unfoldings import contact_at, contact_numbers

TWO_FOLD, SECOND = "two-fold", "a second touch"
CUSP, HIGHER = "tangency of higher order", "touch of higher order"
AT_START, AT_END = "touch at the start", "touch at the end"

#: Tests of an event itself; beyond their zeros it is an event of another kind.
OWN_ENDS = (
    TWO_FOLD,
    SECOND,
    CUSP,
    HIGHER,
    AT_START,
    AT_END,
    "1:1 resonance",
    "1:2 resonance",
    "Hopf",
)

#: Times of two touches of a leg differ by more than this part of its duration.
_APART = 1e-6

#: Speed at a touch, relative to the largest one, of an orbit that comes close to an equilibrium.
_SLOW = 1e-2

#: The end of a curve beyond which its solutions violate guards without a located zero of a test.
VIRTUAL = "virtual"


class EventCurve(Curve):
    """The equations of a branch with two free parameters, and the test of an event."""

    exact = False
    tol = 1e-15  # steps of a secant method shrink less regularly than Newton's

    def __init__(
        self,
        base: BranchCurve,
        name: str,
        start: Array,
        touch: float | None = None,
        *,
        whole: bool = True,
    ):
        self.base, self.name = base, name
        self.columns = len(start) - 2
        base.tests(Point(start, np.zeros(len(start))))  # sets the conditions of an orbit
        self.condition: Condition | None = getattr(base, "known", {}).get(name)
        of = self.condition
        self.touches = of is not None and of.what == "interior"
        self.start, self.scale = start, base.scale
        if self.touches:
            last = base.scale[self.columns - 1]
            self.scale = np.insert(base.scale, self.columns, last)
            self.start = np.insert(
                start, self.columns, self._touch(start) if touch is None else touch
            )
        if name == "fold":
            left, _, right = np.linalg.svd(self._square(start))
            self.border = left[:, -1], right[-1]
        self.regular = self.touches  # rows in closed form
        self.sign = self._bend() if self.touches else 1.0
        self.unit = 1.0
        if not self.touches:
            probe = np.cos(1.0 + np.arange(len(start)))  # a generic direction
            self.unit = abs(self.test(start + 1e-3 * base.scale * probe)) or 1.0
        self.secant = Secant(self._scaled_test, 1.0)
        self.limits: list[Array] = []  # ends, where guards of real points vanish
        self.twins, self.real = set[str](), True
        if whole:
            self.settle(self.start)
            self.real = not self.faults(self.start)

    def settle(self, u: Array) -> None:
        """Leave out tests that vanish with the event, as at its image in a symmetric orbit."""
        tests = self.tests(Point(u, np.zeros(u.size)))
        self.twins = {k for k, v in tests.items() if abs(v) <= 1e-8}

    # unknowns -----------------------------------------------------------------------------------

    def without(self, u: Array) -> Array:
        """The unknowns of the branch: without the time of a touch."""
        return np.delete(u, self.columns) if self.touches else u

    @property
    def problem(self) -> BoundaryProblem:
        """The equations of an orbit."""
        found: BoundaryProblem = self.base.problem  # type: ignore[attr-defined]
        return found

    def parameters_at(self, u: Array) -> Array:
        """All parameters of the system at a point of the curve."""
        return self.base.parameters_at(self.without(u))

    def _touch(self, u: Array) -> float:
        leg, x, duration, p = self._leg(u)
        assert self.condition is not None
        return touching(self.base.system, leg, self.condition, x, duration, p)[0]

    def _leg(self, u: Array) -> tuple[Leg, Array, float, Array]:
        """The leg of the condition, its start, its duration and the parameters, of unknowns of the branch."""
        assert self.condition is not None
        i, (starts, durations) = self.condition.leg, self.problem.split(u[: self.columns])
        return self.problem.legs[i], starts[i], float(durations[i]), self.base.parameters_at(u)

    def grown(self, u: Array, fresh: Sequence[int], by: float) -> Array:
        """Unknowns near an orbit whose legs ``fresh`` last for ``by``."""
        inner, k = self.without(u), self.columns
        found = grown(self.problem, inner[:k], self.base.parameters_at(inner), fresh, by)
        if not self.touches:
            return np.append(found, inner[k:])
        assert self.condition is not None
        before, after = (self.problem.split(v)[1] for v in (inner[:k], found))
        begins = float((after - before)[: self.condition.leg].sum())
        return np.concatenate([found, [u[k] - begins], inner[k:]])

    # equations ----------------------------------------------------------------------------------

    def _scaled_test(self, v: Array) -> Array:
        return np.array([self.test(v * self.scale) / self.unit])

    def _square(self, u: Array) -> Array:
        """Jacobian by the unknowns without the parameters, scaled."""
        return self.base.scaled(u / self.base.scale)[1][:, : self.columns]

    def test(self, u: Array) -> float:
        """The function that vanishes on the curve."""
        if self.name == "fold":
            return self._bordered(u)[0]
        found = self.base.tests(Point(u, np.zeros(u.size)))
        if self.name not in found:
            raise DegenerateError(f"the test of the {self.name} is not defined there")
        return float(found[self.name])

    def _bordered(self, u: Array) -> tuple[float, Array]:
        """The test of a fold, zero where the square Jacobian is singular, and its null vector."""
        b, c = self.border
        matrix = np.block([[self._square(u), b[:, None]], [c[None, :], np.zeros((1, 1))]])
        target = np.zeros(b.size + 1)
        target[-1] = 1.0
        solved = np.linalg.solve(matrix, target)
        return float(solved[-1]), solved[:-1]

    def equations(self, u: Array) -> tuple[Array, Array]:
        inner = self.without(u)
        values, jacobian = self.base.equations(inner)
        if self.touches:
            more, rows = self._touching_rows(u, inner)
            jacobian = np.insert(jacobian, self.columns, 0.0, axis=1)
            return np.append(values, more), np.vstack([jacobian, rows])
        known = self.base.test_row(self.name, u)
        if known is not None:
            value, slope = known
            return np.append(values, value), np.vstack([jacobian, slope])
        test, row = self.secant(u / self.scale)
        return np.append(values, test), np.vstack([jacobian, row / self.scale])

    def _touching_rows(self, u: Array, inner: Array) -> tuple[Array, Array]:
        """The guard and its rate at the touch, and their derivatives by the unknowns."""
        # Only the point of the flow at the touch is needed; both are differentiated numerically there.
        leg, _, _, p = self._leg(inner)
        assert self.condition is not None
        n, k, free = self.problem.dimension, self.columns, self.base.free
        x, begin, t, share = self.problem.begun_at(inner[:k], self.condition.leg, float(u[k]))
        flow = integrate_leg(self.base.system, leg, x, t, p, free)
        terms, y, rows = self._guard(leg, flow.end, p), flow.end, np.zeros((2, u.size))
        by_state = np.empty((2, y.size))
        for j in range(y.size):
            step = 1e-6 * max(abs(float(y[j])), 1e-3) * np.eye(y.size)[j]
            change = self._guard(leg, y + step, p) - self._guard(leg, y - step, p)
            by_state[:, j] = change[:2] / (2.0 * step[j])
        rows[:, begin : begin + n] = by_state @ flow.by_start
        rows[:, k] = terms[1], 2.0 * terms[2]
        rows[:, k - len(self.problem.legs) + self.condition.leg] -= share * rows[:, k]
        for j, index in enumerate(free):
            step = 1e-6 * max(abs(float(p[index])), 1e-3) * np.eye(p.size)[index]
            change = self._guard(leg, y, p + step) - self._guard(leg, y, p - step)
            rows[:, k + 1 + j] = change[:2] / (2.0 * step[index])
            rows[:, k + 1 + j] += by_state @ flow.by_parameters[:, j]
        return terms[:2], rows

    def _guard(self, leg: Leg, y: Array, p: Array) -> Array:
        """Coefficients of the guard of the condition along the flow from a state."""
        field = guarded_field(self.base.system, leg.mode)
        assert self.condition is not None
        return np.asarray(
            first_terms(field, states_at(self.base.system, leg.mode, y, p), p)[1][
                field.motion.guards.index(self.condition.guard)
            ]
        )

    def terms(self, u: Array) -> Array:
        """Coefficients of the guard in the time from the touch: its value, rate, half the second derivative, ..."""
        inner = self.without(u)
        leg, _, _, p = self._leg(inner)
        assert self.condition is not None
        x, _, t, _ = self.problem.begun_at(
            inner[: self.columns], self.condition.leg, float(u[self.columns])
        )
        return self._guard(leg, integrate_leg(self.base.system, leg, x, t, p).end, p)

    def renewed(self, point: Point) -> Point | None:
        tangent = self.base.turned(self.without(point.u), self.without(point.tangent))
        if tangent is None:
            return None
        tangent = np.insert(tangent, self.columns, 0.0) if self.touches else tangent
        tangent = self.along(self.scaled(point.u / self.scale)[1], tangent)[0]
        return self.point(point.u, tangent, tangent, point.arclength)

    def singular(self, name: str) -> bool:
        return self.base.singular(name)

    # ends ---------------------------------------------------------------------------------------

    def ends(self, name: str) -> bool:
        return self.base.ends_curve(self.name, name) and (self.real or name in OWN_ENDS)

    def ends_at(self, zero: Zero) -> bool:
        double = self.name == "Hopf" and zero.name == "fold"
        return self.ends(zero.name) or (double and self.base.double_zero(zero.point.u))

    def faults(self, u: Array) -> list[str]:
        """Why a point is virtual: guards that are violated, of the event itself too."""
        inner = self.without(u)
        found = self.base.faults(inner)
        if self.touches:
            found = found + [name for name, value in self._sides(u).items() if value < -1e-9]
        return found

    def _sides(self, u: Array) -> dict[str, float]:
        """Functions that are positive while a touch is an extremum inside its leg."""
        leg, _, duration, _ = self._leg(self.without(u))
        t, found = float(u[self.columns]), {HIGHER: self.sign * float(self.terms(u)[2])}
        # an orbit without events begins nowhere
        return found if leg.timed else found | {AT_START: t, AT_END: duration - t}

    def _bend(self) -> float:
        """The sign of a guard's second derivative at an extremum near which it is satisfied."""
        assert self.condition is not None and self.condition.guard is not None
        guard = self.condition.guard
        if guard.kind not in CONDITIONS:
            return 1.0
        return -float(guard.side) or float(np.sign(self.terms(self.start)[2])) or 1.0

    def passed(self, last: Point, new: Point, ending: Zero | None) -> bool:
        """Whether a step leads to virtual points without a located end."""
        return self.real and ending is None and bool(self.faults(new.u))

    def out(self, u: Array) -> str:
        if self.real and self.faults(u):
            return VIRTUAL
        inner = self.without(u)
        if self.base.is_to_divide(inner) and self.base.redivided(inner)[0] is not self.base:
            return DIVIDE
        return ""

    def comes_to(self, u: Array) -> str:
        """The limit of a touch where steps become short: an equilibrium to which the orbit shrinks, or that it passes ever
        more slowly; empty where it is neither."""
        if not self.touches or self.base.system.time_dependent:
            return ""
        assert self.condition is not None
        inner, n = self.without(u), self.base.system.dimension
        if self.base.is_at_hopf(inner, self.condition.guard):
            return "Hopf"
        at = self.problem.evaluate(inner[: self.columns], self.base.parameters_at(inner))
        leg, x, _, p = self._leg(inner)
        slow = integrate_leg(self.base.system, leg, x, float(u[self.columns]), p).rate
        fast = np.linalg.norm(
            np.vstack([at.flows.rate, at.flows.before[: len(at.starts)]])[:, :n], axis=1
        )
        return "period diverges" if np.linalg.norm(slow[:n]) < _SLOW * fast.max() else ""

    def again(self, u: Array, tangent: Array) -> Departure | None:
        """The same curve with legs divided where derivatives grow along them; None where nothing changes."""
        base, start = self.base.redivided(self.without(u))
        if base is self.base:
            return None
        curve = EventCurve(
            base, self.name, start, float(u[self.columns]) if self.touches else None, whole=False
        )
        curve.real = self.real
        curve.settle(curve.start)
        way, kept = np.zeros(curve.scale.size), self.problem.undivided(self.without(u)).size
        kept += self.touches + 2
        way[-kept:] = tangent[-kept:]
        way /= np.linalg.norm(way)
        found = curve.correct(curve.start, way)
        if found is None:
            return None
        return Departure(curve, [found], curve.along(curve.scaled(found / curve.scale)[1], way)[0])

    # tests --------------------------------------------------------------------------------------

    def tests(self, point: Point) -> Mapping[str, float]:
        """Functions that vanish at other events and at degenerate ones."""
        u = self.without(point.u)
        found = dict(self.base.tests(Point(u, np.zeros(u.size))))
        found.pop(self.name, None)
        if self.name == "fold":
            found["cusp"] = self._quadratic(u)
        else:
            found["fold"] = float(np.linalg.det(self._square(u)))
        t = float(point.u[self.columns]) if self.touches else None
        further = self.base.codimension_two(self.name, u, t)
        if TWO_FOLD in further:  # the event before is tangent there too
            found = {k: v for k, v in found.items() if not k.startswith("transversality")}
        found |= dict(further) | (self._sides(point.u) if self.touches else {})
        return {k: v for k, v in found.items() if k not in self.twins}

    def _quadratic(self, u: Array) -> float:
        """Quadratic coefficient of a fold, by the change of the Jacobian along its null vector."""
        null = self._bordered(u)[1]
        null = null / np.linalg.norm(null)
        step = np.zeros(u.size)
        step[: self.columns] = 1e-5 * null * self.scale[: self.columns]
        change = (self._square(u + step) - self._square(u - step)) @ null / 2e-5
        left = np.linalg.svd(self._square(u))[0][:, -1]
        return float(left @ change) * np.sign(left @ self.border[0])

    def describe(self, u: Array) -> Any:
        """The solution at a point of the curve, with the guards that it violates."""
        found = self.base.describe(self.without(u))
        if isinstance(found, PeriodicOrbit) and not any(np.array_equal(u, v) for v in self.limits):
            return replace(found, faults=tuple(self.faults(u)))
        return found


# Tests of orbits --------------------------------------------------------------------------------------

#: Cosines of the angles of resonances.
_RESONANCES = {"1:1": 1.0, "1:2": -1.0, "1:3": -0.5, "1:4": 0.0}


def degenerate_tests(
    problem: BoundaryProblem,
    condition: Condition | None,
    name: str,
    at: Evaluation,
    p: Array,
    touch: float | None,
) -> dict[str, float]:
    """Functions that vanish at points of codimension two on the curve of one event of orbits."""
    if name == "Neimark-Sacker":
        return _resonances(problem, at) | _cubic(problem, at, p, name)
    if name in ("period doubling", "pitchfork"):
        return _cubic(problem, at, p, name)
    if condition is None or condition.guard is None:
        return {}
    if touch is not None:
        return _touches(problem, condition, at, p, touch)
    return _beginnings(problem, condition, at, p) if condition.what == "start" else {}


def _cubic(problem: BoundaryProblem, at: Evaluation, p: Array, name: str) -> dict[str, float]:
    """The coefficient of the normal form, at whose zeros a curve of folds begins."""
    kind = "Chenciner" if name == "Neimark-Sacker" else f"degenerate {name}"
    try:
        found = normal_form(problem, at, p, name)
    except np.linalg.LinAlgError:  # another multiplier is 1
        return {}
    return {kind: next(iter(found.values()))} if found else {}


def _resonances(problem: BoundaryProblem, at: Evaluation) -> dict[str, float]:
    values = np.linalg.eigvals(return_map(problem, at))
    pair = torus_pair(values)
    cosine = float((values[pair[0]] + values[pair[1]]).real) / 2.0
    found = {f"{ratio} resonance": cosine - value for ratio, value in _RESONANCES.items()}
    others = np.delete(values, pair)  # the pair itself passes 1 and -1 at the ends of the curve
    found["fold"] = float(np.prod(1.0 - others[np.abs(others) > 1e-9]).real)
    found["period doubling"] = float(np.prod(1.0 + others[np.abs(others) > 1e-9]).real)
    return found


def _touches(
    problem: BoundaryProblem, condition: Condition, at: Evaluation, p: Array, touch: float
) -> dict[str, float]:
    i, guard = condition.leg, condition.guard
    assert guard is not None
    leg, x, duration = problem.legs[i], at.starts[i], float(at.durations[i])
    found: dict[str, float] = {}
    near = minima(problem.system, leg, guard, x, duration, p)
    others = [value for t, value in near if abs(t - touch) > _APART * duration]
    if others:
        found[SECOND] = min(others)
    if guard.kind != "surface" or soft_switch(problem, leg, guard.element):
        return found  # nothing slides beyond
    y = integrate_leg(problem.system, leg, x, touch, p).end[: problem.dimension]
    try:
        _, other, _ = contact_at(problem, leg, guard.element, guard.side, y, p)
    except NonsmoothError:
        return found  # the leg slides elsewhere
    normal = guard.side * surface_map(problem.system, guard.element)(y, p).gradient
    found[TWO_FOLD] = float(normal[: other.size] @ other)
    with np.errstate(all="ignore"):  # at the two-fold itself the map has a pole
        try:
            numbers = contact_numbers(problem, replace(condition, t=touch), at, p)
        except (NonsmoothError, np.linalg.LinAlgError):
            return found
    found["fold with contact"] = numbers["det(I - A_i)"]
    found["period doubling with contact"] = numbers["det(I + A_i)"]
    return {key: value for key, value in found.items() if np.isfinite(value)}


def _beginnings(
    problem: BoundaryProblem, condition: Condition, at: Evaluation, p: Array
) -> dict[str, float]:
    i, guard, system = condition.leg, condition.guard, problem.system
    field = guarded_field(system, problem.legs[i].mode)
    k = field.motion.guards.index(guard)
    y = states_at(system, problem.legs[i].mode, at.starts[i], p)
    order = 2 if problem.legs[i - 1].kind == "crossing" else 1
    before = at.events[i - 1]
    rate = at.by_leg[i - 1].rate
    return {
        CUSP: float(first_terms(field, y, p)[1][k, order]),
        TWO_FOLD: float(before.gradient @ rate),
    }
