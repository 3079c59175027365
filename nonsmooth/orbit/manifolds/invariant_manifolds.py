"""Stable and unstable manifolds of saddles, pseudo-saddles, folds, two-folds and periodic orbits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ...flow.concatenation import join
from ...flow.ensembles.progress import progress_bar
from ...flow.options import tolerances
from ...flow.saving import Savable, savable
from ...flow.simulate import simulate
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...local import Equilibrium, Fold, FoldFold, PseudoEquilibrium
from ...local.point.regions import Region
from ...local.point.surface_point import surface_at
from ...local.searches.find_two_fold import TwoFold
from ...model import (
    Array,
    DegenerateError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    Parameters,
    Surfaces,
    mode_field,
    real,
    require_continuous,
    require_system,
    reversed_system,
    whole,
)
from ...result_tables import ResultTable, joined
from ..periodic.multipliers import leg_maps
from ..periodic.orbit import PeriodicOrbit
from ..runs.legs import integrate_leg
from .canards import Slider, paths_from
from .dividing_surfaces import DividingCurves, dividing_curves, plane_of, read_begin, require_event

# Orbits as curves of a given length ---------------------------------------------------------------

#: Steps after which the length of an orbit is checked, and the most steps.
_CHUNK, _LONGEST = 16, 20_000

#: Length of a chunk, relative to that of the orbit, beyond which it is repeated over a shorter time.
_FAR = 4.0

#: Growth in a chunk, relative to the length, below which an orbit has come to rest.
_RESTS = 1e-7

#: Points of a step that measure its length.
_FINE = 64


@savable(points="m n", t="m")
@dataclass(frozen=True, eq=False, repr=False)
class Arc:
    """A curve along an orbit.

    Attributes
    ----------
    points : ndarray (m, n)
        At equal distances along the curve, both ends included.
    t : ndarray (m,)
        Times since the start, negative where the orbit was followed backward.
    itinerary : str
        Modes in their order along the orbit.
    end : str
        ``"length"`` reached, or why it is shorter: ``"rest"``, ``"sliding"`` (backward: orbits arrive
        there from a whole neighbourhood), ``"interrupted"``, or the name of a status.
    """

    points: Array
    t: Array
    itinerary: str
    end: str

    def __repr__(self) -> str:
        length = float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())
        return f"Arc(length {length:.4g}, itinerary {self.itinerary!r}, ends by {self.end})"


class _InterruptedOrbit(KeyboardInterrupt):
    """Ctrl-C during the integration of an orbit, with the part ``run`` of it and its curve ``arc``."""

    def __init__(self, run: Trajectory):
        super().__init__()
        self.run = run
        self.arc: Arc | None = None


@dataclass(frozen=True)
class Follower:
    """Integration of orbits of a system in one direction of time."""

    system: FilippovSystem
    parameters: dict[str, float]
    ahead: bool
    length: float
    spacing: float
    tol: float

    def arc(self, start: Array, mode: str | None = None) -> Arc | None:
        """Follow the orbit from a start; None where it cannot leave in the given mode."""
        try:
            found = self.run(start, mode)
        except _InterruptedOrbit as stopped:
            stopped.arc = self._resampled(stopped.run, "interrupted")
            raise
        return None if found is None else self._resampled(*found)

    def run(self, start: Array, mode: str | None = None) -> tuple[Trajectory, str] | None:
        """The orbit as a run (of the reversed system, if backward), and why it ends."""
        system = self.system if self.ahead else reversed_system(self.system)
        pieces, x, t, grown, end = list[Trajectory](), start, 0.0, 0.0, "length"
        span = 1e9
        while grown < self.length:
            try:
                part = simulate(
                    system,
                    x,
                    t + span,
                    t_start=t,
                    parameters=self.parameters,
                    tol=self.tol,
                    start_mode=mode,
                    max_steps=_CHUNK,
                )
            except KeyboardInterrupt:
                if not pieces:
                    raise
                raise _InterruptedOrbit(join(pieces)) from None
            far = float(lengths(part)[1][-1]) if len(part.steps) else 0.0
            if not far <= _FAR * self.length:  # steps of a polynomial field have any length
                span = (
                    (self.length / far) ** 0.125 * float(part.t[-1] - t)
                    if far < np.inf
                    else span / 8
                )
                continue
            if not len(part.steps):
                if not pieces:
                    return None
                end = str(part.status)
                break
            pieces.append(part)
            more, ended = far, part.status is Status.REACHED_END
            grown += more
            slides = _slides(part) if not self.ahead and (mode is None or "s" not in mode) else None
            if slides is not None or not (ended or part.status is Status.TOO_MANY_STEPS):
                end = "sliding" if slides is not None else str(part.status)
                break
            span = 4.0 * span if ended else span
            if (more < _RESTS * self.length and not ended) or len(pieces) * _CHUNK >= _LONGEST:
                end = "rest" if more < _RESTS * self.length else str(part.status)
                break
            x, t, mode = part.x[-1], float(part.t[-1]), part.events[-1].mode_after
        return join(pieces), end

    def _resampled(self, run: Trajectory, end: str) -> Arc:
        (t, s), length = lengths(run), self.length
        until = _slides(run) if end == "sliding" else None
        if until is not None:
            s = s[t <= until]
            t = t[t <= until]
        whole = float(s[-1])
        if whole >= length:
            whole, end = length, "length"
        count = max(1, round(whole / self.spacing))
        target = whole * np.arange(count + 1) / count if whole < length else None
        if target is None:
            target = np.minimum(self.spacing * np.arange(count + 1), whole)
            target[-1] = whole
        rising = np.concatenate([[True], np.diff(s) > 0.0])
        times = np.interp(target, s[rising], t[rising])
        sign = 1.0 if self.ahead else -1.0
        modes = [p.mode or "o" for p in run.segments if p.t_start <= times[-1]]
        return Arc(run(times), sign * times, " ".join(modes), end)


def lengths(run: Trajectory) -> tuple[Array, Array]:
    """Times within the steps of a run, and the length of the curve up to each."""
    edges = np.unique(run.t)
    if len(edges) < 2:
        return edges, np.zeros(len(edges))
    parts = np.linspace(edges[:-1], edges[1:], _FINE, endpoint=False, axis=1).ravel()
    t = np.append(parts, edges[-1])
    steps = np.linalg.norm(np.diff(run(t), axis=0), axis=1)
    return t, np.concatenate([[0.0], np.cumsum(steps)])


def _slides(run: Trajectory) -> float | None:
    """The time at which a run begins to slide; None if it does not."""
    return next((e.t for e in run.events if e.kind == "entry"), None)


# Manifolds of periodic orbits and of canards ------------------------------------------------------

Seed = Callable[[float], Arc | None]

#: Distance of starts from a periodic orbit, relative to its size, and distance from which its manifold
#: is shown, in spacings.
_FROM_ORBIT, _SHOWN = 1e-6, 0.5

#: Multipliers this close to the unit circle count as on it.
_OFF_CIRCLE = 1e-6


def _orbit_seeds(orbit: PeriodicOrbit, follower: Follower, stable: bool) -> list[Seed]:
    """The sheets of orbits that approach a periodic orbit or leave it, as functions of a start."""
    multiplier, x, v, period = _direction(orbit, stable)
    turns = 1 if multiplier > 0 else 2
    factor = abs(multiplier) ** (-turns if stable else turns)
    size = float(np.abs(orbit.trajectory.x).max()) or 1.0
    shown = _SHOWN * follower.spacing
    count = max(0, math.ceil(math.log(shown / (_FROM_ORBIT * size)) / math.log(factor)))
    system = follower.system if follower.ahead else reversed_system(follower.system)

    def sheet(sign: float) -> Seed:
        def seed(u: float) -> Arc | None:
            start = x + sign * _FROM_ORBIT * size * factor**u * v
            if count:
                run = simulate(
                    system,
                    start,
                    count * turns * period,
                    parameters=follower.parameters,
                    tol=min(follower.tol, 1e-11),
                )
                if run.t[-1] < count * turns * period:
                    return None
                start = run.x[-1]
            return follower.arc(start)

        return seed

    return [sheet(1.0), sheet(-1.0)] if turns == 1 else [sheet(1.0)]


def _direction(orbit: PeriodicOrbit, stable: bool) -> tuple[float, Array, Array, float]:
    """The multiplier, a point of the orbit inside a leg, the eigenvector there, and the period."""
    values = orbit.floquet.values
    outside = np.abs(values) < 1.0 - _OFF_CIRCLE if stable else np.abs(values) > 1.0 + _OFF_CIRCLE
    kind, n = "stable" if stable else "unstable", orbit.system.dimension
    if int(outside.sum()) != 1 or n != 3 or (stable and orbit.floquet.zeros):
        raise DegenerateError(
            f"of: the orbit has {n} states and the multipliers {values.round(6).tolist()}, so its {kind} "
            f"manifold is no surface. Give one in three dimensions with one {kind} multiplier, not 0."
        )
    problem, at = orbit.problem, orbit.evaluation
    maps = leg_maps(problem, at)
    whole = np.eye(n)
    for step in maps:
        whole = step @ whole
    found, vectors = np.linalg.eig(whole)
    target = orbit.floquet.of_map[outside][0]
    k = int(np.argmin(np.abs(found - target)))
    v = vectors[:, k].real
    free = [i for i, leg in enumerate(problem.legs) if "s" not in leg.mode] or range(len(maps))
    best = max(free, key=lambda i: float(at.durations[i]))
    for step in maps[:best]:
        v = step @ v
    p, half = orbit.parameter_vector, 0.5 * float(at.durations[best])
    flow = integrate_leg(orbit.system, problem.legs[best], at.starts[best], half, p)
    v = flow.by_start[:n] @ v
    return float(values[outside][0].real), flow.end[:n], v / np.linalg.norm(v), orbit.period


def _canard_curve(fold: TwoFold, follower: Follower, stable: bool) -> Callable[[float], Array]:
    """The canard of a two-fold in attracting (or repelling) sliding, by a parameter in [0, 1]."""
    system = reversed_system(follower.system) if stable else follower.system
    where, s = surface_at(system, fold.point, follower.parameters)
    surfaces = Surfaces(system)
    speed = max(float(np.linalg.norm(f)) for f in where.at(s).fields) or 1.0
    span = 20.0 * follower.length / speed
    slider = Slider(where, surfaces, span, tolerances(min(follower.tol, 1e-10)))
    try:
        paths = [path for path in paths_from(s, 0.0, slider, 16) if path.repelling]
    except NonsmoothError:
        paths = []
    if len(paths) != 1:
        many = "infinitely many" if paths else "none"
        side = "into it through attracting" if stable else "out of it through repelling"
        raise DegenerateError(
            f"of: the two-fold at {fold.point.tolist()} ({fold.label}) has {many} of the canards {side} "
            "sliding. Give one with exactly one, which divides the orbits beside it."
        )
    run = paths[0].run
    t, along = lengths(run)
    most = min(float(along[-1]), follower.length)
    mode = [where.surface]

    def point(u: float) -> Array:
        x = run(np.interp(u * most, along, t))
        return np.asarray(surfaces.project(x, system.parameter_vector(follower.parameters), mode))

    return point


# Surfaces swept by orbits -------------------------------------------------------------------------

#: Distance of neighbours, in spacings, above which one is put between them, and above which there is a
#: hole in the surface.
_APART, _HOLE = 1.0, 2.5

#: Smallest distance of the parameters of neighbours.
_CLOSEST = 1e-10


def _bundle(
    seed: Callable[[float], Arc | None],
    closed: bool,
    spacing: float,
    count: int,
    most: int,
    report: Callable[[], object] = lambda: None,
) -> tuple[list[tuple[float, Arc]], bool]:
    """Arcs from starts on a curve with the parameter 0 to 1, denser where they diverge."""
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
    """Parameters midway between neighbours that are too far apart."""
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
    """Points (k, n) of all arcs and triangles (q, 3) between neighbours, without holes."""
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


#: Distance of starts from the point, relative to the length; the error is its square.
_NEAR = 1e-6

#: Real parts of eigenvalues below this, relative to the largest eigenvalue, count as zero.
_HYPERBOLIC = 1e-9

_FIRST = 16  # arcs of a bundle at the beginning


@dataclass(frozen=True, eq=False, repr=False)
class Manifold(Savable, point="n", points="k n | 0 0", triangles="q 3 <points"):
    """A stable or unstable manifold, as curves or a surface of orbits.

    Attributes
    ----------
    stable : bool
        Whether orbits approach the point (True) or leave it.
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

    def _tables(self) -> dict[str, ResultTable]:
        tables = {"points": joined("arc", [{"t": arc.t, "x": arc.points} for arc in self.arcs])}
        if len(self.triangles):
            tables["vertices"] = ResultTable({"vertex": len(self.points)}, {"x": self.points})
            corners = {"vertex": ("corner", self.triangles)}
            tables["triangles"] = ResultTable({"triangle": len(self.triangles)}, corners)
        return tables

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


