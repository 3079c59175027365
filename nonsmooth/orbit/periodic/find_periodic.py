"""Find a periodic orbit from a guess by Newton's method on its boundary value problem."""

from __future__ import annotations

import math
from dataclasses import replace
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...flow.ensembles.progress import progress_bar
from ...flow.fixed import TOLERANCE
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    ConvergenceError,
    DegenerateError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    Parameters,
    require_system,
    whole,
)
from ...model.checks import positive
from ...solvers.newton import Equations, converge, solve
from ..runs.itinerary import Itinerary
from ..runs.legs import Leg, integrate_leg, leg_name, shown_itinerary
from .boundary_value_problem import BoundaryProblem, Evaluation
from .divided_legs import divided, growth, to_divide
from .guess import Start, about_of, equations_of, is_about, starts_of
from .orbit import PeriodicOrbit, named, violations_of
from .symmetry import prime_period, require_symmetric, symmetry_matrix

#: Largest duration of a leg relative to the guess of the whole orbit.
_LONGEST = 10.0


def periodic_orbit(
    system: FilippovSystem,
    guess: Trajectory | PeriodicOrbit | ArrayLike,
    *,
    itinerary: Itinerary | None = None,
    period: Any = None,
    multiplicity: int | None = None,
    symmetry: ArrayLike | str | None = None,
    parameters: Parameters | None = None,
    t_start: float = 0.0,
    virtual: bool = False,
    max_iterations: int = 20,
    max_time: float | None = None,
    progress: bool = False,
) -> PeriodicOrbit:
    """Find a periodic orbit, stable or not, to rounding, with its multipliers and margins.

    The itinerary is that of the guess; the boundary value problem of its legs is solved by
    Newton's method with exact derivatives; then the guards are checked along the orbit.

    Parameters
    ----------
    system : FilippovSystem
        It may slide, jump, hit, rub in a plane or in space, and depend periodically on time.
    guess : Trajectory, state (n,) or PeriodicOrbit
        A run whose end is near the orbit; a state near it, from which the system is simulated; an
        orbit at other parameters, whose itinerary is kept.
    itinerary : str or sequence, optional
        Modes of the legs in order, e.g. ``"- s"``, or pairs of a mode and the name of the event that
        ends it; with a state as the guess. One mode alone means an orbit of a forced system without
        events; without ``multiplicity`` it lasts for as many periods of the forcing (up to 16) as close best.
        With vector multipliers only that.
    period : expression in parameters or float, optional
        The period of the forcing, if the system depends on time. Found by itself where the time only
        enters sines and cosines whose frequencies have rational ratios. Of a system without
        time about how long the whole orbit takes: shorter and longer ones, by more than a factor of
        1.5, are skipped in the guess and refused as the result.
    multiplicity : int, optional
        Number of periods of the forcing that the orbit of a forced system takes. By default, for a state as the
        guess, the least of an orbit beside it (up to 8), and else 1; a run, an itinerary or an orbit has
        its own.
    symmetry : "odd" or array_like (n, n), optional
        R, if R x solves the equations when x does (half a forcing period later, if there is one): the
        orbit is solved for as a half, which R maps to the other half. ``"odd"`` is $R = -1$.
    parameters : mapping, optional
        Values that replace those of the guess, or defaults.
    t_start : float, optional
        Time of a state.
    virtual : bool, optional
        Accept an orbit that violates guards.
    max_iterations : int, optional
        Maximum number of full Newton steps; where they fail, up to twice as many with damping follow.
    max_time : float, optional
        Seconds after which Newton's method gives up (ConvergenceError).
    progress : bool, optional
        Whether to show a bar that counts evaluations of the equations.

    Returns
    -------
    PeriodicOrbit
        The closed orbit: period, itinerary and multipliers.

    Raises
    ------
    ConvergenceError
        The guess does not close, or Newton's method fails.
    VirtualOrbitError
        The solution violates guards; it is the error's attribute ``orbit``.
    DegenerateError
        The orbit grazes, or passes a two-fold or a corner.
    DefinitionError
        ``system`` is none; a mode of the itinerary that it does not have.
    OptionError
        No period, though the system depends on time and none is found, or one that is no positive
        time; a symmetry that is none; with a run or an orbit as the guess an itinerary, a ``t_start``,
        or what contradicts it.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    PointError
        A state of a wrong shape or not finite.

    Notes
    -----
    Unknowns are starts and durations of the legs (multiple shooting by Taylor series; no mesh).
    Impacts or switches that accumulate are one leg, which the itinerary shows with dots, as in ``"c o o..."``.
    Multipliers: products of variational and saltation matrices, Leine & Nijmeijer 2004, ch. 7.

    Examples
    --------
    A relay that is forced to cross, at a phase $phi$ with $sin phi = -pi/5$. With $c = 2.5 cos phi$ its
    multiplier is $((c - 1)/(c + 1))^2$.

    >>> import casadi as ca, nonsmooth as ns
    >>> x, t = ca.SX.sym("x"), ca.SX.sym("t")
    >>> drive = 2.5 * ca.cos(t)
    >>> relay = ns.FilippovSystem([x], surface=x, above=[drive - 1], below=[drive + 1], time=t)
    >>> orbit = ns.periodic_orbit(relay, ns.simulate(relay, [0.5], t_end=40.0))
    >>> c = 2.5 * np.sqrt(1 - (np.pi / 5)**2)
    >>> bool(abs(orbit.multipliers[0] - ((c - 1) / (c + 1))**2) < 1e-14)
    True
    >>> orbit.stability
    'asymptotically stable'
    """
    require_system(system, sets=True, complementarity=True, joints=True)
    max_iterations = whole(max_iterations, "max_iterations")
    if not isinstance(virtual, (bool, np.bool_)):
        raise OptionError(f"virtual: expected True or False, received {virtual!r}.")
    matrix = symmetry_matrix(system, symmetry)
    if multiplicity is not None:
        multiplicity = _multiplicity(system, multiplicity, matrix)
    budget = _Budget(max_time, progress)
    given = itinerary, period, multiplicity, matrix, parameters, t_start
    try:
        for start in starts_of(system, guess, *given):
            if start.near:
                beside = _beside(start, multiplicity, max_iterations, budget)
                if beside is not None:
                    return beside
                continue
            orbit = _solved(start, period, multiplicity, max_iterations, budget)
            if orbit.faults and not virtual:
                raise _virtual(orbit)
            return orbit
        raise AssertionError("the last start is beside none")
    except _OutOfTime:
        raise ConvergenceError(
            f"periodic orbit: no orbit was found in max_time = {max_time:g} s, after {budget.spent} evaluations of "
            "the equations. Start closer to the orbit, or allow more time."
        ) from None
    finally:
        budget.bar.close()


