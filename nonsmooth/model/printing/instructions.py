"""A system as lists of instructions, which the interpreter in C runs without compilation.

``Values`` is a graph node by node, ``Series`` one by its Taylor rules, ``Instructions`` all functions of a system
that a driver calls, in any mode (``model.coupled``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import NamedTuple, cast

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..expressions.graph import Node, depends_on, instructions, reached
from ..expressions.long_sums import LongSums
from ..expressions.simplification import simplified
from ..expressions.sums import summed, with_long_sums, written_out
from ..expressions.taylor_rules import Rule, entered, lower
from ..laws.coupled import Coupled
from ..numbering import OPERATIONS, TAYLOR_RULES
from ..values import Array

Integers = NDArray[np.int32]


@dataclass(frozen=True)
class Values:
    """Nodes of a graph."""

    op: Integers
    a: Integers  # arguments of the operation; vector and position of an input
    b: Integers
    constant: Array
    still: Integers  # nodes that are evaluated once for given parameters, in order
    moving: Integers  # those that are evaluated at every point
    free: Integers  # those of the latter that suffice where nothing slides
    outputs: Integers
    paired: Integers  # whether each is two numbers where the time is; see ``flow/core/pairs.h``
    nodes: Sequence[Node]  # the same nodes, to be printed


#: A rule and a term of a sum as C reads them; see ``flow/core/programs.h``.
_INTEGERS = "rule later op w a b c paired begin from to end".split()
RULE = np.dtype([(name, np.int32) for name in _INTEGERS] + [("first", float), ("second", float)])
TERM = np.dtype([("factor", float), *[(name, np.int32) for name in ("a", "b", "kind", "pad")]])

#: Lists of rules; see ``flow/core/programs.h``.
LISTS = "still values moving later late early loop loop_late before after".split()


@dataclass(frozen=True)
class Series:
    """Rules of power series as C reads them."""

    rule: NDArray[np.void]
    term: NDArray[np.void]
    input: Integers
    index: Integers
    outputs: Integers
    lists: Mapping[str, Integers]
    program: Program

    @cached_property
    def printed(self) -> tuple[Sequence[Rule], Sequence[Sequence[int]]]:
        """Rules and numbers of those of each output, to be printed."""
        return self.program.printed()


@dataclass(frozen=True)
class Entries:
    """Row and column indices of the nonzero entries of a matrix."""

    row: Integers
    column: Integers


@dataclass(frozen=True)
class Instructions:
    """Data of a system for the driver in C; see ``System`` in ``flow/core/state.c``."""

    series: Series
    free: Series
    point: Values
    surfaces: Values
    maps: Values
    atoms: Values
    choices: Values
    restitution: Values
    columns: Values
    slope: Entries
    layer_gradient: Entries
    height_gradient: Entries
    stop_gradient: Entries
    factor_gradient: Entries
    surface_gradient: Entries
    atom_gradient: Entries
    column: Entries
    component: Integers
    slope_output: Integers
    slope_moves: Integers
    slope_symmetric: Integers
    slope_outputs: int


def instructions_of(coupled: Coupled) -> Instructions:
    """Write a system as lists of instructions."""
    system, d = coupled.system, coupled.system.definition
    x, p = system.extended_states, system.parameter_symbols
    slope, gradients = sparse_entries(coupled.slope), [_by_rows(g) for g in coupled.gradients]
    matrices = [slope, *gradients]
    kept = coupled.kept
    surface_gradient = (
        sparse_entries(ca.jacobian(kept, x)) if kept.numel() else sparse_entries(ca.SX(0, 1))
    )
    column = sparse_entries(coupled.columns_of_field)
    atoms = d.guards if d.guards.numel() else ca.SX(0, 1)
    gradient = sparse_entries(ca.jacobian(atoms, x) if d.guards.numel() else ca.SX(0, x.numel()))
    output, moves, slopes = _moving_slopes(coupled)
    every = coupled.parameter_symbols
    point = [coupled.layer, coupled.factors, *[nonzeros for nonzeros, _ in matrices]]
    series, free = _series_of_modes(coupled, slopes)
    time = _time_of(coupled)
    return Instructions(
        series=series,
        free=free,
        point=values_of([coupled.moving, every], coupled.awake(point), (4, 5), time),
        surfaces=values_of([x, p], [kept, surface_gradient[0]], (), time),
        maps=values_of([x, p], [d.maps], (), time),
        atoms=values_of([x, p], [atoms, gradient[0]], (), time),
        choices=values_of([x, p], [d.whens, d.priorities, d.periods], (), time),
        restitution=values_of([x, p], [d.restitutions], (), time),
        columns=values_of([coupled.moving, every], coupled.awake([column[0]]), (), time),
        slope=slope[1],
        layer_gradient=gradients[0][1],
        height_gradient=gradients[1][1],
        stop_gradient=gradients[2][1],
        factor_gradient=gradients[3][1],
        surface_gradient=surface_gradient[1],
        atom_gradient=gradient[1],
        column=column[1],
        component=_components(surface_gradient[1], kept.numel()),
        slope_output=output,
        slope_moves=moves,
        slope_symmetric=_integers(coupled.slope_symmetric.ravel()),
        slope_outputs=slopes.numel(),
    )


def _time_of(coupled: Coupled) -> int | None:
    """Position of the time among the states."""
    system = coupled.system
    return system.dimension if system.time_dependent else None


def values_of(
    inputs: Sequence[ca.SX],
    outputs: Sequence[ca.SX],
    free: Sequence[int] = (),
    time: int | None = None,
) -> Values:
    """Write expressions in two vectors of symbols, of which the first moves."""
    nodes, rows = instructions(inputs, outputs)
    moving = depends_on(nodes, [True, False])
    number = {op: k for k, op in enumerate(OPERATIONS)}
    op, constant = [number[node.op] for node in nodes], np.zeros(len(nodes))
    args = np.zeros((len(nodes), 2), np.int32)
    for j, node in enumerate(nodes):
        if node.op == "const":
            constant[j] = cast("float", node.payload)
        elif node.op == "input":
            args[j] = node.source
        else:
            args[j, : len(node.args)] = node.args
    is_time = [node.op == "input" and node.source == (0, time) for node in nodes]
    return Values(
        op=_integers(op),
        a=_integers(args[:, 0]),
        b=_integers(args[:, 1]),
        constant=constant,
        still=_where(moving, False),
        moving=_where(moving, True),
        free=_reached([node.args for node in nodes], moving, [j for k in free for j in rows[k]]),
        outputs=_integers([j for row in rows for j in row]),
        paired=_paired([node.op for node in nodes], [node.args for node in nodes], is_time),
        nodes=nodes,
    )


#: Operations and rules with two numbers; others have one, of two arguments.
_KEEP_PAIRS = frozenset(
    "assign neg twice sq inv add sub mul div fabs fmin fmax fmod if_else_zero sum chosen".split()
)


def _paired(
    names: Sequence[str], arguments: Sequence[Sequence[int]], is_time: Sequence[bool]
) -> Integers:
    """Nodes that are the time or follow from it by arithmetic, or have such an argument."""
    kept = list(is_time)
    found = list(is_time)
    for j, (name, own) in enumerate(zip(names, arguments, strict=True)):
        found[j] |= any(kept[a] for a in own)
        kept[j] |= found[j] and name in _KEEP_PAIRS
    return _integers(found)


def series_of(inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]) -> Series:
    """Write the Taylor rules of expressions in two vectors, of which the first moves."""
    program = _rules_of(inputs, outputs)
    return _series(program, range(len(outputs)), lambda _: True, lambda _: False)


def _series_of_modes(coupled: Coupled, slopes: ca.SX) -> tuple[Series, Series]:
    """Rules of any mode, and those of a mode without sliding, with the same numbers."""
    n, m = coupled.system.extended_dimension, coupled.system.surface_count
    program = _rules_of(*coupled.series([slopes]), coupled.sums)
    of_sets = {n + i for i in coupled.system.set_of}
    held = {n + i for i in range(m) if coupled.scaled[i]} - of_sets
    time = _time_of(coupled)
    every = _series(program, range(6), lambda k: k not in held, lambda k: k >= n, time)
    free = (0, 1, 2, 4) if of_sets else (0, 2, 4)
    follow = lambda k: k in of_sets
    return every, _series(program, free, lambda k: k < n or follow(k), follow, time)


class Program(NamedTuple):
    """Rules of expressions and the numbers of those of each output, and the same with sums."""

    plain: list[Rule]
    plain_rows: list[list[int]]
    rules: list[Rule]
    rows: list[list[int]]
    sums: LongSums | None
    first: int  # input of the first long sum

    def printed(self) -> tuple[list[Rule], list[list[int]]]:
        """Rules before products are summed."""
        if self.sums is None:
            return self.plain, self.plain_rows
        return written_out(self.plain, self.plain_rows, self.sums, self.first)


def _rules_of(
    inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], sums: LongSums | None = None
) -> Program:
    """Rules of expressions, of which the last inputs and the first outputs are those of long sums."""
    outputs = [ca.densify(o) for o in outputs]
    nodes, rows = instructions(inputs, simplified(inputs, outputs, [True, False]))
    plain, rule_of = lower(nodes, depends_on(nodes, [True, False]))
    plain_rows = [[rule_of[j] for j in row] for row in rows]
    rules, rows = summed(plain, plain_rows)
    first = inputs[0].numel() - (0 if sums is None else sums.symbols.numel())
    if sums is not None:
        rules, rows = with_long_sums(rules, rows, sums, first), rows[1:]
    return Program(plain, plain_rows, rules, rows, sums, first)


def derived_series_of(coupled: Coupled) -> tuple[Series, Series, Entries]:
    """Rules of any mode and its derivatives, and those without sliding; indices of the derivatives in their matrix."""
    n, size = coupled.system.extended_dimension, coupled.moving.numel()
    derivatives, entries = sparse_entries(coupled.derivatives)
    outputs = [*coupled.outputs, _moving_slopes(coupled)[2], derivatives]
    inputs = [coupled.moving, coupled.parameter_symbols]
    program = _rules_of(inputs, coupled.awake(outputs))
    of_sets, time = {n + i for i in coupled.system.set_of}, _time_of(coupled)
    held = {n + i for i, own in enumerate(coupled.scaled) if own} - of_sets
    follow = lambda k: k in of_sets
    rows = list(zip(program.rows[-1], entries.row.tolist(), entries.column.tolist(), strict=True))
    layer = n + coupled.count

    def derived(last: int, own: Sequence[tuple[int, int, int]]) -> tuple[list[int], list[int]]:
        """Rules of derivatives along a step, and of those of surfaces, gaps and factors, which are read at points."""
        return [j for j, i, _ in own if i < last], [j for j, i, _ in own if i >= layer]

    moves, target = (lambda k: k not in held), range(len(outputs) - 1)
    every = _series(program, target, moves, lambda k: n <= k < size, time, *derived(layer, rows))
    rows = [own for own in rows if not n <= own[2] < size or follow(own[2])]
    some, last = ((0, 1, 2, 4), layer) if of_sets else ((0, 2, 4), n)
    moves = lambda k: k < n or follow(k)
    free = _series(program, some, moves, follow, time, *derived(last, rows))
    return every, free, entries


def _series(
    program: Program,
    target: Sequence[int],
    moves: Callable[[int], bool],
    unknown: Callable[[int], bool],
    time: int | None = None,
    more: Sequence[int] = (),
    valued: Sequence[int] = (),
) -> Series:
    """Rules as the interpreter reads them, with ``more`` whose later coefficients are read only if they move, and some
    that are ``valued`` only."""
    rules, rows = program.rules, program.rows
    still = [_is_still(rule) for rule in rules]
    change = [not own for own in still]
    moving, late = entered(rules, moves), entered(rules, lambda k: unknown(k) and moves(k))
    timed = entered(rules, lambda k: k == time)
    varied = entered(rules, lambda k: k != time and moves(k))
    is_input = [rule.rule == "input" and rule.source[0] == 0 for rule in rules]
    is_time = [rule.source == (0, time) for rule in rules]
    arguments = [rule.args for rule in rules]
    roots = [j for k in target for j in rows[k]]
    found = reached(arguments, change, [*roots, *more, *valued])
    series = reached(arguments, change, [*roots, *more])
    # Constant nodes have later coefficients, zeros, only where they are read.
    read = [*roots, *(a for j in series if rules[j].rule == "atan2" for a in rules[j].args)]
    zeros = reached(arguments, change, [j for j in read if not moving[j]])
    needed = {*zeros, *(j for j in series if moving[j])}
    term = _terms(rules, moving)
    rule, second = _written(rules, term["kind"], moving, _lines(rules, still, is_time), needed)
    rule["paired"] = _paired([rule.rule for rule in rules], arguments, is_time)
    later = [j for j in sorted(needed) if not is_input[j] and j not in second]
    looped = set(reached(arguments, change, [j for k in target if k < 2 for j in rows[k]]))
    before = {j for j in later if timed[j] and not varied[j]}
    after = {*later} - looped - before
    before, after = (
        set() if _are_knotted(rules, some, second) else some for some in (before, after)
    )
    loop = [j for j in later if j not in before and j not in after]
    values = reached([_valued(rule) for rule in rules], change, [*roots, *more, *valued])
    lists = {
        "still": [j for j, own in enumerate(still) if own],
        "values": [j for j in values if not is_input[j]],
        "moving": [j for j in found if not is_input[j]],
        "later": later,
        "late": [j for j in later if late[j]],
        "early": [j for j in later if not late[j]],
        "loop": loop,
        "loop_late": [j for j in loop if late[j]],
        "before": sorted(before),
        "after": sorted(after),
    }
    inputs = sorted((rules[j].source[1], j) for j in found if is_input[j])
    return Series(
        rule=rule,
        term=term,
        input=_integers([j for _, j in inputs]),
        index=_integers([k for k, _ in inputs]),
        outputs=_integers([j for row in rows for j in row]),
        lists={name: _integers(own) for name, own in lists.items()},
        program=program,
    )


def _written(
    rules: Sequence[Rule],
    kinds: Integers,
    moving: Sequence[bool],
    lines: Sequence[bool],
    needed: set[int],
) -> tuple[NDArray[np.void], set[int]]:
    """Rules by number, and which of them are written with the one before: a sine and its cosine."""
    operations = {op: k for k, op in enumerate(OPERATIONS)}
    numbers_of = {name: k for k, name in enumerate(TAYLOR_RULES)}
    made, begin, second = [], 0, set[int]()
    for j, rule in enumerate(rules):
        name, args, numbers = rule.rule, rule.args, rule.numbers
        positions = (begin, begin, begin, begin)
        if name == "sum":
            end = begin + len(numbers)
            name, first, last = _sum_named(kinds[begin:end].tolist())
            args, numbers, positions = (), (), (begin, begin + first, begin + last, end)
            begin = end
        elif name == "input":
            args, positions = (), (rule.source[1],) * 4
        elif name == "integral":
            name = "turn" if lines[args[0]] else name
            if args[1] == j + 1 in needed and rules[j + 1].args == (args[0], j):
                name = "pair" if name == "integral" else "turns"
                numbers = (*numbers, *rules[j + 1].numbers)
                second.add(j + 1)
        elif name in _SPECIAL:
            at_rest = (s for s, a in zip(_SPECIAL[name], args, strict=True) if s and not moving[a])
            name = next(at_rest, name)
        own = numbers_of[rule.rule], numbers_of[name], operations.get(_operation(rule), 0), j
        made.append((*own, *(*args, 0, 0, 0)[:3], 0, *positions, *(*numbers, 0.0, 0.0)[:2]))
    return np.array(made, RULE), second


def _sum_named(kinds: Sequence[int]) -> tuple[str, int, int]:
    """By which rule later coefficients of a sum follow, and from which of its terms."""
    moving = [k for k, kind in enumerate(kinds) if kind]
    first, last = (moving[0], moving[-1] + 1) if moving else (0, 0)
    if set(kinds[first:last]) != {1}:
        return "sum", first, last
    return ("linear" if last - first > 4 else f"linear{last - first}"), first, last


#: Name of a rule where its first, or its second, argument does not move.
_SPECIAL = {"div": ("under", "over"), "chosen": ("gated", "")}


def _terms(rules: Sequence[Rule], moving: Sequence[bool]) -> NDArray[np.void]:
    """Terms of all sums; a constant factor is the second one."""
    sums = [rule for rule in rules if rule.rule == "sum"]
    args = np.fromiter(chain.from_iterable(rule.args for rule in sums), int).reshape(-1, 2)
    a, b, moves = args[:, 0], args[:, 1], np.array(moving, bool)
    made = np.zeros(len(args), TERM)
    made["factor"] = np.fromiter(chain.from_iterable(rule.numbers for rule in sums), float)
    made["a"], made["b"] = np.where(moves[a], a, b), np.where(moves[a], b, a)
    made["kind"] = moves[a].astype(int) + moves[b] + (moves[a] & (a == b))
    return made


def _are_knotted(rules: Sequence[Rule], some: set[int], second: set[int]) -> bool:
    """Whether some rules need coefficients of one another, so that their orders follow one after the other."""
    return any(a > j and a not in second for j in some for a in rules[j].args)


def _valued(rule: Rule) -> tuple[int, ...]:
    """Rules from which the value of a rule follows."""
    return rule.args[: {"integral": 1, "quotient": 1, "atan2": 2}.get(rule.rule, len(rule.args))]


def _operation(rule: Rule) -> str:
    """The operation of a rule's first coefficient."""
    return rule.operation or {"power": "pow", "chosen": "if_else_zero"}.get(rule.rule, rule.rule)


