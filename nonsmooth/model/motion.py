"""The smooth motion of one mode: its field, its guards, and their jets as fast functions.

A guard is a function that is positive inside the mode; the mode ends where it falls through zero:

- ``surface``: s_i h_i for a surface that does not slide (s_i = +1 or -1);
- ``exit``: -L_{F+} h_i and L_{F-} h_i for the one that slides. They vanish where sliding stops
  being attracting; the ratio alpha is never used, because it is 0/0 at a two-fold.

Stops and resets follow the guards as they were given; their direction is the driver's business.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .cancel import cancel_common_factor
from .errors import DefinitionError
from .graph import has_branch_points
from .jets import taylor
from .system import Array, FilippovSystem, read_function


@dataclass(frozen=True)
class Guard:
    """What the zero of one event function means.

    Attributes
    ----------
    kind : {"surface", "exit", "stop", "reset", "branch", "zero"}
    index : int
        Of the surface, stop or reset.
    side : int
        For an exit the side, +1 or -1, to which the motion leaves; for a surface the side on which
        the motion is; for stops and resets the direction.
    name : str
    """

    kind: str
    index: int
    side: int
    name: str


class Motion:
    """Field, guards and jets of one mode of a system.

    Parameters
    ----------
    system : FilippovSystem
    mode : str
        One letter for each surface, at most one ``s``.
    """

    def __init__(self, system: FilippovSystem, mode: str):
        self.system, self.mode = system, mode
        self.signs = system.parse_mode(mode)
        sliding = [i for i, s in enumerate(self.signs) if s == 0]
        if len(sliding) > 1:
            raise DefinitionError(
                f"mode {mode!r}: expected at most one sliding surface, received {len(sliding)}. "
                "Sliding on an intersection has the multipliers as further states: Intersection."
            )
        self.states = system.extended_states
        self.sliding = sliding[0] if sliding else None
        self.cancelled = False
        self._key: tuple[object, ...] = ()
        self.field = self._sliding_field() if sliding else system.field(mode)
        self.guards, self.functions = self._guards()

    def _with_side(self, side: int) -> str:
        assert self.sliding is not None
        letters = list(self.mode)
        letters[self.sliding] = "+" if side > 0 else "-"
        return "".join(letters)

    def _sliding_field(self) -> ca.SX:
        """F0 - (a/b) G with the common factor of G and b cancelled (Filippov 1988, sec. 4)."""
        system, i = self.system, self.sliding
        assert i is not None
        multipliers = ca.SX([float(s) for s in self.signs])
        lam = ca.SX.sym("lambda")
        multipliers[i] = lam
        field = system.field_with(multipliers)
        middle = ca.substitute(field, lam, 0)
        difference = ca.jacobian(field, lam)
        gradient = ca.jacobian(system.surface_function(i), system.extended_states)
        a = ca.simplify(ca.mtimes(gradient, middle))
        entries = ca.vertsplit(ca.densify(difference))
        if self._continuous(entries):
            self.cancelled = True
            return middle
        # A factor of G is one of b = grad h . G too, and there it may no longer be in sight.
        reduced, factor = cancel_common_factor(
            entries, system.extended_states, system.parameter_symbols
        )
        self.cancelled = bool(ca.depends_on(factor, system.extended_states))
        b = ca.simplify(ca.mtimes(gradient, ca.vertcat(*reduced)))
        return middle - (a / b) * ca.vertcat(*reduced)

    def _continuous(self, difference: list[ca.SX]) -> bool:
        """Whether the two fields are one field on the surface: their difference is 0 or h times a
        function, so that there is nothing to choose there."""
        system = self.system
        assert self.sliding is not None
        h = system.surface_function(self.sliding)
        pieces = [e for e in difference if not e.is_zero()]
        if not pieces:
            return True
        reduced, _ = cancel_common_factor(
            [*pieces, h], system.extended_states, system.parameter_symbols
        )
        if not ca.depends_on(reduced[-1], system.extended_states):
            return True
        return self._vanishes_on_surface(ca.vertcat(*pieces), h)

    def _vanishes_on_surface(self, difference: ca.SX, h: ca.SX, samples: int = 6) -> bool:
        """Whether an expression is zero at random points of the surface: an identity test.

        It finds factors h that no rearrangement of the expression brings to light.
        """
        system = self.system
        x, p = system.extended_states, system.parameter_symbols
        gradient = ca.jacobian(h, x)
        f = ca.Function("f", [x, p], [difference, h, gradient, ca.fabs(difference)])
        random, seen = np.random.default_rng(0), 0
        for _ in range(4 * samples):
            point, q = random.uniform(0.2, 1.2, x.numel()), random.uniform(0.2, 1.2, p.numel())
            size = float(np.max(np.array(f(point, q)[3]), initial=0.0))
            for _ in range(8):
                _, value, slope, _ = (np.array(v) for v in f(point, q))
                step = (
                    value.item() * slope.ravel() / max(float(slope.ravel() @ slope.ravel()), 1e-300)
                )
                point = point - step
            left = np.array(f(point, q)[0])
            if not (
                np.all(np.isfinite(left)) and np.isfinite(size) and abs(f(point, q)[1]) < 1e-12
            ):
                continue
            if np.abs(left).max() > 1e-11 * max(1.0, size):
                return False
            seen += 1
            if seen == samples:
                return True
        return False

    def _guards(self) -> tuple[tuple[Guard, ...], ca.SX]:
        system = self.system
        guards: list[Guard] = []
        functions: list[ca.SX] = []
        for i, sign in enumerate(self.signs):
            if sign:
                guards.append(Guard("surface", i, sign, f"h{i}"))
                functions.append(sign * system.surface_function(i))
                continue
            for guard, function in self._exits(i):
                guards.append(guard)
                functions.append(function)
        for j, (name, direction) in enumerate(system.stops):
            guards.append(Guard("stop", j, direction, name))
            functions.append(system._guards[j])
        for j, (name, direction) in enumerate(system.resets):
            guards.append(Guard("reset", j, direction, name))
            functions.append(system._guards[len(system.stops) + j])
        return tuple(guards), ca.densify(ca.vertcat(*functions)) if functions else ca.SX(0, 1)

    def _exits(self, i: int) -> list[tuple[Guard, ca.SX]]:
        """Guards of the sliding on surface i."""
        return [
            (
                Guard("exit", i, side, "L_F1 h" if side > 0 else "L_F2 h"),
                -side * self.system.lie_derivative([self._with_side(side)], i),
            )
            for side in (1, -1)
        ]

    @cached_property
    def branches(self) -> bool:
        """Whether a step must be compared with the field at its end (see has_branch_points)."""
        return has_branch_points([self.states, self.system.parameter_symbols], [self.field])

    def field_function(self) -> ca.Function:
        """Return (x, p) -> the field (N, 1)."""
        return self.system.function(("field", self.mode), lambda: [self.field], self.states)

    def jet_function(self, order: int) -> ca.Function:
        """Return (x, p) -> jets of states (N, order+1) and of guard functions (m, order+1)."""
        system = self.system

        def build() -> Sequence[ca.SX]:
            return taylor(self.field, self.functions, self.states, system.parameter_symbols, order)

        return system.function(("jet", self.mode, order, *self._key), build, self.states)

    def gradient_function(self) -> ca.Function:
        """Return (x, p) -> gradients of the guard functions (m, N), the yardstick of rounding."""
        system = self.system

        def build() -> Sequence[ca.SX]:
            return [ca.jacobian(self.functions, self.states)]

        return system.function(("gradient", self.mode, *self._key), build, self.states)


class Evaluator:
    """A CasADi function called without conversions: preallocated inputs and outputs.

    Two threads at once may use ``copied`` only.

    Parameters
    ----------
    function : casadi.Function
        Two dense inputs (x, p), dense outputs.
    """

    def __init__(self, function: ca.Function):
        self._buffer, self._run = function.buffer()
        self._lock = threading.Lock()
        self._x = np.zeros(function.numel_in(0))
        self._p = np.zeros(function.numel_in(1))
        self.outputs: list[NDArray[np.float64]] = [
            np.zeros(function.size_out(k), order="F") for k in range(function.n_out())
        ]
        for k, value in enumerate((self._x, self._p)):
            if value.size:
                self._buffer.set_arg(k, value.data)
        for k, result in enumerate(self.outputs):
            if result.size:
                self._buffer.set_res(k, result.reshape(-1, order="F").data)

    def __call__(self, x: Array, p: Array) -> list[Array]:
        """Evaluate; the returned arrays are overwritten by the next call."""
        self._x[:] = x
        self._p[:] = p
        self._run()
        return self.outputs

    def copied(self, x: Array, p: Array) -> list[Array]:
        """Evaluate to arrays that are the caller's, from any thread."""
        with self._lock:
            return [np.array(output) for output in self(x, p)]


