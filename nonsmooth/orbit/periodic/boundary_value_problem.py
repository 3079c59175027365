"""Boundary value problem of a periodic orbit with a fixed itinerary: residual, Jacobian, elimination.

Unknowns are the start x_i (extended by the time where the system depends on it) and the duration T_i of
every leg. With the flow phi of the leg's mode, its event e_i and reset g_i,

    g_i(phi_i(x_i, T_i; p)) - x_(i+1) = 0,     e_i(phi_i(x_i, T_i; p)) = 0,     i = 1 .. N,

and the last leg leads back to the first: R g_N - d - x_1 = 0, where R is a symmetry (half orbits) and
d advances the time of a forced system. The Jacobian contains plain variational matrices; eliminating the
durations gives the saltation matrices.

Guards are not checked here: a solution may be virtual, and branches pass through such points smoothly. Source: Dercole & Kuznetsov 2005 (SlideCont), Thota & Dankowicz 2008 (TC-HAT), with Taylor
legs in place of collocation.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ...flow.fixed import TOLERANCE
from ...model import Array, ConvergenceError, FilippovSystem
from ...model.derivatives.event_maps import AtEvent, EventMap, kept_maps
from ...model.derivatives.forcing import Forcing
from ...solvers import linear_equations
from ..runs.cell_legs import CellLegs
from ..runs.leg_integration import LegFlows, LegIntegrator
from ..runs.legs import Leg, LegFlow, integrate_leg, rate_at, surface_of


class JacobianIndices(NamedTuple):
    """Flat indices of the legs' equations in their matrix (m, m + q)."""

    #: (L, n + 1, n + 1 + q): States and event of each leg, by its start, its duration and
    #: parameters.
    own: NDArray[Any]
    #: (L, n): The states by the start of the next leg.
    following: NDArray[Any]
    #: (L,)
    next_leg: NDArray[Any]


@lru_cache(maxsize=256)
def jacobian_indices(count: int, n: int, q: int = 0) -> JacobianIndices:
    """Indices for ``count`` legs of n states, with q parameters."""
    size = count * (n + 1)
    rows = np.arange(count * n).reshape(count, n)
    times = np.arange(count * n, size)[:, None]
    more = np.broadcast_to(np.arange(size, size + q), (count, q))
    own, columns = np.hstack([rows, times]), np.hstack([rows, times, more])
    next_leg = np.roll(np.arange(count), -1)
    width = size + q
    return JacobianIndices(
        own[:, :, None] * width + columns[:, None, :], rows * width + rows[next_leg], next_leg
    )


#: Up to so many unknowns a dense solution is faster than elimination from leg to leg.
_DENSE = 80

