"""Homoclinic orbits to saddles and pseudo-saddles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...flow.ensembles.progress import progress_bar
from ...flow.simulate import simulate
from ...flow.trajectory import Trajectory
from ...local import Equilibrium, PseudoEquilibrium
from ...local.searches.equilibria import find_equilibrium, kind_of
from ...local.searches.folds import find_fold
from ...local.searches.pseudo_equilibria import find_pseudo_equilibrium
from ...model import (
    Array,
    ConvergenceError,
    DegenerateError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    ParameterError,
    Parameters,
    PointError,
    Surfaces,
    real_array,
    require_continuous,
    require_system,
)
from ...result_tables import ResultTable, Tabular, stacked
from ...solvers.newton import Equations, converge, solve
from ..periodic.orbit import OrbitLeg, named
from ..periodic.orbit_run import orbit_run
from ..runs.legs import Leg, Stretch, integrate_leg, stretches
from .loops import NEAR, Loop, PseudoSaddleLoop, SaddleLoop, Spectrum, equilibrium_of, spectrum_of

# Guesses: orbits of an unstable manifold that return near the saddle -------------------------------

#: Largest distance from the saddle at which a guess returns, relative to its size.
_CLOSE = 0.5

#: Multiples of the estimated time of return that are simulated, and the number of directions tried in
#: an unstable eigenspace of two dimensions.
_LONGER, _AROUND = (1.0, 3.0, 10.0), 64

#: Steps after which an orbit counts as unbounded.
_STEPS = 4000

#: Exponent by which neighbours separate over a part of a leg.
_GROWTH = 1.5


@dataclass(frozen=True, eq=False)
class Departure:
    """An orbit that leaves a saddle and returns near it."""

    saddle: Array
    legs: tuple[Leg, ...]
    starts: Array
    durations: Array
    held: tuple[float | None, ...]  # durations of parts of legs, as in Loop
    miss: float  # distance from the saddle at the end
    size: float  # largest distance from the saddle


def saddle_at(
    system: FilippovSystem, saddle: object, p: Array
) -> tuple[str, Equilibrium | PseudoEquilibrium]:
    """The saddle nearest to a given one or a point, and its mode."""
    found = list[tuple[str, Equilibrium | PseudoEquilibrium]]()
    if isinstance(saddle, (Equilibrium, PseudoEquilibrium)):
        near = np.asarray(saddle.point, float)
    else:
        near = real_array(saddle, "saddle")
        if near.shape != (system.dimension,):
            raise PointError(
                f"saddle has shape {near.shape}, but the system has {system.dimension} states. Give one "
                "number for each."
            )
    given, reasons = named(system, p), list[str]()
    if system.surface_count == 0:
        found.append(("", _smooth(system, equilibrium_of(system, "", near, p), p)))
    elif not isinstance(saddle, Equilibrium):
        try:
            pseudo = find_pseudo_equilibrium(system, near, parameters=given)
            found.append(("s", pseudo))
        except NonsmoothError as error:
            reasons.append(str(error))
    if system.surface_count == 1 and not isinstance(saddle, PseudoEquilibrium):
        for side in "+-":
            try:
                at_side = find_equilibrium(system, near, side=side, parameters=given)  # type: ignore[arg-type]
                found.append((side, at_side))
            except NonsmoothError as error:
                reasons.append(str(error))
    if not found:
        raise DegenerateError(
            f"saddle: no equilibrium was found near {near.tolist()} ({'; '.join(reasons)}). Give a "
            "closer point."
        )
    mode, at = min(found, key=lambda pair: float(np.linalg.norm(pair[1].point - near)))
    if not _is_saddle(at):
        raise DegenerateError(
            f"saddle: the equilibrium found is no real saddle or pseudo-saddle: {at} Choose another point "
            "or parameter."
        )
    return mode, at


def _is_saddle(at: Equilibrium | PseudoEquilibrium) -> bool:
    if at.status != "real":
        return False
    values = np.real(at.eigenvalues)
    if isinstance(at, PseudoEquilibrium) and at.kind == "pseudo-saddle" and values.size == 1:
        return True
    return bool(values.min() < 0.0 < values.max())


def _smooth(system: FilippovSystem, at: Array, p: Array) -> Equilibrium:
    values = spectrum_of(system, "", at, p).values
    order = np.argsort(values.real)
    kind, margin = kind_of(values[order], float(np.abs(values).max()))
    return Equilibrium(at, "+", "real", kind, values[order], np.inf, margin, 0.0, 0.0, 0, "")


def departures(system: FilippovSystem, mode: str, x: Array, p: Array) -> Iterator[Departure]:
    """Orbits of the unstable manifold that return near the saddle, the nearest first."""
    here = spectrum_of(system, mode, x, p)
    size = max(float(np.abs(here.point).max()), 1e-3)
    found = []
    for direction in _directions(here):
        start = here.point + NEAR * size * direction
        held = [k for k, c in enumerate(mode) if c == "s"]
        if held:
            start = Surfaces(system).project(start, p, held)
        back = _comes_back(system, mode, here, start, p)
        if back is not None:
            found.append(back)
    yield from sorted(found, key=lambda d: d.miss / d.size)


def _directions(here: Spectrum) -> list[Array]:
    basis = here.unstable
    if basis.shape[1] == 1:
        return [basis[:, 0], -basis[:, 0]]
    if basis.shape[1] == 2:
        angles = 2 * np.pi * np.arange(_AROUND) / _AROUND
        return [basis @ np.array([np.cos(a), np.sin(a)]) for a in angles]
    raise DegenerateError(
        f"saddle has an unstable manifold of dimension {basis.shape[1]}, but only 1 and 2 are searched. "
        "Reverse time: reversed_system(system) exchanges stable and unstable."
    )


def _comes_back(
    system: FilippovSystem, mode: str, here: Spectrum, start: Array, p: Array
) -> Departure | None:
    unit = -np.log(NEAR) * (1.0 / here.leading(False) - 1.0 / here.leading(True))
    for times in _LONGER:
        try:
            run = simulate(
                system,
                start,
                times * unit,
                parameters=named(system, p),
                start_mode=mode or None,
                tol=1e-12,
                max_events=500,
                max_steps=_STEPS,
            )
            found = _nearest(run, mode, here)
        except NonsmoothError:
            return None
        if found is not None:
            return found
    return None


def _nearest(run: Trajectory, mode: str, here: Spectrum) -> Departure | None:
    """The first return of a run to the neighbourhood of the saddle, in its mode."""
    parts = [part for part in stretches(run) if part.duration > 0.0]
    peak, chain = 0.0, list[Stretch]()
    for part in parts:
        chain.append(part)
        times = part.t + part.duration * np.linspace(0.0, 1.0, 201)[1:-1]
        with np.errstate(over="ignore"):
            away = np.linalg.norm(run(times) - here.point, axis=1)
        for k in range(len(times) - 1):
            peak = max(peak, float(away[k]))
            falls = away[k - 1] >= away[k] if k else len(chain) > 1  # or is nearest where it lands
            if falls and away[k] <= min(_CLOSE * peak, away[k + 1]) and part.leg.mode == mode:
                first = int(np.argmax(away[: max(k, 1)]))
                required = np.sqrt(away[first] * away[k])  # on the way back, before it turns away
                k = first + int(np.argmin(np.abs(away[first : k + 1] - required)))
                chain[-1] = replace(part, leg=Leg(mode), duration=float(times[k]) - part.t)
                whole = [(one.leg, one.start, one.duration, False) for one in chain]
                p = run.system.parameter_vector(run.parameters)
                return in_parts(run.system, whole, p, here, float(away[k]), peak)
    return None


def in_parts(
    system: FilippovSystem,
    chain: Sequence[tuple[Leg, Array, float, bool]],
    p: Array,
    here: Spectrum,
    miss: float,
    size: float,
) -> Departure:
    """Legs, given by start, duration and whether the next one continues them, divided into parts over which neighbours
    separate by a bounded factor."""
    growth, n = float(here.values.real.max()), system.dimension
    legs, starts, durations = list[Leg](), list[Array](), list[float]()
    held: list[float | None] = []
    for leg, x, duration, continued in chain:
        count = max(1, round(duration * growth / _GROWTH))
        step = duration / count
        for k in range(count):
            legs.append(leg)
            starts.append(
                x[:n] if not k else integrate_leg(system, leg, starts[-1], step, p).end[:n]
            )
            durations.append(step)
            inside = step if leg.timed or continued else 0.0
            held.append(inside if continued or k + 1 < count else None)
    return Departure(
        here.point, tuple(legs), np.array(starts), np.array(durations), tuple(held), miss, size
    )


def _flight_to(
    system: FilippovSystem, saddle: PseudoEquilibrium, p: Array
) -> tuple[str, list[Leg], list[Array], list[float]]:
    """The orbit from a visible fold that lands nearest to a pseudo-saddle of the plane."""
    values, best = named(system, p), None
    reasons: list[str] = []
    for side in "+-":
        try:
            fold = find_fold(system, saddle.point, side=side, parameters=values)  # type: ignore[arg-type]
        except NonsmoothError as error:
            reasons.append(f"side {side!r}: {error}")
            continue
        if fold.kind != "visible":
            reasons.append(f"side {side!r}: its fold at {fold.point.tolist()} is not visible")
            continue
        size = float(np.linalg.norm(fold.point - saddle.point)) or 1.0
        for k in range(9):
            run = simulate(
                system, fold.point, 4.0**k, parameters=values, start_mode=side, tol=1e-12
            )
            if any(e.kind == "entry" for e in run.events):
                break
        legs = []
        for part in stretches(run):
            legs.append(part)
            if part.leg.kind == "entry":
                break
        if legs[-1].leg.kind != "entry":
            reasons.append(f"side {side!r}: the orbit of the fold does not land")
            continue
        miss = float(np.linalg.norm(legs[-1].end - saddle.point)) / size
        if miss > _CLOSE:
            reasons.append(
                f"side {side!r}: the orbit lands {miss:.2g} of the distance to the fold away"
            )
        elif best is None or miss < best[0]:
            starts, times = [part.start for part in legs], [part.duration for part in legs]
            best = (miss, side, [part.leg for part in legs], starts, times)
    if best is None:
        raise ConvergenceError(
            f"homoclinic orbit: no orbit of a visible fold lands near the pseudo-saddle "
            f"{saddle.point.tolist()} ({'; '.join(reasons)}). Give a better guess of the parameter.",
            point=saddle.point,
        )
    return best[1:]


# The search ----------------------------------------------------------------------------------------

#: Factor by which the end of an orbit approaches the saddle in one step, and its least value.
_CLOSER, _SLOWLY = 4.0, 1.2

#: Change of the parameter, for a distance smaller by a factor e, at which it is known. An orbit that comes along another
#: than the leading direction has a larger error than the estimate of ``SaddleLoop.target``.
_SETTLED = 1e-13

#: Distance from the saddle, relative to the size of the orbit, that suffices where no step succeeds.
_ENOUGH = 1e-3

#: Distance from the guess, in scaled unknowns, within which a solution is searched for.
_FAR = 10.0


@dataclass(frozen=True, eq=False, repr=False)
class Connection(Tabular):
    """A homoclinic orbit to a saddle, a pseudo-saddle or a saddle-focus.

    Attributes
    ----------
    system : FilippovSystem
        The system of the orbit.
    parameter : str
        Name of the parameter that was varied.
    value : float
        Of that parameter at the connection.
    parameters : dict of str to float
        All of them there.
    saddle : Equilibrium or PseudoEquilibrium
        The saddle at that value.
    legs : tuple of OrbitLeg
        Legs of the orbit, which begins and ends close to a saddle that it approaches asymptotically.
    iterations : int
        Evaluations of the equations.
    residual : float
        Largest entry of the equations.
    faults : tuple of str
        Guards that it violates; empty unless it is virtual.
    loop : Loop
        Its equations.
    unknowns : ndarray
        Their solution, from which ``continue_bifurcation`` starts.
    complete : bool
        False if the search was interrupted: the orbit ends farther from the saddle than it could.
    """

    system: FilippovSystem
    parameter: str
    value: float
    parameters: dict[str, float]
    saddle: Equilibrium | PseudoEquilibrium
    legs: tuple[OrbitLeg, ...]
    iterations: int
    residual: float
    faults: tuple[str, ...]
    loop: Loop
    unknowns: Array
    complete: bool = True

    def _tables(self) -> dict[str, ResultTable]:
        return {"legs": stacked(self.legs, {"leg": len(self.legs)}, self.system.state_names)}

    @property
    def itinerary(self) -> str:
        """Modes of the legs in order, separated by blanks."""
        return " ".join(leg.mode or "o" for leg in self.legs)

    @property
    def _free(self) -> int:
        """Number of the first leg that does not slide; 0 if all slide."""
        return next((k for k, leg in enumerate(self.legs) if "s" not in leg.mode), 0)

    @property
    def fold(self) -> Array | None:
        """The point at which the orbit first leaves the surface; None if it does not slide before."""
        finite = isinstance(self.loop, PseudoSaddleLoop)
        return self.legs[self._free].start if self._free or finite else None

    @property
    def side(self) -> str:
        """Mode of the first leg that does not slide."""
        return self.legs[self._free].mode

    @property
    def flight(self) -> float:
        """Time from where it leaves the surface, or the neighbourhood of the saddle, to its end."""
        return float(sum(leg.duration for leg in self.legs[self._free :]))

    @property
    def eigenvalue(self) -> float:
        """The leading unstable one: periods of nearby orbits diverge as $-ln|mu - mu_0|$ over it."""
        real = np.real(self.saddle.eigenvalues)
        return float(real[real > 0].min())

    @property
    def saddle_quantity(self) -> float:
        """Sum of the leading stable and unstable eigenvalues.

        The periodic orbit that is born is stable where it is negative. It is minus infinity where the
        orbit reaches the saddle in finite time.
        """
        real = np.real(self.saddle.eigenvalues)
        stable = real[real < 0]
        return self.eigenvalue + float(stable.max()) if stable.size else -np.inf

    @cached_property
    def trajectory(self) -> Trajectory:
        """The legs as a run."""
        return orbit_run(self.system, self.parameters, self.loop.pieces(self.unknowns))

    def __str__(self) -> str:
        virtual = f" (virtual: {self.faults[0]})" if self.faults else ""
        kind = "pseudo-saddle" if isinstance(self.saddle, PseudoEquilibrium) else self.saddle.kind
        at = f"at {self.parameter} = {self.value:.13g}{virtual}"
        lines = [f"Homoclinic orbit to a {kind} {at}, itinerary {self.itinerary!r}"]
        values = ", ".join(f"{v:.6g}" for v in self.saddle.eigenvalues)
        lines.append(f"  {kind} {self.saddle.point.tolist()}, eigenvalues {values}")
        if self.fold is not None:
            lines.append(f"  leaves the surface at {self.fold.tolist()} to {self.side!r}")
        if isinstance(self.loop, SaddleLoop) and not self.complete:
            lines.append(f"  interrupted: the orbit ends {self.loop.far:.2g} from the saddle")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"Connection({self.parameter} = {self.value:.10g}, {self.itinerary!r})"


def find_homoclinic(
    system: FilippovSystem,
    saddle: Equilibrium | PseudoEquilibrium | ArrayLike,
    parameter: str,
    *,
    guess: float | None = None,
    parameters: Parameters | None = None,
    max_iterations: int = 30,
    progress: bool = False,
) -> Connection:
    """Find the parameter at which an orbit is homoclinic to a saddle or pseudo-saddle.

    Parameters
    ----------
    system : FilippovSystem
        Without explicit time. The orbit may cross, slide and be reset.
    saddle : Equilibrium, PseudoEquilibrium or array_like (n,)
        At the guess, or a point near it. A saddle of one mode, on the surface or off it; of a planar
        pseudo-saddle the surface is the unstable manifold.
    parameter : str
        Name of the parameter that is varied.
    guess : float, optional
        Its value to start from; by default that of ``parameters``. There an orbit of the unstable
        manifold should return to within half of its size.
    parameters : mapping, optional
        Values that replace defaults.
    max_iterations : int, optional
        Newton's method gives up after this many steps.
    progress : bool, optional
        Whether to show on a terminal the distance of the orbit from the saddle.

    Returns
    -------
    Connection
        Of codimension one. ``continue_bifurcation`` follows it as two parameters vary. After Ctrl-C the
        orbit ends farther from the saddle, and ``complete`` is False.

    Raises
    ------
    ConvergenceError
        No orbit returns, or Newton's method fails.
    DegenerateError
        The point is no saddle.
    OptionError
        A system with explicit time or hidden dynamics.
    DefinitionError
        ``system`` is not a FilippovSystem, or has vector multipliers.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    PointError
        A saddle of a wrong shape.

    Notes
    -----
    An orbit that lands on a planar pseudo-saddle does so in finite time, with regular equations. Others
    begin and end close to the saddle in its eigenspaces; how close is chosen so that the error of the
    parameter is that of rounding.

    Examples
    --------
    A spiral above the surface that lands where it slides to:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, c = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("c")
    >>> above = [0.1 * x - (y - 1), x + 0.1 * (y - 1)]
    >>> system = ns.FilippovSystem(
    ...     [x, y], surface=y, above=above, below=[c, 1], parameters={c: -0.6})
    >>> found = ns.find_homoclinic(system, [-1.4, 0.0], "c")
    >>> f"{found.value:.13f}", f"{found.flight:.13f}"
    ('-0.5862126010325', '5.2426089986980')

    The saddle of a pendulum-like oscillator whose friction is balanced:

    >>> mu = ca.SX.sym("mu")
    >>> smooth = ns.FilippovSystem([x, y], field=[y, x - x**3 + mu * y], parameters={mu: 0.01})
    >>> bool(abs(ns.find_homoclinic(smooth, [0.0, 0.0], "mu").value) < 1e-12)
    True
    """
    require_system(system)
    require_continuous(system, "find_homoclinic")
    if system.coupled or system.time_dependent:
        raise OptionError(
            f"system {system!r} depends on time or has hidden dynamics. Give an autonomous one that is "
            "linear in its multipliers."
        )
    names = system.parameter_names
    if parameter not in names:
        raise ParameterError(f"parameter {parameter!r} is unknown. The system has {list(names)}.")
    given = {str(k): v for k, v in (parameters or {}).items()}
    if guess is not None:
        given[parameter] = guess
    p, index = system.parameter_vector(given), names.index(parameter)
    mode, at = saddle_at(system, saddle, p)
    if isinstance(at, PseudoEquilibrium) and system.dimension == 2:
        side, legs, starts, durations = _flight_to(system, at, p)
        loop = PseudoSaddleLoop(system, legs, (index,), p, side)
        u = _solved(loop, loop.pack(starts, durations, at), parameter, max_iterations)
        return connection_of(loop, u, parameter)
    reasons = list[str]()
    for start in departures(system, mode, at.point, p):
        try:
            return by_projections(system, mode, start, p, (index,), max_iterations, progress)
        except ConvergenceError as error:
            reasons.append(str(error))
    raise ConvergenceError(
        f"homoclinic orbit: no orbit of the unstable manifold of {at.point.tolist()} returns to it "
        f"({reasons[0] if reasons else 'none comes near'}). Give a better guess of the parameter.",
        point=at.point,
    )


def by_projections(
    system: FilippovSystem,
    mode: str,
    start: Departure,
    p: Array,
    index: tuple[int, ...],
    max_iterations: int = 30,
    progress: bool = False,
    surface: int | None = None,
) -> Connection:
    """Solve for the orbit with the end of the guess, then move its end to the saddle."""
    far, near = start.miss, float(np.linalg.norm(start.starts[0] - start.saddle))
    parameter = system.parameter_names[index[-1]]
    loop = SaddleLoop(system, start.legs, index, p, mode, start.saddle, near, far, start.held)
    loop.surface = surface
    u = np.concatenate([np.ravel(start.starts), start.durations, p[list(index)]])
    u = _solved(loop, u, parameter, max_iterations, damped=True)
    target, factor, complete = loop.target() * start.size, _CLOSER, True
    bar, whole = progress_bar(100, progress, "%"), math.log(max(far / target, _SLOWLY))
    moved, k = np.inf, len(index)
    try:
        while far > target or moved > _SETTLED:
            closer = max(target, far / factor) if far > target else far / factor
            wait = np.log(far / closer) / -loop.reference.leading(True)
            longer, guess = loop.prolonged(u, wait, closer)
            try:
                found = _solved(longer, guess, parameter, max_iterations)
                if far > target:
                    bar.update(100.0 * math.log(far / closer) / whole)
                last, change = moved, (found[-k:] - u[-k:]) / loop.scales(u)[-k:]
                moved = float(np.abs(change).max()) / math.log(far / closer)
                if far <= target and moved >= last:  # rounding
                    break
                u, loop, far, factor = found, longer, closer, _CLOSER
            except ConvergenceError:
                factor **= 0.5
                if factor < _SLOWLY:
                    if far > max(target, _ENOUGH * start.size):
                        raise
                    break
    except KeyboardInterrupt:
        complete = False
    finally:
        bar.close()
    return replace(connection_of(loop, u, parameter), complete=complete)


def _guarded(equations: Equations, start: Array) -> Equations:
    """Equations that are NaN where a leg cannot be integrated, and far from the start."""

    def guarded(v: Array) -> tuple[Array, Array]:
        try:
            if np.abs(v - start).max() < _FAR:
                return equations(v)
        except NonsmoothError:
            pass
        return np.full(v.size, np.nan), np.full((v.size, v.size), np.nan)

    return guarded


def _solved(
    loop: Loop, u: Array, parameter: str, max_iterations: int, damped: bool = False
) -> Array:
    scales = loop.scales(u)

    def equations(v: Array) -> tuple[Array, Array]:
        with np.errstate(all="ignore"):  # a trial may diverge
            values, jacobian = loop.equations(v * scales)
        return values, jacobian * scales

    reason, root = "", None
    try:
        root = converge(equations, u / scales, tol=1e-13, max_iterations=max_iterations)
    except ConvergenceError as error:
        reason = f" {error}"
    if root is None and damped:
        try:
            what = "homoclinic orbit"
            near = _guarded(equations, u / scales)
            root = solve(near, u / scales, tol=1e-10, max_iterations=60, what=what).x
        except NonsmoothError as error:
            reason = f" {error}"
    if root is None or not np.abs(root - u / scales).max() < _FAR:
        raise ConvergenceError(
            f"homoclinic orbit: Newton's method in {parameter!r} did not converge in {loop.iterations} "
            f"steps.{reason} Give a better guess.",
            point=u,
        )
    return np.asarray(root * scales)


def connection_of(loop: Loop, u: Array, parameter: str) -> Connection:
    """The homoclinic orbit of a solution of the equations."""
    legs, faults = loop.described(u)
    p = loop.parameters_at(u)
    return Connection(
        system=loop.system,
        parameter=parameter,
        value=float(p[loop.free[-1]]),
        parameters=named(loop.system, p),
        saddle=loop.saddle(u),
        legs=legs,
        iterations=loop.iterations,
        residual=float(np.abs(loop.equations(u)[0]).max()),
        faults=faults,
        loop=loop,
        unknowns=u,
    )
