"""The compiled engine from Python: one system, one order, its libraries loaded with ctypes."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array, FilippovSystem
from ..facts import FULL, GUARDS, HAND_OVER, KINDS
from ..options import Options
from ..results import Chunk, Stopped
from ..section import Hits
from .build import CompilerError, build, lane_width
from .codegen import lanes_source, scalar_source, supports_scalar

#: Steps of one call of C; between calls Python hears Ctrl-C and requests to stop.
_BURST = 4096

#: Room of the first and of the largest arrays of a dense run.
_FIRST_STEPS, _MOST_STEPS = 1024, 16384

_D, _I32, _I64 = ctypes.c_double, ctypes.c_int32, ctypes.c_int64
_POINTER = ctypes.c_void_p


class _COptions(ctypes.Structure):
    _fields_ = [
        *[(name, _D) for name in ("t_end", "rtol", "atol", "max_step")],
        *[(name, _I64) for name in ("max_steps", "max_events")],
        *[(name, _I32) for name in ("start_mode", "at_kind")],
        ("at_count", _I64),
        *[(name, _I32) for name in ("dense", "hit_after")],
        ("hit_kinds", _I64),
        ("hit_guards", _I64 * len(GUARDS)),
        *[(name, _I64) for name in ("hit_side", "hit_skip", "hit_every", "hit_count")],
    ]


_OUTPUT_ARRAYS = {
    "start": (float, "step"),
    "coefficients": (float, "step"),
    "point_t": (float, "point"),
    "point_x": (float, "point"),
    "event_t": (float, "event"),
    "event_x": (float, "event"),
    "event_after_x": (float, "event"),
    "step_mode": (np.int32, "step"),
    "event_kind": (np.int32, "event"),
    "event_before": (np.int32, "event"),
    "event_after": (np.int32, "event"),
    "event_guard": (np.int32, "event"),
}


class _CBatch(ctypes.Structure):
    _fields_ = [
        ("count", _I64),
        ("p_stride", _I64),
        ("t0", _D),
        *[(name, _POINTER) for name in ("which", "x0", "p", "x", "t", "status", "itinerary")],
        *[(name, _POINTER) for name in ("kinds", "at_x", "at_t", "totals")],
        *[(name, _I64) for name in ("room", "times_stride")],
        *[(name, _POINTER) for name in ("times", "sample_t", "sample_x")],
    ]


class _COutput(ctypes.Structure):
    _fields_ = [
        *[(name, _I64) for name in ("steps", "points", "events")],
        *[(name, _I64) for name in ("step_room", "point_room", "event_room")],
        *[(name, _POINTER) for name in _OUTPUT_ARRAYS],
    ]


@dataclass
class Run:
    """One dense run as arrays.

    Attributes
    ----------
    status : int
        A Status, or HAND_OVER: the reference driver must repeat the run.
    reason, where : int
        Why, for the message (see ``facts.REASONS``): a surface, a stop, or a set of modes as bits.
    t, x : ndarray (m,), (m, n)
        Points: start, steps and events; a reset appears twice.
    starts, coefficients, modes : ndarray (s,), (s, N, P+1), (s,)
        Steps: start times, Taylor coefficients, mode numbers (positions in ``system.modes``).
    event_kinds, event_t, event_x, event_after_x : ndarray (e,) or (e, n)
    event_before, event_after, event_guards : ndarray (e,)
        Events: kind (position in ``facts.KINDS``), modes before and after, row of the guard in
        ``motion(system, mode_before).guards``. The final "end" is not among them.
    limit : float
        Accumulation time or NaN.
    itinerary : str
    """

    status: int
    reason: int
    where: int
    mode: int
    limit: float
    itinerary: str
    t: Array
    x: Array
    starts: Array
    coefficients: Array
    modes: NDArray[np.int32]
    event_kinds: NDArray[np.int32]
    event_t: Array
    event_x: Array
    event_after_x: Array
    event_before: NDArray[np.int32]
    event_after: NDArray[np.int32]
    event_guards: NDArray[np.int32]


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
        library, steps = self.scalar, _FIRST_STEPS
        state = ctypes.create_string_buffer(library.run_size())
        tree = library.tree_new()
        c_options = ctypes.byref(_c_options(self.system, options, dense=True))
        x, p = np.array(x, float), np.array(p, float)
        arrays, output = self._output(steps)
        parts: list[dict[str, NDArray[Any]]] = []
        try:
            library.run_begin(
                state, c_options, output, tree, _address(x), _address(p), options.t_start
            )
            while True:
                status = library.run_continue(state)
                numbers, counts = self._read(state)
                sizes = dict(zip(("step", "point", "event"), counts[7:10], strict=True))
                parts.append({k: a[: sizes[_OUTPUT_ARRAYS[k][1]]] for k, a in arrays.items()})
                if status != FULL:
                    break
                steps = min(4 * steps, _MOST_STEPS)
                arrays, output = self._output(steps)
                library.run_resume(state, output)
            code = int(counts[4])
            itinerary = _words(library, tree, self.system.modes, [code])[code]
        finally:
            library.tree_free(tree)
        return self._run(parts, numbers, counts, itinerary)

    def _output(self, steps: int) -> tuple[dict[str, NDArray[Any]], Any]:
        """Arrays with room for some steps, and the C structure that points to them."""
        rooms = {"step": steps, "point": 3 * steps, "event": 2 * steps}
        arrays = self._output_arrays(rooms)
        addresses = [a.ctypes.data for a in arrays.values()]
        return arrays, ctypes.byref(_COutput(0, 0, 0, *rooms.values(), *addresses))

    def _output_arrays(self, rooms: dict[str, int]) -> dict[str, NDArray[Any]]:
        n = self.system.extended_dimension
        shapes: dict[str, tuple[int, ...]] = {
            "coefficients": (n, self.order + 1),
            "point_x": (n,),
            "event_x": (n,),
            "event_after_x": (n,),
        }
        return {
            name: np.empty((rooms[room], *shapes.get(name, ())), dtype)
            for name, (dtype, room) in _OUTPUT_ARRAYS.items()
        }

    def _read(self, state: Any) -> tuple[Array, NDArray[np.int64]]:
        numbers = np.empty(3 + 2 * self.system.extended_dimension)
        counts = np.empty(10 + len(KINDS), np.int64)
        self.scalar.run_read(state, _address(numbers), _address(counts))
        return numbers, counts

    def _run(
        self,
        parts: Sequence[dict[str, NDArray[Any]]],
        numbers: Array,
        counts: NDArray[np.int64],
        itinerary: str,
    ) -> Run:
        joined = np.concatenate if len(parts) > 1 else lambda pieces: pieces[0]
        whole = {name: joined([p[name] for p in parts]) for name in _OUTPUT_ARRAYS}
        n = self.system.dimension
        return Run(
            status=int(counts[0]),
            reason=int(counts[1]),
            where=int(counts[2]),
            mode=int(counts[3]),
            limit=float(numbers[1]),
            itinerary=itinerary,
            t=whole["point_t"],
            x=whole["point_x"][:, :n],
            starts=whole["start"],
            coefficients=whole["coefficients"],
            modes=whole["step_mode"],
            event_kinds=whole["event_kind"],
            event_t=whole["event_t"],
            event_x=whole["event_x"][:, :n],
            event_after_x=whole["event_after_x"][:, :n],
            event_before=whole["event_before"],
            event_after=whole["event_after"],
            event_guards=whole["event_guard"],
        )

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
        c_options = _c_options(self.system, options, dense=False, at=at)
        library = self.lanes if lanes else self.scalar
        tree = library.tree_new()
        try:
            batch = partial(self._batch, x, p, options.t_start, chunk, times)
            self._call(library, batch(None), c_options, tree, stop)
            rest = np.flatnonzero(chunk.status == HAND_OVER)
            if lanes and rest.size:
                self._call(self.scalar, batch(rest), c_options, tree, stop)
            used = np.flatnonzero(np.bincount(chunk.itinerary))
            chunk.rename(_words(library, tree, self.system.modes, used.tolist()))
        finally:
            library.tree_free(tree)
        return chunk

    def _batch(
        self,
        x: Array,
        p: Array,
        t_start: float,
        chunk: Chunk,
        times: Array | None,
        which: NDArray[np.intp] | None,
    ) -> _CBatch:
        """What C reads and where it writes; all arrays live as long as the caller's."""
        results = (chunk.x, chunk.t, chunk.status, chunk.itinerary, chunk.kinds)
        kept = (chunk.at_x, chunk.at_t, chunk.totals)
        sample_t = chunk.sample_t
        return _CBatch(
            len(x) if which is None else len(which),
            p.shape[-1] if p.ndim > 1 else 0,
            t_start,
            *[_address(a) for a in (which, x, p, *results, *kept)],
            0 if sample_t is None else sample_t.shape[1],
            0 if times is None or times.ndim == 1 else times.shape[1],
            *[_address(a) for a in (times, sample_t, chunk.sample_x)],
        )

    def _call(
        self,
        library: ctypes.CDLL,
        batch: _CBatch,
        options: _COptions,
        tree: int,
        stop: Callable[[], bool],
    ) -> None:
        memory = np.zeros(library.many_size() + 64, np.uint8)
        state = memory.ctypes.data + -memory.ctypes.data % 64
        call = (state, ctypes.byref(batch), ctypes.byref(options), tree, _BURST)
        while library.run_many(*call):
            if stop():
                raise Stopped


