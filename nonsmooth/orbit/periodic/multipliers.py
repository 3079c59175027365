"""Floquet multipliers of a periodic orbit from the derivatives of its legs.

The return map is condensed: perturbations are kept on the surfaces of the events, where the direction
of the flow is left out, and in the subspaces that entries to sliding leave. What remains are the
multipliers that are not structural; a multiplier 1 of the flow (or of the time) and a 0 for each
dimension lost are exact. The full matrix gives them with rounding, which estimates the error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array
from ..runs.legs import leg_name
from ..runs.saltation import passages, saltations
from .boundary_value_problem import BoundaryProblem, Evaluation, jacobian_indices

#: A direction of which a leg leaves no more than this part is lost.
_LOST = 1e-12


#: States below this part of the way of a leg are zero.
_AT_ZERO = 1e-9


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of the map of the legs, with the condensed map."""

    #: (N - 1 or N,): The nontrivial ones and the structural zeros, largest first; of the whole
    #: period. Discrete states have none.
    values: NDArray[np.complex128]
    #: Those of the legs' map alone, the half map of a symmetric orbit.
    of_map: NDArray[np.complex128]
    #: How many are structurally zero.
    zeros: int
    #: (r, r): The condensed map, whose eigenvalues are the nontrivial ones of ``of_map``.
    reduced: Array
    problem: BoundaryProblem
    #: The orbit.
    at: Evaluation

    @cached_property
    def matrix(self) -> Array:
        """The full derivative of the legs' map, (N, N)."""
        return monodromy(self.problem, self.at)

    @cached_property
    def error(self) -> float:
        """Distance of the structural multipliers of ``matrix`` from 1 and 0."""
        whole, joints = np.linalg.eigvals(self.matrix), self.problem.with_rates
        held = sum(i not in joints for i in self.problem.kept)
        # the sliding field keeps h whatever it is: off a surface that is never left its matrix has a 1
        ones = np.argsort(np.abs(whole - 1.0))[: 1 + held]
        rest = np.sort(np.abs(np.delete(whole, ones)))
        structural = rest[: self.zeros - held].tolist()
        return max(float(np.abs(whole[ones] - 1.0).max()), *structural, 0.0)


def multipliers_of(problem: BoundaryProblem, at: Evaluation, p: Array) -> Multipliers:
    """Multipliers of a periodic orbit."""
    n = problem.dimension
    reduced = _condensed(problem, at, p)
    nontrivial = np.linalg.eigvals(reduced) if len(reduced) > 1 else reduced.ravel()
    discrete = 0 if problem.labels is None else problem.labels.shape[1]
    zeros = n - 1 - nontrivial.size - discrete
    of_map = values = _sorted(np.concatenate([nontrivial, np.zeros(zeros)]))
    if problem.symmetry is not None:
        values = _sorted(of_map**2)
    return Multipliers(values, of_map, zeros, reduced, problem, at)


def _sorted(values: NDArray[Any]) -> NDArray[np.complex128]:
    if len(values) < 2:
        return values.astype(complex)
    order = np.lexsort((values.imag, -np.abs(values).round(14)))
    return np.asarray(values[order], complex)


def leg_maps(problem: BoundaryProblem, at: Evaluation) -> Array:
    """Derivatives (L, N, N) of the maps from the start of each leg to that of the next, across the flow."""
    flows = at.flows
    row = flows.gradient[:, None, :] @ flows.by_start
    speed = (flows.gradient * flows.rate).sum(axis=1)
    across = flows.by_start - flows.rate[:, :, None] * (row / speed[:, None, None])
    maps = flows.after_state @ across
    if problem.symmetry is not None:
        maps[-1] = problem.wrap @ maps[-1]
    if at.allowed is not None:
        maps[-1] = at.allowed @ maps[-1]
    return np.asarray(maps)


def return_map(problem: BoundaryProblem, at: Evaluation) -> Array:
    """Derivative of the legs' map across the flow, (N, N); 0 in place of the 1 of the flow."""
    product = np.eye(problem.dimension)
    for step in leg_maps(problem, at):
        product = step @ product
    return product


def finite_return_map(problem: BoundaryProblem, at: Evaluation) -> Array | None:
    """As ``return_map``; None where it is not finite, as an event is grazed."""
    with np.errstate(all="ignore"):
        found = return_map(problem, at)
    return found if np.isfinite(found).all() else None