def _multiplicity(system: FilippovSystem, given: Any, symmetry: Array | None) -> int:
    """Check the number of periods of the forcing."""
    count = whole(given, "multiplicity")
    if not system.time_dependent:
        raise OptionError(
            f"multiplicity={count} is a number of periods of a forcing, but the system does not depend on time. "
            "Give period=, about how long the orbit takes."
        )
    if symmetry is not None and count % 2 == 0:
        raise OptionError(
            f"multiplicity={count} is even, but an orbit whose half a symmetry maps to the other half takes an odd "
            "number of periods of the forcing. Drop symmetry=."
        )
    return count


class _OutOfTime(Exception):
    """The time for a search is spent."""


class _Budget:
    """The time that a search may take, and a bar that counts evaluations of its equations."""

    def __init__(self, seconds: float | None, shown: bool):
        self.end = math.inf if seconds is None else monotonic() + positive(seconds, "max_time")
        self.bar, self.spent = progress_bar(None, shown, " evaluations"), 0

    def spend(self) -> None:
        if monotonic() > self.end:
            raise _OutOfTime
        self.spent += 1
        self.bar.update()


def _solved(
    start: Start,
    period: Any,
    multiplicity: int | None,
    most: int,
    budget: _Budget,
    damped: bool = True,
) -> PeriodicOrbit:
    """The orbit that Newton's method finds from a start."""
    begun, guessed, system = start.problem, start.unknowns, start.problem.system
    if not begun.legs[-1].timed:
        begun, guessed = prime_period(begun, guessed, start.p)
    problem, u, at, iterations = _closed_orbit(begun, guessed, start.p, most, budget, damped)
    part, once = prime_period(begun, problem.undivided(u), start.p)
    if part is not begun:
        problem, u, at, _ = _closed_orbit(part, once, start.p, most, budget)
    require_motion(problem, at, start)
    require_duration(problem, at, about_of(system, period, start.p))
    _require_multiplicity(problem, multiplicity)
    faults = tuple(violations_of(problem, at, start.p))
    orbit = PeriodicOrbit(system, named(system, start.p), problem, u, at, iterations, faults)
    orbit = _of_neutral_family(orbit, most, budget) or orbit
    require_simple(orbit)
    require_symmetric(orbit)
    return orbit


