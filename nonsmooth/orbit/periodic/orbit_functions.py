"""Numbers of a periodic orbit with their derivatives: period, values at events, extrema, integrals, multipliers.

As functions of the unknowns of the orbit's equations and of the parameters they are rows of a larger system: the
derivative of an extremum is that of the value at its time (the envelope), integrals are Gauss-Legendre sums over
the legs, on which states are analytic.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ...local.checks import parameter_index
from ...model import Array, DefinitionError, FilippovSystem, OptionError, is_real, whole
from ...model.derivatives.event_maps import EventMap
from ...model.derivatives.expressions import expression_map
from ..runs.legs import Leg, integrate_leg
from .boundary_value_problem import BoundaryProblem, Evaluation
from .multipliers import Multipliers
from .orbit import PeriodicOrbit

#: Value, and derivatives by the unknowns and the free parameters.
Row = tuple[float, Array]

#: Equations, numbers of an orbit, all parameters, and those that are free.
Rule = Callable[[BoundaryProblem, Evaluation, Array, tuple[int, ...]], Row]


@dataclass(frozen=True, eq=False, repr=False)
class OrbitFunction:
    """A number of a periodic orbit: its value, and how it changes along a branch.

    Sums, differences, products and quotients of such functions, and of them with numbers, are functions too.

    Attributes
    ----------
    system : FilippovSystem
        The system of the orbits.
    name : str
        In words.
    rule : callable
        Its value and derivatives from the equations of an orbit.
    """

    system: FilippovSystem
    name: str
    rule: Rule

    def __call__(self, orbit: PeriodicOrbit) -> float:
        """Evaluate it at an orbit."""
        return self.rule(orbit.problem.whole, orbit.evaluation, orbit.parameter_vector, ())[0]

    def derivative(self, orbit: PeriodicOrbit, parameter: str) -> float:
        """Derivative by a parameter along the branch of an orbit.

        Parameters
        ----------
        orbit : PeriodicOrbit
            The orbit at which it is taken.
        parameter : str
            Its name.
        """
        problem, p = orbit.problem.whole, orbit.parameter_vector
        free = (parameter_index(orbit.system, parameter),)
        at = problem.evaluate(orbit.problem.undivided(orbit.unknowns), p, free)
        row = self.rule(problem, at, p, free)[1]
        change = -problem.solve(at.jacobian, at.by_parameters[:, 0])
        return float(row[:-1] @ change + row[-1])

    def _with(
        self, other: Any, sign: str, of: Callable[[float, float], tuple[float, float, float]]
    ) -> OrbitFunction:
        """A function of two: ``of`` gives its value and its derivatives by them."""
        if not (is_real(other) or isinstance(other, OrbitFunction)):
            raise DefinitionError(
                f"{other!r} is neither a number nor a function of orbits. Combine what orbit_functions gives."
            )

        def rule(problem: BoundaryProblem, at: Evaluation, p: Array, free: tuple[int, ...]) -> Row:
            a, rows = self.rule(problem, at, p, free)
            b, more = (
                (float(other), 0.0 * rows) if is_real(other) else other.rule(problem, at, p, free)
            )
            value, by_a, by_b = of(a, b)
            return value, by_a * rows + by_b * more

        return OrbitFunction(
            self.system, f"({self.name} {sign} {getattr(other, 'name', other)})", rule
        )

    def __add__(self, other: Any) -> OrbitFunction:
        return self._with(other, "+", lambda a, b: (a + b, 1.0, 1.0))

    def __sub__(self, other: Any) -> OrbitFunction:
        return self._with(other, "-", lambda a, b: (a - b, 1.0, -1.0))

    def __mul__(self, other: Any) -> OrbitFunction:
        return self._with(other, "*", lambda a, b: (a * b, b, a))

    def __truediv__(self, other: Any) -> OrbitFunction:
        return self._with(other, "/", lambda a, b: (a / b, 1.0 / b, -a / b**2))

    def __neg__(self) -> OrbitFunction:
        return self * -1.0

    def __radd__(self, other: Any) -> OrbitFunction:
        return self + other

    def __rsub__(self, other: Any) -> OrbitFunction:
        return -self + other

    def __rmul__(self, other: Any) -> OrbitFunction:
        return self * other

    def __repr__(self) -> str:
        return f"OrbitFunction({self.name})"


@dataclass(frozen=True)
class UserRows:
    """Functions of orbits that a user gives: events, rows of the equations, and a cost."""

    events: Mapping[str, OrbitFunction] = field(default_factory=dict)
    constraints: tuple[OrbitFunction, ...] = ()
    cost: OrbitFunction | None = None


def read_rows(
    system: FilippovSystem, events: Any, constraints: Any, cost: Any, free: Sequence[int]
) -> UserRows:
    """Check the functions of a user along a branch of a system with further free parameters."""
    named = dict(events) if isinstance(events, Mapping) else None
    if named is None or not all(isinstance(name, str) for name in named):
        raise DefinitionError(
            f"events={events!r} is no mapping of names to functions. Write {{'amplitude 2': o.max('x') - 2}} with "
            "o = orbit_functions(system)."
        )
    rows = tuple(constraints) if isinstance(constraints, Sequence) else (constraints,)
    for function in (*named.values(), *rows, *(() if cost is None else (cost,))):
        if not isinstance(function, OrbitFunction) or function.system is not system:
            raise DefinitionError(
                f"{function!r} is no function of the orbits of this system. Make it with orbit_functions(system)."
            )
    if len(rows) != len(free):
        raise DefinitionError(
            f"{len(rows)} constraints= need as many parameters in free=, received {len(free)}. Name one for each."
        )
    return UserRows(named, rows, cost)


class OrbitFunctions:
    """Functions of the periodic orbits of a system; ``nonsmooth.orbit_functions`` makes them."""

    def __init__(self, system: FilippovSystem):
        self.system = system

    @property
    def period(self) -> OrbitFunction:
        """The duration of the whole orbit."""

        def rule(problem: BoundaryProblem, at: Evaluation, p: Array, free: tuple[int, ...]) -> Row:
            row, turns = np.zeros(problem.size + len(free)), _halves(problem)
            row[problem.size - len(problem.legs) : problem.size] = turns
            return turns * float(at.durations.sum()), row

        return OrbitFunction(self.system, "period", rule)

    def at(self, event: str, expression: Any, number: int = 0) -> OrbitFunction:
        """Return the value of an expression at an event, before the state jumps there.

        Parameters
        ----------
        event : str
            Its name, as in ``orbit.legs``.
        expression : str or SX
            In states, parameters and time, such as ``"x**2"``.
        number : int, optional
            Which of several events of that name, from 0.
        """
        own, system = expression_map(self.system, expression), self.system
        whole(number, "number", least=0)

        def rule(problem: BoundaryProblem, at: Evaluation, p: Array, free: tuple[int, ...]) -> Row:
            ends = [
                i
                for i, leg in enumerate(problem.legs)
                if not leg.timed and leg.name(system) == event
            ]
            if len(ends) <= number:
                names = [leg.name(system) for leg in problem.legs if not leg.timed]
                raise OptionError(
                    f"event={event!r} is no name of an event of the orbit, or it has fewer than {number + 1} of "
                    f"them. Give one of {names}."
                )
            i = ends[number]
            return _Legs(problem, at, p, free, own).row(i, float(at.durations[i]))

        return OrbitFunction(self.system, f"{expression} at {event}", rule)

    def max(self, expression: Any) -> OrbitFunction:
        """Return the largest value of an expression along the orbit.

        Parameters
        ----------
        expression : str or SX
            In states, parameters and time.
        """
        return self._extremum(expression, 1.0)

    def min(self, expression: Any) -> OrbitFunction:
        """Return the smallest value of an expression along the orbit.

        Parameters
        ----------
        expression : str or SX
            In states, parameters and time.
        """
        return self._extremum(expression, -1.0)

    def _extremum(self, expression: Any, sign: float) -> OrbitFunction:
        own = expression_map(self.system, expression)

        def rule(problem: BoundaryProblem, at: Evaluation, p: Array, free: tuple[int, ...]) -> Row:
            legs = _Legs(problem, at, p, (), own)
            found = [legs.largest(i, image, sign) for i, image in legs.all]
            _, i, t, image = max(found, key=lambda entry: entry[0])
            return replace(legs, free=free).row(i, t, image)

        what = "max" if sign > 0.0 else "min"
        return OrbitFunction(self.system, f"{what} {expression}", rule)

    def integral(self, expression: Any) -> OrbitFunction:
        """Return the integral of an expression over the orbit.

        Parameters
        ----------
        expression : str or SX
            In states, parameters and time.
        """
        own = expression_map(self.system, expression)

        def rule(problem: BoundaryProblem, at: Evaluation, p: Array, free: tuple[int, ...]) -> Row:
            legs = _Legs(problem, at, p, free, own)
            parts = [legs.integral(i, image) for i, image in legs.all]
            return sum(value for value, _ in parts), np.sum([row for _, row in parts], axis=0)

        return OrbitFunction(self.system, f"integral {expression}", rule)

    def multiplier(self, i: int) -> OrbitFunction:
        """Return a Floquet multiplier, or the modulus of one that is complex.

        Parameters
        ----------
        i : int
            Its number among those of ``orbit.multipliers`` that are not the 1 of the flow, by size, from 0.
        """
        whole(i, "i", least=0)

        def value(problem: BoundaryProblem, at: Evaluation, p: Array) -> float:
            found = Multipliers(problem, at, p).values
            if len(found) <= i:
                raise OptionError(f"i={i}: the orbit has {len(found)} multipliers. Count from 0.")
            return float(found[i].real if not found[i].imag else abs(found[i]))

        def rule(problem: BoundaryProblem, at: Evaluation, p: Array, free: tuple[int, ...]) -> Row:
            u = problem.pack(at.starts, at.durations)
            sizes, row = _STEP * problem.scales(u, p), np.zeros(problem.size + len(free))
            for k in range(
                problem.size if free else 0
            ):  # differences, where derivatives are needed
                step = sizes[k] * np.eye(u.size)[k]
                row[k] = value(problem, problem.evaluate(u + step, p), p)
                row[k] = (row[k] - value(problem, problem.evaluate(u - step, p), p)) / (
                    2 * sizes[k]
                )
            for k, index in enumerate(free):
                step = _STEP * max(abs(float(p[index])), 1e-3) * np.eye(p.size)[index]
                ends = [value(problem, problem.evaluate(u, q), q) for q in (p + step, p - step)]
                row[problem.size + k] = (ends[0] - ends[1]) / (2 * step[index])
            return value(problem, at, p), row

        return OrbitFunction(self.system, f"multiplier {i}", rule)

    def __repr__(self) -> str:
        return f"OrbitFunctions of {self.system!r}"


def orbit_functions(system: FilippovSystem) -> OrbitFunctions:
    """Functions of periodic orbits, for constraints, costs and events along a branch.

    Parameters
    ----------
    system : FilippovSystem
        The system of the orbits.

    Returns
    -------
    OrbitFunctions
        With ``period``, ``at(event, expression)``, ``max(expression)``, ``min(expression)``,
        ``integral(expression)`` and ``multiplier(i)``. Each is a function of an orbit, may be added, multiplied
        and divided, and has its ``derivative(orbit, parameter)``.

    See Also
    --------
    continue_orbit : which takes them as ``events=``, ``constraints=`` and ``cost=``.

    Examples
    --------
    The relay oscillator $x'' + 2 d x' + x = sgn x'$ has the amplitude 2 where $e^{-d pi/sqrt(1 - d^2)} = 1/3$:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, v, d = (ca.SX.sym(s) for s in ("x", "v", "d"))
    >>> relay = ns.FilippovSystem([x, v], surface=v, above=[v, 1 - x - 2 * d * v],
    ...                           below=[v, -1 - x - 2 * d * v], parameters={d: 0.1})
    >>> o = ns.orbit_functions(relay)
    >>> orbit = ns.periodic_orbit(relay, [-6.4, 0.0])
    >>> branch = ns.continue_orbit(orbit, "d", bounds=(0.05, 0.5), events={"amplitude 2": o.max("x") - 2})
    >>> [(e.kind, round(e.parameter, 12)) for e in branch.events]
    [('amplitude 2', 0.330097420439)]
    """
    if not isinstance(system, FilippovSystem):
        raise DefinitionError(
            f"system={system!r} is no FilippovSystem. Give the system of the orbits."
        )
    return OrbitFunctions(system)


# Values along legs --------------------------------------------------------------------------------

#: Relative step of differences of a multiplier.
_STEP = 1e-6

#: Samples of a whole orbit between which an extremum is found, and least of a leg.
_SAMPLES, _LEAST = 48, 8

#: Numbers of nodes of a leg, in turn, until an integral changes by less than this part of it.
_NODES, _EXACT = (12, 24, 48, 96, 192), 1e-13


def _halves(problem: BoundaryProblem) -> int:
    return 1 if problem.symmetry is None else 2


@dataclass(frozen=True)
class _Legs:
    """The legs of an orbit, and with a symmetry their images, along which an expression is evaluated."""

    problem: BoundaryProblem
    at: Evaluation
    p: Array
    free: tuple[int, ...]
    own: EventMap

    @property
    def all(self) -> list[tuple[int, int]]:
        """Legs by their numbers, and whether they are images."""
        legs, halves = range(len(self.problem.legs)), range(_halves(self.problem))
        return [(i, image) for i in legs for image in halves]

    def value(self, i: int, t: float, image: int = 0) -> tuple[float, float, Array]:
        """The expression at a time of a leg, its rate, and its derivatives at this time."""
        problem, n, p = self.problem, self.problem.dimension, self.p
        leg, start = Leg(problem.legs[i].mode), self.at.starts[i]
        flow = integrate_leg(problem.system, leg, start, t, p, self.free)
        y, turned, ahead = flow.end[:n], np.eye(n), np.zeros(p.size)
        if image:
            turned, (shift, slope) = problem.wrap, problem.advance(p)
            y = turned @ y
            if problem.system.time_dependent:
                y[-1] += shift
                ahead = slope
        here, row = self.own(y, p), np.zeros(problem.size + len(self.free))
        by_state = here.gradient[:n] @ turned
        row[i * n : (i + 1) * n] = by_state @ flow.by_start[:n]
        row[problem.size :] = (here.by_parameters + here.gradient[-1] * ahead)[list(self.free)]
        row[problem.size :] += by_state @ flow.by_parameters[:n]
        return here.value, float(by_state @ flow.rate[:n]), row

    def row(self, i: int, t: float, image: int = 0) -> Row:
        """The expression at a time of a leg; one that is its duration moves with it."""
        value, rate, row = self.value(i, t, image)
        if t == self.at.durations[i]:
            row[self.problem.size - len(self.problem.legs) + i] = rate
        return value, row

    def largest(self, i: int, image: int, sign: float) -> tuple[float, int, float, int]:
        """The largest value on a leg, with the leg, its time and whether it is an image."""
        duration = float(self.at.durations[i])
        count = max(_LEAST, int(np.ceil(_SAMPLES * duration / float(self.at.durations.sum()))))
        times = np.linspace(0.0, duration, count + 1).tolist()
        look = lambda t: sign * np.array(self.value(i, t, image)[:2])
        values = [look(t) for t in times]
        k = int(np.argmax([value for value, _ in values]))
        best, t = float(values[k][0]), times[k]
        for low, high in ((k - 1, k), (k, k + 1)):
            if low < 0 or high > count or not values[low][1] > 0.0 > values[high][1]:
                continue
            from scipy.optimize import brentq

            t = float(brentq(lambda s: look(s)[1], times[low], times[high], xtol=1e-15, rtol=1e-14))
            best = float(look(t)[0])
        return best, i, t, image

    def integral(self, i: int, image: int) -> Row:
        """The integral over a leg, and its derivatives."""
        duration, last = float(self.at.durations[i]), self.problem.size - len(self.problem.legs) + i
        value, before = 0.0, np.nan
        row = np.zeros(0)
        for count in _NODES:
            value, size, row = 0.0, 0.0, np.zeros(self.problem.size + len(self.free))
            for part, weight in zip(*_gauss(count), strict=True):
                here, rate, more = self.value(i, part * duration, image)
                value, size = value + weight * duration * here, size + weight * duration * abs(here)
                row += weight * duration * more
                row[last] += weight * (here + part * duration * rate)
            if abs(value - before) <= _EXACT * size:
                break
            before = value
        return value, row


@lru_cache(maxsize=8)
def _gauss(count: int) -> tuple[list[float], list[float]]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (0.5 * (nodes + 1.0)).tolist(), (0.5 * weights).tolist()
