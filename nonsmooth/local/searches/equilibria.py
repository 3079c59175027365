"""Equilibria of the two fields: their search by Newton's method, and their kind by eigenvalues."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import Array, FilippovSystem, OptionError, Parameters, call
from ...model.derivatives.mode_derivatives import mode_equations
from ...result_tables import Tabular
from ..checks import require_autonomous
from ..discrete_states import with_discrete_states_held
from ..point.surface_point import (
    FIELDS,
    TOLERANCE,
    LocalSurface,
    Side,
    null_space,
    side_index,
    surface_at,
)
from .search import Found, search

#: Eigenvalues whose real part is below this, relative to the largest, decide nothing.
HYPERBOLIC = 1e-9


@dataclass(frozen=True, eq=False)
class Equilibrium(Tabular):
    """A zero of one of the two fields, or of a smooth system's one field.

    Attributes
    ----------
    point : ndarray (n,)
        The point, in the order of the states.
    side : {"+", "-"}
        Of the field $F1$ above the surface or $F2$ below it; ``"+"`` for a smooth system.
    status : {"real", "virtual", "boundary"}
        Whether it is on its field's own side, on the other side of a surface or behind a contact, or on the surface or
        contact. Also virtual where a stop or reset of the discrete state is due at once.
    kind : str
        ``"stable node"``, ``"unstable focus"``, ``"saddle"``, ...; ``"degenerate"`` if an
        eigenvalue has no real part.
    eigenvalues : ndarray (n,)
        Of DF_i, by real part.
    h : float
        Value of the switching function there: on which side it is, and how far; inf without one.
    margin : float
        Smallest real part relative to the largest modulus: distance from a degenerate one.
    distance : float
        From the start of the search.
    residual : float
        What is left of the equations at the point.
    iterations : int
        Iterations that Newton's method took; 0 where nothing was searched.
    mode : str
        Whose field: one letter for each surface.
    """

    point: Array
    side: Side
    status: str
    kind: str
    eigenvalues: NDArray[Any]
    h: float
    margin: float
    distance: float
    residual: float
    iterations: int
    mode: str

    def __str__(self) -> str:
        values = ", ".join(f"{v:.6g}" for v in self.eigenvalues)
        if not self.mode:
            status = "" if self.status == "real" else f"{self.status} "
            return f"{status}{self.kind} at {self.point.tolist()}, eigenvalues {values}."
        where = f"mode {self.mode!r}" if set(self.mode) & set("ocs") else FIELDS[self.side]
        return (
            f"{self.status} {self.kind} of {where} at {self.point.tolist()}, h = {self.h:.6g}, "
            f"eigenvalues {values}."
        )


def equilibrium_distance(field: Array, derivative: Array, x: Array) -> float:
    """Distance of the next zero of a field to first order over 1 + |x|; inf if there is none."""
    length, size = 1 + float(np.linalg.norm(x)), float(np.linalg.norm(derivative, 2))
    norm = float(np.linalg.norm(field))
    if norm <= TOLERANCE * size * length or norm == 0.0:
        return norm / (size * length) if norm else 0.0
    step = np.linalg.lstsq(derivative, -field, rcond=1e-12)[0]
    if np.linalg.norm(derivative @ step + field) > 0.5 * norm:
        return float("inf")
    return float(np.linalg.norm(step)) / length


def by_real_part(matrix: Array) -> NDArray[Any]:
    """Eigenvalues, ascending by real part."""
    values = np.linalg.eigvals(matrix) if matrix.size else np.zeros(0)
    return np.array(sorted(values, key=lambda v: (v.real, v.imag)))


def kind_of(eigenvalues: NDArray[Any], scale: float) -> tuple[str, float]:
    """Name an equilibrium by its eigenvalues; also the smallest real part over ``scale``."""
    real = eigenvalues.real
    if not real.size:  # what is kept leaves no direction
        return "stable node", math.inf
    margin = float(np.min(np.abs(real))) / scale if scale > 0 else 0.0
    if margin <= HYPERBOLIC:
        return "degenerate", margin
    shape = "focus" if np.any(np.abs(eigenvalues.imag) > 0) else "node"
    if np.all(real < 0):
        return f"stable {shape}", margin
    return (f"unstable {shape}", margin) if np.all(real > 0) else ("saddle", margin)


@with_discrete_states_held
def find_equilibrium(
    system: FilippovSystem,
    near: ArrayLike,
    *,
    side: Side = "+",
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-12,
    max_iterations: int = 50,
) -> Equilibrium:
    """Find an equilibrium of one field close to a point, on whichever side of the surface it is.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`; the point need not be on the surface. A smooth system has none. With complementarity
        conditions, constraints or closed contacts ``mode`` has all letters, also those of sliding and closed elements;
        without the letters of contacts these are open.
    near : array_like (n,)
        Where the search starts.
    side : {"+", "-"}
        Of the field $F1$ or $F2$; a smooth system has one field, of ``"+"``.
    tol : float, optional
        Accepted residual (a distance), relative to $1 + |x|$.
    max_iterations : int, optional
        Newton's method gives up after this many.

    Returns
    -------
    Equilibrium
        The equilibrium found, with its eigenvalues.

    Raises
    ------
    ConvergenceError
        Newton's method does not converge from this start; ``residual`` and ``point`` are the last ones.
    DefinitionError
        Explicit time or vector multipliers; a ``mode``, ``surface`` or ``side`` that the system does
        not have.
    PointError
        A start of a wrong shape or not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    OptionError
        ``tol`` or ``max_iterations`` is not positive.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[y - x, 1 - 2 * y], below=[1, 1])
    >>> found = find_equilibrium(s, [1.0, 1.0])
    >>> found.point, found.status, found.kind
    (array([0.5, 0.5]), 'real', 'stable node')
    """
    k = side_index(side)
    if isinstance(system, FilippovSystem) and needs_mode(system, mode):
        return _of_mode(system, near, mode, parameters, tol, max_iterations)
    require_autonomous(system, "equilibrium")
    where, x = surface_at(system, near, parameters, 0.0, surface, mode, smooth=True, flight=True)
    if not system.surface_count and side != "+":
        raise OptionError(
            f"side: expected '+', as a smooth system has one field, received {side!r}. Leave it out."
        )

    def equations(u: Array) -> tuple[Array, Array]:
        return where.at(u).fields[k], where.jacobians(u)[k]

    what = f"equilibrium of {FIELDS[side]}" if where.mode else "equilibrium"
    found = search(equations, x, tol=tol, max_iterations=max_iterations, what=what)
    return equilibrium_at(where, found, side)


def needs_mode(system: FilippovSystem, mode: str | None) -> bool:
    """Whether a mode must have letters of sliding and closed elements, or has them."""
    if system.complementarity or system.constraints:
        return True
    return bool(system.impacts) and mode is not None and len(mode) > len(system.entries)


def _of_mode(
    system: FilippovSystem,
    near: ArrayLike,
    mode: str | None,
    parameters: Parameters | None,
    tol: float,
    max_iterations: int,
) -> Equilibrium:
    """An equilibrium of the field of a mode, whose conditions keep some functions at zero."""
    require_autonomous(system, "equilibrium", elements=True)
    if mode is None and len(system.modes) == 1 and not system.impacts:
        mode = system.modes[0]
    if mode is None:
        raise OptionError(
            f"mode: expected letters, received none. Give one of {list(system.modes)}: in which mode the "
            "equilibrium is."
        )
    p, n = system.parameter_vector(parameters), system.dimension
    numbers = mode_equations(system, mode)

    def equations(u: Array) -> tuple[Array, Array]:
        field, slope, h, gradient, *_ = numbers.copied(u, p)
        rows = gradient.reshape(-1, n)
        along = null_space(rows).T if len(rows) else np.eye(n)
        values = np.concatenate([along @ field.ravel(), h.ravel()])
        return values, np.vstack([along @ slope, rows])

    start = system.extended_point(near, 0.0)
    what = f"equilibrium of mode {mode!r}"
    found = search(equations, start, tol=tol, max_iterations=max_iterations, what=what)
    return equilibrium_of_mode(system, mode, found, p)


def equilibrium_of_mode(system: FilippovSystem, mode: str, found: Found, p: Array) -> Equilibrium:
    """Describe the equilibrium at a point where the field of a mode and what it keeps vanish."""
    n = system.dimension
    _, slope, _, gradient, guards, *_ = mode_equations(system, mode).copied(found.x, p)
    along = null_space(gradient) if gradient.size else np.eye(n)
    eigenvalues = by_real_part(along.T @ slope @ along)
    scale = float(np.max(np.abs(eigenvalues), initial=0.0))
    kind, margin = kind_of(eigenvalues, scale)
    least = float(guards.min(initial=np.inf))
    near_zero = abs(least) <= TOLERANCE * (1 + float(np.linalg.norm(found.x)))
    status = "boundary" if near_zero else "real" if least > 0.0 else "virtual"
    return Equilibrium(
        found.x, "+", status, kind, eigenvalues, least, margin, **found.effort, mode=mode
    )


def equilibrium_at(where: LocalSurface, found: Found, side: Side) -> Equilibrium:
    """Describe the equilibrium at a point where a field vanishes."""
    x, numbers = found.x, where.at(found.x)
    eigenvalues = by_real_part(where.jacobians(x)[side_index(side)])
    kind, margin = kind_of(eigenvalues, float(np.max(np.abs(eigenvalues))))
    h, mode = (numbers.h if where.mode else np.inf), where.side(side)
    if not where.mode:
        status = "real"
    elif numbers.distance <= TOLERANCE * (1 + float(np.linalg.norm(x))):
        status = "boundary"
    else:
        signs = np.where(where.switches(x) > 0, "+", "-")
        status = "real" if "".join(signs) == mode else "virtual"
    gap, touching = _least_gap(where, x), TOLERANCE * (1 + float(np.linalg.norm(x)))
    if gap <= touching and status != "virtual":
        status = "boundary" if gap >= -touching else "virtual"
    return Equilibrium(x, side, status, kind, eigenvalues, h, margin, **found.effort, mode=mode)


def _least_gap(where: LocalSurface, x: Array) -> float:
    """Of the contacts, at a point; inf without one."""
    system = where.system
    if not system.impacts:
        return math.inf
    function = system.function(("gaps",), lambda: [system.definition.gaps])
    return float(np.min(call(function, x, where.parameters)[0]))