def _declare(library: ctypes.CDLL) -> ctypes.CDLL:
    _require_size(library.options_size, _COptions)
    _require_size(library.batch_size, _CBatch)
    library.tree_new.restype = _POINTER
    library.tree_size.argtypes = [_POINTER]
    library.tree_read.argtypes = [_POINTER] * 3
    library.tree_free.argtypes = [_POINTER]
    library.many_size.restype = _I64
    library.run_many.argtypes = [*[_POINTER] * 4, _I64]
    if not hasattr(library, "run_size"):
        return library
    _require_size(library.output_size, _COutput)
    library.run_size.restype = _I64
    library.run_begin.argtypes = [*[_POINTER] * 6, _D]
    library.run_continue.argtypes = [_POINTER]
    library.run_read.argtypes = [_POINTER] * 3
    library.run_resume.argtypes = [_POINTER] * 2
    return library


def _require_size(size: Any, structure: type[ctypes.Structure]) -> None:
    """Refuse a library whose structure is not laid out as ours."""
    size.restype = _I64
    if size() != ctypes.sizeof(structure):
        raise CompilerError(
            f"{structure.__name__}: expected {ctypes.sizeof(structure)} bytes, received {size()} "
            "from the compiled library. Its compiler lays out structures in another way."
        )


def _address(a: NDArray[Any] | None) -> int | None:
    return None if a is None else a.ctypes.data


