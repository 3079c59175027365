"""Periodic orbits as a parameter varies, through the bifurcations that change their itineraries.

The boundary value problem of a fixed itinerary is continued by :mod:`nonsmooth.continuation`. What
ends an itinerary is a zero of one of its tests (``conditions``). Of the two itineraries that meet
there the one with fewer legs is regular, so the event is located in it; then the branch goes on in
the other one (``edits``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from ...local.read_only import ReadOnly
from ...model import Array, ConvergenceError, NonsmoothError
from ...solvers.continuation import Departure, Point, Zero
from ...solvers.newton import converge
from ..periodic.boundary_value_problem import BoundaryProblem
from ..periodic.orbit import PeriodicOrbit, faults_of, named
from ..periodic.symmetry import require_symmetric
from ..runs.legs import fly
from .branch import BranchEnd, BranchEvent, FarSide
from .branch_curves import BranchCurve
from .codimension_two import ENDS, degenerate
from .conditions import Condition, condition_row, conditions_of, is_smooth
from .family_ends import extent, hopf_point, surface_end
from .homoclinic_curves import homoclinic_end
from .itinerary_changes import Edited, edited, grown, kind_of
from .orbit_equations import OrbitEquations
from .smooth_events import as_doubling, as_pitchfork, smooth_side
from .unfoldings import far_side

#: Durations, or distances along the branch, at which it leaves an event; relative to the orbit.
_STARTS = (1e-4, 1e-3, 1e-2, 1e-5)

#: Relative growth of a long period, over a change of the parameter by its bounds, that diverges.
_STEEP = 30.0

#: An orbit that shrank to the first of these parts of its size where its itinerary ends, or to the second
#: where it is lost, may be about to shrink to a point of a surface.
_TINY, _SMALL = 1e-4, 1e-2

#: A solution of a branch that takes less than this part of the guess is no orbit but a point.
_COLLAPSED = 1e-6

#: Share of the way to an event at which the orbits before it are looked at.
_JUST = 0.99

#: What names an event of which several conditions vanish.
_PRIORITY = ("duration", "start", "end", "interior", "transversality")

#: Cosines of the angle between the flow and the normal of the plane on which an orbit without events
#: starts: below the first it gets a new plane, below the second a step was too long.
_OBLIQUE, _LEFT = 0.9, 0.5


class OrbitCurve(OrbitEquations):
    """Periodic orbits of one itinerary, with what is watched along them and what happens where it ends."""

    def with_problem(self, problem: BoundaryProblem, u: Array) -> OrbitCurve:
        """The same parameters with another itinerary."""
        return OrbitCurve(problem, self.p, self.free, self.widths, u, self.longest)

    def tests(self, point: Point) -> Mapping[str, float]:
        at, p, self._last = self.evaluation(point.u), self.parameters_at(point.u), b""
        found = conditions_of(self.problem, at, p, self.known)
        if self._on_plane:  # the flow across the plane on which the orbit starts
            assert self.problem.phase is not None
            found["Hopf"] = float(self.problem.phase @ at.flown[0].rate[: self.problem.dimension])
        return found

    def restart(self, u: Array) -> None:
        problem = self.problem.rephased(u[: self.problem.size], self.parameters_at(u))
        if problem is not self.problem:
            self.problem, self._found = problem, {}

    @property
    def _on_plane(self) -> bool:
        return self.problem.phase is not None and not self.system.time_dependent

    def ends(self, name: str) -> bool:
        return name == "Hopf" or not is_smooth(name)

    def ends_at(self, zero: Zero) -> bool:
        """As by name; and where doubled orbits become one, as beyond are the same, a round later."""
        doubled = zero.name == "branch point" and as_doubling(self, zero) is not None
        return doubled or self.ends(zero.name)

    def passed(self, last: Point, new: Point, ending: Zero | None) -> bool:
        """Whether an extremum of a guard was born in a step and has passed zero already."""
        # Then either no motion is left at the end of the step, or none just before another event in it.
        born = new.tests.keys() - last.tests.keys()
        if any(new.tests[k] < 0.0 and self._inside(k) for k in born) and ending is None:
            return True
        if ending is None or is_smooth(ending.name) or self.faults(last.u):
            return False
        step = (ending.point.u - last.u) / self.scale
        length = float(np.linalg.norm(step))
        if not length > 0.0:
            return False
        just = self.correct(last.u + _JUST * step * self.scale, step / length)
        return just is not None and bool(self.faults(just))

    def _inside(self, test: str) -> bool:
        return test in self.known and self.known[test].what == "interior"

    def singular(self, name: str) -> bool:
        """At a Hopf point the equations hold for the equilibrium with any duration."""
        return name in ("branch point", "Hopf")

    def _across(self, u: Array) -> float:
        """Cosine of the angle between the flow at the start and the normal of the plane."""
        assert self.problem.phase is not None
        rate = self.evaluation(u).flown[0].rate[: self.problem.dimension]
        return float(self.problem.phase @ rate) / (float(np.linalg.norm(rate)) or 1.0)

    def point(self, u: Array, before: Array, chord: Array, arclength: float) -> Point | None:
        """As of any curve; none where an orbit without events has nearly left its plane."""
        found = super().point(u, before, chord, arclength)
        lost = found is not None and self._on_plane and abs(self._across(u)) < _LEFT
        return None if lost else found

    def turned(self, u: Array, tangent: Array) -> Array | None:
        """Take a plane across the flow at the start, where that of an orbit without events is oblique."""
        if not self._on_plane or self._across(u) > _OBLIQUE:
            return None
        rate = self.evaluation(u).flown[0].rate[: self.problem.dimension]
        self.restart(u)
        ahead = tangent * self.scale  # the same way, less what only moves along the orbit
        ahead[: rate.size] -= float(rate @ ahead[: rate.size]) / float(rate @ rate) * rate
        ahead = ahead / self.scale
        return np.asarray(ahead / np.linalg.norm(ahead))

    def solution_at(self, guess: Array, value: float) -> PeriodicOrbit:
        """The orbit near a guess at a value of the parameter."""
        curve = copy(self)
        curve._found = {}
        curve.restart(guess)
        found = BranchCurve.solution_at(curve, guess, value)
        assert isinstance(found, PeriodicOrbit)
        durations = self.problem.split(guess[: self.problem.size])[1]
        if found.evaluation.durations.sum() < _COLLAPSED * durations.sum():
            raise ConvergenceError(
                f"the branch at {value:.10g}: expected an orbit near its neighbours, received one that "
                f"shrank to the point {found.start.tolist()}. Continue with a smaller step."
            )
        p = found.parameter_vector
        return replace(found, faults=tuple(faults_of(found.problem, found.evaluation, p)))

    def out(self, u: Array) -> str:
        """The period diverges where it is long and grows without the parameter changing."""
        durations = slice(self.problem.size - len(self.problem.legs), self.problem.size)
        return "period diverges" if u[durations].sum() > self.longest and self._steep(u) else ""

    def _steep(self, u: Array) -> bool:
        """Whether the period grows by far more than it would over the bounds of the parameter."""
        durations = slice(self.problem.size - len(self.problem.legs), self.problem.size)
        tangent = np.linalg.svd(self.equations(u)[1] * self.scale)[2][-1] * self.scale
        growth = abs(float(tangent[durations].sum())) * float(self.widths[-1])
        return bool(growth > _STEEP * float(u[durations].sum()) * abs(float(tangent[-1])))

    def ending(self, u: Array, end: BranchEnd) -> BranchEvent | None:
        """The point to which the orbit shrinks, or the homoclinic orbit where the period diverges, or would
        if rounding allowed it."""
        shrunk = self._shrunk(u, _SMALL)
        if shrunk is not None:
            return shrunk
        if end is not BranchEnd.PERIOD_DIVERGES and not self._steep(u):
            return None
        name = self.system.parameter_names[self.free[-1]]
        return homoclinic_end(self.describe(u), name, float(self.widths[-1]))

    def _shrunk(self, u: Array, part: float) -> BranchEvent | None:
        """The point of a surface to which an orbit shrinks that is no larger than a part of the first one."""
        if self.system.time_dependent or self.system.coupled or not self.system.surface_count:
            return None
        first = extent(
            self.problem, self.begin[: self.problem.size], self.parameters_at(self.begin)
        )
        size = extent(self.problem, u[: self.problem.size], self.parameters_at(u))
        if not size <= part * first:
            return None
        name = self.system.parameter_names[self.free[-1]]
        return surface_end(self.describe(u), name, size, first)

    def faults(self, u: Array) -> list[str]:
        """What the guards contradict."""
        return faults_of(self.problem, self.evaluation(u), self.parameters_at(u))

    def require_valid(self, u: Array) -> None:
        """Refuse half orbits of a system whose symmetry the parameter breaks."""
        if self.problem.symmetry is not None:
            virtual = tuple(self.faults(u))
            require_symmetric(replace(self.describe(u), faults=virtual))

    # results ------------------------------------------------------------------------------------

    def describe(self, u: Array) -> PeriodicOrbit:
        p, unknowns = self.parameters_at(u), np.array(u[: self.problem.size])
        problem = self.problem.rephased(unknowns, p)
        same = problem is self.problem
        at = self.evaluation(u) if same else problem.evaluate(unknowns, p, self.free)
        return PeriodicOrbit(self.system, named(self.system, p), problem, unknowns, at, 0)

    def test_row(self, test: str, u: Array) -> tuple[float, Array] | None:
        if test not in self.known:
            return None
        p, unknowns = self.parameters_at(u), u[: self.problem.size]
        return condition_row(self.problem, unknowns, p, self.free, self.known[test])

    def codimension_two(self, name: str, u: Array) -> Mapping[str, float]:
        at, p = self.evaluation(u), self.parameters_at(u)
        return degenerate(self.problem, self.known.get(name), name, at, p)

    def ends_curve(self, name: str) -> bool:
        return name in ENDS

    def named(self, test: str, u: Array) -> str:
        if is_smooth(test) or test not in self.known:
            return test
        condition = self.known[test]
        return kind_of(self.problem, condition, self.evaluation(u), self.parameters_at(u))

    def event(self, zero: Zero) -> BranchEvent | None:
        u = zero.point.u
        if is_smooth(zero.name):
            return self._smooth_event(zero)
        shrunk = self._shrunk(u, _TINY)
        if shrunk is not None:
            return shrunk
        conditions = self._vanishing(zero)
        at, p = self.evaluation(u), self.parameters_at(u)
        kind = kind_of(self.problem, conditions[0], at, p)
        beyond = self._edited(kind, conditions, u, p)
        if beyond is None or not beyond.test:
            word = "" if beyond is None else _word(beyond.problem)
            side = far_side(self.problem, kind, conditions[0], at, p, word, beyond)
            return self._event(kind, self, zero.point, conditions[0].name, side)
        word, curve = _word(beyond.problem), self.with_problem(beyond.problem, beyond.u)
        point = curve.located(np.append(beyond.u, u[-len(self.free) :]), beyond.test)
        if point is None:
            side = FarSide(word, "not located on the side with fewer legs")
            return self._event(kind, self, zero.point, conditions[0].name, side)
        at, p = curve.evaluation(point.u), curve.parameters_at(point.u)
        test = curve.known[beyond.test]
        back = curve._edited(kind, [test], point.u, p) if kind == "corner" else None
        side = far_side(curve.problem, kind, test, at, p, word, back)
        return self._event(kind, curve, point, beyond.test, side)

    def _vanishing(self, zero: Zero) -> list[Condition]:
        """Conditions that vanish together at a zero, those that name the event."""
        # Where a leg vanishes the events beside it are tangent too; an orbit that is symmetric has
        # each event several times.
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
        if zero.name == "Hopf":
            return self._hopf(zero)
        at, p = self.evaluation(zero.point.u), self.parameters_at(zero.point.u)
        if zero.name == "branch point":
            parting = as_doubling(self, zero) or as_pitchfork(self, zero)
            if parting is not None:
                return self._event(*parting)
        side = smooth_side(self.problem, at, p, zero.name)
        return None if side is None else self._event(zero.name, self, zero.point, zero.name, side)

    def _hopf(self, zero: Zero) -> BranchEvent:
        """The orbit shrinks: where its equilibrium has two imaginary eigenvalues."""
        u, leg = zero.point.u, self.problem.legs[0]
        p, (starts, durations) = self.parameters_at(u), self.problem.split(u)
        opposite = fly(self.system, leg, starts[0], 0.5 * float(durations[0]), p).end
        n = self.system.dimension
        middle = 0.5 * (starts[0] + opposite[: self.problem.dimension])[:n]
        found = hopf_point(self.system, leg.mode, middle, p, self.free[-1])
        words = "the orbit shrinks to an equilibrium"
        event = self._event("Hopf", self, zero.point, "", FarSide("", words))
        if found is None:
            return event
        numbers = ReadOnly({"frequency": found[2]})
        return replace(event, parameter=found[1], coefficients=numbers)

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
        if is_smooth(zero.name) or event.point is None or not isinstance(event.curve, OrbitCurve):
            return None
        curve, u = event.curve, event.point.u
        if curve is not self:  # located on the side with fewer legs, which is ahead
            return curve.leave(u, ())
        beyond = self._edited(event.kind, self._vanishing(zero), u, self.parameters_at(u))
        if beyond is None:
            return None
        start = np.append(beyond.u, u[-len(self.free) :])
        return self.with_problem(beyond.problem, beyond.u).leave(start, beyond.fresh)

    def leave(self, u: Array, fresh: Sequence[int]) -> Departure | None:
        """Leave an event into the side where the itinerary holds, new legs growing from zero."""
        k = len(u) - len(self.free)
        for size in _STARTS:
            ways: list[tuple[Array, Array]] = []
            try:
                tangent = np.linalg.svd(self.scaled(u / self.scale)[1])[2][-1]
            except (NonsmoothError, np.linalg.LinAlgError):  # no derivatives there
                return None
            if fresh:
                axis = np.zeros(u.size)
                axis[[k - len(self.problem.legs) + i for i in fresh]] = len(fresh) ** -0.5
                by = size * float(self.scale[k - 1])
                guess = grown(self.problem, u[:k], self.parameters_at(u), fresh, by)
                ways.append((np.append(guess, u[k:]), axis))
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