#: Up to so many legs the states where they start do not determine the size of the orbit.
_FEW = 4


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The equations at some unknowns."""

    #: (m,)
    residual: Array
    #: (m, m + q): Derivatives by the unknowns, then by the chosen parameters.
    whole: Array
    #: The legs, with the events at their ends; for a leg without an event the identity and the phase
    #: condition.
    flows: LegFlows
    #: (N, n)
    starts: Array
    #: (N,)
    durations: Array
    #: (n, n) or None: The projector at the first start onto what constraints allow.
    allowed: Array | None = None
    #: The same of the parts of divided legs, as legs; None where no leg is divided.
    parts: Evaluation | None = None

    @property
    def jacobian(self) -> Array:
        """By the unknowns, (m, m)."""
        return self.whole[:, : len(self.whole)]

    @property
    def by_parameters(self) -> Array:
        """By the chosen parameters, (m, q)."""
        return self.whole[:, len(self.whole) :]

    @property
    def by_leg(self) -> tuple[LegFlow, ...]:
        """Leg by leg."""
        return self.flows.by_leg

    @property
    def events(self) -> tuple[AtEvent, ...]:
        """Event by event."""
        return self.flows.events


@dataclass(frozen=True, eq=False)
class BoundaryProblem:
    """A periodic orbit's equations: legs, symmetry, forcing, phase."""

    system: FilippovSystem
    legs: tuple[Leg, ...]
    #: (n, n) or None: R, on the states without the time.
    symmetry: Array | None = None
    #: Forcing periods by which the legs advance the time; a whole number, or a half of one with a
    #: symmetry.
    periods: float = 0.0
    #: The forcing period as a function of the parameters.
    forcing: Forcing | None = None
    #: (N,) or None: For a leg without an event: the row of the phase condition ``phase . (x_1 -
    #: reference)``.
    phase: Array | None = None
    #: (N,) or None
    reference: Array | None = None
    #: Surfaces on which every leg slides, and behind them contacts that are closed in every leg.
    kept: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        modes = [self.system.widened(leg.mode) for leg in self.legs]
        kept = [i for i, own in enumerate(zip(*modes, strict=True)) if self._is_kept(i, set(own))]
        object.__setattr__(self, "kept", tuple(kept))

    def _is_kept(self, i: int, letters: set[str]) -> bool:
        return letters == {"s" if i < self.system.surface_count else "c"}

    @cached_property
    def with_rates(self) -> list[int]:
        """Joints and contacts that are kept: their rates are, too."""
        contacts = [i for i in self.kept if i >= self.system.surface_count]
        return [*self.system.joints, *contacts]

    @cached_property
    def held(self) -> list[EventMap]:
        """Functions that are zero all the time."""
        return kept_maps(self.system, self.kept)

    @cached_property
    def dimension(self) -> int:
        """States of a leg's start, the time included."""
        return self.system.extended_dimension

    @cached_property
    def labels(self) -> Array | None:
        """Values of the discrete states of each leg, which are no unknowns; None without any."""
        rows = [leg.discrete for leg in self.legs]
        return np.array(rows) if all(rows) else None

    def _label(self, flows: LegFlows) -> None:
        """Set the discrete states to the values of the following leg, without derivatives."""
        if self.labels is not None:
            n, count = self.system.dimension, self.labels.shape[1]
            following = np.roll(self.labels, -1, axis=0)
            if self.symmetry is not None:  # mapped to the first leg's
                own = self.symmetry[n - count :, n - count :]
                following[-1] = np.linalg.solve(own, following[-1])
            flows.after[:, n - count : n] = following
            for slopes in (flows.after_state, flows.after_parameters):
                slopes[:, n - count : n] = 0.0
            flows.by_start[:, :, n - count : n] = 0.0

    @cached_property
    def has_many(self) -> bool:
        """Whether equations are solved from leg to leg: many legs, each with an event, and no more."""
        return self.size > _DENSE and not self.kept and not any(leg.timed for leg in self.legs)

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.legs) * (self.dimension + 1)

    @property
    def whole(self) -> BoundaryProblem:
        """The problem with undivided legs."""
        return self

    @property
    def of_parts(self) -> BoundaryProblem:
        """The same orbit with the parts of divided legs as its legs."""
        return self

    def parts_of(self, i: int) -> range:
        """The parts of a leg among those of all legs."""
        return range(i, i + 1)

    def begun_at(self, u: Array, i: int, t: float) -> tuple[Array, int, float, float]:
        """The last start of a part of a leg before a time t since its start: the state, its index among the unknowns, the
        time since then, and the derivative of this time by the duration of the leg, with its sign changed."""
        return self.split(u)[0][i], i * self.dimension, t, 0.0

    def undivided(self, u: Array) -> Array:
        """The unknowns of undivided legs, without free parameters."""
        return u[: self.size]

    def pack(self, starts: Array, durations: Array) -> Array:
        """Unknowns from starts (N, n) and durations (N,)."""
        return np.concatenate([np.ravel(starts), np.ravel(durations)])

    def split(self, u: Array) -> tuple[Array, Array]:
        """Starts (N, n) and durations (N,) of unknowns."""
        count = len(self.legs)
        at = count * self.dimension
        return u[:at].reshape(count, self.dimension), u[at : at + count]

    @cached_property
    def wrap(self) -> Array:
        """R on the extended states."""
        whole = np.eye(self.dimension)
        if self.symmetry is not None:
            n = self.system.dimension
            whole[:n, :n] = self.symmetry
        return whole

    def advance(self, p: Array) -> tuple[float, Array]:
        """Time by which the legs advance, and its derivatives by all parameters."""
        if self.forcing is None:
            return 0.0, np.zeros(p.size)
        value, slope = self.forcing(p)
        return self.periods * value, self.periods * slope

    def evaluate(
        self, u: Array, p: Array, chosen: tuple[int, ...] = (), tol: float = TOLERANCE
    ) -> Evaluation:
        """Residual, Jacobian by the unknowns, and derivatives by the chosen of all parameters p."""
        starts, durations = self.split(u)
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later
            flows = self.integrator(chosen)(starts, durations, p, tol)
            self._label(flows)
            return self._assembled(flows, starts, durations, p, list(chosen))

    def _assembled(
        self, flows: LegFlows, starts: Array, durations: Array, p: Array, chosen: list[int]
    ) -> Evaluation:
        (count, n), q, size = starts.shape, len(chosen), self.size
        at, residual, whole = (
            jacobian_indices(count, n, q),
            np.empty(size),
            np.zeros((size, size + q)),
        )
        moved = [flows.by_start, flows.rate[:, :, None], flows.by_parameters]
        ends = np.concatenate(moved if q else moved[:2], axis=2)
        after = flows.after
        entries = np.empty((count, n + 1, n + 1 + q))
        np.matmul(flows.after_state, ends, out=entries[:, :n])
        np.matmul(flows.gradient[:, None, :], ends, out=entries[:, n:])
        if q:
            entries[:, :n, n + 1 :] += flows.after_parameters[:, :, chosen]
            entries[:, n, n + 1 :] += flows.value_parameters[:, chosen]
        if self.symmetry is not None:
            after = after.copy()
            after[-1], entries[-1, :n] = self.wrap @ after[-1], self.wrap @ entries[-1, :n]
        flat = whole.reshape(-1)
        flat[at.own] = entries
        flat[at.following] -= 1.0
        residual[: count * n] = (after - starts[at.next_leg]).reshape(-1)
        residual[count * n :] = flows.value
        jacobian, by_parameters = whole[:, :size], whole[:, size:]
        if self.forcing is not None:
            value, slope = self.advance(p)
            residual[count * n - 1] -= value
            by_parameters[count * n - 1] -= slope[chosen]
        if self.phase is not None:
            self._phased(residual, jacobian, by_parameters, flows, starts[0])
        if self.kept:
            self._keep(residual, jacobian, by_parameters, starts[0], p, chosen)
        return Evaluation(residual, whole, flows, starts, durations, self._allowed(starts[0], p))

    def _allowed(self, start: Array, p: Array) -> Array | None:
        if not self.with_rates:
            return None
        rows = np.array([own(start, p).gradient for own in kept_maps(self.system, self.with_rates)])
        return np.asarray(np.eye(self.dimension) - np.linalg.pinv(rows) @ rows)

    def residual(self, u: Array, p: Array, extended: bool = False) -> Array | None:
        """Residual without derivatives, or in extended precision; None where the legs do not allow it."""
        starts, durations = self.split(u)
        if self.phase is not None or self.kept or self.labels is not None:
            return None
        found = self.integrator(()).ends(starts, durations, p, extended)
        if found is None:
            return None
        after, rest, value = found
        with np.errstate(over="ignore", invalid="ignore"):
            for part in (after, rest) if self.symmetry is not None else ():
                if part is not None:
                    part[-1] = self.wrap @ part[-1]
            gap = after - starts[jacobian_indices(*starts.shape).next_leg]
            gap[-1, -1] -= self.advance(p)[0]
            if rest is not None:
                gap += rest
        return np.concatenate([gap.ravel(), value])

    def integrator(self, chosen: tuple[int, ...] = ()) -> LegIntegrator | CellLegs:
        """The legs, ready to be integrated with derivatives by chosen parameters."""
        made = _INTEGRATORS.setdefault(self, {})
        found = made.get(chosen)
        if found is None:
            of_legs = CellLegs if self.system.written.tables else LegIntegrator
            build = lambda: of_legs(self.system, self.legs, chosen)
            found = made[chosen] = self.system.cached(("integrator", self.legs, chosen), build)
        return found

    def _phased(
        self, residual: Array, jacobian: Array, by_parameters: Array, flows: LegFlows, start: Array
    ) -> None:
        """The phase condition, which replaces the missing event of the one leg."""
        assert self.phase is not None and self.reference is not None
        n = self.dimension
        residual[n] = self.phase @ (start - self.reference)
        jacobian[n] = 0.0
        jacobian[n, :n] = self.phase
        by_parameters[n] = 0.0
        flows.gradient[0, :n] = self.phase @ self.wrap

    def _keep(
        self,
        residual: Array,
        jacobian: Array,
        by_parameters: Array,
        start: Array,
        p: Array,
        columns: Sequence[int],
    ) -> None:
        """Replace redundant equations by the functions that are zero all the time."""
        n = self.dimension
        first = (len(self.legs) - 1) * n
        maps = [own(start, p) for own in self.held]
        rest = np.array([at.gradient[: self.system.dimension] for at in maps])
        for i, at in enumerate(maps):
            k = int(np.argmax(np.abs(rest[i])))  # of the remainder
            rest[i + 1 :] -= np.outer(rest[i + 1 :, k] / rest[i, k], rest[i])
            residual[first + k] = at.value
            jacobian[first + k] = 0.0
            jacobian[first + k, :n] = at.gradient
            by_parameters[first + k] = at.by_parameters[list(columns)]

    def rephased(self, u: Array, p: Array) -> BoundaryProblem:
        """The problem with the plane through an orbit's start across the flow there."""
        # An autonomous orbit without events starts on a plane, which may miss the orbits that it becomes as a
        # parameter varies. Problems with events, or with forcing, do not change.
        if self.phase is None or self.system.time_dependent:
            return self
        start, leg = self.split(u)[0][0], self.legs[0]
        rate = rate_at(self.system, leg, start, p)
        speed = float(np.linalg.norm(rate))
        if not speed > 0.0:
            return self
        return replace(self, phase=rate / speed, reference=start.copy())

    def solve(self, matrix: Array, right: Array) -> Array:
        """Solve these equations, with rows of a border below; by elimination where legs are many."""
        if self.has_many:
            return eliminated(self, matrix, right).solution()
        return linear_equations.solve(matrix, right)

    def scales(self, u: Array, p: Array | None = None) -> Array:
        """Sizes of the unknowns: states by their range over the legs, times by the duration."""
        # With parameters ``p`` the states inside of few legs count, not only where they start.
        starts, durations = self.split(u)
        seen = starts
        if p is not None and len(self.legs) <= _FEW:
            n = self.dimension
            inside = list[Array]()
            with suppress(ConvergenceError):  # a virtual leg may not exist
                for leg, x, duration in zip(self.legs, starts, durations, strict=True):
                    for part in (0.2, 0.4, 0.6, 0.8):
                        flow = integrate_leg(self.system, leg, x, part * float(duration), p)
                        inside.append(flow.end[:n])
            seen = np.vstack([starts, *inside])
        size, span = self.sizes(seen, durations)
        count = len(self.legs)
        return np.array(size * count + [span] * count)

    def sizes(self, seen: Array, durations: Array) -> tuple[list[float], float]:
        """Of the states and the time at (k, n) points, and of the duration."""
        span = float(np.abs(durations).sum()) or 1.0
        size, n = np.abs(seen).max(axis=0).tolist(), self.system.dimension
        largest = max(*size[:n], 1e-300)  # the time has units of its own
        if self.system.time_dependent and largest < 1e-9 * span:  # all legs begin at zero
            largest = span
        size = [part if part > 1e-6 * largest else largest for part in size[:n]]
        return size + [span] * (self.dimension - n), span


