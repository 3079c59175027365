"""Floquet multipliers of a periodic orbit from the derivatives of its legs.

Perturbations are restricted to the surfaces of the events, without the direction of the flow, and to the subspaces
after entries to sliding. This gives the multipliers that are not structural; a multiplier 1 of the flow (or of the
time) and a 0 for each lost dimension are exact. Legs on which derivatives grow too differently are divided. The 1 is
also computed with the direction of the flow, which estimates the error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray

from ...model import Array, ConvergenceError, DegenerateError
from ..runs.legs import Leg, integrate_leg, leg_name, rate_at
from ..runs.saltation import passages, saltations
from .boundary_value_problem import BoundaryProblem, Evaluation, jacobian_indices
from .cyclic_qr import Factor, Product

#: States below this part of what leads away from them are zero, and those below this part of the largest are rounding.
_AT_ZERO, _ROUNDED = 1e-6, 1e-13

#: States below this many residuals are rounding.
_CLOSED = 10.0

#: Condition number of the derivatives of a leg above which it is divided.
_STIFF = 1e4

#: How often a leg is halved at most.
_HALVINGS = 10


#: Sine of the angle of a multiplier below which it is real.
_REAL = 1e-15

#: Logarithm of the size of multipliers that are on the unit circle, and beyond which their error says nothing.
_NEUTRAL, _UNSURE = 1e-9, 1e-3

#: Logarithm of multipliers below which an orbit is strongly stable.
_STRONG = -18.0


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of the map of the legs."""

    problem: BoundaryProblem
    #: The orbit.
    at: Evaluation
    p: Array

    @cached_property
    def refusal(self) -> str:
        """Why the orbit has no multipliers; empty if it has some."""
        given = self.at.flows.ended, *events_of(self.problem, self.at)
        try:
            passages(*given)
        except DegenerateError:
            try:  # not by the units of states alone
                passages(*given, units=self._units)
            except DegenerateError as error:
                return str(error)
        along = np.abs((self.at.parts or self.at).flows.by_start).max(initial=1.0)
        maps = event_maps(self.problem, self.at)
        with np.errstate(over="ignore", invalid="ignore"):
            sizes = [np.abs(own).max(initial=1.0) * along for own in maps]
        return (
            ""
            if np.isfinite([along, *sizes]).all()
            else "derivatives along the orbit are beyond the range of numbers"
        )

    @cached_property
    def logarithms(self) -> NDArray[np.complex128]:
        """Logarithms of the nontrivial multipliers that are not zero, largest first; of the legs' map alone."""
        return self._product.logarithms

    @cached_property
    def zeros(self) -> int:
        """Number of structural zeros. Discrete states have none."""
        return self._count - self.logarithms.size if not self.refusal else 0

    @property
    def of_map(self) -> NDArray[np.complex128]:
        """Those of the legs' map alone, the half map of a symmetric orbit."""
        return self._powers(1)

    @property
    def values(self) -> NDArray[np.complex128]:
        """(N - 1 or N,): The nontrivial ones and the structural zeros, largest first; of the whole period."""
        return self._powers(1 if self.problem.symmetry is None else 2)

    def _powers(self, power: int) -> NDArray[np.complex128]:
        """NaN where an event is grazed; beyond the range of numbers 0 or infinity."""
        if self.refusal:
            return np.full(self._count, complex(math.nan, math.nan))
        whole = power * self.logarithms
        whole = whole[np.lexsort((np.sin(whole.imag), -whole.real.round(13)))]
        turned = np.exp(1j * whole.imag)
        turned = np.where(np.abs(turned.imag) < _REAL, turned.real, turned)
        with np.errstate(over="ignore", under="ignore"):
            return np.concatenate([np.exp(whole.real) * turned, np.zeros(self.zeros)])

    @cached_property
    def error(self) -> float:
        """Error of the multipliers, relative to those beyond 1: by the 1 of the flow and by transposed factors."""
        return math.nan if self.refusal else max(self._carried[1], self._product.error)

    @property
    def repeats(self) -> bool:
        """Whether an autonomous orbit has the multiplier 1 twice, as in a family of orbits."""
        if self.refusal or self.problem.system.time_dependent or not 10.0 * self.error <= _UNSURE:
            return False
        return bool((np.abs(self.logarithms) <= max(_NEUTRAL, 10.0 * self.error)).any())

    @property
    def stability(self) -> str:
        """Stability in words, from the multipliers that are not the 1 of the flow."""
        if self.refusal:
            return f"not determined: {self.refusal}"
        sizes, margin = self.logarithms.real, max(_NEUTRAL, 10.0 * self.error)
        outside, on = int(np.sum(sizes > margin)), int(np.sum(np.abs(sizes) <= margin))
        if outside:
            return f"unstable, {outside} multiplier{'s' * (outside > 1)} outside the unit circle"
        if on and margin > _UNSURE:
            return f"not determined: the error of the multipliers is {self.error:.1e}"
        if on:
            return f"neutral to first order, {on} multiplier{'s' * (on > 1)} on the unit circle"
        if self.zeros and not sizes.size:
            return "superstable"
        return f"{'strongly' if sizes.size and sizes[0] < _STRONG else 'asymptotically'} stable"

    # the map of the legs --------------------------------------------------------------------------

    @cached_property
    def _count(self) -> int:
        labels = self.problem.labels
        return self.problem.dimension - 1 - (0 if labels is None else labels.shape[1])

    @property
    def _product(self) -> Product:
        """The map of the legs on directions modulo that of the flow."""
        return self._carried[0]

    @cached_property
    def _carried(self) -> tuple[Product, float]:
        """The map, and the error of the flow's own direction."""
        problem, at, units = self.problem, self.at, self._units
        n, events = problem.dimension, event_maps(problem, at)
        fields = at.flows.before[:, :n] / units
        across, factors, missed = _across(fields[0]), list[Factor](), 0.0
        if problem.kept:
            factors.append(Factor(across.T @ self._held @ across, np.eye(n - 1)))
        for i, parts in enumerate(self._parts):
            own, count = fields[i], len(parts)
            for k, (part, rate) in enumerate(parts, 1):
                x, last = part[:n] / units[:, None], k == count
                field = fields[(i + 1) % len(fields)] if last else rate[:n] / units
                ahead = _across(field)
                whole = ahead.T @ (events[i] @ part / units[:, None] if last else x)
                missed = max(missed, float(np.linalg.norm(whole @ own) / np.linalg.norm(field)))
                factors.append(Factor(whole @ across, x @ across if last else None))
                own, across = field, ahead
        return Product(factors), missed

    @cached_property
    def _units(self) -> Array:
        # sizes decide what is lost, and states and time have different units
        return _units(self.problem, self.at, self.p)

    @cached_property
    def _held(self) -> Array:
        """Projector on directions along the surfaces on which the orbit slides all the time."""
        rows = [own(self.at.starts[0], self.p).gradient for own in self.problem.held]
        kept = np.linalg.svd(np.array(rows) * self._units)[2][len(rows) :]
        return np.asarray(kept.T @ kept)

    @cached_property
    def _parts(self) -> list[list[tuple[Array, Array]]]:
        """Derivatives (S, N) of the parts of each leg, by starts in units of the orbit, and fields at their ends."""
        at, result = self.at.parts or self.at, list[list[tuple[Array, Array]]]()
        scaled = at.flows.by_start * self._units
        even = self._even(scaled)
        for i, leg in enumerate(self.problem.legs):
            result.append([])
            for k in self.problem.parts_of(i):
                whole, start = (scaled[k], at.flows.rate[k]), at.starts[k]
                duration = float(at.durations[k])
                as_one = leg.repeats or even[k]
                result[-1] += [whole] if as_one else self._cut(leg, start, duration, whole)
        return result

    def _even(self, parts: Array) -> NDArray[np.bool_]:
        """Whether derivatives (..., S, N) do not grow too differently."""
        if self.problem.system.sets:  # their null space is lost, however short the leg is
            return np.ones(parts.shape[:-2], bool)
        sizes = np.linalg.svd(
            parts[..., : self._units.size, :] / self._units[:, None], compute_uv=False
        )
        count = self._count + 1  # discrete states do not move
        return np.asarray(sizes[..., 0] <= _STIFF * sizes[..., count - 1])

    def _cut(
        self, leg: Leg, x: Array, duration: float, whole: tuple[Array, Array], halvings: int = 1
    ) -> list[tuple[Array, Array]]:
        """Parts of a leg, halved where derivatives grow too differently."""
        n, half, parts = self.problem.dimension, 0.5 * duration, list[tuple[Array, Array]]()
        for _ in range(2):
            try:
                flow = integrate_leg(self.problem.system, leg, x, half, self.p)
            except ConvergenceError:  # rounding of the parts leads it astray
                return [whole]
            moved = np.zeros_like(whole[0])
            moved[: len(flow.by_start)] = flow.by_start * self._units
            part = moved, flow.rate
            last = halvings >= _HALVINGS or self._even(moved)
            parts += [part] if last else self._cut(leg, x, half, part, halvings + 1)
            x = flow.end[:n]
        return parts


