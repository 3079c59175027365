"""Homoclinic orbits to saddles of one mode, by projections onto eigenspaces at both ends.

The orbit begins at a distance e of the saddle x* in its unstable eigenspace and ends at a distance d in
the stable one: with rows W_s, W_u that annihilate the other space,

    W_s (x_1 - x*) = 0,  |x_1 - x*| = e,  W_u (x_end - x*) = 0,  |x_end - x*| = d.

On a surface the mode slides, and h(x_1) = 0 takes the place of the direction across it. The error in the
parameter is d^(2 + r), where r is the ratio of the unstable to the stable eigenvalue, and rounding is
magnified by d^-(1 + r): d is chosen between the two.

Source: Beyn 1990 (IMA J. Numer. Anal. 10, 379); Champneys, Kuznetsov & Sandstede 1996 (HomCont).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...local import Equilibrium, PseudoEquilibrium
from ...local.searches.pseudo_equilibria import find_pseudo_equilibrium
from ...model import Array, ConvergenceError, FilippovSystem
from ...model.derivatives.event_maps import surface_map
from ...model.derivatives.variational import variational_field
from ..periodic.orbit import named
from ..runs.legs import Leg, fly
from .loops import Loop

#: Distance from the saddle at which orbits leave it, relative to the loop.
NEAR = 1e-5

#: The error of the parameter that decides how close to the saddle the orbit ends.
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
        f"saddle: expected an equilibrium of mode {mode or 'o'!r} near {x.tolist()}, received no "
        "convergence. Give a point closer to it.",
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
            f"saddle: expected {base[1].shape[1]} unstable directions, received "
            f"{unstable.shape[1]} at {x.tolist()}: an eigenvalue passed the imaginary axis.",
            point=x,
        )
    try:
        rows = [
            np.linalg.solve(w.T @ b, w.T) if w.size else w.T
            for w, b in zip((w_stable, w_unstable), base, strict=True)
        ]
    except np.linalg.LinAlgError as error:
        raise ConvergenceError(
            f"saddle: its eigenspaces turned too far at {x.tolist()}."
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
        self._at = self.reference.point  # the saddle where it was last

    def spectrum(self, p: Array) -> Spectrum:
        """The saddle at other parameters."""
        return spectrum_of(self.system, self.mode, self._at, p, self.reference)

    def target(self) -> float:
        """How close to the saddle the orbit should end, relative to its size."""
        values = self.reference.values.real
        ratio = float(values.max() / -self.reference.leading(True))
        return float(_TRUNCATION ** (1.0 / (2.0 + ratio)))

    def prolonged(self, u: Array, wait: float, far: float) -> tuple[SaddleLoop, Array]:
        """The orbit with another part, of the duration ``wait``, that ends closer to the saddle."""
        (starts, durations), p = self.split(u), self.parameters_at(u)
        last = fly(self.system, self.legs[-1], starts[-1], float(durations[-1]), p).end
        held = (*self.held[:-1], float(durations[-1]), None)
        legs = (*self.legs, self.legs[-1])
        point = self.spectrum(p).point
        other = SaddleLoop(self.system, legs, self.free, p, self.mode, point, self.near, far, held)
        other.iterations = self.iterations
        chain = [starts.ravel(), last[: self.system.dimension], durations]
        return other, np.concatenate([*chain, np.array([wait]), u[-len(self.free) :]])

    def equations(self, u: Array) -> tuple[Array, Array]:
        n, k, p = self.system.dimension, len(self.free), self.parameters_at(u)
        values = np.zeros(u.size - k + 1)
        jacobian = np.zeros((values.size, u.size))
        held = [surface_map(self.system, i) for i, c in enumerate(self.mode) if c == "s"]
        row, first = 0, self.split(u)[0][0]
        for surface in held:
            at = surface(first, p)
            values[row], jacobian[row, :n] = at.value, at.gradient
            jacobian[row, -k:] = at.by_parameters[list(self.free)]
            row += 1
        row, flown = self.chain(u, values, jacobian, row)
        last = len(self.legs) - 1
        ends = [(first, True, np.eye(n), slice(0, n))]
        ends.append((flown.end, False, flown.by_start, slice(last * n, (last + 1) * n)))
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
                jacobian[rows, len(self.legs) * n + last] = by_x @ flown.rate
                jacobian[rows, -k:] += by_x @ flown.by_parameters
            row += found.size
        return values, jacobian

    def _at_end(self, here: Spectrum, x: Array, begins: bool) -> tuple[Array, Array]:
        """Conditions on the first or the last point, and their derivatives by it."""
        away, size = x - here.point, self.near if begins else self.far
        rows = here.left_stable if begins else here.left_unstable
        values = np.append(rows @ away, (away @ away / size - size) / 2.0)
        return values, np.vstack([rows, away / size])

    def _moved(self, p: Array, index: int) -> tuple[Spectrum, Spectrum, float]:
        """The saddle at two values of a parameter: differences only steer Newton's method."""
        size = 1e-6 * max(abs(float(p[index])), 1e-2)
        low, high = p.copy(), p.copy()
        low[index], high[index] = p[index] - size, p[index] + size
        return self.spectrum(low), self.spectrum(high), 2.0 * size

    def tests(self, u: Array) -> dict[str, float]:
        found = super().tests(u)
        here = self.spectrum(self.parameters_at(u))
        found["neutral saddle"] = here.leading(True) + here.leading(False)
        for stable in (True, False):
            side = here.values[(here.values.real < 0) == stable]
            side = side[np.argsort(np.abs(side.real))]
            if side.size > 1:
                word = "stable" if stable else "unstable"
                a, b = side[:2]
                found[f"double {word} eigenvalue"] = float(((a - b) ** 2).real)
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
