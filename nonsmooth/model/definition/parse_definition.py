"""Reading the definition of a system: what a user wrote, checked, as symbols and expressions.

Both ways in, two fields of one surface or a field with multipliers, end in one form: a field in
states, time, parameters and multipliers, and functions of the first three.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from ..checks import real
from ..errors import DefinitionError, ParameterError, explain
from ..expressions.graph import require_smooth
from ..reading import Expression, Parameters, column, listed, require_known, scalar, symbols
from .consistency import require_consistent
from .events import Impact, Reset, Stop
from .form import Definition
from .vectors import read_entry, require_alike

_DIRECTIONS = (-1, 0, 1)


def read_definition(
    states: Any,
    *,
    surface: Any,
    above: Any,
    below: Any,
    field: Any,
    multipliers: Any,
    surfaces: Any,
    parameters: Any,
    time: Any,
    stops: Any,
    resets: Any,
    impacts: Any,
    hidden: bool,
) -> Definition:
    """Read what a user gave to FilippovSystem, whose docstring says what each is."""
    x = symbols(states, "states")
    if x.numel() == 0:
        raise DefinitionError("states: expected at least one symbol, received none.")
    t = symbols([time], "time") if time is not None else ca.SX(0, 1)
    p, defaults = _parameters(parameters)
    h, sizes = _surfaces(surface, surfaces)
    if above is not None or below is not None:
        lam, f = _two_fields(above, below, field, multipliers, h, x.numel())
    else:
        require_alike(sizes, multipliers)
        lam = symbols([s for entry in listed(multipliers) for s in listed(entry)], "multipliers")
        f = column(field, "field", x.numel())
    _one_multiplier_each(lam, h)
    kinds = [(stops, Stop, "stops"), (resets, Reset, "resets"), (impacts, Impact, "impacts")]
    (stops, resets, impacts), renamed = _told_apart([_items(*k) for k in kinds], _own_names(sizes))
    guards = [column([s.function], f"stop {s.name!r}", 1) for s in stops]
    guards += [column([r.function], f"reset {r.name!r}", 1) for r in resets]
    maps = [column(r.map, f"map of reset {r.name!r}", x.numel()) for r in resets]
    reactions, f = _reactions(impacts, x, t, f)
    definition = Definition(
        states=x,
        time=t,
        parameters=p,
        multipliers=lam,
        reactions=reactions,
        gaps=ca.vertcat(*[column([i.gap], f"gap of {i.name!r}", 1) for i in impacts]),
        restitutions=ca.vertcat(
            *[column([i.restitution], f"restitution of {i.name!r}", 1) for i in impacts]
        ),
        impacts=tuple(i.name for i in impacts),
        field=f,
        surfaces=h,
        guards=ca.vertcat(*guards),
        maps=ca.horzcat(*maps),
        stops=tuple((s.name, s.direction) for s in stops),
        resets=tuple((r.name, r.direction) for r in resets),
        defaults=defaults,
        hidden=hidden,
        sizes=sizes if max(sizes, default=1) > 1 else (),
        renamed=renamed,
    )
    require_consistent(definition)
    return definition


def _one_multiplier_each(lam: ca.SX, h: ca.SX) -> None:
    if lam.numel() != h.numel():
        raise DefinitionError(
            explain(
                "multipliers",
                expected=f"one for each of the {h.numel()} surfaces",
                received=str(lam.numel()),
                advice="Surface i switches multiplier i.",
            )
        )


def read_function(definition: Definition, value: Any, what: str) -> ca.SX:
    """Check a scalar function of states, parameters and time that a user gave."""
    expression = scalar(value, what)
    known = ca.vertcat(definition.extended_states, definition.parameters)
    require_known(expression, known, what, **definition.names)
    require_smooth(expression, definition.extended_states, definition.parameters, what)
    return expression


# Pieces of a definition --------------------------------------------------------------------------


def _parameters(
    parameters: Parameters | Sequence[Expression] | None,
) -> tuple[ca.SX, dict[str, float | None]]:
    if isinstance(parameters, Mapping):
        given, values = list(parameters), list(parameters.values())
    else:
        given = listed(parameters)
        values = [None] * len(given)
    p = symbols(given, "parameters")
    defaults = {
        s.name(): None if v is None else real(v, f"parameter {s.name()!r}", error=ParameterError)
        for s, v in zip(given, values, strict=True)
    }
    return p, defaults


def _surfaces(
    surface: Expression | None, surfaces: Sequence[Expression] | None
) -> tuple[ca.SX, tuple[int, ...]]:
    """All switching functions, and how many of them belong to each surface or set."""
    if surface is not None and surfaces is not None:
        raise DefinitionError(
            "surface: expected either surface= or surfaces=, received both. One switching "
            "function goes to surface=, several to surfaces=."
        )
    given = [surface] if surface is not None else listed(surfaces)
    entries = [read_entry(v, f"surface {i}") for i, v in enumerate(given)]
    expressions = [e for entry in entries for e in entry]
    sizes = tuple(len(entry) for entry in entries)
    return ca.vertcat(*expressions) if expressions else ca.SX(0, 1), sizes


def _items(values: Any, kind: type[Any], what: str) -> list[Any]:
    """Read stops=, resets= or impacts=: one, or a sequence of them."""
    items = [values] if isinstance(values, kind) else listed(values)
    for i, item in enumerate(items):
        if not isinstance(item, kind):
            raise DefinitionError(
                explain(
                    f"{what}[{i}]",
                    expected=f"a {kind.__name__}",
                    received=f"{item!r} ({type(item).__name__})",
                    advice=f"Write {what}=[nonsmooth.{kind.__name__}(function, ...)].",
                )
            )
        if kind is Impact:
            continue
        if isinstance(item.direction, bool) or item.direction not in _DIRECTIONS:
            raise DefinitionError(
                f"direction of {item.name!r}: expected -1 (falling), 0 (both) or 1 (rising), "
                f"received {item.direction!r}."
            )
    return items


def _own_names(sizes: Sequence[int]) -> set[str]:
    """Names of guards of surfaces, sets and the ends of sliding (``flow/names.py``)."""
    of_each = ("h{}", "lambda{} = 1", "lambda{} = -1", "|lambda{}| = 1")
    names = {name.format(k) for k in range(len(sizes)) for name in of_each}
    return names | ({"stability of sliding"} if sizes else set())


def _told_apart(
    kinds: Sequence[list[Any]], own: set[str]
) -> tuple[list[list[Any]], tuple[tuple[str, str], ...]]:
    """Events with names of their own."""
    # ``at=``, ``until=`` and ``itinerary=`` choose events by their names.
    taken, used = {item.name for items in kinds for item in items} | own, set(own)
    found, renamed = list[list[Any]](), list[tuple[str, str]]()
    for items in kinds:
        found.append([])
        for item in items:
            name, number = item.name, 1
            if name in used:
                while name in taken:
                    number += 1
                    name = f"{item.name} {number}"
                renamed.append((name, item.name))
                item = replace(item, name=name)
                taken.add(name)
            used.add(name)
            found[-1].append(item)
    return found, tuple(renamed)


def _two_fields(
    above: Any, below: Any, field: Any, multipliers: Any, h: ca.SX, n: int
) -> tuple[ca.SX, ca.SX]:
    if field is not None or multipliers is not None or h.numel() != 1:
        raise DefinitionError(
            explain(
                "definition",
                expected="above= and below= with one surface=, or field= with multipliers= and "
                "surfaces=",
                received="a mixture of the two forms"
                if h.numel() == 1
                else f"{h.numel()} surfaces",
                advice="Two fields belong to exactly one surface.",
            )
        )
    f1, f2 = column(above, "above", n), column(below, "below", n)
    lam = ca.SX.sym("lambda")
    entries = []
    for a, b in zip(ca.vertsplit(f1), ca.vertsplit(f2), strict=True):
        # This form folds back to exactly a and b at lambda = +1 and -1.
        same = ca.is_equal(a, b, 10)
        entries.append(a if same else (1 + lam) / 2 * a + (1 - lam) / 2 * b)
    return lam, ca.vertcat(*entries)


def _direction(impact: Impact, gap: ca.SX, rate: ca.SX, x: ca.SX) -> ca.SX:
    """Direction of a reaction that is not given: the gradient of the gap's rate by the velocities."""
    positions = _depends_on_each(gap, x)
    push = ca.densify(ca.gradient(rate, x))
    velocities = [i for i in range(x.numel()) if not positions[i] and not push[i].is_zero()]
    if velocities and not ca.is_linear(rate, ca.vertcat(*[x[i] for i in velocities])):
        raise DefinitionError(
            explain(
                f"reaction of {impact.name!r}",
                expected="reaction=, a symbol in the field",
                received=f"none, and the rate {rate} of the gap, which is not linear in the states that "
                "are not in the gap",
                advice="The direction in which the contact pushes cannot be seen from it.",
            )
        )
    return ca.vertcat(*[push[i] if i in velocities else 0 for i in range(x.numel())])


def _depends_on_each(function: ca.SX, x: ca.SX) -> list[bool]:
    """Which of some symbols an expression depends on."""
    return [bool(ca.depends_on(function, x[i])) for i in range(x.numel())]


def _reactions(impacts: Sequence[Impact], x: ca.SX, t: ca.SX, field: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Symbols of the reactions, and the field with those that were not in it."""
    given: list[ca.SX] = []
    for j, impact in enumerate(impacts):
        if impact.reaction is not None:
            given.append(symbols([impact.reaction], f"reaction of {impact.name!r}"))
            continue
        gap = column([impact.gap], f"gap of {impact.name!r}", 1)
        rate = ca.jtimes(gap, ca.vertcat(x, t), ca.vertcat(field, ca.SX.ones(t.numel(), 1)))
        given.append(ca.SX.sym(f"reaction{j}"))
        field = field + given[-1] * _direction(impact, gap, rate, x)
    return ca.vertcat(*given) if given else ca.SX(0, 1), field
