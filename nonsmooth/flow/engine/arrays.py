"""What Python and the drivers in C share: options and batches, a run as arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem, Guard
from ..constants import GUARDS, KINDS, METHODS
from ..options import Options
from ..results import Chunk
from ..section import Hits
from .structures import structure

#: Steps of one call of C; between calls Python hears Ctrl-C and requests to stop.
BURST = 4096


class Happened(NamedTuple):
    """Events and segments of a run as arrays.

    Attributes
    ----------
    event_t, event_rows, event_jumps : ndarray (e + 1,)
        Events, and the end of the run: time, row of the state in ``states``, whether the state after it is the
        next row.
    event_codes, keys : ndarray (e + 1,), sequence of tuple
        What an event is, as a position in the keys (the end is after them): kind (position in
        ``facts.KINDS``), modes before and after, guard (``guard_of``) or -1.
    states : ndarray
        The points of the run, then what else is the state of an event.
    event_motions : ndarray (e, w)
        What a restart after each event needs; empty without dense output.
    segment_modes, segment_starts : ndarray (k,), (k + 1,)
        Segments: numbers of their modes, and times at which they begin, and the last one ends.
    segment_firsts : ndarray (k,)
        Numbers of the first steps of the segments; zero without dense output.
    """

    event_t: Array
    event_rows: NDArray[np.int64]
    event_jumps: NDArray[np.bool_]
    event_codes: NDArray[np.int32]
    event_motions: Array
    segment_modes: NDArray[np.int32]
    segment_starts: Array
    segment_firsts: NDArray[np.int64]
    states: Array
    keys: Sequence[tuple[int, ...]]


@dataclass
class Run:
    """One run as arrays.

    Attributes
    ----------
    status : int
        A Status.
    reason, where : int
        Why, for the message (see ``facts.REASONS``): a surface, a stop.
    mode : int
        Last mode.
    limit : float
        Accumulation time or NaN.
    letters : sequence of str
        Modes by number.
    active : list of int
        Surfaces and contacts at the last point that was decided.
    several : list of str
        Modes that could continue there, where more than one could.
    rates : ndarray (k, n)
        Rates of the states in them.
    facts : int
        What was noted about the decisions, as bits.
    t_error : float
        Largest error of the time of an event that rounding hides; see ``Facts``.
    unmet : int
        A stop or reset, in this order, that was true at the start and did not happen, or -1.
    implicit_steps : int
        How many steps were implicit.
    t, x : ndarray (m,), (m, n)
        Points: start, steps and events; a reset appears twice.
    motion : ndarray (w,)
        What a restart at the end needs besides the state.
    dense : bool
        Whether the following were kept.
    starts, coefficients, implicit : ndarray (s,), (s, N, P+1), (s,)
        Steps: start times, coefficients of the states, whether they are implicit.
    sample_x : ndarray (K, n)
        States at the times before the end at which the run was to be read, unless it is dense.
    event_count : int
        Number of events but the end.
    make_happened : callable
        Makes events and segments when they are first read.
    few : mapping or None
        What the driver wrote, by name, if events and steps are few.
    labels : sequence of tuple
        Values of the discrete states by number of mode; empty without any.
    """

    status: int
    reason: int
    where: int
    mode: int
    limit: float
    letters: Sequence[str]
    active: list[int]
    several: list[str]
    rates: Array
    facts: int
    t_error: float
    unmet: int
    implicit_steps: int
    t: Array
    x: Array
    motion: Array
    labels: Sequence[tuple[float, ...]]
    dense: bool
    starts: Array
    coefficients: Array
    implicit: NDArray[np.bool_]
    sample_x: Array
    event_count: int
    make_happened: Callable[[], Happened]
    few: Mapping[str, NDArray[Any]] | None

    @cached_property
    def happened(self) -> Happened:
        """Events and segments."""
        return self.make_happened()

    def each(self) -> list[tuple[int, float, Array]]:
        """Guard, time and state of each event but the end."""
        if self.few is not None:
            rows, t, x = (self.few[f"event_{name}"] for name in ("guard", "t", "x"))
            return [*zip(rows.tolist(), t.tolist(), x, strict=True)]
        found = self.happened
        guards = [found.keys[code][-1] for code in found.event_codes[:-1]]
        states = found.states[found.event_rows[:-1]]
        return [*zip(guards, found.event_t.tolist()[:-1], states, strict=True)]


def guard_of(system: FilippovSystem, code: int) -> Guard:
    """Read a guard as C writes it: its index, its side plus one in two bits, its kind in four."""
    kind, side, i, m = GUARDS[code & 15], (code >> 4 & 3) - 1, code >> 6, system.surface_count
    if kind in ("stop", "reset"):
        return Guard(kind, i, (system.stops if kind == "stop" else system.resets)[i][1], i)
    if kind in ("impact", "release") and i >= m:
        return Guard(kind, i - m, side, len(system.entries) + i - m)
    return Guard(kind, i, 0 if kind == "branch" else side, system.entry_of(i))


def address(a: NDArray[Any] | None) -> int | None:
    """Return where an array begins."""
    if a is None:
        return None
    try:  # a quarter of the time that ``a.ctypes`` takes
        return ctypes.addressof(ctypes.c_char.from_buffer(a.data))
    except (TypeError, ValueError):  # read only, with gaps, or empty
        return a.ctypes.data


def options_of(
    system: FilippovSystem,
    o: Options,
    dense: bool,
    at: tuple[int, int] | None = None,
    start_mode: int = -1,
) -> ctypes.Structure:
    """Options as C reads them; the start's mode by its number."""
    kind, count = at or (-1, 0)
    limit = 2**62  # no run has so many events
    made: Any = structure("Options")(
        o.t_end,
        o.rtol,
        o.atol,
        o.max_step,
        o.rest_below or 0.0,
        int(min(o.max_steps, limit)),
        int(min(o.max_events, limit)),
        int(min(o.max_jumps, limit)),
        start_mode,
        kind,
        min(count, limit),
        int(dense),
    )
    made.method = METHODS.index(o.method)
    made.hit_every = 1
    if o.hits is not None:
        named = _named(system, o.hits)
        made.kept = (named,)
        made.hit_named, made.hit_width = address(named), named.shape[1]
        made.hit_after, last = int(o.hits.after), o.hits.last
        made.hit_skip, made.hit_every = min(o.hits.skip, limit), min(o.hits.every, limit)
        made.hit_kinds = sum(1 << i for i, kind in enumerate(KINDS) if kind in o.hits.kinds)
        made.hit_count = o.hits.count if o.hits.count is not None and last <= limit else 0
        made.hit_side = 0 if o.hits.letter is None else (1 if o.hits.letter[1] == "+" else -1)
    if o.passed:
        passed = np.array(o.passed, np.int8)
        made.kept = (passed,)
        made.passed = address(passed)
    return made


