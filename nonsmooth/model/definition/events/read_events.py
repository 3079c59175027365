"""Reading of stops and resets: their conditions as rules, their maps as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from ...errors import DefinitionError
from ...numbering import MOST_CODES
from ...reading import column, scalar
from .conditions import Atoms, Rule, Tree, is_boolean, is_piecewise, passages
from .declarations import Reset, Stop


def direction_of(event: Stop | Reset) -> int:
    """Direction of a guard; a condition has none."""
    return 0 if is_boolean(scalar(event.function, event.name)) else event.direction


def read_when(event: Stop | Reset) -> ca.SX:
    """The filter of an event as an expression that is not zero where it is true."""
    return ca.SX(1) if event.when is None else scalar(event.when, f"when of {event.name!r}")


def read_maps(resets: Sequence[Reset], x: ca.SX) -> tuple[list[ca.SX], list[tuple[int, ...]]]:
    """States after each reset, and the positions of those that its map names."""
    maps, named = list[ca.SX](), list[tuple[int, ...]]()
    position = {symbol.element_hash(): i for i, symbol in enumerate(ca.vertsplit(x))}
    for reset in resets:
        what = f"map of reset {reset.name!r}"
        if not isinstance(reset.map, Mapping):
            maps.append(column(reset.map, what, x.numel()))
            named.append(tuple(range(x.numel())))
            continue
        after, own = ca.vertsplit(x), list[int]()
        for symbol, value in reset.map.items():
            known = isinstance(symbol, ca.SX) and symbol.is_scalar() and symbol.is_symbolic()
            i = position.get(symbol.element_hash()) if known else None
            if i is None:
                raise DefinitionError(
                    f"{what}: {symbol!r} is no state. The keys are states, such as {{{x[0]}: 0}}; states "
                    "that are not named stay."
                )
            after[i] = scalar(value, f"{what}, {symbol}")
            own.append(i)
        maps.append(ca.vertcat(*after))
        named.append(tuple(sorted(own)))
    return maps, named


def read_rules(
    stops: Sequence[Stop], resets: Sequence[Reset], atoms: Atoms, named: Sequence[tuple[int, ...]]
) -> tuple[Rule, ...]:
    """Conditions of all events; the first atoms are the own ones of stops, then resets."""
    events: list[tuple[Stop | Reset, str]] = [(s, f"stop {s.name!r}") for s in stops]
    events += [(r, f"reset {r.name!r}") for r in resets]
    atoms.functions += [None] * len(events)
    triggers = [_triggers(event, k, what, atoms) for k, (event, what) in enumerate(events)]
    rules = []
    for k, (event, what) in enumerate(events):
        _require_options(event, what)
        when = None if event.when is None else read_when(event)
        tree = None
        if when is not None and (event.level or _is_condition(when)):
            tree = atoms.tree(when, f"when of {what}")
        elif when is not None and not is_boolean(when) and ca.depends_on(when, atoms.moving):
            raise DefinitionError(
                f"when of {what}: expected a condition, received the function {when}, which is zero at single "
                f"instants only. Write a comparison, such as {when} >= 0."
            )
        if max(map(len, (*triggers[k], tree or ()))) > MOST_CODES:
            raise DefinitionError(
                f"{what}: its condition has more than {MOST_CODES} comparisons and operations. Split it into "
                "several events."
            )
        rules.append(
            Rule(
                triggers[k],
                tree,
                level=bool(event.level),
                initially=-1 if event.initially is None else int(event.initially),
                by_jumps=bool(event.by_jumps),
                persistent=bool(event.persistent),
                at_trigger=isinstance(event, Reset) and event.values == "trigger",
                named=named[k - len(stops)] if isinstance(event, Reset) else (),
            )
        )
    return tuple(rules)


def require_no_endless_level(
    rules: Sequence[Rule], stops: int, resets: Sequence[Reset], atoms: Sequence[ca.SX], x: ca.SX
) -> None:
    """Refuse a level reset without ``when`` whose map keeps its condition."""
    for reset, rule in zip(resets, rules[stops:], strict=True):
        if not rule.level or reset.when is not None:
            continue
        own = ca.vertcat(*[atoms[a] for a in sorted(rule.atoms)])
        changed = [x[i] for i in rule.named]
        if not any(ca.depends_on(own, symbol) for symbol in changed):
            raise DefinitionError(
                f"reset {reset.name!r}: its map keeps every function of its condition, so that it would "
                "fire without end. Give when=, a condition that the map makes false, for example "
                "when=q == 0 with the map {q: 1}."
            )


def _is_condition(when: ca.SX) -> bool:
    """Whether a filter is made of comparisons, which are decided to rounding; others by their values."""
    if not is_boolean(when):
        return False
    if any(when.is_op(op) for op in (ca.OP_AND, ca.OP_OR, ca.OP_NOT)):
        return all(_is_condition(when.dep(k)) for k in range(when.n_dep()))
    inner = [when.dep(k) for k in range(when.n_dep())]
    return not any(is_boolean(e) or e.is_op(ca.OP_IF_ELSE_ZERO) for e in inner)


def _triggers(event: Stop | Reset, k: int, what: str, atoms: Atoms) -> tuple[Tree, ...]:
    (function,) = ca.vertsplit(column([event.function], what, 1))
    if is_boolean(function):
        if event.direction:
            raise DefinitionError(
                f"direction of {event.name!r}: a condition is due where it becomes true and has no "
                "direction. Leave direction= out, or give a guard that passes zero."
            )
        atoms.slot = k
        return (atoms.tree(function, what),)
    if is_piecewise(function) and not function.is_op(ca.OP_FABS):  # that touches its zero
        atoms.slot = k
        return atoms.passages(function, event.direction, what)
    atoms.functions[k] = function
    return passages(k, event.direction)


def _require_options(event: Stop | Reset, what: str) -> None:
    if event.level and not event.direction and not is_boolean(scalar(event.function, what)):
        raise DefinitionError(
            f"{what}: level=True needs direction=1 (due while its function is not negative) or "
            "direction=-1 (while it is not positive), or a condition."
        )
    if event.initially not in (None, True, False):
        raise DefinitionError(
            f"initially of {event.name!r}: expected True, False or None, received {event.initially!r}."
        )
    if isinstance(event, Reset) and event.values not in ("now", "trigger"):
        raise DefinitionError(
            f'values of {event.name!r}: expected "now" or "trigger", received {event.values!r}.'
        )
    for name in ("level", "by_jumps", "persistent"):
        if not isinstance(getattr(event, name), bool):
            raise DefinitionError(
                f"{name} of {event.name!r}: expected True or False, received "
                f"{getattr(event, name)!r}."
            )
