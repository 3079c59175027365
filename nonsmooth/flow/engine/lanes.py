"""Several trajectories together, from Python: one system, one order."""

from __future__ import annotations

import ctypes
import math
import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from ...model import Array, FilippovSystem
from ..options import Options
from ..results import Chunk
from ..section import Hits
from .arrays import BURST
from .building.build import build
from .building.codegen import driver_decides, lanes_source, supports_lanes
from .building.compilers import lane_width
from .interpreter import interpreter_for
from .interpreter import library as core_library
from .structures import declare, structure

#: Lanes are compiled for this processor with fused products: their bits differ from those of the driver.
FLAGS = ("-march=native", "-ffp-contract=fast")


class Lanes:
    """The library that runs a system's trajectories together, built when first needed."""

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
        times: Array | None = None,
    ) -> Chunk:
        """Run trajectories from extended starts (m, N) with parameters (m, np) or (np,)."""
        # The driver makes steps that the lanes cannot decide.
        return interpreter_for(self.system, options).run_many(
            x, p, options, at, out, stop, times, self._calls
        )

    def _calls(self, run: int, batch: Any, options: Any) -> Callable[[], int]:
        """Calls of the lanes, which have a run of the driver."""
        core = core_library()
        steps = [ctypes.cast(f, ctypes.c_void_p).value for f in (core.core_begin, core.core_step)]
        given = structure("Core")(run, *steps, self.random)
        memory = np.zeros(self.library.many_size() + 64, np.uint8)
        state = memory.ctypes.data + -memory.ctypes.data % 64
        call = (state, batch, options, core.lanes_tree(run), ctypes.byref(given), BURST)

        def more(_: Any = (memory, given)) -> int:  # which live as long as this
            return int(self.library.run_many(*call))

        return more


def lanes_for(system: FilippovSystem, options: Options) -> Lanes | None:
    """Return the lanes of a system, or None where the driver has to run it."""
    if options.start_mode is not None or options.rest_below is not None or options.begins_late:
        return None
    if not supports_lanes(system):
        return None
    order = _order_with_sets(options) if system.sets else options.order
    return system.cached(("lanes", order), lambda: Lanes(system, order))


def can_sample(system: FilippovSystem, hits: Hits | None) -> bool:
    """Whether lanes keep samples: at times, or at events besides stops."""
    stops, lanes_decide = {name for name, _ in system.stops}, not driver_decides(system)
    if system.sets or hits is None or (hits.after and system.surface_count and lanes_decide):
        return not system.sets and hits is None
    named = hits.names is not None and not stops.intersection(hits.names)
    return named or not stops or "stop" not in hits.kinds


def _order_with_sets(options: Options) -> int:
    """Order for systems with sets, where the series cost most."""
    return max(6, math.ceil(options.order / 1.2))
