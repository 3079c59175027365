"""The programs of one system as C: the operations of the interpreter, in its order, without loops.

The results have the same bits as those of ``flow/compiled/interpreter``, which loops over instructions
and orders.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..definition.system import FilippovSystem
from ..laws.coupled import Coupled
from .recurrences import Writer, literal
from .tape import OPERATIONS, TAPE_RULES, Integers, Series, Tape, Values

#: C of the operations that need no function; the others are called as the interpreter calls them.
_ARITHMETIC = {
    "assign": "{0}",
    "neg": "-{0}",
    "twice": "{0} + {0}",
    "sq": "{0} * {0}",
    "inv": "1.0 / {0}",
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
}

#: Products of coefficients beyond which a compiler takes too long.
MOST_PRODUCTS = 30_000


def special_sizes(system: FilippovSystem, order: int) -> str:
    """C of the sizes that are constants in a program for one system."""
    sizes = {
        "P": order,
        "STATES": system.extended_dimension,
        "DIMENSION": system.dimension,
        "TIMED": int(system.time_dependent),
        "SURFACES": system.surface_count,
        "CONTACTS": len(system.impacts),
        "STOPS": len(system.stops),
        "RESETS": len(system.resets),
        "SETS": len(system.sets),
    }
    return "#define GENERATED\n" + "".join(f"#define {k} {v}\n" for k, v in sizes.items())


def special_values(tape: Tape) -> str:
    """C of ``run_point``, ``run_free_point`` and ``run_surfaces``."""
    return "".join(
        [
            _values("run_point", tape.point, tape.point.moving),
            _values("run_free_point", tape.point, tape.point.free),
            _values("run_surfaces", tape.surfaces, tape.surfaces.moving),
        ]
    )


def products(tape: Tape, order: int) -> int:
    """Products of coefficients that the series of a step take, about."""
    convolved = {TAPE_RULES.index(name) for name in ("mul", "div", "under", "integral", "quotient")}
    convolved |= {TAPE_RULES.index(name) for name in ("sq", "sqrt", "power", "atan2")}
    lists = [(tape.free, tape.free.later), (tape.series, tape.series.later)]
    lists.append((tape.series, tape.series.late))
    count = sum(int(s.rule[j]) in convolved for s, which in lists for j in which.tolist())
    plain = sum(len(which) for _, which in lists)
    return count * order * (order + 1) // 2 + plain * order


def special_series(tape: Tape, coupled: Coupled, order: int) -> str:
    """C of ``first_values``, ``point_sums``, ``free_series`` and ``sliding_series``."""
    system, scaled = coupled.system, coupled.scaled
    return "".join(
        [
            _first_values("first_free", tape.free, _checked(coupled, free=True)),
            _first_values("first_sliding", tape.series, _checked(coupled, free=False)),
            "static void first_values(Run *r, int is_free) {\n"
            "  if (is_free) first_free(r->input, r->series); else first_sliding(r->input, r->series);\n"
            "}\n",
            _sums(tape, coupled.count, len(system.stops) + len(system.resets)),
            _Free(tape.free, system, order, scaled).text(),
            _Sliding(tape.series, system, order, scaled).text(),
        ]
    )


def _checked(coupled: Coupled, free: bool) -> list[bool]:
    """Which outputs of the series (field, layer, heights, factors, stops) a step is checked with."""
    found, width = coupled.linearity, coupled.count
    if coupled.system.sets:  # their guards are made of heights and factors
        return [True] * sum(output.numel() for output in coupled.outputs)
    heights, stops = found.bent_guards[:width], found.bent_guards[width:]
    if free:
        return [*found.bent_free_rows, *[False] * width, *heights, *[False] * width, *stops]
    return [*found.bent_rows, *[True] * width, *heights, *[True] * width, *stops]


# Values -----------------------------------------------------------------------------------------


def _values(name: str, v: Values, which: Integers) -> str:
    op, a, b = v.op.tolist(), v.a.tolist(), v.b.tolist()
    own = set(which.tolist())

    def value(j: int) -> str:
        if OPERATIONS[op[j]] == "const":
            return literal(float(v.constant[j]))
        return f"v{j}" if j in own else f"w[{j}]"

    lines = []
    for j in which.tolist():
        operation = OPERATIONS[op[j]]
        text = (
            f"x[{b[j]}]" if operation == "input" else _applied(operation, value(a[j]), value(b[j]))
        )
        lines.append(f"const double v{j} = {text};")
    lines += [f"w[{j}] = v{j};" for j in dict.fromkeys(v.outputs.tolist()) if j in own]
    arguments = "const Values *t, const double *restrict x, const double *p, double *restrict w"
    return _function(f"{name}({arguments})", ["(void)t; (void)x; (void)p; (void)w;", *lines])


def _applied(operation: str, first: str, second: str) -> str:
    if operation in _ARITHMETIC:
        return _ARITHMETIC[operation].format(first, second)
    if operation == "sqrt":
        return f"sqrt({first})"
    return f"operate(OP_{operation}, {first}, {second})"


def _function(head: str, lines: Iterable[str]) -> str:
    return f"static void {head} {{\n" + "".join(f"  {line}\n" for line in lines) + "}\n"


def _sums(tape: Tape, width: int, stops: int) -> str:
    """C of ``point_sums``: the sums of ``gradient_sums`` written out."""
    v, first = tape.point, 2 * width + len(tape.slope.row)
    nodes, constant = v.outputs.tolist(), OPERATIONS.index("const")
    kinds = {"layer": width, "height": width, "stop": stops, "factor": width}
    lines: dict[str, list[str]] = {}
    for kind, count in kinds.items():
        entries, sums = getattr(tape, f"{kind}_gradient"), [""] * count
        for place, (row, column) in enumerate(
            zip(entries.row.tolist(), entries.column.tolist(), strict=True)
        ):
            j = nodes[first + place]
            slope = literal(float(v.constant[j])) if v.op[j] == constant else f"r->point[{j}]"
            term = f"weighed({slope}, vector[{column}], finite_only)"
            sums[row] = f"{sums[row]} + {term}" if sums[row] else term
        lines[kind] = [f"to->{kind}[{row}] = {total or 0};" for row, total in enumerate(sums)]
        first += len(entries.row)
    free = [*lines["height"], *lines["stop"]]
    arguments = "const Run *r, int is_free, const double *vector, int finite_only, const Sums *to"
    sliding = [*lines["layer"], *lines["factor"]]
    text = ["(void)vector; (void)finite_only; (void)to;", *free, "if (is_free) return;", *sliding]
    return _function(f"point_sums({arguments})", text)


# Series -----------------------------------------------------------------------------------------


def _first_values(name: str, series: Series, wanted: Sequence[bool]) -> str:
    """C of the first coefficients of some outputs, from the inputs of the series."""
    writer = Writer(series)
    for j in series.moving.tolist():
        writer.advance(j, 0, lambda position, _: f"x[{position}]")
    rows = [j for j, own in zip(series.outputs.tolist(), wanted, strict=False) if own]
    for j in dict.fromkeys(rows):
        if (j, 0) in writer.names and j not in writer.still:
            writer.lines.append(f"s[{j} * (P + 1)] = {writer.name(j, 0)};")
    head = f"{name}(const double *restrict x, double *restrict s)"
    return _function(head, ["(void)x; (void)s;", *writer.lines])


class _Free:
    """C of ``free_series``: all coefficients where nothing slides."""

    head = "free_series(Run *r, Expansion *e)"

    def __init__(self, series: Series, system: FilippovSystem, order: int, scaled: Sequence[bool]):
        self.n, self.order = system.extended_dimension, order
        self.m, self.width = system.surface_count, system.surface_count + len(system.impacts)
        self.scaled = scaled
        self.series, self.writer = series, Writer(series)
        outputs = series.outputs.tolist()
        self.field, others = outputs[: self.n], outputs[self.n :]
        self.layer = others[: self.width]
        self.rows = dict.fromkeys(others)
        self.states: dict[tuple[int, int], str] = {}

    def text(self) -> str:
        writer = self.writer
        writer.lines += ["double *c = e->states, *s = r->series;", "(void)c; (void)s;"]
        for i in range(self.n):
            self.states[i, 0] = writer.let(f"x{i}_0", f"c[{i} * (P + 1)]")
        for k in range(self.order + 1):
            self._advance(k)
            self._store(self.rows, k)
            if k < self.order:
                self._next_states(k)
        return _function(self.head, writer.lines)

    def _advance(self, k: int) -> None:
        for j in (self.series.later if k else self.series.moving).tolist():
            self.writer.advance(j, k, self._input)

    def _input(self, position: int, k: int) -> str:
        if position < self.n:
            return self.states[position, k]
        held = k == 0 and position < self.n + self.width
        return f"r->held[{position - self.n}]" if held else "0.0"

    def _store(self, rules: Iterable[int], k: int) -> None:
        writer = self.writer
        for j in rules:
            if j not in writer.still and (j, k) in writer.names:
                writer.lines.append(f"s[{j} * (P + 1) + {k}] = {writer.name(j, k)};")

    def _next_states(self, k: int) -> None:
        for i, j in enumerate(self.field):
            value = f"{self.writer.name(j, k)} * (1.0 / {float(k + 1)!r})"
            self.states[i, k + 1] = self.writer.let(f"x{i}_{k + 1}", value)
            self.writer.lines.append(f"c[{i} * (P + 1) + {k + 1}] = x{i}_{k + 1};")


class _Sliding(_Free):
    """C of ``sliding_series``: the unknowns follow from the equations of each order."""

    head = "sliding_series(Run *r, Expansion *e, const int32_t *start)"

    def _advance(self, k: int) -> None:
        writer = self.writer
        if k == 0:
            super()._advance(k)
            return
        late = self.series.late.tolist()
        for j in self.series.later.tolist():
            writer.advance(j, k, self._unknown_input, "a" if j in set(late) else "")
        self._store(dict.fromkeys(self.layer), k)
        writer.lines.append(f"follow_layer(r, e, {k}, start);")
        for j in late:
            writer.advance(j, k, self._input)

    def _unknown_input(self, position: int, k: int) -> str:
        return self.states[position, k] if position < self.n else "0.0"

    def _input(self, position: int, k: int) -> str:
        """Inputs of the series as the interpreter's ``set_inputs`` puts them together."""
        if position < self.n:
            return self.states[position, k]
        i = position - self.n
        if i < self.width:
            held = "0.0" if k else f"r->held[{i}]"
            if i < self.m and self.scaled[i]:
                return held
            value = f"{held} + e->series[{i} * (P + 1) + {k}]"
        else:
            own = [j for j in range(self.m) if self.scaled[j]][i - self.width]
            value = f"e->series[{own} * (P + 1) + {k}]"
        return self.writer.let(f"u{position}_{k}", value)
