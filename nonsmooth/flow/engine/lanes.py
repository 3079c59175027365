"""Several trajectories in step, from Python: one system of at most one surface, one order."""

from __future__ import annotations

import ctypes
import math
import threading
from collections.abc import Callable

import numpy as np

from ...model import Array, FilippovSystem
from ..options import Options
from ..results import Chunk, Stopped
from .arrays import BURST, batch_of, options_of
from .building.build import build
from .building.codegen import lanes_source, supports_lanes
from .building.compilers import lane_width
from .structures import declare, structure
from .tape import library as core_library
from .tape import tape_for

#: Lanes are compiled for this processor, and have no bits in common with the driver: sums of products may be fused.
FLAGS = ("-march=native", "-ffp-contract=fast")


class Lanes:
    """The library that runs a system's trajectories in step, built when first needed."""

    #: Not 0: every other step, at random, is made by the driver, which changes no result.
    random = 0

    def __init__(self, system: FilippovSystem, order: int):
        self.system, self.order = system, order
        self._library: ctypes.CDLL | None = None
        self._lock = threading.Lock()

    @property
    def library(self) -> ctypes.CDLL:
        """The library, loaded."""
        with self._lock:
            if self._library is None:
                source = lanes_source(self.system, self.order, lane_width())
                self._library = declare(build(source, FLAGS), "kernel/batch.c")
            return self._library

    def run_many(
        self,
        x: Array,
        p: Array,
        options: Options,
        at: tuple[int, int] | None,
        out: Chunk | None = None,
        stop: Callable[[], bool] = lambda: False,
    ) -> Chunk:
        """Run trajectories from extended starts (m, N) with parameters (m, np) or (np,)."""
        # The driver takes steps that are not clear.
        chunk = out or Chunk.empty(len(x), self.system, at is not None)
        chunk.forget()
        x, p = np.ascontiguousarray(x, float), np.ascontiguousarray(p, float)
        padded = np.append(p, np.zeros((*p.shape[:-1], 1)), axis=-1)
        c_options = options_of(self.system, options, dense=False, at=at)
        tape = tape_for(self.system, options)
        assert tape is not None
        with tape.held_table() as table, tape.held_run(table) as run:
            tree = core_library().lanes_tree(run)
            batch = batch_of(x, padded, options.t_start, chunk, None, None)
            _call(self.library, batch, c_options, tree, _core(run, self.random), stop)
            used = np.flatnonzero(np.bincount(chunk.itinerary))
            chunk.rename(tape.words(table, used.tolist()))
        return chunk


def _call(
    library: ctypes.CDLL,
    batch: ctypes.Structure,
    options: ctypes.Structure,
    tree: int,
    core: ctypes.Structure,
    stop: Callable[[], bool],
) -> None:
    memory = np.zeros(library.many_size() + 64, np.uint8)
    state = memory.ctypes.data + -memory.ctypes.data % 64
    call = (state, ctypes.byref(batch), ctypes.byref(options), tree, ctypes.byref(core), BURST)
    while library.run_many(*call):
        if stop():
            raise Stopped


def _core(run: int, random: int) -> ctypes.Structure:
    """The driver as C of the lanes calls it."""
    begin, step = core_library().core_begin, core_library().core_step
    return structure("Core")(
        run, *[ctypes.cast(f, ctypes.c_void_p).value for f in (begin, step)], random
    )


def lanes_for(system: FilippovSystem, options: Options) -> Lanes | None:
    """Return what runs a system's trajectories in step, or None where the driver has to run them."""
    if options.start_mode is not None or options.rest_below is not None or options.begins_late:
        return None
    if not supports_lanes(system):
        return None
    order = _order_with_sets(options) if system.sets else options.order
    return system.cached(("lanes", order), lambda: Lanes(system, order))


def _order_with_sets(options: Options) -> int:
    """Where directions of slip are expanded the work of the series counts most."""
    return max(6, math.ceil(options.order / 1.2))
