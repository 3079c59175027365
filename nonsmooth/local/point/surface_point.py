"""One surface of a system at a point: h, the two fields, their Lie derivatives, and all gradients.

L_i = F_i . grad h and L_ij = F_i . grad L_j, so L12 is F1 . grad L2. Derivatives are exact. Points
and vectors have N coordinates: the states, then time if the system depends on it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...flow.fixed import first_terms
from ...model import (
    Array,
    DefinitionError,
    FilippovSystem,
    OneSurface,
    Parameters,
    PointError,
    Switching,
    call,
    evaluator,
    one_surface,
    require_system,
)
from ...model.derivatives.variational import guarded_field
from ...solvers.newton import Equations
from ..checks import require_surface
from .elements_at import Situation, acts, chosen, situation

#: Default of ``tol`` at a given point: an angle, and a relative distance.
TOLERANCE = 1e-10

#: A side of a surface: ``+`` (h > 0, field F1) or ``-`` (h < 0, field F2).
Side = Literal["+", "-"]

#: In the order in which fields, Lie derivatives and Jacobians are listed.
SIDES: tuple[Side, Side] = ("+", "-")

#: Names of the fields.
FIELDS: dict[str, str] = {"+": "F1 (above)", "-": "F2 (below)"}


def side_index(side: object) -> int:
    """0 for ``+`` and 1 for ``-``."""
    if side not in SIDES:
        raise DefinitionError(
            f"side: expected '+' (the field F1, h > 0) or '-' (F2, h < 0), received {side!r}. "
            "Folds and equilibria belong to one of the two fields."
        )
    return SIDES.index(side)


def other(side: Side) -> Side:
    """The other side."""
    return "-" if side == "+" else "+"


def null_space(rows: Array) -> Array:
    """Orthonormal basis of the directions that rows (k, N) leave free, dependent ones included; (N, d)."""
    sizes, basis = np.linalg.svd(rows)[1:]
    return np.asarray(basis[np.count_nonzero(sizes > 1e-10 * sizes.max(initial=0.0)) :].T)


@dataclass(frozen=True, eq=False)
class Numbers:
    """Values at one point."""

    x: Array  # (N,)
    h: float
    gradient: Array  # grad h (N,)
    fields: Array  # F1 (above) and F2 (below) (2, N)
    lie: Array  # L1 and L2 (2,)
    lie_gradients: Array  # (2, N)

    @property
    def second(self) -> dict[str, float]:
        """Second Lie derivatives ``{"L11", "L12", "L21", "L22"}``."""
        values = self.fields @ self.lie_gradients.T
        return {f"L{i + 1}{j + 1}": float(values[i, j]) for i in (0, 1) for j in (0, 1)}

    @property
    def gradients(self) -> Array:
        """Rows grad h, grad L1, grad L2; (3, N)."""
        return np.vstack([self.gradient, self.lie_gradients])

    @property
    def tangents(self) -> Array:
        """Orthonormal basis of the surface's tangent space (N, N-1); in the plane (g_y, -g_x)."""
        g = self.gradient
        if g.size == 2:
            return np.array([[g[1]], [-g[0]]]) / np.linalg.norm(g)
        return np.linalg.svd(g[None, :])[2][1:].T

    @property
    def angles(self) -> Array:
        """Sines of the angles of F1 and F2 with the surface, 0 for a vanishing field; (2,)."""
        lengths = np.linalg.norm(self.gradient) * np.linalg.norm(self.fields, axis=1)
        return np.divide(self.lie, lengths, out=np.zeros(2), where=lengths > 0)

    @property
    def distance(self) -> float:
        """Distance to the surface to first order, |h|/|grad h|."""
        length = float(np.linalg.norm(self.gradient))
        if not length:
            return float("inf") if self.h else 0.0
        return abs(self.h) / length


