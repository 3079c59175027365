"""Periodic orbits as a parameter varies, through the bifurcations that change their itineraries.

The boundary value problem of a fixed itinerary is continued by :mod:`nonsmooth.continuation`. What
ends an itinerary is a zero of one of its tests (``conditions``). Of the two itineraries that meet
there the one with fewer legs is regular, so the event is located in it; then the branch goes on in
the other one (``edits``).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..local.checks import positive
from ..local.newton import converge
from ..local.read_only import ReadOnly
from ..model import Array, DefinitionError, NonsmoothError, explain, whole
from .boundary import BoundaryProblem, Evaluation
from .branch import Branch, BranchEvent, FarSide
from .branch_curves import BranchCurve, check_bounds, follow_branch
from .conditions import Condition, condition_row, conditions_of, is_smooth
from .continuation import Departure, Point, Zero
from .edits import Edited, edited, kind_of
from .elimination import applies, eliminated
from .far_side import far_side
from .periodic import PeriodicOrbit, faults_of, named

#: Durations, or distances along the branch, at which it leaves an event; relative to the orbit.
_STARTS = (1e-4, 1e-3, 1e-2, 1e-5)

#: Equations of more unknowns are solved from leg to leg.
_MANY = 24

#: What names an event of which several conditions vanish.
_PRIORITY = ("duration", "start", "end", "interior", "transversality")

#: An orbit this many times as long as the first one is near a homoclinic orbit.
_LONG = 10.0


class OrbitCurve(BranchCurve):
    """Periodic orbits of one itinerary in the unknowns (starts, durations, parameters).

    Parameters
    ----------
    problem : BoundaryProblem
    p : ndarray
        All parameters.
    free : tuple of int
        Those that vary.
    scale : ndarray
    longest : float
        Where the period counts as divergent.
    """

    def __init__(
        self,
        problem: BoundaryProblem,
        p: Array,
        free: tuple[int, ...],
        widths: Array,
        u: Array,
        longest: float,
    ):
        self.problem, self.p, self.free, self.longest = problem, p, free, longest
        self.system, self.widths = problem.system, widths
        self.scale = np.append(problem.scales(u), widths)
        self.known: dict[str, Condition] = {}
        self._many = problem.size > _MANY and applies(problem)
        self._last: tuple[bytes, Evaluation] | None = None

    # equations ----------------------------------------------------------------------------------

    def parameters_at(self, u: Array) -> Array:
        p = self.p.copy()
        p[list(self.free)] = u[-len(self.free) :]
        return p

    def freed(self, u: Array, free: tuple[int, ...], widths: Array) -> tuple[BranchCurve, Array]:
        p, unknowns = self.parameters_at(u), u[: self.problem.size]
        curve = OrbitCurve(self.problem, p, free, widths, unknowns, self.longest)
        curve.known = self.known
        return curve, np.append(unknowns, p[list(free)])

    def with_problem(self, problem: BoundaryProblem, u: Array) -> OrbitCurve:
        """The same parameters with another itinerary."""
        return OrbitCurve(problem, self.p, self.free, self.widths, u, self.longest)

    def evaluation(self, u: Array) -> Evaluation:
        """The equations at a point, computed once."""
        key = u.tobytes()
        if self._last is None or self._last[0] != key:
            p, unknowns = self.parameters_at(u), u[: self.problem.size]
            self._last = key, self.problem.evaluate(unknowns, p, self.free)
        return self._last[1]

    def equations(self, u: Array) -> tuple[Array, Array]:
        at = self.evaluation(u)
        return at.residual, np.hstack([at.jacobian, at.by_parameters])

    def solve(self, matrix: Array, right: Array) -> Array:
        if not self._many:
            return super().solve(matrix, right)
        return eliminated(self.problem, matrix, right).solution()

    def determinant(self, matrix: Array) -> float:
        if not self._many:
            return super().determinant(matrix)
        return eliminated(self.problem, matrix, np.zeros(len(matrix))).determinant()

    def tests(self, point: Point) -> Mapping[str, float]:
        return conditions_of(
            self.problem, self.evaluation(point.u), self.parameters_at(point.u), self.known
        )

    def ends(self, name: str) -> bool:
        return not is_smooth(name)

    def out(self, u: Array) -> str:
        period = float(u[: self.problem.size][-len(self.problem.legs) :].sum())
        return "period diverges" if period > self.longest else ""

    def faults(self, u: Array) -> list[str]:
        """What the guards contradict."""
        return faults_of(self.problem, self.evaluation(u), self.parameters_at(u))

    # results ------------------------------------------------------------------------------------

    def describe(self, u: Array) -> PeriodicOrbit:
        p, at = self.parameters_at(u), self.evaluation(u)
        unknowns = np.array(u[: self.problem.size])
        return PeriodicOrbit(self.system, named(self.system, p), self.problem, unknowns, at, 0)

    def test_row(self, test: str, u: Array) -> tuple[float, Array] | None:
        if test not in self.known:
            return None
        p, unknowns = self.parameters_at(u), u[: self.problem.size]
        return condition_row(self.problem, unknowns, p, self.free, self.known[test])

    def named(self, test: str, u: Array) -> str:
        if is_smooth(test) or test not in self.known:
            return test
        condition = self.known[test]
        return kind_of(self.problem, condition, self.evaluation(u), self.parameters_at(u))

    def event(self, zero: Zero) -> BranchEvent | None:
        u = zero.point.u
        if is_smooth(zero.name):
            return self._smooth_event(zero)
        conditions = self._vanishing(zero)
        at, p = self.evaluation(u), self.parameters_at(u)
        kind = kind_of(self.problem, conditions[0], at, p)
        beyond = self._edited(kind, conditions, u, p)
        if beyond is None or not beyond.test:
            word = "" if beyond is None else _word(beyond.problem)
            side = far_side(self.problem, kind, conditions[0], at, p, word)
            return self._event(kind, self, zero.point, conditions[0].name, side)
        word, curve = _word(beyond.problem), self.with_problem(beyond.problem, beyond.u)
        point = curve.located(np.append(beyond.u, u[-len(self.free) :]), beyond.test)
        if point is None:
            side = FarSide(word, "not located on the side with fewer legs")
            return self._event(kind, self, zero.point, conditions[0].name, side)
        at, p = curve.evaluation(point.u), curve.parameters_at(point.u)
        side = far_side(curve.problem, kind, curve.known[beyond.test], at, p, word)
        return self._event(kind, curve, point, beyond.test, side)

    def _vanishing(self, zero: Zero) -> list[Condition]:
        """Conditions that vanish together at a zero, those that name the event.

        Where a leg vanishes the events beside it are tangent too; an orbit that is symmetric has
        each event several times.
        """
        small = [self.known[zero.name]]
        small += [self.known[n] for n in zero.together if n != zero.name and not is_smooth(n)]
        first = min(small, key=lambda c: _PRIORITY.index(c.what))
        kin = [c for c in small if c.what == first.what and c is not first]
        return sorted([first, *kin], key=lambda c: -c.leg)

    def _event(
        self, kind: str, curve: OrbitCurve, point: Point, test: str, side: FarSide
    ) -> BranchEvent:
        return BranchEvent(
            kind,
            float(point.u[-1]),
            curve.describe(point.u),
            side,
            side.numbers,
            curve,
            point,
            test,
        )

    def _smooth_event(self, zero: Zero) -> BranchEvent | None:
        u = zero.point.u
        orbit, words, numbers = self.describe(u), "", {}
        if zero.name == "fold":
            words = "two orbits meet and vanish"
        elif zero.name == "branch point":
            words = "branches cross"
        elif zero.name == "Neimark-Sacker":
            values = orbit.floquet.of_map
            k, l = np.triu_indices(values.size, 1)
            near = int(np.argmin(np.abs(values[k] * values[l] - 1.0)))
            pair = values[k[near]]
            if abs(pair.imag) < 1e-9:
                return None  # a neutral saddle: two real multipliers with the product 1
            numbers = {"angle": float(abs(np.angle(pair)))}
            words = "an invariant torus is born"
        elif zero.name == "period doubling":
            words = "an orbit of twice the period branches off"
        else:
            words = "two orbits without the symmetry branch off"
        side = FarSide("", words, ReadOnly(numbers))
        return self._event(zero.name, self, zero.point, zero.name, side)

    def _edited(self, kind: str, conditions: list[Condition], u: Array, p: Array) -> Edited | None:
        try:
            return edited(self.problem, kind, conditions, u[: self.problem.size], p)
        except NonsmoothError:
            return None  # the letters fit no event there

    def located(self, guess: Array, name: str) -> Point | None:
        """The orbit at which a test of this itinerary vanishes, near a guess."""
        scale = self.scale
        self.tests(Point(guess, np.zeros(guess.size)))  # what the conditions are
        if name not in self.known or self.test_row(name, guess) is None:
            return None

        def equations(v: Array) -> tuple[Array, Array]:
            values, jacobian = self.scaled(v)
            found = self.test_row(name, v * scale)
            assert found is not None
            return np.append(values, found[0]), np.vstack([jacobian, found[1] * scale])

        try:
            root = converge(equations, guess / scale, tol=1e-15, max_iterations=30)
            if root is None or np.abs(root - guess / scale).max() > 0.3:
                return None
            u = root * scale
            jacobian = self.scaled(root)[1]
            tangent = np.linalg.svd(jacobian)[2][-1]
            point = self.point(u, tangent, tangent, 0.0)
        except (NonsmoothError, np.linalg.LinAlgError):
            return None
        return point

    # beyond an event ----------------------------------------------------------------------------

    def onward(self, event: BranchEvent, zero: Zero) -> Departure | None:
        """The branch in the other itinerary."""
        assert event.point is not None
        curve, u = event.curve, event.point.u
        if curve is not self:  # located on the side with fewer legs, which is ahead
            return curve.leave(u, -1)
        beyond = self._edited(event.kind, self._vanishing(zero), u, self.parameters_at(u))
        if beyond is None:
            return None
        start = np.append(beyond.u, u[-len(self.free) :])
        return self.with_problem(beyond.problem, beyond.u).leave(start, beyond.fresh)

    def leave(self, u: Array, fresh: int) -> Departure | None:
        """Leave an event into the side where the itinerary holds, a new leg growing from zero."""
        k = len(u) - len(self.free)
        for size in _STARTS:
            ways: list[tuple[Array, Array]] = []
            try:
                tangent = np.linalg.svd(self.scaled(u / self.scale)[1])[2][-1]
            except NonsmoothError:
                return None
            if fresh >= 0:
                axis = np.zeros(u.size)
                axis[k - len(self.problem.legs) + fresh] = 1.0
                ways.append((u + size * axis * self.scale, axis))
            ways += [(u + s * size * tangent * self.scale, tangent) for s in (1.0, -1.0)]
            for guess, axis in ways:
                found = self.correct(guess, axis)
                if found is None or np.abs((found - u) / self.scale).max() > 0.2:
                    continue
                if not self.faults(found):
                    step = (found - u) / self.scale
                    return Departure(self, [u, found], step / np.linalg.norm(step))
        return None


def _word(problem: BoundaryProblem) -> str:
    return " ".join(leg.mode or "o" for leg in problem.legs)


def continue_orbit(
    orbit: PeriodicOrbit | BranchEvent,
    parameter: str,
    *,
    bounds: tuple[float, float],
    step: float = 0.05,
    max_points: int = 1000,
    through: bool = True,
    progress: bool = False,
) -> Branch:
    """Follow a periodic orbit as a parameter varies.

    Pseudo-arclength continuation both ways to the bounds, with multipliers at each point. The
    itinerary is kept as long as it holds; what ends it is located in the itinerary with fewer legs,
    where it is regular, and named.

    Parameters
    ----------
    orbit : PeriodicOrbit or BranchEvent
        Where to start; at a period doubling, pitchfork or branch point the other branch is followed.
    parameter : str
        Name of the parameter that varies.
    bounds : (float, float)
        Where the branch ends.
    step : float, optional
        Largest step where the branch bends, relative to the width of the bounds and to the size of
        the orbit.
    max_points : int, optional
        Of each piece.
    through : bool, optional
        Whether to edit the itinerary and go on beyond what changes it.
    progress : bool, optional
        Whether to show a bar that counts points. An interrupt (Ctrl-C) returns what was computed.

    Returns
    -------
    Branch
        Its ``solutions`` (or ``orbits``) are PeriodicOrbits. Events: ``"fold"``, ``"period
        doubling"``, ``"Neimark-Sacker"``, ``"pitchfork"`` (of symmetric orbits), ``"branch
        point"``, ``"grazing-sliding"``, ``"crossing-sliding"``, ``"switching-sliding"``,
        ``"adding-sliding"``, ``"impact grazing"``, ``"grazing, escaping"``, ``"corner"``,
        ``"two-fold"``.

    Raises
    ------
    ConvergenceError, DefinitionError, OptionError

    Examples
    --------
    A relay that is forced, x' = A cos t - sgn x: crossing orbits end to cross at
    A = sqrt(1 + pi^2/4), below which they slide.

    >>> import casadi as ca, nonsmooth as ns
    >>> x, t, a = (ca.SX.sym(s) for s in ("x", "t", "a"))
    >>> relay = ns.FilippovSystem([x], surface=x, time=t, parameters={a: 2.5},
    ...                           above=[a * ca.cos(t) - 1], below=[a * ca.cos(t) + 1])
    >>> orbit = ns.periodic_orbit(relay, [0.5])
    >>> branch = ns.continue_orbit(orbit, "a", bounds=(1.5, 3.0))
    >>> [(e.kind, round(e.parameter, 12)) for e in branch.events]
    [('crossing-sliding', 1.862095889119)]
    """
    positive(step, "step")
    whole(max_points, "max_points", least=2)
    curve, start = _begin(orbit, parameter)
    value = float(start[-1])
    low, high = check_bounds(bounds, value, parameter)
    curve.widths = np.array([high - low])
    curve.scale = np.append(curve.scale[:-1], high - low)
    return follow_branch(
        curve,
        start,
        name=parameter,
        bounds=(low, high),
        step=step,
        max_points=max_points,
        through=through,
        progress=progress,
    )


def _begin(orbit: PeriodicOrbit | BranchEvent, parameter: str) -> tuple[OrbitCurve, Array]:
    """The curve and its first point."""
    if not isinstance(orbit, (PeriodicOrbit, BranchEvent)):
        raise DefinitionError(
            explain(
                "orbit",
                expected="a PeriodicOrbit or an event of a branch of them",
                received=repr(orbit),
                advice="periodic_orbit(system, guess) finds one.",
            )
        )
    system = orbit.system if isinstance(orbit, PeriodicOrbit) else orbit.curve.system
    if parameter not in system.parameter_names:
        raise DefinitionError(
            explain(
                "parameter",
                expected=f"a parameter among {list(system.parameter_names)}",
                received=repr(parameter),
                advice="Give its name.",
            )
        )
    free = (system.parameter_names.index(parameter),)
    if isinstance(orbit, BranchEvent):
        from .switching_branches import switched

        return switched(orbit, free)
    p, u = orbit.parameter_vector, orbit.unknowns
    longest = _LONG * float(orbit.evaluation.durations.sum())
    curve = OrbitCurve(orbit.problem, p, free, np.ones(1), u, longest)
    return curve, np.append(u, p[list(free)])
