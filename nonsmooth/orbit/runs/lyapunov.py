"""Lyapunov exponents of a run through its events: QR with state-transition and saltation matrices."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...flow.constants import AT_END
from ...flow.ensembles.progress import progress_bar
from ...flow.options import tolerances
from ...flow.saving import Savable
from ...flow.simulate import simulate
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...model import (
    Array,
    DegenerateError,
    FilippovSystem,
    OptionError,
    Parameters,
    explain,
    mode_field,
    real,
    require_system,
    whole,
)
from .legs import Flown, Stretch, fly, stretches
from .variation import saltation_after

#: A column of an event's factor below this part of the matrix is zero: what an entry to sliding loses.
_LOST = 1e-12

#: Growths of two columns on a leg differ by this factor at most, or the leg is cut: beyond, the
#: smaller one is lost in rounding.
_RATIO = 1e6

#: Logarithms of the growths at an event add up to that of its determinant to this.
_MISSED = 1e-6

#: Derivatives beyond this are those of a run that diverges.
_HUGE = 1e100

#: A run that ends so many times as far away as it began, or as 1, diverges.
_FAR = 1e6

#: Stretches of equal length from which the standard errors are taken.
_BLOCKS = 32


@dataclass(frozen=True, eq=False, repr=False)
class LyapunovSpectrum(
    Savable, exponents="k nan", errors="k nan", blocks="b k nan", sum_check="nan"
):
    """Mean rates at which neighbours of a run go apart, the largest first.

    Attributes
    ----------
    exponents : ndarray (k,)
        Per unit time; ``-inf`` for directions that are lost (an entry to sliding, an impact without
        rebound): neighbours are one after a finite time.
    errors : ndarray (k,)
        Standard errors of the means, from ``blocks``. They do not see correlations longer than a
        block.
    blocks : ndarray (b, k)
        Exponents of stretches of equal length, one after the other.
    t : float
        Length of the run that was counted.
    sum_check : float
        What the sum of all finite exponents has to be, by another way: the mean of the divergence of
        the field and of ``log abs(det)`` of the saltation matrices. NaN where directions were lost,
        not all exponents were asked for, or the divergence is not known.
    complete : bool
        False if the computation was interrupted, and counts a shorter run.
    """

    exponents: Array
    errors: Array
    blocks: Array
    t: float
    sum_check: float
    complete: bool = True

    @property
    def dimension(self) -> float:
        """Kaplan-Yorke dimension of the attractor; NaN where the exponents do not add up below zero."""
        total = 0.0
        for j, exponent in enumerate(self.exponents):
            if total + exponent < 0.0:
                return j + total / abs(exponent)
            total += exponent
        return math.nan

    def __repr__(self) -> str:
        values = zip(self.exponents, self.errors, strict=True)
        told = ", ".join(f"{e:.6g}" + (f" +- {s:.1g}" if s else "") for e, s in values)
        cut = "" if self.complete else ", interrupted"
        return f"LyapunovSpectrum({told}; over t = {self.t:g}{cut})"


def lyapunov_spectrum(
    system: FilippovSystem,
    x0: ArrayLike,
    t_end: float,
    *,
    transient: float | None = None,
    k: int | None = None,
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    progress: bool = True,
) -> LyapunovSpectrum:
    """Lyapunov exponents of the run from a start, through crossings, sliding, resets and impacts.

    Parameters
    ----------
    system : FilippovSystem
        With scalar multipliers; an attractor is reached from the start.
    x0 : array_like (n,)
        States at the start.
    t_end : float
        The run ends here. Errors fall as the square root of the length of a chaotic run.
    transient : float, optional
        Time that is not counted at the beginning, in which the directions turn into place; a tenth
        of the run unless given.
    k : int, optional
        How many exponents, the largest; all n unless given.
    t_start, parameters, tol, rtol, atol : optional
        As in :func:`simulate`.
    progress : bool, optional
        A bar for runs of some seconds on a terminal.

    Returns
    -------
    LyapunovSpectrum
        Explicit time is no direction and has no exponent; the phase of a :class:`Clock` has its 0.
        Ctrl-C ends with what was counted so far.

    Raises
    ------
    DegenerateError
        The run ends before, grazes a surface, or meets two at one instant.
    DefinitionError
        ``system`` is none, or has vector multipliers.
    PointError
        A start of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        More exponents than states; a time out of its range.

    Notes
    -----
    Benettin et al. 1980; through events Mueller 1995 (Chaos, Solitons & Fractals 5, 1671). An event
    where columns become dependent loses the last of them for good.

    Examples
    --------
    Two decays, one of them halved by a clock, whose phase neither grows nor shrinks:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, u = ca.SX.sym("x"), ca.SX.sym("u")
    >>> clock = ns.Clock(1.0, map=[x / 2, u])
    >>> decay = ns.FilippovSystem([x, u], field=[0.25 * x, -u], clocks=clock)
    >>> ns.lyapunov_spectrum(decay, [1.0, 1.0, 0.5], t_end=100.0, transient=60.0).exponents.round(6)
    array([ 0.      , -0.443147, -1.      ])
    """
    require_system(system)
    n = system.dimension
    count = n if k is None else whole(k, "k")
    if count > n:
        raise OptionError(f"k: expected at most the {n} states, received {k}.")
    t_start, t_end = real(t_start, "t_start"), real(t_end, "t_end")
    wait = (t_end - t_start) / 10 if transient is None else real(transient, "transient", low=0.0)
    if not t_start + wait < t_end:
        raise OptionError(
            explain(
                "t_end",
                expected=f"a time after t_start + transient = {t_start + wait:g}",
                received=f"{t_end!r}",
                advice="The run from there to t_end is counted.",
            )
        )
    rtol, atol = tolerances(tol, rtol, atol)
    run = simulate(
        system,
        x0,
        t_end,
        t_start=t_start,
        parameters=parameters,
        rtol=rtol,
        atol=atol,
        max_events=10_000_000,
        max_steps=100_000_000,
    )
    if run.status is not Status.REACHED_END:
        raise DegenerateError(_ended(run, t_end))
    return _Frame(run, count, t_start + wait).follow(progress)


def _ended(run: Trajectory, t_end: float) -> str:
    """Message for a run that ended before, with its last state where that is far away."""
    size = float(np.abs(run.x[-1]).max())
    away = not size < _FAR * max(1.0, float(np.abs(run.x[0]).max()))
    words = f"The run diverges: its last state is {run.x[-1].tolist()}. " if away else ""
    return (
        f"run: expected one to t_end = {t_end:g}, received one that ended at t = {run.t[-1]:.10g} with "
        f"status {run.status}. {words}{run.message}"
    )


class _Frame:
    """Orthonormal directions that travel with a run, and the growth that they saw."""

    def __init__(self, run: Trajectory, count: int, begin: float):
        self.run, self.system, self.n = run, run.system, run.system.dimension
        self.p = run.system.parameter_vector(run.parameters)
        # Directions in general position: coordinate axes may lie in invariant subspaces.
        self.q = np.linalg.qr(np.random.default_rng(0).normal(size=(self.n, count)))[0]
        self.bounds = np.linspace(begin, float(run.t[-1]), _BLOCKS + 1)
        self.logs = np.zeros((_BLOCKS, count))
        self.volume, self.t = 0.0, float(run.t[0])

    def follow(self, progress: bool) -> LyapunovSpectrum:
        """Travel along the run."""
        parts = stretches(self.run)
        bar = progress_bar(len(parts), progress, "leg")
        complete = True
        try:
            for j, part in enumerate(parts):
                flown = self._leg(part)
                following = parts[j + 1] if j + 1 < len(parts) else None
                self._event(part, flown, following)
                bar.update(1)
        except KeyboardInterrupt:
            complete = False
            if self.t <= self.bounds[1]:
                raise  # nothing was counted
        finally:
            bar.close()
        return self._spectrum(complete)

    def _leg(self, part: Stretch) -> Flown:
        """Fly a leg in pieces that end at the bounds of blocks."""
        end = part.t + part.duration
        inner = self.bounds[(self.bounds > part.t) & (self.bounds < end)].tolist()
        cuts = [*inner, end]
        x, t = part.start, part.t
        for cut in cuts:
            flown = self._piece(part, x, t, cut - t, 0)
            x, t = flown.end[: len(x)], cut
        self.t = end
        return flown

    def _piece(self, part: Stretch, x: Array, t: float, duration: float, depth: int) -> Flown:
        flown = fly(self.system, part.leg, x, duration, self.p)
        if not self.q.shape[1]:
            return flown
        q, r = np.linalg.qr(flown.by_start[: self.n, : self.n] @ self.q)
        growth = np.abs(np.diag(r))
        if depth < 40 and not _resolved(growth):
            half = self._piece(part, x, t, duration / 2, depth + 1)
            return self._piece(part, half.end[: len(x)], t + duration / 2, duration / 2, depth + 1)
        self._count(q, growth, t + duration / 2)
        if t >= self.bounds[0] and self.q.shape[1] == self.n:
            self.volume += self._divergence(part.leg.mode, t, duration)
        return flown

    def _event(self, part: Stretch, flown: Flown, following: Stretch | None) -> None:
        event = saltation_after(self.run, part, flown, following, self.p)
        if event is None or part.leg.kind == "end" or not self.q.shape[1]:
            return
        matrix = event.matrix[: self.n, : self.n]
        if not np.abs(matrix).max() < _HUGE:
            raise self._diverging(matrix, part)
        q, r = np.linalg.qr(matrix @ self.q)
        growth = np.abs(np.diag(r))
        kept = growth > _LOST * np.linalg.norm(matrix)
        if not kept.all() and _regular(matrix):  # too small to be seen, but not lost
            q, growth = self._spread(matrix, part)
            kept = np.full(growth.shape, True)
        if self._block(self.t) >= 0:
            size = abs(float(np.linalg.det(matrix)))
            self.volume += math.log(size) if kept.all() and size else math.nan
        self._count(q[:, kept], growth[kept], self.t)

    def _spread(self, matrix: Array, part: Stretch) -> tuple[Array, Array]:
        """Directions and growths of an event that loses none, though QR sees them vanish."""
        found = _spread(matrix, self.q)
        if found is None:
            raise self._diverging(matrix, part)
        return found

    def _diverging(self, matrix: Array, part: Stretch) -> DegenerateError:
        return DegenerateError(
            f"{part.leg.name!r} at t = {self.t:.10g}: expected an event that carries neighbours on with "
            f"digits that are left, received derivatives up to {np.abs(matrix).max():.2g} that lose no "
            "direction. The run diverges, or its states need other units: the last one is "
            f"{part.end[: self.n].tolist()}."
        )

    def _count(self, q: Array, growth: Array, t: float) -> None:
        self.q = q
        block = self._block(t)
        if block >= 0:
            self.logs[block, : len(growth)] += np.log(growth)

    def _block(self, t: float) -> int:
        """Number of the block that a time belongs to, its end included; negative before the first."""
        found = np.searchsorted(self.bounds, t - AT_END * max(1.0, abs(t)), side="left")
        return min(int(found) - 1, _BLOCKS - 1)

    def _divergence(self, mode: str, t: float, duration: float) -> float:
        """Integral of the divergence of a mode's field along the run, by Gauss's rule on each step."""
        run, system = self.run, self.system
        if len(mode) > system.surface_count or mode.count("s") > 1 or any(system.nonlinear):
            return math.nan

        def build() -> list[object]:
            field = mode_field(system, mode)
            return [sum(system.gradient(field[i])[i] for i in range(self.n))]

        function = system.function(("divergence", mode), build)
        inner = run.t[(run.t > t) & (run.t < t + duration)]
        edges = np.unique([t, *inner, t + duration])
        nodes, weights = np.polynomial.legendre.leggauss(8)
        middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        times = (middle[:, None] + half[:, None] * nodes).ravel()
        x = run(times)
        if system.time_dependent:
            x = np.column_stack([x, times])
        values = np.array(function(x.T, self.p)).reshape(-1, 8)
        return float(half @ (values @ weights))

    def _spectrum(self, complete: bool) -> LyapunovSpectrum:
        done = _BLOCKS if complete else int(np.searchsorted(self.bounds, self.t, side="right")) - 1
        blocks = self.logs[:done] / (self.bounds[1] - self.bounds[0])
        left = self.q.shape[1]
        blocks[:, left:] = -math.inf
        exponents, errors = blocks.mean(axis=0), np.zeros(blocks.shape[1])
        if done > 1:
            errors[:left] = blocks[:, :left].std(axis=0, ddof=1) / math.sqrt(done)
        order = np.argsort(-exponents, kind="stable")
        length = float(self.bounds[done] - self.bounds[0])
        all_of_them = complete and left == self.n
        check = self.volume / length if all_of_them else math.nan
        return LyapunovSpectrum(
            exponents[order], errors[order], blocks[:, order], length, check, complete
        )


def _spread(matrix: Array, q: Array) -> tuple[Array, Array] | None:
    """Directions after a regular map and growths, also where these differ by more than rounding
    allows."""
    m, whole = q.shape[1], np.linalg.qr(q, mode="complete")[0]
    forward, r = np.linalg.qr(matrix @ whole)
    backward, s = np.linalg.qr(np.linalg.solve(matrix.T, whole)[:, ::-1])
    growth, shrinking = np.abs(np.diag(r)), np.abs(np.diag(s))[::-1]
    large = growth > math.sqrt(_LOST) * growth.max()
    if not (np.where(large, growth, shrinking) > 0.0).all():
        return None
    logs = np.where(large, np.log(growth, where=large, out=np.zeros(len(large))), 0.0)
    logs -= np.log(shrinking, where=~large, out=np.zeros(len(large)))
    if not abs(logs.sum() - np.linalg.slogdet(matrix)[1]) < _MISSED:
        return None
    turned = np.linalg.qr(np.where(large, forward, backward[:, ::-1]))[0]
    return turned[:, :m], np.exp(logs[:m])


def _regular(matrix: Array) -> bool:
    """Whether a square matrix has an inverse, in whatever units its rows and columns are."""
    scaled = np.abs(matrix)
    signs = np.sign(matrix)
    for axis in (1, 0, 1, 0):
        largest = scaled.max(axis=axis, keepdims=True)
        if not (np.isfinite(largest) & (largest > 0.0)).all():
            return False
        scaled = scaled / largest
    values = np.linalg.svd(signs * scaled, compute_uv=False)
    return bool(values[-1] > _LOST * values[0])


def _resolved(growth: Array) -> bool:
    finite = bool(np.all(np.isfinite(growth)))
    return finite and bool(growth.max() <= _RATIO * growth.min())
