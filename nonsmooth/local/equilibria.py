"""Equilibria of the two fields and of the sliding field, found by Newton's method in R^n.

A pseudo-equilibrium is a zero of the sliding field: h = 0 and (1 - alpha) F1 + alpha F2 = 0 with
0 < alpha < 1, so F1 and F2 point in opposite directions. Its stability along the surface is that of
the n - 1 eigenvalues of Dg on the tangent space, g = (L2 F1 - L1 F2)/(L2 - L1); across the surface
it is that of the sliding region (Filippov 1988, sec. 17-19; Kuznetsov, Rinaldi & Gragnani 2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model import (
    Array,
    DefinitionError,
    FilippovSystem,
    NonsmoothError,
    OptionError,
    Parameters,
    PointError,
    explain,
    real_array,
)
from .folds import Side
from .lie import TOLERANCE, Numbers, Place, place
from .newton import Root, solve
from .regions import Region, region_of

#: Eigenvalues whose real part is below this, relative to the largest, decide nothing.
HYPERBOLIC = 1e-9
SIDES: tuple[Side, Side] = ("above", "below")


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A zero of one of the two fields.

    Attributes
    ----------
    point : ndarray (n,)
    side : {"above", "below"}
        Of the field F1 (h > 0) or F2 (h < 0).
    status : {"real", "virtual", "boundary"}
        Whether it is on its field's own side, on the other side, or on the surface.
    kind : str
        ``"stable node"``, ``"unstable focus"``, ``"saddle"``, ...; ``"degenerate"`` if an
        eigenvalue has no real part.
    eigenvalues : ndarray (n,)
        Of DF_i, by real part.
    h : float
    margin : float
        Smallest real part relative to the largest modulus: distance from a degenerate one.
    distance : float
        From the start of the search.
    residual : float
    iterations : int
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

    def __str__(self) -> str:
        field = "F1 (above)" if self.side == "above" else "F2 (below)"
        values = ", ".join(f"{v:.6g}" for v in self.eigenvalues)
        return (
            f"{self.status} {self.kind} of {field} at {self.point.tolist()}, h = {self.h:.6g}, "
            f"eigenvalues {values}."
        )


@dataclass(frozen=True, eq=False)
class PseudoEquilibrium:
    """A zero of the sliding field.

    Attributes
    ----------
    point : ndarray (n,)
    alpha : float
        Weight of F2; in (0, 1) for a real one.
    status : {"real", "virtual"}
        Virtual if alpha is outside (0, 1): the fields are parallel there, not opposite.
    region : Region
    kind : str
        ``"stable pseudo-node"``, ``"unstable pseudo-node"``, ``"pseudo-saddle"``, with complex
        eigenvalues ``"stable pseudo-focus"``, ...; ``"pseudo-saddle-node"`` or ``"degenerate"``
        where the sliding flow decides nothing.
    eigenvalues : ndarray (n - 1,)
        Of the sliding field on the tangent space of the surface, by real part.
    stable : bool
        Attracting from the surface and along it.
    margin : float
        Smallest of: alpha, 1 - alpha, the real parts relative to the largest modulus of DF_i.
    distance, residual : float
    iterations : int
    """

    point: Array
    alpha: float
    status: str
    region: Region
    kind: str
    eigenvalues: NDArray[Any]
    stable: bool
    margin: float
    distance: float
    residual: float
    iterations: int

    def __str__(self) -> str:
        values = ", ".join(f"{v:.6g}" for v in self.eigenvalues) or "none"
        return (
            f"{self.status} {self.kind} at {self.point.tolist()} in {self.region}, "
            f"alpha = {self.alpha:.6g}, eigenvalues along the surface {values}."
        )


# numbers ---------------------------------------------------------------------------------------


def jacobians(where: Place, x: Array) -> Array:
    """DF1 and DF2 at a point; (2, N, N)."""
    system, modes = where.system, (where.side("+"), where.side("-"))
    size = system.extended_dimension

    def build() -> Sequence[Any]:
        fields = [system.field(mode) for mode in modes]
        return [system.gradient(f[i]) for f in fields for i in range(size)]

    function = system.function(("jacobians", where.surface, where.mode), build)
    rows = [np.array(row, dtype=float).ravel() for row in function.call([x, where.parameters])]
    return np.array(rows).reshape(2, size, size)


def sliding_matrix(numbers: Numbers, derivatives: Array) -> tuple[Array, Array]:
    """Dg on the tangent space at a pseudo-equilibrium (n-1, n-1), and an orthonormal basis (n, n-1).

    Dg = (L2 DF1 - L1 DF2 + F1 (grad L2)^T - F2 (grad L1)^T)/(L2 - L1), where g = 0.
    """
    (f1, f2), (l1, l2) = numbers.fields, numbers.lie
    (g1, g2), (d1, d2) = numbers.lie_gradients, derivatives
    dg = (l2 * d1 - l1 * d2 + np.outer(f1, g2) - np.outer(f2, g1)) / (l2 - l1)
    basis = tangent_basis(numbers.gradient)
    return basis.T @ dg @ basis, basis


def tangent_basis(gradient: Array) -> Array:
    """Orthonormal basis of the tangent space of a surface (n, n-1); in the plane (g_y, -g_x)."""
    if gradient.size == 2:
        return np.array([[gradient[1]], [-gradient[0]]]) / np.linalg.norm(gradient)
    return np.linalg.svd(gradient[None, :])[2][1:].T


def equilibrium_distance(field: Array, derivative: Array, x: Array) -> float:
    """How far the next zero of a field is, to first order, relative to 1 + |x|.

    Infinite where the linearised equations have no solution.
    """
    length, size = 1 + float(np.linalg.norm(x)), float(np.linalg.norm(derivative, 2))
    norm = float(np.linalg.norm(field))
    if norm <= TOLERANCE * size * length or norm == 0.0:
        return norm / (size * length) if norm else 0.0
    step = np.linalg.lstsq(derivative, -field, rcond=1e-12)[0]
    if np.linalg.norm(derivative @ step + field) > 0.5 * norm:
        return float("inf")
    return float(np.linalg.norm(step)) / length


def _sorted(matrix: Array) -> NDArray[Any]:
    values = np.linalg.eigvals(matrix) if matrix.size else np.zeros(0)
    return np.array(sorted(values, key=lambda v: (v.real, v.imag)))


def kind_of(eigenvalues: NDArray[Any], scale: float) -> tuple[str, float]:
    """Name an equilibrium by its eigenvalues; also the smallest real part over ``scale``."""
    real = eigenvalues.real
    margin = float(np.min(np.abs(real))) / scale if scale > 0 else 0.0
    if margin <= HYPERBOLIC:
        return "degenerate", margin
    shape = "focus" if np.any(np.abs(eigenvalues.imag) > 0) else "node"
    if np.all(real < 0):
        return f"stable {shape}", margin
    return (f"unstable {shape}", margin) if np.all(real > 0) else ("saddle", margin)


def _require_autonomous(system: FilippovSystem, what: str) -> None:
    if system.time_dependent:
        raise DefinitionError(
            explain(
                what,
                expected="a system without explicit time",
                received=f"one that depends on {system.extended_states[-1]}",
                advice="Make the time a state, or freeze it at a value.",
            )
        )


def require_linear(system: FilippovSystem, surface: int, what: str) -> None:
    """Refuse a multiplier that enters nonlinearly: alpha would not be Filippov's."""
    if system.nonlinear[surface]:
        raise DefinitionError(
            explain(
                what,
                expected=f"multiplier {surface} to enter the field linearly",
                received="hidden dynamics",
                advice="The sliding field is then not a convex combination of two fields; follow "
                "it with simulate.",
            )
        )


