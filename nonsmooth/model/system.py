"""WHAT a nonsmooth system is: states, parameters, fields, switching surfaces, stops and resets.

One representation serves both ways in. Internally the state carries the time as a last component
when the system depends on it, so Lie derivatives and jets include the explicit-time terms without
any special case.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import real, real_array
from .errors import DefinitionError, ParameterError, PointError, explain
from .graph import require_smooth
from .lift import LiftedSwitch, lift

Array = NDArray[np.float64]
Expression = Any  # a CasADi SX scalar, a number, or (for vectors) a sequence of these
Parameters = Mapping[Any, float | None]

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


class FilippovSystem:
    """A system x' = f(x, lambda; p) with lambda_i in Sgn(h_i(x)).

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
        The fields F1 where h > 0 and F2 where h < 0.
    field : sequence of n expressions, optional
        The right-hand side in states, parameters, time and multipliers.
    multipliers : SX symbol or sequence of them, optional
        One for each surface.
    surfaces : sequence of expressions, optional
        Switching functions, one for each multiplier (``surface`` also takes one).
    parameters : mapping or sequence, optional
        Symbols with their default values; None, or a bare sequence of symbols, means no default.
    time : SX symbol, optional
        The symbol of time if the system depends on it.
    stops : sequence of Stop, optional
    resets : sequence of Reset, optional
    hidden : bool, optional
        Allow multipliers that enter nonlinearly (hidden dynamics, Jeffrey 2018): sliding then
        follows a stable solution lambda of grad h . f(x, lambda) = 0.

    Raises
    ------
    DefinitionError
        Shapes, foreign symbols, a constant surface, a multiplier that enters nonlinearly.
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
        resets: Sequence[Reset] = (),
        hidden: bool = False,
    ):
        x = _symbols(states, "states")
        if x.numel() == 0:
            raise DefinitionError("states: expected at least one symbol, received none.")
        t = _symbols([time], "time") if time is not None else ca.SX(0, 1)
        p, self._defaults = _parameter_symbols(parameters)
        h = _surface_expressions(surface, surfaces)
        if above is not None or below is not None:
            lam, f = _two_fields(above, below, field, multipliers, h, x.numel())
        else:
            lam = _symbols(_listed(multipliers), "multipliers")
            f = _column(field, "field", x.numel())
        if lam.numel() != h.numel():
            raise DefinitionError(
                explain(
                    "multipliers",
                    expected=f"one for each of the {h.numel()} surfaces",
                    received=str(lam.numel()),
                    advice="Surface i switches multiplier i.",
                )
            )
        stops, resets = _items(stops, Stop, "stops"), _items(resets, Reset, "resets")
        guards = [_column([s.function], f"stop {s.name!r}", 1) for s in stops]
        guards += [_column([r.function], f"reset {r.name!r}", 1) for r in resets]
        maps = [_column(r.map, f"map of reset {r.name!r}", x.numel()) for r in resets]
        items: list[Stop | Reset] = [*stops, *resets]
        for item in items:
            if isinstance(item.direction, bool) or item.direction not in _DIRECTIONS:
                raise DefinitionError(
                    f"direction of {item.name!r}: expected -1 (falling), 0 (both) or 1 (rising), "
                    f"received {item.direction!r}."
                )
        self._adopt(x, t, p, lam, f, h, ca.vertcat(*guards), ca.horzcat(*maps))
        self.stops = tuple((s.name, s.direction) for s in stops)
        self.resets = tuple((r.name, r.direction) for r in resets)
        self.hidden = hidden
        self._check()

    # construction ------------------------------------------------------------------------------

    #: What ``from_expression`` found, one for each surface; empty for other systems.
    lifted: tuple[LiftedSwitch, ...] = ()

    @classmethod
    def from_expression(
        cls,
        states: Sequence[Expression],
        rhs: Sequence[Expression],
        *,
        parameters: Parameters | Sequence[Expression] | None = None,
        time: Expression | None = None,
        stops: Sequence[Stop] = (),
        resets: Sequence[Reset] = (),
        hidden: bool = False,
    ) -> FilippovSystem:
        """Find sign, fabs, fmin, fmax and if_else in x' = ``rhs`` and make them surfaces.

        Identical switching functions, also up to a constant factor, share one multiplier; see
        ``lifted`` for the surfaces and their order. What the expression is on a surface does not
        matter: between its two sides the field is Filippov's convex combination, also where the
        expression is nonlinear in a switch, as sign(x)**2 is, unless ``hidden`` is true.

        Parameters
        ----------
        states, parameters, time, stops, resets
            As for the class. Stops and resets must be smooth.
        rhs : sequence of n expressions
            In states, parameters and time, with switches.
        hidden : bool, optional
            Keep switches that enter nonlinearly as they are written (hidden dynamics).

        Returns
        -------
        FilippovSystem

        Raises
        ------
        NotSmoothError
            floor, ceil, fmod, an equality, or a condition that is no comparison.
        DefinitionError

        Notes
        -----
        Source: Filippov 1988, sec. 4; nonlinear switches: Jeffrey 2018, Hidden Dynamics. The rules
        are in ``nonsmooth/model/lift.py``.

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
        n = len(_listed(states))
        frame = cls(states, field=[0] * n, parameters=parameters, time=time)
        entries = _column(rhs, "rhs", n)
        known = ca.vertcat(frame.extended_states, frame._p)
        _no_foreign_symbols(entries, known, "rhs", frame)
        found = lift(entries, frame._x, frame._t, frame._p, hidden=hidden)
        system = cls(
            states,
            field=found.field,
            multipliers=found.multipliers,
            surfaces=found.surfaces,
            parameters=parameters,
            time=time,
            stops=stops,
            resets=resets,
            hidden=hidden,
        )
        system.lifted = found.switches
        return system

    def _adopt(
        self,
        x: ca.SX,
        t: ca.SX,
        p: ca.SX,
        lam: ca.SX,
        f: ca.SX,
        h: ca.SX,
        guards: ca.SX,
        maps: ca.SX,
    ) -> None:
        self._x, self._t, self._p, self._lam = x, t, p, lam
        self._f, self._h = f, h
        self._guards, self._maps = guards, maps
        self._functions: dict[Any, Any] = {}
        self.nonlinear = tuple(not ca.is_linear(f, lam[i]) for i in range(lam.numel()))
        self.state_names = tuple(s.name() for s in ca.vertsplit(x))
        self.parameter_names = tuple(s.name() for s in ca.vertsplit(p)) if p.numel() else ()

    def _check(self) -> None:
        named = [("field", self._f, True)]
        named += [(f"surface {i}", self._h[i], False) for i in range(self.surface_count)]
        guard_names = [f"stop {n!r}" for n, _ in self.stops]
        guard_names += [f"reset {n!r}" for n, _ in self.resets]
        named += [(name, self._guards[i], False) for i, name in enumerate(guard_names)]
        named += [
            (f"map of reset {self.resets[j][0]!r}", self._maps[:, j], False)
            for j in range(len(self.resets))
        ]
        known = ca.vertcat(self.extended_states, self._p, self._lam)
        _unique(known)
        moving = ca.vertcat(self.extended_states, self._lam)
        for what, expression, multipliers in named:
            _no_foreign_symbols(expression, known, what, self)
            if not multipliers and ca.depends_on(expression, self._lam):
                raise DefinitionError(
                    f"{what}: expected an expression in states, time and parameters, received one "
                    "with a multiplier. Only the field may contain multipliers."
                )
            _finite_constants(expression, known, what)
            require_smooth(expression, moving, self._p, what)
        for i, name in enumerate(guard_names):
            if not ca.depends_on(self._guards[i], self.extended_states):
                raise DefinitionError(_without_states(name, self._guards[i], self))
        for i in range(self.surface_count):
            if not ca.depends_on(self._h[i], self._x):
                raise DefinitionError(_without_states(f"surface {i}", self._h[i], self))
            if self.nonlinear[i] and not self.hidden:
                raise DefinitionError(
                    f"multiplier {self._lam[i]}: expected a field linear in it (Filippov's convex "
                    "combination), received a nonlinear one. Nonlinear multipliers are hidden "
                    "dynamics (Jeffrey 2018): say hidden=True if they are meant. Products of "
                    "different multipliers are fine."
                )

    def __repr__(self) -> str:
        parts = [
            f"{self.dimension} state{'s' * (self.dimension > 1)}: {', '.join(self.state_names)}"
        ]
        names = f": {', '.join(s.function for s in self.lifted)}" if self.lifted else ""
        parts.append(f"{self.surface_count} surface{'s' * (self.surface_count != 1)}{names}")
        if self.parameter_names:
            parts.append(f"parameters: {', '.join(self.parameter_names)}")
        if self.time_dependent:
            parts.append(f"time {self._t}")
        parts += [f"stop {n!r}" for n, _ in self.stops] + [f"reset {n!r}" for n, _ in self.resets]
        return f"FilippovSystem({'; '.join(parts)})"

    def __getstate__(self) -> dict[str, Any]:
        inputs = [self._x, self._t, self._p, self._lam]
        outputs = [self._f, self._h, self._guards, self._maps]
        return {
            "definition": ca.Function("definition", inputs, outputs).serialize(),
            "names": [[str(s) for s in ca.vertsplit(v)] if v.numel() else [] for v in inputs],
            "defaults": self._defaults,
            "stops": self.stops,
            "resets": self.resets,
            "hidden": self.hidden,
            "lifted": self.lifted,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        definition = ca.Function.deserialize(state["definition"])
        vectors = [ca.vertcat(*map(ca.SX.sym, names)) for names in state["names"]]
        vectors = [v if v.numel() else ca.SX(0, 1) for v in vectors]
        self._adopt(*vectors, *(ca.SX(e) for e in definition.call(vectors)))
        self._defaults = state["defaults"]
        self.stops, self.resets = state["stops"], state["resets"]
        self.lifted = state.get("lifted", ())
        self.hidden = state["hidden"]

    # shape -------------------------------------------------------------------------------------

    @property
    def dimension(self) -> int:
        """Number n of states."""
        return int(self._x.numel())

    @property
    def surface_count(self) -> int:
        """Number of switching surfaces."""
        return int(self._h.numel())

    @property
    def time_dependent(self) -> bool:
        """Whether the system depends on time explicitly."""
        return bool(self._t.numel())

    @property
    def extended_dimension(self) -> int:
        """Number of states, plus one if the system depends on time."""
        return int(self._x.numel() + self._t.numel())

    @property
    def extended_states(self) -> ca.SX:
        """The states, followed by the time where the system depends on it (SX column)."""
        return ca.vertcat(self._x, self._t)

    @property
    def parameter_symbols(self) -> ca.SX:
        """The parameters as an SX column, in the order of ``parameter_names``."""
        return self._p

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes of one letter per surface in which at most one surface slides."""
        result = [""]
        for _ in range(self.surface_count):
            result = [m + c for m in result for c in "+-s" if not (c == "s" and "s" in m)]
        return tuple(result)

    def content_hash(self) -> str:
        """Hash of the definition: equal for equal expressions, names, stops and resets."""
        state = {k: v for k, v in self.__getstate__().items() if k != "lifted"}
        code = hashlib.sha256(str(sorted((k, repr(v)) for k, v in state.items())).encode())
        return code.hexdigest()

    # symbolic ----------------------------------------------------------------------------------

    def surface_function(self, surface: int = 0) -> ca.SX:
        """Return the switching function h of a surface (SX scalar)."""
        return self._h[self._index(surface)]

    def field(self, mode: str) -> ca.SX:
        """Right-hand side of a mode without sliding, time row included (SX, extended dimension).

        Parameters
        ----------
        mode : str
            One letter, ``+`` or ``-``, for each surface.
        """
        signs = self.parse_mode(mode)
        if 0 in signs:
            raise DefinitionError(f"field: expected a mode of + and -, received {mode!r}.")
        return self.field_with(ca.DM(list(signs)))

    def field_with(self, multipliers: Any) -> ca.SX:
        """Right-hand side for given multipliers (values or expressions), time row included."""
        f = ca.substitute(self._f, self._lam, multipliers) if self.surface_count else self._f
        return ca.vertcat(f, ca.SX.ones(self._t.numel(), 1))

    def parse_mode(self, mode: str) -> tuple[int, ...]:
        """Turn letters into signs: ``+`` 1, ``-`` -1, ``s`` 0.

        Raises
        ------
        DefinitionError
            A wrong number of letters or another letter.
        """
        letters = {"+": 1, "-": -1, "s": 0}
        if not isinstance(mode, str) or len(mode) != self.surface_count or set(mode) - set(letters):
            raise DefinitionError(
                explain(
                    "mode",
                    expected=f"{self.surface_count} letter(s), each of + - s, one per surface",
                    received=repr(mode),
                    advice="'+' is h > 0, '-' is h < 0, 's' is sliding.",
                )
            )
        return tuple(letters[c] for c in mode)

    def lie_derivative(
        self, fields: str | Sequence[str], surface: int = 0, of: Expression | None = None
    ) -> ca.SX:
        """Iterated Lie derivative; the rightmost field is applied first, as in L12 = F1.grad L2.

        Parameters
        ----------
        fields : str or sequence of str
            Modes without sliding. With one surface a string such as ``"+-"`` reads as L12.
        surface : int, optional
            Which switching function is differentiated.
        of : expression, optional
            Another function to differentiate.

        Returns
        -------
        SX scalar, explicit-time terms included.

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x, y, z = (ca.SX.sym(s) for s in "xyz")
        >>> s = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, 2], below=[z, 3, 4])
        >>> s.lie_derivative("+"), s.lie_derivative("++"), s.lie_derivative("+-")
        (SX((-y)), SX(-1), SX(2))
        """
        key = ("lie", tuple(fields), surface)
        if of is None and key in self._functions:
            return self._functions[key]
        expression = self.surface_function(surface) if of is None else ca.SX(of)
        for mode in reversed(list(fields)):
            gradient = ca.jacobian(expression, self.extended_states)
            expression = ca.mtimes(gradient, self.field(mode))
        expression = ca.simplify(expression)
        if of is None:
            self._functions[key] = expression
        return expression

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
        return ca.densify(ca.jacobian(_expression(expression, "expression"), self.extended_states))

    # numeric -----------------------------------------------------------------------------------

    def function(
        self, key: Any, build: Callable[[], Sequence[ca.SX]], states: ca.SX | None = None
    ) -> ca.Function:
        """Return the cached CasADi function (states, p) -> ``build()``; states as extended."""
        if key not in self._functions:
            outputs = [ca.densify(ca.SX(e)) for e in build()]
            x = self.extended_states if states is None else states
            self._functions[key] = ca.Function("f", [x, self._p], outputs, {"cse": True})
        return self._functions[key]

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
        point : array_like (n,)
        parameters : mapping, optional
            Values that replace defaults.
        t : float, optional
            Time, where the system depends on it.

        Returns
        -------
        ndarray of the expression's shape

        Raises
        ------
        PointError, ParameterError, DefinitionError

        Examples
        --------
        >>> import casadi as ca, nonsmooth as ns
        >>> x = ca.SX.sym("x")
        >>> system = ns.FilippovSystem([x], surface=x, above=[-1], below=[3])
        >>> system.evaluate(system.lie_derivative("-"), [0.0]).item()
        3.0
        """
        values, p = self.extended_point(point, t), self.parameter_vector(parameters)
        return np.array(self._function_of(_matrix(expression))(values, p))

    def _function_of(self, expression: ca.SX) -> ca.Function:
        """Return the function of an expression, the same for the same expression object."""
        entries = ca.vertsplit(ca.vec(expression)) if expression.numel() else []
        key = ("expression", expression.shape, tuple(e.element_hash() for e in entries))
        if key not in self._functions:
            known = ca.vertcat(self.extended_states, self._p)
            _no_foreign_symbols(expression, known, "expression", self)
            # The expression stays alive beside its function: hashes are those of live nodes.
            self._functions["alive", key] = expression
            self.function(key, lambda: [expression])
        return self._functions[key]

    def parameter_vector(self, parameters: Parameters | None = None) -> Array:
        """Numbers for all parameters, defaults replaced by ``parameters`` (keys: symbols or names).

        Returns
        -------
        ndarray, in the order of ``parameter_names``

        Raises
        ------
        ParameterError
            An unknown name, a missing value or one that is not a finite number.
        """
        values, given = dict(self._defaults), dict[str, Any]()
        if parameters is not None and not isinstance(parameters, Mapping):
            raise ParameterError(
                explain(
                    "parameters",
                    expected="a mapping from names or symbols to numbers",
                    received=f"{parameters!r} ({type(parameters).__name__})",
                    advice=f"The names are {list(self.parameter_names)}.",
                )
            )
        for key, value in (parameters or {}).items():
            name = key if isinstance(key, str) else str(key)
            if name in given:
                raise ParameterError(
                    f"parameters: expected one value for {name!r}, received {given[name]!r} and "
                    f"{value!r}, under its name and its symbol. Keep one of them."
                )
            given[name] = value
            if name not in values:
                raise ParameterError(
                    explain(
                        "parameters",
                        expected=f"names among {list(self.parameter_names)}",
                        received=repr(name),
                        advice="Declare it in the system's parameters=, or correct the name.",
                    )
                )
            values[name] = value
        missing = [name for name, value in values.items() if value is None]
        if missing:
            raise ParameterError(
                f"parameters: expected a value for {missing}, received none. They have no default: "
                "pass parameters={name: value}."
            )
        return np.array(
            [
                real(values[n], f"parameter {n!r}", error=ParameterError)
                for n in self.parameter_names
            ]
        )

    def extended_point(self, point: ArrayLike, t: float = 0.0) -> Array:
        """Check a state and append the time where the system depends on it.

        Raises
        ------
        PointError
            Wrong shape, not numbers, NaN or inf.
        """
        values = real_array(point, "point", f"{self.dimension} numbers")
        if values.shape != (self.dimension,):
            raise PointError(
                explain(
                    "point",
                    expected=f"shape ({self.dimension},) for the states {self.state_names}",
                    received=f"shape {values.shape}",
                    advice="Give one number for each state.",
                )
            )
        if not np.all(np.isfinite(values)):
            raise PointError(
                explain(
                    "point",
                    expected="finite numbers",
                    received=str(values),
                    advice="NaN or inf often comes from an earlier division by zero.",
                )
            )
        moment = real(t, "time", error=PointError)
        return np.append(values, moment) if self.time_dependent else values

    def _index(self, surface: int) -> int:
        if isinstance(surface, bool) or not isinstance(surface, (int, np.integer)):
            raise DefinitionError(f"surface: expected an index (int), received {surface!r}.")
        if not 0 <= surface < self.surface_count:
            raise DefinitionError(
                f"surface: expected an index below {self.surface_count}, received {surface}."
            )
        return int(surface)


# Reading a definition --------------------------------------------------------------------------


def _listed(value: Any) -> list[Any]:
    if value is None:
        return []
    if isinstance(value, (ca.SX, ca.DM)):
        return ca.vertsplit(ca.vec(ca.SX(value))) if value.numel() else []
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        return [value]
    return list(value)


def _expression(value: Any, what: str) -> ca.SX:
    if isinstance(value, ca.MX):
        raise DefinitionError(
            f"{what}: expected CasADi SX expressions, received MX. Make the symbols with "
            "casadi.SX.sym."
        )
    try:
        result = ca.SX(value) if isinstance(value, (ca.SX, ca.DM)) else ca.SX(float(value))
    except (TypeError, ValueError, NotImplementedError) as error:
        raise DefinitionError(
            f"{what}: expected a CasADi SX expression or a number, received {value!r} "
            f"({type(value).__name__})."
        ) from error
    if result.shape != (1, 1):
        raise DefinitionError(f"{what}: expected a scalar, received shape {result.shape}.")
    return ca.densify(result)


def _matrix(value: Any) -> ca.SX:
    """Read an expression of any shape: an SX, or a (nested) sequence of scalars."""
    if not isinstance(value, (list, tuple, np.ndarray)):
        return (
            ca.densify(ca.SX(value))
            if isinstance(value, (ca.SX, ca.DM))
            else _expression(value, "expression")
        )
    return ca.densify(ca.vertcat(*[_matrix(v).T for v in value]))


def read_function(system: FilippovSystem, value: Any, what: str) -> ca.SX:
    """Check a scalar function of states, parameters and time that a user gave.

    Raises
    ------
    DefinitionError, NotSmoothError
    """
    expression = _expression(value, what)
    known = ca.vertcat(system.extended_states, system.parameter_symbols)
    _no_foreign_symbols(expression, known, what, system)
    require_smooth(expression, system.extended_states, system.parameter_symbols, what)
    return expression


def _column(values: Any, what: str, length: int) -> ca.SX:
    if values is None:
        raise DefinitionError(
            f"{what}: expected {length} expressions, received none. Give above= and below= with "
            "surface=, or field= with multipliers= and surfaces=."
        )
    items = _listed(values)
    if len(items) != length:
        raise DefinitionError(
            explain(
                what,
                expected=f"{length} expressions, one for each state"
                if length != 1
                else "one expression",
                received=str(len(items)),
                advice="The order is that of the states.",
            )
        )
    return ca.vertcat(*[_expression(v, f"{what}[{i}]") for i, v in enumerate(items)])


def _symbols(values: Any, what: str) -> ca.SX:
    items = _listed(values)
    for i, item in enumerate(items):
        if not (isinstance(item, ca.SX) and item.is_scalar() and item.is_symbolic()):
            raise DefinitionError(
                explain(
                    f"{what}[{i}]",
                    expected="a scalar symbol made by casadi.SX.sym",
                    received=f"{item!r} ({type(item).__name__})",
                    advice="MX symbols, expressions and strings are not symbols.",
                )
            )
    return ca.vertcat(*items) if items else ca.SX(0, 1)


def _parameter_symbols(
    parameters: Parameters | Sequence[Expression] | None,
) -> tuple[ca.SX, dict[str, float | None]]:
    if isinstance(parameters, Mapping):
        symbols, values = list(parameters), list(parameters.values())
    else:
        symbols = _listed(parameters)
        values = [None] * len(symbols)
    p = _symbols(symbols, "parameters")
    defaults = {
        s.name(): None if v is None else real(v, f"parameter {s.name()!r}", error=ParameterError)
        for s, v in zip(symbols, values, strict=True)
    }
    return p, defaults


def _surface_expressions(
    surface: Expression | None, surfaces: Sequence[Expression] | None
) -> ca.SX:
    if surface is not None and surfaces is not None:
        raise DefinitionError(
            "surface: expected either surface= or surfaces=, received both. One switching "
            "function goes to surface=, several to surfaces=."
        )
    items = [surface] if surface is not None else _listed(surfaces)
    expressions = [_expression(v, f"surface {i}") for i, v in enumerate(items)]
    return ca.vertcat(*expressions) if expressions else ca.SX(0, 1)


def _without_states(what: str, function: ca.SX, system: FilippovSystem) -> str:
    """Message for a surface, stop or reset that no motion can cross."""
    if system.time_dependent and ca.depends_on(function, system._t):
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
        expected=f"a function of the states {system.state_names}",
        received=received,
        advice=advice,
    )


def _items(values: Any, kind: type[Any], what: str) -> list[Any]:
    """Read stops= or resets=: one, or a sequence of them."""
    items = [values] if isinstance(values, kind) else _listed(values)
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
    f1, f2 = _column(above, "above", n), _column(below, "below", n)
    lam = ca.SX.sym("lambda")
    entries = []
    for a, b in zip(ca.vertsplit(f1), ca.vertsplit(f2), strict=True):
        # This form folds back to exactly a and b at lambda = +1 and -1.
        same = ca.is_equal(a, b, 10)
        entries.append(a if same else (1 + lam) / 2 * a + (1 - lam) / 2 * b)
    return lam, ca.vertcat(*entries)


def _unique(symbols: ca.SX) -> None:
    names = [str(s) for s in ca.vertsplit(symbols)]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise DefinitionError(
            f"symbols: expected one name for each state, parameter, multiplier and time, received "
            f"{twice} more than once. Names are how parameters are set and results are labelled."
        )


def _no_foreign_symbols(expression: ca.SX, known: ca.SX, what: str, system: FilippovSystem) -> None:
    present = ca.symvar(expression)
    listed = ca.vertsplit(known)
    foreign = [s for s in present if not any(ca.is_equal(s, k) for k in listed)]
    if foreign:
        names = {str(k) for k in listed}
        clash = [str(s) for s in foreign if str(s) in names]
        cause = (
            f"{clash} has the name of a declared symbol but is another symbol: create each symbol "
            "once and reuse it."
            if clash
            else "Add it to states=, parameters= or time=, or give it a number."
        )
        raise DefinitionError(
            explain(
                what,
                expected=f"the states {list(system.state_names)} and parameters "
                f"{list(system.parameter_names)}",
                received=f"also {[str(s) for s in foreign]}",
                advice=cause,
            )
        )


def _finite_constants(expression: ca.SX, known: ca.SX, what: str) -> None:
    f = ca.Function("constants", [known], [expression])
    for k in range(f.n_instructions()):
        if f.instruction_id(k) == ca.OP_CONST and not math.isfinite(f.instruction_constant(k)):
            raise DefinitionError(
                f"{what}: expected finite constants, received {f.instruction_constant(k)} in "
                f"{expression}."
            )