def _too_high(dimension: int) -> DegenerateError:
    return DegenerateError(
        f"of: the manifold has {dimension} dimensions, but at most two are computed. Give another "
        "point, or change stable=."
    )


class _Grower:
    """Computation of the manifold of one point or orbit from its local directions."""

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
            seeds = _orbit_seeds(self.of, self.follower, self.stable)
            return self._surfaces(seeds)
        if isinstance(self.of, Equilibrium):
            return self._of_equilibrium()
        return self._of_pseudo_equilibrium()

    def _of_equilibrium(self) -> Manifold:
        if self.of.status != "real":
            raise DegenerateError(
                f"of: the equilibrium at {self.point.tolist()} is {self.of.status}, so it has no "
                "manifolds. Give one on its own side of the surface."
            )
        basis = self._directions(self.of.mode)
        if basis.shape[1] == 1:
            return self._curves([partial(self._arc, s * basis[:, 0]) for s in (1, -1)])
        return self._circle(basis, None)

    def _of_pseudo_equilibrium(self) -> Manifold:
        of = self.of
        if of.status != "real" or of.region is Region.MIXED or of.mode.count("s") != 1:
            raise DegenerateError(
                f"of: the manifolds of {of} do not consist of orbits. Give a real pseudo-equilibrium on "
                "one surface."
            )
        basis = self._directions(of.mode)
        collects = (of.region is Region.ATTRACTING) == self.stable
        sides = [of.mode.replace("s", side) for side in "+-"]
        if collects and basis.shape[1] == 0:
            return self._curves([partial(self._leave, mode) for mode in sides])
        if collects and basis.shape[1] == 1:
            return self._from_curve(self._sliding_curve(basis[:, 0]), sides)
        if collects:
            raise _too_high(basis.shape[1] + 1)
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
                f"of: the {self.of.kind} with the eigenvalues {values.round(6).tolist()} has no {kind} "
                "directions. Give another point, or change stable=."
            )
        self.node = apart
        return np.asarray(vectors[:, chosen].real if apart else u[:, :count])

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
            part = stopped.arc if isinstance(stopped, _InterruptedOrbit) else None
            if part is not None and len(part.points) > 1:
                found.append(part)
            if not found:
                raise
            complete = False
        if not found:
            kind = "comes to" if self.stable else "leaves"
            raise DegenerateError(
                f"of: no orbit {kind} {self.of}. Give another point, or change stable=."
            )
        return Manifold(self.stable, self.point, 1, found, complete=complete)

    def _circle(self, basis: Array, mode: str | None) -> Manifold:
        """A surface of the orbits that start on a small circle."""
        if basis.shape[1] > 2:
            raise _too_high(basis.shape[1])

        def seed(u: float) -> Arc | None:
            return self._arc(basis @ self._around(u), mode)

        return self._surface(seed, True)

    def _around(self, u: float) -> Array:
        """A direction in the eigenspace, by a parameter from 0 to 1 of one turn."""
        # With two real eigenvalues nearly all orbits leave along the strong direction; those that go
        # far along the weak one start beside it, at angles in geometric progression.
        if not self.node:
            return np.array([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)])
        quarter, part = divmod(4.0 * u, 1.0)
        spread = min(60.0, 4.0 - math.log(_NEAR) * (self.rates.max() / self.rates.min() - 1.0))
        tangent = math.exp(spread * (2.0 * part - 1.0)) if part else 0.0
        x, y = 1.0 / math.hypot(1.0, tangent), tangent / math.hypot(1.0, tangent)
        turned = [(x, y), (-y, x), (-x, -y), (y, -x)][int(quarter) % 4]
        return np.array(turned)

    def _of_two_fold(self) -> Manifold:
        """The orbits of both fields that end on the canard, or leave it."""
        if self.system.dimension != 3 or self.system.surface_count != 1:
            raise DegenerateError(
                f"of: the two-fold is one of {self.system!r}. Give one of three states on one surface, or "
                "cut its dividing surface with starts=."
            )
        return self._from_curve(_canard_curve(self.of, self.follower, self.stable), ["+", "-"])

    def _from_curve(self, curve: Callable[[float], Array], sides: list[str]) -> Manifold:
        """A surface of the orbits of both fields that end on a sliding curve."""

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
            raise DegenerateError(
                f"of: no orbit slides to {self.of}. Give another point, or change stable=."
            )
        return point

    def _surface(self, seed: Any, closed: bool) -> Manifold:
        f = self.follower
        arcs, complete = _bundle(seed, closed, f.spacing, _FIRST, self.most, self.report)
        if len(arcs) < 2:
            raise DegenerateError(
                f"of: fewer than two orbits start at {self.of}. Give another point."
            )
        points, table = triangles(arcs, closed, f.spacing)
        found = [arc for _, arc in arcs]
        return Manifold(self.stable, self.point, 2, found, points, table, complete)