def _reached(
    arguments: Sequence[Sequence[int]], target: Sequence[bool], roots: Sequence[int]
) -> Integers:
    return _integers(reached(arguments, target, roots))


def _is_still(rule: Rule) -> bool:
    return rule.rule in ("constant", "apply") or (rule.rule == "input" and rule.source[0] == 1)


def _lines(rules: Sequence[Rule], still: Sequence[bool], is_time: Sequence[bool]) -> list[bool]:
    """Which rules are affine in the time: their series end with the second coefficient."""
    found: list[bool] = []
    for j, rule in enumerate(rules):
        line = still[j] or is_time[j]
        if rule.rule == "sum":
            pairs = zip(rule.args[::2], rule.args[1::2], strict=True)
            line = all((still[a] and found[b]) or (found[a] and still[b]) for a, b in pairs)
        elif rule.rule == "div":
            line = line or (found[rule.args[0]] and still[rule.args[1]])
        found.append(line)
    return found


def sparse_entries(matrix: ca.SX) -> tuple[ca.SX, Entries]:
    """Nonzero entries of a matrix as a column, and their indices."""
    rows, columns = matrix.sparsity().row(), matrix.sparsity().get_col()
    nonzeros = ca.vertcat(*matrix.nonzeros()) if rows else ca.SX(0, 1)
    return nonzeros, Entries(_integers(rows), _integers(columns))