#: Part of the period of which the square, the height of a touch, is rounding.
_TOUCH = 1e-6


def _of_neutral_family(orbit: PeriodicOrbit, most: int, budget: _Budget) -> PeriodicOrbit | None:
    """The last orbit of a neutral family without events, of which the slides where it touches a surface are rounding."""
    system, p, durations = orbit.system, orbit.parameter_vector, orbit.evaluation.durations
    legs = orbit.problem.whole.legs
    short = np.abs(durations) <= _TOUCH * orbit.period
    modes = {leg.mode for leg, slides in zip(legs, short, strict=True) if not slides}
    slides = all(leg.kind == "exit" for leg, own in zip(legs, short, strict=True) if own)
    if system.time_dependent or orbit.symmetric or len(modes) != 1 or not (short.any() and slides):
        return None
    i, leg = int(np.argmin(short)), Leg(modes.pop())
    x = integrate_leg(system, leg, orbit.evaluation.starts[i], 0.4 * float(durations[i]), p).end
    for span in (durations[i], durations.sum()):
        begun = equations_of(system, (leg,), x[None], np.array([span]), 0.0, None, None, p)
        try:
            problem, u, at, count = _closed_orbit(begun.problem, begun.unknowns, p, most, budget)
            part, once = prime_period(problem.whole, problem.undivided(u), p)
            if part is not problem.whole:
                problem, u, at, count = _closed_orbit(part, once, p, most, budget)
        except (ConvergenceError, DegenerateError):
            continue
        faults = tuple(violations_of(problem, at, p))
        found = PeriodicOrbit(system, orbit.parameters, problem, u, at, count, faults)
        if found.floquet.repeats and not faults:
            return found
    return None


def _closed_orbit(
    problem: BoundaryProblem,
    guess: Array,
    p: Array,
    most: int,
    budget: _Budget,
    damped: bool = True,
) -> tuple[BoundaryProblem, Array, Evaluation, int]:
    """The orbit near a guess, with legs divided where derivatives grow along them; how many steps it took."""
    solver, found = _Solver(problem, p, budget), None
    try:
        found = solver.solve(guess, most, damped)
        if not to_divide(problem, found[1]):
            return problem, *found, solver.iterations
        parts, start = divided(problem, found[0], p)
    except ConvergenceError:
        parts, start = divided(problem, guess, p) if damped else (problem, guess)
        if parts is problem:
            raise
    if parts is not problem:
        try:
            finer = _Solver(parts, p, budget)
            orbit = finer.solve(start, most, damped)
            return parts, *orbit, solver.iterations + finer.iterations
        except ConvergenceError:
            if found is None:
                raise
    assert found is not None
    return problem, *found, solver.iterations