class Followed(Motion):
    """A mode whose functions are only watched: its guards' and further ones, all of kind "zero".

    Parameters
    ----------
    system : FilippovSystem
    mode : str
    watched : sequence of SX scalars
        Functions of states, parameters and time, named ``f0``, ``f1``, ...
    """

    def __init__(self, system: FilippovSystem, mode: str, watched: Sequence[ca.SX]):
        super().__init__(system, mode)
        own = [Guard("zero", k, 0, g.name) for k, g in enumerate(self.guards)]
        more = [Guard("zero", len(own) + k, 0, f"f{k}") for k in range(len(watched))]
        expressions = [
            read_function(system, w, f"watched function {k}") for k, w in enumerate(watched)
        ]
        self.guards = (*own, *more)
        self.functions = ca.densify(ca.vertcat(self.functions, *expressions))
        inputs = [system.extended_states, system.parameter_symbols]
        content = ca.Function("watched", inputs, [ca.vertcat(*expressions)]).serialize()
        self._key = ("followed", hash(content)) if expressions else ()


class Surfaces:
    """Values and state gradients of all switching functions; projection onto them."""

    def __init__(self, system: FilippovSystem):
        self.system = system

        def build() -> Sequence[ca.SX]:
            h = ca.vertcat(*[system.surface_function(i) for i in range(system.surface_count)])
            return [h, ca.jacobian(h, system.extended_states)]

        self.evaluator = Evaluator(system.function("surfaces", build))

    def values(self, x: Array, p: Array) -> tuple[Array, Array]:
        """Return h (m,) and its gradient with respect to the extended state (m, N)."""
        if not self.system.surface_count:
            return np.zeros(0), np.zeros((0, x.size))
        h, gradient = self.evaluator(x, p)
        return np.array(h).ravel(), np.array(gradient)

    def project(
        self,
        x: Array,
        p: Array,
        which: Sequence[int],
        level: float = 0.0,
        iterations: int = 3,
    ) -> Array:
        """Move the states (not the time) onto h_i = level by least-norm Newton steps."""
        n, chosen = self.system.dimension, list(which)
        for _ in range(iterations if chosen else 0):
            h, gradient = self.values(x, p)
            miss = h[chosen] - level
            if not np.any(miss):
                break
            step = np.linalg.lstsq(gradient[chosen, :n], miss, rcond=None)[0]
            x = x.copy()
            x[:n] -= step
        return x


