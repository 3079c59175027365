"""Equations of homoclinic orbits, as chains of legs that begin and end at a saddle.

To a saddle of one mode: the orbit begins at a distance e of the saddle x* in its unstable eigenspace and
ends at a distance d in the stable one. With rows W_s, W_u that annihilate the other space,

    W_s (x_1 - x*) = 0,  |x_1 - x*| = e,  W_u (x_end - x*) = 0,  |x_end - x*| = d.

On a surface the mode slides, and h(x_1) = 0 replaces the condition across it. The error in the
parameter is d^(2 + r), where r is the ratio of the unstable to the stable eigenvalue, and rounding is
magnified by d^-(1 + r): d is chosen between the two.

To a pseudo-saddle of the plane on attracting sliding: its unstable manifold is the surface, which leads to
a visible fold, where the orbit leaves and lands on the pseudo-saddle in finite time. For the legs
i = 1 .. N, the fold x_1, the pseudo-saddle P with its weight alpha and the parameter mu,

    h(x_1) = 0,  L_i(x_1) = 0,  phi_i(x_i, T_i) = x_(i+1),  h(x_(i+1)) = 0,  phi_N(x_N, T_N) = P,
    h(P) = 0,  (1 - alpha) F1(P) + alpha F2(P) = 0,

without asymptotics.

Source: Beyn 1990 (IMA J. Numer. Anal. 10, 379); Champneys, Kuznetsov & Sandstede 1996 (HomCont);
Kuznetsov, Rinaldi & Gragnani 2003, "One-parameter bifurcations in planar Filippov systems".
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from ...flow.names import guard_name
from ...local import Equilibrium, PseudoEquilibrium
from ...local.searches.pseudo_equilibria import find_pseudo_equilibrium
from ...model import Array, ConvergenceError, FilippovSystem
from ...model.derivatives.event_maps import event_map, surface_map
from ...model.derivatives.variational import variational_field
from ..periodic.orbit import named
from ..periodic.orbit_run import OrbitLeg, orbit_leg
from ..runs.guards import watch
from ..runs.legs import Leg, LegFlow, integrate_leg


class Loop(ABC):
    """Equations of a homoclinic orbit in (starts, durations, ..., free parameters)."""

    # A long leg is divided into parts over which errors grow little: ``held`` has the duration of a part
    # that another one continues (0: equal to that of the next), and None for the last part of a leg.

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
        """Functions that vanish where the connection degenerates."""
        found, p = dict[str, float](), self.parameters_at(u)
        whole = self.joined(u)
        for i, (leg, x, _, duration) in enumerate(whole):
            if i + 1 < len(whole):
                found[f"leg {i + 1} vanishes"] = duration
            if duration <= 0.0:
                continue
            least: dict[str, float] = {}
            for near in watch(self.system, leg, x, duration, p).approaches:
                name = f"leg {i + 1} grazes {guard_name(self.system, near.guard)}"
                least[name] = min(near.value, least.get(name, np.inf))
            found.update(least)
        return found

    def joined(self, u: Array) -> list[tuple[Leg, Array, float, float]]:
        """Legs with their starts, times and durations, the parts of each joined."""
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

    def chain(self, u: Array, values: Array, jacobian: Array, row: int) -> tuple[int, LegFlow]:
        """Fill the rows of the chain of legs; return the next row and the end of the last leg."""
        starts, durations = self.split(u)
        p, free, n = self.parameters_at(u), list(self.free), self.system.dimension
        count, k, flow = len(self.legs), len(free), None
        self.iterations += 1
        for i, leg in enumerate(self.legs):
            flow = integrate_leg(self.system, leg, starts[i], float(durations[i]), p, self.free)
            if i + 1 == count:
                break
            own, time, rows = slice(i * n, (i + 1) * n), count * n + i, slice(row, row + n)
            held = self.held[i]
            if held is not None:
                values[rows] = flow.end - starts[i + 1]
                jacobian[rows, own], jacobian[rows, time] = flow.by_start, flow.rate
                jacobian[rows, (i + 1) * n : (i + 2) * n] = -np.eye(n)
                jacobian[rows, -k:] = flow.by_parameters
                values[row + n], jacobian[row + n, time] = durations[i] - held, 1.0
                if held == 0.0:
                    values[row + n] -= durations[i + 1]
                    jacobian[row + n, time + 1] = -1.0
                row += n + 1
                continue
            at = leg.at_event(self.system, flow.end, p)
            values[rows] = at.after - starts[i + 1]
            jacobian[rows, own] = at.after_state @ flow.by_start
            jacobian[rows, time] = at.after_state @ flow.rate
            jacobian[rows, (i + 1) * n : (i + 2) * n] = -np.eye(n)
            jacobian[rows, -k:] = at.after_state @ flow.by_parameters + at.after_parameters[:, free]
            row += n
            values[row] = at.value
            jacobian[row, own] = at.gradient @ flow.by_start
            jacobian[row, time] = at.gradient @ flow.rate
            jacobian[row, -k:] = at.gradient @ flow.by_parameters + at.by_parameters[free]
            row += 1
        assert flow is not None
        return row, flow

    def described(self, u: Array) -> tuple[tuple[OrbitLeg, ...], tuple[str, ...]]:
        """The legs with their numbers, and the guards that they violate."""
        p, legs, faults = self.parameters_at(u), list[OrbitLeg](), list[str]()
        for k, (leg, x, t, duration) in enumerate(self.joined(u)):
            legs.append(orbit_leg(self.system, leg, x, t, duration))
            name = f"leg {k + 1} ({leg.mode or 'o'})"
            if duration <= 0.0:
                faults.append(f"{name} has the duration {duration:.3g}")
            else:
                seen = watch(self.system, leg, x, duration, p).violations
                faults += [f"{name}: {one}" for one in seen]
        return tuple(legs), tuple(faults)

    def pieces(self, u: Array) -> tuple[OrbitLeg, ...]:
        """The parts of the legs with their numbers."""
        starts, durations = self.split(u)
        times = np.concatenate([[0.0], np.cumsum(durations)[:-1]])
        return tuple(
            orbit_leg(self.system, leg, x.copy(), float(t), float(d), held is None)
            for leg, x, t, d, held in zip(
                self.legs, starts, times, durations, self.held, strict=True
            )
        )


# Saddles of one mode ------------------------------------------------------------------------------

#: Distance from the saddle at which orbits leave it, relative to the loop.
NEAR = 1e-5

#: Error of the parameter from which the distance at the end of the orbit follows.
_TRUNCATION = 1e-14


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A saddle of one mode with its eigenspaces."""

    point: Array
    values: Array
    stable: Array
    unstable: Array
    left_stable: Array
    left_unstable: Array

    def leading(self, stable: bool) -> float:
        """Real part of the eigenvalue next to the imaginary axis on one side of it."""
        real = self.values.real
        return float(real[real < 0].max() if stable else real[real > 0].min())


