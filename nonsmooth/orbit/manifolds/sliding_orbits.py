"""Sliding orbits on a surface of three states: evenly spaced ones, separatrices and canards.

They are orbits of L2 F1 - L1 F2, which is smooth at two-folds, where the sliding field is 0/0, and zero
there; the sign of L2 - L1 gives the direction of time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from ...flow import Status, follow
from ...local.point.surface_point import SIDES, surface_at
from ...local.scans.surface_scan import SurfaceScan
from ...local.searches.find_two_fold import TwoFold
from ...local.searches.pseudo_equilibria import PseudoEquilibrium, sliding_matrix
from ...model import Array, FilippovSystem, Stop
from .evenly_spaced_orbits import Cut, SpacedOrbit, evenly_spaced, polyline

_TOLERANCE = 1e-8
_CHUNK, _LONGEST = 10, 300  # steps after which an orbit is cut, and the most steps
# Lengths are in units of the box.
_LENGTH = 3.0  # of an orbit
_STILL = 1e-4  # of a chunk that has come to rest: at a two-fold or a pseudo-equilibrium
_SHORTEST = 0.06
_ASIDE = 2e-3  # from a pseudo-saddle to starts on its manifolds
#: Distance from a two-fold to starts on its canards, and tolerance. Away from a node the other direction
#: grows faster, so that the distance is not smaller and the tolerance is that of rounding.
_FROM_TWO_FOLD, _FINEST = 2e-2, 1e-13


class SlidingOrbits:
    """Sliding orbits of a system over the box of a scan."""

    def __init__(self, scan: SurfaceScan):
        self.scan = scan

    @cached_property
    def _flow(self) -> FilippovSystem:
        """x' = L2 F1 - L1 F2, with stops at the folds and at the frame."""
        where, box = self.scan.where, self.scan.box
        system = where.system
        lie = [system.lie_derivative(side) for side in SIDES]
        above, below = (system.field(side) for side in SIDES)
        states = [system.extended_states[k] for k in range(3)]
        u, v = (states[k] for k in self.scan.shown)
        folds = [e for e in lie if not system.gradient(e).is_zero()]
        ends = [*folds, u - box.x0, box.x1 - u, v - box.y0, box.y1 - v]
        symbols = [system.parameter_symbols[k] for k in range(len(where.parameters))]
        return FilippovSystem(
            states,
            field=[lie[1] * above[k] - lie[0] * below[k] for k in range(3)],
            parameters=dict(zip(symbols, where.parameters.tolist(), strict=True)),
            stops=[Stop(g, 0, f"end {k}") for k, g in enumerate(ends)],
        )

    @cached_property
    def _span(self) -> float:
        """Time of that flow in which even a slow orbit passes the box several times."""
        numbers = self.scan.where.many(self.scan.lift(self.scan.box.grid(21)))
        speed = np.linalg.norm(self.scan.flat(numbers.numerator) / self.scan.box.size, axis=1)
        speed = speed[np.isfinite(speed) & (speed > 0) & numbers.slides]
        return 100.0 / float(np.quantile(speed, 0.1)) if speed.size else 1.0

    def follow(
        self, start: Array, ahead: bool = True, cut: Cut | None = None, tol: float = _TOLERANCE
    ) -> Array:
        """Follow the sliding orbit from a state to a fold, the edge of the box or rest."""
        scan, x = self.scan, start
        if not np.all(np.isfinite(start)):
            return np.empty((0, 2))
        l1, l2 = scan.where.at(start).lie
        curve = scan.flat(start[None, :])
        if not l1 * l2 < 0:
            return curve[:0]
        way = self._span if ahead == (l2 > l1) else -self._span
        stops = [name for name, _ in self._flow.stops]
        for _ in range(_LONGEST // _CHUNK):
            part = follow(self._flow, x, way, mode="", until=stops, tol=tol, max_steps=_CHUNK)
            whole = np.full(3, np.inf)
            whole[list(scan.shown)] = scan.box.size
            piece = scan.flat(polyline(part, whole))
            curve = np.vstack([curve, piece[1:]])
            kept = curve if cut is None else cut(curve)
            done = part.status is not Status.TOO_MANY_STEPS or scan.box.length(piece) < _STILL
            if done or len(kept) < len(curve) or scan.box.length(curve) > _LENGTH:
                return kept
            x = part.x[-1]
        return curve

    def spaced(
        self, count: int = 12, avoid: Sequence[Array] = ()
    ) -> Iterator[tuple[SpacedOrbit, bool]]:
        """Evenly spaced orbits, and whether they attract; none starts beside the curves ``avoid``."""
        scan = self.scan

        def orbit(flat: Array, ahead: bool, cut: Cut) -> Array:
            return self.follow(scan.lift(flat[None, :])[0], ahead, cut)

        rests = [scan.flat(at.point) for at in scan.two_folds]
        rests += [scan.flat(at.point) for at in scan.pseudo_equilibria]
        found = evenly_spaced(scan.box, count, orbit, shortest=_SHORTEST, avoid=avoid, rests=rests)
        for one in found:
            l1, l2 = scan.where.at(scan.lift(one.start[None, :])[0]).lie
            yield one, bool(l1 < l2)

    def manifolds(self, found: PseudoEquilibrium) -> Iterator[Array]:
        """Manifolds (m, 2) of a saddle of the sliding flow, in the direction of time; else nothing."""
        scan = self.scan
        where, x = surface_at(scan.where.system, found.point, scan.where.values)
        matrix, basis = sliding_matrix(where.at(x), where.jacobians(x))
        values, vectors = np.linalg.eig(matrix)
        if np.any(np.imag(values)) or not values[0] * values[1] < 0:
            return
        for value, vector in zip(np.real(values), np.real(vectors).T, strict=True):
            along = scan.flat(basis @ vector)
            offset = _ASIDE * along / np.linalg.norm(along / scan.box.size)
            for sign in (1, -1):
                flat = (scan.flat(found.point) + sign * offset)[None, :]
                start = scan.lift(flat, float(found.point[scan.left_out]))[0]
                yield self.follow(start, bool(value > 0))[:: 1 if value > 0 else -1]

    def eigenlines(self, fold: TwoFold) -> Iterator[tuple[str, Array]]:
        """Halves (m, 2) of the canards and faux canards of a two-fold, with names, in the direction of time."""
        if fold.discriminant < 0:
            return
        tangents = self.scan.flat(fold.tangents()[:, 1:].T) / self.scan.box.size
        reach = _FROM_TWO_FOLD / float(np.linalg.norm(tangents, 2))
        for value, slope in zip(np.real(fold.eigenvalues), np.real(fold.slopes), strict=True):
            if not slope > 0 or abs(value) < 1e-9:
                continue
            line = np.array([1.0, slope]) / np.hypot(1.0, slope)
            starts = fold.point_at(reach * np.array([line, -line]))
            # a canard comes to s in Da and goes away in Dr
            for start, ahead in zip(starts, (value > 0, value < 0), strict=True):
                name = "canard" if value < 0 else "faux canard"
                curve = self.follow(start, bool(ahead), tol=_FINEST)
                curve = np.vstack([self.scan.flat(fold.point), curve])
                yield name, curve[:: 1 if ahead else -1]
