"""Lyapunov exponents of a run by QR decompositions of state-transition and saltation matrices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...flow.constants import AT_END
from ...flow.engine.columns import carry_frame
from ...flow.ensembles.progress import progress_bar
from ...flow.fixed import TOLERANCE
from ...flow.options import tolerances
from ...flow.saving import Savable
from ...flow.simulate import simulate
from ...flow.status import Status
from ...flow.trajectory import Trajectory
from ...flow.variation import ROUNDING, Precision
from ...model import (
    Array,
    DegenerateError,
    FilippovSystem,
    OptionError,
    Parameters,
    mode_field,
    real,
    require_plain,
    require_system,
    whole,
)
from ...result_tables import ResultTable
from .legs import Leg, LegFlow, Stretch, stretches
from .limits import limits_of
from .saltation import Saltation
from .variation import beginning_of, carried, flows_over, passages_over, passages_to

#: Relative size of a column of R at an event below which a direction is lost, as in an entry to sliding.
_LOST = 1e-12

#: Rounding of an entry of a saltation matrix, relative to its terms.
_ROUNDED = 16.0 * float(np.finfo(float).eps)

#: Largest ratio of the growths of two directions on a piece of a leg; beyond it rounding spoils the smaller one.
_RATIO = 1e6

#: The condition from which on derivatives along a leg begin anew, their tolerance as a part of the run's, and the
#: largest ratio then: the smaller direction has the product of ratio and tolerance as its error.
_APART, _OF_RUN, _LOOSE_RATIO = 1e2, 1e-3, 1e4

#: Steps of the run in a piece of a leg, and pieces that are carried in one call.
_STEPS, _AT_A_TIME = 256, 64

#: Gauss's rule for each step of a run.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)

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

    def _tables(self) -> dict[str, ResultTable]:
        columns = {"exponent": self.exponents, "error": self.errors}
        blocks = {"exponent": ("direction", self.blocks)}
        return {
            "directions": ResultTable({"direction": len(self.exponents)}, columns),
            "blocks": ResultTable({"block": len(self.blocks)}, blocks),
        }

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
        Of which an attractor is reached from the start.
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
        ``system`` is not a FilippovSystem, or has vector multipliers beside rules.
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
    require_system(system, sets=True, complementarity=True)
    if system.sets:
        require_plain(system, "lyapunov_spectrum with sets")
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
    return _Frame(run, count, t_start + wait, rtol).follow(progress)


def _ended(run: Trajectory, t_end: float) -> str:
    """Message for a run that ended early, with its last state where it diverges."""
    size = float(np.abs(run.x[-1]).max())
    away = not size < _FAR * max(1.0, float(np.abs(run.x[0]).max()))
    last = f"The run diverges: its last state is {run.x[-1].tolist()}. " if away else ""
    return (
        f"t_end = {t_end:g}, but the run ended at t = {run.t[-1]:.10g} with status {run.status}. "
        f"{last}{run.message}"
    )


class _Link(NamedTuple):
    """Derivatives (n, n) over a part of a leg, or of an event at its end, which takes no time."""

    part: Stretch
    matrix: Array
    begin: float
    end: float


class _Frame:
    """Orthonormal directions along a run, and the logarithms of their growth."""

    def __init__(self, run: Trajectory, count: int, begin: float, rtol: float):
        self.run, self.system = run, run.system
        self.n = self.system.dimension - len(self.system.definition.discrete)
        # Directions in general position: coordinate axes may lie in invariant subspaces.
        self.q = np.linalg.qr(np.random.default_rng(0).normal(size=(self.n, count)))[0]
        self.bounds = np.linspace(begin, float(run.t[-1]), _BLOCKS + 1)
        self.logs = np.zeros((_BLOCKS, count))
        self.volume, self.rate, self.t = 0.0, 0.0, float(run.t[0])
        loose = Precision(max(TOLERANCE, _OF_RUN * rtol), _APART)
        self.precision = ROUNDING if self.system.sets else loose

    def follow(self, progress: bool) -> LyapunovSpectrum:
        """Follow the run and return its exponents."""
        parts = stretches(self.run, driven=True)
        limits = {found.points[0]: i for i, (found, _) in limits_of(parts).items()}
        bar = progress_bar(len(parts), progress, "leg")
        complete, j, whole = True, 0, self._whole(parts)
        try:
            while j < len(parts):
                end = limits.get(j, j) + 1
                if j in limits:
                    self._limit(parts, j, end - 1)
                else:
                    own = list(self._pieces(parts[j], whole[j]))
                    while end < len(parts) and end not in limits and len(own) < _AT_A_TIME:
                        own += self._pieces(parts[end], whole[end])
                        end += 1
                    self._follow_pieces(own, parts[end] if end < len(parts) else None)
                bar.update(end - j)
                j = end
        except KeyboardInterrupt:
            complete = False
            if self.t <= self.bounds[1]:
                raise  # not one block is complete
        finally:
            bar.close()
        return self._spectrum(complete)

    def _whole(self, parts: Sequence[Stretch]) -> list[bool]:
        """Which legs have few steps and no bound of a block inside."""
        spans = np.array([(part.t, part.t + part.duration) for part in parts]).T
        inside = [
            np.searchsorted(times, spans[1]) - np.searchsorted(times, spans[0], side="right")
            for times in (self.run.steps.starts, self.bounds)
        ]
        found: list[bool] = ((inside[0] < _STEPS) & (inside[1] <= 0)).tolist()
        return found

    def _pieces(self, part: Stretch, whole: bool) -> Sequence[Stretch]:
        """Pieces of a leg that end at the bounds of blocks and after some steps of the run."""
        if whole and not part.system.sets:
            return (part,)
        rate = self.rate if part.system.sets else 0.0  # others are divided as they are carried
        pieces = self._cut(part, np.union1d(self.bounds, self._inner(part, rate)))
        return [beginning_of(part), *pieces] if part.system.sets else pieces

    def _inner(self, part: Stretch, rate: float) -> Array:
        """Times inside a leg between which directions grow apart by no more than ``_RATIO``, if so at a ``rate``: ends of
        steps of the run as far as they suffice."""
        starts, end = self.run.steps.starts, part.t + part.duration
        first = int(np.searchsorted(starts, part.t, side="right"))
        steps = starts[first : np.searchsorted(starts, end)]
        count = math.ceil(rate * part.duration / math.log(_RATIO))
        count = max(1, count, len(steps) // _STEPS + 1)
        if count <= len(steps):
            return steps[np.arange(1, count) * len(steps) // count]
        return np.union1d(steps, np.linspace(part.t, end, count + 1)) if count > 1 else steps[:0]

    def _cut(self, part: Stretch, times: Array) -> list[Stretch]:
        """A leg cut at those of some times that are inside."""
        end = part.t + part.duration
        times = times[(times > part.t) & (times < end)]
        if not len(times):
            return [part]
        x = self.run(times)
        if len(part.start) > x.shape[1]:
            x = np.column_stack([x, times])
        edges, states = [part.t, *times.tolist(), end], [part.start, *x, part.end]
        pieces = list[Stretch]()
        for k in range(len(times) + 1):
            leg, after = (part.leg, part.after) if k == len(times) else (Leg(part.leg.mode), x[k])
            leg = replace(leg, left=() if k else part.leg.left)
            duration, span = edges[k + 1] - edges[k], states[k : k + 2]
            own = replace(part, leg=leg, t=edges[k], duration=duration, start=span[0], end=span[1])
            pieces.append(replace(own, after=after))
        return pieces

    def _follow_pieces(self, pieces: Sequence[Stretch], following: Stretch | None) -> None:
        """Carry directions over pieces of legs and through the events between them."""
        after = [] if following is None else [beginning_of(following)]
        found = passages_over(self.run, [*pieces, *after], precision=self.precision)[: len(pieces)]
        maps = iter(_cleaned([one.event for one in found if one.event is not None], self.n))
        links = list[_Link]()
        for one in found:
            links += self._links(one.stretch, one.flow)
            if one.event is not None:
                end = one.stretch.t + one.stretch.duration
                links.append(_Link(one.stretch, next(maps), end, end))
        self._follow(links, _LOOSE_RATIO if self.precision.ratio else _RATIO)
        if self.q.shape[1] == self.n:
            self._add_divergence(pieces)

    def _links(self, part: Stretch, flow: LegFlow) -> list[_Link]:
        """Derivatives of a piece of a leg, divided where one direction grows so much more that another is lost in it."""
        since, matrices = flow.parts
        edges = [part.t, *(part.t + since).tolist(), part.t + part.duration]
        own = zip([*matrices, flow.by_start], edges, edges[1:], strict=False)
        return [_Link(part, a[: self.n, : self.n], begin, end) for a, begin, end in own]

    def _follow(self, links: Sequence[_Link], most: float) -> None:
        """Carry directions over derivatives, in which they may grow apart by a ratio."""
        if not (links and self.q.shape[1]):
            return
        matrices = np.array([link.matrix for link in links])
        spans = np.array([link[2:] for link in links])
        i = 0
        while i < len(links) and self.q.shape[1]:
            i += self._follow_regular(matrices[i:], spans[i:], most)
            if i < len(links) and self.q.shape[1]:
                self._follow_one(links[i], most)
                i += 1

    def _follow_regular(self, matrices: Array, spans: Array, most: float) -> int:
        """Carry directions until they grow apart, or one may be lost; by how many matrices."""
        q, growth = carry_frame(matrices, self.q)
        begin, end = spans.T
        moves, least, largest = begin < end, growth.min(axis=1), growth.max(axis=1)
        with np.errstate(all="ignore"):
            apart = np.where(least > 0.0, np.log(largest / least), math.inf)
            size = np.abs(matrices).max(axis=(1, 2))
            is_kept = (least > _LOST * np.linalg.norm(matrices, axis=(1, 2))) & (size < _HUGE)
        regular = np.where(moves, apart <= math.log(most), is_kept) & np.isfinite(growth).all(
            axis=1
        )
        count = len(regular) if regular.all() else int(regular.argmin())
        if not count:
            return 0
        blocks, flows = self._blocks((begin + end)[:count] / 2), np.flatnonzero(moves[:count])
        counted = blocks >= 0
        np.add.at(self.logs[:, : growth.shape[1]], blocks[counted], np.log(growth[:count][counted]))
        events = counted & ~moves[:count]
        with np.errstate(divide="ignore"):
            sizes = np.log(np.abs(np.linalg.det(matrices[:count][events])))
        self.volume += float(np.where(np.isfinite(sizes), sizes, math.nan).sum())
        self.q = q[count - 1]
        if len(flows):
            last = flows[-1]
            self.t, self.rate = float(end[last]), float(apart[last] / (end[last] - begin[last]))
        return count

    def _follow_one(self, link: _Link, most: float) -> None:
        """Carry directions that grow apart, or of which some are lost."""
        part, matrix, begin, end = link
        if not begin < end:
            self._lose(matrix, part, self.t)
            return
        q, r = np.linalg.qr(matrix @ self.q)
        growth = np.abs(r.diagonal())
        least, largest = float(growth.min()), float(growth.max())
        finite = math.isfinite(largest) and least > 0.0
        spread = math.log(largest / least) if finite else math.log(_HUGE)
        self.rate = spread / (end - begin)
        if spread > math.log(most) and (finite or not part.system.sets):
            own = next(one for one in self._cut(part, np.array([begin, end])) if one.t == begin)
            pieces = self._cut(own, self._inner(own, self.rate))
            for piece, flow in zip(pieces, flows_over(self.run, pieces), strict=True):
                self._follow(self._links(piece, flow), _RATIO)
        elif part.system.sets and not least > _LOST * largest:
            self._lose(matrix, part, self.t)  # a set is reached at its end
        else:
            self._count(q, growth, (begin + end) / 2)
        self.t = end

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
        return int(self._blocks(np.array([t]))[0])

    def _blocks(self, t: Array) -> NDArray[np.int64]:
        """The same of many times."""
        found = np.searchsorted(self.bounds, t - AT_END * np.maximum(1.0, np.abs(t)))
        return np.minimum(found - 1, _BLOCKS - 1)

    def _add_divergence(self, pieces: Sequence[Stretch]) -> None:
        """Add the integral of the divergence of the fields along legs, by Gauss's rule on each step."""
        kinds = dict[str, list[Stretch]]()
        for part in pieces:
            if part.t >= self.bounds[0] and part.duration:
                kinds.setdefault(part.leg.mode, []).append(part)
        for mode, parts in kinds.items():
            system = parts[0].system
            unknown = system.sets or len(mode) > system.surface_count or mode.count("s") > 1
            if unknown or any(system.nonlinear):
                self.volume = math.nan
                return
            divergence = self._divergence(system, mode)
            spans = np.array([(part.t, part.t + part.duration) for part in parts])
            if divergence.jac_sparsity(0, 0).nnz() == 0:
                value = float(divergence(parts[0].start, parts[0].p))
                self.volume += value * float((spans[:, 1] - spans[:, 0]).sum())
                continue
            low, half = self._steps_in(spans)
            times = (low[:, None] + half[:, None] * (1.0 + _NODES)).ravel()
            x = self.run(times)
            if system.time_dependent:
                x = np.column_stack([x, times])
            values = np.array(divergence(x.T, parts[0].p)).reshape(-1, 8)
            self.volume += float(half @ (values @ _WEIGHTS))

    def _steps_in(self, spans: Array) -> tuple[Array, Array]:
        """Beginnings and half lengths of the steps of the run, and of their parts, within spans of time (m, 2) in order."""
        starts = self.run.steps.starts
        first, last = np.searchsorted(starts, (spans[0, 0], spans[-1, 1]))
        edges = np.unique([*spans.ravel(), *starts[first:last]])
        low, high = edges[:-1], edges[1:]
        inside = low < spans[np.searchsorted(spans[:, 0], low, side="right") - 1, 1]
        return low[inside], ((high - low) / 2)[inside]

    def _divergence(self, system: FilippovSystem, mode: str) -> Any:
        def build() -> list[object]:
            field = mode_field(system, mode)
            return [sum(system.gradient(field[i])[i] for i in range(self.n))]

        return system.function(("divergence", mode), build)

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


def _cleaned(events: Sequence[Saltation], n: int) -> Array:
    """Saltation matrices (m, n, n) with zeros where their terms cancel to rounding."""
    maps = np.array([event.after_state[:n, :n] for event in events]).reshape(-1, n, n)
    jumps = np.array([event.jump[:n] for event in events]).reshape(-1, n, 1)
    times = np.array([event.time_by_state[:n] for event in events]).reshape(-1, 1, n)
    kept = np.array([event.kept for event in events], bool).reshape(-1, 1, 1)
    moved = jumps * times
    found = maps - np.where(kept, 0.0, moved)
    return np.where(np.abs(found) > _ROUNDED * (np.abs(maps) + np.abs(moved)), found, 0.0)


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