def equilibrium_of(system: FilippovSystem, mode: str, x: Array, p: Array) -> Array:
    """The zero of a mode's field near ``x``, on the surface if it slides."""
    field = variational_field(system, mode).linear
    held = [surface_map(system, k) for k, c in enumerate(mode) if c == "s"]
    size = float(np.abs(x).max()) or 1.0
    last = np.inf
    for _ in range(30):
        rate, slope, _ = (np.asarray(part, float) for part in field.copied(x, p))
        rows = [e(x, p) for e in held]
        values = np.append(rate.ravel(), [e.value for e in rows])
        matrix = np.vstack([slope, *[e.gradient[None, :] for e in rows]])
        step = np.linalg.lstsq(matrix, values, rcond=1e-13)[0]
        x = x - step
        change = float(np.abs(step).max()) / size
        if change < 1e-15 or (change < 1e-11 and change >= 0.25 * last):
            return np.asarray(x)
        last = change
    raise ConvergenceError(
        f"saddle: no equilibrium of mode {mode or 'o'!r} was found near {x.tolist()}. Give a closer point.",
        point=x,
    )


def spectrum_of(
    system: FilippovSystem, mode: str, x: Array, p: Array, reference: Spectrum | None = None
) -> Spectrum:
    """Eigenspaces of a mode at the equilibrium near ``x``; rows dual to the bases of ``reference``."""
    x = equilibrium_of(system, mode, x, p)
    slope = np.asarray(variational_field(system, mode).linear.copied(x, p)[1], float)
    right, left = np.linalg.eig(slope), np.linalg.eig(slope.T)
    held = mode.count("s")
    values, parts = right[0], []
    for found, vectors in (right, left):
        keep = np.argsort(np.abs(found))[held:]
        for sign in (-1.0, 1.0):
            parts.append(_real_basis(found[keep], vectors[:, keep], sign))
    stable, unstable, w_stable, w_unstable = parts
    base = (stable, unstable) if reference is None else (reference.stable, reference.unstable)
    if (stable.shape, unstable.shape) != (base[0].shape, base[1].shape):
        raise ConvergenceError(
            f"saddle: its unstable directions change from {base[1].shape[1]} to {unstable.shape[1]} at "
            f"{x.tolist()}. An eigenvalue crossed the imaginary axis: stay on one side of it.",
            point=x,
        )
    try:
        rows = [
            np.linalg.solve(w.T @ b, w.T) if w.size else w.T
            for w, b in zip((w_stable, w_unstable), base, strict=True)
        ]
    except np.linalg.LinAlgError as error:
        raise ConvergenceError(
            f"saddle: its eigenspaces turned too far at {x.tolist()}. Give a better guess."
        ) from error
    values = values[np.argsort(np.abs(values))[held:]]
    return Spectrum(x, values, stable, unstable, np.asarray(rows[0]), np.asarray(rows[1]))


