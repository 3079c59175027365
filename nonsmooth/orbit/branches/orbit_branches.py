"""Branches of periodic orbits as a parameter varies, with their bifurcations.

The boundary value problem of a fixed itinerary is continued by :mod:`nonsmooth.continuation`. An itinerary
ends at a zero of one of its tests (``conditions``). Of the two itineraries that meet there the one with
fewer legs is regular, so the event is located in it, and the branch continues in the other one
(``itinerary_changes``).

Source: Kowalczyk, di Bernardo, Champneys et al. 2006 (Int. J. Bifurcation Chaos 16, 601); Kuznetsov 2004,
ch. 9.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace

import numpy as np

from ...local.read_only import ReadOnly
from ...model import Array, ConvergenceError, DefinitionError, Guard, NonsmoothError
from ...solvers.continuation import Departure, Point, Zero
from ...solvers.newton import converge
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation, eliminated
from ..periodic.divided_legs import divided, to_divide
from ..periodic.find_periodic import at_two_fold
from ..periodic.multipliers import Multipliers, return_map
from ..periodic.orbit import PeriodicOrbit, named, violations_of
from ..periodic.orbit_functions import OrbitFunction, UserRows
from ..periodic.symmetry import halves, prime_period, require_symmetric
from ..runs.guards import watch
from ..runs.legs import integrate_leg, shown_itinerary
from .branch import (
    DIVIDE,
    BranchCurve,
    BranchEnd,
    BranchEvent,
    FarSide,
)
from .chatter_end import chatter_end
from .conditions import COST, USER, Condition, condition_row, conditions_of, is_smooth
from .event_curves import OWN_ENDS, degenerate_tests
from .family_ends import extent, hopf_point, node_end, surface_end
from .homoclinic_curves import homoclinic_end, passed_saddle
from .itinerary_changes import (
    CENTRE,
    SOFT,
    ChangedItinerary,
    changed_itinerary,
    departures,
    grown,
    kind_of,
)
from .normal_forms import normal_form, torus_pair
from .unfoldings import VERDICTS, far_side

# Equations of periodic orbits with free parameters ----------------------------------------------------


class OrbitEquations(BranchCurve):
    """Periodic orbits of one itinerary in the unknowns (starts, durations, parameters)."""

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
        self.begin = np.append(u[: problem.size], p[list(free)])
        self.system, self.widths = problem.system, widths
        self.scale = np.append(problem.scales(u, p), widths)
        self.known: dict[str, Condition] = {}
        self.rows = UserRows()
        self._found, self._last = dict[bytes, Evaluation](), b""  # of points, and the last untested
        self._tested: tuple[bytes, Mapping[str, float]] = b"", {}  # the last point with its tests
        self._largest = dict[str, float]()  # sizes of L of the other field where slides end
        self.held: tuple[Array, Array, Array] | None = (
            None  # of a family: rows, directions, a point
        )

    # equations ----------------------------------------------------------------------------------

    def parameters_at(self, u: Array) -> Array:
        p = self.p.copy()
        p[list(self.free)] = u[-len(self.free) :]
        return p

    def freed(self, u: Array, free: tuple[int, ...], widths: Array) -> tuple[BranchCurve, Array]:
        p, unknowns = self.parameters_at(u), self.problem.undivided(u)
        if self.rows.constraints:
            raise DefinitionError(
                "a branch with constraints= has no curves in two parameters and no other branches. Continue an orbit "
                "without constraints."
            )
        curve = type(self)(self.problem.whole, p, free, widths, unknowns, self.longest)
        curve.known = self.known
        return curve, np.append(unknowns, p[list(free)])

    def evaluation(self, u: Array) -> Evaluation:
        """The equations at a point, computed once."""
        key = u.tobytes()
        if key not in self._found:
            p, unknowns = self.parameters_at(u), u[: self.problem.size]
            at = self.problem.evaluate(unknowns, p, self.free)
            self._found.pop(self._last, None)
            self._found[key], self._last = at, key
        return self._found[key]

    def equations(self, u: Array) -> tuple[Array, Array]:
        values, jacobian = self._own_equations(u)
        if self.held is None:
            return values, jacobian
        push, ways, point = self.held
        return values + push @ (
            ways @ (u / self.scale - point)
        ), jacobian + push @ ways / self.scale

    def hold_family(self, u: Array) -> None:
        """Where orbits form a neutral family at each value of the parameter, keep to a branch that does not move along it."""
        # A combination of the equations that the family makes redundant is replaced by the condition not to move along it.
        self.held = None
        if self.problem.has_many or len(self.free) > 1:
            return
        jacobian = self.equations(u)[1] * self.scale
        rows = np.linalg.norm(jacobian, axis=1)
        sizes = np.where(rows > _FAMILY * rows.max(), rows, rows.max())[:, None]
        left, values, right = np.linalg.svd(jacobian / sizes)
        count = int(np.sum(values <= _FAMILY * values[0]))
        null = right[len(values) - count :]
        if not count or not np.linalg.norm(null[:, -1]) > _VERTICAL:
            return
        ways = np.linalg.svd(null[:, -1][None])[2][1:] @ null
        self.held = left[:, len(values) - count :] * sizes, ways, u / self.scale

    def _own_equations(self, u: Array) -> tuple[Array, Array]:
        at = self.evaluation(u)
        if not self.rows.constraints:
            return at.residual, at.whole
        p = self.parameters_at(u)
        more = [self.of_user(c, at, p, self.free) for c in self.rows.constraints]
        values = [value for value, _ in more]
        return np.append(at.residual, values), np.vstack([at.whole, *(row for _, row in more)])

    def of_user(
        self, function: OrbitFunction, at: Evaluation, p: Array, free: tuple[int, ...]
    ) -> tuple[float, Array]:
        """A function of the user, of whole legs, with its derivatives by the unknowns."""
        value, row = function.rule(self.problem.whole, at, p, free)
        return value, np.append(np.zeros(self.problem.size - self.problem.whole.size), row)

    def values(self, u: Array) -> Array | None:
        if self.rows.constraints or self.held is not None:
            return None
        return self.problem.residual(u[: self.problem.size], self.parameters_at(u))

    def solve(self, matrix: Array, right: Array) -> Array:
        return self.problem.solve(matrix, right)

    def along(self, jacobian: Array, before: Array) -> tuple[Array, float]:
        if not self.problem.has_many:
            return super().along(jacobian, before)
        target = np.zeros(before.size)
        target[-1] = 1.0
        small = eliminated(self.problem, np.vstack([jacobian, before]), target)
        tangent = small.solution()
        length = float(np.linalg.norm(tangent))
        return tangent / length, small.determinant() * length

    def determinant(self, matrix: Array) -> float:
        if not self.problem.has_many:
            return super().determinant(matrix)
        return eliminated(self.problem, matrix, np.zeros(len(matrix))).determinant()


#: Distance along a curve, scaled, over which a fold changes the parameter by more than rounding of it.
_BESIDE, _SAME_VALUE = 1e-3, 1e-12

#: Relative singular value of the equations with the parameter below which a direction is undetermined.
_FAMILY = 1e-10

#: Relative growth of a long period, over a change of the parameter by its bounds, at which it diverges.
_STEEP = 30.0

#: Relative sizes below which an orbit may shrink to a point of a surface: where its itinerary ends, and where
#: the branch is lost.
_TINY, _SMALL = 1e-4, 1e-2

#: L of the other field where a slide ends, relative to its gradient and the orbit, at the last step to a two-fold.
_REACHED = 1e-5

#: Part of its largest value on a branch below which this L may be rounding.
_NEARING = 1e-3

#: Rounding of this L: the slide of a branch ends at the two-fold, as it tends to it exponentially.
_ROUNDED = 1e-11

#: Change of the parameter, over its bounds, per relative change of the period below which it is rounding, and part of
#: the longest period from which this is computed.
_UNRESOLVED, _LATE = 1e-12, 0.2

#: Period relative to that of the guess below which a solution is a point.
_COLLAPSED = 1e-6

#: Share of the way to an event at which the orbit before it is checked.
_JUST = 0.99

#: Logarithm of a multiplier beyond which doubles do not separate the parameters of orbits.
_STEEPEST = 23.0

#: Component of the parameter in a tangent below which a branch is vertical.
_VERTICAL = 1e-6

#: Share of an orbit without events by which it may begin later, where a guard is touched at its start.
_LATER = 0.381966

#: Order of the conditions that name an event at which several vanish.
_PRIORITY = ("duration", "start", "end", "interior", "transversality")

#: Cosines of the angle between the flow and the normal of the plane on which an orbit without events
#: starts, below which the plane is renewed, and below which a step was too long.
_OBLIQUE, _LEFT = 0.9, 0.5


class OrbitCurve(OrbitEquations):
    """Periodic orbits of one itinerary, with their tests and events."""

    def with_problem(self, problem: BoundaryProblem, u: Array, p: Array) -> OrbitCurve:
        """The same free parameters with another itinerary, at parameters p."""
        curve = OrbitCurve(problem, p, self.free, self.widths, u, self.longest)
        curve.rows = self.rows
        return curve

    def tests(self, point: Point) -> Mapping[str, float]:
        at, p, self._last = self.evaluation(point.u), self.parameters_at(point.u), b""
        found = conditions_of(self.problem, at, p, self.known)
        for name, function in self.rows.events.items():
            found[USER + name] = self.of_user(function, at, p, ())[0]
        if self.rows.cost is not None:
            row = self.of_user(self.rows.cost, at, p, self.free)[1]
            found[COST] = float(row @ (point.tangent * self.scale))
        if self._on_plane:  # the flow across the plane on which the orbit starts
            assert self.problem.phase is not None
            found["Hopf"] = float(self.problem.phase @ at.by_leg[0].rate[: self.problem.dimension])
        self._tested = point.u.tobytes(), found
        return found

    def restart(self, u: Array) -> None:
        problem = self.problem.rephased(u[: self.problem.size], self.parameters_at(u))
        if problem is not self.problem:
            self.problem, self._found = problem, {}
        with suppress(NonsmoothError, np.linalg.LinAlgError):
            self.hold_family(u)

    @property
    def _on_plane(self) -> bool:
        return self.problem.phase is not None and not self.system.time_dependent

    def ends(self, name: str) -> bool:
        return name == "Hopf" or not is_smooth(name)

    def ends_at(self, zero: Zero) -> bool:
        """Whether the branch ends, by the name; also at a period doubling of doubled orbits, which repeat beyond it."""
        doubled = zero.name == "branch point" and _as_doubling(self, zero) is not None
        return doubled or self.ends(zero.name)

    def passed(self, last: Point, new: Point, ending: Zero | None) -> bool:
        """Whether an extremum of a guard appeared in a step and has passed zero already."""
        # Then the orbit is virtual at the end of the step, or just before another event in it.
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
        rate = self.evaluation(u).by_leg[0].rate[: self.problem.dimension]
        return float(self.problem.phase @ rate) / (float(np.linalg.norm(rate)) or 1.0)

    def point(self, u: Array, before: Array, chord: Array, arclength: float) -> Point | None:
        """The point; None where an orbit without events is nearly tangent to its plane."""
        found = super().point(u, before, chord, arclength)
        lost = found is not None and self._on_plane and abs(self._across(u)) < _LEFT
        return None if lost else found

    def turned(self, u: Array, tangent: Array) -> Array | None:
        """Renew the plane of an orbit without events where it is oblique to the flow."""
        if not self._on_plane or self._across(u) > _OBLIQUE:
            return None
        rate = self.evaluation(u).by_leg[0].rate[: self.problem.dimension]
        self.restart(u)
        ahead = tangent * self.scale  # without the component along the orbit
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
                f"the branch at {value:.10g}: the solution is no orbit, but the point "
                f"{found.start.tolist()}. Continue with a smaller step."
            )
        p = found.parameter_vector
        return replace(found, faults=tuple(violations_of(found.problem, found.evaluation, p)))

    def out(self, u: Array) -> str:
        """``"period diverges"`` where it is long and grows at a constant parameter; else empty."""
        if self.is_to_divide(u) and self.again(u) is not None:
            return DIVIDE
        if self._nears_two_fold(u) and self._at_two_fold(u, _ROUNDED):
            return "two-fold"
        durations = slice(self.problem.size - len(self.problem.legs), self.problem.size)
        period = float(u[durations].sum())
        if period > self.longest:
            return "period diverges" if self._steep(u, _STEEP) else ""
        if not (period > _LATE * self.longest and self._steep(u, 1.0 / _UNRESOLVED)):
            return ""
        of_family = Multipliers(self.problem, self.evaluation(u), self.parameters_at(u)).repeats
        return "" if of_family else "period diverges"

    def again(self, u: Array, tangent: Array | None = None) -> Departure | None:
        """The same branch with legs divided where derivatives grow along them; None where nothing changes."""
        curve, start = self.redivided(u)
        if curve is self:
            return None
        k = self.problem.undivided(u).size + len(self.free)
        way = np.zeros(curve.scale.size)
        way[-k:] = 1.0 if tangent is None else tangent[-k:]
        way /= np.linalg.norm(way)
        found = curve.correct(start, way)
        return None if found is None else Departure(curve, [found], way)

    def is_to_divide(self, u: Array) -> bool:
        """Whether derivatives grow too much on a leg."""
        return to_divide(self.problem, self.evaluation(u))

    def redivided(self, u: Array) -> tuple[OrbitCurve, Array]:
        """The same equations with legs divided where derivatives grow along them, and a guess at the point."""
        p, own = self.parameters_at(u), self.problem
        try:
            problem, v = divided(own, u[: own.size], p)
        except NonsmoothError:
            return self, u
        if problem is own:
            return self, u
        curve, k = self.with_problem(problem, v, p), own.undivided(u).size + len(self.free)
        inside = np.resize(self.scale[-k:][: own.dimension], problem.size - own.undivided(u).size)
        curve.scale = np.concatenate([inside, self.scale[-k:]])
        return curve, np.append(v, u[own.size :])

    def _steep(self, u: Array, least: float = _STEEP) -> bool:
        """Whether the period grows steeply with the parameter."""
        durations = slice(self.problem.size - len(self.problem.legs), self.problem.size)
        tangent = np.linalg.svd(self.equations(u)[1] * self.scale)[2][-1] * self.scale
        growth = abs(float(tangent[durations].sum())) * float(self.widths[-1])
        return bool(growth > least * float(u[durations].sum()) * abs(float(tangent[-1])))

    def ending(self, u: Array, end: BranchEnd) -> BranchEvent | None:
        """The point to which the orbit shrinks, the end of its chatter, or the homoclinic orbit at which its period diverges."""
        if self.is_at_hopf(u):
            return self._hopf(u)
        shrunk = self._shrunk(u, _SMALL)
        if shrunk is not None:
            return shrunk
        chatter = chatter_end(self.problem, u, self.scale, self.equations)
        if chatter is not None:
            kind, value, near = chatter
            return BranchEvent(
                kind, value, self.describe(near), FarSide("", VERDICTS[kind]), curve=self
            )
        for verb in ("ends at", "passes"):
            if self._at_two_fold(u, _REACHED, inside=verb == "passes"):
                verdict = f"a slide {verb} a two-fold, beyond which its continuation is not unique"
                point = Point(u, np.zeros(u.size))
                return self._event("two-fold", self, point, "", FarSide("", verdict))
        name, width = self.system.parameter_names[self.free[-1]], float(self.widths[-1])
        node = node_end(self.describe(u), name, width)
        long = end is BranchEnd.PERIOD_DIVERGES or self._steep(u) or self.diverges(u)
        if node is not None or not long:
            return node
        return homoclinic_end(self.describe(u), name, width)

    def diverges(self, u: Array) -> str:
        return passed_saddle(self.describe(u), self._sizes(u)[0])

    def _nears_two_fold(self, u: Array) -> bool:
        """Whether L of the other field where a slide ends is small relative to its largest value, or unknown."""
        (point, tests), nears = self._tested, False
        for i, leg in enumerate(self.problem.legs):
            if leg.kind == "exit":
                name = f"end {i} exit {leg.element} {-leg.side}"
                size = abs(tests.get(name, 0.0)) if point == u.tobytes() else 0.0
                nears = nears or not size > _NEARING * self._largest.get(name, math.inf)
                self._largest[name] = max(size, self._largest.get(name, 0.0))
        return nears

    def _at_two_fold(self, u: Array, part: float, inside: bool = False) -> bool:
        """Whether a slide ends at a two-fold, or comes to one ``inside`` its leg."""
        at, p = self.evaluation(u), self.parameters_at(u)
        for i, leg in enumerate(self.problem.legs):
            state, ends = at.flows.end[i, : at.flows.sizes[i]], [leg]
            if inside and leg.mode.count("s") == 1 and at.durations[i] > 0.0:
                x, duration = at.starts[i], float(at.durations[i])
                seen = watch(self.system, leg, x, duration, p).approaches
                near = min(seen, key=lambda a: abs(a.value), default=None)
                if near is None or near.guard.kind != "exit":
                    continue
                state = integrate_leg(self.system, leg, x, near.t, p).end
                k = near.guard.element
                ends = [replace(leg, kind="exit", element=k, side=s) for s in (1, -1)]
            if all(at_two_fold(self.system, end, state, p, at.starts, part) for end in ends):
                return True
        return False

    def unresolved(self, u: Array) -> str:
        p, k = self.parameters_at(u), self.problem.size
        found = Multipliers(self.problem, self.problem.evaluate(u[:k], p), p)
        growth = np.zeros(0) if found.refusal else found.logarithms.real
        if not growth.size or growth[0] < _STEEPEST:
            return ""
        return (
            f"A multiplier has grown to {np.exp(min(growth[0], 700.0)):.1e}: beyond, orbits differ by less than the "
            "parameter's rounding, as where canards grow."
        )

    def _sizes(self, u: Array) -> tuple[float, float]:
        """Of the orbit and of the first one."""
        size, first = (
            extent(self.problem, v[: self.problem.size], self.parameters_at(v))
            for v in (u, self.begin)
        )
        return size, first

    def _shrunk(self, u: Array, part: float) -> BranchEvent | None:
        """The point of a surface to which an orbit shrinks, if it is small relative to the first one."""
        if self.system.time_dependent or self.system.coupled or not self.system.surface_count:
            return None
        size, first = self._sizes(u)
        if not size <= part * first:
            return None
        name = self.system.parameter_names[self.free[-1]]
        return surface_end(self.describe(u), name, size, first)

    def faults(self, u: Array) -> list[str]:
        """Violated guards."""
        return violations_of(self.problem, self.evaluation(u), self.parameters_at(u))

    def admissible(self, u: Array) -> bool:
        return not self.faults(u)

    def require_valid(self, u: Array) -> None:
        """Raise for half orbits of a system whose symmetry the parameter breaks."""
        if self.problem.symmetry is not None:
            virtual = tuple(self.faults(u))
            require_symmetric(replace(self.describe(u), faults=virtual))

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

    def codimension_two(self, name: str, u: Array, touch: float | None) -> Mapping[str, float]:
        at, p = self.evaluation(u), self.parameters_at(u)
        return degenerate_tests(self.problem, self.known.get(name), name, at, p, touch)

    def ends_curve(self, event: str, name: str) -> bool:
        return name in OWN_ENDS or (name in self.known and not is_smooth(name))

    def named(self, test: str, u: Array) -> str:
        if is_smooth(test) or test not in self.known:
            return test
        condition = self.known[test]
        return kind_of(self.problem, condition, self.evaluation(u), self.parameters_at(u))

    def _turns(self, u: Array) -> bool:
        """Whether the parameter changes beside a turning point, where not all orbits are at one value of it."""
        tangent = np.linalg.svd(self.scaled(u / self.scale)[1])[2][-1]
        ways = [self.correct(u + s * _BESIDE * tangent * self.scale, tangent) for s in (-1.0, 1.0)]
        moved = [np.inf if v is None else abs(v[-1] - u[-1]) / self.scale[-1] for v in ways]
        return bool(max(moved) > _SAME_VALUE)

    def occurs(self, test: str, u: Array) -> bool:
        """Not a Neimark-Sacker point at a neutral saddle, where two real multipliers have the product 1."""
        if test != "Neimark-Sacker":
            return True
        values = np.linalg.eigvals(return_map(self.problem, self.evaluation(u)))
        return bool(abs(values[torus_pair(values)[0]].imag) >= _REAL)

    def event(self, zero: Zero) -> BranchEvent | None:
        u = zero.point.u
        if is_smooth(zero.name):
            return self._smooth_event(zero)
        shrunk = self._shrunk(u, _TINY)
        if shrunk is not None:
            return shrunk
        conditions = self._vanishing(zero)
        if conditions[0].what == "start":
            later = self._at_another_phase(u, conditions[0])
            if later is not None:
                return later
        at, p = self.evaluation(u), self.parameters_at(u)
        kind = kind_of(self.problem, conditions[0], at, p)
        if self.held is not None and kind == "grazing-sliding":
            verdict = "the last orbit of a neutral family: orbits that slide come to it at once"
            side = FarSide("", verdict)
            return self._event(kind, self, zero.point, conditions[0].name, side)
        beyond = self._edited(kind, conditions, u, p)
        if beyond is None or not beyond.test:
            legs = () if beyond is None else beyond.problem.legs
            itinerary = shown_itinerary(self.system, legs)
            side = far_side(self.problem, kind, conditions[0], at, p, itinerary, beyond)
            return self._event(kind, self, zero.point, conditions[0].name, side)
        itinerary = shown_itinerary(self.system, beyond.problem.legs)
        curve = self.with_problem(beyond.problem, beyond.u, p)
        point = curve.located(np.append(beyond.u, u[-len(self.free) :]), beyond.test)
        if point is None:
            side = FarSide(itinerary, "not located on the side with fewer legs")
            return self._event(kind, self, zero.point, conditions[0].name, side)
        at, p = curve.evaluation(point.u), curve.parameters_at(point.u)
        test = curve.known[beyond.test]
        vertical = abs(float(point.tangent[-1])) < _VERTICAL and not self.system.time_dependent
        if kind == SOFT and vertical and curve.problem.legs[0].timed:
            kind = CENTRE
        back = curve._edited(kind, [test], point.u, p) if kind == "corner" else None
        side = far_side(curve.problem, kind, test, at, p, itinerary, back)
        return self._event(kind, curve, point, beyond.test, side)

    def begun_later(self, u: Array) -> tuple[BranchCurve, Array]:
        if self.problem.phase is None or not self.system.time_dependent:
            return self, u
        k, p = self.problem.size, self.parameters_at(u)
        (x,), (duration,) = self.problem.split(u[:k])
        n, leg = self.problem.dimension, self.problem.legs[0]
        begin = integrate_leg(self.system, leg, x, _LATER * float(duration), p).end[None, :n]
        unknowns = self.problem.pack(begin, np.array([duration]))
        phased = replace(self.problem.whole, reference=begin[0])
        curve = self.with_problem(phased, unknowns, p)
        return curve, np.append(unknowns, u[k:])

    def _at_another_phase(self, u: Array, at: Condition) -> BranchEvent | None:
        """The touch of an orbit without events where it begins, located from another start."""
        (curve, guess), name = self.begun_later(u), replace(at, what="interior").name
        assert isinstance(curve, OrbitCurve)
        point = None if curve is self else curve.located(guess, name)
        return None if point is None else curve.event(Zero(name, point, 0.0, (name,)))

    def _vanishing(self, zero: Zero) -> list[Condition]:
        """Conditions that vanish together at a zero, of the kind that names the event."""
        # Where a leg vanishes its neighbours end tangentially too; a symmetric orbit has each event several
        # times.
        small = [self.known[zero.name]]
        small += [self.known[n] for n in zero.together if n != zero.name and not is_smooth(n)]
        # An event without effect that is touched is so by the legs before and behind it too.
        of, count = lambda c: (c.guard.kind, c.guard.element), len(self.problem.legs)
        ends = [(c.leg, of(c)) for c in small if c.what == "transversality"]
        ends += [((leg + 1) % count, guard) for leg, guard in ends]
        small = [c for c in small if c.what != "interior" or (c.leg, of(c)) not in ends]
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
        if zero.name == "fold" and not self._turns(zero.point.u):
            return None
        small = {"branch point": _SMALL, "Neimark-Sacker": _TINY}.get(zero.name)
        if small is not None and self._shrunk(zero.point.u, small) is not None:
            return None  # all multipliers tend to 1
        if zero.name == "Hopf":
            return self._hopf(zero.point.u)
        at, p = self.evaluation(zero.point.u), self.parameters_at(zero.point.u)
        if zero.name.startswith(USER):
            function = self.rows.events[zero.name.removeprefix(USER)]
            of_user = FarSide("", f"{function.name} = 0")
            return self._event(zero.name.removeprefix(USER), self, zero.point, "", of_user)
        if zero.name == COST and self.rows.cost is not None:
            cost = self.of_user(self.rows.cost, at, p, ())[0]
            of_user = FarSide("", f"{self.rows.cost.name} is extremal", ReadOnly({"cost": cost}))
            return self._event(COST, self, zero.point, "", of_user)
        if zero.name == "branch point":
            shorter = _as_doubling(self, zero) or _as_pitchfork(self, zero)
            if shorter is not None:
                return self._event(*shorter)
        side = _smooth_side(self.problem, at, p, zero.name)
        return None if side is None else self._event(zero.name, self, zero.point, zero.name, side)

    def hopf(self, u: Array, guard: Guard | None = None) -> tuple[Array, Array, float] | None:
        """The Hopf point beside a small orbit: equilibrium, free parameters and frequency."""
        leg, p = self.problem.legs[0], self.parameters_at(u)
        starts, durations = self.problem.split(u[: self.problem.size])
        opposite = integrate_leg(self.system, leg, starts[0], 0.5 * float(durations[0]), p).end
        middle = 0.5 * (starts[0] + opposite[: self.problem.dimension])[: self.system.dimension]
        free = self.free if guard is not None else self.free[-1:]
        return hopf_point(self.system, leg.mode, middle, p, free, guard)

    def is_at_hopf(self, u: Array, guard: Guard | None = None) -> bool:
        """Whether the orbit has shrunk to an equilibrium, with two free parameters on the surface of a guard."""
        size, first = self._sizes(u) if self._on_plane else (1.0, 1.0)
        return size <= _SMALL * first and self.hopf(u, guard) is not None

    def _hopf(self, u: Array) -> BranchEvent:
        """The Hopf point of the equilibrium to which the orbit shrinks."""
        found, side = self.hopf(u), FarSide("", "the orbit shrinks to an equilibrium")
        event = self._event("Hopf", self, Point(u, np.zeros(u.size)), "", side)
        if found is None:
            return event
        numbers = ReadOnly({"frequency": found[2]})
        return replace(event, parameter=float(found[1][0]), coefficients=numbers)

    def _edited(
        self, kind: str, conditions: list[Condition], u: Array, p: Array
    ) -> ChangedItinerary | None:
        try:
            return changed_itinerary(self.problem, kind, conditions, u[: self.problem.size], p)
        except NonsmoothError:
            return None  # no itinerary with such modes

    def located(self, guess: Array, name: str) -> Point | None:
        """The orbit at which a test of this itinerary vanishes, near a guess."""
        scale = self.scale
        self.tests(Point(guess, np.zeros(guess.size)))  # sets the known conditions
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

    def onward(self, event: BranchEvent, zero: Zero) -> Departure | None:
        """The branch in the other itinerary."""
        if is_smooth(zero.name) or event.point is None or not isinstance(event.curve, OrbitCurve):
            return None
        family = self.held is not None and event.kind == "grazing-sliding"
        if event.kind == CENTRE or family:  # any orbit of the centre solves the equations beyond
            return None
        curve, u = event.curve, event.point.u
        if curve is not self and curve.problem.legs == self.problem.legs:  # from another start
            return curve.onward(event, Zero(event.test, event.point, 0.0, (event.test,)))
        if curve is not self:  # located on the side with fewer legs, which is ahead
            return curve.leave(u, ())
        return self.beyond(event.kind, self._vanishing(zero), u)

    def beyond(self, kind: str, conditions: list[Condition], u: Array) -> Departure | None:
        """Leave an event into the itinerary with more legs."""
        p = self.parameters_at(u)
        found = self._edited(kind, conditions, u, p)
        if found is None:
            return None
        start = np.append(found.u, u[-len(self.free) :])
        return self.with_problem(found.problem, found.u, p).leave(start, found.fresh)

    def leave(self, u: Array, fresh: Sequence[int]) -> Departure | None:
        """Leave an event to the side where the itinerary is admissible, new legs growing from zero."""
        return next(iter(departures(self, u, fresh)), None)

    def grown(self, u: Array, fresh: Sequence[int], by: float) -> Array:
        """Unknowns near an orbit whose legs ``fresh`` last for ``by``."""
        k = self.problem.size
        return np.append(grown(self.problem, u[:k], self.parameters_at(u), fresh, by), u[k:])


# Smooth bifurcations ------------------------------------------------------------------------------

_VERDICTS = {
    "fold": "two orbits meet and vanish",
    "branch point": "branches cross",
    "period doubling": "an orbit of twice the period branches off",
    "pitchfork": "two orbits without the symmetry branch off",
    "Neimark-Sacker": "an invariant torus is born",
}

#: Imaginary part below which a multiplier is real: that of a double one is the root of rounding.
_REAL = 1e-6

#: Distance of an angle from a strong resonance within which the normal form does not hold.
_RESONANT = 1e-4


def _smooth_side(problem: BoundaryProblem, at: Evaluation, p: Array, kind: str) -> FarSide | None:
    """Classify a smooth bifurcation."""
    verdict, numbers = _VERDICTS[kind], dict[str, float]()
    if kind in ("fold", "branch point"):
        return FarSide("", verdict)
    values = np.linalg.eigvals(return_map(problem, at))
    critical = [int(np.argmin(np.abs(values + 1.0)))]
    if kind == "Neimark-Sacker":
        critical = torus_pair(values)
        one = values[critical[0]]
        if abs(one.imag) < _REAL:
            return None  # a neutral saddle: two real multipliers with the product 1
        numbers["angle"] = angle = float(abs(np.angle(one)))
        if min(abs(3.0 * angle - 2.0 * np.pi), abs(4.0 * angle - 2.0 * np.pi)) < _RESONANT:
            return FarSide("", f"{verdict}; not classified: a strong resonance", ReadOnly(numbers))
    found = normal_form(problem, at, p, kind)
    if not found:
        return FarSide("", f"{verdict}; not classified: no orbits beside it", ReadOnly(numbers))
    value, error = found.values()
    numbers |= found
    if abs(value) <= 10.0 * error:
        return FarSide("", f"{verdict}; degenerate to rounding", ReadOnly(numbers))
    grows = (value < 0.0) if kind == "Neimark-Sacker" else (value > 0.0)
    rest = np.delete(values, critical)
    stable = grows and bool(np.all(np.abs(rest) < 1.0))
    what = "supercritical" if grows else "subcritical"
    return FarSide("", f"{verdict} ({what}{', stable' if stable else ''})", ReadOnly(numbers))


#: Error of the multiplier -1 at a branch point, which is located to about the square root of rounding.
_PARTS = 1e-3

#: Kind of an event, its curve, point and test, and its unfolding.
Located = tuple[str, OrbitCurve, Point, str, FarSide]


def _as_doubling(curve: OrbitCurve, zero: Zero) -> Located | None:
    """Recognise a branch point as the period doubling of an orbit of half the period."""
    u, p = zero.point.u, curve.parameters_at(zero.point.u)
    problem, once = prime_period(curve.problem.whole, curve.problem.undivided(u), p)
    whole = float(curve.problem.split(u)[1].sum())
    if round(whole / float(problem.split(once)[1].sum())) != 2:
        return None
    return _part(curve, problem, once, zero, "period doubling")


def _as_pitchfork(curve: OrbitCurve, zero: Zero) -> Located | None:
    """Recognise a branch point as the pitchfork of an orbit that is symmetric under a reflection."""
    u, p = zero.point.u, curve.parameters_at(zero.point.u)
    for problem, half in halves(curve.problem.whole, curve.problem.undivided(u), p):
        found = _part(curve, problem, half, zero, "pitchfork")
        if found is not None:
            return found
    return None


def _part(
    curve: OrbitCurve, problem: BoundaryProblem, part: Array, zero: Zero, kind: str
) -> Located | None:
    """The event of a part of the orbit, if its return map has the multiplier -1."""
    made = curve.with_problem(problem, part, curve.parameters_at(zero.point.u))
    u = np.append(part, zero.point.u[-len(curve.free) :])
    try:
        tangent = np.linalg.svd(made.scaled(u / made.scale)[1])[2][-1]
        point, at = made.point(u, tangent, tangent, 0.0), made.evaluation(u)
        values = np.linalg.eigvals(return_map(problem, at))
    except (NonsmoothError, np.linalg.LinAlgError):
        return None
    if point is None or not float(np.abs(values + 1.0).min()) < _PARTS:
        return None
    side = _smooth_side(problem, at, made.parameters_at(u), kind)
    return None if side is None else (kind, made, point, kind, side)