def _require_multiplicity(problem: BoundaryProblem, target: int | None) -> None:
    """Refuse an orbit that takes another number of periods of the forcing."""
    found = problem.periods * (1 if problem.symmetry is None else 2)
    if target is not None and abs(found - target) > 0.25:
        raise ConvergenceError(
            f"periodic orbit: multiplicity = {target} was requested, but the orbit closes after {found:g} of the "
            "forcing's periods. Start closer to the orbit, or leave multiplicity= out."
        )


def _beside(
    start: Start, multiplicity: int | None, most: int, budget: _Budget
) -> PeriodicOrbit | None:
    """The orbit that full Newton steps reach beside a state; None if it is not near."""
    try:
        orbit = _solved(start, None, multiplicity, min(most, _QUICK), budget, damped=False)
    except (ConvergenceError, DegenerateError):
        return None
    begun, guessed = prime_period(start.problem, start.unknowns, start.p)
    own, u = orbit.problem.whole, orbit.problem.undivided(orbit.unknowns)
    if orbit.faults or own.size != begun.size:
        return None
    away = np.abs(u - guessed) / own.scales(u, start.p)
    return orbit if away.max() <= _BESIDE else None


#: Full Newton steps that suffice beside an orbit.
_QUICK = 8

#: Largest distance of an orbit from a state beside it, in scaled unknowns.
_BESIDE = 0.05

#: Steps below this, relative to the orbit, that do not shrink are rounding of the equations.
_CLOSE = 1e-10

#: Steps below this, relative to the orbit, are rounding.
_ROUNDING = 1e-14

#: Legs far from the orbit are integrated with local errors up to this.
_COARSE = 1e-8

#: Steps below this, relative to the orbit, change its derivatives by rounding: Newton's method ends.
_FINAL = 1e-13

#: Larger steps from an orbit of a family, relative to the orbit, are rounding that is magnified along it.
_POLISH = 1e-3

#: A guess that closes to a part e of its size is as near as this times sqrt(e) to its orbit.
_FAR = 10.0

#: Relative singular values below which directions are weak, in turn.
_WEAK = (1e-15, 1e-8, 1e-6, 1e-4, 1e-2)

#: Residual, relative to the orbit, with which it does not close.
_CLOSES = 1e-7

#: Equations of which singular values would take minutes, and residuals that cannot be smaller.
_LARGE, _CLOSED = 1000, 1e-9

#: Growth of derivatives along a leg with which a run ends anywhere: rounding becomes as large as the orbit.
_RESOLVED = 1e16