def _real_basis(values: Array, vectors: Array, sign: float) -> Array:
    """Real orthonormal basis of the eigenvectors on one side of the imaginary axis."""
    chosen = vectors[:, sign * values.real > 0]
    count = chosen.shape[1]
    if not count:
        return np.zeros((len(vectors), 0))
    u, _, _ = np.linalg.svd(np.column_stack([chosen.real, chosen.imag]))
    return np.asarray(u[:, :count])


class SaddleLoop(Loop):
    """A homoclinic orbit to a saddle of one mode."""

    def __init__(
        self,
        system: FilippovSystem,
        legs: Sequence[Leg],
        free: tuple[int, ...],
        p: Array,
        mode: str,
        point: Array,
        near: float,
        far: float,
        held: Sequence[float | None] = (),
    ):
        super().__init__(system, legs, free, p, held)
        self.mode, self.near, self.far = mode, near, far
        self.reference = spectrum_of(system, mode, point, p)
        self._at = self.reference.point  # the last position of the saddle
        self.surface: int | None = None  # on which the saddle is required to be

    def spectrum(self, p: Array) -> Spectrum:
        """The saddle at other parameters."""
        return spectrum_of(self.system, self.mode, self._at, p, self.reference)

    def target(self) -> float:
        """Distance from the saddle at which the orbit should end, relative to its size."""
        values = self.reference.values.real
        ratio = float(values.max() / -self.reference.leading(True))
        return float(_TRUNCATION ** (1.0 / (2.0 + ratio)))

    def prolonged(self, u: Array, wait: float, far: float) -> tuple[SaddleLoop, Array]:
        """The orbit with one more part of the duration ``wait``, ending at ``far`` from the saddle."""
        (starts, durations), p = self.split(u), self.parameters_at(u)
        last = integrate_leg(self.system, self.legs[-1], starts[-1], float(durations[-1]), p).end
        held = (*self.held[:-1], float(durations[-1]), None)
        legs = (*self.legs, self.legs[-1])
        point = self.spectrum(p).point
        other = SaddleLoop(self.system, legs, self.free, p, self.mode, point, self.near, far, held)
        other.iterations, other.surface = self.iterations, self.surface
        chain = [starts.ravel(), last[: self.system.dimension], durations]
        return other, np.concatenate([*chain, np.array([wait]), u[-len(self.free) :]])

    def equations(self, u: Array) -> tuple[Array, Array]:
        n, k, p = self.system.dimension, len(self.free), self.parameters_at(u)
        values = np.zeros(u.size - k + (1 if self.surface is None else 2))
        jacobian = np.zeros((values.size, u.size))
        held = [surface_map(self.system, i) for i, c in enumerate(self.mode) if c == "s"]
        row, first = 0, self.split(u)[0][0]
        for surface in held:
            at = surface(first, p)
            values[row], jacobian[row, :n] = at.value, at.gradient
            jacobian[row, -k:] = at.by_parameters[list(self.free)]
            row += 1
        row, flow = self.chain(u, values, jacobian, row)
        last = len(self.legs) - 1
        ends = [(first, True, np.eye(n), slice(0, n))]
        ends.append((flow.end, False, flow.by_start, slice(last * n, (last + 1) * n)))
        here = self.spectrum(p)
        if np.abs(here.point - self._at).max() < self.near + self.far:
            self._at = here.point
        around = [self._moved(p, j) for j in self.free]
        for x, begins, by_own, columns in ends:
            found, by_x = self._at_end(here, x, begins)
            rows = slice(row, row + found.size)
            values[rows], jacobian[rows, columns] = found, by_x @ by_own
            for j, (low, high, width) in enumerate(around):
                change = self._at_end(high, x, begins)[0] - self._at_end(low, x, begins)[0]
                jacobian[rows, u.size - k + j] = change / width
            if not begins:
                jacobian[rows, len(self.legs) * n + last] = by_x @ flow.rate
                jacobian[rows, -k:] += by_x @ flow.by_parameters
            row += found.size
        if self.surface is not None:
            h = surface_map(self.system, self.surface)(here.point, p)
            values[row], jacobian[row, -k:] = h.value, h.by_parameters[list(self.free)]
            moves = [(high.point - low.point) / width for low, high, width in around]
            jacobian[row, -k:] += np.array(moves) @ h.gradient
        return values, jacobian

    def _at_end(self, here: Spectrum, x: Array, begins: bool) -> tuple[Array, Array]:
        """Conditions on the first or the last point, and their derivatives by it."""
        away, size = x - here.point, self.near if begins else self.far
        rows = here.left_stable if begins else here.left_unstable
        values = np.append(rows @ away, (away @ away / size - size) / 2.0)
        return values, np.vstack([rows, away / size])

    def _moved(self, p: Array, index: int) -> tuple[Spectrum, Spectrum, float]:
        """The saddle at two values of a parameter; their difference only guides Newton's method."""
        size = 1e-6 * max(abs(float(p[index])), 1e-2)
        low, high = p.copy(), p.copy()
        low[index], high[index] = p[index] - size, p[index] + size
        return self.spectrum(low), self.spectrum(high), 2.0 * size

    def tests(self, u: Array) -> dict[str, float]:
        found = super().tests(u)
        p = self.parameters_at(u)
        here = self.spectrum(p)
        for k, letter in enumerate(self.mode):
            if letter != "s":
                of = f" of surface {k}" if len(self.mode) > 1 else ""
                h = surface_map(self.system, k)(here.point, p).value
                found[f"boundary equilibrium{of}"] = h if letter == "+" else -h
        found["neutral saddle"] = here.leading(True) + here.leading(False)
        for stable in (True, False):
            side = here.values[(here.values.real < 0) == stable]
            side = side[np.argsort(np.abs(side.real))]
            if side.size > 1:
                kind = "stable" if stable else "unstable"
                a, b = side[:2]
                found[f"double {kind} eigenvalue"] = float(((a - b) ** 2).real)
        return found

    def saddle(self, u: Array) -> Equilibrium | PseudoEquilibrium:
        p = self.parameters_at(u)
        here = self.spectrum(p)
        if "s" in self.mode:
            given = named(self.system, p)
            return find_pseudo_equilibrium(
                self.system, here.point, parameters=given, surface=self.mode.index("s")
            )
        order = np.argsort(here.values.real)
        values = here.values[order]
        margin = float(np.abs(values.real).min() / np.abs(values).max())
        h = np.inf
        if self.system.surface_count == 1:
            h = surface_map(self.system, 0)(here.point, p).value
        kind = "saddle" if not np.any(values.imag) else "saddle-focus"
        return Equilibrium(
            here.point,
            "-" if h < 0 else "+",
            "real",
            kind,
            values,
            float(h),
            margin,
            0.0,
            0.0,
            0,
            self.mode,
        )


