"""Test functions along a branch of periodic orbits: itinerary changes and smooth bifurcations.

Some functions are positive while the itinerary is admissible; others vanish at smooth bifurcations.

An itinerary ceases to be admissible where a leg's duration vanishes, where a guard is grazed inside a leg, where a
guard fails at the start of the next leg or at the end of one, or where an event is no longer crossed
(the table of sliding bifurcations: di Bernardo, Kowalczyk & Nordmark 2002; with resets Nordmark 1991).
Each test is a smooth function along the branch, which continues as a virtual one beyond its zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...flow.fixed import first_terms
from ...model import Array, Evaluator, FilippovSystem, Guard, evaluator, layer_of
from ...model.derivatives.event_maps import keeps_zero
from ...model.derivatives.variational import guarded_field, states_at
from ..periodic.boundary_value_problem import BoundaryProblem, Evaluation
from ..periodic.multipliers import Multipliers, finite_return_map
from ..runs.cell_field import Guarded, field_of
from ..runs.guards import CONDITIONS, LegGuards, is_active, watch
from ..runs.legs import Leg, surface_of

_SMOOTH = ("fold", "branch point", "period doubling", "pitchfork", "Neimark-Sacker", "Hopf")

#: Tests that a user gives: the prefix of the names of events, and the extremum of a cost.
USER, COST = "event: ", "extremum of the cost"

#: Entries of a return map beyond which its small multipliers have lost their digits.
_NO_DIGITS = 1e6


@dataclass(frozen=True)
class Condition:
    """The condition behind a test function of an itinerary.

    Attributes
    ----------
    what : {"duration", "interior", "start", "end", "transversality"}
    leg : int
    guard : Guard or None
        Of the leg's mode.
    t : float or None
        Which extremum of the guard is meant, by the time since the start of the leg; the nearest to zero.
    """

    what: str
    leg: int
    guard: Guard | None = None
    t: float | None = field(default=None, compare=False)

    @cached_property
    def name(self) -> str:
        """A name that is the same along the branch."""
        g = self.guard
        of = "" if g is None else f" {g.kind} {g.element} {g.side}"
        return f"{self.what} {self.leg}{of}"


def is_smooth(name: str) -> bool:
    """Whether a test is that of a smooth bifurcation, which does not end an itinerary."""
    return name in _SMOOTH or name == COST or name.startswith(USER)


def conditions_of(
    problem: BoundaryProblem, at: Evaluation, p: Array, known: dict[str, Condition]
) -> dict[str, float]:
    """All test functions of an orbit; their conditions are added to ``known``."""
    system, legs = problem.system, problem.legs
    tests: _Tests = system.cached(("tests of legs", legs), lambda: _Tests(system, legs))
    found: dict[str, float] = {}
    for condition, value in tests(at, p):
        name = condition.name
        known.setdefault(name, condition)
        if math.isfinite(value):
            found[name] = value
    smooth = smooth_tests(problem, at, p)
    found.update((name, v) for name, v in smooth.items() if math.isfinite(v))
    return found


def condition_row(
    problem: BoundaryProblem, u: Array, p: Array, free: tuple[int, ...], condition: Condition
) -> tuple[float, Array] | None:
    """Value of a condition on one leg, and its derivatives by the unknowns and free parameters."""
    # Differences by the start of its leg and the parameters; they affect only the speed of Newton's method,
    # not its accuracy. None for conditions on the end of a leg.
    if condition.what not in ("interior", "start"):
        return None
    i, n = condition.leg, problem.dimension
    starts, durations = problem.split(u)
    duration, count = float(durations[i]), problem.size
    own = count - len(durations) * (n + 1) + i * n

    def value(x: Array, q: Array) -> float:
        if condition.what == "start":
            leg, before = problem.legs[i], problem.legs[i - 1]
            y = states_at(problem.system, leg.mode, x, q)
            first = first_terms(guarded_field(problem.system, leg.mode), y, q)[1]
            rows = _starting(problem.system, i, leg, before)
            found = {test.name: (_at_start(first[k], order, test), test) for k, order, test in rows}
            rate, test = found.get(condition.name, (np.nan, condition))
            return _through(problem.system, before, leg, test, rate, x, q)
        return touching(problem.system, problem.legs[i], condition, x, duration, q)[1]

    row, x = np.zeros(count + len(free)), starts[i]
    sizes = 1e-6 * np.maximum(np.abs(starts).max(axis=0), 1e-3)
    for k in range(n):
        step = sizes[k] * np.eye(n)[k]
        row[own + k] = (value(x + step, p) - value(x - step, p)) / (2 * sizes[k])
    for j, k in enumerate(free):
        size = 1e-6 * max(abs(float(p[k])), 1e-3)
        step = size * np.eye(p.size)[k]
        row[count + j] = (value(x, p + step) - value(x, p - step)) / (2 * size)
    return value(x, p), row


def smooth_tests(problem: BoundaryProblem, at: Evaluation, p: Array) -> dict[str, float]:
    """Tests by the multipliers of the legs' map."""
    # An eigenvalue -1 of the half map of a symmetric orbit breaks its symmetry: a pitchfork.
    reduced = finite_return_map(problem, at)
    if reduced is None:  # an event is grazed
        return {}
    values: NDArray[Any] = np.linalg.eigvals(reduced)
    if not float(np.abs(reduced).max()) < _NO_DIGITS:
        found = Multipliers(problem, at, p).of_map
        values = np.append(found, np.zeros(len(reduced) - found.size, complex))
    k, l = _pairs(values.size)
    with np.errstate(all="ignore"):
        pairs = values[k] * values[l]
        torus = float(np.multiply.reduce((pairs - 1.0) / (1.0 + np.abs(pairs))).real)
        flip = float(np.multiply.reduce((values + 1.0) / (1.0 + np.abs(values))).real)
    name = "period doubling" if problem.symmetry is None else "pitchfork"
    return {name: flip, "Neimark-Sacker": torus}