#: A length that is positive.
_LEAST = float(np.finfo(float).tiny)

Point = Equilibrium | PseudoEquilibrium | Fold | FoldFold | TwoFold | PeriodicOrbit


@overload
def manifold(
    system: FilippovSystem,
    of: Point,
    *,
    stable: bool = True,
    length: float,
    spacing: float | None = None,
    parameters: Parameters | None = None,
    tol: float | None = None,
    max_orbits: int = 400,
    progress: bool = False,
) -> Manifold: ...


@overload
def manifold(
    system: FilippovSystem,
    of: TwoFold,
    *,
    starts: Any,
    box: Any,
    duration: float,
    until: str | None = None,
    begin: Any = None,
    stable: bool = True,
    spacing: float | None = None,
    parameters: Parameters | None = None,
    tol: float | None = None,
    progress: bool = False,
) -> DividingCurves: ...


def manifold(
    system: FilippovSystem,
    of: Point,
    *,
    stable: bool = True,
    length: float | None = None,
    starts: Any = None,
    box: Any = None,
    duration: float | None = None,
    until: str | None = None,
    begin: Any = None,
    spacing: float | None = None,
    parameters: Parameters | None = None,
    tol: float | None = None,
    max_orbits: int = 400,
    progress: bool = False,
) -> Manifold | DividingCurves:
    """Follow the stable or unstable manifold of a point through switches, or cut it by a plane of starts.

    Parameters
    ----------
    system : FilippovSystem
        Without explicit time. A stable manifold is followed backward: without resets and impacts.
    of : Equilibrium, PseudoEquilibrium, Fold, FoldFold, TwoFold or PeriodicOrbit
        From ``find_equilibrium``, ``find_pseudo_equilibrium``, ``fold``, ``fold_fold``,
        ``find_two_fold``, ``periodic_orbit``. Of a visible fold in the plane: the orbits that reach
        it, or leave it. Of a two-fold of three states: the orbits that reach its one canard, the
        dividing surface of those that pass it on either side (or those that leave the canard). Of a
        periodic orbit of three states: the surface of one multiplier inside the unit circle, or one
        outside.
    stable : bool, optional
        Whether to compute orbits that approach the point (True) or those that leave it.
    length : float
        Of the orbits on it. Not with ``starts``.
    starts : array_like (3, n), callable or orbit.ComputedStarts, optional
        Of a two-fold of n states: a plane that cuts the dividing surface, as a point and two directions,
        or as a function of two coordinates that returns n expressions; with ``until`` also computed
        starts, with times of their own.
    box : array_like (2, 2)
        With ``starts``: the range of either coordinate.
    duration : float
        With ``starts``: the duration of orbits, in which they should leave the two-folds to one side of
        the switching surface or the other. With ``until`` the longest duration of a leg.
    until : str, optional
        With ``starts``: the name of a stop at which orbits end and both fields have the same component
        across the surface, as where a contact opens and friction vanishes with the load. Then ``of`` is
        a two-fold there, and starts are divided by the side of the surface on which orbits end.
    begin : sequence of (str, (float, float)), optional
        With ``starts``: points of one curve, each with its itinerary. It is followed from the last of
        them until it leaves the box, ends, or closes. By default the whole box is searched.
    spacing : float, optional
        Of points along orbits and between them; a hundredth of the length unless given. With ``starts``
        the largest distance of points on bent curves, relative to half of the box or to the scale of
        computed starts; 0.05 unless given.
    parameters : optional
        As in :func:`simulate`.
    tol : float, optional
        As in :func:`simulate`; 1e-10, and with ``starts`` 1e-13, unless given.
    max_orbits : int, optional
        Of a surface.
    progress : bool, optional
        Whether to show on a terminal the number of computed orbits.

    Returns
    -------
    Manifold
        Curves where the manifold has one dimension, a surface where it has two. Backward it ends
        at sliding, where orbits arrive from a whole neighbourhood. After Ctrl-C it has
        the orbits computed so far, and ``complete`` is False.
    DividingCurves
        With ``starts``: curves in the plane that divide orbits, made of arcs that slide into a two-fold
        and arcs that graze the surface, their junctions, and why they end.

    Raises
    ------
    DegenerateError
        No such manifold, or one of more than two dimensions; with ``starts`` a two-fold that divides no
        orbits of the box, or a system with resets, impacts or several surfaces.
    OptionError
        ``of`` is none of these points; explicit time; a length, spacing or number that is not positive.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    DefinitionError
        ``system`` is not a FilippovSystem, or does not have the point's modes; hidden dynamics, vector
        multipliers.

    Notes
    -----
    Orbits reach attracting sliding in finite time, so the stable manifold of a pseudo-saddle consists of
    the orbits of both fields that end on it: they start exactly at the point. Other manifolds
    start at a distance of a millionth of ``length`` along eigenvectors.

    In n states two-folds fill a set of dimension n - 3, and the orbits that slide into it a surface of
    dimension n - 1. A plane of starts cuts it in curves. On either side orbits slide close to a two-fold
    and leave it to different sides. Beyond the two-folds a curve consists of orbits that graze the surface
    at a visible fold: on one side they miss it, on the other they cross it.

    Examples
    --------
    The orbits that end at a pseudo-saddle of the plane divide those that slide to the left from those to the right:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[x + y, -1], below=[x, 1])
    >>> saddle = ns.find_pseudo_equilibrium(system, [0.1, 0.0])
    >>> found = ns.manifold(system, saddle, length=2.0)
    >>> found.dimension, [arc.itinerary for arc in found.arcs], found.arcs[0].points[0].round(9) + 0.0
    (1, ['+', '-'], array([0., 0.]))

    Starts at the height 0.3 that pass a visible two-fold of three states on either side:

    >>> x, y, z = (ca.SX.sym(name) for name in "xyz")
    >>> system = ns.FilippovSystem([x, y, z], surface=x, above=[y, 1, 0.5], below=[z, 0.3, -1])
    >>> fold = ns.find_two_fold(system, near=[0.0, 0.0, 0.0])
    >>> found = ns.manifold(system, fold, starts=lambda a, b: [0.3, a, b], box=[(-2, -0.5), (-1, 1)],
    ...                     duration=6.0)
    >>> [arc.itinerary for arc in found.arcs], found.junctions.round(9)
    (['+', '+ s'], array([[-0.77459667, -0.38729833]]))
    """
    require_system(system)
    require_continuous(system, "manifold")
    if system.time_dependent:
        raise OptionError(
            f"system {system!r} depends on time, so its saddles move. Give an autonomous one."
        )
    known = (Equilibrium, PseudoEquilibrium, Fold, FoldFold, TwoFold, PeriodicOrbit)
    if not isinstance(of, known):
        raise OptionError(
            f"of={of!r} is no Equilibrium, PseudoEquilibrium, Fold, FoldFold, TwoFold or PeriodicOrbit. "
            "Find one with find_equilibrium, find_pseudo_equilibrium, find_two_fold or periodic_orbit."
        )
    if spacing is not None:
        spacing = real(spacing, "spacing", expected="a positive number", low=_LEAST)
    given = of.parameters | dict(parameters or {}) if isinstance(of, PeriodicOrbit) else parameters
    p = dict(zip(system.parameter_names, system.parameter_vector(given).tolist(), strict=True))
    if starts is not None:
        end = (duration, until, begin)
        return _cut(system, of, stable, starts, box, end, spacing or 0.05, p, tol, progress)
    if until is not None or begin is not None:
        raise OptionError(
            "until and begin apply only with starts=, a plane of starts. Give it or drop them."
        )
    long = real(length, "length", expected="a positive number", low=_LEAST)
    follower = Follower(system, p, not stable, long, spacing or long / 100, tol or 1e-10)
    most, bar = whole(max_orbits, "max_orbits"), progress_bar(None, progress, "orbit")
    try:
        return _Grower(follower, of, stable, most, bar.update).grow()
    finally:
        bar.close()