class _Solver:
    """Newton's method on the equations of an orbit, with diagnostics on failure."""

    def __init__(self, problem: BoundaryProblem, p: Array, budget: _Budget):
        self.problem, self.p, self.iterations, self.budget = problem, p, 0, budget
        self.last: tuple[Array, Evaluation | None] = (np.zeros(0), None)
        self.growth = 0.0  # of derivatives along a leg of the guess

    def solve(self, u: Array, max_iterations: int, damped: bool = True) -> tuple[Array, Evaluation]:
        """The orbit, to rounding; with damped steps where full ones fail."""
        longest = _LONGEST * float(np.abs(self.problem.split(u)[1]).sum())
        scales = self.problem.scales(u)
        last: list[Array] = []
        first: list[tuple[Array, Evaluation]] = []

        def equations(v: Array) -> tuple[Array, Array]:
            if first and np.array_equal(v, first[0][0]):  # the guess, again
                self.last = first[0][0] * scales, first[0][1]
                return first[0][1].residual, first[0][1].jacobian * scales
            u = v * scales
            self.last = u, None
            durations = self.problem.split(u)[1]
            if not max(-float(durations.min()), float(durations.max())) <= longest:
                i = int(np.argmax(np.abs(durations)))
                raise ConvergenceError(
                    f"Leg {i + 1} {leg_name(self.problem.system, self.problem.legs[i])} grew to the duration "
                    f"{durations[i]:.3g}."
                )
            self.budget.spend()
            size = float(np.abs(v - last[-1]).max()) if last else 0.0
            # after a step of this size the next one is its square, and what it leaves its fourth power
            tol = min(max(1e-3 * size**4, TOLERANCE), _COARSE)
            at = self.problem.evaluate(u, self.p, tol=tol)
            if not last:
                first.append((v, at))
                self.growth = growth(self.problem, at, at.flows)
            last.append(v)
            self.last = u, at
            self.iterations += 1
            with np.errstate(over="ignore"):  # of a trial that is no step
                return at.residual, at.jacobian * scales

        reason = ""
        root: Array | None
        try:
            root = converge(
                equations,
                u / scales,
                tol=_FINAL,
                max_iterations=max_iterations,
                linear=self.problem.solve,
                noise=_CLOSE,
                values=lambda v: self.problem.residual(v * scales, self.p),
            )
        except (ConvergenceError, DegenerateError) as error:
            root, reason = None, str(error)
            if not last:  # not even the guess can be followed: no shorter step helps
                raise self._failure(reason) from error
        before = list(last)
        nearest = self._of_family(equations, u / scales, root, max_iterations)
        last[:] = before
        if nearest is not root and nearest is not None:
            return self._closed(*self._polished(nearest * scales, _POLISH))
        if root is None and damped and u.size <= _LARGE:
            root = self._damped(equations, u / scales, 2 * max_iterations)
        if root is None:
            raise self._failure(reason)
        return self._closed(*self._polished(root * scales))

    def _closed(self, u: Array, at: Evaluation) -> tuple[Array, Evaluation]:
        """Refuse a guess that no step brings nearer to an orbit."""
        sizes = self._sizes(at.jacobian * self.problem.scales(u))
        if not float(np.abs(at.residual / sizes).max()) <= _CLOSES:
            self.last = u, at
            raise self._failure("")
        return u, at

    def _of_family(
        self, equations: Equations, v: Array, root: Array | None, most: int
    ) -> Array | None:
        """The orbit near a guess that closes so well that Newton's method should not leave it."""
        if v.size > _LARGE:
            return root
        try:
            values, jacobian = equations(v)
            moving = np.abs(v) > _ROUNDING  # states that are zero have the unit of others
            closes = float(np.abs(values / self._sizes(jacobian * moving)).max())
            far = _FAR * math.sqrt(closes)
            if far > 1.0 or (root is not None and np.abs(root - v).max() <= far):
                return root
            found = self._nearest(equations, v, most, far)
        except (NonsmoothError, np.linalg.LinAlgError):
            return root
        return root if found is None else found

    def _nearest(self, equations: Equations, v: Array, most: int, far: float) -> Array | None:
        """Newton's method that does not run along a family of orbits."""
        # A step that increases the residual goes along a direction that the residual does not determine: the
        # weakest directions, more and more of them, are kept fixed.
        start, (values, jacobian) = v, equations(v)
        for _ in range(most):
            sizes = self._sizes(jacobian)
            now = float(np.abs(values / sizes).max())
            less = math.inf
            for weak in _WEAK:
                step = np.linalg.lstsq(jacobian / sizes[:, None], values / sizes, rcond=weak)[0]
                if not np.abs(v - step - start).max() <= far:
                    continue
                there = equations(v - step)
                less = float(np.abs(there[0] / sizes).max())
                if less < 0.5 * now:
                    break
            if not less < 0.5 * now:
                return v if now <= _CLOSED else None
            v, (values, jacobian) = v - step, there
        return None

    def _sizes(self, jacobian: Array) -> Array:
        """Sizes of the equations: of the states that are to meet, and of the events by their derivatives."""
        rows, n = np.linalg.norm(jacobian, axis=1), len(self.problem.legs) * self.problem.dimension
        rows[:n] = np.maximum(rows[:n], self.problem.scales(self.last[0])[:n])
        return np.where(rows > 0.0, rows, 1.0)

    def _damped(self, equations: Equations, v: Array, max_iterations: int) -> Array | None:
        """Newton's method with halved steps, from farther away."""

        def guarded(w: Array) -> tuple[Array, Array]:
            try:
                return equations(w)
            except (ConvergenceError, DegenerateError):
                return np.full(w.size, np.nan), np.full((w.size, w.size), np.nan)

        try:
            found = solve(
                guarded, v, tol=1e-7, max_iterations=max_iterations, what="periodic orbit"
            )
        except NonsmoothError:
            return None
        return found.x

    def _polished(self, u: Array, largest: float = math.inf) -> tuple[Array, Evaluation]:
        """Two more steps at most, as long as they shrink and are not too large: to rounding."""
        at, scales = self.problem.evaluate(u, self.p), self.problem.scales(u)
        for _ in range(2):
            exact = self.problem.residual(u, self.p, extended=True)
            step = self._step(at.jacobian, at.residual if exact is None else exact)
            size = float(np.abs(step / scales).max())
            if exact is not None and size <= _FINAL:  # the derivatives are those of the orbit
                return self._moved(u, step, at, exact)
            if size <= _ROUNDING or size > largest:
                break
            try:
                there = self.problem.evaluate(u + step, self.p)
            except (ConvergenceError, DegenerateError):
                break
            self.iterations += 1
            if not np.abs(there.residual).max() < np.abs(at.residual).max():
                break
            u, at = u + step, there
        return u, at

    def _step(self, jacobian: Array, residual: Array) -> Array:
        try:
            return -self.problem.solve(jacobian, residual)
        except np.linalg.LinAlgError:  # one of a family of orbits: the nearest
            return -np.asarray(np.linalg.lstsq(jacobian, residual, rcond=1e-12)[0], float)

    def _moved(
        self, u: Array, step: Array, at: Evaluation, exact: Array
    ) -> tuple[Array, Evaluation]:
        """The last step, by which derivatives change less than rounding."""
        there = u + step
        starts, durations = self.problem.split(there)
        residual = exact + at.jacobian @ (there - u)  # rounding of the unknowns is what remains
        return there, replace(at, residual=residual, starts=starts, durations=durations)

    def _largest(self, at: Evaluation) -> str:
        """The leg whose equations have the largest residual."""
        count, n = len(self.problem.legs), self.problem.dimension
        sizes = np.abs(at.residual[: count * n]).reshape(count, n).max(axis=1)
        ends = np.abs(at.residual[count * n :])
        i = int(np.argmax(np.maximum(sizes, ends)))
        what = "does not end on its event" if ends[i] > sizes[i] else "does not meet the next one"
        return f"leg {i + 1} {leg_name(self.problem.system, self.problem.legs[i])} {what} (by {max(sizes[i], ends[i]):.2g})"

    def _failure(self, reason: str) -> ConvergenceError:
        u, at = self.last
        _, durations = self.problem.split(u)
        legs = self.problem.legs
        size = float(np.abs(at.residual).max()) if at is not None else math.nan
        backward = [
            f"leg {i + 1} {leg_name(self.problem.system, leg)} has the duration {d:.3g}"
            for i, (leg, d) in enumerate(zip(legs, durations, strict=True))
            if not d > 0.0
        ]
        if not backward and at is not None:
            try:
                backward = violations_of(self.problem, at, self.p)
            except NonsmoothError:
                backward = []
        why = f" {reason}" if reason else ""
        if at is not None and not backward:
            backward = [self._largest(at)]
        where = f" At the last iterate {backward[0]}." if backward else ""
        advice = (
            "Simulate longer, start closer to the orbit, or try the itinerary of a run from there."
        )
        if not self.growth < _RESOLVED:
            why, where = (
                f" Derivatives grow by {self.growth:.0e} along a leg: runs leave the orbit.",
                "",
            )
            advice = (
                "Give itinerary= with a state near it, or continue an orbit of other parameters."
            )
        modes = shown_itinerary(self.problem.system, legs[:40])
        modes += f" ... ({len(legs)} legs)" * (len(legs) > 40)
        return ConvergenceError(
            f"periodic orbit: Newton's method did not converge with the itinerary {modes!r} in "
            f"{self.iterations} evaluations of the equations, residual {size:.2g}.{why}{where} {advice}",
            residual=size,
            point=u,
        )


