"""Lyapunov exponents of a run by QR decompositions of state-transition and saltation matrices."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
    mode_field,
    real,
    require_system,
    whole,
)
from .legs import LegFlow, Stretch, carry_leg, stretches
from .limits import limits_of
from .variation import carried, passages_to, saltation_after

#: Relative size of a column of R at an event below which a direction is lost, as in an entry to sliding.
_LOST = 1e-12

#: Largest ratio of the growths of two columns on a leg; beyond it rounding spoils the smaller one, and the
#: leg is divided.
_RATIO = 1e6

#: Tolerance of the sum of the logarithms of growths at an event, which is that of its determinant.
_MISSED = 1e-6

#: Derivatives beyond which a run diverges.
_HUGE = 1e100

#: Size of the last state, relative to the first or 1, beyond which a run diverges.
_FAR = 1e6

#: Blocks of equal length for the standard errors.
_BLOCKS = 32


@dataclass(frozen=True, eq=False, repr=False)
class LyapunovSpectrum(
    Savable, exponents="k nan", errors="k nan", blocks="b k nan", sum_check="nan"
):
    """Lyapunov exponents, the largest first.

    Attributes
    ----------
    exponents : ndarray (k,)
        Per unit time; ``-inf`` for directions that are lost (an entry to sliding, an impact without
        rebound), in which neighbours coincide after a finite time.
    errors : ndarray (k,)
        Standard errors of the means, from ``blocks``, without correlations longer than a block.
    blocks : ndarray (b, k)
        Exponents of consecutive parts of equal length.
    t : float
        Length of the run without the transient.
    sum_check : float
        The sum of the exponents by another method: the mean of the divergence of the field and of
        ``log abs(det)`` of the saltation matrices. NaN where directions were lost, ``k`` is less than
        n, or the divergence is not known.
    complete : bool
        False if the computation was interrupted, and used a shorter run.
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
        each = ", ".join(f"{e:.6g}" + (f" +- {s:.1g}" if s else "") for e, s in values)
        cut = "" if self.complete else ", interrupted"
        return f"LyapunovSpectrum({each}; over t = {self.t:g}{cut})"


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
        End of the run. Errors fall as the square root of the length of a chaotic run.
    transient : float, optional
        Time at the beginning that is left out, in which the directions align; a tenth of the run by
        default.
    k : int, optional
        Number of exponents, the largest; all n by default.
    t_start, parameters, tol, rtol, atol : optional
        As in :func:`simulate`.
    progress : bool, optional
        Whether to show a progress bar for long runs on a terminal.

    Returns
    -------
    LyapunovSpectrum
        Explicit time and discrete states have no exponent; the phase of a :class:`Clock` has the exponent 0. After Ctrl-C the
        exponents are those of the run so far.

    Raises
    ------
    DegenerateError
        The run ends early, grazes a surface, or meets two at one instant.
    DefinitionError
        ``system`` is not a FilippovSystem, or has vector multipliers.
    PointError
        A start of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        More exponents than states; a time out of its range.

    Notes
    -----
    Benettin et al. 1980; through events Mueller 1995 (Chaos, Solitons & Fractals 5, 1671). At an event
    where columns become dependent the last of them is lost.

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
    require_system(system, complementarity=True)
    n = system.dimension - len(system.definition.discrete)
    count = n if k is None else whole(k, "k")
    if count > n:
        moving = " that move" if system.definition.discrete else ""
        raise OptionError(f"k = {k}, but the system has {n} states{moving}. Give at most that.")
    t_start, t_end = real(t_start, "t_start"), real(t_end, "t_end")
    wait = (t_end - t_start) / 10 if transient is None else real(transient, "transient", low=0.0)
    if not t_start + wait < t_end:
        raise OptionError(
            f"t_end = {t_end!r} is not after t_start + transient = {t_start + wait:g}. Give a later time."
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
    """Message for a run that ended early, with its last state where it diverges."""
    size = float(np.abs(run.x[-1]).max())
    away = not size < _FAR * max(1.0, float(np.abs(run.x[0]).max()))
    last = f"The run diverges: its last state is {run.x[-1].tolist()}. " if away else ""
    return (
        f"t_end = {t_end:g}, but the run ended at t = {run.t[-1]:.10g} with status {run.status}. "
        f"{last}{run.message}"
    )


class _Frame:
    """Orthonormal directions along a run, and the logarithms of their growth."""

    def __init__(self, run: Trajectory, count: int, begin: float):
        self.run, self.system = run, run.system
        self.n = self.system.dimension - len(self.system.definition.discrete)
        # Directions in general position: coordinate axes may lie in invariant subspaces.
        self.q = np.linalg.qr(np.random.default_rng(0).normal(size=(self.n, count)))[0]
        self.bounds = np.linspace(begin, float(run.t[-1]), _BLOCKS + 1)
        self.logs = np.zeros((_BLOCKS, count))
        self.volume, self.t = 0.0, float(run.t[0])

    def follow(self, progress: bool) -> LyapunovSpectrum:
        """Follow the run and return its exponents."""
        parts = stretches(self.run, driven=True)
        limits = {found.points[0]: i for i, (found, _) in limits_of(parts).items()}
        bar = progress_bar(len(parts), progress, "leg")
        complete, j = True, 0
        try:
            while j < len(parts):
                i = limits.get(j, j)
                if i > j:
                    self._limit(parts, j, i)
                else:
                    flow = self._leg(parts[j])
                    following = parts[j + 1] if j + 1 < len(parts) else None
                    self._event(parts[j], flow, following)
                bar.update(i + 1 - j)
                j = i + 1
        except KeyboardInterrupt:
            complete = False
            if self.t <= self.bounds[1]:
                raise  # not one block is complete
        finally:
            bar.close()
        return self._spectrum(complete)

    def _leg(self, part: Stretch) -> LegFlow:
        """Integrate a leg in pieces that end at the bounds of blocks."""
        end = part.t + part.duration
        inner = self.bounds[(self.bounds > part.t) & (self.bounds < end)].tolist()
        cuts = [*inner, end]
        x, t = part.start, part.t
        for cut in cuts:
            flow = self._piece(part, x, t, cut - t, 0)
            x, t = flow.end[: len(x)], cut
        self.t = end
        return flow

    def _piece(self, part: Stretch, x: Array, t: float, duration: float, depth: int) -> LegFlow:
        flow = carry_leg(part.system, part.leg, x, duration, part.p)
        if not self.q.shape[1]:
            return flow
        q, r = np.linalg.qr(flow.by_start[: self.n, : self.n] @ self.q)
        growth = np.abs(np.diag(r))
        if depth < 40 and not _resolved(growth):
            half = self._piece(part, x, t, duration / 2, depth + 1)
            return self._piece(part, half.end[: len(x)], t + duration / 2, duration / 2, depth + 1)
        self._count(q, growth, t + duration / 2)
        if t >= self.bounds[0] and self.q.shape[1] == self.n:
            self.volume += self._divergence(part, t, duration)
        return flow

    def _event(self, part: Stretch, flow: LegFlow, following: Stretch | None) -> None:
        event = saltation_after(self.run, part, flow, following, None)
        if event is None or part.leg.kind == "end" or not self.q.shape[1]:
            return
        self._lose(event.matrix[: self.n, : self.n], part, self.t)

    def _lose(self, matrix: Array, part: Stretch, end: float) -> None:
        """Apply the matrix (n, n) of an event, or of what happens until ``end``, at which directions may be lost."""
        if not np.abs(matrix).max() < _HUGE:
            raise self._diverging(matrix, part)
        q, r = np.linalg.qr(matrix @ self.q)
        growth = np.abs(np.diag(r))
        kept = growth > _LOST * np.linalg.norm(matrix)
        if not kept.all() and _regular(matrix):  # below rounding, but not lost
            q, growth = self._spread(matrix, part)
            kept = np.full(growth.shape, True)
        if self._block(self.t) >= 0:
            size = abs(float(np.linalg.det(matrix)))
            self.volume += math.log(size) if kept.all() and size else math.nan
        if end == self.t:
            self._count(q[:, kept], growth[kept], end)
            return
        parts_of = np.diff(np.clip(self.bounds, self.t, end)) / (end - self.t)
        self.logs[:, : kept.sum()] += np.outer(parts_of, np.log(growth[kept]))
        self.q, self.t = q[:, kept], end

    def _limit(self, parts: Sequence[Stretch], first: int, i: int) -> None:
        """Follow directions from leg ``first`` to the limit of events that ends leg i, where some are lost."""
        width = len(parts[first].start)
        found = passages_to(self.run, parts, i, first)
        *_, (_, _, _, (matrix, _)) = carried(found[:-1], np.eye(width), np.zeros((width, 0)), ())
        self._lose(matrix[: self.n, : self.n], parts[i], parts[i].t + parts[i].duration)

    def _spread(self, matrix: Array, part: Stretch) -> tuple[Array, Array]:
        """Directions and growths at a regular event, some below the rounding of QR."""
        found = _spread(matrix, self.q)
        if found is None:
            raise self._diverging(matrix, part)
        return found

    def _diverging(self, matrix: Array, part: Stretch) -> DegenerateError:
        return DegenerateError(
            f"{part.shown.name(self.system)!r} at t = {self.t:.10g} has derivatives up to {np.abs(matrix).max():.2g}, too "
            f"large to resolve the other directions. The run diverges, or its states need other units: the "
            f"last one is {part.end[: self.n].tolist()}."
        )

    def _count(self, q: Array, growth: Array, t: float) -> None:
        self.q = q
        block = self._block(t)
        if block >= 0:
            self.logs[block, : len(growth)] += np.log(growth)

    def _block(self, t: float) -> int:
        """Number of the block of a time, its end included; negative before the first."""
        found = np.searchsorted(self.bounds, t - AT_END * max(1.0, abs(t)), side="left")
        return min(int(found) - 1, _BLOCKS - 1)

    def _divergence(self, part: Stretch, t: float, duration: float) -> float:
        """Integral of the divergence of a mode's field along the run, by Gauss's rule on each step."""
        run, system, mode = self.run, part.system, part.leg.mode
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
        values = np.array(function(x.T, part.p)).reshape(-1, 8)
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
    """Directions after a regular map and growths, also of a ratio below rounding; None if unresolved."""
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
    """Whether a square matrix has an inverse, in any units of its rows and columns."""
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
