"""Phase response of a periodic orbit: the shift of phase by a kick of the state.

The asymptotic phase of a state near a stable orbit is that of the point of the orbit to which it converges, in
the unit of time. Its gradient Z along the orbit solves

    Z' = -Df^T Z  on legs,    Z- = S^T Z+  at events,    Z . f = 1,

with the saltation matrix S, and is periodic. As S f- = f+, the last equation holds on every leg if it holds
on one. At the start of a leg Z is the left eigenvector of the monodromy matrix for the multiplier 1.

Source: Park, Shaw, Chiel & Thomas 2018, "The infinitesimal phase response curves of oscillators in
piecewise smooth dynamical systems"; Shirasaka, Kurebayashi & Nakao 2017.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...model import Array, DegenerateError, OptionError, PointError
from ...result_tables import ResultTable, Tabular
from ..runs.legs import integrate_leg
from ..runs.saltation import saltations
from ..runs.saltation_matrix import saltation_matrix
from .multipliers import events_of, monodromy
from .orbit import PeriodicOrbit

#: Relative singular value of the equations of Z below which Z is not unique.
_FAMILY = 1e-8

#: Largest distance of the ends of a divided and of the whole leg, relative to the size of the states.
_SAME_END = 1e-8

#: Parts of each leg at the least: derivatives over a part stay moderate.
_PARTS = 4


@dataclass(frozen=True, eq=False, repr=False)
class PhaseResponse(Tabular):
    """Phase response of a periodic orbit.

    Attributes
    ----------
    orbit : PeriodicOrbit
        The orbit.
    t : ndarray (m,)
        Times since the start of the orbit, increasing from 0 to the period. Each event is there twice:
        just before it and just after.
    x : ndarray (m, n)
        States at these times.
    z : ndarray (m, n)
        Shift of the phase in the unit of time for a unit kick of each state.
    leg : ndarray (m,) of int
        The leg of each row.
    error : float
        Largest difference of Z . f from 1, and of the phase after one period, as a part of the period.
    """

    orbit: PeriodicOrbit
    t: Array
    x: Array
    z: Array
    leg: Array
    error: float

    def _tables(self) -> dict[str, ResultTable]:
        columns = {"x": self.x, "z": self.z, "leg": self.leg}
        return {
            "points": ResultTable({"t": self.t}, columns, {"state": self.orbit.system.state_names})
        }

    def __call__(self, t: float) -> Array:
        """Phase response (n,) at a time, of any size; at an event that after it.

        Parameters
        ----------
        t : float
            Time since the start of the orbit.
        """
        return self._at(t)[0]

    def kicked(self, t: float, surface: int, side: int) -> Array:
        """Phase response (n,) on a slide to kicks that leave the surface into one side.

        The motion returns to the surface at once, so that the response is Z^T S with the saltation
        matrix S of that entry; responses to the two sides differ.

        Parameters
        ----------
        t : float
            Time since the start of the orbit, in a leg that slides.
        surface : int
            Number of the switching surface.
        side : int
            +1 or -1.

        Raises
        ------
        OptionError
            A side that is not +1 or -1.
        PointError
            The orbit does not slide there on that surface, or the motion does not return to it.
        """
        if side not in (1, -1):
            raise OptionError(f"side: expected +1 or -1, received {side!r}.")
        z, x, mode = self._at(t)
        count = self.orbit.system.surface_count
        if not 0 <= surface < count or mode[surface] != "s":
            raise PointError(
                f"t = {t:.10g}: expected sliding on surface {surface}, received the mode {mode!r}. "
                "Give a time in a leg that slides, and the surface on which it does."
            )
        before = mode[:surface] + ("+" if side > 0 else "-") + mode[surface + 1 :]
        own = saltation_matrix(self.orbit.system, before, mode, x, parameters=self.orbit.parameters)
        return np.asarray(own.T @ z)

    def _at(self, t: float) -> tuple[Array, Array, str]:
        """Response and state at a time, and the mode."""
        orbit, problem = self.orbit, self.orbit.problem
        t = float(t) % orbit.period
        half = 0.5 * orbit.period
        mirrored = orbit.symmetric and t >= half
        t -= half if mirrored else 0.0
        after = min(int(np.searchsorted(self.t, t, side="right")), len(self.t) - 1)
        number = int(self.leg[after - 1])
        leg, p = replace(problem.legs[number], left=()), orbit.parameter_vector
        gone, rest = t - float(self.t[after - 1]), float(self.t[after]) - t
        at_end = after + 1 == len(self.t) or self.leg[after + 1] != number
        x = integrate_leg(orbit.system, leg, self.x[after - 1], gone, p).end[: self.x.shape[1]]
        z = (
            integrate_leg(orbit.system, leg, x, rest, p, to_end=at_end).by_start[: len(x)].T
            @ self.z[after]
        )
        if mirrored:
            x, z = problem.wrap @ x, np.linalg.solve(problem.wrap.T, z)
            number += len(problem.legs)
        return z, x, orbit.legs[number].mode

    @cached_property
    def span(self) -> Array:
        """Smallest and largest response of each state, (n, 2)."""
        return np.stack([self.z.min(axis=0), self.z.max(axis=0)], axis=1)

    def __repr__(self) -> str:
        names = self.orbit.system.state_names
        spans = ", ".join(
            f"{name} {low:.4g} .. {high:.4g}"
            for name, (low, high) in zip(names, self.span, strict=True)
        )
        return f"PhaseResponse(period {self.orbit.period:.10g}; {spans})"


def phase_response(orbit: PeriodicOrbit, *, samples: int = 200) -> PhaseResponse:
    """Phase response of a periodic orbit: the shift of phase for a small kick of each state.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Of an autonomous system.
    samples : int, optional
        Times over one period, at least 2; each leg has at least four.

    Returns
    -------
    PhaseResponse
        Times, states, responses; call it for a time between.

    Raises
    ------
    OptionError
        ``orbit`` is not a periodic orbit, ``samples`` is too small, or the system is forced: its phase is
        that of the forcing.
    DegenerateError
        The orbit is virtual, or one of a family (multiplier 1 twice), where the phase that is reached
        depends on the size of the kick; or an event is grazed.

    Notes
    -----
    On a slide only kicks along the surface have a response without a side; ``z`` is that of the sliding
    field, and ``kicked`` gives the responses into each side. How the period changes with a parameter is
    ``orbit.derivative(name).period``.

    Examples
    --------
    An oscillator with a relay: half a period later the response is the opposite.

    >>> import casadi as ca, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> free = -x - 0.2 * v
    >>> system = ns.FilippovSystem([x, v], surface=v, above=[v, free + 1], below=[v, free - 1])
    >>> orbit = ns.periodic_orbit(system, [-6.4, 0.01])
    >>> response = ns.phase_response(orbit)
    >>> response(0.7).round(6)
    array([-0.093614, -0.120738])
    """
    if not isinstance(orbit, PeriodicOrbit):
        raise OptionError(f"orbit: expected a PeriodicOrbit, received {type(orbit).__name__}.")
    if not isinstance(samples, int) or samples < 2:
        raise OptionError(f"samples: expected a whole number of at least 2, received {samples!r}.")
    if orbit.system.time_dependent:
        raise OptionError(
            "orbit: expected one of an autonomous system; the phase of a forced one is that of its forcing. "
            "orbit.derivative and sensitivity say how it answers."
        )
    if orbit.is_virtual:
        raise DegenerateError(
            f"orbit: expected one that motions follow, received a virtual one: {orbit.faults[0]}."
        )
    first = _eigenvector(orbit)
    t, x, z, leg, speed = _along(orbit, first, samples)
    error = max(
        float(np.abs(speed - 1.0).max()),
        float(np.abs((z[0] - first) * x.std(axis=0)).max()) / orbit.period,
    )
    if orbit.symmetric:
        wrap, half, count = orbit.problem.wrap, 0.5 * orbit.period, len(orbit.problem.legs)
        t, leg = np.concatenate([t, t + half]), np.concatenate([leg, leg + count])
        x, z = np.vstack([x, x @ wrap.T]), np.vstack([z, z @ np.linalg.inv(wrap)])
    return PhaseResponse(orbit, t, x, z, leg, error)


def _eigenvector(orbit: PeriodicOrbit) -> Array:
    """Z at the start of the first leg: the left eigenvector of the monodromy for 1, with Z . f = 1."""
    at = orbit.evaluation
    n = orbit.system.dimension
    matrix, field = monodromy(orbit.problem, at), at.flows.before[0, :n]
    # states in units of the orbit and the field as a direction: rows of one size whatever the units are
    units = np.ptp(orbit.trajectory.x, axis=0)
    units[units == 0.0] = 1.0
    speed = float(np.linalg.norm(field / units))
    rows = np.vstack([(matrix * units / units[:, None] - np.eye(n)).T, field / units / speed])
    free = n - len(orbit.problem.held)
    sizes = np.linalg.svd(rows, compute_uv=False)
    if sizes[free - 1] < _FAMILY * sizes[0]:
        raise DegenerateError(
            "orbit: it belongs to a family of periodic orbits (the multiplier 1 twice), so that the phase after a "
            "kick is not determined to first order. Change a parameter until the orbit is isolated."
        )
    target = np.concatenate([np.zeros(n), [1.0 / speed]])
    found = np.linalg.lstsq(rows, target, rcond=_FAMILY)[0]
    return np.asarray(found / units)


def _along(orbit: PeriodicOrbit, first: Array, samples: int) -> tuple[Array, ...]:
    """Times, states, responses, legs and Z . f on the legs that were solved for, from the last back."""
    problem, at = orbit.problem, orbit.evaluation
    jumps = saltations(at.flows.ended, *events_of(problem, at)).matrix
    ends = np.cumsum(at.durations)
    z, rows = first @ problem.wrap, list[tuple[Array, ...]]()
    for k in reversed(range(len(problem.legs))):
        duration = float(at.durations[k])
        count = max(_PARTS, int(np.ceil(samples * duration / orbit.period)))
        states, maps, speeds = _parts(orbit, k, duration / count, count)
        own = [jumps[k][:, : at.flows.sizes[k]].T @ z]
        for i in reversed(range(count)):
            own.append(maps[i].T @ own[-1])
        own[0] = own[0][: len(first)]
        z = own[-1]
        values = np.array(own[::-1])
        times = ends[k] - duration + duration * np.arange(count + 1) / count
        rate = (values * speeds).sum(axis=1)
        rows.append((times, states, values, np.full(count + 1, k), rate))
    t, x, z_all, leg, rate = (np.concatenate(part) for part in zip(*rows[::-1], strict=True))
    return t, x, z_all, leg, rate


def _parts(
    orbit: PeriodicOrbit, k: int, step: float, count: int
) -> tuple[Array, list[Array], Array]:
    """States (count + 1, n) along a leg, derivatives over its parts, and its field there."""
    system, leg, p = orbit.system, orbit.problem.legs[k], orbit.parameter_vector
    n, x = system.dimension, orbit.evaluation.starts[k]
    states, maps, speeds = [x], list[Array](), list[Array]()
    for i in range(count):
        last, own = i == count - 1, leg if i == 0 else replace(leg, left=())
        part = integrate_leg(system, own, x, step, p, to_end=last)
        maps.append(part.by_start if last else part.by_start[:n])
        x = part.end[:n]
        states.append(x)
        speeds.append(part.rate[:n])
    target = orbit.evaluation.flows.end[k, :n]
    if not np.abs(x - target).max() <= _SAME_END * (1.0 + float(np.abs(target).max())):
        raise DegenerateError(
            f"leg {k + 1}: expected the end {target.tolist()}, received {x.tolist()} in {count} parts. Its "
            "multipliers are not determined by the state; give fewer samples."
        )
    speeds.insert(0, orbit.evaluation.flows.before[k, :n])
    return np.array(states), maps, np.array(speeds)


__all__ = ["PhaseResponse", "phase_response"]