@lru_cache(maxsize=64)
def _pairs(count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    return np.triu_indices(count, 1)


class _Tests:
    """Test functions of the legs of an orbit, and their guards."""

    def __init__(self, system: FilippovSystem, legs: tuple[Leg, ...]):
        self.system, self.legs, self.guards = system, legs, LegGuards(system, legs)
        own = [field.motion.guards for field in self.guards.fields]
        self.durations = [Condition("duration", i) for i in range(len(legs))]
        self.starts = [_starting(system, i, leg, legs[i - 1]) for i, leg in enumerate(legs)]
        crossed = [system.definition.hidden and leg.kind == "crossing" for leg in legs]
        self.hidden = [crossed[i - 1] for i in range(len(legs))]
        self.ends = [_ending(i, leg, own[i]) for i, leg in enumerate(legs)]
        self.inside = [[(Condition("interior", i, g), g) for g in own[i]] for i in range(len(legs))]

    def __call__(self, at: Evaluation, p: Array) -> list[tuple[Condition, float]]:
        durations, found = at.durations.tolist(), list[tuple[Condition, float]]()
        speeds = (at.flows.gradient * at.flows.rate).sum(axis=1).tolist()
        watched = zip(*self.guards(at.starts, p, at.durations), strict=True)
        for i, (rows, begin, values) in enumerate(watched):
            first = begin[len(begin) - len(self.inside[i]) :].tolist()
            found.append((self.durations[i], durations[i]))
            for k, order, condition in self.starts[i]:
                rate, last = _at_start(first[k], order, condition), self.legs[i - 1]
                if self.hidden[i]:
                    given = condition, rate, at.starts[i], p
                    rate = _through(self.system, last, self.legs[i], *given)
                found.append((condition, rate))
            own, sign, others = self.ends[i]
            if own is not None:
                found.append((own, sign * speeds[i]))
            if others:
                if not durations[i] > 0.0:
                    state = states_at(self.system, self.legs[i].mode, at.by_leg[i].end, p)
                    values = guard_values(self.system, self.legs[i].mode)(state, p)[1][:, 0]
                found += [(condition, float(values[k])) for k, condition in others]
            found += _interior(self.inside[i], self.guards.fields[i], rows, p)
        return found


def _starting(
    system: FilippovSystem, i: int, leg: Leg, before: Leg
) -> list[tuple[int, int, Condition]]:
    """Guards that are not zero by construction at the start of a leg, of those to order 3."""
    guards = field_of(system, leg.mode).motion.guards
    orders = [(k, guard, _order(system, guard, before, leg)) for k, guard in enumerate(guards)]
    return [(k, order, Condition("start", i, g)) for k, g, order in orders if order is not None]


def _leaves_zero(system: FilippovSystem, guard: Guard, before: Leg, leg: Leg) -> bool:
    """Whether a function that the previous leg kept at zero leaves zero at a rate where this leg begins."""
    k = guard.element
    if guard.kind != "surface" or before.timed or before.mode[k] not in "sc" or leg.mode[k] in "sc":
        return False
    i, *more = system.entries[k]
    if more or i in system.algebraic or before.kind in ("impact", "jump"):
        return False
    return before.kind != "reset" or keeps_zero(system, i, before.element)


def _changes(system: FilippovSystem, guard: Guard, before: Leg, leg: Leg) -> bool:
    """Whether a guard is of a complementarity condition whose letter changes at the event before a leg."""
    k = guard.element
    if guard.kind not in ("surface", "release") or k >= len(system.entries):
        return False
    jumps = before.kind in ("reset", "impact", "jump") or before.timed
    return not jumps and system.entries[k][0] in system.half_lines and before.mode[k] != leg.mode[k]


def _order(system: FilippovSystem, guard: Guard, before: Leg, leg: Leg) -> int | None:
    """Order at which a guard is positive after the event of the leg before; None without a test."""
    if _changes(system, guard, before, leg):
        return None
    if guard.kind == "reset" == before.kind and guard.element == before.element:
        plain = guard.side and system.definition.plain
        return 1 if plain and keeps_zero(system, -1, before.element) else None
    # A crossing leaves the guard zero and its rate positive. After an exit or release the rate is zero
    # too, and its positive second derivative is the transversality of that event.
    if guard.kind not in ("surface", "exit", "impact", "release"):
        return None
    if before.kind in ("reset", "impact") and guard.kind != "surface":
        return None  # the rate after it is that before it, the transversality of the event
    if guard.kind == "surface" and surface_of(system, before) == guard.element:
        return 1 if before.kind == "crossing" else None
    if _leaves_zero(system, guard, before, leg):
        return 1
    if guard.kind == "impact" and guard.ends(before.kind, before.element, before.side):
        return None
    return 0


def _at_start(terms: Sequence[float], order: int, condition: Condition) -> float:
    """Term of a guard where a leg begins; of a reset on whose surface that is, where the leg bends to it again."""
    guard = condition.guard
    if guard is None or guard.kind != "reset":
        return float(terms[order])
    return float(guard.side * terms[1]) if guard.side * terms[2] > 0.0 else math.nan


#: Points at which hidden dynamics is sampled, a polynomial of the degree of which agrees with it.
_LAYER = np.polynomial.chebyshev.chebpts1(9)


def _through(
    system: FilippovSystem,
    before: Leg,
    leg: Leg,
    condition: Condition,
    rate: float,
    x: Array,
    p: Array,
) -> float:
    """The rate away from a surface that was crossed; with hidden dynamics its least inside, at whose zero it sticks."""
    guard = condition.guard
    k = -1 if guard is None or guard.kind != "surface" else guard.element
    if not system.definition.hidden or before.kind != "crossing" or surface_of(system, before) != k:
        return rate
    layer, i, sign = layer_of(system), system.entries[k][0], 1.0 if leg.mode[k] == "+" else -1.0
    lam = np.array([{"+": 1.0, "-": -1.0}.get(a, 0.0) for a in leg.mode[: system.surface_count]])
    slides = np.array([a == "s" for a in leg.mode[: system.surface_count]])
    rates = list[float]()
    for value in _LAYER:
        lam[i] = value
        numbers = layer.at(x, lam, p)
        if numbers.rates_l.reshape(len(lam), -1)[i][slides].any():  # by other sliding functions
            return rate
        rates.append(sign * float(numbers.rates[i]))
    inside = np.polynomial.Chebyshev.fit(_LAYER, rates, len(_LAYER) - 1, domain=[-1, 1])
    turns = [r.real for r in inside.deriv().roots() if abs(r.imag) < 1e-6 and abs(r.real) < 1.0]
    return min(float(inside(value)) for value in [-1.0, 1.0, *turns])


def _ending(
    i: int, leg: Leg, guards: Sequence[Guard]
) -> tuple[Condition | None, int, list[tuple[int, Condition]]]:
    """Transversality of a leg's event with its sign, and the other guards of sliding."""
    own = [g for g in guards if g.ends(leg.kind, leg.element, leg.side)]
    if not own:
        return None, 0, []
    sign = own[0].side if own[0].kind in ("stop", "reset") and own[0].side else -1
    others = [(k, g) for k, g in enumerate(guards) if g.kind == "exit" and g is not own[0]]
    rows = [(k, Condition("end", i, g)) for k, g in others]
    return Condition("transversality", i, own[0]), sign, rows


def guard_values(system: FilippovSystem, mode: str) -> Evaluator:
    """(y, p) -> field and guards of a mode; built once."""
    motion = guarded_field(system, mode).motion
    return evaluator(
        system, ("values", mode), lambda: [motion.field, motion.functions], motion.states
    )


def _interior(
    guards: Sequence[tuple[Condition, Guard]], field: Guarded, rows: Array, p: Array
) -> list[tuple[Condition, float]]:
    """Smallest minimum of each guard inside a leg, where something happens at its zero."""
    least: dict[int, float] = {}
    turns = rows[rows[:, 3] != 0.0]
    for row, (number, _, value, bend) in zip(turns, turns[:, :4].tolist(), strict=True):
        k = int(number)
        guard = guards[k][1]
        if (bend > 0.0 or guard.kind in CONDITIONS) and is_active(field, row, p):
            value = _signed(guard, value)
            least[k] = min(value, least.get(k, np.inf))
    return [(guards[k][0], value) for k, value in least.items()]


def _signed(guard: Guard, value: float) -> float:
    """A guard's extremum, positive as long as it is not passed."""
    sign = -guard.side if guard.kind in ("stop", "reset") else 1
    return (sign or 1) * value


def minima(
    system: FilippovSystem, leg: Leg, guard: Guard, x: Array, duration: float, p: Array
) -> list[tuple[float, float]]:
    """Times since its start and values at which a leg is extremal to a guard, the nearest approach first."""
    seen = watch(system, leg, x, duration, p).approaches if duration > 0.0 else []
    own = [(near.t, _signed(guard, near.value)) for near in seen if near.guard == guard]
    return sorted(own, key=lambda pair: abs(pair[1]))


def touching(
    system: FilippovSystem,
    leg: Leg,
    condition: Condition,
    x: Array,
    duration: float,
    p: Array,
) -> tuple[float, float]:
    """Time and value of the extremum of a guard in an interior condition."""
    assert condition.guard is not None
    found, near = minima(system, leg, condition.guard, x, duration, p), condition.t
    if near is not None:
        return min(found, key=lambda pair: abs(pair[0] - near), default=(near, np.nan))
    return found[0] if found else (0.5 * duration, np.nan)