# Pseudo-saddles of the plane ----------------------------------------------------------------------


class PseudoSaddleLoop(Loop):
    """An orbit from a visible fold to a pseudo-saddle of a planar system."""

    def __init__(
        self,
        system: FilippovSystem,
        legs: Sequence[Leg],
        free: tuple[int, ...],
        p: Array,
        side: str,
    ):
        super().__init__(system, legs, free, p)
        fold = event_map(system, "s", "exit", 0, 1 if side == "+" else -1)
        self._fold = (surface_map(system, 0), fold)
        self._fields = [variational_field(system, mode).linear for mode in "+-"]

    def pack(
        self, starts: Sequence[Array], durations: Sequence[float], saddle: PseudoEquilibrium
    ) -> Array:
        """Unknowns: starts, durations, pseudo-saddle, alpha, parameters."""
        end = [saddle.alpha, *self.p[list(self.free)]]
        return np.concatenate([np.ravel(starts), durations, saddle.point, end])

    def _further(self, size: float) -> Array:
        return np.append(np.full(self.system.dimension, size), 1.0)

    def equations(self, u: Array) -> tuple[Array, Array]:
        n, k, free, p = (
            self.system.dimension,
            len(self.free),
            list(self.free),
            self.parameters_at(u),
        )
        first = self.chained
        at, alpha, last = u[first : first + n], float(u[first + n]), len(self.legs) - 1
        values = np.zeros(u.size - k + 1)
        jacobian = np.zeros((values.size, u.size))
        for row, condition in enumerate(self._fold):
            e = condition(self.split(u)[0][0], p)
            values[row], jacobian[row, :n] = e.value, e.gradient
            jacobian[row, -k:] = e.by_parameters[free]
        row, flow = self.chain(u, values, jacobian, 2)
        rows = slice(row, row + n)
        values[rows] = flow.end - at
        jacobian[rows, last * n : (last + 1) * n] = flow.by_start
        jacobian[rows, len(self.legs) * n + last] = flow.rate
        jacobian[rows, first : first + n] = -np.eye(n)
        jacobian[rows, -k:] = flow.by_parameters
        row += n
        e = surface_map(self.system, 0)(at, p)
        values[row], jacobian[row, first : first + n] = e.value, e.gradient
        jacobian[row, -k:] = e.by_parameters[free]
        (f1, x1, p1), (f2, x2, p2) = (f.copied(at, p) for f in self._fields)
        rows = slice(row + 1, row + 1 + n)
        values[rows] = ((1 - alpha) * f1 + alpha * f2)[:, 0]
        jacobian[rows, first : first + n] = (1 - alpha) * x1 + alpha * x2
        jacobian[rows, first + n] = (f2 - f1)[:, 0]
        jacobian[rows, -k:] = ((1 - alpha) * p1 + alpha * p2)[:, free]
        return values, jacobian

    def tests(self, u: Array) -> dict[str, float]:
        found, alpha = super().tests(u), float(u[self.chained + self.system.dimension])
        slope = self.saddle(u).eigenvalues
        return found | {
            "boundary equilibrium of F1": alpha,
            "boundary equilibrium of F2": 1.0 - alpha,
            "pseudo-saddle-node": float(np.real(slope[0])),
        }

    def saddle(self, u: Array) -> PseudoEquilibrium:
        at = u[self.chained : self.chained + self.system.dimension]
        given = named(self.system, self.parameters_at(u))
        return find_pseudo_equilibrium(self.system, at, parameters=given)
