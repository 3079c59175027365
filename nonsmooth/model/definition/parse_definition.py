"""Read and check the definition of a system: one form for all ways in which it can be written.

The form is a field in states, time, parameters and multipliers, with functions of the first three.
A vector h of k switching functions with a vector of k multipliers is a set h = 0 of codimension k:
the multiplier is h/|h| off the set and at most 1 in length on it. Coulomb friction in the plane has
k = 2, with drilling friction k = 3. With k = 1 the set is a surface.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import accumulate
from typing import Any

import casadi as ca

from ..checks import real
from ..errors import DefinitionError, ParameterError
from ..expressions.cancel import cancel_common_factor, powers
from ..expressions.graph import (
    IN_A_FIELD,
    IN_A_GAP,
    IN_A_GUARD,
    IN_A_SURFACE,
    require_finite,
    require_smooth,
)
from ..expressions.linearity import bent, enters_nonlinearly
from ..numbering import IMPACT_LAWS
from ..reading import (
    Expression,
    Parameters,
    column,
    items_of,
    listed,
    require_known,
    require_unique,
    scalar,
    symbols,
)
from ..values import Array, parameter_values
from .complementarity import rate_of, require_complementarity
from .constraints import Constraint, joints_of, require_constraints
from .elements import (
    Complementarity,
    functions_of,
    hysteresis_of,
    laws_of,
    multipliers_of,
    read_entries,
)
from .events import Clock, Impact, Reset, Stop
from .events.conditions import Atoms, Rule, located, passages
from .events.read_events import (
    direction_of,
    read_maps,
    read_rules,
    read_when,
    require_no_endless_level,
)
from .tables.pieces import Table

#: No expressions.
_NONE = ca.SX(0, 1)

#: Symbols of a definition, and its expressions, in the order in which they are written down.
INPUTS = ("states", "time", "parameters", "multipliers", "reactions")
OUTPUTS = (
    *("field", "surfaces", "guards", "maps", "gaps", "restitutions"),
    *("whens", "priorities", "periods", "hysteresis"),
)


@dataclass(frozen=True)
class Definition:
    """A system as symbols and expressions."""

    states: ca.SX
    time: ca.SX
    parameters: ca.SX
    multipliers: ca.SX
    field: ca.SX
    surfaces: ca.SX
    guards: ca.SX
    maps: ca.SX
    reactions: ca.SX
    gaps: ca.SX
    restitutions: ca.SX
    stops: tuple[tuple[str, int], ...]
    resets: tuple[tuple[str, int], ...]
    impacts: tuple[str, ...]
    defaults: dict[str, float | None]
    hidden: bool
    whens: ca.SX = _NONE
    priorities: ca.SX = _NONE
    periods: ca.SX = _NONE
    rules: tuple[Rule, ...] = ()
    clocks: tuple[tuple[int, int], ...] = ()
    discrete: tuple[tuple[float, ...] | None, ...] = ()
    sizes: tuple[int, ...] = ()
    renamed: tuple[tuple[str, str], ...] = ()
    layer_widths: tuple[float, ...] = ()
    laws: tuple[str, ...] = ()  # of the entries, where not all are surfaces and sets
    hysteresis: ca.SX = _NONE  # how much lower each function is where its multiplier is -1
    complementarity: tuple[str, ...] = ()  # names of the conditions among the entries
    impact_law: str = "newton"
    constraints: tuple[str, ...] = ()  # names of the joints, the last entries
    tables: tuple[Table, ...] = ()  # the values of their curves are the last parameters
    breakpoints: frozenset[int] = frozenset()  # surfaces that are breakpoints of tables

    @cached_property
    def plain(self) -> bool:
        """Whether all events are guards that are passed, without conditions or discrete states."""
        directions = [d for _, d in (*self.stops, *self.resets)]
        ticks = {len(self.stops) + reset for reset, _ in self.clocks}
        filtered = self.whens.numel() and not self.whens.is_constant()
        return (
            not self.discrete
            and not filtered
            and all(
                replace(rule, by_jumps=True, named=(), level=rule.level and k not in ticks)
                == Rule(passages(k, direction))
                for k, (rule, direction) in enumerate(zip(self.rules, directions, strict=True))
            )
        )

    @property
    def located(self) -> list[int]:
        """How each atom, a row of ``guards``, is located along a motion (``conditions``)."""
        atoms = ca.vertsplit(self.guards)[: self.guards.numel()]
        count = self.states.numel() - len(self.discrete)
        return located(self.rules, atoms, ca.vertcat(self.states[:count], self.time))

    @property
    def extended_states(self) -> ca.SX:
        """The states, followed by the time where the system depends on it."""
        return ca.vertcat(self.states, self.time)

    @cached_property
    def half_lines(self) -> tuple[int, ...]:
        """Functions y of complementarity conditions, among the surfaces."""
        return self.functions_of("complementarity")

    def functions_of(self, law: str) -> tuple[int, ...]:
        """First functions of the elements of a law, among the surfaces."""
        sizes = self.sizes or (1,) * self.surfaces.numel()
        laws = zip(accumulate(sizes, initial=0), self.laws, strict=False)
        return tuple(first for first, own in laws if own == law)

    @property
    def open_surfaces(self) -> ca.SX:
        """The switching functions (m,) as functions of states alone, without multipliers."""
        if not self.complementarity:
            return self.surfaces
        none = ca.SX.zeros(self.multipliers.numel(), 1)
        return ca.substitute(self.surfaces, self.multipliers, none)

    @property
    def gap_rates(self) -> ca.SX:
        """Rates of the gaps (c,), in states, parameters and time."""
        return rate_of(self, self.gaps) if self.gaps.numel() else ca.SX(0, 1)

    def frame(self) -> dict[str, Any]:
        """States, parameters with their defaults, and time, as arguments of a system."""
        return {
            "states": listed(self.states),
            "parameters": dict(zip(listed(self.parameters), self.defaults.values(), strict=True)),
            "time": self.time if self.time.numel() else None,
        }

    @property
    def names(self) -> dict[str, list[str]]:
        """Names of the states and of the parameters."""
        return {
            "states": [s.name() for s in listed(self.states)],
            "parameters": [s.name() for s in listed(self.parameters)],
        }

    def state(self) -> dict[str, Any]:
        """Plain values from which ``from_state`` makes an equal definition; defaults are left out."""
        inputs = [getattr(self, name) for name in INPUTS]
        outputs = OUTPUTS if self.hysteresis.numel() else OUTPUTS[:-1]
        plain = {name: getattr(self, name) for name in PLAIN}
        return {
            **{name: v for name, v in plain.items() if v != getattr(Definition, name, None)},
            "definition": ca.Function(
                "definition", inputs, [getattr(self, n) for n in outputs]
            ).serialize(),
            "names": [[str(s) for s in listed(v)] for v in inputs],
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> Definition:
        """Make the definition that ``state`` was taken from, over new symbols."""
        function = ca.Function.deserialize(state["definition"])
        vectors = [ca.vertcat(*map(ca.SX.sym, names)) for names in state["names"]]
        vectors = [v if v.numel() else ca.SX(0, 1) for v in vectors]
        expressions = [ca.SX(e) for e in function.call(vectors)]
        parts = dict(zip((*INPUTS, *OUTPUTS), (*vectors, *expressions), strict=False))
        return cls(**parts, **{name: state[name] for name in PLAIN if name in state})


#: Parts of a definition that are no expressions, and derived ones.
PLAIN = tuple(f.name for f in fields(Definition) if f.type not in ("ca.SX", "frozenset[int]"))


class _Deferred:
    """An attribute that may be given as a function, called where it is first read."""

    def __get__(self, owner: Any, _: Any) -> Any:
        value = vars(owner)["field"]
        if callable(value) and not isinstance(value, ca.SX):
            value = vars(owner)["field"] = value()
        return value

    def __set__(self, owner: Any, value: Any) -> None:
        vars(owner)["field"] = value


Definition.field = _Deferred()


#: Classes of the parts of a system besides surfaces, their arguments, and an example of each.
_ELEMENTS: tuple[tuple[Any, ...], ...] = (
    *((Stop, "stops"), (Reset, "resets"), (Impact, "impacts")),
    (Complementarity, "complementarity"),
    (Constraint, "constraints", "function, reaction=..."),
)


def read_definition(
    states: Any,
    *,
    field: Any,
    multipliers: Any,
    surfaces: Any,
    parameters: Any,
    time: Any,
    stops: Any,
    resets: Any,
    impacts: Any,
    hidden: bool,
    complementarity: Any,
    constraints: Any,
    clocks: Sequence[Clock],
    discrete: Sequence[tuple[float, ...] | None],
    surface: Any = None,
    above: Any = None,
    below: Any = None,
    layer_widths: Any = None,
) -> Definition:
    """Read and check the arguments of FilippovSystem."""
    t = _NONE if time is None else symbols([time], "time")
    x, (p, defaults) = symbols(states, "states"), _parameters(parameters)
    if x.numel() == 0:
        raise DefinitionError("states: expected at least one symbol, received none.")
    entries = read_entries(surface, surfaces)
    sizes = tuple(len(entry.functions) for entry in entries)
    lam, f = _multipliers_and_field(entries, above, below, field, multipliers, x.numel())
    given = (stops, resets, impacts, complementarity, constraints)
    items = [items_of(values, *own) for values, own in zip(given, _ELEMENTS, strict=True)]
    (stops, resets, impacts, conditions, joined), renamed = _distinct(items, _own_names(sizes))
    reactions, f = _reactions(impacts, "gap", x, t, f)
    _require_one_field(above, joined)
    held, f = _reactions(joined, "function", x, t, f)
    require_unique(ca.vertcat(x, t, p, lam, reactions, held))
    joints = joints_of(joined, listed(held), f)
    own = [*[condition.entry() for condition in conditions], *joints.entries]
    sizes, entries = (*sizes, *[1] * len(own)), [*entries, *own]
    parts: dict[str, Any] = dict(
        states=x,
        time=t,
        parameters=p,
        multipliers=ca.vertcat(lam, *[entry.multiplier for entry in own]),
        reactions=reactions,
        field=joints.field,
        surfaces=functions_of(entries),
        defaults=defaults,
        hidden=hidden or any(entry.hidden for entry in entries),
        sizes=sizes if max(sizes, default=1) > 1 else (),
        renamed=renamed,
        layer_widths=_widths(layer_widths, sum(sizes) - len(own), len(own)),
        constraints=joints.names,
        laws=laws_of(entries),
        hysteresis=hysteresis_of(entries),
        complementarity=tuple(condition.name for condition in conditions),
        **_contacts(impacts),
    )
    definition = _with_events(parts, (stops, resets, clocks, discrete, x, t, p))
    require_consistent(definition)
    return definition


def _with_events(parts: dict[str, Any], events: tuple[Any, ...]) -> Definition:
    try:
        return Definition(**parts, **_events(*events))
    except DefinitionError:  # an error of the field is reported before those of its guards
        require_consistent(Definition(**parts, **_events((), (), (), (), *events[4:])))
        raise


def _multipliers_and_field(
    entries: Sequence[Any], above: Any, below: Any, field: Any, multipliers: Any, n: int
) -> tuple[ca.SX, ca.SX]:
    """Multipliers of the given surfaces and sets, and the field of n states in them."""
    h = functions_of(entries)
    if above is not None or below is not None:
        lam, f = _two_fields(above, below, field, multipliers, h, n)
    else:
        multipliers = multipliers_of(entries, multipliers)
        _require_alike(tuple(len(entry.functions) for entry in entries), multipliers)
        lam = symbols([s for entry in listed(multipliers) for s in listed(entry)], "multipliers")
        f = column(field, "field", n)
    _one_multiplier_each(lam, h)
    return lam, f


def _require_one_field(above: Any, constraints: Sequence[Any]) -> None:
    """Refuse reactions of constraints in two fields."""
    if above is not None and any(own.reaction is not None for own in constraints):
        raise DefinitionError(
            "constraints: their reactions are in above= and below=, of which one applies at a time. Give field= with "
            "multipliers= and surfaces=, which contains them once."
        )


def _contacts(impacts: Sequence[Impact]) -> dict[str, Any]:
    """Parts of a definition for contacts."""
    return {
        "gaps": _of_impacts(impacts, "gap"),
        "restitutions": _of_impacts(impacts, "restitution"),
        "impacts": tuple(i.name for i in impacts),
        "impact_law": _law_of(impacts),
    }


def _events(
    stops: Sequence[Stop],
    resets: Sequence[Reset],
    clocks: Sequence[Clock],
    discrete: Sequence[tuple[float, ...] | None],
    x: ca.SX,
    t: ca.SX,
    p: ca.SX,
) -> dict[str, Any]:
    """Parts of a definition for stops, resets, clocks and discrete states."""
    _require_directions([*stops, *resets])
    maps, named = read_maps(resets, x)
    moving = ca.vertcat(x[: x.numel() - len(discrete)], t)
    atoms = Atoms(ca.vertcat(x, t), moving, p)
    rules = read_rules(stops, resets, atoms, named)
    ticks = len(resets) - len(clocks)
    require_no_endless_level(
        rules[: len(stops) + ticks], len(stops), resets[:ticks], atoms.functions, x
    )
    first = x.numel() - len(discrete) - len(clocks)
    every: tuple[Stop | Reset, ...] = (*stops, *resets)
    return {
        "guards": ca.vertcat(*atoms.functions),
        "maps": ca.horzcat(*maps),
        "whens": ca.vertcat(*[read_when(e) for e in every]),
        "priorities": ca.vertcat(*[scalar(e.priority, f"priority of {e.name!r}") for e in every]),
        "periods": ca.vertcat(*[scalar(c.period, f"period of {c.name!r}") for c in clocks]),
        "rules": rules,
        "clocks": tuple((ticks + k, first + k) for k in range(len(clocks))),
        "discrete": tuple(discrete),
        "stops": tuple((s.name, direction_of(s)) for s in stops),
        "resets": tuple((r.name, direction_of(r)) for r in resets),
    }


def _law_of(impacts: Sequence[Impact]) -> str:
    """The law of impacts, one for all of them."""
    for impact in impacts:
        if impact.law not in IMPACT_LAWS:
            raise DefinitionError(
                f"law of {impact.name!r} is {impact.law!r}. Give one of {', '.join(IMPACT_LAWS)}."
            )
    laws = {impact.law: impact.name for impact in impacts}
    if len(laws) > 1:
        received = " and ".join(f"{law!r} for {name!r}" for law, name in laws.items())
        raise DefinitionError(
            f"impacts have different laws: {received}. Contacts that are struck together need one: give all "
            "the same law=."
        )
    return next(iter(laws), "newton")


def _of_impacts(impacts: Sequence[Any], what: str) -> ca.SX:
    """One expression of each impact."""
    return ca.vertcat(*[column([getattr(i, what)], f"{what} of {i.name!r}", 1) for i in impacts])


def _widths(values: Any, count: int, more: int) -> tuple[float, ...]:
    """Widths of the layers of the surfaces, and of more functions that have none; nothing where they are equal."""
    if values is None:
        return ()
    widths = tuple(real(v, "layer_widths") for v in listed(values))
    if len(widths) != count or not all(0 < v < float("inf") for v in widths):
        raise DefinitionError(
            f"layer_widths is {values!r}, but the system has {count} switching functions. Give a "
            "positive number for each."
        )
    return (*widths, *[1.0] * more) if len(set(widths)) > 1 else ()


def _require_directions(events: Sequence[Stop | Reset]) -> None:
    for event in events:
        if isinstance(event.direction, bool) or event.direction not in (-1, 0, 1):
            raise DefinitionError(
                f"direction of {event.name!r}: expected -1 (falling), 0 (both) or 1 (rising), "
                f"received {event.direction!r}."
            )


def _one_multiplier_each(lam: ca.SX, h: ca.SX) -> None:
    if lam.numel() != h.numel():
        raise DefinitionError(
            f"multipliers: expected one for each of the {h.numel()} surfaces, received "
            f"{lam.numel()}. Surface i switches multiplier i."
        )


def read_function(definition: Definition, value: Any, what: str) -> ca.SX:
    """Check a scalar function of states, parameters and time that a user gave."""
    expression = scalar(value, what)
    known = ca.vertcat(definition.extended_states, definition.parameters)
    require_known(expression, known, what, **definition.names)
    require_smooth(expression, definition.extended_states, definition.parameters, what)
    return expression


# parts of a definition ---------------------------------------------------------------------------


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


def _own_names(sizes: Sequence[int]) -> set[str]:
    """Names reserved for guards of surfaces and sets and for the ends of sliding (``flow/names.py``)."""
    of_each = ("h{}", "lambda{} = 1", "lambda{} = -1", "|lambda{}| = 1")
    names = {name.format(k) for k in range(len(sizes)) for name in of_each}
    return names | ({"stability of sliding"} if sizes else set())


def _distinct(
    kinds: Sequence[list[Any]], own: set[str]
) -> tuple[list[list[Any]], tuple[tuple[str, str], ...]]:
    """Events with different names, by which they are found again; and which were renamed."""
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
        received = "a mixture of the two forms" if h.numel() == 1 else f"{h.numel()} surfaces"
        raise DefinitionError(
            "definition: expected above= and below= with one surface=, or field= with multipliers= "
            f"and surfaces=, received {received}. Two fields belong to exactly one surface."
        )
    f1, f2 = column(above, "above", n), column(below, "below", n)
    lam = ca.SX.sym("lambda")
    entries = []
    for a, b in zip(ca.vertsplit(f1), ca.vertsplit(f2), strict=True):
        # This form folds back to exactly a and b at lambda = +1 and -1.
        same = ca.is_equal(a, b, 10)
        entries.append(a if same else (1 + lam) / 2 * a + (1 - lam) / 2 * b)
    return lam, ca.vertcat(*entries)


def _direction(name: str, gap: ca.SX, rate: ca.SX, x: ca.SX) -> ca.SX:
    """Direction of a reaction that is not given: the gradient of a function's rate by the velocities."""
    push = ca.densify(ca.gradient(rate, x))
    moved = [i for i in range(x.numel()) if not push[i].is_zero()]
    velocities = [i for i in moved if not ca.depends_on(gap, x[i])]
    if velocities and not ca.is_linear(rate, ca.vertcat(*[x[i] for i in velocities])):
        raise DefinitionError(
            f"reaction of {name!r}: the rate {rate} of {gap} is not linear in the states "
            "that it does not hold itself, so it does not give the direction of the reaction. Give "
            "reaction=, a symbol in the field."
        )
    return ca.vertcat(*[push[i] if i in velocities else 0 for i in range(x.numel())])