@dataclass(frozen=True, eq=False)
class ManyNumbers:
    """Values at k points, as in ``Numbers``; NaN where a field is undefined."""

    x: Array  # (k, N)
    h: Array  # (k,)
    gradient: Array  # (k, N)
    fields: Array  # (k, 2, N)
    lie: Array  # (k, 2)
    lie_gradients: Array  # (k, 2, N)

    @property
    def values(self) -> Array:
        """Columns h, L1, L2; (k, 3)."""
        return np.column_stack([self.h, self.lie])

    @property
    def gradients(self) -> Array:
        """Rows grad h, grad L1, grad L2 of each point; (k, 3, N)."""
        return np.concatenate([self.gradient[:, None], self.lie_gradients], axis=1)

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Whether L1 L2 < 0, attracting or repelling; (k,)."""
        return self.lie[:, 0] * self.lie[:, 1] < 0

    @property
    def numerator(self) -> Array:
        """L2 F1 - L1 F2, along the sliding field times L2 - L1 and smooth at two-folds; (k, N)."""
        above, below = self.fields[:, 0], self.fields[:, 1]
        return self.lie[:, 1:] * above - self.lie[:, :1] * below

    @property
    def sliding(self) -> Array:
        """Sliding field, meaningful where L1 L2 < 0; (k, N)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.numerator / (self.lie[:, 1:] - self.lie[:, :1])


