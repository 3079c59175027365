"""Master stability function: stability of synchrony of equal oscillators on a network.

Oscillators x_i' = f(x_i) - s sum_j L_ij H(x_j), where the row sums of L are zero, have the periodic orbit of one as
a common motion. Perturbations of it split into eigenvectors of s L; with an eigenvalue kappa

    delta' = (Df - kappa Pi DH) delta  on legs,    delta+ = S delta-  at events,

with the saltation matrix S of the single oscillator, and Pi = I except in sliding, where it keeps the
motion on its surfaces. That S is that of one oscillator needs a coupled variable H(x) that does not jump.

Source: Pecora & Carroll 1998; Coombes & Thul 2016, "Synchrony in networks of coupled non-smooth dynamical
systems: extending the master stability function".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, ConvergenceError, DegenerateError, OptionError
from ...model.derivatives.given_functions import Coupling
from ...result_tables import ResultTable, Tabular
from ..runs.legs import integrate_leg
from ..runs.saltation import saltations
from .multipliers import events_of
from .orbit import PeriodicOrbit

#: Nodes of the Gauss collocation, of order 2 x 8, in each part of a leg; on (0, 1), with weights and matrix.
_STAGES = 8
_NODES, _WEIGHTS = (0.5 * v for v in np.polynomial.legendre.leggauss(_STAGES))
_NODES = _NODES + 0.5
_POWERS = np.arange(1, _STAGES + 1)
_MATRIX = (_NODES[:, None] ** _POWERS / _POWERS) @ np.linalg.inv(_NODES[:, None] ** (_POWERS - 1))

#: Change of the maps, relative to their size, from one division into parts to one twice as fine.
_TOLERANCE = 1e-11

#: Parts of a leg, until two divisions agree.
_PARTS = tuple(2**i for i in range(1, 12))

#: Logarithms of multipliers nearer to zero are zero.
_NEUTRAL = 1e-9

#: Change of H at an event, relative to its size, above which it jumps.
_JUMPS = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class MasterStability(Tabular):
    """Growth of perturbations across synchrony.

    Attributes
    ----------
    kappa : ndarray (m,) of complex
        Eigenvalues of strength times Laplacian.
    multipliers : ndarray (m, n) of complex
        Factors of perturbations over one period, largest first.
    exponents : ndarray (m,)
        Largest growth rate in the unit of time; synchrony is stable where all but that of the zero
        eigenvalue are negative.
    period : float
        Of the orbit.
    """

    kappa: NDArray[np.complex128]
    multipliers: NDArray[np.complex128]
    exponents: Array
    period: float

    def _tables(self) -> dict[str, ResultTable]:
        columns = {
            "kappa": self.kappa,
            "exponent": self.exponents,
            "multipliers": ("multiplier", self.multipliers),
        }
        return {"nodes": ResultTable({"node": len(self.kappa)}, columns)}

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Where perturbations decay by more than rounding, (m,)."""
        return self.exponents * self.period < -_NEUTRAL

    def __repr__(self) -> str:
        low, high = float(self.exponents.min()), float(self.exponents.max())
        return (
            f"MasterStability({len(self.kappa)} values of kappa, exponents {low:.6g} .. {high:.6g}, "
            f"{int(self.stable.sum())} stable)"
        )


def master_stability(
    orbit: PeriodicOrbit, coupling: Sequence[Any], kappa: ArrayLike
) -> MasterStability:
    """Growth of perturbations across the synchrony of coupled oscillators, by eigenvalues of the network.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Of one oscillator.
    coupling : sequence of n expressions
        H(x): the coupling in each row of the field, in the system's states and parameters.
    kappa : array_like (m,)
        Eigenvalues of strength times Laplacian, such as ``strength * np.linalg.eigvals(laplacian)``; a
        pair with diffusive coupling of strength s has 0 and 2 s.

    Returns
    -------
    MasterStability
        Multipliers and exponents.

    Raises
    ------
    OptionError
        No periodic orbit, an expression for each state missing, or kappa that is not finite.
    DegenerateError
        The orbit is virtual; H(x) jumps at an event, so that the order of the oscillators' events enters;
        a contact or joint is closed, or vector multipliers; an event is grazed.
    ConvergenceError
        kappa is too large to integrate.

    Notes
    -----
    At an impact the states jump as those of one oscillator: the law of restitution does not include a coupling in
    the rate of a gap, as in the rates of positions.

    Examples
    --------
    Relay oscillators that are coupled by their positions; alone they have the multiplier .531802.

    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> free = -x - 0.2 * v
    >>> system = ns.FilippovSystem([x, v], surface=v, above=[v, free + 1], below=[v, free - 1])
    >>> orbit = ns.periodic_orbit(system, [-6.4, 0.01])
    >>> found = ns.master_stability(orbit, [0, v], [0.0, 0.2])
    >>> abs(found.multipliers[0]).round(6)
    array([1.      , 0.531802])
    >>> bool(found.stable[1])
    True
    """
    values, eigenvalues = _checked(orbit, coupling, kappa)
    problem, at, n = orbit.problem, orbit.evaluation, orbit.system.dimension
    _require_no_jump(orbit, values)
    jumps = saltations(at.flows.ended, *events_of(problem, at)).matrix
    product = np.broadcast_to(np.eye(n, dtype=complex), (len(eigenvalues), n, n))
    for k in range(len(problem.legs)):
        product = jumps[k][:n, :n] @ (_leg_map(orbit, values, k, eigenvalues) @ product)
    product = problem.wrap[:n, :n] @ product
    found = np.linalg.eigvals(product)
    if problem.symmetry is not None:
        found = found**2
    found = np.take_along_axis(found, np.argsort(-np.abs(found), axis=1), axis=1)
    with np.errstate(divide="ignore"):
        exponents = np.log(np.abs(found[:, 0])) / orbit.period
    return MasterStability(eigenvalues, found, exponents, orbit.period)


