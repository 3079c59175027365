"""Maps of events: the function e(x, p) of an event and the state g(x, p) after it, with gradients.

g is the identity if the event does not reset the state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import casadi as ca
import numpy as np

from ..cache import Content
from ..definition.events.conditions import decides
from ..definition.system import FilippovSystem
from ..errors import DegenerateError
from ..expressions.graph import Expressions, evaluate, instructions, operation
from ..expressions.identity import vanish_on
from ..laws.coupled import combinable, coupled_of, raised_of
from ..laws.evaluators import Evaluator, evaluator
from ..laws.motion import motion, solved
from ..laws.switches import Guard
from ..numbering import UNWATCHED
from ..printing.instructions import Values, values_of
from ..values import Array


@dataclass(frozen=True, eq=False)
class PlainMap:
    """g and e without derivatives."""

    values: Values


class EventMap:
    """The event at the end of a leg: e and g in its states; ``smooth`` where g is the identity."""

    def __init__(
        self,
        system: FilippovSystem,
        states: ca.SX,
        event: ca.SX,
        guard: Guard,
        after: ca.SX | None = None,
    ):
        self.guard, self.smooth = guard, after is None
        self._n, self._event = system.extended_dimension, event
        self._after = states[: self._n] if after is None else after
        self._inputs = [states, system.parameter_symbols]

    def _with_gradients(self, e: ca.SX) -> list[ca.SX]:
        return [ca.densify(d) for d in (e, *(ca.jacobian(e, v) for v in self._inputs))]

    @cached_property
    def _function(self) -> Evaluator:
        outputs = [] if self.smooth else self._with_gradients(self._after)
        outputs += self._with_gradients(self._event)
        return Evaluator(ca.Function("event", self._inputs, outputs, {"cse": True}))

    @cached_property
    def values(self) -> Values:
        """The entries of g, g_x, g_p, e, e_x and e_p, column after column, as a graph."""
        outputs = [*self._with_gradients(self._after), *self._with_gradients(self._event)]
        return values_of(self._inputs, outputs)

    @cached_property
    def plain(self) -> PlainMap:
        """g and e alone."""
        outputs = [ca.densify(e) for e in (self._after, self._event)]
        return PlainMap(values_of(self._inputs, outputs))

    def __call__(self, y: Array, p: Array) -> AtEvent:
        """Evaluate at the end of a leg."""
        *after, e, ex, ep = self._function.copied(y, p)
        event = float(e[0, 0]), ex[0], ep[0]
        if self.smooth:
            return AtEvent.smooth_at(np.array(y[: self._n], float), *event)
        g, gx, gp = after
        return AtEvent(g[:, 0], gx, gp, *event)


@dataclass(frozen=True)
class AtEvent:
    """Numbers of an event map at a point, for N states, k multipliers and q parameters."""

    after: Array  # g (N,)
    after_state: Array  # (N, N + k)
    after_parameters: Array  # (N, q)
    value: float  # e
    gradient: Array  # of e by states and multipliers (N + k,)
    by_parameters: Array  # of e (q,)
    smooth: bool = False  # whether g is the identity

    @property
    def negative(self) -> AtEvent:
        """The same with a function of the other sign."""
        return replace(
            self,
            value=-self.value,
            gradient=-self.gradient,
            by_parameters=-self.by_parameters,
        )

    @classmethod
    def smooth_at(cls, x: Array, value: float, gradient: Array, by_parameters: Array) -> AtEvent:
        """An event at a state (N,) that does not change it."""
        unit, none = _identity(len(x), len(gradient), len(by_parameters))
        return cls(x, unit, none, value, gradient, by_parameters, True)


@lru_cache(maxsize=64)
def _identity(n: int, width: int, q: int) -> tuple[Array, Array]:
    """The derivatives of a map that changes nothing, by states and by parameters."""
    return np.broadcast_to(np.eye(n, width), (n, width)), np.broadcast_to(0.0, (n, q))


def event_map(
    system: FilippovSystem,
    mode: str,
    kind: str,
    element: int,
    side: int,
    letters: str = "",
    atom: int = -1,
) -> EventMap:
    """The map of an event of a mode, with the function of an ``atom`` of its condition; built once."""
    if system.sets and kind not in ("exit", "release"):
        return instant_map(system, system.widened(mode), kind, element, letters)

    def build() -> EventMap:
        of_mode = motion(system, mode)
        if kind == "jump":
            function, after = jumped(system, element, letters)
            return EventMap(system, of_mode.states, function, Guard("zero", 0, 0, element), after)
        for row, guard in enumerate(of_mode.guards):
            if guard.ends(kind, element, side):
                after = _after(system, mode, guard, letters)
                function = of_mode.functions[row] if atom < 0 else system.definition.guards[atom]
                return EventMap(system, of_mode.states, function, guard, after)
        raise DegenerateError(
            f"leg in mode {mode!r}: its {kind} is no zero of a function, as where a branch of hidden "
            "sliding ends, and has no derivative. End the run before it."
        )

    return system.cached(("event map", mode, kind, element, side, letters, atom), build)


def instant_map(
    system: FilippovSystem, mode: str, kind: str, element: int, letters: str = "", atom: int = -1
) -> EventMap:
    """The map of a crossing, entry, stop, reset, jump or impact, of which alone the ``mode`` matters, as one of the
    extended states; with the function of an ``atom`` of its condition."""

    def build() -> EventMap:
        d, i = system.definition, element
        if kind == "jump":
            function, after = jumped(system, element, letters)
            return EventMap(system, system.extended_states, function, Guard("zero", 0, 0, i), after)
        if kind in ("stop", "reset"):
            own = i if kind == "stop" else len(system.stops) + i
            function = d.guards[own if atom < 0 else atom]
        elif kind == "impact":
            i -= len(system.entries)
            if takes_in_space(system, mode, i):
                from .impact_in_space import ImpactInSpace  # which needs this module

                return ImpactInSpace(system, mode, i, letters)
            function = d.gaps[i]
        else:
            i = system.entries[element][0]
            function = d.open_surfaces[i]
        guard = Guard("surface" if kind in ("crossing", "entry") else kind, i, 0, element)
        after = _after(system, mode, guard, letters)
        return EventMap(system, system.extended_states, function, guard, after)

    return system.cached(("instant map", mode, kind, element, letters, atom), build)


def function_map(system: FilippovSystem, mode: str, function: ca.SX) -> EventMap:
    """The map of a leg that ends where a function of states, parameters and time is zero."""
    symbols = [system.extended_states, system.parameter_symbols]

    def build() -> EventMap:
        guard = Guard("zero", 0, 0, 0)
        states = symbols[0] if system.sets else motion(system, mode).states
        return EventMap(system, states, function, guard)

    return system.cached(("function map", mode, Content(symbols, function)), build)


def _after(system: FilippovSystem, mode: str, guard: Guard, letters: str) -> ca.SX | None:
    """The state after an event, None where it does not change."""
    time = system.definition.time
    if guard.kind == "reset":
        return ca.vertcat(system.definition.maps[:, guard.index], time)
    if guard.kind == "impact":
        return struck(system, mode, guard.index, letters)
    return None


@dataclass(frozen=True)
class Struck:
    """Possible participants of the impact of a contact: its friction, closed contacts."""

    carried: tuple[int, ...]
    closed: tuple[int, ...]

    def choices(self, mode: str) -> list[str]:
        """Letters of each, the present ones of friction and contacts that take an impulse first."""
        friction = [mode[i] + "".join(c for c in "s+-" if c != mode[i]) for i in self.carried]
        return [*friction, *["co"] * len(self.closed)]


def struck_by(system: FilippovSystem, mode: str, contact: int) -> Struck:
    """Possible participants of an impact."""
    coupled, m = coupled_of(system), system.surface_count
    signs = system.parse_letters(mode)
    closed = [j for j in range(len(system.impacts)) if not signs[m + j] and j != contact]
    carried = [i for i in range(m) if any(j in (contact, *closed) for j in coupled.carriers[i])]
    return Struck(tuple(carried), tuple(closed))


def takes_in_space(system: FilippovSystem, mode: str, contact: int) -> bool:
    """Whether friction in space may take part in the impact of a contact."""
    return any(i in system.set_of for i in struck_by(system, mode, contact).carried)


def struck(system: FilippovSystem, mode: str, contact: int, letters: str = "") -> ca.SX:
    """The state after the impulses at a gap that closes (``contacts.c``)."""
    # ``letters`` tell which closed contacts take part, with the rate zero, and the side to which friction acts, with
    # the impulse in the same proportion as with the reaction.
    coupled, m, d = coupled_of(system), system.surface_count, system.definition
    others = struck_by(system, mode, contact)
    carried = others.carried
    letters = letters or "".join(own[0] for own in others.choices(mode))
    takes = zip(others.closed, letters[len(carried) :], strict=True)
    taking = [contact, *[j for j, letter in takes if letter == "c"]]
    held = dict(zip(carried, letters, strict=False))
    numbers = ca.SX([{"+": 1.0, "-": -1.0}.get(held.get(i, mode[i]), 0.0) for i in range(m)])
    kept = [*system.joints, *[i for i in carried if held[i] == "s"]]
    every = [*kept, *[m + j for j in taking]]
    columns = ca.jacobian(coupled.field, coupled.symbols_of(every))
    columns = ca.substitute(columns, coupled.multipliers, numbers) if m else columns
    own = [[d.open_surfaces[i], *coupled.lower[i]][-1] for i in kept]
    rates = ca.vertcat(*own, d.gap_rates[taking])
    slope = ca.mtimes(ca.jacobian(rates, system.extended_states), columns)
    back, k = d.restitutions[taking], len(kept)
    if d.impact_law == "poisson":  # what is kept by friction or joints is so in both parts
        impulses = (1 + back) * solved(slope, -rates)[k:]
        if k:
            rest = -rates[:k] - ca.mtimes(slope[:k, k:], impulses)
            impulses = ca.vertcat(solved(slope[:k, :k], rest), impulses)
    else:
        back = ca.vertcat(ca.SX.zeros(k), back[0], ca.SX.zeros(len(taking) - 1))
        impulses = solved(slope, -(1 + back) * rates)
    return ca.densify(system.extended_states + ca.mtimes(columns, impulses))


def jumping(system: FilippovSystem, x: Array, after: Array, p: Array) -> str:
    """Letters of the complementarity conditions: closed (c) where one takes an impulse in a jump to ``after``."""
    from scipy.optimize import nnls  # slow to import

    if combinable(system):
        raise DegenerateError(
            "jump: its derivatives are implemented where no y of a complementarity condition holds a multiplier. Start "
            "after it."
        )
    coupled, own = coupled_of(system), [i for i in system.half_lines if i not in system.algebraic]
    columns = lambda: [ca.jacobian(coupled.field, coupled.symbols_of(own))]
    b = evaluator(system, "columns of conditions", columns).copied(after, p)[0]
    impulses = nnls(b, after - x)[0]
    taking = {i for i, impulse in zip(own, impulses, strict=True) if impulse > 0.0}
    return "".join("c" if i in taking else "o" for i in system.half_lines)


def jumped(system: FilippovSystem, element: int, letters: str) -> tuple[ca.SX, ca.SX]:
    """y of a complementarity condition, and the state after the impulses of those that ``letters`` say (c)."""
    coupled, d, x = coupled_of(system), system.definition, system.extended_states
    own = [i for i, letter in zip(system.half_lines, letters, strict=True) if letter == "c"]
    columns, y = ca.jacobian(coupled.field, coupled.symbols_of(own)), d.open_surfaces[own]
    gradient = ca.jacobian(y, x)
    if ca.depends_on(gradient, x) or ca.depends_on(columns, x):
        raise DegenerateError(
            f"jump of {system.surface_names[system.entries[element][0]]!r}: its derivatives are implemented where "
            "y and the field are linear in the states. Start after it."
        )
    impulses = solved(ca.mtimes(gradient, columns), -y)
    return d.open_surfaces[system.entries[element][0]], x + ca.mtimes(columns, impulses)


def keeps_zero(system: FilippovSystem, surface: int, reset: int) -> bool:
    """Whether the map of a reset leads to zeros of a switching function, or with -1 of its own, from its zeros."""
    d = system.definition

    def build() -> bool:
        h = d.open_surfaces[surface] if surface >= 0 else d.guards[len(d.stops) + reset]
        after = ca.substitute(h, d.states, d.maps[:, reset])
        return bool(ca.is_equal(h, after, 10)) or vanish_on([after], h, d.extended_states)

    return system.cached(("keeps zero", surface, reset), build)


def surface_map(system: FilippovSystem, surface: int) -> EventMap:
    """A switching function as a map on the extended states, with its gradients."""

    def build() -> EventMap:
        guard = Guard("zero", surface, 0, surface)
        return EventMap(system, system.extended_states, system.surface_function(surface), guard)

    return system.cached(("surface map", surface), build)


def kept_maps(system: FilippovSystem, kept: Sequence[int]) -> list[EventMap]:
    """Functions that are zero while surfaces slide, then those of closed contacts, as maps on the extended states."""
    x, m, found = system.extended_states, system.surface_count, list[EventMap]()
    for i in kept:
        rows = [*coupled_of(system).lower[i]] if i in system.joints else []
        if i < m:
            found.append(surface_map(system, i))
        else:
            rows = [system.definition.gaps[i - m], system.definition.gap_rates[i - m]]
        for k, rate in enumerate(rows):
            build = partial(EventMap, system, x, rate, Guard("zero", i, 0, i))
            found.append(system.cached(("rate map", i, k), build))
    return found


def rest_maps(system: FilippovSystem, mode: str, elements: Sequence[int]) -> list[EventMap]:
    """Functions and rates that are zero where surfaces, sets and contacts rest, by their positions in a mode."""

    def build() -> list[EventMap]:
        d, lower, count, kept = system.definition, raised_of(system).lower, len(system.entries), []
        for k in elements:
            if k < count:
                kept += [e for i in system.entries[k] for e in (d.open_surfaces[i], *lower[i])]
            else:
                kept += [d.gaps[k - count], d.gap_rates[k - count]]
        return [function_map(system, mode, e) for e in kept]

    return system.cached(("rest maps", mode, tuple(elements)), build)


def atoms_at(
    system: FilippovSystem, kind: str, element: int, x: Array, p: Array
) -> dict[int, float]:
    """Values of the functions that decide when a stop or reset is due and that move along a motion."""
    d = system.definition
    rule = d.rules[element if kind == "stop" else len(d.stops) + element]
    own = {code // 8 for tree in rule.located for code in tree if code >= 0}
    atoms = [k for k, way in enumerate(d.located) if k in own and way != UNWATCHED]
    build = lambda: [d.guards[k] for k in atoms]
    values = _values_at(system, ("atoms of", kind, element), build, x, p)
    return dict(zip(atoms, values, strict=True))


def atom_of(system: FilippovSystem, guard: Guard) -> int:
    """Index of the function of a guard of an event among those of all conditions."""
    before = {"reset": len(system.stops), "atom": len(system.stops) + len(system.resets)}
    return guard.element + before.get(guard.kind, 0)


def is_due_at(system: FilippovSystem, guard: Guard, x: Array, p: Array) -> bool:
    """Whether an event becomes due, or ceases to be, where a function of its condition passes zero at a state."""
    d = system.definition
    if d.plain:
        return True
    i = atom_of(system, guard)
    build = lambda: [*ca.vertsplit(d.guards), *ca.vertsplit(d.whens)]
    values = _values_at(system, ("conditions",), build, x, p)
    count = d.guards.numel()
    sides = [(v > 0.0) - (v < 0.0) for v in values[:count]]
    rules = zip(d.rules, values[count:], strict=True)
    return any(
        (when != 0.0 or rule.when is not None) and decides(rule, i, sides) for rule, when in rules
    )


def choices_at(
    system: FilippovSystem, kind: str, element: int, x: Array, p: Array
) -> tuple[Array, Array]:
    """Differences (k,) by which comparisons, fmin, fmax and if_else in a map and a filter decide, with gradients."""
    seen = deciding(system, kind, element)
    if not seen:
        return np.zeros(0), np.zeros((0, len(x)))
    own = ca.vertcat(*seen)
    outputs = lambda: [own, ca.jacobian(own, system.extended_states)]
    values, gradient = evaluator(system, ("choices", kind, element), outputs).copied(x, p)
    return values.ravel(), gradient


def deciding(system: FilippovSystem, kind: str, element: int) -> list[ca.SX]:
    """The differences of states or time by which the map and the filter of a stop or reset decide."""
    d = system.definition

    def build() -> list[ca.SX]:
        i = element if kind == "stop" else len(d.stops) + element
        outputs = [d.whens[i], *([d.maps[:, element]] if kind == "reset" else [])]
        inputs = [system.extended_states, system.parameter_symbols]
        found, moving = _Differences(inputs), d.states[: d.states.numel() - len(d.discrete)]
        evaluate(instructions(inputs, outputs)[0], found)
        return [e for e in found.seen if ca.depends_on(e, ca.vertcat(moving, d.time))]

    return system.cached(("differences of", kind, element), build)


def _values_at(
    system: FilippovSystem,
    key: tuple[object, ...],
    build: Callable[[], list[ca.SX]],
    x: Array,
    p: Array,
) -> list[float]:
    found = evaluator(system, key, lambda: [ca.vertcat(*build(), 0)]).copied(x, p)[0]
    return found.ravel().tolist()[:-1]


class _Differences(Expressions):
    """Expressions of a graph, and the differences by which its operations choose."""

    def __init__(self, vectors: list[ca.SX]):
        super().__init__(vectors)
        self.seen = list[ca.SX]()

    def apply(self, op: str, args: Sequence[ca.SX]) -> ca.SX:
        if op in ("lt", "le", "eq", "ne", "fmin", "fmax"):
            self.seen.append(args[0] - args[1])
        elif op in ("sign", "fabs"):
            self.seen.append(args[0])
        return operation(op, args)