# Checks of a solution: motion, period, and no two-fold.

#: A period below this part of the guess is that of a point.
_POINT = 1e-9

#: One below this part of it is too, where the equations are singular to ``_SINGULAR``: as an orbit
#: shrinks to a point, its duration is determined ever less.
_SHRUNK, _SINGULAR = 1e-2, 1e-9

#: Motion by fewer spacings of numbers of the size of a state is lost in rounding.
_SPACINGS = 8.0

#: Gaps between legs, beside the size of the guess, from which an orbit is none.
_OPEN = 1e-3

#: States that move by no more than this part of their size rest.
_STILL = 1e-6


def require_motion(problem: BoundaryProblem, at: Evaluation, start: Start) -> None:
    """Refuse a point: every equilibrium solves the equations of an orbit, of no or any duration."""
    # So does, with any duration, every point so far away that motion is lost in its rounding.
    n = problem.system.dimension
    guess = float(np.abs(start.problem.split(start.unknowns)[1]).sum())
    period, x = float(np.abs(at.durations).sum()), at.starts[0, :n]
    _require_resolved(problem, at)
    _require_closed(problem, at, start)
    way = float(np.abs(at.flows.rate[0]).max()) * period
    rests = problem.legs[-1].timed and not problem.system.time_dependent
    shrunk = period <= _SHRUNK * guess and _singular(problem, at)
    if period > _POINT * guess and not shrunk:
        guessed = float(np.abs(start.problem.split(start.unknowns)[0][:, :n]).max())
        size = max(min(1.0, guessed), float(np.abs(x).max()))
        if not (rests and way <= _STILL * size):
            return
    raise ConvergenceError(
        f"periodic orbit: Newton's method shrank the orbit to a point, {x.tolist()}, of period "
        f"{period:.2g} (guess {guess:.6g}). It is an equilibrium, or a point "
        "where legs vanish: start closer to the orbit.",
        point=x,
    )