def _by_rows(matrix: ca.SX) -> tuple[ca.SX, Entries]:
    """The same, row after row."""
    nonzeros, positions = sparse_entries(matrix.T)
    return nonzeros, Entries(positions.column, positions.row)


def _moving_slopes(coupled: Coupled) -> tuple[Integers, Integers, ca.SX]:
    """Series that the stability of sliding is read from."""
    output, moves = np.full((coupled.count, coupled.count), -1), coupled.slope_moves
    weighted = any(coupled.scaled) and not coupled.slope_symmetric.all()
    if not moves.any() and not weighted:
        return _integers(output.ravel()), _integers(moves.ravel()), ca.SX(0, 1)
    sparsity = coupled.slope.sparsity()
    output[sparsity.row(), sparsity.get_col()] = range(sparsity.nnz())
    own = ca.vertcat(*coupled.slope.nonzeros())
    return _integers(output.ravel()), _integers(moves.ravel()), own


def _components(gradient: Entries, rows: int) -> Integers:
    """Number of the group of each row: rows of different groups have no column in common."""
    group = list(range(rows))

    def root(i: int) -> int:
        while group[i] != i:
            group[i] = group[group[i]]
            i = group[i]
        return i

    first: dict[int, int] = {}
    for i, j in zip(gradient.row.tolist(), gradient.column.tolist(), strict=True):
        group[root(i)] = root(first.setdefault(j, i))
    return _integers([root(i) for i in range(rows)])


def _where(flags: Sequence[bool], target: bool) -> Integers:
    return _integers([j for j, flag in enumerate(flags) if flag == target])


def _integers(values: Sequence[int] | NDArray[np.generic]) -> Integers:
    return np.ascontiguousarray(values, dtype=np.int32)
