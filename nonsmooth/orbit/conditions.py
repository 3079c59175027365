"""What is watched along a branch of periodic orbits: functions that are positive while its itinerary
holds, and those that vanish at smooth bifurcations.

An itinerary ceases to hold where a leg's duration ends, where a guard is grazed inside a leg, where a
guard fails at the start of the next leg or at the end of one, or where an event is no longer crossed
(the table of sliding bifurcations: di Bernardo, Kowalczyk & Nordmark 2002; with resets Nordmark 1991).
Each test is a smooth function along the branch, which goes on, virtual, beyond its zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model import Array, Evaluator, FilippovSystem, Guard
from ..model.variational import guarded_field, variational_field
from .boundary import BoundaryProblem, Evaluation
from .guards import Approach, near_and_first, watch
from .legs import Leg
from .multipliers import return_map

_SMOOTH = ("fold", "branch point", "period doubling", "pitchfork", "Neimark-Sacker", "Hopf")

#: Entries of a return map beyond this say nothing of its multipliers.
_NO_DIGITS = 1e10


@dataclass(frozen=True)
class Condition:
    """What a test of an itinerary is about.

    Attributes
    ----------
    what : {"duration", "interior", "start", "end", "transversality"}
    leg : int
    guard : Guard or None
        Of the leg's mode.
    """

    what: str
    leg: int
    guard: Guard | None = None

    @property
    def name(self) -> str:
        """A name that is the same along the branch."""
        of = f" {self.guard.name} {self.guard.side}" if self.guard is not None else ""
        return f"{self.what} {self.leg}{of}"


def is_smooth(name: str) -> bool:
    """Whether a test is that of a smooth bifurcation, which does not end an itinerary."""
    return name in _SMOOTH


def conditions_of(
    problem: BoundaryProblem, at: Evaluation, p: Array, known: dict[str, Condition]
) -> dict[str, float]:
    """All tests of an orbit; what they are about is added to ``known``."""
    found: dict[str, float] = {}
    system, legs = problem.system, problem.legs
    seen = near_and_first(system, legs, at.starts, at.durations, p)
    for i, (leg, (approaches, first)) in enumerate(zip(legs, seen, strict=True)):
        rows = [
            (Condition("duration", i), float(at.durations[i])),
            *_at_start(system, i, leg, legs[i - 1], first),
            *_at_end(problem, i, at, p),
            *_interior(i, approaches),
        ]
        for test, value in rows:
            known.setdefault(test.name, test)
            found[test.name] = value
    found.update(smooth_tests(problem, at))
    return {name: value for name, value in found.items() if np.isfinite(value)}


def condition_row(
    problem: BoundaryProblem, u: Array, p: Array, free: tuple[int, ...], condition: Condition
) -> tuple[float, Array] | None:
    """Value of a condition on one leg, and its derivatives by the unknowns and free parameters.

    Only the start of its leg and the parameters matter, by which differences are taken; they steer
    Newton's method, whose accuracy is that of the value. None for conditions on the end of a leg.
    """
    if condition.what not in ("interior", "start"):
        return None
    i, n = condition.leg, problem.dimension
    starts, durations = problem.split(u)
    duration, count = float(durations[i]), problem.size

    def value(x: Array, q: Array) -> float:
        if condition.what == "start":
            leg, before = problem.legs[i], problem.legs[i - 1]
            y = variational_field(problem.system, leg.mode).states_at(x, q)
            first = guarded_field(problem.system, leg.mode).starts.copied(y, q)[1]
            rows = _at_start(problem.system, i, leg, before, first)
            return dict((test.name, v) for test, v in rows).get(condition.name, np.nan)
        values = minima(problem.system, problem.legs[i], condition, x, duration, q)
        return min(values, key=abs, default=np.nan)  # the one that touches, not the least

    row, x = np.zeros(count + len(free)), starts[i]
    sizes = 1e-6 * np.maximum(np.abs(starts).max(axis=0), 1e-3)
    for k in range(n):
        step = sizes[k] * np.eye(n)[k]
        row[i * n + k] = (value(x + step, p) - value(x - step, p)) / (2 * sizes[k])
    for j, k in enumerate(free):
        size = 1e-6 * max(abs(float(p[k])), 1e-3)
        step = size * np.eye(p.size)[k]
        row[count + j] = (value(x, p + step) - value(x, p - step)) / (2 * size)
    return value(x, p), row


def smooth_tests(problem: BoundaryProblem, at: Evaluation) -> dict[str, float]:
    """Tests by the multipliers of the legs' map.

    An eigenvalue -1 of the half map of a symmetric orbit breaks its symmetry: a pitchfork.
    """
    with np.errstate(all="ignore"):
        reduced = return_map(problem, at)
        if not float(np.abs(reduced).max()) < _NO_DIGITS:  # an event is grazed
            return {}
        flip = float(np.linalg.det(reduced + np.eye(len(reduced))))
        values = np.linalg.eigvals(reduced)
        k, l = np.triu_indices(values.size, 1)
        torus = float(np.prod(values[k] * values[l] - 1.0).real)
    name = "period doubling" if problem.symmetry is None else "pitchfork"
    return {name: flip, "Neimark-Sacker": torus}


def _at_start(
    system: FilippovSystem, i: int, leg: Leg, before: Leg, first: Array
) -> list[tuple[Condition, float]]:
    """First Taylor coefficient, at the start of a leg, of each guard that is not zero by construction,
    of those to order 3."""
    field = guarded_field(system, leg.mode)
    orders = [_order(system, guard, before) for guard in field.motion.guards]
    return [
        (Condition("start", i, guard), float(first[k, order]))
        for k, (guard, order) in enumerate(zip(field.motion.guards, orders, strict=True))
        if order is not None
    ]


def _order(system: FilippovSystem, guard: Guard, before: Leg) -> int | None:
    """Order at which a guard is positive after the event of the leg before; None if not watched.

    A crossing leaves the guard zero and its rate positive. After an exit or release the rate is zero
    too, and its positive second derivative is the transversality of that event.
    """
    if guard.kind not in ("surface", "exit", "impact", "release"):
        return None
    if before.kind in ("reset", "impact") and guard.kind != "surface":
        return None  # the rate after it is that before it, the transversality of the event
    if guard.kind == "surface" and surface_of(system, before) == guard.index:
        return 1 if before.kind == "crossing" else None
    if guard.kind == "impact" and before.name == guard.name:
        return None
    return 0


def surface_of(system: FilippovSystem, leg: Leg) -> int:
    """The switching surface of a leg's event; -1 if it has none."""
    if leg.kind == "exit" and leg.name.startswith("L_"):
        return leg.mode.index("s")
    if leg.kind in ("crossing", "entry", "exit"):
        digits = leg.name.removeprefix("lambda").removeprefix("h")
        return int(digits) if digits.isdigit() else -1
    return -1


