"""Pseudo-equilibria: zeros of the sliding field g = (L2 F1 - L1 F2)/(L2 - L1).

There h = 0 and (1 - alpha) F1 + alpha F2 = 0 with 0 < alpha < 1, so F1 and F2 point in opposite
directions. Stability along the surface is that of the n - 1 eigenvalues of Dg on the tangent space;
across the surface it is that of the sliding region (Filippov 1988, sec. 17-19; Kuznetsov, Rinaldi &
Gragnani 2003). Where k surfaces meet, f(x, lambda) = 0 with one multiplier for each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...model import (
    Array,
    DefinitionError,
    FilippovSystem,
    LayerNumbers,
    Parameters,
    PointError,
    layer_of,
)
from ...result_tables import Tabular
from ..checks import require_autonomous, require_generic, require_linear
from ..discrete_states import with_discrete_states_held
from ..point.intersections import Meeting
from ..point.regions import Region, region_of
from ..point.surface_point import TOLERANCE, LocalSurface, Numbers, surface_at
from .equilibria import Equilibrium, by_real_part, kind_of
from .search import Found, search


@dataclass(frozen=True, eq=False)
class PseudoEquilibrium(Tabular):
    """A zero of the sliding field.

    Attributes
    ----------
    point : ndarray (n,)
        The point, in the order of the states.
    alpha : float
        Weight of $F2$; in (0, 1) for a real one. NaN on several surfaces.
    status : {"real", "virtual"}
        Virtual if $alpha$ is outside (0, 1): the fields are parallel there, not opposite. On several
        surfaces: if a multiplier is outside (-1, 1).
    region : Region or None
        On several surfaces: whether sliding along their intersection attracts or repels, else MIXED. None for rest
        between two forces, without sliding, on branches of :func:`continue_equilibrium`.
    kind : str
        ``"stable pseudo-node"``, ``"unstable pseudo-node"``, ``"pseudo-saddle"``, with complex
        eigenvalues ``"stable pseudo-focus"``, ...; ``"pseudo-saddle-node"`` or ``"degenerate"``
        where the sliding flow decides nothing.
    eigenvalues : ndarray (n - k,)
        Of the sliding field on the tangent space of the surface ($k = 1$) or of k that meet, by real part.
    stable : bool
        Attracting from the surface and along it.
    margin : float
        Smallest of: $alpha$, $1 - alpha$, the real parts relative to the largest modulus of $D F_i$.
    distance, residual : float
        Distance from the start of the search, and what is left of the equations.
    iterations : int
        Iterations that Newton's method took; 0 where nothing was searched.
    mode : str
        One letter for each surface, ``s`` for those that slide.
    multipliers : ndarray (k,)
        Of those, $1 - 2 alpha$ on one surface.
    """

    point: Array
    alpha: float
    status: str
    region: Region | None
    kind: str
    eigenvalues: NDArray[Any]
    stable: bool
    margin: float
    distance: float
    residual: float
    iterations: int
    mode: str
    multipliers: Array

    def __str__(self) -> str:
        values = ", ".join(f"{v:.6g}" for v in self.eigenvalues) or "none"
        weights, surface = f"alpha = {self.alpha:.6g}", "the surface"
        if self.multipliers.size > 1:
            weights = f"multipliers {', '.join(f'{v:.6g}' for v in self.multipliers)}"
            surface = f"the intersection {self.mode}"
        where = f"{self.status} {self.kind} at {self.point.tolist()}"
        if self.region is None:
            return f"{where}, {weights}."
        return f"{where} in {self.region}, {weights}, eigenvalues along {surface} {values}."


def pseudo_kind(kind: str, region: Region) -> str:
    """Kind of the sliding flow and stability across the surface, together."""
    if kind == "degenerate":
        return "pseudo-saddle-node"
    stability, _, shape = kind.partition(" ")
    across = {Region.ATTRACTING: "stable", Region.REPELLING: "unstable"}.get(region, stability)
    return f"{stability} pseudo-{shape}" if stability == across else "pseudo-saddle"


@with_discrete_states_held
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
    """Find a pseudo-equilibrium close to a point: $h = 0$ and $(1 - alpha) F1 + alpha F2 = 0$.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`; the point need not be on the surface. A ``mode`` with several ``s``, such
        as ``"ss+"``, searches the intersection of those surfaces.
    near : array_like (n,)
        Where the search starts.
    tol : float, optional
        Accepted residual (a distance), relative to $1 + |x|$.
    max_iterations : int, optional
        Newton's method gives up after this many.

    Returns
    -------
    PseudoEquilibrium
        Check its ``status``: where $alpha$ is outside (0, 1) the fields are parallel and orbits
        cross.

    Raises
    ------
    ConvergenceError
        Newton's method does not converge from this start; ``residual`` and ``point`` are the last ones.
    DefinitionError
        Explicit time, hidden dynamics or vector multipliers; no surface; a ``mode`` or ``surface`` that
        the system does not have.
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
    >>> relay = ns.FilippovSystem(
    ...     [x, y], surface=x + y, above=[y - x, 3 * y - 10], below=[y - x, 3 * y + 10])
    >>> print(find_pseudo_equilibrium(relay, [0.5, -0.4]).kind)
    stable pseudo-node

    Two genes that switch each other off, and a third that both switch on:

    >>> a, b, z = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("z")
    >>> genes = ns.FilippovSystem(
    ...     [x, y, z], field=[-a - x, -b - y, a + b + 1 - z], multipliers=[a, b], surfaces=[x, y])
    >>> found = find_pseudo_equilibrium(genes, [0.1, 0.1, 0.5], mode="ss")
    >>> found.kind, (found.point.round(9) + 0.0).tolist(), found.eigenvalues.round(9).tolist()
    ('stable pseudo-node', [0.0, 0.0, 1.0], [-1.0])
    """
    require_autonomous(system, "pseudo-equilibrium", elements=True)
    plain = not (system.complementarity or system.constraints)
    if mode is not None and plain and sliding_in(system, mode) > 1:
        return find_on_intersection(
            system, near, mode, parameters, tol=tol, max_iterations=max_iterations
        )
    where, x = surface_at(system, near, parameters, 0.0, surface, mode, search=True)
    if where.one_sided:
        raise DefinitionError(
            f"surface {surface} is the boundary of a condition or contact. find_equilibrium(system, near, mode=...) with "
            "its letter c finds where it rests."
        )
    require_linear(system, surface, "pseudo-equilibrium")
    require_generic(where.system, where.surface, where.mode, "pseudo-equilibrium")
    numbers = where.finite_at(x)
    n, (l1, l2), everywhere = x.size, numbers.lie, where.free
    alpha = float(np.clip(l1 / (l1 - l2), 0.0, 1.0)) if l1 != l2 else 0.5

    def equations(u: Array) -> tuple[Array, Array]:
        at, derivatives = everywhere.at(u[:n]), everywhere.jacobians(u[:n])
        f1, f2 = at.fields
        values = np.append((1 - u[n]) * f1 + u[n] * f2, at.h)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = (1 - u[n]) * derivatives[0] + u[n] * derivatives[1]
        matrix[:n, n] = f2 - f1
        matrix[n, :n] = at.gradient
        return values, matrix

    found = search(
        where.with_kept(equations, velocities=True),
        np.append(x, alpha),
        tol=tol,
        max_iterations=max_iterations,
        what="pseudo-equilibrium",
    )
    away = float(np.linalg.norm(found.x[:n] - x))
    return pseudo_equilibrium_at(where, replace(found, x=found.x[:n], distance=away))


def pseudo_equilibrium_at(where: LocalSurface, found: Found) -> PseudoEquilibrium:
    """Describe the pseudo-equilibrium at a point where the sliding field vanishes."""
    x = found.x
    numbers, derivatives = where.finite_at(x), where.jacobians(x)
    l1, l2 = numbers.lie
    if l1 == l2:
        raise PointError(
            f"pseudo-equilibrium at {x.tolist()}: expected L1 != L2, received L1 = L2 = {l1:.6g}. "
            "The sliding field is not defined there (a fold-fold or a boundary equilibrium): "
            "classify(system, point) names it."
        )
    alpha = float(l1 / (l1 - l2))
    matrix, _ = sliding_matrix(numbers, derivatives)
    eigenvalues = by_real_part(matrix)
    scale = float(max(np.linalg.norm(d, 2) for d in derivatives)) or 1.0
    kind, margin = kind_of(eigenvalues, scale) if eigenvalues.size else ("stable node", np.inf)
    region = region_of(numbers, TOLERANCE)
    real = 0.0 < alpha < 1.0
    return PseudoEquilibrium(
        point=x,
        alpha=alpha,
        status="real" if real else "virtual",
        region=region,
        kind=pseudo_kind(kind, region),
        eigenvalues=eigenvalues,
        stable=region is Region.ATTRACTING and kind.startswith("stable"),
        margin=min(abs(alpha), abs(1 - alpha), margin),
        **found.effort,
        mode=where.mode,
        multipliers=np.array([1.0 - 2.0 * alpha]),
    )


def closed_equilibrium(found: Equilibrium) -> PseudoEquilibrium:
    """The same of a condition that rests while it is closed: a zero of the limit of sliding."""
    nothing = found.eigenvalues.size == 0
    kind = "stable pseudo-node" if nothing else pseudo_kind(found.kind, Region.ATTRACTING)
    return PseudoEquilibrium(
        point=found.point,
        alpha=float("nan"),
        status="real" if found.status == "real" else "virtual",
        region=Region.ATTRACTING,
        kind=kind,
        eigenvalues=found.eigenvalues,
        stable=kind.startswith("stable"),
        margin=found.margin,
        distance=found.distance,
        residual=found.residual,
        iterations=found.iterations,
        mode=found.mode,
        multipliers=np.array([found.h]),
    )


# along the surface -----------------------------------------------------------------------------


def sliding_matrix(numbers: Numbers, derivatives: Array) -> tuple[Array, Array]:
    """Dg on the tangent space at a pseudo-equilibrium (n-1, n-1), and its basis (n, n-1)."""
    # Dg = (L2 DF1 - L1 DF2 + F1 (grad L2)^T - F2 (grad L1)^T)/(L2 - L1), where g = 0.
    (f1, f2), (l1, l2) = numbers.fields, numbers.lie
    (g1, g2), (d1, d2) = numbers.lie_gradients, derivatives
    dg = (l2 * d1 - l1 * d2 + np.outer(f1, g2) - np.outer(f2, g1)) / (l2 - l1)
    basis = numbers.tangents
    return basis.T @ dg @ basis, basis


def sliding_expansion(where: LocalSurface, numbers: Numbers) -> tuple[float, float]:
    """Slope and second derivative of the planar sliding speed at a pseudo-equilibrium."""
    # g = c1 x + c2 x^2 + ... in the tangent coordinate; c1 = 0 != c2 is a pseudo-saddle-node.
    x, (l1, l2) = numbers.x, numbers.lie
    tangent = numbers.tangents[:, 0]
    square = float(numbers.gradient @ numbers.gradient)
    derivatives = where.jacobians(x)
    (f1, f2), (g1, g2) = numbers.fields, numbers.lie_gradients
    matrix = l2 * derivatives[0] - l1 * derivatives[1] + np.outer(f1, g2) - np.outer(f2, g1)
    hessians, numerator = where.hessians(x)
    bending = -float(tangent @ hessians[0] @ tangent) / square * numbers.gradient
    slope = float(tangent @ matrix @ tangent)
    second = np.einsum("i,ijk,j,k->", tangent, numerator, tangent, tangent)
    second += float(tangent @ matrix @ bending)
    # d/dx of the denominator matters at second order only through the slope, zero where it counts
    drift = float((g2 - g1) @ tangent) / (l2 - l1)
    c1 = slope / (l2 - l1)
    return c1, float(0.5 * second / (l2 - l1) - c1 * drift)


# where several surfaces meet ---------------------------------------------------------------------

#: Stability of sliding across the intersection, in the terms of one surface.
_REGIONS = {
    "attracting": Region.ATTRACTING,
    "spiralling in": Region.ATTRACTING,
    "repelling": Region.REPELLING,
    "spiralling out": Region.REPELLING,
}


def sliding_in(system: FilippovSystem, mode: str) -> int:
    """Number of sliding surfaces of a mode, checked."""
    return system.parse_mode(mode).count(0)


def find_on_intersection(
    system: FilippovSystem,
    near: ArrayLike,
    mode: str,
    parameters: Parameters | None,
    *,
    tol: float,
    max_iterations: int,
) -> PseudoEquilibrium:
    """Find a pseudo-equilibrium on the surfaces that slide in a mode."""
    x, p = system.extended_point(near, 0.0), system.parameter_vector(parameters)
    letters = np.array(system.parse_mode(mode), float)
    chosen, n = np.flatnonzero(letters == 0.0), x.size
    if chosen.size > n:
        raise DefinitionError(
            f"mode {mode!r}: expected at most {n} surfaces that meet in a space of {n} states, "
            f"received {chosen.size}. Give + or - to the others."
        )
    layer = layer_of(system)

    def multipliers(u: Array) -> Array:
        values = letters.copy()
        values[chosen] = u[n:]
        return values

    def equations(u: Array) -> tuple[Array, Array]:
        at = layer.at(u[:n], multipliers(u), p)
        matrix = np.zeros((n + chosen.size, n + chosen.size))
        matrix[:n, :n], matrix[:n, n:] = at.field_x, at.field_l[:, chosen]
        matrix[n:, :n] = at.h_x[chosen]
        return np.concatenate([at.field, at.h[chosen]]), matrix

    first = layer.at(x, letters, p)
    slope = first.rates_l[np.ix_(chosen, chosen)]
    guess = np.clip(np.linalg.lstsq(slope, -first.rates[chosen], rcond=None)[0], -1.0, 1.0)
    what = "pseudo-equilibrium"
    start = np.concatenate([x, guess])
    found = search(equations, start, tol=tol, max_iterations=max_iterations, what=what)
    away = float(np.linalg.norm(found.x[:n] - x))
    meeting = Meeting(system, found.x[:n], p, chosen.tolist(), letters)
    return equilibrium_of(meeting, found.x[n:], replace(found, x=found.x[:n], distance=away))


def equilibrium_of(meeting: Meeting, multipliers: Array, found: Found) -> PseudoEquilibrium:
    """Describe the pseudo-equilibrium at a point of an intersection where the sliding flow vanishes."""
    chosen = meeting.surfaces
    lam = meeting.held.copy()
    lam[chosen] = multipliers
    at = meeting.at(lam)
    eigenvalues = by_real_part(along_intersection(at, chosen)[0])
    across = meeting.attraction(lam)
    region = _REGIONS.get(across, Region.MIXED)
    scale = float(np.linalg.norm(at.field_x, 2)) or 1.0
    layer = np.linalg.eigvals(at.rates_l[np.ix_(chosen, chosen)])
    kind, margin = _kind(eigenvalues, layer, region, scale)
    inside = float(np.min(1.0 - np.abs(multipliers)))
    return PseudoEquilibrium(
        point=found.x,
        alpha=float("nan"),
        status="real" if inside > 0.0 else "virtual",
        region=region,
        kind=kind if region is not Region.MIXED else f"{kind}, {across}",
        eigenvalues=eigenvalues,
        stable=region is Region.ATTRACTING and inside > 0.0 and kind.startswith("stable"),
        margin=min(abs(inside), margin),
        **found.effort,
        mode="".join("s" if i in chosen else "+" if v > 0 else "-" for i, v in enumerate(lam)),
        multipliers=multipliers,
    )


def _kind(
    eigenvalues: NDArray[Any], layer: NDArray[Any], region: Region, scale: float
) -> tuple[str, float]:
    """Kind by the eigenvalues along the intersection, or by the layer if there are none."""
    if eigenvalues.size:
        along, margin = kind_of(eigenvalues, scale)
        return pseudo_kind(along, region), margin
    shape = "focus" if np.any(np.abs(layer.imag) > 0.0) else "node"
    stability = {Region.ATTRACTING: "stable ", Region.REPELLING: "unstable "}.get(region, "")
    return f"{stability}pseudo-{shape}", float("inf")


def along_intersection(at: LayerNumbers, surfaces: list[int]) -> tuple[Array, Array]:
    """D(f(x, lambda(x))) on the tangent space (N-k, N-k), where f = 0, and its basis (N, N-k)."""
    # lambda_x = -(dG/dlambda)^-1 dG/dx, with G the rates of the surfaces.
    gradient = at.h_x[surfaces]
    basis = np.linalg.svd(gradient)[2][len(surfaces) :].T
    if not basis.size:
        return np.zeros((0, 0)), basis
    slope = at.rates_l[np.ix_(surfaces, surfaces)]
    if np.linalg.cond(slope) * TOLERANCE > 1.0:
        raise PointError(
            "pseudo-equilibrium on an intersection: expected multipliers that are determined by "
            f"the rates of the surfaces, received d(rates)/d(multipliers) = {slope.tolist()}, "
            "singular. The sliding flow is not defined there."
        )
    drift = np.linalg.solve(slope, at.rates_x[surfaces])
    whole = at.field_x - at.field_l[:, surfaces] @ drift
    return basis.T @ whole @ basis, basis
