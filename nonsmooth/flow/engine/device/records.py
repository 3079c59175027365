"""Runs between two steps, exchanged by a GPU and the driver."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ....model import Array, FilippovSystem
from ...constants import FALL_BACK, NEEDS_PROGRAM, SIMPLE_KINDS
from ...options import Options
from ...results import Chunk, Stopped
from ..arrays import BURST, address, batch_of, options_of
from ..interpreter import Interpreter, interpreter_for, library

#: An array of :func:`record_type`.
Records = NDArray[np.void]

#: Modes of an itinerary that a card keeps, and what its number has where there are more.
MOST_MODES = 30
FROZEN = 1 << 62

#: Least number of records for a thread of this processor.
_LEAST = 64


def record_type(system: FilippovSystem) -> np.dtype[np.void]:
    """``Left`` of common.h, the states and the sides of stops: words of 64 bits."""
    counts = ("steps", "events", "entered", "shrinking", "code", "letter", "drop", "begun")
    return np.dtype(
        [
            ("index", np.int64),
            *[(name, np.float64) for name in ("t", "since", "length", "shortest")],
            *[(name, np.int64) for name in counts],
            ("kinds", np.int64, (SIMPLE_KINDS - 1,)),
            ("x", np.float64, (system.extended_dimension,)),
            ("above_stop", np.int64, (len(system.stops),)),
        ]
    )


def word_of(code: int, modes: Sequence[str]) -> str:
    """Return an itinerary from its code: digits from 1 to base 4, the last mode lowest."""
    letters, rest = [], code & ~FROZEN
    while rest:
        letters.append(modes[(rest & 3) - 1] or "o")
        rest >>= 2
    return " ".join(reversed(letters)) + (" ..." if code & FROZEN else "")


def _shown(word: str) -> str:
    """An itinerary as a card would give it."""
    modes = word.split(" ")
    return word if len(modes) <= MOST_MODES else " ".join([*modes[:MOST_MODES], "..."])


def continued(
    records: Records,
    system: FilippovSystem,
    p: Array,
    options: Options,
    at: tuple[int, int] | None,
    out: Chunk,
    to_end: bool,
    workers: int,
) -> Records:
    """Let the driver make a step of each run, or all to its end; return those that continue, in ``records`` too.

    ``out`` has the events at which they are kept, and gets the results of the others. Numbers of the returned records
    are rows of ``out``.
    """
    count = len(records)
    size = max(_LEAST, -(-count // max(workers, 1)))
    engine, stop = interpreter_for(system, options), threading.Event()
    assert engine is not None

    def part(first: int) -> tuple[slice, Chunk]:
        rows = slice(first, min(first + size, count))
        own = p[rows] if p.ndim > 1 else p
        chunk = out.part(rows.start, rows.stop)
        _continue(engine, records[rows], own, options, at, chunk, to_end, stop.is_set)
        return rows, chunk

    with ThreadPoolExecutor(max(workers, 1)) as pool:
        try:
            parts = list(pool.map(part, range(0, count, size)))
        except BaseException:
            stop.set()
            raise
    out.take(parts)
    rows = np.flatnonzero(out.status == FALL_BACK)
    going = records[rows]
    going["index"], going["shortest"], going["shrinking"] = rows, 1e-3, 0
    return going


def _continue(
    engine: Interpreter,
    records: Records,
    p: Array,
    options: Options,
    at: tuple[int, int] | None,
    out: Chunk,
    to_end: bool,
    stop: Callable[[], bool],
) -> None:
    x, done = np.ascontiguousarray(records["x"]), np.zeros(1, np.int64)
    own, p = records.ctypes.data, engine.shown.with_cells(p)
    c_options = options_of(engine.system, options, dense=False, at=at)
    batch = batch_of(x, p, options.t_start, out, None)
    rest = (own, records.dtype.itemsize // 8, int(to_end), BURST)
    out.itinerary[:] = 0
    with engine.held_table() as table, engine.held_run(table) as run:
        library().lanes_tree(run)  # modes have the numbers that they have in codes
        call = (run, address(done), ctypes.byref(batch), ctypes.byref(c_options))
        while status := library().run_left(*call, *rest):
            if status == NEEDS_PROGRAM:
                engine.add_implicit()
            if stop():
                raise Stopped
        used = np.flatnonzero(np.bincount(out.itinerary)).tolist()
        words = {k: _shown(word) for k, word in engine.words(table, used).items()}
    frozen = np.flatnonzero((records["code"] & FROZEN) != 0)
    for code in np.unique(records["code"][frozen]).tolist():
        number = max(words) + 1
        words[number] = word_of(code, engine.system.modes)
        out.itinerary[frozen[records["code"][frozen] == code]] = number
    out.rename(words)
