"""The interpreter from Python: any system at once, with a library that is compiled once per machine."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cached_property, lru_cache
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import Array, Coupled, FilippovSystem, OptionError, driven_of
from ...model.printing.instructions import (
    LISTS,
    Entries,
    Instructions,
    Series,
    Values,
    derived_series_of,
    instructions_of,
)
from ..constants import FULL, IMPACT_LAWS, LAWS, NEEDS_PROGRAM, REASONS, RUNNING, SEVERAL
from ..names import shown_mode
from ..options import Options
from ..results import Chunk, Stopped
from ..status import Status
from .arrays import (
    BURST,
    Run,
    address,
    batch_of,
    options_of,
    words_of,
)
from .building.codegen import driver_decides, interpreter_order, width_of_motion
from .library import core_library
from .recording import Output, Recorder, Rooms, loose_rooms, rooms_of
from .shown import Shown
from .structures import declare, structure

_VALUES = ("point", "surfaces", "maps", "atoms", "choices", "restitution", "columns")
_ENTRIES = tuple(field.name for field in fields(Instructions) if field.type == "Entries")


#: Targets of the addresses in the driver's structures.
Block = NDArray[Any] | ctypes.Structure | ctypes.Array[Any]

#: Makes a function that continues a batch, from a run of the driver, the batch and its options; it returns 0 at the end.
Calls = Callable[[int, Any, Any], Callable[[], int]]

#: Steps of a test for stiffness.
_PROBED = 400

#: Seconds of a step, and of each rule and each term of a sum in it: measured on an EPYC at tolerances from 1e-6 to 1e-12.
_OF_STEP, _OF_TERM = 4e-7, 2.5e-8

#: Modes whose letters are kept.
_KNOWN = 4096


@lru_cache(maxsize=1)
def library() -> ctypes.CDLL:
    """Return the driver."""
    return declare(core_library())


def _elements(coupled: Coupled, shown: Sequence[int]) -> list[ctypes.Structure]:
    """The element of each function: of surfaces and sets, then of contacts; and its number in results."""
    system, m, c = coupled.system, coupled.system.surface_count, len(coupled.system.impacts)
    made, lower = list[ctypes.Structure](), m + 2 * c
    for name, members in zip(system.laws, system.entries, strict=True):
        i, k, further = members[0], len(members), len(coupled.lower[members[0]])
        flags = coupled.continuous[i] + 2 * coupled.scaled[i]
        law, degree = LAWS.index(name), 1 if i in system.remembering else further + 1
        degree = 0 if i in system.algebraic else degree
        size = (system.layer_widths[i], coupled.powers[i])
        rest = (law, i, k, degree, lower, flags)
        made += [structure("Element")(*rest, shown[j], 0, *size) for j in members]
        lower += further
    law = LAWS.index("contact")
    of_contact = lambda j: (law, m + j, 1, 2, m + c + j, 0, shown[m + j], 0, 1.0, 0.0)
    return [*made, *[structure("Element")(*of_contact(j)) for j in range(c)]]


def interpreter_for(system: FilippovSystem, options: Options) -> Interpreter:
    """Return the driver with a system at the options' tolerance."""
    order = interpreter_order(system.of_pieces, options)
    return system.cached(("interpreter", order), lambda: Interpreter(system, order))


def series_structure(s: Series, n: int, order: int, kept: list[NDArray[Any]]) -> ctypes.Structure:
    """Rules for n states at an order as C reads them; what it points to is added to ``kept``."""
    stride, rule, term = order + 1, s.rule.copy(), s.term.copy()
    for table, names in ((rule, "wabc"), (term, "ab")):
        for name in names:
            table[name] *= stride
    arrays = (rule, term, s.input * stride, s.index, s.outputs * stride)
    lists = [s.lists[name] for name in LISTS]
    kept += (*arrays, *lists)
    states, paired = int((s.index < n).sum()), int(rule["paired"].any())
    sizes = (len(rule), len(term), len(s.input), states, len(s.outputs), paired)
    own = [structure("List")(len(a), 0, a.ctypes.data) for a in lists]
    return structure("Series")(*sizes, *[a.ctypes.data for a in arrays], *own)


