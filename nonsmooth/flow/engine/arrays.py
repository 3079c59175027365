"""Data that Python and the drivers in C share: options and batches, a run as arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem, Guard
from ..constants import GUARDS, KINDS, METHODS
from ..options import Options
from ..results import Chunk
from ..section import Hits
from .structures import structure

#: Steps of one call of C; between calls Python handles Ctrl-C and requests to stop.
BURST = 4096


@dataclass
class Run:
    """One run as arrays."""

    status: int  # of Status
    reason: int  # why, for the message: position in ``REASONS``
    where: int  # a surface, a stop
    mode: int  # the last one
    limit: float  # accumulation time or NaN
    letters: Sequence[str]  # modes by number
    active: list[int]  # surfaces and contacts at the last point that was decided
    several: list[str]  # modes that could continue there, where more than one could
    rates: Array  # (k, n): rates of the states in them
    facts: int  # what was noted about the decisions, as bits
    t_error: float  # largest error of the time of an event that rounding hides; see ``Facts``
    unfired: int  # a stop or reset that was true at the start and did not happen, or -1
    implicit_steps: int  # how many steps were implicit
    t: Array  # (m,): start, steps and events; a reset appears twice
    x: Array  # (m, n)
    motion: Array  # (w,): what a restart at the end needs besides the state
    labels: Sequence[tuple[float, ...]]  # discrete states by number of mode; empty without any
    dense: bool  # whether the following were kept
    starts: Array  # (s,): of steps
    coefficients: Array  # (s, N, P+1): of the states
    implicit: NDArray[np.bool_]  # (s,): whether steps are implicit
    sample_x: Array  # (K, n): states at the times to be read before the end, unless it is dense
    event_count: int  # without the end
    written: Any  # arrays by name, what the driver wrote
    few: bool  # whether events and points are few, so that they are read one by one

    def each(self) -> list[tuple[int, float, Array]]:
        """Guard, time and state of each event but the end."""
        rows, t, x = (self.written[f"event_{name}"] for name in ("guard", "t", "x"))
        return [*zip(rows.tolist(), t.tolist(), x, strict=True)]


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
) -> ctypes.Structure:
    """Options as C reads them."""
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
        min(count, limit),
        kind,
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
    """Whether the guards of each kind have the name of the section."""
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
    x: Array, p: Array, t_start: float, chunk: Chunk, times: Array | None
) -> ctypes.Structure:
    """What C reads and where it writes; all arrays live as long as the caller's."""
    stride = p.shape[-1] if p.ndim > 1 else 0
    results = (chunk.x, chunk.t, chunk.status, chunk.itinerary, chunk.kinds)
    kept = (chunk.at_x, chunk.at_t, chunk.totals)
    arrays = [address(a) for a in (x, p, *results, *kept)]
    room = 0 if chunk.sample_t is None else chunk.sample_t.shape[1]
    times_stride = 0 if times is None or times.ndim == 1 else times.shape[1]
    width = chunk.kinds.shape[1]
    samples = [address(a) for a in (times, chunk.sample_t, chunk.sample_x)]
    return structure("Batch")(len(x), stride, t_start, *arrays, room, times_stride, *samples, width)


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