def _cut(
    system: FilippovSystem,
    of: Point,
    stable: bool,
    starts: Any,
    box: Any,
    end: tuple[float | None, str | None, Any],
    step: float,
    parameters: dict[str, float],
    tol: float | None,
    progress: bool,
) -> DividingCurves:
    """The dividing surface of a two-fold, cut by a plane of starts."""
    if not isinstance(of, TwoFold):
        raise OptionError(
            f"of={of!r}, but starts= needs a TwoFold. Find one with find_two_fold, or drop starts."
        )
    duration, until, begin = end
    plane = plane_of(system, starts, box)
    if not plane.exact and until is None:
        raise OptionError("starts that are computed need until=. Give it, or give expressions.")
    if until is not None:
        require_event(system, until, of, parameters)
        if not stable:
            raise OptionError(
                "stable=False does not go with until=, as stops do not end orbits backward in time. Drop one."
            )
    span = real(duration, "duration", expected="a positive number", low=_LEAST)
    bar = progress_bar(None, progress, "arc")
    try:
        return dividing_curves(
            system if stable else reversed_system(system),
            of,
            plane,
            stable=stable,
            duration=span,
            step=step,
            until=until,
            begin=read_begin(system, begin),
            parameters=parameters,
            tol=tol or 1e-13,
            report=bar.update,
        )
    finally:
        bar.close()
