"""The jet of all modes of one surface at once, for trajectories that take steps together (lanes).

Lanes of a vector may be in different modes. Instead of expanding every mode and choosing at the
end, the expansion is shared: subexpressions common to the modes are expanded once, and at every
order each state takes its next coefficient from the field of its lane's mode. Two symbols carry the
mode: a mask that is true while sliding, and lambda = +1 or -1 (with a mask of its sign).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ..definition.system import FilippovSystem
from ..expressions.dependent_rows import in_span
from ..expressions.graph import instructions
from ..expressions.jets import Coefficient, expansion_of, scaled, value_of
from ..laws.motion import motion

#: A field made of these is as safe to evaluate at lambda = +-1 as at a fixed sign.
_ENTIRE = {"const", "input", "add", "sub", "mul", "neg", "sq", "twice", "sin", "cos", "not"}


@dataclass(frozen=True)
class Blend:
    """Symbols and jets."""

    extra: ca.SX
    states: ca.SX
    guards: ca.SX
    affine: list[bool]
    checked: tuple[tuple[int, ...], tuple[int, ...]]


def blended_jet(system: FilippovSystem, order: int) -> Blend:
    """Expand the modes ``+``, ``-`` and ``s`` of a system with one surface together."""
    # A system without surfaces has one mode; its masks are not used.
    slides, above, lam = (ca.SX.sym(n) for n in ("slides_", "above_", "lambda_"))
    extra = ca.vertcat(slides, above, lam)
    stops = (
        ca.densify(system.definition.guards) if system.definition.guards.numel() else ca.SX(0, 1)
    )
    if system.surface_count:
        sides = _side_fields(system, lam)
        sliding = motion(system, "s")
        h = system.surface_function(0)
        plus, minus = system.lie_derivative("+"), system.lie_derivative("-")
        field = sliding.field if sliding.regular else _kept_alone(system, h, sliding.field)
        fields = [*sides, field]
        functions = ca.vertcat(lam * h, -plus, minus, stops)
    else:
        fields, functions = [system.field("")], stops
    others = ca.vertcat(system.parameter_symbols, extra)
    expansion = expansion_of([ca.vertcat(*fields), functions], system.extended_states, others)
    n = int(system.extended_states.numel())
    jet: list[list[Coefficient]] = [[system.extended_states[i]] for i in range(n)]
    values: list[list[Coefficient]] = []
    for k in range(order + 1):
        flat, outputs = expansion.advance(k, [c[k] for c in jet])
        rows = [flat[i : i + n] for i in range(0, len(flat), n)]
        values.append(_choose_guards(system, outputs, slides))
        if k < order:
            for i in range(n):
                jet[i].append(scaled(_choose([r[i] for r in rows], slides, above), 1.0 / (k + 1)))
    states = ca.vertcat(*[ca.horzcat(*[value_of(c) for c in row]) for row in jet])
    columns = [ca.vertcat(*[value_of(c) for c in column]) for column in values]
    guards = ca.horzcat(*columns) if columns[0].numel() else ca.SX(0, order + 1)
    checked = _checked(system, fields)
    return Blend(extra, states, guards, _affine(system), checked)


def _kept_alone(system: FilippovSystem, h: ca.SX, sliding: ca.SX) -> ca.SX:
    """A sliding field with the rate of h written out, where h is a function of one state and the time."""
    # Rounding in it would move what rests for as long as it rests.
    n, gradient, field = system.dimension, ca.jacobian(h, system.extended_states), ca.SX(sliding)
    own = [i for i in range(n) if not gradient[i].is_zero()]
    if len(own) == 1:
        by_time = gradient[n] if system.time_dependent else ca.SX(0)
        field[own[0]] = -by_time / gradient[own[0]]
    return field


def _checked(
    system: FilippovSystem, fields: list[ca.SX]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Rows of the field that are not affine in every mode, and guards that are no combination of them."""
    # Rows that are combinations of the others are left out.
    x, p = system.extended_states, system.parameter_symbols
    rows = [i for i in range(x.numel()) if not all(ca.is_linear(f[i], x) for f in fields)]
    modes = [motion(system, mode).field for mode in ("+-s" if system.surface_count else ("",))]
    for i in reversed(rows):
        others = [j for j in rows if j != i]
        if all(in_span([f[i]], [f[j] for j in others], x, p)[0] for f in modes):
            rows = others
    stops = ca.vertsplit(system.definition.guards) if system.definition.guards.numel() else []
    if not system.surface_count:
        wanted = [(k, stop, "") for k, stop in enumerate(stops)]
    else:
        lie = [system.lie_derivative(side) for side in "+-"]
        wanted = [(0, system.surface_function(0), "+"), (0, system.surface_function(0), "-")]
        wanted += [(0, lie[0], "s"), (1, lie[1], "s")]
        wanted += [(2 + k, stop, mode) for k, stop in enumerate(stops) for mode in "+-s"]
    slots = set()
    for slot, function, mode in wanted:
        field = motion(system, mode).field
        bent = [field[i] for i in range(x.numel()) if not ca.is_linear(field[i], x)]
        if not ca.is_linear(function, x) and not in_span([function], bent, x, p)[0]:
            slots.add(slot)
    return tuple(rows), tuple(sorted(slots))


def _side_fields(system: FilippovSystem, lam: ca.SX) -> list[ca.SX]:
    """One field in lambda if that is cheaper than two, and safe; else those of both sides."""
    inputs = [system.extended_states, ca.vertcat(system.parameter_symbols, lam)]
    pair = [system.field("+"), system.field("-")]
    one = system.field_with(lam)
    nodes, _ = instructions(inputs, [one])
    separate, _ = instructions(inputs, pair)
    if len(nodes) < len(separate) + _different(*pair) and {node.op for node in nodes} <= _ENTIRE:
        return [one]
    return pair


def _different(a: ca.SX, b: ca.SX) -> int:
    """Rows that would need a choice at every order."""
    pairs = zip(ca.vertsplit(a), ca.vertsplit(b), strict=True)
    return sum(not ca.is_equal(u, v, 5) for u, v in pairs)


def _choose(rows: list[Coefficient], slides: ca.SX, above: ca.SX) -> Coefficient:
    """Coefficient of the lane's mode: rows are [sides, sliding], [+, -, sliding] or [only]."""
    if len(rows) == 1:
        return rows[0]
    side = rows[0] if len(rows) == 2 else _select(above, rows[0], rows[1])
    return _select(slides, rows[-1], side)


def _select(mask: ca.SX, a: Coefficient, b: Coefficient) -> Coefficient:
    if (a is None and b is None) or (a is not None and b is not None and ca.is_equal(a, b, 1)):
        return a
    return ca.if_else(mask, value_of(a), value_of(b))


def _choose_guards(
    system: FilippovSystem, outputs: list[Coefficient], slides: ca.SX
) -> list[Coefficient]:
    if not system.surface_count:
        return outputs
    surface, plus, minus, *stops = outputs
    return [_select(slides, plus, surface), minus, *stops]


def _affine(system: FilippovSystem) -> list[bool]:
    x = system.extended_states
    stops = (
        ca.densify(system.definition.guards) if system.definition.guards.numel() else ca.SX(0, 1)
    )
    flags = [bool(ca.is_linear(stops[k], x)) for k in range(stops.numel())]
    if not system.surface_count:
        return flags
    h = system.surface_function(0)
    plus, minus = system.lie_derivative("+"), system.lie_derivative("-")
    first = bool(ca.is_linear(h, x)) and bool(ca.is_linear(plus, x))
    return [first, bool(ca.is_linear(minus, x)), *flags]