class Resets:
    """The maps of a system's resets as one function of state and parameters."""

    def __init__(self, system: FilippovSystem):
        self.system = system
        self.function = system.function("resets", lambda: [system._maps])

    def apply(self, index: int, x: Array, p: Array) -> Array:
        """Return the state after reset ``index``; the time is kept."""
        after = x.copy()
        after[: self.system.dimension] = np.array(self.function(x, p))[:, index]
        return after


class Intersection(Motion):
    """Sliding whose multipliers solve grad h_i . f(x, lambda) = 0 implicitly.

    For several sliding surfaces, or one whose multiplier enters nonlinearly (hidden dynamics), the
    multipliers are further states with lambda' = -(dG/dlambda)^-1 dG/dx f, so the same jets carry
    them. A multiplier that reaches +1 or -1 leaves its surface; ``branch`` guards keep the
    equilibrium lambda of the layer problem eps lambda_i' = grad h_i . f stable (Jeffrey 2018).

    Parameters
    ----------
    system : FilippovSystem
    mode : str
        One letter for each surface.
    """

    def __init__(self, system: FilippovSystem, mode: str):
        self.system, self.mode = system, mode
        self.signs = system.parse_mode(mode)
        self.surfaces = [i for i, s in enumerate(self.signs) if s == 0]
        self.sliding, self.cancelled, self._key = self.surfaces[0], True, ()
        self.multipliers = ca.vertcat(*[ca.SX.sym(f"lambda{i}") for i in self.surfaces])
        values = ca.SX([float(s) for s in self.signs])
        for k, i in enumerate(self.surfaces):
            values[i] = self.multipliers[k]
        field = system.field_with(values)
        x = system.extended_states
        h = ca.vertcat(*[system.surface_function(i) for i in self.surfaces])
        self.layer = ca.densify(ca.mtimes(ca.jacobian(h, x), field))
        self.slope = ca.densify(ca.jacobian(self.layer, self.multipliers))
        drift = ca.mtimes(ca.jacobian(self.layer, x), field)
        rates = -ca.mtimes(ca.inv_minor(self.slope), drift)
        self.states = ca.vertcat(x, self.multipliers)
        self.field = ca.vertcat(field, rates)
        self.guards, self.functions = self._guards()

    def _guards(self) -> tuple[tuple[Guard, ...], ca.SX]:
        guards, functions = super()._guards()
        k, first = len(self.surfaces), self.surfaces[0]
        # At a simple fold of one multiplier the field is singular before its guard is zero.
        stable = [(-1.0) ** k * ca.det(self.slope)]
        if k > 1:
            stable.append(-ca.trace(self.slope))
        more = tuple(Guard("branch", first, 0, "stability of sliding") for _ in stable)
        return guards + more, ca.densify(ca.vertcat(functions, *stable))

    def _exits(self, i: int) -> list[tuple[Guard, ca.SX]]:
        lam = self.multipliers[self.surfaces.index(i)]
        return [(Guard("exit", i, side, f"lambda{i}"), 1 - side * lam) for side in (1, -1)]

    def layer_function(self) -> ca.Function:
        """Return (x with multipliers, p) -> G (k,), dG/dlambda (k, k)."""
        build = [self.layer, self.slope]
        return self.system.function(("layer", self.mode), lambda: build, self.states)

    def improve(self, values: Array, p: Array, iterations: int = 2) -> Array:
        """Correct the multipliers at the end of ``values`` by Newton on G = 0."""
        k, values = len(self.surfaces), values.copy()
        for _ in range(iterations):
            g, slope = (np.array(a) for a in self.layer_function()(values, p))
            if not np.all(np.isfinite(slope)) or abs(np.linalg.det(slope)) == 0.0:
                break
            values[-k:] -= np.linalg.solve(slope, g.ravel())
        return values

    def velocity_and_slope(self, values: Array, p: Array) -> tuple[Array, Array]:
        """Field of the extended state (N,) and dG/dlambda (k, k) at x with multipliers."""
        rows = self.system.extended_dimension
        build = [self.field[:rows], self.slope]
        f = self.system.function(("velocity", self.mode), lambda: build, self.states)
        velocity, slope = (np.array(v) for v in f(values, p))
        return velocity.ravel(), slope

    def solutions(self, x: Array, p: Array, stable_only: bool = True) -> list[Array]:
        """Multipliers in [-1, 1]^k at x, each as x extended by them.

        Newton from a grid: bilinear equations of two multipliers have at most two solutions.
        """
        k = len(self.surfaces)
        grid = np.linspace(-0.95, 0.95, 21 if k == 1 else 5)
        found: list[Array] = []
        for start in np.stack(np.meshgrid(*[grid] * k), axis=-1).reshape(-1, k):
            values = self.improve(np.concatenate([x, start]), p, 30)
            g, slope = (np.array(a) for a in self.layer_function()(values, p))
            lam = values[-k:]
            small = np.abs(g).max() <= 1e-10 * (1.0 + np.abs(slope).max())
            if not small or np.abs(lam).max() > 1.0 + 1e-9:
                continue
            if stable_only and np.linalg.eigvals(slope).real.max() >= 0.0:
                continue
            if all(np.abs(lam - other[-k:]).max() > 1e-7 for other in found):
                found.append(values)
        return found


def evaluator(
    system: FilippovSystem, key: Hashable, build: Callable[[], Sequence[ca.SX]]
) -> Evaluator:
    """Return the evaluator of ``system.function(key, build)``, made once per system."""
    key = ("evaluator", key)
    if key not in system._functions:
        system._functions[key] = Evaluator(system.function(key, build))
    return system._functions[key]


def followed(system: FilippovSystem, mode: str, watched: Sequence[ca.SX] = ()) -> Followed:
    """Return the watched motion of a mode, built once per system unless functions are added."""
    if watched:
        return Followed(system, mode, watched)
    key = ("followed", mode)
    if key not in system._functions:
        system._functions[key] = Followed(system, mode, ())
    return system._functions[key]


def motion(system: FilippovSystem, mode: str) -> Motion:
    """Return the motion of a mode, built once per system."""
    key = ("motion", mode)
    if key not in system._functions:
        implicit = mode.count("s") > 1 or any(
            c == "s" and nonlinear for c, nonlinear in zip(mode, system.nonlinear, strict=True)
        )
        system._functions[key] = (Intersection if implicit else Motion)(system, mode)
    return system._functions[key]
