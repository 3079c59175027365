"""The compiled engine from Python: one system, one order, its libraries loaded with ctypes."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem, Guard, motion
from ..facts import FULL, HAND_OVER, KINDS
from ..options import Options
from ..results import Chunk, Stopped
from .arrays import (
    BURST,
    FIRST_STEPS,
    MOST_STEPS,
    BatchStructure,
    OptionsStructure,
    Output,
    Run,
    address,
    batch_of,
    options_of,
    require_size,
    words_of,
)
from .build import build, lane_width
from .codegen import lanes_source, scalar_source, supports_scalar

_I64, _D, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p


class Engine:
    """The compiled libraries of one system at one order, each built when first needed.

    Parameters
    ----------
    system : FilippovSystem
    order : int
    """

    def __init__(self, system: FilippovSystem, order: int):
        self.system, self.order = system, order
        self._scalar: ctypes.CDLL | None = None
        self._lanes: ctypes.CDLL | None = None
        self._lock = threading.Lock()

    @property
    def scalar(self) -> ctypes.CDLL:
        """The library for one trajectory at a time."""
        with self._lock:
            if self._scalar is None:
                self._scalar = _declare(build(scalar_source(self.system, self.order)))
            return self._scalar

    @property
    def lanes(self) -> ctypes.CDLL:
        """The library for trajectories in step."""
        with self._lock:
            if self._lanes is None:
                self._lanes = _declare(build(lanes_source(self.system, self.order, lane_width())))
            return self._lanes

    # one trajectory ----------------------------------------------------------------------------

    def run(self, x: Array, p: Array, options: Options) -> Run:
        """Run one trajectory from an extended start, dense output kept."""
        library, n = self.scalar, self.system.extended_dimension
        state = ctypes.create_string_buffer(library.run_size())
        tree = library.tree_new()
        c_options = ctypes.byref(self._options(options, dense=True))
        x, p = np.array(x, float), np.array(p, float)
        output = Output(n, self.order, FIRST_STEPS)
        parts: list[dict[str, NDArray[Any]]] = []
        try:
            given = (tree, address(x), address(p))
            library.run_begin(state, c_options, output.pointer, *given, options.t_start)
            while True:
                status = library.run_continue(state)
                numbers, counts = self._read(state)
                parts.append(output.filled(counts[7:10]))
                if status != FULL:
                    break
                output = Output(n, self.order, min(4 * output.steps, MOST_STEPS))
                library.run_resume(state, output.pointer)
            code = int(counts[4])
            itinerary = _words(library, tree, self.system.modes, [code])[code]
        finally:
            library.tree_free(tree)
        return self._run(parts, numbers, counts, itinerary)

    def _options(
        self, options: Options, dense: bool, at: tuple[int, int] | None = None
    ) -> OptionsStructure:
        mode = options.start_mode
        start = -1 if mode is None else self.system.modes.index(mode)
        return options_of(self.system, options, dense, at, start)

    def _read(self, state: Any) -> tuple[Array, NDArray[np.int64]]:
        numbers = np.empty(3 + 2 * self.system.extended_dimension)
        counts = np.empty(10 + len(KINDS), np.int64)
        self.scalar.run_read(state, address(numbers), address(counts))
        return numbers, counts

    def _run(
        self,
        parts: Sequence[dict[str, NDArray[Any]]],
        numbers: Array,
        counts: NDArray[np.int64],
        itinerary: str,
    ) -> Run:
        modes, where = self.system.modes, int(counts[2])
        return Run.joined(
            parts,
            self.system.dimension,
            numbers=numbers,
            counts=counts,
            itinerary=itinerary,
            letters=modes,
            guards=self._guards,
            active=[],
            several=[mode for k, mode in enumerate(modes) if where >> k & 1],
        )

    def _guards(self, mode: str) -> tuple[Guard, ...]:
        return motion(self.system, mode).guards

    # many trajectories -------------------------------------------------------------------------

    def run_many(
        self,
        x: Array,
        p: Array,
        options: Options,
        at: tuple[int, int] | None,
        lanes: bool,
        out: Chunk | None = None,
        stop: Callable[[], bool] = lambda: False,
        times: Array | None = None,
    ) -> Chunk:
        """Run trajectories from extended starts (m, N) with parameters (m, np) or (np,).

        Parameters
        ----------
        at : (kind, count) or None
            Event whose state is kept.
        lanes : bool
            Run several in step; what is rare is run again one by one.
        out : Chunk, optional
            Contiguous arrays for the results, which are made unless given.
        stop : callable, optional
            Asked now and then whether to leave the work.
        times : ndarray (K,) or (m, K), optional
            Times at which the states are kept; not with lanes.

        Raises
        ------
        Stopped
        CompilerError
        """
        chunk = out or Chunk.empty(len(x), self.system.dimension, at is not None)
        chunk.forget()
        x, p = np.ascontiguousarray(x, float), np.ascontiguousarray(p, float)
        c_options = self._options(options, dense=False, at=at)
        library = self.lanes if lanes else self.scalar
        tree = library.tree_new()
        try:
            batch = partial(batch_of, x, p, options.t_start, chunk, times)
            self._call(library, batch(None), c_options, tree, stop)
            rest = np.flatnonzero(chunk.status == HAND_OVER)
            if lanes and rest.size:
                self._call(self.scalar, batch(rest), c_options, tree, stop)
            used = np.flatnonzero(np.bincount(chunk.itinerary))
            chunk.rename(_words(library, tree, self.system.modes, used.tolist()))
        finally:
            library.tree_free(tree)
        return chunk

    def _call(
        self,
        library: ctypes.CDLL,
        batch: BatchStructure,
        options: OptionsStructure,
        tree: int,
        stop: Callable[[], bool],
    ) -> None:
        memory = np.zeros(library.many_size() + 64, np.uint8)
        state = memory.ctypes.data + -memory.ctypes.data % 64
        call = (state, ctypes.byref(batch), ctypes.byref(options), tree, BURST)
        while library.run_many(*call):
            if stop():
                raise Stopped


def _declare(library: ctypes.CDLL) -> ctypes.CDLL:
    require_size(library.options_size, OptionsStructure)
    require_size(library.batch_size, BatchStructure)
    library.tree_new.restype = _POINTER
    library.tree_size.argtypes = [_POINTER]
    library.tree_read.argtypes = [_POINTER] * 3
    library.tree_free.argtypes = [_POINTER]
    library.many_size.restype = _I64
    library.run_many.argtypes = [*[_POINTER] * 4, _I64]
    if not hasattr(library, "run_size"):
        return library
    require_size(library.output_size, Output.Structure)
    library.run_size.restype = _I64
    library.run_begin.argtypes = [*[_POINTER] * 6, _D]
    library.run_continue.argtypes = [_POINTER]
    library.run_read.argtypes = [_POINTER] * 3
    library.run_resume.argtypes = [_POINTER] * 2
    return library


def _words(
    library: ctypes.CDLL, tree: int, modes: Sequence[str], nodes: Sequence[int]
) -> Mapping[int, str]:
    """Itineraries of some nodes of a tree, as strings."""
    size = library.tree_size(tree)
    parent, mode = np.empty(size, np.int32), np.empty(size, np.int32)
    library.tree_read(tree, address(parent), address(mode))
    return words_of(parent, mode, modes, nodes)


def engine_for(system: FilippovSystem, options: Options) -> Engine | None:
    """Return the system's engine for the options' tolerance, or None where it has none."""
    if not supports_scalar(system):
        return None
    if options.start_mode is not None and options.start_mode not in system.modes:
        return None
    order = options.order
    return system.cached(("engine", order), lambda: Engine(system, order))