def _require_closed(problem: BoundaryProblem, at: Evaluation, start: Start) -> None:
    """Refuse states that diverged from the guess and close only relative to their own size."""
    n, count = problem.dimension, len(problem.legs)
    own = problem.system.dimension
    size = float(start.problem.scales(start.unknowns, start.p)[:own].max())
    gaps = np.abs(at.residual[: count * n].reshape(count, n)[:, :own])
    if gaps.max() <= _OPEN * size:
        return
    raise ConvergenceError(
        f"periodic orbit: Newton's method ran away to states of the size {np.abs(at.starts[:, :own]).max():.2g} from a "
        f"guess of the size {size:.2g}, and does not close (by {gaps.max():.2g}). There may be no orbit: does the motion "
        "grow without bound, as at a resonance?",
        residual=float(gaps.max()),
        point=at.starts[0, :own],
    )


def _require_resolved(problem: BoundaryProblem, at: Evaluation) -> None:
    """Refuse an orbit whose motion is below the rounding of its states."""
    n, count = problem.system.dimension, len(problem.legs)
    ways = np.abs(at.flows.rate[:count, :n]) * np.abs(at.durations[:, None])
    spacings = np.spacing(np.abs(at.starts[:, :n]).max(axis=0))
    if (ways > _SPACINGS * spacings).any() or not ways.any() or not _singular(problem, at):
        return  # or at rest by the equations
    raise ConvergenceError(
        f"periodic orbit: expected an orbit that moves, received the state {at.starts[0, :n].tolist()}, "
        f"which moves by {ways.max():.2g} at most: less than {_SPACINGS:g} spacings of numbers of that "
        f"size, of {spacings.max():.2g}, so it closes by rounding. Start closer to the orbit.",
        point=at.starts[0, :n],
    )


