"""Planar catalogue: boundary equilibria, fold-folds and pseudo-saddle-nodes, each with its margin.

Boundary equilibrium: F1 = A x + ... vanishes on h = 0 where F2 = E. With C = grad h, d = C.E and
s = C A^-1 E, s < 0 is persistence and s > 0 a nonsmooth fold (di Bernardo, Budd, Champneys &
Kowalczyk 2008, ch. 5, in any dimension). In the plane the equilibrium's type splits these into BF1
to BF5 (focus), BN1, BN2 (stable node), BS1 to BS3 (saddle) after Kuznetsov, Rinaldi & Gragnani
2003, and UN1, UN2 (unstable node, Hogan, Homer, Jeffrey & Szalai 2016). The table is for d > 0;
d < 0 is its time reversal (A, E -> -A, -E).

Fold-fold: F1 = (a1, b1 x), F2 = (a2, b2 x) in a tangent coordinate x: VV1, VV2, VI1 to VI3, II1, II2
by visibility and directions; only VI with opposite directions needs the sizes.

Every class has margins: dimensionless distances from the boundaries where it changes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model import Array, DefinitionError, FilippovSystem, Parameters, PointError, explain
from .equilibria import equilibrium_distance, jacobians, require_linear, side_index, tangent_basis
from .folds import Side
from .lie import Numbers, Place, on_surface, place, positive

#: A class whose margin is below this is not named.
MARGIN = 1e-6


@dataclass(frozen=True, eq=False)
class BoundaryEquilibrium:
    """An equilibrium of one field on the surface, and the bifurcation that it is.

    Attributes
    ----------
    point : ndarray (n,)
    side : {"above", "below"}
        Whose equilibrium: of F1 or F2.
    label : str
        In the plane ``"BF1"`` ... ``"BF5"``, ``"BN1"``, ``"BN2"``, ``"UN1"``, ``"UN2"``,
        ``"BS1"`` ... ``"BS3"``; otherwise ``"persistence"`` or ``"nonsmooth fold"``;
        ``"degenerate"`` if the margin is below the tolerance.
    unfolding : {"persistence", "nonsmooth fold"}
        Whether the equilibrium turns into a pseudo-equilibrium, or they annihilate.
    time_reversed : bool
        The other field points away from the equilibrium's side (d < 0): the class is that of the
        system with time reversed.
    eigenvalues : ndarray (n,)
        Of the field's linear part A.
    numbers : mapping
        ``d`` and ``s``; in the plane ``trace``, ``determinant``; ``landing`` (BF2, BF3) or
        ``unstable`` (BS1, BS2) and ``pseudo``, all in units of L_i along the surface for a unit
        shift of the equilibrium.
    margins : mapping
        Distance from each boundary of the class.
    """

    point: Array
    side: Side
    label: str
    unfolding: str
    time_reversed: bool
    eigenvalues: NDArray[Any]
    numbers: Mapping[str, float]
    margins: Mapping[str, float]

    @property
    def margin(self) -> float:
        """Smallest of the margins."""
        return min(self.margins.values())


@dataclass(frozen=True, eq=False)
class FoldFold:
    """A point of a planar system where both fields are tangent to the surface.

    Attributes
    ----------
    point : ndarray (2,)
    label : str
        ``"VV1"``, ``"VV2"``, ``"VI1"``, ``"VI2"``, ``"VI3"``, ``"II1"``, ``"II2"``, or
        ``"degenerate"``.
    visible : (bool, bool)
        Of the folds of F1 and F2.
    same_direction : bool
    numbers : mapping
        ``L11``, ``L22``, ``a1``, ``a2``, ``b1``, ``b2``; for II2 also ``stability``: positive if
        the fused focus is stable (its pseudo-Hopf cycle is then stable too).
    margins : mapping
    """

    point: Array
    label: str
    visible: tuple[bool, bool]
    same_direction: bool
    numbers: Mapping[str, float]
    margins: Mapping[str, float]

    @property
    def margin(self) -> float:
        """Smallest of the margins."""
        return min(self.margins.values())


# Boundary equilibria ---------------------------------------------------------------------------


def boundary_equilibrium(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    side: Side | None = None,
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-9,
    margin: float = MARGIN,
) -> BoundaryEquilibrium:
    """Describe the equilibrium of one field at a point of the surface.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`.
    point : array_like (n,)
    side : {"above", "below"}, optional
        Whose equilibrium; by default the field that vanishes there.
    tol : float, optional
        How far away the zero of the field may be, relative to 1 + |x|.
    margin : float, optional
        Below this distance from a change of class the label is ``"degenerate"``.

    Returns
    -------
    BoundaryEquilibrium

    Raises
    ------
    PointError
        Neither field vanishes there, or the point is off the surface.
    DefinitionError, ParameterError, OptionError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[-x - y, x - y], below=[1, 1])
    >>> found = boundary_equilibrium(s, [0, 0])
    >>> found.label, found.unfolding
    ('BF4', 'persistence')
    """
    positive(tol, "tol"), positive(margin, "margin")
    where, x = place(system, point, parameters, 0.0, surface, mode)
    require_linear(system, surface, "boundary equilibrium")
    numbers, derivatives = on_surface(where, x, tol), jacobians(where, x)
    found = [
        equilibrium_distance(f, d, x) for f, d in zip(numbers.fields, derivatives, strict=True)
    ]
    k = int(np.argmin(found)) if side is None else side_index(side)
    if found[k] > tol:
        raise PointError(
            explain(
                f"point {x}",
                expected=f"an equilibrium of a field (to {tol:.1e})",
                received=f"F1 = {numbers.fields[0].tolist()}, F2 = {numbers.fields[1].tolist()}; "
                f"the nearest zero is about {found[k]:.3g} away",
                advice="find_boundary_equilibrium(system, near, vary=parameter) finds one.",
            )
        )
    return boundary_equilibrium_of(
        x, k, numbers.gradient, numbers.fields[1 - k], derivatives[k], margin
    )


def boundary_equilibrium_of(
    x: Array, k: int, gradient: Array, other: Array, a: Array, margin: float = MARGIN
) -> BoundaryEquilibrium:
    """Class from the linear data: grad h, the other field and the linear part of field ``k``."""
    c = gradient if k == 0 else -gradient  # towards the equilibrium's own side
    eigenvalues = np.linalg.eigvals(a)
    singular = np.linalg.svd(a, compute_uv=False)
    margins = {"determinant": float(singular[-1] / singular[0]) if singular[0] else 0.0}
    d = float(c @ other)
    margins["d"] = _sine(c, other)
    reversed_time = d < 0
    values = {"d": d, "s": math.nan}
    if margins["determinant"] > 1e-14:
        inverse: Array = np.asarray(np.linalg.solve(a, other), dtype=np.float64)
        values["s"] = s = float(c @ inverse)
        margins["s"] = _sine(c, inverse)
        unfolding = "nonsmooth fold" if s > 0 else "persistence"
        label = unfolding
        if x.size == 2:
            sign = -1.0 if reversed_time else 1.0
            label, more = _planar_class(sign * a, c, sign * d, s, margins)
            values.update(more)
    else:
        label = unfolding = "degenerate"
    if min(margins.values()) < margin:
        label = "degenerate"
    side: Side = "above" if k == 0 else "below"
    return BoundaryEquilibrium(
        x,
        side,
        label,
        unfolding,
        reversed_time,
        eigenvalues,
        MappingProxyType(values),
        MappingProxyType(margins),
    )


def _sine(u: Array, v: Array) -> float:
    lengths = float(np.linalg.norm(u) * np.linalg.norm(v))
    return abs(float(u @ v)) / lengths if lengths else 0.0


def _planar_class(
    a: Array, c: Array, d: float, s: float, margins: dict[str, float]
) -> tuple[str, dict[str, float]]:
    """Name for d > 0; adds the planar margins."""
    trace, det = float(np.trace(a)), float(np.linalg.det(a))
    size = float(np.linalg.norm(a, 2))
    disc = trace**2 - 4 * det
    ca = c @ a
    margins["fold"] = abs(float(ca[0] * c[1] - ca[1] * c[0])) / float(
        (np.linalg.norm(ca) * np.linalg.norm(c)) or 1.0
    )
    numbers = {"trace": trace, "determinant": det, "pseudo": -d / s if s else math.nan}
    if det < 0:
        if s < 0:
            return "BS3", numbers
        unstable = 0.5 * (trace + math.sqrt(disc))
        numbers["unstable"] = -unstable
        margins["W^u meets the pseudo-node"] = _ratio(d / s, unstable)
        return ("BS1" if d / s < unstable else "BS2"), numbers
    margins["trace"] = abs(trace) / size
    margins["focus or node"] = abs(disc) / (trace**2 + 4 * det)
    if disc > 0:
        name = "BN" if trace < 0 else "UN"
        return f"{name}{1 if s < 0 else 2}", numbers
    if trace < 0:
        return ("BF4" if s < 0 else "BF5"), numbers
    if s < 0:
        return "BF1", numbers
    landing = fold_orbit_landing(0.5 * trace, 0.5 * math.sqrt(-disc))
    numbers["landing"] = landing
    margins["fold orbit meets the pseudo-saddle"] = _ratio(d / s, -landing)
    return ("BF2" if -landing < d / s else "BF3"), numbers


def _ratio(u: float, v: float) -> float:
    return abs(u - v) / (abs(u) + abs(v))


def fold_orbit_landing(rho: float, omega: float) -> float:
    """L1 where the orbit from the visible fold of an unstable focus comes back to the surface.

    The focus is a unit of h above the surface. Along the orbit h - 1 =
    -exp(rho t) (cos wt - (rho/w) sin wt), which is -1 again once in (pi/w, 2 pi/w).

    Parameters
    ----------
    rho, omega : float
        Eigenvalues rho +- i omega of the focus, both positive.

    Returns
    -------
    float
        Negative: in the sliding region if the other field points up.

    Examples
    --------
    The pseudo-saddle of A = [[r, -1], [1, r]], F2 = (c, 1) is met at c = r - (1 + r^2)/|landing|:

    >>> [round(r + (1 + r**2) / fold_orbit_landing(r, 1.0), 12) for r in (0.1, 0.3)]
    [-0.586212601033, 0.052559241308]
    """
    q = rho / omega

    def miss(u: float) -> float:  # divided by exp(q u), which overflows for a strong focus
        return math.cos(u) - q * math.sin(u) - math.exp(-q * u)

    from scipy.optimize import brentq

    root = brentq(miss, math.pi, 2 * math.pi, xtol=4e-16, rtol=1e-15)
    return math.exp(min(q * root, 700.0)) * (rho * q + omega) * math.sin(root)


# Fold-folds ------------------------------------------------------------------------------------


def fold_fold(
    system: FilippovSystem,
    point: ArrayLike,
    *,
    parameters: Parameters | None = None,
    surface: int = 0,
    mode: str | None = None,
    tol: float = 1e-9,
    margin: float = MARGIN,
) -> FoldFold:
    """Describe the fold-fold of a planar system at a point where L1 = L2 = 0.

    Parameters
    ----------
    system, parameters, surface, mode
        As in :func:`region`.
    point : array_like (2,)
    tol : float, optional
        Largest angle of a field with the surface, and relative distance from it.
    margin : float, optional
        Below this distance from a change of class the label is ``"degenerate"``.

    Returns
    -------
    FoldFold

    Raises
    ------
    DefinitionError
        Not a planar system; explicit time.
    PointError
        The fields are not both tangent there.
    ParameterError, OptionError

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> s = ns.FilippovSystem([x, y], surface=y, above=[1, -x], below=[-1, -x])
    >>> fold_fold(s, [0, 0]).label
    'II2'
    """
    positive(tol, "tol"), positive(margin, "margin")
    require_planar(system, "fold-fold")
    where, x = place(system, point, parameters, 0.0, surface, mode)
    numbers = on_surface(where, x, tol)
    if np.any(np.abs(numbers.angles) > tol):
        raise PointError(
            explain(
                f"point {x}",
                expected="a fold-fold, L1 = L2 = 0",
                received=f"L1 = {numbers.lie[0]:.6g}, L2 = {numbers.lie[1]:.6g}",
                advice="In the plane fold-folds happen at isolated values of a parameter.",
            )
        )
    return fold_fold_of(where, numbers, margin)


def require_planar(system: FilippovSystem, what: str) -> None:
    """Refuse a system that is not planar and autonomous."""
    if system.extended_dimension != 2:
        size = f"{system.dimension} states{' and time' if system.time_dependent else ''}"
        raise DefinitionError(
            explain(
                what,
                expected="a planar system without explicit time",
                received=size,
                advice="In three and more dimensions two folds meet in a two-fold: find_two_fold.",
            )
        )


def fold_fold_of(where: Place, numbers: Numbers, margin: float = MARGIN) -> FoldFold:
    """Class from the numbers at the point; F1 and F2 must not vanish."""
    tangent = tangent_basis(numbers.gradient)[:, 0]
    a = numbers.fields @ tangent
    b = numbers.lie_gradients @ tangent
    second = a * b  # L11, L22: the fields are tangent
    visible = (bool(second[0] > 0), bool(second[1] < 0))
    same = bool(a[0] * a[1] > 0)
    margins = {f"L{k + 1}{k + 1}": bend(numbers, k, float(second[k])) for k in (0, 1)}
    names = ("L11", "L22", "a1", "a2", "b1", "b2")
    values = dict(zip(names, map(float, (*second, *a, *b)), strict=True))
    if visible[0] == visible[1]:
        label = ("VV" if visible[0] else "II") + ("1" if same else "2")
    elif same:
        label = "VI1"
    else:
        seen, unseen = (0, 1) if visible[0] else (1, 0)
        saddle, node = abs(a[unseen] * b[seen]), abs(a[seen] * b[unseen])
        margins["a2 b1 = a1 b2"] = _ratio(saddle, node)
        label = "VI2" if saddle > node else "VI3"
    if label == "II2" and min(margins.values()) > 0:
        values["stability"] = fused_focus(where, numbers)
    if min(margins.values()) < margin:
        label = "degenerate"
    return FoldFold(
        numbers.x, label, visible, same, MappingProxyType(values), MappingProxyType(margins)
    )


def bend(numbers: Numbers, k: int, second: float) -> float:
    """Curvature of an orbit of field k against the surface, times 1 + |x|: zero at a cusp."""
    speed, slope = float(np.linalg.norm(numbers.fields[k])), float(np.linalg.norm(numbers.gradient))
    return abs(second) / (speed**2 * slope) * (1 + float(np.linalg.norm(numbers.x)))


def second_derivatives(where: Place, x: Array) -> tuple[Array, Array]:
    """Hessians of h, L1, L2 (3, N, N) and of the numerator L2 F1 - L1 F2 of sliding (N, N, N)."""
    system, size = where.system, where.system.extended_dimension
    above, below = where.side("+"), where.side("-")

    def build() -> Sequence[Any]:
        lie = [system.lie_derivative([mode], where.surface) for mode in (above, below)]
        f1, f2 = system.field(above), system.field(below)
        numerator = [lie[1] * f1[i] - lie[0] * f2[i] for i in range(size)]
        gradients = [
            system.gradient(e) for e in (system.surface_function(where.surface), *lie, *numerator)
        ]
        return [system.gradient(g[i]) for g in gradients for i in range(size)]

    function = system.function(("second", where.surface, where.mode), build)
    rows = [np.array(row, dtype=float).ravel() for row in function.call([x, where.parameters])]
    hessians = np.array(rows).reshape(3 + size, size, size)
    return hessians[:3], hessians[3:]


def fused_focus(where: Place, numbers: Numbers) -> float:
    """Stability of a fused focus (II2): positive if orbits spiral in.

    A flight of the field (a + p x + q y, b x + r x^2 + s y) maps x to -x + beta x^2 with
    beta = 2 (b p + b s - a r)/(3 a b); one flight each gives x + (beta2 - beta1) x^2.
    """
    tangent = tangent_basis(numbers.gradient)[:, 0]
    gradient, square = numbers.gradient, float(numbers.gradient @ numbers.gradient)
    hessians, _ = second_derivatives(where, numbers.x)
    derivatives = jacobians(where, numbers.x)
    curvature = float(tangent @ hessians[0] @ tangent) / square  # of the surface, times grad h
    betas = []
    for k in (0, 1):
        a = float(numbers.fields[k] @ tangent)
        b = float(numbers.lie_gradients[k] @ tangent)
        p = float(tangent @ derivatives[k] @ tangent)
        s = float(numbers.lie_gradients[k] @ gradient) / square
        along = float(tangent @ hessians[1 + k] @ tangent)
        r = 0.5 * (along - curvature * float(gradient @ numbers.lie_gradients[k]))
        betas.append(2 * (b * p + b * s - a * r) / (3 * a * b))
    return float(np.sign(numbers.fields[0] @ tangent)) * (betas[1] - betas[0])


# Pseudo-saddle-nodes ---------------------------------------------------------------------------


def sliding_expansion(where: Place, numbers: Numbers) -> tuple[float, float]:
    """Slope and second derivative of the planar sliding speed at a pseudo-equilibrium.

    g = c1 x + c2 x^2 + ... in the tangent coordinate; c1 = 0 != c2 is a pseudo-saddle-node.

    Returns
    -------
    c1, c2 : float
    """
    x, (l1, l2) = numbers.x, numbers.lie
    tangent = tangent_basis(numbers.gradient)[:, 0]
    square = float(numbers.gradient @ numbers.gradient)
    derivatives = jacobians(where, x)
    (f1, f2), (g1, g2) = numbers.fields, numbers.lie_gradients
    matrix = l2 * derivatives[0] - l1 * derivatives[1] + np.outer(f1, g2) - np.outer(f2, g1)
    hessians, numerator = second_derivatives(where, x)
    bending = -float(tangent @ hessians[0] @ tangent) / square * numbers.gradient
    slope = float(tangent @ matrix @ tangent)
    second = np.einsum("i,ijk,j,k->", tangent, numerator, tangent, tangent)
    second += float(tangent @ matrix @ bending)
    # d/dx of the denominator matters at second order only through the slope, zero where it counts
    drift = float((g2 - g1) @ tangent) / (l2 - l1)
    c1 = slope / (l2 - l1)
    return c1, float(0.5 * second / (l2 - l1) - c1 * drift)
