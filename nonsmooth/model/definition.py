"""Reading the definition of a system: what a user wrote, checked, as symbols and expressions.

Both ways in, two fields of one surface or a field with multipliers, end in one form: a field in
states, time, parameters and multipliers, and functions of the first three.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from .cancel import powers
from .checks import real
from .errors import DefinitionError, ParameterError, explain
from .graph import require_smooth
from .reading import (
    Expression,
    Parameters,
    column,
    listed,
    require_finite,
    require_known,
    require_unique,
    scalar,
    symbols,
)

_DIRECTIONS = (-1, 0, 1)


@dataclass(frozen=True)
class Stop:
    """A surface that ends a run.

    Parameters
    ----------
    function : expression
        The run ends where it is zero.
    direction : {-1, 0, 1}
        Only when falling, either way, only when rising.
    name : str
        Shown in events and messages.
    """

    function: Expression
    direction: int = 0
    name: str = "stop"


@dataclass(frozen=True)
class Reset:
    """A surface on which the state jumps, x -> ``map``.

    Parameters
    ----------
    function : expression
        The jump happens where it is zero.
    map : sequence of expressions
        The new state, in the order of the states.
    direction : {-1, 0, 1}
        Only when falling, either way, only when rising.
    name : str
        Shown in events and messages.
    """

    function: Expression
    map: Sequence[Expression]
    direction: int = 0
    name: str = "reset"


@dataclass(frozen=True)
class Impact:
    """A gap that is never negative: bodies hit it, come to rest on it, and are let go.

    The contact is open (letter ``o``) or closed (``c``). Where the gap falls to zero with a rate v,
    an impulse along the reaction turns it into -restitution v. Impacts that accumulate end in the
    closed contact, in which the reaction keeps the gap at zero; it opens when the reaction falls to
    zero.

    Parameters
    ----------
    gap : expression
        Of states, parameters and time; not negative. Its rate must not depend on multipliers.
    restitution : expression or number, optional
        Newton's coefficient, from 0 to 1.
    reaction : SX symbol, optional
        A multiplier in the field, not negative and linear there: how the reaction acts. Unless given,
        one is added that acts along the gradient of the gap's rate (unit masses). Friction at the
        contact is a surface whose multiplier is multiplied with it.
    name : str, optional
        Shown in events and messages.

    Examples
    --------
    A mass on a shaken table, and a block that slides on a floor with friction:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, u, v, t, lam, r = (ca.SX.sym(s) for s in ("x", "y", "u", "v", "t", "lam", "r"))
    >>> gap = y - 0.1 * ca.sin(5 * t)
    >>> ns.FilippovSystem([y, v], field=[v, -9.81], impacts=ns.Impact(gap, restitution=0.5), time=t)
    FilippovSystem(2 states: y, v; 0 surfaces; time t; impact 'impact')
    >>> block = ns.FilippovSystem(
    ...     [x, y, u, v], field=[u, v, -0.3 * lam * r, r - 9.81], surface=u, multipliers=lam,
    ...     impacts=ns.Impact(y, reaction=r))
    """

    gap: Expression
    restitution: Expression = 0.0
    reaction: Expression | None = None
    name: str = "impact"


@dataclass(frozen=True)
class Definition:
    """A system as symbols and expressions.

    Attributes
    ----------
    states, time, parameters, multipliers : SX columns
        Symbols; ``time`` is empty where the system does not depend on it.
    field : SX (n,)
        In all of them.
    surfaces : SX (m,)
        Switching functions, one for each multiplier.
    guards : SX
        Functions of the stops, then of the resets.
    maps : SX (n, resets)
        States after the resets.
    reactions, gaps, restitutions : SX (c,)
        Symbols and functions of the impacts.
    stops, resets : tuple of (name, direction)
    impacts : tuple of str
        Names.
    defaults : dict
        Values of the parameters by name; None where there is none.
    hidden : bool
        Whether multipliers may enter nonlinearly.
    """

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

    @property
    def extended_states(self) -> ca.SX:
        """The states, followed by the time where the system depends on it."""
        return ca.vertcat(self.states, self.time)

    @property
    def gap_rates(self) -> ca.SX:
        """Rates of the gaps (c,), in states, parameters and time."""
        x = self.extended_states
        free = ca.vertcat(self.field, ca.SX.ones(self.time.numel(), 1))
        rates = ca.jtimes(self.gaps, x, free) if self.gaps.numel() else ca.SX(0, 1)
        return ca.densify(rates)

    @property
    def names(self) -> dict[str, list[str]]:
        """Names of the states and of the parameters."""
        return {
            "states": [s.name() for s in listed(self.states)],
            "parameters": [s.name() for s in listed(self.parameters)],
        }

    def state(self) -> dict[str, Any]:
        """Plain values from which ``from_state`` makes an equal definition."""
        inputs = [self.states, self.time, self.parameters, self.multipliers, self.reactions]
        outputs = [self.field, self.surfaces, self.guards, self.maps, self.gaps, self.restitutions]
        return {
            "definition": ca.Function("definition", inputs, outputs).serialize(),
            "names": [[str(s) for s in listed(v)] for v in inputs],
            "defaults": self.defaults,
            "stops": self.stops,
            "resets": self.resets,
            "impacts": self.impacts,
            "hidden": self.hidden,
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> Definition:
        """Make the definition that ``state`` was taken from, over new symbols."""
        function = ca.Function.deserialize(state["definition"])
        vectors = [ca.vertcat(*map(ca.SX.sym, names)) for names in state["names"]]
        vectors = [v if v.numel() else ca.SX(0, 1) for v in vectors]
        expressions = [ca.SX(e) for e in function.call(vectors)]
        inputs = ("states", "time", "parameters", "multipliers", "reactions")
        outputs = ("field", "surfaces", "guards", "maps", "gaps", "restitutions")
        rest = {k: state[k] for k in ("stops", "resets", "impacts", "defaults", "hidden")}
        parts = dict(zip((*inputs, *outputs), (*vectors, *expressions), strict=True))
        return cls(**parts, **rest)


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
    """Read what a user gave to FilippovSystem, whose docstring says what each is.

    Raises
    ------
    DefinitionError, NotSmoothError, ParameterError
    """
    x = symbols(states, "states")
    if x.numel() == 0:
        raise DefinitionError("states: expected at least one symbol, received none.")
    t = symbols([time], "time") if time is not None else ca.SX(0, 1)
    p, defaults = _parameters(parameters)
    h = _surfaces(surface, surfaces)
    if above is not None or below is not None:
        lam, f = _two_fields(above, below, field, multipliers, h, x.numel())
    else:
        lam = symbols(listed(multipliers), "multipliers")
        f = column(field, "field", x.numel())
    _one_multiplier_each(lam, h)
    stops, resets = _items(stops, Stop, "stops"), _items(resets, Reset, "resets")
    guards = [column([s.function], f"stop {s.name!r}", 1) for s in stops]
    guards += [column([r.function], f"reset {r.name!r}", 1) for r in resets]
    maps = [column(r.map, f"map of reset {r.name!r}", x.numel()) for r in resets]
    impacts = _items(impacts, Impact, "impacts")
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
    )
    _check(definition)
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
    """Check a scalar function of states, parameters and time that a user gave.

    Raises
    ------
    DefinitionError, NotSmoothError
    """
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


def _surfaces(surface: Expression | None, surfaces: Sequence[Expression] | None) -> ca.SX:
    if surface is not None and surfaces is not None:
        raise DefinitionError(
            "surface: expected either surface= or surfaces=, received both. One switching "
            "function goes to surface=, several to surfaces=."
        )
    given = [surface] if surface is not None else listed(surfaces)
    expressions = [scalar(v, f"surface {i}") for i, v in enumerate(given)]
    return ca.vertcat(*expressions) if expressions else ca.SX(0, 1)


def _items(values: Any, kind: type[Any], what: str) -> list[Any]:
    """Read stops= or resets=: one, or a sequence of them."""
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
        field = field + given[-1] * ca.densify(ca.gradient(rate, x))
    return ca.vertcat(*given) if given else ca.SX(0, 1), field


# Checks ------------------------------------------------------------------------------------------


def _check(d: Definition) -> None:
    guards = [f"stop {n!r}" for n, _ in d.stops] + [f"reset {n!r}" for n, _ in d.resets]
    named = [("field", d.field, True)]
    named += [(f"surface {i}", e, False) for i, e in enumerate(listed(d.surfaces))]
    named += [(name, d.guards[i], False) for i, name in enumerate(guards)]
    named += [(f"map of reset {n!r}", d.maps[:, j], False) for j, (n, _) in enumerate(d.resets)]
    for j, name in enumerate(d.impacts):
        named += [(f"gap of {name!r}", d.gaps[j], False)]
        named += [(f"restitution of {name!r}", d.restitutions[j], False)]
    known = ca.vertcat(d.extended_states, d.parameters, d.multipliers, d.reactions)
    require_unique(known)
    moving = ca.vertcat(d.extended_states, d.multipliers, d.reactions)
    for what, expression, multipliers in named:
        require_known(expression, known, what, **d.names)
        if not multipliers and ca.depends_on(expression, ca.vertcat(d.multipliers, d.reactions)):
            raise DefinitionError(
                f"{what}: expected an expression in states, time and parameters, received one "
                "with a multiplier. Only the field may contain multipliers."
            )
        require_finite(expression, known, what)
        require_smooth(expression, moving, d.parameters, what)
    for i, name in enumerate(guards):
        if not ca.depends_on(d.guards[i], d.extended_states):
            raise DefinitionError(_without_states(name, d.guards[i], d))
        _require_simple(name, d.guards[i], d)
    for i, h in enumerate(listed(d.surfaces)):
        if not ca.depends_on(h, d.states):
            raise DefinitionError(_without_states(f"surface {i}", h, d))
        _require_simple(f"surface {i}", h, d)
    for j in range(len(d.impacts)):
        _check_impact(d, j)
    if not d.hidden:
        _require_linear(d)


def _check_impact(d: Definition, j: int) -> None:
    what, gap, rate = f"gap of {d.impacts[j]!r}", d.gaps[j], d.gap_rates[j]
    if not ca.depends_on(gap, d.states):
        raise DefinitionError(_without_states(what, gap, d))
    _require_simple(what, gap, d)
    if ca.depends_on(rate, ca.vertcat(d.multipliers, d.reactions)):
        raise DefinitionError(
            explain(
                what,
                expected="a function of positions, whose rate no multiplier enters",
                received=f"{gap}, with the rate {rate}",
                advice="Forces act on velocities: a gap is a function of positions and time.",
            )
        )
    effect = ca.mtimes(ca.jacobian(rate, d.states), ca.jacobian(d.field, d.reactions[j]))
    if effect.is_zero() or not ca.is_linear(d.field, d.reactions[j]):
        raise DefinitionError(
            explain(
                f"reaction of {d.impacts[j]!r}",
                expected="a multiplier that enters the field linearly and moves the gap's rate",
                received="one that does not move it" if effect.is_zero() else "a nonlinear one",
                advice="Write the force that opens the contact as reaction times its direction.",
            )
        )
    e = d.restitutions[j]
    if e.is_constant() and not 0.0 <= float(e) <= 1.0:
        raise DefinitionError(
            f"restitution of {d.impacts[j]!r}: expected a number from 0 to 1, received {float(e):g}."
        )


def _require_linear(d: Definition) -> None:
    for lam in listed(d.multipliers):
        if not ca.is_linear(d.field, lam):
            raise DefinitionError(
                f"multiplier {lam}: expected a field linear in it (Filippov's convex "
                "combination), received a nonlinear one. Nonlinear multipliers are hidden "
                "dynamics (Jeffrey 2018): say hidden=True if they are meant. Products of "
                "different multipliers are fine."
            )


def _require_simple(what: str, function: ca.SX, d: Definition) -> None:
    """Refuse a power of something that is zero on the surface, as far as it is in sight."""
    x = d.extended_states
    for factor, power in powers(function, x, d.parameters):
        if power > 1 and ca.depends_on(factor, x) and ca.is_linear(factor, x):
            raise DefinitionError(
                explain(
                    what,
                    expected="a function with simple zeros",
                    received=f"{function}, which has the factor {factor} {power} times",
                    advice="Where the gradient vanishes too, the surface cannot be located to "
                    "rounding: use the factor once if the power is odd; an even one does not "
                    "change the sign.",
                )
            )


def _without_states(what: str, function: ca.SX, d: Definition) -> str:
    """Message for a surface, stop or reset that no motion can cross."""
    if d.time.numel() and ca.depends_on(function, d.time):
        received, advice = (
            f"the function {function} of time alone",
            "Make a clock a state: c with c' = 1, started at the time, and the surface a function "
            "of c.",
        )
    else:
        received = f"the constant {function}"
        advice = "A surface is the zero set of a function of the states."
    return explain(
        what,
        expected=f"a function of the states {tuple(d.names['states'])}",
        received=received,
        advice=advice,
    )
