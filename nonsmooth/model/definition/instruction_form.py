"""A system as an instruction list: numbers and texts for a file, checked when they are read.

CasADi's own text of a function is not read from files: it is not checked there, and a damaged one can
end the process.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..checks import is_real
from ..errors import DefinitionError
from ..expressions.float_arithmetic import BINARY
from ..expressions.graph import Node, evaluate, instructions, operation
from ..numbering import LAWS, MOST_CODES, OPERATIONS
from ..reading import listed
from ..values import Array
from .conditions import OR, Rule
from .curves import Curve
from .elements import LARGEST
from .lift import LiftedSwitch
from .parse_definition import OUTPUTS, Definition, require_consistent
from .pieces import Table
from .system import FilippovSystem

#: Most instructions, and entries, of a system in a file, and most that are nested: CasADi prints nested ones
#: by recursion.
MOST, DEEPEST = 200_000, 4_000

_INPUTS = ("states", "time", "parameters", "multipliers", "reactions")


def written(system: FilippovSystem) -> dict[str, Any]:
    """Return plain values from which ``read_system`` makes an equal system."""
    d = system.written
    inputs, outputs = ([getattr(d, name) for name in names] for names in (_INPUTS, d.outputs))
    nodes, rows = instructions(inputs, outputs, merged=False)
    operations = sorted({node.op for node in nodes})
    size, depth = max(len(nodes), sum(map(len, rows))), _depth(nodes)
    if size > MOST or depth > DEEPEST:
        raise DefinitionError(
            f"system: it has {size} instructions or entries and instructions nested {depth} deep; files have "
            f"at most {MOST}, nested {DEEPEST} deep. Save the arrays of the result with numpy.savez."
        )
    constants = [node.payload for node in nodes if node.op == "const"]
    args, used = np.zeros((len(nodes), 2), np.int32), 0
    for k, node in enumerate(nodes):
        if node.op == "const":
            args[k, 0], used = used, used + 1
        else:
            own = node.source if node.op == "input" else node.args
            args[k, : len(own)] = own
    return {
        "operations": operations,
        "op": np.array([operations.index(node.op) for node in nodes], np.int32),
        "args": args,
        "constants": np.array(constants, float),
        "outputs": np.array([k for row in rows for k in row], np.int32),
        "shapes": [list(e.shape) for e in outputs],
        "names": [[str(s) for s in listed(v)] for v in inputs],
        "defaults": d.defaults,
        "events": [[list(e) for e in d.stops], [list(e) for e in d.resets], list(d.impacts)],
        "rules": [_plain_rule(rule) for rule in d.rules],
        "clocks": [list(pair) for pair in d.clocks],
        "discrete": [None if own is None else list(own) for own in d.discrete],
        "hidden": d.hidden,
        "sizes": list(d.sizes),
        "renamed": [list(pair) for pair in d.renamed],
        "layer_widths": list(d.layer_widths),
        "laws": list(d.laws),
        "complementarity": list(d.complementarity),
        "tables": [_plain_table(table) for table in d.tables],
        "lifted": system.lifted,
    }


def read_system(plain: Any) -> FilippovSystem:
    """Make the system that ``written`` described; DefinitionError for anything else."""
    _require(isinstance(plain, dict), "a description of a system")
    names = [_texts(v, "names") for v in _list(plain, "names", len(_INPUTS))]
    vectors = [_symbols(v) for v in names]
    expressions = _expressions(plain, vectors)
    stops, resets, impacts = _list(plain, "events", 3)
    tables = tuple(_table(v) for v in _parts(plain.get("tables", []), None, "tables"))
    count = len(names[2]) - sum(len(table.curves) for table in tables)
    _require(count >= 0, "a value of each curve")
    sizes = [_whole(v, "sizes", 1, LARGEST) for v in _list(plain, "sizes")]
    widths = _list(plain, "layer_widths") if "layer_widths" in plain else []
    _require(all(is_real(v) and v > 0 for v in widths), "layer_widths that are positive numbers")
    definition = Definition(
        **dict(zip(_INPUTS, vectors, strict=True)),
        **dict(zip(OUTPUTS, expressions, strict=False)),
        stops=_directed(stops),
        resets=_directed(resets),
        impacts=tuple(_texts(impacts, "impacts")),
        rules=tuple(map(_rule, _list(plain, "rules", len(stops) + len(resets)))),
        clocks=_clocks(plain, len(resets)),
        discrete=tuple(map(_values, _list(plain, "discrete"))),
        defaults=_defaults(plain, names[2][:count]),
        hidden=_flag(plain.get("hidden")),
        sizes=tuple(sizes),
        renamed=tuple((a, b) for a, b in map(_pair, _list(plain, "renamed"))),
        layer_widths=tuple(map(float, widths)),
        laws=tuple(_texts(plain.get("laws", []), "laws")),
        complementarity=tuple(_texts(plain.get("complementarity", []), "complementarity")),
        tables=tables,
    )
    _require_shapes(definition)
    require_consistent(definition, given=False)
    system = FilippovSystem.__new__(FilippovSystem)
    system._adopt(definition)
    system.lifted = _lifted(plain.get("lifted"))
    return system


# Expressions -------------------------------------------------------------------------------------


class _Expressions:
    """Expressions over some vectors of symbols, as an algebra of graphs."""

    def __init__(self, vectors: Sequence[ca.SX]):
        self.symbols = [listed(v) for v in vectors]
        self.constant = ca.SX
        self.apply = operation

    def symbol(self, vector: int, position: int) -> ca.SX:
        return self.symbols[vector][position]


def _symbols(names: Sequence[str]) -> ca.SX:
    return ca.vertcat(*map(ca.SX.sym, names)) if names else ca.SX(0, 1)


def _depth(nodes: Sequence[Node]) -> int:
    depth: list[int] = []
    for node in nodes:
        depth.append(1 + max((depth[k] for k in node.args), default=0))
    return max(depth, default=0)


def _expressions(plain: Mapping[str, Any], vectors: Sequence[ca.SX]) -> list[ca.SX]:
    nodes = _nodes(plain, [v.numel() for v in vectors])
    outputs = _array(plain, "outputs", np.int32)
    shapes = [_shape(s) for s in _list(plain, "shapes")]
    _require(len(OUTPUTS) - 1 <= len(shapes) <= len(OUTPUTS), "a shape of each output")
    _require(outputs.size <= MOST, f"at most {MOST} outputs")
    _require(sum(r * c for r, c in shapes) == outputs.size, "as many outputs as shapes have")
    _require(_within(outputs, len(nodes)), "outputs among the instructions")
    _require(_depth(nodes) <= DEEPEST, f"at most {DEEPEST} nested instructions")
    values = evaluate(nodes, _Expressions(vectors))
    found, first = [], 0
    for rows, columns in shapes:
        entries = [values[k] for k in outputs[first : first + rows * columns].tolist()]
        first += rows * columns
        flat = ca.vertcat(*entries) if entries else ca.SX(rows, columns)
        found.append(ca.reshape(flat, rows, columns))
    return found


def _nodes(plain: Mapping[str, Any], lengths: Sequence[int]) -> list[Node]:
    """The instructions, each of which has arguments before itself."""
    operations = _texts(plain.get("operations"), "operations")
    _require({*operations} <= {*OPERATIONS}, "operations that are known")
    op, args = _array(plain, "op", np.int32), _array(plain, "args", np.int32)
    constants: Array = _array(plain, "constants", np.float64)
    count = len(op)
    _require(count <= MOST, f"at most {MOST} instructions")
    _require(op.ndim == constants.ndim == 1 and args.shape == (count, 2), "rows of instructions")
    _require(_within(op, len(operations)), "operations in their list")
    arity = np.array([2 if name in BINARY else 1 for name in operations], int)[op]
    is_input, is_const = (
        np.array([name == which for name in operations], bool)[op] for which in ("input", "const")
    )
    limit = np.arange(count)
    limit[is_const] = constants.size
    limit[is_input] = len(lengths)
    _require(bool(np.all((args[:, 0] >= 0) & (args[:, 0] < limit))), "arguments before their use")
    limit[is_input] = np.array(lengths)[args[is_input, 0]]
    two = (arity == 2) | is_input
    within = (args[:, 1] >= 0) & (args[:, 1] < limit)
    _require(bool(np.all(within[two])), "arguments before their use")
    nodes = []
    for k, row in zip(op.tolist(), args.tolist(), strict=True):
        name = operations[k]
        if name == "const":
            nodes.append(Node(name, (), float(constants[row[0]])))
        elif name == "input":
            nodes.append(Node(name, (), tuple(row)))
        else:
            nodes.append(Node(name, tuple(row[: 2 if name in BINARY else 1])))
    return nodes


# Parts -------------------------------------------------------------------------------------------


def _require(holds: bool, what: str) -> None:
    if not holds:
        raise DefinitionError(f"system: expected {what}, received something else.")


def _list(plain: Mapping[str, Any], name: str, length: int | None = None) -> list[Any]:
    value = plain.get(name)
    fits = isinstance(value, list) and length in (None, len(value))
    _require(fits, f"a list {name!r}" + ("" if length is None else f" of {length}"))
    return value  # type: ignore[return-value]


def _array(plain: Mapping[str, Any], name: str, kind: type[Any]) -> NDArray[Any]:
    value = plain.get(name)
    if not isinstance(value, np.ndarray) or value.dtype != kind:
        raise DefinitionError(f"system: expected an array {name!r} of {np.dtype(kind)}.")
    return value


def _within(values: NDArray[Any], count: int) -> bool:
    return values.ndim == 1 and bool(np.all((values >= 0) & (values < count)))


def _texts(values: Any, what: str) -> list[str]:
    _require(isinstance(values, list), f"a list of {what}")
    for value in values:
        _require(isinstance(value, str) and "\0" not in value, f"{what} that are texts")
        value.encode()  # a lone surrogate is none; ValueError
    return list(values)


def _whole(value: Any, what: str, low: int, high: int) -> int:
    fits = type(value) is int and low <= value <= high
    _require(fits, f"{what} from {low} to {high}")
    return int(value)


def _flag(value: Any) -> bool:
    _require(isinstance(value, bool), "hidden as true or false")
    return bool(value)


def _pair(value: Any) -> tuple[str, str]:
    name, other = value if isinstance(value, list) and len(value) == 2 else (None, None)
    _texts([name, other], "names")
    return str(name), str(other)


def _directed(values: Any) -> tuple[tuple[str, int], ...]:
    """Names of stops or resets with their directions."""
    _require(isinstance(values, list), "lists of events")
    for value in values:
        _require(isinstance(value, list) and len(value) == 2, "events with their direction")
        _texts(value[:1], "names")
        _whole(value[1], "directions", -1, 1)
    return tuple((name, direction) for name, direction in values)


#: Parts of a rule in a file, after its conditions.
_RULE_FLAGS = ("level", "by_jumps", "persistent", "at_trigger")


def _plain_rule(rule: Rule) -> list[Any]:
    when = None if rule.when is None else list(rule.when)
    flags = [getattr(rule, name) for name in _RULE_FLAGS]
    return [[list(t) for t in rule.triggers], when, flags, rule.initially, list(rule.named)]


def _rule(value: Any) -> Rule:
    _require(isinstance(value, list) and len(value) == 5, "rules of five parts")
    triggers, when, flags, initially, named = value
    _require(isinstance(triggers, list) and 1 <= len(triggers) <= 2, "one or two conditions")
    _require(isinstance(flags, list) and len(flags) == len(_RULE_FLAGS), "flags of a rule")
    _require(isinstance(named, list), "states that a map names")
    return Rule(
        tuple(map(_tree, triggers)),
        None if when is None else _tree(when),
        initially=_whole(initially, "initially", -1, 1),
        named=tuple(_whole(i, "states", 0, MOST) for i in named),
        **{name: _flag(own) for name, own in zip(_RULE_FLAGS, flags, strict=True)},
    )


def _tree(value: Any) -> tuple[int, ...]:
    """A condition in postfix order, in which each operation has its two arguments."""
    _require(isinstance(value, list) and 0 < len(value) <= MOST_CODES, "conditions")
    height = 0
    for code in value:
        height += 1 if _whole(code, "codes", OR, 8 * MOST) >= 0 else -1
        _require(height > 0 and (code < 0 or code % 8 > 0), "conditions that are whole")
    _require(height == 1, "conditions that are whole")
    return tuple(value)


def _clocks(plain: Mapping[str, Any], resets: int) -> tuple[tuple[int, int], ...]:
    pairs = _list(plain, "clocks")
    for pair in pairs:
        _require(isinstance(pair, list) and len(pair) == 2, "pairs of clocks")
        _whole(pair[0], "resets", 0, resets - 1)
        _whole(pair[1], "states", 0, MOST)
    return tuple((reset, state) for reset, state in pairs)


def _values(value: Any) -> tuple[float, ...] | None:
    fits = isinstance(value, list) and value and all(map(is_real, value))
    _require(value is None or bool(fits), "values of discrete states")
    return None if value is None else tuple(map(float, value))


def _shape(value: Any) -> tuple[int, int]:
    _require(isinstance(value, list) and len(value) == 2, "shapes of two numbers")
    rows, columns = (_whole(v, "shapes", 0, MOST) for v in value)
    return rows, columns


def _defaults(plain: Mapping[str, Any], parameters: Sequence[str]) -> dict[str, float | None]:
    values = plain.get("defaults")
    fits = isinstance(values, dict) and list(values) == list(parameters)
    _require(fits, "a default of each parameter, or null")
    assert isinstance(values, dict)
    for value in values.values():
        _require(value is None or is_real(value), "defaults that are finite numbers")
    return {name: None if v is None else float(v) for name, v in values.items()}


def _plain_table(table: Table) -> list[Any]:
    curves = [[*map(np.array, (c.levels, c.pieces, c.jumps)), list(c.closed)] for c in table.curves]
    pairs = [[list(pair) for pair in sides] for sides in table.sides]
    return [table.element, curves, pairs, [list(twin) for twin in table.twins]]


def _table(value: Any) -> Table:
    element, curves, sides, twins = _parts(value, 4, "tables of four parts")
    made = Table(
        _whole(element, "functions", 0, MOST),
        tuple(_curve(own) for own in _parts(curves, None, "curves")),
        tuple(
            tuple(_wholes(p, 2) for p in _parts(own, None, "sides"))
            for own in _parts(sides, None, "sides")
        ),
    )
    _require(0 < len(made.curves) == len(made.sides), "sides of each curve")
    return replace(made, twins=tuple(_wholes(twin, 3) for twin in _parts(twins, None, "twins")))


def _curve(value: Any) -> Curve:
    *arrays, closed = _parts(value, 4, "curves of four parts")
    numbers = all(isinstance(a, np.ndarray) and a.dtype == np.float64 for a in arrays)
    _require(numbers and all(np.isfinite(a).all() for a in arrays), "numbers of a curve")
    levels, pieces, jumps = arrays
    k = len(levels) if levels.ndim == 1 else -1
    _require(pieces.shape == (k + 1, 5) and jumps.size == 4 * k, "a piece of each cell")
    _require(bool((np.diff(levels) > 0).all()), "breakpoints that increase")
    low, high = _parts(closed, 2, "ends of a curve")
    _require(k > 0 or closed == [False, False], "breakpoints at the ends of a curve")
    rows, more = (tuple(map(tuple, a.tolist())) for a in (pieces, jumps.reshape(k, 4)))
    return Curve(tuple(levels.tolist()), rows, more, (_flag(low), _flag(high)))


def _parts(value: Any, length: int | None, what: str) -> list[Any]:
    _require(isinstance(value, list) and length in (None, len(value)), what)
    return list(value)


def _wholes(value: Any, length: int) -> Any:
    return tuple(_whole(v, "surfaces", -1, MOST) for v in _parts(value, length, "numbers"))


def _lifted(value: Any) -> tuple[LiftedSwitch, ...]:
    fits = isinstance(value, tuple) and all(isinstance(s, LiftedSwitch) for s in value)
    _require(fits, "switches that were lifted")
    return tuple(value)


#: Shapes of no entry, which CasADi joins with columns of any length.
_EMPTY = {(0, 0), (0, 1), (1, 0)}


def _require_shapes(d: Definition) -> None:
    """Refuse expressions that are not as many as states, multipliers and events."""
    n, guards = d.states.numel(), len(d.stops) + len(d.resets)
    contacts = len(d.impacts)
    columns = {
        "field": n,
        "surfaces": d.multipliers.numel(),
        "whens": guards,
        "priorities": guards,
        "periods": len(d.clocks),
        "gaps": contacts,
        "restitutions": contacts,
    }
    _require(n > 0 and d.time.numel() <= 1, "states, and at most one time")
    _require(d.reactions.numel() == contacts, "a reaction of each impact")
    for name, rows in columns.items():
        shape = getattr(d, name).shape
        _require(shape == (rows, 1) or (not rows and shape in _EMPTY), f"{name} of {rows} rows")
    atoms = d.guards.numel()
    _require(
        (d.guards.shape == (atoms, 1) and atoms >= guards)
        or (not guards and d.guards.shape in _EMPTY),
        f"at least {guards} guards",
    )
    trees = [t for rule in d.rules for t in (*rule.triggers, *([rule.when] if rule.when else []))]
    _require(
        all(code < 8 * atoms for tree in trees for code in tree), "conditions of known functions"
    )
    _require(all(i < n for rule in d.rules for i in rule.named), "states that maps name")
    _require(len(d.discrete) <= n, "discrete states among the states")
    _require(all(state < n for _, state in d.clocks), "phases among the states")
    k = len(d.resets)
    _require(
        d.maps.shape == (n, k) or (not k and d.maps.shape in _EMPTY), f"maps of shape {(n, k)}"
    )
    sizes = sum(d.sizes) == d.multipliers.numel() and max(d.sizes, default=1) > 1
    _require(not d.sizes or sizes, "sizes of the sets")
    _require(len(d.layer_widths) in (0, d.surfaces.numel()), "one layer width for each surface")
    tables = [table.element for table in d.tables]
    _require(tables == [*d.functions_of("table")], "an argument of each table")
    sides = [pair for t in d.tables for own in t.sides for pair in own]
    surfaces = [i for i, _ in [*sides, *[twin[1:] for t in d.tables for twin in t.twins]]]
    _require(
        all(0 <= i < d.surfaces.numel() and i not in tables for i in surfaces), "sides of surfaces"
    )
    _require(
        all(0 <= k < len(t.levels) for t in d.tables for k, *_ in t.twins), "twins of breakpoints"
    )
    known = [law in LAWS and law != "contact" for law in d.laws]
    _require(len(known) in (0, len(d.sizes or range(d.surfaces.numel()))) and all(known), "laws")
    _require(d.hysteresis.numel() in (0, d.surfaces.numel()), "a hysteresis of each surface")
    _require(len(d.half_lines) == len(d.complementarity), "names of complementarity conditions")
    names = [*(n for n, _ in (*d.stops, *d.resets)), *d.impacts, *d.complementarity]
    _require(len({*names}) == len(names), "events of different names")