@dataclass(frozen=True, eq=False)
class LocalSurface:
    """One surface of a system with values of its parameters."""

    system: FilippovSystem
    surface: int
    mode: str  # one letter per surface, ``s`` for this one; empty for a smooth system
    parameters: Array
    element: OneSurface | None = None  # what it is in a system with conditions, contacts or joints

    def side(self, letter: str) -> str:
        """Return the mode above (``+``) or below (``-``) the surface; of a smooth system its one mode."""
        if not self.mode:
            return ""
        return self.mode[: self.surface] + letter + self.mode[self.surface + 1 :]

    @property
    def one_sided(self) -> bool:
        """Whether it is the boundary of a condition or of a contact, below which there is no motion."""
        return self.element is not None and self.element.kind in ("one-sided", "contact")

    def along(self, x: Array) -> Array | None:
        """Orthonormal basis (N, d) of the tangent space of joints and of what is closed; None if all is free."""
        if self.element is None or not self.element.kept:
            return None
        return null_space(self.element.kept_at(x, self.parameters)[1])

    @property
    def free(self) -> LocalSurface:
        """The same with derivatives in all directions, also those that leave joints and closed contacts."""
        return replace(self, element=None)

    def with_kept(self, equations: Equations, velocities: bool = False) -> Equations:
        """Equations whose first unknowns are the states, and those of joints and of what is closed.

        The first equations are components of a velocity if ``velocities``: those along the joints are taken.
        """
        element, n = self.element, self.system.extended_dimension
        if element is None or not element.kept:
            return equations

        def more(u: Array) -> tuple[Array, Array]:
            values, matrix = equations(u)
            kept, gradient, _ = element.kept_at(u[:n], self.parameters)
            rows = np.pad(gradient, [(0, 0), (0, u.size - n)])
            if velocities:
                along = null_space(gradient).T
                values = np.concatenate([along @ values[:n], values[n:]])
                matrix = np.vstack([along @ matrix[:n], matrix[n:]])
            return np.concatenate([values, kept]), np.vstack([matrix, rows])

        return more

    @property
    def values(self) -> dict[str, float]:
        """Names and values of the parameters."""
        names = self.system.parameter_names
        return dict(zip(names, map(float, self.parameters), strict=True))

    @property
    def switching(self) -> Switching:
        """The class of the surface, the other surfaces on their sides.

        Generic is one that is so for other values of the parameters: it passes a bifurcation at these.
        """
        system, mode = self.system, self.mode if self.system.surface_count > 1 else None
        for_all = system.switching(self.surface, mode=mode)
        if for_all.slides:
            return for_all
        return system.switching(self.surface, mode=mode, parameters=self.values)

    def _expressions(self) -> tuple[Any, list[Any], list[Any]]:
        """h, (L1, L2) and (F1, F2); of a smooth system h = 1 and both fields are the one."""
        system, modes = self.system, [self.side(letter) for letter in SIDES]
        if not system.surface_count:
            field = system.field("")
            number = type(field)
            return number(1.0), [number(0.0)] * 2, [field] * 2
        lie = [system.lie_derivative([mode], self.surface) for mode in modes]
        return system.surface_function(self.surface), lie, [system.field(mode) for mode in modes]

    def _build(self) -> Sequence[Any]:
        h, lie, fields = self._expressions()
        return [h, *lie, *(self.system.gradient(e) for e in (h, *lie)), *fields]

    def _rows(self, what: str, build: Callable[[], Sequence[Any]], x: Array) -> Array:
        """Evaluate expressions of N numbers each at a point; (k, N)."""
        evaluate = evaluator(self.system, (what, self.surface, self.mode), build)
        return np.array([v.ravel() for v in evaluate.copied(x, self.parameters)])

    def at(self, x: Array) -> Numbers:
        """Evaluate at an extended point (N,); entries may be NaN where a field is undefined."""
        evaluate = evaluator(self.system, ("local", self.surface, self.mode), self._build)
        h, l1, l2, *vectors = evaluate.copied(x, self.parameters)
        g, g1, g2, f1, f2 = (v.ravel() for v in vectors)
        lie, rows = np.array([l1[0, 0], l2[0, 0]]), np.array([g, f1, f2, g1, g2])
        basis = self.along(x)
        rows = rows if basis is None else rows @ basis
        return Numbers(x, float(h[0, 0]), rows[0], rows[1:3], lie, rows[3:])

    def finite_at(self, x: Array, slopes: bool = True) -> Numbers:
        """Evaluate as ``at`` does and refuse NaN and inf, those of grad L1 and grad L2 if ``slopes``."""
        numbers = self.at(x)
        gradients = numbers.gradients if slopes else numbers.gradient
        if not all(np.all(np.isfinite(v)) for v in (numbers.h, numbers.fields, gradients)):
            raise PointError(
                f"point {x}: expected a state where the fields and the derivatives of h, L1 and "
                f"L2 are finite, received h={numbers.h}, F1={numbers.fields[0]}, "
                f"F2={numbers.fields[1]}, grad L1={numbers.lie_gradients[0]}, grad "
                f"L2={numbers.lie_gradients[1]}. A root or logarithm left its domain, or a form "
                "such as sqrt(x)*x has an infinite factor in its derivative: write it as one "
                "power."
            )
        return numbers

    def many(self, x: Array) -> ManyNumbers:
        """Evaluate at points (k, N)."""
        function = self.system.function(("local", self.surface, self.mode), self._build)
        count, size = x.shape
        if not count:
            vectors = np.zeros((0, 2, size))
            return ManyNumbers(x, np.zeros(0), x, vectors, np.zeros((0, 2)), vectors)
        outputs = call(function, x.T, self.parameters)
        h, l1, l2 = (v[0] for v in outputs[:3])
        g, g1, g2 = (v.reshape(count, size) for v in outputs[3:6])
        fields = np.stack([f.T for f in outputs[6:]], axis=1)
        return ManyNumbers(x, h, g, fields, np.column_stack([l1, l2]), np.stack([g1, g2], axis=1))

    def many_h(self, x: Array) -> tuple[Array, Array]:
        """h (k,) and its gradient (k, N) at points (k, N)."""
        system = self.system

        def build() -> Sequence[Any]:
            h = system.surface_function(self.surface)
            return [h, system.gradient(h)]

        h, gradient = call(system.function(("h", self.surface), build), x.T, self.parameters)
        return h[0], gradient.reshape(x.shape)

    def switches(self, x: Array) -> Array:
        """The functions of all surfaces at a point; (m,)."""
        return _switches(self.system, x, self.parameters)

    @property
    def others(self) -> tuple[int, ...]:
        """The other surfaces."""
        return tuple(j for j in range(self.system.surface_count) if j != self.surface)

    # derivatives -------------------------------------------------------------------------------

    def jacobians(self, x: Array) -> Array:
        """DF1 and DF2 at a point; (2, N, N)."""
        system, size = self.system, self.system.extended_dimension

        def build() -> Sequence[Any]:
            return [system.gradient(f[i]) for f in self._expressions()[2] for i in range(size)]

        found, basis = self._rows("jacobians", build, x).reshape(2, size, size), self.along(x)
        return found if basis is None else np.asarray(basis.T @ found @ basis)

    def hessians(self, x: Array) -> tuple[Array, Array]:
        """Hessians of h, L1, L2 (3, N, N) and of the numerator L2 F1 - L1 F2 of sliding (N, N, N)."""
        system, size = self.system, self.system.extended_dimension

        def build() -> Sequence[Any]:
            h, (l1, l2), (f1, f2) = self._expressions()
            numerator = [l2 * f1[i] - l1 * f2[i] for i in range(size)]
            gradients = [system.gradient(e) for e in (h, l1, l2, *numerator)]
            return [system.gradient(g[i]) for g in gradients for i in range(size)]

        found, basis = self._rows("hessians", build, x).reshape(3 + size, size, size), self.along(x)
        if basis is not None:
            found = self._bent(found, x, basis)
            return found[:3], np.einsum("ia,ijk->ajk", basis, found[3:])
        return found[:3], found[3:]

    def _bent(self, hessians: Array, x: Array, basis: Array) -> Array:
        """Second derivatives along the manifold of what is kept, which bends."""
        system, size = self.system, self.system.extended_dimension
        assert self.element is not None

        def build() -> Sequence[Any]:
            h, (l1, l2), (f1, f2) = self._expressions()
            numerator = [l2 * f1[i] - l1 * f2[i] for i in range(size)]
            return [system.gradient(e) for e in (h, l1, l2, *numerator)]

        slopes = self._rows("slopes", build, x)
        _, gradient, second = self.element.kept_at(x, self.parameters)
        normal = -slopes @ np.linalg.pinv(gradient, rcond=1e-10)
        flat = hessians + np.einsum("ik,kab->iab", normal, second)
        return np.asarray(basis.T @ flat @ basis)

    def parameter_derivatives(self, x: Array) -> tuple[Array, Array]:
        """Derivatives of h (q,) and of F1, F2 (2, N, q) by the q parameters, at a point."""
        system, size = self.system, self.system.extended_dimension

        def build() -> Sequence[Any]:
            h, _, fields = self._expressions()
            entries = [h, *(f[i] for f in fields for i in range(size))]
            return [system.parameter_gradient(e) for e in entries]

        found = self._rows("parameters", build, x)
        return found[0], found[1:].reshape(2, size, -1)

    def lie_parameter_derivatives(self, x: Array) -> Array:
        """Derivatives of h, L1 and L2 by the q parameters, at a point; (3, q)."""

        def build() -> Sequence[Any]:
            h, lie, _ = self._expressions()
            return [self.system.parameter_gradient(e) for e in (h, *lie)]

        return self._rows("lie parameters", build, x)

    def orbit(self, x: Array, letter: str, order: int) -> tuple[Array, Array]:
        """Taylor coefficients of an orbit (N, order + 1) and of h on it, L^k h/k! (order + 1,)."""
        field = guarded_field(self.system, self.side(letter))
        states, guards = first_terms(field, x, self.parameters, order)
        # the guard of a side is h there, and positive
        return states, (1.0 if letter == "+" else -1.0) * guards[self.surface]


