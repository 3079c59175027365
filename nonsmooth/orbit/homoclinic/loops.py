"""Equations of homoclinic orbits: what chains of legs that begin and end at a saddle share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy

import numpy as np

from ...flow.names import guard_name
from ...local import Equilibrium, PseudoEquilibrium
from ...model import Array, FilippovSystem
from ..periodic.orbit_run import OrbitLeg, orbit_leg
from ..runs.guards import watch
from ..runs.legs import Flown, Leg, fly


class Loop(ABC):
    """Equations of a homoclinic orbit in (starts, durations, ..., free parameters).

    Parameters
    ----------
    system : FilippovSystem
    legs : sequence of Leg
    free : tuple of int
        Parameters that vary: one for a connection, two for a curve of them.
    p : ndarray
        All parameters.
    held : sequence of (float or None), optional
        Durations of legs that end at no event but are continued by the next one, 0 for that of the
        next one: a long leg in several parts, over each of which errors grow by little.
    """

    def __init__(
        self,
        system: FilippovSystem,
        legs: Sequence[Leg],
        free: tuple[int, ...],
        p: Array,
        held: Sequence[float | None] = (),
    ):
        self.system, self.legs, self.free, self.p = system, tuple(legs), free, p
        self.held = tuple(held) or (None,) * len(legs)
        self.iterations = 0

    @property
    def chained(self) -> int:
        """Number of unknowns that are starts and durations."""
        return len(self.legs) * (self.system.dimension + 1)

    def with_free(self, free: tuple[int, ...], p: Array) -> Loop:
        """The same equations with other free parameters."""
        other = copy(self)
        other.free, other.p = free, p
        return other

    def split(self, u: Array) -> tuple[Array, Array]:
        """Starts (N, n) and durations (N,)."""
        count, n = len(self.legs), self.system.dimension
        return u[: count * n].reshape(count, n), u[count * n : count * (n + 1)]

    def parameters_at(self, u: Array) -> Array:
        """All parameters at some unknowns."""
        p = self.p.copy()
        p[list(self.free)] = u[-len(self.free) :]
        return p

    @abstractmethod
    def equations(self, u: Array) -> tuple[Array, Array]:
        """Values (m,) and Jacobian (m, m - 1 + number of free parameters)."""

    @abstractmethod
    def saddle(self, u: Array) -> Equilibrium | PseudoEquilibrium:
        """Where the orbit begins and ends."""

    def tests(self, u: Array) -> dict[str, float]:
        """What vanishes where the connection degenerates."""
        found, p = dict[str, float](), self.parameters_at(u)
        whole = self.joined(u)
        for i, (leg, x, _, duration) in enumerate(whole):
            if i + 1 < len(whole):
                found[f"leg {i + 1} vanishes"] = duration
            if duration <= 0.0:
                continue
            least: dict[str, float] = {}
            for near in watch(self.system, leg.mode, x, duration, p).approaches:
                name = f"leg {i + 1} grazes {guard_name(self.system, near.guard)}"
                least[name] = min(near.value, least.get(name, np.inf))
            found.update(least)
        return found

    def joined(self, u: Array) -> list[tuple[Leg, Array, float, float]]:
        """Legs with their starts, times and durations, those in parts put together."""
        starts, durations = self.split(u)
        result: list[tuple[Leg, Array, float, float]] = []
        t, begun = 0.0, True
        for leg, x, duration, held in zip(self.legs, starts, durations, self.held, strict=True):
            if begun:
                result.append((leg, x.copy(), t, float(duration)))
            else:
                _, first, since, so_far = result[-1]
                result[-1] = (leg, first, since, so_far + float(duration))
            t, begun = t + float(duration), held is None
        return result

    def scales(self, u: Array) -> Array:
        """Sizes of the unknowns."""
        starts, durations = self.split(u)
        size = max(float(np.abs(starts).max()), 1e-12)
        chain = [np.full(starts.size, size), np.full(durations.size, float(durations.sum()))]
        p = np.abs(u[-len(self.free) :])
        return np.concatenate([*chain, self._further(size), np.maximum(p, 0.1)])

    def _further(self, size: float) -> Array:
        """Sizes of the unknowns between the durations and the parameters."""
        return np.zeros(0)

    def chain(self, u: Array, values: Array, jacobian: Array, row: int) -> tuple[int, Flown]:
        """Fill the rows of legs that follow one another; the next row, and the end of the last leg."""
        starts, durations = self.split(u)
        p, free, n = self.parameters_at(u), list(self.free), self.system.dimension
        count, k, flown = len(self.legs), len(free), None
        self.iterations += 1
        for i, leg in enumerate(self.legs):
            flown = fly(self.system, leg, starts[i], float(durations[i]), p, self.free)
            if i + 1 == count:
                break
            own, time, rows = slice(i * n, (i + 1) * n), count * n + i, slice(row, row + n)
            held = self.held[i]
            if held is not None:
                values[rows] = flown.end - starts[i + 1]
                jacobian[rows, own], jacobian[rows, time] = flown.by_start, flown.rate
                jacobian[rows, (i + 1) * n : (i + 2) * n] = -np.eye(n)
                jacobian[rows, -k:] = flown.by_parameters
                values[row + n], jacobian[row + n, time] = durations[i] - held, 1.0
                if held == 0.0:
                    values[row + n] -= durations[i + 1]
                    jacobian[row + n, time + 1] = -1.0
                row += n + 1
                continue
            at = leg.at_end(self.system, flown.end, p)
            values[rows] = at.after - starts[i + 1]
            jacobian[rows, own] = at.after_state @ flown.by_start
            jacobian[rows, time] = at.after_state @ flown.rate
            jacobian[rows, (i + 1) * n : (i + 2) * n] = -np.eye(n)
            jacobian[rows, -k:] = (
                at.after_state @ flown.by_parameters + at.after_parameters[:, free]
            )
            row += n
            values[row] = at.value
            jacobian[row, own] = at.gradient @ flown.by_start
            jacobian[row, time] = at.gradient @ flown.rate
            jacobian[row, -k:] = at.gradient @ flown.by_parameters + at.by_parameters[free]
            row += 1
        assert flown is not None
        return row, flown

    def described(self, u: Array) -> tuple[tuple[OrbitLeg, ...], tuple[str, ...]]:
        """The legs with numbers, and what their guards contradict."""
        p, legs, faults = self.parameters_at(u), list[OrbitLeg](), list[str]()
        for k, (leg, x, t, duration) in enumerate(self.joined(u)):
            legs.append(orbit_leg(self.system, leg, x, t, duration))
            name = f"leg {k + 1} ({leg.mode or 'o'})"
            if duration <= 0.0:
                faults.append(f"{name} has the duration {duration:.3g}")
            else:
                seen = watch(self.system, leg.mode, x, duration, p).faults
                faults += [f"{name}: {fault}" for fault in seen]
        return tuple(legs), tuple(faults)

    def pieces(self, u: Array) -> tuple[OrbitLeg, ...]:
        """The parts of the legs with numbers."""
        starts, durations = self.split(u)
        times = np.concatenate([[0.0], np.cumsum(durations)[:-1]])
        return tuple(
            orbit_leg(self.system, leg, x.copy(), float(t), float(d), held is None)
            for leg, x, t, d, held in zip(
                self.legs, starts, times, durations, self.held, strict=True
            )
        )
