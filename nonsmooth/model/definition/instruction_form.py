"""A system as an instruction list: numbers and texts for a file, checked when they are read.

CasADi's own text of a function is not read from files: it is not checked there, and a damaged one can
end the process.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..errors import DefinitionError
from ..expressions.float_arithmetic import BINARY
from ..expressions.graph import Expressions, Node, evaluate, instructions, shaped
from ..numbering import IMPACT_LAWS, LAWS, MOST_CODES, OPERATIONS
from ..reading import listed
from ..schema import Validator, savable, type_hints
from ..values import Array
from .elements import LARGEST
from .events.conditions import OR, Rule
from .lift import LiftedSwitch
from .parse_definition import INPUTS, OUTPUTS, PLAIN, Definition, require_consistent
from .system import FilippovSystem
from .tables.curves import Curve
from .tables.pieces import Table

#: Most instructions, and entries, of a system in a file, and most that are nested: CasADi prints nested ones
#: by recursion.
MOST, DEEPEST = 200_000, 4_000


def _require(conditions: Iterator[tuple[bool, str]]) -> None:
    """Raise DefinitionError for the first condition that is false."""
    for holds, what in conditions:
        if not holds:
            raise DefinitionError(f"system: expected {what}, received something else.")


def _depth(nodes: Sequence[Node]) -> int:
    depth: list[int] = []
    for node in nodes:
        depth.append(1 + max((depth[k] for k in node.args), default=0))
    return max(depth, default=0)


@savable(
    check=lambda graph: _require(graph.conditions()),
    op="k",
    args="k 2",
    constants="c nan",
    outputs="o",
)
@dataclass(frozen=True)
class Graph:
    """Expressions of symbols as instructions, each of which has arguments before itself."""

    names: tuple[tuple[str, ...], ...]  # of the symbols of each vector
    operations: tuple[str, ...]
    op: NDArray[np.int32]  # positions in ``operations``
    args: NDArray[
        np.int32
    ]  # instructions; of an input its vector and index; of a constant its index
    constants: Array
    outputs: NDArray[np.int32]  # instructions of the entries of all expressions
    shapes: tuple[tuple[int, int], ...]  # of the expressions

    @classmethod
    def of(cls, inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]) -> Graph:
        """Write expressions down."""
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
        return cls(
            names=tuple(tuple(map(str, listed(v))) for v in inputs),
            operations=tuple(operations),
            op=np.array([operations.index(node.op) for node in nodes], np.int32),
            args=args,
            constants=np.array(constants, float),
            outputs=np.array([k for row in rows for k in row], np.int32),
            shapes=tuple(e.shape for e in outputs),
        )

    def conditions(self) -> Iterator[tuple[bool, str]]:
        """Conditions on the numbers, besides their types and shapes."""
        every = [name for names in self.names for name in names]
        yield all("\0" not in name.encode().decode() for name in every), "names of symbols"
        yield {*self.operations} <= {*OPERATIONS}, "operations that are known"
        yield len(self.op) == len(self.args) <= MOST, f"at most {MOST} instructions"
        yield self.outputs.size <= MOST, f"at most {MOST} outputs"
        yield _within(self.op, len(self.operations)), "operations in their list"
        sizes = [r * c for r, c in self.shapes if r >= 0 and c >= 0]
        yield len(sizes) == len(self.shapes), "shapes that are not negative"
        yield sum(sizes) == self.outputs.size, "as many outputs as shapes have"
        yield _within(self.outputs, len(self.op)), "outputs among the instructions"
        is_input, is_const, is_double = (
            np.array([name in which for name in self.operations], bool)[self.op]
            for which in (("input",), ("const",), BINARY)
        )
        limit = np.arange(len(self.op))
        limit[is_const] = self.constants.size
        limit[is_input] = len(self.names)
        yield _within(self.args[:, 0], limit), "arguments before their use"
        limit[is_input] = np.array([len(names) for names in self.names])[self.args[is_input, 0]]
        two = is_double | is_input
        yield _within(self.args[two, 1], limit[two]), "arguments before their use"
        yield _depth(self.nodes) <= DEEPEST, f"at most {DEEPEST} nested instructions"

    @property
    def nodes(self) -> list[Node]:
        """The instructions."""
        made = list[Node]()
        for k, row in zip(self.op.tolist(), self.args.tolist(), strict=True):
            name = self.operations[k]
            if name == "const":
                made.append(Node(name, (), float(self.constants[row[0]])))
            elif name == "input":
                made.append(Node(name, (), tuple(row)))
            else:
                made.append(Node(name, tuple(row[: 2 if name in BINARY else 1])))
        return made

    def read(self) -> tuple[list[ca.SX], list[ca.SX]]:
        """New symbols, and the expressions in them."""
        vectors = [
            ca.vertcat(*map(ca.SX.sym, names)) if names else ca.SX(0, 1) for names in self.names
        ]
        values = evaluate(self.nodes, Expressions([listed(v) for v in vectors]))
        outputs = [ca.SX(*shape) for shape in self.shapes]
        return vectors, shaped(outputs, [values[k] for k in self.outputs.tolist()])


def _within(values: NDArray[Any], count: int | NDArray[Any]) -> bool:
    return bool(np.all((values >= 0) & (values < count)))


def written(system: FilippovSystem) -> dict[str, Any]:
    """Return values from which ``read_system`` makes an equal system."""
    d = system.written
    inputs, outputs = ([getattr(d, name) for name in names] for names in (INPUTS, OUTPUTS))
    plain = {name: getattr(d, name) for name in PLAIN}
    return {"graph": Graph.of(inputs, outputs), "plain": plain, "lifted": system.lifted}


def read_system(values: Any) -> FilippovSystem:
    """Make the system that ``written`` described; ValueError for anything else."""
    graph, plain, lifted = (values[name] for name in ("graph", "plain", "lifted"))
    hints = {"graph": Graph, "lifted": tuple[LiftedSwitch, ...], **type_hints(Definition)}
    parts: Mapping[str, Any] = {"graph": graph, "lifted": lifted, **plain}
    Validator().require_parts("system", parts, hints, {})
    sizes = (len(graph.names), len(graph.shapes), {*plain}) == (len(INPUTS), len(OUTPUTS), {*PLAIN})
    _require(iter([(sizes, "the parts of a definition")]))
    vectors, expressions = graph.read()
    symbols = dict(zip((*INPUTS, *OUTPUTS), (*vectors, *expressions), strict=True))
    definition = Definition(**symbols, **plain)
    _require(_conditions(definition))
    require_consistent(definition, given=False)
    return FilippovSystem._of(definition, lifted)


# Conditions of the parts of a definition ------------------------------------------------------------


def _of_curve(curve: Curve) -> Iterator[tuple[bool, str]]:
    k = len(curve.levels)
    own = [*map(len, curve.pieces)], [*map(len, curve.jumps)]
    yield own == ([5] * (k + 1), [4] * k), "a piece of each cell"
    yield all(a < b for a, b in pairwise(curve.levels)), "breakpoints that increase"
    yield k > 0 or not any(curve.closed), "breakpoints at the ends of a curve"


def _of_table(table: Table) -> Iterator[tuple[bool, str]]:
    yield 0 < len(table.curves) == len(table.sides), "sides of each curve"


def _of_rule(rule: Rule) -> Iterator[tuple[bool, str]]:
    yield 1 <= len(rule.triggers) <= 2 and rule.initially in (-1, 0, 1), "one or two conditions"
    for tree in (*rule.triggers, *([] if rule.when is None else [rule.when])):
        heights = [*accumulate(1 if code >= 0 else -1 for code in tree)]
        whole = 0 < len(tree) <= MOST_CODES and min(heights) > 0 and heights[-1] == 1
        yield whole, "conditions that are whole"
        yield all(OR <= code and (code < 0 or code % 8 > 0) for code in tree), "codes of conditions"


for _cls, _own in ((Curve, _of_curve), (Table, _of_table), (Rule, _of_rule)):
    savable(check=lambda value, own=_own: _require(own(value)))(_cls)  # type: ignore[misc]
savable()(LiftedSwitch)


#: Shapes of no entry, which CasADi joins with columns of any length.
_EMPTY = {(0, 0), (0, 1), (1, 0)}


def _conditions(d: Definition) -> Iterator[tuple[bool, str]]:
    """Conditions of CasADi and of the driver on a definition, beside those of ``require_consistent``."""
    n, m, guards, k = d.states.numel(), d.surfaces.numel(), len(d.rules), len(d.resets)
    yield guards == len(d.stops) + k, "a rule of each event"
    columns = {
        "field": n,
        "surfaces": d.multipliers.numel(),
        "whens": guards,
        "priorities": guards,
        "periods": len(d.clocks),
        "reactions": len(d.impacts),
        "gaps": len(d.impacts),
        "restitutions": len(d.impacts),
        "guards": d.guards.numel(),
        "hysteresis": m if d.hysteresis.numel() else 0,
    }
    yield n > 0 and d.time.numel() <= 1, "states, and at most one time"
    for name, rows in columns.items():
        shape = getattr(d, name).shape
        yield shape == (rows, 1) or (not rows and shape in _EMPTY), f"{name} of {rows} rows"
    yield d.maps.shape == (n, k) or (not k and d.maps.shape in _EMPTY), f"maps of shape {(n, k)}"
    yield d.guards.numel() >= guards, f"at least {guards} guards"
    codes = [code for r in d.rules for tree in (*r.triggers, r.when or ()) for code in tree]
    yield all(code < 8 * d.guards.numel() for code in codes), "conditions of known functions"
    yield all(0 <= i < n for rule in d.rules for i in rule.named), "states that maps name"
    yield all(way in (-1, 0, 1) for _, way in (*d.stops, *d.resets)), "directions"
    yield all(0 <= r < k and 0 <= x < n for r, x in d.clocks), "phases among the states"
    yield len(d.discrete) <= n and () not in d.discrete, "discrete states among the states"
    sizes = all(1 <= size <= LARGEST for size in d.sizes) and max(d.sizes, default=2) > 1
    yield not d.sizes or (sizes and sum(d.sizes) == m), "sizes of the sets"
    known = [law in LAWS and law != "contact" for law in d.laws]
    yield len(known) in (0, len(d.sizes or range(m))) and all(known), "laws"
    yield d.impact_law in IMPACT_LAWS, "a law of impacts"
    yield len(d.layer_widths) in (0, m), "one layer width for each surface"
    yield all(width > 0 for width in d.layer_widths), "layer widths that are positive"
    yield len(d.half_lines) == len(d.complementarity), "names of complementarity conditions"
    joints = range(m - len(d.constraints), m)
    yield d.functions_of("joint") == (*joints,), "joints at the end of the functions"
    yield from _of_tables(d)
    names = [*(n for n, _ in (*d.stops, *d.resets)), *d.impacts, *d.complementarity]
    yield len({*names}) == len(names), "events of different names"


def _of_tables(d: Definition) -> Iterator[tuple[bool, str]]:
    own = d.names["parameters"]
    count = len(own) - sum(len(table.curves) for table in d.tables)
    yield count >= 0 and [*d.defaults] == own[:count], "a default of each parameter, or null"
    elements = [table.element for table in d.tables]
    yield elements == [*d.functions_of("table")], "an argument of each table"
    sides = [
        pair for t in d.tables for own in (*t.sides, [twin[1:] for twin in t.twins]) for pair in own
    ]
    others = {*range(d.surfaces.numel())} - {*elements}
    yield all(i in others and side in (-1, 1) for i, side in sides), "sides of surfaces"
    twins = [0 <= k < len(t.levels) for t in d.tables for k, *_ in t.twins]
    yield all(twins), "twins of breakpoints"