def _across(field: Array) -> Array:
    """Orthonormal basis (n, n - 1) of the directions across a field."""
    # columns of a Householder reflection
    v = field / (float(np.abs(field).max()) or 1.0)  # whose square does not overflow
    v /= math.sqrt(float(v @ v)) or 1.0
    v[0] += math.copysign(1.0, v[0])
    found: Array = np.multiply.outer(v, v[1:] / -abs(v[0]))
    found.reshape(-1)[len(v) - 1 :: len(v)] += 1.0  # below the diagonal
    return found


def event_maps(problem: BoundaryProblem, at: Evaluation) -> Array:
    """Derivatives (L, N, S) of the maps from the end of each leg to the start of the next, across the flow."""
    flows = at.flows
    speed = (flows.gradient * flows.rate).sum(axis=1)
    lost = (flows.after_state @ flows.rate[:, :, None]) / speed[:, None, None]
    maps = flows.after_state - lost * flows.gradient[:, None, :]
    if problem.symmetry is not None:
        maps[-1] = problem.wrap @ maps[-1]
    if at.allowed is not None:
        maps[-1] = at.allowed @ maps[-1]
    return np.asarray(maps)


def leg_maps(problem: BoundaryProblem, at: Evaluation) -> Array:
    """Derivatives (L, N, N) of the maps from the start of each leg to that of the next, across the flow."""
    return np.asarray(event_maps(problem, at) @ at.flows.by_start)


