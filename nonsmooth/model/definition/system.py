"""A Filippov system: states, parameters, fields, switching surfaces and events.

If the system depends on time, time is the last component of the state, in Lie derivatives and jets too.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import accumulate
from typing import Any, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ...notebook import Markup, representation
from ..cache import CAPACITY, Cache, Content
from ..calls import call
from ..checks import real
from ..errors import DefinitionError, PointError
from ..expressions.linearity import enters_nonlinearly
from ..expressions.mathml import equation, rate, symbol
from ..reading import Expression, Parameters, column, listed, matrix, require_known, scalar
from ..values import Array, state_values
from .complementarity import holds
from .constraints import Constraint
from .discrete_states import held_values, with_values
from .elements import Complementarity, unknowns_of
from .events import Clock, Impact, Reset, Stop, with_added_states
from .lift import LiftedSwitch, lift
from .matrix_symbols import in_scalar_symbols, read_dae
from .parse_definition import (
    Definition,
    consistent_parameters,
    read_definition,
)
from .roots import roots_of
from .switching import Switching, class_of
from .tables.pieces import by_breakpoints, by_pieces, in_cells

T = TypeVar("T")

#: Classes of surfaces are shown for at most so many of them.
_CLASSES_SHOWN = 8
_EQUATIONS_SHOWN = 12
_FUNCTIONS_SHOWN = 24
#: Further cached results for each breakpoint of a table, for the objects of an orbit in each cell.
_OF_CELL = 8

_SIDES = (("+", "above"), ("-", "below"))

Discrete = Sequence[Expression] | Mapping[Any, Sequence[float] | None]


class FilippovSystem:
    """A system $x' = f(x, lambda; p)$ with $lambda_i in Sgn(h_i(x))$.

    Give either the two fields of one surface, or a field with multipliers. ``lambda = +1`` where
    ``h > 0`` and ``-1`` where ``h < 0``; in between while sliding. Each multiplier must enter the
    field linearly (Filippov's convention); products of different multipliers are allowed.

    Parameters
    ----------
    states : sequence of scalar casadi.SX symbols
        The n states.
    surface : expression, optional
        The switching function h; its zero set is the surface.
    above, below : sequence of n expressions, optional
        The fields $F1$ where $h > 0$ and $F2$ where $h < 0$.
    field : sequence of n expressions, optional
        The right-hand side in states, parameters, time and multipliers.
    multipliers : SX symbol or sequence of them, optional
        One for each surface; a vector for each set.
    surfaces : sequence of expressions, optional
        Switching functions, one for each multiplier (``surface`` also takes one). A vector h of two or
        three is one set $h = 0$: its multiplier is $h/|h|$ off it and $|lambda| <= 1$ on it. A
        :class:`Relay` is one with hysteresis.
    parameters : mapping or sequence, optional
        Symbols with their default values; None, or a bare sequence of symbols, means no default.
    time : SX symbol, optional
        The symbol of time if the system depends on it.
    stops : sequence of Stop, optional
        Surfaces on which a run ends.
    resets : sequence of Reset, optional
        Surfaces on which the state jumps.
    impacts : sequence of Impact, optional
        Contacts that cannot be passed.
    complementarity : sequence of Complementarity, optional
        Ideal diodes, projections and sweeping sets: ``0 <= y``, ``multiplier >= 0``, one of them zero.
    constraints : sequence of Constraint, optional
        Joints: functions that stay zero. Each has the letter ``s`` in a mode, after the surfaces.
    clocks : sequence of Clock, optional
        Periodic functions of time; each adds its phase to the states.
    discrete : sequence of SX symbols or mapping, optional
        States that change at resets only; starts have them last. A mapping gives the values that each
        may have: ``{q: (0, 1)}``. The field may depend on them and has no entry for them.
    hidden : bool, optional
        Allow multipliers that enter nonlinearly (hidden dynamics, Jeffrey 2018): sliding then
        follows a stable solution $lambda$ of $grad h . f(x, lambda) = 0$.
    layer_widths : sequence of float, optional
        Widths of the layers of the surfaces, in the units of their functions; equal unless given. Where
        several surfaces slide, stability of sliding can depend on their ratios; ``run.facts`` records whether
        it did.

    Raises
    ------
    DefinitionError
        Shapes, foreign symbols, a constant surface, a multiplier that enters nonlinearly, a CasADi
        Function that is no graph of SX operations (``interpolant``, ``rootfinder``, external ones).
    NotSmoothError
        sign, fabs, fmin, fmax, if_else or a comparison of the states in an expression.

    Examples
    --------
    A block on a belt with Coulomb friction, in both forms:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, v, lam = (ca.SX.sym(s) for s in ("x", "v", "lam"))
    >>> ns.FilippovSystem([x, v], surface=v - 0.3, above=[v, -x - 0.4], below=[v, -x + 0.4])
    FilippovSystem(2 states: x, v; 1 surface)
    >>> ns.FilippovSystem([x, v], surfaces=[v - 0.3], multipliers=[lam], field=[v, -x - 0.4 * lam])
    FilippovSystem(2 states: x, v; 1 surface)
    """

    #: What ``from_expression`` found, one for each surface; empty for other systems.
    lifted: tuple[LiftedSwitch, ...] = ()

    def __init__(
        self,
        states: Sequence[Expression],
        *,
        surface: Expression | None = None,
        above: Sequence[Expression] | None = None,
        below: Sequence[Expression] | None = None,
        field: Sequence[Expression] | None = None,
        multipliers: Sequence[Expression] | Expression | None = None,
        surfaces: Sequence[Expression] | None = None,
        parameters: Parameters | Sequence[Expression] | None = None,
        time: Expression | None = None,
        stops: Sequence[Stop] = (),
        resets: Sequence[Reset] | Reset = (),
        impacts: Sequence[Impact] | Impact = (),
        complementarity: Sequence[Complementarity] | Complementarity = (),
        constraints: Sequence[Constraint] | Constraint = (),
        clocks: Sequence[Clock] | Clock = (),
        discrete: Discrete = (),
        hidden: bool = False,
        layer_widths: Sequence[float] | None = None,
    ):
        given = {name: value for name, value in locals().items() if name != "self"}
        self._adopt(read_definition(**with_added_states(in_scalar_symbols(given))))

    # construction ------------------------------------------------------------------------------

    @classmethod
    def from_expression(
        cls,
        states: Sequence[Expression],
        rhs: Sequence[Expression],
        *,
        parameters: Parameters | Sequence[Expression] | None = None,
        time: Expression | None = None,
        stops: Sequence[Stop] = (),
        resets: Sequence[Reset] | Reset = (),
        impacts: Sequence[Impact] | Impact = (),
        complementarity: Sequence[Complementarity] | Complementarity = (),
        constraints: Sequence[Constraint] | Constraint = (),
        clocks: Sequence[Clock] | Clock = (),
        discrete: Discrete = (),
        hidden: bool = False,
    ) -> FilippovSystem:
        """Find sign, fabs, fmin, fmax and if_else in a right-hand side and make them surfaces.

        Identical switching functions, also up to a constant factor, share one multiplier; see
        ``lifted`` for the surfaces and their order. The value of the expression on a surface does not
        matter: there the field is Filippov's convex combination of both sides, also where the
        expression is nonlinear in a switch, as sign(x)**2 is, unless ``hidden`` is true.

        Parameters
        ----------
        states, parameters, time, stops, resets, impacts, complementarity, constraints, clocks, discrete
            As for the class. Gaps, y and functions of constraints must be smooth.
        rhs : sequence of n expressions
            In states, parameters and time, multipliers and reactions that elements bring, with switches.
        hidden : bool, optional
            Keep switches that enter nonlinearly as they are written (hidden dynamics).

        Raises
        ------
        NotSmoothError
            floor, ceil, fmod, an equality, or a condition that is no comparison.
        DefinitionError
            Shapes and symbols, as for the class.

        Notes
        -----
        Source: Filippov 1988, sec. 4; nonlinear switches: Jeffrey 2018, Hidden Dynamics. The rules
        are in ``nonsmooth/model/definition/lift.py``.

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
        >>> rhs = [v, -x - ca.sign(v) * ca.if_else(v > 0, 0.4, 0.3)]
        >>> system = ns.FilippovSystem.from_expression([x, v], rhs)
        >>> system, str(system.lifted[0])
        (FilippovSystem(2 states: x, v; 1 surface: v), 'h0 = v (comparison, sign); ...')
        >>> system.field("+"), system.field("-")
        (SX([v, (-(x+0.4))]), SX([v, (-(x+-0.3))]))
        """
        given = {name: value for name, value in locals().items() if name != "cls"}
        given = in_scalar_symbols(given)
        column(given["rhs"], "rhs", len(listed(given["states"])))  # before clocks are added
        given = with_added_states(given)
        n, rhs = len(listed(given["states"])), given.pop("rhs")
        own = {name: given[name] for name in ("parameters", "time")}
        frame = cls(given["states"], field=[0] * n, **own).definition
        entries = column(rhs, "rhs", n)
        brought = (given[name] for name in ("complementarity", "impacts", "constraints"))
        held = ca.vertcat(frame.parameters, *[unknowns_of(elements) for elements in brought])
        known = ca.vertcat(frame.extended_states, held)
        require_known(entries, known, "rhs", **frame.names)
        found = lift(entries, frame.states, frame.time, held, hidden=hidden)
        given |= {"field": found.field, "multipliers": found.multipliers}
        given["surfaces"], values = found.surfaces, given["parameters"]
        if found.values and isinstance(values, Mapping):
            given["parameters"] = {**values, **dict.fromkeys(found.values)}
        elif found.values:
            given["parameters"] = [*listed(values), *found.values]
        made = read_definition(**given)
        names = {value.name() for value in found.values}
        defaults = {name: value for name, value in made.defaults.items() if name not in names}
        return cls._of(replace(made, tables=found.tables, defaults=defaults), found.switches)

    @classmethod
    def from_dae(
        cls,
        dae: Mapping[str, Any],
        *,
        parameters: Mapping[Any, float] | None = None,
        **events: Any,
    ) -> FilippovSystem:
        """Read CasADi's dictionary of an ordinary differential equation, as its ``integrator`` takes it.

        Parameters
        ----------
        dae : mapping
            ``x`` and ``ode``, and ``t`` and ``p`` where there are any: SX, or MX that expand to SX. Entries of a
            vector ``x`` are named x_0, x_1, ...
        parameters : mapping, optional
            Values of entries of ``p``, by name or symbol.
        **events
            As for ``from_expression``: stops, resets, complementarity, constraints, ...

        Returns
        -------
        FilippovSystem
            With the switches of ``ode`` as surfaces.

        Raises
        ------
        DefinitionError
            Algebraic equations or other entries; MX that call a table or another Function that is no graph.
        NotSmoothError
            As ``from_expression``.

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, p = ca.MX.sym("x", 2), ca.MX.sym("mu")
        >>> ode = ca.vertcat(x[1], -x[0] - p * ca.sign(x[1]))
        >>> ns.FilippovSystem.from_dae({"x": x, "p": p, "ode": ode}, parameters={"mu": 0.1})
        FilippovSystem(2 states: x_0, x_1; 1 surface: x_1; parameters: mu)
        """
        return cls.from_expression(**read_dae(dae, parameters, events))

    def holding(self, values: Mapping[Any, float]) -> FilippovSystem:
        """Hold the discrete states at values: the system between two events, without stops and resets.

        Functions of a point, such as :func:`classify` and :func:`find_equilibrium`, do this themselves, with
        the values in the point. Portraits do it for each value; two-folds and manifolds take the system that this
        returns.

        Parameters
        ----------
        values : mapping
            A number for each discrete state; keys are symbols or names.

        Returns
        -------
        FilippovSystem
            Of the other states.

        Raises
        ------
        DefinitionError
            Other names than those of the discrete states.
        PointError
            A value that the discrete state does not have.

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, q = ca.SX.sym("x"), ca.SX.sym("q")
        >>> on = ns.Reset(x - 18, {q: 1}, -1, level=True, when=q == 0, name="on")
        >>> off = ns.Reset(x - 22, {q: 0}, 1, level=True, when=q == 1, name="off")
        >>> room = ns.FilippovSystem([x], field=[30 * q - x], discrete={q: (0, 1)}, resets=[on, off])
        >>> room.holding({q: 1})
        FilippovSystem(1 state: x; 0 surfaces)
        >>> ns.find_equilibrium(room, [20.0, 1]).eigenvalues
        array([-1.])
        """
        key = tuple(held_values(self.definition, values))

        return self.cached(
            ("holding", key), lambda: self._of(with_values(self.written, list(key)), self.lifted)
        )

    @classmethod
    def _of(cls, written: Definition, lifted: tuple[LiftedSwitch, ...] = ()) -> FilippovSystem:
        """Return the system of a definition that was read, and of the switches that were found for it."""
        system = cls.__new__(cls)
        system._adopt(written)
        system.lifted = lifted
        return system

    def _adopt(self, written: Definition) -> None:
        #: The definition with tables as elements of one argument each; ``definition`` has their breakpoints.
        self.written = written
        definition = self.definition = by_breakpoints(written) if written.tables else written
        self.stops, self.resets = definition.stops, definition.resets
        self.impacts, self.constraints = definition.impacts, definition.constraints
        self.complementarity = definition.complementarity
        self.hidden = definition.hidden
        names = definition.names
        self.state_names = tuple(names["states"])
        self.parameter_names = tuple(names["parameters"])
        self._extended_states = definition.extended_states
        self._cache = Cache(CAPACITY + _OF_CELL * len(definition.breakpoints))

    @cached_property
    def nonlinear(self) -> Any:
        """Which multipliers enter the field nonlinearly."""
        return enters_nonlinearly(self.definition.field, self.definition.multipliers)

    @cached_property
    def of_pieces(self) -> FilippovSystem:
        """The system that runs integrate: with tables as elements, whose cells set parameters."""
        if not self.written.tables:
            return self
        system = self._of(by_pieces(self.written))
        counts = {table.element: table.count for table in self.written.tables}
        sizes = [counts.get(members[0], 1) for members in system.entries]
        system.numbers = tuple(accumulate(sizes, initial=0))
        return system

    @cached_property
    def of_breakpoints(self) -> FilippovSystem:
        """The system whose breakpoints are surfaces in runs too."""
        return self._of(self.definition, self.lifted) if self.written.tables else self

    def __getstate__(self) -> dict[str, Any]:
        return {**self.written.state(), "lifted": self.lifted}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._adopt(Definition.from_state(state))
        self.lifted = state["lifted"]

    def content_hash(self) -> str:
        """Hash of the definition: equal for equal expressions, names, stops and resets."""

        def build() -> str:
            parts = sorted((k, repr(v)) for k, v in self.written.state().items())
            return hashlib.sha256(str(parts).encode()).hexdigest()

        return self.cached("content hash", build)

    def __eq__(self, other: object) -> bool:
        """Whether another system has the same definition; its symbols may be others."""
        same = isinstance(other, FilippovSystem) and self.content_hash() == other.content_hash()
        return self is other or same

    def __hash__(self) -> int:
        return hash(self.content_hash())

    # notebook and print ------------------------------------------------------------------------

    def _repr_html_(self) -> str:
        """Notebook representation: states, fields, surfaces and parameters, typeset."""
        rows: list[tuple[str, object]] = [("states", ", ".join(self.state_names))]
        own = self.definition
        parts = (own.extended_states, own.parameters, own.multipliers, own.reactions)
        known = [one for part in parts for one in listed(part)]
        others = self.sets or self.hidden or self.complementarity or self.joints
        single = len(self.entries) == 1 and not others
        fields = {f"field {where}": self.field(mode) for mode, where in _SIDES} if single else {}
        for where, field in (fields or {"field": self.definition.field}).items():
            pairs = list(zip(self.state_names, listed(field), strict=False))[:_EQUATIONS_SHOWN]
            written = [equation(rate(name), rhs, known) for name, rhs in pairs]
            more = len(self.state_names) - len(pairs)
            written += [f"and {more} more"] * (more > 0)
            rows.append((where, Markup("<br>".join(written))))
        for k, function in enumerate(listed(own.surfaces)[:_EQUATIONS_SHOWN]):
            name, what = f"h{k}", f"surface h{k}"
            if k in self.half_lines:
                name, what = "y", f"complementarity {self.surface_names[k]}"
            if k in self.joints:
                name, what = "g", f"constraint {self.constraints[self.joints.index(k)]}"
            rows.append((what, Markup(equation(symbol(name), function, known))))
        rows += [("parameters", ", ".join(self.parameter_names))]
        rows += [("stops", ", ".join(n for n, _ in self.stops))]
        rows += [("resets", ", ".join(n for n, _ in self.resets))]
        rows += [("impacts", ", ".join(self.impacts))]
        return representation("FilippovSystem", rows)

    def __repr__(self) -> str:
        parts = [
            f"{self.dimension} state{'s' * (self.dimension > 1)}: {', '.join(self.state_names)}"
        ]
        functions = [s.function for s in self.lifted]
        if len(functions) > _FUNCTIONS_SHOWN:
            functions[2:-1] = ["..."]
        names = f": {', '.join(functions)}" if functions else ""
        others = len(self.complementarity) + len(self.constraints)
        surfaces = len(self.entries) - len(self.sets) - others
        if surfaces or not (self.sets or others):
            parts.append(f"{surfaces} surface{'s' * (surfaces != 1)}{self._classes()}{names}")
        parts += [f"root |{name}|^{power:g}" for name, power in self.roots.items()]
        parts += [f"set of codimension {len(members)}" for members in self.sets]
        if self.parameter_names:
            parts.append(f"parameters: {', '.join(self.parameter_names)}")
        if self.time_dependent:
            parts.append(f"time {self.definition.time}")
        parts += [f"stop {n!r}" for n, _ in self.stops] + [f"reset {n!r}" for n, _ in self.resets]
        parts += [f"impact {n!r}" for n in self.impacts]
        parts += [f"complementarity {n!r}" for n in self.complementarity]
        parts += [f"constraint {n!r}" for n in self.constraints]
        return f"FilippovSystem({'; '.join(parts)})"

    def _classes(self) -> str:
        """The classes of surfaces, for people, where one is not generic."""
        others = (*self.half_lines, *self.joints)
        own = [i for i, *more in self.entries if not more and i not in others]
        if len(own) > _CLASSES_SHOWN:
            return ""
        words = [self.switching(i).name for i in own]
        if set(words) <= {"generic"}:
            return ""
        return f" ({', '.join(words if len(set(words)) > 1 else words[:1])})"

    # shape -------------------------------------------------------------------------------------

    @cached_property
    def dimension(self) -> int:
        """Number n of states."""
        return int(self.definition.states.numel())

    @cached_property
    def roots(self) -> dict[str, float]:
        """Roots of switching functions by name of the surface: the smallest exponent that was found.

        A run passes the zero of such a root; that of another function ends it.

        Examples
        --------
        >>> import casadi as ca
        >>> import nonsmooth as ns
        >>> x = ca.SX.sym("x")
        >>> ns.FilippovSystem([x], surface=x, above=[-ca.sqrt(x)], below=[0]).roots
        {'h0': 0.5}
        """
        d = self.definition
        surfaces = d.surfaces[: min((*self.half_lines, self.surface_count))]
        found = roots_of(d.field, surfaces, self.extended_states)
        return {f"h{self.entry_of(i)}": power for i, power in sorted(found.items())}

    @cached_property
    def surface_count(self) -> int:
        """Number of switching functions: one for each surface, k for a set of codimension k."""
        return int(self.definition.surfaces.numel())

    @cached_property
    def entries(self) -> tuple[tuple[int, ...], ...]:
        """Switching functions of each surface or set, in the order in which they were given."""
        sizes = self.definition.sizes or (1,) * self.surface_count
        firsts = accumulate(sizes, initial=0)
        return tuple(tuple(range(f, f + k)) for f, k in zip(firsts, sizes, strict=False))

    @cached_property
    def numbers(self) -> tuple[int, ...]:
        """Number of each surface or set in names and in modes that are shown, and how many there are."""
        return tuple(range(len(self.entries) + 1))

    @cached_property
    def layer_widths(self) -> tuple[float, ...]:
        """Widths of the layers of the switching functions."""
        return self.definition.layer_widths or (1.0,) * self.surface_count

    @cached_property
    def sets(self) -> tuple[tuple[int, ...], ...]:
        """Switching functions of each set of codimension two or more."""
        return tuple(members for members in self.entries if len(members) > 1)

    @cached_property
    def set_of(self) -> dict[int, tuple[int, ...]]:
        """The set to which a switching function belongs; surfaces are not in it."""
        return {i: members for members in self.sets for i in members}

    @cached_property
    def laws(self) -> tuple[str, ...]:
        """Name of the law of each surface, set or other element, in the order of ``entries``."""
        return self.definition.laws or tuple(
            "surface" if len(e) == 1 else "set" for e in self.entries
        )

    @cached_property
    def remembering(self) -> tuple[int, ...]:
        """Switching functions of elements with hysteresis, whose state follows from the past."""
        widths = listed(self.definition.hysteresis)
        return tuple(i for i, width in enumerate(widths) if not width.is_zero())

    @property
    def half_lines(self) -> tuple[int, ...]:
        """Functions y of complementarity conditions, among the switching functions."""
        return self.definition.half_lines

    @cached_property
    def algebraic(self) -> tuple[int, ...]:
        """Those of them that contain a multiplier: relative degree 0."""
        d, states = self.definition, self.extended_states
        own = d.multipliers[list(self.half_lines)]
        return tuple(i for i in self.half_lines if holds(d.surfaces[i], own, states))

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Functions of constraints, the last of the switching functions."""
        m = self.surface_count
        return tuple(range(m - len(self.constraints), m))

    @cached_property
    def surface_names(self) -> tuple[str, ...]:
        """Names in events of each switching function: ``h0``, ``h1``, ... by surface or set, or as given."""
        names = [f"h{self.numbers[k]}" for k, own in enumerate(self.entries) for _ in own]
        for i, name in zip(self.half_lines, self.complementarity, strict=True):
            names[i] = name
        return tuple(names)

    def entry_of(self, function: int) -> int:
        """Number, in names and modes, of the surface or set of a switching ``function`` (index)."""
        return next(k for k, members in enumerate(self.entries) if function in members)

    @cached_property
    def coupled(self) -> bool:
        """Whether multipliers are solved for together: several, a nonlinear one, or reactions."""
        several = self.surface_count > 1 or bool(self.impacts) or bool(self.complementarity)
        several = several or bool(self.constraints)
        return several or any(self.nonlinear)

    def spelled(self, mode: str) -> str:
        """Shorten a ``mode`` to one letter for each surface, set and impact."""
        if not self.sets:
            return mode
        letters = [mode[members[0]] for members in self.entries]
        shown = ["*" if letter in "*bli" else letter for letter in letters]
        return "".join(shown) + mode[self.surface_count :]

    def widened(self, mode: str) -> str:
        """Widen a ``mode`` to one letter for each switching function and impact."""
        if not self.sets or not isinstance(mode, str):
            return mode
        if len(mode) not in (len(self.entries), len(self.entries) + len(self.impacts)):
            return mode
        pairs = zip(mode, self.entries, strict=False)
        wide = "".join(letter * len(members) for letter, members in pairs)
        return wide + mode[len(self.entries) :]

    @cached_property
    def time_dependent(self) -> bool:
        """Whether the system depends on time explicitly."""
        return bool(self.definition.time.numel())

    @cached_property
    def extended_dimension(self) -> int:
        """Number of states, plus one if the system depends on time."""
        return int(self.definition.states.numel() + self.definition.time.numel())

    @property
    def extended_states(self) -> ca.SX:
        """The states, followed by the time where the system depends on it (SX column)."""
        return self._extended_states

    @property
    def parameter_symbols(self) -> ca.SX:
        """The parameters as an SX column, in the order of ``parameter_names``."""
        return self.definition.parameters

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes of one letter per surface in which at most one surface slides."""
        result = [""]
        for members in self.entries:
            own = self._letters(members[0])
            letters, joint = "*s" if len(members) > 1 else own, members[0] in self.joints
            result = [
                m + c for m in result for c in letters if joint or not (c == "s" and "s" in m)
            ]
        return tuple(result)

    @cached_property
    def _known_letters(self) -> tuple[str, ...]:
        """Letters of all switching functions."""
        return tuple(map(self._letters, range(self.surface_count)))

    def _letters(self, i: int) -> str:
        """Letters of a switching function; in runs those of sets are more."""
        if i in self.joints:
            return "s"
        return "*sbli" if i in self.set_of else "oc" if i in self.half_lines else "+-s"

    def parse_mode(self, mode: str) -> tuple[int, ...]:
        """Turn the letters of the surfaces in a ``mode`` into signs: ``+`` 1, ``-`` -1, ``s`` 0.

        The letters of a set, ``*`` and ``s``, stand for each of its switching functions: 2 and 0.

        Raises
        ------
        DefinitionError
            A wrong number of letters or another letter.
        """
        return self.parse_letters(mode)[: self.surface_count]

    def parse_letters(self, mode: str) -> tuple[int, ...]:
        """Turn the letters of surfaces and impacts in a ``mode`` into signs.

        ``+`` and ``o`` are 1, ``-`` is -1, ``s`` and ``c`` are 0. Impacts without a letter are open.
        Complementarity conditions come after the surfaces and before the impacts.

        Raises
        ------
        DefinitionError
            A wrong number of letters or another letter.
        """
        # In a run "b" is "*" close to a set that was left, "l" the instant of leaving it, "i" a set
        # whose multiplier does not enter the field.
        letters = {"+": 1, "-": -1, "s": 0, "o": 1, "c": 0, **dict.fromkeys("*bli", 2)}
        m, c, wide = self.surface_count, len(self.impacts), self.widened(mode)
        whole = wide + "o" * c if isinstance(wide, str) and len(wide) == m else wide
        fits = isinstance(whole, str) and len(whole) == m + c and not set(whole[m:]) - set("oc")
        known = self._known_letters
        if not fits or any(a not in b for a, b in zip(whole, known, strict=False)):
            raise DefinitionError(self._letters_expected(mode))
        return tuple(letters[letter] for letter in whole)

    def require_mode(self, mode: object) -> None:
        """Refuse a ``mode`` without one letter for each surface and set, or with letters of runs."""
        known = ["*s" if more else self._letters(i) for i, *more in self.entries]
        whole = [*known, *["oc"] * len(self.impacts)]
        fits = isinstance(mode, str) and len(mode) in (len(known), len(whole))
        if not fits or any(a not in b for a, b in zip(str(mode), whole, strict=False)):
            raise DefinitionError(self._letters_expected(mode))

    def _letters_expected(self, mode: object) -> str:
        m, c, k, y = len(self.entries), len(self.impacts), len(self.sets), len(self.complementarity)
        kinds = "each of + - s, one per surface"
        if k:
            kinds = "+ - s for a surface and * s for a set, in their order"
        if y:
            kinds += ", and o c, one per complementarity condition"
        contacts = f", and {c}, each of o c, one per impact" if c else ""
        set_letter = ", '*' is off a set" if k else ""
        contact_letters = "; 'o' is an open contact, 'c' a closed one" if c else ""
        contact_letters += "; 'o' has the multiplier 0, 'c' has y = 0" if y else ""
        return (
            f"mode: expected {m} letter(s), {kinds}{contacts}, received {mode!r}. '+' is h > 0, '-' is "
            f"h < 0, 's' is sliding{set_letter}{contact_letters}."
        )

    def surface_index(self, surface: int) -> int:
        """Check the number of a ``surface``."""
        if isinstance(surface, bool) or not isinstance(surface, (int, np.integer)):
            raise DefinitionError(f"surface: expected an index (int), received {surface!r}.")
        if not 0 <= surface < self.surface_count:
            raise DefinitionError(
                f"surface: expected an index below {self.surface_count}, received {surface}."
            )
        return int(surface)

    def switching(
        self, surface: int = 0, *, mode: str | None = None, parameters: Parameters | None = None
    ) -> Switching:
        """Classify a surface by the jump of the field: continuous, velocity continuous or generic.

        Parameters
        ----------
        surface : int, optional
            Index of the surface, or of a complementarity condition: those follow the surfaces. One whose y holds its
            multiplier is continuous, one of relative degree 1 generic: the motion goes along its boundary.
        mode : str, optional
            Letters of the other surfaces, ``+``, ``-`` or ``s``, and conditions: the class in that mode. Otherwise the class
            holds for all values of the other multipliers.
        parameters : mapping, optional
            Values of the parameters; the class of these values only. Otherwise it holds for all.

        Returns
        -------
        Switching
            The class, its order, and how it was decided.

        Raises
        ------
        DefinitionError
            No such surface or mode.
        ParameterError
            An unknown parameter, one without a value, or a value that is not a finite number.

        Notes
        -----
        Source: di Bernardo et al. 2008, Piecewise-smooth Dynamical Systems, section 2.3.

        Examples
        --------
        A soft stop is continuous; a preload in it is not, and only its velocity is:

        >>> import casadi as ca, nonsmooth as ns
        >>> x, v, force = (ca.SX.sym(s) for s in ("x", "v", "force"))
        >>> s = ns.FilippovSystem([x, v], surface=x - 1, above=[v, -x - 5 * (x - 1) - force],
        ...     below=[v, -x], parameters=[force])
        >>> print(s.switching(parameters={"force": 0}))
        continuous of order 1; nothing slides here (by exact arithmetic modulo a prime)
        >>> s.switching().kind, s.switching().order
        ('velocity continuous', 0)
        """
        i = self.surface_index(surface)
        if mode is not None:
            self.require_mode(mode)
        if i in (*self.set_of, *self.remembering, *self.joints):
            what = "as a set" if i in self.set_of else "with hysteresis"
            what = "as a constraint" if i in self.joints else what
            return Switching("generic", None, None, f"its definition {what}")
        values = None if parameters is None else tuple(self.parameter_vector(parameters).tolist())
        key = ("switching", i, mode, values)
        return self.cached(key, lambda: class_of(self, i, mode, parameters))

    # expressions -----------------------------------------------------------------------------

    def surface_function(self, surface: int = 0) -> ca.SX:
        """Return the switching function h of a ``surface`` (SX scalar)."""
        return self.definition.surfaces[self.surface_index(surface)]

    def field(self, mode: str) -> ca.SX:
        """Right-hand side of a mode without sliding, time row included (SX, extended dimension).

        Parameters
        ----------
        mode : str
            One letter, ``+`` or ``-``, for each surface.
        """
        signs = self.parse_mode(mode)
        if 0 in signs or 2 in signs:
            raise DefinitionError(f"field: expected a mode of + and -, received {mode!r}.")
        return self.field_with(
            ca.DM([0 if i in self.half_lines else s for i, s in enumerate(signs)])
        )

    def field_with(self, multipliers: Any, reactions: Any = None) -> ca.SX:
        """Right-hand side for ``multipliers`` (values or expressions), time row included.

        The ``reactions`` of impacts are zero unless given.
        """
        d, f = self.definition, None
        if self.written.tables and isinstance(multipliers, ca.DM):
            f = in_cells(self.written, np.array(multipliers).ravel().tolist())
        if f is None:
            f = d.field
            f = ca.substitute(f, d.multipliers, multipliers) if self.surface_count else f
        if self.impacts:
            f = ca.substitute(f, d.reactions, 0 if reactions is None else reactions)
        return ca.vertcat(f, ca.SX.ones(d.time.numel(), 1))

    def gradient(self, expression: Expression) -> ca.SX:
        """Derivatives of a scalar ``expression`` with respect to the states, then time (SX row).

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
        >>> ns.FilippovSystem([x, v], surface=v, above=[v, -x - 1], below=[v, 1 - x]).gradient(x * v)
        SX([[v, x]])
        """
        return ca.densify(ca.jacobian(scalar(expression, "expression"), self.extended_states))

    def parameter_gradient(self, expression: Expression) -> ca.SX:
        """Derivatives of a scalar ``expression`` with respect to the parameters (SX row).

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, a, b = ca.SX.sym("x"), ca.SX.sym("a"), ca.SX.sym("b")
        >>> system = ns.FilippovSystem([x], field=[a * x], parameters=[a, b])
        >>> system.parameter_gradient(a * x + b)
        SX([[x, 1]])
        """
        return ca.densify(ca.jacobian(scalar(expression, "expression"), self.parameter_symbols))

    # symbolic ----------------------------------------------------------------------------------

    def lie_derivative(
        self, fields: str | Sequence[str], surface: int = 0, of: Expression | None = None
    ) -> ca.SX:
        """Iterated Lie derivative; the rightmost field is applied first, as in $L12 = F1.grad L2$.

        Parameters
        ----------
        fields : str or sequence of str
            Modes without sliding. With one surface a string such as ``"+-"`` means $L12$.
        surface : int, optional
            Which switching function is differentiated.
        of : expression, optional
            Another function to differentiate.

        Returns
        -------
        SX scalar
            Explicit-time terms included.

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, y, z = (ca.SX.sym(s) for s in "xyz")
        >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, 2], below=[z, 3, 4])
        >>> s.lie_derivative("+"), s.lie_derivative("++"), s.lie_derivative("+-")
        (SX((-y)), SX(-1), SX(2))
        """
        if of is None:
            key = ("Lie derivative", tuple(fields), surface)
            function = self.surface_function(surface)
            return self.cached(key, lambda: self._derive(fields, function))
        return self._derive(fields, ca.SX(of))

    def _derive(self, fields: str | Sequence[str], expression: ca.SX) -> ca.SX:
        for mode in reversed(list(fields)):
            gradient = ca.jacobian(expression, self.extended_states)
            expression = ca.mtimes(gradient, self.field(mode))
        return ca.simplify(expression)

    # numeric -----------------------------------------------------------------------------------

    def cached(self, key: Hashable, build: Callable[[], T]) -> T:
        """Return the cached value of ``key``, made by ``build`` if it is not among the last 256."""
        return self._cache.get(key, build)

    def function(
        self, key: Hashable, build: Callable[[], Sequence[ca.SX]], states: ca.SX | None = None
    ) -> ca.Function:
        """Return the function of ``states`` and parameters that ``build`` gives, cached by ``key``."""

        def made() -> ca.Function:
            outputs = [ca.densify(ca.SX(e)) for e in build()]
            x = self.extended_states if states is None else states
            return ca.Function("f", [x, self.parameter_symbols], outputs, {"cse": True})

        return self.cached(("function", key), made)

    def evaluate(
        self,
        expression: Expression,
        point: ArrayLike,
        parameters: Parameters | None = None,
        t: float = 0.0,
    ) -> Array:
        """Evaluate a scalar or matrix expression in states, parameters and time at a point.

        Parameters
        ----------
        expression : SX
            Any expression in states, parameters and time.
        point : array_like (n,)
            Where, in the order of the states.
        parameters : mapping, optional
            Values that replace defaults.
        t : float, optional
            Time, where the system depends on it.

        Returns
        -------
        ndarray of the expression's shape
            Its values at the point.

        Raises
        ------
        PointError, ParameterError, DefinitionError
            A point, parameters or an expression that do not fit.

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x = ca.SX.sym("x")
        >>> system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
        >>> system.evaluate(system.lie_derivative("-"), [0.0]).item()
        3.0
        """
        values, p = self.extended_point(point, t), self.parameter_vector(parameters)
        return call(self._function_of(matrix(expression)), values, p)[0]

    def _function_of(self, expression: ca.SX) -> ca.Function:
        """Return the function of an expression, the same for the same expression object."""
        known = ca.vertcat(self.extended_states, self.parameter_symbols)
        require_known(expression, known, "expression", **self.definition.names)
        symbols = [self.extended_states, self.parameter_symbols]
        return self.function(Content(symbols, expression), lambda: [expression])

    def parameter_vector(self, parameters: Parameters | None = None) -> Array:
        """Numbers for all parameters, defaults replaced by ``parameters`` (keys: symbols or names).

        Returns
        -------
        ndarray (p,)
            In the order of ``parameter_names``.

        Raises
        ------
        ParameterError
            An unknown name, a missing value, or one that is not a finite number or no restitution.
        """
        return consistent_parameters(self.definition, self.parameter_names, parameters)

    def extended_point(self, point: ArrayLike, t: float = 0.0) -> Array:
        """Check the state ``point`` and append ``t`` where the system depends on time.

        Raises
        ------
        PointError
            Wrong shape, not numbers, NaN or inf.
        """
        values = state_values(self.state_names, point)
        moment = real(t, "time", error=PointError)
        return np.array([*values, moment]) if self.time_dependent else values


#: Elements that not every function supports: the system's attribute, what it has, and where they work.
_ELEMENTS = {
    "sets": (
        "vector multipliers",
        "Sets of codimension two and three work in simulate, ensemble, sensitivity, region, limit_directions, poincare, "
        "attractors, lyapunov_spectrum, periodic_orbit, continue_orbit and phase_response.",
    ),
    "remembering": (
        "elements with hysteresis",
        "They work in simulate, ensemble and outcomes.",
    ),
    "complementarity": (
        "complementarity conditions",
        "They work in simulate, ensemble, outcomes, sensitivity, classify, region, find_equilibrium, find_fold, "
        "continue_equilibrium, periodic_orbit and continue_orbit.",
    ),
    "constraints": (
        "constraints",
        "They work in simulate, ensemble, outcomes, sensitivity, classify, region, find_equilibrium, find_fold, "
        "continue_equilibrium, periodic_orbit and continue_orbit. Write the motion in coordinates that satisfy them.",
    ),
}


def require_system(
    value: Any,
    sets: bool = False,
    hysteresis: bool = False,
    complementarity: bool = False,
    joints: bool = False,
) -> None:
    """Refuse all but a FilippovSystem; flags allow vector multipliers, relays, complementarity and constraints."""
    if not isinstance(value, FilippovSystem):
        raise DefinitionError(
            f"system: expected a FilippovSystem, received {value!r} ({type(value).__name__}). "
            "Make one with FilippovSystem(states, ...) or FilippovSystem.from_expression(states, "
            "rhs)."
        )
    allowed = (sets, hysteresis, complementarity, joints)
    for (name, (what, where)), is_allowed in zip(_ELEMENTS.items(), allowed, strict=True):
        if getattr(value, name) and not is_allowed:
            raise DefinitionError(
                f"system: {value!r} has {what}, which this function does not support. {where}"
            )


def parted(system: FilippovSystem, point: ArrayLike) -> tuple[Array, dict[str, float]]:
    """Split a state (n,) into the states that move and the values of the discrete ones."""
    x, count = state_values(system.state_names, point), len(system.definition.discrete)
    values = dict(zip(system.state_names[-count:], x[-count:].tolist(), strict=True))
    return x[:-count], values


def require_plain(system: FilippovSystem, what: str) -> None:
    """Refuse a system whose events have conditions, filters or levels, or that has discrete states."""
    if not system.definition.plain:
        raise DefinitionError(
            f"system: {system!r} has conditions of events, when=, level=, or discrete states, which {what} "
            "does not support. Give guards that are passed."
        )


def require_continuous(system: FilippovSystem, what: str) -> None:
    """Refuse a system with discrete states."""
    count = len(system.definition.discrete)
    if count:
        values = ", ".join(f"{name!r}: 0" for name in system.state_names[-count:])
        raise DefinitionError(
            f"system: {system!r} has discrete states, which {what} does not support. Hold them, as in "
            f"system.holding({{{values}}})."
        )


def multiplier_enters(system: FilippovSystem, members: Sequence[int], p: Array) -> bool:
    """Whether the multiplier of a set enters the field with given parameters."""
    d = system.definition
    columns = ca.jacobian(d.field, d.multipliers[list(members)])
    if d.parameters.numel():
        columns = ca.substitute(columns, d.parameters, ca.SX(p.tolist()))
    return not ca.densify(columns).is_zero()
