"""WHAT a nonsmooth system is: states, parameters, fields, switching surfaces, stops and resets.

Where it depends on time, the state carries that as a last component, in Lie derivatives and jets too.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..cache import Cache, Content
from ..calls import call
from ..checks import real
from ..errors import DefinitionError, PointError, explain
from ..reading import Expression, Parameters, column, listed, matrix, require_known
from ..values import Array, state_values
from .clock import Clock, with_clocks
from .consistency import consistent_parameters
from .events import Impact, Reset, Stop
from .form import Definition
from .lift import lift
from .parse_definition import read_definition
from .structure import Structure

T = TypeVar("T")


class FilippovSystem(Structure):
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
        three is one set $h = 0$: its multiplier is $h/|h|$ off it and $|lambda| <= 1$ on it.
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
    clocks : sequence of Clock, optional
        What is periodic in time; each adds its phase to the states.
    hidden : bool, optional
        Allow multipliers that enter nonlinearly (hidden dynamics, Jeffrey 2018): sliding then
        follows a stable solution $lambda$ of $grad h . f(x, lambda) = 0$.

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
        clocks: Sequence[Clock] | Clock = (),
        hidden: bool = False,
    ):
        given = {
            "states": states,
            "surface": surface,
            "above": above,
            "below": below,
            "field": field,
            "multipliers": multipliers,
            "surfaces": surfaces,
            "parameters": parameters,
            "time": time,
            "stops": stops,
            "resets": resets,
            "impacts": impacts,
            "hidden": hidden,
        }
        self._adopt(read_definition(**with_clocks(clocks, given)))

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
        clocks: Sequence[Clock] | Clock = (),
        hidden: bool = False,
    ) -> FilippovSystem:
        """Find sign, fabs, fmin, fmax and if_else in a right-hand side and make them surfaces.

        Identical switching functions, also up to a constant factor, share one multiplier; see
        ``lifted`` for the surfaces and their order. What the expression is on a surface does not
        matter: between its two sides the field is Filippov's convex combination, also where the
        expression is nonlinear in a switch, as sign(x)**2 is, unless ``hidden`` is true.

        Parameters
        ----------
        states, parameters, time, stops, resets, impacts, clocks
            As for the class. Stops, resets and gaps must be smooth.
        rhs : sequence of n expressions
            In states, parameters and time, with switches.
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
        column(rhs, "rhs", len(listed(states)))  # refuses what is no field of the states
        widened = with_clocks(clocks, {"states": states, "rhs": rhs, "resets": resets})
        states, rhs, resets = widened["states"], widened["rhs"], widened["resets"]
        n = len(listed(states))
        frame = cls(states, field=[0] * n, parameters=parameters, time=time).definition
        entries = column(rhs, "rhs", n)
        known = ca.vertcat(frame.extended_states, frame.parameters)
        require_known(entries, known, "rhs", **frame.names)
        found = lift(entries, frame.states, frame.time, frame.parameters, hidden=hidden)
        system = cls(
            states,
            field=found.field,
            multipliers=found.multipliers,
            surfaces=found.surfaces,
            parameters=parameters,
            time=time,
            stops=stops,
            resets=resets,
            impacts=impacts,
            hidden=hidden,
        )
        system.lifted = found.switches
        return system

    def _adopt(self, definition: Definition) -> None:
        super()._adopt(definition)
        self._cache = Cache()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.definition.state(), "lifted": self.lifted}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._adopt(Definition.from_state(state))
        self.lifted = state["lifted"]

    def content_hash(self) -> str:
        """Hash of the definition: equal for equal expressions, names, stops and resets."""

        def build() -> str:
            parts = sorted((k, repr(v)) for k, v in self.definition.state().items())
            return hashlib.sha256(str(parts).encode()).hexdigest()

        return self.cached("content hash", build)

    def __eq__(self, other: object) -> bool:
        """Whether another system has the same definition; its symbols may be others."""
        same = isinstance(other, FilippovSystem) and self.content_hash() == other.content_hash()
        return self is other or same

    def __hash__(self) -> int:
        return hash(self.content_hash())

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
        """Return what is kept for ``key``, or what ``build`` makes; the last 256 things are kept."""
        return self._cache.get(key, build)

    def function(
        self, key: Hashable, build: Callable[[], Sequence[ca.SX]], states: ca.SX | None = None
    ) -> ca.Function:
        """Return the function of ``states`` and parameters that ``build`` makes; it is kept for ``key``."""

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


def require_system(value: Any, sets: bool = False) -> None:
    """Raise DefinitionError unless a value is a FilippovSystem."""
    # ``sets`` says whether it may have sets of codimension two or more, where multipliers are vectors.

    if not isinstance(value, FilippovSystem):
        raise DefinitionError(
            explain(
                "system",
                expected="a FilippovSystem",
                received=f"{value!r} ({type(value).__name__})",
                advice="Make one with FilippovSystem(states, ...) or "
                "FilippovSystem.from_expression(states, rhs).",
            )
        )
    if value.sets and not sets:
        raise DefinitionError(
            explain(
                "system",
                expected="one whose multipliers are scalars, here",
                received=repr(value),
                advice="Vector multipliers, sets of codimension two and three, are known to simulate, "
                "ensemble, sensitivity, region and limit_directions.",
            )
        )