def _at_end(
    problem: BoundaryProblem, i: int, at: Evaluation, p: Array
) -> list[tuple[Condition, float]]:
    """How fast a leg's event is met, and guards of sliding that end together with it."""
    leg, system = problem.legs[i], problem.system
    field = guarded_field(system, leg.mode)
    own = [g for g in field.motion.guards if g.name == leg.name and leg.side in (0, g.side)]
    if not own:
        return []
    speed = float(at.events[i].gradient @ at.flown[i].rate)
    sign = own[0].side if own[0].kind in ("stop", "reset") and own[0].side else -1
    rows = [(Condition("transversality", i, own[0]), speed * sign)]
    others = [k for k, g in enumerate(field.motion.guards) if g.kind == "exit" and g is not own[0]]
    if others:
        values = guard_values(system, leg.mode)(at.flown[i].end, p)[1]
        rows += [(Condition("end", i, field.motion.guards[k]), float(values[k, 0])) for k in others]
    return rows


def guard_values(system: FilippovSystem, mode: str) -> Evaluator:
    """(y, p) -> field and guards of a mode; built once."""
    motion = guarded_field(system, mode).motion
    return system.cached(("guard values", mode), lambda: Evaluator(motion.value_function()))


def _interior(i: int, approaches: list[Approach]) -> list[tuple[Condition, float]]:
    """Smallest minimum of each guard inside a leg."""
    least: dict[Guard, float] = {}
    for near in approaches:
        value = _signed(near)
        least[near.guard] = min(value, least.get(near.guard, np.inf))
    return [(Condition("interior", i, guard), value) for guard, value in least.items()]


def _signed(near: Approach) -> float:
    """A guard's extremum, positive as long as it is not passed."""
    sign = -near.guard.side if near.guard.kind in ("stop", "reset") else 1
    return (sign or 1) * near.value


def minima(
    system: FilippovSystem, leg: Leg, condition: Condition, x: Array, duration: float, p: Array
) -> list[float]:
    """Values of the guard of an interior condition at all its minima inside a leg."""
    if duration <= 0.0:
        return []
    seen = watch(system, leg.mode, x, duration, p).approaches
    return [_signed(near) for near in seen if near.guard == condition.guard]


def touching(
    system: FilippovSystem, leg: Leg, guard: Guard, x: Array, duration: float, p: Array
) -> float:
    """Time since its start at which a leg comes nearest to a guard."""
    seen = watch(system, leg.mode, x, duration, p).approaches
    own = [near for near in seen if near.guard == guard]
    return min(own, key=lambda near: abs(near.value)).t if own else 0.5 * duration
