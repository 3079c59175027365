"""Stable and unstable manifolds of saddles and pseudo-saddles, and the orbits through visible folds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..flow.progress import progress_bar
from ..flow.saving import Savable
from ..local import Equilibrium, Fold, FoldFold, PseudoEquilibrium
from ..local.regions import Region
from ..local.two_fold import TwoFold
from ..model import (
    Array,
    DegenerateError,
    FilippovSystem,
    OptionError,
    Parameters,
    Surfaces,
    explain,
    real,
    require_system,
    whole,
)
from .arcs import Arc, Follower, lengths
from .bundles import bundle, triangles
from .manifold_seeds import canard_curve, orbit_seeds
from .periodic import PeriodicOrbit

#: Seeds are so far from the point, as a part of the length: the error is the square of it.
_NEAR = 1e-6

#: Eigenvalues with a real part below this, relative to the largest, decide nothing.
_HYPERBOLIC = 1e-9

_FIRST = 16  # arcs of a bundle at the beginning


@dataclass(frozen=True, eq=False, repr=False)
class Manifold(Savable):
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


def manifold(
    system: FilippovSystem,
    of: Equilibrium | PseudoEquilibrium | Fold | FoldFold | TwoFold | PeriodicOrbit,
    *,
    stable: bool = True,
    length: float,
    spacing: float | None = None,
    parameters: Parameters | None = None,
    tol: float = 1e-10,
    max_orbits: int = 400,
    progress: bool = False,
) -> Manifold:
    """Follow the stable or unstable manifold of a point through switches.

    Parameters
    ----------
    system : FilippovSystem
        Without explicit time. A stable manifold is followed backward: without resets and impacts.
    of : Equilibrium, PseudoEquilibrium, Fold, FoldFold, TwoFold or PeriodicOrbit
        From ``find_equilibrium``, ``find_pseudo_equilibrium``, ``fold``, ``fold_fold``,
        ``find_two_fold``, ``periodic_orbit``. Of a visible fold in the plane: the orbits that come to
        it, or leave it. Of a two-fold of three states: the orbits that come to its one canard, the
        dividing surface of those that pass it on either side (or those that leave the canard). Of a
        periodic orbit of three states: the surface of one multiplier inside the unit circle, or one
        outside.
    stable : bool, optional
        Whether orbits that come to the point are asked for (True) or those that leave it.
    length : float
        Of the orbits on it.
    spacing : float, optional
        Of points along orbits and between them; a hundredth of the length unless given.
    parameters, tol : optional
        As in :func:`simulate`.
    max_orbits : int, optional
        Of a surface.
    progress : bool, optional
        Show on a terminal how many orbits were followed.

    Returns
    -------
    Manifold
        Curves where the manifold has one dimension, a surface where it has two. Backward it ends
        where it meets sliding: what arrives there comes from a whole neighbourhood. Ctrl-C ends it
        with the orbits that it has (``complete`` is false then).

    Raises
    ------
    DegenerateError
        No such manifold, or one of more than two dimensions.
    OptionError
        ``of`` is none of these points; explicit time; a length, spacing or number that is not positive.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    DefinitionError
        ``system`` is none, or does not have the point's modes; hidden dynamics, vector multipliers.

    Notes
    -----
    Orbits come to attracting sliding in finite time, so the stable manifold of a pseudo-saddle has
    the orbits of both fields that end on it, exactly: they start at the point itself. Other manifolds
    start at a distance of a millionth of ``length`` along eigenvectors.

    Examples
    --------
    The orbits that end at a pseudo-saddle of the plane divide what slides to the left and right:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[x + y, -1], below=[x, 1])
    >>> saddle = ns.find_pseudo_equilibrium(system, [0.1, 0.0])
    >>> found = ns.manifold(system, saddle, length=2.0)
    >>> found.dimension, [arc.itinerary for arc in found.arcs], found.arcs[0].points[0].round(9) + 0.0
    (1, ['+', '-'], array([0., 0.]))
    """
    require_system(system)
    if system.time_dependent:
        raise OptionError(
            f"system: expected one without explicit time, received {system!r}. Its saddles move."
        )
    known = (Equilibrium, PseudoEquilibrium, Fold, FoldFold, TwoFold, PeriodicOrbit)
    if not isinstance(of, known):
        raise OptionError(
            explain(
                "of",
                expected="an Equilibrium, a PseudoEquilibrium, a Fold, a FoldFold, a TwoFold or a "
                "PeriodicOrbit",
                received=f"{of!r}",
                advice="Find it with find_equilibrium, find_pseudo_equilibrium, find_two_fold, fold or "
                "periodic_orbit.",
            )
        )
    length = real(length, "length", expected="a positive number", low=np.finfo(float).tiny)
    if spacing is not None:
        spacing = real(spacing, "spacing", expected="a positive number", low=np.finfo(float).tiny)
    given = of.parameters | dict(parameters or {}) if isinstance(of, PeriodicOrbit) else parameters
    p = dict(zip(system.parameter_names, system.parameter_vector(given).tolist(), strict=True))
    follower = Follower(system, p, not stable, length, spacing or length / 100, tol)
    most, bar = whole(max_orbits, "max_orbits"), progress_bar(None, progress, "orbit")
    try:
        return _Grower(follower, of, stable, most, bar.update).grow()
    finally:
        bar.close()


class _Grower:
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
        f, n = system.mode_field(mode), system.dimension
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
        except KeyboardInterrupt:
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
        """A direction in the eigenspace, by a parameter from 0 to 1 that goes round once.

        With two real eigenvalues nearly all orbits leave along the strong direction; those that come
        far along the weak one start beside it, at angles that differ by factors.
        """
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
