"""What grows from a point along its eigenvectors: curves and surfaces made of orbits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...flow.saving import Savable
from ...local import Equilibrium, Fold, FoldFold
from ...local.point.regions import Region
from ...local.searches.two_fold import TwoFold
from ...model import Array, DegenerateError, Surfaces, mode_field
from ..periodic.orbit import PeriodicOrbit
from .arcs import Arc, Follower, InterruptedOrbit, lengths
from .manifold_seeds import canard_curve, orbit_seeds

# Surfaces swept by orbits: a bundle of arcs, denser where they part, and the triangles between.

#: Neighbours in a bundle are at most so many spacings apart, or there is a hole between them.
_APART = 1.0
_HOLE = 2.5

#: A seed is put between two others down to this distance of their parameters.
_CLOSEST = 1e-10


def bundle(
    seed: Callable[[float], Arc | None],
    closed: bool,
    spacing: float,
    count: int,
    most: int,
    report: Callable[[], object] = lambda: None,
) -> tuple[list[tuple[float, Arc]], bool]:
    """Arcs from seeds on a curve with the parameter 0 to 1, with further ones where they part."""
    arcs: dict[float, Arc] = {}
    tried: set[float] = set()
    new = np.linspace(0.0, 1.0, count, endpoint=not closed).tolist()
    try:
        while new:
            tried.update(new)
            for u in new:
                arc = seed(u)
                if arc is not None:
                    arcs[u] = arc
                report()
            new = [u for u in _wide(arcs, closed, spacing) if u not in tried][: most - len(arcs)]
    except KeyboardInterrupt:
        if len(arcs) < 2:
            raise
        return sorted(arcs.items()), False
    return sorted(arcs.items()), True


def _wide(arcs: dict[float, Arc], closed: bool, spacing: float) -> list[float]:
    """Parameters in the middle of neighbours that are too far apart."""
    order = sorted(arcs)
    ends = [*order[1:], order[0] + 1.0] if closed and order else order[1:]
    return [
        (a + b) / 2 % 1.0
        for a, b in zip(order, ends, strict=False)
        if b - a > _CLOSEST and _gap(arcs[a], arcs[b % 1.0 if closed else b]) > _APART * spacing
    ]


def _gap(one: Arc, other: Arc) -> float:
    """Largest distance of two arcs at equal length."""
    m = min(len(one.points), len(other.points))
    return float(np.linalg.norm(one.points[:m] - other.points[:m], axis=1).max())


def triangles(
    arcs: list[tuple[float, Arc]], closed: bool, spacing: float
) -> tuple[Array, NDArray[np.int64]]:
    """Points (k, n) of all arcs and triangles (q, 3) between neighbours, but for holes."""
    starts = np.cumsum([0, *[len(arc.points) for _, arc in arcs]])
    points = np.concatenate([arc.points for _, arc in arcs])
    found: list[tuple[int, int, int]] = []
    count = len(arcs)
    for i in range(count if closed and count > 2 else count - 1):
        j = (i + 1) % count
        m, n = len(arcs[i][1].points), len(arcs[j][1].points)
        for k in range(max(m, n) - 1):
            a, b = starts[i] + min(k, m - 1), starts[i] + min(k + 1, m - 1)
            c, d = starts[j] + min(k, n - 1), starts[j] + min(k + 1, n - 1)
            found += [t for t in ((a, b, c), (b, d, c)) if len(set(t)) == 3]
    table = np.array(found, dtype=np.int64).reshape(-1, 3)
    edges = points[table] - points[np.roll(table, 1, axis=1)]
    small = np.linalg.norm(edges, axis=2).max(axis=1) <= _HOLE * spacing
    return points, table[small]


#: Seeds are so far from the point, as a part of the length: the error is the square of it.
_NEAR = 1e-6

#: Eigenvalues with a real part below this, relative to the largest, decide nothing.
_HYPERBOLIC = 1e-9

_FIRST = 16  # arcs of a bundle at the beginning


@dataclass(frozen=True, eq=False, repr=False)
class Manifold(Savable, point="n", points="k n | 0 0", triangles="q 3 <points"):
    """Points that go to a point forward (stable) or backward (unstable) in time.

    Attributes
    ----------
    stable : bool
        Whether orbits come to the point (True) or leave it.
    point : ndarray (n,)
        Of the saddle, pseudo-saddle or fold.
    dimension : int
        1: curves; 2: surfaces.
    arcs : list of Arc
        The curves; of a surface the orbits that sweep it.
    points : ndarray (k, n)
        Of a surface.
    triangles : ndarray of int (q, 3)
        Of a surface, as rows of ``points``. There are holes where neighbours part faster than
        ``max_orbits`` allows, or for good.
    complete : bool
        False if the computation was interrupted.
    """

    stable: bool
    point: Array
    dimension: int
    arcs: list[Arc]
    points: Array = field(default_factory=lambda: np.zeros((0, 0)))
    triangles: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), np.int64))
    complete: bool = True

    def __repr__(self) -> str:
        what = "stable" if self.stable else "unstable"
        of = (
            f"{len(self.arcs)} curves"
            if self.dimension == 1
            else f"{len(self.arcs)} orbits, {len(self.triangles)} triangles"
        )
        cut = "" if self.complete else "; interrupted"
        point = self.point.round(6).tolist()
        return f"Manifold({what}, of {point}, dimension {self.dimension}: {of}{cut})"


class Grower:
    """Local directions of a manifold and what grows from them."""

    def __init__(
        self, follower: Follower, of: Any, stable: bool, most: int, report: Callable[[], object]
    ):
        self.follower, self.of, self.stable, self.most = follower, of, stable, most
        self.report = report
        self.system = follower.system
        self.point = np.asarray(of.start if isinstance(of, PeriodicOrbit) else of.point, float)
        self.step = _NEAR * follower.length
        self.rates, self.node = np.ones(1), False  # of the eigenspace: two real eigenvalues

    def grow(self) -> Manifold:
        if isinstance(self.of, (Fold, FoldFold)):
            return self._curves([partial(self._leave, mode) for mode in "+-"])
        if isinstance(self.of, TwoFold):
            return self._of_two_fold()
        if isinstance(self.of, PeriodicOrbit):
            seeds = orbit_seeds(self.of, self.follower, self.stable)
            return self._surfaces(seeds)
        if isinstance(self.of, Equilibrium):
            return self._of_equilibrium()
        return self._of_pseudo_equilibrium()

    # kinds of points -----------------------------------------------------------------------------

    def _of_equilibrium(self) -> Manifold:
        if self.of.status != "real":
            raise DegenerateError(
                f"of: expected an equilibrium on its own side, received a {self.of.status} one at "
                f"{self.point.tolist()}. It has no manifolds in the system."
            )
        basis = self._directions(self.of.mode)
        if basis.shape[1] == 1:
            return self._curves([partial(self._arc, s * basis[:, 0]) for s in (1, -1)])
        return self._circle(basis, None)

    def _of_pseudo_equilibrium(self) -> Manifold:
        of = self.of
        if of.status != "real" or of.region is Region.MIXED or of.mode.count("s") != 1:
            raise DegenerateError(
                f"of: expected a real pseudo-equilibrium on one surface, received {of}. Its manifolds "
                "are not made of orbits of the system."
            )
        basis = self._directions(of.mode)
        collects = (of.region is Region.ATTRACTING) == self.stable
        sides = [of.mode.replace("s", side) for side in "+-"]
        if collects and basis.shape[1] == 0:
            return self._curves([partial(self._leave, mode) for mode in sides])
        if collects and basis.shape[1] == 1:
            return self._sheets(basis[:, 0], sides)
        if collects:
            raise DegenerateError(
                f"of: expected a manifold of at most two dimensions, received one of "
                f"{basis.shape[1] + 1}: all that slides to it, and what comes to that."
            )
        if basis.shape[1] == 1:
            return self._curves([partial(self._arc, s * basis[:, 0], of.mode) for s in (1, -1)])
        return self._circle(basis, of.mode)

    def _directions(self, mode: str) -> Array:
        """Orthonormal basis (n, d) of the stable or unstable eigenspace."""
        system, p = self.system, self.follower.parameters
        f, n = mode_field(system, mode), system.dimension
        rows = [system.evaluate(system.gradient(f[i]), self.point, p).ravel() for i in range(n)]
        values, vectors = np.linalg.eig(np.array(rows))
        edge = _HYPERBOLIC * float(np.abs(values).max(initial=0.0))
        chosen = values.real < -edge if self.stable else values.real > edge
        count = int(chosen.sum())
        self.rates = np.abs(values[chosen].real)
        real_ones = bool(np.all(values[chosen].imag == 0.0))
        apart = count == 2 and real_ones and self.rates.max() > 1.01 * self.rates.min()
        u, _, _ = np.linalg.svd(np.column_stack([vectors[:, chosen].real, vectors[:, chosen].imag]))
        if not count and isinstance(self.of, Equilibrium):
            kind = "stable" if self.stable else "unstable"
            raise DegenerateError(
                f"of: expected a point with {kind} directions, received {self.of.kind!r} with the "
                f"eigenvalues {values.round(6).tolist()}."
            )
        self.node = apart
        return np.asarray(vectors[:, chosen].real if apart else u[:, :count])

    # what grows ----------------------------------------------------------------------------------

    def _leave(self, mode: str) -> Arc | None:
        """The orbit of one mode from the point itself."""
        return self.follower.arc(self.point, mode)

    def _arc(self, direction: Array, mode: str | None = None) -> Arc | None:
        return self.follower.arc(self.point + self.step * direction, mode)

    def _curves(self, orbits: Sequence[Callable[[], Arc | None]]) -> Manifold:
        found, complete = list[Arc](), True
        try:
            for orbit in orbits:
                arc = orbit()
                if arc is not None and len(arc.points) > 1:
                    found.append(arc)
                self.report()
        except KeyboardInterrupt as stopped:
            part = stopped.arc if isinstance(stopped, InterruptedOrbit) else None
            if part is not None and len(part.points) > 1:
                found.append(part)
            if not found:
                raise
            complete = False
        if not found:
            kind = "comes to" if self.stable else "leaves"
            raise DegenerateError(f"of: expected a point that an orbit {kind}, received {self.of}.")
        return Manifold(self.stable, self.point, 1, found, complete=complete)

    def _circle(self, basis: Array, mode: str | None) -> Manifold:
        """A surface of the orbits that start on a small circle."""
        if basis.shape[1] > 2:
            raise DegenerateError(
                f"of: expected a manifold of at most two dimensions, received {basis.shape[1]}."
            )

        def seed(u: float) -> Arc | None:
            return self._arc(basis @ self._around(u), mode)

        return self._surface(seed, True)

    def _around(self, u: float) -> Array:
        """A direction in the eigenspace, by a parameter from 0 to 1 that goes round once."""
        # With two real eigenvalues nearly all orbits leave along the strong direction; those that come
        # far along the weak one start beside it, at angles that differ by factors.
        if not self.node:
            return np.array([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)])
        quarter, part = divmod(4.0 * u, 1.0)
        spread = min(60.0, 4.0 - math.log(_NEAR) * (self.rates.max() / self.rates.min() - 1.0))
        tangent = math.exp(spread * (2.0 * part - 1.0)) if part else 0.0
        x, y = 1.0 / math.hypot(1.0, tangent), tangent / math.hypot(1.0, tangent)
        turned = [(x, y), (-y, x), (-x, -y), (y, -x)][int(quarter) % 4]
        return np.array(turned)

    def _sheets(self, direction: Array, sides: list[str]) -> Manifold:
        """A surface of the orbits of both fields that end on the curve that slides to the point."""
        return self._from_curve(self._sliding_curve(direction), sides)

    def _of_two_fold(self) -> Manifold:
        """The orbits of both fields that end on the canard, or leave it."""
        if self.system.dimension != 3 or self.system.surface_count != 1:
            raise DegenerateError(
                f"of: expected a two-fold of three states on one surface, received {self.system!r}. The "
                "orbits that come to its canards are no surface."
            )
        return self._from_curve(canard_curve(self.of, self.follower, self.stable), ["+", "-"])

    def _from_curve(self, curve: Callable[[float], Array], sides: list[str]) -> Manifold:
        def orbit(mode: str, u: float) -> Arc | None:
            return self.follower.arc(curve(u), mode)

        return self._surfaces([partial(orbit, mode) for mode in sides])

    def _surfaces(self, seeds: Sequence[Callable[[float], Arc | None]]) -> Manifold:
        """Several surfaces as one."""
        parts, complete = list[Manifold](), True
        try:
            for seed in seeds:
                if complete:
                    parts.append(self._surface(seed, False))
                    complete = parts[-1].complete
        except KeyboardInterrupt:
            if not parts:
                raise
            complete = False
        offsets = np.cumsum([0, *[len(part.points) for part in parts]])
        return Manifold(
            self.stable,
            self.point,
            2,
            [arc for part in parts for arc in part.arcs],
            np.concatenate([part.points for part in parts]),
            np.concatenate([p.triangles + k for p, k in zip(parts, offsets, strict=False)]),
            complete,
        )

    def _sliding_curve(self, direction: Array) -> Callable[[float], Array]:
        """Points of the curve that slides to the point, by a parameter from 0 to 1."""
        surfaces, mode = Surfaces(self.system), self.of.mode
        p = self.system.parameter_vector(self.follower.parameters)
        halves = []
        for s in (-1, 1):
            found = self.follower.run(self.point + s * self.step * direction, mode)
            if found is not None:
                halves.append((found[0], *lengths(found[0])))

        def point(u: float) -> Array:
            run, t, s = halves[0 if u < 0.5 else -1]
            most = min(float(s[-1]), self.follower.length)
            x = run(np.interp(abs(2.0 * u - 1.0) * most, s, t))
            return np.asarray(surfaces.project(x, p, [mode.index("s")]))

        if not halves:
            raise DegenerateError(f"of: expected a point that orbits slide to, received {self.of}.")
        return point

    def _surface(self, seed: Any, closed: bool) -> Manifold:
        f = self.follower
        arcs, complete = bundle(seed, closed, f.spacing, _FIRST, self.most, self.report)
        if len(arcs) < 2:
            raise DegenerateError(
                f"of: expected a point with orbits around it, received {self.of}."
            )
        points, table = triangles(arcs, closed, f.spacing)
        found = [arc for _, arc in arcs]
        return Manifold(self.stable, self.point, 2, found, points, table, complete)