def _condensed(problem: BoundaryProblem, at: Evaluation, p: Array) -> Array:
    """The return map on perturbations across the flow, in the smallest invariant subspace."""
    # in units of the orbit: sizes decide what is lost, and states and time have different units
    units = _units(problem, at)
    passages(at.flows.ended, *events_of(problem, at))  # DegenerateError where an event is grazed
    maps = leg_maps(problem, at) * (units / units[:, None])
    flow = at.flows.by_start[:, : problem.dimension] * (units / units[:, None])
    return reduced_map(maps, flow, _sliding_directions(problem, at, p, units))


def _units(problem: BoundaryProblem, at: Evaluation) -> Array:
    """Sizes of states and time; of states that are zero where all legs begin by how far these lead."""
    n, own = problem.dimension, problem.system.dimension
    units = problem.scales(problem.pack(at.starts, at.durations))[:n]
    if problem.system.time_dependent:
        ways = np.abs(at.flows.rate[: len(at.durations), :own] * at.durations[:, None]).max(
            initial=0.0
        )
        if np.abs(at.starts[:, :own]).max() < _AT_ZERO * ways:
            units[:own] = np.maximum(units[:own], ways)
    return units


def reduced_map(maps: Array, flow: Array, basis: Array) -> Array:
    """Product of maps (L, n, n) of legs on what these leave of some directions (n, r)."""
    # Directions are lost beside those that the legs carry, ``flow`` (L, n, n).
    count, n = len(maps), maps.shape[1]
    bases: list[Array] = [np.eye(n)] * count
    for i in range(2 * count):
        k, following = i % count, (i + 1) % count
        size = _length(flow[k] @ basis) if basis.size else 0.0
        basis = _range(maps[k] @ basis, size)
        if i >= count and basis.shape[1] == bases[following].shape[1]:
            break  # nothing more is lost in the second pass
        bases[following] = basis
    first = min(range(count), key=lambda i: bases[i].shape[1])
    product: Array = np.eye(bases[first].shape[1])
    for k in range(count):
        i = (first + k) % count
        product = np.asarray(bases[(i + 1) % count].T @ maps[i] @ bases[i] @ product, float)
    return product


def _sliding_directions(problem: BoundaryProblem, at: Evaluation, p: Array, units: Array) -> Array:
    """Directions that remain on the surfaces on which the orbit slides all the time, in given units."""
    if not problem.kept:
        return np.eye(problem.dimension)
    rows = [own(at.starts[0], p).gradient for own in problem.held]
    return np.asarray(np.linalg.svd(np.array(rows) * units)[2][len(rows) :].T)


def _length(matrix: Array) -> float:
    return math.sqrt(float(np.vdot(matrix, matrix)))


def _range(matrix: Array, size: float) -> Array:
    """Orthonormal basis of the range of a matrix, without what is lost beside ``size``."""
    if not matrix.shape[1]:
        return matrix
    if matrix.shape[1] == 1:
        length = _length(matrix)
        return matrix / length if length > _LOST * size else matrix[:, :0]
    u, sizes, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(u[:, sizes > _LOST * max(float(sizes[0]), size)])


def monodromy(problem: BoundaryProblem, at: Evaluation) -> Array:
    """Product of state-transition and saltation matrices over the legs, (N, N)."""
    jumps = saltations(at.flows.ended, *events_of(problem, at)).matrix
    product: Array = np.eye(problem.dimension)
    for step in jumps @ at.flows.by_start:
        product = step @ product
    product = problem.wrap @ product
    return product if at.allowed is None else np.asarray(at.allowed @ product, float)


def stability(values: NDArray[np.complex128], error: float) -> str:
    """Stability in words, from the multipliers that are not the 1 of the flow."""
    sizes, margin = np.abs(values), max(1e-9, 10.0 * error)
    outside = int(np.sum(sizes > 1.0 + margin))
    if outside:
        return f"unstable, {outside} multiplier{'s' * (outside > 1)} outside the unit circle"
    if np.any(sizes > 1.0 - margin):
        on = int(np.sum(sizes > 1.0 - margin))
        return f"neutral to first order, {on} multiplier{'s' * (on > 1)} on the unit circle"
    return "superstable" if values.size and not np.any(sizes) else "asymptotically stable"


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