#: Legs of a problem ready to be integrated, by the chosen parameters.
_INTEGRATORS: WeakKeyDictionary[
    BoundaryProblem, dict[tuple[int, ...], LegIntegrator | CellLegs]
] = WeakKeyDictionary()


# Symmetry action on legs.

TURNED = str.maketrans("+-", "-+")


def neighbours(problem: BoundaryProblem, i: int) -> tuple[Leg, Leg]:
    """The legs before and after leg ``i``; beyond the ends of a half those of the other half."""
    legs, last = problem.legs, len(problem.legs) - 1
    before = legs[i - 1] if i else mirrored(problem, legs[last])
    after = legs[i + 1] if i < last else mirrored(problem, legs[0])
    return before, after


def mirrored(problem: BoundaryProblem, leg: Leg) -> Leg:
    """A leg as the symmetry of the problem maps it; surfaces whose function changes its sign turn."""
    if problem.symmetry is None:
        return leg
    turned = _turning(problem)
    mode = "".join(
        c.translate(TURNED) if k < len(turned) and turned[k] else c for k, c in enumerate(leg.mode)
    )
    surface = surface_of(problem.system, leg)
    side = -leg.side if surface >= 0 and turned[surface] else leg.side
    discrete = leg.discrete
    if discrete:
        n, count = problem.system.dimension, len(discrete)
        discrete = tuple((problem.symmetry[n - count : n, n - count : n] @ discrete).tolist())
    return replace(leg, mode=mode, side=side, discrete=discrete)


