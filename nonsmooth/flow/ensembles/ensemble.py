"""Integration of many trajectories, from arrays of starts and parameters."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ...model import FilippovSystem, OptionError, require_system
from ..constants import KINDS
from ..engine.building.codegen import has_driven_events
from ..engine.building.compilers import ADVICE, CompilerError, find_compiler
from ..engine.interpreter import interpreter_for, library
from ..engine.lanes import can_sample, lanes_for
from ..options import Options
from ..other_names import hinted
from ..results import Chunk, Collected, Ensemble
from ..section import KINDS_OF_SECTIONS, read_sampling, sectioned
from ..warn import warn_once
from .chunks import Job
from .lazy_starts import LazyStarts
from .on_device import CHUNK, device_chunk, require_device, run_on_device
from .starts import Starts, require_start
from .store import Store
from .work import Work, checked_work, run_all, size_of_chunk

#: Below so many trajectories the engine that runs several in step is not compiled; the second number is for
#: systems with a set, which take longer to compile.
_FEW, _FEW_WITH_SETS = 64, 4000

#: Least time of an ensemble in the driver, in seconds by estimate, for which lanes are compiled.
_WORTH = 0.05

#: This many times as long where the driver makes events, as lanes gain less.
_WITH_EVENTS = 20.0

#: Largest size of a program that is compiled in a few seconds; the time of others grows as the square of their size.
_USUAL = 600

#: The work of at least this many trajectories is estimated from three of them, of fewer from one.
_MANY = 100_000


@hinted
def ensemble(
    system: FilippovSystem,
    x0: ArrayLike | LazyStarts,
    t_end: float,
    *,
    t_start: float = 0.0,
    parameters: Mapping[Any, ArrayLike] | None = None,
    tol: float = 1e-10,
    rtol: float | None = None,
    atol: float | None = None,
    start_mode: str | None = None,
    max_step: float = math.inf,
    max_steps: int = 1_000_000,
    max_events: int = 100_000,
    max_jumps: int = 1_000,
    rest_below: float | None = None,
    at_event: tuple[str, int] | None = None,
    t_eval: ArrayLike | None = None,
    at: Any = None,
    work: Work | None = None,
    device: str | None = None,
    method: str = "auto",
) -> Ensemble:
    """Integrate many trajectories and keep their ends.

    Parameters
    ----------
    system : FilippovSystem
        As for :func:`simulate`.
    x0 : array_like (..., n), Grid or RandomStarts
        Starts. Those that are not finite get the status NOT_FINITE; the others run.
    t_end : float
        Time at which every run ends, unless something ends it before.
    t_start : float, optional
        Time at which every run starts; default 0.
    parameters : mapping, optional
        Values that replace defaults: numbers, or arrays that broadcast with the starts.
    tol, rtol, atol, start_mode, max_step, max_steps, max_events, max_jumps, rest_below, method : optional
        As in :func:`simulate`; a start on another side than that of ``start_mode`` gets the status
        NON_UNIQUE.
    at_event : (kind, k), optional
        Keep the state at the k-th event (from 1) of a kind, e.g. ``("crossing", 1)``.
    t_eval : array_like (K,), optional
        Keep the states at these times, sorted, in ``sample_t`` and ``sample_x``.
    at : Section, str, number or expression, optional
        Keep the states at a section; one at events needs a ``count``. See :class:`Section`.
    work : Work, optional
        Threads or an executor, size of a chunk, progress bar, store; see :class:`Work`.
    device : {None, "cuda"}, optional
        ``"cuda"`` runs on an NVIDIA card; steps that it cannot decide fall back to the CPU. It needs the
        packages of ``nonsmooth-dynamics[cuda]``, and a system of at most one surface without resets and contacts.

    Returns
    -------
    Ensemble
        Independent of ``work`` to the last bit.

    Raises
    ------
    PointError
        Starts whose last axis has not the length n, or that do not broadcast with the parameters.
    ParameterError
        An unknown parameter, or one without a value.
    OptionError
        A tolerance, a limit, a time or a section out of its range.
    DefinitionError
        ``system`` is none; a ``start_mode`` that it does not have.
    CompilerError
        The driver in C is not compiled, and there is no C compiler.
    DeviceError
        ``device="cuda"`` without a card, its driver or the packages.

    Examples
    --------
    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x = ca.SX.sym("x")
    >>> system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
    >>> many = ns.ensemble(system, np.array([[-1.0], [0.5], [np.nan]]), t_end=0.4)
    >>> many.itinerary.tolist(), [str(ns.Status(s)) for s in many.status]
    (['- s', '+', ''], ['REACHED_END', 'REACHED_END', 'NOT_FINITE'])
    """
    options = Options.of(locals())
    require_system(system, sets=True, hysteresis=True, complementarity=True, joints=True)
    work = checked_work(work)
    if start_mode is not None:
        system.require_mode(start_mode)
    system, at = sectioned(system, at)
    starts = Starts(system, x0, parameters, t_start)
    number = _event_number(at_event)
    if system.definition.discrete or system.definition.clocks:
        for first in range(0, starts.count, CHUNK):
            require_start(system, *starts.part(first, min(first + CHUNK, starts.count)))
    p = starts.p if at is None else starts.every_parameter()
    sampling = read_sampling(system, t_eval, at, options.t_start, options.t_end, p)
    if sampling.hits is not None:
        options = replace(options, hits=sampling.hits)
    if options.hits is not None and sampling.room is None:
        raise OptionError(
            "at is a section at events without a count, which an ensemble needs. Give "
            "at=nonsmooth.Section(..., count=100) to keep up to 100 states of each run."
        )
    step = sampling.room is None or can_sample(system, sampling.hits)
    step = step and t_end > t_start and device is None
    chosen = engine_for(system, options, starts, step)
    job = Job(system, options, number, sampling.times, sampling.room, chosen)
    return _run(job, starts, work, device)


def _run(job: Job, starts: Starts, work: Work, device: str | None) -> Ensemble:
    system, count = starts.system, starts.count
    if device is not None:
        require_device(job, device, work.executor is not None)
    away = (
        None
        if device is None
        else lambda first, out: run_on_device(job, device, starts, first, out, work.workers)
    )
    none = Chunk.empty(0, system, job.at is not None, job.room)
    most = work.largest(none.row_size)
    size = lambda: (
        work.chunk
        or (device_chunk(system) if away else size_of_chunk(job, starts, work.workers, most))
    )
    collected = lambda arrays: Collected(system, starts.shape, job.at is not None, job.room, arrays)
    if work.store is None:
        results = collected(None)
        run_all(job, starts, results, work, size(), None, away)
        return results.ensemble(job.engine if away is None else str(device))
    store = Store(work.store, _problem(system, starts, job, device))
    with store.opened(size):
        results, codes = collected(store.arrays(none, count)), store.codes(count)
        run_all(job, starts, results, work, store.chunk, store, away)
        return results.ensemble(job.engine if away is None else str(device), codes)


def engine_for(system: FilippovSystem, options: Options, starts: Starts, step: bool) -> str:
    """Return the engine of all chunks, ``lanes`` or ``core``, compiled here so that all use the same."""
    lanes = lanes_for(system, options) if step else None
    enough = starts.count >= (_FEW_WITH_SETS if system.sets else _FEW)
    if lanes is not None and enough and _is_worth_lanes(system, options, starts):
        try:
            if find_compiler() is not None and lanes.library:
                return "lanes"
        except CompilerError as error:
            warn_once(
                f"{error.brief or error} Several trajectories in step need a compiler. {ADVICE}"
            )
    library()
    return "core"


def _is_worth_lanes(system: FilippovSystem, options: Options, starts: Starts) -> bool:
    """Whether the runs take long one by one, and none takes implicit steps, which lanes do not have."""
    engine, last = interpreter_for(system, options), starts.count - 1
    probed, found = [last // 2] if last < _MANY else [0, last // 2, last], list[float]()
    for first in probed:
        x, p = starts.part(first, first + 1)
        seconds = engine.seconds(x[0], p[0] if p.ndim > 1 else p, options)
        if seconds is None:
            return False
        found.append(seconds)
    least = _WORTH * (_WITH_EVENTS if has_driven_events(system) else 1.0)
    return starts.count * max(found) >= least * max(1.0, engine.size / _USUAL) ** 2


def _event_number(at_event: tuple[str, int] | None) -> tuple[int, int] | None:
    if at_event is None:
        return None
    try:
        kind, count = at_event
        if kind in KINDS_OF_SECTIONS and int(count) == count and count >= 1:
            return KINDS.index(kind), int(count)
    except (TypeError, ValueError):
        pass
    raise OptionError(
        f"at_event is {at_event!r}. Give (kind, k) with a kind of {KINDS_OF_SECTIONS} and k from 1, for "
        'example ("crossing", 1). The ends of all runs are x of the result.'
    )


def _problem(system: FilippovSystem, starts: Starts, job: Job, device: str | None) -> str:
    code = hashlib.sha256(system.content_hash().encode())
    engine = job.engine if device is None else (job.engine, device)
    code.update(repr((job.options, job.at, job.times, engine)).encode())
    code.update(starts.digest().encode())
    return code.hexdigest()
