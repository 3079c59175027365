"""Pseudo-equilibria: zeros of the sliding field g = (L2 F1 - L1 F2)/(L2 - L1).

There h = 0 and (1 - alpha) F1 + alpha F2 = 0 with 0 < alpha < 1, so F1 and F2 point in opposite
directions. Stability along the surface is that of the n - 1 eigenvalues of Dg on the tangent space;
across the surface it is that of the sliding region (Filippov 1988, sec. 17-19; Kuznetsov, Rinaldi &
Gragnani 2003). On k surfaces that meet f(x, lambda) = 0 with one multiplier each
(``intersection_equilibria``).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..model import Array, FilippovSystem, Parameters, PointError, explain, require_system
from .checks import require_autonomous, require_linear
from .equilibria import by_real_part, kind_of
from .intersection_equilibria import find_on_intersection, sliding_in
from .numbers import Numbers
from .place import TOLERANCE, Place, place
from .pseudo_equilibrium import PseudoEquilibrium, pseudo_kind
from .regions import Region, region_of
from .search import Found, search


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
        as ``"ss+"``, looks on the intersection of those surfaces.
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
    require_system(system)
    require_autonomous(system, "pseudo-equilibrium")
    if mode is not None and sliding_in(system, mode) > 1:
        return find_on_intersection(
            system, near, mode, parameters, tol=tol, max_iterations=max_iterations
        )
    where, x = place(system, near, parameters, 0.0, surface, mode)
    require_linear(system, surface, "pseudo-equilibrium")
    numbers = where.finite_at(x)
    n, (l1, l2) = x.size, numbers.lie
    alpha = float(np.clip(l1 / (l1 - l2), 0.0, 1.0)) if l1 != l2 else 0.5

    def equations(u: Array) -> tuple[Array, Array]:
        at, derivatives = where.at(u[:n]), where.jacobians(u[:n])
        f1, f2 = at.fields
        values = np.append((1 - u[n]) * f1 + u[n] * f2, at.h)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = (1 - u[n]) * derivatives[0] + u[n] * derivatives[1]
        matrix[:n, n] = f2 - f1
        matrix[n, :n] = at.gradient
        return values, matrix

    found = search(
        equations,
        np.append(x, alpha),
        tol=tol,
        max_iterations=max_iterations,
        what="pseudo-equilibrium",
    )
    away = float(np.linalg.norm(found.x[:n] - x))
    return pseudo_equilibrium_at(where, replace(found, x=found.x[:n], distance=away))


def pseudo_equilibrium_at(where: Place, found: Found) -> PseudoEquilibrium:
    """Describe the pseudo-equilibrium at a point where the sliding field vanishes."""
    x = found.x
    numbers, derivatives = where.finite_at(x), where.jacobians(x)
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
        distance=found.distance,
        residual=found.residual,
        iterations=found.iterations,
        mode=where.mode,
        multipliers=np.array([1.0 - 2.0 * alpha]),
    )


# along the surface -----------------------------------------------------------------------------


def sliding_matrix(numbers: Numbers, derivatives: Array) -> tuple[Array, Array]:
    """Dg on the tangent space at a pseudo-equilibrium (n-1, n-1), and an orthonormal basis (n, n-1).

    Dg = (L2 DF1 - L1 DF2 + F1 (grad L2)^T - F2 (grad L1)^T)/(L2 - L1), where g = 0.
    """
    (f1, f2), (l1, l2) = numbers.fields, numbers.lie
    (g1, g2), (d1, d2) = numbers.lie_gradients, derivatives
    dg = (l2 * d1 - l1 * d2 + np.outer(f1, g2) - np.outer(f2, g1)) / (l2 - l1)
    basis = numbers.tangents
    return basis.T @ dg @ basis, basis


def sliding_expansion(where: Place, numbers: Numbers) -> tuple[float, float]:
    """Slope and second derivative of the planar sliding speed at a pseudo-equilibrium.

    g = c1 x + c2 x^2 + ... in the tangent coordinate; c1 = 0 != c2 is a pseudo-saddle-node.

    Returns
    -------
    c1, c2 : float
    """
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