def _named(system: FilippovSystem, hits: Hits) -> NDArray[np.int8]:
    """Whether the guards of each kind have a name that is looked for."""
    own = [name if i in system.half_lines else "" for i, name in enumerate(system.surface_names)]
    half_lines = [*own, *system.impacts]
    names = {
        **dict.fromkeys(("surface", "near"), system.surface_names),
        "stop": [name for name, _ in system.stops],
        "reset": [name for name, _ in system.resets],
        "impact": half_lines,
        "release": half_lines,
    }
    width = max(system.surface_count + 1, *map(len, names.values()))
    named = np.zeros((len(GUARDS), width), np.int8)
    for row, kind in zip(named, GUARDS, strict=True):
        if hits.names is None:
            row[:] = 1
        else:
            of_kind = names.get(kind, ())
            row[: len(of_kind)] = [name in hits.names for name in of_kind]
    return named


def batch_of(
    x: Array,
    p: Array,
    t_start: float,
    chunk: Chunk,
    times: Array | None,
    which: NDArray[np.intp] | None,
) -> ctypes.Structure:
    """What C reads and where it writes; all arrays live as long as the caller's."""
    count = len(x) if which is None else len(which)
    stride = p.shape[-1] if p.ndim > 1 else 0
    results = (chunk.x, chunk.t, chunk.status, chunk.itinerary, chunk.kinds)
    kept = (chunk.at_x, chunk.at_t, chunk.totals)
    arrays = [address(a) for a in (which, x, p, *results, *kept)]
    room = 0 if chunk.sample_t is None else chunk.sample_t.shape[1]
    times_stride = 0 if times is None or times.ndim == 1 else times.shape[1]
    width = chunk.kinds.shape[1]
    samples = [address(a) for a in (times, chunk.sample_t, chunk.sample_x)]
    return structure("Batch")(count, stride, t_start, *arrays, room, times_stride, *samples, width)


def words_of(
    parent: NDArray[np.int32],
    mode: NDArray[np.int32],
    modes: Sequence[str],
    nodes: Sequence[int],
) -> Mapping[int, str]:
    """Itineraries of some nodes of a tree of modes, as strings."""
    above, last = parent.tolist(), mode.tolist()
    words = {}
    for node in nodes:
        letters, k = [], node
        while k > 0:
            letters.append(modes[last[k]] or "o")
            k = above[k]
        words[node] = " ".join(reversed(letters))
    return words