def _singular(problem: BoundaryProblem, at: Evaluation) -> bool:
    """Whether the equations, in units of the orbit, are nearly singular."""
    jacobian = at.jacobian * problem.scales(problem.pack(at.starts, at.durations))
    rows = np.linalg.norm(jacobian, axis=1)
    values = np.linalg.svd(jacobian / np.where(rows > 0.0, rows, 1.0)[:, None], compute_uv=False)
    return bool(values[-1] <= _SINGULAR * values[0])


def require_duration(problem: BoundaryProblem, at: Evaluation, about: float | None) -> None:
    """Refuse an orbit whose period is not near the given one."""
    period = float(at.durations.sum()) * (1 if problem.symmetry is None else 2)
    if about is None or is_about(period, about):
        return
    raise ConvergenceError(
        f"periodic orbit: period = {about:.6g} was requested, but the solution has the period "
        f"{period:.10g}, at {at.starts[0, : problem.system.dimension].tolist()}. Start closer to the "
        "orbit, or leave period= out.",
        point=at.starts[0, : problem.system.dimension],
    )


#: L of the other field at an exit, relative to its gradient and the orbit, at which the exit is at a two-fold.
_TWO_FOLD = 1e-9


def at_two_fold(
    system: FilippovSystem, leg: Leg, end: Array, p: Array, starts: Array, part: float = _TWO_FOLD
) -> bool:
    """Whether a slide of an orbit with these starts of legs ends where L_F1 h and L_F2 h both vanish, on one surface."""
    if leg.kind != "exit" or system.coupled:
        return False
    other = replace(leg, side=-leg.side).at_event(system, end, p)
    states = np.vstack([end[: system.dimension], starts[:, : system.dimension]])
    largest = float(np.linalg.norm(states, axis=1).max())  # the two-fold may be at the origin
    return abs(other.value) <= part * (float(np.linalg.norm(other.gradient)) * largest or 1.0)


def require_simple(orbit: PeriodicOrbit) -> None:
    """Refuse orbits through two-folds, and grazing."""
    system, p, flows = orbit.system, orbit.parameter_vector, orbit.evaluation.flows
    for i, leg in enumerate(orbit.problem.legs):
        end = flows.end[i]
        if at_two_fold(system, leg, end, p, orbit.evaluation.starts):
            raise DegenerateError(
                f"periodic orbit: expected legs that end on one fold, received leg {i + 1} "
                f"{leg_name(system, leg)} that ends where L_F1 h and L_F2 h both vanish: a two-fold, at "
                f"{end[: system.dimension].tolist()}. The orbit is not unique there: vary a parameter."
            )
    if orbit.floquet.refusal:
        raise DegenerateError(orbit.floquet.refusal)


class VirtualOrbitError(ConvergenceError):
    """A solution of the orbit's equations that violates guards.

    Attributes
    ----------
    orbit : PeriodicOrbit
        The virtual orbit.
    """

    def __init__(self, message: str, orbit: PeriodicOrbit):
        super().__init__(message, residual=orbit.residual, point=orbit.unknowns)
        self.orbit = orbit


def _virtual(orbit: PeriodicOrbit) -> VirtualOrbitError:
    more = f" (and {len(orbit.faults) - 1} more)" if len(orbit.faults) > 1 else ""
    return VirtualOrbitError(
        f"periodic orbit: the solution is virtual, it violates a guard: {orbit.faults[0]}{more}. Try "
        "the itinerary of a simulation from there, or accept it with virtual=True. The solution is the "
        "attribute `orbit` of this error.",
        orbit,
    )