def _reactions(
    items: Sequence[Any], what: str, x: ca.SX, t: ca.SX, field: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Symbols of the reactions of impacts or constraints, and the field with those that were not in it."""
    given: list[ca.SX] = []
    for j, item in enumerate(items):
        if item.reaction is not None:
            given.append(symbols([item.reaction], f"reaction of {item.name!r}"))
            continue
        gap = column([getattr(item, what)], f"{what} of {item.name!r}", 1)
        rate = ca.jtimes(gap, ca.vertcat(x, t), ca.vertcat(field, ca.SX.ones(t.numel(), 1)))
        given.append(ca.SX.sym(f"reaction{j}" if what == "gap" else f"{item.name} reaction"))
        field = field + given[-1] * _direction(item.name, gap, rate, x)
    return ca.vertcat(*given) if given else ca.SX(0, 1), field


# sets of codimension two and three --------------------------------------------------------------


def _require_alike(sizes: Sequence[int], multipliers: Any) -> None:
    """Refuse multipliers whose shapes differ from those of the surfaces."""
    entries = [len(listed(entry)) for entry in listed(multipliers)]
    if max((*sizes, *entries), default=1) == 1 or list(sizes) == entries:
        return
    raise DefinitionError(
        f"multipliers: they have {entries} components, but the surfaces have {list(sizes)}. "
        "surfaces=[casadi.vertcat(h1, h2)] goes with multipliers=[casadi.vertcat(l1, l2)]."
    )


def _require_linear_sets(d: Definition) -> None:
    """Refuse sets whose multipliers enter nonlinearly or whose components have different loads."""
    first = 0
    for i, size in enumerate(d.sizes):
        lam = d.multipliers[first : first + size]
        first += size
        if size == 1:
            continue
        if not ca.is_linear(d.field, lam):
            raise DefinitionError(
                f"multiplier {lam}: expected a field linear in all of its components together, "
                "received a nonlinear one. Hidden dynamics has one multiplier for each surface."
            )
        entries = ca.jacobian(d.field, lam).nonzeros()
        if not any(ca.depends_on(e, d.reactions) for e in entries):
            continue
        variables, known = ca.vertcat(d.extended_states, d.reactions), ca.vertcat(d.parameters, lam)
        if any(
            ca.depends_on(e, d.reactions)
            for e in cancel_common_factor(entries, variables, known)[0]
        ):
            raise DefinitionError(
                f"multiplier {lam} of surface {i}: its friction has no common bound {', '.join(map(str, entries))}. Write "
                "each component as multiplier times one coefficient times one sum of reactions, the load."
            )


# checks of the whole definition ------------------------------------------------------------------


def require_consistent(d: Definition, given: bool = True) -> None:
    """Refuse unknown symbols, functions that are not smooth, and multipliers that do not fit."""
    # Sections of derived systems may have multiple zeros; only ``given`` guards must have simple ones.
    atoms = _guard_names(d)
    guards = atoms[: len(d.stops) + len(d.resets)]
    functions = [*zip(_function_names(d), listed(d.surfaces), strict=True)]
    gaps = [(f"gap of {name!r}", d.gaps[j]) for j, name in enumerate(d.impacts)]
    named = [("field", d.field, True)]
    named += [(name, e, i in d.half_lines) for i, (name, e) in enumerate(functions)]
    named += [(name, d.guards[i], False) for i, name in enumerate(atoms)]
    switched = [(f"map of reset {n!r}", d.maps[:, j]) for j, (n, _) in enumerate(d.resets)]
    switched += [(f"when of {name}", d.whens[i]) for i, name in enumerate(guards)]
    switched += [(f"priority of {name}", d.priorities[i]) for i, name in enumerate(guards)]
    switched += [("period of a clock", e) for e in listed(d.periods)]
    for j, name in enumerate(d.impacts):
        named += [(*gaps[j], False), (f"restitution of {name!r}", d.restitutions[j], False)]
    known = ca.vertcat(d.extended_states, d.parameters, d.multipliers, d.reactions)
    x = d.extended_states
    require_unique(known)
    every, names = [*named, *[(w, e, False) for w, e in switched]], d.names
    _of_all(lambda what, e: require_known(e, known, what, **names), [own[:2] for own in every])
    _of_all(lambda what, e: _require_bare(what, e, d), [(w, e) for w, e, has in every if not has])
    _of_all(lambda what, e: require_finite(e, what), [own[:2] for own in every])
    _require_smooth_functions(d, gaps, [(what, e) for what, e, _ in named])
    for period in listed(d.periods):
        if ca.depends_on(period, d.extended_states):
            raise DefinitionError(
                f"period of a clock: {period} depends on states. Give a number or parameters."
            )
    _require_locally_constant(d)
    for i, name in enumerate(atoms):
        _require_states(name, d.guards[i], d.extended_states, d)
        if given:
            _require_simple(name, d.guards[i], d)
    moves, of_tables = (
        ca.which_depends(d.surfaces, x, 1, True) if functions else [],
        d.functions_of("table"),
    )
    for i, ((name, h), curved) in enumerate(zip(functions, bent(d.surfaces, x), strict=True)):
        if i in d.half_lines:
            if not ca.depends_on(h, d.multipliers):
                _require_simple(name, h, d)
            continue
        if not moves[i]:
            _require_states(name, h, d.extended_states, d)
        if curved and i not in of_tables:
            _require_simple(name, h, d)
    for j in range(len(d.impacts)):
        _check_impact(d, j)
    require_complementarity(d)
    require_constraints(d)
    if not d.hidden:
        _require_linear(d)
    _require_linear_sets(d)
    _require_hysteresis(d)


def _of_all(check: Callable[[str, ca.SX], None], named: Sequence[tuple[str, ca.SX]]) -> None:
    """Check expressions together, and one by one only to name what is refused."""
    try:
        if named:
            check("", ca.vertcat(*[ca.vec(e) for _, e in named]))
    except DefinitionError:
        for what, expression in named:
            check(what, expression)
        raise


def _require_bare(what: str, expression: ca.SX, d: Definition) -> None:
    """Refuse multipliers."""
    if ca.depends_on(expression, ca.vertcat(d.multipliers, d.reactions)):
        raise DefinitionError(
            f"{what}: expected an expression in states, time and parameters, received one "
            "with a multiplier. Only the field may contain multipliers."
        )


def _require_smooth_functions(
    d: Definition, gaps: list[tuple[str, ca.SX]], named: list[tuple[str, ca.SX]]
) -> None:
    """Refuse switches in functions of the states, with advice for each."""
    moving = ca.vertcat(d.extended_states, d.multipliers, d.reactions)
    advice = dict.fromkeys(_function_names(d), IN_A_SURFACE)
    advice |= dict.fromkeys([name for name, _ in gaps], IN_A_GAP)
    advice |= dict.fromkeys(_guard_names(d), IN_A_GUARD)
    check = lambda what, e: require_smooth(
        e, moving, d.parameters, what, advice.get(what, IN_A_FIELD)
    )
    _of_all(check, [*gaps, *named])


def _guard_names(d: Definition) -> list[str]:
    """Names in messages of the functions of stops and resets."""
    own = [f"stop {n!r}" for n, _ in d.stops] + [f"reset {n!r}" for n, _ in d.resets]
    return [*own, *["a condition"] * (d.guards.numel() - len(own))]


def _function_names(d: Definition) -> list[str]:
    """Names of the switching functions in messages."""
    first = d.surfaces.numel() - len(d.constraints)
    names = [f"surface {i}" for i in range(first)] + [f"function of {n!r}" for n in d.constraints]
    for i, name in zip(d.half_lines, d.complementarity, strict=True):
        names[i] = f"y of {name!r}"
    return names


def _check_impact(d: Definition, j: int) -> None:
    what, gap, rate = f"gap of {d.impacts[j]!r}", d.gaps[j], d.gap_rates[j]
    _require_states(what, gap, d.states, d)
    _require_simple(what, gap, d)
    if ca.depends_on(rate, ca.vertcat(d.multipliers, d.reactions)):
        raise DefinitionError(
            f"{what}: the rate {rate} of {gap} contains a multiplier. Forces act on velocities: a "
            "gap is a function of positions and time. A diode, or a bound on a state whose rate the multiplier "
            "changes, is Complementarity(y, multiplier=...)."
        )
    effect = ca.mtimes(ca.jacobian(rate, d.states), ca.jacobian(d.field, d.reactions[j]))
    if effect.is_zero() or not ca.is_linear(d.field, d.reactions[j]):
        problem = "does not change the gap's rate" if effect.is_zero() else "enters nonlinearly"
        raise DefinitionError(
            f"reaction of {d.impacts[j]!r}: {d.reactions[j]} {problem}. Write the force that opens the "
            "contact as reaction times its direction. A diode, or a bound on a state whose own rate is changed, is "
            "Complementarity(y, multiplier=...)."
        )
    e = d.restitutions[j]
    if e.is_constant() and not 0.0 <= float(e) <= 1.0:
        raise DefinitionError(
            f"restitution of {d.impacts[j]!r}: expected a number from 0 to 1, received {float(e):g}."
        )


def _require_hysteresis(d: Definition) -> None:
    """Refuse elements whose two thresholds are not a fixed distance apart."""
    for width in listed(d.hysteresis):
        require_known(width, d.parameters, "thresholds of an element", **d.names)


def consistent_parameters(
    d: Definition, names: Sequence[str], parameters: Parameters | None
) -> Array:
    """Numbers for all parameters; a restitution that depends on nothing else must be one."""
    p = parameter_values(names, d.defaults, parameters)
    for j, name in enumerate(d.impacts):
        e = d.restitutions[j]
        if e.is_constant() or ca.depends_on(e, d.extended_states):
            continue
        value = float(ca.evalf(ca.substitute(e, d.parameters, ca.DM(p))))
        if not 0.0 <= value <= 1.0:
            raise ParameterError(
                f"restitution of {name!r}: expected a number from 0 to 1, received {value:g} (= {e})."
            )
    for width in listed(d.hysteresis):
        value = float(ca.evalf(ca.substitute(width, d.parameters, ca.DM(p))))
        if not (width.is_zero() or value > 0.0):
            raise ParameterError(
                f"thresholds of an element: the upper one is {value:g} (= {width}) above the lower one. "
                "Give values with a positive difference."
            )
    return p


def _require_linear(d: Definition) -> None:
    found = enters_nonlinearly(d.field, d.multipliers)
    for lam, is_nonlinear in zip(listed(d.multipliers), found, strict=True):
        if is_nonlinear:
            raise DefinitionError(
                f"multiplier {lam}: expected a field linear in it (Filippov's convex "
                "combination), received a nonlinear one. Nonlinear multipliers are hidden "
                "dynamics (Jeffrey 2018): give hidden=True if they are intended. Products of "
                "different multipliers are fine."
            )


def _require_locally_constant(d: Definition) -> None:
    """Refuse maps of discrete states that depend smoothly on states that move."""
    count = d.states.numel() - len(d.discrete)
    moving = ca.vertcat(d.states[:count], d.time)
    for j, (name, _) in enumerate(d.resets):
        for i in range(count, d.states.numel()):
            slope = ca.simplify(ca.densify(ca.jacobian(d.maps[i, j], moving)))
            if not slope.is_zero():
                raise DefinitionError(
                    f"map of reset {name!r}: the discrete state {d.states[i]} becomes {d.maps[i, j]}, which "
                    "varies smoothly with a state. A number that is sampled and held is an ordinary state "
                    "with the field 0."
                )


def _require_states(what: str, function: ca.SX, states: ca.SX, d: Definition) -> None:
    """Refuse a function that does not depend on the states."""
    if not ca.depends_on(function, states):
        received = f"the constant {function}"
        advice = "Its sign has to change along the motion."
        if d.time.numel() and ca.depends_on(function, d.time):
            received = f"the function {function} of time alone"
            advice = "Make a clock a state, c' = 1, and the surface a function of c."
        raise DefinitionError(
            f"{what}: expected a function of the states {tuple(d.names['states'])}, received "
            f"{received}. {advice}"
        )


def _require_simple(what: str, function: ca.SX, d: Definition) -> None:
    """Refuse a function with a visible multiple zero."""
    x = d.extended_states
    for factor, power in powers(function, x, d.parameters):
        if power > 1 and ca.depends_on(factor, x) and ca.is_linear(factor, x):
            raise DefinitionError(
                f"{what}: {function} has the factor {factor} {power} times, so its gradient "
                "vanishes on the surface, which cannot be located to rounding. Use the factor once "
                "if the power is odd; an even power does not change the sign."
            )