def _turning(problem: BoundaryProblem) -> list[bool]:
    """Which surfaces have functions that the symmetry maps to their negatives."""
    system = problem.system
    x = np.cos(1.0 + np.arange(system.dimension))
    back = np.linalg.inv(problem.symmetry) if problem.symmetry is not None else np.eye(x.size)
    result = []
    for first, *more in system.entries:
        h = system.surface_function(first)
        a, b = (float(system.evaluate(h, v, None)[0, 0]) for v in (x, back @ x))
        result.append(not more and a * b < 0.0)  # a set has no sides
    return result


@dataclass(frozen=True, eq=False)
class ReducedEquations:
    """Bordered equations after elimination of the legs."""

    #: matrix, right (n + k, n + k), (n + k,): For the first start and the k unknowns of no leg.
    matrix: Array
    right: Array
    #: starts, durations (L, n, n + k + 1), (L, n + k + 1): Those of all legs by these, and the
    #: constant part.
    starts: Array
    durations: Array
    pivots: float

    def determinant(self) -> float:
        """Of all equations, up to a factor that keeps its sign."""
        return float(np.linalg.det(self.matrix)) * self.pivots

    def solution(self) -> Array:
        """All unknowns."""
        few = np.append(np.linalg.solve(self.matrix, self.right), 1.0)
        n = self.starts.shape[1]
        return np.concatenate([(self.starts @ few).ravel(), self.durations @ few, few[n:-1]])