def _c_options(
    system: FilippovSystem, o: Options, dense: bool, at: tuple[int, int] | None = None
) -> _COptions:
    start = -1 if o.start_mode is None else system.modes.index(o.start_mode)
    kind, count = at or (-1, 0)
    limit = 2**62
    return _COptions(
        o.t_end,
        o.rtol,
        o.atol,
        o.max_step,
        int(min(o.max_steps, limit)),
        int(min(o.max_events, limit)),
        start,
        kind,
        count,
        int(dense),
        *_c_hits(system, o.hits),
    )


def _c_hits(system: FilippovSystem, hits: Hits | None) -> tuple[Any, ...]:
    """The last fields of the options: which events are hits, by their numbers."""
    none = (_I64 * len(GUARDS))()
    if hits is None:
        return 0, 0, none, 0, 0, 1, 0
    names = {
        "surface": [f"h{i}" for i in range(system.surface_count)],
        "stop": [name for name, _ in system.stops],
        "reset": [name for name, _ in system.resets],
    }
    masks = [-1] * len(GUARDS)
    if hits.names is not None:
        masks = [_bits(n in hits.names for n in names.get(guard, ())) for guard in GUARDS]
    side = 0 if hits.letter is None else (1 if hits.letter[1] == "+" else -1)
    kinds = _bits(kind in hits.kinds for kind in KINDS)
    numbers = (side, hits.skip, hits.every, hits.count or 0)
    return int(hits.after), kinds, type(none)(*masks), *numbers


def _bits(flags: Iterable[bool]) -> int:
    return sum(1 << i for i, flag in enumerate(flags) if flag)


def _words(
    library: ctypes.CDLL, tree: int, modes: Sequence[str], nodes: Sequence[int]
) -> dict[int, str]:
    """Itineraries of some nodes of a tree, as strings."""
    size = library.tree_size(tree)
    arrays = np.empty(size, np.int32), np.empty(size, np.int32)
    library.tree_read(tree, *[_address(a) for a in arrays])
    parent, mode = (a.tolist() for a in arrays)
    words = {}
    for node in nodes:
        letters, k = [], node
        while k > 0:
            letters.append(modes[mode[k]] or "o")
            k = parent[k]
        words[node] = " ".join(reversed(letters))
    return words


def engine_for(system: FilippovSystem, options: Options) -> Engine | None:
    """Return the system's engine for the options' tolerance, or None where it has none."""
    if not supports_scalar(system):
        return None
    if options.start_mode is not None and options.start_mode not in system.modes:
        return None
    order = options.order
    return system.cached(("engine", order), lambda: Engine(system, order))


def simulate_arrays(system: FilippovSystem, x: Array, p: Array, options: Options) -> Run | None:
    """Run one trajectory; None where the reference driver must (no engine, singular points).

    Parameters
    ----------
    system : FilippovSystem
    x : ndarray (N,)
        Extended start.
    p : ndarray
    options : Options

    Raises
    ------
    CompilerError
        Without a compiler, or where it fails.
    """
    engine = engine_for(system, options)
    if engine is None:
        return None
    run = engine.run(x, p, options)
    return None if run.status == HAND_OVER else run