def values_structure(v: Values, kept: list[NDArray[Any]]) -> ctypes.Structure:
    """A graph as C reads it; what it points to is added to ``kept``."""
    arrays = (v.op, v.a, v.b, v.still, v.moving, v.free, v.outputs, v.paired, v.constant)
    kept += arrays
    sizes = (*map(len, (v.op, v.still, v.moving, v.free, v.outputs)), int(v.paired.any()))
    return structure("Values")(*sizes, *[a.ctypes.data for a in arrays])


#: Numbers of a run at its end.
_Numbers, _Counts = ctypes.c_double * 4, ctypes.c_int64 * 15


class _Held:
    """Memory of C that is freed at the end of a block."""

    def __init__(self, pointer: int, free: Callable[[int], Any]):
        self.pointer, self.free = pointer, free

    def __enter__(self) -> int:
        return self.pointer

    def __exit__(self, *_: object) -> None:
        self.free(self.pointer)


def _ordering(entries: Entries, n: int) -> NDArray[np.int32]:
    """Order of the states that reduces the bandwidth: reverse Cuthill-McKee."""
    from scipy.sparse import coo_array  # slow to import
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    of_states = (entries.row < n) & (entries.column < n)
    entries_at = (entries.row[of_states], entries.column[of_states])
    graph = coo_array((np.ones(len(entries_at[0])), entries_at), shape=(n, n)).tocsr()
    return reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True).astype(np.int32)


def _ends(parts: Sequence[Sequence[Any]]) -> list[int]:
    """Offsets of the parts of a row, and the end of the last."""
    return [0, *np.cumsum([len(part) for part in parts], dtype=int).tolist()]