def eliminated(problem: BoundaryProblem, matrix: Array, right: Array) -> ReducedEquations:
    """Reduce equations (m + k, m + k): those of an orbit, then k rows of a border."""
    # Durations first, then the starts of all legs but the first: n^3 operations for each leg.
    # Columns and rows may be scaled. The last columns of blocks are their constant parts.
    count, n, m = len(problem.legs), problem.dimension, problem.size
    few = n + len(matrix) - m
    rows = np.arange(count * n).reshape(count, n)
    own, pivot = matrix[count * n : m], np.diagonal(matrix)[count * n : m]
    if not pivot.all():
        i = int(np.argmin(np.abs(pivot)))  # the leg's event is grazed
        raise np.linalg.LinAlgError(f"leg {i + 1}: its event does not determine its duration")
    legs = np.arange(count)
    slope = -own.reshape(count, -1)[legs[:, None], rows] / pivot[:, None]
    by_rest = np.hstack([-own[:, m:], right[count * n : m, None]]) / pivot[:, None]
    by_time = matrix[rows, count * n + legs[:, None]][:, :, None]
    steps = matrix[rows[:, :, None], rows[:, None, :]] + by_time * slope[:, None, :]
    rest = np.dstack([matrix[rows, m:], -right[rows]]) + by_time * by_rest[:, None, :]
    ahead = -matrix[rows[:-1], rows[1:]][:, :, None]  # a diagonal block
    steps[:-1] /= ahead
    rest[:-1] /= ahead
    starts = np.zeros((count, n, few + 1))
    starts[:, :, n:] = np.concatenate([np.zeros((1, n, few + 1 - n)), rest[:-1]])
    starts[0, :, :n] = np.eye(n)
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later
        for i in range(count - 1):
            starts[i + 1] += steps[i] @ starts[i]
    durations = (slope[:, None, :] @ starts)[:, 0]
    durations[:, n:] += by_rest
    small = np.zeros((few, few + 1))
    small[:n] = steps[-1] @ starts[-1]
    small[:n, n:] += rest[-1]
    if count > 1:
        small[:n, :n] += matrix[rows[-1], :n]
    small[n:] = matrix[m:, : count * n] @ starts.reshape(count * n, -1)
    small[n:] += matrix[m:, count * n : m] @ durations
    small[n:, n:] += np.hstack([matrix[m:, m:], -right[m:, None]])
    pivots = float(np.prod(pivot / np.linalg.norm(own, axis=1)))
    return ReducedEquations(small[:, :-1], -small[:, -1], starts, durations, pivots)
