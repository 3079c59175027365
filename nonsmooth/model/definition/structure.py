"""What can be read off a system's definition: sizes, names, the letters of modes, expressions."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ...notebook import card
from ..errors import DefinitionError, explain
from ..reading import Expression, listed, scalar
from .form import Definition
from .found_switches import LiftedSwitch


class Structure:
    """A definition that answers questions about itself; ``FilippovSystem`` computes with it."""

    #: What ``from_expression`` found, one for each surface; empty for other systems.
    lifted: tuple[LiftedSwitch, ...] = ()

    def _adopt(self, definition: Definition) -> None:
        self.definition = definition
        self.stops, self.resets = definition.stops, definition.resets
        self.impacts = definition.impacts
        self.hidden = definition.hidden
        field, multipliers = definition.field, listed(definition.multipliers)
        self.nonlinear = tuple(not ca.is_linear(field, lam) for lam in multipliers)
        names = definition.names
        self.state_names = tuple(names["states"])
        self.parameter_names = tuple(names["parameters"])
        self._extended_states = definition.extended_states

    def _repr_html_(self) -> str:
        """How a notebook shows the system: states, fields of one surface, surfaces, parameters."""
        rows: list[tuple[str, object]] = [("states", ", ".join(self.state_names))]
        single = len(self.entries) == 1 and not self.sets
        for mode, where in (("+", "above"), ("-", "below")) if single else ():
            rows.append((f"field {where}", self.field(mode)))
        surfaces = listed(self.definition.surfaces)
        rows += [(f"surface h{k}", function) for k, function in enumerate(surfaces)]
        rows += [("parameters", ", ".join(self.parameter_names))]
        rows += [("stops", ", ".join(n for n, _ in self.stops))]
        rows += [("resets", ", ".join(n for n, _ in self.resets))]
        rows += [("impacts", ", ".join(self.impacts))]
        return card("FilippovSystem", rows)

    def __repr__(self) -> str:
        parts = [
            f"{self.dimension} state{'s' * (self.dimension > 1)}: {', '.join(self.state_names)}"
        ]
        names = f": {', '.join(s.function for s in self.lifted)}" if self.lifted else ""
        surfaces = len(self.entries) - len(self.sets)
        if surfaces or not self.sets:
            parts.append(f"{surfaces} surface{'s' * (surfaces != 1)}{names}")
        parts += [f"set of codimension {len(members)}" for members in self.sets]
        if self.parameter_names:
            parts.append(f"parameters: {', '.join(self.parameter_names)}")
        if self.time_dependent:
            parts.append(f"time {self.definition.time}")
        parts += [f"stop {n!r}" for n, _ in self.stops] + [f"reset {n!r}" for n, _ in self.resets]
        parts += [f"impact {n!r}" for n in self.impacts]
        return f"FilippovSystem({'; '.join(parts)})"

    # shape -------------------------------------------------------------------------------------

    @cached_property
    def dimension(self) -> int:
        """Number n of states."""
        return int(self.definition.states.numel())

    @cached_property
    def surface_count(self) -> int:
        """Number of switching functions: one for each surface, k for a set of codimension k."""
        return int(self.definition.surfaces.numel())

    @cached_property
    def entries(self) -> tuple[tuple[int, ...], ...]:
        """Switching functions of each surface or set, in the order in which they were given."""
        sizes = self.definition.sizes or (1,) * self.surface_count
        firsts = [sum(sizes[:i]) for i in range(len(sizes))]
        return tuple(tuple(range(f, f + k)) for f, k in zip(firsts, sizes, strict=True))

    @cached_property
    def sets(self) -> tuple[tuple[int, ...], ...]:
        """Switching functions of each set of codimension two or more."""
        return tuple(members for members in self.entries if len(members) > 1)

    @cached_property
    def set_of(self) -> dict[int, tuple[int, ...]]:
        """The set to which a switching function belongs; surfaces are not in it."""
        return {i: members for members in self.sets for i in members}

    @cached_property
    def surface_names(self) -> tuple[str, ...]:
        """Names in events of each switching function: ``h0``, ``h1``, ... by surface or set."""
        return tuple(f"h{k}" for k, members in enumerate(self.entries) for _ in members)

    def entry_of(self, function: int) -> int:
        """Number in names and modes of the surface or set to which a switching function belongs."""
        return next(k for k, members in enumerate(self.entries) if function in members)

    @cached_property
    def coupled(self) -> bool:
        """Whether multipliers are not eliminated: several surfaces, one that enters nonlinearly, or
        reactions."""
        return self.surface_count > 1 or any(self.nonlinear) or bool(self.impacts)

    def spelled(self, mode: str) -> str:
        """Mode with one letter for each surface, set and impact, of one with a letter for each
        switching function."""
        if not self.sets:
            return mode
        letters = [mode[members[0]] for members in self.entries]
        shown = ["*" if letter in "*bli" else letter for letter in letters]
        return "".join(shown) + mode[self.surface_count :]

    def widened(self, mode: str) -> str:
        """Mode with a letter for each switching function, of one with a letter for each set."""
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
            letters = "+-s" if len(members) == 1 else "*s"
            result = [m + c for m in result for c in letters if not (c == "s" and "s" in m)]
        return tuple(result)

    def parse_mode(self, mode: str) -> tuple[int, ...]:
        """Turn the letters of the surfaces into signs: ``+`` 1, ``-`` -1, ``s`` 0.

        The letters of a set, ``*`` and ``s``, stand for each of its switching functions: 2 and 0.

        Raises
        ------
        DefinitionError
            A wrong number of letters or another letter.
        """
        return self.parse_letters(mode)[: self.surface_count]

    def parse_letters(self, mode: str) -> tuple[int, ...]:
        """Turn the letters of surfaces and impacts into signs: ``+`` 1, ``-`` -1, ``s`` 0, ``o`` 1
        and ``c`` 0. Letters of the impacts may be missing: open.

        Raises
        ------
        DefinitionError
            A wrong number of letters or another letter.
        """
        # Within a run "b" is "*" close to a set that was left, "l" the moment of leaving it, "i" a set
        # whose multiplier makes no difference.
        letters = {"+": 1, "-": -1, "s": 0, "o": 1, "c": 0, **dict.fromkeys("*bli", 2)}
        m, c, wide = self.surface_count, len(self.impacts), self.widened(mode)
        whole = wide + "o" * c if isinstance(wide, str) and len(wide) == m else wide
        fits = isinstance(whole, str) and len(whole) == m + c and not set(whole[m:]) - set("oc")
        if not fits or any(
            letter not in ("*sbli" if i in self.set_of else "+-s")
            for i, letter in enumerate(whole[:m])
        ):
            raise DefinitionError(self._letters_expected(mode))
        return tuple(letters[letter] for letter in whole)

    def require_mode(self, mode: object) -> None:
        """Refuse what is no mode for a user: one letter for each surface and set, and none that only runs know.

        Raises
        ------
        DefinitionError
        """
        known = ["*s" if len(members) > 1 else "+-s" for members in self.entries]
        whole = [*known, *["oc"] * len(self.impacts)]
        fits = isinstance(mode, str) and len(mode) in (len(known), len(whole))
        if not fits or any(a not in b for a, b in zip(str(mode), whole, strict=False)):
            raise DefinitionError(self._letters_expected(mode))

    def _letters_expected(self, mode: object) -> str:
        m, c, k = len(self.entries), len(self.impacts), len(self.sets)
        kinds = "each of + - s, one per surface"
        if k:
            kinds = "+ - s for a surface and * s for a set, in their order"
        contacts = f", and {c}, each of o c, one per impact" if c else ""
        return explain(
            "mode",
            expected=f"{m} letter(s), {kinds}{contacts}",
            received=repr(mode),
            advice="'+' is h > 0, '-' is h < 0, 's' is sliding"
            + (", '*' is off a set" if k else "")
            + ("; 'o' is an open contact, 'c' a closed one." if c else "."),
        )

    def surface_index(self, surface: int) -> int:
        """Check the number of a surface.

        Raises
        ------
        DefinitionError
        """
        if isinstance(surface, bool) or not isinstance(surface, (int, np.integer)):
            raise DefinitionError(f"surface: expected an index (int), received {surface!r}.")
        if not 0 <= surface < self.surface_count:
            raise DefinitionError(
                f"surface: expected an index below {self.surface_count}, received {surface}."
            )
        return int(surface)

    # expressions -----------------------------------------------------------------------------

    def surface_function(self, surface: int = 0) -> ca.SX:
        """Return the switching function h of a surface (SX scalar)."""
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
        return self.field_with(ca.DM(list(signs)))

    def field_with(self, multipliers: Any, reactions: Any = None) -> ca.SX:
        """Right-hand side for given multipliers (values or expressions), time row included.

        Reactions of impacts are zero unless given.
        """
        d, f = self.definition, self.definition.field
        if self.surface_count:
            f = ca.substitute(f, d.multipliers, multipliers)
        if self.impacts:
            f = ca.substitute(f, d.reactions, 0 if reactions is None else reactions)
        return ca.vertcat(f, ca.SX.ones(d.time.numel(), 1))

    def gradient(self, expression: Expression) -> ca.SX:
        """Derivatives of a scalar with respect to the states, then time if it depends on it.

        Returns
        -------
        SX row (1, extended dimension)

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
        >>> ns.FilippovSystem([x, v], surface=v, above=[v, -x - 1], below=[v, 1 - x]).gradient(x * v)
        SX([[v, x]])
        """
        return ca.densify(ca.jacobian(scalar(expression, "expression"), self.extended_states))

    def parameter_gradient(self, expression: Expression) -> ca.SX:
        """Derivatives of a scalar with respect to the parameters, in the order of their names.

        Returns
        -------
        SX row (1, number of parameters)

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, a, b = ca.SX.sym("x"), ca.SX.sym("a"), ca.SX.sym("b")
        >>> system = ns.FilippovSystem([x], field=[a * x], parameters=[a, b])
        >>> system.parameter_gradient(a * x + b)
        SX([[x, 1]])
        """
        return ca.densify(ca.jacobian(scalar(expression, "expression"), self.parameter_symbols))