class Interpreter:
    """The driver in C with one system at one order, with ``derived`` for derivatives."""

    def __init__(self, system: FilippovSystem, order: int, derived: bool = False):
        self.shown, self.order = Shown(system.of_breakpoints if derived else system), order
        self.system = self.shown.driven
        self.coupled = driven_of(self.system)
        lists = self.system.cached("instructions", lambda: instructions_of(self.coupled))
        self._kept: list[NDArray[Any]] = []  # arrays that C points to
        entries = None
        if derived:
            series, free, entries = self._derived()
            lists = replace(lists, series=series, free=free)
        self._c = self._structure(self.coupled, lists)
        if entries is not None:
            self._c.derivatives = self._entries(entries)
        self._rooms: Rooms = rooms_of((0, 0, 0))
        self._known_modes = dict[bytes, str]()
        self._last_spelled: tuple[bytes | None, list[str]] = (None, [])

    def _derived(self) -> tuple[Series, Series, Entries]:
        return self.system.cached("derived", lambda: derived_series_of(self.coupled))

    def add_implicit(self) -> None:
        """Give the driver the field's derivatives, which implicit steps need."""
        series, _, entries = self._derived()
        implicit = self._series(series, 0)
        self._c.derivatives = self._entries(entries)
        self._c.ordering = self._at(_ordering(entries, self.system.extended_dimension))
        self._c.implicit = ctypes.addressof(implicit)
        self._implicit = implicit

    def _series(self, series: Series, order: int) -> ctypes.Structure:
        return series_structure(series, self.system.extended_dimension, order, self._kept)

    def _structure(self, coupled: Coupled, lists: Instructions) -> Any:
        system, m, c = self.system, self.system.surface_count, len(self.system.impacts)
        carries = np.zeros((m, c))
        for i, carried in enumerate(coupled.carriers):
            carries[i, carried] = 1
        elements, linearity = _elements(coupled, self.shown.functions), coupled.linearity
        table = (structure("Element") * (len(elements) + 1))(*elements)
        parts: dict[str, Any] = {
            "n": system.extended_dimension,
            "dimension": system.dimension,
            "timed": int(system.time_dependent),
            "m": m,
            "c": c,
            "parameters": len(system.parameter_names),
            "stops": len(system.stops),
            "resets": len(system.resets),
            "order": self.order,
            "slope_outputs": lists.slope_outputs,
            "series": self._series(lists.series, self.order),
            "free": self._series(lists.free, self.order),
            "affine": int(coupled.affine),
            "linear": int(linearity.everywhere),
            "linear_free": int(linearity.free),
            "carries": carries.ravel(),
            "component": lists.component,
            "slope_output": lists.slope_output,
            "slope_moves": lists.slope_moves,
            "slope_symmetric": lists.slope_symmetric,
            "mixed": coupled.mixed.ravel(),
            "bent": linearity.bent_rows,
            "bent_free": linearity.bent_free_rows,
            "bent_guards": linearity.bent_guards,
            "curved": linearity.curved_guards,
            "sets": len(system.sets),
            "kept_rows": int(coupled.kept.numel()),
            "joints": len(system.joints),
            "combined": len(coupled.combined),
            "impact_law": IMPACT_LAWS.index(system.definition.impact_law),
            "element": self._at(np.frombuffer(bytes(table), np.uint8)),
            "tables": len(self.shown.tables),
            "cells": self._cells(),
            "rules": self._rules(),
        }
        for name in _VALUES:
            parts[name] = values_structure(getattr(lists, name), self._kept)
        for name in _ENTRIES:
            parts[name] = self._entries(getattr(lists, name))
        return self._filled("System", parts)

    def _filled(self, name: str, parts: Mapping[str, Any]) -> Any:
        """A structure of numbers, structures, and rows of integers by their addresses."""
        rows = {k: v for k, v in parts.items() if isinstance(v, (list, np.ndarray))}
        own = {k: self._at(np.array([*v, 0], np.int32)) for k, v in rows.items()}
        return structure(name)(**{**parts, **own})

    def _cells(self) -> int:
        """Tables as C reads them, by their functions."""
        made: Any = (structure("Cells") * (self.system.surface_count + 1))()
        first = self.shown.parameters
        for table in self.shown.tables:
            values, k = table.values(), len(table.levels)
            limits = [v for *cells, own in table.limits for v in (*cells, len(own), *chain(*own))]
            numbers = [np.array(a, np.int32) for a in ([*table.shown, 0], [*limits, 0])]
            arrays = [np.array([*table.levels, 0.0]), np.ascontiguousarray(values), *numbers]
            sizes = (k, values.shape[1], first, len(table.limits))
            made[table.element] = structure("Cells")(*sizes, *[self._at(a) for a in arrays])
            first += values.shape[1]
        return self._at(np.frombuffer(bytes(made), np.uint8))

    def _rules(self) -> ctypes.Structure:
        """Conditions of stops and resets as C reads them."""
        d, n = self.system.definition, self.system.dimension
        conditions = [tree for rule in d.rules for tree in rule.triggers]
        filters = [rule.when or () for rule in d.rules]
        values = [own or () for own in d.discrete]
        flags = [
            rule.level + 2 * rule.by_jumps + 4 * rule.persistent + 8 * rule.at_trigger
            for rule in d.rules
        ]
        tables: dict[str, Any] = {
            "way": d.located,
            "trigger_event": [k for k, rule in enumerate(d.rules) for _ in rule.triggers],
            "trigger_at": _ends(conditions),
            "condition": [code for tree in conditions for code in tree],
            "filter_at": _ends(filters),
            "filter": [code for tree in filters for code in tree],
            "flags": flags,
            "initially": [rule.initially for rule in d.rules],
            "named": [i in rule.named for rule in d.rules[len(d.stops) :] for i in range(n)],
            "clock_reset": [reset for reset, _ in d.clocks],
            "clock_state": [state for _, state in d.clocks],
            "value_at": _ends(values),
        }
        atoms, keeps = d.guards.numel(), any(rule.at_trigger for rule in d.rules)
        numbers = {
            "atoms": atoms,
            "triggers": len(conditions),
            "clocks": len(d.clocks),
            "discrete": len(d.discrete),
            "keeps": int(keeps),
            "width": width_of_motion(self.system),
            "value": self._at(np.array([*chain(*values), 0.0], float)),
        }
        return self._filled("Rules", tables | numbers)

    def _at(self, array: NDArray[Any]) -> int:
        self._kept.append(array)
        return array.ctypes.data

    def _entries(self, e: Entries) -> ctypes.Structure:
        return structure("Entries")(len(e.row), 0, self._at(e.row), self._at(e.column))

    @property
    def atoms(self) -> int:
        """Number of functions in the conditions of stops and resets."""
        return int(self._c.rules.atoms)

    @property
    def motion_width(self) -> int:
        """Numbers that a restart needs besides the state."""
        return int(self._c.rules.width)

    def blocks(self) -> tuple[ctypes.Structure, dict[int, Block]]:
        """The system as C reads it, with the parts for implicit steps, and the targets of its addresses."""
        if not self._c.implicit:
            self.add_implicit()
        found = dict[int, Block]()
        for array in sorted(
            self._kept, key=lambda a: a.nbytes
        ):  # slices begin where the whole does
            found[array.ctypes.data] = array
        cells = structure("Cells") * (self.system.surface_count + 1)
        found[self._c.cells] = cells.from_buffer_copy(bytes(found[self._c.cells]))
        return self._c, found | {ctypes.addressof(self._implicit): self._implicit}

    # one trajectory ----------------------------------------------------------------------------

    def run(
        self,
        x: Array,
        p: Array,
        options: Options,
        read_at: Array | None = None,
        motion: Array | None = None,
        mode: str | None = None,
        dense: bool = True,
    ) -> Run:
        """Run one trajectory from an extended start, to be read at ``read_at`` times."""
        # ``motion`` and ``mode`` are those of a run or event that is continued.
        width = self._c.rules.width
        motion = None if motion is None else self._checked(motion)
        n = self.system.extended_dimension
        rooms = self._rooms if dense else loose_rooms(n, self.order)
        output = Output(n, self.order, rooms, width if dense else 0)
        recorder = Recorder(output, self.system.dimension, dense, read_at)
        x, p = np.array(x, float), self.shown.with_cells(p)
        start, known = self._letters(options.start_mode), self._letters(mode)
        with self.held_table() as table, self.held_run(table) as state:
            c_options = ctypes.byref(options_of(self.shown.system, options, dense=True))
            given = (address(x), address(p), address(start), options.t_start, address(motion))
            if read_at is not None:
                library().run_read_at(state, address(read_at), len(read_at))
            if known is not None:
                library().run_remember(state, address(known))
            library().run_begin(state, c_options, output.pointer, *given)
            while True:
                status = self._continued(state)
                numbers, counts, active, several, rates = self._read(state)
                if status != FULL:
                    break
                recorder.make_room(counts[7:10])
                library().run_resume(state, output.pointer)
            recorded = recorder.finished(counts[7:10])
            self._rooms = recorder.rooms if dense else self._rooms  # the next run is often similar
            modes, labels = self._modes(table), self._labels(table)
            at_zero = width == 1 and options.t_start == 0  # times of events are known to rounding
            final = np.zeros(0 if at_zero else width)
            if len(final):
                library().run_motion(state, address(final))
        return Run(
            status=counts[0],
            reason=counts[1],
            where=self.shown.where(REASONS[counts[1]], counts[2]),
            mode=counts[3],
            limit=numbers[1],
            letters=modes,
            active=[self.shown.functions[i] for i in active],
            several=[modes[k] for k in several],
            rates=rates[:, : self.system.dimension],
            facts=counts[12],
            t_error=numbers[3],
            unfired=counts[13],
            implicit_steps=counts[14],
            motion=final,
            labels=labels,
            dense=dense,
            **recorded,
        )

    def _continued(self, state: int) -> int:
        """Continue until a run ends or its arrays are full; Python handles Ctrl-C between the calls."""
        while (status := library().run_continue(state, BURST)) in (RUNNING, NEEDS_PROGRAM):
            if status == NEEDS_PROGRAM:
                self.add_implicit()
        return int(status)

    @property
    def size(self) -> int:
        """Rules and terms of a step in all orders."""
        return int(self._c.series.size + self._c.series.terms) * self.order

    def seconds(self, x: Array, p: Array, options: Options) -> float | None:
        """About how long the steps of a run take that lanes could make; None if it takes implicit ones soon."""
        # By what a step has to do, not by the clock: what is decided by it has to be the same again.
        few = replace(options, max_steps=min(options.max_steps, _PROBED), hits=None)
        if not np.isfinite(x).all():
            return math.inf
        run, series = self.run(x, p, few, dense=False), self._c.series
        if run.implicit_steps:
            return None
        done = (float(run.t[-1]) - options.t_start) / (options.t_end - options.t_start)
        steps = len(run.t) / (max(done, 1e-9) if run.status == Status.TOO_MANY_STEPS else 1.0)
        closed = "sc" if driver_decides(self.system) else "c"
        made = [not set(closed) & set(mode) for mode in run.letters]
        modes = run.written["step_mode"]
        share = np.mean(np.array(made)[modes]) if len(modes) else 1.0
        return float(steps * share) * (_OF_STEP + _OF_TERM * (series.size + series.terms))

    def _checked(self, motion: Array) -> Array:
        """Data of a run or event for a restart, if it is of this system."""
        rules, d = self._c.rules, self.system.definition
        sides = motion[6 : 6 + 3 * rules.atoms]
        fits = len(motion) == rules.width and bool(np.isfinite(motion).all())
        last = motion[3] if fits and rules.atoms else -1
        if fits and (np.isin(sides, (-1, 0, 1)).all() and -1 <= last < len(d.rules)):
            return np.ascontiguousarray(motion)
        raise OptionError(
            "start is a run or event of another system, or with another section. Continue it with its own "
            "system and at=, or give its state as x0 and its time as t_start."
        )

    def _letters(self, mode: str | None) -> NDArray[np.int8] | None:
        return None if mode is None else np.array([*self.shown.narrowed(mode), 0], np.int8)

    @cached_property
    def _width(self) -> int:
        """Bytes of a mode: letters, then values of discrete states."""
        system = self.system
        values = len(system.definition.discrete) + len(self.shown.tables)
        return system.surface_count + len(system.impacts) + 8 * values

    def held_table(self) -> _Held:
        made = library()
        return _Held(made.table_new(self._width), made.table_free)

    def held_run(self, table: int) -> _Held:
        made = library()
        state = made.run_new(ctypes.byref(self._c), table)
        if not state:
            raise MemoryError("the compiled engine: no memory for a run of this system")
        return _Held(state, made.run_free)

    def _read(self, state: int) -> tuple[list[float], list[int], list[int], list[int], Array]:
        numbers, counts = _Numbers(), _Counts()
        width = self.system.surface_count + len(self.system.impacts)
        active, several = (ctypes.c_int32 * (width + 1))(), (ctypes.c_int32 * SEVERAL)()
        rates = np.empty((SEVERAL, self.system.extended_dimension))
        library().run_read(state, numbers, counts, active, several, address(rates))
        known, found = active[: counts[10]], several[: counts[11]]
        return numbers[:], counts[:], known, found, rates[: len(found)]

    def words(self, table: int, nodes: list[int]) -> Mapping[int, str]:
        """Itineraries of some nodes of the tree of modes."""
        size = library().table_size(table)
        parent, mode = np.empty(size, np.int32), np.empty(size, np.int32)
        library().table_read(table, address(parent), address(mode), None)
        # Chunks of an ensemble have the same modes.
        reached, known = self._modes_of(table).tobytes(), self._last_spelled
        if known[0] != reached:
            self._last_spelled = known = reached, self._all_spelled(table)
        return words_of(parent, mode, known[1], nodes)

    def _all_spelled(self, table: int) -> list[str]:
        """Modes of a table, as itineraries show them."""
        spelled = [self.shown.system.spelled(letters) for letters in self._modes(table)]
        rows = self._labels(table)
        if not rows:
            return spelled
        return [shown_mode(self.system, one, row) for one, row in zip(spelled, rows, strict=True)]

    def _modes(self, table: int) -> list[str]:
        """Modes of a table, by number."""
        reached, width, known = self._modes_of(table).tobytes(), self._width, self._known_modes
        rows = [reached[k : k + width] for k in range(0, len(reached), width)] if width else [b""]
        if len(known) > _KNOWN:
            known.clear()
        return [known.get(row) or known.setdefault(row, self._letters_of(row)) for row in rows]

    def _letters_of(self, row: bytes) -> str:
        """Letters of a mode from its bytes."""
        width = self.system.surface_count + len(self.system.impacts)
        letters = self._spelled(np.frombuffer(row[:width], np.int8).tolist())
        return self.shown.widened(
            letters, np.frombuffer(row[width:])[len(self.system.definition.discrete) :]
        )

    def _modes_of(self, table: int) -> NDArray[np.int8]:
        """Modes of a table, as bytes."""
        width, count = self._width, library().table_modes(table)
        reached = np.empty(count * width + 1, np.int8)
        library().table_read(table, None, None, address(reached))
        return reached[:-1].reshape(count, width)

    def _labels(self, table: int) -> list[tuple[float, ...]]:
        """Values of the discrete states in the modes of the run; empty without any."""
        count = len(self.system.definition.discrete)
        if not count:
            return []
        width = self.system.surface_count + len(self.system.impacts)
        values = np.ascontiguousarray(self._modes_of(table)[:, width:]).view(np.float64)
        return [*map(tuple, values[:, :count].tolist())]

    def _spelled(self, signs: list[int]) -> str:
        """Letters of all switching functions and contacts; see ``core/state.c`` for those of sets."""
        m, half_lines = self.system.surface_count, self.system.half_lines
        letters = ["-s+*blli"[sign + 1] for sign in signs[:m]]
        for i in half_lines:
            letters[i] = "o" if signs[i] else "c"
        return "".join([*letters, *("o" if sign else "c" for sign in signs[m:])])

    # many trajectories -------------------------------------------------------------------------

    def run_many(
        self,
        x: Array,
        p: Array,
        options: Options,
        at: tuple[int, int] | None,
        out: Chunk | None = None,
        stop: Callable[[], bool] = lambda: False,
        times: Array | None = None,
        calls: Calls | None = None,
    ) -> Chunk:
        """Run trajectories from extended starts (m, N) with parameters (m, np) or (np,), by ``calls`` of C."""
        chunk = out or Chunk.empty(len(x), self.system, at is not None)
        chunk.forget()
        x, p = np.ascontiguousarray(x, float), self.shown.with_cells(p)
        batch = batch_of(x, p, options.t_start, chunk, times)
        start, done = self._letters(options.start_mode), np.zeros(1, np.int64)
        c_options = options_of(self.shown.system, options, dense=False, at=at)
        given = (ctypes.byref(batch), ctypes.byref(c_options))
        with self.held_table() as table, self.held_run(table) as state:
            own = lambda: library().run_many(state, address(done), *given, address(start), BURST)
            more = own if calls is None else calls(state, *given)
            while status := more():
                if status == NEEDS_PROGRAM:
                    self.add_implicit()
                if stop():
                    raise Stopped
            used = np.flatnonzero(np.bincount(chunk.itinerary)).tolist()
            chunk.rename(self.words(table, used))
        return chunk