def surface_at(
    system: FilippovSystem,
    point: ArrayLike,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
    *,
    smooth: bool = False,
    tol: float = 1e-9,
    search: bool = False,
    flight: bool = False,
) -> tuple[LocalSurface, Array]:
    """Check the arguments of a function at a point; ``smooth`` allows a point on no surface, or a system without.

    The point of a ``search`` is near the surface, and ``mode`` has the letters of conditions and contacts. In a
    ``flight`` contacts are open, wherever the point is.
    """
    require_system(system, complementarity=True, joints=True)
    x = system.extended_point(point, t)
    p = system.parameter_vector(parameters)
    if not flight and acts(system, x, p, mode, tol):
        if search:
            found = chosen(system, surface, mode)
        else:
            found = situation(system, x, p, surface, mode, tol)
        return _element_at(system, x, p, found, smooth), x
    if system.surface_count == 0 and smooth:
        if surface or mode:
            raise DefinitionError(
                f"surface and mode: received {surface!r} and {mode!r}, but the system has no surface. "
                "Leave them out."
            )
        return LocalSurface(system, 0, "", p), x
    require_surface(system)
    system.surface_function(surface)  # refuses a wrong index
    letters = list(_signs(system, x, p, surface) if mode is None else mode)
    if mode is not None:
        system.require_mode(mode)
    letters[surface] = "s"
    if letters.count("s") > 1:
        raise DefinitionError(
            f"mode {''.join(letters)!r}: expected one sliding surface, received "
            f"{letters.count('s')}. Give + or - to the others; for several sliding surfaces use "
            "sliding_branches or intersection_range."
        )
    return LocalSurface(system, int(surface), "".join(letters), p), x