def _multiplied(maps: Array) -> Array:
    return reduce(lambda product, step: step @ product, maps)


def return_map(problem: BoundaryProblem, at: Evaluation) -> Array:
    """Derivative of the legs' map across the flow, (N, N); 0 in place of the 1 of the flow."""
    return _multiplied(leg_maps(problem, at))


def monodromy(problem: BoundaryProblem, at: Evaluation) -> Array:
    """Product of state-transition and saltation matrices over the legs, (N, N)."""
    jumps = saltations(at.flows.ended, *events_of(problem, at)).matrix
    product = problem.wrap @ _multiplied(jumps @ at.flows.by_start)
    return product if at.allowed is None else np.asarray(at.allowed @ product, float)


def finite_return_map(problem: BoundaryProblem, at: Evaluation) -> Array | None:
    """As ``return_map``; None where it is not finite, as an event is grazed."""
    with np.errstate(all="ignore"):
        found = return_map(problem, at)
    return found if np.isfinite(found).all() else None


def _units(problem: BoundaryProblem, at: Evaluation, p: Array) -> Array:
    """Sizes of states and time, each in its own unit; of a state that is zero by what leads away from it."""
    own, span = problem.system.dimension, float(np.abs(at.durations).sum()) or 1.0
    states = at.residual[: -len(at.durations)].reshape(-1, problem.dimension)[:, :own]
    size = np.abs(at.starts[:, :own]).max(axis=0)
    rounding = np.maximum(_CLOSED * np.abs(states).max(axis=0), _ROUNDED * size.max())
    fields = np.array([at.flows.rate[:, :own], at.flows.before[:, :own]])
    ways = np.abs(fields * at.durations[:, None]).max(axis=(0, 1))
    beside = _beside(problem, at, p)
    ways = np.maximum(ways, beside)
    derivatives = np.abs((at.parts or at).flows.by_start[:, :own]).max(axis=0)
    # its own growth is none from others
    derivatives /= np.maximum(np.diagonal(derivatives), 1.0)[:, None]
    np.fill_diagonal(derivatives, 0.0)
    zero = size <= rounding
    for _ in range(own):  # what the time and other states, which may be zero as well, lead to
        moved = derivatives * np.append(size, [span] * (derivatives.shape[1] - own))
        reach = np.maximum(ways, moved.max(axis=1))
        zero |= size <= _AT_ZERO * reach
        size = np.where(zero, reach, size)
    moved = derivatives[:, :own] * size
    excess = (moved / np.where(size > 0.0, size, np.inf)[:, None]).max(axis=0)
    # it moves no other by more than its size
    size = np.where(zero, size / np.maximum(excess, 1.0), size)
    # of a state that is projected rounding is that of the largest state
    projected = bool(problem.system.sets or problem.system.joints)
    known = (size > _ROUNDED * size.max() * projected) | (beside > 0.0)
    size = np.where(known, size, float(size.max()) or span)
    return np.append(size, [span] * (problem.dimension - own))


def _beside(problem: BoundaryProblem, at: Evaluation, p: Array) -> Array:
    """How far the fields off the surfaces on which the orbit is all the time lead during its legs, (n,)."""
    system, ways = problem.system, np.zeros(problem.system.dimension)
    kept = [i for i in problem.kept if i not in system.joints and not system.sets]
    for leg, x, duration in zip(problem.legs, at.starts, at.durations.tolist(), strict=True):
        for i, side in ((i, side) for i in kept for side in "+-"):
            letter = side if i < system.surface_count else "o"
            off = replace(leg, mode=leg.mode[:i] + letter + leg.mode[i + 1 :])
            ways = np.maximum(ways, np.abs(rate_at(system, off, x, p)[: ways.size] * duration))
    return ways


def events_of(
    problem: BoundaryProblem, at: Evaluation
) -> tuple[Array, Callable[[int], str], NDArray[np.bool_]]:
    """Fields after the events of legs, their names, and which legs have one."""
    following = jacobian_indices(len(problem.legs), problem.dimension).next_leg
    after = at.flows.before[following, : problem.dimension]
    if problem.symmetry is not None:
        after[-1] = np.linalg.solve(problem.wrap, after[-1])
    legs = problem.legs
    named = lambda i: f"leg {i + 1} {leg_name(problem.system, legs[i])}"
    return after, named, np.array([not leg.timed for leg in legs])