# searches --------------------------------------------------------------------------------------


def find_equilibrium(
    system: FilippovSystem,
    near: ArrayLike,
    *,
    side: Side = "above",
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
        As in :func:`region`; the point need not be on the surface.
    near : array_like (n,)
    side : {"above", "below"}
        Of the field F1 or F2.
    tol : float, optional
        Accepted residual (a distance), relative to 1 + |x|.
    max_iterations : int, optional

    Returns
    -------
    Equilibrium

    Raises
    ------
    ConvergenceError
        With ``residual`` and ``point``, the last iterate.
    PointError, ParameterError, DefinitionError, OptionError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[y - x, 1 - 2 * y], below=[1, 1])
    >>> found = find_equilibrium(s, [1.0, 1.0])
    >>> found.point, found.status, found.kind
    (array([0.5, 0.5]), 'real', 'stable node')
    """
    _require_autonomous(system, "equilibrium")
    where, x = place(system, near, parameters, 0.0, surface, mode)
    k = side_index(side)

    def equations(u: Array) -> tuple[Array, Array]:
        return where.at(u).fields[k], jacobians(where, u)[k]

    root = solve(equations, x, tol=tol, max_iterations=max_iterations, what=f"equilibrium {side}")
    return _equilibrium(where, root, side, float(np.linalg.norm(root.x - x)))


def side_index(side: str) -> int:
    """0 for ``"above"`` and 1 for ``"below"``.

    Raises
    ------
    DefinitionError
    """
    if side not in SIDES:
        raise DefinitionError(
            explain(
                "side",
                expected="'above' (F1, h > 0) or 'below' (F2, h < 0)",
                received=repr(side),
                advice="An equilibrium belongs to one of the two fields.",
            )
        )
    return SIDES.index(side)


def _equilibrium(where: Place, root: Root, side: Side, distance: float) -> Equilibrium:
    k, x = side_index(side), root.x
    numbers = where.at(x)
    eigenvalues = _sorted(jacobians(where, x)[k])
    kind, margin = kind_of(eigenvalues, float(np.max(np.abs(eigenvalues))))
    if numbers.distance <= TOLERANCE * (1 + float(np.linalg.norm(x))):
        status = "boundary"
    else:
        status = "real" if (numbers.h > 0) == (side == "above") else "virtual"
    return Equilibrium(
        x,
        side,
        status,
        kind,
        eigenvalues,
        numbers.h,
        margin,
        distance,
        root.residual,
        root.iterations,
    )


def find_pseudo_equilibrium(
    system: FilippovSystem,
    near: ArrayLike,
    *,
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-12,
    max_iterations: int = 50,
) -> PseudoEquilibrium:
    """Find a pseudo-equilibrium close to a point: h = 0 and (1 - alpha) F1 + alpha F2 = 0.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`; the point need not be on the surface.
    near : array_like (n,)
    tol : float, optional
        Accepted residual (a distance), relative to 1 + |x|.
    max_iterations : int, optional

    Returns
    -------
    PseudoEquilibrium
        Check its ``status``: where alpha is outside (0, 1) the fields are parallel and orbits
        cross.

    Raises
    ------
    ConvergenceError
        With ``residual`` and ``point``, the last iterate.
    DefinitionError
        Explicit time, or hidden dynamics.
    PointError, ParameterError, OptionError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> relay = ns.FilippovSystem(
    ...     [x, y], surface=x + y, above=[y - x, 3 * y - 10], below=[y - x, 3 * y + 10])
    >>> print(find_pseudo_equilibrium(relay, [0.5, -0.4]).kind)
    stable pseudo-node
    """
    _require_autonomous(system, "pseudo-equilibrium")
    where, x = place(system, near, parameters, 0.0, surface, mode)
    require_linear(system, surface, "pseudo-equilibrium")
    numbers = where.finite_at(x)
    n, (l1, l2) = x.size, numbers.lie
    alpha = float(np.clip(l1 / (l1 - l2), 0.0, 1.0)) if l1 != l2 else 0.5

    def equations(u: Array) -> tuple[Array, Array]:
        at, derivatives = where.at(u[:n]), jacobians(where, u[:n])
        f1, f2 = at.fields
        values = np.append((1 - u[n]) * f1 + u[n] * f2, at.h)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = (1 - u[n]) * derivatives[0] + u[n] * derivatives[1]
        matrix[:n, n] = f2 - f1
        matrix[n, :n] = at.gradient
        return values, matrix

    root = solve(
        equations,
        np.append(x, alpha),
        tol=tol,
        max_iterations=max_iterations,
        what="pseudo-equilibrium",
    )
    return pseudo_equilibrium_at(where, root.x[:n], x, root)


def pseudo_equilibrium_at(
    where: Place, x: Array, start: Array, root: Root | None = None
) -> PseudoEquilibrium:
    """Describe the pseudo-equilibrium at a known point."""
    numbers, derivatives = where.finite_at(x), jacobians(where, x)
    l1, l2 = numbers.lie
    if l1 == l2:
        raise PointError(
            explain(
                f"pseudo-equilibrium at {x.tolist()}",
                expected="L1 != L2",
                received=f"L1 = L2 = {l1:.6g}",
                advice="The sliding field is not defined there (a fold-fold or a boundary "
                "equilibrium): classify(system, point) names it.",
            )
        )
    alpha = float(l1 / (l1 - l2))
    matrix, _ = sliding_matrix(numbers, derivatives)
    eigenvalues = _sorted(matrix)
    scale = float(max(np.linalg.norm(d, 2) for d in derivatives)) or 1.0
    kind, margin = kind_of(eigenvalues, scale) if eigenvalues.size else ("stable node", np.inf)
    region = region_of(numbers, TOLERANCE)
    real = 0.0 < alpha < 1.0
    return PseudoEquilibrium(
        point=x,
        alpha=alpha,
        status="real" if real else "virtual",
        region=region,
        kind=_pseudo_kind(kind, region),
        eigenvalues=eigenvalues,
        stable=region is Region.ATTRACTING and kind.startswith("stable"),
        margin=min(abs(alpha), abs(1 - alpha), margin),
        distance=float(np.linalg.norm(x - start)),
        residual=numbers.distance if root is None else root.residual,
        iterations=0 if root is None else root.iterations,
    )


def _pseudo_kind(kind: str, region: Region) -> str:
    """Kind of the sliding flow and stability across the surface, together."""
    if kind == "degenerate":
        return "pseudo-saddle-node"
    stability, _, shape = kind.partition(" ")
    across = {Region.ATTRACTING: "stable", Region.REPELLING: "unstable"}.get(region, stability)
    return f"{stability} pseudo-{shape}" if stability == across else "pseudo-saddle"


def find_boundary_equilibrium(
    system: FilippovSystem,
    near: ArrayLike,
    *,
    vary: str,
    side: Side = "above",
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-11,
    max_iterations: int = 50,
) -> tuple[Array, float]:
    """Find the value of a parameter at which an equilibrium of one field is on the surface.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`; the point need not be on the surface.
    near : array_like (n,)
    vary : str
        Name of the parameter; the search starts from its value in ``parameters``.
    side : {"above", "below"}
    tol : float, optional
    max_iterations : int, optional

    Returns
    -------
    point : ndarray (n,)
    value : float
        Of the parameter.

    Raises
    ------
    ConvergenceError, DefinitionError, PointError, ParameterError, OptionError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y, mu = (ca.SX.sym(s) for s in ("x", "y", "mu"))
    >>> s = ns.FilippovSystem(
    ...     [x, y], surface=y, above=[y - x, mu - 1 - y], below=[1, 1], parameters={mu: 0.0})
    >>> point, value = find_boundary_equilibrium(s, [0.1, 0.1], vary="mu")
    >>> (abs(point).round(12) + 0.0).tolist(), round(value, 12)
    ([0.0, 0.0], 1.0)
    """
    _require_autonomous(system, "boundary equilibrium")
    where, x = place(system, near, parameters, 0.0, surface, mode)
    k = side_index(side)
    if vary not in system.parameter_names:
        raise DefinitionError(
            explain(
                "vary",
                expected=f"a parameter among {list(system.parameter_names)}",
                received=repr(vary),
                advice="An equilibrium is on the surface at isolated values of a parameter.",
            )
        )
    j, n = system.parameter_names.index(vary), x.size

    def at(value: float) -> Place:
        p = where.parameters.copy()
        p[j] = value
        return replace(where, parameters=p)

    def values(u: Array, parameter: float) -> Array:
        numbers = at(parameter).at(u[:n])
        return np.append(numbers.fields[k], numbers.h)

    def equations(u: Array) -> tuple[Array, Array]:
        here, step = at(u[n]), 1e-5 * (1 + abs(u[n]))
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = jacobians(here, u[:n])[k]
        matrix[n, :n] = here.at(u[:n]).gradient
        matrix[:, n] = (values(u, u[n] + step) - values(u, u[n] - step)) / (2 * step)
        return values(u, u[n]), matrix

    start = np.append(x, where.parameters[j])
    what = f"boundary equilibrium {side}"
    root = solve(equations, start, tol=tol, max_iterations=max_iterations, what=what)
    return root.x[:n], float(root.x[n])


def find_all(search: Any, starts: ArrayLike, *, apart: float = 1e-6) -> list[Any]:
    """Results of a search from many starts, each once; starts that lead nowhere are left out.

    Parameters
    ----------
    search : callable
        Takes a start (n,), returns an object with a ``point``, e.g. ``lambda x:
        find_equilibrium(system, x, side="below")``.
    starts : array_like (k, n)
    apart : float, optional
        Two results closer than this, relative to 1 + |x|, are the same.

    Returns
    -------
    list

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[x**2 - 1, -y], below=[1, 1])
    >>> found = find_all(lambda p: find_equilibrium(s, p), [[-2, 0], [-1, 1], [0.5, 0], [3, 1]])
    >>> [e.kind for e in found]
    ['stable node', 'saddle']
    """
    found: list[Any] = []
    if not callable(search):
        raise OptionError(
            explain(
                "search",
                expected="a function of a start",
                received=repr(search),
                advice="For example lambda x: nonsmooth.find_fold(system, x).",
            )
        )
    for start in np.atleast_2d(real_array(starts, "starts")):
        try:
            result = search(start)
        except NonsmoothError:
            continue
        near = apart * (1 + float(np.linalg.norm(result.point)))
        if all(np.linalg.norm(result.point - other.point) > near for other in found):
            found.append(result)
    return found