def _element_at(
    system: FilippovSystem, x: Array, p: Array, found: Situation, smooth: bool
) -> LocalSurface:
    """The surface, condition or contact at a point, with the others held."""
    if found.element is None and not smooth:
        raise PointError(
            f"point {x.tolist()}: expected a point on a surface or where a condition or contact opens or closes, received "
            f"one inside the mode {found.mode!r}. find_equilibrium(system, near, mode={found.mode!r}) goes to where it rests."
        )
    element = one_surface(system, found.mode, found.element)
    return LocalSurface(element.system, 0, "" if found.element is None else "s", p, element)


def _signs(system: FilippovSystem, x: Array, p: Array, surface: int) -> str:
    if system.surface_count == 1:
        return "s"
    values = _switches(system, x, p).tolist()
    for i, value in enumerate(values):
        if i != surface and value == 0:
            if values[surface]:
                raise PointError(
                    f"point {x}: expected a point on surface {surface}, received one on surface {i}. Give surface={i}, or "
                    "the side with mode=, one letter per surface."
                )
            raise PointError(
                f"point {x}: expected a side of surface {i}, received a point on surfaces "
                f"{surface} and {i}. Choose the side with mode=, one letter per surface."
            )
    return "".join("+" if value > 0 else "-" for value in values)


def _switches(system: FilippovSystem, x: Array, p: Array) -> Array:
    if not system.surface_count:
        return np.zeros(0)

    def build() -> Sequence[Any]:
        return [system.surface_function(i) for i in range(system.surface_count)]

    return np.array([v.item() for v in call(system.function(("local", "surfaces"), build), x, p)])


def on_surface(where: LocalSurface, x: Array, tol: float, slopes: bool = True) -> Numbers:
    """Evaluate as ``finite_at`` does at a point whose distance from the surface is at most ``tol (1 + |x|)``."""
    numbers = where.finite_at(x, slopes)
    if not np.any(numbers.gradient):
        raise PointError(
            f"point {x}: expected a regular point of surface {where.surface}, received grad h = "
            "0. The zero set of h is not a surface there; write h with a nonzero gradient."
        )
    if numbers.distance > tol * (1 + np.linalg.norm(x)):
        foot = x - numbers.h * numbers.gradient / (numbers.gradient @ numbers.gradient)
        raise PointError(
            f"point {x}: expected a point on surface {where.surface}, h = 0, received h = "
            f"{numbers.h:.6g} (about {numbers.distance:.3g} away). The nearest point of the "
            f"surface is about {foot.tolist()} (one Newton step along grad h; repeat it where the "
            "surface is curved), or raise tol."
        )
    return numbers