def _checked(
    orbit: PeriodicOrbit, coupling: Sequence[Any], kappa: ArrayLike
) -> tuple[Coupling, NDArray[np.complex128]]:
    """H and the eigenvalues."""
    if not isinstance(orbit, PeriodicOrbit):
        raise OptionError(f"orbit: expected a PeriodicOrbit, received {type(orbit).__name__}.")
    system, read = orbit.system, Coupling(orbit.system, coupling)
    values = np.atleast_1d(np.asarray(kappa, complex))
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise OptionError(f"kappa: expected finite numbers (m,), received {kappa!r}.")
    if orbit.is_virtual:
        raise DegenerateError(
            f"orbit: expected one that motions follow, received a virtual one: {orbit.faults[0]}."
        )
    degree_two = system.joints or any("c" in leg.mode[len(system.entries) :] for leg in orbit.legs)
    if system.sets or degree_two:
        raise DegenerateError(
            "orbit: master stability is implemented for switching surfaces, resets and impacts, not for vector "
            "multipliers, closed contacts and joints. Take the multipliers of the network's own orbit."
        )
    return read, values


def _require_no_jump(orbit: PeriodicOrbit, coupling: Coupling) -> None:
    """Refuse an H that jumps at an event."""
    p, flows, size = orbit.parameter_vector, orbit.evaluation.flows, orbit.problem.dimension
    for k, leg in enumerate(orbit.problem.legs):
        ends = (flows.end[k, :size], flows.after[k])
        before, after = (coupling.output.copied(x, p)[0] for x in ends)
        if np.abs(after - before).max() > _JUMPS * (1.0 + float(np.abs(before).max())):
            raise DegenerateError(
                f"coupling: expected one that does not jump at events, received one that jumps at "
                f"{leg.name(orbit.system)!r}. Between the events of two oscillators it acts with its whole jump, so "
                "that stability depends on their order: take the multipliers of the network's own orbit."
            )


class _Nodes(NamedTuple):
    """A leg at the nodes of collocation: parts, stages."""

    by_state: Array  # (parts, stages, n, n): Df of the mode
    by_output: Array  # Pi DH


def _leg_map(
    orbit: PeriodicOrbit, coupling: Coupling, k: int, kappa: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Maps (m, n, n) of perturbations along a leg, with the parts doubled until they agree."""
    duration = float(orbit.evaluation.durations[k])
    known: NDArray[np.complex128] | None = None
    for parts in _PARTS:
        at = _nodes(orbit, coupling, k, parts)
        found = _collocated(at, kappa, duration / parts)
        if known is not None and _agree(found, known):
            return found
        known = found
    raise ConvergenceError(
        f"leg {k + 1}: expected maps of perturbations that agree in {parts} parts, received ones that "
        f"differ. Give smaller kappa than {np.abs(kappa).max():.6g}."
    )


def _agree(found: NDArray[np.complex128], known: NDArray[np.complex128]) -> bool:
    size = np.abs(found).max(axis=(1, 2))
    return bool((np.abs(found - known).max(axis=(1, 2)) <= _TOLERANCE * size).all())


def _nodes(orbit: PeriodicOrbit, coupling: Coupling, k: int, parts: int) -> _Nodes:
    """Derivatives of the mode's field by states and through the coupling, at the nodes of a leg."""
    system, n = orbit.system, orbit.system.dimension
    leg, p = orbit.problem.legs[k], orbit.parameter_vector
    x, size, q = orbit.evaluation.starts[k], system.extended_dimension, len(p)
    step = float(orbit.evaluation.durations[k]) / parts
    field = replace(leg, left=()).field(coupling.driven, tuple(range(q, q + n)))
    by_state, by_output = np.empty((2, parts * _STAGES, n, n))
    t = 0.0
    for i, time in enumerate(((np.arange(parts)[:, None] + _NODES) * step).ravel().tolist()):
        x = integrate_leg(system, leg, x, time - t, p).end[:size]
        t = time
        output, slope = coupling.output.copied(x, p)
        given = np.concatenate([p, output.ravel()])  # the input that makes F + u - H the field F
        start = field.initial(x, given)
        _, by_y, by_p = field.linear.copied(start[:, 0], given)
        full = by_y @ start[:, 1:]
        by_output[i] = (full[:n, size:] + by_p[:n, q:]) @ slope
        by_state[i] = full[:n, :n] + by_output[i]
    shape = (parts, _STAGES, n, n)
    return _Nodes(by_state.reshape(shape), by_output.reshape(shape))


def _collocated(at: _Nodes, kappa: NDArray[np.complex128], step: float) -> NDArray[np.complex128]:
    """Maps (m, n, n) over the parts by collocation: slopes K_i = A_i (X + step sum_j a_ij K_j)."""
    n, m = at.by_state.shape[-1], len(kappa)
    maps = np.broadcast_to(np.eye(n, dtype=complex), (m, n, n))
    for by_state, by_output in zip(at.by_state, at.by_output, strict=True):
        a = by_state - kappa[:, None, None, None] * by_output  # (m, stages, n, n)
        system = np.einsum("ij,miab->miajb", step * _MATRIX, a).reshape(m, _STAGES * n, -1)
        slopes = np.linalg.solve(np.eye(_STAGES * n) - system, a.reshape(m, -1, n) @ maps)
        maps = maps + step * np.einsum("i,miab->mab", _WEIGHTS, slopes.reshape(m, _STAGES, n, n))
    return np.asarray(maps)


__all__ = ["MasterStability", "master_stability"]
